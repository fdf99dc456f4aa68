"""The words in YAML, in what `dump_config` logs, and in what the autotuner prints at its end."""

from __future__ import annotations

import re
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.esphome.words import FIELDS
from heatertune.plc.parallel.text import number_of
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, wrong
from heatertune.plc.single_precision import single

__all__ = ["from_text"]

#: what the logger writes before a line, colours included
_LOGGED: Final = re.compile(r"^(?:\x1b\[[\d;]*m)?(?:\[[^\]]*\])*(?:\x1b\[[\d;]*m)?:?\s*")
_ENTRY: Final = re.compile(r"([A-Za-z_]+):\s*([^\s,#]+)\s*(?:#.*)?")
_DUMPED: Final = re.compile(r"kp: ([^\s,]+), ki: ([^\s,]+), kd: ([^\s,]+)(?:, output samples: (\S+))?")
_RULE: Final = re.compile(r"Rule '")
_TIMES: Final = {"ms": 1.0, "s": 1000.0, "sec": 1000.0, "min": 60000.0}
_TIME: Final = re.compile(r"([\d.]+)\s*([a-z]+)")
_FIELDS: Final = {field.name: field for field in FIELDS}
#: what the schema takes where nothing is written
_USUAL: Final[dict[str, Number]] = {
    "ki": 0.0, "kd": 0.0, "min_integral": -1.0, "max_integral": 1.0, "derivative_averaging_samples": 1}
#: what is not held here → the only value that changes nothing
_OTHERS: Final = {"output_averaging_samples": 1.0, "starting_integral_term": 0.0}
_REFUSED: Final = ("deadband_parameters", "cool_output", "threshold_high", "threshold_low", "max_power", "min_power")


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text; what the schema has a default for need not be there.

    Raises:
        InputError: no kp, a word there with two values or no number, no interval; a dead band, a cooler, or another
            part that is not proven here.
    """
    reader = _YamlReader(source, None if sample_time_s is None else round(1000.0 * sample_time_s))
    for line, content in lines_of(text):
        reader.take(line, _LOGGED.sub("", content).strip())
    return reader.read()


class _YamlReader:
    """The words of a text so far."""

    def __init__(self, source: str, interval_ms: int | None) -> None:
        self._source, self._interval = source, interval_ms
        self._collected, self._seen, self._after_rule = WordCollector(source, FIELDS), set[str](), False

    def take(self, line: int, content: str) -> None:
        """Take a line without what the logger writes before it."""
        if _RULE.match(content):  # one of the autotuner's other rules: not in force
            self._after_rule = True
        elif match := _DUMPED.fullmatch(content):
            if not self._after_rule:
                for name, text in zip(("kp", "ki", "kd"), match.groups()[:3], strict=True):
                    self._put(line, name, text)
                self._other(line, "output_averaging_samples", match[4] or "1")
            self._after_rule = False
        elif match := _ENTRY.fullmatch(content.removeprefix("- ")):
            self._entry(line, match[1], match[2])
        elif content.removesuffix(":") in _REFUSED:
            self._other(line, content.removesuffix(":"), "")

    def _entry(self, line: int, name: str, text: str) -> None:
        if name in _OTHERS or name in _REFUSED:
            self._other(line, name, text)
        elif name == "update_interval":
            if self._interval is None:
                self._collected.put(name, _ms(text), line, text)
                self._seen.add(name)
        elif name in _FIELDS:
            self._put(line, name, text)

    def _put(self, line: int, name: str, text: str) -> None:
        number = number_of(text)
        value: Number | None = number
        if number is not None:
            whole = _FIELDS[name].format != "REAL"
            value = (int(number) if number.is_integer() else None) if whole else single(number)
        self._collected.put(name, value, line, text)
        self._seen.add(name)

    def _other(self, line: int, name: str, value: str) -> None:
        """Refuse what is not held here, but for the value that changes nothing."""
        if name in _REFUSED or number_of(value) != _OTHERS[name]:
            only = f"{_OTHERS[name]:g}" if name in _OTHERS else "nothing of it"
            raise wrong(self._source, line, name, value, f"{only}: no other is proven here")

    def read(self) -> ReadBack:
        """Return the words, with the schema's defaults where nothing is written."""
        if "kp" not in self._seen:
            raise InputError(f"{self._source}: kp is not there; expected control_parameters of ESPHome's PID climate")
        missing = [name for name in _USUAL if name not in self._seen]
        for name in missing:
            self._collected.put(name, _USUAL[name], 0, str(_USUAL[name]))
        if self._interval is not None:
            self._collected.put("update_interval", self._interval, 0, str(self._interval))
        told = (f"{name} is not there: {_USUAL[name]:g}, ESPHome's default" for name in missing)
        return ReadBack(self._collected.values(), tuple(told))


def _ms(text: str) -> int | None:
    """Return a time in whole ms, None where it is none."""
    match = _TIME.fullmatch(text)
    number = number_of(match[1]) if match else None
    if match is None or number is None or match[2] not in _TIMES:
        return None
    exact = number * _TIMES[match[2]]
    return round(exact) if abs(exact - round(exact)) < 1e-6 else None

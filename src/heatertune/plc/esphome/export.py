"""Words → YAML: the PID climate with its control_parameters, a slow_pwm output behind it.

The words in YAML, in what `dump_config` logs, and in what the autotuner prints at its end.

What the YAML sets: the climate's words, its setpoint, the boost before its output, slow_pwm's period.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.esphome.step import EspHomeAssumptions
from heatertune.plc.esphome.words import FIELDS
from heatertune.plc.exported import TextSettings
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.parallel.window import PwmWindow, window_of
from heatertune.plc.parallel.words import decimal, number_of
from heatertune.plc.ramp import Boost, Number
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, wrong
from heatertune.plc.single_precision import single
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words", "from_text", "loaders"]


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
            raise InputError(f"{self._source}: kp is missing; expected control_parameters of ESPHome's PID climate")
        missing = [name for name in _USUAL if name not in self._seen]
        for name in missing:
            self._collected.put(name, _USUAL[name], 0, str(_USUAL[name]))
        if self._interval is not None:
            self._collected.put("update_interval", self._interval, 0, str(self._interval))
        told = (f"{name} is not set: {_USUAL[name]:g}, ESPHome's default" for name in missing)
        return ReadBack(self._collected.values(), tuple(told))


def _ms(text: str) -> int | None:
    """Return a time in whole ms, None where it is none."""
    match = _TIME.fullmatch(text)
    number = number_of(match[1]) if match else None
    if match is None or number is None or match[2] not in _TIMES:
        return None
    exact = number * _TIMES[match[2]]
    return round(exact) if abs(exact - round(exact)) < 1e-6 else None


_FILE: Final = "esphome_pid.yaml"
_SETPOINT: Final = re.compile(r"^ +default_target_temperature: ([\d.+-]+)°C$", re.MULTILINE)
_PERIOD: Final = re.compile(r"^ +period: (\d+)ms$", re.MULTILINE)
_EXPORTED_BOOST: Final = re.compile(r"away > \(boosting \? ([\d.]+)f : ([\d.]+)f\)")
_THROUGH: Final = re.compile(r"^ +heat_output: heater_level$", re.MULTILINE)


def loaders(files: Mapping[str, str | bytes], assume: EspHomeAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads the file."""
    return {_FILE: lambda: _settings(str(files[_FILE]))}


def _settings(text: str) -> TextSettings:
    setpoint, period, boost = _SETPOINT.search(text), _PERIOD.search(text), _EXPORTED_BOOST.search(text)
    if setpoint is None or period is None:
        raise InputError("default_target_temperature or period is missing")
    if (boost is None) == (_THROUGH.search(text) is not None):
        raise InputError("the boost is not between climate and slow_pwm")
    distances = None if boost is None else Boost(
        within_degC=single(float(boost[1])), again_degC=single(float(boost[2])))
    return TextSettings(from_text(text, None, _FILE).values, distances, float(setpoint[1]), int(period[1]) / 1000.0)


_LEAST_PERIOD_MS = 100

_YAML = """
sensor:
  - platform: template  # TODO: your sensor, in degC; each of its values calls the PID, so no filter may lose one
    id: heater_temperature
    update_interval: {update_interval}ms
    lambda: "return NAN;"

climate:
  - platform: pid
    name: "Heater"
    id: heater_climate
    sensor: heater_temperature
    default_target_temperature: {setpoint}°C
    heat_output: {output}
    control_parameters:
{parameters}
output:
  - platform: slow_pwm
    id: heater_output
    pin: GPIO5  # TODO: yours
    period: {period}ms
{boost}"""

_BOOST = """\
  - platform: template
    id: heater_level
    type: float
    write_action:
      - lambda: |-
          // far from the setpoint: full power, and no integral part; while it is off nothing is summed up, either
          static bool boosting = true;
          const bool off = id(heater_climate).mode == climate::CLIMATE_MODE_OFF;
          const float away = id(heater_climate).target_temperature - id(heater_climate).current_temperature;
          if (!std::isnan(away)) boosting = off || (away > (boosting ? {within}f : {again}f) && !std::isinf(away));
          if (off || boosting) id(heater_climate).reset_integral_term();
          id(heater_output).set_level(boosting && !off && !std::isnan(away) ? 1.0f : state);
"""


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the file; the same words and certificate give the same bytes."""
    window = window_of(words, certificate)
    parameters = "".join(f"      {field.name}: {_text(words, field.name)}\n" for field in FIELDS
                         if field.address == "control_parameters")
    setpoint = words.scaling.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    head = "\n".join(f"# {line}" for line in _head(words, certificate, window))
    body = _YAML.format(update_interval=words.whole["update_interval"], setpoint=decimal(setpoint, "LREAL"),
                        parameters=parameters, period=max(window.period_ms, _LEAST_PERIOD_MS),
                        output="heater_output" if words.boost is None else "heater_level", boost=_boost(words))
    return {"esphome_pid.yaml": head + "\n" + body}


def _boost(words: Words) -> str:
    if words.boost is None:
        return ""
    within, again = (decimal(each, "REAL") for each in (words.boost.within_degC, words.boost.again_degC))
    return _BOOST.format(within=within, again=again)


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
    return entry_texts({field.name: _text(words, field.name) for field in FIELDS})


def _text(words: Words, name: str) -> str:
    value = words.values[name]
    return decimal(value, "REAL") if isinstance(value, float) else str(value)


def _head(words: Words, certificate: Certificate, window: PwmWindow) -> tuple[str, ...]:
    scale = words.scaling
    short = f"; slow_pwm has no period below {_LEAST_PERIOD_MS} ms" if window.period_ms < _LEAST_PERIOD_MS else ""
    least = ("; slow_pwm knows no shortest pulse or pause: the switch behind it has to"
             if window.least_on_ms or window.least_off_ms else "")
    return (
        "heater controller for ESPHome's PID climate",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s; level 1 is full power",
        *certificate.head,
        f"slow_pwm: {window.summary}{short}{least}; pulses end with a round of the loop, about 16 ms",
        "remains to be done by hand: sensor and pin; a part of your own file, not a whole one",
    )

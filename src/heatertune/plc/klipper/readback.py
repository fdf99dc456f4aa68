"""The words in printer.cfg, in its block SAVE_CONFIG, or in what PID_CALIBRATE prints."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.klipper.words import FIELDS, PLACES, USUAL
from heatertune.plc.printer_heater import KLIPPER_HEATER, UNKNOWN, several
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, wrong

__all__ = ["from_text"]

_SAVED: Final = "#*#"
_HEAD: Final = re.compile(r"\[\s*([^\]]*?)\s*\]")
_LINE: Final = re.compile(r"([A-Za-z_]\w*)\s*[:=]\s*(.*?)")
#: PID_CALIBRATE's own line; the unknown temperature before the colon is Kalico's
_PRINTED: Final = re.compile(r"pid_Kp\s*=\s*(\S+)\s+pid_Ki\s*=\s*(\S+)\s+pid_Kd\s*=\s*(\S+)", re.IGNORECASE)
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FIELDS: Final = {field.name.lower(): field for field in FIELDS}
_GAINS: Final = ("pid_Kp", "pid_Ki", "pid_Kd")


class _Line(NamedTuple):
    number: int
    section: str
    name: str
    value: str
    saved: bool


def from_text(text: str, _sample_time_s: float | None, source: str, heater: str = UNKNOWN) -> ReadBack:
    """Return the words of one heater in a text, and what else stands there.

    The block SAVE_CONFIG counts before the lines above it, as in the firmware.

    Args:
        text: of printer.cfg, or what PID_CALIBRATE prints.
        source: its name, for error messages.
        heater: which one's gains are read, a setting of `KLIPPER_HEATER`; unknown: those of the only heater.

    Raises:
        InputError: a line that is none, a gain that is missing, there with two values, no number of three decimals or
            out of its range; another control than pid; several heaters, and which one is unknown; none of this kind.
    """
    collected, printed = WordCollector(source, FIELDS), False
    for number, line in lines_of(text):
        found = _PRINTED.search(line)
        if found is not None and not line.startswith("#"):
            printed = True
            for name, value in zip(_GAINS, found.groups(), strict=True):
                collected.put(name, _number(value), number, value)
    if printed:
        return ReadBack(_with_usual(collected, set()), _told(set()))
    lines = list(_lines(text, source))
    section = _section(lines, source, heater)
    return _of_section(lines, section, collected, source)


def _lines(text: str, source: str) -> Iterator[_Line]:
    """Yield the options of all sections, without comments."""
    section, saved = "", False
    for number, line in lines_of(text):
        is_saved = line.startswith(_SAVED)
        if is_saved and not saved:
            section, saved = "", True
        code = re.split(r"[#;]", line[len(_SAVED):] if is_saved else line, maxsplit=1)[0].strip()
        head = _HEAD.fullmatch(code)
        if head is not None:
            section = " ".join(head[1].split())
            continue
        option = _LINE.fullmatch(code)
        if option is not None:
            yield _Line(number, section, option[1].lower(), option[2], is_saved)
        elif code and not is_saved and code.split()[0].lower() in _FIELDS:
            raise wrong(source, number, code.split()[0], code, "name: value")


def _section(lines: list[_Line], source: str, heater: str) -> str:
    """Return the section of the heater that is read."""
    sections = list(dict.fromkeys(line.section for line in lines if line.name in _FIELDS))
    with_gain = {line.section for line in lines if line.name == "pid_kp"}
    having = [one for one in sections if one in with_gain] or sections
    if not having:
        raise InputError(f"{source}: no gains are there; expected pid_Kp, pid_Ki and pid_Kd of a heater's section, or "
                         "what PID_CALIBRATE prints")
    kinds = [one.split(" ")[0] for one in having]
    of_it = [one for one, kind in zip(having, kinds, strict=True) if heater in (UNKNOWN, kind)]
    if len(of_it) == 1:
        return of_it[0]
    heads = " and ".join(f"[{one}]" for one in having)
    if heater != UNKNOWN:
        raise InputError(f"{source}: gains of {heads}; expected those of one [{heater}]")
    raise several(source, heads, [kind for kind in KLIPPER_HEATER.summary if kinds.count(kind) == 1])


def _of_section(lines: list[_Line], section: str, collected: WordCollector, source: str) -> ReadBack:
    own = [line for line in lines if line.section == section]
    saved = {line.name for line in own if line.saved}
    over, there = [], set()
    for line in own:
        if line.saved < (line.name in saved):
            over.append(f"{line.name}: {line.value} (line {line.number}; SAVE_CONFIG has another)")
            continue
        if line.name == "control" and line.value.lower() != "pid":
            raise wrong(source, line.number, "control", line.value, "pid")
        field = _FIELDS.get(line.name)
        if field is None:
            if line.name != "control":
                over.append(f"{line.name}: {line.value} (line {line.number})")
            continue
        collected.put(field.name, _number(line.value), line.number, line.value)
        there.add(field.name)
    others = dict.fromkeys(line.section for line in lines if line.section != section)
    over += [f"[{one}]" if one else "lines before the first section" for one in others]
    return ReadBack(_with_usual(collected, there), (*over, *_told(there)))


def _with_usual(collected: WordCollector, there: set[str]) -> dict[str, int | float]:
    for name, value in USUAL.items():
        if name not in there:
            collected.put(name, value, 0, f"{value:.{PLACES}f}")
    return collected.values()


def _told(there: set[str]) -> tuple[str, ...]:
    return tuple(f"{name}, which is not there: {value:.{PLACES}f} as in the firmware" for name, value in USUAL.items()
                 if name not in there)


def _number(text: str) -> float | None:
    return float(text) if _NUMBER.fullmatch(text) else None

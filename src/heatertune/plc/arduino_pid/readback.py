"""The words in a sketch: PID_v1's constructor, SetOutputLimits and SetSampleTime, with numbers or its constants."""

from __future__ import annotations

import re
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.arduino_pid.words import FIELDS, FULL, ON_ERROR, ON_MEASUREMENT
from heatertune.plc.parallel.text import blank_matches, number_of
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, wrong

__all__ = ["from_text"]

_COMMENT: Final = re.compile(r"/\*.*?(?:\*/|\Z)|//[^\n]*", re.DOTALL)
_PID: Final = re.compile(r"\bPID\s+(\w+)\s*\(([^()]*)\)")
_LIMITS: Final = re.compile(r"\.\s*SetOutputLimits\s*\(([^()]*)\)")
_SAMPLE: Final = re.compile(r"\.\s*SetSampleTime\s*\(([^()]*)\)")
_TUNINGS: Final = re.compile(r"\.\s*SetTunings\s*\(([^()]*)\)")
_CONSTANT: Final = re.compile(r"\b(\w+)\s*=\s*([^;,(){}]+?)\s*(?=[;,])|#\s*define\s+(\w+)\s+(\S+)")
_MODES: Final = {"P_ON_E": ON_ERROR, "P_ON_M": ON_MEASUREMENT}
#: names by which sketches call the output at full power: that of heatertune's, and the library's example
_FULLS: Final = ("Full", "WindowSize")
_FIRST_MS: Final = 100


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a sketch.

    Raises:
        InputError: no constructor of PID_v1 or several; a gain that is no number or out of its range; REVERSE; a
            lower limit other than 0; gains that the sketch changes later.
    """
    plain = blank_matches(_COMMENT, text.replace("\r\n", "\n").replace("\r", "\n"))
    made = list(_PID.finditer(plain))
    if len(made) != 1:
        what = "no constructor of PID_v1" if not made else f"{len(made)} constructors of PID_v1"
        raise InputError(f"{source}: {what}; expected one line such as PID heater(&Input, &Output, &Setpoint, 2.0, "
                         "5.0, 1.0, P_ON_E, DIRECT);")
    known = {match[1] or match[3]: match[2] or match[4] for match in _CONSTANT.finditer(plain)}
    collected, over = WordCollector(source, FIELDS), list[str]()
    line = _line(plain, made[0])
    gains, modes = _parts(made[0][2], line, source)
    for name, value in zip(("Kp", "Ki", "Kd"), gains, strict=True):
        collected.put(name, _number(value, known), line, value)
    collected.put("POn", _MODES.get(modes[0], ON_ERROR), line, modes[0])
    high = _limits(plain, known, source, collected)
    full = next((_number(name, known) for name in _FULLS if name in known), None)
    if full is None:
        over.append(f"the output at full power is not stated: the upper limit {high:g} is used")
    collected.put("Full", high if full is None else full, line, f"{full}")
    times = list(_SAMPLE.finditer(plain))
    for match in times:
        given = _number(match[1], known)
        whole = int(given) if isinstance(given, float) and given.is_integer() else given
        collected.put("SampleTime", whole, _line(plain, match), match[1])
    if not times:
        collected.put("SampleTime", _FIRST_MS, line, str(_FIRST_MS))
    for match in _TUNINGS.finditer(plain):
        raise wrong(source, _line(plain, match), "SetTunings", match[1], "gains in the constructor alone")
    return ReadBack(collected.values(), tuple(over))


def _parts(arguments: str, line: int, source: str) -> tuple[list[str], list[str]]:
    """Return the three gains and the modes of a constructor."""
    parts = [part.strip() for part in arguments.split(",")]
    modes = parts[6:]
    if len(parts) not in (7, 8) or modes[-1] != "DIRECT" or (len(modes) == 2 and modes[0] not in _MODES):
        raise wrong(source, line, "PID", arguments, "three pointers, three gains, P_ON_E or P_ON_M (or none), DIRECT")
    return parts[3:6], modes


def _limits(plain: str, known: dict[str, str], source: str, collected: WordCollector) -> float:
    """Take the upper limit and return it."""
    high, found = FULL, list(_LIMITS.finditer(plain))
    for match in found:
        ends = [_number(part.strip(), known) for part in match[1].split(",")]
        line = _line(plain, match)
        if len(ends) != 2 or ends[0] != 0.0 or ends[1] is None:
            raise wrong(source, line, "SetOutputLimits", match[1], "0 and a number: a heater has no power below 0")
        collected.put("OutMax", ends[1], line, match[1])
        high = float(ends[1])
    if not found:
        collected.put("OutMax", high, 0, str(high))
    return high


def _number(text: str, known: dict[str, str]) -> Number | None:
    """Return a number, or the constant of that name."""
    return number_of(known.get(text.strip(), text))


def _line(text: str, match: re.Match[str]) -> int:
    return text.count("\n", 0, match.start()) + 1

"""What the exported texts of firmware share: numbers, the window of time of a PWM, and whose heater gains are.

Numbers are as C and YAML write them. A window holds the switch that was proven, as numbers in the program's text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.exported import TextSettings
from heatertune.plc.open_points import OpenPoint, never
from heatertune.plc.ramp import Boost, Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import Certificate, Words

__all__ = [
    "PLACEHOLDER", "UNKNOWN", "PwmWindow", "blank_matches", "calls_open_point", "commented", "decimal",
    "heater_open_point", "number_of", "sensor_line", "setpoint_of", "settings_of", "several", "window_of",
]

_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[fFlL]?", re.ASCII)
_DIGITS: Final = 9  # of a single, so that none is another's

UNKNOWN: Final = "unknown"
#: name of a heater that is not known: a printer refuses a file that has it
PLACEHOLDER: Final = "YOUR_HEATER"

_MAKES_UP: Final = "proven was a switch that makes up what it leaves out: this program does not"


def number_of(text: str) -> float | None:
    """Return a decimal number in double precision, None where it is none or has no end."""
    plain = text.strip()
    if not _NUMBER.fullmatch(plain):
        return None
    value = float(plain.rstrip("fFlL"))
    return value if math.isfinite(value) else None


def decimal(value: Number, format_: str) -> str:
    """Return a number in plain decimals, as few as no other of its format has; no exponent, one decimal at least.

    Some of the parsers that read it (Marlin's of G-code) end a number at an E.
    """
    text = repr(float(value))
    if format_ == "REAL":
        texts = (f"{value:.{digits}g}" for digits in range(1, _DIGITS + 1))
        text = next(each for each in texts if single(float(each)) == value)
    plain = format(Decimal(text), "f")
    return plain if "." in plain else f"{plain}.0"


def blank_matches(pattern: re.Pattern[str], text: str) -> str:
    """Return a text with blanks for what a pattern matches, line for line."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def commented(sign: str, *lines: str) -> str:
    """Return lines as comments."""
    return "".join(f"{sign} {line}\n" for line in lines)


def sensor_line(words: Words, more: str) -> str:
    """Return the line of a head that tells sensor range and interval."""
    scale = words.scaling
    return f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s{more}"


def setpoint_of(words: Words, certificate: Certificate) -> str:
    """Return the proven setpoint in decimals; where none is told, the lowest temperature."""
    proven = certificate.setpoint_degC
    return decimal(words.scaling.low_degC if proven is None else proven, "LREAL")


def heater_open_point(kinds: Sequence[str], reason: str) -> OpenPoint:
    """Return the open point of the heater that the gains belong to; the settings are the firmware's names."""
    means = {name: number for number, name in enumerate((UNKNOWN, *kinds))}
    return OpenPoint(name="heater", means=means, summary=tuple(kinds), shows=never,
                     reason=f"heater that the gains belong to: {reason}")


def calls_open_point(reason: str) -> OpenPoint:
    """Return the open point of calls that come on time or late."""
    return OpenPoint(name="calls", means={"on_time": False, "late": True}, reason=reason)


def several(source: str, heads: str, kinds: Sequence[str]) -> InputError:
    """Construct the error of a text with the gains of several heaters.

    Args:
        source: name of the text.
        heads: what the text calls the heaters.
        kinds: settings of the open point `heater` that select one of them.
    """
    ways = " or ".join(f"--assume heater={kind}" for kind in kinds) or "a text without the others"
    return InputError(f"{source}: gains of {heads}; expected those of one heater: {ways}")


class PwmWindow(NamedTuple):
    """Times of a window [ms], and what is told of them."""

    period_ms: int
    step_ms: int
    least_on_ms: int
    least_off_ms: int
    summary: str


def window_of(words: Words, certificate: Certificate) -> PwmWindow:
    """Return the proven switch's window; where none is told, one of TA in steps of a hundredth."""
    switch = certificate.actuator
    if switch is None:
        period = max(1, round(1000.0 * words.sample_time_s))
        return PwmWindow(period, max(1, period // 100), 0, 0, "no switch is told: the window is TA")
    period, step, on, off = (round(1000.0 * time) for time in switch.numbers[:4])
    description = f"window of {period} ms, pulses in steps of {max(1, step)} ms"
    if switch.numbers[4]:
        description += f"; {_MAKES_UP}"
    return PwmWindow(max(1, period), max(1, step), on, off, description)


def settings_of(
    values: Mapping[str, Number], numbers: Mapping[str, float], setpoint_degC: float, boost: tuple[str, str], text: str
) -> TextSettings:
    """Return what a program sets; of a PWM that it tells to be another than proven, nothing.

    Args:
        values: of the words.
        numbers: constants of the text by name.
        setpoint_degC: [°C].
        boost: names of its two distances.
        text: of the program.

    Raises:
        OutOfRange: distances that make no boost.
        KeyError: a constant is not there.
    """
    within, again = (numbers.get(name) for name in boost)
    distances = None if within is None or again is None else Boost(within_degC=within, again_degC=again)
    period, *pulses = (numbers[name] / 1000.0 for name in ("WINDOW_MS", "STEP_MS", "LEAST_ON_MS", "LEAST_OFF_MS"))
    if _MAKES_UP in text:
        return TextSettings(values, distances, setpoint_degC)
    return TextSettings(values, distances, setpoint_degC, period, (pulses[0], pulses[1], pulses[2]))

"""The PWM that an exported program makes in windows of time: the switch that was proven, as numbers in its text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from heatertune.plc.exported import TextSettings
from heatertune.plc.ramp import Boost, Number
from heatertune.plc.words import Certificate, Words

__all__ = ["PwmWindow", "settings_of", "window_of"]

_MAKES_UP: Final = "proven was a switch that makes up what it leaves out: this program does not"


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
    told = f"window of {period} ms, pulses in steps of {max(1, step)} ms"
    if switch.numbers[4]:
        told += f"; {_MAKES_UP}"
    return PwmWindow(max(1, period), max(1, step), on, off, told)


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

"""The PWM that an exported program makes in windows of time: the switch that was proven, as numbers in its text."""

from __future__ import annotations

from typing import NamedTuple

from heatertune.plc.words import Certificate, Words

__all__ = ["Window", "window_of"]


class Window(NamedTuple):
    """Times of a window [ms], and what is told of them."""

    period_ms: int
    step_ms: int
    least_on_ms: int
    least_off_ms: int
    told: str


def window_of(words: Words, certificate: Certificate) -> Window:
    """Return the proven switch's window; where none is told, one of TA in steps of a hundredth."""
    switch = certificate.actuator
    if switch is None:
        period = max(1, round(1000.0 * words.sample_time_s))
        return Window(period, max(1, period // 100), 0, 0, "no switch is told: the window is TA")
    period, step, on, off = (round(1000.0 * time) for time in switch.numbers[:4])
    told = f"window of {period} ms, pulses in steps of {max(1, step)} ms"
    if switch.numbers[4]:
        told += "; proven was a switch that makes up what it leaves out: this program does not"
    return Window(max(1, period), max(1, step), on, off, told)

"""The PWM period of a controller that makes its pulses itself, where its words hold it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

from heatertune.plc.ramp import Number
from heatertune.plc.words import Words

__all__ = ["Cycle", "with_pwm_period"]


class Cycle(NamedTuple):
    """How words hold the PWM period.

    Attributes:
        of: values → the period [s].
        put: (values, a period [s]) → values with that period; raises OutOfRange where they can't hold it.
        periods_s: that they can hold, rising [s].
    """

    of: Callable[[Mapping[str, Number]], float]
    put: Callable[[Mapping[str, Number], float], Mapping[str, Number]]
    periods_s: tuple[float, ...]


def with_pwm_period(cycle: Cycle | None, words: Words, pwm_period_s: float | None) -> Words:
    """Return words with a PWM period [s]; as they are where none is given, or none is in them.

    Raises:
        OutOfRange: one that they can't hold.
    """
    if cycle is None or pwm_period_s is None:
        return words
    return replace(words, values=cycle.put(words.values, pwm_period_s))

"""The PWM period of a controller that makes its pulses itself, where its words hold it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from heatertune.plc.ramp import Number

__all__ = ["Cycle"]


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

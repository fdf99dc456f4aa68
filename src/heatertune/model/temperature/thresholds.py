"""The thresholds of two-level control, as a log shows them: an interval each, from the temperature at each switching.

The controller switches at its first reading at or beyond the threshold, at an instant that the rows hide. So a
threshold lies between the temperatures at the beginning and at the end of what each switching leaves open. A minimum
time on or off delays a switching: the threshold for off may then be lower, and that for on higher.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.statistics import Interval, hull
from heatertune.model.temperature.evidence import quiet_noise_degC

__all__ = ["Thermostat", "Thresholds", "reading_margin_degC", "threshold_between"]

_EXTREME: Final = 3.5  # standard deviations of the noise that many readings reach


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermostat:
    """A stated two-level controller: off from `high_degC` up, on from `low_degC` down.

    Attributes:
        low_degC, high_degC: the thresholds [°C].
        least_on_s, least_off_s: shortest times on and off [s].
    """

    low_degC: float
    high_degC: float
    least_on_s: float = 0.0
    least_off_s: float = 0.0

    @classmethod
    def stated(cls, numbers: float | Sequence[float] | None) -> Thermostat | None:
        """Return the thermostat of two to four stated numbers, None without them.

        Raises:
            OutOfRange: another count of numbers, thresholds in the wrong order, a negative time.
        """
        if numbers is None:
            return None
        given = (numbers,) if isinstance(numbers, int | float) else tuple(numbers)
        if not 2 <= len(given) <= 4:
            raise OutOfRange("thermostat", given, "LOW HIGH, or LOW HIGH MINIMUM-ON MINIMUM-OFF")
        if given[0] > given[1]:
            raise OutOfRange("thermostat", given[0], f"<= its high threshold, {given[1]:g}")
        if min((0.0, *given[2:])) < 0.0:
            raise OutOfRange("thermostat", min(given[2:]), ">= 0: a minimum time [s]")
        return cls(low_degC=given[0], high_degC=given[1], least_on_s=given[2] if len(given) > 2 else 0.0,
                   least_off_s=given[3] if len(given) > 3 else 0.0)


class Thresholds(NamedTuple):
    """Where a log shows that two-level control switches: on from `low` down, off from `high` up [°C]."""

    low: Interval
    high: Interval
    hysteresis: Interval

    @classmethod
    def between(cls, low: Interval, high: Interval) -> Thresholds:
        """Return two thresholds and the distances that they allow, never negative."""
        (low_least, low_most), (high_least, high_most) = _ends(low), _ends(high)
        least = max(high_least - low_most, 0.0)
        return cls(low, high, Interval(low=least, high=max(high_most - low_least, least)))

    def or_of(self, second: Thresholds) -> Thresholds:
        """Return the intervals that hold both these thresholds and the second ones."""
        return Thresholds(*(hull(one, two) for one, two in zip(self, second, strict=True)))

    @property
    def summary(self) -> str:
        """The thresholds in words."""
        (low, low_most), (high, high_most), (apart, apart_most) = map(_ends, self)
        return (f"off at {high:.1f} to {high_most:.1f} °C and on at {low:.1f} to {low_most:.1f} °C, {apart:.1f} to "
                f"{apart_most:.1f} °C apart, unless a minimum time on or off delays it")

    def check_stated(self, name: str, thermostat: Thermostat) -> None:
        """Refuse stated thresholds that the log contradicts; a stated minimum time allows for a delay.

        Args:
            name: of the log.
            thermostat: as stated.

        Raises:
            InputError: a threshold outside its interval.
        """
        (low, low_most), (high, high_most) = _ends(self.low), _ends(self.high)
        is_off = thermostat.high_degC <= high_most and (thermostat.least_on_s > 0.0 or high <= thermostat.high_degC)
        is_on = low <= thermostat.low_degC and (thermostat.least_off_s > 0.0 or thermostat.low_degC <= low_most)
        if not (is_off and is_on):
            raise InputError(
                f"{name}: its heater is switched {self.summary}; that is not a thermostat of {thermostat.low_degC:g} "
                f"and {thermostat.high_degC:g} °C: correct --thermostat (with its minimum times, if it has any), or "
                "leave it out")


def reading_margin_degC(log: Log) -> float:
    """Return by how much noise and rounding let a controller switch beside its threshold [°C]."""
    step = float(np.min(np.diff(np.unique(log.temperature_degC))))
    noise = np.sqrt(max(quiet_noise_degC(log) ** 2 - step**2 / 12.0, 0.0))
    return float(_EXTREME * noise + 0.5 * step)


def threshold_between(begin_degC: Array, end_degC: Array, margin_degC: float) -> Interval:
    """Return the interval of a threshold from the temperatures on both sides of each switching, of shape (n,).

    Where no threshold fits all switchings (it was changed, or something delays some of them) it holds each one's.
    """
    lowest, highest = np.minimum(begin_degC, end_degC) - margin_degC, np.maximum(begin_degC, end_degC) + margin_degC
    least, most = float(np.max(lowest)), float(np.min(highest))
    if least > most:
        least, most = float(np.min(lowest)), float(np.max(highest))
    return Interval(low=least, high=most)


def _ends(inside: Interval) -> tuple[float, float]:
    """Return the ends of a closed interval."""
    assert inside.low is not None
    assert inside.high is not None
    return inside.low, inside.high

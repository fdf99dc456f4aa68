"""The log as the other stages see it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from heatertune.errors import OutOfRange
from heatertune.log.taken import Taken
from heatertune.show import Shown

__all__ = ["ABSOLUTE_ZERO_DEGC", "MIN_SAMPLES", "Log"]

ABSOLUTE_ZERO_DEGC = -273.15

#: Fewer readings than this cannot carry the five unknowns of a heater model.
MIN_SAMPLES = 20

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log(Shown):
    """A temperature record.

    Attributes:
        name: short name shown to people.
        source: where the numbers come from (a file's name, a paper's table).
        time_s: instants [s], strictly increasing, shape (n,).
        temperature_degC: process variable [°C], shape (n,).
        power_pct: heater power [0…100 % of full power], held from its instant to the next, shape (n,), or None.
        setpoint_degC: setpoint [°C], shape (n,), or None.
        repairs: what the reader changed or assumed, one sentence each.
        doubts: readings that look odd but were left as they are, one sentence each.
        same_heater: names of built-in logs taken on the same heater.
        taken: what was taken of a file as what, None for a log that was not read from one.
        rests_at_degC: where the source says that the record rests, None where it says nothing [°C].

    Raises:
        OutOfRange: shapes differ, fewer than 20 readings, times not increasing, values not finite,
            temperature constant or below absolute zero, power outside 0…100 %.
    """

    name: str
    source: str
    time_s: Array
    temperature_degC: Array
    power_pct: Array | None = None
    setpoint_degC: Array | None = None
    repairs: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    same_heater: tuple[str, ...] = field(default=())
    taken: Taken | None = None
    rests_at_degC: float | None = None

    def __post_init__(self) -> None:
        n = len(self.time_s)
        if n < MIN_SAMPLES:
            raise OutOfRange("number of samples", n, f">= {MIN_SAMPLES}")
        for name in ("time_s", "temperature_degC", "power_pct", "setpoint_degC"):
            column = getattr(self, name)
            if column is not None:
                object.__setattr__(self, name, _frozen(name, column, n))
        if not np.all(np.diff(self.time_s) > 0):
            raise OutOfRange("time_s", float(self.time_s[0]), "strictly increasing")
        if np.ptp(self.temperature_degC) == 0.0:
            raise OutOfRange("temperature_degC", float(self.temperature_degC[0]), "varying, not constant")
        _demand_bounds("temperature_degC", self.temperature_degC, ABSOLUTE_ZERO_DEGC, np.inf)
        _demand_bounds("power_pct", self.power_pct, 0.0, 100.0)

    def window(self, start_s: float, end_s: float) -> Log:
        """Return the readings with start_s <= time <= end_s."""
        keep = (self.time_s >= start_s) & (self.time_s <= end_s)

        def cut(column: Array | None) -> Array | None:
            return None if column is None else column[keep]

        return Log(
            name=self.name, source=self.source, time_s=self.time_s[keep],
            temperature_degC=self.temperature_degC[keep], power_pct=cut(self.power_pct),
            setpoint_degC=cut(self.setpoint_degC), repairs=self.repairs, doubts=self.doubts,
            same_heater=self.same_heater, taken=self.taken, rests_at_degC=self.rests_at_degC,
        )


def _demand_bounds(name: str, column: Array | None, least: float, most: float) -> None:
    if column is None:
        return
    outside = column[(column < least) | (column > most)]
    if len(outside):
        raise OutOfRange(name, float(outside[0]), f">= {least:g} and <= {most:g}")


def _frozen(name: str, column: Array, n: int) -> Array:
    array = np.array(column, dtype=np.float64)
    if array.shape != (n,):
        raise OutOfRange(name, array.shape, f"of shape ({n},)")
    if not np.all(np.isfinite(array)):
        raise OutOfRange(name, float(array[~np.isfinite(array)][0]), "finite")
    array.setflags(write=False)
    return array

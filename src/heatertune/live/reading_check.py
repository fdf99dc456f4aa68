"""Whether a reading can be believed: it is a number within the sensor's range, and it moves where it has to.

Every comparison here is written as what is good: a value that is no number fails it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np

from heatertune.model.values import HeaterModel

__all__ = ["StillSensor", "reading_problem"]

#: so long a reading may stand still after they have moved: the true dead time and lag may be longer than fitted
_DEAD_TIMES: Final = 1.0
_LAGS: Final = 0.25
_GAP_LAGS: Final = 0.1  # of the shortest lag: for so long nobody need know the power
_GAP_INTERVALS: Final = 4.0  # of the shortest interval between readings
_STEPS: Final = 5.0  # of the sensor that the heater has to have moved by


def reading_problem(degC: float, sensor_degC: tuple[float, float]) -> str:
    """Return why a temperature cannot be a reading, a few words; empty where it can.

    Args:
        degC: the temperature that the PLC shows [°C].
        sensor_degC: both ends of the sensor's range [°C]; the upper one is what a broken wire shows.
    """
    low, high = sensor_degC
    if not math.isfinite(degC):
        return "the reading is not a number"
    if not low <= degC < high:
        return f"the reading is {degC:.4g} °C, not within the sensor's range of {low:g} to {high:g} °C"
    return ""


class StillSensor:
    """Tells a frozen sensor from a loop at rest: the power has moved every plausible heater, but not its reading.

    Each heater is taken as one lag behind its dead time. How warm it is at first is not known: it is followed twice,
    from what the first power holds and from what the first reading says, and both have to have moved.
    """

    def __init__(self, heaters: Sequence[HeaterModel], least_degC: float) -> None:
        """Take heaters.

        Args:
            heaters: that are plausible.
            least_degC: by how much each of them has to have moved before a reading that stands still is frozen [°C].
        """
        self._gain = np.array([model.gain_degC_per_pct for model in heaters])
        self._lag_s = np.array([sum(model.lags_s) for model in heaters])
        self._dead_s = np.array([model.dead_time_s for model in heaters])
        self._ambient = np.array([float(model.ambient_degC or 0.0) for model in heaters])
        self._least_degC = least_degC
        self._patience_s = float((_DEAD_TIMES * self._dead_s + _LAGS * self._lag_s).max())
        self._step_degC = math.inf  # the smallest that was seen
        self._powers: deque[tuple[float, float]] = deque()
        self._held = np.empty((0, len(self._gain)))  # power that would hold each heater where it is [%]
        self._since = self._held
        self._reading, self._since_s, self._last_s = math.nan, 0.0, 0.0
        self._interval_s = math.inf  # the shortest between two readings
        self._moved_s = math.inf  # since when they have moved by as much

    def see(self, time_s: float, degC: float, power_pct: float) -> str:
        """Take a reading; return why it is frozen, a sentence; empty where it need not be.

        Args:
            time_s: of the reading [s].
            degC: that is shown [°C].
            power_pct: that the controller asks for; no number: it is not known [%]. Nor is it within a gap between
                two readings, after which the heaters are followed from the start.
        """
        passed_s = time_s - self._last_s
        gap = passed_s > max(_GAP_LAGS * float(self._lag_s.min()), _GAP_INTERVALS * self._interval_s)
        self._interval_s = min(self._interval_s, passed_s) if passed_s > 0.0 else self._interval_s
        if gap or not math.isfinite(power_pct) or not passed_s >= 0.0:
            self._held = np.empty((0, len(self._gain)))  # begins again with the next power
            self._powers.clear()
            self._reading, self._last_s = math.nan, time_s if math.isfinite(time_s) else 0.0
            return ""
        self._follow(time_s, degC, power_pct)
        if degC != self._reading:
            apart = abs(degC - self._reading)
            self._step_degC = apart if apart < self._step_degC else self._step_degC
            self._reading, self._since_s, self._since = degC, time_s, self._held.copy()
            self._moved_s = math.inf
            return ""
        moved = float(np.abs(self._gain * (self._held - self._since)).min())
        coarse = _STEPS * self._step_degC if math.isfinite(self._step_degC) else 0.0
        self._moved_s = min(self._moved_s, time_s) if moved > max(self._least_degC, coarse) else math.inf
        if not time_s - self._moved_s > self._patience_s:
            return ""
        return (f"the reading stands still at {degC:.4g} °C from {self._since_s:.6g} to {time_s:.6g} s, in which the "
                f"power has moved the heater by {moved:.2g} °C at least: the sensor is frozen")

    def _follow(self, time_s: float, degC: float, power_pct: float) -> None:
        if not len(self._held):
            by_reading = (degC - self._ambient) / self._gain
            self._held = np.array([np.full(len(self._gain), power_pct), by_reading])
        else:
            passed = 1.0 - np.exp(-(time_s - self._last_s) / self._lag_s)
            self._held += passed * (self._delayed(time_s) - self._held)
        self._powers.append((time_s, power_pct))
        oldest = time_s - float(self._dead_s.max())
        while len(self._powers) > 2 and self._powers[1][0] <= oldest:
            self._powers.popleft()
        self._last_s = time_s

    def _delayed(self, time_s: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Return the power that reaches each heater now [%]."""
        times, powers = (np.array(column) for column in zip(*self._powers, strict=True))
        place = np.searchsorted(times, time_s - self._dead_s, side="right") - 1
        return np.asarray(powers[np.maximum(place, 0)], dtype=float)

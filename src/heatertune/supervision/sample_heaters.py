"""Heaters that are drawn, each with its own whole story: what a monitor must never trip on.

Each plausible heater in turn is drawn in a box around it: gain and lags ± the spread, the dead time ± one and a half of
it, the ambient temperature ± 5 °C, the noise between none (or what the user knows) and what is assumed. No heater is
drawn that could not hold the setpoint: that one shall trip. The corners of the box come first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import OutOfRange
from heatertune.heater.exact import time_to
from heatertune.model.values import HeaterModel
from heatertune.proof.scenario import Disturbance, Load, Mains, NewSetpoint, PlcPower, Scenario
from heatertune.units import check

__all__ = ["FamilyMember", "HeaterFamily"]

Array = npt.NDArray[np.float64]

_CORNERS: Final = 32  # of gain, lags, dead time, ambient and noise
_RESERVE_PCT: Final = 5.0
_LITTLE_PCT: Final = 2.0
_LOW_MAINS: Final = 0.9**2
_HIGH_MAINS: Final = 1.1**2
_LOOP_TIMES: Final = 6.0  # of the slowest heater's lags and dead time, for the loop to come to rest
_SHORT_OFF: Final = 0.1
_LONG_OFF: Final = 3.0
_SHAKEN: Final = 24  # scans by which an event comes later, drawn
_LOW_SHARE: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FamilyMember:
    """One drawn heater.

    Attributes:
        row: as `heatertune.proof.kernel.LoopBatch` has it.
        scenario: its story.
        noise_degC: of its sensor, standard deviation.
        seed: of that noise.
    """

    row: list[float]
    scenario: Scenario
    noise_degC: float
    seed: int

    def noise(self, scans: int) -> Array:
        """Return the noise of its readings [°C], shape (scans,)."""
        return np.random.Generator(np.random.Philox(key=self.seed)).normal(0.0, self.noise_degC, scans)

    @property
    def needs_pct(self) -> float:
        """Power that holds the setpoint [%]."""
        return (self.scenario.setpoint_degC - self.row[4]) / self.row[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeaterFamily:
    """What is drawn.

    Attributes:
        heaters: the possible ones; each with its ambient temperature.
        setpoint_degC: upper end of the setpoints of use.
        low_degC: lower end; None: a fifth of the way to the ambient below.
        delay_s: of the controller, added to each dead time.
        scan_s: of the controller.
        spread: of gain and lags; the dead time's is half as much again.
        ambient_degC: half width of the ambient temperature.
        noise_degC: (least, most) standard deviation of the noise.
        ramp_degC_per_min: of the setpoint; infinite: none.
        load_pct: most power that a load takes.

    Raises:
        OutOfRange: a spread that leaves no heater; a heater that cannot hold the setpoint.
    """

    heaters: Sequence[HeaterModel]
    setpoint_degC: float
    scan_s: float
    low_degC: float | None = None
    delay_s: float = 0.0
    spread: float = 0.2
    ambient_degC: float = 5.0
    noise_degC: tuple[float, float] = (0.0, 0.1)
    ramp_degC_per_min: float = math.inf
    load_pct: float = 15.0
    slowest_s: float = field(init=False)

    def __post_init__(self) -> None:
        check("spread", self.spread, least=0.0, most=0.6)
        for heater in self.heaters:
            if not 0.0 < self._needs(heater, 0.0) <= 100.0 - _LITTLE_PCT:
                rule = f"above the ambient and below what {100.0 - _LITTLE_PCT:g} % of power reach on each heater"
                raise OutOfRange("setpoint_degC", self.setpoint_degC, rule)
        slow = max(sum(h.lags_s) * (1.0 + self.spread) + h.dead_time_s * (1.0 + 1.5 * self.spread)
                   for h in self.heaters)
        object.__setattr__(self, "slowest_s", slow + self.delay_s)

    def _needs(self, heater: HeaterModel, warmer: float) -> float:
        return (self.setpoint_degC - float(heater.ambient_degC or 0.0) - warmer) / heater.gain_degC_per_pct

    @property
    def dead_times_s(self) -> tuple[float, float]:
        """Shortest and longest time after which power acts, most of the smaller lag included [s]."""
        low = min(h.dead_time_s * (1.0 - 1.5 * self.spread) for h in self.heaters)
        high = max(h.dead_time_s * (1.0 + 1.5 * self.spread) + (1.0 + self.spread) * sum(h.lags_s[1:])
                   for h in self.heaters)
        return low + self.delay_s, high + self.delay_s

    def member(self, seed: int, *, corner: int | None = None) -> FamilyMember:
        """Return the heater of a seed, or of a corner of the box."""
        generator = np.random.Generator(np.random.Philox(key=seed))
        even = generator.uniform(-1.0, 1.0, 16)
        if corner is not None:
            even[:5] = [1.0 if corner >> place & 1 else -1.0 for place in range(5)]
            even[5] = 1.0
        heater = self.heaters[(seed if corner is None else corner // _CORNERS) % len(self.heaters)]
        ambient = float(heater.ambient_degC or 0.0) + self.ambient_degC * even[3]
        ambient = min(ambient, self.setpoint_degC - 1.0)
        least = min((self.setpoint_degC - ambient) / (100.0 - _RESERVE_PCT), heater.gain_degC_per_pct)
        gain = max(heater.gain_degC_per_pct * (1.0 + self.spread * even[0]), least,
                   (self.setpoint_degC - ambient) / (100.0 - _LITTLE_PCT))
        first, *rest = (lag * (1.0 + self.spread * even[1]) for lag in heater.lags_s)
        dead = heater.dead_time_s * (1.0 + 1.5 * self.spread * even[2]) + self.delay_s
        low, high = self.noise_degC
        row = [gain, first, rest[0] if rest else 0.0, dead, ambient, ambient]
        return FamilyMember(row=row, scenario=self._story(row, even[5:], generator), seed=seed,
                      noise_degC=low + (high - low) * 0.5 * (1.0 + even[4]))

    def corners(self) -> range:
        """Return the numbers of all corners."""
        return range(_CORNERS * len(self.heaters))

    def way_s(self) -> float:
        """Return the longest time from cold to the setpoint with all power, and the ramp's."""
        ways, step = [], 0.0
        for heater in self.heaters:
            needs = min(self._needs(heater, -self.ambient_degC) / (1.0 - self.spread), 100.0 - _RESERVE_PCT) / 100.0
            lags = [lag * (1.0 + self.spread) for lag in heater.lags_s]
            ways.append(time_to(needs, *lags))
            step = max(step, self.setpoint_degC - float(heater.ambient_degC or 0.0) + self.ambient_degC)
        return max(ways) + 60.0 * step / self.ramp_degC_per_min

    def settled_s(self) -> float:
        """Return when every heater has come to rest after the cold start [s]."""
        return self._whole(self.way_s() + _LOOP_TIMES * self.slowest_s)

    def _whole(self, seconds: float) -> float:
        return math.ceil(seconds / self.scan_s - 1e-9) * self.scan_s

    def _story(self, row: list[float], even: Array, generator: np.random.Generator) -> Scenario:
        settles, way = _LOOP_TIMES * self.slowest_s, self.way_s()
        needs = (self.setpoint_degC - row[4]) / row[0]
        most = max(0.0, min(self.load_pct * (0.75 + 0.25 * float(even[0])), 100.0 - needs - _LITTLE_PCT))
        weak = max(_LOW_MAINS, min(1.0, needs / (100.0 - _LITTLE_PCT)))
        low = self.setpoint_degC - _LOW_SHARE * (self.setpoint_degC - row[4])
        low = low if self.low_degC is None else max(self.low_degC, row[4] + 1.0)
        parts: list[tuple[Any, dict[str, Any], float]] = [
            (None, {}, way + settles),
            (Load, {"power_pct": -most}, settles), (Load, {"power_pct": most}, settles),
            (NewSetpoint, {"setpoint_degC": low}, settles),
            (NewSetpoint, {"setpoint_degC": self.setpoint_degC}, settles),
            (Mains, {"share": weak}, settles), (Mains, {"share": _HIGH_MAINS}, settles),
            (Mains, {"share": 1.0}, settles),
            (PlcPower, {"on": False}, _SHORT_OFF * self.slowest_s), (PlcPower, {"on": True}, settles),
            (PlcPower, {"on": False}, _LONG_OFF * self.slowest_s * (0.5 + 0.5 * abs(float(even[1])))),
            (PlcPower, {"on": True}, way + settles),
        ]
        now, events = 0.0, list[Disturbance]()
        for kind, fields, lasts in parts:
            if kind is not None:
                events.append(kind(time_s=now, **fields))
            now += self._whole(lasts) + int(generator.integers(0, _SHAKEN)) * self.scan_s
        return Scenario(setpoint_degC=self.setpoint_degC, ambient_degC=row[4], duration_s=now,
                        disturbances=tuple(events))

"""A thermal network: heaters that exchange heat, each with its own gain, lags and dead time; its exact solution.

    T_i·dy_i/dt = a_i + K_i·q_i − y_i + Σ_j c_ij·(y_j − y_i),   q_i = u_i(t − L_i), or that behind a second lag

c_ij is the exchange with zone j relative to the zone's own loss. The network is linear, so its modes give the exact
solution for power that is constant between instants.

Heaters on one supply that sags take power from each other: of u_i, 1 − Σ_j s_j·u_j / 100 reaches zone i, j ≠ i.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, HeaterModel, TwoLag
from heatertune.units import check

__all__ = ["Modes", "ThermalNetwork", "ZonePower", "modes_of", "neighbours", "simulate_many"]

Complex = npt.NDArray[np.complex128]

#: how two zones may be neighbours
STRUCTURES: Final = ("chain", "ring", "free")
_APART: Final = 1e-6  # by which two equal lags are set apart, so that the modes are independent
_LEAST_LEFT: Final = 0.05  # of a heater's power on a supply that sags, in the search for the powers that hold a heat
_MOST_SEARCHED_PCT: Final = 1e3
_SEARCHES: Final = 200


def neighbours(structure: str, count: int) -> tuple[tuple[int, int], ...]:
    """Return the ordered pairs (zone, neighbour) of zones that may exchange heat.

    Args:
        structure: "chain": in the order of the zones; "ring": the last one and the first as well; "free": all.
        count: number of zones.

    Raises:
        OutOfRange: another structure.
    """
    if structure not in STRUCTURES:
        raise OutOfRange("structure", structure, " or ".join(map(repr, STRUCTURES)))
    pairs = [(i, j) for i in range(count) for j in range(count) if i != j]
    if structure == "free":
        return tuple(pairs)
    ends = {(0, count - 1), (count - 1, 0)} if structure == "ring" else set()
    return tuple(pair for pair in pairs if abs(pair[0] - pair[1]) == 1 or pair in ends)


class Modes(NamedTuple):
    """A network by its modes: z' = rates·z + inputs·u(t − L) + constant, y = outputs·z.

    Attributes:
        rates: shape (m,) [1/s].
        outputs: shape (n, m).
        inputs: shape (m, n).
        constant: of the ambient, shape (m,).
        inverse: from states to modes, shape (m, m); the states are the zones' temperatures and their elements' power.
        elements: zones that have a heating element with a lag of its own.
        element_lags_s: of these [s].
    """

    rates: Complex
    outputs: Complex
    inputs: Complex
    constant: Complex
    inverse: Complex
    elements: tuple[int, ...]
    element_lags_s: tuple[float, ...]


@dataclass(frozen=True, slots=False, kw_only=True, eq=False)
class ThermalNetwork:
    """Zones that exchange heat; the order of the zones is that of `zones`.

    Attributes:
        zones: names.
        gains_degC_per_pct: steady rise of a zone per percent of its power, without any exchange [°C/%].
        time_constants_s: of a zone without any exchange [s].
        dead_times_s: from a zone's power to its temperature [s].
        ambients_degC: temperature of a zone without power and exchange [°C].
        exchange: heat exchanged with zone j per degree, relative to the loss of zone i, shape (n, n), 0 at i = j.
        second_time_constants_s: lag of the heating element before the zone, or of the sensor behind it; 0: none [s].
        supply_shares: of their power that all other heaters lose while that of a zone is fully on, 0…1; empty: none.

    Raises:
        InputError: no zone, or names that are not unique.
        OutOfRange: another number of values than zones, a gain or lag that is not positive, a negative dead time or
            exchange, or a share that is not one.
    """

    zones: tuple[str, ...]
    gains_degC_per_pct: tuple[float, ...]
    time_constants_s: tuple[float, ...]
    dead_times_s: tuple[float, ...]
    ambients_degC: tuple[float, ...]
    exchange: Array
    second_time_constants_s: tuple[float, ...] = ()
    supply_shares: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.zones)
        if not count or len(set(self.zones)) < count:
            raise InputError(f"zones {', '.join(self.zones) or 'not named'}: each zone needs a name of its own")
        if not self.second_time_constants_s:
            object.__setattr__(self, "second_time_constants_s", (0.0,) * count)
        if len(self.supply_shares) not in (0, count):
            raise OutOfRange("supply_shares", len(self.supply_shares), f"one value for each of {count} zones")
        for share in self.supply_shares:
            check("supply_shares", share, least=0.0, most=1.0)
        for name, least in (("gains_degC_per_pct", None), ("time_constants_s", None), ("dead_times_s", 0.0),
                            ("ambients_degC", -273.15), ("second_time_constants_s", 0.0)):
            values = getattr(self, name)
            if len(values) != count:
                raise OutOfRange(name, len(values), f"one value for each of {count} zones")
            for value in values:
                check(name, value, above=0.0) if least is None else check(name, value, least=least)
        exchange = np.array(self.exchange, dtype=np.float64)
        if exchange.shape != (count, count) or np.any(np.diag(exchange) != 0.0):
            raise OutOfRange("exchange", exchange.shape, f"of shape ({count}, {count}), 0 of a zone with itself")
        if not np.all(np.isfinite(exchange)) or np.any(exchange < 0.0):
            raise OutOfRange("exchange", float(np.min(exchange)), "finite and >= 0")
        exchange.setflags(write=False)
        object.__setattr__(self, "exchange", exchange)

    @cached_property
    def modes(self) -> Modes:
        """The network's modes."""
        return modes_of(
            np.array(self.gains_degC_per_pct), np.array(self.time_constants_s), np.array(self.ambients_degC),
            self.exchange, np.array(self.second_time_constants_s))

    def steady_degC(self, power_pct: npt.ArrayLike) -> Array:
        """Return the temperatures at which the zones rest with these powers, shape (n,) [°C]."""
        reaching = np.asarray(power_pct) * self._shares_left(np.asarray(power_pct))
        heat = np.array(self.ambients_degC) + np.array(self.gains_degC_per_pct) * reaching
        return np.asarray(np.linalg.solve(self._losses, heat))

    def holding_pct(self, temperatures_degC: npt.ArrayLike) -> Array:
        """Return the powers that hold these temperatures, shape (n,) [%]; below 0 where a zone would have to cool."""
        heat = self._losses @ np.asarray(temperatures_degC, dtype=np.float64) - np.array(self.ambients_degC)
        return self.demanded_pct(heat / np.array(self.gains_degC_per_pct))

    @property
    def is_supply_shared(self) -> bool:
        """Whether the heaters take power from each other."""
        return any(self.supply_shares)

    def _shares_left(self, power_pct: Array) -> Array:
        """Return which share of its power each heater gets while all have these, shape (n,)."""
        if not self.is_supply_shared:
            return np.ones(len(self.zones))
        lost = np.array(self.supply_shares) * np.maximum(power_pct, 0.0) / 100.0
        return np.asarray(1.0 - (lost.sum() - lost))

    def demanded_pct(self, heat_pct: Array) -> Array:
        """Return the powers of which these reach the heaters, shape (n,); beyond 100 where none do [%]."""
        power = np.asarray(heat_pct, dtype=np.float64)
        for _ in range(_SEARCHES if self.is_supply_shared else 0):
            before, left = power, np.maximum(self._shares_left(power), _LEAST_LEFT)
            power = np.minimum(heat_pct / left, _MOST_SEARCHED_PCT)
            if np.max(np.abs(power - before)) < 1e-9:
                break
        return power

    def power_slopes(self, power_pct: float) -> Array:
        """Return by how much the power that reaches zone i changes with that of zone j, shape (n, n).

        Args:
            power_pct: of every zone [%].
        """
        powers = np.full(len(self.zones), power_pct)
        slopes = np.diag(self._shares_left(powers))
        if self.is_supply_shared:
            slopes -= (1.0 - np.eye(len(powers))) * np.array(self.supply_shares) * power_pct / 100.0
        return np.asarray(slopes)

    @property
    def _losses(self) -> Array:
        return np.asarray(np.diag(1.0 + self.exchange.sum(axis=1)) - self.exchange)

    def neighbours_held(self, zone: int, at_degC: Sequence[float] | None = None) -> HeaterModel:
        """Return a zone's heater while its neighbours are held at their temperatures.

        Args:
            zone: its number.
            at_degC: temperatures of all zones; None: their ambients [°C].
        """
        share = 1.0 + float(self.exchange[zone].sum())
        neighbours_degC = np.asarray(self.ambients_degC if at_degC is None else at_degC, dtype=np.float64)
        ambient = (self.ambients_degC[zone] + float(self.exchange[zone] @ neighbours_degC)) / share
        lag, second = self.time_constants_s[zone] / share, self.second_time_constants_s[zone]
        gain, dead = self.gains_degC_per_pct[zone] / share, self.dead_times_s[zone]
        if second <= 0.0:
            return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead, ambient_degC=ambient)
        return TwoLag(gain_degC_per_pct=gain, time_constant_s=max(lag, second), dead_time_s=dead,
                      second_time_constant_s=min(lag, second), ambient_degC=ambient)

    def rise_time_s(self, zone: int, to_degC: float, power_pct: float) -> float:
        """Return how long a zone takes from its ambient to a temperature, its neighbours at theirs; 3 lags at most [s].

        Args:
            zone: its number.
            to_degC: temperature [°C].
            power_pct: of its heater [%].
        """
        share, cold = 1.0 + float(self.exchange[zone].sum()), self.steady_degC(np.zeros(len(self.zones)))[zone]
        rise = (to_degC - cold) * share / (power_pct * self.gains_degC_per_pct[zone])
        lag = self.time_constants_s[zone] / share + self.second_time_constants_s[zone]
        return self.dead_times_s[zone] - lag * math.log(1.0 - min(max(float(rise), 0.0), 0.95))

    def neighbours_pct(self, zone: int, temperatures_degC: Sequence[float]) -> float:
        """Return the power of a zone that heats it as much as its neighbours do beyond their ambients [%].

        Args:
            zone: its number.
            temperatures_degC: of all zones [°C].
        """
        beyond = np.asarray(temperatures_degC) - np.array(self.ambients_degC)
        return float(self.exchange[zone] @ beyond) / self.gains_degC_per_pct[zone]

    def most_drift_pct(self, zone: int, offset_degC: float) -> float:
        """Return by how much a zone's power differs where it and its neighbours are off in opposite directions [%].

        Args:
            zone: its number.
            offset_degC: by which each temperature may be off [°C].
        """
        share = 1.0 + 2.0 * float(self.exchange[zone].sum())
        return offset_degC * share / self.gains_degC_per_pct[zone]

    def pulse_response(self, omega: Array, sample_time_s: float, delay_s: float = 0.0) -> Complex:
        """Return the pulse transfer matrix behind a hold at `omega` [rad/s], shape (len(omega), n, n) [°C/%].

        Args:
            omega: frequencies, up to π/`sample_time_s` [rad/s].
            sample_time_s: common interval of all controllers [s].
            delay_s: of the controllers' input and output [s].
        """
        modes, z = self.modes, np.exp(1j * omega * sample_time_s)
        matrix = np.empty((len(omega), len(self.zones), len(self.zones)), dtype=np.complex128)
        for zone, dead in enumerate(self.dead_times_s):
            whole, rest = divmod(dead + delay_s, sample_time_s)
            now = np.expm1(modes.rates * (sample_time_s - rest)) / modes.rates
            before = np.exp(modes.rates * (sample_time_s - rest)) * np.expm1(modes.rates * rest) / modes.rates
            pulse = (now + before / z[:, None]) / (z[:, None] - np.exp(modes.rates * sample_time_s))
            part = (pulse * modes.inputs[:, zone]) @ modes.outputs.T
            matrix[:, :, zone] = part * z[:, None] ** -whole
        return matrix


def modes_of(gains: Array, lags_s: Array, ambients_degC: Array, exchange: Array, second_s: Array) -> Modes:
    """Return the modes of a network, see `ThermalNetwork`.

    Args:
        gains: of the zones, shape (n,) [°C/%].
        lags_s: of the zones, shape (n,) [s].
        ambients_degC: shape (n,) [°C].
        exchange: shape (n, n); during a fit it may have entries below 0.
        second_s: lag of each zone's element, shape (n,); 0: none [s].
    """
    n, elements = len(gains), np.flatnonzero(second_s > 0.0)
    size = n + len(elements)
    states, powers, constant = np.zeros((size, size)), np.zeros((size, n)), np.zeros(size)
    states[:n, :n] = (exchange - np.diag(1.0 + exchange.sum(axis=1))) / lags_s[:, None]
    constant[:n] = ambients_degC / lags_s
    powers[:n] = np.diag(gains / lags_s)
    for place, zone in enumerate(elements, start=n):
        states[zone, place] = gains[zone] / lags_s[zone]
        powers[zone, zone] = 0.0
        states[place, place], powers[place, zone] = -1.0 / second_s[zone], 1.0 / second_s[zone]
    rates, vectors = np.linalg.eig(states)
    if np.linalg.cond(vectors) > 1.0 / _APART:  # a double mode
        rates, vectors = np.linalg.eig(states * (1.0 + _APART * np.arange(size)[:, None]))
    inverse = np.linalg.inv(vectors)
    return Modes(rates.astype(np.complex128), vectors[:n].astype(np.complex128),
                 (inverse @ powers).astype(np.complex128), (inverse @ constant).astype(np.complex128),
                 inverse.astype(np.complex128), tuple(map(int, elements)),
                 tuple(map(float, second_s[elements])))


class ZonePower(NamedTuple):
    """The logged power of one zone: at first, and at each instant at which it changed, by how much [%, s]."""

    first_pct: float
    instants_s: Array
    changes_pct: Array

    @classmethod
    def from_rows(cls, time_s: Array, power_pct: Array) -> ZonePower:
        """Return the course of a power that each row holds up to the next; both of shape (N,)."""
        changed = np.flatnonzero(np.diff(power_pct)) + 1
        return cls(float(power_pct[0]), time_s[changed], np.diff(power_pct)[changed - 1])

    def behind_lag_pct(self, instant_s: float, dead_s: float, lag_s: float) -> float:
        """Return the power behind a dead time and a lag at an instant, settled before the first change [%]."""
        since = np.maximum(instant_s - dead_s - self.instants_s, 0.0)
        return self.first_pct - float(self.changes_pct @ np.expm1(-since / lag_s))


def simulate_many(cases: Sequence[tuple[Modes, Array, Array]], time_s: Array, courses: Sequence[ZonePower]) -> Array:
    """Return the temperatures of several networks at the instants, shape (len(cases), len(time_s), n) [°C].

    Args:
        cases: modes, dead times of the zones [s] and temperatures at the first instant [°C], of each network.
        time_s: instants, increasing [s].
        courses: power of each zone, which may begin before the first instant; before its first change it was the first
            power, and elements had settled to it.
    """
    span, size = np.diff(time_s), len(cases[0][0].rates)
    decay = np.empty((len(span), len(cases), size), dtype=np.complex128)
    heat = np.empty_like(decay)
    states = np.empty((len(time_s), len(cases), size), dtype=np.complex128)
    for case, (modes, dead_times_s, start_degC) in enumerate(cases):
        exponent = np.outer(span, modes.rates)
        decay[:, case] = np.exp(exponent)
        growth = np.expm1(exponent) / modes.rates
        added = growth * modes.constant
        for zone, course in enumerate(courses):
            added += _heat_of(course, dead_times_s[zone], time_s, growth, modes.rates) * modes.inputs[:, zone]
        heat[:, case] = added
        first = [*start_degC, *(courses[zone].behind_lag_pct(time_s[0], dead_times_s[zone], lag_s)
                                for zone, lag_s in zip(modes.elements, modes.element_lags_s, strict=True))]
        states[0, case] = modes.inverse @ np.array(first)
    for row in range(len(span)):
        states[row + 1] = decay[row] * states[row] + heat[row]
    return np.array([(states[:, case] @ modes.outputs.T).real for case, (modes, *_) in enumerate(cases)])


def _heat_of(course: ZonePower, dead_s: float, time_s: Array, growth: Complex, rates: Complex) -> Complex:
    """Return what the power of a zone adds to each mode from one instant to the next, per unit of its input."""
    arrives = course.instants_s + dead_s
    row = np.searchsorted(time_s, arrives, side="left") - 1  # the span in which it arrives
    inside = (row >= 0) & (row < len(time_s) - 1)
    power_pct = np.full(len(time_s) - 1, course.first_pct) + np.concatenate(
        [[0.0], np.cumsum(np.bincount(row[inside], course.changes_pct[inside], len(time_s) - 1))[:-1]])
    power_pct += float(course.changes_pct[row < 0].sum())
    heat = growth * power_pct[:, None]
    remainder_s = time_s[row[inside] + 1] - arrives[inside]
    part = course.changes_pct[inside, None] * np.expm1(np.outer(remainder_s, rates)) / rates
    np.add.at(heat, row[inside], part)
    return np.asarray(heat)

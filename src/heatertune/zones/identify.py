"""Log of several zones → the thermal network behind it, with intervals, and the couplings that the log leaves open.

A linear least-squares fit of the integrated heat balance, zone by zone, gives the start. The whole network is then
fitted to all readings at once with its exact solution (output error), so the noise of a neighbour's reading biases
nothing. The intervals take the autocorrelation of each zone's residuals into account.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC, MIN_SAMPLES
from heatertune.model.findings import Finding
from heatertune.model.statistics import Interval, sensor_step
from heatertune.zones.network import (
    Modes,
    ThermalNetwork,
    ZonePower,
    modes_of,
    neighbours,
    simulate_many,
)

__all__ = ["FittedNetwork", "ParameterLayout", "ZoneLog", "fit_network", "network_by_hand"]

_ROWS: Final = 1200  # readings used of each zone
_DEAD_TIMES: Final = 25  # tried for the start of the fit
_LATE_ROWS: Final = 2  # by which the logged power may be late, as in the fit of one heater
_NORMAL: Final = 1.96
_FREE_UP_TO: Final = 3  # zones for which every coupling is fitted where no structure is stated
_SIGNIFICANT: Final = 25.0  # points that a coupling beyond the structure has to gain: five standard errors
_BIC: Final = 10.0  # points that a second lag of each zone has to gain, for each parameter
_WHITE: Final = 1.25  # inflation below which residuals leave nothing to explain
_POOR_PCT: Final = 80.0
_GOOD_PCT: Final = 98.0  # of a zone's log: a network that explains less has to leave little more than noise
_MOST_LEFT: Final = 4.0  # times the noise between neighbouring rows, that it may leave then
_MOST_STEPS: Final = 40
_CHANGES: Final = 60  # of a zone's power, the largest, whose instants are fitted
_ROUNDS: Final = 3  # of that fit
_COLDER: Final = 0.02  # exchange below 0 that cannot be the noise of a weak one
_BELOW: Final = 0.4  # exchange below 0 that a fit may try, of all neighbours of a zone
_LEAST_SHOWN: Final = 1e-14  # of a direction of the parameters, relative to what the log shows of each
_NO_HEATER: Final = 1e3  # ratio of an end of an interval to the gain or lag, from which on nothing is known of it
_KNOWN: Final = 10.0  # ratio of an end of a lag's interval to the lag, beyond which the log does not show it
_FROM_REST: Final = "log a step of each zone's power, one after the other, each until all temperatures are steady"
_OTHERS: Final = 0.25  # of the squares that no power, or the own one, leaves: less shows what heats or cools a zone
_MOVED: Final = 0.05  # of the squares of a zone's temperatures: more is left without the power that moves it
_GAP_TIMES: Final = 5.0  # intervals without a row are a gap
_MOST_GAPS: Final = 3  # that are looked at, the longest
_WIDE: Final = 4.0  # ratio of an interval's ends above which the log bounds nothing


class ParameterLayout(NamedTuple):
    """Places of the parameters: of each zone log K, log T, L, a, the first temperature, with a second lag its log; c.

    Attributes:
        size: number of zones.
        pairs: (zone, neighbour) of each coupling.
        second: whether each zone has a second lag.
    """

    size: int
    pairs: tuple[tuple[int, int], ...]
    second: bool

    @property
    def per_zone(self) -> int:
        """Parameters of a zone besides couplings."""
        return 6 if self.second else 5

    def parts(self, values: Array) -> tuple[Array, Array]:
        """Return the parameters by zone, shape (n, 5 or 6), and the matrix of the couplings, shape (n, n)."""
        own = values[: self.size * self.per_zone].reshape(self.size, self.per_zone)
        exchange = np.zeros((self.size, self.size))
        for (zone, other), value in zip(self.pairs, values[self.size * self.per_zone:], strict=True):
            exchange[zone, other] = value
        return own, exchange

    def case(self, values: Array) -> tuple[Modes, Array, Array]:
        """Return what `simulate_many` takes, of parameters of shape (p,)."""
        own, exchange = self.parts(values)
        second = np.exp(own[:, 5]) if self.second else np.zeros(self.size)
        modes = modes_of(np.exp(own[:, 0]), np.exp(own[:, 1]), own[:, 3], exchange, second)
        return modes, own[:, 2], own[:, 4]

    def network(self, zones: tuple[str, ...], values: Array) -> ThermalNetwork:
        """Return the network of parameters of shape (p,); no coupling or dead time is below 0, no ambient below 0 K."""
        own, exchange = self.parts(values)
        return ThermalNetwork(
            zones=zones, gains_degC_per_pct=tuple(np.exp(own[:, 0])), time_constants_s=tuple(np.exp(own[:, 1])),
            dead_times_s=tuple(np.maximum(own[:, 2], 0.0)),
            ambients_degC=tuple(np.maximum(own[:, 3], ABSOLUTE_ZERO_DEGC)),
            exchange=np.maximum(exchange, 0.0),
            second_time_constants_s=tuple(np.exp(own[:, 5])) if self.second else ())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ZoneLog:
    """Temperatures and powers of several zones at the same instants.

    Attributes:
        name: of the log.
        zones: names, in order; neighbours in a chain follow each other.
        time_s: instants, increasing, shape (N,) [s].
        temperatures_degC: shape (N, n) [°C].
        powers_pct: held from its instant to the next, shape (N, n) [0…100 %].
        setpoints_degC: shape (N, n), None if not logged [°C].
        courses: of each power by its own instants; empty: as `powers_pct`.
        repairs: what the reader changed or assumed, one sentence each.
        findings: that leave a network of this log unproven: a unit without evidence.

    Raises:
        InputError: fewer than two zones, or names that are not unique.
        OutOfRange: shapes that differ, too few rows, times that do not increase, a power outside 0…100 %.
    """

    name: str
    zones: tuple[str, ...]
    time_s: Array
    temperatures_degC: Array
    powers_pct: Array
    setpoints_degC: Array | None = None
    courses: tuple[ZonePower, ...] = ()
    repairs: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        if len(self.zones) < 2 or len(set(self.zones)) < len(self.zones):
            raise InputError(f"zones {', '.join(self.zones)}: expected two or more zones, each with a name of its own")
        shape = (len(self.time_s), len(self.zones))
        if shape[0] < MIN_SAMPLES:
            raise OutOfRange("number of samples", shape[0], f">= {MIN_SAMPLES}")
        for name in ("temperatures_degC", "powers_pct", "setpoints_degC"):
            values = getattr(self, name)
            if values is not None and (values.shape != shape or not np.all(np.isfinite(values))):
                raise OutOfRange(name, values.shape, f"finite, of shape {shape}")
        if not np.all(np.diff(self.time_s) > 0.0):
            raise OutOfRange("time_s", float(self.time_s[0]), "strictly increasing")
        if np.min(self.powers_pct) < 0.0 or np.max(self.powers_pct) > 100.0:
            raise OutOfRange("powers_pct", float(np.max(np.abs(self.powers_pct))), ">= 0 and <= 100")

    @property
    def interval_s(self) -> float:
        """The usual time between two rows [s]."""
        return float(np.median(np.diff(self.time_s)))

    def fit_zones(self, **settings: Any) -> FittedNetwork:
        """Identify the thermal network of the zones; arguments and errors as `fit_network`."""
        return fit_network(self, **settings)


@dataclass(frozen=True, slots=False, kw_only=True, eq=False)
class FittedNetwork:
    """The thermal network of a log, and how far the log determines it.

    Attributes:
        network: the best fit.
        layout: of `values`.
        values: the parameters, as `layout` places them.
        covariance: of the parameters.
        late_s: by how much longer than fitted the dead times may be, as the logged power may be late [s].
        noise_degC: standard deviation of the residuals of each zone [°C].
        fit_pct: 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) of each zone [%].
        residuals_degC: shape (N, n) [°C].
        findings: that leave the network unproven, see `heatertune.model.findings`.
        log: name of the log.
        interval_s: between two rows [s].
        setpoints_degC: last logged setpoint of each zone, None if not logged [°C].
        highest_degC: highest reading of each zone [°C].
    """

    network: ThermalNetwork
    layout: ParameterLayout
    values: Array
    covariance: Array
    late_s: float = 0.0
    noise_degC: tuple[float, ...] = ()
    fit_pct: tuple[float, ...] = ()
    residuals_degC: Array = field(default_factory=lambda: np.zeros((0, 0)))
    findings: tuple[Finding, ...] = ()
    log: str = "by hand"
    interval_s: float = 0.0
    setpoints_degC: tuple[float, ...] | None = None
    highest_degC: tuple[float, ...] | None = None

    @cached_property
    def ci95(self) -> Mapping[str, Interval]:
        """Quantity with unit and zone, or "exchange A-B" → its 95 % interval."""
        own, zones = self.layout.per_zone, self.network.zones
        names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC", "", "second_time_constant_s")
        found = {}
        for zone, label in enumerate(zones):
            for place, name in enumerate(names[:own]):
                if name:
                    found[f"{name} {label}"] = self._interval(zone * own + place, is_log=place in (0, 1, 5),
                                                              late_s=self.late_s if place == 2 else 0.0)
        for number, (zone, other) in enumerate(self.layout.pairs):
            found[f"exchange {zones[zone]}-{zones[other]}"] = self._interval(len(zones) * own + number)
        return found

    def _interval(self, place: int, *, is_log: bool = False, late_s: float = 0.0) -> Interval:
        reach = _NORMAL * math.sqrt(float(self.covariance[place, place]))
        low, high = float(self.values[place]) - reach, float(self.values[place]) + reach
        return Interval(low=math.exp(low), high=math.exp(high)) if is_log else Interval(low=low, high=high + late_s)

    @property
    def couplings(self) -> Mapping[str, bool]:
        """"A-B" → whether the log shows that zone A receives heat from zone B; if not, it is open."""
        return {name.removeprefix("exchange "): interval.low is not None and interval.low > 0.0
                for name, interval in self.ci95.items() if name.startswith("exchange ")}

    def draw(self, count: int, seed: int = 1) -> list[tuple[str, ThermalNetwork]]:
        """Return plausible networks with labels: the best fit, the ends of the intervals, and drawn ones.

        The draws follow the joint distribution of the parameters; dead times are longer by up to `late_s`.

        Args:
            count: number of drawn networks.
            seed: of the draws.
        """
        zones, own = self.network.zones, self.layout.per_zone
        found = [("best fit", self.network)]
        if not np.any(self.covariance):
            return found
        reach = _NORMAL * np.sqrt(np.diag(self.covariance))
        coupled = np.arange(len(self.values)) >= len(zones) * own
        dead = ~coupled & (np.arange(len(self.values)) % own == 2)
        for label, sign in (("strongest exchange, longest dead times", 1.0), ("weakest exchange", -1.0)):
            values = self.values + sign * np.where(coupled, reach, 0.0)
            values = np.where(dead, self.values + (reach + self.late_s if sign > 0.0 else 0.0), values)
            found.append((label, self.layout.network(zones, values)))
        random = np.random.default_rng(seed)
        spread = np.linalg.cholesky(self.covariance + 1e-15 * np.diag(np.diag(self.covariance)))
        for number in range(count):
            values = self.values + spread @ random.standard_normal(len(self.values))
            values = np.where(dead, values + random.uniform(0.0, self.late_s, len(values)), values)
            found.append((f"drawn network {number + 1}", self.layout.network(zones, values)))
        return found

    def summary(self) -> str:
        """Return the network as text, a line for each zone and one for each coupling."""
        net, lines = self.network, []
        for zone, label in enumerate(net.zones):
            parts = [f"{self._text(f'gain_degC_per_pct {label}', net.gains_degC_per_pct[zone])} °C/%",
                     f"time constant {self._text(f'time_constant_s {label}', net.time_constants_s[zone])} s",
                     f"dead time {self._text(f'dead_time_s {label}', net.dead_times_s[zone])} s"]
            lines.append(f"zone {label}: {', '.join(parts)}, ambient {net.ambients_degC[zone]:.4g} °C")
        for name, shown in self.couplings.items():
            zone, other = self.layout.pairs[list(self.couplings).index(name)]
            value = self._text(f"exchange {name}", float(net.exchange[zone, other]))
            lines.append(f"exchange {name}: {value}{'' if shown else ', open: the log does not show it'}")
        return "\n".join([*lines, *(f"{finding.name}: {finding.message}" for finding in self.findings)])

    def _text(self, name: str, value: float) -> str:
        interval = self.ci95[name]
        return f"{value:.4g} ({interval.low:.4g}…{interval.high:.4g})"


def network_by_hand(network: ThermalNetwork) -> FittedNetwork:
    """Return a network that was entered by its numbers, in the form that tuning and proof take; it has no intervals."""
    count = len(network.zones)
    pairs = tuple((i, j) for i in range(count) for j in range(count) if network.exchange[i, j] > 0.0)
    second = any(lag > 0.0 for lag in network.second_time_constants_s)
    layout = ParameterLayout(count, pairs, second)
    own = [np.log(network.gains_degC_per_pct), np.log(network.time_constants_s), np.array(network.dead_times_s),
           np.array(network.ambients_degC), np.array(network.ambients_degC)]
    if second:
        own.append(np.log(np.maximum(network.second_time_constants_s, 1e-6)))
    values = np.concatenate([np.column_stack(own).ravel(), [network.exchange[pair] for pair in pairs]])
    return FittedNetwork(network=network, layout=layout, values=values, covariance=np.zeros((len(values),) * 2))


def fit_network(log: ZoneLog, *, structure: str | None = None) -> FittedNetwork:
    """Identify the thermal network of a log.

    Args:
        log: of all zones, with power.
        structure: "chain", "ring" or "free", see `heatertune.zones.network.neighbours`; None: free up to three zones,
            otherwise a chain and the couplings beyond it that the log shows.

    Raises:
        InputError: a zone whose power never changes, or a log that gives no heater.
        OutOfRange: another structure.
    """
    for zone, power in zip(log.zones, log.powers_pct.T, strict=True):
        if np.ptp(power) == 0.0:
            raise InputError(f"{log.name}: the power of zone {zone!r} never changes, so its gain is unknown: log a "
                             "step of the power of each zone, one after the other")
    fitted = _fit(log, structure)
    if any(finding.name == "poor-fit" for finding in fitted.findings):
        hidden = tuple(_hidden_powers(log, structure))
        fitted = replace(fitted, findings=(*hidden, *fitted.findings))
    return fitted


def _fit(log: ZoneLog, structure: str | None) -> FittedNetwork:
    """Return the network of a log; arguments and errors as `fit_network`."""
    count = len(log.zones)
    pairs = neighbours(structure or ("free" if count <= _FREE_UP_TO else "chain"), count)
    problem = _NetworkProblem.from_log(log)
    layout = ParameterLayout(count, pairs, second=False)
    problem, fitted = problem.timed(problem.fit(layout, problem.start(layout)))
    if structure is None and count > _FREE_UP_TO:
        fitted = problem.with_further_couplings(fitted)
    fitted = problem.with_second_lags(fitted)
    return _result(log, problem, fitted)


def _hidden_powers(log: ZoneLog, structure: str | None) -> Iterator[Finding]:
    """Yield which gap keeps a network from explaining a log: beside it, one explains the log before or after it."""
    spans = np.diff(log.time_s)
    gaps = [int(row) for row in np.argsort(-spans)[:_MOST_GAPS] if spans[row] > _GAP_TIMES * log.interval_s]
    for row in gaps:
        begin_s, end_s, parts = log.time_s[row], log.time_s[row + 1], (slice(row + 1, None), slice(row + 1))
        for part, option in zip(parts, (f"--from {end_s:.6g}", f"--until {begin_s:.6g}"), strict=True):
            own = _part_of(log, part)
            if own is not None and _is_explained(own, structure):
                yield _gap_finding(begin_s, end_s, f"one network explains the part that {option} leaves")
                return
    if gaps and not any(_part_of(log, part) for row in gaps for part in (slice(row + 1, None), slice(row + 1))):
        begin_s, end_s = log.time_s[gaps[0]:gaps[0] + 2]
        yield _gap_finding(begin_s, end_s, "neither part has steps of every zone: log again without a gap")


def _gap_finding(begin_s: float, end_s: float, message: str) -> Finding:
    return Finding(name="gap-hides-power", message=(
        f"the log has no row from {begin_s:.6g} to {end_s:.6g} s, so what the power did there is unknown; {message}"))


def _part_of(log: ZoneLog, rows: slice) -> ZoneLog | None:
    """Return some rows of a log, None where these do not show a heater of each zone."""
    power = log.powers_pct[rows]
    if len(power) < MIN_SAMPLES or not np.all(np.ptp(power, axis=0)):
        return None
    return replace(log, time_s=log.time_s[rows], temperatures_degC=log.temperatures_degC[rows], powers_pct=power,
                   setpoints_degC=None, courses=(), findings=())


def _is_explained(log: ZoneLog, structure: str | None) -> bool:
    try:
        return not _fit(log, structure).findings
    except InputError:
        return False


class _NetworkFit(NamedTuple):
    layout: ParameterLayout
    values: Array
    residuals: Array  # shape (rows, n)
    jacobian: Array  # shape (rows, n, parameters)


class _HeatBalance(NamedTuple):
    squares: float  # [°C²], summed
    solution: Array  # of elapsed time, own temperature, power, one, and the temperatures of others less the own
    dead_s: float

    @property
    def of_power(self) -> float:
        """By how much the power heats [°C/s per %]."""
        return float(self.solution[2])

    @property
    def is_heater(self) -> bool:
        """Whether the zone loses heat and its power heats it."""
        return bool(self.solution[1] < 0.0 < self.solution[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class _NetworkProblem:
    """Readings of the log, thinned, and the power of each zone as logged."""

    time_s: Array
    readings: Array
    courses: Sequence[ZonePower]
    longest_s: float
    interval_s: float  # between rows of the log
    spans_s: Sequence[Array]  # before each change of a zone's power: within it, nobody knows when it changed

    @classmethod
    def from_log(cls, log: ZoneLog) -> _NetworkProblem:
        keep = slice(None, None, math.ceil(len(log.time_s) / _ROWS))
        courses = log.courses or [ZonePower.from_rows(log.time_s, power) for power in log.powers_pct.T]
        before = [log.time_s[np.maximum(np.searchsorted(log.time_s, course.instants_s) - 1, 0)] for course in courses]
        spans_s = [np.maximum(course.instants_s - row, log.interval_s)
                   for course, row in zip(courses, before, strict=True)]
        return cls(time_s=log.time_s[keep], readings=log.temperatures_degC[keep], courses=courses,
                   longest_s=float(np.ptp(log.time_s)) / 4.0, interval_s=log.interval_s, spans_s=spans_s)

    def start(self, layout: ParameterLayout) -> Array:
        """Return parameters by linear least squares on the integrated heat balance, the best of several dead times."""
        own = np.empty((layout.size, 5))
        couplings = []
        for zone in range(layout.size):
            others = [other for first, other in layout.pairs if first == zone]
            tried = (balance for balance in self._balances(zone, zone, others) if balance.is_heater)
            own[zone], found = self._from_balance(
                zone, min(tried, key=attrgetter("squares"), default=None), len(others))
            couplings += found
        return np.concatenate([own.ravel(), couplings])

    def _balances(self, zone: int, power: int | None, others: Sequence[int]) -> Iterator[_HeatBalance]:
        """Yield a zone's integrated heat balance with the power of a zone, or none, at several dead times."""
        steps = np.diff(self.time_s)
        integral = np.vstack([np.zeros(len(self.courses)), np.cumsum(
            0.5 * (self.readings[1:] + self.readings[:-1]) * steps[:, None], axis=0)])
        elapsed = self.time_s - self.time_s[0]
        for dead in (0.0, *np.geomspace(0.5 * float(np.median(steps)), self.longest_s, _DEAD_TIMES)):
            exchanged: list[Array] = [integral[:, other] - integral[:, zone] for other in others]
            energy = 0.0 * elapsed if power is None else self._energy(power, float(dead))
            columns = np.column_stack([elapsed, integral[:, zone], energy, np.ones(len(elapsed)), *exchanged])
            scale = np.abs(columns).max(axis=0) + 1e-30
            solution, *_ = np.linalg.lstsq(columns / scale, self.readings[:, zone], rcond=None)
            yield _HeatBalance(float(np.sum((columns @ (solution / scale) - self.readings[:, zone]) ** 2)),
                               solution / scale, float(dead))

    def misread_powers(self, zones: Sequence[str]) -> Iterator[str]:
        """Yield which zones another zone's power heats, or their own power cools, as the heat balance of each shows."""
        for zone, name in enumerate(zones):
            best = self._shown_balances(zone)
            if not best:
                continue
            power = min(range(len(zones)), key=lambda number: best[number].squares)
            if power == zone and best[zone].of_power < 0.0:
                yield (f"the power of zone {name!r} cools it, and zones are heaters: log it while the others rest, and "
                       "design it by itself with --cooler")
            elif best[power].is_heater and best[power].squares < _OTHERS * best[zone].squares:
                yield (f"zone {name!r} follows the power of zone {zones[power]!r}, not its own: name the columns of "
                       "its temperature and power alike")

    def _shown_balances(self, zone: int) -> list[_HeatBalance]:
        """Return a zone's best heat balance with the power of each zone; empty if no power shows in it."""
        powers, readings = range(len(self.courses)), self.readings[:, zone]
        others = [other for other in powers if other != zone]
        best = [min(self._balances(zone, power, others), key=attrgetter("squares")) for power in powers]
        idle = next(self._balances(zone, None, others)).squares
        is_moved = idle >= _MOVED * float(np.sum((readings - readings.mean()) ** 2))
        return best if is_moved and min(each.squares for each in best) <= _OTHERS * idle else []

    def _from_balance(self, zone: int, best: _HeatBalance | None, others: int) -> tuple[Array, list[float]]:
        if best is None:  # far from a heater: a start all the same
            lag = float(np.ptp(self.time_s)) / 10.0
            return np.array([math.log(0.5), math.log(lag), 0.0, self.readings[0, zone], self.readings[0, zone]]), [
                0.1] * others
        solution, dead = best.solution, best.dead_s
        lag = -1.0 / solution[1]
        return (np.array([math.log(solution[2] * lag), math.log(lag), dead, solution[0] * lag, self.readings[0, zone]]),
                [max(float(value) * lag, 0.01) for value in solution[4:]])

    def _energy(self, zone: int, dead_s: float) -> Array:
        """Return the integral of the delayed power [%·s]."""
        course = self.courses[zone]
        since = np.maximum(self.time_s[:, None] - course.instants_s - dead_s, 0.0)
        return np.asarray(course.first_pct * (self.time_s - self.time_s[0]) + since @ course.changes_pct)

    def simulate(self, layout: ParameterLayout, values: Sequence[Array]) -> Array:
        return simulate_many([layout.case(each) for each in values], self.time_s, self.courses)

    def fit(self, layout: ParameterLayout, start: Array) -> _NetworkFit:
        """Return the least-squares fit of all zones by Levenberg and Marquardt's method, weighted by their noise."""
        values, damping = start, 1e-3
        residuals = self.readings - self.simulate(layout, [values])[0]
        for _ in range(_MOST_STEPS):
            weights = 1.0 / np.maximum(residuals.std(axis=0), 1e-6)
            jacobian = self.jacobian(layout, values)
            weighted = (jacobian * weights[:, None]).reshape(-1, len(values))
            target = (residuals * weights).ravel()
            cost, moved = float(target @ target), False
            normal, slope = weighted.T @ weighted, weighted.T @ target
            for _ in range(8):
                step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
                step = np.clip(step, -self._most(layout), self._most(layout))
                tried = self._allowed(layout, values + step)
                errors = self.readings - self.simulate(layout, [tried])[0]
                if np.all(np.isfinite(errors)) and float(np.sum((errors * weights) ** 2)) < cost:
                    gained = cost - float(np.sum((errors * weights) ** 2))
                    values, residuals, damping, moved = tried, errors, damping / 5.0, True
                    break
                damping *= 6.0
            if not moved or gained < 1e-6 * cost:
                break
        return _NetworkFit(layout, values, residuals, self.jacobian(layout, values))

    def _most(self, layout: ParameterLayout) -> Array:
        """Return the largest change of each parameter in one step."""
        own = [0.7, 0.7, self.longest_s / 5.0, 50.0, 50.0, 0.7][: layout.per_zone]
        return np.array([*own * layout.size, *[1.0] * len(layout.pairs)])

    def _allowed(self, layout: ParameterLayout, values: Array) -> Array:
        """Return parameters with no dead time far below 0 and no coupling so far below 0 that the network runs away."""
        values = values.copy()
        dead = np.arange(layout.size) * layout.per_zone + 2
        values[dead] = np.clip(values[dead], -self.interval_s, self.longest_s)  # power logged up to a row late
        first = layout.size * layout.per_zone
        values[first:] = np.maximum(values[first:], -_most_below(layout))
        return values

    def jacobian(self, layout: ParameterLayout, values: Array) -> Array:
        """Return the derivatives of all temperatures, shape (rows, n, parameters)."""
        dead = 1e-3 * max(float(np.median(np.diff(self.time_s))), 1e-3)
        own = [1e-4, 1e-4, dead, 1e-2, 1e-2, 1e-4][: layout.per_zone]
        size = np.array([*own * layout.size, *[1e-4] * len(layout.pairs)])
        moved = [values, *(values + size[place] * np.eye(1, len(values), place)[0] for place in range(len(values)))]
        found = self.simulate(layout, moved)
        return np.asarray(np.moveaxis((found[1:] - found[0]) / size[:, None, None], 0, 2))

    def covariance(self, fit: _NetworkFit) -> Array:
        """Return the covariance of the parameters: of noise with its autocorrelation, and of when the power changed."""
        freedom = len(fit.residuals) - len(fit.values) / fit.layout.size
        variance = np.sum(fit.residuals**2, axis=0) / freedom
        inflated = variance * np.array([_inflation(each) for each in fit.residuals.T])
        weighted = (fit.jacobian / np.sqrt(inflated)[:, None]).reshape(-1, len(fit.values))
        scale = np.sqrt(np.sum(weighted**2, axis=0)) + 1e-30
        weighted /= scale
        late = (self.late_changes(fit) / np.sqrt(inflated)[:, None]).reshape(len(weighted), -1)
        normal, crossed = weighted.T @ weighted, weighted.T @ late
        normal -= crossed @ np.linalg.solve(late.T @ late + self._prior(), crossed.T)
        values, vectors = np.linalg.eigh(normal)  # what the log does not show has a variance without end, not none
        return np.asarray((vectors / np.maximum(values, _LEAST_SHOWN)) @ vectors.T / np.outer(scale, scale))

    def _prior(self) -> Array:
        """Return what is known of the instants of changes: any one since the row before, variance interval²/12."""
        return np.diag(12.0 / self._timed_spans() ** 2)

    def _timed_spans(self) -> Array:
        """Return within which span each timed change may have been, shape (changes,) [s]."""
        return np.concatenate([spans[timed] for spans, timed in zip(self.spans_s, self._timed(), strict=True)])

    def _timed(self) -> list[npt.NDArray[np.intp]]:
        """Return which changes of each zone's power are timed: the largest."""
        return [np.argsort(-np.abs(course.changes_pct))[:_CHANGES] for course in self.courses]

    def late_changes(self, fit: _NetworkFit) -> Array:
        """Return what it adds that a change of power comes later, shape (rows, n, changes) [°C/s]."""
        modes, dead_times_s, _ = fit.layout.case(fit.values)
        found = []
        for zone, (course, timed) in enumerate(zip(self.courses, self._timed(), strict=True)):
            since = self.time_s[:, None] - course.instants_s[timed] - dead_times_s[zone]
            decay = np.where(since > 0.0, np.exp(modes.rates[:, None, None] * np.maximum(since, 0.0)), 0.0)
            answer = np.tensordot(decay, modes.outputs * modes.inputs[:, zone], axes=(0, 1))
            found.append(-np.moveaxis(answer.real, 2, 1) * course.changes_pct[timed])
        return np.concatenate(found, axis=2)

    def timed(self, fit: _NetworkFit) -> tuple[_NetworkProblem, _NetworkFit]:
        """Return the problem with each change of power at the instant between its rows that explains the log best.

        Without it, power that changes between two rows leaves residuals that look like another heater's.
        """
        problem = self
        moved = np.zeros(sum(map(len, self._timed())))
        for _ in range(_ROUNDS):
            weights = 1.0 / np.maximum(fit.residuals.std(axis=0), 1e-6)[:, None]
            own = (fit.jacobian * weights).reshape(-1, len(fit.values))
            late = (problem.late_changes(fit) * weights).reshape(len(own), -1)
            both = np.hstack([own, late])
            normal = both.T @ both
            normal[len(fit.values):, len(fit.values):] += self._prior()
            slope = both.T @ (fit.residuals * weights[:, 0]).ravel()
            slope[len(fit.values):] -= self._prior() @ moved
            step = np.linalg.lstsq(normal, slope, rcond=None)[0][len(fit.values):]
            moved = np.clip(moved + step, -self._timed_spans(), self.interval_s)
            parts, courses = iter(np.split(moved, np.cumsum([len(timed) for timed in self._timed()]))), []
            for course, timed in zip(self.courses, self._timed(), strict=True):
                instants = course.instants_s.copy()
                instants[timed] += next(parts)
                courses.append(course._replace(instants_s=instants))
            problem = replace(self, courses=courses)
            fit = problem.fit(fit.layout, fit.values)
        return problem, fit

    def with_further_couplings(self, fit: _NetworkFit) -> _NetworkFit:
        """Return the fit with the couplings beyond the chain that explain the log better, the clearest first."""
        for _ in range(fit.layout.size):
            others = [pair for pair in neighbours("free", fit.layout.size) if pair not in fit.layout.pairs]
            if not others:
                break
            wider = fit.layout._replace(pairs=(*fit.layout.pairs, *others))
            values = np.append(fit.values, np.zeros(len(others)))
            weights = 1.0 / fit.residuals.std(axis=0)
            jacobian = (self.jacobian(wider, values) * weights[:, None]).reshape(-1, len(values))
            step, *_ = np.linalg.lstsq(jacobian, (fit.residuals * weights).ravel(), rcond=None)
            error = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
            place = int(np.argmax((step / error)[-len(others):]))
            layout = fit.layout._replace(pairs=(*fit.layout.pairs, others[place]))
            tried = self.fit(layout, np.append(fit.values, max(float(step[place - len(others)]), 0.01)))
            if _gain(fit, tried) < _SIGNIFICANT:
                break
            fit = tried
        return fit

    def with_second_lags(self, fit: _NetworkFit) -> _NetworkFit:
        """Return the fit with a second lag of each zone where it explains the log better.

        The larger lag may be the zone's own or that between heater and sensor: heat is exchanged after it or before.
        """
        if max(_inflation(each) for each in fit.residuals.T) < _WHITE:
            return fit
        own, _ = fit.layout.parts(fit.values)
        second = np.log(np.maximum(0.5 * own[:, 2], 0.02 * np.exp(own[:, 1])))
        start = np.column_stack([own, second])
        start[:, 2] = 0.5 * own[:, 2]
        exchanged = start[:, [0, 5, 2, 3, 4, 1]]
        layout = fit.layout._replace(second=True)
        both = (self.fit(layout, np.concatenate([each.ravel(), fit.values[own.size:]])) for each in (start, exchanged))
        wider = max(both, key=partial(_gain, fit))
        return wider if _gain(fit, wider) > _BIC * fit.layout.size and self._bounds_lags(wider) else fit

    def _bounds_lags(self, fit: _NetworkFit) -> bool:
        """Return whether a fit with second lags tells the size of each lag."""
        own = np.diag(self.covariance(fit))[: fit.layout.size * fit.layout.per_zone].reshape(fit.layout.size, -1)
        return bool(np.all(_NORMAL * np.sqrt(own[:, [1, 5]]) < math.log(_KNOWN)))


def _gain(fit: _NetworkFit, wider: _NetworkFit) -> float:
    """Return by how many points of -2·log likelihood a wider model explains the log better, correlation considered."""
    rows = len(fit.residuals) / max(_inflation(each) for each in wider.residuals.T)
    return rows * float(np.sum(np.log(np.mean(fit.residuals**2, axis=0) / np.mean(wider.residuals**2, axis=0))))


def _inflation(residuals: Array) -> float:
    """Return by how much the autocorrelation of residuals raises the variance of what is fitted."""
    centred = residuals - residuals.mean()
    rho = float(centred[1:] @ centred[:-1] / max(float(centred @ centred), 1e-30))
    rho = min(max(rho, 0.0), 0.98)
    return (1.0 + rho) / (1.0 - rho)


def _result(log: ZoneLog, problem: _NetworkProblem, fit: _NetworkFit) -> FittedNetwork:
    readings, (own, _), covariance = problem.readings, fit.layout.parts(fit.values), problem.covariance(fit)
    reach = _NORMAL * np.sqrt(np.diag(covariance)[: own.size].reshape(own.shape)[:, :2])
    for zone, ambient, known in zip(log.zones, own[:, 3], reach < math.log(_NO_HEATER), strict=True):
        if ambient < ABSOLUTE_ZERO_DEGC or not np.all(known):
            cause = "; ".join(problem.misread_powers(log.zones))
            raise InputError(f"{log.name}: the log does not show the heater of zone {zone!r}: {cause or _FROM_REST}")
    error = np.sqrt(np.sum(fit.residuals**2, axis=0) / np.sum((readings - readings.mean(axis=0)) ** 2, axis=0))
    fit_pct = tuple(100.0 * (1.0 - error))
    findings = [*_poor_findings(log, fit_pct, fit.residuals)]
    if findings:
        findings += [Finding(name="contradicted", message=cause) for cause in problem.misread_powers(log.zones)]
    fitted = FittedNetwork(
        network=fit.layout.network(log.zones, fit.values), layout=fit.layout, values=fit.values,
        covariance=covariance, late_s=_LATE_ROWS * log.interval_s,
        noise_degC=tuple(fit.residuals.std(axis=0)), fit_pct=fit_pct, residuals_degC=fit.residuals,
        log=log.name, interval_s=log.interval_s,
        setpoints_degC=None if log.setpoints_degC is None else tuple(log.setpoints_degC[-1]),
        highest_degC=tuple(readings.max(axis=0)))
    return replace(fitted, findings=(*log.findings, *findings, *_open_findings(fitted)))


def _poor_findings(log: ZoneLog, fit_pct: Sequence[float], residuals_degC: Array) -> Iterator[Finding]:
    """Yield which logs the network does not explain, residuals of shape (N, n)."""
    for zone, share, left, readings in zip(log.zones, fit_pct, residuals_degC.T, log.temperatures_degC.T, strict=True):
        noise = float(np.sqrt(np.mean(np.diff(left, 2) ** 2) / 6.0))
        noise = max(noise, (sensor_step(readings) or 0.0) / math.sqrt(12.0))
        message = f"the network explains {share:.3g} % of zone {zone}'s log"
        if share < _POOR_PCT:
            yield Finding(name="poor-fit", message=message)
        elif share < _GOOD_PCT and float(left.std()) > _MOST_LEFT * noise:
            yield Finding(name="poor-fit", message=(
                f"{message} and leaves {float(left.std()):.2g} °C, far more than noise; if zones share a slow mass, "
                "no network does better: log each zone while the others rest, and design each by itself"))


def _open_findings(fitted: FittedNetwork) -> Iterator[Finding]:
    """Yield which heaters the log does not bound."""
    for zone in fitted.network.zones:
        for name, what in (("gain_degC_per_pct", "gain"), ("time_constant_s", "time constant")):
            interval = fitted.ci95[f"{name} {zone}"]
            assert interval.low is not None
            assert interval.high is not None
            if interval.high > _WIDE * interval.low:
                yield Finding(name="unexplained-by-power", message=(
                    f"the log does not bound the {what} of zone {zone}: {interval.low:.3g} to {interval.high:.3g}"))
    first = fitted.layout.size * fitted.layout.per_zone
    for name, value in zip(fitted.couplings, fitted.values[first:], strict=True):
        high = fitted.ci95[f"exchange {name}"].high
        assert high is not None
        if high < -_COLDER:
            yield Finding(name="contradicted", message=(
                f"the exchange {name} would be below 0 ({high:.2g} at most), which no heat exchange is"))
        elif value <= -_most_below(fitted.layout) + _COLDER:
            yield Finding(name="contradicted", message=(
                f"the exchange {name} fits best at {value:.2g}, the end of its search, and none is below 0: the "
                "log does not tell the zones apart"))


def _most_below(layout: ParameterLayout) -> float:
    """Return how far below 0 an exchange may be during a fit; the network does not run away with it."""
    return _BELOW / max(layout.size - 1, 1)

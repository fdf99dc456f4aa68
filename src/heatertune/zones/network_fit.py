"""The fit of a thermal network to the readings of all zones at once, with the network's exact solution (output error).

A linear least-squares fit of the integrated heat balance, zone by zone, gives the start. The intervals take the slow
part of each zone's residuals into account, the instants of the changes of power between two rows, and by how much the
halves of the log differ.

Heaters on one supply: while another zone's heater is on, the voltage sags and a heater gives less power.

    q_i = u_i·(1 − Σ_j s_j·u_j / 100),   j ≠ i

s_j is the share of their power that all others lose while zone j is at full power: its current through the resistance
of supply and wires. u_i·u_j is the share of the time in which two PWMs of different clocks are on together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC
from heatertune.model.findings import Finding
from heatertune.model.power.uncertainty import LEAST_FREEDOM, colour
from heatertune.model.statistics import student_t
from heatertune.zones.network import Modes, ThermalNetwork, ZonePower, modes_of, neighbours, simulate_many

__all__ = [
    "NetworkFit", "NetworkProblem", "ParameterLayout", "SupplyFit", "explanation_gain", "fit_supply",
    "long_run_variance", "most_below", "power_courses", "variance_inflation",
]


_ROWS: Final = 1200  # readings used of each zone
_DEAD_TIMES: Final = 25  # tried for the start of the fit
_NORMAL: Final = 1.96
_SIGNIFICANT: Final = 25.0  # points that a coupling beyond the structure, or a share, has to gain: five standard errors
_BIC: Final = 10.0  # points that a second lag of each zone has to gain, for each parameter
_WHITE: Final = 1.25  # inflation below which residuals leave nothing to explain
_MOST_STEPS: Final = 40
_CHANGES: Final = 60  # of a zone's power, the largest, whose instants are fitted
_ROUNDS: Final = 3  # of that fit
_BELOW: Final = 0.4  # exchange below 0 that a fit may try, of all neighbours of a zone
_LEAST_SHOWN: Final = 1e-14  # of a direction of the parameters, relative to what the log shows of each
_HALF_SHOWN: Final = 0.01  # of what the log shows of a direction: a half that shows less has no say
_MEANS_OF: Final = (1, 2, 4)  # rows, whose correlation is looked at
_LEAST_MEANS: Final = 6.0  # for each parameter
_KNOWN: Final = 10.0  # ratio of an end of a lag's interval to the lag, beyond which the log does not show it
_OTHERS: Final = 0.25  # of the squares that no power, or the own one, leaves: less shows what heats or cools a zone
#: share of a heater's power that others may take
MOST_LOST: Final = 0.9
_MOVED: Final = 0.05  # of the squares of a zone's temperatures: more is left without the power that moves it


class ParameterLayout(NamedTuple):
    """Places of the parameters: of each zone log K, log T, L, a, the first temperature, also log of a second lag; c; s.

    Attributes:
        size: number of zones.
        pairs: (zone, neighbour) of each coupling.
        second: whether each zone has a second lag.
        sag: whether the heaters share a supply; then the share of each zone is the last of the parameters.
    """

    size: int
    pairs: tuple[tuple[int, int], ...]
    second: bool
    sag: bool = False

    @property
    def per_zone(self) -> int:
        """Parameters of a zone besides couplings."""
        return 6 if self.second else 5

    def parts(self, values: Array) -> tuple[Array, Array]:
        """Return the parameters by zone, shape (n, 5 or 6), and the matrix of the couplings, shape (n, n)."""
        own = values[: self.size * self.per_zone].reshape(self.size, self.per_zone)
        exchange = np.zeros((self.size, self.size))
        for (zone, other), value in zip(self.pairs, self.couplings(values), strict=True):
            exchange[zone, other] = value
        return own, exchange

    def couplings(self, values: Array) -> Array:
        """Return the parameters of the couplings, shape (c,)."""
        first = self.size * self.per_zone
        return values[first: first + len(self.pairs)]

    def moving(self, zone: int, count: int) -> list[int]:
        """Return the places of the parameters of a zone, of its couplings, and of the shares among `count`."""
        coupled = [self.size * self.per_zone + place for place, pair in enumerate(self.pairs) if pair[0] == zone]
        return [*range(zone * self.per_zone, (zone + 1) * self.per_zone), *coupled, *range(self.first_share, count)]

    @property
    def first_share(self) -> int:
        """Place of the share of the first zone, where the heaters share a supply."""
        return self.size * self.per_zone + len(self.pairs)

    def case(self, values: Array) -> tuple[Modes, Array, Array]:
        """Return what `simulate_many` takes, of parameters of shape (p,)."""
        own, exchange = self.parts(values)
        second = np.exp(own[:, 5]) if self.second else np.zeros(self.size)
        modes = modes_of(np.exp(own[:, 0]), np.exp(own[:, 1]), own[:, 3], exchange, second)
        return modes, own[:, 2], own[:, 4]

    def network(self, zones: tuple[str, ...], values: Array) -> ThermalNetwork:
        """Return the network of parameters, shape (p,); couplings, dead times, shares are >= 0, ambients >= 0 K."""
        own, exchange = self.parts(values)
        return ThermalNetwork(
            zones=zones, gains_degC_per_pct=tuple(np.exp(own[:, 0])), time_constants_s=tuple(np.exp(own[:, 1])),
            dead_times_s=tuple(np.maximum(own[:, 2], 0.0)),
            ambients_degC=tuple(np.maximum(own[:, 3], ABSOLUTE_ZERO_DEGC)),
            exchange=np.maximum(exchange, 0.0),
            second_time_constants_s=tuple(np.exp(own[:, 5])) if self.second else (),
            supply_shares=tuple(np.clip(values[self.first_share:], 0.0, MOST_LOST)) if self.sag else ())


class NetworkFit(NamedTuple):
    """A network fitted to readings.

    Attributes:
        layout: of the parameters.
        values: the parameters, shape (p,).
        residuals: readings less the temperatures of the network, shape (N, n) [°C].
        jacobian: derivatives of the temperatures by each parameter, shape (N, n, p).
    """

    layout: ParameterLayout
    values: Array
    residuals: Array
    jacobian: Array


class _HeatBalance(NamedTuple):
    squares: float  # [°C²], summed
    solution: Array  # of elapsed time, own temperature, power, one, and the temperatures of others less the own
    dead_s: float

    @property
    def is_heater(self) -> bool:
        """Whether the zone loses heat and its power heats it."""
        return bool(self.solution[1] < 0.0 < self.solution[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkProblem:
    """Readings of the log, thinned, and the power of each zone as logged."""

    time_s: Array
    readings: Array
    courses: Sequence[ZonePower]
    longest_s: float
    interval_s: float  # between rows of the log
    spans_s: Sequence[Array]  # before each change of a zone's power: within it, nobody knows when it changed

    @classmethod
    def from_readings(
        cls, time_s: Array, readings: Array, courses: Sequence[ZonePower], interval_s: float
    ) -> NetworkProblem:
        """Return the problem of readings of shape (N, n) at the instants, thinned, `interval_s` apart [°C, s]."""
        keep = slice(None, None, math.ceil(len(time_s) / _ROWS))
        before = [time_s[np.maximum(np.searchsorted(time_s, course.instants_s) - 1, 0)] for course in courses]
        spans_s = [np.maximum(course.instants_s - row, interval_s) for course, row in zip(courses, before, strict=True)]
        return cls(time_s=time_s[keep], readings=readings[keep], courses=courses,
                   longest_s=float(np.ptp(time_s)) / 4.0, interval_s=interval_s, spans_s=spans_s)

    def start(self, layout: ParameterLayout) -> Array:
        """Return parameters, shape (p,), by least squares on the integrated heat balance, of several dead times."""
        parameters = np.empty((layout.size, 5))
        couplings = []
        for zone in range(layout.size):
            others = [neighbour for first, neighbour in layout.pairs if first == zone]
            tried = (balance for balance in self._balances(zone, zone, others) if balance.is_heater)
            parameters[zone], strengths = self._from_balance(
                zone, min(tried, key=attrgetter("squares"), default=None), len(others))
            couplings += strengths
        return np.concatenate([parameters.ravel(), couplings])

    def weak_exchange_start(self, layout: ParameterLayout) -> Array | None:
        """Return parameters with second lags and a weak exchange, shape (p,), as the heat balances give the others.

        A short log may leave exchange and losses open together, and one without the lags be explained by either. None
        where a balance shows no heater.
        """
        own = []
        for zone in range(layout.size):
            others = [other for first, other in layout.pairs if first == zone]
            tried = (each for each in self._balances(zone, zone, others, _EXCHANGE_AT_START) if each.is_heater)
            best = min(tried, key=attrgetter("squares"), default=None)
            if best is None:
                return None
            (gain, lag, dead, *rest), _ = self._from_balance(zone, best, 0)
            own.append([gain, lag, _OF_DEAD_TIME * dead, *rest,
                        math.log(max(_OF_DEAD_TIME * dead, _OF_LAG * math.exp(lag)))])
        return np.concatenate([np.array(own).ravel(), np.full(len(layout.pairs), _EXCHANGE_AT_START)])

    def _balances(self, zone: int, power: int | None, others: Sequence[int], exchange: float | None = None
                  ) -> Iterator[_HeatBalance]:
        """Yield a zone's integrated heat balance with the power of a zone, or none, at several dead times.

        Args:
            zone: its number.
            power: number of the zone whose power heats it; None: of none.
            others: its neighbours.
            exchange: with each of these; None: what explains the readings best.
        """
        steps = np.diff(self.time_s)
        integral = np.vstack([np.zeros(len(self.courses)), np.cumsum(
            0.5 * (self.readings[1:] + self.readings[:-1]) * steps[:, None], axis=0)])
        elapsed = self.time_s - self.time_s[0]
        for dead in (0.0, *np.geomspace(0.5 * float(np.median(steps)), self.longest_s, _DEAD_TIMES)):
            exchanged: list[Array] = [integral[:, other] - integral[:, zone] for other in others]
            own = integral[:, zone]
            if exchange is not None:
                own, exchanged = own - exchange * np.sum(exchanged, axis=0), []
            energy = 0.0 * elapsed if power is None else self._energy(power, float(dead))
            columns = np.column_stack([elapsed, own, energy, np.ones(len(elapsed)), *exchanged])
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
            if power == zone and best[zone].solution[2] < 0.0:
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
        """Return the temperatures of networks of several parameters, shape (len(values), N, n) [°C]."""
        return simulate_many([layout.case(each) for each in values], self.time_s, self.courses)

    def fit(self, layout: ParameterLayout, start: Array) -> NetworkFit:
        """Return the least-squares fit by Levenberg and Marquardt's method, from parameters of shape (p,)."""
        values, residuals = _least_squares(
            start, lambda values: self.readings - self.simulate(layout, [values])[0], partial(self.jacobian, layout),
            lambda values, *system: self.within_limits(layout, values, np.asarray(np.linalg.solve(*system))),
            _MOST_STEPS)
        return NetworkFit(layout, values, residuals, self.jacobian(layout, values))

    def within_limits(self, layout: ParameterLayout, values: Array, step: Array) -> Array:
        """Return parameters a step further, both of shape (p,), as far as one step may go."""
        return self._allowed(layout, values + np.clip(step, -self._most(layout), self._most(layout)))

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
        values[first:] = np.maximum(values[first:], -most_below(layout))
        return values

    def jacobian(self, layout: ParameterLayout, values: Array) -> Array:
        """Return the derivatives of all temperatures, shape (rows, n, parameters)."""
        dead = 1e-3 * max(float(np.median(np.diff(self.time_s))), 1e-3)
        steps = [1e-4, 1e-4, dead, 1e-2, 1e-2, 1e-4][: layout.per_zone]
        size = np.array([*steps * layout.size, *[1e-4] * len(layout.pairs)])
        moved = [values, *(values + size[place] * np.eye(1, len(values), place)[0] for place in range(len(values)))]
        temperatures = self.simulate(layout, moved)
        return np.asarray(np.moveaxis((temperatures[1:] - temperatures[0]) / size[:, None, None], 0, 2))

    def covariance(self, fit: NetworkFit) -> Array:
        """Return the covariance of the parameters, shape (p, p): of slow errors, and of when the power changed.

        It is as much larger as the halves of the log differ more than their errors explain (Birge's ratio).
        """
        count, layout = fit.jacobian.shape[-1], fit.layout
        errors = np.sqrt([long_run_variance(left, fit.jacobian[:, zone, layout.moving(zone, count)])
                          for zone, left in enumerate(fit.residuals.T)])
        columns = np.dstack([fit.jacobian, self.late_changes(fit), fit.residuals]) / np.maximum(errors, 1e-9)[:, None]
        scale = np.sqrt(np.sum(columns[:, :, :count] ** 2, axis=(0, 1))) + 1e-30
        columns[:, :, :count] /= scale
        halves = [half.T @ half for half in (
            part.reshape(-1, columns.shape[-1]) for part in np.array_split(columns, 2))]
        normal, slope = self._without_late(halves[0] + halves[1], count)
        values, vectors = np.linalg.eigh(normal)  # what the log does not show has a variance without end, not none
        root = vectors / np.sqrt(np.maximum(values, _LEAST_SHOWN))
        step, apart, explained = root @ (root.T @ slope), 0.0, 1.0
        for normal, slope in (self._without_late(half, count) for half in halves):
            shown, turned = np.linalg.eigh(root.T @ normal @ root)
            shown = np.clip(shown, 0.0, 1.0)
            apart += float(np.sum(((slope - normal @ step) @ root @ turned) ** 2 / (shown + _HALF_SHOWN)))
            explained += float(np.sum(shown * (1.0 - shown) / (shown + _HALF_SHOWN)))
        return np.asarray(max(apart / explained, 1.0) * (root @ root.T) / np.outer(scale, scale))

    def _without_late(self, products: Array, count: int) -> tuple[Array, Array]:
        """Return normal matrix and slope of the first parameters, whenever the power changed between its rows.

        Args:
            products: of the derivatives by parameters and instants, and of the residuals, shape (m, m).
            count: number of parameters.
        """
        late = slice(count, -1)
        gain = np.linalg.solve(products[late, late] + self._prior(), products[late])
        left = products - products[:, late] @ gain
        return left[:count, :count], left[:count, -1]

    def _prior(self) -> Array:
        """Return what is known of the instants of changes: any one since the row before, variance interval²/12."""
        return np.diag(12.0 / self._timed_spans() ** 2)

    def _timed_spans(self) -> Array:
        """Return within which span each timed change may have been, shape (changes,) [s]."""
        return np.concatenate([spans[timed] for spans, timed in zip(self.spans_s, self._timed(), strict=True)])

    def _timed(self) -> list[npt.NDArray[np.intp]]:
        """Return which changes of each zone's power are timed: the largest."""
        return [np.argsort(-np.abs(course.changes_pct))[:_CHANGES] for course in self.courses]

    def late_changes(self, fit: NetworkFit) -> Array:
        """Return what it adds that a change of power comes later, shape (rows, n, changes) [°C/s]."""
        modes, dead_times_s, _ = fit.layout.case(fit.values)
        responses = []
        for zone, (course, timed) in enumerate(zip(self.courses, self._timed(), strict=True)):
            since = self.time_s[:, None] - course.instants_s[timed] - dead_times_s[zone]
            decay = np.where(since > 0.0, np.exp(modes.rates[:, None, None] * np.maximum(since, 0.0)), 0.0)
            answer = np.tensordot(decay, modes.outputs * modes.inputs[:, zone], axes=(0, 1))
            responses.append(-np.moveaxis(answer.real, 2, 1) * course.changes_pct[timed])
        return np.concatenate(responses, axis=2)

    def timed(self, fit: NetworkFit) -> tuple[NetworkProblem, NetworkFit]:
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

    def is_explained_by(self, pairs: Sequence[tuple[int, int]]) -> bool:
        """Return whether the heat balances with the exchange of these pairs leave little more than with that of all."""
        zones = range(len(self.courses))
        near, every = ([min(each.squares for each in self._balances(zone, zone, [
            other for first, other in chosen if first == zone])) for zone in zones]
            for chosen in (pairs, neighbours("free", len(zones))))
        return bool(np.all(np.array(every) >= _OTHERS * np.array(near)))

    def lacks_couplings(self, fit: NetworkFit) -> bool:
        """Return whether a coupling beyond those of a fit, linearised there, explains the log clearly better."""
        others = [pair for pair in neighbours("free", fit.layout.size) if pair not in fit.layout.pairs]
        wider = fit.layout._replace(pairs=(*fit.layout.pairs, *others))
        weights = 1.0 / fit.residuals.std(axis=0)
        values = np.append(fit.values, np.zeros(len(others)))
        jacobian = (self.jacobian(wider, values) * weights[:, None]).reshape(-1, len(values))
        step, *_ = np.linalg.lstsq(jacobian, (fit.residuals * weights).ravel(), rcond=None)
        error = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
        return bool(np.any((step / error)[len(fit.values):] ** 2 > _SIGNIFICANT))

    def with_clear_couplings(self, fit: NetworkFit, pairs: Sequence[tuple[int, int]]) -> NetworkFit:
        """Return the fit with these couplings and, of all others, with those alone that a fit shows clearly.

        Args:
            fit: of a free network.
            pairs: couplings that are kept in any case.
        """
        first, error = fit.layout.size * fit.layout.per_zone, np.sqrt(np.diag(self.covariance(fit)))
        clear = fit.values > math.sqrt(_SIGNIFICANT) * error
        index = [place for place, pair in enumerate(fit.layout.pairs, start=first) if pair in pairs or clear[place]]
        layout = fit.layout._replace(pairs=tuple(fit.layout.pairs[place - first] for place in index))
        return self.fit(layout, np.concatenate([fit.values[:first], fit.values[index]]))

    def with_second_lags(self, fit: NetworkFit) -> NetworkFit:
        """Return the fit with a second lag of each zone where it explains the log better.

        The larger lag may be the zone's own or that between heater and sensor: heat is exchanged after it or before.
        """
        if max(variance_inflation(each) for each in fit.residuals.T) < _WHITE:
            return fit
        own, _ = fit.layout.parts(fit.values)
        second = np.log(np.maximum(0.5 * own[:, 2], 0.02 * np.exp(own[:, 1])))
        start = np.column_stack([own, second])
        start[:, 2] = 0.5 * own[:, 2]
        exchanged = start[:, [0, 5, 2, 3, 4, 1]]
        layout = fit.layout._replace(second=True)
        both = (self.fit(layout, np.concatenate([each.ravel(), fit.values[own.size:]])) for each in (start, exchanged))
        wider = max(both, key=partial(explanation_gain, fit))
        return wider if explanation_gain(fit, wider) > _BIC * fit.layout.size and self.bounds_lags(wider) else fit

    def bounds_lags(self, fit: NetworkFit) -> bool:
        """Return whether a fit with second lags tells the size of each lag."""
        own = np.diag(self.covariance(fit))[: fit.layout.size * fit.layout.per_zone].reshape(fit.layout.size, -1)
        return bool(np.all(_NORMAL * np.sqrt(own[:, [1, 5]]) < math.log(_KNOWN)))


def _least_squares(
    start: Array, residuals_of: Callable[[Array], Array], jacobian_of: Callable[[Array], Array],
    step_within: Callable[[Array, Array, Array], Array], most_steps: int,
) -> tuple[Array, Array]:
    """Return parameters, shape (p,), and residuals, shape (N, n), by Levenberg and Marquardt's method.

    Args:
        start: parameters where the search begins.
        residuals_of: parameters → readings less temperatures, shape (N, n).
        jacobian_of: parameters → derivatives of the temperatures, shape (N, n, p).
        step_within: parameters, damped normal matrix and slope → parameters a step further, within their limits.
        most_steps: at most so many.
    """
    values, damping = start, 1e-3
    residuals = residuals_of(values)
    for _ in range(most_steps):
        weights = 1.0 / np.maximum(residuals.std(axis=0), 1e-6)
        weighted = (jacobian_of(values) * weights[:, None]).reshape(-1, len(values))
        target, gained = (residuals * weights).ravel(), 0.0
        normal, slope, cost = weighted.T @ weighted, weighted.T @ target, float(target @ target)
        for _ in range(8):
            tried = step_within(values, normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
            errors = residuals_of(tried)
            gained = cost - float(np.sum((errors * weights) ** 2))
            if np.all(np.isfinite(errors)) and gained > 0.0:
                values, residuals, damping = tried, errors, damping / 5.0
                break
            damping *= 6.0
        if not gained > 1e-6 * cost:
            break
    return values, residuals


def long_run_variance(residuals: Array, moves: Array) -> float:
    """Return the variance of white noise that would leave parameters as uncertain as the slow part of residuals does.

    Quick noise hides slow errors from the correlation of neighbours, so means of several rows are looked at, too. A
    fit follows slow errors, which its residuals then lack; few rows that differ bound a variance badly (Student's t).

    Args:
        residuals: of a zone, shape (N,) [°C].
        moves: derivatives of its temperature by its own parameters, shape (N, p).
    """
    variances = []
    for rows in _MEANS_OF:
        count = len(residuals) // rows
        if rows == 1 or count >= _LEAST_MEANS * moves.shape[1]:
            means = residuals[: count * rows].reshape(count, rows).mean(axis=1)
            base, _ = np.linalg.qr(moves[: count * rows].reshape(count, rows, -1).mean(axis=1))
            rho, variance = colour(means, base)
            variances.append(rows * variance * (1.0 + rho) / (1.0 - rho))
    freedom = float(residuals @ residuals) / max(*variances, 1e-30) - moves.shape[1]
    return max(variances) * (student_t(max(freedom, LEAST_FREEDOM)) / _NORMAL) ** 2


def explanation_gain(fit: NetworkFit, wider: NetworkFit) -> float:
    """Return by how many points of -2·log likelihood a wider model explains the log better, correlation considered."""
    rows = len(fit.residuals) / max(variance_inflation(each) for each in wider.residuals.T)
    return rows * float(np.sum(np.log(np.mean(fit.residuals**2, axis=0) / np.mean(wider.residuals**2, axis=0))))


def variance_inflation(residuals: Array) -> float:
    """Return by how much the autocorrelation of residuals, shape (N,), raises the variance of what is fitted."""
    centred = residuals - residuals.mean()
    rho = float(centred[1:] @ centred[:-1] / max(float(centred @ centred), 1e-30))
    rho = min(max(rho, 0.0), 0.98)
    return (1.0 + rho) / (1.0 - rho)


def most_below(layout: ParameterLayout) -> float:
    """Return how far below 0 an exchange may be during a fit; the network does not run away with it."""
    return _BELOW / max(layout.size - 1, 1)


_MOST_SUPPLY_STEPS: Final = 100
#: where the search for a shared supply begins, too: exchange, share, and second lag as part of a dead time or lag
_EXCHANGE_AT_START: Final = 0.2
_SHARES_AT_START: Final = (0.2, 0.4)
_OF_DEAD_TIME, _OF_LAG = 0.5, 0.02
_LEAST_LOST: Final = 0.02  # below it a share is no sag of a supply



class SupplyFit(NamedTuple):
    """A network whose heaters share a supply.

    Attributes:
        problem: with the powers that reach the heaters.
        fit: its Jacobian is by the shares, too.
        shares: of their power that all other zones lose while a zone is at full power, shape (n,).
        reach: half of the 95 % interval of each, shape (n,).
    """

    problem: NetworkProblem
    fit: NetworkFit
    shares: Array
    reach: Array

    def explains_more(self, fit: NetworkFit) -> bool:
        """Return whether a sag of the supply explains the log clearly better than a fit without it."""
        return bool(explanation_gain(fit, self.fit) > _SIGNIFICANT * len(self.shares)
                    and np.any(self.shares - self.reach > _LEAST_LOST) and np.all(self.shares + self.reach > 0.0)
                    and np.all(self.shares + self.reach < 1.0))

    @property
    def whole(self) -> NetworkFit:
        """The fit with the shares among its parameters."""
        layout, values = self.fit.layout._replace(sag=True), np.concatenate([self.fit.values, self.shares])
        return NetworkFit(layout, values, self.fit.residuals, self.fit.jacobian)

    def findings(self, zones: Sequence[str]) -> Iterator[Finding]:
        """Yield which zones take power from the others."""
        for zone, share, reach in zip(zones, self.shares, self.reach, strict=True):
            if share - reach > _LEAST_LOST:
                yield Finding(name="shared-supply", message=(
                    f"while the heater of zone {zone} is on, each other heater gives {100.0 * share:.3g} % less "
                    f"power ({100.0 * (share - reach):.3g}…{100.0 * (share + reach):.3g} %)"))


def power_courses(courses: Sequence[ZonePower], shares: Array) -> list[ZonePower]:
    """Return the powers that reach the heaters, each with a change wherever that of any zone changes.

    Args:
        courses: power of each zone as logged.
        shares: of their power that all others lose while a zone is at full power, shape (n,).
    """
    instants = np.unique(np.concatenate([course.instants_s for course in courses]))
    levels = np.column_stack([
        course.first_pct + np.concatenate([[0.0], np.cumsum(course.changes_pct)])[
            np.searchsorted(course.instants_s, instants, side="right")] for course in courses])
    levels = np.vstack([[course.first_pct for course in courses], levels])
    lost = levels * shares / 100.0
    left = levels * (1.0 - (lost.sum(axis=1, keepdims=True) - lost))
    return [ZonePower(float(own[0]), instants, np.diff(own)) for own in left.T]


def fit_supply(problem: NetworkProblem, fit: NetworkFit) -> SupplyFit:
    """Return the least-squares fit of a network and of the shares that its zones take from each other.

    Args:
        problem: with the powers as logged.
        fit: of a network without a sag of the supply, where the search begins.
    """
    best = _refined(problem, fit, np.zeros(fit.layout.size))
    wider = best.problem.with_second_lags(best.fit)
    if wider is not best.fit:
        best = _refined(problem, wider, best.shares)
    elif max(variance_inflation(column) for column in best.fit.residuals.T) < _WHITE:
        return best
    for share in _SHARES_AT_START:
        shares = np.full(fit.layout.size, share)
        start = _with_shares(problem, shares).weak_exchange_start(fit.layout)
        if start is not None:
            tried = _refined(problem, fit._replace(layout=fit.layout._replace(second=True), values=start), shares)
            if explanation_gain(best.fit, tried.fit) > _SIGNIFICANT and tried.problem.bounds_lags(tried.fit):
                best = tried
    return best


def _with_shares(problem: NetworkProblem, shares: Array) -> NetworkProblem:
    """Return the problem with the powers that reach the heaters."""
    _, places = np.unique(np.concatenate([course.instants_s for course in problem.courses]), return_index=True)
    spans = np.concatenate(problem.spans_s)[places]
    return replace(problem, courses=power_courses(problem.courses, shares), spans_s=[spans] * len(problem.courses))


def _refined(problem: NetworkProblem, fit: NetworkFit, shares: Array) -> SupplyFit:
    """Return the fit of parameters and shares together, by Levenberg and Marquardt's method."""
    layout, count = fit.layout, len(fit.values)
    solution, residuals = _least_squares(
        np.concatenate([fit.values, shares]), partial(_residuals, problem, layout), partial(_jacobian, problem, layout),
        partial(_step_within, problem, layout), _MOST_SUPPLY_STEPS)
    jacobian = _jacobian(problem, layout, solution)
    sag_problem = _with_shares(problem, solution[count:])
    network_fit = NetworkFit(layout, solution[:count], residuals, jacobian)
    reach = _NORMAL * np.sqrt(np.diag(sag_problem.covariance(network_fit))[count:])
    return SupplyFit(sag_problem, network_fit, solution[count:], reach)


def _step_within(problem: NetworkProblem, layout: ParameterLayout, both: Array, normal: Array, slope: Array) -> Array:
    """Return parameters and shares a step further; one that would leave its limit stays, and moves no other."""
    count, free = len(both) - layout.size, np.ones(len(both), dtype=bool)
    while True:
        step = np.zeros(len(both))
        step[free] = np.linalg.solve(normal[np.ix_(free, free)], slope[free])
        tried = np.concatenate([
            problem.within_limits(layout, both[:count], step[:count]),
            np.clip(both[count:] + np.clip(step[count:], -0.2, 0.2), -MOST_LOST, MOST_LOST)])
        stopped = free & (tried == both) & (step != 0.0)
        if not np.any(stopped) or np.all(stopped == free):
            return tried
        free &= ~stopped


def _residuals(problem: NetworkProblem, layout: ParameterLayout, both: Array) -> Array:
    values, shares = both[: -layout.size], both[-layout.size:]
    return np.asarray(problem.readings - _with_shares(problem, shares).simulate(layout, [values])[0])


def _jacobian(problem: NetworkProblem, layout: ParameterLayout, both: Array) -> Array:
    """Return the derivatives of all temperatures by parameters and shares, shape (rows, n, parameters + n)."""
    size = 1e-3
    by_share = [-(_residuals(problem, layout, moved) - _residuals(problem, layout, both)) / size
                for moved in both + size * np.eye(len(both))[-layout.size:]]
    own = _with_shares(problem, both[-layout.size:]).jacobian(layout, both[: -layout.size])
    return np.concatenate([own, np.moveaxis(np.array(by_share), 0, 2)], axis=2)

"""Independent models of a real heater's log: exact responses of one and two lags behind a dead time, by least squares.

Nothing of heatertune is used. The power is held between its readings, also before the part that is fitted. The ambient
is free; so is the state at the part's beginning, but where a log begins at rest, and the ambient drifts where that pays.
A model whose power does nothing that a free state or a drift could not do as well says nothing of the heater, and is
none. Readings lie on an even grid: the logs' own intervals differ little.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from tests.bench.heaters import Heater

LEAST_FIT_PCT = 80.0  # below that a model is no witness
_MOST_RESIDUALS = 1500
_STARTS = 4  # of the best places of the grid
_APART = 1.02  # least ratio of two lags
_OWN = 0.05  # least share of the power's effect that initial state, ambient and drift cannot make
_RULED_OUT = 10.0  # BIC behind the best


@dataclass(frozen=True)
class Record:
    """A log, or a part of one that knows the power before it.

    Attributes:
        interval: mean, between readings [s].
        power: of the whole log [%].
        temperature: of the whole log [°C].
        first, last: readings of the part, last exclusive.
    """

    interval: float
    power: np.ndarray
    temperature: np.ndarray
    first: int
    last: int

    @property
    def seconds(self):
        """How long the part is."""
        return (self.last - self.first) * self.interval


@dataclass(frozen=True)
class Witness:
    """A model of a part.

    Attributes:
        form: its lags, and what else was free.
        heater: gain, lags, dead time and ambient.
        fit_pct: share of the readings' standard deviation that it explains.
    """

    form: str
    heater: Heater
    fit_pct: float


@dataclass(frozen=True)
class _Problem:
    record: Record
    before: float  # power before the log [%]
    resting: bool
    drifting: bool
    order: int

    def columns(self, dead, lags):
        """Return what each free number adds to the temperature: gain, ambient, states at the beginning, drift."""
        record = self.record
        responses = [_one_lag(record.power, self.before, record.interval, dead, lag) for lag in lags]
        if len(lags) == 2:
            responses = [(lags[0] * responses[0] - lags[1] * responses[1]) / (lags[0] - lags[1])]
        rows = np.arange(record.first, record.last, max(1, (record.last - record.first) // _MOST_RESIDUALS))
        since = (rows - record.first) * record.interval
        states = [] if self.resting else [np.exp(-since / lag) for lag in lags]
        drift = [since / since[-1]] if self.drifting else []
        return np.column_stack([responses[0][rows], np.ones(len(rows)), *states, *drift]), record.temperature[rows]

    def solved(self, dead, lags):
        """Return the free numbers and the residuals."""
        a, y = self.columns(dead, lags)
        scale = np.maximum(np.linalg.norm(a, axis=0), 1e-300)
        found = np.linalg.lstsq(a / scale, y, rcond=1e-9)[0]
        return found / scale, y - a / scale @ found

    def own_share(self, dead, lags):
        """Return which share of the power's effect the other free numbers cannot make."""
        a, _ = self.columns(dead, lags)
        effect, others = a[:, 0], a[:, 1:]
        rest = effect - others @ np.linalg.lstsq(others, effect, rcond=1e-9)[0]
        return float(np.std(rest) / max(np.std(effect), 1e-300))

    def unpacked(self, x):
        """Return dead time and lags of the search's numbers."""
        longest = math.exp(x[1])
        return x[0], ((longest,) if len(x) == 2 else (longest, longest / (_APART + math.exp(x[2]))))

    def cost(self, x):
        """Return the log of the mean square; outside the search's box a wall."""
        dead, lags = self.unpacked(x)
        low, high = 0.2 * self.record.interval, 20.0 * self.record.seconds
        if not 0.0 <= dead <= 0.5 * self.record.seconds or lags[0] > high or lags[-1] < low:
            return 1e3
        numbers, rest = self.solved(dead, lags)
        return math.log(float(rest @ rest) / len(rest) + 1e-12) if numbers[0] > 0.0 else 1e2

    def best(self):
        """Return the search's numbers of the best model, None where none heats."""
        seconds = self.record.seconds
        deads = (0.0, *np.geomspace(0.5 * self.record.interval, 0.3 * seconds, 9))
        lags = np.log(np.geomspace(2.0 * self.record.interval, 5.0 * seconds, 10))
        apart = [()] if self.order == 1 else [(math.log(r),) for r in (0.1, 2.0, 20.0)]
        grid = sorted(([dead, lag, *ratio] for dead, lag, ratio in product(deads, lags, apart)), key=self.cost)
        ends = [minimize(self.cost, start, method="Nelder-Mead", options={
            "xatol": 1e-4, "fatol": 1e-7, "maxfev": 400, "initial_simplex": self._simplex(start)})
            for start in grid[:_STARTS]]
        found = min(ends, key=lambda end: end.fun)
        return found.x if found.fun < 1e2 else None

    def _simplex(self, start):
        steps = [max(0.2 * start[0], 0.7 * self.record.interval), *([0.4] * (len(start) - 1))]
        return np.vstack([start, *(np.array(start) + step * row for step, row in zip(steps, np.eye(len(start)), strict=True))])


def _one_lag(power, before, interval, dead, lag):
    """Return the response of one lag to a held, late power, at the readings; at rest on `before` at the beginning."""
    whole = math.floor(dead / interval + 1e-12)
    late = dead - whole * interval
    known = np.concatenate([np.full(whole + 1, before), power])[: len(power)]  # u(k − whole − 1)
    after = np.concatenate([np.full(whole, before), power])[: len(power)]  # u(k − whole)
    past, rest = math.exp(-interval / lag), math.exp(-(interval - late) / lag)
    driven = known * (rest - past) + after * (1.0 - rest)
    return np.concatenate([[before], lfilter([1.0], [1.0, -past], driven, zi=[past * before])[0][:-1]])


def _independent(rest):
    """Return how many independent residuals there are, by the correlation of neighbours."""
    near = max(0.0, float(rest[1:] @ rest[:-1]) / max(float(rest @ rest), 1e-300))
    return max(4.0, len(rest) * (1.0 - near) / (1.0 + near))


@dataclass(frozen=True)
class _Solved:
    witness: Witness
    free: int
    rest: np.ndarray

    def bic(self, count):
        """Return BIC with so many independent residuals."""
        return count * math.log(float(self.rest @ self.rest) / len(self.rest) + 1e-12) + self.free * math.log(count)


def _solved(problem):
    x = problem.best()
    if x is None:
        return None
    dead, lags = problem.unpacked(x)
    if problem.own_share(dead, lags) < _OWN:
        return None
    numbers, rest = problem.solved(dead, lags)
    y = problem.columns(dead, lags)[1]
    fit = 100.0 * (1.0 - float(np.linalg.norm(rest) / np.linalg.norm(y - y.mean())))
    said = [("one lag", "two lags")[problem.order - 1], *["at rest"] * problem.resting, *["drift"] * problem.drifting]
    heater = Heater(gain=float(numbers[0]), lags=lags, dead=float(dead), ambient=float(numbers[1]))
    return _Solved(Witness(", ".join(said), heater, fit), len(x) + len(numbers), rest)


def _problems(record, order):
    """Return what may be free: before a log and at its beginning more is possible than within it.

    A power that never changes within the part had its edge before it, and a free state could make all of that.
    """
    changes = np.ptp(record.power[record.first : record.last]) > 0.0
    if record.first > 0:
        ways = [(0.0, False)] if changes else []
    else:
        ways = [(before, rests) for before in {0.0, float(record.power[0])} for rests in (True, False) if rests or changes]
    return [_Problem(record, *way, drifting, order) for way in ways for drifting in (False, True)]


def witnesses(record):
    """Return the models of a part that explain it and that it does not rule out, of each number of lags the best."""
    tried = [_solved(problem) for order in (1, 2) for problem in _problems(record, order)]
    found = [each for each in tried if each is not None]
    if not found:
        return []
    count = _independent(min(found, key=lambda each: float(each.rest @ each.rest)).rest)
    bests = [min(same, key=lambda each: each.bic(count)) for order in (1, 2)
             if (same := [each for each in found if len(each.witness.heater.lags) == order])]
    least = min(each.bic(count) for each in bests)
    return [each.witness for each in bests
            if each.bic(count) < least + _RULED_OUT and each.witness.fit_pct >= LEAST_FIT_PCT]

"""Fit several logs of one heater with power: each log alone first, then one heater for all, and a test of agreement.

Gain, lags and dead time are shared; ambient, drift, initial state and loads are solved for each log inside the search.
A log is weighted by its long-run noise, so a long, noisy log does not dominate a short, quiet one. Intervals come from
profile likelihood and block bootstrap; residuals of each log have their own variance and colour, and resampled blocks
stay within their log.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.model.diagnostics import Remark, fast_remarks, findings_of, poor_remarks
from heatertune.model.least_squares import Minima, ResidualFunction, minimise
from heatertune.model.model_values import Candidate, FittedModel, Fopdt, HeaterModel, OneLog, Residuals
from heatertune.model.power.candidates import lies_inside, open_ends, second_is_seen, widen_intervals
from heatertune.model.power.disturbance_fit import bic_of
from heatertune.model.power.explanation import Explanation, alias_remarks
from heatertune.model.power.fit_checks import agreement_remarks, checks_in_place, disagreements
from heatertune.model.power.fit_power import (
    TWO_LAGS_SHOWN,
    WeighedFit,
    limit_notes,
    log_notes,
    longest_hold_s,
    outcome_of,
    rival_notes,
    share_remarks,
    values_at_ends,
    values_of,
    weigh_fit,
)
from heatertune.model.power.nonlinear import bend_remarks
from heatertune.model.power.open_loop import FixedUnknowns, PowerFit, PowerProblem, parameters_on_bounds
from heatertune.model.power.regressors import AMBIENT, DRIFT, GAIN
from heatertune.model.power.two_scales_fit import TwoScaleFit, fit_two_scales
from heatertune.model.power.uncertainty import (
    LEAST_FREEDOM,
    READINGS,
    STEPS,
    AtEnd,
    bound_crossing,
    colour,
    distinct_candidates,
    ends_of,
)
from heatertune.model.reduction import half_rule_intervals
from heatertune.model.statistics import (
    RATIO,
    Interval,
    ar1_bic,
    ar1_weighted,
    autocorrelation,
    block_resamples,
    envelope,
    fit_pct,
    hull,
    identified_parts,
    interval,
    long_run_noise,
    student_t,
)

__all__ = [
    "DEAD", "FIRST_AMBIENT", "LAG", "POWER", "JointFit", "JointProblem", "fit_logs", "joint_fit_at", "joint_intervals",
    "two_scales_of_logs",
]


#: indices in a vector: ln gain (or ln gain per lag), ln first lag, dead time, ratio of the second lag; then, as
#: an additional unknown, the first log's ambient
POWER, LAG, DEAD, SECOND, FIRST_AMBIENT = 0, 1, 2, 3, 4

_FAR_AMBIENT = 10.0  # spans of the first log, about its best ambient
_FAR = 1e3  # times the largest gain of a log alone, and its inverse of the least, the search goes no further


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointFit:
    """The best heater of one order for all logs.

    Attributes:
        vector: see the places above.
        parts: each log's own fit, with the shared numbers held.
    """

    vector: Array
    parts: tuple[PowerFit, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointProblem:
    """Logs of one heater as a bounded least-squares problem.

    Shapes of the arrays: a vector of the shared parameters (4,), or (5,) with the first log's ambient, see the indices
    above; starts (n, 4) or (n, 5); readings (m,), one log after the other, stacked (…, m).

    Attributes:
        parts: one problem for each log, all of one lag or all of two.
        weights: of each log, the inverse of its noise [1/°C].
        low, high: bounds of the shared vector.
    """

    parts: tuple[PowerProblem, ...]
    weights: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, parts: Sequence[PowerProblem], fits: Sequence[PowerFit]) -> JointProblem:
        """Return the joint problem of logs with known individual fits."""
        gains = [math.log(fit.linear[GAIN]) for fit in fits]
        low = np.min([part.low for part in parts], axis=0)
        high = np.max([part.high for part in parts], axis=0)
        return cls(
            parts=tuple(parts), weights=np.array([1.0 / long_run_noise(p.readings.temperature_degC, f.simulated_degC)
                                                 for p, f in zip(parts, fits, strict=True)]),
            low=np.array([min(gains) - math.log(_FAR), *low]), high=np.array([max(gains) + math.log(_FAR), *high]),
        )

    @property
    def records(self) -> Array:
        """The readings of all logs, one log after the other [°C], shape (m,)."""
        return np.concatenate([part.readings.temperature_degC for part in self.parts])

    def average(self, most: int) -> JointProblem:
        """Return the problem with each log's readings averaged to about `most`; neighbours' noise is taken as one."""
        parts = tuple(part.average(most) for part in self.parts)
        counts = [math.sqrt(len(a.readings.time_s) / len(b.readings.time_s))
                  for a, b in zip(self.parts, parts, strict=True)]
        return replace(self, parts=parts, weights=self.weights * np.array(counts))

    def split(self, stacked: Array) -> list[Array]:
        """Return the part of each log, along the last axis: of shape (…, m) as many of shape (…, m of the log)."""
        ends = np.cumsum([len(part.readings.time_s) for part in self.parts])
        return np.split(stacked, ends[:-1], axis=-1)

    def residuals(self, records: Array, *, per_lag: bool = False) -> ResidualFunction:
        """Return the weighted residuals of all logs as `minimise` wants them.

        Args:
            records: readings, shape (n, m), of the row that a problem belongs to [°C].
            per_lag: whether the vector begins with the gain per first lag instead of the gain.
        """
        split = self.split(records)

        def answer(z: Array, rows: npt.NDArray[np.intp]) -> Array:
            gain = np.exp(z[:, POWER] + (z[:, LAG] if per_lag else 0.0))
            weighted = []
            for i, (part, weight, record) in enumerate(zip(self.parts, self.weights, split, strict=True)):
                fixed = part.nothing_more(len(z)).values
                fixed[:, GAIN] = gain
                if i == 0 and z.shape[1] > FIRST_AMBIENT:
                    fixed[:, AMBIENT] = z[:, FIRST_AMBIENT]
                own = np.ascontiguousarray(z[:, LAG : SECOND + 1])
                weighted.append(weight * part.solve(own, record[rows], FixedUnknowns(values=fixed))[0])
            return np.concatenate(weighted, axis=1)

        return answer

    def with_ambient(self, fit: JointFit) -> tuple[JointProblem, Array]:
        """Return the problem with the first log's ambient as an additional unknown, and the vector of a fit in it.

        The shape is (4,), or (5,) with that ambient. If that ambient is known, the problem is unchanged.
        """
        first = self.parts[0]
        if not math.isnan(first.fixed[AMBIENT]):
            return self, fit.vector
        best = float(fit.parts[0].linear[AMBIENT])
        reach = _FAR_AMBIENT * float(np.ptp(first.readings.temperature_degC))
        wider = replace(self, low=np.append(self.low, best - reach), high=np.append(self.high, best + reach))
        return wider, np.append(fit.vector, best)

    def refine(self, starts: Array) -> JointFit:
        """Return the best fit from the starts (n, p), vectors of the shared parameters."""
        records = np.tile(self.records, (len(starts), 1))
        minima = minimise(self.residuals(records), starts, self.low, self.high, tolerance=1e-9)
        return self.at(minima.parameters[int(np.argmin(minima.cost))])

    def far(self, fit: JointFit) -> JointFit:
        """Return the best fit whose time constant is the longest searched: the heater as an integrator."""
        longer = self.high[LAG] - fit.vector[LAG]
        start = fit.vector + np.array([longer, longer, 0.0, 0.0])
        high = np.where(np.arange(len(start)) == LAG, self.low, np.maximum(self.high, start))
        records = self.records[None, :]
        return self.at(minimise(self.residuals(records), start[None, :], self.low, high).parameters[0])

    def at(self, vector: Array) -> JointFit:
        """Return the fit at a shared vector (p,), its gain not per lag."""
        gain = math.exp(vector[POWER])
        return JointFit(vector=vector, parts=tuple(part.fit_at_gain(vector[LAG:], gain) for part in self.parts))

    def on_bound(self, fit: JointFit) -> tuple[str, ...]:
        """Return the names of the lags and the dead time that ended on a bound of the search."""
        low, high, z = (vector[LAG:] for vector in (self.low, self.high, fit.vector))
        return parameters_on_bounds(z, low, high)

    def bic(self, fit: JointFit) -> float:
        """Return the criterion over all logs; shared parameters count once."""
        shared = 3 + self.parts[0].two_lags
        own = sum(
            ar1_bic(part.readings.temperature_degC - part_fit.simulated_degC, part_fit.unknowns - shared)
            for part, part_fit in zip(self.parts, fit.parts, strict=True)
        )
        return own + shared * math.log(len(self.records))


_RESAMPLES = 200

#: of vectors, shape (n, 4) or (n, 5)
Measure = Callable[[Array], Array]

_MEASURES: dict[str, Measure] = {
    "gain_degC_per_pct": lambda z: np.exp(z[:, POWER]),
    "time_constant_s": lambda z: np.exp(z[:, LAG]),
    "dead_time_s": lambda z: z[:, DEAD],
    RATIO: lambda z: np.exp(z[:, POWER] - z[:, LAG]),
    "ambient_degC": lambda z: z[:, FIRST_AMBIENT],
}


def joint_intervals(problem: JointProblem, fit: JointFit, *, seed: int) -> dict[str, Interval]:
    """Return the 95 % intervals of the shared parameters, and of the first log's ambient if it is free.

    An end on a bound of the search is open.
    """
    thin, reported = problem.average(READINGS), problem.with_ambient(fit)[1]
    fit = thin.refine(fit.vector[None, :])
    wider, best = thin.with_ambient(fit)
    measures = {name: measure for name, measure in _MEASURES.items()
                if name != "ambient_degC" or len(best) > FIRST_AMBIENT}
    resampled = _bootstrap(wider, fit, best, seed)
    noise = _linear(wider, fit, best, measures)
    ends, intervals = _ends_joint(wider), {}
    for name, measure in measures.items():
        shaken = interval(measure(resampled), *ends[name])
        profiled = _profile(wider, best, name, noise)
        intervals[name] = envelope(hull(shaken, profiled), [float(measure(reported[None, :])[0])])
    return intervals


def _ends_joint(problem: JointProblem) -> dict[str, tuple[float, float]]:
    low, high = problem.low, problem.high
    return {
        "gain_degC_per_pct": (math.exp(low[POWER]), math.exp(high[POWER])),
        "time_constant_s": (math.exp(low[LAG]), math.exp(high[LAG])),
        "dead_time_s": (float(low[DEAD]), float(high[DEAD])),
        RATIO: (math.exp(low[POWER] - high[LAG]), math.exp(high[POWER] - low[LAG])),
        "ambient_degC": (float(low[-1]), float(high[-1])),
    }


def _bootstrap(problem: JointProblem, fit: JointFit, best: Array, seed: int) -> Array:
    """Return the vectors of resampled logs, shape (n, len(best))."""
    rng = np.random.default_rng(seed)
    simulation = np.concatenate([part.simulated_degC for part in fit.parts])
    left = problem.split(problem.records - simulation)
    records = simulation + np.concatenate([block_resamples(error, _RESAMPLES, rng) for error in left], axis=1)
    starts = np.tile(best, (_RESAMPLES, 1))
    return minimise(problem.residuals(records), starts, problem.low, problem.high, iterations=15).parameters


def _linear(
    problem: JointProblem, fit: JointFit, best: Array, measures: Mapping[str, Measure]
) -> dict[str, tuple[float, float]]:
    """Return the deviation of each parameter, and the increase of the sum of squares at the end of its 95 % interval.

    The noise of each log is first-order autoregressive. The parameters of each log are solved inside, so the slopes of
    the residuals are already free of them (Frisch–Waugh).
    """
    free = np.flatnonzero(problem.high > problem.low)
    slopes = _slopes(problem, best, free)
    inverse = np.linalg.pinv(slopes.T @ slopes)
    middle, freedom = np.zeros_like(inverse), -float(len(free))
    for i, (part, weight, part_fit, slope) in enumerate(
        zip(problem.parts, problem.weights, fit.parts, problem.split(slopes.T), strict=True)
    ):
        left = part.readings.temperature_degC - part_fit.simulated_degC
        own = np.isnan(part.fixed)
        own[GAIN] = False  # shared
        own[AMBIENT] &= i > 0 or len(best) <= FIRST_AMBIENT
        columns = np.vstack([part.basis(part_fit.vector)[own], slope[np.any(slope != 0.0, axis=1)]])
        rho, variance = colour(left, np.linalg.qr(columns.T)[0])
        middle += weight**2 * variance * ar1_weighted(slope, rho) @ slope.T
        freedom += len(left) * (1.0 - rho) / (1.0 + rho) - np.count_nonzero(own)
    coloured = inverse @ middle @ inverse
    quantile = student_t(max(freedom, LEAST_FREEDOM))
    noise = {}
    for name, measure in measures.items():
        gradient = _gradient(measure, best)[free]
        spread = float(gradient @ coloured @ gradient)
        rise = quantile**2 * spread / max(float(gradient @ inverse @ gradient), 1e-300)
        noise[name] = math.sqrt(spread), rise
    return noise


def _slopes(problem: JointProblem, best: Array, free: npt.NDArray[np.intp]) -> Array:
    """Return the derivatives of the weighted residuals by the free numbers of the vector, shape (m, q)."""
    step = 1e-4 * (problem.high - problem.low)[free]
    count = np.arange(len(free))
    moved = np.tile(best, (2 * len(free), 1))
    up = np.minimum(best[free] + step, problem.high[free])
    down = np.maximum(best[free] - step, problem.low[free])
    moved[count, free], moved[len(free) + count, free] = up, down
    records = np.tile(problem.records, (len(moved), 1))
    answers = problem.residuals(records)(moved, np.arange(len(moved)))
    return np.asarray(((answers[: len(free)] - answers[len(free) :]) / (up - down)[:, None]).T)


def _gradient(measure: Measure, best: Array) -> Array:
    step, unit = 1e-6, np.eye(len(best))
    values = measure(best + step * np.vstack([unit, -unit]))
    return np.asarray((values[: len(best)] - values[len(best) :]) / (2.0 * step))


def _profile(problem: JointProblem, best: Array, name: str, noise: Mapping[str, tuple[float, float]]) -> Interval:
    """Return where the weighted sum of squares, with all else fitted again, has risen as far as the noise allows."""
    deviation, limit = noise[name]
    value = float(_MEASURES[name](best[None, :])[0])
    least = float(np.sum(problem.residuals(problem.records[None, :])(best[None, :], np.array([0])) ** 2))
    ends = []
    for side in (-1.0, 1.0):
        values = np.clip(value + side * deviation * STEPS, *_ends_joint(problem)[name])
        rise = np.array([0.0, *np.maximum(_minima_at(problem, best, name, values).cost - least, 0.0)])
        ends.append(bound_crossing(np.array([value, *values]), rise, limit))
    return Interval(low=ends[0], high=ends[1])


def joint_fit_at(problem: JointProblem, fit: JointFit, name: str, value: float) -> JointFit:
    """Return one heater for all logs with one number held: dead time [s], or gain per time constant."""
    thin = problem.average(READINGS)
    vector = _minima_at(thin, thin.refine(fit.vector[None, :]).vector, name, np.array([value])).parameters[0].copy()
    if name == RATIO:
        vector[POWER] += vector[LAG]
    return problem.at(vector)


def _minima_at(problem: JointProblem, best: Array, name: str, values: Array) -> Minima:
    """Return the fits and least weighted sums of squares with the named number held at each value."""
    per_lag = name == RATIO
    place = {"time_constant_s": LAG, "dead_time_s": DEAD, "ambient_degC": FIRST_AMBIENT}.get(name, POWER)
    starts = np.tile(best, (len(values), 1))
    starts[:, place] = values if place in (DEAD, FIRST_AMBIENT) else np.log(values)
    high = problem.high.copy()
    high[place] = problem.low[place]  # held
    records = np.tile(problem.records, (len(values), 1))
    residuals = problem.residuals(records, per_lag=per_lag)
    return minimise(residuals, starts, problem.low, high, iterations=12)


_NEAR = 10.0  # BIC points

_LAW = "power logged"


class _Joint(NamedTuple):
    """One heater for all logs, by one way to read them."""

    problem: JointProblem
    fit: JointFit
    law: str
    sentence: str = ""
    shifted: bool = False

    @property
    def heater(self) -> HeaterModel:
        """The heater, with the ambient of the first log."""
        model = self.fit.parts[0].model
        assert model is not None
        return model


def fit_logs(logs: Sequence[Explanation], *, open_start: bool, seed: int, least_dead_time_s: float) -> FittedModel:
    """Return the common FOPDT of several logs with power.

    Shared: gain, time constant, dead time. Each log has its own ambient, initial state, drift, loads and noise. An
    alternative explanation that a log alone does not rule out stays a candidate unless the other logs contradict it. If
    the logs disagree, each log's own heater is a candidate too.

    Args:
        logs: explanation of each log alone.
        open_start: whether the power before the logs is unknown.
        seed: of the bootstrap.
        least_dead_time_s: shortest plausible dead time.
    """
    logs, best = _drifting(logs)
    weights = [weigh_fit(log, open_start=open_start, seed=seed) for log in logs]
    inside = joint_intervals(best.problem, best.fit, seed=seed)
    rivals = [rival for rival in _rivals(best, logs, weights)
              if rival.shifted or not lies_inside(_fopdt(rival), inside)]
    alone = _each_alone(logs, weights, best)
    apart = disagreements(alone)
    as_read, ci95 = _as_read(inside, rivals, [log.model for log in logs if apart], logs)
    lag = ci95["time_constant_s"]
    others = list(_others(best, logs, open_lag=lag.high is None))
    candidates = [*_candidates(best, rivals, others, logs), *(_own(log) for log in logs if apart),
                  *(end for log in logs for end in _bent(log))]
    shown, order = best, "one lag"
    is_open = rivals or apart or any(each.open_start for each in weights) or any(log.has_events for log in logs)
    if not (_resolved(ci95) or is_open) and (two := _better_by_two_lags(best, others)) is not None:
        shown, order, as_read = two, "two lags", joint_intervals(two.problem, two.fit, seed=seed)
        ci95 = half_rule_intervals(two.heater, as_read)
        candidates = [each for each in candidates if each.delta_bic < _NEAR]
        candidates.sort(key=lambda near: near.model != two.heater)
        alone = _each_alone(logs, weights, shown)
    ends = _ends(shown, logs, candidates[0], as_read, least_dead_time_s)
    family = distinct_candidates([*candidates, *ends], least_dead_time_s)
    open_ = open_ends([(order, ci95)])
    ratio, resolved = ci95.pop(RATIO), _resolved(ci95)
    model, first = shown.heater.half_rule(), logs[0]
    simulated = first.at_readings(shown.problem.parts[0], shown.fit.parts[0])
    agreement, names = list(agreement_remarks(alone, apart)), " and ".join(log.log.name for log in logs)
    checks = [*fast_remarks(math.exp(shown.problem.low[LAG]), model.time_constant_s, names), *_shares(shown, logs),
              *_aliases(logs),
              *(remark._replace(sentence=f"{log.log.name}: {remark.sentence}")
                for log in logs for remark in bend_remarks(log.bend))]
    fit = _fit_pct([log.clean_temperature for log in logs], _simulated(shown, logs))
    outcome = outcome_of(fit, resolved=resolved)
    return FittedModel(
        model=model,
        outcome=outcome,
        method="exact simulation of every log with its own power, free initial states; intervals: profile likelihood "
        "or block bootstrap, whichever reaches further",
        ci95={**ci95},
        combinations={} if resolved else {RATIO: (values_of(model)[RATIO], ratio)},
        candidates=family,
        fit_pct=fit,
        findings=(*findings_of([*poor_remarks(outcome, fit, names), *agreement, *checks]), *open_),
        notes=(*(remark.sentence for remark in agreement), *_log_notes(shown, logs),
               *limit_notes(model, shown.problem.on_bound(shown.fit), ci95,
                            max(longest_hold_s(log.log, log.problems[0]) for log in logs)),
               *rival_notes("the logs", candidates), *([TWO_LAGS_SHOWN] if shown is not best else []),
               *(rival.sentence for rival in rivals), *(remark.sentence for remark in checks)),
        residuals=Residuals(
            time_s=first.log.time_s, measured_degC=first.log.temperature_degC, simulated_degC=simulated,
            autocorrelation=autocorrelation(first.clean_temperature - simulated),
        ),
        logs=tuple(alone),
    )


def _as_read(
    inside: Mapping[str, Interval], rivals: Sequence[_Joint], alone: Sequence[Fopdt], logs: Sequence[Explanation]
) -> tuple[dict[str, Interval], dict[str, Interval]]:
    """Return the intervals with what else the logs may say: as their power reads, and if it changed within gaps."""
    others = [values_of(_fopdt(rival)) for rival in rivals if not rival.shifted]
    # the reported ambient is that of the first log
    others += [values_of(model) | {"ambient_degC": math.nan} for model in alone]
    others += [end for log in logs for end in values_at_ends(log.bend)]
    as_read = widen_intervals(inside, others)
    return as_read, widen_intervals(as_read, [values_of(_fopdt(rival)) for rival in rivals if rival.shifted])


def _resolved(ci95: Mapping[str, Interval]) -> bool:
    return all(identified_parts(ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s"))


def _better_by_two_lags(best: _Joint, others: Sequence[_Joint]) -> _Joint | None:
    """Return the heater of two lags that explains all logs far better than one lag, None if there is none."""
    two = next((other for other in others if other.problem.parts[0].two_lags), None)
    if two is None or two.problem.bic(two.fit) > best.problem.bic(best.fit) - _NEAR:
        return None
    singles = zip(best.problem.parts, best.fit.parts, strict=True)
    checks = [checks_in_place(part, fit, one_lag)
              for part, fit, one_lag in zip(two.problem.parts, two.fit.parts, singles, strict=True)]
    return two if all(checks) else None


def two_scales_of_logs(logs: Sequence[Explanation]) -> list[TwoScaleFit]:
    """Return the heater of two time scales that explains all logs, in a list; empty where no log asks for it.

    Raises:
        InputError: one log asks for two time scales, and no such heater explains all.
    """
    asking = [log.log.name for log in logs if log.extended and isinstance(log.extended[0], TwoScaleFit)]
    if not asking:
        return []
    problems = [replace(log.problems[0], drift=False, loads_s=()) for log in logs]
    noise = [long_run_noise(log.problems[0].readings.temperature_degC, log.best_simulated_degC) for log in logs]
    fits = fit_two_scales(problems, min(_bic_together(logs, order) for order in (0, 1)), noise)
    if not fits:
        raise InputError(f"{asking[0]} shows two time scales (a fast element on a slow mass), but no such heater "
                         f"explains all {len(logs)} logs: fit {' or '.join(asking)} alone")
    return fits


def _bic_together(logs: Sequence[Explanation], order: int) -> float:
    joint = _joint([log.problems[order] for log in logs], [log.fits[order] for log in logs], _LAW)
    return joint.problem.bic(joint.fit)


def _joint(problems: Sequence[PowerProblem], fits: Sequence[PowerFit], law: str, sentence: str = "") -> _Joint:
    """Return one heater for all logs, sought from where the fits of each lie."""
    problem = JointProblem.of(problems, fits)
    starts = [np.array([math.log(fit.linear[GAIN]), *fit.vector]) for fit in fits]
    return _Joint(problem, problem.refine(np.array([*starts, np.mean(starts, axis=0)])), law, sentence)


def _drifting(logs: Sequence[Explanation]) -> tuple[Sequence[Explanation], _Joint]:
    """Return logs and heater with a drift in each log that asks for it once the heater is that of all logs."""
    joint = _joint([log.problems[0] for log in logs], [log.fits[0] for log in logs], _LAW)
    for place, log in enumerate(logs):
        changed = [*logs[:place], log.with_drift(), *logs[place + 1 :]]
        if any(fit.model is None for fit in changed[place].fits):
            continue
        trial = _joint([log.problems[0] for log in changed], [log.fits[0] for log in changed], _LAW)
        if trial.problem.bic(trial.fit) < joint.problem.bic(joint.fit) - _NEAR:
            logs, joint = changed, trial
    return logs, joint


def _rivals(best: _Joint, logs: Sequence[Explanation], weights: Sequence[WeighedFit]) -> Iterator[_Joint]:
    """Return the alternative heaters for all logs that the other logs do not contradict."""
    at_best = best.problem.bic(best.fit)
    for law in dict.fromkeys(rival.law for weight in weights for rival in weight.rivals):
        own_rivals = [next((rival for rival in weight.rivals if rival.law == law), None) for weight in weights]
        parts, names, sentences, dearer_alone = list(best.problem.parts), [], [], 0.0
        for place, (log, rival) in enumerate(zip(logs, own_rivals, strict=True)):
            if rival is not None:
                parts[place] = rival.problem
                names.append(log.log.name)
                sentences.append(f"{log.log.name}: {rival.sentence}")
                dearer_alone += max(bic_of(rival.problem, rival.fit) - bic_of(log.problems[0], log.fits[0]), 0.0)
        fits = [rival.fit if rival is not None and rival.shifted else log.fits[0]
                for log, rival in zip(logs, own_rivals, strict=True)]
        other = _joint(parts, fits, f"{law} ({', '.join(names)})", " ".join(sentences))._replace(
            shifted=any(rival is not None and rival.shifted for rival in own_rivals))
        if other.problem.bic(other.fit) - at_best < dearer_alone + _NEAR:
            yield other


def _others(best: _Joint, logs: Sequence[Explanation], *, open_lag: bool) -> Iterator[_Joint]:
    """Return two lags where every log sees the second, and the integrator where the time constant is open upwards."""
    if all(second_is_seen(log.fits[1]) for log in logs):
        two = _joint([log.problems[1] for log in logs], [log.fits[1] for log in logs], _LAW)
        if not two.problem.on_bound(two.fit):
            yield two
    if open_lag:
        yield best._replace(fit=best.problem.far(best.fit), law=f"{_LAW}, as an integrator")


def _candidates(
    best: _Joint, rivals: Sequence[_Joint], others: Sequence[_Joint], logs: Sequence[Explanation]
) -> Iterator[Candidate]:
    """Return one lag, its rivals, and every other model that explains the logs nearly as well or better."""
    tried = [best, *rivals, *others]
    bics = [trial.problem.bic(trial.fit) for trial in tried]
    cleaned = [log.clean_temperature for log in logs]
    for place, (trial, bic) in enumerate(zip(tried, bics, strict=True)):
        if place > len(rivals) and bic - min(bics) >= _NEAR:
            continue
        simulated = _simulated(trial, logs)
        left = np.concatenate(cleaned) - np.concatenate(simulated)
        yield Candidate(
            model=trial.heater, log=" + ".join(log.log.name for log in logs), law=trial.law,
            window_s=(min(float(log.log.time_s[0]) for log in logs), max(float(log.log.time_s[-1]) for log in logs)),
            fit_pct=_fit_pct(cleaned, simulated), rmse_degC=float(np.sqrt(np.mean(left**2))),
            delta_bic=bic - min(bics),
            fits_pct={log.log.name: fit_pct(log.clean_temperature, simulation) for log,
                      simulation in zip(logs, simulated, strict=True)},
        )


def _bent(log: Explanation) -> Iterator[Candidate]:
    """Yield the local heaters at both ends of a nonlinear heater."""
    bend = log.bend
    if bend is None:
        return
    record = log.problems[0].readings.temperature_degC
    for end in dict.fromkeys(bend.ends):
        yield Candidate(
            model=end.model, log=log.log.name, window_s=(float(log.log.time_s[0]), float(log.log.time_s[-1])),
            law=f"power logged, {end.at}", fit_pct=fit_pct(record, bend.simulated_degC),
            rmse_degC=float(np.sqrt(np.mean((record - bend.simulated_degC) ** 2))), delta_bic=0.0)


def _own(log: Explanation) -> Candidate:
    """Return the heater of one log alone."""
    left = log.clean_temperature - log.simulated_degC
    return Candidate(
        model=log.model, log=log.log.name, window_s=(float(log.log.time_s[0]), float(log.log.time_s[-1])),
        law=f"{_LAW}, this log alone", fit_pct=fit_pct(log.clean_temperature, log.simulated_degC),
        rmse_degC=float(np.sqrt(np.mean(left**2))), delta_bic=0.0,
    )


def _each_alone(logs: Sequence[Explanation], weights: Sequence[WeighedFit], best: _Joint) -> list[OneLog]:
    return [_alone(*pair, best, place) for place, pair in enumerate(zip(logs, weights, strict=True))]


def _alone(log: Explanation, weight: WeighedFit, best: _Joint, place: int) -> OneLog:
    """Return the results of one log alone, and of the common heater on it."""
    fit, model = best.fit.parts[place], log.model
    simulated = log.at_readings(best.problem.parts[place], fit)
    order = int(best.problem.parts[place].two_lags)
    own = log.at_readings(log.problems[order], log.fits[order])
    ends = widen_intervals(weight.inside, [values_of(rival.model) for rival in weight.rivals])
    return OneLog(
        name=log.log.name, fit_pct=fit_pct(log.clean_temperature, simulated),
        alone_fit_pct=fit_pct(log.clean_temperature, own), ambient_degC=float(fit.linear[AMBIENT]),
        drift_degC_per_s=float(fit.linear[DRIFT]), noise_degC=float(np.std(log.clean_temperature - simulated)),
        values={name: value for name, value in values_of(model).items() if name in ends and name != "ambient_degC"},
        ci95={name: limits for name, limits in ends.items() if name != "ambient_degC"},
    )


def _ends(
    best: _Joint, logs: Sequence[Explanation], first: Candidate, ci95: Mapping[str, Interval | None],
    least_dead_time_s: float,
) -> Iterator[Candidate]:
    cleaned = [log.clean_temperature for log in logs]

    def held(name: str, value: float) -> AtEnd | None:
        at = best._replace(fit=joint_fit_at(best.problem, best.fit, name, value))
        model = at.fit.parts[0].model
        if model is None:
            return None
        simulated = _simulated(at, logs)
        left = np.concatenate(cleaned) - np.concatenate(simulated)
        return AtEnd(model, _fit_pct(cleaned, simulated), float(np.sqrt(np.mean(left**2))))

    values = {name: float(_MEASURES[name](best.fit.vector[None, :])[0]) for name in ("dead_time_s", RATIO)}
    return ends_of(first, values, ci95, held, least_dead_time_s=least_dead_time_s)


def _simulated(joint: _Joint, logs: Sequence[Explanation]) -> list[Array]:
    pairs = zip(logs, joint.problem.parts, joint.fit.parts, strict=True)
    return [log.at_readings(part, fit) for log, part, fit in pairs]


def _fit_pct(measured: Sequence[Array], simulated: Sequence[Array]) -> float:
    """Return the fit over all logs, each about its own mean: the logs' levels are no merit of the model [%]."""
    levels = np.concatenate([series - series.mean() for series in measured])
    left = np.concatenate(measured) - np.concatenate(simulated)
    return float(100.0 * (1.0 - np.linalg.norm(left) / np.linalg.norm(levels)))


def _fopdt(joint: _Joint) -> Fopdt:
    assert isinstance(joint.heater, Fopdt)
    return joint.heater


def _shares(best: _Joint, logs: Sequence[Explanation]) -> Iterator[Remark]:
    """Yield the findings about temperature that the power does not explain in each log, with the common heater."""
    for log, part, fit in zip(logs, best.problem.parts, best.fit.parts, strict=True):
        yield from share_remarks(log.log.name, [part], [fit], log.doubt)


def _aliases(logs: Sequence[Explanation]) -> Iterator[Remark]:
    for log in logs:
        for remark in alias_remarks(log.alias):
            yield remark._replace(sentence=f"{log.log.name}: {remark.sentence}")


def _log_notes(best: _Joint, logs: Sequence[Explanation]) -> Iterator[str]:
    for log, part, fit in zip(logs, best.problem.parts, best.fit.parts, strict=True):
        for note in (*log.notes, *log_notes(log.log, part, fit, log.outliers)):
            yield f"{log.log.name}: {note}"

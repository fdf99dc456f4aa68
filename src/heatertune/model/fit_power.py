"""The fit of a log with power: one lag as the working model, and beside it whatever else explains the log."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.log.values import Log
from heatertune.model.alias import alias_of, alias_told
from heatertune.model.cleaning import cleaned
from heatertune.model.diagnosis import notes_of
from heatertune.model.events import refitted, with_events, without_events
from heatertune.model.family import family_of
from heatertune.model.feedback import is_feedback
from heatertune.model.hearing import fast_told, findings_of, level_told, poor_told
from heatertune.model.intervals import PERIOD, RATIO, identified_parts
from heatertune.model.judge import correlation_of, judged, judgement_told
from heatertune.model.judgement import Validation
from heatertune.model.measures import ultimate_period_s
from heatertune.model.nonlinear import Bend, bend_told, judged_linear
from heatertune.model.open_loop import PowerFit, PowerProblem
from heatertune.model.parts import halves_notes, said_by_halves, widening, widening_notes
from heatertune.model.power_candidates import candidates_of, second_is_seen
from heatertune.model.readings import Readings
from heatertune.model.rivals import Rival, rivals_of, widened
from heatertune.model.sanity import demand_cause, follows_temperature
from heatertune.model.statistics import autocorrelation, fit_pct
from heatertune.model.uncertainty import intervals_by
from heatertune.model.values import FittedModel, Fopdt, Interval, Outcome, Residuals

__all__ = ["Explained", "explained", "fit_power", "outcome_of", "values_of", "weighed"]

Array = npt.NDArray[np.float64]

_POOR = 60.0  # fit [%] below which no interval means anything


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explained:
    """A log with power, the problems and fits of one lag and two, and what became of its readings.

    Attributes:
        log: without readings between disturbances that are too close.
        readings: its readings, one for one, and where its segments begin.
        problems: of one lag and of two, with the start, the drift and the loads the log asks for.
        fits: their best fits.
        cleaned: readings with outliers put where their neighbours are, shape (n,) [°C].
        outliers: their places.
        told: about the log's disturbances, and what it cannot tell about its heater, one sentence each.
        alias: about power that switches faster than it was logged; empty where it does not.
        bend: what explains the log better than a linear heater, None where nothing does.
    """

    log: Log
    readings: Readings
    problems: list[PowerProblem]
    fits: list[PowerFit]
    cleaned: Array
    outliers: npt.NDArray[np.intp]
    told: tuple[str, ...]
    alias: str
    bend: Bend | None = None

    @property
    def model(self) -> Fopdt:
        """One lag."""
        model = self.fits[0].model
        assert isinstance(model, Fopdt)
        return model

    @property
    def simulated_degC(self) -> Array:
        """Answer of one lag at every reading of the log, shape (n,)."""
        return self.at_readings(self.problems[0], self.fits[0])

    def at_readings(self, problem: PowerProblem, fit: PowerFit) -> Array:
        """Return what a fit makes of every reading of the log, shape (n,) [°C]."""
        return fit.linear @ replace(problem, readings=self.readings).basis(fit.vector)


    def drifting(self) -> Explained:
        """Return the log with a drift of the ambient fitted, whether it asks for one alone or not."""
        problems = [replace(problem, drift=True) for problem in self.problems]
        return replace(self, problems=problems, fits=refitted(problems, self.fits))


class Weighed(NamedTuple):
    """Of one lag: intervals, checks, other fits that the log does not rule out, and how far intervals were widened."""

    inside: dict[str, Interval]
    validation: Validation
    rivals: tuple[Rival, ...]
    wider: dict[str, float] | None = None


def explained(
    log: Log, *, ambient_degC: float | None, power_before_pct: float | None, believed: bool = False,
    most_dead_time_s: float | None = None,
) -> Explained:
    """Return one lag and two, each with the start, drift and loads that a log with power asks for.

    `believed`: the power is known to be the heater's, so its cause is not asked for. `most_dead_time_s`: no dead time
    is longer, as the user knows.

    Raises:
        InputError: the power cannot have made the temperature (sign, clock, no answer at all).
    """
    readings = Readings.of(log)
    problem = PowerProblem(readings=readings, ambient_degC=ambient_degC, power_before_pct=power_before_pct,
                           most_dead_time_s=most_dead_time_s)
    return _search(log, problem, believed=believed)


def weighed(found: Explained, *, open_start: bool, seed: int) -> Weighed:
    """Return what one lag is worth; `open_start`: nobody knows the power before the log."""
    problem, one = found.problems[0], found.fits[0]
    wider = widening(problem, one)
    narrow, inside = intervals_by(problem, one, [{}, wider], seed=seed)
    validation = judged(problem, one)
    rivals = rivals_of(found.log, problem, one, narrow, validation.held_out, open_start=open_start)
    return Weighed(inside, validation, rivals, wider)


def fit_power(found: Explained, weight: Weighed, *, least_dead_time_s: float, seed: int) -> FittedModel:
    """Return the FOPDT of a log with power, its intervals, and the candidates.

    Beside one lag: two lags, a time constant for heating and one for cooling, an integrator; a drift of the ambient
    and load steps where the log asks for them; the ends of the intervals, and the halves where they disagree.

    Args:
        found: what explains the log.
        weight: what one lag is worth.
        least_dead_time_s: no dead time below this is believed.
        seed: of the bootstrap.
    """
    log, one = found.log, found.fits[0]
    inside, validation, rivals, wider = weight
    read_otherwise = widened(inside, [*(values_of(rival.model) for rival in rivals), *_ends_of(found.bend)])
    ci95: dict[str, Interval | None] = {
        **widened(read_otherwise, said_by_halves(found.problems[0], one, validation, read_otherwise))}
    lag = ci95["time_constant_s"]
    assert lag is not None
    candidates = candidates_of(
        log, found.problems, found.fits, left_out=validation.held_out, open_lag=lag.high is None, rivals=rivals,
        bend=found.bend)
    family, open_ = family_of(found, candidates, ci95, validation.halves, least_dead_time_s, wider or {}, seed)
    ratio, _ = ci95.pop(RATIO), ci95.pop(PERIOD)
    assert ratio is not None
    known = all(identified_parts(ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s"))
    simulated = found.simulated_degC
    fit = fit_pct(found.cleaned, simulated)
    second = correlation_of(found.problems[1], found.fits[1]) if second_is_seen(found.fits[1]) else None
    outcome = outcome_of(max([fit, *(each.fit_pct for each in candidates)]), known=known)
    least_s = math.exp(found.problems[0].low[0])
    checks = [*bend_told(found.bend), *judgement_told(log, validation, fit, second), *alias_told(found.alias),
              *fast_told(least_s, found.model.time_constant_s, log.name), *level_told(log)]
    return FittedModel(
        model=found.model,
        outcome=outcome,
        method="exact simulation with the logged power, "
        f"{'begun at rest' if found.problems[0].at_rest else 'free initial state'}; "
        "intervals: profile likelihood or block bootstrap, whichever reaches further",
        ci95=ci95,
        combinations={} if known else {RATIO: (values_of(found.model)[RATIO], ratio)},
        candidates=family,
        fit_pct=fit,
        notes=(*found.told, *notes_of(log, found.problems[0], one, ci95, candidates, found.outliers),
               *widening_notes(wider or {}), *halves_notes(read_otherwise, ci95), *(rival.told for rival in rivals),
               *(each.sentence for each in checks)),
        findings=(*findings_of([*poor_told(outcome, fit, log.name), *checks]), *open_),
        residuals=Residuals(
            time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=simulated,
            autocorrelation=autocorrelation(found.cleaned - simulated),
        ),
        validation=validation,
    )


def _ends_of(bend: Bend | None) -> list[dict[str, float]]:
    """Return the values of a bend's ends; a second lag counts by the half rule, an ambient not at all."""
    ends = () if bend is None else bend.ends
    return [values_of(end.model.half_rule()) | {"ambient_degC": math.nan} for end in ends]


def outcome_of(fit: float, *, known: bool) -> Outcome:
    """Return how a fit ended: by its fit [%] and by whether gain and time constant are known."""
    return Outcome.POOR_FIT if fit < _POOR else Outcome.IDENTIFIED if known else Outcome.COMBINATIONS_ONLY


def values_of(model: Fopdt) -> dict[str, float]:
    """Return gain, time constant, dead time, ambient (nan: unknown) and gain per time constant."""
    named = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    return {name: float(getattr(model, name)) for name in named} | {
        "ambient_degC": math.nan if model.ambient_degC is None else model.ambient_degC,
        RATIO: model.gain_degC_per_pct / model.time_constant_s,
        PERIOD: ultimate_period_s(model),
    }


def _search(log: Log, problem: PowerProblem, *, believed: bool) -> Explained:
    """Return one lag and two, without the outliers, the start, the drift and the loads the log asks for."""
    log, found, told = cleaned(log, problem)
    thin, fit = found.problem, found.fit
    alias = "" if believed else alias_of(log, thin, fit)
    if not believed:
        _demand_cause(log, thin, fit, alias)
    two = replace(thin, two_lags=True)
    closed = is_feedback(log) or follows_temperature(log)
    way = with_events([thin, two], [fit, _second(two, fit)], closed=closed)
    (problems, fits), bend, untold = judged_linear(without_events(way), way)
    if any(fit.model is None for fit in fits):
        raise InputError(f"{log.name}: no heater explains the log: a rising power never warms it")
    return Explained(
        log=log, readings=found.whole.readings, problems=problems, fits=fits, cleaned=found.readings_degC,
        outliers=found.outliers, told=(*told, *untold), alias=alias, bend=bend,
    )


def _demand_cause(log: Log, problem: PowerProblem, fit: PowerFit, alias: str) -> None:
    """Refuse a log in which the power cannot be the temperature's cause, by its aliasing where it has one."""
    try:
        demand_cause(log, problem, None if fit.model is None else fit)
    except InputError as refused:
        if alias:
            raise InputError(f"{log.name}: {alias}") from refused
        raise


def _second(problem: PowerProblem, one: PowerFit) -> PowerFit:
    """Return two lags; where the free initial states alone make the best of it, the two nearest to the one lag."""
    found = problem.fit()
    if found.model is not None:
        return found
    near = [(one.vector[0], max(one.vector[1] - ratio * math.exp(one.vector[0]), 0.0), ratio) for ratio in (0.03, 0.2)]
    return problem.refined(np.array(near))

"""The fit of a log that holds nothing but temperature: controller hypotheses compared on the same rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.closed_loop import Hypothesis, Segment
from heatertune.model.intervals import envelope, identified, interval
from heatertune.model.law import ControllerLaw
from heatertune.model.least_squares import minimise
from heatertune.model.search import Fit, fit_all, residuals_of
from heatertune.model.statistics import autocorrelation, block_resamples
from heatertune.model.values import Candidate, FittedModel, HeaterModel, Interval, Outcome, Residuals
from heatertune.units import NOMENCLATURE

__all__ = ["fit_temperature"]

Array = npt.NDArray[np.float64]

_NEAR = 10.0  # BIC points within which a model explains the log nearly as well
_FOPDT_NEAR = 3.0  # fit [%] within which the best single lag stays a candidate
_POOR = 60.0
_RESAMPLES = 100
_MOST_READINGS = 500
_AMBIENT_BELOW, _AMBIENT_ABOVE = 8.0, 6.0  # °C around the first reading: a log without power starts near the room's

#: name → value of one heater, for intervals
_MEASURES: dict[str, Callable[[HeaterModel], float]] = {
    "gain_degC_per_pct": lambda plant: plant.half_rule().gain_degC_per_pct,
    "time_constant_s": lambda plant: plant.half_rule().time_constant_s,
    "dead_time_s": lambda plant: plant.half_rule().dead_time_s,
    "ambient_degC": lambda plant: float(plant.ambient_degC or 0.0),
    "gain_per_time_constant_degC_per_s_pct": lambda plant: plant.gain_degC_per_pct / plant.half_rule().time_constant_s,
}


def fit_temperature(
    log: Log, laws: Sequence[ControllerLaw], *, ambient_degC: float | None, seed: int
) -> FittedModel:
    """Return the half-rule FOPDT of the best-fitting hypothesis and every hypothesis that explains the log as well.

    Hypotheses: each law, one lag and two, with and without one setpoint step. They are ranked by BIC with AR(1) errors
    on identical rows; those within 10 points stay, and the best single lag where its fit is
    within 3 % of the best.
    """
    log, thinned = _thinned(log)
    first = float(log.temperature_degC[0])
    ambient = (first - _AMBIENT_BELOW, first + _AMBIENT_ABOVE) if ambient_degC is None else (ambient_degC,) * 2
    hypotheses = [
        Hypothesis(segments=(Segment(log=log, law=law, event=event, ambient_degC=ambient),), two_lags=two)
        for law in laws
        for two in (False, True)
        for event in (False, True)
    ]
    ranked = fit_all(hypotheses, seed=seed)
    kept = _kept(ranked)
    best = max(kept, key=lambda fit: fit.fit_pct)
    plant = best.hypothesis.plant(best.vector)
    ranges = _ranges(best, kept, seed)
    ci95 = _intervals(ranges, ambient_degC)
    residuals = log.temperature_degC - best.simulated_degC
    return FittedModel(
        model=plant.half_rule(),
        outcome=_outcome(best.fit_pct, ci95),
        method=_method(best),
        ci95=ci95,
        combinations={
            name: (measure(plant), ranges[name]) for name, measure in _MEASURES.items() if name not in _FIELDS
        },
        candidates=tuple(_candidate(fit, ranked[0].bic, log) for fit in kept),
        fit_pct=best.fit_pct,
        notes=thinned + _notes(log, best, ranges, ci95, ambient_degC),
        residuals=Residuals(
            time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=best.simulated_degC,
            autocorrelation=autocorrelation(residuals),
        ),
    )


def _intervals(ranges: dict[str, Interval], ambient_degC: float | None) -> dict[str, Interval | None]:
    """Return what is identified; gain and time constant trade off against an unknown ambient."""
    found = {name: identified(ranges[name]) for name in _FIELDS}
    if ambient_degC is not None:
        return found | {"ambient_degC": None}
    if found["ambient_degC"] is None:
        return found | {"gain_degC_per_pct": None, "time_constant_s": None}
    return found


_FIELDS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")


def _kept(ranked: list[Fit]) -> list[Fit]:
    near = [fit for fit in ranked if fit.bic - ranked[0].bic <= _NEAR]
    single = max((fit for fit in ranked if not fit.hypothesis.two_lags), key=lambda fit: fit.fit_pct, default=near[0])
    best = max(fit.fit_pct for fit in near)
    return near if single in near or single.fit_pct < best - _FOPDT_NEAR else [*near, single]


def _ranges(best: Fit, kept: list[Fit], seed: int) -> dict[str, Interval]:
    """Return each measure's interval: block bootstrap of the best model, widened to hold every candidate."""
    hypothesis, measured = best.hypothesis, best.hypothesis.measured
    shaken = block_resamples(measured - best.simulated_degC, _RESAMPLES, np.random.default_rng(seed))
    starts = np.repeat(best.vector[None, :], _RESAMPLES, axis=0)
    residuals = residuals_of(hypothesis, best.simulated_degC + shaken)
    minima = minimise(residuals, starts, hypothesis.low, hypothesis.high, iterations=10)
    plants = [hypothesis.plant(z) for z in minima.parameters]
    bounds = {"ambient_degC": (hypothesis.low[4], hypothesis.high[4]), "dead_time_s": (0.0, np.inf)}
    others = [fit.hypothesis.plant(fit.vector) for fit in kept]
    found = {}
    for name, measure in _MEASURES.items():
        low, high = bounds.get(name, (0.0, np.inf))
        values = np.array([measure(plant) for plant in plants])
        found[name] = envelope(interval(values, low, high), [measure(plant) for plant in others])
    return found


def _candidate(fit: Fit, leader: float, log: Log) -> Candidate:
    return Candidate(
        model=fit.hypothesis.plant(fit.vector),
        log=log.name,
        window_s=(float(log.time_s[0]), float(log.time_s[-1])),
        law=_law_name(fit),
        controller=fit.hypothesis.controller(fit.vector),
        fit_pct=fit.fit_pct,
        rmse_degC=fit.rmse_degC,
        delta_bic=fit.bic - leader,
    )


def _thinned(log: Log) -> tuple[Log, tuple[str, ...]]:
    """Return the log with every k-th reading only, where it has more than the loops inside the fit need, and a note."""
    every = -(-len(log.time_s) // _MOST_READINGS)
    if every == 1:
        return log, ()
    setpoint = None if log.setpoint_degC is None else log.setpoint_degC[::every]
    temperature = log.temperature_degC[::every]
    thin = replace(log, time_s=log.time_s[::every], temperature_degC=temperature, setpoint_degC=setpoint)
    return thin, (f"Of {len(log.time_s)} readings every {every}th was used.",)


def _law_name(fit: Fit) -> str:
    segment = fit.hypothesis.segments[0]
    return segment.law.name + (", setpoint step" if segment.event else "")


def _outcome(fit: float, ci95: dict[str, Interval | None]) -> Outcome:
    if fit < _POOR:
        return Outcome.POOR_FIT
    apart = ci95["gain_degC_per_pct"] is not None and ci95["time_constant_s"] is not None
    return Outcome.IDENTIFIED if apart else Outcome.COMBINATIONS_ONLY


def _method(best: Fit) -> str:
    order = "two lags, reduced by the half rule" if best.hypothesis.two_lags else "one lag"
    return f"closed loop simulated with {best.hypothesis.segments[0].law.name} inside the fit; {order}; block bootstrap"


def _notes(
    log: Log, best: Fit, ranges: dict[str, Interval], ci95: dict[str, Interval | None], ambient_degC: float | None
) -> tuple[str, ...]:
    notes = ["Neither power nor setpoint was logged: the controller's law is a hypothesis, and setpoint and bias show "
             "only as their sum."]
    event = best.hypothesis.controller(best.vector)
    if "setpoint_step_degC" in event:
        notes.append(
            f"A setpoint step of {event['setpoint_step_degC']:+.1f} °C at {event['setpoint_step_at_s']:.0f} s is "
            "assumed because the log asks for it; nobody wrote it down."
        )
    lost = [name for name, found in ci95.items() if found is None and not (name == "ambient_degC" and ambient_degC)]
    for name in lost:
        _, called, unit = NOMENCLATURE[name]
        low, high = ("the bound of the search" if end is None else f"{end:.3g} {unit}"
                     for end in (ranges[name].low, ranges[name].high))
        told = f"The {called} is not identified: anything from {low} to {high} explains {log.name}"
        notes.append(f"{told} nearly as well.")
    if ambient_degC is None:
        notes.append(
            f"The ambient was sought within {best.hypothesis.low[4]:.1f}…{best.hypothesis.high[4]:.1f} °C, around the "
            "first reading; give --ambient if you know it."
        )
    else:
        notes.append(f"The ambient temperature of {ambient_degC:g} °C was given, not fitted.")
    if lost:
        notes.append("A log of the power, or one open-loop step of known size until the temperature rests, settles it.")
    bound = [name for name in best.hypothesis.on_bound(best.vector) if name != "ambient_degC"]
    if bound:
        notes.append(f"On a bound of the search: {', '.join(bound)}.")
    return tuple(notes)

"""The fit of a log with power: one lag as the working model, two lags beside it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.intervals import identified_parts, interval
from heatertune.model.open_loop import PowerFit, PowerProblem
from heatertune.model.statistics import ar1_bic, autocorrelation, block_resamples, fit_pct
from heatertune.model.values import Candidate, FittedModel, Fopdt, Interval, Outcome, Residuals

__all__ = ["fit_power"]

Array = npt.NDArray[np.float64]

_RESAMPLES = 200
_LONG = 5000  # readings; above, fewer resamples keep the wait short
_POOR = 60.0  # fit [%] below which no interval means anything
_NEAR = 10.0  # BIC points


def fit_power(
    log: Log, *, ambient_degC: float | None, power_before_pct: float | None, seed: int
) -> FittedModel:
    """Return the FOPDT of a log with power, its bootstrap intervals, and the candidates (one lag, two lags)."""
    problems = [
        PowerProblem(log=log, two_lags=two, ambient_degC=ambient_degC, power_before_pct=power_before_pct)
        for two in (False, True)
    ]
    fits = [problem.fit() for problem in problems]
    one = fits[0]
    assert isinstance(one.model, Fopdt)
    residuals = log.temperature_degC - one.simulated_degC
    ci95 = _bootstrap(problems[0], one, residuals, seed)
    if ambient_degC is not None:
        ci95["ambient_degC"] = None
    fit_one = fit_pct(log.temperature_degC, one.simulated_degC)
    candidates = _candidates(log, fits)
    return FittedModel(
        model=one.model,
        outcome=_outcome(fit_one, ci95),
        method="exact simulation with the logged power, free initial state; block bootstrap",
        ci95=ci95,
        candidates=candidates,
        fit_pct=fit_one,
        notes=_notes(log, one, candidates, ambient_degC),
        residuals=Residuals(
            time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=one.simulated_degC,
            autocorrelation=autocorrelation(residuals),
        ),
    )


def _bootstrap(problem: PowerProblem, fit: PowerFit, residuals: Array, seed: int) -> dict[str, Interval | None]:
    resamples = _RESAMPLES if len(residuals) < _LONG else _RESAMPLES // 5
    shaken = block_resamples(residuals, resamples, np.random.default_rng(seed))
    values = problem.refit(fit.vector, fit.simulated_degC + shaken)
    columns = {
        "gain_degC_per_pct": (values[:, 0], 0.0, np.inf),
        "time_constant_s": (values[:, 1], float(np.exp(problem.low[0])), float(np.exp(problem.high[0]))),
        "dead_time_s": (values[:, 3], float(problem.low[1]), float(problem.high[1])),
        "ambient_degC": (values[:, 4], -np.inf, np.inf),
    }
    return {name: interval(column, low, high) for name, (column, low, high) in columns.items()}


def _candidates(log: Log, fits: list[PowerFit]) -> tuple[Candidate, ...]:
    """Return the one-lag model and, where it explains the log nearly as well or better, the two-lag one."""
    bics = [ar1_bic(log.temperature_degC - fit.simulated_degC, fit.unknowns) for fit in fits]
    found = []
    for fit, bic in zip(fits, bics, strict=True):
        error = log.temperature_degC - fit.simulated_degC
        found.append(
            Candidate(
                model=fit.model, log=log.name, window_s=(float(log.time_s[0]), float(log.time_s[-1])),
                law="power logged", fit_pct=fit_pct(log.temperature_degC, fit.simulated_degC),
                rmse_degC=float(np.sqrt(np.mean(error**2))), delta_bic=bic - min(bics),
            )
        )
    return tuple(c for c in found if isinstance(c.model, Fopdt) or c.delta_bic < _NEAR)


def _outcome(fit: float, ci95: dict[str, Interval | None]) -> Outcome:
    if fit < _POOR:
        return Outcome.POOR_FIT
    needed = ("gain_degC_per_pct", "time_constant_s")
    return Outcome.IDENTIFIED if all(identified_parts(ci95[n]) for n in needed) else Outcome.COMBINATIONS_ONLY


def _notes(
    log: Log, one: PowerFit, candidates: tuple[Candidate, ...], ambient_degC: float | None
) -> tuple[str, ...]:
    notes = []
    if len(candidates) > 1 and candidates[0].delta_bic > _NEAR:
        two = candidates[1].model
        notes.append(
            f"Two lags ({two.lags_s[0]:.3g} s, {two.lags_s[1]:.3g} s, dead time {two.dead_time_s:.3g} s) explain "
            f"{log.name} better than one (BIC {candidates[0].delta_bic:.0f} points): tuning and proof run on both."
        )
    if ambient_degC is not None:
        notes.append(f"The ambient temperature of {ambient_degC:g} °C was given, not fitted.")
    assert log.power_pct is not None
    if log.power_pct[0] > 0.0:
        notes.append(
            f"The log begins with {log.power_pct[0]:g} % power; the initial state was fitted, but what the power was "
            "before (--power-before) decides the dead time where no later step shows it."
        )
    if one.on_bound:
        notes.append(f"On a bound of the search: {', '.join(one.on_bound)}.")
    return tuple(notes)

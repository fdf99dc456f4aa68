"""What a fit with power has to say in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.intervals import Interval, identified_parts
from heatertune.model.outliers import sensor_step
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import COLUMNS, DRIFT
from heatertune.model.values import Candidate, HeaterModel

__all__ = ["limit_notes", "log_notes", "longest_hold_s", "notes_of", "rival_notes"]

Array = npt.NDArray[np.float64]

_NEAR = 10.0  # BIC points
_SETTLED = 3.0  # time constants of held power, after which 5 % of a step are left
_NAMED = 5  # instants that are listed


def notes_of(
    log: Log, problem: PowerProblem, fit: PowerFit, ci95: Mapping[str, Interval | None],
    candidates: tuple[Candidate, ...], outliers: npt.NDArray[np.intp],
) -> tuple[str, ...]:
    """Return what was found, assumed and cannot be known, one sentence each.

    Args:
        log: as it was fitted.
        problem: with the start, drift and loads that the log asked for.
        fit: of the problem, with a model.
        ci95: parameter → its interval, None where it has none.
        candidates: as `candidates_of` gives them.
        outliers: places of the readings that were put where their neighbours are, shape (k,).
    """
    assert fit.model is not None
    return (
        *log_notes(log, problem, fit, outliers),
        *limit_notes(fit.model, fit.on_bound, ci95, longest_hold_s(log, problem)),
        *rival_notes(log.name, candidates),
    )


def log_notes(
    log: Log, problem: PowerProblem, fit: PowerFit, outliers: npt.NDArray[np.intp]
) -> tuple[str, ...]:
    """Return what was done to the readings, and what was assumed and found beside the heater.

    `outliers`: places of the readings that were put where their neighbours are, shape (k,).
    """
    return (*_readings(log, problem, outliers), *_power_before(log, problem), *_disturbed(log, problem, fit))


def longest_hold_s(log: Log, problem: PowerProblem) -> float:
    """Return the longest time for which the power stays the same [s]."""
    return float(np.max(np.diff([*problem.readings.edge_s, log.time_s[-1]])))


def _readings(log: Log, problem: PowerProblem, outliers: npt.NDArray[np.intp]) -> list[str]:
    notes = []
    assert log.power_pct is not None
    step = sensor_step(log.temperature_degC)
    if step is not None:
        notes.append(f"The sensor's readings come in steps of {step:.3g} °C.")
    if len(outliers):
        named = ", ".join(f"{t:g}" for t in log.time_s[outliers[:_NAMED]])
        more = f" and {len(outliers) - _NAMED} more" if len(outliers) > _NAMED else ""
        notes.append(f"Readings far from their neighbours were given no weight: {len(outliers)} (at {named} s{more}).")
    if problem.readings.averaged > 1:
        merged = len(problem.readings.edge_s) <= np.count_nonzero(np.diff(log.power_pct))
        notes.append(
            f"Runs of up to {problem.readings.averaged} readings were averaged for the search, "
            "and the model over the same runs; the power's edges were kept exactly"
            f"{', but for small ones that follow closely, which were averaged' if merged else ''}."
        )
    return notes


def _power_before(log: Log, problem: PowerProblem) -> list[str]:
    assert log.power_pct is not None
    notes = []
    if problem.ambient_degC is not None:
        notes.append(f"The ambient temperature of {problem.ambient_degC:g} °C was stated, not fitted.")
    first = log.power_pct[0]
    if problem.at_rest and first != problem.power_before:
        notes.append(
            f"The log begins with {first:g} % power already on; it was taken as {problem.power_before:g} %, and the "
            "heater at rest, before, which explains it better than any other start; --power-before would settle it."
        )
    elif problem.at_rest:
        pass  # the readings before the first step show it
    elif first > 0.0 and problem.power_before_pct is None:
        notes.append(
            f"The log begins with {first:g} % power already on, and nothing before it: no steady start was assumed, "
            "which can more than double the gain; if you know the power before, give --power-before."
        )
    elif first > 0.0 and problem.power_before_pct == 0.0:
        notes.append(
            f"The log begins with {first:g} % power already on; it was taken as 0 % before, which --power-before "
            "would settle, and no steady start was assumed, which can more than double the gain."
        )
    return notes


def _disturbed(log: Log, problem: PowerProblem, fit: PowerFit) -> list[str]:
    notes = []
    if problem.drift:
        notes.append(f"The ambient drifts by {3600.0 * fit.linear[DRIFT]:.2g} °C/h; the drift was fitted.")
    for instant, size in zip(problem.loads_s, fit.linear[COLUMNS:], strict=False):
        notes.append(
            f"At {instant:.4g} s an unlogged load, or a change of the heater, begins that "
            f"{'warms' if size > 0 else 'cools'} {log.name} by {abs(size):.2g} °C in the long run; it was fitted "
            "together with the power."
        )
    return notes


def limit_notes(
    model: HeaterModel, on_bound: tuple[str, ...], ci95: Mapping[str, Interval | None], longest_s: float
) -> tuple[str, ...]:
    """Return what is known only in part; `longest_s`: see `longest_hold_s`, of all logs."""
    notes = []
    if not all(identified_parts(ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s")):
        full = 100.0 * model.gain_degC_per_pct / model.lags_s[0]
        reason = (
            "the log never reaches steady state (pulses and truncated tests fix no more)"
            if longest_s < _SETTLED * model.lags_s[0]
            else "what the model leaves over is slow, and passes for gain or ambient"
        )
        notes.append(f"Gain and time constant are known only as a ratio, {full:.2g} °C/s at full power: {reason}.")
    if model.dead_time_s > model.lags_s[0]:
        notes.append(
            f"The dead time of {model.dead_time_s:.3g} s is longer than the time constant of {model.lags_s[0]:.3g} s, "
            "which no heater of fewer than six equal lags in series has: it may as well be a clock of the power that "
            "runs ahead of the temperature's, which looks the same; compare the two at one switching of the heater."
        )
    if on_bound:
        notes.append(f"On a bound of the search: {', '.join(on_bound)}.")
    return tuple(notes)


def rival_notes(name: str, candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """Return which other models explain the log, or logs, of this name; the first candidate is of one lag."""
    notes = []
    better = candidates[0].delta_bic
    two = next((c.model for c in candidates if len(c.model.lags_s) > 1 and c.law.endswith("logged")), None)
    if two is not None and better > _NEAR:
        notes.append(
            f"Two lags ({two.lags_s[0]:.3g} s, {two.lags_s[1]:.3g} s, dead time {two.dead_time_s:.3g} s) explain "
            f"{name} better than one (BIC {better:.0f} points): tuning and proof run on both."
        )
    faces = [c for c in candidates if c.law.endswith(("heating", "cooling"))]
    if faces and better > _NEAR:
        notes.append(
            f"{name} warms with a time constant of {faces[0].model.time_constant_s:.3g} s and cools with "
            f"{faces[1].model.time_constant_s:.3g} s: tuning and proof run on both."
        )
    if any(c.law.endswith("integrator") for c in candidates):
        notes.append("No curvature is seen: an integrator explains the log as well and is one of the candidates.")
    return tuple(notes)

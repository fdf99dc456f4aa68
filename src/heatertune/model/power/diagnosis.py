"""What a fit with power has to say in plain words.

How much of a log's temperature the power explains, against loads, a drift and free initial states.

Loads and a drift can stand for a slow answer of the heater: where they move the model by as much as the readings span,
or act against every step of the power, the gain that is left for the power can be several times the heater's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.diagnostics import Remark
from heatertune.model.outliers import sensor_step
from heatertune.model.power.candidates import second_is_seen
from heatertune.model.power.load_steps import bic_of, edges_of
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import COLUMNS, DRIFT, GAIN
from heatertune.model.statistics import Interval, identified_parts
from heatertune.model.values import Candidate, HeaterModel

__all__ = [
    "Contributions", "contributions_of", "limit_notes", "log_notes", "longest_hold_s", "notes_of", "rival_notes",
    "share_remarks",
]


Array = npt.NDArray[np.float64]

_LEAST: Final = 2.0 / 3.0  # of the span, that the power has to move the model by
_DRIFT: Final = 1.0 / 3.0  # of the span, that a drift may move it by
_LOADS: Final = 2.0 / 3.0  # of the span, that loads may
_AGAINST: Final = 4.0 / 3.0  # of the span: beyond that, power and loads cancel
_CANCELLED: Final = 3.0  # of the span: beyond that, power and initial states cancel
_OFTEN: Final = 0.75  # of the log, within a time constant of a step
_POWER_SHARE_NEAR: Final = 10.0  # BIC points within which a fit explains the log nearly as well as the best
_SMALL: Final = 0.15  # of the span: loads that move it by less hide little


class Contributions(NamedTuple):
    """What a fit makes of its readings, by cause: largest less smallest value over the readings [°C].

    Attributes:
        model: of the whole model.
        power: of the answer to the power.
        powered: of the answer to the power with the initial states.
        events: of drift and loads together.
        drift: of the drift.
        loads: of the loads.
        start: of the free initial states.
    """

    model: float
    power: float
    powered: float
    events: float
    drift: float
    loads: float
    start: float


def contributions_of(problem: PowerProblem, fit: PowerFit) -> Contributions:
    """Compute how far each cause moves a fit over its readings."""
    parts = fit.linear[:, None] * problem.basis(fit.vector)
    end = COLUMNS + len(problem.loads_s)
    power, drift, loads = parts[GAIN], parts[DRIFT], parts[COLUMNS:end].sum(axis=0)
    start = parts[DRIFT + 1 : COLUMNS].sum(axis=0) + parts[end:].sum(axis=0)
    causes = (parts.sum(axis=0), power, power + start, drift + loads, drift, loads, start)
    return Contributions(*(float(np.ptp(cause)) for cause in causes))


def share_remarks(
    name: str, problems: Sequence[PowerProblem], fits: Sequence[PowerFit], doubt: str = ""
) -> Iterator[Remark]:
    """Yield the finding that the power does not explain a log's temperature, once, of the first fit that shows it.

    A fit that another one explains away, by more than 10 BIC points, is not judged: it is no model of the log.

    Args:
        name: of the log.
        problems: of one lag and, where two were tried, of two.
        fits: their best fits.
        doubt: what casts doubt on the power as the cause, see `sanity.demand_cause`; it is yielded first.
    """
    if doubt:
        yield Remark("unexplained-by-power", f"{name}: {doubt}")
        return
    judged = [(problem, fit) for problem, fit in zip(problems, fits, strict=True)
              if not problem.two_lags or second_is_seen(fit)]
    least = min((bic_of(*pair) for pair in judged), default=math.inf)
    for problem, fit in judged:
        if bic_of(problem, fit) > least + _POWER_SHARE_NEAR:
            continue
        reason = _reason(contributions_of(problem, fit), problem, fit)
        if reason:
            yield Remark("unexplained-by-power", f"{name}, {'two lags' if problem.two_lags else 'one lag'}: {reason}")
            return


def _reason(moved: Contributions, problem: PowerProblem, fit: PowerFit) -> str:
    """Return why the power does not explain the readings; empty where it does."""
    whole, events = moved.model, _events(problem, fit)
    if moved.power < _LEAST * whole:
        rest = "; ".join([*events, *([f"initial states {moved.start:.3g} °C"] if moved.start > _SMALL * whole else [])])
        return (f"the power explains {moved.power:.3g} °C of the {whole:.3g} °C that the model spans "
                f"({100.0 * moved.power / whole:.0f} %, where two thirds are needed); the rest: {rest or 'nothing'}.")
    cancels = moved.events > _DRIFT * whole and moved.powered > _AGAINST * whole
    if moved.drift > _DRIFT * whole or moved.loads > _LOADS * whole or cancels:
        return (f"drift and loads move the model by {moved.events:.3g} °C and the power by {moved.power:.3g} °C, where "
                f"both together span {whole:.3g} °C ({'; '.join(events)}).")
    if moved.power > _CANCELLED * whole and moved.start > whole:
        return (f"the power moves the model by {moved.power:.3g} °C and its initial state by {moved.start:.3g} °C, "
                f"where both together span {whole:.3g} °C.")
    if moved.loads > _SMALL * whole and _loads_oppose(problem, fit):
        return (f"each load begins within a time constant of a step of the power and acts against it "
                f"({'; '.join(events)}).")
    return ""


def _events(problem: PowerProblem, fit: PowerFit) -> list[str]:
    """Return drift and loads in a few words each, loads as what they would come to in the long run."""
    drift = [f"drift {3600.0 * fit.linear[DRIFT]:+.3g} °C/h"] * problem.drift
    return drift + [f"load of {size:+.3g} °C at {instant:.4g} s"
                    for instant, size in zip(problem.loads_s, fit.linear[COLUMNS:], strict=False)]


def _loads_oppose(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether every load begins within a time constant of a large step of the power, and against it.

    Where the power moves so often that most instants lie within a time constant of a step, no load is judged so.
    """
    edges, steps = edges_of(problem)
    reach = math.exp(float(fit.vector[0]))
    time = problem.readings.time_s
    if not problem.loads_s or not len(edges) or _covered(edges, reach, time) > _OFTEN:
        return False
    return all(np.any((instant >= edges) & (instant <= edges + reach) & (steps * size * fit.linear[GAIN] < 0.0))
               for instant, size in zip(problem.loads_s, fit.linear[COLUMNS:], strict=False))


def _covered(edges: Array, reach: float, time: Array) -> float:
    """Return the share of the log that lies within a reach after an edge."""
    ends = np.minimum(np.append(edges[1:], time[-1]), edges + reach)
    return float(np.sum(np.maximum(ends - edges, 0.0))) / float(np.ptp(time))


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

"""How much of a log's temperature the power explains, against loads, a drift and free initial states.

Loads and a drift can stand for a slow answer of the heater: where they move the model by as much as the readings span,
or act against every step of the power, the gain that is left for the power can be several times the heater's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.model.diagnostics import Remark
from heatertune.model.power.candidates import second_is_seen
from heatertune.model.power.load_steps import bic_of, edges_of
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import COLUMNS, DRIFT, GAIN

__all__ = ["Contributions", "contributions_of", "share_remarks"]

Array = npt.NDArray[np.float64]

_LEAST: Final = 2.0 / 3.0  # of the span, that the power has to move the model by
_DRIFT: Final = 1.0 / 3.0  # of the span, that a drift may move it by
_LOADS: Final = 2.0 / 3.0  # of the span, that loads may
_AGAINST: Final = 4.0 / 3.0  # of the span: beyond that, power and loads cancel
_CANCELLED: Final = 3.0  # of the span: beyond that, power and initial states cancel
_OFTEN: Final = 0.75  # of the log, within a time constant of a step
_NEAR: Final = 10.0  # BIC points within which a fit explains the log nearly as well as the best
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
        if bic_of(problem, fit) > least + _NEAR:
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

"""The front of performance against robustness: the best cost at each limit of Ms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from heatertune.errors import OutOfRange
from heatertune.model.cooler_mirror import cools, mirror_heater
from heatertune.model.values import FittedModel
from heatertune.pid.continuous.optimum import ContinuousProblem, optimum
from heatertune.pid.continuous.tune import assess_design
from heatertune.pid.search.feasible import Problem, search
from heatertune.pid.specs import OBJECTIVES, Specs
from heatertune.pid.tune import assessed_sampled, tune
from heatertune.units import whole

__all__ = ["SCHEMA", "front"]

_MOST_POINTS: Final = 1000

SCHEMA = "heatertune/pareto/1"


def front(
    fitted: FittedModel, *, structure: str = "pi", ms_low: float = 1.2, ms_high: float = 2.0, points: int = 9,
    sample_time_s: float | None = 0.0, progress: Callable[[str], object] = str, **specs: Any,
) -> dict[str, Any]:
    """Return the document of the front: one row for each limit of Ms, from the most robust to the fastest.

    A row is on the front where no row of a smaller Ms costs as little; under limits of Mt or Mks a larger Ms may give
    nothing more, and the row says so.

    Args:
        fitted: model and candidates.
        structure: "pi" or "pid".
        ms_low: smallest limit of Ms.
        ms_high: largest limit of Ms.
        points: number of rows.
        sample_time_s: TA [s]; 0 for the continuous loop, None for the TA that `tune` finds half way.
        progress: told what begins.
        specs: further settings of `Specs`: mt, mks, objective, weight.

    Raises:
        OutOfRange: limits that are not in order, fewer than two points, a P controller (it has no load IAE).
        InputError: as `heatertune.pid.tune.tune`.
    """
    if structure not in ("pi", "pid"):
        raise OutOfRange("structure", structure, "pi or pid: the offset of a P controller costs without end")
    points = whole("points", points, least=2, most=_MOST_POINTS)
    if not ms_low < ms_high:
        raise OutOfRange("ms_low", ms_low, f"< ms_high = {ms_high:g}")
    if cools(fitted):
        document = front(mirror_heater(fitted), structure=structure, ms_low=ms_low, ms_high=ms_high, points=points,
                         sample_time_s=sample_time_s, progress=progress, **specs)
        return document | {"rows": [row | {"gain_pct_per_degC": -row["gain_pct_per_degC"]} for row in document["rows"]]}
    wanted = Specs(ms=ms_high, **specs)
    if sample_time_s is None:
        half_way = {"ms": 0.5 * (ms_low + ms_high), **specs}
        sample_time_s = tune(fitted, structure=structure, progress=progress, **half_way).sample_time_s
    rows: list[dict[str, Any]] = []
    least = math.inf
    for number, ms in enumerate(np.linspace(ms_low, ms_high, points), 1):
        progress(f"tuning with Ms <= {ms:.3g} ({number} of {points})")
        row = _row(fitted, structure, replace(wanted, ms=float(ms)), sample_time_s)
        rows.append(row | {"on_front": row["cost"] < least * (1.0 - 1e-3)})
        least = min(least, row["cost"])
    return {
        "schema": SCHEMA, "structure": structure, "sample_time_s": sample_time_s, "objective": wanted.objective,
        "weight": wanted.weight, "cost": _cost_name(wanted), "rows": rows,
    }


def _cost_name(specs: Specs) -> str:
    if specs.weight is None:
        return OBJECTIVES[specs.objective]
    load = f"{1.0 - specs.weight:g}·∫|e| dt after a load of 1/k %"
    return f"{load} + {specs.weight:g}·∫|e| dt after a setpoint step of 1 °C [s]"


def _row(fitted: FittedModel, structure: str, specs: Specs, sample_time_s: float) -> dict[str, Any]:
    if sample_time_s == 0.0:
        problem = ContinuousProblem(plants=fitted.plants, structure=structure, specs=specs)
        optimal = optimum(problem)
        cost, design = problem.cost(optimal), assess_design(fitted, optimal)
    else:
        sampled = Problem(
            plants=fitted.plants, structure=structure, sample_time_s=sample_time_s, ms=specs.ms, mt=specs.mt,
            mks=specs.mks, objective=specs.objective, weight=specs.weight,
        )
        optimal = search(sampled)
        cost, design = sampled.cost(optimal), assessed_sampled(fitted.plants, optimal)
    assert design.margins is not None
    return {"ms_limit": specs.ms, "cost": cost, "ms": design.margins.ms, "mt": design.margins.mt} | {
        name: getattr(design, name)
        for name in ("mks", "gain_pct_per_degC", "integral_time_s", "derivative_time_s", "iae_load", "iae_setpoint")
    }

"""Alternatives for the same heater and sampling interval: all tuning rules, and the best cost at each limit of Ms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError, OutOfRange, demand_known
from heatertune.model.model_values import FittedModel
from heatertune.model.reduction import cools, mirror_heater
from heatertune.options import checked_arguments
from heatertune.pid.continuous_optimum import ContinuousProblem, assess_design, optimum
from heatertune.pid.continuous_optimum import margins as continuous_margins
from heatertune.pid.design_values import PidDesign
from heatertune.pid.rules import RULES, apply_rule, model_for, range_note
from heatertune.pid.sampled_loop import iae_load, margins
from heatertune.pid.search.feasible import Problem, search
from heatertune.pid.specs import OBJECTIVES, Specs
from heatertune.pid.tune import assessed_sampled, tune
from heatertune.settings import TuneSettings
from heatertune.units import whole

__all__ = ["SCHEMA", "alternatives", "front"]


_MOST_POINTS: Final = 1000
_KEYWORDS: Final = ("structure", "ms_low", "ms_high", "points", "sample_time_s", "progress")

SCHEMA = "heatertune/pareto/1"


@checked_arguments
def front(
    fitted: FittedModel, *, structure: str = "pi", ms_low: float = 1.2, ms_high: float = 2.0, points: int = 9,
    sample_time_s: float | None = 0.0, progress: Callable[[str], object] = str, **specs: Any,
) -> dict[str, Any]:
    """Return the document of the front: one row for each limit of Ms, from the most robust to the fastest.

    A row is on the front if no row with a smaller Ms costs as little. With limits of Mt or Mks, a larger Ms may give no
    improvement, and the row says so.

    Args:
        fitted: model and candidates.
        structure: "pi" or "pid".
        ms_low: smallest limit of Ms.
        ms_high: largest limit of Ms.
        points: number of rows.
        sample_time_s: TA [s]; 0 for the continuous loop, None for the TA that `tune` finds half way.
        progress: called with a short message when a stage begins.
        specs: further settings of `Specs`: mt, mks, objective, weight.

    Raises:
        UnknownOption: another keyword.
        OutOfRange: limits that are not in order, fewer than two points, a P controller (it has no load IAE).
        InputError: as `heatertune.pid.tune.tune`.
    """
    if structure not in ("pi", "pid"):
        raise OutOfRange("structure", structure, "pi or pid: the offset of a P controller has an infinite cost")
    demand_known(specs, [*_KEYWORDS, *(set(Specs.__dataclass_fields__) - {"ms"})], {"ms": "ms_high"})
    points = whole("points", points, least=2, most=_MOST_POINTS)
    if not ms_low < ms_high:
        raise OutOfRange("ms_low", ms_low, f"< ms_high = {ms_high:g}")
    if cools(fitted):
        document = front(mirror_heater(fitted), structure=structure, ms_low=ms_low, ms_high=ms_high, points=points,
                         sample_time_s=sample_time_s, progress=progress, **specs)
        return document | {"rows": [row | {"gain_pct_per_degC": -row["gain_pct_per_degC"]} for row in document["rows"]]}
    base = Specs(ms=ms_high, **specs)
    if sample_time_s is None:
        half_way = {"ms": 0.5 * (ms_low + ms_high), **specs}
        sample_time_s = tune(fitted, TuneSettings(structure=structure, **half_way), progress=progress).sample_time_s
    rows: list[dict[str, Any]] = []
    least = math.inf
    for number, ms in enumerate(np.linspace(ms_low, ms_high, points), 1):
        progress(f"tuning with Ms <= {ms:.3g} ({number} of {points})")
        row = _row(fitted, structure, replace(base, ms=float(ms)), sample_time_s)
        rows.append(row | {"on_front": row["cost"] < least * (1.0 - 1e-3)})
        least = min(least, row["cost"])
    return {
        "schema": SCHEMA, "structure": structure, "sample_time_s": sample_time_s, "objective": base.objective,
        "weight": base.weight, "cost": _cost_name(base), "rows": rows,
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


@checked_arguments
def alternatives(fitted: FittedModel, design: PidDesign) -> list[dict[str, Any]]:
    """Return a table of the design and every rule, all with the structure, TA and derivative filter of the design.

    Each row holds method, gain_pct_per_degC, integral_time_s, derivative_time_s, ms (worst candidate, infinite if
    unstable), iae_load (worst candidate [°C·s], infinite if the loop keeps an offset or is unstable), applicable, and
    why_not: one sentence, None if the rule is applicable. A rule that gives no settings has None for numbers.
    """
    first = {"method": "this design", **_judged(fitted, design, None)}
    return [first, *({"method": name, **_ruled(name, fitted, design)} for name in RULES)]


def _ruled(name: str, fitted: FittedModel, design: PidDesign) -> Mapping[str, Any]:
    ta, structure = design.sample_time_s, design.structure
    model = model_for(name, structure, fitted)
    try:
        gain, integral, derivative = apply_rule(name, model, structure, ta)
    except InputError as problem:
        numbers = ("gain_pct_per_degC", "integral_time_s", "derivative_time_s", "ms", "iae_load")
        return dict.fromkeys(numbers) | {"applicable": False, "why_not": str(problem)}
    ruled = replace(
        design, gain_pct_per_degC=gain, integral_time_s=integral, derivative_time_s=derivative,
        margins=None, iae_load=None, iae_setpoint=None, notes=(),
    )
    return _judged(fitted, ruled, range_note(name, model, structure, ta))


def _judged(fitted: FittedModel, design: PidDesign, doubt: str | None) -> dict[str, Any]:
    if design.sample_time_s == 0.0:
        of_each = [continuous_margins((plant,), design)[0].ms for plant in fitted.plants]
    else:
        of_each = [margins(plant, design).ms for plant in fitted.plants]
    unstable = sum(math.isinf(ms) for ms in of_each)
    why_not = [doubt] if doubt is not None else []
    if unstable:
        why_not.append(f"Unstable on {unstable} of {len(of_each)} candidate models.")
    return {
        "gain_pct_per_degC": design.gain_pct_per_degC,
        "integral_time_s": design.integral_time_s,
        "derivative_time_s": design.derivative_time_s,
        "ms": max(of_each),
        "iae_load": math.inf if unstable else _load(fitted, design),
        "applicable": not why_not,
        "why_not": " ".join(why_not) or None,
    }


def _load(fitted: FittedModel, design: PidDesign) -> float:
    if design.sample_time_s == 0.0:
        cost = assess_design(fitted, design).iae_load
        return math.inf if cost is None else cost
    return max(iae_load(plant, design) for plant in fitted.plants)

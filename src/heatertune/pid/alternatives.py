"""What every rule would have given for the same heater, candidates and sampling interval."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from heatertune.errors import InputError
from heatertune.model.values import FittedModel
from heatertune.pid.continuous.optimum import margins as continuous_margins
from heatertune.pid.continuous.tune import assess_design
from heatertune.pid.loop.robustness import margins
from heatertune.pid.loop.sampled import iae_load
from heatertune.pid.rules import RULES, apply_rule, model_for, range_note
from heatertune.pid.values import PidDesign

__all__ = ["alternatives"]


def alternatives(fitted: FittedModel, design: PidDesign) -> list[dict[str, Any]]:
    """Return the design, then every rule, all with the structure, TA and derivative filter of the design.

    Each row holds method, gain_pct_per_degC, integral_time_s, derivative_time_s, ms (worst candidate, infinite where
    unstable), iae_load (worst candidate [°C·s], infinite where the loop keeps an offset or is unstable), applicable,
    and why_not: one sentence, None where the rule is applicable. A rule that gives no settings has None for numbers.
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

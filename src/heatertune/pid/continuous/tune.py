"""FittedModel → PidDesign of the continuous loop: the answer to `--sample-time 0`, with its explanation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from heatertune.errors import InputError
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.continuous.kernel import DERIVATIVE_FILTER_N
from heatertune.pid.continuous.optimum import ContinuousProblem, global_optimum, iae, margins, optimum
from heatertune.pid.explain import explain
from heatertune.pid.rules import RULES, apply_rule, model_for
from heatertune.pid.scheduling import told_about_faces
from heatertune.pid.search.robust import Open, robust_design
from heatertune.pid.specs import Specs
from heatertune.pid.values import PidDesign, Promise, structure_of

__all__ = ["assess_design", "tune_continuous"]

_TOLD = (
    f"Continuous loop with its exact dead time, TV filtered by TV/{DERIVATIVE_FILTER_N:g}; "
    "for words of a PLC tune with a sampling interval."
)


def tune_continuous(
    fitted: FittedModel, *, method: str, structure: str, specs: Specs, closed_loop_s: float | None = None,
    robust: str = "none",
) -> PidDesign:
    """Return the continuous design by the optimum or a rule; the optimum is checked on a grid.

    Args:
        fitted: model and candidates.
        method: "optimum" or the name of a rule.
        structure: "p", "pi" or "pid".
        specs: objective and limits, for the optimum.
        closed_loop_s: closed-loop time constant of a rule that leaves it open [s], None for the rule's own.
        robust: over which heaters drawn from the fit the optimum keeps its limits, as in `heatertune.pid.tune.tune`.

    Raises:
        InputError, OutOfRange: as `ContinuousProblem` and `optimum`; the rule does not give the structure.
        UnknownName: no such rule.
    """
    if method != "optimum":
        model = model_for(method, structure, fitted)
        gain, tn, tv = apply_rule(method, model, structure, 0.0, closed_loop_s=closed_loop_s)
        by_rule = PidDesign(
            gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=0.0,
            structure=structure_of(tn, tv), method=f"{method} ({RULES[method].source})",
        )
        return replace(assess_design(fitted, by_rule), notes=(_TOLD,))
    problem = ContinuousProblem(plants=fitted.plants, structure=structure, specs=specs)
    best, checked = global_optimum(problem)
    notes = [_TOLD, checked]
    if robust != "none":
        kept = robust_design(
            Open.of(fitted, robust), specs, robust, lambda guards: optimum(replace(problem, guards=guards)), best)
        problem = replace(problem, guards=kept.guards)
        notes = [_TOLD, kept.sentence(problem.cost(best), problem.cost(kept.design))]
        best = replace(kept.design, promise=Promise(way=robust, limits=specs.limits))
    design = assess_design(fitted, best)
    notes += [*_explained(problem, design), *_plainer(problem, design)]
    notes += told_about_faces(fitted, design, partial(_alone, problem))
    return replace(design, method=f"optimum ({specs.text} on {len(fitted.plants)} models)", notes=tuple(notes))


def _alone(problem: ContinuousProblem, plant: HeaterModel) -> tuple[PidDesign, Callable[[PidDesign], float]]:
    own = replace(problem, plants=(plant,), guards=())
    return optimum(own), own.cost


def assess_design(fitted: FittedModel, design: PidDesign) -> PidDesign:
    """Return the design with its margins and costs, worst over the models; a cost is None where there is none."""
    worst, mks = margins(fitted.plants, design)
    at_rest = worst.stable and math.isfinite(design.integral_time_s)
    alone = [iae(plant, design) for plant in fitted.plants] if at_rest else []
    return replace(
        design, margins=worst, mks=mks if worst.stable else None,
        iae_load=max((load for load, _ in alone), default=None),
        iae_setpoint=max((setpoint for _, setpoint in alone), default=None),
    )


def _explained(problem: ContinuousProblem, design: PidDesign) -> list[str]:
    of_all, noise = margins(problem.limited, design)
    peaks = {"ms": of_all.ms, "mt": of_all.mt, "mks": noise}

    def solve(specs: Specs) -> float:
        other = replace(problem, specs=specs)
        return other.cost(optimum(other))

    if problem.structure == "p":
        return explain(problem.specs, peaks, -1.0 / design.gain_pct_per_degC, lambda specs: 1.0 / solve(specs))
    return explain(problem.specs, peaks, problem.cost(design), solve)


def _plainer(problem: ContinuousProblem, design: PidDesign) -> list[str]:
    """Tell where a PI controller is better: the derivative part multiplies noise by 1 + N however short TV is."""
    if problem.structure != "pid":
        return []
    try:
        plain = replace(problem, structure="pi")
        gained = 100.0 * (1.0 - plain.cost(optimum(plain)) / problem.cost(design))
    except InputError:
        return []
    return [f"A PI controller under the same limits costs {gained:.1f} % less."] if gained > 0.0 else []

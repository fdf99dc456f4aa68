"""One design on every controller: what each one's number format and arithmetic make of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from heatertune.errors import NotRepresentable
from heatertune.model.values import FittedModel
from heatertune.pid.design_provenance import DesignProvenance
from heatertune.pid.values import PidDesign
from heatertune.plc import TARGETS, Scaling, Words, controller_for
from heatertune.plc.design import encode
from heatertune.progress import ProgressCallback
from heatertune.proof import Proof, Trace, judge, prove, simulate_wish
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.prove_words import setpoints_for
from heatertune.proof.rebuild_words import apply_provenance
from heatertune.proof.series import trace_series
from heatertune.settings import Conditions

__all__ = ["SCHEMA", "compare"]

SCHEMA = "heatertune/compare/2"

_NAMES = ("overshoot", "settling_time", "steady_offset", "recovery_time", "iae")


def compare(
    wished: PidDesign, fitted: FittedModel, conditions: Conditions | None = None, *, scaling: Scaling | None = None,
    recipe: DesignProvenance | None = None, first_look: bool = False, progress: ProgressCallback = str,
) -> dict[str, Any]:
    """Return the document of one design on all targets, on the model that fits best.

    Each target's words are proven on all models. Beside what the controller does, each row holds what the unrounded
    design would do with the same switch, and what the design does that the words realise, still in floating point:
    the first difference is the price of the words, the second that of the controller's arithmetic and order.

    Args:
        wished: the design.
        fitted: the heater and its candidates.
        conditions: of the proofs.
        scaling: sensor range.
        recipe: what the words of its own target get beside the gains; None: nothing.
        first_look: as for `prove`.
        progress: told what begins.

    Raises:
        InputError, OutOfRange: as `prove`.
    """
    rows, asked = [], conditions or Conditions()
    for number, target in enumerate(TARGETS, 1):
        progress(f"proving the parameters of {target} ({number} of {len(TARGETS)})")
        its = asked if recipe is None or recipe.target == target else replace(asked, switches={})
        rows.append(_row(target, wished, scaling, recipe, partial(prove, fitted=fitted, conditions=its,
                                                                  first_look=first_look)))
    label, model = labelled_heaters(fitted)[0]
    setpoint, _ = setpoints_for(fitted, asked)
    return {"schema": SCHEMA, "model": label, "setpoint_degC": setpoint,
            "gain_degC_per_pct": model.gain_degC_per_pct, "rows": rows}


def _row(
    target: str, wished: PidDesign, scaling: Scaling | None, recipe: DesignProvenance | None,
    proven: Callable[[Words], Proof]
) -> dict[str, Any]:
    controller = controller_for(target)
    row: dict[str, Any] = {"target": target, "title": controller.title}
    if controller.timer.shortest_s == controller.timer.longest_s:
        wished = replace(wished, sample_time_s=controller.timer.shortest_s)
        row["sample_time_s"] = wished.sample_time_s
    try:
        words = apply_provenance(encode(wished, target, scaling=scaling), recipe)
    except NotRepresentable as problem:
        return row | {"verdict": "not representable", "why": str(problem)}
    proof = proven(words)
    nominal = proof.nominal
    same = replace(wished, derivative_filter=_filter(proof))
    wish = simulate_wish(same, nominal.model, nominal.scenario, nominal.actuator)
    rounded = None if proof.design is None else simulate_wish(
        proof.design, nominal.model, nominal.scenario, nominal.actuator
    )
    return row | {
        "verdict": proof.verdict,
        "words": dict(words.values),
        "fails": list(proof.shortfalls),
        "realised": _figures(proof, nominal),
        "rounded": None if rounded is None else _figures(proof, rounded),
        "wished": _figures(proof, wish),
        "series": trace_series(nominal, target),
        "ideal": trace_series(wish, "unrounded"),
    }


def _filter(proof: Proof) -> float:
    """Return the target's own derivative filter, so that only rounding and arithmetic differ."""
    return 0.5 if proof.design is None else proof.design.derivative_filter


def _figures(proof: Proof, trace: Trace) -> dict[str, float | None]:
    criteria = {criterion.name: criterion for criterion in judge(trace, proof.limits)}
    return {name: criteria[name].to_document()["value"] for name in _NAMES}

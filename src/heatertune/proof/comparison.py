"""What other designs, and the paper's own settings, do in the same loop.

One design on every controller: what each one's number format and arithmetic make of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from heatertune.errors import NotRepresentable
from heatertune.model.model_values import FittedModel, Fopdt, model_by_hand
from heatertune.options import checked_arguments
from heatertune.pid.design_document import DesignProvenance
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import margins
from heatertune.pid.search.feasible import Problem, search
from heatertune.plc import TARGETS, Scaling, Words, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.design import encode, tune
from heatertune.plc.s7_200_paper.words import paper_words
from heatertune.processors import ProgressCallback
from heatertune.proof import (
    Acceptance,
    Coverage,
    Proof,
    Trace,
    paper_scenario,
    prove,
    prove_models,
    simulate,
    simulate_wish,
)
from heatertune.proof.heaters import holding_heaters, labelled_heaters
from heatertune.proof.proof_document import PaperRunView, PaperView, RivalView, SeriesView
from heatertune.proof.prove_words import actuator_for, setpoints_for
from heatertune.proof.repetition import apply_provenance
from heatertune.proof.report_curves import trace_series
from heatertune.settings import Conditions
from heatertune.units import written

__all__ = ["SCHEMA", "best_single_lag", "compare", "paper_runs", "price_of_doubt", "rivals"]


SCHEMA = "heatertune/compare/2"

_NAMES = ("overshoot", "settling_time", "steady_offset", "recovery_time", "iae")


@checked_arguments
def compare(
    ideal: PidDesign, fitted: FittedModel, conditions: Conditions | None = None, *, scaling: Scaling | None = None,
    recipe: DesignProvenance | None = None, first_look: bool = False, progress: ProgressCallback = str,
) -> dict[str, Any]:
    """Return the document of one design on all targets, on the model that fits best.

    Each target's words are proven on all models. Beside what the controller does, each row holds what the unrounded
    design would do with the same switch, and what the design does that the words realise, still in floating point:
    the first difference is the price of the words, the second that of the controller's arithmetic and order.

    Args:
        ideal: the design.
        fitted: the heater and its candidates.
        conditions: of the proofs.
        scaling: sensor range.
        recipe: what the words of its own target get beside the gains; None: nothing.
        first_look: as for `prove`.
        progress: called with a few words as each step begins.

    Raises:
        InputError, OutOfRange: as `prove`.
    """
    rows, assumptions = [], conditions or Conditions()
    for number, target in enumerate(TARGETS, 1):
        progress(f"proving the parameters of {target} ({number} of {len(TARGETS)})")
        row_conditions = assumptions if recipe is None or recipe.target == target else replace(assumptions, switches={})
        rows.append(_row(target, ideal, scaling, recipe, partial(prove, fitted=fitted, conditions=row_conditions,
                                                                  first_look=first_look)))
    label, model = labelled_heaters(fitted)[0]
    setpoint, _ = setpoints_for(fitted, assumptions)
    return {"schema": SCHEMA, "model": label, "setpoint_degC": setpoint,
            "gain_degC_per_pct": model.gain_degC_per_pct, "rows": rows}


def _row(
    target: str, ideal_design: PidDesign, scaling: Scaling | None, recipe: DesignProvenance | None,
    proven: Callable[[Words], Proof]
) -> dict[str, Any]:
    controller = controller_for(target)
    row: dict[str, Any] = {"target": target, "title": controller.title}
    if controller.timer.shortest_s == controller.timer.longest_s:
        ideal_design = replace(ideal_design, sample_time_s=controller.timer.shortest_s)
        row["sample_time_s"] = ideal_design.sample_time_s
    try:
        words = apply_provenance(encode(ideal_design, target, scaling=scaling), recipe)
    except NotRepresentable as problem:
        return row | {"verdict": "not representable", "why": str(problem)}
    proof = proven(words)
    nominal = proof.nominal
    same = replace(ideal_design, derivative_filter=_filter(proof))
    ideal = partial(simulate_wish, model=nominal.model, scenario=nominal.scenario, actuator=nominal.actuator,
                    limits=proof.limits)
    wish = ideal(same)
    return row | {
        "verdict": proof.verdict,
        "words": dict(words.values),
        "fails": list(proof.shortfalls),
        "realised": _figures(nominal),
        "rounded": None if proof.design is None else _figures(ideal(proof.design)),
        "wished": _figures(wish),
        "series": trace_series(nominal, target),
        "ideal": trace_series(wish, "unrounded"),
    }


def _filter(proof: Proof) -> float:
    """Return the target's own derivative filter, so that only rounding and arithmetic differ."""
    return 0.5 if proof.design is None else proof.design.derivative_filter


def _figures(trace: Trace) -> dict[str, float | None]:
    criteria = {criterion.name: criterion for criterion in trace.criteria}
    return {name: criteria[name].to_document()["value"] for name in _NAMES}


#: one rule of each kind; `tune` compares all of them without a proof
RIVAL_RULES = ("simc", "amigo", "lambda", "ziegler-nichols")

#: the laboratory of the paper: first reading of Table 4 [°C]
PAPER_ROOM_DEGC = 24.0

#: the paper's runs; gain 20 and 60 are printed, Ki and T are assumed
PAPER_RUNS: dict[str, dict[str, Any]] = {
    "P, gain 20 %": {"gain": 20},
    "P, gain 60 %": {"gain": 60},
    "PI, gain 20 %": {"gain": 20, "ki": 1, "t": 40},
}


def rivals(fitted: FittedModel, ideal: PidDesign, proof: Proof) -> tuple[RivalView, ...]:
    """Return how other designs fare in the same proof: rules on the best single-lag model alone, two-level control."""
    alone, target = best_single_lag(fitted), proof.words.target
    heater = f"{alone.gain_degC_per_pct:.3g} °C/%, {written(alone.lags_s[0], 3)} s, {written(alone.dead_time_s, 3)} s"
    ruled = [(f"{rule} on {heater}", tune(
        model_by_hand(alone), target=target, scaling=proof.words.scaling, method=rule)) for rule in RIVAL_RULES]
    compared = [replace(_rival(label, design, target, fitted, proof), gain_pct_per_degC=design.gain_pct_per_degC,
                        integral_time_s=design.integral_time_s) for label, design in ruled]
    baseline = controller_for(target).baseline
    if baseline is not None:
        compared.append(_rival("two-level control, ±0.5 °C", ideal, baseline, fitted, proof))
    return tuple(compared)


def _rival(label: str, design: PidDesign, target: str, fitted: FittedModel, proof: Proof) -> RivalView:
    """Return how a design fares on a target in another one's proof, with its ramp or boost, open points at default."""
    try:
        words = with_cooling(encode(design, target, scaling=proof.words.scaling), proof.actuator.cooling_gain)
    except NotRepresentable as problem:
        return RivalView(label=label, verdict="not representable", ms=None, fails=(str(problem),))
    if proof.words.ramp is not None and controller_for(target).has_ramp:
        ramp = controller_for(target).ramp(words, proof.ramp_degC_per_min, proof.hold_degC)
        words = replace(words, ramp=ramp)
    if controller_for(target).has_boost:
        words = replace(words, boost=proof.words.boost)
    coverage = Coverage(open_points=False,
                        stated_settings=proof.stated_settings if target == proof.words.target else {})
    proven = prove_models(
        controller_for(target), words, holding_heaters(fitted, proof.scenario.setpoint_degC), proof.scenario,
        actuator_for(Conditions(), words), Acceptance(limits=proof.limits, margins_of=margins), coverage,
        interlock=proof.interlock)
    ms = next((criterion.value for criterion in proven.criteria if criterion.name == "ms"), None)
    return RivalView(label=label, verdict=proven.verdict, ms=ms, fails=proven.shortfalls)


def price_of_doubt(fitted: FittedModel, ideal: PidDesign) -> str | None:
    """Return what the best-fitting candidate alone would have allowed; None where it is alone, or without an I part."""
    models = labelled_heaters(fitted)
    if len(models) == 1 or ideal.margins is None or math.isinf(ideal.integral_time_s + ideal.margins.ms):
        return None
    (label, best) = models[0]
    ms, ta = ideal.margins.ms, ideal.sample_time_s
    sign = math.copysign(1.0, ideal.gain_pct_per_degC)  # a cooler's mirror image is searched
    alone = Problem(plants=(replace(best, gain_degC_per_pct=abs(best.gain_degC_per_pct)),),
                    structure=ideal.structure, ms=ms, sample_time_s=ta)
    optimum, own = search(alone), replace(ideal, gain_pct_per_degC=abs(ideal.gain_pct_per_degC))
    return (
        f"On {label} alone the same Ms would allow K = {sign * optimum.gain_pct_per_degC:.3g} %/°C and TN = "
        f"{written(optimum.integral_time_s, 3)} s instead of {ideal.gain_pct_per_degC:.3g} %/°C and "
        f"{written(ideal.integral_time_s, 3)} s, and a load disturbance would cost "
        f"{alone.cost(optimum) / alone.cost(own):.2f} times the IAE: that is the price of what the log leaves open."
    )


def best_single_lag(fitted: FittedModel) -> Fopdt:
    """Return the single-lag model that fits the log best, else the working one."""
    singles = [c for c in fitted.candidates if isinstance(c.model, Fopdt) and c.log == fitted.candidates[0].log]
    best = max(singles, key=lambda c: c.fit_pct).model if singles else fitted.model
    assert isinstance(best, Fopdt)
    return best


def paper_runs(fitted: FittedModel) -> PaperView:
    """Return what the paper's own settings do: its program as printed, gain 20 %, 60 %, and with an I part.

    Cycle time, sensor range and Ki are assumptions; updates are taken to go on at the limits, as the paper's logs show.
    """
    model = replace(best_single_lag(fitted), ambient_degC=PAPER_ROOM_DEGC)
    scenario = paper_scenario()
    fall_s = scenario.disturbances[0].time_s
    runs = []
    for label, settings in PAPER_RUNS.items():
        words = paper_words(**settings)
        trace = simulate(
            controller_for(words.target), words, model, scenario, switches={"rails": "edges_go_on"}, direct=True)
        rests = [trace.course(start, end)[1] for start, end in ((fall_s - 200.0, fall_s), (2250.0, 2400.0))]
        peak = float(trace.course(0.0, fall_s)[1].max())
        runs.append(PaperRunView(
            label=label, overshoot_degC=max(0.0, peak - scenario.setpoint_degC),
            offset_degC=scenario.setpoint_degC - float(rests[0].mean()),
            offset_after_degC=scenario.setpoint_degC - float(rests[1].mean()),
            series=SeriesView(**trace_series(trace, label))))
    assumed = (
        f"The program as printed on {model.gain_degC_per_pct:.3g} °C/%, {written(model.time_constant_s, 3)} s, "
        f"{written(model.dead_time_s, 3)} s, setpoint {scenario.setpoint_degC:g} °C. Assumed, because the paper "
        "does not print them: PWM cycle 2 s, sensor 0…140 °C, Ki = 1 with T = 40."
    )
    return PaperView(message=assumed, runs=tuple(runs))

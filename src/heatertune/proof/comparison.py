"""What other designs, and the paper's own settings, do in the same loop."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from heatertune.errors import NotRepresentable
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import FittedModel, Fopdt
from heatertune.pid.loop.robustness import margins
from heatertune.pid.search.feasible import Problem, search
from heatertune.pid.values import PidDesign
from heatertune.plc import controller_for
from heatertune.plc.design import encode, tune
from heatertune.plc.s7_200_paper.words import paper_words
from heatertune.proof import Actuator, Proof, paper_scenario, prove_models, simulate
from heatertune.proof.fitted import default_pwm_period_s
from heatertune.proof.heaters import holding, labelled
from heatertune.proof.series import trace_series

__all__ = ["best_single_lag", "paper_runs", "price_of_doubt", "rivals"]

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


def rivals(fitted: FittedModel, wished: PidDesign, proof: Proof) -> list[dict[str, Any]]:
    """Return how other designs fare in the same proof: rules on the best single-lag model alone, two-level control."""
    alone, target = best_single_lag(fitted), proof.words.target
    heater = f"{alone.gain_degC_per_pct:.3g} °C/%, {alone.lags_s[0]:.3g} s, {alone.dead_time_s:.3g} s"
    ruled = [(f"{rule} on {heater}", tune(model_by_hand(alone), target=target, method=rule)) for rule in RIVAL_RULES]
    found = [
        {"gain_pct_per_degC": design.gain_pct_per_degC, "integral_time_s": design.integral_time_s}
        | _rival(label, design, target, fitted, proof) for label, design in ruled
    ]
    baseline = controller_for(target).baseline
    if baseline is not None:
        switching = _rival("two-level control, ±0.5 °C", wished, baseline, fitted, proof)
        found.append({"gain_pct_per_degC": None, "integral_time_s": None} | switching)
    return found


def _rival(label: str, design: PidDesign, target: str, fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return how a design fares on a target in another one's proof, with its ramp, open points at their defaults."""
    try:
        words = encode(design, target, scaling=proof.words.scaling)
    except NotRepresentable as problem:
        return {"label": label, "verdict": "not representable", "ms": None, "fails": [str(problem)]}
    if proof.words.ramp is not None and controller_for(target).ramped:
        words = replace(words, ramp=controller_for(target).ramp(words, proof.ramp_degC_per_min))
    actuator = Actuator(pwm_period_s=default_pwm_period_s(words.sample_time_s))
    found = prove_models(
        controller_for(target), words, holding(fitted, proof.scenario.setpoint_degC), proof.scenario, actuator,
        proof.limits, margins,
        open_points=False, interlock=proof.interlock,
        known=proof.known if target == proof.words.target else None,
    )
    ms = next((criterion.value for criterion in found.criteria if criterion.name == "ms"), None)
    fails = [criterion.name for criterion in found.criteria if not criterion.ok]
    return {"label": label, "verdict": found.verdict, "ms": ms, "fails": fails}


def price_of_doubt(fitted: FittedModel, wished: PidDesign) -> str | None:
    """Return what the best-fitting candidate alone would have allowed; None where it is alone, or without an I part."""
    models = labelled(fitted)
    if len(models) == 1 or wished.margins is None or math.isinf(wished.integral_time_s + wished.margins.ms):
        return None
    (label, best) = models[0]
    ms, ta = wished.margins.ms, wished.sample_time_s
    alone = Problem(plants=(best,), structure=wished.structure, ms=ms, sample_time_s=ta)
    found = search(alone)
    return (
        f"On {label} alone the same Ms would allow K = {found.gain_pct_per_degC:.3g} %/°C and TN = "
        f"{found.integral_time_s:.3g} s instead of {wished.gain_pct_per_degC:.3g} %/°C and "
        f"{wished.integral_time_s:.3g} s, and a load disturbance would cost "
        f"{alone.cost(found) / alone.cost(wished):.2f} times the IAE: that is the price of what the log does not tell."
    )


def best_single_lag(fitted: FittedModel) -> Fopdt:
    """Return the single-lag model that fits the log best, else the working one."""
    singles = [c for c in fitted.candidates if isinstance(c.model, Fopdt) and c.log == fitted.candidates[0].log]
    found = max(singles, key=lambda c: c.fit_pct).model if singles else fitted.model
    assert isinstance(found, Fopdt)
    return found


def paper_runs(fitted: FittedModel) -> dict[str, Any]:
    """Return what the paper's own settings do: its program as printed, gain 20 %, 60 %, and with an I part.

    Cycle time, sensor range and Ki are assumptions; updates are taken to go on at the limits, as the paper's logs show.
    """
    model = replace(best_single_lag(fitted), ambient_degC=PAPER_ROOM_DEGC)
    scenario = paper_scenario()
    kick = scenario.disturbances[0].time_s
    runs = []
    for label, settings in PAPER_RUNS.items():
        words = paper_words(**settings)
        trace = simulate(controller_for(words.target), words, model, scenario, switches={"rails": "edges_go_on"})
        rests = [trace.course(start, end)[1] for start, end in ((kick - 200.0, kick), (2250.0, 2400.0))]
        peak = float(trace.course(0.0, kick)[1].max())
        runs.append({
            "label": label,
            "overshoot_degC": max(0.0, peak - scenario.setpoint_degC),
            "offset_degC": scenario.setpoint_degC - float(rests[0].mean()),
            "offset_after_degC": scenario.setpoint_degC - float(rests[1].mean()),
            "series": trace_series(trace, label),
        })
    told = (
        f"The program as printed on {model.gain_degC_per_pct:.3g} °C/%, {model.time_constant_s:.3g} s, "
        f"{model.dead_time_s:.3g} s, setpoint {scenario.setpoint_degC:g} °C. Assumed, because the paper does not print "
        "them: PWM cycle 2 s, sensor 0…140 °C, Ki = 1 with T = 40."
    )
    return {"told": told, "runs": runs}

"""The series that a report draws of a proof."""

from __future__ import annotations

from typing import Any

from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.proof.heaters import holding
from heatertune.proof.ideal import simulate_wish
from heatertune.proof.prove import Proof
from heatertune.proof.series import curve_series, trace_series

__all__ = ["pictures"]


def pictures(wished: PidDesign, fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return the series that the report draws: the runs, the wish, and the robustness of the words as realised."""
    nominal, models = proof.nominal, holding(fitted, proof.scenario.setpoint_degC)
    first_of = {run.model: number for number, run in reversed(list(enumerate(proof.runs)))}
    others = [trace_series(proof.traced(first_of[label]), label) for label, _ in models[1:]]
    return {
        "schema": "heatertune/pictures/1",
        "kick_s": nominal.scenario.disturbances[0].time_s,
        "ms_limit": proof.limits.ms,
        "nominal": trace_series(nominal, proof.runs[0].label),
        "worst": trace_series(proof.worst, proof.runs[proof.worst_run].label),
        "others": [{name: run[name] for name in ("label", "time_s", "temperature_degC")} for run in others],
        "wish": trace_series(
            simulate_wish(wished, models[0][1], nominal.scenario, nominal.actuator,
                          ramp_degC_per_min=proof.ramp_degC_per_min), "wished"),
        "curves": [] if proof.design is None else curve_series(proof.design, models),
    }

"""The series that a report draws of a proof."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.values import PidDesign
from heatertune.plc import room
from heatertune.proof.heaters import holding
from heatertune.proof.ideal import simulate_wish
from heatertune.proof.loop import simulate
from heatertune.proof.prove import Proof
from heatertune.proof.series import curve_series, trace_series
from heatertune.proof.trace import Trace

__all__ = ["pictures"]


def pictures(wished: PidDesign, fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return the series that the report draws: the runs, the wish, and the robustness of the words as realised."""
    models = holding(fitted, proof.scenario.setpoint_degC)
    nominal, found = proof.nominal, room(proof.words.target)
    others = [
        trace_series(
            simulate(found, proof.words, model, nominal.scenario, nominal.actuator, interlock=nominal.interlock), label)
        for label, model in models[1:]
    ]
    return {
        "schema": "heatertune/pictures/1",
        "kick_s": nominal.scenario.disturbances[0].time_s,
        "ms_limit": proof.limits.ms,
        "nominal": trace_series(nominal, proof.runs[0].label),
        "worst": trace_series(proof.worst, _label_of(proof.worst, models)),
        "others": [{name: run[name] for name in ("label", "time_s", "temperature_degC")} for run in others],
        "wish": trace_series(
            simulate_wish(wished, models[0][1], nominal.scenario, nominal.actuator,
                          ramp_degC_per_min=proof.ramp_degC_per_min), "wished"),
        "curves": [] if proof.design is None else curve_series(proof.design, models),
    }


def _label_of(trace: Trace, models: Sequence[tuple[str, HeaterModel]]) -> str:
    label = next(label for label, model in models if model == trace.model)
    defaults = {switch.name: switch.default for switch in room(trace.words.target).switches} if trace.words else {}
    changed = [f"{name} = {setting}" for name, setting in trace.switches.items() if setting != defaults.get(name)]
    return ", ".join([label, *changed])

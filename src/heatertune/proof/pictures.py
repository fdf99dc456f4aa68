"""The series that a report draws of a proof."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from heatertune.codec import built, encode
from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import controller_for
from heatertune.proof.heaters import labelled
from heatertune.proof.ideal import simulate_wish
from heatertune.proof.prove import Proof
from heatertune.proof.scenario import delayed, named, phases_of
from heatertune.proof.series import curve_series, trace_series
from heatertune.proof.trace import Trace
from heatertune.proof.views import CurveView, OtherRunView, PhaseView, PicturesView, SeriesView

__all__ = ["pictures"]


def pictures(wished: PidDesign, fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return the series that the report draws: the runs, the wish, and the robustness of the words as realised."""
    first_of = {run.model: number for number, run in reversed(list(enumerate(proof.runs)))}
    delay_s, nominal = controller_for(proof.words.target).delayed_s(proof.words.scaling), proof.nominal
    models = [(label, delayed(model, delay_s)) for label, model in labelled(fitted) if label in first_of]
    others = [trace_series(proof.traced(first_of[label]), label) for label, _ in models[1:]]
    wish = simulate_wish(wished, models[0][1], nominal.scenario, nominal.actuator,
                         ramp_degC_per_min=proof.ramp_degC_per_min, hold_degC=proof.hold_degC, boost=proof.boost)
    document: dict[str, Any] = encode(PicturesView(
        phases=tuple(_phases(nominal)), ms_limit=proof.limits.ms,
        nominal=SeriesView(**trace_series(nominal, proof.runs[0].label)),
        worst=SeriesView(**trace_series(proof.worst, proof.runs[proof.worst_run].label)),
        others=tuple(built(OtherRunView, SeriesView(**run)) for run in others),
        wish=SeriesView(**trace_series(wish, "wished")),
        curves=() if proof.design is None else tuple(CurveView(**run) for run in curve_series(proof.design, models))))
    return document


def _phases(trace: Trace) -> Iterator[PhaseView]:
    scenario, end = trace.scenario, float(trace.time_s[-1])
    for event, phase in zip((None, *scenario.disturbances), phases_of(scenario, end, end), strict=True):
        yield built(PhaseView, phase, label=named(event))

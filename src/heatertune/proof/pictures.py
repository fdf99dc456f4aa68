"""The series that a report draws of a proof."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from heatertune.codec import construct_from, encode
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.values import PidDesign
from heatertune.plc import controller_for
from heatertune.proof.document_views import CurveView, OtherRunView, PhaseView, PicturesView, SeriesView
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.ideal import simulate_wish
from heatertune.proof.proof import Proof
from heatertune.proof.scenario import delay_heater, event_name, phases_of
from heatertune.proof.series import curve_series, trace_series
from heatertune.proof.trace import Trace

__all__ = ["pictures", "robustness"]


def robustness(fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return what the report draws of the words as realised without a run, a part of `pictures`."""
    curves = () if proof.design is None else curve_series(proof.design, _models(fitted, proof))
    return {"curves": curves, "ms_limit": proof.limits.ms}


def pictures(
    wished: PidDesign, fitted: FittedModel, proof: Proof, robust: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return all series that the report draws: the runs, the wish, and what `robustness` gives, or gave."""
    robust = robust or robustness(fitted, proof)
    first_of = {run.model: number for number, run in reversed(list(enumerate(proof.runs)))}
    models, nominal = _models(fitted, proof), proof.nominal
    others = [trace_series(proof.trace(first_of[label]), label) for label, _ in models[1:]]
    wish = simulate_wish(wished, models[0][1], nominal.scenario, nominal.actuator,
                         ramp_degC_per_min=proof.ramp_degC_per_min, hold_degC=proof.hold_degC, boost=proof.boost)
    document: dict[str, Any] = encode(PicturesView(
        phases=tuple(_phases(nominal)), ms_limit=robust["ms_limit"],
        nominal=SeriesView(**trace_series(nominal, proof.runs[0].label)),
        worst=SeriesView(**trace_series(proof.worst, proof.runs[proof.worst_run].label)),
        others=tuple(construct_from(OtherRunView, SeriesView(**run)) for run in others),
        ideal=SeriesView(**trace_series(wish, "wished")),
        curves=tuple(CurveView(**run) for run in robust["curves"])))
    return document


def _models(fitted: FittedModel, proof: Proof) -> list[tuple[str, HeaterModel]]:
    """Return the heaters that a proof ran, as its controller sees them, and their labels."""
    ran, words = {run.model for run in proof.runs}, proof.words
    delay_s = controller_for(words.target).delayed_s(words.scaling)
    return [(label, delay_heater(model, delay_s)) for label, model in labelled_heaters(fitted) if label in ran]


def _phases(trace: Trace) -> Iterator[PhaseView]:
    scenario, end = trace.scenario, float(trace.time_s[-1])
    for event, phase in zip((None, *scenario.disturbances), phases_of(scenario, end, end), strict=True):
        yield construct_from(PhaseView, phase, label=event_name(event))

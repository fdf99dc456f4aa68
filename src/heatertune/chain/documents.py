"""The JSON documents that no single stage owns: log, words, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from heatertune.chain.stages import holding
from heatertune.chain.views import ComparisonView, LogView, PicturesView
from heatertune.chain.words_file import WORDS_SCHEMA, WholeWordsView, demand_same_words
from heatertune.codec import decode, encode, schema_of
from heatertune.documents import read_document
from heatertune.log.values import Log
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.model.view import ModelView
from heatertune.pid import document as pid_document
from heatertune.pid.document import PidView
from heatertune.pid.values import PidDesign
from heatertune.plc import Words, room
from heatertune.proof import Proof, Trace, simulate, simulate_wish
from heatertune.proof.document import ProofView, checked
from heatertune.proof.series import curve_series, trace_series

__all__ = ["log_document", "pictures", "read_documents", "words_document"]

_VIEWS: Final[Mapping[str, type]] = {
    "log": LogView, "model": ModelView, "pid": PidView, "words": WholeWordsView, "proof": ProofView,
    "pictures": PicturesView, "comparison": ComparisonView,
}


def log_document(log: Log) -> dict[str, Any]:
    """Return the JSON document of a log as it was understood."""
    names = ("name", "source", "time_s", "temperature_degC", "power_pct", "setpoint_degC", "repairs", "doubts")
    taken = None if log.taken is None else log.taken.document()
    return {"schema": "heatertune/log/1"} | {name: getattr(log, name) for name in names} | {"taken": taken}


def words_document(
    words: Words, proof: Proof, files: Mapping[str, str | bytes], search: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the JSON document of words, in the order in which they are typed in, and how they were found."""
    fields = room(words.target).fields
    return {
        "schema": WORDS_SCHEMA,
        "target": words.target,
        "words": dict(words.values),
        "fields": [{name: getattr(f, name) for name in ("name", "address", "format", "low", "high", "comment")}
                   for f in fields],
        "sample_time_s": words.sample_time_s,
        "setpoint_degC": proof.scenario.setpoint_degC,
        "setpoint_units": room(words.target).measure(words, proof.scenario.setpoint_degC),
        "setpoint_ramp": proof.ramp_document(),
        "scaling": {"low_degC": words.scaling.low_degC, "high_degC": words.scaling.high_degC},
        "realised": None if proof.design is None else pid_document.to_document(proof.design),
        "files": sorted(files),
        "verdict": proof.verdict,
        "forced": bool(files) and proof.verdict != "PASS",
        "search": None if search is None else dict(search),
    }


def read_documents(directory: Path) -> dict[str, dict[str, Any]]:
    """Return the documents that `design` wrote into a directory.

    Raises:
        DocumentError: one is missing or is none, or the proof does not follow from its values.
        ExportRefused: the proof is of other words.
    """
    documents = {}
    for name, view in _VIEWS.items():
        path = directory / f"{name}.json"
        document = read_document(path, str(schema_of(view)))
        value: object = decode(view, checked(document, path) if name == "proof" else document, path)
        documents[name] = encode(value) | document  # with what it may leave out, its own numbers as they are written
    if documents["words"]["realised"] is not None:
        decode(PidView, documents["words"]["realised"], directory / "words.json", "realised")
    demand_same_words(documents["words"], documents["proof"], directory / "proof.json")
    return documents


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

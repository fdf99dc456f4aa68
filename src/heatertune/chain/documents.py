"""The JSON documents that belong to no single stage: log, words, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from heatertune.codec import (
    LEFT_OUT,
    Document,
    construct_from,
    data_folder,
    decode,
    encode,
    peek_schema,
    plain,
    read_document,
    register_schema,
    schema_of,
)
from heatertune.errors import DocumentError, InputError
from heatertune.log.log_values import Log, ReadSummary
from heatertune.model import model_document
from heatertune.model.model_document import ModelView
from heatertune.model.model_values import FittedModel
from heatertune.model.statistics import Interval
from heatertune.options import checked_arguments
from heatertune.pid import design_document as pid_document
from heatertune.pid.design_document import PidView
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.ramp import Boost, Ramp
from heatertune.proof import Proof
from heatertune.proof.folder_digest import demand_one_design
from heatertune.proof.proof_document import ComparisonView, LogView, PicturesView, ProofView, TakenView, check_document
from heatertune.proof.repetition import demand_consistent
from heatertune.proof.verdict import FIRST, PROOF_SCHEMA, verdict_first
from heatertune.proof.words_file import WORDS_SCHEMA, FieldView, WholeWordsView, demand_same_words, words_of

__all__ = [
    "load", "log_document", "own_clocks", "read_documents", "rows", "to_dict", "with_own_clocks", "without_curves",
    "words_document",
]

_VIEWS: Final[Mapping[str, type]] = {
    "log": LogView, "model": ModelView, "pid": PidView, "words": WholeWordsView, "proof": ProofView,
    "pictures": PicturesView, "comparison": ComparisonView,
}


def log_document(log: Log) -> dict[str, Any]:
    """Return the JSON document of a log as it was understood."""
    summary = None if log.taken is None else decode(TakenView, plain(log.taken.document()), log.name)
    document: dict[str, Any] = encode(construct_from(LogView, log, taken=summary, signals=own_clocks(log) or None))
    return document


Numbers = tuple[float, ...]


def own_clocks(log: Log) -> dict[str, tuple[Numbers, Numbers]]:
    """Return role → instants and values, to the last reading, of the signals that have instants of their own."""
    own = {role: signal.until(float(log.time_s[-1])) for role, signal in log.signals.items()
           if signal.time_s is not log.time_s}
    return {role: (tuple(time.tolist()), tuple(values.tolist())) for role, (time, values) in own.items()}


def with_own_clocks(log: Log, own: Mapping[str, tuple[Numbers, Numbers]], power_late_s: float = 0.0) -> Log:
    """Return a log of rows with the signals of `own_clocks`, and with how late its power may be written [s].

    Raises:
        DocumentError: a signal of which there are no rows.
    """
    if strange := own.keys() - log.signals.keys():
        raise DocumentError(f"signals of {', '.join(sorted(strange))} without rows; expected {', '.join(log.signals)}")
    signals = dict(log.signals) | {role: log.signals[role]._replace(time_s=np.asarray(time), values=np.asarray(values))
                                   for role, (time, values) in own.items()}
    if power_late_s and "power" in signals:
        signals["power"] = signals["power"]._replace(late_s=power_late_s)
    return replace(log, signals=signals)


@dataclass(frozen=True, slots=True, kw_only=True)
class SummaryValues:
    """The fields of `ReadSummary` as JSON holds them."""

    file: str
    rows: int
    interval_s: float
    columns: Mapping[str, tuple[str, str]]
    rows_read: int
    left_out: int
    repeats: int
    repaired: int
    unused: tuple[str, ...]
    reading: Mapping[str, str | float | bool | tuple[float, ...] | None]
    assumed: Mapping[str, str]
    stated: tuple[str, ...]


@register_schema("heatertune/log-values/1")
@dataclass(frozen=True, slots=True, kw_only=True)
class LogValues:
    """The fields of `Log` as JSON holds them, all of them: a fit of what is loaded is that of what was saved."""

    name: str
    source: str
    time_s: Numbers
    temperature_degC: Numbers
    power_pct: Numbers | None
    setpoint_degC: Numbers | None
    disturbance: Numbers | None
    cooling_pct: Numbers | None
    ambient_degC: Numbers | None
    repairs: tuple[str, ...]
    warnings: tuple[str, ...]
    same_heater: tuple[str, ...]
    taken: SummaryValues | None
    rests_at_degC: float | None
    pwm_period_s: float
    power_late_s: float
    cooling_gain: float
    signals: Mapping[str, tuple[Numbers, Numbers]] | None = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def from_log(cls, log: Log) -> LogValues:
        """Return the fields of a log."""
        columns: dict[str, Any] = {name: None if (column := getattr(log, name)) is None else tuple(column.tolist())
                                   for name in _COLUMNS}
        summary = None if log.taken is None else construct_from(
            SummaryValues, log.taken, stated=tuple(sorted(log.taken.stated)))
        power = log.signals.get("power")
        return construct_from(cls, log, **columns, taken=summary, power_late_s=0.0 if power is None else power.late_s,
                              signals=own_clocks(log) or None)

    @property
    def log(self) -> Log:
        """The log of these fields."""
        columns: dict[str, Any] = {name: None if (column := getattr(self, name)) is None else np.asarray(column)
                                   for name in _COLUMNS}
        summary = None if self.taken is None else construct_from(
            ReadSummary, self.taken, stated=frozenset(self.taken.stated))
        return with_own_clocks(
            construct_from(Log, self, **columns, taken=summary, signals=None), self.signals or {}, self.power_late_s)


#: those of `Log` with a value for each reading
_COLUMNS: Final = ("time_s", "temperature_degC", "power_pct", "setpoint_degC", "disturbance", "cooling_pct",
                   "ambient_degC")


def to_dict(value: object) -> dict[str, Any]:
    """Return a log, model, design, parameters or proof as the JSON document that `load` takes.

    Raises:
        InputError: another value.
    """
    match value:
        case Log():
            document: dict[str, Any] = encode(LogValues.from_log(value))
        case FittedModel():
            document = model_document.to_document(value)
        case PidDesign():
            document = pid_document.to_document(value)
        case Words():
            document = {"schema": WORDS_SCHEMA, **encode(construct_from(
                WordsValues, value, words=value.values, setpoint_ramp=value.ramp))}
        case Proof():
            document = value.to_document()
        case ProofView():
            document = encode(value)
        case _:
            raise InputError(f"no document of a {type(value).__name__}; there is one of a log, a model, a design, "
                             "parameters and a proof")
    return document


@dataclass(frozen=True, slots=True, kw_only=True)
class WordsValues:
    """The fields of `Words` as `heatertune.proof.words_file` reads them."""

    target: str
    words: Mapping[str, float]
    scaling: Scaling
    sample_time_s: float
    setpoint_ramp: Ramp | None
    boost: Boost | None


@checked_arguments
def load(path: str | Path) -> Log | FittedModel | PidDesign | Words | ProofView:
    """Return the value of a JSON file: of `save`, or of a command.

    A log.json of `design` has not all of a log; read the log's own file. A proof has `verdict`, `criteria`, `runs`,
    `summary()` and `to_frame()`; its traces are not saved, so it has no picture.

    Args:
        path: model.json, pid.json, words.json, proof.json, or a log that `save` wrote.

    Raises:
        DocumentError: the file cannot be read, or holds another document, or a damaged one.
        OutOfRange: parameters that their controller does not allow.
    """
    schema = peek_schema(path)
    if schema == schema_of(LogValues):
        return decode(LogValues, read_document(path, str(schema)), path).log
    if schema == model_document.SCHEMA:
        return model_document.read_model(path)
    if schema == pid_document.SCHEMA:
        return pid_document.read_design(path)[0]
    if schema == WORDS_SCHEMA:
        document = read_document(path, WORDS_SCHEMA)
        return words_of(document, str(document.get("target")), path)
    if schema == PROOF_SCHEMA:
        return decode(ProofView, check_document(read_document(path, PROOF_SCHEMA), path), path)
    raise DocumentError(f"{path}: {schema or 'no document of heatertune'}; expected a model.json, pid.json, words.json "
                        "or proof.json, or a log that was saved (read_log reads a log's file)")


def rows(value: object) -> list[dict[str, Any]]:
    """Return a value as the rows of a table: parameters with their intervals, criteria, or parameters to enter.

    Raises:
        InputError: a value without such a table.
    """
    match value:
        case FittedModel():
            return [{"parameter": name, "value": getattr(value.model, name), "low": None if ci95 is None else ci95.low,
                     "high": None if ci95 is None else ci95.high} for name, ci95 in _intervals(value)]
        case PidDesign():
            document = {**to_dict(value), "schema": []}
            return [{name: part for name, part in document.items() if not isinstance(part, list | dict)}]
        case Words():
            its = controller_for(value.target).fields
            return [{"parameter": each.name, "address": each.address, "value": value.values[each.name],
                     "format": each.format, "low": each.low, "high": each.high, "meaning": each.comment}
                    for each in its]
        case Proof() | ProofView():
            worst = {each.name: each.view for each in value.criteria} if isinstance(value, Proof) else value.criteria
            return [{"criterion": name, "worst": each.value, "limit": each.limit, "unit": each.unit, "ok": each.ok,
                     "run": each.where} for name, each in worst.items()]
    raise InputError(f"no table of a {type(value).__name__}")


def _intervals(fitted: FittedModel) -> list[tuple[str, Interval | None]]:
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")
    return [(name, fitted.ci95.get(name)) for name in names]


def words_document(
    words: Words, proof: Proof, files: Mapping[str, str | bytes], search: Document | None = None
) -> dict[str, Any]:
    """Return the JSON document of the controller parameters, in the order of entry, and how they were found."""
    target, setpoint = controller_for(words.target), proof.scenario.setpoint_degC
    fields = tuple(construct_from(FieldView, field) for field in target.fields)
    document: dict[str, Any] = encode(construct_from(
        WholeWordsView, words, proof, words=words.values, fields=fields, setpoint_degC=setpoint,
        setpoint_units=target.measure(words, setpoint),
        realised=None if proof.design is None else pid_document.to_document(proof.design), files=tuple(sorted(files)),
        forced=bool(files) and proof.verdict != "PASS", search=None if search is None else plain(search)))
    return document


def without_curves(documents: Mapping[str, Document], nearest: Sequence[str] = ()) -> dict[str, Any]:
    """Return a design without curves: verdict, setpoint, specification, parameters, criteria and files first.

    Args:
        documents: of all stages; log and pictures contain the curves.
        nearest: for a failing design, the command that gives PASS.
    """
    proof = verdict_first(documents["proof"])
    first = {name: proof.pop(name) for name in FIRST}
    curves = {"model": ("residuals",), "comparison": ("paper",)}
    rest = {name: {key: part for key, part in documents[name].items() if key not in curves.get(name, ())}
            for name in ("model", "pid", "comparison")}
    words = {name: part for name, part in documents["words"].items() if name not in ("words", "target", "verdict")}
    return {**first, "files": documents["words"]["files"], "nearest": list(nearest), "schema": "heatertune/design/2",
            "encoded": words, "proof": proof, **rest}


def read_documents(folder: str | Path) -> dict[str, dict[str, Any]]:
    """Return the documents that `design` wrote into a folder.

    Raises:
        DocumentError: one is missing or invalid, the proof does not follow from its values, the parameters do not state
            its verdict, or the words, the design and the heater do not belong together.
        ExportRefused: the proof belongs to other parameters.
    """
    documents, directory = {}, data_folder(folder)
    for name, view in _VIEWS.items():
        path = directory / f"{name}.json"
        document = read_document(path, str(schema_of(view)))
        value: object = decode(view, check_document(document, path) if name == "proof" else document, path)
        documents[name] = _completed(document, encode(value))
    if (realised := documents["words"]["realised"]) is not None:
        complete = encode(decode(PidView, realised, directory / "words.json", "realised"))
        documents["words"]["realised"] = _completed(realised, complete)
    demand_same_words(documents["words"], documents["proof"], directory / "proof.json")
    own, proven = (documents[name]["verdict"] for name in ("words", "proof"))
    if own != proven:
        raise DocumentError(f"{directory / 'words.json'}: verdict: {own!r}; proof.json next to it says {proven!r}: "
                            "export the parameters again (heatertune export-db)")
    demand_consistent(directory, documents)
    demand_one_design(directory, "design again")
    return documents


def _completed(document: Any, complete: Any) -> Any:
    """Return a document with the fields that it leaves out, at every depth; its own numbers stay as written."""
    if isinstance(document, dict) and isinstance(complete, dict):
        return complete | {key: _completed(value, complete[key]) if key in complete else value
                           for key, value in document.items()}
    if isinstance(document, list) and isinstance(complete, list) and len(document) == len(complete):
        return [_completed(value, default) for value, default in zip(document, complete, strict=True)]
    return document

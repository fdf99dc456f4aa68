"""The whole chain in one call, and its report.

Also the as-left report (the folder of a `design` and a trace of the commissioned loop), and feed-forward (a design for
a log with a measured disturbance, compared with plain feedback).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from heatertune import cache
from heatertune.chain.documents import log_document, read_documents, words_document
from heatertune.chain.precompile import OPINION, Worker, work_alongside
from heatertune.chain.second_opinion import SECOND_OPINION_SCHEMA, SecondOpinion, disagreement
from heatertune.chain.stages import export, fit
from heatertune.codec import DATA, Document, data_folder, decode, encode, plain, read_document, to_json
from heatertune.errors import ExportRefused, InputError
from heatertune.log import read_log
from heatertune.log.formats.printer_logs import names_of
from heatertune.log.log_values import Log
from heatertune.model import model_document
from heatertune.model.disturbance import DisturbanceEffect
from heatertune.model.loss_curve import for_setpoints
from heatertune.model.model_document import from_document, read_model
from heatertune.model.model_values import FittedModel
from heatertune.options import Keywords, checked_arguments, merge_options, split_options, with_options
from heatertune.pid import design_document as pid_document
from heatertune.pid.design_document import DesignProvenance
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import margins
from heatertune.pid.tune import stated_problem
from heatertune.plc import Words, controller_for
from heatertune.plc.design import loop_fit, stated_scaling
from heatertune.plc.feed_forward import feed_forward as line_for
from heatertune.plc.targets import TARGETS, target_by_name
from heatertune.plc.word_selection import search_document
from heatertune.processors import ProgressCallback, log_progress
from heatertune.proof import Proof
from heatertune.proof.as_left import AS_LEFT_SCHEMA, AsLeft, as_left
from heatertune.proof.comparison import paper_runs, price_of_doubt, rivals
from heatertune.proof.design_request import DesignRequest, DesignResult, with_heater, with_printer_range
from heatertune.proof.difference import WRITTEN_SCHEMA, WriteHistory
from heatertune.proof.feed_forward_check import FeedForwardProof, PlainLoop, prove_feed_forward
from heatertune.proof.folder_digest import DIGEST_FILE, demand_one_design, folder_digest
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.proof_document import ComparisonView, ProofView, check_document
from heatertune.proof.prove_words import every_setpoint, tune_settings_for
from heatertune.proof.redesign.on_samples import closed_on_samples
from heatertune.proof.report_curves import pictures, proven_heaters, robustness
from heatertune.proof.text_comparison import as_exported
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import (
    WORDS_SCHEMA,
    certificate,
    demand_same_words,
    exported_names,
    read_words,
    words_of,
)
from heatertune.settings import (
    RECORD_SCHEMA,
    AsLeftSettings,
    Conditions,
    FeedForwardSettings,
    FitSettings,
    ReadSettings,
    RecordSettings,
    SampleSettings,
    SensorSettings,
    TuneSettings,
    WordSettings,
)
from heatertune.writing import write_files

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import DesignOptions

__all__ = [
    "TYPICAL_S", "ChainResult", "FedForward", "as_left_in", "design", "dossier", "feed_forward", "files_of",
    "redraw", "related_documents", "write_report",
]


def as_left_in(
    directory: str | Path, documents: Mapping[str, Document], log: Log,
    settings: AsLeftSettings | None = None, progress: ProgressCallback = str,
) -> AsLeft:
    """Compare a trace with the proof of a design.

    Args:
        directory: names the documents in an error.
        documents: of its stages, as `read_documents` returns them.
        log: the trace.
        settings: additional knowledge about the trace.
        progress: called with the progress of the runs.

    Raises:
        InputError, OutOfRange: as `heatertune.proof.as_left.as_left`.
        DocumentError: a document is incomplete.
    """
    words_document, folder = documents["words"], data_folder(directory)
    words = words_of(words_document, words_document["target"], folder / "words.json")
    proof = decode(ProofView, dict(documents["proof"]), folder / "proof.json")
    return as_left(log, words, from_document(documents["model"]), proof, settings, progress=progress)


def related_documents(directory: str | Path, proof: Document) -> dict[str, dict[str, Any]]:
    """Return the additional documents of a design: "as_left" and "written" of this proof, and "record".

    Raises:
        DocumentError: one of them is incomplete.
    """
    folder, documents = data_folder(directory), {}
    for name, schema, kind in (("as_left", AS_LEFT_SCHEMA, AsLeft), ("written", WRITTEN_SCHEMA, WriteHistory),
                               ("record", RECORD_SCHEMA, RecordSettings),
                               ("second_opinion", SECOND_OPINION_SCHEMA, SecondOpinion)):
        path = folder / f"{name}.json"
        if path.exists():
            document = read_document(path, schema)
            decode(kind, document, path)
            if name == "record" or document["digest"] == proof["digest"]:
                documents[name] = document
    return documents


def files_of(directory: str | Path, documents: Mapping[str, Document]) -> dict[str, str]:
    """Return the additional files of a design, name → content."""
    folder = data_folder(directory).relative_to(directory)
    return {str(folder / f"{name}.json"): to_json(documents[name])
            for name in ("as_left", "written", "record", "second_opinion") if name in documents}


@dataclass(frozen=True, slots=True, kw_only=True)
class FedForward:
    """Feed-forward for a design.

    Attributes:
        proof: of the feed-forward, compared with plain feedback.
        files: name → content: the document, and the PLC program if it passes or was forced.
    """

    proof: FeedForwardProof
    files: Mapping[str, str]


def feed_forward(
    directory: str | Path, settings: FeedForwardSettings | None = None, *, force: bool = False
) -> FedForward:
    """Design feed-forward of the disturbance in the log of a design.

    Args:
        directory: written by `heatertune.chain.design`.
        settings: input of the disturbance; None: an analog sensor over the logged range.
        force: return the program regardless of the verdicts.

    Raises:
        InputError: no disturbance in the design, or no significant effect, or an effect that is not equivalent to
            power; a target without an input for it; no power in reserve.
        DocumentError: a document is missing or invalid.
        ExportRefused: the parameters themselves are not proven, and `force` is not set.
        NotRepresentable, OutOfRange: the input cannot hold the line.
    """
    options, folder = merge_options(FeedForwardSettings, settings, {}), data_folder(directory)
    demand_one_design(folder, "design again")
    effect = _effect(folder)
    document = check_document(read_document(folder / "proof.json", PROOF_SCHEMA), folder / "proof.json")
    demand_same_words(read_document(folder / "words.json", WORDS_SCHEMA), document, folder / "proof.json")
    plain = decode(ProofView, document, folder / "proof.json")
    words = _words(folder, plain.target)
    feed = controller_for(words.target).feed
    if feed is None:
        raise InputError(f"{words.target} has no input for a measured disturbance (see: heatertune targets)")
    proven = certificate(document, force=force)
    low, high = options.disturbance_range or (effect.calm, effect.strong)
    line = line_for(feed, column=effect.column, pct_per_unit=effect.pct_per_unit, calm=effect.calm, low=low, high=high,
                    switched=options.contact)
    loop = PlainLoop(setpoint_degC=plain.scenario.setpoint_degC, actuator=plain.actuator, limits=plain.limits,
                     noise_degC=plain.scenario.noise_degC, stated_settings=plain.stated_settings)
    models = holding_heaters(read_model(folder / "model.json"), loop.setpoint_degC)
    proof = prove_feed_forward(words, line, effect, models, loop)
    files = {f"{DATA}/feed_forward.json": to_json(proof.to_document())}
    if force or not proof.refusal:
        files |= feed.listing(line,
                              replace(proven, lines=(*proven.lines, *proof.summary), forced=proven.forced or force))
    return FedForward(proof=proof, files=files)


def _effect(folder: Path) -> DisturbanceEffect:
    fitted = read_model(folder / "model.json")
    effect = fitted.disturbance
    if loss := next((finding.message for finding in fitted.findings if finding.name == "loss-changes"), ""):
        raise InputError(f"{loss} No line of power offsets it: prove the heater with the fan as in use.")
    if effect is None:
        raise InputError(f"{folder}: its log has no disturbance: design with --disturbance-column NAME first")
    if not effect.acts:
        raise InputError(effect.sentence)
    if not effect.as_power:
        raise InputError(
            f"{effect.sentence} Feed-forward of a straight line is proven only for what acts as power does.")
    return effect


def _words(folder: Path, target: str) -> Words:
    words = read_words(folder / "words.json", target)
    if words is None:
        raise ExportRefused(f"{folder / 'words.json'} holds no words")
    return words


#: stage → its progress message, and its usual duration with cached machine code [s]
_STAGES: Final = {
    "fit": ("finding the heater", 8.0), "design": ("tuning", 1.5), "words": ("finding the words", 2.0),
    "proof": ("proving them", 4.0), "report": ("comparing with other designs, drawing the report", 5.0)}
#: keywords of `design` that are no options of a stage → default
_OWN: Final = {"target": None, "interval_by_words": False, "sample_settings": None}
TYPICAL_S: Final = tuple(seconds for _, seconds in _STAGES.values())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChainResult:
    """Result of a design.

    Attributes:
        log: as it was read.
        fitted_model: the heater behind it.
        outcome: the design, its parameters and their proof.
        files: for the PLC, name → content; empty if the verdict is not PASS and the export was not forced.
        documents: of all stages, as JSON holds them.
    """

    log: Log
    fitted_model: FittedModel
    outcome: DesignResult
    files: Mapping[str, str | bytes]
    documents: Mapping[str, Document]

    def __repr__(self) -> str:
        """Return the verdict and what there is in one line; `summary()` has the rest."""
        return f"<ChainResult {self.log.name}: {self.proof!r}, {len(self.files)} files>"

    @property
    def proof(self) -> Proof:
        """Proof of the parameters."""
        return self.outcome.proof

    def summary(self, *, verbose: bool = False) -> str:
        """Return what the command line prints of the proof on one screen, the point first; `verbose`: all of it."""
        return self.proof.summary(verbose=verbose)

    def _repr_html_(self) -> str:
        return self.proof._repr_html_()


def _stage_text(stage: str) -> str:
    return f"{_STAGES[stage][0]} ({list(_STAGES).index(stage) + 1} of {len(_STAGES)})"


@with_options(TuneSettings, SensorSettings, WordSettings, Conditions, own=_OWN)
def design(
    source: str | Path | Log, request: DesignRequest | None = None, *, out: str | Path | None = None,
    read: ReadSettings | None = None, fitted_with: FitSettings | None = None, force: bool = False,
    progress: ProgressCallback = log_progress, begun: Worker | None = None, **changed: Unpack[DesignOptions],
) -> ChainResult:
    """Run the whole chain, write every stage's document, the export files and the report.

    A verdict that is not PASS writes documents and report but no export files, unless `force` is given.

    Args:
        source: file of a log, "table3" / "table4", or the result of `read_log`.
        request: for the design; None: as the options say, of which `target` is needed.
        out: directory for the results; None: nothing is written.
        read: how the log is read; misprints of a built-in table are corrected.
        fitted_with: settings of the fit.
        force: export regardless of the verdict.
        progress: called with a short message when a stage begins.
        begun: second process that is already running; None: start it now.
        changed: target and options of tuning, sensor, rounding and proof, where there is no request.

    Raises:
        InputError: both a request and options, or neither a request nor a target.
        HeatertuneError: as the stages; no files are written in this case.
    """
    request = _requested(request, changed)
    controller_for(request.target)  # an unknown target is refused before the long part
    with work_alongside(request.target) if begun is None else nullcontext(begun) as second:
        log = source if isinstance(source, Log) else read_log(source, read, errata=True)
        columns = [each for each in (log.temperature_degC, log.setpoint_degC) if each is not None]
        request = with_printer_range(_of_its_heater(request, log), max(float(np.max(each)) for each in columns))
        progress(_stage_text("fit"))
        fitted = fit(log, fitted_with, companions=True, progress=progress)
        fitted = for_setpoints(fitted, every_setpoint(fitted, request.conditions))
        second.draw(_input_documents(log, fitted), "log")
        closure = closed_on_samples(fitted, request, progress=progress, stage=lambda name: progress(_stage_text(name)))
        progress(_stage_text("report"))
        second.draw(_asked_of_libraries(fitted, closure, request), OPINION)
        files, documents = _shown(log, fitted, closure, force, second)
        proof = as_exported(closure.proof)  # while the pictures are drawn
        opinion = decode(SecondOpinion, json.loads(second.answer(OPINION)), OPINION)
        result = replace(closure, proof=proof.with_findings(disagreement(opinion)))
        if result.proof.diagnostics != closure.proof.diagnostics:
            files, documents = _shown(log, fitted, result, force, second)
        documents["second_opinion"] = encode(replace(opinion, digest=documents["proof"]["digest"]))
        documents = _with_comparison(documents, log, fitted, result.ideal, result.proof, second)
        if out is not None:
            _write(documents, files, out, second)
        return ChainResult(log=log, fitted_model=fitted, outcome=result, files=files, documents=documents)


def _asked_of_libraries(fitted: FittedModel, result: DesignResult, request: DesignRequest) -> dict[str, Any]:
    """Return the arguments of `second_opinion`."""
    ideal, words, controller = result.ideal, result.proof.words, controller_for(request.target)
    in_loop = loop_fit(fitted, request.target, words.scaling)
    problem, ms = None, math.inf
    if ideal.gain_pct_per_degC > 0.0 and ideal.sample_time_s > 0.0:
        ms = max(margins(plant, ideal).ms for plant in in_loop.plants)
    if math.isfinite(ms):
        tuned = tune_settings_for(request.tune_settings, result.conditions)
        problem = replace(
            stated_problem(in_loop, tuned, ideal.sample_time_s), structure=ideal.structure,
            derivative_filter=ideal.derivative_filter, step_power=ideal.step_power_limit_pct_per_degC,
            ms=ms)  # its own: the search may have taken another limit, and an optimum is one within its own Ms, too
        if controller.most_gain is not None:
            problem = replace(problem, most_gain=partial(controller.most_gain, words.scaling))
    return {"words_design": result.proof.design, "heaters": proven_heaters(fitted, result.proof), "ideal": ideal,
            "problem": problem, "is_optimum": ideal.method.startswith("optimum") and ideal.promise is None}


def _requested(request: DesignRequest | None, keywords: Keywords) -> DesignRequest:
    """Return the request, or that of the options.

    Raises:
        InputError: both, or no target; as the settings.
    """
    if request is not None:
        if keywords:
            raise InputError(f"{', '.join(keywords)}: state it in the request, or leave the request out")
        return request
    own = {name: keywords.get(name, default) for name, default in _OWN.items()}
    options = {name: value for name, value in keywords.items() if name not in own}
    tuning, sensing, wording, proving = split_options(
        options, TuneSettings, SensorSettings, WordSettings, Conditions,
        also=(*_OWN, "request", "out", "read", "fitted_with", "force", "progress"))
    if own["target"] is None:
        raise InputError(f"no target: name the controller, one of {', '.join(TARGETS)}")
    target = target_by_name(own["target"])
    return DesignRequest(
        target=target, scaling=stated_scaling(target, None, sensing),
        tune_settings=merge_options(TuneSettings, None, tuning), conditions=merge_options(Conditions, None, proving),
        interval_by_words=own["interval_by_words"], sample_settings=own["sample_settings"] or SampleSettings(),
        **wording)


def _of_its_heater(request: DesignRequest, log: Log) -> DesignRequest:
    """Return the request with the heater of a printer that the log is of, stated (`--tag`) or the one that was read."""
    names = () if log.taken is None else names_of(log.taken.reading)
    switches = with_heater(request.conditions.switches, request.target, names)
    return replace(request, conditions=replace(request.conditions, switches=switches))


def _shown(
    log: Log, fitted: FittedModel, result: DesignResult, force: bool, second: Worker
) -> tuple[Mapping[str, str | bytes], dict[str, dict[str, Any]]]:
    """Return the export files of a design, and its documents without the comparison."""
    proof = result.proof
    files = export(proof.words, proof, force=force) if force or proof.verdict == "PASS" else {}
    search = search_document(result.choice, fitted, result.notes)
    return files, _without_comparison(log, fitted, result.ideal, proof, files, search, result.recipe, second)


@checked_arguments
def write_report(
    log: Log, fitted: FittedModel, ideal: PidDesign, proof: Proof, out: str | Path, *, force: bool = False
) -> list[Path]:
    """Write the documents, the export files of words that passed (or were forced) and `report.html`; return the paths.

    Args:
        log: as it was read.
        fitted: the heater behind it.
        ideal: the design.
        proof: of its words.
        out: directory for the results.
        force: export regardless of the verdict.

    Raises:
        InputError: the directory cannot be written.
        ExportRefused: as `export`.
    """
    files = export(proof.words, proof, force=force) if force or proof.verdict == "PASS" else {}
    return _write(dossier(log, fitted, ideal, proof, files), files, out)


def dossier(
    log: Log, fitted: FittedModel, ideal: PidDesign, proof: Proof, files: Mapping[str, str | bytes],
    search: Document | None = None, recipe: DesignProvenance | None = None,
) -> dict[str, dict[str, Any]]:
    """Return the documents of all stages in JSON form: a report made from them equals one made later from the files.

    Args:
        log: as it was read.
        fitted: the heater behind it.
        ideal: the design.
        proof: of its words.
        files: exported files, name → content; empty if the export was refused.
        search: how the parameters were found, see `heatertune.plc.word_selection.search_document`; None: omitted.
        recipe: provenance of the parameters; None: omitted.
    """
    nobody = Worker(None)
    documents = _without_comparison(log, fitted, ideal, proof, files, search, recipe, nobody)
    return _with_comparison(documents, log, fitted, ideal, proof, nobody)


def _without_comparison(
    log: Log, fitted: FittedModel, ideal: PidDesign, proof: Proof, files: Mapping[str, str | bytes],
    search: Document | None, recipe: DesignProvenance | None, second: Worker,
) -> dict[str, dict[str, Any]]:
    """Return the documents without the comparison, whose pictures are still being drawn."""
    documents = _input_documents(log, fitted) | {
        "pid": pid_document.to_document(ideal, fitted, recipe),
        "words": words_document(proof.words, proof, files, search),
        "proof": proof.to_document(),
        "pictures": robustness(fitted, proof),
    }
    second.draw(documents, "design")
    documents["pictures"] = pictures(ideal, fitted, proof, documents["pictures"])
    second.draw(documents, "proof")
    return documents


def _with_comparison(
    documents: Mapping[str, dict[str, Any]], log: Log, fitted: FittedModel, ideal: PidDesign, proof: Proof,
    second: Worker,
) -> dict[str, dict[str, Any]]:
    """Return the documents with the comparison, whose pictures are still being drawn."""
    inputs = {name: documents[name] for name in ("model", "pid", "words", "proof")} | {"same_heater": log.same_heater}
    comparison = cache.load_or_compute("comparison", inputs, lambda: encode(ComparisonView(
        paper=paper_runs(fitted) if log.same_heater else None,
        cost=price_of_doubt(loop_fit(fitted, proof.words.target, proof.words.scaling), ideal),
        rivals=rivals(fitted, ideal, proof),  # last: they wait for the compiler
    )), lambda stored: encode(decode(ComparisonView, stored, "comparison")))
    compared = {**documents, "comparison": comparison}
    second.draw(compared, "comparison")
    return compared


def _input_documents(log: Log, fitted: FittedModel) -> dict[str, dict[str, Any]]:
    """Return the documents of a log and of the heater behind it."""
    return {"log": log_document(log), "model": model_document.to_document(fitted)}


def redraw(
    directory: str | Path, trace: Log | None = None, about: AsLeftSettings | None = None,
    record: RecordSettings | None = None, progress: ProgressCallback = str, *, written: WriteHistory | None = None,
) -> dict[str, dict[str, Any]]:
    """Recreate `report.html` from the documents in a directory; return the documents.

    Args:
        directory: written by `design`.
        trace: of the commissioned loop, to compare with the proof; None: as before.
        about: additional knowledge about the trace.
        record: names of the plant and the record; fields not given stay as before.
        progress: called with the progress of the runs for the trace.
        written: record of writes of this proof to the PLC; None: as before.

    Raises:
        DocumentError: a document is missing or invalid.
        InputError: the directory cannot be written; as `heatertune.proof.as_left.as_left`.
    """
    documents = read_documents(directory)
    documents |= related_documents(directory, documents["proof"])
    if record is not None and record != RecordSettings():
        own = {name: text for name, text in encode(record).items() if text is not None}
        documents["record"] = encode(RecordSettings()) | documents.get("record", {}) | own
    if trace is not None:
        documents["as_left"] = plain(encode(as_left_in(directory, documents, trace, about, progress)))
    if written is not None:
        documents["written"] = encode(written)
    record_files = files_of(directory, documents) if (trace, record, written) != (None, None, None) else {}
    write_files(directory, {"report.html": _page(documents), **record_files})
    return documents


def _write(
    documents: Mapping[str, Document], files: Mapping[str, str | bytes], out: str | Path,
    second: Worker | None = None,
) -> list[Path]:
    written = {f"{name}.json": to_json(document) for name, document in documents.items()}
    moved = {f"{DATA}/{name}": content for name, content in written.items()}
    moved[f"{DATA}/{DIGEST_FILE}"] = to_json(folder_digest(documents))
    drawn = None if second is None else second.sections()
    stale_files = [*written, *exported_names(data_folder(out) / "words.json")]
    return write_files(out, {**files, "report.html": _page(documents, drawn), **moved}, gone=stale_files)


def _page(documents: Mapping[str, Document], drawn: Mapping[str, str] | None = None) -> str:
    from heatertune.report import render

    return render(documents, drawn)

"""words.json and the proof beside it: read and exported again without any of the slow libraries."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from heatertune.codec import (
    LEFT_OUT,
    Document,
    construct_from,
    data_folder,
    decode,
    peek_schema,
    read_document,
    register_schema,
)
from heatertune.errors import DocumentError, ExportRefused
from heatertune.pid.design_document import BoostView
from heatertune.plc import Boost, Certificate, Ramp, Scaling, Words, controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.pwm import Actuator
from heatertune.proof.heaters import mains_label
from heatertune.proof.verdict import (
    FIRST,
    PROOF_SCHEMA,
    blocking_findings,
    derived_verdict,
    extent,
    relaxed_clause,
    sample_lines,
    verdict_first,
    verdict_line,
    verdict_notes,
)

__all__ = [
    "WORDS_SCHEMA", "WholeWordsView", "certificate", "demand_same_words", "export_first", "exported_names",
    "pwm_period_in", "read_words", "words_in", "words_of",
]

WORDS_SCHEMA: Final = "heatertune/words/2"
_OF_ZONE: Final = re.compile(r"zone\d+_[\w-]+/\w[\w.-]*")  # a file in the folder of a zone


@dataclass(frozen=True, slots=True, kw_only=True)
class WordsRampView:
    """A setpoint ramp as its words hold it: whole steps of whole words."""

    step: int | float
    calls: int = 1
    hold: int | float | None = None
    hold_degC: float | None = None
    degC_per_min: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WordsView:
    """What the words of a document need to be read as words; these themselves the controller checks."""

    scaling: Scaling
    sample_time_s: float
    setpoint_ramp: WordsRampView | None
    boost: BoostView | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldView:
    """One word as it is typed in."""

    name: str
    address: str
    format: str
    low: float
    high: float
    comment: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnView:
    """Ms over heaters drawn from the fit."""

    count: int
    median: float | None
    p95: float | None
    worst: float | None
    unstable: int
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchNotesView:
    """What is told of how words were found."""

    notes: tuple[str, ...]
    ms_sampled: DrawnView | None


@register_schema(WORDS_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class WholeWordsView:
    """The document of words as `design` and `export-db` write it."""

    target: str
    words: Mapping[str, float]
    fields: tuple[FieldView, ...]
    sample_time_s: float
    setpoint_degC: float
    setpoint_units: float
    setpoint_ramp: WordsRampView | None
    boost: BoostView | None = field(default=None, metadata=LEFT_OUT)
    scaling: Scaling
    realised: Mapping[str, Any] | None
    files: tuple[str, ...]
    verdict: str
    forced: bool
    search: Document | None

    def __post_init__(self) -> None:
        if set(self.words) != {word.name for word in self.fields}:
            raise DocumentError("fields: others than the words")
        if self.search is not None:
            decode(SearchNotesView, {name: self.search.get(name, "") for name in ("notes", "ms_sampled")}, "search")


def read_words(path: str | Path, target: str) -> Words | None:
    """Return the words of a `words.json`, None where the file holds another document.

    Raises:
        DocumentError: the file cannot be read, or holds words of another target.
        OutOfRange: a word the target does not allow, a ramp or boost that makes no sense (the proof asks whether the
            target can follow it).
    """
    if peek_schema(path) != WORDS_SCHEMA:
        return None
    return words_of(read_document(path, WORDS_SCHEMA), target, path)


def words_in(directory: str | Path) -> tuple[Words, dict[str, Any]]:
    """Return the words of a folder that an export wrote, and the document they stand in.

    Raises:
        DocumentError: there is none, or it holds no words.
        OutOfRange: as `read_words`.
    """
    path = data_folder(directory) / "words.json"
    document = read_document(path, WORDS_SCHEMA)
    return words_of(document, str(document.get("target")), path), document


def pwm_period_in(directory: str | Path) -> float | None:
    """Return the PWM period with which a folder's words were proven [s], None where it has no proof of today's kind.

    Raises:
        DocumentError: the proof cannot be read.
    """
    path = data_folder(directory) / "proof.json"
    if not path.is_file() or peek_schema(path) != PROOF_SCHEMA:
        return None
    return float(read_document(path, PROOF_SCHEMA)["actuator"]["pwm_period_s"])


def words_of(document: Document, target: str, path: str | Path) -> Words:
    """Return the words of a document.

    Args:
        document: of words.
        target: the controller they have to be of.
        path: names the document in an error.

    Raises:
        DocumentError: it holds words of another target, or none.
        OutOfRange: as `read_words`.
    """
    if document.get("target") != target or not isinstance(document.get("words"), dict):
        raise DocumentError(f"{path}: words of target {document.get('target')!r}; expected {target!r}")
    around = ("scaling", "sample_time_s", "setpoint_ramp", "boost")
    view = decode(WordsView, {name: document.get(name) for name in around}, path)
    ramp = view.setpoint_ramp
    words = Words(
        target=target, values=document["words"], sample_time_s=view.sample_time_s, scaling=view.scaling,
        ramp=None if ramp is None else Ramp(step=ramp.step, calls=ramp.calls, hold=ramp.hold),
        boost=None if view.boost is None else construct_from(Boost, view.boost),
    )
    controller_for(target).check(words)
    return words


def certificate(proof: Document, *, force: bool = False) -> Certificate:
    """Return what an export says about a proof, which is given as its document.

    Raises:
        ExportRefused: the verdict is not PASS and `force` was not given.
    """
    failed = [name for name, criterion in proof["criteria"].items() if not criterion["ok"]]
    open_, verdict = blocking_findings(proof), derived_verdict(proof)
    if verdict != "PASS" and not force:
        raise ExportRefused(f"{verdict_line(proof)}; --force exports these parameters anyway")
    lines = [f"proven {extent(proof)}"]
    if proof["setpoint_ramp"] is not None:
        ramp = proof["setpoint_ramp"]
        led = Ramp(**{name: ramp[name] for name in ("step", "calls", "hold")})
        rate = f"{led}, {ramp['degC_per_min']:.3g} °C/min"
        lines.append(f"proven with the setpoint ramp {rate}; not proven without it")
    if "boost" in proof:
        lines.append(f"proven with a boost: {Boost(**proof['boost'])}; not proven without it")
    watch = proof["interlock"]
    lines += [] if watch is None else [f"behind the interlock {watch['name']}, limit {watch['limit_degC']:g} °C"]
    lines += [f"assumed: {name} = {setting}" for name, setting in proof["stated_settings"].items()]
    lines += [f"not kept: {name}" for name in failed]
    lines += [f"not proven: {finding['message']}" for finding in open_]
    lines += [*sample_lines(proof), *verdict_notes(proof)]
    spec = proof["specification"]
    return Certificate(verdict=verdict, lines=tuple(lines), forced=verdict != "PASS", digest=proof["digest"],
                       setpoint_degC=proof["scenario"]["setpoint_degC"], actuator=Actuator(**proof["actuator"]),
                       specification=None if spec is None else spec["name"], switches=proof["stated_settings"],
                       relaxed=relaxed_clause(proof))


def exported_names(path: Path) -> list[str]:
    """Return the names of the files that a design exported beside its document, or for its zones; none if not stated.

    Those of an earlier design must not lie beside the record of a new one, which may fail or be for another controller.
    """
    with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        names = json.loads(path.read_text(encoding="utf-8"))["files"]
        return [name for name in names if isinstance(name, str) and name not in ("", "..") and (
            Path(name).name == name or _OF_ZONE.fullmatch(name))]
    return []


def export_first(words: Document, proof: Document) -> dict[str, Any]:
    """Return the document of exported words with what is asked of their proof first."""
    parts = verdict_first(proof)
    first = {name: parts[name] for name in FIRST} | {"files": words["files"]}
    return first | {name: value for name, value in words.items() if name not in first}


def demand_same_words(words: Document, proof: Document, where: str | Path) -> None:
    """Refuse a proof (document) of other words than these (document), of a PID without its margins, or of a part alone.

    Raises:
        ExportRefused: it is of other words.
        DocumentError: they make a PID, whose margins the proof does not judge; a setting of what the manual leaves open
            was not run on each heater.
        UnknownName: the target has no such switch or setting.
    """
    names = ("target", "words", "sample_time_s", "scaling", "setpoint_ramp", "boost")
    other = [name for name in names if proof.get(name) != words.get(name)]
    if other:
        raise ExportRefused(f"{where}: the proof of other parameters ({', '.join(other)}); prove these first")
    if words.get("realised") is not None and "ms" not in proof["criteria"]:
        raise DocumentError(f"{where}: criteria.ms: is missing: no whole proof; prove the words again")
    demanded = settings_to_prove(controller_for(proof["target"]).switches, proof["stated_settings"])
    for mains_power in (None, *(one["mains_power"] for one in proof.get("mains", ()))):
        runs = [run for run in proof["runs"] if run.get("mains_power") == mains_power]
        _demand_settings(runs, demanded, "" if mains_power is None else f", {mains_label(mains_power)}", where)


def _demand_settings(
    runs: Sequence[Document], demanded: Sequence[Mapping[str, str]], at: str, where: str | Path
) -> None:
    """Refuse runs (of a document) at one mains voltage that leave out a setting on a heater, or are none."""
    if not runs:
        raise DocumentError(f"{where}: runs: none{at}: no whole proof; prove the words again")
    for model in dict.fromkeys(run["model"] for run in runs):
        ran = [dict(run["switches"]) for run in runs if run["model"] == model]
        if missing := [setting for setting in demanded if setting not in ran]:
            untried = ", ".join(f"{name} = {setting}" for name, setting in missing[0].items())
            raise DocumentError(
                f"{where}: runs: none on {model} under {untried}{at}: no whole proof; prove the words again")

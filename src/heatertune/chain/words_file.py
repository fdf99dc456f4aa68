"""words.json and the proof beside it: read and exported again without any of the slow libraries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from heatertune.documents import number, peek_schema, read_document
from heatertune.errors import DocumentError, ExportRefused
from heatertune.plc import Certificate, Ramp, Scaling, Words, room
from heatertune.proof.verdict import NOT_PROVEN, PROOF_SCHEMA, Heard, blocking, extent, told_of, verdict_line

__all__ = ["WORDS_SCHEMA", "certificate", "export_again", "read_words"]

WORDS_SCHEMA: Final = "heatertune/words/1"


def read_words(path: str | Path, target: str) -> Words | None:
    """Return the words of a `words.json`, None where the file holds another document.

    Raises:
        DocumentError: the file cannot be read, or holds words of another target.
        OutOfRange: a word the target does not allow, a ramp that makes no sense (the proof asks whether the target
            can follow it).
    """
    found = peek_schema(path)
    if found != WORDS_SCHEMA:
        return None
    document = read_document(path, WORDS_SCHEMA)
    if document.get("target") != target or not isinstance(document.get("words"), dict):
        raise DocumentError(f"{path}: words of target {document.get('target')!r}; expected {target!r}")
    scale = document.get("scaling")
    if not isinstance(scale, dict):
        raise DocumentError(f"{path}: scaling is {scale!r}; expected low_degC and high_degC")
    words = Words(
        target=target, values=document["words"], sample_time_s=number(document, "sample_time_s", path),
        scaling=Scaling(low_degC=number(scale, "low_degC", path), high_degC=number(scale, "high_degC", path)),
        ramp=_read_ramp(document.get("setpoint_ramp"), path),
    )
    room(target).check(words)
    return words


def _read_ramp(document: Any, path: str | Path) -> Ramp | None:
    if document is None:
        return None
    if not isinstance(document, dict):
        raise DocumentError(f"{path}: setpoint_ramp is {document!r}; expected step and calls")
    number(document, "step", path)
    return Ramp(step=document["step"], calls=document.get("calls", 1))


def certificate(proof: Mapping[str, Any], *, force: bool = False) -> Certificate:
    """Return what an export says about a proof, which is given as its document.

    Raises:
        ExportRefused: the verdict is not PASS and `force` was not given.
    """
    failed = [name for name, criterion in proof["criteria"].items() if not criterion["ok"]]
    open_ = blocking(proof)
    if (failed or open_) and not force:
        raise ExportRefused(f"{verdict_line(proof)}; --force exports these words all the same")
    lines = [f"proven {extent(proof)}"]
    if proof["setpoint_ramp"] is not None:
        ramp = proof["setpoint_ramp"]
        rate = f"{Ramp(step=ramp['step'], calls=ramp['calls'])}, {ramp['degC_per_min']:.3g} °C/min"
        lines.append(f"proven with the setpoint ramp {rate}; nothing is proven without it")
    watch = proof["interlock"]
    lines += [] if watch is None else [f"behind the interlock {watch['name']}, limit {watch['limit_degC']:g} °C"]
    lines += [f"taken as known: {name} = {setting}" for name, setting in proof["known"].items()]
    lines += [f"not kept: {name}" for name in failed]
    lines += [f"not proven: {each['told']}" for each in open_]
    lines += told_of(proof)
    return Certificate(verdict=_verdict(proof), lines=tuple(lines), forced=bool(failed or open_))


def _verdict(proof: Mapping[str, Any]) -> str:
    """Return the verdict that follows from a proof's values; what the document calls it is not asked."""
    broken = any(not criterion["ok"] for criterion in proof["criteria"].values())
    return "FAIL" if broken else NOT_PROVEN if blocking(proof) else "PASS"


def _accepting(proof: Mapping[str, Any], accept: Sequence[str]) -> dict[str, Any]:
    """Return a proof's document with findings accepted that the user names; errors as `Heard`."""
    Heard(accepted=tuple(accept))
    found = [{**each, "accepted": each["accepted"] or each["name"] in accept} for each in proof["findings"]]
    accepted = {**proof, "findings": found}
    return accepted | {"verdict": _verdict(accepted)}


def export_again(
    path: str | Path, target: str, *, force: bool = False, accept: Sequence[str] = ()
) -> dict[str, Any] | None:
    """Return the files of words that were proven before, with their two documents; None where the file holds no words.

    The proof is the `proof.json` beside the words, and must be of exactly these.

    `accept` names findings of the fit that the user accepts beside those the proof was made with.

    Returns:
        words (document), proof (document), files (name → content).

    Raises:
        DocumentError, OutOfRange: as `read_words`, or there is no whole proof.
        ExportRefused: the proof is of other words; as `certificate`.
    """
    words = read_words(path, target)
    if words is None:
        return None
    beside = Path(path).with_name("proof.json")
    proof = read_document(beside, PROOF_SCHEMA)
    scale = {"low_degC": words.scaling.low_degC, "high_degC": words.scaling.high_degC}
    document = read_document(path, WORDS_SCHEMA)
    held = {"target": target, "words": dict(words.values), "sample_time_s": words.sample_time_s, "scaling": scale,
            "setpoint_ramp": document.get("setpoint_ramp")}
    other = [name for name, value in held.items() if proof.get(name) != value]
    if other:
        raise ExportRefused(f"{beside}: the proof of other words ({', '.join(other)}); prove these first")
    try:
        proof = _accepting(proof, accept)
        found = certificate(proof, force=force)
    except (KeyError, TypeError, AttributeError) as problem:
        raise DocumentError(f"{beside}: no whole proof; prove the words again") from problem
    files = dict(room(target).export(words, found))
    told = {"files": sorted(files), "verdict": found.verdict, "forced": found.forced}
    return {"words": document | told, "proof": proof, "files": files}

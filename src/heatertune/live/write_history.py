"""Records of writes and their rollbacks → what the report shows of them: as found, as left, measured against proven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numpy as np

from heatertune.codec import data_folder, decode, read_document
from heatertune.errors import DocumentError, HeatertuneError, InputError
from heatertune.live.write.rollback import Before, before_of
from heatertune.plc import Words
from heatertune.proof.difference import Side, difference
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import words_in
from heatertune.proof.write_comparison import IN_BLOCK, Outcome, Passage, Quantity, Watch, WriteHistory

__all__ = ["written_in"]

T = TypeVar("T")
Step = Mapping[str, Any]
Values = Mapping[str, int | float]

_DRAWN: Final = 1500  # instants of a picture


def written_in(paths: Sequence[str | Path], directory: str | Path) -> WriteHistory:
    """Return what records tell of words that were written, held against the proof of a folder.

    Args:
        paths: of the records that `heatertune write` made.
        directory: that `heatertune design` wrote, with the proof that they were written with.

    Raises:
        DocumentError: a record is damaged, or none; the folder holds no proof.
        InputError: a record of another proof, or one that is named twice.
        OutOfRange: as `heatertune.proof.words_file.words_in`.
    """
    words, _ = words_in(directory)
    proof = data_folder(directory) / "proof.json"
    digest = str(read_document(proof, PROOF_SCHEMA).get("digest"))
    files = [Path(each).resolve() for each in paths]
    passages = list[Passage]()
    for path, file in zip(paths, files, strict=True):
        if files.count(file) > 1:
            raise InputError(f"--record {path}: is named twice")
        before = before_of(path)
        found = before.lines.begin["digest"]
        if found != digest:
            raise InputError(f"{path}: the record of another proof, {_short(found)}; that in {proof} is "
                             f"{_short(digest)}: name the folder whose words were written")
        _demand_whole(before, words)
        passages += _passages(before, words)
    return WriteHistory(digest=digest, passages=tuple(sorted(passages, key=lambda one: one.begun)))


def _short(digest: object) -> str:
    return str(digest).removeprefix("sha256:")[:8]


def _demand_whole(before: Before, words: Words) -> None:
    """Refuse a first line whose parts do not agree."""
    where, there = f"{before.lines.path}, line 1", before.image
    for name in there.own:
        if name not in there.block.operators and before.after[name] != words.values[name]:
            raise DocumentError(f"{where}: words.{name}: {before.after[name]!r}; in its proof {words.values[name]!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Begin:
    """What a passage begins with; of a rollback `stands` is what was found."""

    at: str
    version: str = ""
    simulated: bool = False
    checks: tuple[Mapping[str, Any], ...] = ()
    stands: Values | None = None
    told: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _WriteEndLine:
    at: str
    outcome: Outcome
    told: str
    stands: Values | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Band:
    setpoint_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reading:
    s: float
    temperature_degC: float
    low_degC: float
    high_degC: float


def _passages(before: Before, words: Words) -> list[Passage]:
    """Return the write that a record tells of, and each time that it was taken back."""
    groups: list[list[Step]] = [[before.lines.begin]]
    for step in before.lines.steps:
        if step["step"] == "rollback":
            groups.append([])
        groups[-1].append(step)
    for group in groups:
        if any(step["step"] == "end" for step in group[:-1]):
            late = f"step {group[-1]['step']!r} of {group[-1].get('at')}"
            raise DocumentError(f"{before.lines.path}: {late}: comes after the end")
    made = [_passage(before, words, group) for group in groups]
    for number, group in enumerate(groups[1:]):
        if made[number].ended is None:  # nobody asked what became of it until it was taken back
            back = _read(before, _Begin, group[0])
            made[number] = replace(made[number], message=back.told, left=back.stands or None,
                                   quantities=_quantities(words, made[number].as_found, back.stands or None))
    if before.lines.torn:
        torn = "The last line of the record is torn, as a kill leaves it, and was left out."
        made[-1] = replace(made[-1], notes=(*made[-1].notes, torn))
    return made


def _passage(before: Before, words: Words, steps: Sequence[Step]) -> Passage:
    first, last, path = before.lines.begin, steps[-1], before.lines.path
    begin, head = _read(before, _Begin, steps[0]), _read(before, _Begin, first)
    is_write = steps[0] is first
    end = _read(before, _WriteEndLine, last) if last["step"] == "end" else _WriteEndLine(
        at="", outcome="unknown", stands=None,
        told=f"the record breaks off after the step {last['step']!r}; heatertune rollback {path.name} asks the PLC")
    found = before.before if is_write else begin.stands or None
    lost = sum(step["step"] == "no answer" for step in steps)
    notes = [f"{lost} {'answer was' if lost == 1 else 'answers were'} lost; the parameters were read from the PLC "
             "again."]
    return Passage(
        kind="write" if is_write else "rollback", record=path.name, address=before.address.text,
        simulated=head.simulated, version=head.version, begun=_instant(before, begin.at),
        ended=_instant(before, end.at) if end.at else None, outcome=end.outcome, message=end.told,
        observations=tuple(f"{each.get('name')}: {each.get('told')}" for each in begin.checks),
        notes=tuple(notes if lost else ()), as_found=found, left=end.stands,
        quantities=_quantities(words, found, end.stands), watch=_watch(before, steps))


def _read(before: Before, kind: type[T], step: Step) -> T:
    """Return what is needed of a step; raise DocumentError where it is not there."""
    names = [field.name for field in fields(cast("Any", kind))]
    where = f"{before.lines.path}, step {step['step']!r} of {step.get('at')}"
    return decode(kind, {name: step[name] for name in names if name in step}, where)


def _instant(before: Before, text: str) -> str:
    try:
        return datetime.fromisoformat(text).isoformat(timespec="milliseconds")
    except ValueError:
        raise DocumentError(f"{before.lines.path}: at: {text!r}: expected an instant, as "
                            "2026-11-23T18:36:26+00:00") from None


def _quantities(words: Words, found: Values | None, left: Values | None) -> tuple[Quantity, ...]:
    """Return what words mean: as found, proven, as left."""
    proven = _meant(words, {})
    one, other = (None if values is None else _meant(words, values) for values in (found, left))
    return tuple(
        Quantity(name=name, unit=unit, as_found=None if one is None else one[name, unit], proven=value,
                 left=None if other is None else other[name, unit])
        for (name, unit), value in (proven or {}).items())


def _meant(words: Words, values: Values) -> dict[tuple[str, str], float | None] | None:
    """Return each quantity that words in a block make, None where they are no words of the controller."""
    side = Side(source="", kind="machine", words=replace(words, values={**words.values, **values}))
    try:
        terms = difference(side, side)["terms"]
    except HeatertuneError:
        return None
    return {(term["name"], term["unit"]): term["a"] for term in terms if term["name"] in IN_BLOCK}


def _watch(before: Before, steps: Sequence[Step]) -> Watch | None:
    """Return the response that was watched, thinned to what a picture shows; no reading outside of the band is lost."""
    rows, setpoint = list[tuple[float, ...]](), None
    for step in steps:
        if step["step"] == "band":
            setpoint = _read(before, _Band, step).setpoint_degC
        elif step["step"] == "watched":
            one = _read(before, _Reading, step)
            if setpoint is None:
                raise DocumentError(f"{before.lines.path}: a reading of {one.s:g} s without its band")
            rows.append((one.s, one.temperature_degC, one.low_degC, one.high_degC, setpoint))
    if not rows:
        return None
    columns = np.array(rows)
    _, seen, low, high, _ = columns.T
    kept = np.zeros(len(rows), dtype=bool)
    kept[np.linspace(0, len(rows) - 1, min(len(rows), _DRAWN)).astype(int)] = True
    kept |= (seen < low) | (seen > high)
    kept[[int(np.argmin(seen)), int(np.argmax(seen))]] = True
    time_s, seen, low, high, asked = map(tuple, columns[kept].T.tolist())
    return Watch(time_s=time_s, temperature_degC=seen, low_degC=low, high_degC=high, setpoint_degC=asked)

"""What became of a write, by its record and the PLC; the old words restored; and both for the report."""

from __future__ import annotations

import hashlib
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numpy as np

from heatertune.codec import data_folder, decode, read_document
from heatertune.errors import DocumentError, HeatertuneError, InputError, LinkError
from heatertune.live.client.connection import Address, address_of
from heatertune.live.hold import Hold, WayBackPart, new_way_back
from heatertune.live.write.plc_block import BlockImage, BlockSnapshot, LinkSettings, Peer, WritePart, block_image
from heatertune.live.write.proven_words import LEAST_YES, read_proven
from heatertune.live.write.write_record import MOST_WRITES, Budget, Lines, WriteRecord, read_lines
from heatertune.live.write.writer import WriteEnd, WriteOutcome, Writer
from heatertune.plc import Words
from heatertune.plc.ramp import Number
from heatertune.proof.difference import IN_BLOCK, Outcome, Passage, Quantity, Side, Watch, WriteHistory, difference
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import words_in, words_of

__all__ = [
    "Before", "became", "before_of", "inspect_write", "not_proven", "put_back_words", "record_outcome",
    "rolled_back", "stands", "write_records",
]


Values = Mapping[str, Number]


@dataclass(frozen=True, slots=True, kw_only=True)
class Before:
    """What a record says of the words before it.

    Attributes:
        lines: the record.
        address: of the PLC.
        standing: where the words are.
        interval_s: time between two scans [s].
        before, after: all words.
        parts: what was written, in its order.
        doubtful: words that the device, or somebody else, stored in the place of what was sent, and their values.
        yes: what somebody types who has seen what is put back.
    """

    lines: Lines
    address: Address
    image: BlockImage
    interval_s: float
    before: Values
    after: Values
    parts: tuple[WritePart, ...]
    doubtful: Values
    yes: str


def before_of(path: str | Path) -> Before:
    """Return the content of a record.

    Raises:
        DocumentError: it is none, not whole, or its parts do not fit together: it was changed since.
    """
    lines = read_lines(path)
    begin = lines.begin
    try:
        words = words_of(begin["document"], begin["target"], path)
        address = address_of(begin["address"])
        there = block_image(words, address, begin["known"])
        parts = tuple(WritePart(tuple(part["names"]), int(part["start"]), bytes.fromhex(part["before"]),
                           bytes.fromhex(part["after"])) for part in begin["parts"])
        doubtful = _doubtful(lines)
        content = bytes.fromhex(begin["before"])
        after = {name: begin["words"][name] for name in there.block.words}
        if len(content) != there.count or any(name not in there.block.words for part in parts for name in part.names):
            raise ValueError("others than the words of the controller")
        _check_bytes(begin, there, content, parts)
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise DocumentError(f"{path}, line 1: {problem}: no whole record of a write") from None
    return Before(lines=lines, address=address, image=there, interval_s=words.sample_time_s,
                  before=there.values(content), after=after, parts=parts, doubtful=doubtful,
                  yes=str(begin["sha256"])[:8])


def _doubtful(lines: Lines) -> dict[str, float]:
    line = lines.last("in doubt")
    return {} if line is None else {name: float(value) for name, value in line["words"].items()}


def _check_bytes(begin: Mapping[str, Any], there: BlockImage, content: bytes, parts: tuple[WritePart, ...]) -> None:
    """Raise `ValueError` where the bytes of before are not those of their digest and of each part."""
    if hashlib.sha256(content).hexdigest() != begin["sha256"]:
        raise ValueError("sha256: not the digest of what was there before")
    for part in parts:
        at = there.at(part.start)
        if content[at : at + len(part.before)] != part.before:
            raise ValueError(f"parts: {', '.join(part.names)}: other bytes than were there before")


def stands(before: Values, after: Values, values: Values, names: list[str]) -> tuple[WriteOutcome, str]:
    """Return the comparison of a PLC's content with a write.

    Args:
        before: all words as they were.
        after: all words as they were to be.
        values: all words as they stand.
        names: of the words that were to change.
    """
    kinds: dict[str, list[str]] = {"written": [], "before": [], "other": [], "none": []}
    for name in names:
        value = values[name]
        kind = ("before" if value == before[name] else "written" if value == after[name] else
                "other" if math.isfinite(value) else "none")
        kinds[kind].append(name if kind != "other" else f"{name} is {value:g}")
    for kind, outcome in (("before", WriteOutcome.NOT_DONE), ("written", WriteOutcome.UNWATCHED)):
        if len(kinds[kind]) == len(names):
            return outcome, f"the words stand there as {kind}"
    sentences = {"written": "{} as written", "before": "{} as before", "other": "by somebody else: {}",
                 "none": "{}: no number is read"}
    sentence = "; ".join(sentences[kind].format(", ".join(which)) for kind, which in kinds.items() if which)
    return WriteOutcome.UNKNOWN if kinds["none"] else WriteOutcome.PARTLY, sentence


def record_outcome(lines: Lines, look: BlockSnapshot) -> str:
    """Record what became of a write that never ended, and return it, a sentence."""
    ended = became(before_of(lines.path), look)
    if lines.complete:
        return f"{lines.path.name}: {ended.message}"
    with WriteRecord(lines.path, torn=lines.torn) as record:
        record.write_line("end", **ended.to_document())
    return f"{lines.path.name}: {ended.message}"


def became(before: Before, look: BlockSnapshot) -> WriteEnd:
    """Return the outcome of a write, by its record's last line and the content of the PLC."""
    names = [name for part in before.parts for name in part.names]
    outcome, state = stands(before.before, before.after, look.values, names)
    last = before.lines.steps[-1] if before.lines.steps else before.lines.begin
    if before.lines.complete:
        return WriteEnd(outcome, f"it ended at {last['at']}, {last['outcome']}: {last['message']}; now {state}",
                        look.values)
    return WriteEnd(outcome, f"it broke off at {last['at']} after the step {last['step']!r}; {state}", look.values)


def inspect_write(before: Before, link: LinkSettings | None = None) -> WriteEnd:
    """Return the outcome of a write, and the content of the PLC now.

    Raises:
        LinkError: it cannot be read.
    """
    with Peer(before.address, before.image, before.interval_s, link) as peer:
        ended = became(before, peer.look())
    if (left_s := Hold(before.address).stored_left_s) and ended.outcome is not WriteOutcome.UNWATCHED:
        return WriteEnd(WriteOutcome.UNKNOWN,
                        f"{ended.message}; a request without an answer may still arrive: look again in "
                     f"{left_s:.0f} s", ended.stands)
    return ended


def not_proven(before: Before, present_values: Values) -> str:
    """Return why the words that a rollback leaves in the PLC are not proven, a sentence; empty where they are.

    They are proven on the heater and under the conditions of the folder that was written from, where it is still there.

    Args:
        before: what the record says.
        present_values: all words as they stand in the PLC.
    """
    back = put_back_words(before, present_values)
    if not back:
        return ""
    there = before.image
    values = {name: value for name, value in {**present_values, **back}.items()
              if name in there.own and name not in there.block.operators}
    directory = str(before.lines.begin["directory"])
    if "zone" in before.lines.begin:
        return (f"zones are proven together: heatertune rollback {shlex.quote(str(before.lines.path.parent))} restores "
                "all of them")
    try:
        proven = read_proven(directory)
        if proven.words.target != before.lines.begin["target"]:
            return f"{directory} holds words of {proven.words.target}"
        return proven.not_proven(values)
    except HeatertuneError as problem:
        return f"no heater to prove them on: {problem}"


def put_back_words(before: Before, values: Values) -> dict[str, Number]:
    """Return the words that a rollback changes: those that stand there as written, in doubt or no number."""
    return {name: before.before[name] for part in before.parts for name in part.names
            if (values[name] in (before.after[name], before.doubtful.get(name)) or not math.isfinite(values[name]))
            and before.after[name] != before.before[name]}


def rolled_back(
    before: Before, yes: str | None, link: LinkSettings | None = None, most_writes: int = MOST_WRITES, *,
    unproven: bool = False,
) -> WriteEnd:
    """Put back what a write has changed, or may have; what somebody else has changed since stays.

    Args:
        before: what its record says.
        yes: the first digits of the digest of what was there before, as somebody typed them.
        link: how the link is held.
        most_writes: of one word.
        unproven: whether words are put back that are not proven.

    Raises:
        InputError: words that are not proven, and `unproven` was not said; another yes, another command on this PLC
            that is under way, an experiment on it that has not ended, or the record cannot be written.
    """
    if yes is None or len(yes) < LEAST_YES or not str(before.lines.begin["sha256"]).startswith(yes.lower()):
        entry = "it was not said" if yes is None else f"found {yes!r}"
        raise InputError(f"--confirm: {entry}; expected the first digits of the digest, {before.yes}")
    budget = Budget(before.address, before.image.number, most_writes)
    peer = Peer(before.address, before.image, before.interval_s, link)
    hold = Hold(before.address, peer.clock)
    with hold.lock("rollback"), peer, WriteRecord(before.lines.path, torn=before.lines.torn) as record:
        _demand_own_hold(hold, before)
        try:
            now = became(before, peer.look())
        except LinkError as problem:
            return WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {problem}")
        if not unproven and now.stands is not None and (why := not_proven(before, now.stands)):
            raise InputError(f"what would be put back is not proven: {why}; --unproven puts it back all the same")
        record.write_line("rollback", stands=dict(now.stands or {}), message=now.message)
        parts = [WayBackPart(part.start, part.before, {part.after}) for part in before.parts]
        start = hold.resume()
        hold.open(replace(new_way_back("rollback", before.address, before.image.number, parts,
                                       before.lines.path.absolute()), sent_s=None if start is None else start.sent_s))
        writer = Writer(peer, hold, record, budget)
        ended = writer.restore(before.parts, before.before, before.after, "restored as requested", before.doubtful)
        if ended.outcome in (WriteOutcome.ROLLED_BACK, WriteOutcome.NOT_DONE) and _is_before(before, ended):
            ended = WriteEnd(WriteOutcome.DONE, ended.message, ended.stands)
        ended = writer.end(ended)
        if ended.outcome is WriteOutcome.PARTLY:  # the user has been told what cannot be put back
            hold.close()
        return ended


def _demand_own_hold(hold: Hold, before: Before) -> None:
    """Refuse where another command than the write of a record, or a rollback of it, has not ended.

    Raises:
        InputError: one has not; the message names its end.
    """
    way = hold.way_back()
    if way is not None and (way.command == "experiment" or Path(way.record) != before.lines.path.absolute()):
        raise InputError(way.message)


def _is_before(before: Before, ended: WriteEnd) -> bool:
    """Return whether the words that were to change are as they were."""
    values = ended.stands or {}
    return all(values.get(name) == before.before[name] for part in before.parts for name in part.names)


T = TypeVar("T")
Step = Mapping[str, Any]

_DRAWN: Final = 1500  # instants of a picture


def write_records(paths: Sequence[str | Path], directory: str | Path) -> WriteHistory:
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
        digest_of_record = before.lines.begin["digest"]
        if digest_of_record != digest:
            raise InputError(f"{path}: the record of another proof, {_short(digest_of_record)}; that in {proof} is "
                             f"{_short(digest)}: name the folder whose words were written")
        _demand_whole(before, words)
        passages += _passages(before, words)
    return WriteHistory(digest=digest, passages=tuple(sorted(passages, key=lambda entry: entry.begun)))


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
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _WriteEndLine:
    at: str
    outcome: Outcome
    message: str
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
    passages = [_passage(before, words, group) for group in groups]
    for number, group in enumerate(groups[1:]):
        if passages[number].ended is None:  # nobody asked what became of it until it was taken back
            back = _read(before, _Begin, group[0])
            passages[number] = replace(passages[number], message=back.message, left=back.stands or None,
                                       quantities=_quantities(words, passages[number].as_found, back.stands or None))
    if before.lines.torn:
        torn = "The last line of the record is torn, as a kill leaves it, and was left out."
        passages[-1] = replace(passages[-1], notes=(*passages[-1].notes, torn))
    return passages


def _passage(before: Before, words: Words, steps: Sequence[Step]) -> Passage:
    first, last, path = before.lines.begin, steps[-1], before.lines.path
    begin, head = _read(before, _Begin, steps[0]), _read(before, _Begin, first)
    is_write = steps[0] is first
    end = _read(before, _WriteEndLine, last) if last["step"] == "end" else _WriteEndLine(
        at="", outcome="unknown", stands=None,
        message=f"the record breaks off after the step {last['step']!r}; heatertune rollback {path.name} asks the PLC")
    as_found = before.before if is_write else begin.stands or None
    lost = sum(step["step"] == "no answer" for step in steps)
    notes = [f"{lost} {'answer was' if lost == 1 else 'answers were'} lost; the parameters were read from the PLC "
             "again."]
    return Passage(
        kind="write" if is_write else "rollback", record=path.name, address=before.address.text,
        simulated=head.simulated, version=head.version, begun=_instant(before, begin.at),
        ended=_instant(before, end.at) if end.at else None, outcome=end.outcome, message=end.message,
        observations=tuple(f"{each.get('name')}: {each.get('message')}" for each in begin.checks),
        notes=tuple(notes if lost else ()), as_found=as_found, left=end.stands,
        quantities=_quantities(words, as_found, end.stands), watch=_watch(before, steps))


def _read(before: Before, kind: type[T], step: Step) -> T:
    """Return the required fields of a step; raise DocumentError where it is not there."""
    names = [field.name for field in fields(cast("Any", kind))]
    where = f"{before.lines.path}, step {step['step']!r} of {step.get('at')}"
    return decode(kind, {name: step[name] for name in names if name in step}, where)


def _instant(before: Before, text: str) -> str:
    try:
        return datetime.fromisoformat(text).isoformat(timespec="milliseconds")
    except ValueError:
        raise DocumentError(f"{before.lines.path}: at: {text!r}: expected an instant, as "
                            "2026-11-23T18:36:26+00:00") from None


def _quantities(words: Words, present_values: Values | None, left: Values | None) -> tuple[Quantity, ...]:
    """Return the meaning of words: as found, proven, as left."""
    proven = _meant(words, {})
    one, other = (None if values is None else _meant(words, values) for values in (present_values, left))
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
    _, readings, low, high, _ = columns.T
    selection = np.zeros(len(rows), dtype=bool)
    selection[np.linspace(0, len(rows) - 1, min(len(rows), _DRAWN)).astype(int)] = True
    selection |= (readings < low) | (readings > high)
    selection[[int(np.argmin(readings)), int(np.argmax(readings))]] = True
    time_s, readings, low, high, setpoint_degC = map(tuple, columns[selection].T.tolist())
    return Watch(time_s=time_s, temperature_degC=readings, low_degC=low, high_degC=high, setpoint_degC=setpoint_degC)

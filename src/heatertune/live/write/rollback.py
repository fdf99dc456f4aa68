"""What became of a write, as its record and the PLC say; and the words as they were before it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heatertune.errors import DocumentError, HeatertuneError, InputError, LinkError
from heatertune.live.client.address import Address, address_of
from heatertune.live.plc_state import PlcState
from heatertune.live.write.plc_block import BlockImage, BlockSnapshot, LinkSettings, Peer, WritePart, block_image
from heatertune.live.write.proven_words import LEAST_YES, read_proven
from heatertune.live.write.write_record import MOST_WRITES, Budget, Lines, WriteRecord, read_lines
from heatertune.live.write.writer import WriteEnd, WriteOutcome, Writer
from heatertune.plc.ramp import Number
from heatertune.proof.words_file import words_of

__all__ = ["Before", "became", "before_of", "inspect_write", "not_proven", "record_outcome", "rolled_back", "stands",
           "unfinished_records"]

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
        yes: what somebody types who has seen what is put back.
    """

    lines: Lines
    address: Address
    image: BlockImage
    interval_s: float
    before: Values
    after: Values
    parts: tuple[WritePart, ...]
    yes: str


def before_of(path: str | Path) -> Before:
    """Return what a record says.

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
        content = bytes.fromhex(begin["before"])
        after = {name: begin["words"][name] for name in there.block.words}
        if len(content) != there.count or any(name not in there.block.words for part in parts for name in part.names):
            raise ValueError("others than the words of the controller")
        _check_bytes(begin, there, content, parts)
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise DocumentError(f"{path}, line 1: {problem}: no whole record of a write") from None
    return Before(lines=lines, address=address, image=there, interval_s=words.sample_time_s,
                  before=there.values(content), after=after, parts=parts, yes=str(begin["sha256"])[:8])


def _check_bytes(begin: Mapping[str, Any], there: BlockImage, content: bytes, parts: tuple[WritePart, ...]) -> None:
    """Raise `ValueError` where the bytes of before are not those of their digest and of each part."""
    if hashlib.sha256(content).hexdigest() != begin["sha256"]:
        raise ValueError("sha256: not the digest of what was there before")
    for part in parts:
        at = there.at(part.start)
        if content[at : at + len(part.before)] != part.before:
            raise ValueError(f"parts: {', '.join(part.names)}: other bytes than were there before")


def stands(before: Values, after: Values, found: Values, names: list[str]) -> tuple[WriteOutcome, str]:
    """Return what stands in a PLC, held against a write.

    Args:
        before: all words as they were.
        after: all words as they were to be.
        found: all words as they stand.
        names: of the words that were to change.
    """
    as_before = [name for name in names if found[name] == before[name]]
    written = [name for name in names if found[name] == after[name]]
    others = [f"{name} is {found[name]:g}" for name in names if name not in (*as_before, *written)]
    if len(as_before) == len(names):
        return WriteOutcome.NOT_DONE, "the words stand there as before"
    if len(written) == len(names):
        return WriteOutcome.UNWATCHED, "the words stand there as written"
    told = [f"{', '.join(which)} as {how}" for which, how in ((written, "written"), (as_before, "before")) if which]
    return WriteOutcome.PARTLY, "; ".join([*told, *(["by somebody else: " + ", ".join(others)] if others else [])])


def unfinished_records(folder: Path, address: Address) -> Iterator[Lines]:
    """Return the records in a folder of writes to an address that never ended; what is no record is passed over."""
    for path in sorted(folder.glob("write_*.jsonl")):
        try:
            lines = read_lines(path)
        except DocumentError:  # a kill before its first line: nothing was sent
            continue
        if lines.begin["address"] == address.text and not lines.complete:
            yield lines


def record_outcome(lines: Lines, look: BlockSnapshot) -> str:
    """Record what became of a write that never ended, and return it, a sentence."""
    ended = became(before_of(lines.path), look)
    with WriteRecord(lines.path, torn=lines.torn) as record:
        record.write_line("end", **ended.to_document())
    return f"{lines.path.name}: {ended.message}"


def became(before: Before, look: BlockSnapshot) -> WriteEnd:
    """Return what became of a write, by its record's last line and what stands in the PLC."""
    names = [name for part in before.parts for name in part.names]
    outcome, found = stands(before.before, before.after, look.values, names)
    last = before.lines.steps[-1] if before.lines.steps else before.lines.begin
    if before.lines.complete:
        return WriteEnd(outcome, f"it ended at {last['at']}, {last['outcome']}: {last['told']}; now {found}",
                        look.values)
    return WriteEnd(outcome, f"it broke off at {last['at']} after the step {last['step']!r}; {found}", look.values)


def inspect_write(before: Before, link: LinkSettings | None = None) -> WriteEnd:
    """Return what became of a write, and what stands in the PLC now.

    Raises:
        LinkError: it cannot be read.
    """
    with Peer(before.address, before.image, before.interval_s, link) as peer:
        ended = became(before, peer.look())
    if (left_s := PlcState(before.address).late_left_s()) and ended.outcome is not WriteOutcome.UNWATCHED:
        return WriteEnd(WriteOutcome.UNKNOWN,
                        f"{ended.message}; a request without an answer may still arrive: look again in "
                     f"{left_s:.0f} s", ended.stands)
    return ended


def not_proven(before: Before, found: Values) -> str:
    """Return why the words that a rollback leaves in the PLC are not proven, a sentence; empty where they are.

    They are proven on the heater and under the conditions of the folder that was written from, where it is still there.

    Args:
        before: what the record says.
        found: all words as they stand in the PLC.
    """
    back = _put_back(before, found)
    if not back:
        return ""
    there = before.image
    values = {name: value for name, value in {**found, **back}.items()
              if name in there.own and name not in there.block.operators}
    directory = str(before.lines.begin["directory"])
    try:
        proven = read_proven(directory)
        if proven.words.target != before.lines.begin["target"]:
            return f"{directory} holds words of {proven.words.target}"
        return proven.not_proven(values)
    except HeatertuneError as problem:
        return f"no heater to prove them on: {problem}"


def _put_back(before: Before, found: Values) -> dict[str, Number]:
    """Return the words that a rollback changes: those that stand there as they were written."""
    return {name: before.before[name] for part in before.parts for name in part.names
            if found[name] == before.after[name] != before.before[name]}


def rolled_back(
    before: Before, yes: str | None, link: LinkSettings | None = None, most_writes: int = MOST_WRITES, *,
    unproven: bool = False,
) -> WriteEnd:
    """Put back what a write has changed; what somebody else has changed since stays.

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
        found = "it was not said" if yes is None else f"found {yes!r}"
        raise InputError(f"--yes: {found}; expected the first digits of the digest of what is put back, {before.yes}")
    budget = Budget(before.address, before.image.number, most_writes)
    peer = Peer(before.address, before.image, before.interval_s, link)
    state = PlcState(before.address)
    state.demand_no_way_back()
    with state.lock("rollback"), peer, WriteRecord(before.lines.path, torn=before.lines.torn) as record:
        try:
            now = became(before, peer.look())
        except LinkError as problem:
            return WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {problem}")
        if not unproven and now.stands is not None and (why := not_proven(before, now.stands)):
            raise InputError(f"what would be put back is not proven: {why}; --unproven puts it back all the same")
        record.write_line("rollback", stands=dict(now.stands or {}), told=now.message)
        ended = Writer(peer, record, budget).restore(before.parts, before.before, before.after, "restored as requested")
        if ended.outcome in (WriteOutcome.ROLLED_BACK, WriteOutcome.NOT_DONE) and _is_before(before, ended):
            ended = WriteEnd(WriteOutcome.DONE, ended.message, ended.stands)
        record.write_line("end", **ended.to_document())
        return ended


def _is_before(before: Before, ended: WriteEnd) -> bool:
    """Return whether the words that were to change are as they were."""
    found = ended.stands or {}
    return all(found.get(name) == before.before[name] for part in before.parts for name in part.names)

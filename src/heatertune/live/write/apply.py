"""A write to a running PLC from start to end: check, save, record, write, read back, watch, report.

The plan of a write names the words that differ, the identity of the PLC and the order of the requests. Parts are
written in an order that keeps the loop stable in every intermediate state.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from heatertune import __version__
from heatertune.errors import DocumentError, LinkError
from heatertune.live.client.connection import Address
from heatertune.live.hold import Hold, WayBack, WayBackPart, new_way_back
from heatertune.live.write.band import watch_response
from heatertune.live.write.plc_block import BlockImage, BlockSnapshot, LinkSettings, Peer, WritePart, block_image
from heatertune.live.write.proven_words import Check, Declared, ProvenWords, call_interval, checks, refusal_reason
from heatertune.live.write.rollback import record_outcome
from heatertune.live.write.write_record import (
    MOST_WRITES,
    RECORD_SCHEMA,
    Budget,
    RecordBroken,
    WriteRecord,
    read_lines,
    write_new,
)
from heatertune.live.write.writer import WriteEnd, WriteOutcome, Writer
from heatertune.plc.ramp import Number
from heatertune.proof.difference import Side, difference

__all__ = [
    "PLAN_SCHEMA", "NoOrder", "WritePlan", "WriteRequest", "WriteResult", "apply_write", "in_order", "peer_of",
    "plan_write",
]


class NoOrder(Exception):
    """Raised where every order leads through words that are not proven; the text says which, never a user's error."""


def in_order(
    parts: Sequence[WritePart], before: Mapping[str, Number], after: Mapping[str, Number],
    open_in_between: Callable[[Mapping[str, Number]], str],
) -> list[WritePart]:
    """Return parts in an order in which every set of words in between is proven stable.

    One request is whole or not there at all; between two, and for ever where the link breaks, the PLC runs what stands.

    Args:
        parts: what is to be written.
        before: all words as they are.
        after: all words as they are to be.
        open_in_between: why words are not proven stable, nothing where they are.

    Raises:
        NoOrder: there is none.
    """
    why: dict[frozenset[int], str] = {}

    def words(done: frozenset[int]) -> dict[str, Number]:
        written = [name for number in done for name in parts[number].names]
        return {**before, **{name: after[name] for name in written}}

    def reached(order: tuple[int, ...]) -> tuple[int, ...] | None:
        if len(order) == len(parts):
            return order
        done = frozenset(order)
        if order and done not in why:
            why[done] = open_in_between(words(done))
        if why.get(done):
            return None
        for number in range(len(parts)):
            if number not in done and not why.get(done | {number}) and (sequence := reached((*order, number))):
                return sequence
        return None

    order = reached(())
    if order is not None:
        return [parts[number] for number in order]
    first = min((done for done, message in why.items() if message), key=lambda done: (len(done), sorted(done)))
    message = ", ".join(f"{name} = {after[name]:g}" for number in sorted(first) for name in parts[number].names)
    raise NoOrder(f"no order of writing is proven: with {message} first, {why[first]}")


PLAN_SCHEMA: Final = "heatertune/write/2"
_SCANS: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteRequest:
    """What somebody wants.

    Attributes:
        proven: what is to be written.
        address: where to.
        said: of the PLC.
        link: how the link is held.
        most_writes: of one word.
        watch: whether the response is watched.
        record: file of the record; None: one beside the words, named by the time.
    """

    proven_words: ProvenWords
    address: Address
    declared: Declared = field(default_factory=Declared)
    link: LinkSettings = field(default_factory=LinkSettings)
    most_writes: int = MOST_WRITES
    watch: bool = True
    record: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WritePlan:
    """What a write would do.

    Attributes:
        look: at the PLC.
        checks: whether it is the right one.
        before, after: all words in the block.
        parts: what differs, in the order in which it is written.
        no_order: why there is none; nothing where there is one.
        difference: of both word sets; None: the block holds no words.
        undone_by: as of `heatertune.live.controller_block.ServedBlock`.
    """

    look: BlockSnapshot
    checks: list[Check]
    before: Mapping[str, Number]
    after: Mapping[str, Number]
    parts: Sequence[WritePart]
    no_order: str
    difference: Mapping[str, Any] | None
    undone_by: str

    def to_document(self) -> dict[str, Any]:
        """Return it as the command prints it."""
        return {
            "checks": [check.to_document() for check in self.checks], "difference": self.difference,
            "parts": [part.to_document() for part in self.parts], "no_order": self.no_order or None,
            "undone_by": self.undone_by or None,
        }


def peer_of(wanted: WriteRequest) -> Peer:
    """Return the PLC of an address, not connected to yet; errors as `heatertune.live.write.plc_block.block_image`."""
    words = wanted.proven_words.words
    there = block_image(words, wanted.address, wanted.proven_words.view.stated_settings)
    return Peer(wanted.address, there, words.sample_time_s, wanted.link)


def plan_write(wanted: WriteRequest, peer: Peer) -> WritePlan:
    """Look at a PLC, twice, and return what a write would do.

    Raises:
        LinkError: it cannot be read.
    """
    proven, there = wanted.proven_words, peer.standing
    first = peer.look()
    looks = first, peer.later(first, _SCANS)
    look, results = looks[1], checks(proven, there, looks, wanted.declared)
    is_block = results[0].ok is True
    operator_words = there.block.operators if wanted.declared.in_manual else ()
    after = {**look.values, **{name: proven.words.values[name] for name in there.own if name not in operator_words}}
    parts, no_order = there.parts(look.content, after) if is_block else [], ""
    if not wanted.declared.in_manual:
        try:
            parts = in_order(parts, look.values, after, proven.open_in_between)
        except NoOrder as problem:
            no_order = (f"{problem}; prove other words"
                        + (", or write in manual (--in-manual)" if there.block.manual else ""))
    apart = None
    if is_block:
        now = _now(wanted, there, look)
        then = Side(source=proven.directory, kind="words", words=proven.words, proof=proven.proof)
        apart = difference(now, then)
    return WritePlan(look=look, checks=results, before=look.values, after=after, parts=parts, no_order=no_order,
                   difference=apart, undone_by=there.block.undone_by)


def _now(wanted: WriteRequest, there: BlockImage, look: BlockSnapshot) -> Side:
    """Return what a PLC runs, called as often as it, its words or its user say; else as often as was proven."""
    words = there.words(look.content, wanted.proven_words.words)
    interval_s, _ = call_interval(there, look, wanted.declared)
    taken_over = () if interval_s is not None else ("call interval",)
    return Side(source=wanted.address.text, kind="machine",
                words=words if interval_s is None else replace(words, sample_time_s=interval_s),
                taken_over=(*taken_over, "sensor range", "setpoint ramp and boost"))


Progress = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class WriteResult:
    """What became of a write.

    Attributes:
        ended: its end.
        record: file of its record; None: nothing was begun.
        earlier: what became of writes before it that never ended, one sentence each.
    """

    end: WriteEnd
    record: Path | None = None
    earlier: tuple[str, ...] = ()

    def to_document(self) -> dict[str, Any]:
        """Return it as the command prints it."""
        record = None if self.record is None else str(self.record)
        return {**self.end.to_document(), "record": record, "earlier": list(self.earlier)}


def apply_write(wanted: WriteRequest, yes: str | None, progress: Progress = str) -> WriteResult:
    """Write words into a PLC.

    Args:
        wanted: what, and where.
        yes: the first digits of the proof's digest, as somebody typed them.
        progress: called with what is done.

    Raises:
        InputError: another yes, something that nobody has said of the PLC, a file that cannot be written, or another
            command on this PLC that is under way; an experiment on it that has not ended; a request without an answer
            that may still arrive.
    """
    wanted.proven_words.demand_yes(yes)
    peer = peer_of(wanted)
    budget = Budget(wanted.address, peer.standing.number, wanted.most_writes)
    hold = Hold(wanted.address, wanted.link.clock)
    with hold.lock("write"), peer:
        attempt = hold.demand_free(unless_write=True)
        progress("looking at the PLC")
        try:
            plan = plan_write(wanted, peer)
        except LinkError as problem:
            return WriteResult(WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {problem}"))
        now, earlier = plan.look, _of_earlier(hold, attempt, plan.look)
        if why := refusal_reason(plan.checks) or plan.no_order:
            return WriteResult(WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {why}", now.values), None, earlier)
        if not plan.parts:
            there = "these words stand in the PLC already: nothing was sent"
            return WriteResult(WriteEnd(WriteOutcome.DONE, there, now.values), None, earlier)
        path = _path(wanted)
        write_new(path.with_suffix(".before.bin"), now.content)
        write_new(path, b"")
        parts = [WayBackPart(part.start, part.before, {part.after}) for part in plan.parts]
        hold.open(new_way_back("write", wanted.address, peer.standing.number, parts, path.absolute()))
        with WriteRecord(path) as record:
            return WriteResult(_written(wanted, plan, Writer(peer, hold, record, budget, progress), progress), path,
                               earlier)


def _of_earlier(hold: Hold, begun: WayBack | None, look: BlockSnapshot) -> tuple[str, ...]:
    """Return the outcome of a write that never ended, a sentence; its hold is over once that is recorded."""
    if begun is None:
        return ()
    try:
        message = record_outcome(read_lines(begun.record), look)
    except DocumentError:  # a kill before its first line: nothing was sent; or somebody has removed it
        message = f"a {begun.command} begun {begun.begun} has no record: {begun.record}"
    hold.close()
    return (message,)


def _written(wanted: WriteRequest, plan: WritePlan, writer: Writer, progress: Progress) -> WriteEnd:
    """Write and watch; whatever ends it, what was written is known to stand there or taken back, or the hold stays."""
    record = writer.record
    try:
        record.write_line("begin", **_begin(wanted, plan, writer.peer))
        progress("writing")
        ended = writer.write(plan.parts, plan.before, plan.after)
        if ended.outcome is WriteOutcome.DONE:
            watched = wanted.watch and not wanted.declared.in_manual
            ended = _watched(wanted, plan, writer, ended, progress) if watched else writer.demand_new(plan.look, ended)
    except BaseException as fault:  # of heatertune's own, or a system's without memory
        why = f"ended by a fault of heatertune's own ({type(fault).__name__})"
        writer.end(writer.restore(plan.parts, plan.before, plan.after, why))
        raise
    return writer.end(ended)


def _watched(
    wanted: WriteRequest, plan: WritePlan, writer: Writer, ended: WriteEnd, progress: Progress
) -> WriteEnd:
    try:
        watch = watch_response(writer.peer, writer.record, wanted.proven_words, plan.after, [plan.look, *writer.looks],
                               progress)
    except RecordBroken as problem:
        return writer.restore(plan.parts, plan.before, plan.after, str(problem))
    notice = f"watched for {watch.seconds:.0f} s, {watch.count} readings"
    if watch.outside:
        return writer.restore(plan.parts, plan.before, plan.after, f"{notice}: {watch.outside}")
    if watch.ended_early:
        return WriteEnd(WriteOutcome.UNWATCHED, f"{ended.message}; {notice}, then: {watch.ended_early}",
                        watch.stands or ended.stands)
    return WriteEnd(WriteOutcome.DONE, f"{ended.message}; {notice}, {100.0 * watch.most:.0f} % of the proven band used",
                    watch.stands)


def _path(wanted: WriteRequest) -> Path:
    if wanted.record is not None:
        return wanted.record
    return Path(wanted.proven_words.directory) / f"write_{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z.jsonl"


def _begin(wanted: WriteRequest, plan: WritePlan, peer: Peer) -> dict[str, Any]:
    proven, there = wanted.proven_words, peer.standing
    names = ("target", "words", "sample_time_s", "scaling", "setpoint_ramp", "boost")
    return {
        "schema": RECORD_SCHEMA, "version": __version__, "address": wanted.address.text,
        "simulated": plan.look.status is not None, "directory": str(Path(proven.directory).absolute()),
        "target": proven.words.target, "digest": proven.view.digest, "verdict": proven.view.verdict,
        "block": there.number, "begin": there.begin,
        "before": plan.look.content.hex(), "sha256": hashlib.sha256(plan.look.content).hexdigest(),
        "words_before": dict(plan.before), "words": dict(plan.after),
        "document": {name: proven.proof.get(name) for name in names},
        "parts": [part.to_document() for part in plan.parts], "known": dict(proven.view.stated_settings),
        "checks": [check.to_document() for check in plan.checks],
    }

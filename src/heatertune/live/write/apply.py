"""A write from its begin to its end: looked at, saved, recorded, written, read back, watched, told."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from heatertune import __version__
from heatertune.errors import LinkError
from heatertune.live.plc_state import PlcState
from heatertune.live.write.band import watch_response
from heatertune.live.write.plc_block import Peer
from heatertune.live.write.proven_words import refusal_reason
from heatertune.live.write.rollback import record_outcome, unfinished_records
from heatertune.live.write.write_plan import WritePlan, WriteRequest, peer_of, plan_write
from heatertune.live.write.write_record import RECORD_SCHEMA, Budget, RecordBroken, WriteRecord, write_new
from heatertune.live.write.writer import WriteEnd, WriteOutcome, Writer

__all__ = ["WriteResult", "apply_write"]

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
        progress: told what is done.

    Raises:
        InputError: another yes, something that nobody has said of the PLC, a file that cannot be written, or another
            command on this PLC that is under way; an experiment on it that has not ended; a request without an answer
            that may still arrive.
    """
    wanted.proven_words.demand_yes(yes)
    peer = peer_of(wanted)
    budget = Budget(wanted.address, peer.standing.number, wanted.most_writes)
    state = PlcState(wanted.address)
    with state.lock("write"), peer:
        state.demand_no_way_back()
        state.demand_nothing_late()
        progress("looking at the PLC")
        try:
            plan = plan_write(wanted, peer)
        except LinkError as problem:
            return WriteResult(WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {problem}"))
        folder, now = Path(wanted.proven_words.directory), plan.look
        earlier = tuple(record_outcome(lines, now) for lines in unfinished_records(folder, wanted.address))
        if why := refusal_reason(plan.checks) or plan.no_order:
            return WriteResult(WriteEnd(WriteOutcome.NOT_DONE, f"nothing was sent: {why}", now.values), None, earlier)
        if not plan.parts:
            there = "these words stand in the PLC already: nothing was sent"
            return WriteResult(WriteEnd(WriteOutcome.DONE, there, now.values), None, earlier)
        path = _path(wanted)
        write_new(path.with_suffix(".before.bin"), now.content)
        write_new(path, b"")
        with WriteRecord(path) as record:
            return WriteResult(_written(wanted, plan, peer, record, budget, progress), path, earlier)


def _written(
    wanted: WriteRequest, plan: WritePlan, peer: Peer, record: WriteRecord, budget: Budget, progress: Progress
) -> WriteEnd:
    record.write_line("begin", **_begin(wanted, plan, peer))
    writer = Writer(peer, record, budget, progress)
    progress("writing")
    ended = writer.write(plan.parts, plan.before, plan.after)
    if ended.outcome is WriteOutcome.DONE and wanted.watch and not wanted.declared.in_manual:
        ended = _watched(wanted, plan, peer, record, writer, ended, progress)
    try:
        record.write_line("end", **ended.to_document())
    except RecordBroken as problem:
        return replace(ended, message=f"{ended.message}; {problem}")
    return ended


def _watched(
    wanted: WriteRequest, plan: WritePlan, peer: Peer, record: WriteRecord, writer: Writer, ended: WriteEnd,
    progress: Progress
) -> WriteEnd:
    try:
        seen = watch_response(peer, record, wanted.proven_words, plan.after, [plan.look, *writer.looks], progress)
    except RecordBroken as problem:
        return writer.restore(plan.parts, plan.before, plan.after, str(problem))
    told = f"watched for {seen.seconds:.0f} s, {seen.count} readings"
    if seen.outside:
        return writer.restore(plan.parts, plan.before, plan.after, f"{told}: {seen.outside}")
    if seen.ended_early:
        return WriteEnd(WriteOutcome.UNWATCHED, f"{ended.message}; {told}, then: {seen.ended_early}",
                        seen.stands or ended.stands)
    return WriteEnd(WriteOutcome.DONE, f"{ended.message}; {told}, {100.0 * seen.most:.0f} % of the proven band used",
                    seen.stands)


def _path(wanted: WriteRequest) -> Path:
    if wanted.record is not None:
        return wanted.record
    return Path(wanted.proven_words.directory) / f"write_{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z.jsonl"


def _begin(wanted: WriteRequest, plan: WritePlan, peer: Peer) -> dict[str, Any]:
    proven, there = wanted.proven_words, peer.standing
    names = ("target", "words", "sample_time_s", "scaling", "setpoint_ramp", "boost")
    return {
        "schema": RECORD_SCHEMA, "version": __version__, "address": wanted.address.text,
        "simulated": plan.look.status is not None, "directory": proven.directory, "target": proven.words.target,
        "digest": proven.view.digest, "verdict": proven.view.verdict, "block": there.number, "begin": there.begin,
        "before": plan.look.content.hex(), "sha256": hashlib.sha256(plan.look.content).hexdigest(),
        "words_before": dict(plan.before), "words": dict(plan.after),
        "document": {name: proven.proof.get(name) for name in names},
        "parts": [part.to_document() for part in plan.parts], "known": dict(proven.view.stated_settings),
        "checks": [check.to_document() for check in plan.checks],
    }

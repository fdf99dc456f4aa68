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
from heatertune.live.change.budget import Budget
from heatertune.live.change.guard import refused
from heatertune.live.change.peer import Peer
from heatertune.live.change.plan import Planned, Wanted, peer_of, planned
from heatertune.live.change.record import RECORD_SCHEMA, Record, RecordBroken, write_new
from heatertune.live.change.rollback import settled, unended
from heatertune.live.change.watch import watched
from heatertune.live.change.writer import Ended, Outcome, Writer
from heatertune.live.plc_state import PlcState

__all__ = ["Applied", "applied"]

Progress = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class Applied:
    """What became of a write.

    Attributes:
        ended: its end.
        record: file of its record; None: nothing was begun.
        earlier: what became of writes before it that never ended, one sentence each.
    """

    ended: Ended
    record: Path | None = None
    earlier: tuple[str, ...] = ()

    def to_document(self) -> dict[str, Any]:
        """Return it as the command prints it."""
        record = None if self.record is None else str(self.record)
        return {**self.ended.to_document(), "record": record, "earlier": list(self.earlier)}


def applied(wanted: Wanted, yes: str | None, progress: Progress = str) -> Applied:
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
    wanted.proven.demand_yes(yes)
    peer = peer_of(wanted)
    budget = Budget(wanted.address, peer.standing.number, wanted.most_writes)
    state = PlcState(wanted.address)
    with state.locked("write"), peer:
        state.demand_no_way_back()
        state.demand_nothing_late()
        progress("looking at the PLC")
        try:
            plan = planned(wanted, peer)
        except LinkError as problem:
            return Applied(Ended(Outcome.NOT_DONE, f"nothing was sent: {problem}"))
        folder, now = Path(wanted.proven.directory), plan.look
        earlier = tuple(settled(lines, now) for lines in unended(folder, wanted.address))
        if why := refused(plan.checks) or plan.no_order:
            return Applied(Ended(Outcome.NOT_DONE, f"nothing was sent: {why}", now.values), None, earlier)
        if not plan.parts:
            there = "these words stand in the PLC already: nothing was sent"
            return Applied(Ended(Outcome.DONE, there, now.values), None, earlier)
        path = _path(wanted)
        write_new(path.with_suffix(".before.bin"), now.content)
        write_new(path, b"")
        with Record(path) as record:
            return Applied(_written(wanted, plan, peer, record, budget, progress), path, earlier)


def _written(
    wanted: Wanted, plan: Planned, peer: Peer, record: Record, budget: Budget, progress: Progress
) -> Ended:
    record.put("begin", **_begin(wanted, plan, peer))
    writer = Writer(peer, record, budget, progress)
    progress("writing")
    ended = writer.write(plan.parts, plan.before, plan.after)
    if ended.outcome is Outcome.DONE and wanted.watch and not wanted.said.in_manual:
        ended = _watched(wanted, plan, peer, record, writer, ended, progress)
    try:
        record.put("end", **ended.to_document())
    except RecordBroken as problem:
        return replace(ended, told=f"{ended.told}; {problem}")
    return ended


def _watched(
    wanted: Wanted, plan: Planned, peer: Peer, record: Record, writer: Writer, ended: Ended, progress: Progress
) -> Ended:
    try:
        seen = watched(peer, record, wanted.proven, plan.after, [plan.look, *writer.looks], progress)
    except RecordBroken as problem:
        return writer.restore(plan.parts, plan.before, plan.after, str(problem))
    told = f"watched for {seen.seconds:.0f} s, {seen.count} readings"
    if seen.outside:
        return writer.restore(plan.parts, plan.before, plan.after, f"{told}: {seen.outside}")
    if seen.ended_early:
        return Ended(Outcome.UNWATCHED, f"{ended.told}; {told}, then: {seen.ended_early}", seen.stands or ended.stands)
    return Ended(Outcome.DONE, f"{ended.told}; {told}, {100.0 * seen.most:.0f} % of the proven band used", seen.stands)


def _path(wanted: Wanted) -> Path:
    if wanted.record is not None:
        return wanted.record
    return Path(wanted.proven.directory) / f"write_{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z.jsonl"


def _begin(wanted: Wanted, plan: Planned, peer: Peer) -> dict[str, Any]:
    proven, there = wanted.proven, peer.standing
    names = ("target", "words", "sample_time_s", "scaling", "setpoint_ramp", "boost")
    return {
        "schema": RECORD_SCHEMA, "version": __version__, "address": wanted.address.text,
        "simulated": plan.look.told is not None, "directory": proven.directory, "target": proven.words.target,
        "digest": proven.view.digest, "verdict": proven.view.verdict, "block": there.number, "begin": there.begin,
        "before": plan.look.content.hex(), "sha256": hashlib.sha256(plan.look.content).hexdigest(),
        "words_before": dict(plan.before), "words": dict(plan.after),
        "document": {name: proven.proof.get(name) for name in names},
        "parts": [part.to_document() for part in plan.parts], "known": dict(proven.view.known),
        "checks": [check.to_document() for check in plan.checks],
    }

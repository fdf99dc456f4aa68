"""Words of all zones into one PLC: all of them or none.

Every zone is looked at and checked before the first byte is sent. The zones are written one after the other, in an
order in which every set of words in between is stable together on all plausible networks. One hold has the way back of
all zones; whatever ends the write early, zones that were written before are taken back, the last first.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from heatertune import __version__
from heatertune.codec import encode
from heatertune.errors import DocumentError, InputError, LinkError
from heatertune.live.client.connection import Address
from heatertune.live.hold import Hold, WayBackPart, new_way_back
from heatertune.live.joint.zone_blocks import demand_served, zone_addresses
from heatertune.live.joint.zones_watch import ProvenZones, watch_zones
from heatertune.live.write.apply import NoOrder, in_order
from heatertune.live.write.plc_block import BlockSnapshot, LinkSettings, Peer, WritePart, block_image
from heatertune.live.write.proven_words import LEAST_YES, Check, Declared, checks, refusal_reason
from heatertune.live.write.rollback import Before, became, before_of
from heatertune.live.write.write_record import (
    MOST_WRITES,
    RECORD_SCHEMA,
    Budget,
    RecordBroken,
    WriteRecord,
    write_new,
)
from heatertune.live.write.writer import WriteEnd, WriteOutcome, Writer
from heatertune.plc.ramp import Number

__all__ = [
    "PLAN_SCHEMA", "ZonePlan", "ZonesPlan", "ZonesWriteRequest", "ZonesWriteResult", "apply_zones", "inspect_zones",
    "peers_of", "plan_zones", "restore_zones",
]

PLAN_SCHEMA: Final = "heatertune/zones-write/2"
_SCANS: Final = 2
_COMMAND: Final = "write of zones"
#: outcomes of zones, the worst first
_WORST: Final = (WriteOutcome.UNKNOWN, WriteOutcome.PARTLY, WriteOutcome.ROLLED_BACK, WriteOutcome.NOT_DONE,
                 WriteOutcome.UNWATCHED, WriteOutcome.DONE)
Progress = Callable[[str], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesWriteRequest:
    """What somebody wants.

    Attributes:
        proven: words of all zones.
        address: of the block of the first zone.
        numbers: see `heatertune.live.joint.zone_blocks.zone_addresses`.
        declared: of the PLC.
        link: how the link is held.
        most_writes: of one word.
        watch: whether the response is watched.
        record: folder of the records; None: one beside the design, named by the time.
    """

    proven: ProvenZones
    address: Address
    numbers: tuple[int, ...] = ()
    declared: Declared = field(default_factory=Declared)
    link: LinkSettings = field(default_factory=LinkSettings)
    most_writes: int = MOST_WRITES
    watch: bool = True
    record: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonePlan:
    """What a write would do to a zone.

    Attributes:
        zone: its name.
        look: at its block.
        checks: whether it is the right one.
        before, after: all words in the block.
        parts: what differs, in the order in which it is written.
    """

    zone: str
    look: BlockSnapshot
    checks: list[Check]
    before: Mapping[str, Number]
    after: Mapping[str, Number]
    parts: Sequence[WritePart]

    def to_document(self) -> dict[str, object]:
        """Return it as the command prints it."""
        return {"zone": self.zone, "checks": [check.to_document() for check in self.checks],
                "parts": [part.to_document() for part in self.parts]}


@dataclass(frozen=True, slots=True, kw_only=True)
class ZonesPlan:
    """What a write would do.

    Attributes:
        zones: of each zone, in their order.
        order: numbers of the zones, in the order in which they are written.
        no_order: why there is no such order; empty where there is one.
    """

    zones: tuple[ZonePlan, ...]
    order: tuple[int, ...]
    no_order: str

    @property
    def reason(self) -> str:
        """Why nothing is written, a sentence; empty where all agrees. Raises InputError as `refusal_reason`."""
        wrong = [f"zone {each.zone}: {why}" for each in self.zones if (why := _wrong(each.checks))]
        if not wrong:
            for each in self.zones:
                refusal_reason(each.checks)
        return "; ".join([*wrong, *([self.no_order] if self.no_order else [])])


def _wrong(zone_checks: Sequence[Check]) -> str:
    return "; ".join(f"{check.name} {check.message}" for check in zone_checks if check.ok is False)


def peers_of(wanted: ZonesWriteRequest) -> list[Peer]:
    """Return the block of each zone, not connected to yet; errors as `demand_served` and `zone_addresses`."""
    design = wanted.proven.design
    addresses = zone_addresses(wanted.address, demand_served(design.words), wanted.numbers)
    return [Peer(address, block_image(words, address, design.conditions.switches), words.sample_time_s, wanted.link)
            for address, words in zip(addresses, design.words, strict=True)]


def _demand_parameters_alone(wanted: ZonesWriteRequest) -> None:
    """Refuse decoupled zones: raise InputError."""
    if wanted.proven.design.decoupling is not None:
        raise InputError("decoupled zones: a write changes parameters, and cannot see whether the program in the PLC "
                         "adds what was proven: load the exported program, or design without --decouple")


def plan_zones(wanted: ZonesWriteRequest, peers: Sequence[Peer]) -> ZonesPlan:
    """Look at all zones, twice, and return what a write would do.

    Raises:
        InputError: decoupled zones.
        LinkError: a zone cannot be read.
    """
    _demand_parameters_alone(wanted)
    plans = tuple(_zone_plan(wanted, zone, peer) for zone, peer in enumerate(peers))
    try:
        order, plans = _ordered(wanted, plans)
    except NoOrder as problem:
        return ZonesPlan(zones=plans, order=(), no_order=f"{problem}; or write in manual (--in-manual)")
    return ZonesPlan(zones=plans, order=order, no_order="")


def _zone_plan(wanted: ZonesWriteRequest, zone: int, peer: Peer) -> ZonePlan:
    proven, there = wanted.proven.parts[zone], peer.standing
    first = peer.look()
    looks = first, peer.later(first, _SCANS)
    look, results = looks[1], checks(proven, there, looks, wanted.declared)
    operator_words = there.block.operators if wanted.declared.in_manual else ()
    after = {**look.values, **{name: proven.words.values[name] for name in there.own if name not in operator_words}}
    parts = there.parts(look.content, after) if results[0].ok is True else []
    return ZonePlan(zone=wanted.proven.design.zones[zone], look=look, checks=results, before=look.values, after=after,
                    parts=parts)


def _ordered(wanted: ZonesWriteRequest, plans: tuple[ZonePlan, ...]) -> tuple[tuple[int, ...], tuple[ZonePlan, ...]]:
    """Return the zones that change in an order, each with its parts in an order, in which all in between is stable.

    Raises:
        NoOrder: there is none.
    """
    changing = [zone for zone, plan in enumerate(plans) if plan.parts]
    if wanted.declared.in_manual:
        return tuple(changing), plans
    open_in_between = wanted.proven.open_in_between
    done = [plan.before for plan in plans]

    def with_zones(values: Mapping[str, Number]) -> str:
        return open_in_between([plan.after if values[f"zone {plan.zone}"] else plan.before for plan in plans])

    wholes = [WritePart((f"zone {plans[zone].zone}",), zone, b"", b"") for zone in changing]
    names = [f"zone {plan.zone}" for plan in plans]
    order = tuple(whole.start for whole in in_order(
        wholes, dict.fromkeys(names, 0), dict.fromkeys(names, 1), with_zones))
    zone_plans = list(plans)
    for zone in order:
        def with_words(values: Mapping[str, Number], zone: int = zone) -> str:
            return open_in_between([*done[:zone], values, *done[zone + 1:]])

        plan = plans[zone]
        parts = in_order(plan.parts, plan.before, plan.after, with_words)
        zone_plans[zone] = ZonePlan(zone=plan.zone, look=plan.look, checks=plan.checks, before=plan.before,
                                    after=plan.after, parts=parts)
        done[zone] = plan.after
    return order, tuple(zone_plans)


@dataclass(frozen=True, slots=True)
class ZonesWriteResult:
    """What became of a write.

    Attributes:
        outcome: of all zones.
        message: what happened, a sentence.
        ends: name of a zone → its end, in the order of the zones; those that were not touched are not there.
        record: folder of the records; None: nothing was begun.
    """

    outcome: WriteOutcome
    message: str
    ends: Mapping[str, WriteEnd] = field(default_factory=dict)
    record: Path | None = None

    @property
    def is_done(self) -> bool:
        """Whether all was done that was asked for."""
        return self.outcome is WriteOutcome.DONE

    def to_document(self) -> dict[str, object]:
        """Return it as the command prints it."""
        return {"outcome": self.outcome.value, "message": self.message,
                "zones": {zone: end.to_document() for zone, end in self.ends.items()},
                "record": None if self.record is None else str(self.record)}


def apply_zones(wanted: ZonesWriteRequest, confirm: str | None, progress: Progress = str) -> ZonesWriteResult:
    """Write the words of all zones into a PLC, or of none.

    Args:
        wanted: what, and where.
        confirm: the first digits of the proof's digest, as somebody typed them.
        progress: called with what is done.

    Raises:
        InputError: other digits, something that nobody has said of the PLC, a folder that cannot be written, or another
            command on this PLC that is under way or has not ended.
    """
    _demand_parameters_alone(wanted)
    wanted.proven.demand_yes(confirm)
    peers = peers_of(wanted)
    hold = Hold(wanted.address, wanted.link.clock)
    with hold.lock("write"), ExitStack() as stack:
        for peer in peers:
            stack.enter_context(peer)
        hold.demand_free()
        progress("looking at the zones")
        try:
            plan = plan_zones(wanted, peers)
        except LinkError as problem:
            return ZonesWriteResult(WriteOutcome.NOT_DONE, f"nothing was sent: {problem}")
        if why := plan.reason:
            return ZonesWriteResult(WriteOutcome.NOT_DONE, f"nothing was sent: {why}")
        if not plan.order:
            return ZonesWriteResult(WriteOutcome.DONE, "these words are in the PLC already: nothing was sent")
        folder = wanted.record or Path(wanted.proven.design.directory) / f"write_{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z"
        records = _begin_records(wanted, plan, peers, folder, stack)
        hold.open(new_way_back(_COMMAND, peers[0].address, peers[0].standing.number, _back_parts(plan, peers),
                               folder.absolute()))
        writers = {zone: Writer(peers[zone], hold, records[zone], Budget(
            peers[zone].address, peers[zone].standing.number, wanted.most_writes), progress,
            place=peers[zone].address.text) for zone in plan.order}
        return _ZonesWrite(wanted, plan, peers, writers, hold, folder).run(progress)


def _back_parts(plan: ZonesPlan, peers: Sequence[Peer]) -> list[WayBackPart]:
    """Return the parts that restore all zones, in the order in which they are written."""
    return [WayBackPart(part.start, part.before, {part.after}, address=peers[zone].address.text)
            for zone in plan.order for part in plan.zones[zone].parts]


def _begin_records(
    wanted: ZonesWriteRequest, plan: ZonesPlan, peers: Sequence[Peer], folder: Path, stack: ExitStack
) -> dict[int, WriteRecord]:
    """Return the record of each zone that changes, with its first line."""
    try:
        folder.mkdir(parents=True)
    except OSError as problem:
        raise InputError(f"{folder}: cannot be made for the records: {problem.strerror}") from None
    records = {}
    for place, zone in enumerate(plan.order, start=1):
        path = folder / f"{place}_zone{zone + 1}.jsonl"
        write_new(path, b"")
        records[zone] = record = stack.enter_context(WriteRecord(path))
        record.write_line("begin", **_begin(wanted, plan.zones[zone], zone, peers[zone]))
    return records


def _begin(wanted: ZonesWriteRequest, plan: ZonePlan, zone: int, peer: Peer) -> dict[str, object]:
    design, words = wanted.proven.design, wanted.proven.design.words[zone]
    return {
        "schema": RECORD_SCHEMA, "version": __version__, "address": peer.address.text,
        "simulated": plan.look.status is not None, "directory": str(Path(design.directory).absolute()),
        "zone": plan.zone, "target": words.target, "digest": f"sha256:{design.digest}", "verdict": "PASS",
        "block": peer.standing.number, "begin": peer.standing.begin,
        "before": plan.look.content.hex(), "sha256": hashlib.sha256(plan.look.content).hexdigest(),
        "words_before": dict(plan.before), "words": dict(plan.after),
        "document": {"target": words.target, "words": dict(words.values), "sample_time_s": words.sample_time_s,
                     "scaling": encode(words.scaling), "setpoint_ramp": encode(words.ramp), "boost": None},
        "parts": [part.to_document() for part in plan.parts], "known": dict(design.conditions.switches),
        "checks": [check.to_document() for check in plan.checks],
    }


class _ZonesWrite:
    """A write that is under way."""

    def __init__(
        self, wanted: ZonesWriteRequest, plan: ZonesPlan, peers: Sequence[Peer], writers: Mapping[int, Writer],
        hold: Hold, folder: Path,
    ) -> None:
        self._wanted, self._plan, self._peers, self._writers = wanted, plan, peers, writers
        self._hold, self._folder = hold, folder
        self._ends: dict[int, WriteEnd] = {}

    def run(self, progress: Progress) -> ZonesWriteResult:
        """Write zone after zone and watch; whatever ends it, all zones are written or taken back, or the hold stays."""
        try:
            for zone in self._plan.order:
                plan = self._plan.zones[zone]
                progress(f"writing zone {plan.zone}")
                self._ends[zone] = WriteEnd(WriteOutcome.UNKNOWN, "begun")  # stays where a fault ends the write
                self._ends[zone] = end = self._writers[zone].write(plan.parts, plan.before, plan.after)
                if end.outcome not in (WriteOutcome.DONE, WriteOutcome.UNWATCHED):
                    return self._taken_back(f"zone {plan.zone}: {end.message}", but=zone)
            return self._watched(progress)
        except BaseException as fault:  # of heatertune's own, or a system's without memory
            self._taken_back(f"ended by a fault of heatertune's own ({type(fault).__name__})")
            raise

    def _watched(self, progress: Progress) -> ZonesWriteResult:
        request, plan = self._wanted, self._plan
        if not request.watch or request.declared.in_manual:
            for zone in plan.order:
                self._ends[zone] = self._writers[zone].demand_new(plan.zones[zone].look, self._ends[zone])
            return self._ended(f"the words of {len(plan.order)} zones are in the PLC, read back")
        expected = [each.after for each in plan.zones]
        watch = watch_zones(self._peers, request.proven, expected, progress)
        summary = f"watched for {watch.seconds:.0f} s, {watch.count} readings"
        if watch.outside:
            return self._taken_back(f"{summary}: {watch.outside}")
        if watch.ended_early:
            self._ends = {zone: WriteEnd(WriteOutcome.UNWATCHED, f"{end.message}; {summary}, then: {watch.ended_early}",
                                         end.stands) for zone, end in self._ends.items()}
            return self._ended(f"the words are in the PLC; {summary}, then: {watch.ended_early}")
        return self._ended(f"the words of {len(plan.order)} zones are in the PLC, read back; {summary}, "
                           f"{100.0 * watch.most:.0f} % of the proven band used")

    def _taken_back(self, why: str, but: int = -1) -> ZonesWriteResult:
        """Take back the zones that were written, the last first; `but` has taken back its own words."""
        for zone in reversed(self._plan.order):
            if zone in self._ends and zone != but:
                plan = self._plan.zones[zone]
                self._ends[zone] = self._writers[zone].restore(plan.parts, plan.before, plan.after, why)
        return self._ended(why)

    def _ended(self, message: str) -> ZonesWriteResult:
        ends = {zone: self._ends[zone] for zone in sorted(self._ends)}
        outcome = _worst(ends.values())
        if outcome in (WriteOutcome.UNKNOWN, WriteOutcome.PARTLY):
            message = f"{message}; to bring back all zones: {self._hold.message()}"
        else:
            self._hold.close()
        for zone, end in ends.items():
            with suppress(RecordBroken):
                self._writers[zone].record.write_line("end", **end.to_document())
        return ZonesWriteResult(outcome, message, {self._plan.zones[zone].zone: end for zone, end in ends.items()},
                                self._folder)


def _worst(ends: Iterable[WriteEnd]) -> WriteOutcome:
    """Return the worst outcome of some zones."""
    return min((end.outcome for end in ends), key=_WORST.index)


def _demand_digits(digest: str, confirm: str | None) -> None:
    """Refuse what is not the beginning of a digest; raise InputError."""
    if confirm is None or len(confirm) < LEAST_YES or not digest.startswith(confirm.lower()):
        entered = "it was not said" if confirm is None else f"found {confirm!r}"
        raise InputError(f"--confirm: {entered}; expected the first digits of the digest, {digest[:8]}")


def _befores(folder: str | Path) -> list[Before]:
    """Return the records of a folder, in the order in which the zones were written; errors as `before_of`."""
    files = sorted(Path(folder).glob("*_zone*.jsonl"), key=lambda path: int(path.name.partition("_")[0]))
    records = [before_of(path) for path in files]
    if len({(each.lines.begin["digest"], each.address.host, each.address.port) for each in records}) != 1:
        raise DocumentError(f"{folder}: records of several writes")
    return records


def _digest(befores: Sequence[Before]) -> str:
    return hashlib.sha256("".join(str(each.lines.begin["sha256"]) for each in befores).encode()).hexdigest()


@contextmanager
def _peers_of_records(befores: Sequence[Before], link: LinkSettings | None) -> Iterator[list[Peer]]:
    with ExitStack() as stack:
        yield [stack.enter_context(Peer(each.address, each.image, each.interval_s, link)) for each in befores]


def inspect_zones(folder: str | Path, link: LinkSettings | None = None) -> tuple[dict[str, WriteEnd], str]:
    """Return the outcome of the write of each zone, and the digits that confirm its restoration.

    Raises:
        DocumentError: the records are damaged.
        LinkError: a zone cannot be read.
    """
    befores = _befores(folder)
    with _peers_of_records(befores, link) as peers:
        outcomes = {str(each.lines.begin["zone"]): became(each, peer.look())
                    for each, peer in zip(befores, peers, strict=True)}
    return outcomes, _digest(befores)[:8]


def restore_zones(
    folder: str | Path, confirm: str | None, link: LinkSettings | None = None, most_writes: int = MOST_WRITES,
    progress: Progress = str,
) -> ZonesWriteResult:
    """Put back what a write of zones has changed, the zone that was written last first.

    Args:
        folder: of the records.
        confirm: the first digits that `inspect_zones` returns, as somebody typed them.
        link: how the link is held.
        most_writes: of one word.
        progress: called with what is done.

    Raises:
        InputError: other digits, or another command on this PLC that is under way or has not ended.
        DocumentError: the records are damaged.
    """
    befores = _befores(folder)
    _demand_digits(_digest(befores), confirm)
    ends: dict[str, WriteEnd] = {}
    hold = Hold(befores[0].address, None if link is None else link.clock)
    with hold.lock("rollback"), _peers_of_records(befores, link) as peers:
        hold.demand_free()
        parts = [WayBackPart(part.start, part.before, {part.after}, address=each.address.text)
                 for each in befores for part in each.parts]
        hold.open(new_way_back(_COMMAND, befores[0].address, befores[0].image.number, parts, Path(folder).absolute()))
        for each, peer in reversed(list(zip(befores, peers, strict=True))):
            with WriteRecord(each.lines.path, torn=each.lines.torn) as record:
                budget = Budget(each.address, each.image.number, most_writes)
                writer = Writer(peer, hold, record, budget, progress, place=each.address.text)
                end = writer.restore(each.parts, each.before, each.after, "restored as requested", each.doubtful)
                record.write_line("end", **end.to_document())
            ends[str(each.lines.begin["zone"])] = end
        outcome = _worst(ends.values())
        if outcome in (WriteOutcome.ROLLED_BACK, WriteOutcome.NOT_DONE):
            outcome = WriteOutcome.DONE
        if outcome is not WriteOutcome.UNKNOWN:
            hold.close()
    return ZonesWriteResult(outcome, "what was written is taken back, zone by zone", ends, Path(folder))

"""`write`, `rollback` and `watch` for a folder that `design --zones` wrote."""

from __future__ import annotations

import argparse
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from heatertune.cli import printing
from heatertune.cli.printing import LINE
from heatertune.errors import LinkError
from heatertune.live.client.connection import Address
from heatertune.live.commands.record_watch import (
    end_requests,
    show_notes,
    signals_as_ctrl_c,
    unmoved_note,
    zones_of,
)
from heatertune.live.hold import Hold
from heatertune.live.joint.zones_watch import ProvenZones, ZonesWatch, read_proven_zones
from heatertune.live.joint.zones_write import (
    PLAN_SCHEMA,
    ZonesPlan,
    ZonesWriteRequest,
    ZonesWriteResult,
    apply_zones,
    inspect_zones,
    peers_of,
    plan_zones,
    restore_zones,
)
from heatertune.live.recorder import RecordingSetup, RecordingState, record
from heatertune.live.write.plc_block import LinkSettings, Peer
from heatertune.live.write.proven_words import Check, Declared
from heatertune.report.layout import table, wrap_text
from heatertune.zones.decoupling import WRITTEN

__all__ = ["rollback", "watch", "write"]

_MARKS: Final = {True: "ok", False: "NO", None: "say it"}


def write(settings: argparse.Namespace, address: Address, link: LinkSettings, declared: Declared) -> int:
    """Run `write` for zones; return its exit status. Errors as `read_proven_zones` and `apply_zones`."""
    progress = printing.Progress(settings)
    places = zones_of(settings.directory, address, settings.zone_blocks)
    assert places is not None
    demand = ZonesWriteRequest(
        proven=read_proven_zones(settings.directory, progress), address=places.addresses[0],
        numbers=tuple(each.block or 0 for each in places.addresses), declared=declared, link=link,
        most_writes=settings.max_writes, watch=not settings.no_watch,
        record=None if settings.record is None else Path(settings.record))
    document = {"schema": PLAN_SCHEMA, "directory": settings.directory, "address": address.text,
                "digest": f"sha256:{demand.proven.design.digest}", "yes": demand.proven.yes, "applied": settings.apply}
    if not settings.apply:
        return _show_plan(settings, demand, document)
    with signals_as_ctrl_c():
        done = apply_zones(demand, settings.confirm, progress)
    printing.output(settings, document | done.to_document(), lambda: "\n".join(_of_applied(done)))
    return 0 if done.is_done else 1


def _show_plan(settings: argparse.Namespace, wanted: ZonesWriteRequest, document: dict[str, object]) -> int:
    """Show what a write would do; return the exit status."""
    with ExitStack() as stack:
        try:
            plan = plan_zones(wanted, [stack.enter_context(peer) for peer in peers_of(wanted)])
        except LinkError as problem:
            return _not_read(settings, document, problem)
    unended = Hold(wanted.address).message()
    document |= {"zones": [each.to_document() for each in plan.zones], "no_order": plan.no_order or None,
                 "order": [plan.zones[zone].zone for zone in plan.order], "unended": unended or None}
    printing.output(settings, document, lambda: "\n".join(_of_plan(settings, wanted, plan, unended)))
    return 0


def _not_read(settings: argparse.Namespace, document: dict[str, object], problem: LinkError) -> int:
    """Report that a zone could not be read; return the exit status."""
    message = f"nothing was sent: {problem}"
    printing.output(settings, document | {"outcome": "not done", "told": message}, lambda: f"NOT DONE: {message}")
    return 1


def _of_plan(
    settings: argparse.Namespace, wanted: ZonesWriteRequest, plan: ZonesPlan, unended: str
) -> Iterator[str]:
    for each in plan.zones:
        yield f"zone {each.zone}"
        yield table([(_mark(check), check.name, check.message) for check in each.checks])
    parts = [(plan.zones[zone], part) for zone in plan.order for part in plan.zones[zone].parts]
    for number, (each, part) in enumerate(parts, start=1):
        texts = (f"{name} {each.before[name]:g} -> {each.after[name]:g}" for name in part.names)
        yield f"{number}. zone {each.zone}: {', '.join(texts)}"
    yield from wrap_text(plan.no_order, "- ") if plan.no_order else ()
    if unended:
        yield f"- {unended}"  # not wrapped: it ends in a command line
    yield from _further(settings, wanted, plan)


def _mark(check: Check) -> str:
    return _MARKS[check.ok] if check.ok is not None or check.option else "-"


def _further(settings: argparse.Namespace, wanted: ZonesWriteRequest, plan: ZonesPlan) -> Iterator[str]:
    """Yield the command line that writes, where nothing speaks against it."""
    checks = [check for each in plan.zones for check in each.checks]
    if plan.no_order or any(check.ok is False for check in checks):
        return
    if not plan.order:
        yield "these words are in the PLC already"
        return
    stated = " ".join(dict.fromkeys(check.option for check in checks if check.ok is None))
    again = shlex.join([*settings.given, *stated.split(), "--apply", "--confirm", wanted.proven.yes])
    yield f"to write:\n  heatertune {again}"  # not wrapped: it is typed


def _of_applied(done: ZonesWriteResult) -> Iterator[str]:
    yield from wrap_text(f"{done.outcome.upper()}: {done.message}")
    for zone, end in done.ends.items():
        values = "" if end.stands is None else "; in the PLC: " + ", ".join(
            f"{name} = {value:g}" for name, value in end.stands.items())
        yield from wrap_text(f"zone {zone}: {end.outcome.value}{values}", "- ")
    if done.record is not None:
        yield f"records {done.record}; back again: heatertune rollback {shlex.quote(str(done.record))}"


def rollback(settings: argparse.Namespace, link: LinkSettings) -> int:
    """Run `rollback` for the records of a write of zones; return its exit status. Errors as `restore_zones`."""
    document: dict[str, object] = {"schema": "heatertune/zones-rollback/2", "record": settings.record,
                                "applied": settings.apply}
    folder = shlex.quote(settings.record)
    if settings.apply:
        with signals_as_ctrl_c():
            done = restore_zones(settings.record, settings.confirm, link, settings.max_writes,
                                 printing.Progress(settings))
        printing.output(settings, document | done.to_document(), lambda: "\n".join(_of_applied(
            replace(done, record=None))))
        return 0 if done.is_done else 1
    try:
        ends, digits = inspect_zones(settings.record, link)
    except LinkError as problem:
        return _not_read(settings, document, problem)
    document |= {"yes": digits, "zones": {zone: end.to_document() for zone, end in ends.items()}}
    lines = [f"zone {zone}: {end.message}" for zone, end in ends.items()]
    printing.output(settings, document, lambda: "\n".join([
        *lines, f"to restore all zones:\n  heatertune rollback {folder} --apply --confirm {digits}"]))
    return 0


def watch(settings: argparse.Namespace, address: Address) -> int:
    """Run `watch` for zones; return its exit status. Errors as `read_proven_zones` and `record`."""
    proven = read_proven_zones(settings.design, printing.Progress(settings))
    places = zones_of(settings.design, address, settings.zone_blocks)
    assert places is not None
    log = Path(settings.out or Path(settings.design) / f"watch_{datetime.now(UTC):%Y%m%d_%H%M%S}.csv")
    zones_watch, unended = ZonesWatch(proven), Hold(address).message()
    others = _others(proven, places.addresses)
    with end_requests() as requests:
        so_far = record(address, log, places, RecordingSetup(
            for_s=settings.for_s, append=settings.append, pwm_period_s=proven.design.pwm_period_s),
            shown=_shown(settings, zones_watch), ended=lambda: bool(requests))
    LINE.end()
    messages = list(filter(None, (  # somebody may have written some meanwhile
        unended or Hold(address).message(), unmoved_note(zones_watch.zones[0], zones_watch.settle_s, so_far),
        *(others or _others(proven, places.addresses)))))
    well = zones_watch.well and not messages and not so_far.trouble
    document = {"schema": "heatertune/zones-watch/1", "address": address.text, "log": str(log), "rows": so_far.rows,
                "gaps": so_far.gaps, "lost": so_far.trouble or None, "well": well, "messages": messages,
                "zones": [each.to_document() for each in zones_watch.zones]}
    printing.output(settings, document, lambda: "\n".join(_of_watch(document, zones_watch, messages)))
    return 0 if well else 1


def _shown(settings: argparse.Namespace, watched: ZonesWatch) -> Callable[[RecordingState], object]:
    """Return what takes each row, and shows all zones on the terminal's line."""
    start_s, last, shown_notes = time.monotonic(), [0], list[str]()

    def shown(so_far: RecordingState) -> None:
        show_notes(so_far, shown_notes)
        if so_far.last is not None and so_far.rows > last[0]:
            last[0] = so_far.rows
            watched.see(so_far.last)
        if not settings.quiet:
            LINE.show(lambda: f"{so_far.rows} rows, {time.monotonic() - start_s:.0f} s{watched.short()}"[:118])

    return shown


def _of_watch(document: Mapping[str, object], watched: ZonesWatch, messages: Sequence[str]) -> Iterator[str]:
    yield "WELL: all zones inside the proven band" if document["well"] else "NOT WELL"
    yield from (each.line() for each in watched.zones)
    if document["lost"]:
        yield f"- the link was lost and is not back: {document['lost']}"
    yield from (f"- {each}" for each in messages)
    zones = shlex.quote(",".join(each.zone for each in watched.zones))
    yield f"next: heatertune design {document['log']} --zones {zones}"


def _others(proven: ProvenZones, addresses: tuple[Address, ...]) -> list[str]:
    """Return for each zone which words in the PLC are not the proven ones, or why they could not be compared."""
    request = ZonesWriteRequest(
        proven=proven, address=addresses[0], numbers=tuple(each.block or 0 for each in addresses),
        link=LinkSettings(tries=1))
    lines = []
    for zone, peer in zip(proven.design.zones, peers_of(request), strict=True):
        with peer:
            lines.append(_other_words(proven, zone, peer))
    return [line for line in lines if line]


def _other_words(proven: ProvenZones, zone: str, peer: Peer) -> str:
    try:
        values = peer.look().values
    except LinkError as problem:
        return f"zone {zone}: whether its words are the proven ones is not known: {problem}"
    words = proven.design.words[proven.design.zones.index(zone)]
    own = () if proven.design.decoupling is None else WRITTEN[words.target]
    other = [f"{name} is {values[name]:g}, not {words.values[name]:g}" for name in peer.standing.own
             if name not in (*peer.standing.block.operators, *own) and values[name] != words.values[name]]
    return f"zone {zone}: other words than were proven: {', '.join(other)}" if other else ""

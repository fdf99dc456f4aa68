"""The commands that write parameters into a running PLC and restore the old ones: `write` and `rollback`."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatertune import options, report
from heatertune.cli import printing
from heatertune.codec import holds_zones
from heatertune.errors import LinkError
from heatertune.live.client.connection import address_of
from heatertune.live.commands.record_watch import add_zone_blocks, signals_as_ctrl_c, zones_of
from heatertune.report.layout import table, wrap_text
from heatertune.settings import SensorSettings
from heatertune.units import check

if TYPE_CHECKING:
    from heatertune.live.hold import WayBack
    from heatertune.live.write.apply import WritePlan, WriteRequest, WriteResult
    from heatertune.live.write.plc_block import LinkSettings
    from heatertune.live.write.rollback import Before
    from heatertune.live.write.writer import WriteEnd

__all__ = [
    "ROLLBACK_EXAMPLE", "WRITE_EXAMPLE", "add_guard", "add_rollback", "add_write", "ended_lines", "link_of", "not_read",
]


WRITE_EXAMPLE = "example: heatertune write out/ s7://192.168.0.10/0/2/db30"


def add_write(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "write", help="proven parameters into a running PLC: shows what differs; with --apply, writes, reads back and "
                      "watches",
        epilog=WRITE_EXAMPLE,
        description="Compare the parameters of a design with those in a running PLC. With --apply, write what differs: "
                    "only parameters with a PASS, only over values that were shown before, in an order in which every "
                    "intermediate set is proven stable. Then read them back, watch the response, and restore the old "
                    "ones if it leaves the proven band.",
    )
    command.add_argument("directory", metavar="DIR", help="folder that heatertune design wrote")
    command.add_argument("address", metavar="ADDRESS", help="s7://HOST:PORT/RACK/SLOT/dbN, "
                         "modbus://HOST:PORT/UNIT/REGISTER or opc.tcp://HOST:PORT/ns=3;s=NAME")
    add_guard(command, "the proof, to confirm it")
    group = command.add_argument_group("what the block does not contain")
    group.add_argument("--called-every", type=float, metavar="S", help="interval TA at which the PLC calls it [s]")
    options.add(group, SensorSettings, "range_degC", default=argparse.SUPPRESS,
                help="sensor range at the lowest and highest reading [°C]")
    group.add_argument("--as-exported", action="store_true",
                       help="it runs the program exported with the parameters: ramp, boost, input module")
    group.add_argument("--in-manual", action="store_true",
                       help="the controller is in manual and stays there: parameters are written in any order, without "
                            "watching")
    add_zone_blocks(command)
    command.add_argument("--no-watch", action="store_true", help="do not watch the response")
    command.add_argument("--record", metavar="FILE", help="the record (default: DIR/write_TIME.jsonl)")
    printing.add_output_options(command, _run_write)


def add_guard(command: argparse.ArgumentParser, of_what: str) -> None:
    """Add the options of a write: writing at all, and the link."""
    command.add_argument("--apply", action="store_true", help="write (default: only show)")
    command.add_argument("--confirm", metavar="DIGEST", help=f"first digits of the digest of {of_what}")
    link = command.add_argument_group("the link")
    link.add_argument("--reconnect", type=int, default=5, metavar="N", help="connection attempts (default: 5)")
    link.add_argument("--timeout", type=float, default=2.0, metavar="S",
                      help="time after which an answer counts as lost [s] (default: 2)")
    link.add_argument("--max-writes", type=int, default=1000, metavar="N",
                      help="most writes of one word from this machine, as its memory wears out (default: 1000)")


def link_of(settings: argparse.Namespace) -> LinkSettings:
    """Return how the link is held, as the options say; raise OutOfRange where that makes no sense."""
    from heatertune.live.write.plc_block import LinkSettings

    check("--reconnect", settings.reconnect, least=1)
    check("--timeout", settings.timeout, above=0.0)
    check("--max-writes", settings.max_writes, least=1)
    return LinkSettings(tries=settings.reconnect, timeout_s=settings.timeout)


def _run_write(settings: argparse.Namespace) -> int:
    from heatertune.live.hold import Hold
    from heatertune.live.write.apply import (
        PLAN_SCHEMA,
        WriteRequest,
        apply_write,
        peer_of,
        plan_write,
    )
    from heatertune.live.write.proven_words import Declared, read_proven

    sensor = options.provided_options(SensorSettings, settings)
    terms = Declared(called_every_s=settings.called_every, range_degC=sensor.get("range_degC"),
                as_exported=settings.as_exported, in_manual=settings.in_manual)
    address, link = address_of(settings.address), link_of(settings)
    if holds_zones(settings.directory):
        return int(import_module("heatertune.live.commands.zone_commands").write(settings, address, link, terms))
    zones_of(settings.directory, address, settings.zone_blocks)  # refuses the option
    progress = printing.Progress(settings)
    request = WriteRequest(proven_words=read_proven(settings.directory, progress), address=address, declared=terms,
                           link=link, most_writes=settings.max_writes, watch=not settings.no_watch,
                           record=None if settings.record is None else Path(settings.record))
    document = {"schema": PLAN_SCHEMA, "directory": settings.directory, "address": address.text,
                "digest": request.proven_words.view.digest, "yes": request.proven_words.yes, "applied": settings.apply}
    if settings.apply:
        with signals_as_ctrl_c():
            done = apply_write(request, settings.confirm, progress)
        document |= done.to_document()
        printing.output(settings, document, lambda: "\n".join(_of_applied(done)))
        return 0 if done.end.is_done else 1
    with peer_of(request) as peer:
        try:
            plan = plan_write(request, peer)
        except LinkError as problem:
            return not_read(settings, document, problem)
    unended = Hold(address).message()
    printing.output(settings, document | plan.to_document() | {"unended": unended or None},
                    lambda: "\n".join(_of_plan(settings, request, plan, unended)))
    return 0


def not_read(settings: argparse.Namespace, document: dict[str, Any], problem: LinkError) -> int:
    """Tell that the PLC could not be read, and return the exit status."""
    outcome = {"outcome": "not done", "told": f"nothing was sent: {problem}", "stands": None}
    printing.output(settings, document | outcome, lambda: f"NOT DONE: {outcome['told']}")
    return 1


def _of_plan(settings: argparse.Namespace, wanted: WriteRequest, plan: WritePlan, unended: str) -> Iterator[str]:

    if plan.difference is not None:
        yield from report.difference_lines(_of_block(plan.difference)).splitlines()
    marks = {True: "ok", False: "NO", None: "say it"}
    yield table([(marks[check.ok] if check.ok is not None or check.option else "-", check.name, check.message)
                 for check in plan.checks])
    for number, part in enumerate(plan.parts, start=1):
        yield f"{number}. {', '.join(part.names)}: {part.before.hex(' ')} -> {part.after.hex(' ')}"
    if plan.no_order:
        yield from wrap_text(plan.no_order, "- ")
    if plan.undone_by:
        yield from wrap_text(f"{plan.undone_by}: load the exported one, too", "- ")
    if unended:
        yield f"- {unended}"  # not wrapped: it ends in a command line
    if all(check.ok is not False for check in plan.checks) and plan.parts and not plan.no_order:
        hints = [check.option for check in plan.checks if check.ok is None and check.option]
        again = shlex.join([*settings.given, *" ".join(hints).split(), "--apply", "--confirm", wanted.proven_words.yes])
        yield f"to write:\n  heatertune {again}"  # not wrapped: it is typed


def _of_block(difference: Mapping[str, Any]) -> dict[str, Any]:
    """Return what differs without what no block tells, or the program around writes."""
    from heatertune.proof.difference import IN_BLOCK

    terms = [term for term in difference["terms"] if term["name"] in IN_BLOCK]
    words = [word for word in difference["words"] if not word["written"]]
    a, b = difference["a"] | {"source": "in the PLC"}, difference["b"] | {"source": "proven"}
    return {**difference, "a": a, "b": b, "terms": terms, "words": words, "proofs": []}


def _of_applied(done: WriteResult) -> Iterator[str]:

    for note in done.earlier:
        yield from wrap_text(note, "- ")
    yield from ended_lines(done.end)
    if done.record is not None:
        yield f"record {done.record}; back again: heatertune rollback {shlex.quote(str(done.record))}"


def ended_lines(ended: WriteEnd) -> Iterator[str]:
    """Yield the end of a write, and what stands in the PLC, as a terminal shows it."""
    yield from wrap_text(f"{ended.outcome.upper()}: {ended.message}")
    if ended.stands is not None:
        yield from wrap_text(", ".join(f"{name} = {value:g}" for name, value in ended.stands.items()), "in the PLC: ")


ROLLBACK_EXAMPLE = "example: heatertune rollback out/write_20261123T154500000000Z.jsonl"


def add_rollback(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "rollback", help="report what became of a write; with --apply, restore the parameters as they were "
                         "before", epilog=ROLLBACK_EXAMPLE,
        description="Read the record of a heatertune write, compare it with the PLC, and report. With --apply, restore "
                    "those parameters that are still as written; what someone else has changed since stays.",
    )
    command.add_argument("record", metavar="RECORD", help="file that heatertune write made; of zones, the folder")
    add_guard(command, "what is restored, as shown without --apply")
    command.add_argument("--unproven", action="store_true",
                         help="restore parameters without a proof (default: they are proven first)")
    printing.add_output_options(command, _run_rollback)


def _run_rollback(settings: argparse.Namespace) -> int:
    from heatertune.live.hold import Hold
    from heatertune.live.write.rollback import before_of, inspect_write, rolled_back

    if Path(settings.record).is_dir():
        return int(import_module("heatertune.live.commands.zone_commands").rollback(settings, link_of(settings)))
    before, link = before_of(settings.record), link_of(settings)
    document: dict[str, Any] = {
        "schema": "heatertune/rollback/2", "record": settings.record, "address": before.address.text,
        "yes": before.yes, "applied": settings.apply}
    if settings.apply:
        with signals_as_ctrl_c():
            ended = rolled_back(before, settings.confirm, link, settings.max_writes, unproven=settings.unproven)
    else:
        try:
            ended = inspect_write(before, link)
        except LinkError as problem:
            return not_read(settings, document, problem)
    unended = Hold(before.address).way_back()
    printing.output(settings, document | ended.to_document() | {"unended": unended.message if unended else None},
                    lambda: "\n".join(_lines(settings, before, ended, unended)))
    return 0 if not settings.apply or ended.is_done else 1


def _lines(settings: argparse.Namespace, before: Before, ended: WriteEnd, unended: WayBack | None) -> Iterator[str]:
    if unended:
        yield f"- {unended.message}"  # not wrapped: it ends in a command line
    if settings.apply:
        yield from ended_lines(ended)
        return
    yield from wrap_text(f"{before.address.text}: {ended.message}")
    own = unended is not None and Path(unended.record) == before.lines.path.absolute()
    yield from _way_on(shlex.quote(str(settings.record)), before, ended, "to end the write" if own else "")


def _way_on(record: str, before: Before, ended: WriteEnd, purpose: str) -> Iterator[str]:
    """Yield what would be put back, and the command that does it; `purpose` of it where nothing is to be put back."""
    from heatertune.live.write.rollback import not_proven, put_back_words

    back, why = {}, ""
    if ended.stands is not None and (back := put_back_words(before, ended.stands)):
        purpose = "to put back " + ", ".join(f"{name} = {value:g}" for name, value in back.items())
        why = not_proven(before, ended.stands)
    if why:
        yield from wrap_text(f"what would be put back is not proven: {why}", "- ")
    if not back:
        yield "nothing to put back"
    if purpose:
        yield f"{purpose}:"
        yield (f"  heatertune rollback {record} --apply --confirm {before.yes}"  # not wrapped: it is typed
               f"{' --unproven' if why else ''}")

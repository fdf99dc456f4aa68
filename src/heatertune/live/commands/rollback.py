"""`heatertune rollback`: what became of a write, and the words as they were before it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from heatertune.cli import printing
from heatertune.errors import LinkError
from heatertune.live.commands.record import signals_as_ctrl_c
from heatertune.live.commands.write import add_guard, ended_lines, link_of, not_read
from heatertune.report.layout import wrap_text

if TYPE_CHECKING:
    from heatertune.live.write.rollback import Before
    from heatertune.live.write.writer import WriteEnd

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune rollback out/write_20261123T154500000000Z.jsonl"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "rollback", help="report what became of a write; with --apply, restore the parameters as they were "
                         "before", epilog=_EXAMPLE,
        description="Read the record of a heatertune write, compare it with the PLC, and report. With --apply, restore "
                    "those parameters that are still as written; what someone else has changed since stays.",
    )
    command.add_argument("record", metavar="RECORD", help="file that heatertune write made")
    add_guard(command, "what is restored, as shown without --apply")
    command.add_argument("--unproven", action="store_true",
                         help="restore parameters without a proof (default: they are proven first)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.live.plc_state import PlcState  # noqa: PLC0415
    from heatertune.live.write.rollback import before_of, inspect_write, rolled_back  # noqa: PLC0415 - as in write

    before, link = before_of(settings.record), link_of(settings)
    document: dict[str, Any] = {
        "schema": "heatertune/rollback/1", "record": settings.record, "address": before.address.text,
        "yes": before.yes, "applied": settings.apply}
    if settings.apply:
        with signals_as_ctrl_c():
            ended = rolled_back(before, settings.yes, link, settings.most_writes, unproven=settings.unproven)
    else:
        try:
            ended = inspect_write(before, link)
        except LinkError as problem:
            return not_read(settings, document, problem)
    open_experiment = PlcState(before.address).message()
    printing.output(settings, document | ended.to_document() | {"open_experiment": open_experiment or None},
                    lambda: "\n".join(_lines(settings, before, ended, open_experiment)))
    return 0 if not settings.apply or ended.is_done else 1


def _lines(settings: argparse.Namespace, before: Before, ended: WriteEnd, open_experiment: str) -> Iterator[str]:
    from heatertune.live.write.rollback import not_proven  # noqa: PLC0415

    if open_experiment:
        yield from wrap_text(open_experiment, "- ")
    if settings.apply:
        yield from ended_lines(ended)
    else:
        yield from wrap_text(f"{before.address.text}: {ended.message}")
        back = [name for part in before.parts for name in part.names
                if (ended.stands or {}).get(name) == before.after[name]]
        was = ", ".join(f"{name} = {before.before[name]:g}" for name in back)
        why = not_proven(before, ended.stands) if back and ended.stands is not None else ""
        yield from wrap_text(f"what would be put back is not proven: {why}", "- ") if why else ()
        again = f"heatertune rollback {settings.record} --apply --yes {before.yes}{' --unproven' if why else ''}"
        yield from wrap_text(f"to put back {was}: {again}" if back else "nothing to put back")

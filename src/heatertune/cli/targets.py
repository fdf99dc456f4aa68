"""`heatertune targets`: the controllers, and what each can do."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from heatertune import plc
from heatertune.cli import printing

if TYPE_CHECKING:
    from heatertune.pid.timer import Timer

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune targets"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "targets", help="the controllers, their ranges, and what their manuals leave open", epilog=_EXAMPLE,
        description="List the controllers, grouped by hardware.",
    )
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:

    document = {
        "schema": "heatertune/targets/1",
        "targets": [
            {
                "name": controller.name,
                "group": group,
                "title": controller.title,
                "can": controller.can,
                "cannot": controller.cannot,
                "sample_time_s": _times(controller.timer),
                "words": [{"name": f.name, "address": f.address, "low": f.low, "high": f.high, "format": f.format}
                          for f in controller.fields],
                "inputs": dict(controller.inputs),
                "switches": [{"name": s.name, "settings": s.settings, "why": s.reason, "chosen": s.chosen}
                             for s in controller.switches],
            }
            for group, names in plc.GROUPS.items() for controller in map(plc.controller_for, names)
        ],
    }
    overview = "\n".join(f"{group}: {', '.join(names)}" for group, names in plc.GROUPS.items())
    printing.output(settings, document, lambda: "\n\n".join([overview, *map(_told, document["targets"])]))
    return 0


def _times(timer: Timer) -> dict[str, float]:
    return {"shortest": timer.shortest_s, "longest": timer.longest_s, "step": timer.step_s}


def _told(target: Any) -> str:
    times = target["sample_time_s"]
    lines = [
        f"{target['name']}: {target['title']}",
        f"  TA {times['shortest']:g}…{times['longest']:g} s in steps of {times['step']:g} s",
        *[f"  can: {sentence}" for sentence in target["can"]],
        *[f"  can't: {sentence}" for sentence in target["cannot"]],
        "  words " + ", ".join(_word(w) for w in target["words"]),
        "  inputs of a scan " + ", ".join(f"{name} ({form})" for name, form in target["inputs"].items()),
    ]
    for title, chosen in (("left open by the manual, proven under every setting", False), ("chosen by --switch", True)):
        of_title = [s for s in target["switches"] if s["chosen"] == chosen]
        lines += [f"  {title}:"] if of_title else []
        lines += [f"    {s['name']} ({', '.join(s['settings'])}): {s['why']}" for s in of_title]
    return "\n".join(lines)


def _word(word: Any) -> str:
    real = word["format"] in ("REAL", "LREAL")
    return f"{word['name']} ({word['format']})" if real else f"{word['name']} {word['low']}…{word['high']}"

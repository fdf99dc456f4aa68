"""The commands for reference: `targets`, `terms` and `spec`."""

from __future__ import annotations

import argparse
import dataclasses
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import options, plc
from heatertune.cli import printing
from heatertune.codec import encode
from heatertune.report.layout import table
from heatertune.settings import Conditions
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.pid.design_values import Timer
    from heatertune.terms import GlossaryTerm

__all__ = ["SPEC_EXAMPLE", "TARGETS_EXAMPLE", "TERMS_EXAMPLE", "add_spec", "add_targets", "add_terms"]


TERMS_EXAMPLE = "example: heatertune terms TA TN Ms"

_LEFT: Final = 20  # columns of the names


def add_terms(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "terms", help="what TA, TN, Ms, plausible heater … mean", epilog=TERMS_EXAMPLE,
        description="Explain the symbols and terms that heatertune prints.",
    )
    command.add_argument("term", nargs="*", metavar="TERM", help="a symbol or term (default: all)")
    printing.add_output_options(command, _run_terms)


def _run_terms(settings: argparse.Namespace) -> int:
    from heatertune.terms import TERMS, the_term

    chosen = tuple(map(the_term, settings.term)) or TERMS
    document = {"schema": "heatertune/terms/1", "terms": [dataclasses.asdict(term) for term in chosen]}
    printing.output(settings, document, lambda: "\n".join(map(_told_terms, chosen)))
    return 0


def _told_terms(term: GlossaryTerm) -> str:
    name, *others = term.names
    unit = f" [{term.unit}]" if term.unit not in ("", "1") else ""
    meaning = f"{', '.join(others)}{unit}: {term.meaning}" if others else term.meaning
    return textwrap.fill(meaning, printing.WIDTH, initial_indent=f"{name:{_LEFT - 1}} ", subsequent_indent=" " * _LEFT)


SPEC_EXAMPLE = "example: heatertune spec oven --limit overshoot=3degC -o spec.toml"


def add_spec(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "spec", help="print the specification in force as a file, with the reason for each limit", epilog=SPEC_EXAMPLE,
        description="Print the limits that parameters must keep, as a file to edit and use with --spec.",
    )
    command.add_argument("spec", metavar="NAME|FILE.toml", nargs="?",
                         help="a preset (heatertune spec --list) or a file (default: general)")
    options.add(command, Conditions, "limit", "profile")
    command.add_argument("-o", "--out", metavar="FILE.toml", help="write the specification to this file")
    command.add_argument("--list", action="store_true", help="list the presets")
    printing.add_output_options(command, _run_spec)


def _run_spec(settings: argparse.Namespace) -> int:
    from heatertune.proof.spec_file import in_force, spec_text
    from heatertune.proof.specification import PRESETS

    if settings.list:
        document = {"schema": "heatertune/presets/1",
                    "presets": {name: one.description for name, one in PRESETS.items()}}
        printing.output(settings, document, lambda: table([(name, one.description) for name, one in PRESETS.items()]))
        return 0
    specification = in_force(settings.spec, settings.limit, settings.profile)
    document = {"schema": "heatertune/specification/1", **encode(specification)}
    if settings.out is not None:
        target = Path(settings.out)
        write_files(target.parent, {target.name: spec_text(specification)})
    printing.output(settings, document, lambda: spec_text(specification).rstrip("\n"))
    return 0


TARGETS_EXAMPLE = "example: heatertune targets"


def add_targets(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "targets", help="the controllers, their ranges, and what their manuals leave open", epilog=TARGETS_EXAMPLE,
        description="List the controllers, grouped by hardware.",
    )
    printing.add_output_options(command, _run_targets)


def _run_targets(settings: argparse.Namespace) -> int:

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
    for title, chosen in (("left open by the manual, proven under every setting", False), ("chosen by --assume", True)):
        of_title = [s for s in target["switches"] if s["chosen"] == chosen]
        lines += [f"  {title}:"] if of_title else []
        lines += [f"    {s['name']} ({', '.join(s['settings'])}): {s['why']}" for s in of_title]
    return "\n".join(lines)


def _word(word: Any) -> str:
    real = word["format"] in ("REAL", "LREAL")
    return f"{word['name']} ({word['format']})" if real else f"{word['name']} {word['low']}…{word['high']}"

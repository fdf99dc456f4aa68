"""Pages that MkDocs gets from the program itself, so that nothing is written twice.

A line `<!-- generate: NAME -->` in a page is replaced by what the function of that name returns.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from heatertune.cli import parser
from heatertune.plc import TARGETS, controller_for
from heatertune.plc.commissioning import commissioning
from heatertune.units import NOMENCLATURE

SOURCE = Path(__file__).parents[1] / "src" / "heatertune"
STAGES = ("log", "model", "pid", "plc", "proof", "report")
_MARKER = re.compile(r"^<!-- generate: (\w+) -->$", re.MULTILINE)


def commands() -> str:
    """Return the help of every command, as the program prints it on a terminal of 100 columns."""
    os.environ["COLUMNS"] = "100"
    (sub,) = [a for a in parser()._actions if isinstance(a, argparse._SubParsersAction)]
    parts = [f"```text\n{parser().format_help()}```\n"]
    parts += [f"## {name}\n\n```text\n{each.format_help()}```\n" for name, each in sub.choices.items()]
    return "\n".join(parts)


def nomenclature() -> str:
    """Return the table of symbols."""
    rows = "\n".join(f"| {symbol} | {name} | {unit} | `{field}` |"
                     for field, (symbol, name, unit) in NOMENCLATURE.items())
    return f"| symbol | term | unit | name in the code |\n| --- | --- | --- | --- |\n{rows}\n"


def controllers() -> str:
    """Return what every controller says of itself, and its DIFFERENCES.md."""
    return "\n".join(_controller(name, package) for name, package in TARGETS.items())


def _controller(name: str, package: str) -> str:
    each = controller_for(name)
    low, high, step = each.timer.shortest_s, each.timer.longest_s, each.timer.step_s
    words = "\n".join(f"| {f.address} | {f.name} | {f.format} | {f.low:.6g} … {f.high:.6g} | {f.comment} |"
                      for f in each.fields)
    told = "\n".join([*(f"- can: {can}" for can in each.can), *(f"- can't: {cannot}" for cannot in each.cannot)])
    differences = SOURCE.joinpath(*package.split(".")[1:], "DIFFERENCES.md").read_text(encoding="utf-8")
    body = re.sub(r"^(#+) ", lambda found: f"{found[1]}## ", differences.partition("\n")[2], flags=re.MULTILINE)
    return (f"## {name}\n\n{each.title}. TA {low:g} … {high:g} s in steps of {step:g} s.\n\n{told}\n\n"
            f"| address | word | format | range | meaning |\n| --- | --- | --- | --- | --- |\n{words}\n\n{body}\n")


def service(target: str) -> str:
    """Return how a controller is put into service: the text of its folder, as the report has it."""
    told = commissioning(target)
    parts = [f"**{title}**\n\n" + "\n".join(f"{i}. {step}" for i, step in enumerate(items, 1))
             for title, items in told.steps.items()]
    return "\n\n".join([*parts, f"Source: {told.facts}\n"])


def python() -> str:
    """Return the directives from which mkdocstrings draws the Python reference: chain, what is free to all, stages."""
    steps = ("stages", "whole", "ramp", "samples", "validation", "experiment", "targets", "advice")
    names = [*(f"chain.{name}" for name in steps), "batch.fleets", "batch.studies"]
    return "\n".join(f"::: heatertune.{name}\n    options:\n      toc_label: {name}\n"
                     for name in (*names, "units", "errors", *modules()))


def modules() -> list[str]:
    """Return every module of the stages that offers something to others."""
    found = []
    for stage in STAGES:
        for path in sorted((SOURCE / stage).rglob("*.py")):
            if path.name != "__init__.py" and "__all__" in path.read_text(encoding="utf-8"):
                found.append(".".join(path.relative_to(SOURCE).with_suffix("").parts))
    return found


GENERATORS: dict[str, Callable[[], str]] = {
    "commands": commands, "nomenclature": nomenclature, "controllers": controllers, "python": python,
} | {f"service_{name.replace('-', '_')}": partial(service, name) for name in TARGETS}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill the markers of a page."""
    return _MARKER.sub(lambda found: GENERATORS[found[1]](), markdown)

"""Pages that MkDocs gets from the program itself, so that nothing is written twice.

A line `<!-- generate: NAME -->` in a page is replaced by what the function of that name returns.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from heatertune.cli import parser
from heatertune.plc import GROUPS, TARGETS, controller_for
from heatertune.plc.targets import commissioning
from heatertune.proof.criteria import CRITERIA, LIMITS
from heatertune.proof.event_table import CONDITIONS, EVENTS, EXCLUDED, NOT_RUN
from heatertune.units import TERMS, GlossaryTerm

SOURCE = Path(__file__).parents[1] / "src" / "heatertune"
COMMON = "common"
#: the folders in plc, which have a page of their own
FOLDERS = "controllers"
ROOMS = ("chain", "log", "heater", "model", "pid", "plc", FOLDERS, "proof", "redesign", "lanes", "monte_carlo",
         "supervision",
         "report",
         "batch", "loops", "zones", "live", COMMON)
#: room → its folder, where that has another name
_FOLDERS = {FOLDERS: "plc", "redesign": "proof/redesign", "lanes": "proof/lanes", "monte_carlo": "proof/monte_carlo"}
#: what is no folder of its own → what it is for
_TOLD = {COMMON: "What all rooms may use: settings, options, units, terms, errors.",
         FOLDERS: "The folder of each controller, and the machines that run what is exported."}
_MARKER = re.compile(r"^<!-- generate: (\w+) -->$", re.MULTILINE)


def commands() -> str:
    """Return the help of every command, as the program prints it on a terminal of 100 columns."""
    os.environ["COLUMNS"] = "100"
    (sub,) = [a for a in parser()._actions if isinstance(a, argparse._SubParsersAction)]
    parts = [f"```text\n{parser().format_help()}```\n"]
    parts += [f"## {name}\n\n```text\n{each.format_help()}```\n" for name, each in sub.choices.items()]
    return "\n".join(parts)


def plant() -> str:
    """Return the notebook on the way to the plant as it is stored, without its first heading."""
    path = SOURCE.parents[1] / "notebooks" / "09_from_file_to_plant.ipynb"
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        for output in cell.get("outputs", ()):
            if "text" in output:
                parts.append(f"```text\n{''.join(output['text']).rstrip()}\n```")
            elif (picture := output["data"].get("image/png")) is not None:
                parts.append(f"![what the cell draws](data:image/png;base64,{''.join(picture).strip()})")
    return "\n\n".join(parts).removeprefix(parts[0].partition("\n")[0])


def gallery() -> str:
    """Return a picture of each notebook as it is stored, the last it draws, with its first heading."""
    shown = []
    for path in sorted(SOURCE.parents[1].joinpath("notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        title = "".join(cells[0]["source"]).partition("\n")[0].removeprefix("# ")
        *_, picture = (output["data"]["image/png"] for cell in cells for output in cell.get("outputs", ())
                       if "image/png" in output.get("data", ()))
        data = "".join(picture).strip()
        shown.append(f'<figure><img src="data:image/png;base64,{data}" alt="{path.name}: its last picture">'
                     f"<figcaption><code>{path.name}</code><br>{title}</figcaption></figure>")
    return f'<div class="gallery">{"".join(shown)}</div>'


def symbols() -> str:
    """Return the table of symbols."""
    return _table(("symbol", "term [unit]", "meaning", "name in the code"), [
        (_anchored(term), f"{', '.join(term.names[1:])} [{term.unit}]", term.meaning, f"`{term.field}`")
        for term in TERMS if term.field])


def words() -> str:
    """Return the table of words."""
    return _table(("term", "meaning"), [(_anchored(term), term.meaning) for term in TERMS if not term.field])


def criteria() -> str:
    """Return the table of criteria, each with the limit that users write."""
    options = {measure.field: name for name, limit in LIMITS.items() for measure in limit.units.values()}
    otherwise = {"band": "`tolerance`", "part": "the time that its part of the test sequence lasts", "": ""}
    rows = []
    for kind in (kind for kind in CRITERIA if not kind.limited_only):
        own = f"`{options[kind.limit]}`" if kind.limit in options else ""
        bound = ", otherwise ".join(filter(None, (own, otherwise[kind.otherwise]))) or "fixed"
        meaning = kind.description.format(band="tolerance", interlock="NAME", limit_degC="LIMIT")
        rows.append((kind.name.replace("_", " "), kind.unit, bound, meaning))
    return _table(("criterion", "unit", "limit", "meaning"), rows)


def conditions() -> str:
    """Return the table of what holds through a run of a proof."""
    return _table(("condition", "values"), [(each.name, each.values) for each in CONDITIONS])


def events() -> str:
    """Return the table of the events of a proof."""
    mains = {"every": "−10 %, nominal, +10 %", "nominal": "nominal"}
    return _table(("event", "state", "sizes", "mains", "runs", "finding"), [
        (each.name, each.state, each.sizes, mains[each.mains], each.runs,
         f"[`{each.finding}`](verdict.md)" if each.finding else "") for each in EVENTS])


def excluded() -> str:
    """Return what of conditions and events a proof does not combine, and what it does not run at all."""
    combined = _table(("event", "under", "not run because"), [
        (each.event, each.condition, each.reason) for each in EXCLUDED])
    return "\n".join([combined, "Not run:\n", *(f"- {each};" for each in NOT_RUN[:-1]), f"- {NOT_RUN[-1]}.\n"])


def _anchored(term: GlossaryTerm) -> str:
    """Return a term's name where a link leads to; words with their other names."""
    names = term.names[:1] if term.field else term.names
    return f'<a id="{term.anchor}"></a>{", ".join(names)}'


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def controllers() -> str:
    """Return which controllers there are, each with its page."""
    return _table(("held by", "controller", "what it is"), [
        (group, f"[{name}](../controllers/{name}.md)", controller_for(name).title)
        for group, names in GROUPS.items() for name in names])


def controller(name: str) -> str:
    """Return what a controller can hold, its words, and its DIFFERENCES.md."""
    each = controller_for(name)
    low, high, step = each.timer.shortest_s, each.timer.longest_s, each.timer.step_s
    words = "\n".join(f"| {f.address} | {f.name} | {f.format} | {f.low:.6g} … {f.high:.6g} | {f.comment} |"
                      for f in each.fields)
    told = "\n".join([*(f"- can: {can}" for can in each.can), *(f"- can't: {cannot}" for cannot in each.cannot)])
    folder = SOURCE.joinpath(*TARGETS[name].split(".")[1:])
    differences = (folder / "DIFFERENCES.md").read_text(encoding="utf-8")
    return (f"{each.title}. TA {low:g} … {high:g} s in steps of {step:g} s.\n\n{told}\n\n"
            f"| address | word | format | range | meaning |\n| --- | --- | --- | --- | --- |\n{words}\n\n"
            f"{differences.partition(chr(10))[2]}\n")


def service(target: str) -> str:
    """Return how a controller is put into service: the text of its folder, as the report has it."""
    told = commissioning(target)
    parts = [f"**{title}**\n\n" + "\n".join(f"{i}. {step}" for i, step in enumerate(items, 1))
             for title, items in told.steps.items()]
    return "\n\n".join([*parts, f"Source: {told.facts}\n"])


def python(room: str) -> str:
    """Return the directives from which mkdocstrings draws a room of the Python reference."""
    within = f"{_folder(room).replace('/', '.')}."
    return "\n".join(f"::: heatertune.{name}\n    options:\n      toc_label: {name.rpartition(within)[2]}\n"
                     for name in modules(room))


def rooms() -> str:
    """Return the list of rooms, each with its page and what it is for."""
    lines = []
    for room in ROOMS:
        told = _TOLD.get(room)
        if told is None:
            text = (SOURCE / _folder(room) / "__init__.py").read_text(encoding="utf-8")
            told = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
        lines.append((f"[{room}](python_{room}.md)", told))
    return _table(("room", "what it is for"), lines)


def _folder(room: str) -> str:
    return _FOLDERS.get(room, room)


def modules(room: str) -> list[str]:
    """Return every module of a room that offers something to others."""
    if room == COMMON:
        return ["settings", "options", "units", "errors"]
    found, folder = [], SOURCE / _folder(room)
    of_room = {"plc": folder.glob("*.py"), FOLDERS: folder.glob("*/**/*.py")}
    apart = {SOURCE / each for each in _FOLDERS.values() if each.startswith(f"{room}/")}
    for path in sorted(of_room.get(room, folder.rglob("*.py"))):
        offers = path.name != "__init__.py" and "__all__" in path.read_text(encoding="utf-8")
        command = path.parent.name == "commands" or path.name == "command.py"  # the page of the commands shows these
        if offers and not command and apart.isdisjoint(path.parents):
            found.append(".".join(path.relative_to(SOURCE).with_suffix("").parts))
    return found


GENERATORS: dict[str, Callable[[], str]] = {
    "commands": commands, "symbols": symbols, "words": words, "controllers": controllers, "criteria": criteria,
    "conditions": conditions, "events": events, "excluded": excluded, "rooms": rooms, "plant": plant,
    "gallery": gallery,
} | {f"service_{name.replace('-', '_')}": partial(service, name) for name in TARGETS
} | {f"controller_{name.replace('-', '_')}": partial(controller, name) for name in TARGETS
} | {f"python_{room}": partial(python, room) for room in ROOMS}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill the markers of a page."""
    return _MARKER.sub(lambda found: GENERATORS[found[1]](), markdown)


def on_post_build(config: Any, **_: Any) -> None:
    """Write the index of the search as a script: a browser that opens the manual from files reads no JSON."""
    folder = Path(config["site_dir"], "search")
    index = json.loads((folder / "search_index.json").read_text(encoding="utf-8"))["docs"]
    page = "reference/nomenclature.html"
    terms = [{"title": ", ".join(term.names), "text": term.meaning, "location": f"{page}#{term.anchor}"}
             for term in TERMS]
    sections = [entry for entry in index if "#" in entry["location"]]  # the others are whole pages: the same once more
    text = json.dumps([*terms, *sections], ensure_ascii=False, separators=(",", ":"))
    (folder / "index.js").write_text(f"var searched = {text};\n", encoding="utf-8")
    (folder / "search_index.json").unlink()

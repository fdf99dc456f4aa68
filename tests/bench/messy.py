"""What becomes of the exports of many tools, clean, messy and hostile: read and fitted right, a question, or wrong.

    python -m tests.bench.messy [--tool NAME] [--level clean|messy|hostile] [--draw N] [--verbose]

Each file of `tool_exports` goes through the command line. What a message asks for is typed: literally, if the message gives
the value, otherwise with what the user of this heater knows.

"Right at once" has two meanings, and the table counts both. In the narrow one, the first command gives the heater and leaves
nothing to state. In the wide one, it gives the heater, and the only thing left is that the verdict stays NOT PROVEN until a
unit is confirmed that the file does not hold, as it must: the readings are right, and the user types one option. An export
that is refused or read into other units at first is right at once in neither.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import shlex
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from heatertune.cli import main
from tests.bench.tool_exports import LEVELS, Export, exports, redraw

RIGHT, REMEDY, STUCK, WRONG, ACCUSED = "right at once", "after its remedy", "refused, no way on", "WRONG HEATER", "FALSE ACCUSATION"
CLASSES = (RIGHT, REMEDY, STUCK, WRONG, ACCUSED)
#: among the messages on the way: the first command gave the heater, and asked to confirm a unit
CONFIRMED = "the heater is right, its units are to be confirmed"
_TURNS = 6
_WITHIN = 0.1  # of the truth
_ACCUSES = re.compile(r"cooler|another (zone|heater)|not the heater|element (is|was) (open|broken)|probe")
_FLAG = re.compile(r"(--[a-z][a-z-]+)(?: +(?![a-z]* ?(?:and|or|with|of|in|leaves|reads|counts|to)\b)(\"[^\"]*\"|'[^']*'|[^\s;,)(]+))?")
_SWITCHES = ("--skip-empty", "--cooler")
#: what a file holds that names the unit which an option states: where one stands there, the question was not needed
_MARKS = {
    "--power-full-scale": re.compile(r"%|pct|percent|prozent", re.IGNORECASE),
    "--power-levels": re.compile(r"%|\bmA\b|\bV\b"),
    "--temperature-unit": re.compile(r"°|℃|℉|deg|celsius|fahrenheit|kelvin|[\[(_ /][CFK]\b", re.IGNORECASE),
    "--time-unit": re.compile(r"[\[(_ /](s|ms|sec|seconds|min|h|d)\b", re.IGNORECASE),
}


def command(words: Sequence[str]) -> tuple[int, str, str]:
    """Run a command line in this process: its exit status and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(list(words))
        except SystemExit as ended:
            status = int(ended.code or 0)
    return int(status or 0), out.getvalue(), err.getvalue()


def is_right(model: dict[str, Any], export: Export) -> bool | None:
    """Return whether a model is the heater within 10 % or holds it in its intervals, None if it leaves the heater open.

    A dead time may be a row off.
    """
    holds: list[bool | None] = []
    for name, true, slack in (("gain_degC_per_pct", export.heater.gain, 0.0), ("time_constant_s", export.heater.time_constant_s, 0.0),
                              ("dead_time_s", export.heater.dead_time_s, model["log_interval_s"])):
        low, high = model[f"{name}_ci95"] or (None, None)
        near = model[name] is not None and abs(model[name] - true) <= max(_WITHIN * abs(true), slack)
        holds.append(True if near else None if None in (low, high) else low <= true <= high)
    return False if False in holds else None if None in holds else True


def asked_for(message: str, export: Export, stated: Sequence[str]) -> list[str]:
    """Return what a reader of the message types next: the first option it names whose value is known, and those behind an "and"."""
    words: list[str] = []
    for found in _FLAG.finditer(message):
        flag, value = found.groups()
        if flag in stated or flag in words or (words and not message[:found.start()].endswith("and ")):
            continue
        if flag in export.user:
            words += [flag, *_words(flag, export.user[flag])]
        elif flag in _SWITCHES:
            words += [flag]
        elif value and not value.isupper() and "NAME" not in value and value != "with":
            words += [flag, value.strip("\"'.")]
    return words


def _words(flag: str, value: str) -> list[str]:
    """Return the words of an option's value: two of a pair of numbers."""
    return value.split() if flag == "--power-levels" else [value]


def _units(question: str, said: str, export: Export, options: Sequence[str]) -> list[str]:
    """Return the options that state the units which are asked for."""
    named = _FLAG.findall(question)
    if "--power-levels" in export.user and "--power-levels" in said:  # the other way to read a power below 0
        named = [("--power-levels", "")]
    return [word for flag, value in named if flag not in options for word in (flag, *_words(flag, export.user.get(flag, value)))]


def judge(export: Export, folder: Path) -> tuple[str, list[str]]:
    """Return what became of an export, and the messages on the way."""
    path, written = folder / export.name, folder / "model.json"
    path.write_bytes(export.content)
    options: list[str] = []
    said: list[str] = []
    for turn in range(_TURNS):
        written.unlink(missing_ok=True)
        status, out, err = command(["fit", str(path), *options, "-o", str(written)])
        said.append(f"fit {' '.join(map(shlex.quote, options))} -> {status}: " + " | ".join(err.strip().splitlines()[:4]))
        accusation = _ACCUSES.search(f"{out} {err}" if status else out)
        if accusation and not (export.true_fault and re.search(export.true_fault, out + err)):
            return ACCUSED, [*said, out[:1500]]
        if status:
            message = next((line for line in err.splitlines() if line.startswith("error")), err)
            more = asked_for(message, export, options)
            if not more:
                return STUCK, said
            options += more
            continue
        model = json.loads(written.read_text(encoding="utf-8"))
        findings = {finding["name"] for finding in model["findings"]}
        question = next((line for line in err.splitlines() if "check and state them" in line), "")
        if "unit-assumed" in findings and question:
            more = _units(question, err, export, options)
            if more:
                said += [CONFIRMED] * (not turn and is_right(model, export) is True)
                options += more
                continue
        right = is_right(model, export)
        if right:
            return (REMEDY if turn else RIGHT), said
        if right is None and export.true_fault in findings:
            return RIGHT, said  # it says what is missing: the power, readings in time
        shown = {name: (model[name], model[f"{name}_ci95"]) for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s")}
        if "unit-assumed" in findings and turn + 1 < _TURNS and (more := asked_for(question, export, options)):
            options += more
            continue
        return STUCK if right is None else WRONG, [*said, f"{shown} for {export.heater}; {sorted(findings)}"]
    return STUCK, said


def has_open_units(export: Export, said: Sequence[str]) -> bool:
    """Return whether an export was asked for a unit of which its file holds no mark."""
    content = "".join(export.content.decode(code, "ignore") for code in ("utf-8", "utf-16", "cp1252"))
    return any(f"{flag} " in line.partition(" -> ")[0] and not mark.search(content) for line in said for flag, mark in _MARKS.items())


def judged(tool: str | None = None, level: str | None = None) -> list[tuple[Export, str, list[str]]]:
    """Judge the exports, of one tool or level if it is named."""
    with tempfile.TemporaryDirectory() as folder:
        return [(export, *judge(export, Path(folder))) for export in exports(tool, level)]


def printed(results: Sequence[tuple[Export, str, list[str]]], *, verbose: bool = False) -> str:
    """Return the table: a row for each tool, then the sums."""
    of_tool: dict[str, dict[str, str]] = {}
    for export, outcome, _ in results:
        of_tool.setdefault(export.tool, {})[export.level] = outcome
    lines = ["| tool | clean | messy | hostile |", "| --- | --- | --- | --- |"]
    lines += [f"| {tool} | {' | '.join(of_level.get(level, '') for level in LEVELS)} |" for tool, of_level in of_tool.items()]
    counts = Counter(outcome for _, outcome, _ in results)
    lines += ["", f"{len(results)} exports: " + ", ".join(f"{counts[outcome]} {outcome}" for outcome in CLASSES)]
    confirmed = sum(outcome == REMEDY and CONFIRMED in said for _, outcome, said in results)
    at_once, total = counts[RIGHT], max(len(results), 1)
    lines += [f"right at once with nothing to state: {100.0 * at_once / total:.1f} %; with units to confirm by a command that is shown "
              f"({confirmed} more): {100.0 * (at_once + confirmed) / total:.1f} %"]
    named = [(export.level, outcome) for export, outcome, said in results if not has_open_units(export, said)]
    right = Counter(level for level, outcome in named if outcome == RIGHT)
    shares = ", ".join(f"{level} {right[level]} of {sum(each == level for each, _ in named)}" for level in LEVELS)
    lines += [f"units named in the file or shown by it: {100.0 * right.total() / max(len(named), 1):.1f} % {RIGHT} ({shares})"]
    if verbose:
        lines += [f"\n{export.tool}, {export.level}: {outcome}\n  " + "\n  ".join(said) for export, outcome, said in results if outcome != RIGHT]
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tool")
    parser.add_argument("--level", choices=LEVELS)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--draw", type=int, default=0, help="other heaters and other noise (default: 0, as the tests have them)")
    chosen = parser.parse_args()
    redraw(chosen.draw)
    results = judged(chosen.tool, chosen.level)
    print(printed(results, verbose=chosen.verbose))
    sys.exit(any(outcome in (WRONG, ACCUSED) for _, outcome, _ in results))

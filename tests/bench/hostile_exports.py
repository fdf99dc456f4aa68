"""Hostile exports of one known heater, which no tool writes on purpose: is any read into another heater?

    python -m tests.bench.hostile_exports [--only NAME] [--verbose] [--draw N] [--devices | --field | --terminals | --programs | --services | --tools] [--sheet]

--devices: those of `hostile_devices` alone; --field: those of `field_exports`; --terminals: those of
`terminal_exports`; --programs: those of `program_exports`; --tools: those of `tool_exports`, which
`messy` judges. --sheet: through the studio's sheet for a dropped file in place of the command line.

Each goes through `messy.judge`: a message is followed by what the user of this heater knows. A wrong heater, an
accusation that is false and a traceback are failures; a refusal without a way on is counted and shown.
"""

from __future__ import annotations

import argparse
import importlib
import json
import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from heatertune.errors import HeatertuneError
from heatertune.model.model_document import to_document
from heatertune.options import options_of
from heatertune.settings import ReadSettings
from heatertune.studio.session import fit_log
from heatertune.studio.sheet_card import DroppedFile, sheet
from heatertune.studio.wording import for_page
from tests.bench import tool_exports
from tests.bench.messy import (
    _TURNS,
    ACCUSED,
    CLASSES,
    REMEDY,
    RIGHT,
    STUCK,
    WRONG,
    _units,
    asked_for,
    is_right,
    judge,
)
from tests.bench.tool_exports import START, Export, Run, comma, iso, point, redraw, steps, table, text

WRITERS: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = []
OPEN = "blocked by a finding"
HEAD = ("time [s]", "Temp [°C]", "Heater [%]")


def hostile(
    name: str, into: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = WRITERS,
) -> Callable[[Callable[[Run], tuple[Any, ...]]], Callable[[Run], tuple[Any, ...]]]:
    """Add a writer: it returns content, and optionally what the user knows and a true accusation."""
    def add(writer: Callable[[Run], tuple[Any, ...]]) -> Callable[[Run], tuple[Any, ...]]:
        into.append((name, writer))
        return writer
    return add


def exports(only: str | None = None, writers: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = WRITERS) -> Iterator[Export]:
    """Make the exports, or one of them."""
    for name, writer in writers:
        if only in (None, name):
            content, *more = writer(steps(tool_exports.OVEN))
            content = content if isinstance(content, bytes) else content.encode()
            yield Export(name, "hostile", "log.csv", content, tool_exports.OVEN, *more)


def outcome_of(export: Export, folder: Path) -> tuple[str, list[str]]:
    """Return what became of an export, and the messages on the way."""
    outcome, said = judge(export, folder)
    if outcome == WRONG and ("unit-assumed" in said[-1] or re.search(export.true_fault or "^$", said[-1])):
        return OPEN, said  # a finding blocks the verdict, and its message says what to do
    return outcome, said


def plain(run: Run, header: tuple[str, ...] = HEAD, **options: Any) -> list[list[str]]:
    return table(run, header, options.pop("when", point), **options)


@hostile("two clocks")
def _(run):
    rows = [[iso(s), iso(s + 7213.0 + 0.001 * s), point(d), f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["PLC time", "PC time", "Temp [°C]", "Heater [%]"], *rows]), {"--time-column": "PLC time"}


@hostile("summer time begins")
def _(run):
    begin = datetime(2026, 3, 29, 1, 50)
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{begin + timedelta(seconds=s + (3600 if s >= 600 else 0)):%Y-%m-%d %H:%M:%S}")), {}


@hostile("summer time ends")
def _(run):
    begin = datetime(2026, 10, 25, 2, 50)
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{begin + timedelta(seconds=s - (3600 if s >= 600 else 0)):%Y-%m-%d %H:%M:%S}")), {}


@hostile("a mark for each column")
def _(run):
    return text(plain(run, number=comma, power=lambda p: f"{p:.2f}"), ";"), {}


@hostile("a mark for each half")
def _(run):
    cells = plain(run)
    return text([*cells[:300], *([a, b.replace(".", ","), c] for a, b, c in cells[300:])], ";"), {}


@hostile("kelvin from the middle on")
def _(run):
    cells = plain(run)
    for row in cells[401:]:
        row[1] = point(float(row[1]) + 273.15)
    return text(cells), {"--until": "798"}, "another unit|jump"


@hostile("columns swapped after a restart")
def _(run):
    cells = plain(run)
    return text([*cells[:401], [HEAD[0], HEAD[2], HEAD[1]], *([a, c, b] for a, b, c in cells[401:])]), {"--until": "798"}, "jump|another"


@hostile("columns swapped after a restart, not said")
def _(run):
    cells = plain(run)
    return text([*cells[:401], *([a, c, b] for a, b, c in cells[401:])]), {"--until": "798"}, "jump|another|second|probe|answer"


@hostile("degrees Fahrenheit under °C")
def _(run):
    return text(plain(run.map(lambda d: 1.8 * d + 32))), {"--temperature-unit": "degF"}


@hostile("kelvin under °C")
def _(run):
    return text(plain(run.map(lambda d: d + 273.15))), {"--temperature-unit": "K"}


@hostile("degrees Celsius under K")
def _(run):
    return text(plain(run, ("time [s]", "T [K]", "Heater [%]"))), {"--temperature-unit": "degC"}


@hostile("duty of a limited output")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "duty"), power=lambda p: f"{p / 100:.3f}")), {"--power-full-scale": "1"}


@hostile("UTF-16 with NUL bytes")
def _(run):
    lines = text(plain(run)).splitlines()
    lines[200] = "\0" * 20
    return ("\ufeff" + "\r\n".join(lines)).encode("utf-16-le"), {}


@hostile("UTF-16 without a mark")
def _(run):
    return text(plain(run)).encode("utf-16-be"), {}


@hostile("separator in the first line")
def _(run):
    return ("\ufeffsep=;\r\n" + text(plain(run, number=comma, power=comma), ";", end="\r\n")).encode(), {}


@hostile("12 hours without a.m. and p.m.")
def _(run):
    begin = datetime(2026, 3, 14, 12, 50)
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{begin + timedelta(seconds=s):%Y-%m-%d %I:%M:%S}")), {}


@hostile("a.m. and p.m. in small letters with points")
def _(run):
    begin = datetime(2026, 3, 14, 11, 50)
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{begin + timedelta(seconds=s):%Y-%m-%d %I:%M:%S %p}".replace("AM", "a.m.").replace("PM", "p.m."))), {}


@hostile("one heading for two temperatures")
def _(run):
    rows = [[point(s), point(22.0 + 0.01 * (k % 7)), point(d), f"{p:g}"] for k, (s, d, p, _) in enumerate(run.rows)]
    return text([["time [s]", "Temp [°C]", "Temp [°C]", "Heater [%]"], *rows]), {"--temperature-column": "3"}


@hostile("one heading for two powers")
def _(run):
    rows = [[point(s), point(d), f"{min(1.4 * p, 100):g}", f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["time [s]", "Temp [°C]", "Heater [%]", "Heater [%]"], *rows]), {"--power-column": "4"}


@hostile("seconds since 1970 as powers of ten")
def _(run):
    return text(plain(run, ("time", *HEAD[1:]), when=lambda s: f"{1773482280 + s:.5E}")), {"--log-interval": "2"}


@hostile("days of a spreadsheet with commas")
def _(run):
    return text(plain(run, ("Zeit", *HEAD[1:]), when=lambda s: comma(46095.4 + s / 86400, 8), number=comma, power=comma), ";"), {"--time-unit": "d"}


@hostile("a time zone that changes")
def _(run):
    def when(second):
        moment = datetime(2026, 3, 29, 1, 50) + timedelta(seconds=second)
        return moment.isoformat() + "+01:00" if second < 600 else (moment + timedelta(hours=1)).isoformat() + "+02:00"
    return text(plain(run, ("Time", *HEAD[1:]), when=when)), {}


@hostile("spaces that do not break")
def _(run):
    return text(plain(run, number=lambda d: f"\u00a0{d:.1f}\u00a0", power=lambda p: f"\u202f{p:g} ")), {}


@hostile("power in watts, full power in a comment")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "Power [W]"), power=lambda p: f"{12 * p:g}"), above=("# heater 1200 W",)), {"--power-full-scale": "1200"}


@hostile("power in kilowatts")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "P [kW]"), power=lambda p: f"{0.012 * p:.3f}")), {"--power-full-scale": "1.2", "--power-column": "3"}


@hostile("energy and no power")
def _(run):
    energy, rows = 0.0, []
    for s, d, p, _ in run.rows:
        rows.append([point(s), point(d), f"{energy:.5f}"])
        energy += 1.2 * p / 100 * 2 / 3600
    return text([["time [s]", "Temp [°C]", "Energy [kWh]"], *rows]), {"--power-column": "none"}, "no-power|not-regulated"


@hostile("slow PWM as 0 and 1")
def _(run):
    rows = [[point(s), point(d), str(int((s % 20) < 0.2 * p))] for s, d, p, _ in run.rows]
    return text([["time [s]", "Temp [°C]", "Relay"], *rows]), {}


@hostile("units in the cells of some rows")
def _(run):
    cells = plain(run, ("Time", "Temp", "Heater"), when=iso)
    return text([[a, f"{b} °C" if k % 2 else b, f"{c} %" if k % 3 else c] if k else [a, b, c] for k, (a, b, c) in enumerate(cells)]), {
        "--temperature-unit": "degC", "--power-full-scale": "100"}


@hostile("separators inside quotes")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f'"{(START + timedelta(seconds=s)):%d.%m.%Y, %H:%M:%S}"', number=lambda d: f'"{comma(d)}"')), {}


@hostile("months in German")
def _(run):
    return text(plain(run, ("Zeit", *HEAD[1:]), when=lambda s: f"{(START + timedelta(seconds=s)):%d}. März 2026 {(START + timedelta(seconds=s)):%H:%M:%S}"), ";"), {"--log-interval": "2"}


@hostile("100 is off")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "Output [%]"), power=lambda p: f"{100 - p:g}")), {"--power-levels": "100 0"}, "cooler|answer|wrong way"


@hostile("two channels in turns")
def _(run):
    rows = [row for k, (s, d, p, _) in enumerate(run.rows) for row in (
        [iso(s), "1", point(d), f"{p:g}"], [iso(s), "2", point(31.0 + 0.1 * (k % 5)), "15"])]
    return text([["Time", "Channel", "Temp [°C]", "Heater [%]"], *rows]), {"--tag": "1", "--tag-column": "Channel"}


@hostile("rows in no order")
def _(run):
    head, *rows = plain(run, ("Time", *HEAD[1:]), when=iso)
    random.Random(5).shuffle(rows)
    return text([head, *rows]), {}


@hostile("loaded twice")
def _(run):
    cells = plain(run, ("Time", *HEAD[1:]), when=iso)
    return text([*cells, *cells]), {}


@hostile("16-bit seconds that overflow")
def _(run):
    return text(plain(run, when=lambda s: str(int(65000 + s) % 65536))), {"--run": "2", "--log-interval": "2"}


@hostile("milliseconds without a unit")
def _(run):
    return text(plain(run, ("t", *HEAD[1:]), when=lambda s: str(int(1000 * s)))), {"--time-unit": "ms"}


@hostile("counts of a converter")
def _(run):
    return text(plain(run, ("time [s]", "PV [counts]", "Heater [%]"), number=lambda d: str(round(4000 + 37.5 * d)))), {}


@hostile("set and actual")
def _(run):
    rows = [[point(s), "55.0", point(d), f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["time [s]", "Temp Set [°C]", "Temp Act [°C]", "Heater [%]"], *rows]), {}


@hostile("tenths in whole numbers")
def _(run):
    return text(plain(run, ("time [s]", "Temp (0.1 C)", "Heater [%]"), number=lambda d: str(round(10 * d)))), {"--temperature-unit": "0.1degC"}


@hostile("two tables, two headers")
def _(run):
    cells = plain(run)
    other = [["alarm", "text", "count"], *([f"A{k}", "door", str(k)] for k in range(30))]
    return text([*cells, [""], *other]), {}


@hostile("power as written when it changes")
def _(run):
    rows, last = [], None
    for s, d, p, _ in run.rows:
        rows.append([point(s), point(d), f"{p:g}" if p != last else ""])
        last = p
    return text([list(HEAD), *rows]), {}


@hostile("0 below zero")
def _(run):
    return text(plain(run, power=lambda p: f"{p:.1f}" if p else "-0.0")), {}


@hostile("°F and °C side by side")
def _(run):
    rows = [[point(s), point(1.8 * d + 32), point(d), f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["time [s]", "Temp F", "Temp C", "Heater [%]"], *rows]), {}


@hostile("live zero that is limited")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "Output [mA]"), power=lambda p: f"{4 + 0.16 * p:.2f}")), {"--power-levels": "4 20"}


@hostile("names of R without a time")
def _(run):
    # one name too few, but the first column is the time: the last one has no name
    rows = [[f"{k}", point(d), f"{p:g}", "0"] for k, (_, d, p, _) in enumerate(steps(tool_exports.OVEN, every=1).rows)]
    return text([["time", "Temp [°C]", "Heater [%]"], *rows]), {"--skip-rows": "1", "--time-column": "1", "--temperature-column": "2", "--power-column": "3",
                                                           "--time-unit": "s", "--temperature-unit": "degC", "--power-full-scale": "100"}


@hostile("names of R")
def _(run):
    return text([list(HEAD), *([str(k + 1), *row] for k, row in enumerate(plain(run)[1:]))]), {}


@hostile("an oven that is a humidity")
def _(run):
    # the temperature stands under a name that says nothing, next to "Oven", which is the humidity
    rows = [[point(s), point(45.0 - 0.4 * (d - 20.0) + 0.1 * (k % 3)), point(d), f"{p:g}"] for k, (s, d, p, _) in enumerate(run.rows)]
    return text([["time [s]", "Oven", "CH2", "Heater [%]"], *rows]), {"--temperature-column": "CH2", "--temperature-unit": "degC"}


@hostile("an element of another heater")
def _(run):
    rows = [[point(s), point(d), str(k // 50 % 2 * 30), f"{p:g}"] for k, (s, d, p, _) in enumerate(run.rows)]
    return text([["time [s]", "Temp [°C]", "Element 2", "OUT [%]"], *rows]), {"--power-column": "OUT [%]"}


@hostile("stamps of the last change")
def _(run):
    rows = [[iso(s), iso(int(s / 60) * 60), point(d), f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["Time", "Last changed", "Temp [°C]", "Heater [%]"], *rows]), {"--time-column": "Time"}


@hostile("dates that turn")
def _(run):
    begin = datetime(2026, 3, 11, 23, 50)
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{begin + timedelta(seconds=s):%m/%d/%Y %I:%M:%S %p}")), {"--log-interval": "2"}


@hostile("thousands points and decimal commas")
def _(run):
    def grouped(value: float) -> str:
        return f"{value:,.1f}".translate(str.maketrans(",.", ".,"))

    rows = [[f"{int(1000 * s):,}".replace(",", "."), grouped(d), grouped(p)] for s, d, p, _ in run.rows]
    return text([["Zeit [ms]", "Temp [°C]", "Heizung [%]"], *rows], ";"), {}


@hostile("half in a code page, half in UTF-8")
def _(run):
    lines = text(plain(run, ("Zeit [s]", "Temperatur [°C]", "Heizung [%]"))).split("\n")
    return "\n".join(lines[:300]).encode("cp1252") + "\n\ufeff".encode() + "\n".join(lines[300:]).encode(), {}


@hostile("tenths in a row of units")
def _(run):
    rows = [[point(s), f"{10 * d:.0f}", f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["Time", "PV", "OUT"], ["s", "0.1 °C", "%"], ["double"] * 3, *rows]), {"--temperature-unit": "0.1degC"}


@hostile("weeks of ISO 8601")
def _(run):
    def week(second: float) -> str:
        at = START + timedelta(seconds=second)
        year, number, day = at.isocalendar()
        return f"{year}-W{number:02d}-{day}T{at:%H:%M:%S}"

    return text(plain(run, ("Time", *HEAD[1:]), when=week)), {"--log-interval": "2"}


@hostile("midnight in Spanish")
def _(run):
    def clock(second: float) -> str:
        at = datetime(2026, 3, 5, 23, 50) + timedelta(seconds=second)
        return f"{at:%I:%M:%S} {'a. m.' if at.hour < 12 else 'p. m.'}"

    return text(plain(run, ("Hora", "Temperatura [°C]", "Calefactor [%]"), when=clock)), {"--log-interval": "2"}


@hostile("a code of the converter for a while")
def _(run):
    cells = plain(run)
    for row in cells[251:271]:
        row[1] = "3276.7"
    return text(cells), {}


@hostile("20 mA is off")
def _(run):
    rows = [[point(s), point(d), f"{20.0 - 0.16 * p:.2f}"] for s, d, p, _ in run.rows]
    return text([["time [s]", "Temp [°C]", "Output [mA]"], *rows]), {"--power-levels": "20 4"}


@hostile("corrected rows at the end")
def _(run):
    cells = plain(run)
    bad = [[a, "0.0", c] if 200 <= k < 240 else [a, b, c] for k, (a, b, c) in enumerate(cells[1:])]
    return text([cells[0], *bad, *cells[201:241]]), {}


def outcome_on_sheet(export: Export) -> tuple[str, list[str]]:
    """Return what became of an export that is dropped on the studio's page, and the messages on the way.

    What a message asks for is chosen on the sheet as its answer, or typed into the field of that option.
    """
    flags = {option.flag: option for option in options_of(ReadSettings).values()}
    dropped, typed, said = DroppedFile.of(export.name, export.content), [""], list[str]()
    for turn in range(_TURNS):
        shown = sheet(dropped) + for_page(dropped.problem)
        assumed = " ".join(dropped.log.taken.assumed.values()) if dropped.log and dropped.log.taken else ""
        said.append(dropped.problem or assumed or "read")
        if "Traceback" in shown:
            return WRONG, said
        question = dropped.problem or assumed
        if not question:
            log, known = dropped.to_log()
            try:
                fitted = fit_log(log, settings=known)
                model = json.loads(json.dumps(to_document(fitted)))
            except HeatertuneError as problem:
                question = str(problem)
            else:
                right = is_right(model, export)
                findings = " ".join(finding["name"] for finding in model["findings"])
                said.append(f"{model['gain_degC_per_pct']} {model['time_constant_s']} {model['dead_time_s']} {findings}")
                blocked = any(finding.kind.effect == "blocks" for finding in fitted.findings)
                is_told = right is None and export.true_fault in findings.split()
                return (REMEDY if turn else RIGHT) if right or is_told else OPEN if blocked or right is None else WRONG, said
            said.append(question)
        words = asked_for(question, export, typed)
        if question == assumed:  # the sheet shows the reader's notes beside what it assumed
            words = _units(question, " ".join(dropped.log.repairs), export, typed) or words
        if not words:
            return STUCK, said
        typed += words
        if words[0] in ("--until", "--from"):
            dropped = dropped.assume(**{f"{words[0][2:]}_s": float(words[1])})
            continue
        begins = [k for k, word in enumerate(words) if word in flags]
        for begin, end in zip(begins, [*begins[1:], len(words)], strict=True):
            option = flags[words[begin]]
            values = tuple(map(option.kind, words[begin + 1:end]))
            dropped = dropped.read(**{option.name: True if option.kind is bool else values if option.pair else values[0]})
    return STUCK, said


def main(arguments: list[str] | None = None) -> int:
    """Print what became of each export; return 1 if one was read into another heater, accused falsely or crashed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only")
    parser.add_argument("--draw", type=int, default=0)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--devices", action="store_true")
    parser.add_argument("--field", action="store_true")
    parser.add_argument("--terminals", action="store_true")
    parser.add_argument("--programs", action="store_true")
    parser.add_argument("--services", action="store_true")
    parser.add_argument("--tools", action="store_true")
    parser.add_argument("--sheet", action="store_true")
    asked = parser.parse_args(arguments)
    redraw(asked.draw)
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        module = "hostile_devices" if asked.devices else "field_exports" if asked.field else (
            "terminal_exports" if asked.terminals else "program_exports" if asked.programs else
            "service_exports" if asked.services else "hostile_exports")
        writers = importlib.import_module(f"tests.bench.{module}").WRITERS
        for export in tool_exports.exports(asked.only, None) if asked.tools else exports(asked.only, writers):
            outcome, said = outcome_on_sheet(export) if asked.sheet else outcome_of(export, Path(folder))
            counts[outcome] += 1
            print(f"{export.tool}, {export.level}: {outcome}", flush=True)
            if asked.verbose or outcome in (WRONG, ACCUSED, STUCK):
                print("  " + "\n  ".join(said))
    print(f"{counts.total()} exports: " + ", ".join(f"{counts[outcome]} {outcome}" for outcome in (*CLASSES, OPEN)))
    return int(bool(counts[WRONG] + counts[ACCUSED]))


if __name__ == "__main__":
    sys.exit(main())

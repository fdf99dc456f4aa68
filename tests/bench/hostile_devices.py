"""Exports as devices write them in earnest: clocks, digits, codes and updates that no format describes.

    python -m tests.bench.hostile_exports --devices [--only NAME] [--verbose] [--draw N]

As `hostile_exports`: the heater is known, and none may be read into another or accused falsely.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial
from typing import Any

from tests.bench import tool_exports
from tests.bench.hostile_exports import HEAD, plain
from tests.bench.hostile_exports import hostile as _hostile
from tests.bench.tool_exports import START, Run, comma, iso, point, stamped, steps, text

WRITERS: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = []
hostile = partial(_hostile, into=WRITERS)
EPOCH = 1773482280


def digits(zero: str, mark: str) -> dict[int, str]:
    """Return a translation of ASCII digits and the decimal point."""
    return str.maketrans("0123456789.", "".join(chr(ord(zero) + k) for k in range(10)) + mark)


@hostile("Arabic digits")
def _(run):
    rows = [row[:1] + [cell.translate(digits("٠", "٫")) for cell in row[1:]] for row in plain(run)[1:]]
    return text([list(HEAD), *([row[0].translate(digits("٠", "٫")), *row[1:]] for row in rows)], ";"), {}


@hostile("Persian digits under English names")
def _(run):
    return text([list(HEAD), *([cell.translate(digits("۰", ".")) for cell in row] for row in plain(run)[1:])]), {}


@hostile("digits of full width")
def _(run):
    return text([list(HEAD), *([cell.translate(digits("０", "．")) for cell in row] for row in plain(run)[1:])]), {}


@hostile("days since 1904")
def _(run):
    return text(plain(run, ("Date", *HEAD[1:]), when=lambda s: f"{44633.4 + s / 86400:.8f}")), {"--time-unit": "d"}


@hostile("microseconds since 1970")
def _(run):
    return text(plain(run, ("timestamp", *HEAD[1:]), when=lambda s: str(int((EPOCH + s) * 1e6)))), {"--time-unit": "us"}


@hostile("nanoseconds since 1970")
def _(run):
    return text(plain(run, ("timestamp", *HEAD[1:]), when=lambda s: f"{EPOCH + int(s)}000000000")), {"--time-unit": "ns"}


@hostile("milliseconds since 1970 with a point for thousands")
def _(run):
    return text(plain(run, ("Zeitstempel", *HEAD[1:]), when=lambda s: f"{(EPOCH + int(s)) * 1000:,}".replace(",", "."), number=comma, power=comma), ";"), {
        "--time-unit": "ms"}


@hostile("100 ns since 1601")
def _(run):
    return text(plain(run, ("FILETIME", *HEAD[1:]), when=lambda s: str((EPOCH + int(s) + 11644473600) * 10**7))), {"--log-interval": "2"}


@hostile("hhmmss as a whole number")
def _(run):
    return text(plain(run, ("TIME", *HEAD[1:]), when=stamped("%H%M%S"))), {"--log-interval": "2"}


@hostile("date and time as one whole number")
def _(run):
    return text(plain(run, ("TIME", *HEAD[1:]), when=stamped("%Y%m%d%H%M%S"))), {"--log-interval": "2"}


@hostile("day of the year")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=stamped("%Y-%j %H:%M:%S"))), {"--log-interval": "2"}


@hostile("what date(1) prints")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=stamped("%a %b %d %H:%M:%S CET %Y"))), {"--log-interval": "2"}


@hostile("a clock without a date over midnight")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{datetime(2026, 3, 14, 23, 51) + timedelta(seconds=s):%H:%M:%S}")), {}


@hostile("minutes alone")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=stamped("%Y-%m-%d %H:%M"))), {"--log-interval": "2"}


@hostile("1970 until the clock is set")
def _(run):
    def when(second: float) -> str:
        return f"{datetime(1970, 1, 1) + timedelta(seconds=second + 7):%Y-%m-%d %H:%M:%S}" if second < 40 else iso(second)
    return text(plain(run, ("Time", *HEAD[1:]), when=when)), {"--run": "2"}


@hostile("the clock is put back by 37 s")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: iso(s if s < 500 else s - 37))), {"--log-interval": "2"}


@hostile("millis() overflows")
def _(run):
    return text(plain(run, ("millis", *HEAD[1:]), when=lambda s: str(int(4294967296 - 400000 + 1000 * s) % 4294967296))), {"--log-interval": "2", "--run": "2"}


@hostile("a ring of rows that is not unrolled")
def _(run):
    cells = plain(run)
    return text([cells[0], *cells[401:], *cells[1:401]]), {}


@hostile("a ring of rows with dates")
def _(run):
    cells = plain(run, ("Time", *HEAD[1:]), when=iso)
    return text([cells[0], *cells[401:], *cells[1:401]]), {}


@hostile("newest row first")
def _(run):
    cells = plain(run, ("Time", *HEAD[1:]), when=iso)
    return text([cells[0], *reversed(cells[1:])]), {}


@hostile("each row three times")
def _(run):
    rows = [row for s, d, p, _ in run.rows for row in [[iso(s), point(d), f"{p:g}"]] * 3]
    return text([["Time", *HEAD[1:]], *rows]), {}


@hostile("a device that slept")
def _(run):
    cells = plain(run, ("Time", *HEAD[1:]), when=iso)
    return text([*cells[:501], *cells[590:]]), {}


@hostile("another order of the date after an update")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: (START + timedelta(seconds=s)).strftime("%d/%m/%Y %H:%M:%S" if s < 500 else "%Y-%m-%d %H:%M:%S"))), {
        "--until": "498", "--log-interval": "2"}


@hostile("a column more after an update, with a new header")
def _(run):
    cells = plain(run)
    return text([*cells[:401], [HEAD[0], "RH [%]", *HEAD[1:]], *([a, f"{40 + k % 3}", b, c] for k, (a, b, c) in enumerate(cells[401:]))]), {}


@hostile("a column more after an update, not said")
def _(run):
    cells = plain(run)
    return text([*cells[:401], *([a, f"{40 + k % 3}", b, c] for k, (a, b, c) in enumerate(cells[401:]))]), {}


@hostile("°F until an update")
def _(run):
    cells = plain(run)
    for row in cells[1:401]:
        row[1] = point(1.8 * float(row[1]) + 32)
    return text(cells), {"--until": "798", "--temperature-unit": "degF"}, "jump|another|unexplained-by-power"


@hostile("rows of two heaters in turns, not said")
def _(run):
    rows = [row for k, (s, d, p, _) in enumerate(run.rows) for row in ([iso(s), point(d), f"{p:g}"], [iso(s), point(31.0 + 0.1 * (k % 5)), "15"])]
    return text([["Time", *HEAD[1:]], *rows]), {}, "jump|another|second|probe|answer"


@hostile("units again every 50 rows")
def _(run):
    cells = plain(run, ("Time", "Temp", "Heater"), when=iso)
    rows = [row for k, row in enumerate(cells[1:]) for row in ([["[-]", "[°C]", "[%]"]] if k % 50 == 0 else []) + [row]]
    return text([cells[0], *rows]), {"--temperature-unit": "degC", "--power-full-scale": "100"}


@hostile("pages with heads and numbers")
def _(run):
    cells = plain(run, ("Time", *HEAD[1:]), when=iso)
    rows = [row for k, row in enumerate(cells[1:]) for row in ([[f"Page {k // 60 + 1}"], cells[0]] if k % 60 == 0 else []) + [row]]
    return text(rows), {}


@hostile("statistics below the table")
def _(run):
    cells, foot = plain(run), [["Minimum", "20.1", "0"], ["Maximum", "55.6", "60"], ["Average", "39.0", "37.2"], ["Std. dev.", "11.2", "20.1"], ["MD5", "9a0364b9e99bb480dd25e1f0284c8555"]]
    return text([*cells, [""], *foot]), {}


@hostile("1'234.5 of Switzerland")
def _(run):
    return text(plain(run, ("Zeit [ms]", *HEAD[1:]), when=lambda s: f"{1000 * s:,.1f}".replace(",", "'"))), {}


@hostile("1 234,5 with narrow blanks")
def _(run):
    return text(plain(run, ("temps [ms]", "Température [°C]", "Chauffage [%]"), when=lambda s: f"{1000 * s:,.0f}".replace(",", "\u202f"), number=comma, power=comma), ";"), {}


@hostile("share that never reaches a half")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "u"), power=lambda p: f"{p / 200:.3f}")), {"--power-full-scale": "0.5", "--power-column": "u"}


@hostile("ON time of a window of 2 s")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "on time [ms]"), power=lambda p: f"{20 * p:g}")), {"--power-full-scale": "2000", "--power-column": "on time [ms]"}


@hostile("-127 of a lost sensor")
def _(run):
    cells = plain(run)
    for k in range(90, 640, 37):
        cells[k][1] = "-127.00"
    return text(cells), {}


@hostile("85 after power on")
def _(run):
    cells = plain(run)
    for k in (1, 2, 3, 350):
        cells[k][1] = "85.0"
    return text(cells), {}


@hostile("1372 of an open thermocouple")
def _(run):
    cells = plain(run)
    for row in cells[230:262]:
        row[1] = "1372.0"
    return text(cells), {}


@hostile("0.0 and -0.1 while the converter starts")
def _(run):
    cells = plain(run)
    for k in range(1, 12):
        cells[k][1] = "-0.1" if k % 2 else "0.0"
    return text(cells), {}


@hostile("the last value while the bus is down")
def _(run):
    cells = plain(run)
    for row in cells[120:140]:
        row[1] = cells[119][1]
    return text(cells), {}


@hostile("quotes in quotes")
def _(run):
    return text([[f'"""{cell}"""' for cell in row] for row in plain(run)]), {}


@hostile("units glued to the values")
def _(run):
    return text(plain(run, ("Time", "Temp", "Heater"), when=iso, number=lambda d: f"{d:.1f}C", power=lambda p: f"{p:g}%")), {}


@hostile("registers in hexadecimal")
def _(run):
    return text(plain(run, ("time [s]", "PV", "OUT"), number=lambda d: f"0x{round(10 * d):04X}", power=lambda p: f"0x{round(10 * p):04X}")), {
        "--temperature-unit": "0.1degC", "--power-full-scale": "1000"}


@hostile("marks of limits behind the values")
def _(run):
    return text(plain(run, number=lambda d: f"{d:.1f}{'*' if d > 50 else ' L' if d < 22 else ''}")), {}


@hostile("W and kW by their size")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "Power"), power=lambda p: f"{0.02 * p:.2f} kW" if p >= 50 else f"{20 * p:g} W")), {"--power-full-scale": "2000"}


@hostile("seconds and minutes by their size")
def _(run):
    return text(plain(run, ("Elapsed", *HEAD[1:]), when=lambda s: f"{s:g} s" if s < 120 else f"{s / 60:.3f} min")), {"--log-interval": "2"}


@hostile("words of a relay in French")
def _(run):
    plan = [(int(s), 100.0 * ((s % 20) < 0.2 * p)) for s, _, p, _ in run.rows]  # what the heater gets, too
    rows = [[point(s), point(d), "marche" if p else "arrêt"] for s, d, p, _ in steps(tool_exports.OVEN, plan=plan).rows]
    return text([["temps [s]", "Température [°C]", "Chauffage"], *rows]), {"--power-levels": "arrêt marche"}


@hostile("lines that end with CR alone")
def _(run):
    return text(plain(run), end="\r"), {}


@hostile("a table of HTML")
def _(run):
    head, *rows = plain(run)
    lines = ["<html><body><table>", f"<tr>{''.join(f'<th>{cell}</th>' for cell in head)}</tr>"]
    return "\n".join([*lines, *(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows), "</table></body></html>"]), {}


@hostile("a table of Markdown")
def _(run):
    head, *rows = plain(run)
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * 3, *rows)) + "\n", {}


@hostile("JSON lines with units in their values")
def _(run):
    return "\n".join(json.dumps({"ts": iso(s, mark="T"), "temp": f"{d:.1f} °C", "heater": f"{p:g} %"}, ensure_ascii=False) for s, d, p, _ in run.rows), {}


@hostile("0 to 10 V")
def _(run):
    return text(plain(run, ("time [s]", "Temp [°C]", "AO [V]"), power=lambda p: f"{p / 10:.2f}")), {"--power-full-scale": "10", "--power-column": "AO [V]"}


@hostile("setpoint named Temperature, reading named Value")
def _(run):
    rows = [[iso(s), "55.0" if s > 60 else "20.0", point(d), f"{p:g}"] for s, d, p, _ in run.rows]
    return text([["Time", "Temperature [°C]", "Value [°C]", "Heater [%]"], *rows]), {"--temperature-column": "3"}


@hostile("a reading that is late by a buffer of ten rows")
def _(run):
    late = [run.degC[max(k // 10 * 10 - 1, 0)] for k in range(len(run.degC))]
    return text([list(HEAD), *([point(s), point(d), f"{p:g}"] for (s, _, p, _), d in zip(run.rows, late, strict=True))]), {}

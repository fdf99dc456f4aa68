"""What many tools write of heaters that are known: each tool's export clean, messy and hostile, see `messy`.

The writers share nothing with the reader: they integrate a heater (gain, time constant, dead time) second by second, and
write its readings as the tool would.
"""

from __future__ import annotations

import gzip
import io
import json
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import cache as remember
from typing import Any, NamedTuple

START = datetime(2026, 3, 14, 9, 58, 0)
LEVELS = ("clean", "messy", "hostile")


_draw = 0


def _chance(seed: int) -> random.Random:
    return random.Random(f"{_draw}-{seed}" if _draw else seed)


class Heater(NamedTuple):
    """The true heater [°C/%, s, s, °C]."""

    gain: float
    time_constant_s: float
    dead_time_s: float
    room: float = 20.3


@dataclass(frozen=True)
class Run:
    """Readings of a heater, one for each row: seconds, °C, % and the setpoint."""

    heater: Heater
    seconds: list[float]
    degC: list[float]
    power: list[float]
    setpoint: list[float]

    @property
    def rows(self) -> Iterator[tuple[float, float, float, float]]:
        return zip(self.seconds, self.degC, self.power, self.setpoint, strict=True)

    def map(self, degC: Callable[[float], float]) -> Run:
        return replace(self, degC=[degC(each) for each in self.degC], setpoint=[degC(each) for each in self.setpoint])


def steps(heater: Heater, *, every: int = 2, plan: Sequence[tuple[int, float]] = ((0, 0), (60, 60), (700, 20)), until: int = 1300,
          seed: int = 1, opens: int | None = None) -> Run:
    """Log a heater whose power follows a plan; from `opens` on its element gets nothing, whatever the log says."""
    run = _steps(heater, every, tuple(plan), until, opens, _draw, seed)
    return Run(heater, [*run.seconds], [*run.degC], [*run.power], [*run.setpoint])  # a writer may change its own


@remember  # most of some 400 writers write the same one
def _steps(heater: Heater, every: int, plan: tuple[tuple[int, float], ...], until: int, opens: int | None, draw: int, seed: int) -> Run:
    chance, temperature, made = _chance(seed), heater.room, Run(heater, [], [], [], [])

    def power(second: float) -> float:
        return next(level for begin, level in reversed(plan) if begin <= max(second, 0))

    for second in range(until):
        if second % every == 0:
            made.seconds.append(second)
            made.degC.append(temperature + chance.gauss(0.0, 0.05))
            made.power.append(power(second))
            made.setpoint.append(55.0)
        real = 0.0 if opens is not None and second - heater.dead_time_s >= opens else power(second - heater.dead_time_s)
        temperature += (heater.room + heater.gain * real - temperature) / heater.time_constant_s
    return made


def controlled(heater: Heater, targets: Sequence[tuple[int, float]], *, every: int = 1, until: int = 900, seed: int = 2,
               gain: float = 4.0, reset_s: float = 60.0) -> Run:
    """Log a heater that a PI controller takes to its targets; power in whole thousandths."""
    chance, temperature, integral, made = _chance(seed), heater.room, 0.0, Run(heater, [], [], [], [])
    sent = [0.0] * (int(heater.dead_time_s) + 1)
    for second in range(until):
        target = next(level for begin, level in reversed(targets) if begin <= second)
        reading = temperature + chance.gauss(0.0, 0.05)
        error = target - reading
        unlimited = gain * error + integral
        power = round(min(max(unlimited, 0.0), 100.0), 1) if target else 0.0
        if power == round(unlimited, 1):
            integral += gain * error / reset_s
        sent.append(power)
        if second % every == 0:
            made.seconds.append(second)
            made.degC.append(reading)
            made.power.append(power)
            made.setpoint.append(target)
        temperature += (heater.room + heater.gain * sent[-1 - int(heater.dead_time_s)] - temperature) / heater.time_constant_s
    return made


@dataclass(frozen=True)
class Export:
    """A file.

    Attributes:
        tool, level: what wrote it, and how it fared.
        name, content: of the file.
        heater: the truth.
        user: option → value: what the user knows and may be asked for.
        true_fault: words of an accusation that is true here.
    """

    tool: str
    level: str
    name: str
    content: bytes
    heater: Heater
    user: Mapping[str, str] = field(default_factory=dict)
    true_fault: str = ""


WRITERS: list[tuple[str, str, Callable[[], tuple[Any, ...]]]] = []


def writes(tool: str, level: str) -> Callable[[Callable[[], tuple[Any, ...]]], Callable[[], tuple[Any, ...]]]:
    """Add a writer: it returns name, content, heater, and optionally what the user knows and a true accusation."""
    assert level in LEVELS

    def add(writer: Callable[[], tuple[Any, ...]]) -> Callable[[], tuple[Any, ...]]:
        WRITERS.append((tool, level, writer))
        return writer

    return add


def exports(tool: str | None = None, level: str | None = None) -> Iterator[Export]:
    """Make the exports, of one tool or level if it is named."""
    for name, of_level, writer in WRITERS:
        if tool in (None, name) and level in (None, of_level):
            file, content, *more = writer()
            yield Export(name, of_level, file, content if isinstance(content, bytes) else content.encode(), *more)


# ---- what is common to many tools -------------------------------------------------------------------------------------

OVEN, BED, HOTEND, KILN = Heater(0.6, 150, 12), Heater(0.9, 300, 14), Heater(2.4, 60, 4), Heater(5.5, 900, 40, 19.0)
_AS_WRITTEN = {name: globals()[name] for name in ("OVEN", "BED", "HOTEND", "KILN")}


def redraw(draw: int) -> None:
    """Change the heaters by up to 12 % each way, and all noise, for the exports that are made next; 0: as they were."""
    global _draw
    _draw, chance = draw, random.Random(f"heaters {draw}")
    for name, heater in _AS_WRITTEN.items():
        gain, constant, dead, room = (value * (chance.uniform(0.88, 1.12) if draw else 1.0) for value in heater)
        globals()[name] = Heater(gain, constant, round(dead), room)


MARKS = ("--.-", "Err", "OPEN", "+OVER", "NULL")


def iso(second: float, *, digits: int = 0, mark: str = " ") -> str:
    moment = (START + timedelta(seconds=second)).isoformat(mark, "milliseconds" if digits else "seconds")
    return moment[:len(moment) - 3 + digits] if digits else moment


def stamped(pattern: str) -> Callable[[float], str]:
    return lambda second: (START + timedelta(seconds=second)).strftime(pattern)


def comma(value: float, digits: int = 1) -> str:
    return f"{value:.{digits}f}".replace(".", ",")


def point(value: float, digits: int = 1) -> str:
    return f"{value:.{digits}f}"


def table(run: Run, header: Sequence[str], when: Callable[[float], str], *, sep: str = ",", number: Callable[[float], str] = point,
          power: Callable[[float], str] = lambda value: f"{value:g}", setpoint: bool = False) -> list[list[str]]:
    """Return header and rows of cells; sep.join is the caller's."""
    rows = [[when(second), number(degC), power(percent)] + ([number(target)] if setpoint else [])
            for second, degC, percent, target in run.rows]
    return [list(header), *rows]


def text(cells: Sequence[Sequence[str]], sep: str = ",", *, above: Sequence[str] = (), below: Sequence[str] = (), end: str = "\n") -> str:
    return end.join([*above, *(sep.join(row) for row in cells), *below]) + end


def spoil(cells: list[list[str]], *, column: int = 1, marks: Sequence[str] = MARKS, nul: bool = True, cut: bool = True,
          empty_last: bool = False) -> list[list[str]]:
    """Spoil rows as loggers do: marks for readings, a line of NUL bytes, a cut last row, an empty last column."""
    spoilt = [list(row) for row in cells]
    for mark, place in zip(marks, range(100, 100 + 60 * len(marks), 60), strict=True):
        spoilt[place % len(spoilt)][column] = mark
    if empty_last:
        spoilt = [[*row, ""] for row in spoilt]
    if nul:
        spoilt[300 % len(spoilt)] = ["\0" * 24]
    if cut:
        last = spoilt[-1]
        spoilt[-1] = [*last[:column], last[column][:2]]
    return spoilt


def mean_row(run: Run, sep: str, word: str, number: Callable[[float], str] = point) -> list[str]:
    mean = sum(run.degC) / len(run.degC)
    return ["", sep.join([word, number(mean), number(sum(run.power) / len(run.power))])]


# ---- spreadsheets and plain tables ------------------------------------------------------------------------------------

@writes("generic CSV", "clean")
def _():
    run = steps(OVEN)
    return "oven.csv", text(table(run, ("time_s", "temperature_degC", "power_pct"), point)), OVEN


@writes("generic CSV", "messy")
def _():
    run = steps(OVEN)
    cells = spoil(table(run, ("time [s]", "Temp [°C]", "Heater [%]"), point), empty_last=True)
    return "oven.csv", text(cells, below=mean_row(run, ",", "Mean")), OVEN


@writes("generic CSV", "hostile")
def _():
    # tenths of a degree in whole numbers, and a power in counts, neither said
    run = steps(OVEN)
    cells = table(run, ("time_s", "PV", "OP"), point, number=lambda value: str(round(value * 10)),
                  power=lambda value: str(round(value / 100 * 27648)))
    return "oven.csv", text(cells), OVEN, {"--temperature-unit": "0.1degC", "--temperature-scale": "0.1",
                                           "--power-full-scale": "27648", "--temperature-column": "PV"}


@writes("loose probe", "messy")
def _():
    # for two minutes the probe's plug was out: the converter reads its end of range
    run = steps(OVEN)
    cells = table(run, ("time [s]", "Temp [°C]", "Heater [%]"), point)
    for row in cells[400:425]:
        row[1] = "850.0"
    return "oven.csv", text(cells), OVEN


@writes("loose probe", "hostile")
def _():
    # for three minutes, and the open input reads the cold junction with noise
    run = steps(OVEN, until=1600)
    cells, chance = table(run, ("time [s]", "Temp [°C]", "Heater [%]"), point), random.Random(3)
    for row in cells[480:570]:
        row[1] = point(22.0 + chance.gauss(0, 0.2))
    return "oven.csv", text(cells), OVEN, {"--until": "950"}, "probe|sensor|jump"


@writes("heater opens", "hostile")
def _():
    # the element burns through at 950 s: the power goes on, the oven cools
    run = steps(OVEN, plan=((0, 0), (60, 60), (600, 40)), until=2000, opens=1200)
    return "oven.csv", text(table(run, ("time [s]", "Temp [°C]", "Heater [%]"), point)), OVEN, {}, "open|stops answering"


@writes("second heater", "hostile")
def _():
    first, second = steps(OVEN), steps(BED, plan=((0, 0), (100, 30), (600, 50)), seed=5)
    cells = [["Time [s]", "T1", "T2", "Q1 [%]", "Q2 [%]"]]
    cells += [[point(s), point(a), point(b), f"{p:g}", f"{q:g}"]
              for s, a, b, p, q in zip(first.seconds, first.degC, second.degC, first.power, second.power, strict=True)]
    return "two.csv", text(cells), OVEN, {"--temperature-column": "T1", "--power-column": "Q1 [%]"}


@writes("slow log", "hostile")
def _():
    # once in ten minutes a heater of two: each pulse is a jump and the opposite jump
    heater = Heater(0.6, 120, 10)
    plan = ((0, 0), (20000, 60), (50000, 0), (90000, 40), (130000, 0))
    return "slow.csv", text(table(steps(heater, every=600, plan=plan, until=160000), ("time [s]", "Temp [°C]", "Heater [%]"), point)), heater, {}, "faster-than-log"


@writes("ambient beside it", "hostile")
def _():
    # the oven's own column has a name that says nothing
    run, chance = steps(OVEN), random.Random(6)
    cells = [["Time [s]", "Ambient temp [°C]", "Zone 1", "Heater [%]"]]
    cells += [[point(s), point(21 + s / 4000 + chance.gauss(0, 0.1)), point(d), f"{p:g}"] for s, d, p, _ in run.rows]
    return "oven.csv", text(cells), OVEN, {"--temperature-column": "Zone 1", "--temperature-unit": "degC"}


@writes("coarse clock", "hostile")
def _():
    # four rows a second, stamped in whole seconds
    heater = Heater(2.4, 40, 3)
    run = steps(heater, every=1, plan=((0, 0), (60, 60), (600, 20)), until=1200)
    cells = table(run, ("Time", "Temp [°C]", "Power [%]"), lambda s: iso(s / 4))
    fast = Heater(2.4, 10, 0.75)
    return "fast.csv", text(cells), fast


@writes("names above too few", "hostile")
def _():
    # an unnamed column of numbers of the rows in front, as a data frame writes its index with a wrong header
    run = steps(OVEN)
    lines = ["time [s],Temp [°C],Heater [%]", *(f"{k},{s},{d:.1f},{p:g}" for k, (s, d, p, _) in enumerate(run.rows))]
    return "frame.csv", "\n".join(lines) + "\n", OVEN, {
        "--time-column": "2", "--temperature-column": "3", "--power-column": "4", "--time-unit": "s", "--power-full-scale": "100",
        "--temperature-unit": "degC"}


@writes("display switched to °F", "hostile")
def _():
    # someone changed the unit of the display in the middle
    run = steps(OVEN)
    cells = table(run, ("time [s]", "Temp", "Heater [%]"), point)
    for row in cells[401:]:
        row[1] = point(1.8 * float(row[1]) + 32)
    return "oven.csv", text(cells), OVEN, {"--until": "780", "--temperature-unit": "degC"}, "another unit"


@writes("two delimiters", "messy")
def _():
    run = steps(OVEN)
    lines = [f"{iso(s)};{d:.1f},{p:g}" for s, d, p, _ in run.rows]
    return "logger.txt", "\n".join(["Time;Temperature °C,Power %", *lines]) + "\n", OVEN


@writes("two delimiters", "hostile")
def _():
    run = steps(OVEN)
    lines = [f"{iso(s)}\t{d:.1f} °C;{p:g} %" for s, d, p, _ in run.rows]
    return "logger.txt", "\n".join(lines) + "\n", OVEN, {"--temperature-column": "2", "--power-column": "3"}


@writes("minutes and seconds", "clean")
def _():
    run = steps(OVEN)
    return "timer.csv", text(table(run, ("Time (mm:ss)", "Temp C", "Power %"), lambda s: f"{int(s) // 60:02d}:{int(s) % 60:02d}")), OVEN


@writes("minutes and seconds", "messy")
def _():
    run = steps(OVEN)
    cells = table(run, ("Time", "Temp C", "Power %"), lambda s: f"{int(s) // 60:02d}:{int(s) % 60:02d}")
    return "timer.csv", text(spoil(cells)), OVEN, {"--time-unit": "mm:ss"}


@writes("minutes and seconds", "hostile")
def _():
    # read once a minute: 00:00 to 25:00 is minutes, but the hours of a day go to 23:59
    heater = Heater(0.6, 1500, 120)
    run = steps(heater, every=60, plan=((0, 0), (600, 60), (7000, 20)), until=13000)
    cells = table(run, ("Time", "Temp C", "Power %"), lambda s: f"{int(s) // 3600:02d}:{int(s) % 3600 // 60:02d}")
    return "timer.csv", text(cells), heater, {"--time-unit": "hh:mm"}


@writes("12-hour dates", "clean")
def _():
    run = steps(OVEN)
    return "us.csv", text(table(run, ("Date/Time", "Temp (C)", "Output %"), stamped("%m/%d/%Y %I:%M:%S %p"))), OVEN


@writes("12-hour dates", "messy")
def _():
    run = steps(OVEN)
    cells = table(run, ("Date/Time", "Temp (C)", "Output %"), stamped("%m/%d/%y %I:%M:%S %p"))
    return "us.csv", text(spoil(cells, empty_last=True), below=mean_row(run, ",", "Average")), OVEN


@writes("12-hour dates", "hostile")
def _():
    # the fourth of March, or the third of April: over midnight, noon and five days the order is inferred
    heater = Heater(0.6, 15000, 1200)
    run = steps(heater, every=600, plan=((0, 0), (6000, 60), (150000, 20)), until=300000)
    when = [(datetime(2026, 3, 4, 9, 58) + timedelta(seconds=s)).strftime("%m/%d/%Y %I:%M:%S %p") for s in run.seconds]
    cells = table(run, ("Date/Time", "Temp (C)", "Output %"), point)
    for row, moment in zip(cells[1:], when, strict=True):
        row[0] = moment
    return "us.csv", text(cells), heater, {"--log-interval": "600"}


@writes("headerless long table", "clean")
def _():
    return "tags.csv", text(_long(steps(OVEN))), OVEN


@writes("headerless long table", "messy")
def _():
    cells = _long(steps(OVEN))
    for place, mark in zip(range(200, 500, 60), MARKS, strict=True):
        cells[place - place % 2][2] = mark
    cells[700] = ["\0" * 16]
    cells[-1] = cells[-1][:2]
    return "tags.csv", text(cells), OVEN


@writes("headerless long table", "hostile")
def _():
    cells = _long(steps(OVEN), temperature="ns=2;s=PLC.Oven.rIn", power="ns=2;s=PLC.Oven.rOut")
    return "tags.csv", text(cells, "|"), OVEN, {"--tag": "ns=2;s=PLC.Oven.rIn", "--power-tag": "ns=2;s=PLC.Oven.rOut",
                                                  "--tag-column": "2", "--power-full-scale": "100"}


def _long(run: Run, temperature: str = "Oven.Temperature", power: str = "Oven.Power_pct") -> list[list[str]]:
    cells = []
    for second, degC, percent, _ in run.rows:
        cells += [[iso(second), temperature, point(degC)], [iso(second), power, f"{percent:g}"]]
    return cells


@writes("Excel, German", "clean")
def _():
    run = steps(OVEN)
    cells = table(run, ("Datum/Uhrzeit", "Isttemperatur [°C]", "Stellgrad [%]", "Sollwert [°C]"), stamped("%d.%m.%Y %H:%M:%S"),
                  number=comma, power=comma, setpoint=True)
    return "ofen.csv", text(cells, ";", end="\r\n").encode("cp1252"), OVEN


@writes("Excel, German", "messy")
def _():
    run = steps(OVEN)
    cells = spoil(table(run, ("Zeit", "Temperatur in °C", "Heizleistung in %"), stamped("%d.%m.%Y %H:%M:%S"), number=comma, power=comma),
                  marks=("#NV", "#WERT!", "Fühlerbruch", "---", "#DIV/0!"), nul=False, empty_last=True)
    return "ofen.csv", text(cells, ";", below=mean_row(run, ";", "Mittelwert", comma), end="\r\n").encode("cp1252"), OVEN


@writes("Excel, German", "hostile")
def _():
    # names that say nothing, time in minutes with a comma, power in tenths of a percent
    run = steps(OVEN)
    cells = [["Zeit", "Ofen", "Y"], *([comma(s / 60, 4), comma(d), str(round(10 * p))] for s, d, p, _ in run.rows)]
    return "ofen.csv", text(cells, ";", end="\r\n"), OVEN, {
        "--time-unit": "min", "--temperature-column": "Ofen", "--power-column": "Y", "--power-full-scale": "1000"}


@writes("Excel, Brazilian", "clean")
def _():
    run = steps(OVEN)
    cells = table(run, ("Data/Hora", "Temperatura (°C)", "Potência (%)"), stamped("%d/%m/%Y %H:%M:%S"), number=comma, power=comma)
    return "forno.csv", text(cells, ";", end="\r\n").encode("cp1252"), OVEN


@writes("Excel, Brazilian", "messy")
def _():
    run = steps(OVEN)
    cells = spoil(table(run, ("Data", "Temperatura do forno (°C)", "Saída (%)"), stamped("%d/%m/%Y %H:%M:%S"), number=comma, power=comma),
                  marks=("#N/D", "Erro", "#VALOR!", "-", "aberto"), empty_last=True, nul=False)
    return "forno.csv", text(cells, ";", below=mean_row(run, ";", "Média", comma), end="\r\n").encode("cp1252"), OVEN


@writes("Excel, Brazilian", "hostile")
def _():
    # the heater's column is on and off in Portuguese, the time of day has no date
    run = steps(OVEN, plan=((0, 0), (60, 100), (300, 0), (700, 100), (900, 0)))
    cells = table(run, ("Hora", "Temperatura", "Aquecimento"), stamped("%H:%M:%S"), number=comma,
                  power=lambda p: "ligado" if p else "desligado")
    return "forno.csv", text(cells, ";", end="\r\n").encode("cp1252"), OVEN, {"--power-column": "Aquecimento"}


@writes("Excel, Japanese", "clean")
def _():
    run = steps(OVEN)
    cells = table(run, ("日時", "温度(℃)", "出力(%)", "設定値(℃)"), stamped("%Y/%m/%d %H:%M:%S"), setpoint=True)
    return "炉.csv", text(cells, end="\r\n").encode("cp932"), OVEN


@writes("Excel, Japanese", "messy")
def _():
    run = steps(OVEN)
    cells = spoil(table(run, ("時刻", "現在温度 ℃", "操作量 %"), stamped("%Y/%m/%d %H:%M:%S")),
                  marks=("#N/A", "エラー", "断線", "----", "#VALUE!"), empty_last=True)
    return "炉.csv", text(cells, below=mean_row(run, ",", "平均"), end="\r\n").encode("cp932"), OVEN


@writes("Excel, Japanese", "hostile")
def _():
    run = steps(OVEN, plan=((0, 0), (60, 100), (300, 0), (700, 100), (900, 0)))
    cells = table(run, ("年月日 時分秒", "測定値", "ヒータ"), stamped("%Y年%m月%d日 %H時%M分%S秒"), power=lambda p: "オン" if p else "オフ")
    return "炉.csv", text(cells, end="\r\n").encode("cp932"), OVEN, {"--temperature-column": "測定値", "--power-column": "ヒータ"}


@writes("xlsx", "clean")
def _():
    run = steps(OVEN)
    return "oven.xlsx", _xlsx([["Time", "Temperature [°C]", "Power [%]"],
                               *([START + timedelta(seconds=s), round(d, 1), p] for s, d, p, _ in run.rows)]), OVEN


@writes("xlsx", "messy")
def _():
    run = steps(OVEN)
    cells = [["Oven 3, commissioning"], [], ["Time [s]", "Temperature [°C]", "Power [%]", None],
             *([s, round(d, 1), p, None] for s, d, p, _ in run.rows)]
    cells[100][1], cells[160][1], cells[220][1] = "#N/A", "OPEN", None
    return "oven.xlsx", _xlsx([*cells, [], ["Mean", 40.1, 30.0]]), OVEN


@writes("xlsx", "hostile")
def _():
    # the first sheet is a cover; the readings are on the second, with a spreadsheet's duration as the time
    run = steps(OVEN)
    cells = [["elapsed", "T oven [°C]", "P [%]"], *([s / 86400, round(d, 1), p] for s, d, p, _ in run.rows)]
    return "oven.xlsx", _xlsx([["Report of oven 3"], ["J. Smith"]], cells), OVEN, {"--time-unit": "d", "--power-column": "P [%]", "--tag": "Sheet2"}


def _xlsx(*sheets: Sequence[Sequence[Any]]) -> bytes:
    """Write a workbook as the standard describes it (ECMA-376), dates as days since 1899-12-30 with a style."""
    import zipfile  # noqa: PLC0415 - one writer's
    from xml.sax.saxutils import escape  # noqa: PLC0415

    def cell(value: Any) -> str:
        if value is None:
            return "<c/>"
        if isinstance(value, datetime):
            return f'<c s="1"><v>{(value - datetime(1899, 12, 30)) / timedelta(days=1)!r}</v></c>'
        if isinstance(value, str):
            return f'<c t="inlineStr"><is><t>{escape(value)}</t></is></c>'
        return f"<c><v>{value!r}</v></c>"

    main = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    numbers = range(1, len(sheets) + 1)
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" ContentType="application/xml"/><Override PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/><Override PartName="/xl/styles.xml" ContentType="{kind}.styles+xml"/>' + "".join(
            f'<Override PartName="/xl/worksheets/sheet{n}.xml" ContentType="{kind}.worksheet+xml"/>' for n in numbers) + "</Types>",
        "_rels/.rels": f'<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook {main} xmlns:r="{office}"><sheets>' + "".join(
            f'<sheet name="Sheet{n}" sheetId="{n}" r:id="rId{n}"/>' for n in numbers) + "</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{package}/relationships">' + "".join(
            f'<Relationship Id="rId{n}" Type="{office}/worksheet" Target="worksheets/sheet{n}.xml"/>' for n in numbers) + f'<Relationship Id="rId99" Type="{office}/styles" Target="styles.xml"/></Relationships>',
        "xl/styles.xml": f'<styleSheet {main}><fonts count="1"><font/></fonts><fills count="1"><fill/></fills><borders count="1"><border/></borders><cellStyleXfs count="1"><xf/></cellStyleXfs><cellXfs count="2"><xf/><xf numFmtId="22" applyNumberFormat="1"/></cellXfs></styleSheet>',
    }
    for n, rows in zip(numbers, sheets, strict=True):
        parts[f"xl/worksheets/sheet{n}.xml"] = f"<worksheet {main}><sheetData>" + "".join(
            f"<row>{''.join(map(cell, row))}</row>" for row in rows) + "</sheetData></worksheet>"
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as book:
        for name, part in parts.items():
            book.writestr(name, '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>' + part)
    return held.getvalue()


@writes("compressed CSV", "clean")
def _():
    run = steps(OVEN)
    return "oven.csv.gz", gzip.compress(text(table(run, ("time_s", "temperature_degC", "power_pct"), point)).encode()), OVEN


@writes("compressed CSV", "messy")
def _():
    run = steps(OVEN)
    return "oven.csv.gz", gzip.compress(text(spoil(table(run, ("Time", "Temp C", "Power %"), iso))).encode()), OVEN


@writes("compressed CSV", "hostile")
def _():
    # the computer went off while it was written: the end of the stream is missing
    run = steps(OVEN)
    whole = gzip.compress(text(table(run, ("Time", "Temp C", "Power %"), iso)).encode())
    return "oven.csv.gz", whole[:-40], OVEN


# ---- containers -------------------------------------------------------------------------------------------------------

def _frame(run: Run, names: Sequence[str], *, holes: bool = False) -> Any:
    import pandas  # noqa: PLC0415 - an extra's

    frame = pandas.DataFrame({names[0]: [START + timedelta(seconds=s) for s in run.seconds], names[1]: run.degC, names[2]: run.power})
    if holes:
        frame.loc[100:104, names[1]] = float("nan")
    return frame


def _parquet(frame: Any) -> bytes:
    held = io.BytesIO()
    frame.to_parquet(held)
    return held.getvalue()


@writes("parquet", "clean")
def _():
    return "oven.parquet", _parquet(_frame(steps(OVEN), ("time", "temperature_degC", "power_pct"))), OVEN


@writes("parquet", "messy")
def _():
    return "oven.parquet", _parquet(_frame(steps(OVEN), ("ts", "temperature_degC", "power_pct"), holes=True)), OVEN


@writes("parquet", "hostile")
def _():
    # a share of full power in 32 bits, the time as the index
    frame = _frame(steps(OVEN), ("time", "oven", "duty"))
    frame["duty"] = (frame["duty"] / 100).astype("float32")
    return "oven.parquet", _parquet(frame.set_index("time")), OVEN, {"--temperature-column": "oven", "--power-full-scale": "1"}


@writes("feather", "clean")
def _():
    return "oven.feather", _feather(_frame(steps(OVEN), ("time", "temperature_degC", "power_pct"))), OVEN


@writes("feather", "messy")
def _():
    return "oven.feather", _feather(_frame(steps(OVEN), ("time", "temperature_degC", "power_pct"), holes=True)), OVEN


@writes("feather", "hostile")
def _():
    run = steps(OVEN)
    frame = _frame(run, ("time", "temp", "on"))
    frame["time"] = [round(1e9 * s) for s in run.seconds]
    return "oven.feather", _feather(frame.rename(columns={"time": "t_ns", "on": "heater_pct"})), OVEN, {"--log-interval": "2", "--time-column": "t_ns"}


def _feather(frame: Any) -> bytes:
    held = io.BytesIO()
    frame.to_feather(held)
    return held.getvalue()


@writes("MATLAB", "clean")
def _():
    run = steps(OVEN)
    return "oven.mat", _mat(time_s=run.seconds, temperature_degC=run.degC, power_pct=run.power), OVEN


@writes("MATLAB", "messy")
def _():
    run = steps(OVEN)
    degC = list(run.degC)
    degC[100:104] = [float("nan")] * 4
    return "oven.mat", _mat(t_s=run.seconds, T_degC=degC, u_pct=run.power, Ts=2.0, note="oven 3"), OVEN, {
        "--time-column": "t_s", "--temperature-column": "T_degC", "--power-column": "u_pct"}


@writes("MATLAB", "hostile")
def _():
    # one matrix of three columns, no names
    run = steps(OVEN)
    return "oven.mat", _mat(data=[[s, d, p] for s, d, p, _ in run.rows]), OVEN, {
        "--time-column": "1", "--temperature-column": "2", "--power-column": "3", "--time-unit": "s",
        "--temperature-unit": "degC", "--power-full-scale": "100"}


def _mat(**variables: Any) -> bytes:
    import numpy as np  # noqa: PLC0415 - one writer's
    from scipy.io import savemat  # noqa: PLC0415

    held = io.BytesIO()
    savemat(held, {name: value if isinstance(value, str | float) else np.array(value, dtype=float) for name, value in variables.items()},
            oned_as="column")
    return held.getvalue()


# ---- printers ---------------------------------------------------------------------------------------------------------

def _stats(run: Run, name: str, second: int) -> str:
    return f"{name}: target={run.setpoint[second]:.0f} temp={run.degC[second]:.1f} pwm={run.power[second] / 100:.3f}"


def _klippy(parts: Sequence[tuple[float, Sequence[tuple[str, Run]]]], *, spoilt: bool = False) -> str:
    """Write klippy.log: for each start of the host the configuration, then a line of statistics each second."""
    lines = []
    for begin, heaters in parts:
        lines += ["Starting Klippy...", "Args: ['klippy.py', 'printer.cfg', '-l', 'klippy.log']", "===== Config file =====",
                  "[printer]", "kinematics = corexy", *(f"[{name}]" for name, _ in heaters), "=======================",
                  f"Loaded MCU 'mcu' 105 commands (v0.12.0) at {begin:.1f}"]
        for second in range(len(heaters[0][1].seconds)):
            parts_of_line = [f"Stats {begin + second:.1f}: gcodein=0  mcu: mcu_awake=0.002 mcu_task_avg=0.000007 bytes_write=1290"]
            parts_of_line += [_stats(run, name, second) for name, run in heaters]
            lines.append(" ".join([*parts_of_line, "print_time=12.1 buffer_time=0.000 sysload=0.42 cputime=8.1 memavail=3400000"]))
            if spoilt and second in (200, 400):
                lines += ["\0" * 40, "Timeout with MCU 'mcu' (eventtime=400.1)", lines[-1][:47]]
    return "\n".join(lines) + "\n"


def _cold(name: str, seconds: int, degC: float = 21.0, seed: int = 9) -> tuple[str, Run]:
    chance = random.Random(seed)
    return name, Run(HOTEND, list(range(seconds)), [degC + chance.gauss(0, 0.05) for _ in range(seconds)], [0.0] * seconds, [0.0] * seconds)


HOT = ((0, 0.0), (40, 120.0), (500, 100.0))


@writes("klippy.log", "clean")
def _():
    run = controlled(HOTEND, HOT)
    return "klippy.log", _klippy([(1200.4, [("heater_bed", _cold("", 900)[1]), ("extruder", run)])]), HOTEND


@writes("klippy.log", "messy")
def _():
    # three starts of the host; the clock goes on from the boot of the computer
    run = controlled(HOTEND, HOT)
    idle = [_cold("extruder", 60), _cold("heater_bed", 60)]
    return "klippy.log", _klippy([(300.2, idle), (1200.4, [("extruder", run), _cold("heater_bed", 900)]), (9000.7, idle)], spoilt=True), HOTEND


@writes("klippy.log", "hostile")
def _():
    # the computer was booted between: the clock begins again; only the bed was heated
    bed = controlled(BED, ((0, 0.0), (40, 60.0), (900, 50.0)), until=1500, gain=6.0, reset_s=200.0)
    idle = [_cold("extruder", 300), _cold("heater_bed", 300)]
    return "klippy.log", _klippy([(9000.2, idle), (45.3, [_cold("extruder", 1500), ("heater_bed", bed)])]), BED, {"--tag": "heater_bed", "--run": "2"}


def _octoprint(run: Run, *, bed: bool = True, stamps: bool = True, extra: bool = False) -> list[str]:
    lines = []
    for second, degC, percent, target in run.rows:
        stamp = f"{iso(second, digits=3).replace('.', ',')} - Recv: " if stamps else ""
        bed_part = f" B:22.4 /0.0 @:{round(percent * 1.27)} B@:0" if bed else f" @:{round(percent * 1.27)}"
        lines.append(f"{stamp} T:{degC:.1f} /{target:.1f}{bed_part}")
        if extra and int(second) % 15 == 0:
            lines += [f"{stamp}echo:busy: processing", f"{stamp}ok", f"{iso(second, digits=3).replace('.', ',')} - Send: M105"]
    return lines


@writes("OctoPrint serial.log", "clean")
def _():
    return "serial.log", "\n".join(_octoprint(controlled(HOTEND, HOT, every=2))) + "\n", HOTEND


@writes("OctoPrint serial.log", "messy")
def _():
    lines = _octoprint(controlled(HOTEND, HOT, every=2), extra=True)
    lines[200] = lines[200][:40]
    lines[300] = "\0" * 32
    return "serial.log", "\n".join(lines)[:-20], HOTEND


@writes("OctoPrint serial.log", "hostile")
def _():
    # two hot ends, of which the second was heated
    run = controlled(HOTEND, HOT, every=2)
    lines = [f"{iso(s, digits=3).replace('.', ',')} - Recv: ok T:21.0 /0.0 B:22.1 /0.0 T0:21.0 /0.0 T1:{d:.2f} /{t:.2f} @:0 B@:0 @0:0 @1:{round(p * 1.27)}"
             for s, d, p, t in run.rows]
    return "serial.log", "\n".join(lines) + "\n", HOTEND, {"--tag": "T1"}


@writes("Marlin M303", "clean")
def _():
    return "m303.txt", _m303(stamps=True), HOTEND


@writes("Marlin M303", "messy")
def _():
    return "m303.txt", _m303(stamps=True).replace(" @:127\n", " @:127\nok\n", 3)[:-9], HOTEND


@writes("Marlin M303", "hostile")
def _():
    # no stamps: the readings are two seconds apart, which only the user knows
    return "m303.txt", _m303(stamps=False), HOTEND, {"--log-interval": "2"}


def _m303(*, stamps: bool) -> str:
    """Write an autotune: a relay about 150 °C, readings every 2 s, the results of the cycles between."""
    chance, temperature, on, swings = random.Random(4), HOTEND.room, True, 0
    sent, lines = [0.0] * 5, []

    def say(second: int, line: str) -> None:
        lines.append((f"[{iso(second, digits=3)[11:]}] " if stamps else "") + line)

    say(0, "PID Autotune start")
    for second in range(800):
        reading = temperature + chance.gauss(0, 0.05)
        if on == (reading > 150):
            on = not on
            swings += 1
            if swings > 2 and on:
                say(second, f" bias: {92 + swings} d: {92 - swings} min: 147.2 max: 153.4")
        if second % 2 == 0:
            say(second, f" T:{reading:.2f} /150.00 B:22.31 /0.00 @:{127 if on else 0} B@:0")
        sent.append(100.0 if on else 0.0)
        temperature += (HOTEND.room + HOTEND.gain * sent[-1 - int(HOTEND.dead_time_s)] - temperature) / HOTEND.time_constant_s
    say(800, "PID Autotune finished! Put the last Kp, Ki and Kd constants from below into Configuration.h")
    return "\n".join(lines) + "\n"


@writes("Repetier", "clean")
def _():
    return "repetier.txt", "\n".join(_repetier()) + "\n", HOTEND


@writes("Repetier", "messy")
def _():
    lines = _repetier()
    lines[100:100] = ["09:59:00.100: wait", "\0\0\0\0\0\0", "09:59:00.120: Error:checksum mismatch"]
    return "repetier.txt", "\n".join(lines)[:-12], HOTEND


@writes("Repetier", "hostile")
def _():
    # the host shows a printer with Marlin, whose counts end at 127
    return "repetier.txt", "\n".join(_repetier(marlin=True)) + "\n", HOTEND


def _repetier(*, marlin: bool = False) -> list[str]:
    run = controlled(HOTEND, HOT, every=2)
    sent = [f"@:{round(1.27 * p)} B@:0" if marlin else f"B@:0 @:{round(2.55 * p)}" for p in run.power]
    return [f"{iso(s, digits=3)[11:]}: T:{d:.2f} /{t:.0f} B:21.90 /0 {power}" for (s, d, _, t), power in zip(run.rows, sent, strict=True)]


# ---- kilns, roasters, home automation ----------------------------------------------------------------------------------

def _kiln() -> Run:
    return controlled(KILN, ((0, 150.0), (2500, 300.0), (6000, 220.0)), every=2, until=9000, gain=1.2, reset_s=700.0)


def _kiln_line(second: float, degC: float, percent: float, target: float) -> str:
    return (f"{iso(second, digits=3).replace('.', ',')} INFO oven: temp={degC:.2f}, target={target:.2f}, error={target - degC:.2f}, pid={percent:.2f}, "
            f"p=1.00, i=2.00, d=0.00, heat_on={percent / 50:.2f}, heat_off={2 - percent / 50:.2f}, run_time={int(second)}, total_time=9000, time_left={9000 - int(second)}")


@writes("kiln-controller log", "clean")
def _():
    return "kiln.log", "\n".join(_kiln_line(*row) for row in _kiln().rows) + "\n", KILN


@writes("kiln-controller log", "messy")
def _():
    lines = [_kiln_line(*row) for row in _kiln().rows]
    lines[0:0] = ["2026-03-14 09:57:58,100 INFO root: Starting kiln controller", "2026-03-14 09:57:59,100 INFO oven: Running schedule test starting at 0 minutes"]
    for place in range(300, 1500, 300):
        lines.insert(place, "2026-03-14 10:10:00,100 ERROR oven: Problem reading temp (ignored) not connected")
        lines.insert(place, "2026-03-14 10:10:00,100 INFO oven: kiln must catch up, too cold, shifting schedule")
    return "daemon.log", "\n".join(f"Mar 14 10:10:00 raspberrypi python[286]: {line}" for line in lines)[:-30], KILN


@writes("kiln-controller log", "hostile")
def _():
    # in Fahrenheit, which the log does not say
    run = _kiln().map(lambda degC: 1.8 * degC + 32)
    return "kiln.log", "\n".join(_kiln_line(*row) for row in run.rows) + "\n", KILN, {"--temperature-unit": "degF"}


def _kiln_state(second: float, degC: float, percent: float, target: float) -> dict[str, Any]:
    return {"cost": 0.1, "runtime": second, "temperature": round(degC, 2), "target": target, "state": "RUNNING", "heat": round(percent / 50, 3),
            "heat_rate": 90.1, "totaltime": 9000, "kwh_rate": 0.13, "currency_type": "$", "profile": "test",
            "pidstats": {"time": 1773482280.0 + second, "timeDelta": 2.0, "setpoint": target, "ispoint": round(degC, 2), "err": round(target - degC, 2),
                         "p": 1.0, "i": 2.0, "d": 0.0, "kp": 25, "ki": 10, "kd": 200, "pid": round(percent, 2), "out": round(percent / 100, 4)},
            "catching_up": False, "door": "CLOSED"}


@writes("kiln-controller JSON", "clean")
def _():
    return "kiln.json", "\n".join(json.dumps(_kiln_state(*row)) for row in _kiln().rows) + "\n", KILN, {"--temperature-unit": "degC"}


@writes("kiln-controller JSON", "messy")
def _():
    # the backlog that a browser is sent
    log = [_kiln_state(*row) for row in _kiln().rows]
    for place in (100, 200, 300):
        log[place]["temperature"] = None
    return "backlog.json", json.dumps({"type": "backlog", "profile": {"data": [[0, 20], [9000, 300]], "type": "profile", "name": "test"}, "log": log}), KILN


@writes("kiln-controller JSON", "hostile")
def _():
    log = [{key: value for key, value in _kiln_state(*row).items() if key != "pidstats"} for row in _kiln().rows]
    return "kiln.json", "\n".join(map(json.dumps, log)) + "\n", KILN, {"--power-full-scale": "2", "--temperature-unit": "degC"}


def _artisan(run: Run, *, unit: str = "C") -> list[str]:
    lines = [f"Date:14.03.2026\tUnit:{unit}\tCHARGE:00:00\tTP:\tDRYe:\tFCs:\tFCe:\tSCs:\tSCe:\tDROP:\tCOOL:\tTime:09:58",
             "Time1\tTime2\tET\tBT\tEvent\tHeater %"]
    return lines + [f"{int(s) // 60:02d}:{int(s) % 60:02d}\t\t{1.02 * d:.1f}\t{d:.1f}\t\t{p:g}" for s, d, p, _ in run.rows]


ROASTER = Heater(2.1, 120, 10)
ROAST = ((0, 0), (60, 80), (700, 40))


@writes("Artisan CSV", "clean")
def _():
    return "roast.csv", "\n".join(_artisan(steps(ROASTER, plan=ROAST))) + "\n", ROASTER, {"--temperature-column": "BT"}


@writes("Artisan CSV", "messy")
def _():
    lines = _artisan(steps(ROASTER, plan=ROAST))
    for place in range(100, 340, 60):
        cells = lines[place].split("\t")
        lines[place] = "\t".join([*cells[:2], "-1.0", "-1.0", "", cells[5]])
    lines[50] += ""
    return "roast.csv", "\n".join(lines)[:-6], ROASTER, {"--temperature-column": "BT"}


@writes("Artisan CSV", "hostile")
def _():
    return "roast.csv", "\n".join(_artisan(steps(ROASTER, plan=ROAST).map(lambda degC: 1.8 * degC + 32), unit="F")) + "\n", ROASTER, {"--temperature-column": "BT"}


def _alog(run: Run, *, mode: str = "C", power: bool = True) -> str:
    profile = {"recording_version": "2.10.4", "version": "2.10.4", "mode": mode, "viewerMode": False, "timeindex": [0, 0, 0, 0, 0, 0, 0, 0],
               "title": "Roaster Scope", "roastisodate": "2026-03-14", "roasttime": "09:58:00", "samplinginterval": 2.0,
               "timex": [float(s) for s in run.seconds], "temp1": [round(1.02 * d, 2) for d in run.degC], "temp2": [round(d, 2) for d in run.degC],
               "extradevices": [22], "extraname1": ["Heater %"], "extraname2": ["Fan %"],
               "extratimex": [[float(s) for s in run.seconds]] if power else [],
               "extratemp1": [list(run.power)] if power else [], "extratemp2": [[40.0] * len(run.power)] if power else []}
    return repr(profile)


@writes("Artisan alog", "clean")
def _():
    return "roast.alog", _alog(steps(ROASTER, plan=ROAST)), ROASTER, {"--temperature-column": "BT"}


@writes("Artisan alog", "messy")
def _():
    run = steps(ROASTER, plan=ROAST)
    for place in range(100, 110):
        run.degC[place] = -1.0
    return "roast.alog", _alog(run), ROASTER, {"--temperature-column": "BT"}


@writes("Artisan alog", "hostile")
def _():
    return "roast.alog", _alog(steps(ROASTER, plan=ROAST).map(lambda degC: 1.8 * degC + 32), mode="F"), ROASTER, {"--temperature-column": "BT"}


def _esphome(run: Run, *, colour: bool = False) -> list[str]:
    lines, last = [], None
    begin, end = ("\x1b[0;36m", "\x1b[0m") if colour else ("", "")
    for second, degC, percent, target in run.rows:
        clock = f"[{iso(second)[11:]}]"
        lines.append(f"{begin}{clock}[D][sensor:094]: 'Oven Temperature': Sending state {degC:.5f} °C with 1 decimals of accuracy{end}")
        if percent != last:
            lines.append(f"{begin}{clock}[D][sensor:094]: 'Oven Heat Output': Sending state {percent:.5f} % with 1 decimals of accuracy{end}")
            last = percent
        if int(second) % 60 == 0:
            lines += [f"{begin}{clock}[D][climate:396]: 'Oven' - Sending state:{end}", f"{begin}{clock}[D][climate:399]:   Mode: HEAT{end}",
                      f"{begin}{clock}[D][climate:419]:   Current Temperature: {degC:.2f}°C{end}",
                      f"{begin}{clock}[D][climate:425]:   Target Temperature: {target:.2f}°C{end}",
                      f"{begin}{clock}[D][sensor:094]: 'WiFi Signal': Sending state -61.00000 dBm with 0 decimals of accuracy{end}"]
    return lines


@writes("ESPHome log", "clean")
def _():
    return "esphome.log", "\n".join(_esphome(steps(OVEN))) + "\n", OVEN


@writes("ESPHome log", "messy")
def _():
    lines = _esphome(steps(OVEN), colour=True)
    lines[0:0] = ["INFO ESPHome 2024.12.2", "INFO Starting log output from oven.local using esphome API", "[09:57:59][I][app:100]: ESPHome version 2024.12.2 compiled on Dec 12 2024"]
    clock = lines[200][7:17]
    lines[200:200] = [f"{clock}[W][api.connection:1606]: Can't send to client", f"{clock}[E][max6675.sensor:038]: Got invalid thermocouple reading!",
                      f"{clock}[D][sensor:094]: 'Oven Temperature': Sending state nan °C with 1 decimals of accuracy"]
    return "esphome.log", "\n".join(lines)[:-30], OVEN


@writes("ESPHome log", "hostile")
def _():
    # a relay, which is a switch and no sensor, and a second temperature
    run, lines, last = steps(OVEN, plan=((0, 0), (60, 100), (300, 0), (700, 100), (900, 0))), [], None
    for second, degC, percent, _ in run.rows:
        clock = f"[{iso(second)[11:]}.{137 + int(second) % 7}]"
        lines.append(f"{clock}[D][sensor:135]: 'Oven': Sending state {degC:.5f} °C with 1 decimals of accuracy")
        if int(second) % 30 == 0:
            lines.append(f"{clock}[D][sensor:135]: 'Board Temperature': Sending state 41.2 °C with 1 decimals of accuracy")
        if percent != last:
            lines.append(f"{clock}[D][switch:055]: 'Element': Sending state {'ON' if percent else 'OFF'}")
            last = percent
    return "esphome.log", "\n".join(lines) + "\n", OVEN, {"--tag": "Oven", "--power-tag": "Element"}


@writes("Node-RED JSON lines", "clean")
def _():
    lines = [json.dumps({"timestamp": 1773482280000 + int(1000 * s), "temperature_degC": round(d, 1), "power_pct": p}) for s, d, p, _ in steps(OVEN).rows]
    return "flow.jsonl", "\n".join(lines) + "\n", OVEN


@writes("Node-RED JSON lines", "messy")
def _():
    lines = [json.dumps({"ts": iso(s, mark="T") + "Z", "payload": {"temp": round(d, 1), "heater": p}, "unit": "degC"}) for s, d, p, _ in steps(OVEN).rows]
    lines[100] = '{"ts": "2026-03-14T10:01:20Z", "payload": {"temp": null, "heater": 60}, "unit": "degC"}'
    lines[200] = lines[200][:30]
    lines[300] = "\0" * 20
    return "flow.jsonl", "\n".join(lines)[:-12], OVEN, {"--power-full-scale": "100"}


@writes("Node-RED JSON lines", "hostile")
def _():
    # MQTT: a line for each topic
    lines = []
    for s, d, p, _ in steps(OVEN).rows:
        lines.append(json.dumps({"topic": "oven/1/temperature", "payload": f"{d:.1f}", "qos": 0, "_msgid": "a1", "time": 1773482280.0 + s}))
        lines.append(json.dumps({"topic": "oven/1/heater_pct", "payload": p, "qos": 0, "_msgid": "a2", "time": 1773482280.1 + s}))
    return "mqtt.jsonl", "\n".join(lines) + "\n", OVEN, {"--tag": "oven/1/temperature", "--power-tag": "oven/1/heater_pct"}


def _line_protocol(run: Run, *, apart: bool = False) -> list[str]:
    lines = []
    for s, d, p, _ in run.rows:
        ns = (1773482280 + int(s)) * 10**9
        lines += [f"oven,host=pi,zone=1 temperature={d:.1f} {ns}", f"oven,host=pi,zone=1 power={p:g} {ns}"] if apart else [
            f"oven,host=pi,zone=1 temperature={d:.1f},power={p:g},state=\"run, auto\" {ns}"]
    return lines


@writes("InfluxDB line protocol", "clean")
def _():
    return "oven.lp", "\n".join(_line_protocol(steps(OVEN))) + "\n", OVEN


@writes("InfluxDB line protocol", "messy")
def _():
    lines = ["# DDL", "CREATE DATABASE plant", "# DML", "# CONTEXT-DATABASE: plant", *_line_protocol(steps(OVEN), apart=True)]
    lines[300] = "\0" * 30
    return "oven.lp", "\n".join(lines)[:-25], OVEN


@writes("InfluxDB line protocol", "hostile")
def _():
    lines = [each for s, d, p, _ in steps(OVEN).rows for each in (
        f"zone,name=1 PV={d:.1f},OP={p:g} {1773482280 + int(s)}", f"zone,name=2 PV={18 + (s % 9) / 10:.1f},OP=0 {1773482280 + int(s)}")]
    return "zones.lp", "\n".join(lines) + "\n", OVEN, {
        "--tag": "zone,name=1 PV", "--power-tag": "zone,name=1 OP", "--power-full-scale": "100"}


@writes("Home Assistant", "clean")
def _():
    return "history.csv", text(_history(steps(OVEN))), OVEN


@writes("Home Assistant", "messy")
def _():
    cells = _history(steps(OVEN))
    for place in range(50, 110, 20):
        cells.insert(place, ["sensor.oven_temperature", "unavailable", cells[place][2]])
    return "history.csv", text(cells), OVEN


@writes("Home Assistant", "hostile")
def _():
    cells = _history(steps(OVEN, plan=((0, 0), (60, 100), (300, 0), (700, 100), (900, 0))), power="switch.oven_element")
    return "history.csv", text([[name, {"0": "off", "100": "on"}.get(state, state), moment] for name, state, moment in cells]), OVEN, {
        "--tag": "sensor.oven_temperature", "--power-tag": "switch.oven_element"}


def _history(run: Run, power: str = "number.oven_heater_power") -> list[list[str]]:
    cells, last = [["entity_id", "state", "last_changed"]], {}
    for s, d, p, _ in run.rows:
        for name, state in ((power, f"{p:g}"), ("sensor.oven_temperature", point(d))):
            if last.get(name) != state:
                cells.append([name, state, iso(s, digits=3, mark="T") + "Z"])
                last[name] = state
    return cells


# ---- laboratory and plant ----------------------------------------------------------------------------------------------

def _lvm(run: Run, *, sep: str = "\t", number: Callable[[float, int], str] = point, names: Sequence[str] = ("Temperature", "Heater %")) -> list[str]:
    header = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab", f"Decimal_Separator\t{number(0.5, 1)[1]}",
              "Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tRelative", "Operator\tlab", "Date\t2026/03/14", "Time\t09:58:00.1234567",
              "***End_of_Header***\t", "\t", "Channels\t2\t\t", "Samples\t650\t650\t", "Date\t2026/03/14\t2026/03/14\t", "Time\t09:58:00.12\t09:58:00.12\t",
              "Y_Unit_Label\tdeg C\t%\t", "X_Dimension\tTime\tTime\t", "X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t",
              "Delta_X\t2.000000\t2.000000\t", "***End_of_Header***\t\t\t", sep.join(["X_Value", *names, "Comment"])]
    return header + [sep.join([number(s, 6), number(d, 6), number(p, 6), ""]) for s, d, p, _ in run.rows]


@writes("LabVIEW", "clean")
def _():
    return "oven.lvm", "\r\n".join(_lvm(steps(OVEN))) + "\r\n", OVEN


@writes("LabVIEW", "messy")
def _():
    lines = _lvm(steps(OVEN), number=comma)
    for place in range(100, 340, 60):
        cells = lines[place].split("\t")
        lines[place] = "\t".join([cells[0], "NaN", *cells[2:]])
    return "oven.lvm", "\r\n".join(lines)[:-12], OVEN


@writes("LabVIEW", "hostile")
def _():
    # channels without names; a second section begins after a pause, its time from 0
    run, more = steps(OVEN, until=1100), steps(OVEN, until=400)
    return "oven.lvm", "\r\n".join([*_lvm(run, names=("Untitled", "Untitled 1")), "", *_lvm(more, names=("Untitled", "Untitled 1"))[12:]]) + "\r\n", OVEN, {
        "--temperature-column": "2", "--power-column": "3", "--run": "1"}


def _ignition(run: Run, *, names: Sequence[str] = ("t_stamp", "Oven1/Temperature", "Oven1/Output")) -> list[str]:
    lines = ['"#NAMES"', ",".join(f'"{name}"' for name in names), '"#TYPES"', '"date","D","D"', f'"#ROWS","{len(run.seconds)}"']
    return lines + [f'"{iso(s)}","{d:.2f}","{p:g}"' for s, d, p, _ in run.rows]


@writes("Ignition", "clean")
def _():
    return "trend.csv", "\n".join(_ignition(steps(OVEN))) + "\n", OVEN, {"--power-full-scale": "100"}


@writes("Ignition", "messy")
def _():
    lines = _ignition(steps(OVEN))
    for place in range(100, 340, 60):
        lines[place] = f'{lines[place].split(",")[0]},"null","60"'
    return "trend.csv", "\n".join(lines)[:-8], OVEN, {"--power-full-scale": "100"}


@writes("Ignition", "hostile")
def _():
    # a scaled integer of the PLC and raw output of an analogue card
    run = steps(OVEN)
    lines = _ignition(run, names=("t_stamp", "Oven1/PV_x10", "Oven1/OP_raw"))[:5]
    lines += [f'"{iso(s)}","{round(10 * d)}","{round(p / 100 * 27648)}"' for s, d, p, _ in run.rows]
    return "trend.csv", "\n".join(lines) + "\n", OVEN, {"--power-full-scale": "27648", "--temperature-unit": "0.1degC", "--temperature-scale": "0.1"}


@writes("TIA trace", "clean")
def _():
    cells = [["Sample", "Time stamp (UTC)", "Relative time [ms]", '"DB_Oven".Temperature', '"DB_Oven".OutputPer']]
    cells += [[str(k), iso(s, digits=3), str(int(1000 * s)), point(d, 4), point(p, 4)] for k, (s, d, p, _) in enumerate(steps(OVEN).rows)]
    return "trace.csv", text([[f'{cell}' for cell in row] for row in cells], ";", above=("Measurement;Oven_trace",)), OVEN, {"--power-full-scale": "100"}


@writes("TIA trace", "messy")
def _():
    cells = [["Sample", "Relative time [ms]", "DB_Oven.Temperature [°C]", "DB_Oven.Output [%]", ""]]
    cells += [[str(k), str(int(1000 * s)), comma(d, 4), comma(p, 4), ""] for k, (s, d, p, _) in enumerate(steps(OVEN).rows)]
    return "trace.csv", text(spoil(cells, column=2, marks=("NaN", "#", "---", "Err", "n/a")), ";"), OVEN


@writes("TIA trace", "hostile")
def _():
    # the process value as the card has it, the output as PID_Compact's Output_PER
    cells = [["Sample", "Relative time [ms]", "PID_Compact_1.ScaledInput", "PID_Compact_1.Output_PER"]]
    cells += [[str(k), str(int(1000 * s)), point(d, 4), str(round(p * 276.48))] for k, (s, d, p, _) in enumerate(steps(OVEN).rows)]
    return "trace.csv", text(cells, ";"), OVEN, {"--power-full-scale": "27648"}


def _codesys(run: Run) -> list[str]:
    return ["CoDeSys Trace", "D:\\PROJECTS\\OVEN.PRO", "Cycle PLC_PRG.rOvenTemp PLC_PRG.rHeaterPower",
            *(f"{int(1000 * s)} {d:.3f} {p:g}" for s, d, p, _ in run.rows)]


@writes("CODESYS trace", "clean")
def _():
    return "trace.txt", "\r\n".join(_codesys(steps(OVEN))) + "\r\n", OVEN, {"--time-unit": "ms", "--power-full-scale": "100", "--time-column": "1"}


@writes("CODESYS trace", "messy")
def _():
    lines = _codesys(steps(OVEN))
    lines[200] = "\0" * 12
    return "trace.txt", "\r\n".join(lines)[:-5], OVEN, {"--time-unit": "ms", "--power-full-scale": "100", "--time-column": "1"}


@writes("CODESYS trace", "hostile")
def _():
    # each variable has its own clock
    run = steps(OVEN)
    lines = [";".join(["Time", "PLC_PRG.rOvenTemp", "Time", "PLC_PRG.rHeaterPower"])]
    lines += [f"{int(1000 * s)};{d:.3f};{int(1000 * s) + 500};{p:g}" for s, d, p, _ in run.rows]
    return "trace.csv", "\n".join(lines) + "\n", OVEN, {"--time-unit": "ms", "--power-full-scale": "100", "--time-column": "1"}


def _yokogawa(run: Run, *, spoilt: bool = False) -> list[str]:
    lines = ["Device Type,GX10", "Serial No.,S5T700123", "File Message,", "Time Correction,None", "Starting Condition,Auto", "Dividing Condition,Auto",
             "Meas Cycle,500ms", "Sampling Interval,2s", f"Started Time,{stamped('%Y/%m/%d %H:%M:%S')(0)}.000", "Ch.,,,CH0001,,CH0002,",
             "Tag,,,OVEN TEMP,,HEATER OUT,", "Unit,,,°C,,%,", "Date,Time,sec,MIN,MAX,MIN,MAX"]
    for s, d, p, _ in run.rows:
        cells = (f"{d:.1f}", f"{d + 0.05:.1f}") if not (spoilt and s in (200, 320, 440)) else ("+OVER", "+OVER")
        lines.append(f"{stamped('%Y/%m/%d')(s)},{stamped('%H:%M:%S')(s)},0.000,{cells[0]},{cells[1]},{p:g},{p:g}")
    return lines


@writes("Yokogawa", "clean")
def _():
    run = steps(OVEN)
    lines = ["Device Type,GX10", "Serial No.,S5T700123", "Sampling Interval,2s", "Ch.,,CH0001,CH0002", "Tag,,OVEN TEMP,HEATER OUT", "Unit,,°C,%"]
    lines += [f"{stamped('%Y/%m/%d')(s)},{stamped('%H:%M:%S')(s)},{d:.1f},{p:.1f}" for s, d, p, _ in run.rows]
    return "gx10.csv", "\r\n".join(lines) + "\r\n", OVEN


@writes("Yokogawa", "messy")
def _():
    return "gx10.csv", "\r\n".join(_yokogawa(steps(OVEN), spoilt=True))[:-7], OVEN, {"--temperature-column": "4", "--power-column": "6"}


@writes("Yokogawa", "hostile")
def _():
    # numbers of channels in place of names
    run = steps(OVEN)
    lines = ["Ch.,,CH0001,CH0002", "Unit,,C,"]
    lines += [f"{stamped('%Y/%m/%d')(s)},{stamped('%H:%M:%S')(s)},{d:.1f},{p / 10:.3f}" for s, d, p, _ in run.rows]
    return "dx.csv", "\r\n".join(lines) + "\r\n", OVEN, {"--temperature-column": "CH0001", "--power-column": "CH0002", "--power-full-scale": "10"}


@writes("Testo", "clean")
def _():
    cells = table(steps(OVEN), ("Datum / Uhrzeit", "1 [°C] Temperatur", "2 [%] Heizung"), stamped("%d.%m.%Y %H:%M:%S"), number=comma, power=comma)
    return "testo.csv", text(cells, ";", above=("Gerätename: testo 176 T4", "Seriennummer: 41234567", ""), end="\r\n").encode("cp1252"), OVEN


@writes("Testo", "messy")
def _():
    run = steps(OVEN)
    cells = spoil(table(run, ("Datum / Uhrzeit", "1 [°C] Temperatur", "2 [%] Heizung"), stamped("%d.%m.%Y %H:%M:%S"), number=comma, power=comma),
                  marks=("-----", "-----", "-----", "Err", "-----"), nul=False, cut=False, empty_last=True)
    below = ["", "Minimum;20,1;0,0", "Maximum;56,1;60,0", "Mittelwert;41,0;38,2"]
    return "testo.csv", text(cells, ";", above=("Gerätename: testo 176 T4", "", ""), below=below, end="\r\n").encode("cp1252"), OVEN


@writes("Testo", "hostile")
def _():
    # without a heater's channel: only the temperature was measured
    cells = table(steps(OVEN), ("Datum", "°C"), stamped("%d.%m.%Y %H:%M:%S"), number=comma)
    return "testo.csv", text([row[:2] for row in cells], ";", end="\r\n").encode("cp1252"), OVEN, {}, "no-power"


def _hobo(run: Run, *, spoilt: bool = False) -> list[str]:
    lines = ['"Plot Title: oven"', '"#","Date Time, GMT-05:00","Temp, °C (LGR S/N: 1043, SEN S/N: 1043, LBL: oven)","Heater, % (LGR S/N: 1043, SEN S/N: 1044)",'
             '"Button Down (LGR S/N: 1043)","Host Connected (LGR S/N: 1043)","End Of File (LGR S/N: 1043)"']
    for k, (s, d, p, _) in enumerate(run.rows):
        lines.append(f"{k + 1},{stamped('%m/%d/%y %I:%M:%S %p')(s)},{d:.3f},{p:.3f},,,")
        if spoilt and k in (100, 200):
            lines.append(f"{k + 1},{stamped('%m/%d/%y %I:%M:%S %p')(s + 1)},,,Logged,,")
    return lines


@writes("HOBO", "clean")
def _():
    return "hobo.csv", "\r\n".join(_hobo(steps(OVEN))) + "\r\n", OVEN


@writes("HOBO", "messy")
def _():
    return "hobo.csv", "\r\n".join([*_hobo(steps(OVEN), spoilt=True), f"652,{stamped('%m/%d/%y %I:%M:%S %p')(1302)},,,,Logged,Logged"]) + "\r\n", OVEN


@writes("HOBO", "hostile")
def _():
    lines = [line.replace("Temp, °C", "Temp, °F") for line in _hobo(steps(OVEN).map(lambda degC: 1.8 * degC + 32))]
    return "hobo.csv", "\r\n".join(lines) + "\r\n", OVEN


@writes("Eurotherm", "clean")
def _():
    cells = table(steps(OVEN), ("Date/Time", "Loop.1.Main.PV", "Loop.1.Main.ActiveOut", "Loop.1.Main.TargetSP"), stamped("%d/%m/%Y %H:%M:%S"), setpoint=True)
    return "itools.csv", text(cells), OVEN, {"--power-full-scale": "100"}


@writes("Eurotherm", "messy")
def _():
    run = steps(OVEN)
    cells = spoil(table(run, ("Date/Time", "Loop1.PV (°C)", "Loop1.OP (%)"), stamped("%d/%m/%Y %H:%M:%S")), marks=("S.br", "Sbr", "Bad", "****", "NoPV"))
    return "itools.csv", text(cells, above=("Eurotherm 6100A", "Batch: 17")), OVEN


@writes("Eurotherm", "hostile")
def _():
    # a Modbus logger: register numbers, integers with one decimal
    run = steps(OVEN)
    cells = table(run, ("Timestamp", "PV (reg 1)", "OP (reg 3)"), iso, number=lambda d: str(round(10 * d)), power=lambda p: str(round(10 * p)))
    return "modbus.csv", text(cells), OVEN, {"--temperature-unit": "0.1degC", "--temperature-scale": "0.1", "--power-full-scale": "1000"}


@writes("WinCC", "clean")
def _():
    return "wincc.csv", text(_wincc(steps(OVEN)), ";", end="\r\n"), OVEN, {"--power-full-scale": "100"}


@writes("WinCC", "messy")
def _():
    cells = _wincc(steps(OVEN))
    for place in range(101, 400, 60):
        cells[place][2:4] = ["0,0", "0"]
    return "wincc.csv", text(cells, ";", end="\r\n", below=('"$RT_OFF$";"14.03.2026 10:20:00";0;2;46095430555,6',)), OVEN, {"--power-full-scale": "100"}


@writes("WinCC", "hostile")
def _():
    # raw counts of the analogue output
    cells = _wincc(steps(OVEN), power=lambda p: comma(p / 100 * 27648, 0))
    return "wincc.csv", text(cells, ";", end="\r\n"), OVEN, {"--power-full-scale": "27648"}


def _wincc(run: Run, power: Callable[[float], str] = comma) -> list[list[str]]:
    cells = [['"VarName"', '"TimeString"', '"VarValue"', '"Validity"', '"Time_ms"']]
    for s, d, p, _ in run.rows:
        days = ((START + timedelta(seconds=s)) - datetime(1899, 12, 30)) / timedelta(days=1) * 1e6
        for name, value in (("Oven_Temperature", comma(d, 2)), ("Oven_Output", power(p))):
            cells.append([f'"{name}"', f'"{stamped("%d.%m.%Y %H:%M:%S")(s)}"', value, "1", comma(days, 1)])
    return cells


# ---- coolers, fans, rooms, live zeros, decimal commas ------------------------------------------------------------------

COOLING_GAIN = 0.6
TWO_WAY = ((0, 0), (60, 60), (700, -40), (1400, 25), (2100, -20), (2700, 0))
AIR = ((0, 0), (600, 100), (1200, 0), (1800, 60), (2400, 0))


def with_sides(heater: Heater, *, plan: Sequence[tuple[int, float]] = TWO_WAY, air: Sequence[tuple[int, float]] = ((0, 0),), every: int = 2,
               until: int = 3100, seed: int = 4, cooling_gain: float = COOLING_GAIN, loss: float = 0.0, drift: float = 0.0) -> tuple[Run, list[float], list[float]]:
    """Log a heater that is cooled below 0 %, whose fan multiplies the loss, in a room that warms up: run, fan, room.

    `loss` is by how much the full fan raises the loss; `drift` is how far the room warms up [°C].
    """
    chance, temperature, run, fan, rooms = _chance(seed), heater.room, Run(heater, [], [], [], []), [], []

    def at(course: Sequence[tuple[int, float]], second: float) -> float:
        return next(level for begin, level in reversed(course) if begin <= max(second, 0))

    for second in range(until):
        room = heater.room + drift * min(second / 1500.0, 1.0)
        if second % every == 0:
            for column, value in ((run.seconds, second), (run.degC, temperature + chance.gauss(0.0, 0.05)), (run.power, at(plan, second)),
                                  (run.setpoint, 55.0), (fan, at(air, second)), (rooms, room + chance.gauss(0.0, 0.05))):
                column.append(value)
        power = at(plan, second - heater.dead_time_s)
        power = power if power > 0 else cooling_gain * power
        blown = 1.0 + loss * at(air, second - heater.dead_time_s) / 100.0
        temperature += (heater.gain * power - blown * (temperature - room)) / heater.time_constant_s
    return run, fan, rooms


def _beside(run: Run, header: Sequence[str], *columns: Sequence[str], number: Callable[[float], str] = point,
            power: Callable[[float], str] = point) -> list[list[str]]:
    cells = table(run, header, lambda second: f"{second:g}", number=number, power=power)
    return [cells[0], *([*row, *more] for row, *more in zip(cells[1:], *columns, strict=True))]


@writes("PID_Temp", "clean")
def _():
    run, _, _ = with_sides(OVEN)
    return "pid_temp.csv", text(_beside(run, ("Time [s]", "PID_Temp_1.ProcessValue [°C]", "PID_Temp_1.PidOutputSum [%]"))), OVEN, {}, "cooler"


@writes("PID_Temp", "messy")
def _():
    run, _, _ = with_sides(BED)
    cool = [comma(max(-each, 0.0)) for each in run.power]
    cells = _beside(run, ("Zeit [s]", "Istwert [°C]", "OutputHeat [%]", "OutputCool [%]"), cool, number=comma, power=lambda p: comma(max(p, 0.0)))
    return "pid_temp.csv", text(spoil(cells, marks=MARKS[:3]), ";", end="\r\n"), BED, {}, "cooler"


@writes("PID_Temp", "hostile")
def _():
    # no unit, and the same numbers may be a heater that is off at -100
    run, _, _ = with_sides(OVEN)
    cells = _beside(run, ("t", "PV", "Output"))
    return "trace.csv", text(cells), OVEN, {"--time-unit": "s", "--temperature-unit": "degC", "--power-full-scale": "100"}, "cooler"


@writes("Peltier rig", "messy")
def _():
    run, _, _ = with_sides(OVEN, every=5)
    cells = _beside(run, ("time [s]", "T [°C]", "H-bridge output [-255...255]"), power=lambda p: f"{p * 2.55:.0f}")
    return "peltier.csv", text(cells), OVEN, {"--power-full-scale": "255"}, "cooler"


@writes("bipolar output", "hostile")
def _():
    # FB 43 with ST2BI_ON: -100 is off
    run = steps(OVEN)
    cells = table(run, ("time [s]", "Temp [°C]", "INV [%]"), point, power=lambda p: point(2.0 * p - 100.0))
    return "bipolar.csv", text(cells), OVEN, {"--power-levels": "-100 100", "--power-column": "3"}


@writes("fan", "clean")
def _():
    run, fan, _ = with_sides(OVEN, plan=((0, 0), (60, 60), (1500, 30)), air=AIR, loss=0.8)
    return "fan.csv", text(_beside(run, ("time [s]", "Temp [°C]", "Heater [%]", "Fan [%]"), [f"{each:g}" for each in fan])), OVEN


@writes("fan", "messy")
def _():
    run, fan, _ = with_sides(BED, plan=((0, 0), (60, 60), (1500, 30)), air=((0, 0), (900, 100), (2000, 0)), loss=0.5)
    cells = _beside(run, ("Zeit [s]", "Temperatur [°C]", "Heizung [%]", "Lüfter"), ["EIN" if each else "AUS" for each in fan], number=comma, power=comma)
    return "luefter.csv", text(cells, ";", end="\r\n"), BED


@writes("fan", "hostile")
def _():
    # the fan's output is the heater's, in another unit: nothing tells the two apart
    run = steps(OVEN)
    return "fan.csv", text(_beside(run, ("time [s]", "Temp [°C]", "Heater [%]", "Fan [rpm]"), [f"{14.5 * each:g}" for each in run.power])), OVEN


@writes("room", "clean")
def _():
    run, _, rooms = with_sides(OVEN, plan=((0, 0), (60, 60), (700, 20), (1500, 40)))
    return "room.csv", text(_beside(run, ("time [s]", "Temp [°C]", "Heater [%]", "Room temp [°C]"), [point(each) for each in rooms])), OVEN


@writes("room", "messy")
def _():
    run, _, rooms = with_sides(OVEN, plan=((0, 0), (60, 60), (700, 20), (1500, 40)), drift=6.0)
    cells = _beside(run, ("Zeit [s]", "Ofen °C", "Heizung %", "Umgebung °C"), [comma(each) for each in rooms], number=comma, power=comma)
    return "raum.csv", text(cells, ";"), OVEN


@writes("room", "hostile")
def _():
    run, _, rooms = with_sides(OVEN, plan=((0, 30), (700, 60), (1500, 40)), drift=-4.0)
    cells = _beside(run, ("time [s]", "oven temp (F)", "Output %", "ambient (F)"), [point(32.0 + 1.8 * each) for each in rooms],
                    number=lambda d: point(32.0 + 1.8 * d))
    return "room.csv", text(cells), OVEN, {"--power-before": "0"}


@writes("4-20 mA", "clean")
def _():
    return "loop.csv", text(table(steps(OVEN), ("time [s]", "Temp [°C]", "Heater [mA]"), point, power=lambda p: f"{4 + 0.16 * p:.2f}")), OVEN, {
        "--power-levels": "4 20"}


@writes("4-20 mA", "messy")
def _():
    # the card's zero is low by 0.03 mA
    cells = table(steps(OVEN), ("Zeit [s]", "Temperatur [°C]", "Stellstrom (mA)"), comma, number=comma, power=lambda p: comma(3.97 + 0.16 * p, 2))
    return "strom.csv", text(cells, ";"), OVEN, {"--power-levels": "4 20"}


@writes("4-20 mA", "hostile")
def _():
    # nothing says milliamperes, and both ends are reached
    plan = ((0, 0), (60, 100), (400, 30))
    return "loop.csv", text(table(steps(OVEN, plan=plan), ("time [s]", "Temp [°C]", "Output"), point, power=lambda p: f"{4 + 0.16 * p:.2f}")), OVEN, {
        "--power-levels": "4 20"}


@writes("1-5 V", "messy")
def _():
    return "daq.csv", text(table(steps(OVEN), ("time [s]", "Temp [°C]", "Control [V]"), point, power=lambda p: f"{1 + 0.04 * p:.3f}")), OVEN, {
        "--power-levels": "1 5"}


@writes("2-10 V", "hostile")
def _():
    # a range of 0-10 V would fit the numbers as well
    return "valve.csv", text(table(steps(OVEN), ("time [s]", "Temp [°C]", "Heizung (V)"), point, power=lambda p: f"{2 + 0.08 * p:.2f}")), OVEN, {
        "--power-levels": "2 10"}


@writes("decimal commas between commas", "clean")
def _():
    return "log.csv", text(table(steps(OVEN), ("Zeit [s]", "Temperatur [°C]", "Leistung [%]"), comma, number=comma, power=comma)), OVEN


@writes("decimal commas between commas", "messy")
def _():
    cells = table(steps(OVEN), ("Zeit", "Temperatur [°C]", "Leistung [%]"), iso, number=lambda d: comma(d, 2))
    cells[200] = cells[200][:1]
    return "log.csv", text(cells, above=("Ofen 3,Charge 12",), end="\r\n"), OVEN


@writes("decimal commas between commas", "hostile")
def _():
    cells = table(steps(OVEN), (), lambda second: f"{second:g}", number=lambda d: comma(d, 2))[1:]
    return "log.csv", text(cells), OVEN, {"--decimal-comma": "2", "--time-unit": "s", "--temperature-unit": "degC", "--power-full-scale": "100"}


# ---- languages ---------------------------------------------------------------------------------------------------------

LANGUAGES = {
    "French": ("Temps [s]", "Température [°C]", "Puissance [%]", "utf-8"), "Spanish": ("Tiempo (s)", "Temperatura (°C)", "Potencia (%)", "cp1252"),
    "Italian": ("Tempo [s]", "Temperatura [°C]", "Potenza [%]", "utf-8"), "Dutch": ("Tijd [s]", "Temperatuur [°C]", "Vermogen [%]", "utf-8"),
    "Polish": ("Czas [s]", "Temperatura [°C]", "Moc [%]", "cp1250"), "Czech": ("Čas [s]", "Teplota [°C]", "Výkon [%]", "cp1250"),
    "Russian": ("Время [с]", "Температура [°C]", "Мощность [%]", "cp1251"), "Chinese": ("时间 [s]", "温度 [°C]", "功率 [%]", "gb18030"),
    "Swedish": ("Tid [s]", "Temperatur [°C]", "Effekt [%]", "utf-8"), "Turkish": ("Zaman [s]", "Sıcaklık [°C]", "Güç [%]", "cp1254"),
    "Korean": ("시간 [s]", "온도 [°C]", "출력 [%]", "cp949"), "Finnish": ("Aika [s]", "Lämpötila [°C]", "Teho [%]", "utf-8"),
}


def _add_language(language: str) -> None:
    *header, encoding = LANGUAGES[language]

    @writes(f"names in {language}", "clean")
    def _():
        return "log.csv", text(table(steps(OVEN), header, point), ";").encode(encoding), OVEN, {
            "--time-column": "1", "--temperature-column": "2", "--power-column": "3"}


for each in LANGUAGES:
    _add_language(each)


def damage(content: bytes, chance: random.Random) -> bytes:
    """Return a file with some of its bytes or lines lost, doubled, mixed or replaced."""
    kind = chance.randrange(5)
    if kind == 0:
        return content[: chance.randrange(len(content))]
    if kind == 1:
        changed = bytearray(content)
        for _ in range(chance.randrange(1, 12)):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        return bytes(changed)
    lines = content.split(b"\n")
    if kind == 2:
        del lines[chance.randrange(len(lines)) :: chance.randrange(1, 50)]
    elif kind == 3:
        begin = chance.randrange(len(lines))
        lines[begin:begin] = lines[begin // 2 : begin // 2 + 30]
    else:
        chance.shuffle(lines)
    return b"\n".join(lines)

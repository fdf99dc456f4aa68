"""Exports of kinds that `tool_exports` has not: locales, clocks, units of power, repeats and remains of many programs.

    python -m tests.bench.locale_exports [--verbose] [--fit]

Each is read to its readings, row by row, or is a question; what it asks for is typed. Without `--fit` the heater is not
fitted: an instant, a temperature or a power that is wrong shows in the rows themselves.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from tests.bench.messy import CLASSES, REMEDY, RIGHT, STUCK, WRONG, asked_for, judge
from tests.bench.tool_exports import OVEN, START, Export, Run, comma, iso, point, stamped, steps, table, text

WRITERS: list[tuple[str, str, Callable[[], tuple[Any, ...]]]] = []
HEAD = ("Time", "Temperature [°C]", "Power [%]")
_TURNS = 6


def writes(name: str, level: str = "messy") -> Callable[[Callable[[], tuple[Any, ...]]], Callable[[], tuple[Any, ...]]]:
    def add(writer: Callable[[], tuple[Any, ...]]) -> Callable[[], tuple[Any, ...]]:
        WRITERS.append((name, level, writer))
        return writer

    return add


def exports(name: str | None = None) -> list[Export]:
    made = []
    for tool, level, writer in WRITERS:
        if name in (None, tool):
            file, content, *more = writer()
            made.append(Export(tool, level, file, content if isinstance(content, bytes) else content.encode(), OVEN, *more))
    return made


RUN = steps(OVEN)
SWITCHED = steps(OVEN, plan=((0, 0), (60, 100), (300, 0), (700, 100), (900, 0)))
#: exports of the switched run, of other rows, or of another first instant
OTHER_RUN: dict[str, Run] = {}


def switched(name: str) -> None:
    OTHER_RUN[name] = SWITCHED


def csv(when: Callable[[float], str], *, run: Run = RUN, head: Sequence[str] = HEAD, sep: str = ",", number: Callable[[float], str] = point,
        power: Callable[[float], str] = lambda value: f"{value:g}", **more: Any) -> str:
    return text(table(run, head, when, number=number, power=power), sep, **more)


# ---- clocks -----------------------------------------------------------------------------------------------------------

CLOCKS: dict[str, tuple[Callable[[float], str], dict[str, str]]] = {
    "ISO with Z and nanoseconds": (lambda s: iso(s, mark="T") + ".000000000Z", {}),
    "ISO with seven digits": (lambda s: iso(s) + ".0000000", {}),
    "ISO with an offset": (lambda s: iso(s, mark="T") + "+0100", {}),
    "ISO with an offset of a blank": (lambda s: iso(s) + " +01:00", {}),
    "ISO with a zone's name": (lambda s: iso(s) + " CET", {}),
    "ISO with GMT": (lambda s: iso(s) + " GMT", {}),
    "ISO basic": (stamped("%Y%m%dT%H%M%S"), {}),
    "digits of date and time": (stamped("%Y%m%d%H%M%S"), {"--log-interval": "2"}),
    "digits with a blank": (stamped("%Y%m%d %H%M%S"), {"--log-interval": "2"}),
    "DB2": (stamped("%Y-%m-%d-%H.%M.%S.000000"), {"--log-interval": "2"}),
    "dotted, year first": (stamped("%Y.%m.%d %H:%M:%S"), {}),
    "dots in the clock": (stamped("%d.%m.%Y %H.%M.%S"), {}),
    "dashes, day first": (stamped("%d-%m-%Y %H:%M:%S"), {}),
    "two digits of the year first": (stamped("%y/%m/%d %H:%M:%S"), {"--log-interval": "2"}),
    "ctime": (stamped("%a %b %d %H:%M:%S %Y"), {}),
    "mail": (stamped('"%a, %d %b %Y %H:%M:%S +0100"'), {}),
    "month in capitals": (lambda s: stamped("%d-%b-%Y %H:%M:%S")(s).upper(), {}),
    "two digits of a year behind a month": (stamped("%d-%b-%y %H:%M:%S"), {}),
    "German month": (stamped("%d. März %Y %H:%M:%S"), {}),
    "French month": (stamped("%d mars %Y %H:%M:%S"), {"--log-interval": "2"}),
    "US with a dash": (stamped("%m-%d-%Y %I:%M:%S %p"), {"--log-interval": "2"}),
    "12 hours in small letters": (lambda s: stamped("%m/%d/%Y %I:%M:%S %p")(s).lower(), {}),
    "12 hours, Spanish": (lambda s: stamped("%d/%m/%Y %I:%M:%S %p")(s).replace("AM", "a. m.").replace("PM", "p. m."), {}),
    "12 hours, narrow blank": (stamped('"%m/%d/%Y, %I:%M:%S\u202f%p"'), {}),
    "12 hours, Chinese": (lambda s: stamped("%Y/%m/%d %p%I:%M:%S")(s).replace("AM", "上午").replace("PM", "下午"), {"--log-interval": "2"}),
    "12 hours, Korean": (lambda s: stamped("%Y. %m. %d. %p %I:%M:%S")(s).replace("AM", "오전").replace("PM", "오후"), {"--log-interval": "2"}),
    "epoch in s": (lambda s: f"{1773482280 + s:.0f}", {"--time-unit": "s"}),
    "epoch in s with decimals": (lambda s: f"{1773482280 + s:.3f}", {"--time-unit": "s"}),
    "epoch in ms": (lambda s: f"{(1773482280 + s) * 1000:.0f}", {"--time-unit": "ms"}),
    "epoch in us": (lambda s: f"{round((1773482280 + s) * 1000) * 1000}", {"--time-unit": "us"}),
    "epoch in ns": (lambda s: f"{round(1773482280 + s) * 10**9}", {"--time-unit": "ns"}),
    "epoch, scientific": (lambda s: f"{(1773482280 + s) * 1000:.12E}", {"--time-unit": "ms"}),
    "serial dates": (lambda s: f"{46095.415277777778 + s / 86400:.9f}", {"--time-unit": "d"}),
    "serial dates, comma": (lambda s: f'"{46095.415277777778 + s / 86400:.9f}"'.replace(".", ","), {"--time-unit": "d"}),
    "MATLAB's datenum": (lambda s: f"{740055.415277777778 + s / 86400:.10f}", {"--time-unit": "d"}),
    "LabVIEW's seconds since 1904": (lambda s: f"{3856327080 + s:.3f}", {"--time-unit": "s"}),
    "pandas Timedelta": (lambda s: f"0 days {timedelta(seconds=s)!s:0>8}", {"--log-interval": "2"}),
    "elapsed over a day": (lambda s: f"{(int(s) + 86000) // 3600}:{(int(s) + 86000) % 3600 // 60:02d}:{(int(s) + 86000) % 60:02d}", {}),
    "ISO 8601 duration": (lambda s: f"PT{int(s) // 60}M{int(s) % 60}S", {}),
    "two digits of the year first, over midnight": (lambda s: (START + timedelta(seconds=s + 50400 - 600)).strftime("%y/%m/%d %H:%M:%S"), {}),
    "two digits of the year last, over midnight": (lambda s: (START + timedelta(seconds=s + 50400 - 600)).strftime("%d/%m/%y %H:%M:%S"), {}),
    "Java": (lambda s: iso(s, mark="T") + "+01:00[Europe/Berlin]", {}),
    "a zone that changes": (lambda s: iso(s) + " EST" if s < 600 else iso(s + 3600) + " EDT", {}),
    "digits to the minute's thousandth": (lambda s: stamped("%Y%m%d%H%M%S")(s) + "000", {}),
    "Oracle": (lambda s: stamped("%d-%b-%y %I.%M.%S.000000 %p")(s).upper(), {}),
    "Unix date": (stamped("%a %b %d %H:%M:%S CET %Y"), {}),
    "Portuguese in words": (stamped("%d de março de %Y %H:%M:%S"), {}),
    "elapsed with words": (lambda s: f"{int(s) // 60}m {int(s) % 60}s", {"--log-interval": "2"}),
    "hours with letters": (stamped("%Hh%Mm%Ss"), {"--log-interval": "2"}),
    "clock without a leading zero, am": (lambda s: stamped("%I:%M:%S %p")(s).lstrip("0"), {}),
    "over midnight with a date": (lambda s: iso(s + 50400 - 600), {}),
    "over midnight without one": (lambda s: iso(s + 50400 - 600)[11:], {}),
    "into a leap day": (lambda s: (START.replace(year=2028, month=2, day=28, hour=23, minute=50) + timedelta(seconds=s)).strftime(
        "%d.%m.%Y %H:%M:%S"), {}),
    "over New Year": (lambda s: (START.replace(year=2026, month=12, day=31, hour=23, minute=50) + timedelta(seconds=s)).strftime(
        "%m/%d/%Y %H:%M:%S"), {}),
    "summer time begins, zone told": (lambda s: iso(s) + "+01:00" if s < 600 else iso(s + 3600) + "+02:00", {}),
    "sample number": (lambda s: f"{int(s) // 2 + 1}", {"--log-interval": "2"}),
    "scientific seconds": (lambda s: f"{s:.6E}", {"--time-unit": "s"}),
    "seconds with a unit": (lambda s: f"{s:.1f} s", {}),
    "a quote before the stamp": (lambda s: "'" + iso(s), {}),
    "an equals sign before the stamp": (lambda s: f'="{iso(s)}"', {}),
    "brackets round the stamp": (lambda s: f"[{iso(s)}]", {}),
}

for _name, (_when, _user) in CLOCKS.items():
    def _clock(_when: Callable[[float], str] = _when, _user: dict[str, str] = _user) -> tuple[Any, ...]:
        return "clock.csv", csv(_when), _user
    writes(f"clock: {_name}")(_clock)


@writes("clock: summer time begins, no zone", "hostile")
def _():
    # the clock goes on by an hour in the middle: a pause of an hour that was none
    return "clock.csv", csv(lambda s: iso(s if s < 600 else s + 3600)), {"--log-interval": "2"}


@writes("clock: summer time ends, no zone", "hostile")
def _():
    return "clock.csv", csv(lambda s: iso(s if s < 600 else s - 3600)), {"--log-interval": "2"}


@writes("clock: date only in the first row of a day")
def _():
    cells = [["Date", *HEAD], *([iso(s)[:10] if s == 0 else "", iso(s)[11:], point(d), f"{p:g}"] for s, d, p, _ in RUN.rows)]
    return "merged.csv", text(cells), {}


@writes("clock: minutes and seconds in two columns", "hostile")
def _():
    cells = [["min", "s", "Temperature [°C]", "Power [%]"], *([f"{int(s) // 60}", f"{int(s) % 60}", point(d), f"{p:g}"] for s, d, p, _ in RUN.rows)]
    return "two.csv", text(cells), {"--log-interval": "2"}


@writes("clock: milliseconds in a column of their own")
def _():
    run = steps(OVEN, every=1, until=900)
    OTHER_RUN["clock: milliseconds in a column of their own"] = Run(OVEN, [s / 2 for s in run.seconds], run.degC, run.power, run.setpoint)
    cells = [["Date", "Time", "ms", "Temp [°C]", "Out [%]"], *(
        [iso(s / 2)[:10], iso(s / 2)[11:], f"{round(s * 500) % 1000}", point(d), f"{p:g}"] for s, d, p, _ in run.rows)]
    return "ms.csv", text(cells), {"--log-interval": "0.5"}


# ---- numbers ----------------------------------------------------------------------------------------------------------

HOT = Run(OVEN, RUN.seconds, [d * 20 + 600 for d in RUN.degC], RUN.power, RUN.setpoint)
NUMBERS: dict[str, tuple[Callable[[float], str], str, Run, dict[str, str]]] = {
    "thousands by commas, quoted": (lambda d: f'"{d:,.1f}"', ",", HOT, {}),
    "thousands by commas, semicolons": (lambda d: f"{d:,.1f}", ";", HOT, {}),
    "thousands by points": (lambda d: f"{d:,.1f}".translate(str.maketrans(",.", ".,")), ";", HOT, {}),
    "thousands by blanks": (lambda d: f"{d:,.1f}".translate(str.maketrans(",.", "\u00a0,")), ";", HOT, {}),
    "thousands by narrow blanks": (lambda d: f"{d:,.1f}".translate(str.maketrans(",.", "\u202f,")), ";", HOT, {}),
    "thousands by apostrophes": (lambda d: f"{d:,.1f}".replace(",", "'"), ";", HOT, {}),
    "thousands by Swiss apostrophes": (lambda d: f"{d:,.1f}".replace(",", "’"), ";", HOT, {}),
    "thousands by commas, whole": (lambda d: f'"{d:,.0f}"', ",", HOT, {"--decimal-comma": "none"}),
    "thousands by points, whole": (lambda d: f"{d:,.0f}".replace(",", "."), ";", HOT, {"--decimal-comma": "2"}),
    "thousands by commas from 900 on, whole": (lambda d: f'"{d:,.0f}"', ",", HOT.map(lambda d: d - 100), {}),
    "thousands by points from 900 on, whole": (lambda d: f"{d:,.0f}".replace(",", "."), ";", HOT.map(lambda d: d - 100), {}),
    "thousands with a unit": (lambda d: f'"{d:,.1f} °C"', ",", HOT, {}),
    "three decimals by commas between 1 and 2": (lambda d: f'"{d:.3f}"'.replace(".", ","), ",", Run(
        OVEN, HOT.seconds, [d / 1000 for d in HOT.degC], HOT.power, HOT.setpoint), {"--decimal-comma": "Temperature [°C]"}),
    "three decimals": (lambda d: f"{d:.3f}", ",", RUN, {}),
    "three decimals by commas": (lambda d: f"{d:.3f}".replace(".", ","), ";", RUN, {}),
    "scientific": (lambda d: f"{d:.3E}", ",", RUN, {}),
    "scientific with commas": (lambda d: f"{d:.3E}".replace(".", ","), ";", RUN, {}),
    "Fortran": (lambda d: f"{d:.3E}".replace("E", "D"), ",", RUN, {}),
    "quoted": (lambda d: f'"{d:.1f}"', ",", RUN, {}),
    "single quotes": (lambda d: f"'{d:.1f}'", ",", RUN, {}),
    "quoted with commas": (lambda d: f'"{comma(d)}"', ",", RUN, {}),
    "plus signs": (lambda d: f"{d:+.1f}", ",", RUN, {}),
    "leading zeros": (lambda d: f"{d:07.1f}", ",", RUN, {}),
    "equals signs": (lambda d: f'="{d:.1f}"', ",", RUN, {}),
    "unit behind the number": (lambda d: f"{d:.1f}°C", ",", RUN, {}),
    "unit and comma": (lambda d: f"{comma(d)} °C", ";", RUN, {}),
    "degrees alone": (lambda d: f"{d:.1f}°", ",", RUN, {}),
    "a mark for a valid value": (lambda d: f"{d:.1f}*" if int(d * 10) % 50 == 0 else f"{d:.1f}", ",", RUN, {}),
    "full width digits": (lambda d: f"{d:.1f}".translate(str.maketrans("0123456789.", "０１２３４５６７８９．")), ",", RUN, {"--log-interval": "2"}),
}

for _name, (_number, _sep, _run, _user) in NUMBERS.items():
    OTHER_RUN[f"number: {_name}"] = _run

    def _figure(_number: Callable[[float], str] = _number, _sep: str = _sep, _run: Run = _run, _user: dict[str, str] = _user) -> tuple[Any, ...]:
        return "number.csv", csv(iso, run=_run, number=_number, sep=_sep), _user
    writes(f"number: {_name}")(_figure)


@writes("number: a minus of typographers below zero")
def _():
    run = RUN.map(lambda d: d - 40)
    OTHER_RUN["number: a minus of typographers below zero"] = run
    return "cold.csv", csv(iso, run=run, number=lambda d: point(d).replace("-", "−")), {}


@writes("number: negative zero")
def _():
    run = RUN.map(lambda d: d - 20.3)
    OTHER_RUN["number: negative zero"] = run
    return "cold.csv", csv(iso, run=run, power=lambda p: f"{-0.0 if p == 0 else p:.1f}"), {}


@writes("number: accountants' brackets below zero")
def _():
    run = RUN.map(lambda d: d - 40)
    OTHER_RUN["number: accountants' brackets below zero"] = run
    return "cold.csv", csv(iso, run=run, number=lambda d: f"({-d:.1f})" if d < 0 else point(d)), {}


# ---- power ------------------------------------------------------------------------------------------------------------

Power = tuple[str, Callable[[float], str], dict[str, str]]


def whole(head: str, full: int = 100, user: dict[str, str] | None = None) -> Power:
    """Return a power of whole numbers up to its full scale, and what the user knows of it."""
    scale = {} if full == 100 else {"--power-full-scale": f"{full}"}
    return head, lambda p: f"{p * full / 100:.0f}", scale | (user or {})


POWERS: dict[str, Power] = {
    "kW": ("Power [kW]", lambda p: f"{p * 0.06:.2f}", {"--power-full-scale": "6"}),
    "W": ("P (W)", lambda p: f"{p * 24:.0f}", {"--power-full-scale": "2400", "--power-column": "P (W)"}),
    "W, thousands": ("Heater power / W", lambda p: f'"{p * 24:,.0f}"', {"--power-full-scale": "2400"}),
    "mA, live zero": ("Output mA", lambda p: f"{4 + p * 0.16:.2f}", {"--power-levels": "4 20"}),
    "A": ("I heater [A]", lambda p: f"{p * 0.1:.2f}", {"--power-full-scale": "10"}),
    "V": ("Stellspannung [V]", lambda p: f"{p * 0.1:.2f}", {"--power-full-scale": "10"}),
    "share, no unit": ("duty", lambda p: f"{p / 100:.2f}", {"--power-full-scale": "1"}),
    "counts of 4095": whole("DAC out", 4095),
    "counts of 32767": whole("CV", 32767),
    "counts of 1023": whole("pwm", 1023),
    "counts of 255": whole("PWM", 255),
    "tenths of a percent": whole("Y [0.1 %]", 1000, {"--power-column": "Y [0.1 %]"}),
    "permille": whole("Stellgrad ‰", 1000),
    "percent in the cells": ("Heizung", lambda p: f"{p:.0f}%", {}),
    "percent in the cells, blank": ("Heizung", lambda p: f"{p:.0f} %", {}),
    "a name in Polish": whole("Moc grzałki [%]"),
    "a name in Hungarian": whole("Fűtés [%]", user={"--power-column": "Fűtés [%]"}),
    "a name in Greek": whole("Ισχύς [%]", user={"--power-column": "Ισχύς [%]"}),
    "a name in Norwegian": whole("Pådrag [%]", user={"--power-column": "Pådrag [%]"}),
    "a name in Swedish": whole("Värme [%]", user={"--power-column": "Värme [%]"}),
    "a name in Ukrainian": whole("Потужність [%]", user={"--power-column": "Потужність [%]"}),
    "a name in Hebrew": whole("הספק [%]", user={"--power-column": "הספק [%]"}),
    "a name in Romanian": whole("Putere [%]", user={"--power-column": "Putere [%]"}),
    "a name in Thai": whole("กำลัง [%]", user={"--power-column": "กำลัง [%]"}),
}

for _name, (_head, _power, _user) in POWERS.items():
    def _write_power(_head: str = _head, _power: Callable[[float], str] = _power, _user: dict[str, str] = _user) -> tuple[Any, ...]:
        return "power.csv", csv(iso, head=(HEAD[0], HEAD[1], _head), power=_power), _user
    writes(f"power: {_name}")(_write_power)

SWITCH_WORDS = {
    "French": ("Chauffage", "Marche", "Arrêt"), "French, vrai": ("Chauffage", "VRAI", "FAUX"), "Spanish": ("Calefacción", "Encendido", "Apagado"),
    "Spanish, sí": ("Calefacción", "sí", "no"), "Spanish, verdadero": ("Calefacción", "VERDADERO", "FALSO"), "Italian": ("Riscaldamento", "acceso", "spento"),
    "Italian, vero": ("Riscaldamento", "VERO", "FALSO"), "Dutch": ("Verwarming", "aan", "uit"), "Dutch, waar": ("Verwarming", "WAAR", "ONWAAR"),
    "Polish": ("Grzałka", "włączona", "wyłączona"), "Polish, prawda": ("Grzałka", "PRAWDA", "FAŁSZ"), "Czech": ("Topení", "zapnuto", "vypnuto"),
    "Russian": ("Нагрев", "ВКЛ", "ВЫКЛ"), "Russian, истина": ("Нагрев", "ИСТИНА", "ЛОЖЬ"), "Turkish": ("Isıtıcı", "açık", "kapalı"),
    "Swedish": ("Värme", "till", "från"), "Danish": ("Varme", "tændt", "slukket"), "Finnish": ("Lämmitys", "päällä", "pois"),
    "Hungarian": ("Fűtés", "be", "ki"), "Chinese": ("加热", "开", "关"), "Chinese, long": ("加热", "开启", "关闭"), "Korean": ("히터", "켜짐", "꺼짐"),
    "Japanese": ("ヒーター", "入", "切"), "Portuguese": ("Aquecimento", "Ligado", "Desligado"), "T and F": ("Heater", "T", "F"),
    "Y and N": ("Heater on?", "Y", "N"), "open and closed": ("Relay", "closed", "open"), "1 and 0 with a name": ("Heater relay", "1", "0"),
    "ON and blank": ("Heater", "ON", ""), "Greek": ("Θέρμανση", "ΝΑΙ", "ΟΧΙ"), "quoted": ("Heater", '"true"', '"false"'),
}

for _name, (_head, _on, _off) in SWITCH_WORDS.items():
    switched(f"switch: {_name}")

    def _write_switch(_head: str = _head, _on: str = _on, _off: str = _off) -> tuple[Any, ...]:
        body = csv(iso, run=SWITCHED, head=(HEAD[0], HEAD[1], _head), power=lambda p: _on if p else _off)
        return "switch.csv", body, {"--power-column": _head, "--power-on": _on}
    writes(f"switch: {_name}")(_write_switch)


# ---- tables -----------------------------------------------------------------------------------------------------------

@writes("table: header again every 100 rows")
def _():
    cells = table(RUN, HEAD, iso)
    for place in range(500, 0, -100):
        cells.insert(place, list(HEAD))
    return "again.csv", text(cells), {}


@writes("table: header again, a unit row below each")
def _():
    head, units = ["Time", "Oven", "Heater"], ["", "°C", "%"]
    body = table(RUN, head, iso)[1:]
    cells = [head, units]
    for place in range(0, len(body), 150):
        cells += [*body[place:place + 150], *([head, units] if place + 150 < len(body) else [])]
    return "again.csv", text(cells), {"--temperature-column": "Oven [°C]"}


@writes("table: header again in other words", "hostile")
def _():
    # the logger was set to German in the middle
    cells = table(RUN, HEAD, iso)
    cells.insert(300, ["Zeit", "Temperatur [°C]", "Leistung [%]"])
    return "again.csv", text(cells), {}


@writes("table: BOM and sep=")
def _():
    return "bom.csv", "\ufeffsep=;\r\n" + csv(iso, sep=";", number=comma, end="\r\n"), {}


@writes("table: BOM in the middle")
def _():
    # two files put one behind the other
    lines = csv(iso).splitlines()
    return "cat.csv", "\ufeff" + "\n".join(lines[:300]) + "\n\ufeff" + "\n".join([lines[0], *lines[300:]]) + "\n", {}


@writes("table: UTF-16 with tabs")
def _():
    return "wide.txt", csv(iso, sep="\t", number=comma, end="\r\n").encode("utf-16"), {}


@writes("table: UTF-16BE without a mark")
def _():
    return "wide.txt", csv(iso, sep="\t", end="\r\n").encode("utf-16-be"), {}


@writes("table: UTF-8 in which a degree sign was cut")
def _():
    return "cut.csv", csv(iso).encode().replace("°".encode(), b"\xc2", 1), {"--temperature-unit": "degC"}


@writes("table: UTF-8 read as Latin-1 and written again")
def _():
    return "moji.csv", csv(iso).replace("°", "Â°"), {"--temperature-unit": "degC"}


@writes("table: names of a Mac")
def _():
    return "mac.csv", csv(iso, head=("Time", "Température [°C]", "Puissance [%]")).replace("\n", "\r").encode("mac-roman"), {
        "--temperature-unit": "degC", "--temperature-column": "2", "--power-column": "3"}


@writes("table: names of DOS")
def _():
    return "dos.csv", csv(iso, head=("Zeit", "Temperatur Ofen [°C]", "Heizung für Ofen [%]"), sep=";", end="\r\n").encode("cp850"), {
        "--temperature-unit": "degC"}


@writes("table: comments at the end")
def _():
    return "end.csv", csv(iso, below=["", "# end of record", "# operator: J. Smith", "# 650 samples, 0 errors"]), {}


@writes("table: a statistics block at the end")
def _():
    return "end.csv", csv(iso, below=["", "Statistics,,", "Min,20.1,0", "Max,55.2,60", "Average,40.0,31.2", "Std. dev.,9.1,20"]), {}


@writes("table: a second table below", "hostile")
def _():
    alarms = ["", "Alarms", "Time,Text,State", *(f"{iso(60 * k)},Temperature low,{'came' if k % 2 else 'went'}" for k in range(12))]
    return "two.csv", csv(iso, below=alarms), {}


@writes("table: comments in between")
def _():
    cells = csv(iso).splitlines()
    for place in range(500, 50, -90):
        cells.insert(place, f"# {iso(2 * place)}: operator opened the door")
    return "notes.csv", "\n".join(cells) + "\n", {}


@writes("table: a column of notes")
def _():
    cells = table(RUN, (*HEAD, "Remarks"), iso)
    cells = [cells[0], *([*row, "door opened, closed" if k in (100, 300) else ""] for k, row in enumerate(cells[1:]))]
    return "notes.csv", "\n".join(",".join(f'"{cell}"' for cell in row) for row in cells) + "\n", {}


@writes("table: a note with commas, not quoted")
def _():
    cells = table(RUN, (*HEAD, "Remarks"), iso)
    cells = [cells[0], *([*row, "door opened, closed, ok" if k in (100, 300) else ""] for k, row in enumerate(cells[1:]))]
    return "notes.csv", text(cells), {"--skip-empty": ""}


@writes("table: a note over two lines")
def _():
    cells = table(RUN, (*HEAD, "Remarks"), iso)
    cells = [cells[0], *([*row, '"door\nopened"' if k in (100, 300) else ""] for k, row in enumerate(cells[1:]))]
    return "notes.csv", text(cells), {"--skip-empty": ""}


@writes("table: merged title cells, units in a third row")
def _():
    head = ["Oven 3,,,", "Plant A;B,,,", "Time,Actual,,Output", ",Temperature,Setpoint,Heater", "hh:mm:ss,°C,°C,%"]
    body = [",".join([iso(s)[11:], point(d), point(55), f"{p:g}"]) for s, d, p, _ in RUN.rows]
    return "merged.csv", "\n".join([*head, *body]) + "\n", {}


@writes("table: names in two rows")
def _():
    head = ["Time,Oven,Oven,Oven", "[s],PV [°C],SP [°C],OP [%]"]
    body = [",".join([point(s), point(d), point(55), f"{p:g}"]) for s, d, p, _ in RUN.rows]
    return "rows.csv", "\n".join([*head, *body]) + "\n", {"--temperature-column": "2", "--power-column": "4", "--time-unit": "s", "--temperature-unit": "degC"}


@writes("table: a column twice")
def _():
    cells = [["Time", "Temperature [°C]", "Temperature [°C]", "Power [%]"], *([iso(s), point(d), point(d), f"{p:g}"] for s, d, p, _ in RUN.rows)]
    return "twice.csv", text(cells), {}


@writes("table: the second of two columns of one name is another heater", "hostile")
def _():
    cells = [["Time", "Temperature [°C]", "Power [%]", "Temperature [°C]", "Power [%]"], *(
        [iso(s), point(d), f"{p:g}", "23.4", "0"] for s, d, p, _ in RUN.rows)]
    return "twice.csv", text(cells), {}


@writes("table: a dead column of the same role in front", "hostile")
def _():
    cells = [["Time", "Temp 1 [°C]", "Temp 2 [°C]", "Power [%]"], *([iso(s), "-200.0", point(d), f"{p:g}"] for s, d, p, _ in RUN.rows)]
    return "dead.csv", text(cells), {"--temperature-column": "Temp 2 [°C]"}


@writes("table: status behind each value")
def _():
    cells = [["Time", "TIC1.PV [°C]", "Status", "TIC1.OP [%]", "Status"], *([iso(s), point(d), "Good", f"{p:g}", "Good"] for s, d, p, _ in RUN.rows)]
    return "status.csv", text(cells), {}


@writes("table: status that turns bad for a while", "hostile")
def _():
    cells = [["Time", "TIC1.PV [°C]", "Status", "TIC1.OP [%]", "Status"], *(
        [iso(s), "0.0" if 400 < s < 460 else point(d), "Bad" if 400 < s < 460 else "Good", f"{p:g}", "Good"] for s, d, p, _ in RUN.rows)]
    return "status.csv", text(cells), {"--quality-column": "Status", "--skip-empty": ""}


@writes("table: all cells padded")
def _():
    cells = table(RUN, HEAD, iso)
    return "padded.csv", "\n".join(" ; ".join(cell.ljust(22) for cell in row) for row in cells) + "\n", {}


@writes("table: Markdown")
def _():
    cells = table(RUN, HEAD, iso)
    cells.insert(1, ["---"] * 3)
    return "table.md", "\n".join("| " + " | ".join(row) + " |" for row in cells) + "\n", {}


@writes("table: mysql's frame")
def _():
    cells, line = table(RUN, ("ts", "temperature_degC", "power_pct"), iso), "+---------------------+------------------+-----------+"
    rows = ["| " + " | ".join(cell.ljust(w) for cell, w in zip(row, (19, 16, 9), strict=True)) + " |" for row in cells]
    return "query.txt", "\n".join([line, rows[0], line, *rows[1:], line, "650 rows in set (0.01 sec)"]) + "\n", {}


@writes("table: psql")
def _():
    cells = table(RUN, ("ts", "temperature_degC", "power_pct"), iso)
    rows = [" " + " | ".join(cell.ljust(w) for cell, w in zip(row, (19, 16, 9), strict=True)) for row in cells]
    return "query.txt", "\n".join([rows[0], "-" * 21 + "+" + "-" * 18 + "+" + "-" * 11, *rows[1:], "(650 rows)"]) + "\n", {}


@writes("table: R's write.table")
def _():
    cells = table(RUN, ("time", "temp_C", "power_pct"), point)
    rows = [f'"{k}" {" ".join(row)}' for k, row in enumerate(cells[1:], start=1)]
    return "r.txt", "\n".join(['"time" "temp_C" "power_pct"', *rows]) + "\n", {
        "--time-column": "2", "--temperature-column": "3", "--power-column": "4", "--time-unit": "s", "--temperature-unit": "degC",
        "--power-full-scale": "100"}


@writes("table: pandas' to_csv with an index")
def _():
    cells = table(RUN, ("timestamp", "temperature_degC", "power_pct"), iso)
    rows = [",".join(["" if k == 0 else str(k - 1), *row]) for k, row in enumerate(cells)]
    return "frame.csv", "\n".join(rows) + "\n", {}


@writes("table: newest first")
def _():
    cells = table(RUN, HEAD, iso)
    return "back.csv", text([cells[0], *cells[:0:-1]]), {}


@writes("table: one row twice, as a retry")
def _():
    cells = table(RUN, HEAD, iso)
    for place in range(600, 50, -50):
        cells.insert(place, list(cells[place]))
    return "retry.csv", text(cells), {}


@writes("table: two rows swapped", "hostile")
def _():
    cells = table(RUN, HEAD, iso)
    cells[200], cells[201] = cells[201], cells[200]
    cells[400], cells[401] = cells[401], cells[400]
    return "swapped.csv", text(cells), {"--log-interval": "2"}


@writes("table: rows of zero where the logger started")
def _():
    cells = table(RUN, HEAD, iso)
    for row in cells[1:4]:
        row[1], row[2] = "0.0", "0"
    return "zeros.csv", text(cells), {"--from": "8"}


@writes("table: a year 1970 before the clock was set", "hostile")
def _():
    cells = table(RUN, HEAD, iso)
    for k, row in enumerate(cells[1:6]):
        row[0] = f"1970-01-01 00:00:{10 + 2 * k:02d}"
    return "unset.csv", text(cells), {"--skip-rows": "6", "--from": "10"}


@writes("table: °F in the name, whole degrees")
def _():
    run = RUN.map(lambda d: round(1.8 * d + 32))
    OTHER_RUN["table: °F in the name, whole degrees"] = run.map(lambda f: (f - 32) / 1.8)
    return "us.csv", csv(stamped("%m/%d/%Y %H:%M"[:14] + ":%S"), run=run, head=("Date", "Temp (°F)", "Output %"), number=lambda d: f"{d:.0f}"), {}


@writes("table: kelvins")
def _():
    return "k.csv", csv(iso, head=("Time", "T/K", "Power/%"), number=lambda d: f"{d + 273.15:.2f}"), {}


@writes("table: temperature in tenths, told in the name")
def _():
    return "tenths.csv", csv(iso, head=("Time", "Temp x10", "Power [%]"), number=lambda d: f"{round(d * 10)}"), {
        "--temperature-scale": "0.1", "--temperature-unit": "0.1degC"}


@writes("table: HTML", "hostile")
def _():
    cells = table(RUN, HEAD, iso)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>\n" for row in cells)
    return "oven.xls", f"<html><body><table>\n{body}</table></body></html>\n", {}


@writes("table: JSON array")
def _():
    import json  # noqa: PLC0415 - one writer's

    return "oven.json", json.dumps([{"time": iso(s, mark="T"), "temperature_c": round(d, 1), "power_pct": p} for s, d, p, _ in RUN.rows]), {}


@writes("table: JSON of columns", "hostile")
def _():
    import json  # noqa: PLC0415 - one writer's

    return "oven.json", json.dumps({"time_s": RUN.seconds, "temperature_c": [round(d, 1) for d in RUN.degC], "power_pct": RUN.power}), {}


@writes("table: Grafana", "messy")
def _():
    cells = [["Time", "Oven temperature", "Heater power"], *([iso(s), f"{d:.1f} °C", f"{p:g}%"] for s, d, p, _ in RUN.rows)]
    return "Panel Title-data-2026-03-14 10_00_00.csv", text(cells), {}


@writes("table: Grafana, series as rows", "messy")
def _():
    rows = [f'"{name}";{iso(s, mark="T")}+01:00;{value}' for name, of in (("oven_temperature", RUN.degC), ("heater_power", RUN.power))
            for s, value in zip(RUN.seconds, (f"{v:.2f}" for v in of), strict=True)]
    return "grafana.csv", "\n".join(["Series;Time;Value", *rows]) + "\n", {"--power-full-scale": "100", "--temperature-unit": "degC"}


@writes("table: ThingSpeak")
def _():
    cells = [["created_at", "entry_id", "field1", "field2"], *(
        [iso(s) + " UTC", f"{k}", f"{d:.2f}", f"{p:g}"] for k, (s, d, p, _) in enumerate(RUN.rows, start=1))]
    return "feeds.csv", text(cells), {"--temperature-column": "field1", "--power-column": "field2", "--power-full-scale": "100", "--temperature-unit": "degC"}


@writes("table: Arduino serial monitor with host stamps")
def _():
    rows = [f"{iso(s)[11:]}.000 -> {d:.2f},{p * 2.55:.0f}" for s, d, p, _ in RUN.rows]
    return "monitor.txt", "\n".join(rows) + "\n", {
        "--temperature-column": "2", "--power-column": "3", "--power-full-scale": "255", "--temperature-unit": "degC"}


@writes("table: Arduino plotter, names in the cells")
def _():
    rows = [f"temp:{d:.2f},setpoint:55.00,output:{p * 2.55:.0f}" for s, d, p, _ in RUN.rows]
    return "plotter.txt", "\n".join(rows) + "\n", {"--log-interval": "2", "--power-full-scale": "255", "--temperature-unit": "degC"}


@writes("table: names and values in one line")
def _():
    rows = [f"{iso(s)} temp={d:.2f}C power={p:.0f}% sp=55.0" for s, d, p, _ in RUN.rows]
    return "keys.log", "\n".join(rows) + "\n", {"--temperature-unit": "degC"}


@writes("table: journal lines", "hostile")
def _():
    rows = [f"{stamped('%b %d %H:%M:%S')(s)} pi ovend[412]: INFO temperature {d:.2f} C, power {p:.0f} %" for s, d, p, _ in RUN.rows]
    return "syslog", "\n".join(rows) + "\n", {"--log-interval": "2"}


# ---- judge ------------------------------------------------------------------------------------------------------------

_OPTIONS = {"--log-interval": ("sample_time_s", float), "--from": ("begin_s", float), "--skip-rows": ("skip_rows", int), "--run": ("run", int),
            "--power-full-scale": ("power_full_scale", float), "--temperature-scale": ("temperature_scale", float)}


def _settings(options: Sequence[str]) -> dict[str, Any]:
    """Return the options of a command line as `read_log` takes them."""
    settings: dict[str, Any] = {}
    place = 0
    while place < len(options):
        flag = options[place]
        if flag == "--skip-empty":
            settings["skip_empty"] = True
            place += 1
        elif flag == "--power-levels":
            settings["power_levels"] = (float(options[place + 1]), float(options[place + 2]))
            place += 3
        else:
            name, kind = _OPTIONS.get(flag, (flag[2:].replace("-", "_"), str))
            settings[name] = kind(options[place + 1])
            place += 2
    return settings


def differences(export: Export, log: Any) -> str:
    """Return how the rows that were read differ from those that were written, "" if they do not."""
    run = OTHER_RUN.get(export.tool, RUN)
    written = {round(s - run.seconds[0], 3): (d, p) for s, d, p in zip(run.seconds, run.degC, run.power, strict=True)}
    shift = 0.0 if "rows of zero" not in export.tool and "1970" not in export.tool else None
    elapsed = np.round(np.asarray(log.time_s) - log.time_s[0], 3)
    if shift is None:
        elapsed = np.round(elapsed + run.seconds[-1] - run.seconds[0] - elapsed[-1], 3)
    if len(elapsed) < 0.9 * len(written):
        return f"{len(elapsed)} of {len(written)} rows"
    near = np.array([written.get(t) or written.get(round(t * 2) / 2) or (np.nan, np.nan) for t in elapsed.tolist()])
    if np.isnan(near).any():
        return f"instants that were not written, such as {elapsed[np.flatnonzero(np.isnan(near[:, 0]))[0]]:g} s"
    tolerance = 0.6 if "whole" in export.tool else 0.06
    off = np.abs(np.asarray(log.temperature_degC) - near[:, 0])
    if off.max() > tolerance:
        return f"temperatures off by {off.max():.3g} °C"
    if log.power_pct is None:
        return "no power"
    off = np.abs(np.asarray(log.power_pct) - near[:, 1])
    return f"powers off by {off.max():.3g} %" if off.max() > 0.3 else ""


def judge_rows(export: Export) -> tuple[str, list[str]]:
    """Return what became of an export as `read_log` takes it, and the messages on the way."""
    options: list[str] = []
    said: list[str] = []
    for turn in range(_TURNS):
        try:
            log = read_log(export.name, content=export.content, **_settings([word for word in options if word not in ("--from",)]))
        except HeatertuneError as problem:
            said.append(f"{' '.join(options)}: {problem}")
            more = asked_for(str(problem), export, options)
            if not more:
                return STUCK, said
            options += more
            continue
        if "time" in log.taken.assumed and "--log-interval" in export.user:
            options += [] if "--log-interval" in options else ["--log-interval", export.user["--log-interval"]]
            continue
        asked = [f"{option.split()[0]} {export.user.get(option.split()[0], option.split()[1])}" for option in log.taken.assumed.values()]
        left = [word for each in asked if each.split()[0] not in options for word in each.split()]
        if left:
            said.append(f"{' '.join(options)}: assumed {log.taken.assumed}")
            options += left
            continue
        warned = " ".join(log.warnings)
        if any(flag in warned and flag not in options for flag in export.user) and (more := asked_for(warned, export, options)):
            said.append(warned)
            options += more
            continue
        wrong = differences(export, log)
        return (WRONG if wrong else REMEDY if turn else RIGHT), [*said, wrong, *log.repairs]
    return STUCK, said


def printed(results: Sequence[tuple[Export, str, list[str]]], *, verbose: bool = False) -> str:
    counts = Counter(outcome for _, outcome, _ in results)
    lines = [f"{len(results)} exports: " + ", ".join(f"{counts[outcome]} {outcome}" for outcome in CLASSES)]
    for export, outcome, said in results:
        if outcome not in (RIGHT,) and (verbose or outcome != REMEDY):
            lines.append(f"{export.tool}: {outcome}\n    " + "\n    ".join(said))
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--only", help="exports whose name holds this")
    parser.add_argument("--fit", action="store_true", help="through the command line, with the heater fitted, as `messy` does")
    chosen = parser.parse_args()
    some = [export for export in exports() if not chosen.only or chosen.only in export.tool]
    with tempfile.TemporaryDirectory() as folder:
        results = [(export, *(judge(export, Path(folder)) if chosen.fit else judge_rows(export))) for export in some]
    print(printed(results, verbose=chosen.verbose))
    sys.exit(any(outcome == WRONG for _, outcome, _ in results))

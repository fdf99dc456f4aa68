"""Messy exports with known truth: each is read to exactly that, or refused in one line; none is read wrongly.

    python tests/bench/drawn_exports.py [--files 600] [--seed 1]

The writer shares nothing with the reader: it makes a heater's readings in tenths of a degree, so that what a file says is
what it must give back to the last digit, and writes them as one of many loggers, panels and spreadsheets would.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.log.log_values import Log

START = datetime(2026, 3, 1, 23, 50)


@dataclass
class Truth:
    """What a file holds: tenths of a degree, so that all units below are exact to read back."""

    time_s: list[float]
    degC: list[float]
    power: list[float] | None  # 0…100
    setpoint: list[float] | None = None


@dataclass
class Messy:
    """A file, what it holds, and what may happen to it.

    Attributes:
        kind: how it was written.
        text: of the file.
        truth: what it holds; None: it cannot be understood without help and must be refused.
        options: of `read_log`, what a user would say.
        named: what the refusal has to name.
        encoding: of the file.
    """

    kind: str
    text: str
    truth: Truth | None
    options: dict[str, Any] = field(default_factory=dict)
    named: str = ""
    encoding: str = "utf-8"


def heater(chance: random.Random, rows: int, step: float, *, levels: Sequence[float] = (0, 40, 60, 100)) -> Truth:
    """Work out a heater second by second (gain 0.4 °C/%, time constant 90 s), read in tenths of a degree."""
    room, temperature, power = chance.uniform(15.0, 25.0), 0.0, 0.0
    temperature, left = room, chance.randint(3, 8)
    found = Truth([], [], [], [])
    setpoint = 60.0
    for k in range(rows):
        found.time_s.append(k * step)
        found.degC.append(round(temperature + chance.gauss(0.0, 0.06), 1))
        found.power.append(float(power))
        found.setpoint.append(setpoint)
        for _ in range(10):
            temperature += (room + 0.4 * power - temperature) / 90.0 * step / 10.0
        left -= 1
        if left <= 0:
            power, left = chance.choice([each for each in levels if each != power]), chance.randint(6, 25)
            setpoint = float(chance.choice((55, 60, 65)))
    return found


def stamps(truth: Truth, form: str, *, cut: int = 0) -> list[str]:
    """Return the times as stamps; `cut` digits are taken off the end of the microseconds."""
    made = [(START + timedelta(seconds=t)).strftime(form) for t in truth.time_s]
    return [text[:-cut] if cut else text for text in made]


def table(header: Sequence[str] | None, columns: Sequence[Sequence[Any]], separator: str = ",", mark: str = ".") -> str:
    """Return columns as lines of text; a cell with the separator is put in quotation marks."""
    def cell(value: Any) -> str:
        text = f"{value:.10g}" if isinstance(value, float) else str(value)
        text = text.replace(".", mark) if isinstance(value, float) else text
        return f'"{text}"' if separator in text else text

    lines = [separator.join(map(cell, row)) for row in zip(*columns, strict=True)]
    return "\n".join(([separator.join(map(cell, header))] if header else []) + lines) + "\n"


# ---- files that must be read

def plain(chance: random.Random) -> Messy:
    truth = heater(chance, chance.randint(60, 140), chance.choice([1.0, 2.0, 5.0]))
    separator, mark = chance.choice([(",", "."), (";", ","), (";", "."), ("\t", ","), ("\t", "."), ("|", ".")])
    names = chance.choice([
        ("Zeit [s]", "Istwert [°C]", "Stellgrad [%]", "Sollwert [°C]"), ("t (s)", "PV [degC]", "OP [%]", "SP [degC]"),
        ("time_s", "temp_C", "duty_pct", "setpoint_C"), ("Time [s]", "T1 [°C]", "MV [%]", "SP [°C]"),
        ("Zeit (s)", "Temperatur (°C)", "Heizleistung (%)", "Sollwert (°C)"), ("sec", "PV (°C)", "CV (%)", "SP (°C)"),
        ("time [s]", "Reactor.PV [°C]", "Reactor.OP [%]", "Reactor.SP [°C]"),
        ("Zeit [s]", "Isttemperatur [°C]", "Stellwert [%]", "Solltemperatur [°C]"),
    ])
    order = [0, 1, 2, 3]
    chance.shuffle(order)
    columns = [truth.time_s, truth.degC, truth.power, truth.setpoint]
    return Messy("plain", table([names[i] for i in order], [columns[i] for i in order], separator, mark), truth,
                 encoding=chance.choice(["utf-8", "utf-8-sig", "utf-16", "latin-1"]))


def titled(chance: random.Random) -> Messy:
    truth = heater(chance, chance.randint(60, 120), 2.0)
    truth.setpoint = None
    separator, mark = chance.choice([(",", "."), (";", ","), ("\t", ".")])
    title = chance.sample([
        "Export of plant 7", f"Device{separator}Recorder 4", "", f"Date{separator}2026-03-01", "Zone 3",
        f"Serial number{separator}12345", f"Interval{separator}2 s{separator}", f"Operator{separator}M. Huber{separator}day",
    ], chance.randint(1, 6))
    body = table(["Time", "Temp", "Heater"], [truth.time_s, truth.degC, truth.power], separator, mark)
    head, rest = body.split("\n", 1)
    if chance.random() < 0.7:
        head += "\n" + separator.join(chance.choice([("s", "°C", "%"), ("[s]", "[°C]", "[%]"), ("(s)", "(°C)", "(%)")]))
    if chance.random() < 0.3:
        head += "\n" + separator.join(("REAL", "REAL", "REAL"))
    lines = [line.replace("\t", separator) for line in title]
    skip = {"skip_rows": len(lines)} if chance.random() < 0.3 else {}
    return Messy("titles", "\n".join([*lines, head, rest]), truth, skip)


def with_units(chance: random.Random) -> Messy:
    truth = heater(chance, 80, 2.0)
    gap = chance.choice(["", " ", "\u00a0"])
    mark = chance.choice([".", ","])
    temperature = [f"{y:.1f}{gap}°C".replace(".", mark) for y in truth.degC]
    power = [f"{u:.0f}{chance.choice(['', ' '])}%" for u in truth.power]
    truth.setpoint = None
    clock = stamps(truth, "%Y-%m-%d %H:%M:%S")
    return Messy("units in cells", table(["Time", "Boiler temperature", "Heater"], [clock, temperature, power],
                                         chance.choice([",", ";"])), truth)


def fahrenheit_cells(chance: random.Random) -> Messy:
    truth = heater(chance, 80, 2.0)
    truth.degC = [(round(y * 1.8 + 32.0) - 32.0) / 1.8 for y in truth.degC]  # whole degrees of Fahrenheit
    truth.setpoint, truth.power = None, None
    cells = [f"{round(y * 1.8 + 32.0)} °F" for y in truth.degC]
    return Messy("fahrenheit in cells", table(["time [s]", "temperature"], [truth.time_s, cells]), truth)


def switched(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0, levels=(0, 100))
    truth.setpoint = None
    on, off = chance.choice([("TRUE", "FALSE"), ("ON", "OFF"), ("on", "off"), ("yes", "no"), ("True", "False"),
                             ("ein", "aus"), ("EIN", "AUS"), ("Ja", "Nein"), ("wahr", "falsch")])
    power = [on if u else off for u in truth.power]
    return Messy("switched", table(["time [s]", "T [°C]", chance.choice(["Heater", "Heizung", "SSR", "relay"])],
                                   [truth.time_s, truth.degC, power], chance.choice([",", ";"])), truth)


def clocks(chance: random.Random) -> Messy:
    truth = heater(chance, 90, chance.choice([2.0, 10.0, 60.0]))
    truth.setpoint = None
    form, cut = chance.choice([
        ("%Y-%m-%d %H:%M:%S", 0), ("%d.%m.%Y %H:%M:%S", 0), ("%Y-%m-%dT%H:%M:%S.%fZ", 0), ("%H:%M:%S", 0),
        ("%Y/%m/%d %H:%M:%S", 0), ("%d.%m.%y %H:%M:%S", 0), ("%Y-%m-%dT%H:%M:%S+01:00", 0), ("%H:%M:%S.%f", 3),
        ("%d.%m.%Y %I:%M:%S %p", 0), ("%Y-%m-%d %H:%M:%S.%f", 3), ("%d.%m.%Y %H:%M:%S.%f", 3), ("%H:%M:%S:%f", 3),
    ])
    newest_first = chance.random() < 0.2 and "%Y" in form
    columns = [stamps(truth, form, cut=cut), truth.degC, truth.power]
    if newest_first:
        columns = [list(column)[::-1] for column in columns]
    return Messy("clocks", table(["Zeitstempel", "Temperatur [°C]", "Leistung [%]"], columns, ";", ","), truth)


def two_columns(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 30.0)
    truth.setpoint = None
    form = chance.choice(["%d.%m.%Y", "%Y-%m-%d"])
    names = chance.choice([("Datum", "Zeit"), ("Datum", "Uhrzeit"), ("Date", "Time")])
    header = [*names, "Istwert [°C]", "Stellgrad [%]"]
    return Messy("date and time", table(header, [stamps(truth, form), stamps(truth, "%H:%M:%S"), truth.degC, truth.power],
                                        ";", ","), truth)


def epochs(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    truth.setpoint = None
    digits = chance.choice([10, 13, 16])
    first = 1_772_000_000
    time = [f"{first + t:.0f}" + "0" * (digits - 10) for t in truth.time_s]
    return Messy("epochs", table(["Time", "temperature [°C]", "heater [%]"], [time, truth.degC, truth.power]), truth)


def grafana(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 15.0)
    truth.setpoint = None
    head = "sep=,\n" if chance.random() < 0.5 else ""
    if chance.random() < 0.5:
        time = [f"{1_772_000_000_000 + t * 1000:.0f}" for t in truth.time_s]
        columns = [time, truth.degC, truth.power]
    else:
        columns = [stamps(truth, "%Y-%m-%d %H:%M:%S"), [f"{y:.1f} °C" for y in truth.degC], [f"{u:.0f}%" for u in truth.power]]
    names = ['"Time"', '"temperature {zone=""1""}"', '"heater power {zone=""1""}"']
    rows = "\n".join(",".join(f'"{c}"' if isinstance(c, str) and " " in c else f"{c}" for c in row)
                     for row in zip(*columns, strict=True))
    return Messy("grafana", head + ",".join(names) + "\n" + rows + "\n", truth)


def trace(chance: random.Random) -> Messy:
    truth = heater(chance, 120, 0.5)
    truth.setpoint = None
    head = ["Trace;Heizung Zone 1", "CPU;S7-1500", "Zeitpunkt;01.03.2026 10:00:00", ""]
    time = [f"{t * 1000:.0f}" for t in truth.time_s]
    columns = [list(range(len(time))), time, truth.degC, truth.power]
    names = ["Index", "Zeit [ms]", '"Zone1".Temperatur [°C]', '"Zone1".Stellwert [%]']
    body = table([name.replace('"', "") for name in names], columns, ";", ",")
    return Messy("trace", "\n".join(head) + "\n" + body, truth)


def long_table(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 10.0)
    tags = chance.choice([
        ("Zone1/Temperature", "Zone1/Output", "Zone1/Setpoint"), ("TIC101.PV", "TIC101.OP", "TIC101.SP"),
        ("sensor.boiler_temperature", "number.boiler_power", "number.boiler_setpoint"),
        ("Ofen.Istwert", "Ofen.Stellgrad", "Ofen.Sollwert"), ("A17", "A18", "A19"),
    ])
    good, bad = chance.choice([("192", "0"), ("Good", "Bad"), ("GOOD", "UNCERTAIN"), ("0xC0", "0x00"), ("192", "24")])
    rows: list[tuple[float, str, str, str]] = []
    dropped: set[int] = set()
    for k, t in enumerate(truth.time_s):
        is_bad = 5 < k < 80 and chance.random() < 0.03
        rows.append((t, tags[0], "0.0" if is_bad else f"{truth.degC[k]:.1f}", bad if is_bad else good))
        if is_bad:
            dropped.add(k)
        before = k == 0 or truth.power[k] != truth.power[k - 1]
        if before or chance.random() < 0.3:  # at a time of its own, before the reading it holds for
            rows.append((t - (0.0 if k == 0 else chance.choice([0.0, 1.0, 3.0])), tags[1], f"{truth.power[k]:.0f}", good))
        if k == 0 or truth.setpoint[k] != truth.setpoint[k - 1]:
            rows.append((t, tags[2], f"{truth.setpoint[k]:.0f}", good))
        if k % 10 == 0:
            rows.append((t, "other", f"{chance.uniform(0, 9):.2f}", good))
    rows.sort(key=(lambda row: (row[1], row[0])) if chance.random() < 0.4 else (lambda row: row[0]))
    kept = [k for k in range(len(truth.time_s)) if k not in dropped]
    truth = Truth([truth.time_s[k] for k in kept], [truth.degC[k] for k in kept], [truth.power[k] for k in kept],
                  [truth.setpoint[k] for k in kept])
    names = chance.choice([("tag", "time", "value", "quality"), ("TagName", "DateTime", "Value", "Quality"),
                           ("Name", "Zeit", "Wert", "Qualität"), ("point", "timestamp", "value", "quality")])
    clock = [(START + timedelta(seconds=row[0])).strftime("%Y-%m-%d %H:%M:%S") for row in rows]
    asked = {} if tags[0] != "A17" else {"tag": "A17", "power_tag": "A18", "setpoint_tag": "A19", "temperature_unit": "degC",
                                         "power_full_scale": 100}
    text = table(names, [[row[1] for row in rows], clock, [row[2] for row in rows], [row[3] for row in rows]],
                 chance.choice([",", ";"]))
    return Messy("long table", text, truth, asked)


def home_assistant(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 30.0, levels=(0, 100))
    truth.setpoint = None
    rows = []
    dropped = set()
    for k, t in enumerate(truth.time_s):
        lost = 5 < k < 80 and chance.random() < 0.02
        rows.append(("sensor.boiler_temperature", chance.choice(["unavailable", "unknown"]) if lost else f"{truth.degC[k]:.1f}", t))
        if lost:
            dropped.add(k)
    for k, t in enumerate(truth.time_s):
        if k == 0 or truth.power[k] != truth.power[k - 1]:
            rows.append(("switch.boiler_heater", "on" if truth.power[k] else "off", t))
    clock = [(START + timedelta(seconds=row[2])).strftime("%Y-%m-%dT%H:%M:%S.000Z") for row in rows]
    kept = [k for k in range(len(truth.time_s)) if k not in dropped]
    truth = Truth([truth.time_s[k] for k in kept], [truth.degC[k] for k in kept], [truth.power[k] for k in kept])
    return Messy("home assistant", table(["entity_id", "state", "last_changed"],
                                         [[row[0] for row in rows], [row[1] for row in rows], clock]), truth)


def wincc(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 0.5)
    truth.setpoint = None
    rows = []
    for k, t in enumerate(truth.time_s):
        rows += [("Temp_Ist", t, f"{truth.degC[k]:.2f}".replace(".", ",")), ("Stellwert", t, f"{truth.power[k]:.2f}".replace(".", ","))]
    day = (START - datetime(1899, 12, 30)).total_seconds()
    lines = ['"VarName";"TimeString";"VarValue";"Validity";"Time_ms"']
    for name, t, value in rows:
        clock = (START + timedelta(seconds=t)).strftime("%d.%m.%Y %H:%M:%S")
        lines.append(f'"{name}";"{clock}";{value};1;' + f"{(day + t) / 86400.0 * 1e6:.4f}".replace(".", ","))
    clock = (START + timedelta(seconds=90)).strftime("%d.%m.%Y %H:%M:%S")
    lines.append(f'"$RT_OFF$";"{clock}";0;2;' + f"{(day + 90) / 86400.0 * 1e6:.4f}".replace(".", ","))
    return Messy("wincc", "\n".join(lines) + "\n", truth)


def started(chance: random.Random) -> Messy:
    truth = heater(chance, 120, 1.0)
    truth.setpoint = None
    at_end = chance.random() < 0.3
    width = chance.randint(1, 2)
    values = chance.choice([[85.0], [0.0], [-127.0], [150.3], [999.9]]) * width
    degC = list(truth.degC)
    if at_end:
        degC[-width:] = values
        kept = slice(0, -width)
    else:
        degC[:width] = values
        kept = slice(width, None)
    text = table(["time [s]", "T [°C]", "power [%]"], [truth.time_s, degC, truth.power])
    return Messy("wild end", text, Truth(truth.time_s[kept], truth.degC[kept], truth.power[kept]))


def held_setpoint(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    cells = [f"{w:.0f}" if k == 0 or w != truth.setpoint[k - 1] else "" for k, w in enumerate(truth.setpoint)]
    return Messy("blank setpoints", table(["time [s]", "PV [°C]", "OP [%]", "SP [°C]"],
                                          [truth.time_s, truth.degC, truth.power, cells], ";", ","), truth)


def counts(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0, levels=(0, 20, 60, 100))  # 51, 153 and 255 counts: exact shares
    truth.setpoint = None
    raw = [round(u * 2.55) for u in truth.power]
    name, asked = chance.choice([("PWM 0-255", {}), ("output", {"power_full_scale": 255}), ("U", {"power_full_scale": 255})])
    return Messy("counts", table(["time [s]", "T [°C]", name], [truth.time_s, truth.degC, raw]), truth, asked)


def logger_restarted(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    truth.setpoint = None
    lines = table(["time [s]", "T [°C]", "power [%]"], [truth.time_s, truth.degC, truth.power]).splitlines()
    lines.insert(chance.randint(20, 70), lines[0])
    return Messy("header again", "\n".join(lines) + "\n", truth)


def extras(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    n = len(truth.time_s)
    columns = {
        "Zeit [s]": truth.time_s, "Temperatur [°C]": truth.degC, "Stellgrad [%]": truth.power,
        "Solltemperatur [°C]": truth.setpoint,
    }
    more = {
        "Raumtemperatur [°C]": [round(20 + chance.gauss(0, 0.1), 1) for _ in range(n)], "Status": ["ok"] * n,
        "amps": [round(u / 50, 2) for u in truth.power], "control": [round(u / 9, 3) for u in truth.power],
        "Druck [bar]": [round(1 + chance.random(), 2) for _ in range(n)], "Bemerkung": ["" if chance.random() < 0.9 else "Tür" for _ in range(n)],
        "Umgebungstemperatur [°C]": [19.5] * n, "Drehzahl": [1450] * n, "Leistung [W]": [u * 5 for u in truth.power],
    }
    names = [*columns, *chance.sample(list(more), chance.randint(1, 5))]
    chance.shuffle(names)
    return Messy("other columns", table(names, [(columns | more)[name] for name in names], ";", ","), truth)


def grid_of_titles(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    truth.setpoint = None
    titles = chance.sample(["Plant;Zone;Oven", "Interval;2;s", "Started;01.03.2026 10:00:00;", "Recorder;;", ";Channel 1;Channel 2"],
                           chance.randint(1, 3))
    body = table(["Time [s]", "Temperature [°C]", "Power [%]"], [truth.time_s, truth.degC, truth.power], ";", ",")
    return Messy("grid of titles", "\n".join(titles) + "\n" + body, truth)


def quoted(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    truth.setpoint = None
    end = chance.choice(["\n", "\r\n", "\r"])
    rows = [("time [s]", "T [°C]", "power [%]"), *zip(truth.time_s, truth.degC, truth.power, strict=True)]
    lines = [",".join(f'"{cell}"'.replace(".", ",") if k else f'"{cell}"' for cell in row) for k, row in enumerate(rows)]
    lines = [line + chance.choice(["", ""]) for line in lines]
    return Messy("all quoted", end.join(lines) + end, truth)


def trailing(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    truth.setpoint = None
    lines = table(["time [s]", "T [°C]", "power [%]"], [truth.time_s, truth.degC, truth.power], ";").splitlines()
    return Messy("separators at the end", "\n".join(f"{line};" for line in lines) + "\n;;;\n", truth)


def spaced(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 2.0)
    truth.setpoint = None
    mark = chance.choice([".", ","])
    head = chance.choice(["# t_s T_C duty_%", "time_s temp_C duty_pct", "% time_s"])
    names = chance.choice(["time_s  temp_C  duty_pct", "# time_s temp_C duty_pct"])
    del head
    lines = [f"{t:8.1f}  {y:7.1f}  {u:5.0f}".replace(".", mark) for t, y, u in zip(truth.time_s, truth.degC, truth.power, strict=True)]
    return Messy("spaces", "\n".join([names, *lines]) + "\n", truth)


def jitter(chance: random.Random) -> Messy:
    truth = heater(chance, 120, 1.0)
    truth.setpoint = None
    twice = sorted(chance.sample(range(10, 110, 5), 3))
    rows, kept = [], []
    for k, t in enumerate(truth.time_s):
        rows.append((t - (1.0 if k in twice else 0.0), truth.degC[k], truth.power[k]))
        if k not in twice:
            kept.append(k)
    clock = [(START + timedelta(seconds=row[0])).strftime("%Y-%m-%d %H:%M:%S") for row in rows]
    text = table(["Time", "T [°C]", "power [%]"], [clock, [row[1] for row in rows], [row[2] for row in rows]])
    return Messy("jitter", text, Truth([truth.time_s[k] for k in kept], [truth.degC[k] for k in kept], [truth.power[k] for k in kept]))


def influx(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 10.0)
    truth.setpoint = None
    lines = ["#group,false,false,true,true,false,false,true,true", "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string",
             "#default,_result,,,,,,,", ",result,table,_start,_stop,_time,_value,_field,_measurement"]
    for number, (name, values) in enumerate((("temperature", truth.degC), ("heater_duty", truth.power))):
        for t, value in zip(truth.time_s, values, strict=True):
            clock = (START + timedelta(seconds=t)).strftime("%Y-%m-%dT%H:%M:%SZ")
            lines.append(f",,{number},2026-03-01T00:00:00Z,2026-03-02T12:00:00Z,{clock},{value},{name},oven")
    return Messy("influx", "\n".join(lines) + "\n", truth)


def flagged(chance: random.Random) -> Messy:
    truth = heater(chance, 100, 2.0)
    truth.setpoint = None
    bad = {k for k in range(10, 90) if chance.random() < 0.04}
    flags = [chance.choice(["Bad", "Uncertain"]) if k in bad else "Good" for k in range(100)]
    degC = [0.0 if k in bad else y for k, y in enumerate(truth.degC)]
    kept = [k for k in range(100) if k not in bad]
    return Messy("flags beside columns", table(["time [s]", "T [°C]", "power [%]", "Quality"], [truth.time_s, degC, truth.power, flags]),
                 Truth([truth.time_s[k] for k in kept], [truth.degC[k] for k in kept], [truth.power[k] for k in kept]))


def before_trigger(chance: random.Random) -> Messy:
    truth = heater(chance, 100, 0.1)
    truth.setpoint = None
    time = [f"{(t - 3.0) * 1000:.0f}" for t in truth.time_s]
    return Messy("before the trigger", table(["Zeit [ms]", "Temperatur [°C]", "Stellwert [%]"], [time, truth.degC, truth.power], ";", ","), truth)


def mixed_long(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 10.0)
    truth.setpoint = None
    mark = chance.choice([".", ","])
    rows = []
    for k, t in enumerate(truth.time_s):
        rows += [("Ofen/Temperatur", t, f"{truth.degC[k]:.1f} °C".replace(".", mark)), ("Ofen/Leistung", t, f"{truth.power[k]:.0f} %")]
    clock = [(START + timedelta(seconds=row[1])).strftime("%d.%m.%Y %H:%M:%S") for row in rows]
    return Messy("long with units", "Historian export\n\n" + table(["Messstelle", "Zeitstempel", "Wert"], [[r[0] for r in rows], clock, [r[2] for r in rows]], ";"), truth)


def relay_between(chance: random.Random) -> Messy:
    """A relay that switches twice between two readings: its mean is the share of time that it was on."""
    truth = heater(chance, 90, 20.0, levels=(0, 20, 40, 60, 100))
    truth.setpoint = None
    rows = []
    for k, t in enumerate(truth.time_s):
        rows.append(("kiln.temperature", t, f"{truth.degC[k]:.1f}"))
        on = truth.power[k] / 100.0 * 20.0
        if on > 0:
            rows.append(("kiln.heater", t, "on"))
        if on < 20.0:
            rows.append(("kiln.heater", t + on, "off"))
    if truth.power[-1] not in (0.0, 100.0):
        rows.append(("kiln.heater", truth.time_s[-1] + 20.0, "off"))
    rows.sort(key=lambda row: row[1])
    clock = [f"{1_772_000_000 + row[1]:.1f}" for row in rows]
    return Messy("relay between readings", table(["tag", "time", "value"], [[r[0] for r in rows], clock, [r[2] for r in rows]]), truth)


def blanks(chance: random.Random) -> Messy:
    truth = heater(chance, 100, 2.0)
    truth.setpoint = None
    lost = set(chance.sample(range(5, 95), 4))
    word = chance.choice(["", "NaN", "unavailable", "null", "---", "#N/A"])
    degC = [word if k in lost else f"{y:.1f}" for k, y in enumerate(truth.degC)]
    text = table(["time [s]", "T [°C]", "power [%]"], [truth.time_s, degC, truth.power])
    return Messy("blanks left out", text, without(truth, lost), {"skip_empty": True} if chance.random() < 0.5 else {})


def two_ovens(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    rows = [row for k in range(60) for row in (("Ofen1.Temperatur", truth.time_s[k], truth.degC[k]), ("Ofen2.Temperatur", truth.time_s[k], 30.0 + k),
                                               ("Ofen1.Leistung", truth.time_s[k], truth.power[k]), ("Ofen2.Leistung", truth.time_s[k], 7.0))]
    text = table(["tag", "time [s]", "value"], list(zip(*rows, strict=True)))
    truth.setpoint = None
    asked, named = chance.choice([({}, "--tag"), ({"tag": "Ofen1.Temperatur"}, "--power-tag"), ({"tag": "Ofen1.Temperatur", "power_tag": "Ofen1.Leistung"}, "")])
    return Messy("two ovens", text, None if named else truth, asked, named=named)


def odd_lines(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    lines = table(["time [s]", "T [°C]", "power [%]"], [truth.time_s, truth.degC, truth.power], ";").splitlines()
    odd = chance.choice(["EOF", "End of export", "Summary;3", "Stopped;;", "1.234,5;20;30", "12;20;30;40;50"])
    lines.insert(chance.choice([30, len(lines)]), odd)
    truth.setpoint, is_reading = None, odd.startswith("1.234")
    return Messy("odd line", "\n".join(lines) + "\n", None if is_reading else truth, named="line " if is_reading else "")


def summer_time(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 60.0)
    times = [t if k < 30 else t - 3600.0 for k, t in enumerate(truth.time_s)]
    clock = [(START + timedelta(seconds=t)).strftime("%d.%m.%Y %H:%M:%S") for t in times]
    return Messy("summer time ends", table(["Zeit", "T [°C]", "power [%]"], [clock, truth.degC, truth.power], ";"), None, named="backwards")


def american(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    truth.setpoint, truth.time_s = None, [10800.0 * t for t in truth.time_s]
    clock = stamps(truth, "%m/%d/%Y %I:%M:%S %p")
    return Messy("month first", table(["Date/Time", "Temp (°F)", "Heater (%)"], [clock, [y * 1.8 + 32 for y in truth.degC], truth.power]), truth)


def minutes(chance: random.Random) -> Messy:
    truth = heater(chance, 90, 3.0)
    truth.setpoint = None
    name, size, asked = chance.choice([("Time (min)", 60.0, {}), ("t [h]", 3600.0, {}), ("Zeit", 60.0, {"time_unit": "min"}), ("Tage", 86400.0, {"time_unit": "d"})])
    time = [repr(t / size) for t in truth.time_s]
    return Messy("minutes and hours", table([name, "T [°C]", "power [%]"], [time, truth.degC, truth.power]), truth, asked)


def tagged_two(chance: random.Random) -> Messy:
    """Every tag's readings at instants of its own: the power is what it last was."""
    one = heater(chance, 60, 4.0)
    rows = [row for k in range(60) for row in (
        (one.time_s[k] + 1.5, "TT101", one.degC[k]), (one.time_s[k], "TY101", one.power[k]))]
    text = table(["timestamp", "tag", "value"], [[repr(r[0]) for r in rows], [r[1] for r in rows], [r[2] for r in rows]])
    truth = Truth([t + 1.5 for t in one.time_s], one.degC, one.power)
    return Messy("instants of their own", text, truth, {"tag": "TT101", "power_tag": "TY101"})


Column = tuple[str, str, list[Any]]  # name, unit, cells


def coin(chance: random.Random, share: float = 0.5) -> bool:
    """Return whether the toss says so."""
    return chance.random() < share


def clock_columns(chance: random.Random, truth: Truth) -> tuple[str, list[Column]]:
    """Return how the time is written, and its columns."""
    form = chance.choice(["number", "%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "two", "epoch", "%Y-%m-%dT%H:%M:%SZ"])
    if form == "number":
        size, unit = chance.choice([(1.0, "s"), (1.0, "s"), (0.001, "ms")])
        return form, [(chance.choice(["Zeit", "Time", "t"]), unit, [t / size for t in truth.time_s])]
    if form == "two":
        return form, [("Datum", "", stamps(truth, "%d.%m.%Y")), ("Uhrzeit", "", stamps(truth, "%H:%M:%S"))]
    if form == "epoch":
        return form, [("Timestamp", "", [f"{1_772_000_000_000 + t * 1000:.0f}" for t in truth.time_s])]
    return form, [(chance.choice(["Zeitstempel", "Time", "DateTime"]), "", stamps(truth, form))]


def heat_columns(chance: random.Random, truth: Truth, mark: str, on_off: bool) -> list[Column]:
    """Return temperature, power and setpoint, with their units in the cells or in the names."""
    def cells(values: Sequence[float], unit: str, borne: bool) -> list[Any]:
        return [f"{value:.1f} {unit}".replace(".", mark) for value in values] if borne else list(values)

    borne = coin(chance, 0.3)
    found: list[Column] = [(chance.choice(["PV", "Istwert", "Temperatur", "T1", "Oven temp", "Kessel.Istwert"]),
                            "" if borne and coin(chance) else "°C", cells(truth.degC, "°C", borne))]
    name = chance.choice(["OP", "Stellgrad", "Heizung", "Heater", "Output", "Kessel.Stellwert"])
    borne = coin(chance, 0.3)
    if on_off:
        on, off = chance.choice([("ON", "OFF"), ("TRUE", "FALSE"), ("ein", "aus"), ("100 %", "0 %")])
        found.append((name, "", [on if u else off for u in truth.power]))
    else:
        found.append((name, "" if borne else "%", cells(truth.power, "%", borne)))
    if coin(chance):
        truth.setpoint = None
        return found
    blank = coin(chance, 0.3)
    setpoints = ["" if blank and k and w == truth.setpoint[k - 1] else w for k, w in enumerate(truth.setpoint)]
    return [*found, (chance.choice(["SP", "Sollwert", "Setpoint"]), "°C", setpoints)]


def dressed(chance: random.Random, text: str, separator: str, units: Sequence[str]) -> str:
    """Return a table with a row of units, titles, separators at the ends of its lines."""
    if any(units):
        head, rest = text.split("\n", 1)
        text = "\n".join([head, separator.join(units), rest])
    if coin(chance, 0.3):
        titles = ["Export", f"Anlage{separator}3", "", f"Stand{separator}01.03.2026 10:00:00", "Charge 12/7"]
        text = "\n".join(chance.sample(titles, chance.randint(1, 4))) + "\n" + text
    if coin(chance, 0.2):
        text = f"sep={separator}\n" + text
    if coin(chance, 0.2):
        text = "\n".join(line + separator if line else line for line in text.split("\n"))
    return text.replace("\n", chance.choice(["\n", "\r\n"]))


def composed(chance: random.Random) -> Messy:
    """Everything that may meet in one file, each by the toss of a coin."""
    on_off = coin(chance, 0.2)
    truth = heater(chance, chance.randint(60, 150), chance.choice([1.0, 5.0, 10.0, 60.0]),
                   levels=(0, 100) if on_off else (0, 20, 60, 100))
    separator, mark = chance.choice([(",", "."), (";", ","), (";", "."), ("\t", ","), ("\t", "."), ("|", ",")])
    form, columns = clock_columns(chance, truth)
    columns += heat_columns(chance, truth, mark, on_off)
    n = len(truth.time_s)
    more = [("Druck", "bar", [round(1.0 + chance.random(), 2) for _ in range(n)]), ("Bemerkung", "", ["Charge 7"] * n),
            ("Raumtemperatur", "°C", [20.5] * n), ("Nr", "", [str(k + 1) for k in range(n)])]
    for column in chance.sample(more, chance.randint(0, 4)):
        columns.insert(0 if column[0] == "Nr" else len(columns), column)
    rows = list(zip(*(cells for _, _, cells in columns), strict=True))
    if coin(chance, 0.2):  # the logger writes a row twice
        again = chance.randrange(5, n - 5)
        rows.insert(again, rows[again])
    if coin(chance, 0.15) and form not in ("number", "two") and truth.setpoint is None:
        rows.reverse()
    below = coin(chance, 0.3)
    names = [name if below or not unit else f"{name} {chance.choice(['[{}]', '({})']).format(unit)}" for name, unit, _ in columns]
    text = table(names, list(zip(*rows, strict=True)), separator, mark)
    text = dressed(chance, text, separator, [unit for _, unit, _ in columns] if below else [])
    return Messy("composed", text, truth, encoding=chance.choice(["utf-8", "utf-8-sig", "utf-16", "latin-1"]))


# ---- files that must be refused

def two_zones(chance: random.Random) -> Messy:
    one, two = heater(chance, 60, 2.0), heater(chance, 60, 2.0)
    rows = [row for k in range(60) for row in ((one.time_s[k], "A", one.degC[k], one.power[k]),
                                               (one.time_s[k], "B", two.degC[k] + 3.0, two.power[k]))]
    name = chance.choice(["zone", "rack", "line"])
    text = table(["time [s]", name, "T [°C]", "power [%]"], list(zip(*rows, strict=True)))
    if chance.random() < 0.5:
        one.setpoint = None
        return Messy("one zone asked for", text, one, {"tag": "A", "tag_column": name})
    return Messy("two zones", text, None, named=name)


def foreign_power(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    name, scale = chance.choice([("heater [V]", 0.1), ("amps", 0.02), ("control", 0.02), ("power [W]", 0.5), ("Q1", 0.01),
                                 ("PWM", 0.6), ("current [mA]", 0.2), ("power", 2.55), ("Spannung", 0.24)])
    power = [round(u * scale, 3) if name != "PWM" else round(u * scale) for u in truth.power]
    return Messy("foreign power", table(["time [s]", "T [°C]", name], [truth.time_s, truth.degC, power]), None,
                 named="--power-full-scale")


def no_unit(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    degC = chance.choice([[y + 273.15 for y in truth.degC], [y * 100.0 for y in truth.degC], [y * 27.648 * 2 for y in truth.degC],
                          [y - 150.0 for y in truth.degC]])
    return Messy("no unit", table(["time [s]", "PV"], [truth.time_s, [round(y, 2) for y in degC]]), None,
                 named="--temperature-unit")


def unnamed_tags(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    rows = [row for k in range(60) for row in ((chance.choice(["Q7"]), truth.time_s[k], truth.degC[k]),
                                               ("Q8", truth.time_s[k], truth.power[k]), ("Q9", truth.time_s[k], 5.0))]
    return Messy("unnamed tags", table(["tag", "time", "value"], list(zip(*rows, strict=True))), None, named="--tag")


def odd_flags(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    flags = [chance.choice(["7", "9"]) for _ in truth.time_s]
    text = table(["tag", "time", "value", "quality"], [["Temperature"] * 60, truth.time_s, truth.degC, flags])
    return Messy("odd flags", text, None, named="--quality-column")


def without(truth: Truth, lost: set[int]) -> Truth:
    """Return the truth without some rows, which a reader has to leave out."""
    kept = [k for k in range(len(truth.time_s)) if k not in lost]
    return Truth([truth.time_s[k] for k in kept], [truth.degC[k] for k in kept], [truth.power[k] for k in kept])


def broken(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 2.0)
    lines = table(["time [s]", "T [°C]", "power [%]"], [truth.time_s, truth.degC, truth.power]).splitlines()
    k = chance.randint(5, 55)
    cells = lines[k].split(",")
    lines[k], named = chance.choice([
        (",".join(cells[:2]), ""), (f"{cells[0]},warm,{cells[2]}", ""), (f"{cells[0]},,{cells[2]}", ""),
        (f"{cells[0]},{cells[1]},on", f"line {k + 1}"), (f"{cells[0]},{cells[1]} °F,{cells[2]}", ""),
        (f"{cells[0]},1.234,5,{cells[2]}", ""), (f'{cells[0]},"{cells[1]},{cells[2]}', ""),
    ])
    return Messy("broken", "\n".join(lines) + "\n", None if named else without(truth, {k - 1}), named=named)


def coarse_clock(chance: random.Random) -> Messy:
    """Two rows in each second of the clock, which a reader spreads evenly."""
    truth = heater(chance, 90, 0.5)
    truth.setpoint = None
    return Messy("coarse clock", table(["Time", "T [°C]", "power [%]"], [stamps(truth, "%Y-%m-%d %H:%M:%S"), truth.degC, truth.power]), truth)


def days(chance: random.Random) -> Messy:
    truth = heater(chance, 60, 10.0)
    return Messy("days", table(["Date", "T [°C]", "power [%]"], [[f"{46082.5 + t / 86400:.8f}" for t in truth.time_s], truth.degC, truth.power]),
                 None, named="--time-unit")


WRITERS: tuple[Callable[[random.Random], Messy], ...] = (
    composed,     plain, titled, with_units, fahrenheit_cells, switched, clocks, two_columns, epochs, grafana, trace, long_table,
    home_assistant, wincc, started, held_setpoint, counts, logger_restarted, two_zones, foreign_power, no_unit,
    unnamed_tags, odd_flags, broken, coarse_clock, days, extras, grid_of_titles, quoted, trailing, spaced, jitter, influx, flagged,
    before_trigger, mixed_long, relay_between, blanks, two_ovens, odd_lines, summer_time, american, minutes, tagged_two,
)


def files(number: int, seed: int) -> list[Messy]:
    """Return so many files, all kinds in turn."""
    return [WRITERS[k % len(WRITERS)](random.Random(f"{seed}-{k}")) for k in range(number)]


def without_edges(log: Log, truth: Truth) -> Log:
    """Return a log without the rows that stand for a change of the power alone, their temperature between its neighbours'."""
    if log.power_pct is None or truth.power is None:
        return log
    time, temperature = log.time_s - log.time_s[0], log.temperature_degC
    known = np.min(np.abs(time[:, None] - (np.array(truth.time_s) - truth.time_s[0])[None, :]), axis=1) < 2e-3
    for k in np.flatnonzero(~known):
        around = temperature[[k - 1, k + 1]]
        if log.power_pct[k] == log.power_pct[k - 1] or not around.min() - 1e-9 <= temperature[k] <= around.max() + 1e-9:
            return log
    columns = ("time_s", "temperature_degC", "power_pct", "setpoint_degC")
    kept = {name: column[known] for name in columns if (column := getattr(log, name)) is not None}
    return Log(name=log.name, source=log.source, **kept)


def differs(log: Log, truth: Truth) -> str:
    """Return in which column a log differs from what was written, empty where it does not."""
    log = without_edges(log, truth)
    for name, told in (("time_s", truth.time_s), ("temperature_degC", truth.degC), ("power_pct", truth.power),
                       ("setpoint_degC", truth.setpoint)):
        found = getattr(log, name)
        if (found is None) != (told is None):
            return f"{name} is {'missing' if found is None else 'not there'}"
        if told is not None:
            wanted = np.array(told) - (told[0] if name == "time_s" else 0.0)
            found = found - (found[0] if name == "time_s" else 0.0)
            if found.shape != wanted.shape or not np.allclose(found, wanted, rtol=0.0, atol=2e-3 if name == "time_s" else 1e-9):
                return f"{name} differs"
    return ""


def judged(folder: Path, messy: Messy, number: int) -> str:
    """Return "read", "refused", or what is wrong."""
    path = folder / f"log{number}.csv"
    path.write_bytes(messy.text.encode(messy.encoding))
    try:
        log = read_log(path, **messy.options)
    except HeatertuneError as problem:
        told = str(problem)
        if "\n" in told or messy.truth is not None or messy.named not in told:
            return f"WRONG: refused: {told}"
        return "refused"
    if messy.truth is None:
        return f"WRONG: read, {log.taken.line}"
    if wrong := differs(log, messy.truth):
        return f"WRONG: {wrong}: {log.taken.line}: {log.repairs}"
    again = read_log(path, **log.taken.reading)
    same = all(np.array_equal(getattr(log, name), getattr(again, name)) for name in ("time_s", "temperature_degC"))
    same = same and differs(again, messy.truth) == "" and again.taken.reading == log.taken.reading
    return "read" if same else f"WRONG: not repeated by {log.taken.reading} but {again.taken.reading}"


def main() -> int:
    """Print how many files of each kind were read and refused, and each one that went wrong."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--files", type=int, default=600)
    options.add_argument("--seed", type=int, default=1)
    asked = options.parse_args()
    found: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number, messy in enumerate(files(asked.files, asked.seed)):
            told = judged(Path(folder), messy, number)
            found[messy.kind, told.partition(":")[0]] += 1
            if told.startswith("WRONG"):
                print(f"{messy.kind} {messy.options}: {told.replace(folder, '')}\n  {messy.text[:160]!r}")
    kinds = sorted({kind for kind, _ in found})
    print(f"{'kind':<22}{'read':>6}{'refused':>9}{'wrong':>7}")
    for kind in kinds:
        print(f"{kind:<22}{found[kind, 'read']:>6}{found[kind, 'refused']:>9}{found[kind, 'WRONG']:>7}")
    return 1 if any(told == "WRONG" for _, told in found) else 0


if __name__ == "__main__":
    sys.exit(main())

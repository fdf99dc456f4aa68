"""Exports of recorders, smart plugs, printers and PLCs that no other bench writes, in many languages and clocks.

    python -m tests.bench.hostile_exports --field [--only NAME] [--verbose] [--draw N]

As `hostile_exports`: the heater is known, and none may be read into another or accused falsely.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial
from typing import Any

from tests.bench.hostile_exports import HEAD, plain
from tests.bench.hostile_exports import hostile as _hostile
from tests.bench.tool_exports import START, Run, comma, iso, point, stamped, text

WRITERS: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = []
hostile = partial(_hostile, into=WRITERS)
EPOCH = 1773482280


@hostile("Omron CX-Supervisor, words of a row in Japanese")
def _(run):
    rows = [["日付", "時刻", "現在値(℃)", "目標値(℃)", "操作量(%)"]]
    rows += [[stamped("%Y/%m/%d")(s), stamped("%H:%M:%S")(s), point(d), point(t), point(p)] for s, d, p, t in run.rows]
    return text(rows, end="\r\n").encode("cp932"), {}


@hostile("Shelly status with power in watts")
def _(run):
    return text([["ts", "apower", "temperature:100.tC", "output"], *(
        [str(EPOCH + int(s)), f"{20 * p:.1f}", f"{d:.2f}", "true" if p else "false"] for s, d, p, _ in run.rows)]), {
            "--power-full-scale": "2000", "--power-column": "apower"}


@hostile("Tasmota console")
def _(run):
    lines = []
    for s, d, p, _ in run.rows:
        at = stamped("%H:%M:%S")(s)
        lines.append(f"{at}.123 MQT: tele/oven/SENSOR = " + json.dumps({
            "Time": iso(s, mark="T"), "DS18B20": {"Id": "01131B", "Temperature": round(d, 1)}, "Dimmer": p, "TempUnit": "C"}))
    return "\n".join(lines), {"--power-full-scale": "100", "--power-column": "Dimmer"}


@hostile("Tasmota JSON lines")
def _(run):
    lines = [json.dumps({"Time": iso(s, mark="T"), "DS18B20": {"Id": "01131B", "Temperature": round(d, 1)},
                         "Heater_pct": p, "TempUnit": "C"}) for s, d, p, _ in run.rows]
    return "\n".join(lines), {}


@hostile("Modbus Poll")
def _(run):
    rows = [["Timestamp", "40001 PV x0.1", "40002 MV x0.1"], *(
        [stamped("%m/%d/%Y %I:%M:%S %p")(s), str(round(10 * d)), str(round(10 * p))] for s, d, p, _ in run.rows)]
    return text(rows, "\t", above=["Modbus Poll Log", "Tx = 650: Err = 0: ID = 1: F = 03: SR = 2000ms"], end="\r\n"), {
        "--temperature-unit": "0.1degC", "--power-full-scale": "1000"}


@hostile("Grafana CSV with units in its names' cells")
def _(run):
    return text([['"Time"', '"Oven temperature"', '"Heater duty"'], *(
        [f'"{iso(s)}"', f'"{d:.1f} °C"', f'"{p:g}%"'] for s, d, p, _ in run.rows)]), {}


@hostile("Grafana with a line of the separator, ms since 1970")
def _(run):
    return ("\ufeffsep=,\r\n" + text([['"Time"', '"oven{sensor=""top""}"', '"duty %"'], *(
        [str((EPOCH + int(s)) * 1000), f"{d:.2f}", f"{p:g}"] for s, d, p, _ in run.rows)], end="\r\n")).encode(), {
            "--temperature-column": "2", "--temperature-unit": "degC"}


@hostile("Prometheus range query")
def _(run):
    series = [{"metric": {"__name__": "oven_temperature_celsius", "job": "oven"},
               "values": [[EPOCH + int(s), f"{d:.2f}"] for s, d, _, _ in run.rows]},
              {"metric": {"__name__": "heater_power_percent", "job": "oven"},
               "values": [[EPOCH + int(s), f"{p:g}"] for s, _, p, _ in run.rows]}]
    return json.dumps({"status": "success", "data": {"resultType": "matrix", "result": series}}), {
        "--tag": "oven_temperature_celsius", "--power-tag": "heater_power_percent"}


@hostile("Fluke 289 with sample, start and duration")
def _(run):
    rows = [["Reading", "Sample", "Start Time", "Duration", "Max Time", "Max", "Average", "Min Time", "Min", "Description", "Stop Time", "Heater %"]]
    for k, (s, d, p, _) in enumerate(run.rows, start=1):
        at, end = stamped("%m/%d/%Y %I:%M:%S %p")(s), stamped("%m/%d/%Y %I:%M:%S %p")(s + 2)
        rows.append([str(k), f"{d:.1f} °C", at, "0:00:02.0", at, f"{d + 0.1:.1f} °C", f"{d:.1f} °C", at, f"{d - 0.1:.1f} °C", "Interval", end, f"{p:g}"])
    return text(rows), {"--temperature-column": "Sample", "--time-column": "Start Time"}


@hostile("Sinumerik trace with tabs and a header of pairs")
def _(run):
    rows = [["Zeit [ms]", "DB100.DBD4 Ist [°C]", "DB100.DBD8 Stellgrad [%]"], *(
        [f"{1000 * s:.0f}", comma(d, 2), comma(p, 1)] for s, d, p, _ in run.rows)]
    return text(rows, "\t", above=["; SINUMERIK 840D sl Trace V4.7", "; Kanal 1", ";"], end="\r\n").encode("cp1252"), {}


@hostile("Delta DTB, H and L of a register")
def _(run):
    return text([["No.", "Date", "Time", "PV", "SV", "OUT1(%)"], *(
        [str(k), stamped("%y-%m-%d")(s), stamped("%H:%M:%S")(s), point(d), point(t), point(p)]
        for k, (s, d, p, t) in enumerate(run.rows, start=1))], ";"), {"--temperature-unit": "degC"}


@hostile("Inkbird in Fahrenheit by the header alone")
def _(run):
    return text([["Time", "Temperature(℉)", "Heating(%)"], *(
        [stamped("%Y/%m/%d %H:%M:%S")(s), f"{1.8 * d + 32:.1f}", f"{p:g}"] for s, d, p, _ in run.rows)]), {}


@hostile("BrewPi with columns of two thermostats")
def _(run):
    names = ["Time", "Beer temp", "Beer setting", "Beer annot", "Fridge temp", "Fridge setting", "Fridge annot", "State", "Heater PWM %"]
    return text([names, *([iso(s), point(d, 2), "55.00", "", "20.1", "null", "", "3", f"{p:g}"] for s, d, p, _ in run.rows)], ";"), {
        "--temperature-column": "Beer temp", "--setpoint-column": "none", "--temperature-unit": "degC"}


@hostile("RepRapFirmware event log with temperatures")
def _(run):
    lines = [f"{iso(s)} [debug] T0 temp {d:.1f}C heater {p:g}%" for s, d, p, _ in run.rows]
    return "power up + 00:00:05 [info] Event logging started at level debug\n" + "\n".join(lines), {}


@hostile("Prusa metrics in the line protocol")
def _(run):
    lines = []
    for s, d, p, _ in run.rows:
        at = (EPOCH + int(s)) * 1_000_000
        lines += [f"temp_noz,mac=10:9c v={d:.2f} {at}", f"heater_pct,mac=10:9c v={p:g} {at}"]
    return "\n".join(lines), {"--tag": "temp_noz,mac=10:9c v", "--power-tag": "heater_pct,mac=10:9c v", "--time-unit": "us",
                              "--power-full-scale": "100"}


@hostile("PuTTY log with colours")
def _(run):
    lines = ["=~=~=~=~=~=~=~=~=~=~=~= PuTTY log 2026.03.14 09:58:00 =~=~=~=~=~=~=~=~=~=~=~="]
    lines += [f"\x1b[32m{s:.0f},{d:.2f},{p:g}\x1b[0m" for s, d, p, _ in run.rows]
    return "\r\n".join([lines[0], "\x1b[1mtime_s,temp_C,heater_pct\x1b[0m", *lines[1:]]), {}


@hostile("dump of an SQLite table")
def _(run):
    lines = [f"INSERT INTO log VALUES({k},'{iso(s)}',{d:.2f},{p:g});" for k, (s, d, p, _) in enumerate(run.rows, start=1)]
    return "\n".join(["PRAGMA foreign_keys=OFF;", "BEGIN TRANSACTION;",
                      "CREATE TABLE log(id INTEGER, ts TEXT, temp_C REAL, heater_pct REAL);", *lines, "COMMIT;"]), {}


@hostile("sqlite3 -line")
def _(run):
    return "\n".join(f"        ts = {iso(s)}\n    temp_C = {d:.2f}\nheater_pct = {p:g}\n" for s, d, p, _ in run.rows), {}


@hostile("Chinese with a clock of characters")
def _(run):
    return text([["时间", "炉温(℃)", "输出功率(%)"], *(
        [stamped("%Y年%m月%d日 %H时%M分%S秒")(s), point(d), f"{p:g}"] for s, d, p, _ in run.rows)]).encode("gb18030"), {
            "--log-interval": "2"}


@hostile("Korean with a.m. and p.m. in front")
def _(run):
    def when(s: float) -> str:
        at = START + timedelta(hours=2.03, seconds=s)
        return f"{at:%Y-%m-%d} {'오전' if at.hour < 12 else '오후'} {(at.hour - 1) % 12 + 1}:{at:%M:%S}"
    return text([["시간", "온도(°C)", "히터 출력(%)"], *([when(s), point(d), f"{p:g}"] for s, d, p, _ in run.rows)]), {"--log-interval": "2"}


@hostile("Polish with blanks in thousands of seconds")
def _(run):
    rows = [[f"{1000 * s:,.0f}".replace(",", "\u00a0"), comma(d), comma(p)] for s, d, p, _ in run.rows]
    return text([["Czas [ms]", "Temperatura [°C]", "Moc [%]"], *rows], ";").encode("cp1250", "replace"), {}


@hostile("Turkish, day first, with points")
def _(run):
    return text([["Tarih", "Saat", "Sıcaklık (°C)", "Çıkış (%)"], *(
        [stamped("%d.%m.%Y")(s), stamped("%H:%M:%S")(s), comma(d), comma(p)] for s, d, p, _ in run.rows)], ";").encode("cp1254"), {
            "--power-column": "Çıkış (%)"}


@hostile("Czech UTF-16 with a mark")
def _(run):
    return ("\ufeff" + text([["Čas", "Teplota [°C]", "Výkon topení [%]"], *(
        [stamped("%d. %m. %Y %H:%M:%S")(s), comma(d), comma(p)] for s, d, p, _ in run.rows)], "\t", end="\r\n")).encode("utf-16-le"), {}


@hostile("a leap day with dates month first")
def _(run):
    begin = datetime(2028, 2, 28, 23, 50)
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"{begin + timedelta(seconds=s):%m/%d/%Y %H:%M:%S}")), {}


@hostile("29 February that is not")
def _(run):
    begin = datetime(2026, 2, 28, 23, 50)

    def when(s: float) -> str:
        at = begin + timedelta(seconds=s)
        return f"2026-02-29 {at:%H:%M:%S}" if at.day == 1 else f"{at:%Y-%m-%d %H:%M:%S}"
    return text(plain(run, ("Time", *HEAD[1:]), when=when)), {"--log-interval": "2"}


@hostile("years below zero of a broken clock")
def _(run):
    return text(plain(run, ("Time", *HEAD[1:]), when=lambda s: f"-001-11-30 00:{int(s) // 60:02d}:{int(s) % 60:02d}")), {"--log-interval": "2"}


@hostile("time stamps with zone names that change with summer time")
def _(run):
    begin = datetime(2026, 10, 25, 2, 50)

    def when(s: float) -> str:
        summer = s < 600
        at = begin + timedelta(seconds=s if summer else s - 3600)
        return f"{at:%Y-%m-%d %H:%M:%S} {'CEST' if summer else 'CET'}"
    return text(plain(run, ("Time", *HEAD[1:]), when=when)), {"--log-interval": "2"}


@hostile("blanks for readings in every second row, two devices")
def _(run):
    rows = []
    for s, d, p, _ in run.rows:
        rows += [[iso(s, digits=3), point(d, 2), ""], [iso(s + 0.4, digits=3), "", f"{p:g}"]]
    return text([["Time", *HEAD[1:]], *rows]), {}


@hostile("Bambu printer, MQTT messages with changes alone")
def _(run):
    lines, before = [], None
    for s, d, p, _ in run.rows:
        message = {"nozzle_temper": round(d, 2), "ts": EPOCH + int(s)}
        if p != before:
            message["heater_pct"] = p
        before = p
        lines.append(json.dumps({"print": message}))
    return "\n".join(lines), {}


@hostile("a multimeter's K-type in millivolts next to its degrees")
def _(run):
    return text([["t/s", "U/mV", "T/°C", "P/W"], *(
        [point(s), f"{0.0405 * (d - 20):.3f}", point(d), f"{20 * p:.0f}"] for s, d, p, _ in run.rows)], "\t"), {"--power-full-scale": "2000"}


@hostile("journalctl of a service")
def _(run):
    return "\n".join(f"{stamped('%b %d %H:%M:%S')(s)} pi ovend[812]: temp={d:.2f} C, duty={p:g} %" for s, d, p, _ in run.rows), {
        "--power-full-scale": "100"}


@hostile("thousands marks in milliseconds and watts, unquoted")
def _(run):
    return text([["time [s]", "Temp [°C]", "Power [W]"], *([point(s), point(d), f"{20 * p:,.0f} W"] for s, d, p, _ in run.rows)]), {
        "--power-full-scale": "2000"}

"""What terminals of databases print, and exports of historians, data loggers and home automation that no other bench writes.

    python -m tests.bench.hostile_exports --terminals [--only NAME] [--verbose] [--draw N]

As `hostile_exports`: the heater is known, and none may be read into another or accused falsely. The forms are those of
sqlite3 3.40, psql 15, mysql 8, DuckDB 1, and of the makers' manuals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import timedelta
from functools import partial
from typing import Any

from tests.bench.hostile_exports import hostile as _hostile
from tests.bench.tool_exports import START, Run, comma, iso, point, stamped, text

WRITERS: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = []
hostile = partial(_hostile, into=WRITERS)
EPOCH = 1773482280
NAMES = ("id", "ts", "temp_C", "heater_pct")
SCALE = {"--power-full-scale": "100"}
NO_NAMES = {"--temperature-unit": "degC", "--power-full-scale": "100", "--temperature-column": "3", "--power-column": "4", "--time-column": "2"}


def cells(run: Run, first: int = 1) -> Iterator[list[str]]:
    """Yield the row of a table with a key, as a database holds it."""
    for k, (s, d, p, _) in enumerate(run.rows, start=first):
        yield [str(k), iso(s), f"{d:.2f}", f"{p:.1f}"]


def framed(rows: Sequence[Sequence[str]], bars: str, lines: Sequence[str]) -> str:
    """Return a table with drawn lines: above the names, below them, and at the end."""
    widths = [max(map(len, column)) for column in zip(NAMES, *rows, strict=True)]
    body = [bars + bars.join(f" {cell:<{width}} " for cell, width in zip(row, widths, strict=True)) + bars for row in (NAMES, *rows)]
    rules = [line[0] + line[1].join(line[3] * (width + 2) for width in widths) + line[2] if line else "" for line in lines]
    return "\n".join(filter(None, [rules[0], body[0], rules[1], *body[1:], rules[2]])) + "\n"


@hostile("sqlite3 -box")
def _(run):
    return framed(list(cells(run)), "│", ("┌┬┐─", "├┼┤─", "└┴┘─")), {}


@hostile("sqlite3 -line with a key")
def _(run):
    return "\n".join("".join(f"{name:>10} = {cell}\n" for name, cell in zip(NAMES, row, strict=True)) for row in cells(run)), {}


@hostile("sqlite3 without names")
def _(run):
    return text(list(cells(run)), "|"), NO_NAMES


@hostile("sqlite3 without names, a key that goes on")
def _(run):
    return text(list(cells(run, 5021)), "|"), NO_NAMES


@hostile("sqlite3 -json, a record in each line")
def _(run):
    rows = ",\n".join(f'{{"id":{k},"ts":"{at}","temp_C":{d},"heater_pct":{p}}}' for k, at, d, p in cells(run))
    return f"[{rows}]\n", {}


@hostile("sqlite3 -quote")
def _(run):
    return "\n".join([",".join(f"'{name}'" for name in NAMES), *(f"{k},'{at}',{d},{p}" for k, at, d, p in cells(run))]), {}


@hostile("sqlite3 -html")
def _(run):
    head = "<TR>" + "\n".join(f"<TH>{name}</TH>" for name in NAMES) + "\n</TR>\n"
    return head + "".join("<TR>" + "\n".join(f"<TD>{cell}</TD>" for cell in row) + "\n</TR>\n" for row in cells(run)), {}


@hostile("sqlite3 -column")
def _(run):
    rows = [NAMES, ["-" * 3, "-" * 19, "-" * 6, "-" * 10], *cells(run)]
    return "\n".join("  ".join(f"{cell:<{width}}" for cell, width in zip(row, (3, 19, 6, 10), strict=True)) for row in rows), {}


@hostile("sqlite3 -ascii")
def _(run):
    return "".join("\x1f".join(row) + "\x1e" for row in [NAMES, *cells(run)]), {}


@hostile("psql in expanded form")
def _(run):
    parts = []
    for k, row in enumerate(cells(run), start=1):
        parts += [f"-[ RECORD {k} ]-----------------", *(f"{name:<10} | {cell}" for name, cell in zip(NAMES, row, strict=True))]
    return "\n".join(parts) + "\n\n", {}


@hostile("psql in expanded form, drawn lines")
def _(run):
    parts = []
    for k, row in enumerate(cells(run), start=1):
        parts += [f"╶[ RECORD {k} ]╴────────────────", *(f"{name:<10} │ {cell}" for name, cell in zip(NAMES, row, strict=True))]
    return "\n".join(parts) + "\n\n", {}


@hostile("psql with time zones and a footer")
def _(run):
    rows = [f" {k:>4} | {at}+01 | {d:>6} | {p:>10}" for k, at, d, p in cells(run)]
    return "\n".join(["  id  |           ts           | temp_C | heater_pct ", "------+------------------------+--------+------------", *rows,
                      f"({len(rows)} rows)", "", "Time: 12.345 ms"]), {}


@hostile("mysql with \\G")
def _(run):
    parts = []
    for k, row in enumerate(cells(run), start=1):
        parts += [f"*************************** {k}. row ***************************", *(
            f"{name:>10}: {cell}" for name, cell in zip(NAMES, row, strict=True))]
    return "\n".join([*parts, f"{len(run.seconds)} rows in set (0.01 sec)"]), {}


@hostile("mysql --xml")
def _(run):
    rows = ["  <row>\n" + "".join(f'\t<field name="{name}">{cell}</field>\n' for name, cell in zip(NAMES, row, strict=True)) + "  </row>\n"
            for row in cells(run)]
    return '<?xml version="1.0"?>\n\n<resultset statement="select * from log">\n' + "\n".join(rows) + "</resultset>\n", {}


@hostile("DuckDB with a row of types")
def _(run):
    lines = framed(list(cells(run)), "│", ("┌┬┐─", "├┼┤─", "└┴┘─")).split("\n")
    widths = [len(part) for part in lines[1].split("│")[1:-1]]
    kinds = "│" + "│".join(f"{kind:^{width}}" for kind, width in zip(("int32", "timestamp", "double", "double"), widths, strict=True)) + "│"
    return "\n".join([*lines[:2], kinds, *lines[2:]]), {}


@hostile("SQL Server's sqlcmd")
def _(run):
    rows = [f"{k:>11} {at}.0000000 {d:>24} {p:>24}" for k, at, d, p in cells(run)]
    head = f"{'id':<11} {'ts':<27} {'temp_C':<24} {'heater_pct':<24}"
    return "\r\n".join([head, f"{'-' * 11} {'-' * 27} {'-' * 24} {'-' * 24}", *rows, "", f"({len(rows)} rows affected)"]), {}


@hostile("Oracle's spool with a head on each page")
def _(run):
    lines, head = ["SQL> select ts, temp_c, heater_pct from log;"], ["", f"{'TS':<19} {'TEMP_C':>10} {'HEATER_PCT':>10}", "-" * 19 + " " + "-" * 10 + " " + "-" * 10]
    for k, (_, at, d, p) in enumerate(cells(run)):
        lines += [*(head if k % 50 == 0 else []), f"{at} {d:>10} {p:>10}"]
    return "\n".join([*lines, "", f"{len(run.seconds)} rows selected.", "", "SQL> spool off"]), {}


@hostile("YAML of records")
def _(run):
    return "".join(f"- ts: {at}\n  temp_C: {d}\n  heater_pct: {p}\n" for _, at, d, p in cells(run)), {}


@hostile("XML of attributes")
def _(run):
    return '<?xml version="1.0"?>\n<log>\n' + "".join(f'  <r ts="{at}" temp_C="{d}" heater_pct="{p}"/>\n' for _, at, d, p in cells(run)) + "</log>\n", {}


@hostile("KEPServerEX data logger")
def _(run):
    rows = [["_NAME", "_NUMERICID", "_VALUE", "_TIMESTAMP", "_QUALITY"]]
    for s, d, p, _ in run.rows:
        at = stamped("%m/%d/%Y %I:%M:%S")(s) + ".000 AM"
        rows += [["Oven.Zone1.PV_Temperature", "0", f"{d:.2f}", at, "192"], ["Oven.Zone1.OP_Heater_pct", "0", f"{p:.1f}", at, "192"]]
    return text(rows), SCALE


@hostile("FactoryTalk View float table")
def _(run):
    rows = [["Date", "Time", "Millitm", "TagName", "Value", "Status", "Marker"]]
    for s, d, p, _ in run.rows:
        at = [stamped("%m/%d/%Y")(s), stamped("%H:%M:%S")(s), "417"]
        rows += [[*at, "Oven\\Temperature", f"{d:.3f}", " ", " "], [*at, "Oven\\HeaterOutput", f"{p:.3f}", " ", " "]]
    return text(rows), SCALE | {"--tag": "Oven\\Temperature", "--power-tag": "Oven\\HeaterOutput"}


@hostile("AVEVA historian, cyclic query")
def _(run):
    rows = [["DateTime", "TagName", "Value", "QualityDetail"]]
    for s, d, p, _ in run.rows:
        rows += [[f"{iso(s)}.0000000", "Oven1.PV", f"{d:.2f}", "192"], [f"{iso(s)}.0000000", "Oven1.CV", f"{p:.1f}", "192"]]
    return text(rows, "\t"), SCALE | {"--tag": "Oven1.PV", "--power-tag": "Oven1.CV", "--temperature-unit": "degC"}


@hostile("PI DataLink with English months")
def _(run):
    rows = [["", "TIC101.PV", "TIC101.OP"], ["Timestamp", "°C", "%"]]
    return text([*rows, *([stamped("%d-%b-%y %H:%M:%S")(s), f"{d:.2f}", f"{p:.1f}"] for s, d, p, _ in run.rows)]), {}


@hostile("TwinCAT Scope with a head of pairs")
def _(run):
    head = [["Name", "ScopeProject1"], ["File", "C:\\scope.svdx"], ["StartTime of export", iso(0)], [""], ["Name", "fOvenTemperature", "Name", "fHeaterPower"],
            ["SymbolComment", "", "SymbolComment", ""], ["Data-Type", "REAL32", "Data-Type", "REAL32"], ["SampleTime[ms]", "2000", "SampleTime[ms]", "2000"], [""]]
    return text([*head, *([f"{1000 * s:.0f}", f"{d:.3f}", f"{1000 * s:.0f}", f"{p:.1f}"] for s, d, p, _ in run.rows)], "\t"), {
        "--time-unit": "ms", "--time-column": "1", "--temperature-column": "2", "--power-column": "4", "--temperature-unit": "degC", "--power-full-scale": "100"}


@hostile("BenchLink 34970A with thousandths behind a colon")
def _(run):
    rows = [["Scan", "Time", "101 <Oven> (C)", "Alarm 101", "102 <Heater> (VDC)", "Alarm 102"]]
    rows += [[str(k), f"{stamped('%m/%d/%Y %H:%M:%S')(s)}:{k * 7 % 10:03d}", f"{d:.3f}", "0", f"{p / 10:.4f}", "0"]
             for k, (s, d, p, _) in enumerate(run.rows, start=1)]
    return ("\ufeff" + text(rows, above=["Name:,Scan1", "Owner:,Lab", ""], end="\r\n")).encode("utf-16-le"), {
        "--power-full-scale": "10", "--power-column": "102 <Heater> (VDC)"}


@hostile("PicoLog with averages")
def _(run):
    return text([["", "TC-08 Ch1 Ave. (°C)", "ADC-24 Heater Ave. (V)"], *([f"{iso(s, mark='T')}Z", f"{d:.2f}", f"{p / 10:.3f}"] for s, d, p, _ in run.rows)]), {
        "--power-full-scale": "10", "--power-column": "3"}


@hostile("Graphtec GL240 with signs and blanks")
def _(run):
    head = ["Vendor,GRAPHTEC Corporation", "Model,GL240", "Sampling interval,2s", "Amp settings", "CH,Signal name,Input,Range,Filter,Span",
            "CH1,Oven,TEMP,TC_K,Off,1000,0,degC", "CH2,Heater,DC,10V,Off,100,0,%", "Data", "Number,Date&Time,ms,CH1,CH2", "NO.,Time,ms,degC,%"]
    rows = [[str(k), stamped("%Y/%m/%d %H:%M:%S")(s), "0", f"+ {d:5.1f}", f"+ {p:5.1f}"] for k, (s, d, p, _) in enumerate(run.rows, start=1)]
    return text(rows, above=head), SCALE | {"--power-column": "5"}


@hostile("S7-1200 data log")
def _(run):
    rows = [["Record", "Date", "UTC Time", "Temperature", "Heater"], *(
        [str(k), stamped("%m/%d/%Y")(s), stamped("%H:%M:%S")(s), f"{d:.5E}", f"{p:.5E}"] for k, (s, d, p, _) in enumerate(run.rows, start=1))]
    return text(rows, below=["//END", " " * 40]), SCALE


@hostile("Weintek data log")
def _(run):
    rows = [["Date", "Time", "Millisecond", "PV Temp", "MV %"], *(
        [stamped("%d/%m/%Y")(s), stamped("%H:%M:%S")(s), "120", point(d), point(p)] for s, d, p, _ in run.rows)]
    return text(rows), {}


@hostile("FHEM FileLog")
def _(run):
    lines = []
    for s, d, p, _ in run.rows:
        lines += [f"{iso(s, mark='_')} Ofen temperature: {d:.2f}", f"{iso(s, mark='_')} Ofen heater_pct: {p:g}"]
    return "\n".join(lines), SCALE | {"--tag": "Ofen temperature"}


@hostile("ioBroker history as JSON")
def _(run):
    rows = ",".join(f'{{"val":{d:.2f},"ts":{(EPOCH + int(s)) * 1000},"ack":true}}' for s, d, _, _ in run.rows)
    return f"[{rows}]", {"--temperature-column": "val", "--power-column": "none", "--temperature-unit": "degC"}, "no-power"


@hostile("RRDtool fetch")
def _(run):
    lines = ["                    temp_C           heater_pct", ""]
    return "\n".join([*lines, *(f"{EPOCH + int(s)}: {d:.10e} {p:.10e}" for s, d, p, _ in run.rows), f"{EPOCH + 1302}: -nan -nan"]), {}


@hostile("RRDtool xport as XML")
def _(run):
    rows = "".join(f"    <row><t>{EPOCH + int(s)}</t><v>{d:.10e}</v><v>{p:.10e}</v></row>\n" for s, d, p, _ in run.rows)
    legend = "<legend><entry>temp_C</entry><entry>heater_pct</entry></legend>"
    return f'<?xml version="1.0" encoding="ISO-8859-1"?>\n<xport>\n  <meta><start>{EPOCH}</start><step>2</step>{legend}</meta>\n  <data>\n{rows}  </data>\n</xport>\n', SCALE | {"--temperature-column": "2", "--power-column": "3"}


@hostile("Graphite as CSV, a series after the other")
def _(run):
    return "\n".join([*(f"oven.temperature,{iso(s)},{d:.2f}" for s, d, _, _ in run.rows), *(f"oven.heater_pct,{iso(s)},{p:g}" for s, _, p, _ in run.rows)]), SCALE


@hostile("ThingSpeak with fields")
def _(run):
    rows = [["created_at", "entry_id", "field1", "field2", "latitude", "longitude", "status"]]
    rows += [[f"{iso(s)} UTC", str(k), f"{d:.2f}", f"{p:g}", "", "", ""] for k, (s, d, p, _) in enumerate(run.rows, start=1)]
    return text(rows), {"--temperature-column": "field1", "--power-column": "field2", "--power-full-scale": "100", "--temperature-unit": "degC"}


@hostile("Zabbix history, newest first")
def _(run):
    rows = [["Timestamp", "Oven: Temperature", "Oven: Heater power"], *([iso(s), f"{d:.2f} °C", f"{p:g} %"] for s, d, p, _ in run.rows)]
    return text([rows[0], *reversed(rows[1:])], ";"), {}


@hostile("a simulation without names, exact and rising")
def _(run):
    heater, temperature, lines = run.heater, run.heater.room, []
    for second in range(500):
        lines.append(f"{second},{temperature:.5f},{0 if second < 5 else 80}")
        temperature += (heater.room + heater.gain * (80.0 if second >= 5 + heater.dead_time_s else 0.0) - temperature) / heater.time_constant_s + 1e-6
    return "\n".join(lines), {"--time-unit": "s", "--power-full-scale": "100", "--temperature-unit": "degC", "--time-column": "1"}


@hostile("a rising loop without names, numbered rows")
def _(run):
    heater, temperature, integral, lines, sent = run.heater, run.heater.room, 0.0, [], [0.0] * (int(run.heater.dead_time_s) + 1)
    for second in range(900):
        power = min(max(60.0 - 1.2 * (temperature - heater.room) + integral, 0.0), 100.0)
        integral += 0.02 * (heater.room + 45.0 - temperature)
        sent.append(power)
        lines.append(f"{second},{temperature:.4f},{power:.3f}")
        temperature += max((heater.room + heater.gain * sent[-1 - int(heater.dead_time_s)] - temperature) / heater.time_constant_s, 0.0) + 1e-5
    return "\n".join(lines), {"--time-unit": "s", "--power-full-scale": "100", "--temperature-unit": "degC", "--time-column": "1",
                              "--temperature-column": "2", "--power-column": "3"}


@hostile("German with a clock in hours and hundredths")
def _(run):
    return text([["Zeit [h]", "Temperatur [°C]", "Heizleistung [%]"], *([comma(s / 3600, 7), comma(d, 2), comma(p)] for s, d, p, _ in run.rows)], ";"), {}


@hostile("a recorder that prints every change of the power twice")
def _(run):
    rows, before = [], None
    for s, d, p, _ in run.rows:
        if before not in (None, p):
            rows.append([iso(s), point(d, 2), f"{before:g}"])
        rows.append([iso(s), point(d, 2), f"{p:g}"])
        before = p
    return text([["Time", "Temp [°C]", "Heater [%]"], *rows]), {}


@hostile("days in Excel's 1904 with a decimal comma and a title")
def _(run):
    begin = (START - START.replace(year=1904, month=1, day=1, hour=0, minute=0, second=0)) / timedelta(days=1)
    return text([["Versuch 12", "", ""], ["Datum", "Temperatur [°C]", "Leistung [%]"], *(
        [comma(begin + s / 86400, 8), comma(d, 2), comma(p)] for s, d, p, _ in run.rows)], ";"), {"--time-unit": "d"}


@hostile("SpreadsheetML of Excel 2003")
def _(run):
    def row(cells: Sequence[tuple[str, str]]) -> str:
        return "<Row>" + "".join(f'<Cell><Data ss:Type="{kind}">{cell}</Data></Cell>' for kind, cell in cells) + "</Row>\n"
    rows = row([("String", "Zeit"), ("String", "Temperatur [°C]"), ("String", "Leistung [%]")]) + "".join(
        row([("DateTime", f"{iso(s, mark='T')}.000"), ("Number", f"{d:.2f}"), ("Number", f"{p:g}")]) for s, d, p, _ in run.rows)
    return ('<?xml version="1.0"?>\n<?mso-application progid="Excel.Sheet"?>\n<Workbook xmlns="urn:schemas-microsoft-com:office:spreadsheet" '
            f'xmlns:ss="urn:schemas-microsoft-com:office:spreadsheet">\n<Worksheet ss:Name="Tabelle1"><Table>\n{rows}</Table></Worksheet></Workbook>'), {}

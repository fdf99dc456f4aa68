"""Exports of services, home automation, ovens of makers and PLC loggers that no other bench writes.

    python -m tests.bench.hostile_exports --services [--only NAME] [--verbose] [--draw N]

As `hostile_exports`: the heater is known, and none may be read into another or accused falsely.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from functools import partial
from typing import Any

from tests.bench.hostile_exports import HEAD, plain
from tests.bench.hostile_exports import hostile as _hostile
from tests.bench.tool_exports import Run, comma, iso, point, stamped, text

WRITERS: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = []
hostile = partial(_hostile, into=WRITERS)
EPOCH = 1773482280
OF_255 = {"--power-full-scale": "255"}
OF_1 = {"--power-full-scale": "1"}
PERCENT = {"--power-full-scale": "100"}


@hostile("T-962 reflow oven")
def _(run):
    # columns of the open firmware's serial log; Heat and Fan are 0 to 255
    lines = ["Starting logging", "#   Time,  Temp0, Temp1, Temp2, Temp3,  Set,Actual, Heat, Fan,  ColdJ, Mode"]
    lines += [f"{s:6.1f},  {d:5.1f}, {d + 0.3:5.1f},   0.0,   0.0, {t:5.1f}, {d:5.1f}, {2.55 * p:4.0f},   8, 25.1, BAKE" for s, d, p, t in run.rows]
    return "\n".join(lines), OF_255 | {"--temperature-column": "Actual", "--power-column": "Heat"}


@hostile("Moonraker's temperature store")
def _(run):
    # one reading a second, without a time; powers are shares of 1
    each = [row for row in run.rows for _ in range(2)]
    return json.dumps({"result": {"extruder": {
        "temperatures": [round(d, 2) for _, d, _, _ in each], "targets": [round(t, 1) for *_, t in each],
        "powers": [p / 100 for _, _, p, _ in each]}}}), {"--log-interval": "1"} | OF_1


@hostile("OctoPrint's graph as CSV, ºC with an ordinal")
def _(run):
    return text([["Time", "Tool 0 (ºC)", "Target (ºC)", "PWM (%)"], *([iso(s), point(d), point(t), f"{p:g}"] for s, d, p, t in run.rows)]), {}


@hostile("openHAB's events.log")
def _(run):
    lines, before = [], (None, None)
    for s, d, p, _ in run.rows:
        for name, unit, new, old in (("Oven_Temperature", " °C", f"{d:.1f}", before[0]), ("Oven_Power", " %", f"{p:g}", before[1])):
            if new != old:
                lines.append(f"{iso(s, digits=3)} [INFO ] [openhab.event.ItemStateChangedEvent   ] - Item '{name}' changed from "
                             f"{old if old is not None else 'NULL'}{unit if old is not None else ''} to {new}{unit}")
        before = f"{d:.1f}", f"{p:g}"
    return "\n".join(lines), {}


@hostile("openHAB's persistence of two items")
def _(run):
    def item(name: str, values: list[str]) -> dict[str, Any]:
        return {"name": name, "datapoints": str(len(values)), "data": [
            {"time": 1000 * (EPOCH + int(s)), "state": value} for s, value in zip(run.seconds, values, strict=True)]}
    return json.dumps([item("Oven_Temperature", [f"{d:.2f}" for d in run.degC]), item("Oven_Power", [f"{p:g}" for p in run.power])]), PERCENT


@hostile("InfluxDB, annotated CSV of Flux")
def _(run):
    lines = ["#group,false,false,true,true,false,false,true,true", "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string",
             "#default,_result,,,,,,,", ",result,table,_start,_stop,_time,_value,_field,_measurement"]
    ends = f"{iso(0, mark='T')}Z,{iso(1300, mark='T')}Z"
    lines += [f",,0,{ends},{iso(s, mark='T')}Z,{d:.2f},temperature_C,oven" for s, d, _, _ in run.rows]
    lines += ["", *lines[:4]]
    lines += [f",,1,{ends},{iso(s, mark='T')}Z,{p:g},power_pct,oven" for s, _, p, _ in run.rows]
    return "\r\n".join(lines), {}


@hostile("InfluxDB 1's command line")
def _(run):
    lines = ["name: oven", "time                power_pct temp_C", "----                --------- ------"]
    return "\n".join([*lines, *(f"{10**9 * (EPOCH + int(s))} {p:<9g} {d:.2f}" for s, d, p, _ in run.rows)]), {}


@hostile("Kibana's CSV")
def _(run):
    return text([['"@timestamp"', '"oven.temp_c"', '"oven.duty_pct"'], *(
        [f'"{stamped("%b %d, %Y @ %H:%M:%S")(s)}.000"', f'"{d:.1f}"', f'"{p:g}"'] for s, d, p, _ in run.rows)]), {}


@hostile("Elasticsearch hits")
def _(run):
    return json.dumps({"took": 3, "hits": {"total": {"value": 650}, "hits": [
        {"_index": "oven", "_id": str(k), "_source": {"@timestamp": f"{iso(s, mark='T')}.000Z", "temp_c": round(d, 2), "duty_pct": p}}
        for k, (s, d, p, _) in enumerate(run.rows)]}}), {}


@hostile("ESP-IDF's log")
def _(run):
    lines = ["I (312) cpu_start: Starting scheduler", "W (330) heater: no calibration, defaults used"]
    return "\n".join([*lines, *(f"I ({int(1000 * s)}) heater: T={d:.2f}C duty={p:g}%" for s, d, p, _ in run.rows)]), {}


@hostile("tuples of MicroPython's prompt")
def _(run):
    lines = [">>> for row in log: print(row)", "... "]
    return "\n".join([*lines, *(f"({s:.1f}, {d:.2f}, {p:g})" for s, d, p, _ in run.rows), ">>> "]), {
        "--time-unit": "s", "--temperature-column": "2", "--power-column": "3"} | PERCENT


@hostile("Arduino with bars and units behind numbers")
def _(run):
    return "\n".join(f"millis: {int(1000 * s)} | Temp: {d:.1f}C | Duty: {p:g}%" for s, d, p, _ in run.rows), {}


@hostile("Arduino's serial monitor with stamps and names")
def _(run):
    return "\n".join(f"{stamped('%H:%M:%S')(s)}.123 -> Setpoint:{t:.1f},Temp_C:{d:.2f},Duty_pct:{p:g}" for s, d, p, t in run.rows), {}


@hostile("rsyslog of a daemon")
def _(run):
    return "\n".join(f"{stamped('%b %d %H:%M:%S')(s)} oven heaterd[417]: temp={d:.2f} degC; power={p:g} %" for s, d, p, _ in run.rows), {}


@hostile("Octave's save -text")
def _(run):
    lines = ["# Created by Octave 9.2.0, Sat Mar 14 10:00:00 2026 CET <lab@pc>", "# name: data", "# type: matrix",
             f"# rows: {len(run.seconds)}", "# columns: 3"]
    return "\n".join([*lines, *(f" {s:g} {d:.2f} {p:g}" for s, d, p, _ in run.rows), "", ""]), {"--time-unit": "s", "--power-full-scale": "100"}


@hostile("gnuplot's table with a comment as header")
def _(run):
    return "\n".join(["# lab oven, 14 March", "# t[s]  T[degC]  P[%]", *(f"{s:<8g} {d:<8.2f} {p:g}" for s, d, p, _ in run.rows)]), {"--power-column": "P[%]"}


@hostile("LibreOffice Calc, .ods")
def _(run):
    def row(cells: list[tuple[str, str]]) -> str:
        return "<table:table-row>" + "".join(
            f'<table:table-cell office:value-type="{kind}"' + (f' office:value="{value}"' if kind == "float" else "") +
            f"><text:p>{value}</text:p></table:table-cell>" for kind, value in cells) + "</table:table-row>"
    rows = [row([("string", name) for name in HEAD])]
    rows += [row([("float", f"{s:g}"), ("float", f"{d:.2f}"), ("float", f"{p:g}")]) for s, d, p, _ in run.rows]
    names = " ".join(f'xmlns:{name}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"' for name in ("office", "table", "text"))
    content = (f'<?xml version="1.0" encoding="UTF-8"?><office:document-content {names} office:version="1.2"><office:body><office:spreadsheet>'
               f'<table:table table:name="Sheet1">{"".join(rows)}</table:table></office:spreadsheet></office:body></office:document-content>')
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("content.xml", content)
        archive.writestr("META-INF/manifest.xml", '<?xml version="1.0"?><manifest:manifest xmlns:manifest="urn:oasis:names:tc:opendocument:xmlns:'
                         'manifest:1.0"><manifest:file-entry manifest:full-path="/" manifest:media-type="application/vnd.oasis.opendocument.'
                         'spreadsheet"/><manifest:file-entry manifest:full-path="content.xml" manifest:media-type="text/xml"/></manifest:manifest>')
    return made.getvalue(), {}


@hostile("GX LogViewer of Mitsubishi")
def _(run):
    above = ["[LOGGING]", "RCPU_1,2,3,4", "DATETIME[YYYY/MM/DD hh:mm:ss.s],INTERVAL[us],FLOAT[DEC.2],UNIT[%]", ]
    return text([["TIME", "INTERVAL", "Oven temp(°C)", "Output(%)"], *(
        [f"{stamped('%Y/%m/%d %H:%M:%S')(s)}.0", "2000000", point(d, 2), f"{p:g}"] for s, d, p, _ in run.rows)], above=above, end="\r\n"), {}


@hostile("Automation Studio's trace in microseconds")
def _(run):
    return text([['"Time [us]"', '"gOven.Temp [°C]"', '"gOven.Out [%]"'], *(
        [f"{s * 1e6:.0f}", comma(d, 2), comma(p)] for s, d, p, _ in run.rows)], ";"), {}


@hostile("Jumo with channels and units in lines of their own")
def _(run):
    head = [["Datum/Zeit", "Kanal 1", "Kanal 2"], ["", "Ofen", "Stellgrad"], ["", "°C", "%"]]
    return text([*head, *([stamped("%d.%m.%Y %H:%M:%S")(s), comma(d), comma(p)] for s, d, p, _ in run.rows)], ";", end="\r\n").encode("cp1252"), {}


@hostile("Almemo with units behind names")
def _(run):
    return text([["DATUM:", "ZEIT:", '"M00: °C"', '"M01: %"'], *(
        [stamped("%d.%m.%y")(s), stamped("%H:%M:%S")(s), comma(d), comma(p)] for s, d, p, _ in run.rows)], ";"), {
            "--power-column": "M01: %", "--temperature-column": "M00: °C"}


@hostile("Domoticz")
def _(run):
    return text([["Date", "Temperature", "Dimmer level"], *([iso(s), point(d), f"{p:g}"] for s, d, p, _ in run.rows)]), PERCENT | {
        "--power-column": "Dimmer level"}


@hostile("CraftBeerPi, two sensors' names")
def _(run):
    return text([["DateTime", "Kettle Sensor", "Kettle Heater Power"], *([iso(s), f"{d:.2f}", f"{p:g}"] for s, d, p, _ in run.rows)]), PERCENT | {"--temperature-column": "Kettle Sensor"}


@hostile("MQTT Explorer's messages")
def _(run):
    messages = []
    for s, d, p, _ in run.rows:
        messages.append({"topic": "oven/temperature", "payload": f"{d:.2f}", "qos": 0, "timestamp": f"{iso(s, mark='T')}.000Z"})
        messages.append({"topic": "oven/heater_pct", "payload": f"{p:g}", "qos": 0, "timestamp": f"{iso(s, mark='T')}.000Z"})
    return json.dumps(messages), {}


@hostile("Simulink's signals with colons")
def _(run):
    return text([["time", "Temperature:1(inf)[degC]", "Heater:1(inf)[%]"], *([f"{s:.15g}", f"{d:.15g}", f"{p:g}"] for s, d, p, _ in run.rows)]), {
        "--time-unit": "s"}


@hostile("CloudWatch query results")
def _(run):
    def result(name: str, values: list[float]) -> dict[str, Any]:
        return {"Id": name, "Label": name, "Timestamps": [f"{iso(s, mark='T')}+00:00" for s in run.seconds], "Values": values, "StatusCode": "Complete"}
    return json.dumps({"MetricDataResults": [result("oven_temp_c", [round(d, 2) for d in run.degC]), result("oven_duty_pct", run.power)]}), {}


@hostile("Markdown table in an issue")
def _(run):
    rows = ["| Time (s) | Temp (°C) | Heater (%) |", "|---:|---:|---:|", *(f"| {s:g} | {d:.1f} | {p:g} |" for s, d, p, _ in run.rows)]
    return "\n".join(["Here is my log:", "", *rows, "", "Thanks!"]), {}


@hostile("QuestDB with quoted nanosecond stamps")
def _(run):
    return text([['"ts"', '"temp_c"', '"heater_pct"'], *([f'"{iso(s, mark="T")}.000000Z"', f"{d:.2f}", f"{p:g}"] for s, d, p, _ in run.rows)]), {}


@hostile("a Python list of dictionaries in a script")
def _(run):
    rows = ",\n    ".join(str({"t_s": s, "temp_c": round(d, 2), "heater_pct": p}) for s, d, p, _ in run.rows)
    return f"log = [\n    {rows},\n]\n", {}


@hostile("percent with a sign in the cells, seconds with a unit")
def _(run):
    return text([["t", "temperature", "heater"], *([f"{s:g} s", f"{d:.1f} °C", f"{p:g} %"] for s, d, p, _ in run.rows)], "\t"), {}


@hostile("a pivot of hours with minutes as columns")
def _(run):
    return text(plain(run, ("Elapsed", *HEAD[1:]), when=lambda s: f"0 days 00:{int(s) // 60:02d}:{int(s) % 60:02d}")), {}


@hostile("rows of JSON without names")
def _(run):
    return json.dumps([[s, round(d, 2), p] for s, d, p, _ in run.rows]), {"--time-unit": "s", "--temperature-column": "2", "--power-column": "3"} | PERCENT


@hostile("rows of JSON, names in the first")
def _(run):
    return json.dumps([["time_s", "temp_C", "duty_pct"], *([s, round(d, 2), p] for s, d, p, _ in run.rows)]), {}


@hostile("a kernel's seconds before each line")
def _(run):
    return "\n".join(f"[{s:12.6f}] heater: temp={d:.2f}C duty={p:g}%" for s, d, p, _ in run.rows), {}


@hostile("Grafana's JSON with values before instants")
def _(run):
    return json.dumps([{"target": "oven.temp_c", "datapoints": [[round(d, 2), 1000 * (EPOCH + int(s))] for s, d, _, _ in run.rows]},
                       {"target": "oven.duty_pct", "datapoints": [[p, 1000 * (EPOCH + int(s))] for s, _, p, _ in run.rows]}]), {}


@hostile("Datadog's query with a point list")
def _(run):
    def series(metric: str, values: list[float]) -> dict[str, Any]:
        return {"metric": metric, "unit": None, "scope": "host:oven", "pointlist": [[1000.0 * (EPOCH + s), v] for s, v in zip(run.seconds, values, strict=True)]}
    return json.dumps({"status": "ok", "series": [series("oven.temp_c", [round(d, 2) for d in run.degC]), series("oven.duty_pct", run.power)]}), {}


@hostile("Zephyr's log with a comma in its clock")
def _(run):
    return "\n".join(f"[{int(s) // 3600:02d}:{int(s) // 60 % 60:02d}:{int(s) % 60:02d}.000,000] <inf> oven: temp={d:.2f}C duty={p:g}%" for s, d, p, _ in run.rows), {}


@hostile("a TSV with a BOM and a units row in brackets")
def _(run):
    return "\ufeff" + text([["Time", "Oven PV", "Oven OP"], ["[s]", "[degC]", "[%]"], *([f"{s:g}", f"{d:.2f}", f"{p:g}"] for s, d, p, _ in run.rows)], "\t"), {}


@hostile("semicolons with blanks around and a closing semicolon")
def _(run):
    return "\n".join(["Zeit [s] ; Temperatur [°C] ; Stellgröße [%] ;", *(f"{s:g} ; {comma(d, 2)} ; {comma(p)} ;" for s, d, p, _ in run.rows)]), {}


@hostile("ARDUINO CLI monitor with comments between")
def _(run):
    lines = []
    for k, (s, d, p, _) in enumerate(run.rows):
        if k % 100 == 0:
            lines.append("Connected to /dev/ttyUSB0! Press CTRL-C to exit.")
        lines.append(f"{s:.2f}\t{d:.2f}\t{p:.0f}")
    return "\n".join(["time_s\ttemp_C\tduty_pct", *lines]), {}


@hostile("rows of JSON with a number in each line")
def _(run):
    return json.dumps([["time_s", "temp_C", "duty_pct"], *([s, round(d, 2), p] for s, d, p, _ in run.rows)], indent=1), {}


@hostile("Tasmota's console with sensor and relay")
def _(run):
    # formats of its documentation: SENSOR with TempUnit, POWER as a word; the relay switches a part of the power
    lines = []
    for s, d, p, _ in run.rows:
        at = iso(s)
        lines.append(f"{at[11:]}.110 MQT: stat/oven/DIMMER = {p:g}")
        lines.append(f'{at[11:]}.123 MQT: tele/oven/SENSOR = {{"Time":"{at.replace(" ", "T")}","DS18B20":{{"Id":"01131A","Temperature":{d:.2f}}},"TempUnit":"C"}}')
        lines.append(f"{at[11:]}.150 RSL: RESULT = {{}}")
    return "\n".join(lines), PERCENT | {"--power-tag": "DIMMER"}


@hostile("ThingSpeak's feed, its names in the channel")
def _(run):
    feeds = [{"created_at": iso(s).replace(" ", "T") + "Z", "entry_id": k, "field1": f"{d:.2f}", "field2": f"{p:g}"} for k, (s, d, p, _) in enumerate(run.rows)]
    return json.dumps({"channel": {"id": 9, "name": "oven", "field1": "Temperature", "field2": "Heater %"}, "feeds": feeds}), {}


@hostile("ThingsBoard's telemetry, a list for each key")
def _(run):
    def points(values: list[str]) -> list[dict[str, Any]]:
        return [{"ts": 1000 * (EPOCH + int(s)), "value": value} for s, value in zip(run.seconds, values, strict=True)]
    return json.dumps({"temperature": points([f"{d:.2f}" for d in run.degC]), "heaterPower": points([f"{p:g}" for p in run.power])}), {}


@hostile("Home Assistant's statistics, a mean in each row")
def _(run):
    rows = [[name, f"{EPOCH + s:.1f}", value, value, value] for s, d, p, _ in run.rows
            for name, value in (("sensor.oven_temperature", f"{d:.2f}"), ("sensor.oven_heater", f"{p:g}"))]
    return text([["statistic_id", "start_ts", "mean", "min", "max"], *rows]), PERCENT


@hostile("labels of the Arduino plotter, without a time")
def _(run):
    step = run.seconds[1] - run.seconds[0]
    return "\n".join(f"Setpoint:{t:.1f},Input:{d:.2f},Output:{2.55 * p:.2f}" for _, d, p, t in run.rows), OF_255 | {"--log-interval": f"{step:g}"}


@hostile("SenML in a list, its base in the first record")
def _(run):
    # labels and units: RFC 8428, tables 1 and 6 and its examples
    records = [{"n": name, "u": unit, "t": s, "v": value} for s, d, p, t in run.rows
               for name, unit, value in (("temperature", "Cel", round(d, 2)), ("setpoint", "Cel", t), ("heater", "%", p))]
    return json.dumps([{"bn": "urn:dev:ow:10e2073a01080063:", "bt": EPOCH}, *records]), {}


@hostile("SenML in lines, kelvins and a ratio, each record with its base")
def _(run):
    records = [{"bt": EPOCH + s, "n": name, "u": unit, "v": round(value, 4)} for s, d, p, _ in run.rows
               for name, unit, value in (("oven-temperature", "K", d + 273.15), ("oven-heater", "/", p / 100.0))]
    return "\n".join(map(json.dumps, records)), {}

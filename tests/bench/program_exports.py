"""What programs write that no other bench has: JSON of pandas and of home automation, Python's prints, packed files, loggers.

    python -m tests.bench.hostile_exports --programs [--only NAME] [--verbose] [--draw N]

As `hostile_exports`: the heater is known, and none may be read into another or accused falsely. The forms are those of
pandas 2, numpy 1.26, Home Assistant's REST API, mosquitto_sub, Campbell's TOA5, Lascar's EasyLog, and UaExpert.
"""

from __future__ import annotations

import bz2
import io
import json
import lzma
import zipfile
from collections.abc import Callable
from datetime import timedelta
from functools import partial
from typing import Any

import numpy as np

from tests.bench.hostile_exports import hostile as _hostile
from tests.bench.tool_exports import START, Run, iso, steps

WRITERS: list[tuple[str, Callable[[Run], tuple[Any, ...]]]] = []
hostile = partial(_hostile, into=WRITERS)
EPOCH = 1773482280
SCALE = {"--power-full-scale": "100", "--time-unit": "s"}


def records(run: Run) -> list[dict[str, float]]:
    """Return a record for each reading."""
    return [{"time_s": s, "temp_C": round(d, 2), "power_pct": p} for s, d, p, _ in run.rows]


def plain(run: Run) -> bytes:
    """Return the run as a table with names and units."""
    return "\n".join(["time_s,temp_C,power_pct", *(f"{s:g},{d:.2f},{p:g}" for s, d, p, _ in run.rows)]).encode()


@hostile("Campbell's TOA5 with four lines above the readings")
def _(run):
    head = ['"TOA5","CR1000X","CR1000X","12345","CR1000X.Std.05.01","CPU:oven.CR1X","51233","Table1"',
            '"TIMESTAMP","RECORD","Oven_C_Avg","Heater_Avg"', '"TS","RN","Deg C","%"', '"","","Avg","Avg"']
    return "\r\n".join([*head, *(f'"{iso(s)}",{k},{d:.2f},{p:g}' for k, (s, d, p, _) in enumerate(run.rows))]), {}


@hostile("EasyLog with a serial number in the first row alone")
def _(run):
    rows = [f"{k},{START + timedelta(seconds=s):%d/%m/%Y %H:%M:%S},{d:.1f},{p:.1f}" for k, (s, d, p, _) in enumerate(run.rows, start=1)]
    return "\r\n".join(["Oven,Time,Celsius(°C),Heater(%),Serial Number", f"{rows[0]},000012345", *rows[1:]]), {}


def entities(run: Run, *, minimal: bool) -> str:
    """Return the answer of Home Assistant's REST API: a list for each entity; `minimal`: named in the first record only."""
    answer = []
    for entity, unit, of in (("sensor.oven_temperature", "°C", [f"{d:.2f}" for d in run.degC]), ("sensor.oven_power", "%", [f"{p:g}" for p in run.power])):
        name = {"entity_id": entity, "attributes": {"unit_of_measurement": unit, "friendly_name": entity}}
        answer.append([{**(name if k == 0 or not minimal else {}), "state": state, "last_changed": f"{iso(s).replace(' ', 'T')}+00:00"}
                       for k, (s, state) in enumerate(zip(run.seconds, of, strict=True)) if k == 0 or not minimal or state != of[k - 1]])
    return json.dumps(answer)


@hostile("Home Assistant's REST history")
def _(run):
    return entities(run, minimal=False), {}


@hostile("Home Assistant's REST history, minimal response")
def _(run):
    return entities(run, minimal=True), {}


@hostile("mosquitto_sub with an instant and a topic before JSON")
def _(run):
    return "".join(f'{EPOCH + s:.6f} plant/oven {{"temperature": {d:.2f}, "power_pct": {p:g}}}\n' for s, d, p, _ in run.rows), {}


@hostile("a container's log with a stamp before JSON")
def _(run):
    return "".join(f"{iso(s).replace(' ', 'T')}.123456789Z {json.dumps({'temp_C': round(d, 2), 'power_pct': p})}\n" for s, d, p, _ in run.rows), {}


@hostile("server-sent events")
def _(run):
    return "".join(f"data: {json.dumps({'ts': 1000 * (EPOCH + s), 'temp_C': round(d, 2), 'power_pct': p})}\n\n" for s, d, p, _ in run.rows), {}


@hostile("dictionaries as Python prints them")
def _(run):
    return "".join(f"{dict(record, ok=True, error=None)}\n" for record in records(run)), {}


@hostile("Python's logging of a dictionary")
def _(run):
    return "".join(f"{iso(s)},000 INFO oven: { {'temp_C': round(d, 2), 'power_pct': p} }\n" for s, d, p, _ in run.rows), {}


@hostile("pandas, JSON by columns")
def _(run):
    columns = zip(*(record.values() for record in records(run)), strict=True)
    return json.dumps({name: {str(k): cell for k, cell in enumerate(cells)} for name, cells in zip(records(run)[0], columns, strict=True)}), {}


@hostile("pandas, JSON by an index of instants")
def _(run):
    return json.dumps({str(int(1000 * (EPOCH + s))): {"temp_C": round(d, 2), "power_pct": p} for s, d, p, _ in run.rows}), {}


@hostile("pandas, JSON split")
def _(run):
    return json.dumps({"columns": ["temp_C", "power_pct"], "index": [int(1000 * (EPOCH + s)) for s in run.seconds],
                       "data": [[round(d, 2), p] for _, d, p, _ in run.rows]}), {}


@hostile("pandas, JSON split without a time")
def _(run):
    return json.dumps({"columns": ["temp_C", "power_pct"], "index": list(range(len(run.seconds))),
                       "data": [[round(d, 2), p] for _, d, p, _ in run.rows]}), {"--log-interval": "2"}


@hostile("two zones in one object of JSON")
def _(run):
    other = records(steps(run.heater._replace(gain=0.4 * run.heater.gain), seed=9))
    return json.dumps({"zone1": other, "zone2": records(run)}), {"--tag": "zone2"}


@hostile("a table in a .zip")
def _(run):
    with zipfile.ZipFile(packed := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("logs/oven.csv", plain(run))
    return packed.getvalue(), {}


@hostile("a table in a .bz2")
def _(run):
    return bz2.compress(plain(run)), {}


@hostile("a table in a .xz")
def _(run):
    return lzma.compress(plain(run)), {}


@hostile("an array of numpy")
def _(run):
    np.save(file := io.BytesIO(), np.array([record[:3] for record in run.rows]))
    return file.getvalue(), SCALE


@hostile("names with quotation marks, as OPC UA has them of an S7")
def _(run):
    rows = [f'ns=3,s="Oven"."{name}";{value:g};{iso(s)};Good' for s, d, p, _ in run.rows for name, value in (("Temperature", d), ("xyz", p))]
    return "\n".join(["NodeId;Value;SourceTimestamp;StatusCode", *rows]), {"--power-tag": 'ns=3,s="Oven"."xyz"', **SCALE}


@hostile("a sketch of Arduino's PID library")
def _(run):
    return "\n".join(["millis,Input,Output,Setpoint", *(f"{1000 * s:g},{d:.2f},{2.55 * p:.2f},55" for s, d, p, _ in run.rows)]), {"--power-full-scale": "255"}


@hostile("thousandths of a degree")
def _(run):
    return "\n".join(["time_s,temp,heater_pct", *(f"{s:g},{round(1000 * d)},{p:g}" for s, d, p, _ in run.rows)]), {"--temperature-scale": "0.001"}

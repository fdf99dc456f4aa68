"""What it costs to read a log of 100,000 rows, in several formats: processor time, and memory as a multiple of the file's size.

    python -m tests.bench.long_logs [WORD]    formats with this word in their names

The bars: 1 s and 12 times; a compressed file counts as the table it holds. Each is read in a process of its own, which
has read a short log before, so that neither imports nor compiled code count; memory is measured in a second reading, by
`tracemalloc`, with the content of the file.
"""

from __future__ import annotations

import datetime as dt
import gzip
import io
import json
import os
import pickle
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from heatertune.log import read_log
from tests.bench import tool_exports

ROWS = 100_000
BEGIN = dt.datetime(2026, 3, 9, 20, 0, 0, tzinfo=dt.UTC)
MOST_S, MOST_TIMES = 1.0, 12.0
Row = tuple[int, float, int]


def rows(count: int) -> Iterator[Row]:
    """Yield seconds, °C and % of a heater that steps every 600 s."""
    for k in range(count):
        phase = k % 1200
        yield k, 40.0 + (phase if phase < 600 else 1200 - phase) / 30.0, 60 if phase < 600 else 20


def _stamp(second: int, shape: str) -> str:
    return (BEGIN + dt.timedelta(seconds=second)).strftime(shape)


def _table(head: str, line: Callable[[Row], str]) -> Callable[[int], bytes]:
    return lambda count: "\n".join([head, *map(line, rows(count)), ""]).encode()


def _long(row: Row) -> str:
    second, degC, pct = row
    stamp = _stamp(second, "%Y-%m-%dT%H:%M:%S.000Z")
    return f"sensor.oven_temperature,{degC:.2f},{stamp}\nnumber.heater_power,{pct},{stamp}"


def _parquet(count: int) -> bytes:
    import pyarrow as pa  # noqa: PLC0415 - an extra
    from pyarrow import parquet  # noqa: PLC0415 - an extra

    columns, out = np.array(list(rows(count))).T, io.BytesIO()
    parquet.write_table(pa.table(dict(zip(("time_s", "temperature_degC", "power_pct"), columns, strict=True))), out)
    return out.getvalue()


def _wide_parquet(count: int) -> bytes:
    import pyarrow as pa  # noqa: PLC0415 - an extra
    from pyarrow import parquet  # noqa: PLC0415 - an extra

    out, (second, degC, pct) = io.BytesIO(), zip(*rows(count), strict=True)
    columns: dict[str, object] = {"time": [BEGIN + dt.timedelta(seconds=each) for each in second], "temperature_degC": degC, "power_pct": pct}
    columns |= {f"x{i}": [(each * 7919 + i) % 9973 / 100 for each in second] for i in range(20)}
    parquet.write_table(pa.table(columns), out)
    return out.getvalue()


def _workbook(count: int) -> bytes:
    return tool_exports._xlsx([["Time", "Temperature [°C]", "Power [%]"], *(
        [BEGIN.replace(tzinfo=None) + dt.timedelta(seconds=row[0]), round(row[1], 2), row[2]] for row in rows(count))])


def _hosts(count: int) -> bytes:
    """A host's log: a command, two heaters' report and a remark for each reading."""
    return "".join(f"{(at := _stamp(row[0], '%Y-%m-%d %H:%M:%S'))},012 - Send: N{row[0]} M105*{row[0] % 256}\n"
                   f"{at},034 - Recv: ok T:{row[1]:.2f} /200.00 B:{60 + row[0] % 7 / 10:.2f} /60.00 @:{round(1.27 * row[2])} B@:{row[0] % 64}\n"
                   for row in rows(count)).encode()


_COMMA = _table("time [s],temperature [°C],power [%]", lambda row: f"{row[0]},{row[1]:.2f},{row[2]}")
#: format → name of the file, and what writes it with so many rows
FORMATS: dict[str, tuple[str, Callable[[int], bytes]]] = {
    "comma": ("log.csv", _COMMA),
    "comma, 20 more columns": ("log.csv", _table(
        "time [s],temperature [°C],power [%]" + "".join(f",x{i}" for i in range(20)),
        lambda row: f"{row[0]},{row[1]:.2f},{row[2]}" + "".join(f",{(row[0] * 7919 + i) % 9973 / 100:.2f}" for i in range(20)))),
    "semicolon, decimal comma, dates": ("log.csv", _table(
        "Zeit;Temperatur [°C];Leistung [%]",
        lambda row: f"{_stamp(row[0], '%d.%m.%Y %H:%M:%S')};{f'{row[1]:.2f}'.replace('.', ',')};{row[2]}")),
    "long table": ("log.csv", _table("entity_id,state,last_changed", _long)),
    "compressed": ("log.csv.gz", lambda count: gzip.compress(_COMMA(count))),
    "JSON lines": ("log.jsonl", lambda count: "".join(json.dumps(
        {"time_s": row[0], "temperature_degC": round(row[1], 2), "power_pct": row[2]}) + "\n" for row in rows(count)).encode()),
    "klippy.log": ("klippy.log", lambda count: "".join(["Starting Klippy...\n", *(
        f"Stats {row[0]}.0: gcodein=0  extruder: target=200 temp={row[1]:.1f} pwm={row[2] / 100:.3f} print_time={row[0]}.1 \n"
        for row in rows(count))]).encode()),
    "line protocol": ("log.txt", lambda count: "".join(
        f"oven temperature_degC={row[1]:.2f},power_pct={row[2]} {1_773_000_000 + row[0]}000000000\n" for row in rows(count)).encode()),
    "serial log": ("serial.log", lambda count: "".join(
        f"{_stamp(row[0], '%Y-%m-%d %H:%M:%S')},000 - Recv: ok T:{row[1]:.2f} /200.00 @:{round(1.27 * row[2])}\n"
        for row in rows(count)).encode()),
    "serial log of a host, two heaters": ("serial.log", _hosts),
    "line protocol with tags": ("log.txt", lambda count: "".join(
        f"oven,host=pi,zone=1 temperature_degC={row[1]:.2f} {1_773_000_000 + row[0]}000000000\n"
        f"oven,host=pi,zone=1 power_pct={row[2]}i {1_773_000_000 + row[0]}000000000\n" for row in rows(count)).encode()),
    "parquet": ("log.parquet", _parquet),
    "parquet, dates, 20 more columns": ("log.parquet", _wide_parquet),
    "workbook": ("log.xlsx", _workbook),
}
#: compressed format → the same table as text
PLAIN = {"compressed": "comma", "parquet": "comma", "parquet, dates, 20 more columns": "comma, 20 more columns",
         "workbook": "semicolon, decimal comma, dates"}


def cost(name: str, content: bytes, short: bytes) -> tuple[float, float, int]:
    """Return processor time [s], largest memory [bytes], and rows of the log, in a process of its own."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        with tempfile.TemporaryDirectory() as folder:
            _read(name, short, Path(folder))
            begun = time.process_time()
            count = _read(name, content, Path(folder))
            seconds = time.process_time() - begun
            tracemalloc.start()
            _read(name, content, Path(folder))
            most = tracemalloc.get_traced_memory()[1]
        with os.fdopen(writer, "wb") as pipe:
            pickle.dump((seconds, most, count), pipe)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        result: tuple[float, float, int] = pickle.load(pipe)
    os.waitpid(child, 0)
    return result


def _read(name: str, content: bytes, folder: Path) -> int:
    path = folder / name
    path.write_bytes(content)
    return len(read_log(path, power_full_scale=1.0 if name == "klippy.log" else 127.0 if name == "serial.log" else 100.0).time_s)


def main(word: str) -> int:
    """Print a row for each format; return how many are beyond a bar."""
    print("| format | MB | rows read | processor time [s] | memory [times the file] |")
    print("| --- | --- | --- | --- | --- |")
    beyond = 0
    for title, (name, write) in FORMATS.items():
        if word in title:
            content = write(ROWS)
            seconds, most, count = cost(name, content, write(2000))
            size = len(FORMATS[PLAIN[title]][1](ROWS)) if title in PLAIN else len(content)
            beyond += seconds > MOST_S or most > MOST_TIMES * size
            print(f"| {title} | {len(content) / 1e6:.1f} | {count} | {seconds:.2f} | {most / size:.1f} |", flush=True)
    return beyond


if __name__ == "__main__":
    sys.exit(main([*sys.argv, ""][1]))

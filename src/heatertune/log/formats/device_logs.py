"""Lines that name their values: logs of kilns, roasters and home automation, exports of laboratories and plants."""

from __future__ import annotations

import ast
import csv
import json
import re
import sys
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.errors import LogError
from heatertune.log.formats.format_table import FormatTable, Line, TextFormat, line_stamp, matching
from heatertune.log.quantities import is_number, role_of
from heatertune.log.sheet import Grid, drain
from heatertune.units import count

__all__ = ["DEVICE_LOGS", "PLANT_EXPORTS"]


_END_OF_HEADER: Final = "***End_of_Header***"
#: the line above the readings of LabVIEW, where somebody has cut off the header
_HEADLESS: Final = r"X_Value\t(?:[^\t]+\t)+Comment\s*$"


def _labview(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the segments of a .lvm file: each follows the second end of a header and names its columns."""
    separator = "," if any(line.startswith("Separator,Comma") for _, line in numbered[:30]) else "\t"
    decimal = next((line.split(separator)[1] for _, line in numbered[:30] if line.startswith("Decimal_Separator")), ".")
    names: list[str] = []
    units: list[str] = []
    rows, begins, in_header = list[tuple[int, list[str]]](), 0, True
    for number, line in numbered:
        cells = [cell.strip() for cell in line.split(separator)]
        if cells[0] == "Y_Unit_Label":
            units = cells[1:]
        if cells[0] in ("X_Value", "") and any(cell == "Comment" for cell in cells):
            names, in_header = cells[:cells.index("Comment")], False
            begins += 1
        elif cells[0] in ("LabVIEW Measurement", "Channels"):
            in_header = True
        elif not in_header and names and len(cells) >= len(names):
            rows.append((number, [cell.replace(decimal, ".") for cell in cells[:len(names)]]))
    if not rows:
        raise LogError("no segment with X_Value and readings", file=path,
                       expected="a measurement file of LabVIEW with one X column")
    units = ["", *units, *[""] * len(names)]
    return FormatTable.from_rows(
        ("time [s]" if name == "X_Value" else f"{name} [{units[k]}]" if units[k] else name
         for k, name in enumerate(names)),
        rows, f"Measurement of LabVIEW: {count(begins, 'segment')} read, X_Value in seconds.")


def _ignition(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the data set of Ignition: #NAMES, #TYPES and #ROWS stand above the rows."""
    cells = [(number, row) for number, line in numbered for row in csv.reader([line.replace("\0", "")])]
    names = next(row for (_, before), (_, row) in pairwise(cells) if before[0] == "#NAMES")
    rows = next(k for k, (_, row) in enumerate(cells) if row[0] == "#ROWS") + 1
    records = [(number, row) for number, row in cells[rows:] if len(row) == len(names)]
    return FormatTable.from_rows(names, records, f"Data set of Ignition: {count(len(records), 'row')} read.")


def _codesys(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a trace that CODESYS saves as text: the time in milliseconds, then the variables of the third line."""
    names = numbered[2][1].split()
    rows = [(number, cells) for number, line in numbered[3:] if len(cells := line.split()) == len(names)]
    return FormatTable.from_rows(("time [ms]", *names[1:]), rows, f"Trace of CODESYS: {count(len(rows), 'row')} read, "
                                 "their first column as milliseconds.")


def _paired(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a table in which each variable has a column of times of its own as a long table."""
    separator = _pair_separator(numbered[0][1])
    head = [cell.strip('" ') for cell in numbered[0][1].split(separator)]
    rows = list[tuple[int, list[str]]]()
    for number, line in numbered[1:]:
        cells = [cell.strip('" ') for cell in line.split(separator)]
        rows += [(number, [cells[k], head[k + 1], cells[k + 1]])
                 for k in range(0, min(len(cells), len(head)) - 1, 2) if cells[k] and cells[k + 1]]
    return FormatTable.from_rows((head[0], "tag", "value"), rows, f"Each of {count(len(head) // 2, 'variable')} was "
                                 "read with its own column of times.")


def _pair_separator(line: str) -> str:
    return next((mark for mark in ("\t", ";", ",") if mark in line), ",")


def _has_pairs(lines: Sequence[Line]) -> bool:
    """Return whether the first line names a time before each variable."""
    if not lines:
        return False
    head = [cell.strip('" ') for cell in lines[0][1].split(_pair_separator(lines[0][1]))]
    times = head[::2]
    return len(times) > 1 and len(head) == 2 * len(times) and len(set(times)) == 1 and role_of(times[0]) == "time" and (
        "time" not in map(role_of, head[1::2]))


def _within(lines: Sequence[Line], pattern: str) -> bool:
    return any(re.match(pattern, line) for _, line in lines)


PLANT_EXPORTS: Final = (
    TextFormat("measurement of LabVIEW", lambda lines: _within(lines[:60], re.escape(_END_OF_HEADER)) or
               _within(lines[:1], _HEADLESS), _labview),
    TextFormat("data set of Ignition", lambda lines: _within(lines[:5], '"?#NAMES"?'), _ignition),
    TextFormat("trace of CODESYS", lambda lines: len(lines) > 3 and lines[0][1].strip() == "CoDeSys Trace", _codesys),
    TextFormat("table with a time for each variable", _has_pairs, _paired))


_Record = Mapping[str, object]


#: kiln-controller, lib/oven.py: temp=66.00, target=65.00, …, heat_on=0.00, heat_off=2.00, run_time=0
_KILN: Final = re.compile(r"\btemp ?= ?(-?[\d.]+|nan|None), target=(-?[\d.]+).*\bheat_on=([\d.]+), heat_off=([\d.]+), "
                          r"run_time=(-?[\d.]+)")


def _kiln(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the control lines; the power is the share of the interval in which the elements were on."""
    rows = list[tuple[int, list[str]]]()
    for number, line in numbered:
        if (match := _KILN.search(line)) is not None:
            on, off = float(match[3]), float(match[4])
            share = f"{on / (on + off):.6g}" if on + off > 0.0 else "0"
            rows.append((number, [match[5], match[1], share, match[2]]))
    return FormatTable.from_rows(
        ("run_time [s]", "temp", "power [0...1]", "target"), rows,
        f"Log of kiln-controller: {count(len(rows), 'line')} read; the power is heat_on of heat_on + heat_off.")


#: [10:00:00][D][sensor:094]: 'Oven': Sending state 20.5 °C with 1 decimals of accuracy; also of a switch: ON
_ESPHOME: Final = re.compile(r"\[[A-Z]\]\[(\w[\w.]*):?\d*\]: '([^']+)':? (?:- )?Sending state:? ?"
                             r"(?:([^\s]+)(?: (\S*)( with))?)?")
_CLIMATE: Final = re.compile(r"\[[A-Z]\]\[climate:?\d*\]: +(Current|Target) Temperature: (-?[\d.]+) ?°C")
_COLOUR: Final = re.compile(r"\x1b?\[[\d;]+m")


def _esphome(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the states that are sent, as a long table; a climate's own temperature only where no sensor sends one."""
    rows, climate = list[tuple[int, list[str]]](), ""
    has_sensor = any("°C with" in line for _, line in numbered)
    for number, raw in numbered:
        line = _COLOUR.sub("", raw)
        match = _ESPHOME.search(line)
        if match is not None and match[3] is None:
            climate = match[2]
        elif match is not None and (match[5] or match[1] != "sensor"):  # else the line is cut off
            value = "" if match[3] == "nan" else f"{match[3]} {match[4] or ''}"
            rows.append((number, [line_stamp(line), match[2], value.strip()]))
        elif (part := _CLIMATE.search(line)) is not None and (part[1] == "Target" or not has_sensor):
            rows.append((number, [line_stamp(line), f"{climate} {part[1].lower()} temperature", f"{part[2]} °C"]))
    return FormatTable.from_rows(("time", "name", "value"), rows, f"Log of ESPHome: {count(len(rows), 'state')} read, "
                                 f"{len(numbered) - len(rows)} other lines passed over.")


#: measurement,tag=…,tag=… field=value,field=value 1741557600000000000
_KEY: Final = r"(?=[^\s=,])[^\s=,\\]*+(?:\\.[^\s=,\\]*+)*+"
_NAME: Final = r"(?=[^\s,])[^\s,\\]*+(?:\\.[^\s,\\]*+)*+"
_FIELD_VALUE: Final = r"(?:[^\s,\"]++|\"(?:[^\"\\]++|\\.)*+\")"
_POINT: Final = re.compile(
    rf"({_NAME}(?:,{_KEY}={_NAME})*) ({_KEY}={_FIELD_VALUE}(?:,{_KEY}={_FIELD_VALUE})*) (\d{{9,19}})\s*")
_FIELD: Final = re.compile(rf"({_KEY})=({_FIELD_VALUE})")


def _line_protocol(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a long table of the fields that are no text; where there is one series, a field alone is the tag."""
    names, lines = dict[str, str](), array("q")

    def fields() -> Iterator[list[str]]:
        for number, line in numbered:
            if (match := _POINT.fullmatch(line)) is not None:
                for name, value in _FIELD.findall(match[2]):
                    if value[0] != '"':
                        names[tag := f"{match[1]} {name}"] = name
                        lines.append(number)
                        yield [match[3], tag, value.rstrip("iu")]

    rows = Grid(fields(), len(_LONG))
    if len({tag.removesuffix(name) for tag, name in names.items()}) == 1:
        rows.columns[1] = rows.columns[1].map(names.__getitem__)
    points = len(np.unique(lines))
    return FormatTable(_LONG, rows, lines, [f"Line protocol of InfluxDB: {count(points, 'point')} read, "
                                            f"{len(numbered) - points} other lines passed over."])


_LONG: Final = ("time", "tag", "value")


def _artisan_csv(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the curves of Artisan's CSV; its -1 is a reading that failed, its Time1 minutes and seconds."""
    unit = "degF" if "Unit:F" in numbered[0][1] else "degC"
    header = numbered[1][1].split("\t")
    table = [(number, line.split("\t")) for number, line in numbered[2:]]
    whole = [(number, cells) for number, cells in table if len(cells) == len(header) and _MINUTES.fullmatch(cells[0])]
    places = [i for i, name in enumerate(header) if i and name not in ("Time2", "Event", "")]
    names = [f"{header[i]} temperature [{unit}]" if header[i] in ("ET", "BT") else header[i] for i in places]
    rows = [(number, _in_order([_of_minutes(cells[0]), *(_reading(header[i], cells[i]) for i in places)], names))
            for number, cells in whole]
    return FormatTable.from_rows(("time [s]", *_bean_first(names)), rows, f"CSV of Artisan: {count(len(rows), 'row')} "
                                 f"read, {len(table) - len(rows)} others left out.")


_MINUTES: Final = re.compile(r"[0-9]{1,4}:[0-9]{2}(\.[0-9]+)?")


def _of_minutes(cell: str) -> str:
    minutes, _, seconds = cell.partition(":")
    return f"{60 * int(minutes) + float(seconds):g}"


def _reading(name: str, cell: str) -> str:
    return "" if name in ("ET", "BT") and cell in ("-1", "-1.0", "-1.00") else cell


def _bean_first(names: Sequence[str]) -> list[str]:
    """Return the names, the bean's temperature before the environment's: of several the first one is read."""
    return sorted(names, key=lambda name: (name.startswith("ET "), name.startswith("BT ") is False))


def _in_order(row: Sequence[str], names: Sequence[str]) -> list[str]:
    return [row[0], *(row[1 + list(names).index(name)] for name in _bean_first(names))]


_ALOG: Final = re.compile(r"^\s*\{.*['\"]timex['\"]\s*:", re.DOTALL)


def _artisan_profile(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the curves of Artisan's .alog: a dictionary of Python, or JSON."""
    text = "\n".join(line for _, line in numbered)
    try:
        profile = json.loads(text) if '"timex"' in text else ast.literal_eval(text)
        curves = {f"{name} temperature [deg{profile.get('mode', 'C')}]": profile[key]
                  for name, key in (("BT", "temp2"), ("ET", "temp1"))}
        for k, name in enumerate(profile.get("extraname1", ())):
            if len(profile.get("extratemp1", ())) > k:
                curves |= {name: profile["extratemp1"][k], profile["extraname2"][k]: profile["extratemp2"][k]}
        times = profile["timex"]
        whole = {name: values for name, values in curves.items() if len(values) == len(times)}
        rows = [[repr(float(time)), *("" if values[k] == -1 else f"{values[k]}" for values in whole.values())]
                for k, time in enumerate(times)]
    except (ValueError, SyntaxError, KeyError, TypeError, IndexError, RecursionError) as problem:
        raise LogError("a roast profile that cannot be read", file=path,
                       expected="a file as Artisan saves it (.alog)") from problem
    return FormatTable(("time [s]", *whole), rows, list(range(1, len(rows) + 1)),
                       [f"Profile of Artisan: {count(len(rows), 'reading')} of {count(len(whole), 'curve')}."])


def _json_lines(path: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the records of which each stands in a line of its own."""
    records, lines, has_time = list[dict[str, str]](), list[int](), False
    for number, line in numbered:
        if (record := _record_in(line)) is not None:
            has_time |= not records and "time" in map(role_of, record)
            records.append({**({} if has_time else _stamp_before(line)), **dict(_flat(record))})
            lines.append(number)
    lost = len(numbered) - len(records)
    return _of_records(path, records, lines, f", {count(lost, 'line')} that are none left out" if lost else "")


def _json(path: Path, numbered: Sequence[Line], tag: str | None) -> FormatTable:
    """Return the longest list of records in a whole text of JSON as a table."""
    lists = _json_of(numbered, lambda value: dict(_lists(value))) or {}
    records = list(map(dict, map(_flat, _longest(path, lists, tag) if lists else ())))
    return _of_records(path, records, range(1, len(records) + 1))._replace(part=str(tag) if tag in lists else "")


def _json_of(lines: Sequence[Line], part: Callable[[Any], Any] = lambda value: value) -> Any:
    """Return a part of what lines of JSON hold, None where they are none, are nested too deep, or have no such part."""
    try:
        return part(json.loads("\n".join(line for _, line in lines)))
    except (ValueError, RecursionError, TypeError):
        return None


def _thingspeak(path: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the rows of a channel, which names its fields once, before them."""
    document = json.loads("\n".join(line for _, line in numbered))
    names = {key: str(name) for key, name in document["channel"].items() if key.startswith("field")}
    records = [{names.get(name, name): cell for name, cell in _flat(record)} for record in document["feeds"]]
    return _of_records(path, records, range(1, len(records) + 1))


def _is_thingspeak(lines: Sequence[Line]) -> bool:
    if not lines or lines[0][1].lstrip()[:1] != "{" or not any('"feeds"' in line for _, line in lines):
        return False
    try:
        document = json.loads("\n".join(line for _, line in lines))
        return all(isinstance(part, dict) for part in (document["channel"], *document["feeds"]))
    except (ValueError, RecursionError, TypeError, KeyError):
        return False


def _pandas(path: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a table that pandas wrote as JSON, in whichever orientation."""
    records = list(map(dict, map(_flat, _indexed(json.loads("\n".join(line for _, line in numbered))))))
    return _of_records(path, records, range(1, len(records) + 1))


def _of_records(path: Path, flat: list[dict[str, str]], lines: Sequence[int], left: str = "") -> FormatTable:
    """Return a column for each field of some records."""
    names, notes = _field_names(flat), [f"JSON: {count(len(flat), 'record')} read{left}."]
    if not names:
        raise LogError("JSON without records", file=path,
                       expected="an object with time and temperature in each line, or a list of such")
    if all("pidstats.out" in record and "runtime" in record for record in flat):
        names = _KILN_FIELDS
        notes.append("Its pidstats are kiln-controller's; the power is their out.")
    rows = [[record.get(name, "") for name in names] for record in drain(flat)]
    return FormatTable(tuple(names.values()), rows, lines, notes)


_KILN_FIELDS: Final = {
    "runtime": "runtime [s]", "temperature": "temperature", "pidstats.out": "power [0...1]", "target": "target"}


def _field_names(records: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Return field → name of its column: without the records around it, where that is unique.

    MQTT's payload is the value of a long table. Fields without a role that never change are left out.
    """
    names = {name: name.rpartition(".")[2] for record in records for name in record}
    if sum("topic" in record and "payload" in record for record in records) > len(records) / 2:
        return {name: "value" if name == "payload" else name for name in names if not name.startswith("_")}
    if len(set(names.values())) < len(names):
        names = {name: name for name in names}
    return {name: short for name, short in names.items() if role_of(short) is not None or _varies(records, name)}


#: 09:58:00.123 MQT: tele/oven/SENSOR = {"Time": …}, 1773482280.5 plant/oven {"temp": …}
_TOPIC: Final = re.compile(r"^[^{\"']*[\w/:\]] ?[=: ] ?(?=\{[\"'])")
_EPOCH: Final = re.compile(r"\d{10}(?:\.\d+)?(?= )")


def _record_in(line: str) -> _Record | None:
    """Return the record that a line holds, as JSON or as Python prints it."""
    text = _TOPIC.sub("", line.strip(" \t,[]"))
    text = text if '"' in text else _PYTHON.sub(lambda word: _AS_JSON[word[0]], text.replace("'", '"'))
    try:
        record, end = _DECODE(text)
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) and not text[end:].strip(" \t") else None


_DECODE: Final = json.JSONDecoder().raw_decode
_AS_JSON: Final = {"None": "null", "nan": "null", "True": "true", "False": "false"}
_PYTHON: Final = re.compile(rf"\b({'|'.join(_AS_JSON)})\b")


def _stamp_before(line: str) -> dict[str, str]:
    """Return the time in front of a record."""
    before = line[:line.index("{")]
    stamp = _EPOCH.match(before)
    return {"time": line_stamp(before) if stamp is None else stamp[0]} if before.strip(" \t,[") else {}


def _indexed(value: object) -> list[_Record]:
    """Return the records of what pandas writes: objects of one shape by an index, columns by one, or both split."""
    table = _of_orientation(value) if isinstance(value, dict) else {}
    first = next(iter(table.values()), {})
    is_counted = "time" in map(role_of, first) or list(table) == [*map(str, range(len(table)))]
    return [part if is_counted else {"time": key, **part} for key, part in table.items()]


def _of_orientation(value: Any) -> Mapping[str, _Record]:
    """Return index → record, empty if the objects are not of one shape."""
    if value.keys() >= _SPLIT:
        return {str(key): dict(zip(value["columns"], row, strict=False))
                for key, row in zip(value["index"], value["data"], strict=False)}
    parts = [part for part in value.values() if isinstance(part, dict)]
    if len(parts) < max(len(value), _TITLES) or any(part.keys() != parts[0].keys() for part in parts):
        return {}
    return value if len(parts) > len(parts[0]) else {
        key: {name: part[key] for name, part in value.items()} for key in parts[0]}


_SPLIT: Final = {"columns", "index", "data"}


def _longest(path: Path, lists: Mapping[str, list[_Record]], tag: str | None) -> list[_Record]:
    """Return the longest list of records, or that of the tag; of Home Assistant one for all entities.

    It names the entity and its unit in the first record only.
    """
    longest = max(lists.values(), key=len)
    alike = {name: each for name, each in lists.items() if each[0].keys() == longest[0].keys()}
    if _OF_ENTITY[0] in longest[0]:
        return [record for each in alike.values() for record in _with_entity(each)]
    if len(alike) > 1 and tag not in lists and "temperature" in map(role_of, longest[0]):
        raise LogError(f"{len(alike)} lists of the same fields", file=path, value=", ".join(alike),
                       expected=f"--tag and one of {', '.join(alike)}")
    return lists.get(str(tag), longest)


_OF_ENTITY: Final = ("entity_id", "attributes")


def _with_entity(records: Sequence[_Record]) -> list[_Record]:
    of_all = {name: records[0][name] for name in _OF_ENTITY if name in records[0]}
    return [{**of_all, **record} for record in records]


def _lists(value: object, name: str = "") -> Iterator[tuple[str, list[_Record]]]:
    """Yield each list of records within a value, by the names on the way to it."""
    if isinstance(value, list) and value and all(isinstance(part, dict) for part in value):
        yield name.strip("."), value
    elif isinstance(value, list | dict):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value, start=1):
            yield from _lists(part, f"{name}.{key}")


def _flat(record: _Record, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield name and cell of each value, of nested records with the names before it."""
    for name, value in record.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        elif not isinstance(value, list):
            cell = str(value)
            yield sys.intern(prefix + name), _JSON_WORDS.get(cell, cell)


_JSON_WORDS: Final = {"None": "", "True": "true", "False": "false"}


def _varies(records: Sequence[Mapping[str, str]], name: str) -> bool:
    return len({record.get(name, "") for record in records}) > 1


#: {"time_s": [0, 2, …], "temp": [20.1, …]}
_OF_LISTS: Final = re.compile(r'\s*\{\s*(?:"\w+"\s*:\s*\{\s*){0,3}"[^"]+"\s*:\s*\[\s*(?:[-"\d]|null|true|false)')


def _json_columns(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the lists of one length in an object, or in the first objects within it, as columns."""
    try:
        value = json.loads("\n".join(line for _, line in numbered))
    except (ValueError, RecursionError) as problem:
        raise LogError("JSON that cannot be read", file=path, expected="a whole file of JSON") from problem
    columns = dict(_lists_within(value))
    length = max(map(len, columns.values()), default=0)
    columns = {name: part for name, part in columns.items() if len(part) == length}
    rows = [[_JSON_WORDS.get(str(cell), str(cell)) for cell in row] for row in zip(*columns.values(), strict=True)]
    if not rows:
        raise LogError("JSON without columns", file=path, expected="lists of time and temperature of one length")
    return FormatTable(tuple(columns), rows, list(range(1, len(rows) + 1)), [f"JSON: {count(len(rows), 'row')} read."])


def _lists_within(value: _Record) -> Iterator[tuple[str, list[Any]]]:
    yield from ((name, part) for name, part in value.items() if isinstance(part, list))
    for inner in [part for part in value.values() if isinstance(part, dict)][:1]:
        yield from _lists_within(inner)


def _has_lists(lines: Sequence[Line]) -> bool:
    return bool(lines) and _OF_LISTS.match("\n".join(line[:200] for _, line in lines[:5])) is not None


def _starts_as_json(lines: Sequence[Line]) -> bool:
    first = _TOPIC.sub("", lines[0][1]) if lines else ""
    return re.match(r"(?:\w+\s*=)?[\s\[]*(\{|$)", first) is not None and any(
        re.search(r"[\"']\s*:", line) for _, line in lines[:50])


def _are_records(lines: Sequence[Line]) -> bool:
    return sum(_record_in(line) is not None for _, line in lines[:_SAMPLE]) > max(1, len(lines[:_SAMPLE]) // 2)


_SAMPLE: Final = 200
#: {"columns": [… and {"0": {"temp": 20.4, …
_OF_PANDAS: Final = re.compile(
    r'\s*\{\s*"(?:(?:columns|index|data)"\s*:\s*\[|[^"]*"\s*:\s*\{\s*"[^"]*"\s*:\s*[^\s{\[])')


def _is_indexed(lines: Sequence[Line]) -> bool:
    if not lines or _OF_PANDAS.match("\n".join(line[:_HEAD] for _, line in lines[:5])) is None:
        return False
    return bool(_json_of(lines, _indexed))


def _is_artisan(lines: Sequence[Line]) -> bool:
    return len(lines) > _TITLES and re.match(r"Date:.*\tUnit:[CF]\t", lines[0][1]) is not None and (
        lines[1][1].startswith("Time1\t"))


_TITLES: Final = 2


def _is_profile(lines: Sequence[Line]) -> bool:
    return bool(lines) and _ALOG.match("\n".join(line for _, line in lines[:2000])) is not None


_HEAD: Final = 1000
#: {"name": "Oven_Temperature", "data": [{"time": …, "metric": {"job": …}, "values": [[…, "Timestamps": ["2026-…
_OF_POINTS: Final = re.compile(r'"\w+"\s*:\s*\[\s*(?:\[|\{\s*"\w+"\s*:|"\d)')
_Point = tuple[str, str]


class _NamedSeries(NamedTuple):
    labels: _Record
    points: list[_Point]


def _is_series(lines: Sequence[Line]) -> bool:
    if not lines or lines[0][1].lstrip()[:1] not in ("{", "[") or _OF_POINTS.search(
            "\n".join(line[:_HEAD] for _, line in lines[:20])) is None:
        return False
    return bool(_json_of(lines, _series_in))


def _series_in(value: object) -> list[_NamedSeries]:
    """Return the first list of series within a value: several, or one of Prometheus, which has a metric."""
    parts = _parts_of(value)
    series = [_NamedSeries(labels, _points(record)) for labels, record in parts if isinstance(record, dict)]
    if len(series) == len(parts) > 0 and _are_series(series):
        return series
    inner = value.values() if isinstance(value, dict) else [part for part, _ in parts]
    return next(filter(None, map(_series_in, inner)), [])


def _parts_of(value: object) -> list[tuple[Any, object]]:
    """Return the labels of what may be a series each, and its record: the parts of a list, or what an object names."""
    if isinstance(value, dict):
        return [({"name": name}, {name: part}) for name, part in value.items()]
    return [(part, part) for part in value] if isinstance(value, list) else []


def _are_series(series: Sequence[_NamedSeries]) -> bool:
    several = len(series) > 1 or any("metric" in each.labels for each in series)
    return several and all(each.points for each in series)


def _points(record: _Record) -> list[_Point]:
    """Return time and value of the points in a record of a series, empty if it is none."""
    lists = {name: part for name, part in record.items() if isinstance(part, list) and part}
    clock = next((name for name in lists if role_of(name) == "time"), None)
    if clock is not None and len(lists) == _TITLES:  # times beside values; of other lengths they are no series
        return [(str(at), str(value)) for at, value in zip(lists.pop(clock), *lists.values(), strict=True)]
    return _points_of_rows(next(iter(lists.values()))) if len(lists) == 1 else []


def _points_of_rows(rows: Sequence[Any]) -> list[_Point]:
    if any(not isinstance(row, list | dict) or len(row) != _TITLES for row in rows):
        return []
    place = _place_of_time(rows[0])
    pairs = [(*map(str, row.values() if isinstance(row, dict) else row),) for row in rows]
    return [] if place is None else [(pair[place], pair[1 - place]) for pair in pairs]


def _place_of_time(pair: Mapping[str, object] | Sequence[object]) -> int | None:
    """Return whether the time is the first or the second of a pair, None if neither is named so."""
    if isinstance(pair, Mapping):
        roles = [*map(role_of, pair)]
        return roles.index("time") if "time" in roles else None
    first = str(pair[0])  # a time since 1970, or one in words; other pairs have the value first
    return int(is_number(first) and float(first) < _LEAST_EPOCH)


_LEAST_EPOCH: Final = 1e8


def _series(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the series of a query or of several items as a long table, named by the labels that they do not share."""
    all_series = _series_in(json.loads("\n".join(line for _, line in numbered)))
    labels = [dict(_flat(each.labels)) for each in all_series]
    shared = set.intersection(*(set(each.items()) for each in labels))
    rows = [[at, " ".join(sorted({value for name, value in each.items() if (name, value) not in shared})), value]
            for each, series in zip(labels, all_series, strict=True) for at, value in series.points]
    rows.sort(key=lambda row: (float(row[0]), "") if is_number(row[0]) else (0.0, row[0]))
    return FormatTable(_LONG, rows, list(range(1, len(rows) + 1)), [f"JSON: {len(all_series)} series read."])


#: 2026-03-14 09:58:00.123 [INFO ] [openhab.event.ItemStateChangedEvent   ] - Item 'Oven' changed from 20.3 to 20.4 °C
_OPENHAB: Final = re.compile(r"\bItem '([^']+)' (?:changed from .* to|updated to|received update) (.+?)\s*$")


def _openhab(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the states of items as a long table."""
    rows = [(number, [line_stamp(line), match[1], match[2]])
            for number, line in numbered if (match := _OPENHAB.search(line)) is not None]
    return FormatTable.from_rows(_LONG, rows, f"Events of openHAB: {count(len(rows), 'state')} read, "
                                 f"{len(numbered) - len(rows)} other lines passed over.")


#: 09:58:00.123 MQT: stat/oven/POWER = ON, 09:58:00 MQT: tele/oven/SENSOR = {"Time": …, "DS18B20": {"Temperature": …
_TASMOTA: Final = re.compile(r"MQT: (?:\S+/)?(\w+) = (.*\S)")


_TASMOTA_WORD: Final = re.compile(r"MQT: \S+ = [^\s{]")


def _tasmota(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the values that are published as a long table, named within their message; the last topic names a word."""
    rows = list[tuple[int, list[str]]]()
    for number, line in numbered:
        if (match := _TASMOTA.search(line)) is None:
            continue
        record = _record_in(match[2])
        cells = {match[1]: match[2]} if record is None else dict(_flat(record))
        rows += [(number, [line_stamp(line[:match.start()]), name, cell]) for name, cell in cells.items()
                 if is_number(cell) or cell in ("ON", "OFF")]
    return FormatTable.from_rows(_LONG, rows, f"Console of Tasmota: {count(len(rows), 'value')} read.")


_SENML: Final = frozenset(("bn", "bu", "bs", "bver", "n", "u", "vs", "vb", "vd", "s", "ut"))  # RFC 8428: other labels
_SENML_NUMBERS, _SENML_UNITS = ("v", "t", "bt", "bv"), {"Cel": " [degC]", "/": " [0...1]", "": ""}


def _senml(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the values of SenML (RFC 8428) as a long table: what is base holds until another follows."""
    rows, records, base = list[list[str]](), _senml_records(numbered), list[Any](("", 0.0, "", 0))
    for record in records:
        base = [record.get(label, value) for label, value in zip(("bn", "bt", "bu", "bv"), base, strict=True)]
        source, begin, usual, offset = base
        value = record["v"] + offset if "v" in record else record.get("vb")  # without a number: no reading, or a text
        if value is not None:
            unit = _SENML_UNITS.get(str(record.get("u", usual)), f" [{record.get('u', usual)}]")
            rows.append([repr(begin + record.get("t", 0.0)), f"{source}{record.get('n', '')}{unit}", f"{value}"])
    return FormatTable(_LONG, rows, list(range(1, len(rows) + 1)), [
        f"SenML: {count(len(rows), 'value')} read, {len(records) - len(rows)} records without one passed over."])


def _senml_records(lines: Sequence[Line]) -> list[Any]:
    """Return the records of SenML, in a list or one in each line; empty where there is another."""
    records = _json_of(lines) if lines[0][1].lstrip()[:1] == "[" else [_json_of([line]) for line in lines]
    fits = records and all(map(_is_senml, records)) and any("bn" in record or "u" in record for record in records)
    return records if fits else []


def _is_senml(record: object) -> bool:
    return isinstance(record, dict) and _SENML.issuperset(record.keys() - _SENML_NUMBERS) and all(
        isinstance(record.get(label, 0), int | float) for label in _SENML_NUMBERS)


_INSERT: Final = re.compile(r"INSERT INTO [\"`]?(\w+)[\"`]?(?: ?\(([^)]*)\))? VALUES ?\((.*)\);?$")
_CREATE: Final = re.compile(r"CREATE TABLE (?:IF NOT EXISTS )?[\"`]?(\w+)[\"`]? ?\((.*)\);?$")


def _sql(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the largest table of a dump of SQLite, a row for each line that inserts one."""
    rows: dict[str, list[tuple[int, list[str]]]] = {}
    names: dict[str, str] = {}
    for number, line in numbered:
        if match := _INSERT.match(line):
            cells = next(csv.reader([match[3]], quotechar="'", skipinitialspace=True))
            rows.setdefault(match[1], []).append((number, cells))
            names.setdefault(match[1], match[2] or "")
        elif match := _CREATE.match(line):
            names[match[1]] = ",".join(re.findall(r"(?:^|,)\s*[\"`]?(\w+)", match[2]))
    table, records = max(rows.items(), key=lambda pair: len(pair[1]))
    header = [name.strip(' "`') for name in names[table].split(",")]
    return FormatTable.from_rows(header if len(header) == len(records[0][1]) else (), records,
                                 f"Dump of a database: {count(len(records), 'row')} of the table {table!r} read.")


#: (0.0, 20.3, 60) or [0.0, 20.3, 60], in a line of its own
_ROW: Final = re.compile(r"[(\[]([^()\[\]{}]*,[^()\[\]{}]*)[)\]],?\s*")


def _bracketed(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the rows in brackets, as Python prints them or as JSON has them, with or without names in the first."""
    bodies = [(number, [row[1]]) for number, line in numbered if (row := _ROW.fullmatch(line.strip())) is not None]
    if not bodies:  # JSON that breaks no lines, or breaks rows
        bodies = [*enumerate(([row] for row in _ROW.findall("\n".join(line for _, line in numbered))), start=1)]
    rows = [(number, [cell.strip(" '\"\n") for cell in row[0].split(",")]) for number, row in bodies]
    return FormatTable.from_rows((), rows, f"Rows in brackets: {count(len(rows), 'row')} read, "
                                 f"{max(len(numbered) - len(rows), 0)} other lines passed over.")


def _is_bracketed(lines: Sequence[Line]) -> bool:
    sample = [line.strip() for _, line in lines[-_SAMPLE:]]
    return re.match(r"\[\s*\[", "\n".join(line[:_HEAD] for _, line in lines[:5])) is not None or (
        sum(_ROW.fullmatch(line) is not None for line in sample) > _NEARLY_ALL * len(sample) > 0)


_NEARLY_ALL: Final = 0.9


DEVICE_LOGS: Final = (
    TextFormat("feed of ThingSpeak", _is_thingspeak, _thingspeak),
    TextFormat("series in JSON", _is_series, _series),
    TextFormat("SenML", lambda lines: _within(lines[:5], '.{0,999}"v"') and bool(_senml_records(lines)), _senml),
    TextFormat("events of openHAB", matching(_OPENHAB), _openhab),
    TextFormat("console of Tasmota", matching(_TASMOTA_WORD), _tasmota),
    TextFormat("dump of SQLite", matching(_INSERT), _sql),
    TextFormat("log of kiln-controller", matching(_KILN), _kiln),
    TextFormat("log of ESPHome", matching(_ESPHOME), _esphome),
    TextFormat("line protocol of InfluxDB", matching(re.compile(rf"^{_POINT.pattern}$")), _line_protocol),
    TextFormat("CSV of Artisan", _is_artisan, _artisan_csv),
    TextFormat("profile of Artisan", _is_profile, _artisan_profile),
    TextFormat("JSON of pandas", _is_indexed, _pandas),
    TextFormat("JSON of columns", _has_lists, _json_columns),
    TextFormat("JSON in lines", lambda lines: _starts_as_json(lines) and _are_records(lines), _json_lines),
    TextFormat("JSON", _starts_as_json, _json),
    TextFormat("rows in brackets", _is_bracketed, _bracketed))

"""Tables of HTML, as web pages save them under the name of a workbook, and lines in which each value has its name."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

from heatertune.errors import LogError
from heatertune.log.formats.format_table import FormatTable, Line, TextFormat, line_stamp
from heatertune.log.quantities import role_of
from heatertune.units import count

__all__ = ["WEB_TABLES"]


class _Cells(HTMLParser):
    """Collects the cells of the rows of all tables, each row with its line."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[int, list[str]]] = []
        self.within = False

    def handle_starttag(self, tag: str, _: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self.rows.append((self.getpos()[0], []))
        elif tag in ("td", "th") and self.rows:
            self.rows[-1][1].append("")
            self.within = True

    def handle_endtag(self, tag: str) -> None:
        self.within &= tag not in ("td", "th", "tr")

    def handle_data(self, data: str) -> None:
        if self.within:
            self.rows[-1][1][-1] += data.strip()


def _html(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the rows of the table with the most cells in a row that many rows have."""
    parser = _Cells()
    parser.feed("\n".join(line for _, line in numbered))
    widths = Counter(len(row) for _, row in parser.rows)
    width = max(widths, key=lambda number: number * widths[number], default=0)
    kept = [(number, row) for number, row in parser.rows if len(row) == width and any(row)]
    if width < _FEWEST:
        raise LogError("a page without a table", file=path, expected="a table of time and temperature")
    numbers = [number for number, _ in numbered]
    return FormatTable((), [row for _, row in kept], [numbers[number - 1] for number, _ in kept],
                       [f"Table of a web page: {count(len(kept), 'row')} read."])


_FEWEST: Final = 2
_SAMPLE: Final = 50  # lines
_NEARLY_ALL: Final = 0.9
_NAME: Final = r"(?<![\w.])([^\W\d][\w.]*(?: [^\W\d][\w.]*)?)"
_VALUE: Final = r"(-?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)(?![\d:])"
_UNIT: Final = r" ?(?:°?[CFK]|%|[mk]?[VAW]|m?s)"
#: temp:20.4, output = 51 %, T1: 20.4C, and, with its unit, temperature 20.4 °C
_PAIR: Final = re.compile(rf"{_NAME}(?: ?[:=] ?{_VALUE}({_UNIT})?(?!\w)| {_VALUE}({_UNIT})(?!\w))")


def _pairs(line: str) -> list[tuple[str, str, str]]:
    return [(name, value or other, (unit or its).strip()) for name, value, unit, other, its in _PAIR.findall(line)]


def _last(lines: Sequence[Line]) -> Iterator[str]:
    return (line for _, line in lines[-_SAMPLE:])


def _has_names(lines: Sequence[Line]) -> bool:
    """Return whether nearly all lines at the end hold the same two names or more, one of them a temperature's."""
    names = Counter(tuple(name for name, _, _ in _pairs(line)) for line in _last(lines))
    usual, number = names.most_common(1)[0] if names else ((), 0)
    nearly_all = number > _NEARLY_ALL * len(lines[-_SAMPLE:])
    return len(usual) >= _FEWEST and nearly_all and "temperature" in map(role_of, usual)


def _named(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a column for each name; the time is the stamp in the line, if there is one."""
    names = Counter(tuple(name for name, _, _ in _pairs(line)) for line in _last(numbered)).most_common(1)[0][0]
    rows, lines, units = [], [], dict[str, str]()
    for number, line in numbered:
        pairs = _pairs(line)
        if tuple(name for name, _, _ in pairs) == names:
            units |= {name: unit for name, _, unit in pairs if unit}
            rows.append([line_stamp(line), *(value for _, value, _ in pairs)])
            lines.append(number)
    stamped = all(row[0] for row in rows)
    header = [f"{name} [{units[name]}]" if name in units else name for name in names]
    others = len(numbered) - len(rows)
    note = f"Lines of names and values: {count(len(rows), 'line')} read, {others} others passed over."
    return FormatTable((*(("time",) if stamped else ()), *header), rows if stamped else [row[1:] for row in rows],
                       lines, [note])


#: before what a board prints, as the Arduino IDE shows it: 09:58:00.123 -> 20.4,51
_MONITOR: Final = re.compile(r"\s*(\d\d:\d\d:\d\d[.,]\d{3}) -> (.*)")


def _monitor(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the cells of the lines of a serial monitor, behind the time that it puts before each."""
    found = [(number, match) for number, line in numbered if (match := _MONITOR.match(line)) is not None]
    mark = next((mark for mark in "\t;," if found and mark in found[-1][1][2]), None)
    return FormatTable((), [["time", *_cells(match[2], mark)] if re.match(r"[^\W\d]", match[2]) and k == 0 else [
        match[1].replace(",", "."), *_cells(match[2], mark)] for k, (_, match) in enumerate(found)],
        [number for number, _ in found], [f"Serial monitor: {count(len(found), 'line')} read with its time."])


def _cells(text: str, mark: str | None) -> list[str]:
    return [cell.strip() for cell in text.split(mark)]


def _is_monitor(lines: Sequence[Line]) -> bool:
    return sum(_MONITOR.match(line) is not None for line in _last(lines)) > _NEARLY_ALL * len(lines[-_SAMPLE:])


WEB_TABLES: Final = (
    TextFormat("table of a web page", lambda lines: any("<tr" in line.lower() for _, line in lines[:_SAMPLE]), _html),
    TextFormat("lines of names and values", _has_names, _named),
    TextFormat("serial monitor", _is_monitor, _monitor),
)

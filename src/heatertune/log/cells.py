"""Text file → rows of cells, each with its line number.

Also header lines (titles, column names, units) and two special formats. Klipper and Kalico logs become one table: the
Stats lines of klippy.log, one per second, and the files that PID_CALIBRATE writes with WRITE_FILE=1 (heattest.txt of
Klipper, heattest.csv of Kalico, whose second table contains the peaks). Any other text passes unchanged. Logs of
`heatertune record` may contain incomplete lines of a killed process, and marked gaps.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

from heatertune.errors import LogError
from heatertune.log.quantities import is_number, is_quantity, plain_quantities, role_of, says_nothing, stamp
from heatertune.units import count
from heatertune.writing import read_bytes

__all__ = [
    "MARK", "SWITCHED", "TORN", "PrinterTable", "Sheet", "is_number", "plain_cells", "printer_table", "pwm_period_of",
    "read_sheet", "take_header", "without_torn",
]


_UNIT: Final = re.compile(
    r"[\[(]?(m?s|sec|min|h|°?[CFK]|deg ?[CF]|%|pct|m?V|m?A|k?W|[-–/]|bool|u?s?d?l?int|l?real|float|d?word|string"
    r"|date|time|datetime|double)?[\])]?", re.IGNORECASE)
_HEADER_SAMPLE: Final = 50  # rows at the end that define the form of a reading
_MOST_TITLES: Final = 200  # rows above the first reading


def take_header(file: Path, lines: list[int], rows: list[list[str]], repairs: list[str]) -> tuple[tuple[str, ...], int]:
    """Remove all lines above the readings; return the column names with units, and the other lines.

    Raises:
        LogError: a row with a different number of cells from the readings.
    """
    width = Counter(len(row) for row in rows[-_HEADER_SAMPLE:]).most_common(1)[0][0]
    first = _first_reading(rows, width)
    words = [k for k in range(first) if len(rows[k]) == width and _is_words(rows[k])]
    chosen = _names_row(rows, words)
    if chosen is not None:
        begin = next((k for k in range(chosen + 1, first) if k not in words), first)
    else:
        begin = next((k for k in range(first) if not _is_title(rows[k], width)), first)
    names = () if chosen is None else _named(lines, rows, chosen, [k for k in words if k > chosen], repairs)
    titles = begin if chosen is None else chosen
    above = lines[titles - 1] if titles else 0
    if titles:
        repairs.append(f"{count(titles, 'title line')} above the table skipped (up to line {above}).")
    del rows[:begin], lines[:begin]
    _drop_repeats(names, lines, rows, repairs)
    _demand_one_width(file, lines, rows, width)
    return names, above


def _first_reading(rows: Sequence[list[str]], width: int) -> int:
    """Return the first row that looks like those at the end of the file."""
    sample = [row for row in rows[-_HEADER_SAMPLE:] if len(row) == width]
    values = [i for i in range(width) if sum(_is_value(row[i]) for row in sample) >= 0.5 * len(sample)]
    for k, row in enumerate(rows[:_MOST_TITLES]):
        if len(row) == width and values and all(_is_value(row[i]) or says_nothing(row[i]) for i in values) and any(
            _is_value(row[i]) for i in values
        ):
            return k
    return 0 if any(is_number(cell) for cell in rows[0]) else 1


def _is_value(cell: str) -> bool:
    return is_number(cell) or is_quantity(cell) or stamp(cell) is not None


def _is_words(row: Sequence[str]) -> bool:
    return not any(map(_is_value, row))


def _names_row(rows: Sequence[list[str]], words: Sequence[int]) -> int | None:
    """Return which row of words names the columns: the one with the most roles, the last of equals."""
    if not words:
        return None
    named = [k for k in words if not _is_units(rows[k]) and sum(map(bool, rows[k])) >= len(rows[k]) / 2]
    named = named or list(words[:1])
    return max(named, key=lambda k: (len({role_of(cell) for cell in rows[k]} - {None}), k))


def _is_units(row: Sequence[str]) -> bool:
    return all(map(_UNIT.fullmatch, row))


def _is_title(row: Sequence[str], width: int) -> bool:
    """Return whether a row above unnamed readings is a title, rather than an incomplete row or a row of names."""
    is_reading = len(row) == width or (len(row) > 1 and _is_value(row[0]))
    return not is_reading and not (len(row) > 1 and any(map(role_of, row)))


def _other_width(file: Path, line: int, row: Sequence[str], width: int, like: int) -> LogError:
    expected = f"{width} as in line {like} (a line that is no reading may begin with #)"
    return LogError(f"{count(len(row), 'cell')} in this row", file=file, line=line, expected=expected)


def _named(
    lines: Sequence[int], rows: Sequence[list[str]], chosen: int, below: Sequence[int], repairs: list[str]
) -> tuple[str, ...]:
    """Return the names, with the units of a row below them."""
    names = list(rows[chosen])
    for k in below:
        if any(map(_UNIT.fullmatch, filter(None, rows[k]))):
            repairs.append(f"Line {lines[k]} was read as the units of the columns.")
            units = [unit.strip("[]() ") for unit in rows[k]]
            names = [f"{name} [{unit}]" if unit.strip("-–/") else name for name, unit in zip(names, units, strict=True)]
        else:
            repairs.append(f"Line {lines[k]}, below the names of the columns, skipped.")
    return tuple(names)


def _drop_repeats(names: Sequence[str], lines: list[int], rows: list[list[str]], repairs: list[str]) -> None:
    """Remove rows that repeat the column names, as written when a logger restarts."""
    again = [k for k, row in enumerate(rows) if row[0] == names[0] and tuple(row) == tuple(names)] if names else []
    if again:
        repairs.append(f"{count(len(again), 'repeat')} of the header skipped (line {lines[again[0]]}).")
    for k in reversed(again):
        del rows[k], lines[k]


def _demand_one_width(file: Path, lines: Sequence[int], rows: Sequence[list[str]], width: int) -> None:
    like = next((line for line, row in zip(lines, rows, strict=True) if len(row) == width), 0)
    for line, row in zip(lines, rows, strict=True):
        if len(row) != width:
            raise _other_width(file, line, row, width, like)


#: begins a line of klippy.log: seconds of the host's clock
_STATS: Final = re.compile(r"Stats (\d+\.\d+): ")
_HEATER: Final = re.compile(r"(?:^|\s)(\S+): target=(-?\d+) temp=(-?\d+\.\d+) pwm=(\d\.\d+)(?=\s|$)")
_PWM: Final = re.compile(r"pwm: (-?\d+\.\d+) (-?\d+\.\d+)\s*")
_TEMPERATURE: Final = re.compile(r"(-?\d+\.\d+) (-?\d+\.\d+)\s*")
_KALICO: Final = re.compile(r"time, temp, pwm, target\s*")
_PEAKS: Final = re.compile(r"sample, low time, low, high time, high, max power\s*")

#: the default heater
_USUAL: Final = "extruder"
_HEADER: Final = ("time [s]", "temperature [degC]", "power [0...1]")
_LEAST: Final = 2

_Line = tuple[int, str]


class PrinterTable(NamedTuple):
    """Table of one heater: column names, cells, line number of each row, and skipped content."""

    header: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    repairs: list[str]


def printer_table(path: Path, numbered: Sequence[_Line], tag: str | None) -> PrinterTable | None:
    """Return a printer's table of one heater; None if the lines are not from a printer.

    Args:
        path: the file, for error messages.
        numbered: number and content of each line.
        tag: the heater's name, "extruder", "heater_bed"; None: the extruder if there is one, otherwise the only heater.

    Raises:
        LogError: no such heater; several heaters without an extruder; an incomplete line.
    """
    stats = [(number, found, line) for number, line in numbered if (found := _STATS.match(line)) is not None]
    if sum(_HEATER.search(line) is not None for _, _, line in stats[:50]) >= _LEAST:
        return _of_stats(path, len(numbered), stats, tag)
    if numbered and tag is None:
        if _PWM.fullmatch(numbered[0][1]):
            return _of_test(path, numbered)
        if _KALICO.fullmatch(numbered[0][1]):
            return _of_kalico(numbered)
    return None


def _of_stats(path: Path, total: int, stats: Sequence[tuple[int, re.Match[str], str]], tag: str | None) -> PrinterTable:
    heaters: dict[str, list[tuple[int, list[str]]]] = {}
    for number, found, line in stats:
        for name, target, temperature, pwm in _HEATER.findall(line[found.end():]):
            heaters.setdefault(name, []).append((number, [found[1], name, temperature, pwm, target]))
    wanted = tag or (_USUAL if _USUAL in heaters else None) or (next(iter(heaters)) if len(heaters) == 1 else None)
    if wanted not in heaters:
        problem = "the printer has several heaters" if tag is None else "the printer has no such heater"
        raise LogError(problem, file=path, value=", ".join(heaters) if tag is None else tag,
                       expected=f"--tag and one of {', '.join(heaters)}")
    rows = heaters[wanted]
    repairs = [f"klippy.log: {count(len(rows), 'line')} Stats of {wanted!r} read, {total - len(rows)} others passed "
               "over; power is what was sent last before each of them."]
    others = [name for name in heaters if name != wanted]
    if others:
        repairs.append(f"Other heaters in it: {', '.join(others)} (--tag).")
    header = (_HEADER[0], "name", *_HEADER[1:], "setpoint [degC]")
    return PrinterTable(header, [row for _, row in rows], [number for number, _ in rows], repairs)


def _of_test(path: Path, numbered: Sequence[_Line]) -> PrinterTable:
    """Return the readings of heattest.txt, each with the power that is in effect."""
    times, powers, rows, lines = [], [], [], []
    for number, line in numbered:
        sent, read = _PWM.fullmatch(line), _TEMPERATURE.fullmatch(line)
        if sent is not None:
            times.append(float(sent[1]))
            powers.append(sent[2])
        elif read is not None:
            before = bisect_right(times, float(read[1]))
            rows.append([read[1], read[2], powers[before - 1] if before else "0.000"])
            lines.append(number)
        elif line.strip():
            raise LogError("a line that PID_CALIBRATE does not write", file=path, line=number, value=line[:60],
                           expected="pwm, time and duty, or time and temperature")
    if times != sorted(times):
        raise LogError("the times of pwm do not rise", file=path, expected="the file of one PID_CALIBRATE")
    repairs = [f"heattest.txt of PID_CALIBRATE: {count(len(times), 'change')} of the power, each from its instant on."]
    return PrinterTable(_HEADER, rows, lines, repairs)


def _of_kalico(numbered: Sequence[_Line]) -> PrinterTable:
    """Return the first table of heattest.csv."""
    end = next((k for k, (_, line) in enumerate(numbered) if _PEAKS.fullmatch(line)), len(numbered))
    kept = [(number, [cell.strip() for cell in line.split(",")]) for number, line in numbered[1:end] if line.strip()]
    peaks = count(len(numbered) - end, "line")
    repairs = [f"heattest.csv of Kalico's PID_CALIBRATE: {peaks} of its peaks passed over."]
    return PrinterTable((*_HEADER, "setpoint [degC]"), [row for _, row in kept], [number for number, _ in kept],
                        repairs)


#: begins the first line
MARK: Final = "# heatertune record"
#: in the first line, before the PWM period of the switch [s]
SWITCHED: Final = "; PWM period: "
#: ends a line that was torn, once the file has been continued; else it is the last and has no line's end
TORN: Final = "#torn"
_GAP: Final = "# gap "
_SHOWN: Final = 3
_PERIOD: Final = re.compile(re.escape(SWITCHED) + r"(\d+(?:\.\d+)?(?:e-?\d+)?) s\b")


def pwm_period_of(text: str) -> float:
    """Return the PWM period in the first line, 0 if there is none [s]."""
    told = _PERIOD.search(text.split("\n", 1)[0])
    return float(told[1]) if told else 0.0


def without_torn(text: str, repairs: list[str]) -> str:
    """Return the text with incomplete lines blanked, without changing the number of lines; the repairs list them."""
    lines = text.split("\n")
    torn = [i for i, line in enumerate(lines) if line.endswith(TORN) or (line and i == len(lines) - 1)]
    for i in torn:
        repairs.append(f"Line {i + 1} was torn when the recording was cut off, and is left out: {lines[i]!r}.")
        lines[i] = ""
    gaps = [line.removeprefix(_GAP) for line in lines if line.startswith(_GAP)]
    if gaps:
        more = f"; and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
        repairs.append(f"The recording marks {count(len(gaps), 'gap')}: {'; '.join(gaps[:_SHOWN])}{more}.")
    return "\n".join(lines)


_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_BEFORE_CLOCK = re.compile(r"(?<=\d) (?=\d{1,2}:\d\d)")
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SAMPLE = 50  # lines looked at to find the separator


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Cells of one file.

    Attributes:
        file: its path.
        header: column names with their units, empty if the file has none.
        comment: cells of the comment directly above the readings, one for each column, or empty.
        rows: cells, all of one length.
        lines: line number of each row, 1 = first line of the file.
        repairs: changes and skipped content, one sentence each.
        units: common unit of the cells of each column, or empty.
        above: lines above the column names, or above the readings of unnamed columns.
        pwm_period_s: PWM period stated in a recording, 0 if unknown [s].
        recorded: whether `heatertune record` wrote it; its rows are readings even if the value did not change.
    """

    file: str
    header: tuple[str, ...]
    comment: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    repairs: tuple[str, ...]
    units: tuple[str, ...] = ()
    above: int = 0
    pwm_period_s: float = 0.0
    recorded: bool = False

    def picked(self, places: Sequence[int]) -> Sheet:
        """Return some of the rows, in the order given."""
        return replace(self, rows=[self.rows[k] for k in places], lines=[self.lines[k] for k in places])


def read_sheet(path: Path, content: bytes | None = None, skip_rows: int = 0, tag: str | None = None) -> Sheet:
    """Return the cells of a CSV file, or of a printer's log; with `content`, the path only names it.

    `tag` is the heater of a printer's log, see `heatertune.log.cells.printer_table`.

    Raises:
        LogError: the file cannot be read, is empty, is no text, or a row has another number of cells than the others.
    """
    text, repairs = _text(path, content)
    period_s, recorded = 0.0, text.startswith(MARK)
    if recorded:
        period_s = pwm_period_of(text)
        text = without_torn(text, repairs)
    numbered, passed = _written_lines(text, skip_rows)
    log = printer_table(path, numbered, tag)
    if log is not None:
        _demand_cells(path, log)
        return Sheet(file=str(path), header=log.header, comment=(), rows=log.rows, lines=log.lines,
                     repairs=(*repairs, *log.repairs))
    kept = [(i, line) for i, line in numbered if line.strip(" \t,;") and not line.lstrip().startswith("#")]
    if kept and kept[0][1].strip('" ').lower() in ("sep=;", "sep=,", "sep=\t", "sep=|"):  # written by spreadsheets
        del kept[0]
    if not kept:
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    if passed := passed + len(numbered) - len(kept):
        repairs.append(f"{count(passed, 'line')} without readings (blank, comment) skipped.")
    lines, texts = [i for i, _ in kept], [line for _, line in kept]
    separator = _separator(texts[-_SAMPLE:])
    rows = _without_empty_ends([row or [""] for row in _split(path, lines, texts, separator)], repairs)
    begin = lines[0]
    header, above = take_header(path, lines, rows, repairs)
    comment: tuple[str, ...] = ()
    if rows and not header:
        comment = _comment_above([pair for pair in numbered if pair[0] < begin], separator, len(rows[0]))
    return Sheet(file=str(path), header=header, comment=comment, rows=rows, lines=lines, repairs=tuple(repairs),
                 above=above, pwm_period_s=period_s, recorded=recorded)


def _written_lines(text: str, skip_rows: int) -> tuple[list[tuple[int, str]], int]:
    """Return number and content of the lines to look at, and how many are not: megabytes of those take no memory.

    Blank lines are not looked at, and of comments in a row only the last, which may name the columns.
    """
    numbered: list[tuple[int, str]] = []
    passed, after_comment = 0, False
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if number <= skip_rows:
            continue
        is_comment, is_blank = line.startswith("#"), not line.strip(" \t,;\n")
        if is_blank or (is_comment and after_comment):
            passed += 1
        if is_blank:
            continue
        if is_comment and after_comment:
            numbered.pop()
        numbered.append((number, line.rstrip("\n")))
        after_comment = is_comment
    return numbered, passed


def _demand_cells(path: Path, log: PrinterTable) -> None:
    for line, row in zip(log.lines, log.rows, strict=True):
        if len(row) != len(log.header):
            raise LogError(f"{count(len(row), 'cell')} in this row", file=path, line=line,
                           expected=f"{len(log.header)}: {', '.join(log.header)}")


def _text(path: Path, content: bytes | None) -> tuple[str, list[str]]:
    try:
        data = read_bytes(path) if content is None else content
    except OSError as problem:
        raise LogError(f"cannot be read: {problem.strerror}", file=path) from problem
    text, repairs = _decoded(path, data)
    if _CONTROL.search(text):
        expected = "a text file with one row per reading (UTF-8, Latin-1, or UTF-16 with its byte order mark)"
        raise LogError("the file is binary", file=path, expected=expected)
    return text, repairs


def _decoded(path: Path, data: bytes) -> tuple[str, list[str]]:
    if data.startswith(_UTF16):
        try:
            return data.decode("utf-16"), ["The file is UTF-16."]
        except UnicodeDecodeError as problem:
            raise LogError("the file is not valid UTF-16 text", file=path) from problem
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        return data.decode("latin-1"), ["The file is not UTF-8 and was read as Latin-1."]


def _separator(lines: Sequence[str]) -> str | None:
    """Return the separator that nearly all lines contain; None: white space, or a single column."""
    for candidate in ("\t", ";", "|", ","):
        if sum(candidate in line for line in lines) > 0.8 * len(lines):
            return None if candidate == "," and _is_spaced(lines[-1]) else candidate
    return None


def _is_spaced(line: str) -> bool:
    """Return whether a line holds numbers with decimal commas between spaces."""
    cells = line.split()
    return len(cells) > 1 and all(is_number(cell) and not cell.endswith(",") for cell in cells)


def _split(path: Path, lines: Sequence[int], texts: Sequence[str], separator: str | None) -> list[list[str]]:
    if separator is None:
        return [_BEFORE_CLOCK.sub("T", text).split() for text in texts]
    for line, text in zip(lines, texts, strict=True):
        if text.count('"') % 2:  # else the reader would join this line and the next
            raise LogError("a quotation mark that is not closed", file=path, line=line)
    reader = csv.reader(texts, delimiter=separator, skipinitialspace=True)
    try:
        return [[cell.strip() for cell in row] for row in reader]
    except csv.Error as problem:
        raise LogError(str(problem), file=path, line=lines[reader.line_num - 1]) from problem


def _without_empty_ends(rows: list[list[str]], repairs: list[str]) -> list[list[str]]:
    """Remove the empty columns at the end."""
    if all(row[-1] for row in rows):
        return rows
    width = max(max(i for i, cell in enumerate(row, start=1) if cell or i == 1) for row in rows)
    cut = sum(len(row) > width for row in rows)
    if cut:
        repairs.append(f"Empty cells at the end of {count(cut, 'row')} skipped.")
    return [row[:width] for row in rows]


def _comment_above(above: Sequence[tuple[int, str]], separator: str | None, width: int) -> tuple[str, ...]:
    text = next((text.strip() for _, text in reversed(above) if text.strip()), "")
    cells = [cell.strip(' "') for cell in text.lstrip("# ").split(separator)]
    return tuple(cells) if text.startswith("#") and len(cells) == width and not any(map(is_number, cells)) else ()


def plain_cells(sheet: Sheet) -> Sheet:
    """Return the sheet with units and decimal commas converted to plain numbers; the units are stored separately."""
    units, commas, repairs = [], False, list(sheet.repairs)
    for i in range(len(sheet.rows[0])):
        plain = plain_quantities([row[i] for row in sheet.rows])
        units.append(plain[1] if plain else "")
        if plain is None:
            continue
        commas |= plain[2]
        for row, cell in zip(sheet.rows, plain[0], strict=True):
            row[i] = cell
        if plain[1]:
            name = f"'{sheet.header[i]}'" if sheet.header else f"{i + 1}"
            repairs.append(f"The cells of column {name} bear the unit {plain[1]}.")
    if commas:
        repairs.append("Decimal commas were read as points.")
    return replace(sheet, repairs=tuple(repairs), units=tuple(units))

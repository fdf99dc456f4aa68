"""Words as a parameter sheet in the order of the instrument's menu, and as a list of its registers; and read back."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from heatertune.errors import ExportRefused
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.exported import TextSettings
from heatertune.plc.pband.makes import TIME_UNIT, Entry, Make, field_of
from heatertune.plc.pband.step import PbandAssumptions
from heatertune.plc.pband.words import band_degC, display_text, period_of, places
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, real_of, wrong
from heatertune.plc.words import Certificate, Words

__all__ = ["HEADS", "export_words", "from_text", "loaders", "number_of", "stem_of"]


#: of the list of registers
HEADS: Final = ("address", "hex", "name", "value", "decimals", "unit", "format", "access", "checked")

_HEX: Final = re.compile(r"(?:0x([0-9a-f]{1,4})|([0-9][0-9a-f]{0,4})h)", re.IGNORECASE)
_WHOLE: Final = re.compile(r"[+-]?\d{1,10}")
_DECIMAL: Final = re.compile(r"([+-]?)(\d{1,9})(?:[.](\d{1,9}))?")
_PAIR: Final = re.compile(r"([^\s,;=:]+)(?:\s*[,;=:]\s*|\s+)([^\s,;]+)\s*(.*)")
_WORDS: Final = 1 << 16
_HALF: Final = 1 << 15


def number_of(make: Make, entry: Entry) -> int | None:
    """Return the address of a register, None where it is a mnemonic."""
    if make.decimal:
        return int(entry.address)
    match = _HEX.fullmatch(entry.address)
    return int(match[1] or match[2], 16) if match else None


class _SheetReader:
    """Takes a text line by line; what stands there as the display shows it is understood when all was read."""

    def __init__(self, make: Make, source: str) -> None:
        self._make, self._source = make, source
        self._collected = WordCollector(source, tuple(map(field_of, make.entries)))
        self._names = {entry.name.upper(): entry for entry in make.entries}
        self._places = {number: entry for entry in make.entries if (number := number_of(make, entry)) is not None}
        self._unit: Number | None = 0
        self._displayed: list[tuple[Entry, int, str]] = []
        self.over: list[str] = []

    def pair(self, line: int, first: str, value: str) -> None:
        """Take a parameter by its name, or a register by its address."""
        entry = self._names.get(first.upper())
        number = _whole(first)
        if entry is not None:
            self._displayed.append((entry, line, value))
        elif number is None:
            names = ", ".join(each.name for each in self._make.entries)
            raise wrong(self._source, line, "parameter", f"{first} {value}",
                        f"one of {names} and its value, or the address of a register and its number")
        elif number in self._places:
            self._put(self._places[number], _register(self._places[number], value), line, value)
        else:
            self.over.append(f"register {first} = {value} (line {line})")

    def row(self, line: int, content: str) -> None:
        """Take a row of the list of registers."""
        cells = next(csv.reader([content]))
        if len(cells) != len(HEADS):
            raise wrong(self._source, line, "row", content, f"{len(HEADS)} cells, as its heads are")
        entry = self._names.get(cells[2].upper())
        if entry is None:
            raise wrong(self._source, line, "name", cells[2], f"one of {', '.join(e.name for e in self._make.entries)}")
        number = number_of(self._make, entry)
        address = (entry.address, "") if number is None else (str(number), f"{number:04X}")
        if (cells[0], cells[1].upper()) != address:
            raise wrong(self._source, line, f"address of {entry.name}", f"{cells[0]}, {cells[1]}", ", ".join(address))
        if number is None:
            self._displayed.append((entry, line, cells[3]))
        else:
            self._put(entry, _register(entry, cells[3]), line, cells[3])

    def values(self) -> dict[str, Number]:
        """Return all words; errors as `from_text`."""
        for entry, line, text in sorted(self._displayed, key=lambda entry: entry[0].role != "unit"):
            decimals = places(entry, {TIME_UNIT: self._unit or 0})
            self._put(entry, _typed(entry, decimals, text, (self._source, line)), line, text)
        return self._collected.values()

    def _put(self, entry: Entry, value: Number | None, line: int, text: str) -> None:
        self._collected.put(entry.name, value, line, text)
        if entry.role == "unit":
            self._unit = value


def from_text(make: Make, text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the registers that are none.

    A register is told by its address, decimal, as 0x2A00 or as 2A00H, and holds the number as it is written; a
    parameter by its name, with the value as the display shows it. What begins with # or ; is a remark.

    Raises:
        InputError: a line that is none of them, a parameter that is missing, there with two values, not in its digits
            or out of its range, a name and an address that do not go together.
    """
    reader, listed = _SheetReader(make, source), False
    for line, content in lines_of(text):
        if not content or content[0] in "#;":
            continue
        if content == ",".join(HEADS):
            listed = True
        elif listed:
            reader.row(line, content)
        else:
            reader.pair(line, *_pair(content, line, source))
    return ReadBack(reader.values(), tuple(reader.over))


def _pair(content: str, line: int, source: str) -> tuple[str, str]:
    """Return the first two cells of a line; raise InputError where a third one is no unit or remark."""
    match = _PAIR.fullmatch(content.partition(" ;")[0].strip())
    if match is None:
        raise wrong(source, line, "line", content, "a name or an address, and its value")
    if re.search(r"\d", match[3]):
        raise wrong(source, line, match[1], content, "one value and its unit")
    return match[1], match[2]


def _whole(text: str) -> int | None:
    """Return a decimal or hexadecimal whole number, None where it is none."""
    if _WHOLE.fullmatch(text) and text.isascii():
        return int(text)
    match = _HEX.fullmatch(text)
    return int(match[1] or match[2], 16) if match else None


def _register(entry: Entry, text: str) -> Number | None:
    """Return the content of a register: a float, or 16 bits, with a sign where the parameter may have one."""
    if entry.real:
        return real_of(text)
    number = _whole(text)
    return number - _WORDS if number is not None and entry.low < 0 and _HALF <= number < _WORDS else number


def _typed(entry: Entry, decimals: int, text: str, where: tuple[str, int]) -> Number | None:
    """Return the number behind a value as the display shows it; raise InputError where it has too many places."""
    if entry.real:
        return real_of(text)
    match = _DECIMAL.fullmatch(text)
    if match is None or not text.isascii():
        return None
    behind = (match[3] or "").ljust(decimals, "0")
    if behind[decimals:].strip("0"):
        raise wrong(*where, entry.name, text, f"at most {decimals} decimal places")
    digits = int(match[2] + behind[:decimals])
    return -digits if match[1] == "-" else digits


def loaders(
    make: Make, files: Mapping[str, str | bytes], assume: PbandAssumptions  # noqa: ARG001 - of the instrument, not of a text
) -> dict[str, Callable[[], TextSettings]]:
    """Return the reader of each file: both set all words, the PWM period among them where the make has one."""
    return {file: partial(_settings, make, file, str(text)) for file, text in files.items()}


def _settings(make: Make, file: str, text: str) -> TextSettings:
    values = from_text(make, text, None, file).values
    return TextSettings(values, period_s=period_of(make, values))


def export_words(name: str, make: Make, words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return both files; the same words and certificate give the same bytes.

    Raises:
        ExportRefused: a file that does not read back as the words.
    """
    stem = stem_of(name)
    files = {f"{stem}_sheet.txt": _sheet(make, words, certificate),
             f"{stem}_registers.csv": _registers(make, words, certificate)}
    for file, text in files.items():
        if from_text(make, text, None, file).values != dict(words.values):
            raise ExportRefused(f"{file} does not read back as the words that were proven")
    return {**files}


def stem_of(name: str) -> str:
    """Return how the files of a target begin."""
    return name.replace("-", "_")


def _head(make: Make, words: Words, certificate: Certificate) -> list[str]:
    scale = words.scaling
    unread = [entry.name for entry in make.entries if not entry.read]
    return [
        make.title,
        f"input range {scale.low_degC:g}...{scale.high_degC:g} °C; sampled every {words.sample_time_s:g} s "
        f"({make.sampling}); pulses of {period_of(make, words.values):g} s",
        f"proportional band {band_degC(make, words.values, scale.span_degC):.4g} °C",
        *certificate.head,
        *(f"note: {note}" for note in make.notes),
        *([f"NOT CHECKED against a manual of this type: {', '.join(unread)}"] if unread else []),
        "write each parameter once: the memory behind it wears (100,000 writes in Eurotherm's)",
        "not tried on an instrument",
    ]


def _sheet(make: Make, words: Words, certificate: Certificate) -> str:
    rows = [(entry.name, display_text(entry, words.values), entry.unit, _entry_text(entry)) for entry in make.entries]
    wide = [max(len(row[column]) for row in rows) for column in range(3)]
    lines = [f"{name:<{wide[0]}}  {value:>{wide[1]}}  {unit:<{wide[2]}}  ; {what}" for name, value, unit, what in rows]
    head = [*_head(make, words, certificate), f"menu: {make.menu}", "parameter, as the display shows it, unit"]
    return "\n".join([*(f"; {line}" for line in head), *lines]) + "\n"


def _entry_text(entry: Entry) -> str:
    return entry.description if entry.read else f"{entry.description} - NOT CHECKED"


def _registers(make: Make, words: Words, certificate: Certificate) -> str:
    text = io.StringIO()
    for line in _head(make, words, certificate):
        text.write(f"# {line}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADS)
    for entry in make.entries:
        number = number_of(make, entry)
        value = words.values[entry.name]
        writer.writerow([
            entry.address if number is None else number, "" if number is None else f"{number:04X}", entry.name,
            display_text(entry, words.values) if entry.real or number is None else value, entry.decimals, entry.unit,
            "FLOAT" if entry.real else "text" if number is None else "INT16", "R/W", "yes" if entry.read else "NO"])
    return in_ascii(text.getvalue())

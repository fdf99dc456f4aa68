"""Words → a parameter sheet in the order of the instrument's menu, and a list of its registers."""

from __future__ import annotations

import csv
import io

from heatertune.errors import ExportRefused
from heatertune.plc.cpu.letters import in_ascii
from heatertune.plc.pband.makes import Entry, Make
from heatertune.plc.pband.readback import HEADS, from_text, number_of
from heatertune.plc.pband.words import band_degC, display_text, period_of
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "stem_of"]


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
    rows = [(entry.name, display_text(entry, words.values), entry.unit, _told(entry)) for entry in make.entries]
    wide = [max(len(row[column]) for row in rows) for column in range(3)]
    lines = [f"{name:<{wide[0]}}  {value:>{wide[1]}}  {unit:<{wide[2]}}  ; {what}" for name, value, unit, what in rows]
    head = [*_head(make, words, certificate), f"menu: {make.menu}", "parameter, as the display shows it, unit"]
    return "\n".join([*(f"; {line}" for line in head), *lines]) + "\n"


def _told(entry: Entry) -> str:
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
            display_text(entry, words.values) if entry.real or number is None else value,
            entry.decimals, entry.unit, "FLOAT" if entry.real else "text" if number is None else "INT16", "R/W",
            "yes" if entry.read else "NO"])
    return in_ascii(text.getvalue())

"""The tip's words in STL source."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300.readback import read_source
from heatertune.plc.readback import ReadBack
from heatertune.plc.s7_300.export import export_words
from heatertune.plc.s7_300.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["from_text"]

_UNSAID: Final = Certificate(verdict="")


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in the source of the block's instance data block; errors as `read_source`."""
    return read_source(text, FIELDS, source, _exported)


def _exported(words: Words) -> str:
    return str(export_words(words, _UNSAID)["s7_300_pid.awl"])

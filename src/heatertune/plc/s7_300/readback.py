"""The tip's words in STL source."""

from __future__ import annotations

from heatertune.plc.cpu.s7_300.readback import read_source
from heatertune.plc.readback import ReadBack
from heatertune.plc.s7_300.export import source as exported
from heatertune.plc.s7_300.words import FIELDS

__all__ = ["from_text"]


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in the source of the block's instance data block; errors as `read_source`."""
    return read_source(text, FIELDS, source, exported)

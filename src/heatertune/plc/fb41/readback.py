"""CONT_C's words in STL source."""

from __future__ import annotations

from heatertune.plc.cpu.s7_300.readback import read_source
from heatertune.plc.fb41.export import source as exported
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.readback import ReadBack

__all__ = ["from_text"]


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in the source of CONT_C's instance data block; errors as `read_source`.

    A parameter that the source leaves out has the block's own default, which is not guessed: it is missing.
    """
    return read_source(text, FIELDS, source, exported)

"""The block's parameters in text: its call in structured text, or a list of parameters, one a line."""

from __future__ import annotations

from typing import Final

from heatertune.plc.iec_pid.words import FIELDS
from heatertune.plc.readback import ReadBack
from heatertune.plc.st.readback import ExpectedBlock, words_in

__all__ = ["UNITS", "from_text"]

UNITS: Final = {"KP": "%/°C", "TR": "s", "TD": "s", "XMIN": "%", "XMAX": "%", "CYCLE": "ms"}


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none; errors as `words_in`."""
    return words_in(text, source, ExpectedBlock(FIELDS, UNITS))

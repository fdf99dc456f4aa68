"""The block's parameters in text: its call in structured text, or a list of parameters, one a line."""

from __future__ import annotations

from typing import Final

from heatertune.plc.readback import ReadBack
from heatertune.plc.st.readback import ExpectedBlock, words_in
from heatertune.plc.weg.export import RENAMED
from heatertune.plc.weg.program import PROBE
from heatertune.plc.weg.words import FIELDS

__all__ = ["from_text"]

_BLOCK: Final = ExpectedBlock(
    FIELDS, {"Kp": "%/°C", "Ki": "1/s", "Kd": "s", "TauSetPoint": "s", "MinimumOutput": "%", "MaximumOutput": "%",
             "Ts": "ms"},
    renamed={exported: name for name, exported in RENAMED.items()}, neighbour=PROBE)


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none; errors as `words_in`."""
    return words_in(text, source, _BLOCK)

"""The block's parameters in text: its call in structured text, or a list of parameters, one a line."""

from __future__ import annotations

from heatertune.errors import InputError
from heatertune.plc.iec_pid.readback import UNITS
from heatertune.plc.iec_pid_text.words import FIELDS
from heatertune.plc.readback import ReadBack
from heatertune.plc.st.readback import ExpectedBlock, words_in

__all__ = ["from_text"]


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none.

    Raises:
        InputError: as `words_in`; the text has limits, so it is the repaired block's, whose KP has the other sign.
    """
    read = words_in(text, source, ExpectedBlock(FIELDS, UNITS))
    limits = [each for each in read.passed_over if each.upper().startswith(("XMIN ", "XMAX "))]
    if limits:
        raise InputError(f"{source}: {limits[0]}: the standard's block has no limits; these are words of iec-pid")
    return read

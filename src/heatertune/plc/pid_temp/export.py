"""Words of PID_Temp → SCL source, rollback and watch table, in the form of PID_Compact's; and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from heatertune.plc.exported import Exported
from heatertune.plc.pid_compact.export import export_words as exported_words
from heatertune.plc.pid_compact.exported import exported as loads_of
from heatertune.plc.pid_compact.readback import from_text as read_text
from heatertune.plc.pid_temp.step import Assumptions
from heatertune.plc.pid_temp.words import TEMP
from heatertune.plc.readback import ReadBack
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "exported", "from_text"]


def export_words(words: Words, certificate: Certificate) -> Mapping[str, str | bytes]:
    """Return the three files; the same words and certificate give the same bytes."""
    return exported_words(TEMP, words, certificate)


def exported(
    files: Mapping[str, str | bytes], assume: Assumptions
) -> Mapping[str, Callable[[], Exported | None]]:
    """Return what loads the source."""
    return loads_of(TEMP, files, assume)


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text; errors as those of PID_Compact's."""
    return read_text(TEMP, text, sample_time_s, source)

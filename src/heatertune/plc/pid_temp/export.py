"""Words of PID_Temp → SCL source, rollback and watch table, in the form of PID_Compact's; and back."""

from __future__ import annotations

from functools import partial
from typing import Final

from heatertune.plc.pid_compact.export import LAW, InstructionLaw
from heatertune.plc.pid_compact.export import export_words as exported_words
from heatertune.plc.pid_compact.export import loaders as loads_of
from heatertune.plc.pid_compact.readback import from_text as read_text
from heatertune.plc.pid_temp.step import COLD_PAIR, pair_of, pair_scan
from heatertune.plc.pid_temp.words import COOLING_FIELDS, FIELDS, TEMP, TEMP_COOLING

__all__ = ["cooling_export_words", "cooling_exported", "cooling_from_text", "export_words", "exported", "from_text"]

export_words: Final = partial(exported_words, TEMP, FIELDS)
exported: Final = partial(loads_of, TEMP, FIELDS, LAW)
from_text: Final = partial(read_text, TEMP, FIELDS)

cooling_export_words: Final = partial(exported_words, TEMP_COOLING, COOLING_FIELDS)
cooling_exported: Final = partial(loads_of, TEMP_COOLING, COOLING_FIELDS, InstructionLaw(COLD_PAIR, pair_of, pair_scan))
cooling_from_text: Final = partial(read_text, TEMP_COOLING, COOLING_FIELDS)

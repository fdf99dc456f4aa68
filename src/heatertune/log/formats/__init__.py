"""The formats that need a parser of their own; a new one is a function and a row of these tables.

A parser returns a table of cells. What the columns mean, their units, and which rows are no readings is decided later,
for all formats alike.
"""

from typing import Final

from heatertune.log.formats.containers import CONTAINERS, WEB_TABLES
from heatertune.log.formats.device_logs import DEVICE_LOGS, PLANT_EXPORTS
from heatertune.log.formats.printer_logs import PRINTER_LOGS

__all__ = ["BINARY_FORMATS", "TEXT_FORMATS"]

BINARY_FORMATS: Final = CONTAINERS
TEXT_FORMATS: Final = (*PRINTER_LOGS, *DEVICE_LOGS, *PLANT_EXPORTS, *WEB_TABLES)

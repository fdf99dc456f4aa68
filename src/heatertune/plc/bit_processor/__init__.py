"""The one-bit PLC of Hryniewicz and Chmiel, its programs, and the two-level control it runs; see DIFFERENCES.md."""

from heatertune.plc.bit_processor.room import ROOM

__all__ = ["ROOM"]

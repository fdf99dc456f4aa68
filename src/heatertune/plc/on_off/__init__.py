"""The two-level control that the one-bit PLC of Hryniewicz and Chmiel runs; see DIFFERENCES.md."""

from heatertune.plc.on_off.controller import ROOM

__all__ = ["ROOM"]

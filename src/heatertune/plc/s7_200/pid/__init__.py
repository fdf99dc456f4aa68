"""The PID instruction of an S7-200 (CPU 215, 216 and 22x) and its loop table; see DIFFERENCES.md one folder up."""

from heatertune.plc.s7_200.pid.room import ROOM

__all__ = ["ROOM"]

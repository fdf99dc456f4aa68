"""The PID of SIMATIC S7-300/400 application tip No. 2; what the document leaves open stands in DIFFERENCES.md."""

from heatertune.plc.s7_300.tip.room import ROOM

__all__ = ["ROOM"]

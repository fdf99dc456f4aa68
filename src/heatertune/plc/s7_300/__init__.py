"""The PID of SIMATIC S7-300/400 application tip No. 2; what the document leaves open stands in DIFFERENCES.md."""

from heatertune.plc.s7_300.controller import ROOM

__all__ = ["ROOM"]

"""The paper's PID/PWM program on an S7-200, repaired; what was followed and what differs stands in DIFFERENCES.md."""

from heatertune.plc.s7_200.controller import ROOM

__all__ = ["ROOM"]

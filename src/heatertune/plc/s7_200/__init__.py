"""The paper's PID/PWM program on an S7-200, CPU 214; what it leaves open stands in DIFFERENCES.md."""

from heatertune.plc.s7_200.room import ROOM
from heatertune.plc.s7_200.words import paper_words

__all__ = ["ROOM", "paper_words"]

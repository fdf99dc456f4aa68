"""The paper's PID/PWM program as printed, its faults included; what it leaves open stands in DIFFERENCES.md."""

from heatertune.plc.s7_200_paper.controller import ROOM
from heatertune.plc.s7_200_paper.words import paper_words

__all__ = ["ROOM", "paper_words"]

"""Statement list → what an S7-200 does with it."""

from heatertune.plc.s7_200.machine.assembler import assemble
from heatertune.plc.s7_200.machine.cpu import COLD, Program, State, run

__all__ = ["COLD", "Program", "State", "assemble", "run"]

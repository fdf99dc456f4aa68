"""Statement list → what an S7-200 does with it."""

from heatertune.plc.cpu.s7_200.assembler import assemble
from heatertune.plc.cpu.s7_200.cpu import Program
from heatertune.plc.cpu.s7_200.state import COLD, State, run

__all__ = ["COLD", "Program", "State", "assemble", "run"]

"""Statement list → what an S7-200 does with it."""

from heatertune.plc.cpu.s7_200.assembler import assemble
from heatertune.plc.cpu.s7_200.cpu import S7200Program
from heatertune.plc.cpu.s7_200.io_and_cycle import COLD, S7200State, run

__all__ = ["COLD", "S7200Program", "S7200State", "assemble", "run"]

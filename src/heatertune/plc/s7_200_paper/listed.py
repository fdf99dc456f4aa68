"""The printed program as its statement list runs it on the emulated CPU."""

from __future__ import annotations

from typing import NamedTuple

from heatertune.plc.cpu.s7_200 import Program, State, run
from heatertune.plc.cpu.s7_200.wiring import inputs_of
from heatertune.plc.s7_200_paper.step import Constants, Memory, counted, power_pct, rises

__all__ = ["Listed", "Loaded", "listed"]


class Loaded(NamedTuple):
    """The program, and what the programmer wrote into it."""

    program: Program
    constants: Constants


class Listed(NamedTuple):
    """What the CPU keeps from scan to scan."""

    cpu: State
    memory: Memory = Memory()  # of it: the scans counted, the width of the running PWM cycle


def listed(
    loaded: Loaded, state: Listed, setpoint: int, reading: int, begins: bool
) -> tuple[Listed, float, int, int]:
    """Run the interrupt, where Q0.0 has risen and it is attached, and one scan.

    Args:
        loaded: the program and its constants.
        state: before the scan.
        setpoint: a byte.
        reading: a byte.
        begins: whether a PWM cycle begins with this scan.
    """
    c, memory = loaded.constants, counted(state.memory)
    cpu, overflow, attached = state.cpu.written(inputs_of(setpoint, reading)), False, dict(state.cpu.attached)
    if rises(c, memory, begins) and cpu.enabled and 0 in attached:
        before = cpu.width
        cpu = run(loaded.program, attached[0], cpu, wrap=c.assume.wrap)
        overflow = cpu.overflow
        memory = memory._replace(applied=before if c.assume.next_cycle else cpu.width)
    cpu = run(loaded.program, "OB1", cpu, wrap=c.assume.wrap).written({"SM0.1": 0})
    bits = int(overflow or cpu.overflow) + 2 * int(cpu.zero_division)
    return Listed(cpu, memory), power_pct(c, memory.applied), memory.applied, bits

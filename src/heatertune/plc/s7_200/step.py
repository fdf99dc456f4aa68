"""The repaired program, run once per PWM cycle.

The interrupt adds to the pulse width, as the paper's does; so network 6 delivers the increments of the paper's
equation, KP·ΔE + KI·(E + E_prev) − KD·Δ²PV, in counts and 32 bits, and the rest of the scaling is carried to the next
cycle.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from heatertune.plc.cpu.s7_200 import S7200State
from heatertune.plc.cpu.s7_200.io_and_cycle import WIDTH_APPLIES, TimedProgram, run_cycle, wire

__all__ = ["S7200ManualAssumptions", "step"]


class S7200ManualAssumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False


def step(timed: TimedProgram, state: S7200State, setpoint: int, reading: int, _begins: bool) -> tuple[S7200State, float,
                                                                                                      int, int]:
    """Compute one PWM cycle by the statement list, see `heatertune.plc.core.StepFunctions`.

    Args:
        timed: the program.
        state: of the CPU before the cycle; its memory is changed.
        setpoint: a byte.
        reading: a byte.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    wire(state.memory, setpoint, reading)
    power, width, faults = run_cycle(timed, state.memory)
    return state, power, width, faults

"""The repaired program, directly: what its statement list computes once per PWM cycle, in exact numbers.

The interrupt adds to the pulse width, as the paper's does; so network 6 delivers the increments of the paper's
equation, KP·ΔE + KI·(E + E_prev) − KD·Δ²PV, in counts and 32 bits, and the rest of the scaling is carried to the next
cycle.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from heatertune.plc.cpu.s7_200.cycle import Interrupted, Timed, run_cycle
from heatertune.plc.cpu.s7_200.wiring import WIDTH_APPLIES, inputs_of

__all__ = ["Assumptions", "Constants", "Memory", "cycle", "listed", "step"]


class Assumptions(NamedTuple):
    """What the manual leaves open, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False


class Constants(NamedTuple):
    """What the programmer writes."""

    kp: int
    ki: int
    kd: int
    scale: int
    cycle_ms: int


class Memory(NamedTuple):
    """What the program keeps from cycle to cycle: errors and readings in counts, the width in ms."""

    error: int = 0
    reading: int = 0
    before: int = 0
    rest: int = 0
    width: int = 0
    begun: bool = False


def listed(
    timed: Timed, state: Interrupted, setpoint: int, reading: int, _begins: bool
) -> tuple[Interrupted, float, int, int]:
    """Compute one PWM cycle by the statement list, see `heatertune.plc.core.Core`.

    Args:
        timed: the program.
        state: of the CPU before the cycle.
        setpoint: a byte.
        reading: a byte.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    return run_cycle(timed, state, inputs_of(setpoint, reading))


def step(
    p: tuple[Constants, Assumptions], state: Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[Memory, float, int, int]:
    """Compute the same without the listing, which never overflows.

    Args:
        p: the program's constants, and the assumptions.
        state: the memory before the cycle.
        setpoint: a byte.
        reading: a byte.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    c, assume = p
    after = cycle(c, state, setpoint & 0xFF, reading & 0xFF)
    width = state.width if assume.next_cycle else after.width
    return after, 100.0 * min(width, c.cycle_ms) / c.cycle_ms, width, 0


def cycle(c: Constants, m: Memory, setpoint: int, reading: int) -> Memory:
    """Return the memory after one PWM cycle's computation; `setpoint` and `reading` are bytes."""
    error = setpoint - reading
    last, before = (m.reading, m.before) if m.begun else (reading, reading)
    total = c.kp * (error - m.error) + c.ki * (error + m.error) + c.kd * (2 * last - reading - before) + m.rest
    width = min(max(m.width + (total >> c.scale), 0), c.cycle_ms)
    return Memory(error, reading, last, total & ((1 << c.scale) - 1), width, True)

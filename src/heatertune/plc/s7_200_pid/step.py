"""The program around the PID instruction, directly: what its statement list computes once per PWM cycle.

The loop's equations are those of the System Manual C79000-G7076-C233-01, p. 9-86:

    MP = Kc·(SP − PV)    MI = Kc·(Ts/Ti)·(SP − PV) + MX    MD = Kc·(Td/Ts)·(PV_{n−1} − PV)    M = MP + MI + MD

in single precision, from left to right; see `heatertune.plc.cpu.s7_200.real.pid`, which runs them on the table.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple

from heatertune.plc.cpu.s7_200.wiring import WIDTH_APPLIES
from heatertune.plc.open_points import Switch
from heatertune.plc.single import divided, single

__all__ = ["Assumptions", "Memory", "Table", "cycled"]

_SECONDS: Final = 60.0  # Ti and Td are in minutes


class Assumptions(NamedTuple):
    """What the manual leaves open, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False
    bumpless: Annotated[bool, Switch(
        name="first_call", means={"setpoint_is_pv": True, "setpoint_kept": False},
        why="whether the first call of the loop sets its setpoint to the process variable, so that M begins without a "
            "bump",
    )] = True


class Table(NamedTuple):
    """The words of the loop table."""

    kc: float
    ts: float
    ti: float
    td: float


class Memory(NamedTuple):
    """What the program keeps from cycle to cycle: output, bias and reading as shares, the width in ms."""

    output: float = 0.0  # M
    bias: float = 0.0  # MX
    reading: float = 0.0  # PV_{n−1}
    width: int = 0
    begun: bool = False
    overflow: bool = False  # SM1.1


def cycled(t: Table, cycle_ms: int, m: Memory, setpoint: float, reading: float, bumpless: bool) -> Memory:
    """Return the memory after one PWM cycle's computation; `setpoint` and `reading` are shares of the range."""
    before = m.reading if m.begun else reading
    error = single((reading if bumpless and not m.begun else setpoint) - reading)
    factor = t.kc if t.kc != 0.0 else 1.0
    proportional = single(t.kc * error)
    change = single(single(factor * divided(t.ts, single(_SECONDS * t.ti))) * error)
    derivative = single(single(factor * divided(single(_SECONDS * t.td), t.ts)) * single(before - reading))
    integral = single(change + (m.bias if m.begun else m.output))
    wanted = single(single(proportional + integral) + derivative)
    bias = integral
    if not 0.0 <= wanted <= 1.0:
        bias = single((1.0 if wanted > 1.0 else 0.0) - single(proportional + derivative))
    sound = math.isfinite(wanted) and math.isfinite(bias)
    if not sound:
        return Memory(m.output, m.bias, m.reading, _width(m.output, cycle_ms), True, True)
    output = min(max(wanted, 0.0), 1.0)
    return Memory(output, min(max(bias, 0.0), 1.0), reading, _width(output, cycle_ms), True, False)


def _width(output: float, cycle_ms: int) -> int:
    """Return the pulse width of an output [ms], halves rounded up."""
    return math.floor(single(output * cycle_ms) + 0.5)

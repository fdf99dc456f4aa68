"""The program around the PID instruction, directly: what its statement list computes once per PWM cycle.

The loop's equations are those of the System Manual C79000-G7076-C233-01, p. 9-86:

    MP = Kc·(SP − PV)    MI = Kc·(Ts/Ti)·(SP − PV) + MX    MD = Kc·(Td/Ts)·(PV_{n−1} − PV)    M = MP + MI + MD

in single precision, from left to right; see `heatertune.plc.cpu.s7_200.real.pid`, which runs them on the table.
"""

from __future__ import annotations

import math
import struct
from typing import Annotated, Final, NamedTuple

from heatertune.plc.core import Sensor
from heatertune.plc.cpu.s7_200.cycle import Interrupted, Timed, run_cycle
from heatertune.plc.cpu.s7_200.wiring import WIDTH_APPLIES
from heatertune.plc.open_points import Switch
from heatertune.plc.s7_200_pid.words import SETPOINT
from heatertune.plc.single import divided, single

__all__ = ["FULL", "STEP", "Assumptions", "Memory", "Table", "cycled", "listed", "measure", "step"]

#: analog input word at the end of the range
FULL: Final = 32000
#: of a converter of 12 bits, left-justified
STEP: Final = 8

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


def measure(sensor: Sensor, temperature_degC: float) -> int:
    """Return the analog input word of a temperature."""
    share = (temperature_degC - sensor.low) / sensor.span
    return STEP * int(min(max(share * sensor.counts, 0.0), float(sensor.counts)))


def listed(
    timed: Timed, state: Interrupted, setpoint: int, reading: int, _begins: bool
) -> tuple[Interrupted, float, int, int]:
    """Compute one PWM cycle by the statement list, see `heatertune.plc.core.Core`.

    Args:
        timed: the program.
        state: of the CPU before the cycle.
        setpoint: an analog word.
        reading: an analog word.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    share = int.from_bytes(struct.pack(">f", _share(setpoint)), "big")
    state, power, width, bits = run_cycle(timed, state, {"AIW0": reading, SETPOINT: share})
    return state, power, width, bits & 1


def step(
    p: tuple[Table, int, Assumptions], state: Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[Memory, float, int, int]:
    """Compute the same without the listing.

    Args:
        p: the loop's table, the PWM cycle [ms], and the assumptions.
        state: the memory before the cycle.
        setpoint: an analog word.
        reading: an analog word.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    table, cycle, assume = p
    after = cycled(table, cycle, state, _share(setpoint), _share(reading), assume.bumpless)
    width = state.width if assume.next_cycle else after.width
    return after, 100.0 * min(width, cycle) / cycle, width, int(after.overflow)


def _share(word: int) -> float:
    return divided(float(word), float(FULL))


def cycled(t: Table, cycle_ms: int, m: Memory, setpoint: float, reading: float, bumpless: bool) -> Memory:
    """Return the memory after one PWM cycle's computation.

    Args:
        t: the loop's table.
        cycle_ms: PWM cycle [ms].
        m: the memory before the cycle.
        setpoint: as a share of the range.
        reading: as a share of the range.
        bumpless: whether the first call takes the reading for its setpoint.
    """
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

"""The printed program, scan by scan (Alia 2007, Table 2).

Every scan: VW10 = setpoint − process variable, both in the high byte of their words; AC0 = Kp·E_prev +
T·Ki·(E + E_prev) + Kd·(E − E_prev)/T; VW100 = its high word. The interrupt on the rising edge of Q0.0 adds VW100 to the
pulse width SMW70. So what is called P accumulates (acts as I) and what is called D acts as P.

What the program may be as a control law the printed networks leave open: its P acts as I in the interrupt's
accumulation, its D as P, and the ladders that would settle it are lost (DIFFERENCES.md). Each hypothesis is the
continuous-gain idealisation of one reading; a fit compares them. Errors are in °C, power in percent; `memory` is four
floats, zero at the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple

from heatertune.arrays import Array
from heatertune.model.temperature.closed_loop import Constant, Step
from heatertune.plc.cpu.s7_200 import S7200Program, S7200State
from heatertune.plc.cpu.s7_200.cpu import carry_out
from heatertune.plc.cpu.s7_200.io_and_cycle import WIDTH_APPLIES, wire
from heatertune.plc.cpu.s7_200.io_and_cycle import cold_start as started_cpu
from heatertune.plc.cpu.s7_200.io_and_cycle import own as own_cpu
from heatertune.plc.cpu.s7_200.io_and_cycle import warm_start as restarted_cpu
from heatertune.plc.cpu.s7_200.memory import ATTACHED, ENABLED, FAULTS, WIDTH, bit, cell, word
from heatertune.plc.open_points import OpenPoint

__all__ = [
    "FIRST_EDGE", "LAWS", "LoadedPaperProgram", "PaperLaw", "PaperState", "S7200PaperAssumptions", "cold_start", "own",
    "power_pct", "rises", "step", "warm_start",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperLaw:
    """A reading of the program; see `heatertune.model.temperature.closed_loop.ControllerLaw`."""

    name: str
    constants: tuple[Constant, ...]
    form: int

    @property
    def step(self) -> Step:
        """All five, see `form`."""
        return _power


def _limited(power: float) -> float:
    return min(100.0, max(0.0, power))


def _positional_p(constants: Array, error: float) -> float:
    return _limited(constants[0] * error)


def _incremental_p(constants: Array, memory: Array, error: float, h: float) -> float:
    if memory[1] == 0.0:
        memory[0], memory[1] = constants[1], 1.0
    memory[0] = power = _limited(memory[0] + constants[0] * h * error)
    return power


def _pi_conditional(constants: Array, memory: Array, error: float, h: float) -> float:
    if memory[1] == 0.0:
        memory[0], memory[1] = constants[2], 1.0
    demand = constants[0] * error + memory[0]
    power = _limited(demand)
    if power == demand:
        memory[0] += constants[0] * h / constants[1] * error
    return power


def _pi_plain(constants: Array, memory: Array, error: float, h: float) -> float:
    if memory[1] == 0.0:
        memory[0], memory[1] = constants[2], 1.0
    demand = constants[0] * error + memory[0]
    memory[0] += constants[0] * h / constants[1] * error
    return _limited(demand)


def _velocity_pi(constants: Array, memory: Array, error: float, h: float) -> float:
    if memory[1] == 0.0:
        memory[0], memory[1], memory[2] = constants[2], 1.0, error
    increment = constants[0] * (error - memory[2]) + constants[0] * h / constants[1] * error
    memory[0] = power = _limited(memory[0] + constants[3] * int(increment / constants[3]))
    memory[2] = error
    return power


def _power(form: int, constants: Array, memory: Array, error: float, h: float) -> float:
    if form == 0:
        return _positional_p(constants, error)
    if form == 1:
        return _incremental_p(constants, memory, error, h)
    if form == 2:
        return _pi_conditional(constants, memory, error, h)
    if form == 3:
        return _pi_plain(constants, memory, error, h)
    return _velocity_pi(constants, memory, error, h)


_GAIN = Constant(name="gain_pct_per_degC", low=0.3, high=100.0, logarithmic=True)
_TN = Constant(name="integral_time_s", low=15.0, high=3000.0, logarithmic=True)
_FIRST = Constant(name="first_power_pct", low=0.0, high=100.0)

LAWS: Final[tuple[PaperLaw, ...]] = (
    PaperLaw(name="positional P", constants=(_GAIN,), form=0),
    PaperLaw(
        name="incremental P",
        constants=(Constant(name="gain_pct_per_degC_s", low=1e-3, high=1.0, logarithmic=True), _FIRST),
        form=1,
    ),
    PaperLaw(name="PI with anti-windup", constants=(_GAIN, _TN, _FIRST), form=2),
    PaperLaw(name="PI without anti-windup", constants=(_GAIN, _TN, _FIRST), form=3),
    PaperLaw(
        name="truncated velocity PI",
        constants=(
            _GAIN, _TN, _FIRST, Constant(name="quantum_pct", low=1e-4, high=1.0, logarithmic=True),
        ),
        form=4,
    ),
)


#: S Q0.0,1 reaches I0.0 behind its input filter, some scans after the first
FIRST_EDGE = 3

_UNLOADED = 2  # cycle of the generator without a cycle time [ms]: "less than 2 units → 2 units"
_RISES: Final = 0  # event of a rising edge on I0.0
_ADJUSTMENT_1: Final = cell("SMB29", 1).start
_FIRST_BYTE, _FIRST_BIT = bit("SM0.1")  # the first scan


class S7200PaperAssumptions(NamedTuple):
    """The open points of paper and manual, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False
    wrap: Annotated[bool, OpenPoint(
        name="overflow", means={"keep": False, "wrap": True},
        reason="whether an overflowing +I or −I of the CPU 214 leaves its operand or writes the wrapped result",
    )] = False
    stops_at_rails: Annotated[bool, OpenPoint(
        name="rails", means={"edges_stop": True, "edges_go_on": False},
        reason="whether a width of 0 or of the whole cycle gives no edge and so no update: the manual says that the "
               "output then stays off or on, but the paper's logs recover from it",
    )] = True
    loads_cycle: Annotated[bool, OpenPoint(
        name="cycle_time", means={"loaded": True, "never_loaded": False},
        reason="whether PLS loads the cycle time: the manual says that 16#CA in SMB67 does not, but the paper's "
               "heater worked",
    )] = True


class LoadedPaperProgram(NamedTuple):
    """The program.

    Attributes:
        program: as assembled.
        cycle_ms: PWM cycle [ms].
        pot1: analog adjustment 1.
        assume: how open points are read.
    """

    program: S7200Program
    cycle_ms: int
    pot1: int
    assume: S7200PaperAssumptions = S7200PaperAssumptions()


class PaperState(NamedTuple):
    """What is kept from scan to scan.

    Attributes:
        cpu: the CPU.
        scans: counted up to the scan in which the edge of S Q0.0,1 is served.
        applied: width of the running PWM cycle [ms].
    """

    cpu: S7200State
    scans: int = 0
    applied: int = 0


def step(c: LoadedPaperProgram, state: PaperState, setpoint: int, reading: int, begins: bool) -> tuple[PaperState,
                                                                                                       float, int, int]:
    """Run the interrupt, where Q0.0 has risen and it is attached, and one scan.

    See `heatertune.plc.core.StepFunctions`.

    Args:
        c: the program.
        state: before the scan; the CPU's memory is changed.
        setpoint: a byte.
        reading: a byte.
        begins: whether a PWM cycle begins with this scan.
    """
    memory, applied, faults = state.cpu.memory, state.applied, 0
    scans = min(state.scans + 1, FIRST_EDGE + 1)
    wire(memory, setpoint, reading)
    memory[_ADJUSTMENT_1] = c.pot1
    if scans == 1:
        memory[_FIRST_BYTE] |= _FIRST_BIT
    if rises(c, scans, applied, begins) and memory[ENABLED] and memory[ATTACHED + _RISES]:
        before = word(memory, WIDTH)
        carry_out(c.program, memory, memory[ATTACHED + _RISES] * 1, c.assume.wrap)
        faults = memory[FAULTS] & 2
        applied = before if c.assume.next_cycle else word(memory, WIDTH)
    carry_out(c.program, memory, 0, c.assume.wrap)
    memory[_FIRST_BYTE] &= 0xFF - _FIRST_BIT
    faults |= memory[FAULTS]
    return PaperState(state.cpu, scans, applied), power_pct(c, applied), applied, (faults >> 1 & 1) + (faults >> 2 & 2)


def own(state: PaperState) -> PaperState:
    """Return a copy, whose memory may be changed."""
    return PaperState(own_cpu(state.cpu), state.scans, state.applied)


def cold_start(parameters: LoadedPaperProgram, state: PaperState) -> PaperState:
    """Return the state, made that of a CPU whose memory was lost."""
    return PaperState(started_cpu(parameters, state.cpu), 0, 0)


def warm_start(parameters: LoadedPaperProgram, cold: PaperState, state: PaperState) -> PaperState:
    """Return the state, made that after a start-up."""
    return PaperState(restarted_cpu(parameters, cold.cpu, state.cpu), 0, 0)


def rises(c: LoadedPaperProgram, scans: int, applied: int, cycle_start: bool) -> bool:
    """Return whether Q0.0 rises before a scan.

    Args:
        c: the program.
        scans: counted, this one among them.
        applied: width of the PWM cycle that ends [ms].
        cycle_start: whether a PWM cycle begins with this scan.
    """
    if scans == FIRST_EDGE:
        return True
    if not c.assume.loads_cycle:  # a cycle of 2 ms begins in every scan
        return 0 < applied < _UNLOADED or not c.assume.stops_at_rails
    return cycle_start and (0 < applied < c.cycle_ms or not c.assume.stops_at_rails)


def power_pct(c: LoadedPaperProgram, applied: int) -> float:
    """Return the share of the PWM cycle in which Q0.0 is on [%], its width being `applied` [ms]."""
    cycle = c.cycle_ms if c.assume.loads_cycle else _UNLOADED
    return 100.0 * min(applied, cycle) / cycle

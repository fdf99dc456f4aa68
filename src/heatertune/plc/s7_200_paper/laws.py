"""What the paper's program may be as a control law.

The printed networks leave it open: its P acts as I in the interrupt's accumulation, its D as P, and the ladders that
would settle it are lost (DIFFERENCES.md). Each hypothesis is the continuous-gain idealisation of one reading; a fit
compares them. Errors are in °C, power in percent; `memory` is four floats, zero at the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from heatertune.arrays import Array
from heatertune.model.temperature.closed_loop import Constant, Step

__all__ = ["LAWS", "PaperLaw"]


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
    wanted = constants[0] * error + memory[0]
    power = _limited(wanted)
    if power == wanted:
        memory[0] += constants[0] * h / constants[1] * error
    return power


def _pi_plain(constants: Array, memory: Array, error: float, h: float) -> float:
    if memory[1] == 0.0:
        memory[0], memory[1] = constants[2], 1.0
    wanted = constants[0] * error + memory[0]
    memory[0] += constants[0] * h / constants[1] * error
    return _limited(wanted)


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

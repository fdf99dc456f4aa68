"""The program around the PID instruction, run once per PWM cycle."""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple

from heatertune.plc.core import BINARY_LOSS, Sensor
from heatertune.plc.cpu.s7_200 import S7200State
from heatertune.plc.cpu.s7_200.io_and_cycle import WIDTH_APPLIES, TimedProgram, run_cycle
from heatertune.plc.cpu.s7_200.memory import cell, put_real, put_word
from heatertune.plc.s7_200_pid.words import FULL, SETPOINT
from heatertune.plc.single_precision import divide_single

__all__ = ["FULL", "STEP", "S7200PidAssumptions", "measure", "step"]

#: of a converter of 12 bits, left-justified
STEP: Final = 8

_READING: Final = cell("AIW0", 2).start
_SETPOINT: Final = cell(SETPOINT, 4).start


class S7200PidAssumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md."""

    next_cycle: Annotated[bool, WIDTH_APPLIES] = False


def measure(sensor: Sensor, temperature_degC: float) -> int:
    """Return the analog input word of a temperature."""
    exact = (temperature_degC - sensor.low) * sensor.counts / sensor.span + sensor.half + BINARY_LOSS
    return FULL // sensor.counts * int(min(max(exact, float(sensor.least)), float(sensor.counts)))


def step(timed: TimedProgram, state: S7200State, setpoint: int, reading: int, _begins: bool) -> tuple[S7200State, float,
                                                                                                      int, int]:
    """Compute one PWM cycle by the statement list, see `heatertune.plc.core.StepFunctions`.

    Args:
        timed: the program.
        state: of the CPU before the cycle; its memory is changed.
        setpoint: an analog word, whose share of the range the operator's panel writes.
        reading: an analog word.
        _begins: not looked at: each scan is a whole PWM cycle.
    """
    put_word(state.memory, _READING, reading)
    put_real(state.memory, _SETPOINT, divide_single(float(setpoint), float(FULL)))
    power, width, faults = run_cycle(timed, state.memory)
    return state, power, width, faults & 1

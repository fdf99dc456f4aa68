"""One call of the tip's function block in REAL, in the document's order (PID tip No. 2, V1.0, 11/96, formulas 2.1–2.9).

    SP = raw_SP/27648    PV = raw_PV/27648    Error = SP − PV
    MP = Gain·Error
    CI = Gain·(Sample/Reset)    MI = Bias + CI·Error
    CD = Gain·(Rate/Sample)     MD = CD·(PV_{n−1} − PV_n)
    Output = MP + MI + MD, from left to right
    Bias := MI;  1 − (MP + MD) where Output > 1;  −(MP + MD) where Output < 0; what was adjusted is clamped to 0…1
    Output clamped to 0…1; OUT = Output·27648 as an INT

Gain = 0 leaves Gain out of CI and CD; Reset = 0 takes the integral part out. What is not a number is clamped to 0.
The exported block is the same program, instruction by instruction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, clamp, quotient, real
from heatertune.plc.open_points import OpenPoint

__all__ = ["COLD", "PidTipAssumptions", "PidTipParameters", "PidTipState", "call", "manual", "percent", "scan", "step"]


class PidTipParameters(NamedTuple):
    """The four words of the instance data block; times in ms."""

    gain: float
    rate: float
    reset: float
    sample: float


class PidTipAssumptions(NamedTuple):
    """The open points of the document, see DIFFERENCES.md."""

    truncates: Annotated[bool, OpenPoint(
        name="conversion", means={"rnd": False, "trunc": True},
        reason="whether OUT is rounded (halves to even) or truncated when it is converted to an INT",
    )] = False
    bias_always_clamped: Annotated[bool, OpenPoint(
        name="bias_clamp", means={"adjusted": False, "always": True},
        reason='the document clamps "the adjusted bias": whether a bias that was not adjusted is clamped to 0…1 as '
               'well',
    )] = False
    starts_at_zero: Annotated[bool, OpenPoint(
        name="first_reading", means={"taken": False, "zero": True}, shows=lambda own: own[0].rate != 0.0,
        reason="whether PV_{n−1} of the first call is that call's reading, or 0 with a kick of the derivative part",
    )] = False


class PidTipState(NamedTuple):
    """What the instance data block keeps from call to call."""

    bias: float = 0.0
    reading: float = 0.0  # PV_{n−1}, normalised
    started: bool = False
    output: int = 0  # OUT
    overflow: bool = False


COLD: Final = PidTipState()


def step(
    parameters: tuple[PidTipParameters, PidTipAssumptions], state: PidTipState, setpoint: int, reading: int,
    _begins: bool
) -> tuple[PidTipState, float, int, int]:
    """Compute one scan, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: analog value, −32768…32767.
        reading: analog value, −32768…32767.
        _begins: not looked at: the PWM is behind the output.
    """
    return _outcome(call(parameters[0], parameters[1], state, setpoint, reading))


def scan(
    parameters: tuple[PidTipParameters, PidTipAssumptions], state: PidTipState, inputs: Mapping[str, int]
) -> tuple[PidTipState, float, int, int]:
    """Compute one scan with SP and PV and, where named, mode_req and what the user wrote to OUT in manual."""
    if inputs.get("mode_req", 1):
        return step(parameters, state, inputs["SP"], inputs["PV"], True)
    return _outcome(manual(state, inputs["PV"], inputs.get("OUT", state.output)))


def _outcome(after: PidTipState) -> tuple[PidTipState, float, int, int]:
    """Return the state, OUT in percent, OUT, and the flag."""
    return after, percent(after.output), after.output, int(after.overflow)


def percent(output: int) -> float:
    """Return the power of an analog value [0…100 %]."""
    return min(max(100.0 * output / FULL_SCALE, 0.0), 100.0)


def call(p: PidTipParameters, assume: PidTipAssumptions, state: PidTipState, setpoint: int,
         reading: int) -> PidTipState:
    """Return the state after one call in automatic.

    Args:
        p: the block's parameters.
        assume: of what the document leaves open.
        state: before the call.
        setpoint: analog value, −32768…32767.
        reading: analog value, −32768…32767.
    """
    sp, os = quotient(setpoint, FULL_SCALE)
    pv, os = quotient(reading, FULL_SCALE, os)
    before = state.reading if state.started or assume.starts_at_zero else pv
    ci, cd, os = _coefficients(p, os)
    error, os = real(sp - pv, os)
    mp, os = real(p.gain * error, os)
    mi, os = real(ci * error, os)
    mi, os = real(mi + state.bias, os)
    md, os = real(before - pv, os)
    md, os = real(cd * md, os)
    output, os = real(mp + mi, os)
    output, os = real(output + md, os)
    other, os = real(mp + md, os)
    bias, os = _bias(assume, output, mi, other, os)
    scaled, os = real(clamp(output, 0.0, 1.0) * FULL_SCALE, os)
    return PidTipState(bias, pv, True, math.trunc(scaled) if assume.truncates else round(scaled), os)


def manual(state: PidTipState, reading: int, output: int | None = None) -> PidTipState:
    """Return the state after one call in manual: the user's OUT stays, and the bias follows it."""
    out = state.output if output is None else output
    bias, os = quotient(out, FULL_SCALE)
    pv, os = quotient(reading, FULL_SCALE, os)
    return PidTipState(bias=clamp(bias, 0.0, 1.0), reading=pv, started=True, output=out, overflow=os)


def _coefficients(p: PidTipParameters, os: bool) -> tuple[float, float, bool]:
    """Return CI, CD and OS."""
    factor, ci = p.gain if p.gain != 0.0 else 1.0, 0.0
    if p.reset != 0.0:
        ci, os = quotient(p.sample, p.reset, os)
        ci, os = real(ci * factor, os)
    cd, os = quotient(p.rate, p.sample, os)
    cd, os = real(cd * factor, os)
    return ci, cd, os


def _bias(assume: PidTipAssumptions, output: float, mi: float, value: float, os: bool) -> tuple[float, bool]:
    """Adjust the bias so that the output ends at its limit (formulas 2.8 and 2.9); OS comes with it."""
    if 0.0 <= output <= 1.0:
        return (clamp(mi, 0.0, 1.0) if assume.bias_always_clamped else mi), os
    adjusted, os = real((1.0 if output > 1.0 else 0.0) - value, os)
    return clamp(adjusted, 0.0, 1.0), os

"""One call of CONT_C in REAL: the documented equation, and two public re-implementations where the manual draws only.

    PV = PV_PER·100/27648·PV_FAC + PV_OFF            ER = SP_INT − PV, less the dead band
    E = GAIN·ER    P = E                             TI ≥ CYCLE/2, TD ≥ CYCLE, TM_LAG ≥ CYCLE/2 or raised to it
    I_k = I_{k−1} + CYCLE/TI·½(E_k + E_{k−1})        held at a limit it would leave further, or by INT_HOLD
    D_k = TD/(CYCLE/2 + TM_LAG)·(E_k − F_{k−1})      F_k = F_{k−1} + CYCLE/TD·D_k
    LMN = (P + I + D + DISV, or MAN, within LMN_LLM…LMN_HLM)·LMN_FAC + LMN_OFF

I and F carry what rounding cut off to the next call. Where the sum without the last D leaves a limit by its integral
part, the integral part is taken back to the limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, NamedTuple

from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, clamp, quotient, real
from heatertune.plc.open_points import OpenPoint

__all__ = ["ContCAssumptions", "ContCParameters", "ContCState", "call", "disturbance_step", "outcome", "restart",
           "scale_reading", "scan", "step"]

_PERCENT: Final = 100.0


class ContCParameters(NamedTuple):
    """The inputs of the block that are words; times in s as the block converts them."""

    cycle: float
    gain: float
    ti: float
    td: float
    tm_lag: float
    dead_band: float
    upper: float
    lower: float
    pv_factor: float
    pv_offset: float
    lmn_factor: float
    lmn_offset: float
    initial: float  # I_ITLVAL
    disturbance: float  # DISV
    manual: float  # MAN
    man_on: bool
    p_sel: bool
    i_sel: bool
    int_hold: bool
    i_itl_on: bool
    d_sel: bool


class ContCAssumptions(NamedTuple):
    """The undocumented points, see DIFFERENCES.md."""

    rectangle: Annotated[bool, OpenPoint(
        name="integral", means={"trapezoid": False, "rectangle": True},
        reason="whether the I part uses the mean of two errors or the last one",
    )] = False
    whole_cycle: Annotated[bool, OpenPoint(
        name="derivative_lag", means={"half_cycle": False, "whole_cycle": True}, shows=lambda own: own[0].d_sel,
        reason="whether CYCLE/2 or CYCLE is added to TM_LAG: the bilinear or the backward form of the lag",
    )] = False
    only_held: Annotated[bool, OpenPoint(
        name="anti_windup", means={"taken_back": False, "held": True},
        reason="whether an I part that exceeds a limit by itself is reset to the limit, or only stopped",
    )] = False


class ContCState(NamedTuple):
    """What the instance data block keeps from call to call."""

    integral: float = 0.0
    before: float = 0.0  # E_{k−1}
    derivative: float = 0.0  # LMN_D
    feedback: float = 0.0  # F
    integral_rest: float = 0.0
    feedback_rest: float = 0.0
    limited: float = 0.0  # before LMN_FAC
    at_upper: bool = False
    at_lower: bool = False
    output: float = 0.0  # LMN
    overflow: bool = False


def step(
    parameters: tuple[ContCParameters, ContCAssumptions], state: ContCState, setpoint: int, reading: int, _begins: bool
) -> tuple[ContCState, float, float, int]:
    """Compute one scan, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: analog value, −32768…32767.
        reading: analog value, −32768…32767.
        _begins: not looked at: the PWM is behind the output.
    """
    sp_int, _ = scale_reading(parameters[0], setpoint)
    return _called(parameters[0], parameters[1], state, sp_int, reading)


def disturbance_step(
    parameters: tuple[ContCParameters, ContCAssumptions], state: ContCState, setpoint: int, reading: int, begins: bool,
    disturbance_pct: float,
) -> tuple[ContCState, float, float, int]:
    """Compute one scan with DISV, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: analog value, −32768…32767.
        reading: analog value, −32768…32767.
        begins: not looked at: the PWM is behind the output.
        disturbance_pct: DISV, a REAL [%].
    """
    p = parameters[0]
    fed = ContCParameters(  # without _replace, which no compiler takes
        p.cycle, p.gain, p.ti, p.td, p.tm_lag, p.dead_band, p.upper, p.lower, p.pv_factor, p.pv_offset, p.lmn_factor,
        p.lmn_offset, p.initial, float(disturbance_pct), p.manual, p.man_on, p.p_sel, p.i_sel, p.int_hold, p.i_itl_on,
        p.d_sel)
    return step((fed, parameters[1]), state, setpoint, reading, begins)


def scan(
    parameters: tuple[ContCParameters, ContCAssumptions], state: ContCState, inputs: Mapping[str, Any]
) -> tuple[ContCState, float, float, int]:
    """Compute one scan with PV_PER and SP_PER or SP_INT; what is not named stays as the words have it."""
    p, assume = parameters
    p = p._replace(
        man_on=bool(inputs.get("MAN_ON", p.man_on)), manual=inputs.get("MAN", p.manual),
        disturbance=inputs.get("DISV", p.disturbance), int_hold=bool(inputs.get("INT_HOLD", p.int_hold)),
    )
    if inputs.get("COM_RST", 0):
        return outcome(restart(p))
    setpoint = inputs["SP_INT"] if "SP_INT" in inputs else scale_reading(p, int(inputs["SP_PER"]))[0]
    return _called(p, assume, state, setpoint, int(inputs["PV_PER"]))


def _called(
    p: ContCParameters, assume: ContCAssumptions, state: ContCState, setpoint: float, reading: int
) -> tuple[ContCState, float, float, int]:
    pv, os = scale_reading(p, reading)
    return outcome(call(p, assume, state, setpoint, pv, os))


def outcome(after: ContCState) -> tuple[ContCState, float, float, int]:
    """Return the state, LMN as power, LMN, and the flags as bits."""
    bits = int(after.at_upper) + 2 * int(after.at_lower) + 4 * int(after.overflow)
    return after, clamp(after.output, 0.0, 100.0), after.output, bits


def restart(p: ContCParameters) -> ContCState:
    """Return the state after a call with COM_RST."""
    return ContCState(integral=p.initial)


def scale_reading(p: ContCParameters, reading: int, os: bool = False) -> tuple[float, bool]:
    """Return PV of an analog value, in the unit of PV_FAC, and OS after it."""
    value, os = real(reading * _PERCENT, os)
    value, os = quotient(value, FULL_SCALE, os)
    value, os = real(value * p.pv_factor, os)
    return real(value + p.pv_offset, os)


def call(
    p: ContCParameters, assume: ContCAssumptions, state: ContCState, setpoint: float, reading: float, os: bool = False
) -> ContCState:
    """Return the state after one call.

    Args:
        p: the block's parameters.
        assume: of what the manual leaves open.
        state: before the call.
        setpoint: SP_INT, in the unit of PV_FAC.
        reading: PV, in the same unit.
        os: the status bit OS as it was before.
    """
    error, os = real(setpoint - reading, os)
    error, os = _dead_band(p, error, os)
    error, os = real(p.gain * error, os)
    proportional = error if p.p_sel else 0.0
    integral, integral_rest, os = _integral(p, assume, state, error, proportional, os)
    derivative, feedback, feedback_rest, os = _derivative(p, assume, state, error, os)
    total, os = real(proportional + integral, os)
    total, os = real(total + derivative, os)
    total, os = real(total + p.disturbance, os)
    if p.man_on:
        total = p.manual
    elif p.i_sel and not p.i_itl_on and not assume.only_held:
        without_d, os = real(total - state.derivative, os)
        integral, os = _taken_back(p, integral, total, without_d, os)
    at_upper = total >= p.upper
    at_lower = not at_upper and total <= p.lower
    limited = p.upper if at_upper else p.lower if at_lower else total
    output, os = real(limited * p.lmn_factor, os)
    output, os = real(output + p.lmn_offset, os)
    return ContCState(
        integral, error, derivative, feedback, integral_rest, feedback_rest, limited, at_upper, at_lower, output, os
    )


def _dead_band(p: ContCParameters, error: float, os: bool) -> tuple[float, bool]:
    if error > p.dead_band:
        return real(error - p.dead_band, os)
    return real(error + p.dead_band, os) if error < -p.dead_band else (0.0, os)


def _integral(
    p: ContCParameters, assume: ContCAssumptions, state: ContCState, error: float, proportional: float, os: bool
) -> tuple[float, float, bool]:
    """Return the integral part, what rounding cut off, and OS."""
    if not p.i_sel:
        return 0.0, 0.0, os
    if p.i_itl_on:
        return p.initial, 0.0, os
    if p.man_on:  # ready for a return without a step
        integral, os = real(state.limited - proportional, os)
        integral, os = real(integral - p.disturbance, os)
        return integral, 0.0, os
    half, os = real(p.cycle * 0.5, os)
    mean = error
    if not assume.rectangle:
        mean, os = real(error + state.before, os)
        mean, os = real(mean * 0.5, os)
    share, os = quotient(p.cycle, max(p.ti, half), os)
    change, os = real(share * mean, os)
    change, os = real(change + state.integral_rest, os)
    outward = (change > 0.0 and state.at_upper) or (change < 0.0 and state.at_lower)
    if p.int_hold or outward:
        change = 0.0
    integral, os = real(state.integral + change, os)
    rest, os = _cut_off(state.integral, integral, change, os)
    return integral, rest, os


def _derivative(
    p: ContCParameters, assume: ContCAssumptions, state: ContCState, error: float, os: bool
) -> tuple[float, float, float, bool]:
    """Return the derivative part, its feedback, what rounding cut off, and OS."""
    if p.man_on or not p.d_sel:
        return 0.0, error, 0.0, os
    half, os = real(p.cycle * 0.5, os)
    td, lag = max(p.td, p.cycle), max(p.tm_lag, half)
    both, os = real((p.cycle if assume.whole_cycle else half) + lag, os)
    share, os = quotient(td, both, os)
    derivative, os = real(error - state.feedback, os)
    derivative, os = real(derivative * share, os)
    change, os = quotient(p.cycle, td, os)
    change, os = real(change * derivative, os)
    change, os = real(change + state.feedback_rest, os)
    feedback, os = real(change + state.feedback, os)
    rest, os = _cut_off(state.feedback, feedback, change, os)
    return derivative, feedback, rest, os


def _cut_off(before: float, after: float, change: float, os: bool) -> tuple[float, bool]:
    """Return what rounding cut off a change, and OS."""
    missed, os = real(before - after, os)
    return real(missed + change, os)


def _taken_back(p: ContCParameters, integral: float, total: float, without_d: float, os: bool) -> tuple[float, bool]:
    """Take the integral part back to the limit that it alone leaves; OS comes with it."""
    room, os = real(p.upper - p.disturbance, os)
    if integral > room and total > p.upper and without_d > p.upper:
        own, os = real(integral - room, os)
        beyond, os = real(total - p.upper, os)
        return real(integral - min(own, beyond), os)
    room, os = real(p.lower - p.disturbance, os)
    if integral < room and total < p.lower and without_d < p.lower:
        own, os = real(integral - room, os)
        beyond, os = real(total - p.lower, os)
        return real(integral - max(own, beyond), os)
    return integral, os

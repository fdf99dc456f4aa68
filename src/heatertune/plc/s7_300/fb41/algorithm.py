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

from typing import Final, NamedTuple

from heatertune.plc.s7_300.module import FULL_SCALE
from heatertune.plc.s7_300.real import Real

__all__ = ["Assumptions", "Parameters", "State", "call", "restart", "scaled"]

_PERCENT: Final = 100.0


class Parameters(NamedTuple):
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


class Assumptions(NamedTuple):
    """Settings of what is not documented, see DIFFERENCES.md."""

    rectangle: bool = False
    whole_cycle: bool = False
    only_held: bool = False


class State(NamedTuple):
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


def restart(p: Parameters) -> State:
    """Return the state after a call with COM_RST."""
    return State(integral=p.initial)


def scaled(r: Real, p: Parameters, reading: int) -> float:
    """Return PV of an analog value, in the unit of PV_FAC."""
    percent = r.quotient(r.of(reading * _PERCENT), FULL_SCALE)
    return r.of(r.of(percent * p.pv_factor) + p.pv_offset)


def call(p: Parameters, assume: Assumptions, state: State, setpoint: float, reading: float, r: Real) -> State:
    """Return the state after one call; setpoint SP_INT and reading PV in the unit of PV_FAC."""
    error = r.of(p.gain * _dead_band(r, p, r.of(setpoint - reading)))
    proportional = error if p.p_sel else 0.0
    integral, integral_rest = _integral(r, p, assume, state, error, proportional)
    derivative, feedback, feedback_rest = _derivative(r, p, assume, state, error)
    total = r.of(r.of(r.of(proportional + integral) + derivative) + p.disturbance)
    if p.man_on:
        total = p.manual
    elif p.i_sel and not p.i_itl_on and not assume.only_held:
        integral = _taken_back(r, p, integral, total, r.of(total - state.derivative))
    at_upper = total >= p.upper
    at_lower = not at_upper and total <= p.lower
    limited = p.upper if at_upper else p.lower if at_lower else total
    return State(
        integral=integral, before=error, derivative=derivative, feedback=feedback, integral_rest=integral_rest,
        feedback_rest=feedback_rest, limited=limited, at_upper=at_upper, at_lower=at_lower,
        output=r.of(r.of(limited * p.lmn_factor) + p.lmn_offset), overflow=r.overflow,
    )


def _dead_band(r: Real, p: Parameters, error: float) -> float:
    if error > p.dead_band:
        return r.of(error - p.dead_band)
    return r.of(error + p.dead_band) if error < -p.dead_band else 0.0


def _integral(
    r: Real, p: Parameters, assume: Assumptions, state: State, error: float, proportional: float
) -> tuple[float, float]:
    """Return the integral part and what rounding cut off."""
    if not p.i_sel:
        return 0.0, 0.0
    if p.i_itl_on:
        return p.initial, 0.0
    if p.man_on:  # ready for a return without a step
        return r.of(r.of(state.limited - proportional) - p.disturbance), 0.0
    ti = max(p.ti, r.of(p.cycle * 0.5))
    mean = error if assume.rectangle else r.of(r.of(error + state.before) * 0.5)
    change = r.of(r.of(r.quotient(p.cycle, ti) * mean) + state.integral_rest)
    outward = (change > 0.0 and state.at_upper) or (change < 0.0 and state.at_lower)
    if p.int_hold or outward:
        change = 0.0
    integral = r.of(state.integral + change)
    return integral, r.of(r.of(state.integral - integral) + change)


def _derivative(
    r: Real, p: Parameters, assume: Assumptions, state: State, error: float
) -> tuple[float, float, float]:
    """Return the derivative part, its feedback and what rounding cut off."""
    if p.man_on or not p.d_sel:
        return 0.0, error, 0.0
    half = r.of(p.cycle * 0.5)
    td, lag = max(p.td, p.cycle), max(p.tm_lag, half)
    share = r.quotient(td, r.of((p.cycle if assume.whole_cycle else half) + lag))
    derivative = r.of(r.of(error - state.feedback) * share)
    change = r.of(r.of(r.quotient(p.cycle, td) * derivative) + state.feedback_rest)
    feedback = r.of(change + state.feedback)
    return derivative, feedback, r.of(r.of(state.feedback - feedback) + change)


def _taken_back(r: Real, p: Parameters, integral: float, total: float, without_d: float) -> float:
    """Take the integral part back to the limit that it alone leaves."""
    room = r.of(p.upper - p.disturbance)
    if integral > room and total > p.upper and without_d > p.upper:
        return r.of(integral - min(r.of(integral - room), r.of(total - p.upper)))
    room = r.of(p.lower - p.disturbance)
    if integral < room and total < p.lower and without_d < p.lower:
        return r.of(integral - max(r.of(integral - room), r.of(total - p.lower)))
    return integral

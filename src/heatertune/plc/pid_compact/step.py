"""One cycle of the PID algorithm of PID_Compact and PID_Temp, in single precision, a rounding per operation.

The manuals print the law of a continuous controller (A5E35300227-AC, p. 246 and 391); w setpoint, x reading:

    y = Kp·[(b·w − x) + (w − x)/(TI·s) + TD·s/(a·TD·s + 1)·(c·w − x)]            TI = 0, TD = 0: that part is off

A cycle T makes of it, from left to right, the limits holding y (how each is sampled is open, see `Assumptions`):

    e = w − x     P = Kp·(b·w − x)     I_k = I_{k−1} + (Kp·T/TI)·(e_k, e_{k−1} or their mean)
    v = c·w − x   D_k = α·D_{k−1} + β·(v_k − v_{k−1})                                y = (P + I) + D

Inverted control is Kp below 0. What stops I at a limit is known in words only: it is stopped in the direction that
leads further out, and, by V3 of the block, limited besides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint
from heatertune.plc.single_precision import LARGEST, divide_single, exponential, single

__all__ = ["COLD", "PidCompactAssumptions", "PidCompactBlock", "PidCompactState", "block_of", "integrated_error",
           "scale_input", "scan", "step"]

#: what stops I at a limit
STOPPED: Final = 0
LATE: Final = 1
LIMITED: Final = 2
CLAMPED: Final = 3

#: which error I takes
NEW: Final = 0
OLD: Final = 1
MEAN: Final = 2

#: how the lag of D is sampled
BACKWARD: Final = 0
TUSTIN: Final = 1
RAMP: Final = 2
STEP: Final = 3

#: IntegralResetMode: what I is when automatic begins
SMOOTH: Final = 0
PRE_ASSIGNED: Final = 3
LIKE_A_STEP: Final = 4


class PidCompactAssumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md."""

    anti_windup: Annotated[int, OpenPoint(
        name="anti_windup", means={"stopped": STOPPED, "late": LATE, "limited": LIMITED, "clamped": CLAMPED},
        reason="how I is stopped at a limit: it makes no step further beyond the limit, judged by the sum of this "
               "cycle (stopped) or of the previous one (late); it is also clamped to the limits (limited); or P + I "
               "is clamped to them (clamped)",
    )] = STOPPED
    integral: Annotated[int, OpenPoint(
        name="integral", means={"backward": NEW, "forward": OLD, "trapezoid": MEAN},
        reason="error that I integrates: that of this cycle, that of the previous one, or the mean of both",
    )] = NEW
    lag: Annotated[int, OpenPoint(
        name="derivative_lag", means={"backward": BACKWARD, "tustin": TUSTIN, "ramp": RAMP, "step": STEP},
        shows=lambda own: own[0].past != 0.0 or own[0].kick != 0.0,
        reason="discretisation of the lag a·TD: the weight of its previous value is a·TD/(a·TD + T), (a·TD − "
               "T/2)/(a·TD + T/2), or exp(−T/(a·TD)), the last exact for a reading that changes linearly (ramp) or "
               "in steps (step)",
    )] = BACKWARD
    zero_history: Annotated[bool, OpenPoint(
        name="history", means={"present": False, "zero": True},
        reason="previous values in the first automatic cycle: its own reading, or zeros, so that D kicks",
    )] = False


class PidCompactBlock(NamedTuple):
    """The words as the block uses them, and what follows from them alone."""

    gain: float  # below 0 where the control is inverted
    p_weight: float
    d_weight: float
    growth: float  # of I per unit of error
    past: float  # α
    kick: float  # β
    upper: float
    lower: float
    begins: int  # IntegralResetMode


class PidCompactState(NamedTuple):
    """What the instance keeps from cycle to cycle; all finite."""

    runs: bool = False
    integral: float = 0.0
    error: float = 0.0
    weighted: float = 0.0  # c·w − x
    derivative: float = 0.0
    above: bool = False  # the sum was at or above the upper limit
    below: bool = False
    invalid: bool = False  # a number was not finite


COLD: Final = PidCompactState()


def block_of(values: Mapping[str, float], assume: PidCompactAssumptions) -> PidCompactBlock:
    """Return the block for its words; total for any of them."""
    gain, cycle = float(values["Gain"]), float(values["Cycle"])
    if values.get("InvertControl", 0):
        gain = -gain
    ti, past, kick = float(values["Ti"]), 0.0, 0.0
    td, ratio = float(values["Td"]), float(values["TdFiltRatio"])
    if td > 0.0:
        past, kick = _lag(assume, single(ratio * td), single(gain * td), cycle)
    return PidCompactBlock(
        gain=gain, p_weight=float(values["PWeighting"]), d_weight=float(values["DWeighting"]),
        growth=divide_single(single(gain * cycle), ti) if ti > 0.0 else 0.0, past=past, kick=kick,
        upper=float(values["OutputUpperLimit"]), lower=float(values["OutputLowerLimit"]),
        begins=int(values["IntegralResetMode"]))


def _lag(assume: PidCompactAssumptions, lag: float, gain_td: float, cycle: float) -> tuple[float, float]:
    """Return α and β for a lag, Kp·TD and a cycle; without a lag D lasts for one cycle, however it is sampled."""
    if assume.lag in (RAMP, STEP):
        past = exponential(-divide_single(cycle, lag))
        if assume.lag == STEP and lag > 0.0:
            return past, divide_single(gain_td, lag)
        return past, single(divide_single(gain_td, cycle) * single(1.0 - past))
    if assume.lag == TUSTIN:
        half = single(0.5 * cycle)
        lag = max(lag, half)
        both = single(lag + half)
        return divide_single(single(lag - half), both), divide_single(gain_td, both)
    both = single(lag + cycle)
    return divide_single(lag, both), divide_single(gain_td, both)


def scale_input(count: int, counts: int, low: float, high: float) -> float:
    """Return the reading of Input_PER, 0 and the highest count being low and high, both REALs [°C]."""
    share = single(float(count) / float(counts))
    return single(single(share * single(high - low)) + low)


def step(
    parameters: tuple[PidCompactBlock, PidCompactAssumptions], state: PidCompactState, setpoint: float, reading: float,
    _begins: bool
) -> tuple[PidCompactState, float, float, int]:
    """Compute one cycle in automatic, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the cycle.
        setpoint: a REAL [°C].
        reading: a REAL [°C].
        _begins: not looked at: a period of the PWM begins with each cycle.
    """
    return _outcome(_cycle(parameters[0], parameters[1], state, setpoint, reading))


def scan(
    parameters: tuple[PidCompactBlock, PidCompactAssumptions], state: PidCompactState, inputs: Mapping[str, float]
) -> tuple[PidCompactState, float, float, int]:
    """Compute one cycle with Setpoint, Input and, where named, Reset, which makes the block inactive."""
    if inputs.get("Reset", 0):
        return COLD, 0.0, 0.0, 0
    return step(parameters, state, inputs["Setpoint"], inputs["Input"], False)


def _outcome(outcome: tuple[PidCompactState, float]) -> tuple[PidCompactState, float, float, int]:
    """Return the state, the output as power, the output, and the flags as bits."""
    after, output = outcome
    bits = int(after.above) + 2 * int(after.below) + 4 * int(after.invalid)
    return after, min(max(output, 0.0), 100.0), output, bits


def _cycle(b: PidCompactBlock, assume: PidCompactAssumptions, s: PidCompactState, setpoint: float,
           reading: float) -> tuple[PidCompactState, float]:
    """Return the state after a cycle, and the output; what is not finite leaves the state and asks for 0."""
    error = single(setpoint - reading)
    weighted = single(single(b.d_weight * setpoint) - reading)
    proportional = single(b.gain * single(single(b.p_weight * setpoint) - reading))
    zero = single(0.0)  # as a number this would be in double precision where it is compiled
    before, error_before, integral = s.weighted, s.error, s.integral
    if not s.runs:
        before, error_before = (zero, zero) if assume.zero_history else (weighted, error)
        integral = _begun(b, error, proportional)
    derivative = single(single(b.past * s.derivative) + single(b.kick * single(weighted - before)))
    change = single(b.growth * integrated_error(assume.integral, error, error_before))
    grown = single(integral + change)
    total = single(single(proportional + grown) + derivative)
    if not (abs(total) <= LARGEST and abs(error) <= LARGEST and abs(weighted) <= LARGEST):
        output = _limited(b, zero)
        return PidCompactState(s.runs, s.integral, s.error, s.weighted, s.derivative, s.above, s.below, True), output
    if not s.runs and b.begins in (SMOOTH, PRE_ASSIGNED) and b.growth != 0.0:
        grown = _within_range(zero, single(zero - single(proportional + derivative)))
        total = single(single(proportional + grown) + derivative)
    elif b.growth != 0.0:
        grown = _limited_integral(b, assume, s, integral, change, total, proportional)
        total = single(single(proportional + grown) + derivative)
    after = PidCompactState(True, grown, error, weighted, derivative, total >= b.upper, total <= b.lower, False)
    return after, _limited(b, total)


def _begun(b: PidCompactBlock, error: float, proportional: float) -> float:
    """Return I as automatic finds it: nothing, or what makes P and I together Kp·b·e."""
    if b.begins != LIKE_A_STEP or b.growth == 0.0:
        return single(0.0)
    return single(single(b.gain * single(b.p_weight * error)) - proportional)


def integrated_error(kind: int, error: float, before: float) -> float:
    """Return the error that I takes, of this cycle, of the one before, or the mean of both."""
    if kind == NEW:
        return error
    return before if kind == OLD else single(0.5 * single(error + before))


def _limited_integral(
    b: PidCompactBlock, assume: PidCompactAssumptions, s: PidCompactState, integral: float, change: float, total: float,
    proportional: float
) -> float:
    """Return I after a cycle, as the limits leave it."""
    grown = single(integral + change)
    if assume.anti_windup == CLAMPED:
        return min(max(grown, single(b.lower - proportional)), single(b.upper - proportional))
    above, below = (s.above, s.below) if assume.anti_windup == LATE else (total > b.upper, total < b.lower)
    if (above and change > 0.0) or (below and change < 0.0):
        grown = integral
    if assume.anti_windup == LIMITED:
        grown = min(max(grown, b.lower), b.upper)
    return grown


def _within_range(old: float, new: float) -> float:
    return new if abs(new) <= LARGEST else old


def _limited(b: PidCompactBlock, value: float) -> float:
    return min(max(value, b.lower), b.upper)

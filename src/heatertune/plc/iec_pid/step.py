"""One call of the repaired block, in single precision, one rounding per operation, in the order of the lines.

    e = SP − PV        D = (3·(e − e₃) + e₁ − e₂)/(10·T)
    I = I + KP·T/TR·e, held so that KP·e + I is within the limits
    XOUT = KP·e + I + KP·(TD·D), held within the limits

T is CYCLE in seconds, e₁…e₃ are the errors of the three calls before. The four points of D are the standard's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint
from heatertune.plc.single_precision import LARGEST, divide_single, single
from heatertune.plc.st.program_text import NANOSECONDS, SECONDS, TENS_OF_MS, time_to_real

__all__ = ["COLD", "IecPidAssumptions", "IecPidConstants", "IecPidInputs", "IecPidState", "block_of", "call",
           "disturbance_step", "scan", "step"]


class IecPidAssumptions(NamedTuple):
    """The open points of the standard, see DIFFERENCES.md."""

    time_unit: Annotated[int, OpenPoint(
        name="time_unit", means={"s": SECONDS, "ten_ms": TENS_OF_MS, "ns": NANOSECONDS},
        reason="unit of TIME_TO_REAL: s (matiec: Beremiz, OpenPLC) or ms (CODESYS), which give the same bits here; "
            "whole tens of ms (FPWIN Pro); ns",
    )] = SECONDS


class IecPidConstants(NamedTuple):
    """The words as the block uses them, what follows from them alone, and the boost of the program around it."""

    kp: float
    tr: float
    td: float
    minimum: float
    maximum: float
    growth: float  # of the I part per °C, KP·T/TR
    ten_t: float  # 10·T
    within: float = math.inf  # see `heatertune.plc.ramp.Boost`; infinite: there is none
    again: float = math.inf


class IecPidInputs(NamedTuple):
    """What one call reads."""

    sp: float
    pv: float
    x0: float = 0.0
    auto: bool = True
    run: bool = True


class IecPidState(NamedTuple):
    """What the instance keeps from call to call; all finite."""

    begun: bool = False
    e1: float = 0.0
    e2: float = 0.0
    e3: float = 0.0
    integral: float = 0.0  # I part, %
    output: float = 0.0
    overflow: bool = False  # a number of the last call was not finite


COLD: Final = IecPidState()


def step(
    parameters: tuple[IecPidConstants, IecPidAssumptions], state: IecPidState, setpoint: float, feedback: float,
    _begins: bool
) -> tuple[IecPidState, float, float, int]:
    """Compute one scan, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: SP, a REAL, °C.
        feedback: PV, a REAL, °C.
        _begins: not looked at: the PWM is behind the output.
    """
    automatic = IecPidInputs(setpoint, feedback, setpoint, True, True)  # X0: nothing, but a REAL like the others
    return _scanned(parameters[0], state, automatic)


def disturbance_step(
    parameters: tuple[IecPidConstants, IecPidAssumptions], state: IecPidState, setpoint: float, feedback: float,
    begins: bool, disturbance_pct: float,
) -> tuple[IecPidState, float, float, int]:
    """Compute one scan with a disturbance variable, see `heatertune.plc.core.StepFunctions`.

    The program takes it from XMIN and XMAX and adds it to XOUT, so that the sum is what the block limits.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: SP, a REAL, °C.
        feedback: PV, a REAL, °C.
        begins: not looked at: the PWM is behind the output.
        disturbance_pct: a REAL [%].
    """
    b = parameters[0]
    least, most = single(b.minimum - disturbance_pct), single(b.maximum - disturbance_pct)
    block = IecPidConstants(b.kp, b.tr, b.td, least, most, b.growth, b.ten_t, b.within, b.again)
    after, _, output, bits = step((block, parameters[1]), state, setpoint, feedback, begins)
    total = single(output + disturbance_pct)
    return after, min(max(total, 0.0), 100.0), total, bits


def scan(
    parameters: tuple[IecPidConstants, IecPidAssumptions], state: IecPidState, inputs: Mapping[str, float]
) -> tuple[IecPidState, float, float, int]:
    """Compute one scan with SP, PV and, where named, X0, AUTO and RUN."""
    block_inputs = IecPidInputs(
        inputs["SP"], inputs["PV"], inputs.get("X0", 0.0), bool(inputs.get("AUTO", 1)), bool(inputs.get("RUN", 1)),
    )
    return _scanned(parameters[0], state, block_inputs)


def block_of(values: Mapping[str, float], assume: IecPidAssumptions) -> IecPidConstants:
    """Return the block for its words; total for any of them."""
    kp, tr = float(values["KP"]), float(values["TR"])
    cycle, second = (time_to_real(int(ms), assume.time_unit) for ms in (values["CYCLE"], 1000))
    t = divide_single(cycle, second)
    return IecPidConstants(
        kp=kp, tr=tr, td=float(values["TD"]), minimum=float(values["XMIN"]), maximum=float(values["XMAX"]),
        growth=divide_single(single(kp * t), tr) if tr != 0.0 else 0.0, ten_t=single(10.0 * t),
    )


def call(b: IecPidConstants, s: IecPidState, x: IecPidInputs) -> IecPidState:
    """Return the state after one call; total for all inputs.

    An error that is not finite (a broken sensor, an overflow) leaves the memory as it was and, but by hand, asks for
    the lower limit.
    """
    if not x.run:
        return IecPidState(False, s.e1, s.e2, s.e3, s.integral, single(0.0), False)
    error = single(x.sp - x.pv)
    if not abs(error) <= LARGEST:
        safe_output = b.minimum if x.auto else _limited(b, x.x0)
        return IecPidState(s.begun, s.e1, s.e2, s.e3, s.integral, safe_output, True)
    if not s.begun:
        s = IecPidState(True, error, error, error, single(0.0), s.output, False)
    proportional = single(b.kp * error)
    if x.auto:
        return _automatic(b, s, error, proportional)
    output = _limited(b, x.x0)
    integral = _within_range(s.integral, single(output - proportional)) if b.tr != 0.0 else single(0.0)
    return IecPidState(True, error, error, error, integral, output, False)


def _automatic(b: IecPidConstants, s: IecPidState, error: float, proportional: float) -> IecPidState:
    integral = single(0.0)
    if b.tr != 0.0:
        total = single(s.integral + single(b.growth * error))
        lowest, highest = single(b.minimum - proportional), single(b.maximum - proportional)
        if total < lowest:  # noqa: PLR1730 - what is no number stays none, compiled or not
            total = lowest
        if total > highest:  # noqa: PLR1730
            total = highest
        integral = _within_range(s.integral, total)
    demand = single(proportional + integral)
    if b.td != 0.0:
        slope = divide_single(single(single(single(3.0 * single(error - s.e3)) + s.e1) - s.e2), b.ten_t)
        demand = single(demand + single(b.kp * single(b.td * slope)))
    finite = abs(demand) <= LARGEST
    return IecPidState(True, error, s.e1, s.e2, integral, _limited(b, demand), not finite)


def _scanned(b: IecPidConstants, state: IecPidState, x: IecPidInputs) -> tuple[IecPidState, float, float, int]:
    """Return the state, the output as power, the output, and the flags as bits."""
    boosts = _boosts(b, state, x)
    after = call(b, state, IecPidInputs(x.sp, x.pv, x.x0, x.auto, x.run and not boosts))
    output = b.maximum if boosts else after.output
    bits = int(output >= b.maximum) + 2 * int(output <= b.minimum) + 4 * int(after.overflow)
    return after, min(max(output, 0.0), 100.0), output, bits


def _boosts(b: IecPidConstants, s: IecPidState, x: IecPidInputs) -> bool:
    """Return whether the program leaves RUN FALSE and gives full power itself; an error without end is no reason to."""
    away = single(x.pv - x.sp) if b.kp < 0.0 else single(x.sp - x.pv)
    far = away > (b.again if s.begun or s.overflow else b.within)  # overflow: RUN was TRUE, at no number
    return far and away <= LARGEST and x.run and x.auto


def _limited(b: IecPidConstants, value: float) -> float:
    """Return the value within the limits; what is not a number is the lower one: the heater goes off."""
    if not value >= b.minimum:
        return b.minimum
    return b.maximum if value > b.maximum else value


def _within_range(old: float, new: float) -> float:
    return new if abs(new) <= LARGEST else old

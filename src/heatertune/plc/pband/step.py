"""One sample of an instrument, as its parameters are commonly explained; what no manual prints is a switch.

    u = K·(e + D) + I        I(k) = I(k−1) + K·TA/TN·e(k)        D(k) = D(k−1) + TA/(TF + TA)·(TV/TA·Δ − D(k−1))

e is the setpoint minus the reading, Δ the change of −reading or of e since the last sample, TF a part of TV. The
setpoint of a 2-PID goes through (1 + α·TN·s)/(1 + TN·s).
"""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint

__all__ = ["COLD", "PbandAssumptions", "PbandBlock", "PbandState", "step"]

#: what becomes of the I part while the output is limited
HOLD: Final = 0
WITHIN: Final = 1
OUTSIDE: Final = 2

#: of the I part in 32 bits: 100 % are below 2³¹ of them
_PARTS: Final = float(1 << 24)
_MOST: Final = 127.0  # [%]


class PbandAssumptions(NamedTuple):
    """The open points of the manuals, see DIFFERENCES.md."""

    anti_windup: Annotated[int, OpenPoint(
        name="anti_windup", means={"held": HOLD, "tracking": WITHIN, "outside_band": OUTSIDE},
        shows=lambda own: own[0].growth != 0.0,
        reason="I at a limit: it stops integrating in that direction; it is adjusted so that K·e + I stays within "
               "the limits; or it is zero while the reading is outside the proportional band",
    )] = HOLD
    on_error: Annotated[bool, OpenPoint(
        name="derivative", means={"reading": False, "error": True}, shows=lambda own: own[0].slope != 0.0,
        reason="whether D acts on the reading alone, or on the error, including setpoint steps",
    )] = False
    slow: Annotated[bool, OpenPoint(
        name="derivative_lag", means={"eighth": False, "quarter": True}, shows=lambda own: own[0].slope != 0.0,
        reason="time constant of the derivative's filter: TV/8 or TV/4",
    )] = False
    filtered: Annotated[bool, OpenPoint(
        name="setpoint", means={"as_it_is": False, "filtered": True}, shows=lambda own: own[0].follows > 0.0,
        reason="whether the setpoint passes through the filter of a 2-PID, which starts at the first reading; α as "
               "in the parameters, or 0.65 if they have none",
    )] = False
    whole: Annotated[bool, OpenPoint(
        name="arithmetic", means={"float": False, "integer": True},
        reason="floating point; or I in 32 bits, truncated to steps of 100 %/(100·2^24), and the output in steps of "
               "0.1 %",
    )] = False
    displayed: Annotated[bool, OpenPoint(
        name="reading", means={"fine": False, "display": True}, shows=lambda own: own[0].tenth > 1.0,
        reason="whether the controller uses the full resolution of the input, or setpoint and reading rounded to "
               "0.1 °C as displayed",
    )] = False


class PbandBlock(NamedTuple):
    """The words as a sample uses them; temperatures in counts of the reading."""

    gain: float  # [% per count]
    growth: float  # TA/TN, 0: no I part
    slope: float  # TV/TA
    share: float  # of the way that D goes in one sample
    high: float  # [%]
    least: float  # without pulses below it [%]
    band: float
    approach: float  # D acts within it
    alpha: float
    follows: float  # share of the way that the setpoint's filter goes in one sample
    tenth: float  # 0.1 °C


class PbandState(NamedTuple):
    """What the instrument keeps from sample to sample."""

    runs: bool = False
    last: float = 0.0  # −reading or error
    led: float = 0.0  # the setpoint's filter
    derivative: float = 0.0
    integral: float = 0.0  # [%]


COLD: Final = PbandState()


def step(
    parameters: tuple[PbandBlock, PbandAssumptions], state: PbandState, setpoint: int, reading: int, _begins: bool
) -> tuple[PbandState, float, float, int]:
    """Compute one sample, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the sample.
        setpoint: in counts.
        reading: in counts.
        _begins: not looked at: the sample that comes last before a pulse decides on it.
    """
    b, assume = parameters
    w, x = _displayed_value(b, assume, setpoint), _displayed_value(b, assume, reading)
    led = state.led + b.follows * (w - state.led) if state.runs else x
    if assume.filtered and b.follows > 0.0:
        w = b.alpha * w + (1.0 - b.alpha) * led
    error = w - x
    now = error if assume.on_error else -x
    raw = b.slope * (now - state.last) if state.runs else 0.0
    derivative = state.derivative + b.share * (raw - state.derivative)
    acting = derivative if abs(error) <= b.approach else 0.0
    proportional = b.gain * error
    integral = _integral(b, assume, state.integral, proportional, b.gain * acting, error)
    power = proportional + b.gain * acting + integral
    if assume.whole:
        power = math.floor(10.0 * power + 0.5) / 10.0
    power = min(max(power, 0.0), b.high)
    bits = int(power >= b.high) + 2 * int(power <= 0.0)
    if b.least > 0.0:
        power = 0.0 if power < b.least else 100.0 if power > 100.0 - b.least else power
    return PbandState(True, now, led, derivative, integral), power, power, bits


def _displayed_value(b: PbandBlock, assume: PbandAssumptions, counts: int) -> float:
    """Return a number of counts as the law sees it."""
    if assume.displayed and b.tenth > 1.0:
        return b.tenth * math.floor(counts / b.tenth + 0.5)
    return float(counts)


def _integral(
    b: PbandBlock, assume: PbandAssumptions, before: float, proportional: float, derivative: float, error: float
) -> float:
    """Return the I part after a sample [%]."""
    if b.growth == 0.0:
        return 0.0
    grown = before + proportional * b.growth
    if assume.whole:
        grown = float(int(min(max(grown, -_MOST), _MOST) * _PARTS)) / _PARTS
    if assume.anti_windup == OUTSIDE:
        if abs(error) >= b.band:
            return 0.0
        return min(max(grown, -b.high), b.high)
    if assume.anti_windup == WITHIN:
        return min(max(grown, -proportional), b.high - proportional)
    demand = proportional + derivative + grown
    if (demand > b.high and grown > before) or (demand < 0.0 and grown < before):
        return before
    return grown

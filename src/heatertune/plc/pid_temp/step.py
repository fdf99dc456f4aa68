"""One cycle of PID_Temp: heating alone it is PID_Compact's, so that one compiled loop runs both; and with cooling.

A block that cools, too, has two sets of parameters: heating's, and cooling's, which is Cool.* (AdvancedCooling 1) or
heating's with Gain·CoolFactor (0; the manual's table of the equation has CoolFactor at Kp). A cycle takes one of them:

    P = Kp·(b·w − x)     D_k = α·D_{k−1} + β·((c·w − x)_k − (c·w − x)_{k−1})     y = (P + share of I) + Kp·D

Which one, and what of I stays where it changes, is open (see `CoolingAssumptions`); D is kept before Kp. y below 0 goes
to OutputCool.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint, open_points_of
from heatertune.plc.pid_compact.step import (
    CLAMPED,
    COLD,
    LATE,
    LIKE_A_STEP,
    LIMITED,
    PRE_ASSIGNED,
    SMOOTH,
    PidCompactAssumptions,
    PidCompactBlock,
    block_of,
    integrated_error,
    scan,
    step,
)
from heatertune.plc.single_precision import LARGEST, single

__all__ = [
    "COLD", "COLD_PAIR", "CoolingAssumptions", "Pair", "PairState", "PidCompactAssumptions", "block_of", "cooling_gain",
    "cooling_words", "pair_of", "pair_scan", "pair_step", "scan", "step",
]

_OPEN: Final = open_points_of(PidCompactAssumptions)

#: which set of parameters acts
NOW: Final = 0
OUTPUT: Final = 1
BOTH: Final = 2


class CoolingAssumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md: `Assumptions`, and those of cooling."""

    anti_windup: Annotated[int, _OPEN["anti_windup"]] = 0
    integral: Annotated[int, _OPEN["integral"]] = 0
    lag: Annotated[int, replace(
        _OPEN["lag"], shows=lambda own: any(block.past != 0.0 or block.kick != 0.0 for block in own[0][:2])
    )] = 0
    zero_history: Annotated[bool, _OPEN["zero_history"]] = False
    cools: Annotated[int, OpenPoint(
        name="parameter_set", means={"now": NOW, "output": OUTPUT, "both": BOTH},
        reason="how the block selects the parameter set: by this cycle's sum with the heating set, recalculated "
               "with the cooling set if negative (now); by the output of the previous cycle, or the control "
               "deviation if that is 0 (output); or only when both output and deviation have changed sign (both)",
    )] = NOW
    before_gain: Annotated[bool, OpenPoint(
        name="integral_kept", means={"percent": False, "error": True},
        reason="what is kept of I when the set changes: its contribution to the output (percent), or its value "
               "before the multiplication by Kp (error)",
    )] = False


class Pair(NamedTuple):
    """Both sets as the block uses them, each for Kp = 1, and their Kp."""

    heat: PidCompactBlock
    cool: PidCompactBlock
    heat_gain: float
    cool_gain: float


class PairState(NamedTuple):
    """What the instance keeps from cycle to cycle; all finite."""

    runs: bool = False
    integral: float = 0.0
    derivative: float = 0.0
    setpoint: float = 0.0
    reading: float = 0.0
    output: float = 0.0
    cools: bool = False
    above: bool = False  # the sum was at or above the upper limit
    below: bool = False
    invalid: bool = False  # a number was not finite


COLD_PAIR: Final = PairState()


def cooling_words(values: Mapping[str, float]) -> dict[str, float]:
    """Return cooling's set by the names of heating's, as AdvancedCooling has it."""
    if not values["AdvancedCooling"]:
        return dict(values) | {"Gain": cooling_gain(values)}
    own = {name: values[f"Cool{name}"] for name in ("Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle")}
    return dict(values) | own | {"Gain": cooling_gain(values)}


def cooling_gain(values: Mapping[str, float]) -> float:
    """Return Kp of cooling, a REAL."""
    if values["AdvancedCooling"]:
        return float(values["CoolGain"])
    return single(float(values["Gain"]) * float(values["CoolFactor"]))


def pair_of(values: Mapping[str, float], assume: CoolingAssumptions) -> Pair:
    """Return the block for its words; total for any of them."""
    plain = PidCompactAssumptions(assume.anti_windup, assume.integral, assume.lag, assume.zero_history)
    heat, cool = (block_of(words | {"Gain": 1.0}, plain) for words in (dict(values), cooling_words(values)))
    return Pair(heat, cool, float(values["Gain"]), cooling_gain(values))


def pair_step(
    parameters: tuple[Pair, CoolingAssumptions], state: PairState, setpoint: float, reading: float, _begins: bool
) -> tuple[PairState, float, float, int]:
    """Compute one cycle in automatic; the power is −100…100 %.

    Args:
        parameters: the block's, and the assumptions.
        state: before the cycle.
        setpoint: a REAL [°C].
        reading: a REAL [°C].
        _begins: not looked at: a period of the PWM begins with each cycle.
    """
    after, output = _cycle(parameters[0], parameters[1], state, setpoint, reading)
    bits = int(after.above) + 2 * int(after.below) + 4 * int(after.invalid)
    return after, min(max(output, -100.0), 100.0), output, bits


def pair_scan(
    parameters: tuple[Pair, CoolingAssumptions], state: PairState, inputs: Mapping[str, float]
) -> tuple[PairState, float, float, int]:
    """Compute one cycle with Setpoint, Input and, where named, Reset, which makes the block inactive."""
    if inputs.get("Reset", 0):
        return COLD_PAIR, 0.0, 0.0, 0
    return pair_step(parameters, state, inputs["Setpoint"], inputs["Input"], False)


def _cycle(
    p: Pair, assume: CoolingAssumptions, s: PairState, setpoint: float, reading: float
) -> tuple[PairState, float]:
    cools = _decided(assume, s, single(setpoint - reading))
    total, integral, derivative = _summed(p, assume, s, setpoint, reading, cools)
    if assume.cools == NOW and total < 0.0:
        cools = True
        total, integral, derivative = _summed(p, assume, s, setpoint, reading, cools)
    if not (abs(total) <= LARGEST and abs(integral) <= LARGEST and abs(derivative) <= LARGEST):
        return PairState(s.runs, s.integral, s.derivative, s.setpoint, s.reading, s.output, s.cools, s.above, s.below,
                         True), single(0.0)
    output = min(max(total, p.heat.lower), p.heat.upper)
    return PairState(True, integral, derivative, setpoint, reading, output, cools, total >= p.heat.upper,
                     total <= p.heat.lower, False), output


def _decided(assume: CoolingAssumptions, s: PairState, error: float) -> bool:
    """Return whether cooling's set acts, by what is known before this cycle's sum."""
    if assume.cools == OUTPUT:
        return s.output < 0.0 or (s.output == 0.0 and error < 0.0)
    if assume.cools == BOTH:
        return not (s.output >= 0.0 and error > 0.0) if s.cools else s.output <= 0.0 and error < 0.0
    return False


def _summed(
    p: Pair, assume: CoolingAssumptions, s: PairState, setpoint: float, reading: float, cools: bool
) -> tuple[float, float, float]:
    """Return the sum of a cycle with one of the sets, I and D."""
    b, gain = (p.cool, p.cool_gain) if cools else (p.heat, p.heat_gain)
    error, zero = single(setpoint - reading), single(0.0)
    last_setpoint, last_reading = s.setpoint, s.reading
    if not s.runs:
        last_setpoint, last_reading = (zero, zero) if assume.zero_history else (setpoint, reading)
    weighted = single(single(b.d_weight * setpoint) - reading)
    before = single(single(b.d_weight * last_setpoint) - last_reading)
    proportional = single(gain * single(single(b.p_weight * setpoint) - reading))
    derivative = single(single(b.past * s.derivative) + single(b.kick * single(weighted - before)))
    slope = single(gain * derivative)
    # I in the sum is share·I: the gain is in I's growth, or before it
    share, growth = (gain, b.growth) if assume.before_gain else (single(1.0), single(gain * b.growth))
    if growth == 0.0 or share == 0.0:
        return single(proportional + slope), zero, derivative
    integral = s.integral if s.runs else _begun(b, gain, share, error, proportional)
    change = single(growth * integrated_error(assume.integral, error, single(last_setpoint - last_reading)))
    grown = single(integral + change)
    total = single(single(proportional + single(share * grown)) + slope)
    if not s.runs and b.begins in (SMOOTH, PRE_ASSIGNED):
        grown = _shared(single(zero - single(proportional + slope)), share)
    else:
        grown = _limited_integral(b, assume, s, integral, change, total, proportional, share)
    return single(single(proportional + single(share * grown)) + slope), grown, derivative


def _begun(b: PidCompactBlock, gain: float, share: float, error: float, proportional: float) -> float:
    """Return I as automatic finds it: nothing, or what makes P and I together Kp·b·e."""
    if b.begins != LIKE_A_STEP:
        return single(0.0)
    return _shared(single(single(gain * single(b.p_weight * error)) - proportional), share)


def _limited_integral(
    b: PidCompactBlock, assume: CoolingAssumptions, s: PairState, integral: float, change: float, total: float,
    proportional: float, share: float,
) -> float:
    """Return I after a cycle, as the limits leave it; the share is above 0."""
    grown = single(integral + change)
    if assume.anti_windup == CLAMPED:
        return min(max(grown, _shared(single(b.lower - proportional), share)),
                   _shared(single(b.upper - proportional), share))
    above, below = (s.above, s.below) if assume.anti_windup == LATE else (total > b.upper, total < b.lower)
    if (above and change > 0.0) or (below and change < 0.0):
        grown = integral
    if assume.anti_windup == LIMITED:
        grown = min(max(grown, _shared(b.lower, share)), _shared(b.upper, share))
    return grown


def _shared(part: float, share: float) -> float:
    """Return I whose part of the sum that is; the share is above 0."""
    return single(part / share)

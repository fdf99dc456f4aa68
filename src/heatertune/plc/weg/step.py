"""One call of the block, in single precision, one rounding per operation, in the order of the lines.

Academic form (WEG, CFW501 programming manual V1.8x, external PID; the SCA06's own picture is lost):

    u(k) = i(k−1) + Kp·[(1 + Ki·Ts + Kd/Ts)·e(k) − (Kd/Ts)·e(k−1)]        i(k) = i(k−1) + Kp·Ki·Ts·e(k)

Parallel form, by analogy:

    u(k) = i(k−1) + [(Kp + Ki·Ts + Kd/Ts)·e(k) − (Kd/Ts)·e(k−1)]          i(k) = i(k−1) + Ki·Ts·e(k)

e(k) is the filtered setpoint minus Feedback, or the reverse; Ts in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint, never
from heatertune.plc.single_precision import LARGEST, divide_single, exponential, single

__all__ = ["BLOCK", "CALLER", "CLAMP", "COLD", "FREEZE", "SKIPPED", "WegAssumptions", "WegConstants", "WegInputs",
           "WegState", "block_of", "call", "made_of", "scan", "step"]

#: what becomes of the integral part while Output is at a limit
CLAMP: Final = 0
FREEZE: Final = 1
SUM_ON: Final = 2

#: who keeps Ts: the caller; the block, which loses calls that come each Ts; the block, called each scan
CALLER: Final = 0
SKIPPED: Final = 1
BLOCK: Final = 2


class WegAssumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md."""

    anti_windup: Annotated[int, OpenPoint(
        name="anti_windup", means={"clamp": CLAMP, "freeze": FREEZE, "none": SUM_ON},
        reason="i at a limit: adjusted so that Kp·e + i stays within the limits; frozen; or still integrated",
    )] = CLAMP
    manual_unlimited: Annotated[bool, OpenPoint(
        name="manual", means={"limited": False, "unlimited": True}, shows=never,
        reason="whether ManualSetPoint is limited to MinimumOutput…MaximumOutput",
    )] = False
    bumpless: Annotated[bool, OpenPoint(
        name="manual_return", means={"held": False, "bumpless": True}, shows=never,
        reason="while ManualSetPoint is the output: filter, e(k−1) and i are frozen, or they track, with i = Output "
               "− Kp·e",
    )] = False
    exact_filter: Annotated[bool, OpenPoint(
        name="filter", means={"implicit": False, "exact": True}, shows=lambda own: own[0].share != 1.0,
        reason="weight of the new value per call: Ts/(Tau + Ts), or 1 − exp(−Ts/Tau)",
    )] = False
    by_parts: Annotated[bool, OpenPoint(
        name="order", means={"as_printed": False, "by_parts": True},
        reason="order of the rounded operations: the printed parentheses, or (P + I) + D",
    )] = False
    runs_at_once: Annotated[bool, OpenPoint(
        name="edge", means={"output_zero": False, "runs_at_once": True},
        reason="whether the scan with the positive edge of EN ends with Output zero, or calculates Output",
    )] = False
    zero_history: Annotated[bool, OpenPoint(
        name="history", means={"present": False, "zero": True},
        reason="at this edge: filter at SetPoint and e(k−1) = e(k), or both zero; i is zero in either case",
    )] = False
    sampling: Annotated[int, OpenPoint(
        name="sampling", means={"caller": CALLER, "skipped": SKIPPED, "block": BLOCK}, summary=("skipped", "block"),
        reason="who keeps Ts: the caller; or the block, which is called each scan (block) or may skip every second "
               "call of a program that calls it each Ts (skipped). The exported program detects this and then calls "
               "the block each scan",
    )] = CALLER


class WegConstants(NamedTuple):
    """The words as the block uses them, what follows from them alone, and the boost of the program around it."""

    kp: float
    minimum: float
    maximum: float
    parallel: bool
    reverse: bool
    share: float  # of the way to SetPoint that the filter goes in one call
    ki_ts: float
    kd_by_ts: float
    now: float  # factor of e(k) in the bracket
    growth: float  # of the integral part per unit of e(k)
    within: float = math.inf  # see `heatertune.plc.ramp.Boost`; infinite: there is none
    again: float = math.inf


class WegInputs(NamedTuple):
    """What one call reads."""

    setpoint: float
    feedback: float
    manual: float = 0.0
    select_manual: bool = False
    enable: bool = True


class WegState(NamedTuple):
    """What the instance keeps from call to call; all finite."""

    enabled: bool = False
    reference: float = 0.0  # filtered setpoint
    error: float = 0.0  # e(k−1)
    integral: float = 0.0  # i(k−1)
    output: float = 0.0
    overflow: bool = False  # a number of the last call was not finite
    skips: bool = False  # the next call comes too early for a block that keeps Ts


COLD: Final = WegState()


def step(
    parameters: tuple[WegConstants, WegAssumptions], state: WegState, setpoint: float, feedback: float, _begins: bool
) -> tuple[WegState, float, float, int]:
    """Compute one scan, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: a REAL, in the unit of the sensor's range.
        feedback: a REAL, in the unit of the sensor's range.
        _begins: not looked at: the PWM is behind the output.
    """
    automatic = WegInputs(setpoint, feedback, setpoint, False, True)  # by hand: nothing, but a REAL like the others
    return _scanned(parameters[0], parameters[1], state, automatic)


def scan(
    parameters: tuple[WegConstants, WegAssumptions], state: WegState, inputs: Mapping[str, float]
) -> tuple[WegState, float, float, int]:
    """Compute one scan with SetPoint, Feedback and, where named, ManualSetPoint, SelectSetPoint and EN."""
    block, assume = parameters
    block_inputs = WegInputs(
        inputs["SetPoint"], inputs["Feedback"], inputs.get("ManualSetPoint", 0.0),
        bool(inputs.get("SelectSetPoint", 0)), bool(inputs.get("EN", 1)),
    )
    return _scanned(block, assume, state, block_inputs)


def _scanned(b: WegConstants, assume: WegAssumptions, state: WegState, x: WegInputs) -> tuple[WegState, float, float,
                                                                                              int]:
    """Return the state, the output as power, the output, and the flags as bits."""
    boosts = _boosts(b, state, x)
    after = call(b, assume, state,
                 WegInputs(x.setpoint, x.feedback, x.manual, x.select_manual, x.enable and not boosts))
    return _outcome(b, after, b.maximum if boosts else after.output)


def _outcome(b: WegConstants, after: WegState, output: float) -> tuple[WegState, float, float, int]:
    """Return the state, an output as power, the output, and the flags as bits."""
    bits = int(output >= b.maximum) + 2 * int(output <= b.minimum) + 4 * int(after.overflow)
    return after, min(max(output, 0.0), 100.0), output, bits


def _boosts(b: WegConstants, s: WegState, x: WegInputs) -> bool:
    """Return whether the program leaves EN FALSE and gives full power itself; an error without end is no reason to."""
    away = single(x.feedback - x.setpoint) if b.reverse else single(x.setpoint - x.feedback)
    far = away > (b.again if s.enabled or s.overflow else b.within)  # overflow: EN was TRUE, at no number
    return far and away <= LARGEST and x.enable and not x.select_manual


def block_of(values: Mapping[str, float], assume: WegAssumptions) -> WegConstants:
    """Return the block for its words; total for any of them."""
    v = {name: float(value) for name, value in values.items()}  # a REAL may be given as a whole number
    return made_of(v["Kp"], v["Ki"], v["Kd"], v["TauSetPoint"], v["MinimumOutput"], v["MaximumOutput"], v["Ts"],
                   v["Type"] != 0.0, v["Action"] != 0.0, assume)


def made_of(  # noqa: PLR0913 - the words, as a compiler takes them
    kp: float, ki: float, kd: float, tau: float, minimum: float, maximum: float, ts_ms: float, parallel: bool,
    reverse: bool, assume: WegAssumptions,
) -> WegConstants:
    """Return the same of the words one by one.

    Args:
        kp: Kp.
        ki: Ki.
        kd: Kd.
        tau: TauSetPoint [s].
        minimum: MinimumOutput [%].
        maximum: MaximumOutput [%].
        ts_ms: Ts [ms].
        parallel: whether Type is the parallel form.
        reverse: whether Action is reverse.
        assume: of what the manual leaves open.
    """
    ts = single(divide_single(ts_ms, 1000.0))
    ki_ts, kd_by_ts = single(ki * ts), single(divide_single(kd, ts))
    return WegConstants(
        kp=kp, minimum=minimum, maximum=maximum, parallel=parallel, reverse=reverse,
        share=single(_exact_share(ts, tau) if assume.exact_filter else divide_single(ts, single(tau + ts))),
        ki_ts=ki_ts, kd_by_ts=kd_by_ts, now=single(single((kp if parallel else single(1.0)) + ki_ts) + kd_by_ts),
        growth=ki_ts if parallel else single(kp * ki_ts), within=single(math.inf), again=single(math.inf),
    )


def call(b: WegConstants, assume: WegAssumptions, state: WegState, x: WegInputs) -> WegState:
    """Return the state after one call; total for all inputs.

    An error that is not finite (a broken sensor, an overflow) leaves the memory as it was and, but for manual, asks for
    the lower limit.
    """
    if assume.sampling != SKIPPED:
        return _computed(b, assume, state, x)
    if x.enable and state.skips:
        return _turned(state, False)
    return _turned(_computed(b, assume, state, x), x.enable)


def _turned(s: WegState, skips: bool) -> WegState:
    return WegState(s.enabled, s.reference, s.error, s.integral, s.output, s.overflow, skips)


def _computed(b: WegConstants, assume: WegAssumptions, state: WegState, x: WegInputs) -> WegState:
    if not x.enable:
        return WegState(False, state.reference, state.error, state.integral, state.output, False, False)
    starts = not state.enabled
    before = _begun(assume, x) if starts else state
    reference = single(before.reference + single(b.share * single(x.setpoint - before.reference)))
    error = single(x.feedback - reference) if b.reverse else single(reference - x.feedback)
    forced = _forced(b, assume, x.manual)
    if not math.isfinite(error):
        output = forced if x.select_manual else b.minimum
        return WegState(state.enabled, state.reference, state.error, state.integral, output, True, False)
    if starts and not assume.zero_history:
        before = WegState(before.enabled, before.reference, error, before.integral, before.output, before.overflow,
                          False)
    if starts and not assume.runs_at_once:
        return before
    if x.select_manual:
        return _manual(b, assume, before, forced, reference, error)
    return _automatic(b, assume, before, reference, error)


def _begun(assume: WegAssumptions, x: WegInputs) -> WegState:
    """Return the memory at a positive edge of EN: Output and the integral part zero."""
    zero = single(0.0)  # as a number this would be in double precision where it is compiled
    return WegState(True, zero if assume.zero_history else x.setpoint, zero, zero, zero, False, False)


def _forced(b: WegConstants, assume: WegAssumptions, setpoint_degC: float) -> float:
    free = assume.manual_unlimited and math.isfinite(setpoint_degC)
    return setpoint_degC if free else _limited(b, setpoint_degC)


def _manual(b: WegConstants, assume: WegAssumptions, s: WegState, output: float, reference: float,
            error: float) -> WegState:
    """Leave the memory as it is, or lead it so that the return to automatic is without a bump."""
    if not assume.bumpless:
        return WegState(s.enabled, s.reference, s.error, s.integral, output, False, False)
    integral = single(output - single(b.kp * error))
    return WegState(s.enabled, reference, error, _valid(s.integral, integral), output, False, False)


def _automatic(b: WegConstants, assume: WegAssumptions, s: WegState, reference: float, error: float) -> WegState:
    growth = single(b.growth * error)
    demand = _by_parts(b, s, error, growth) if assume.by_parts else _as_printed(b, s, error)
    output = _limited(b, demand)
    integral = single(s.integral + growth)
    if output != demand and assume.anti_windup == FREEZE:
        integral = s.integral
    elif assume.anti_windup == CLAMP and b.ki_ts != 0.0:  # without Ki, nothing would lead it on again
        proportional = single(b.kp * error)
        lowest, highest = single(b.minimum - proportional), single(b.maximum - proportional)
        integral = min(max(integral, lowest), highest)
    return WegState(s.enabled, reference, error, _valid(s.integral, integral), output, not math.isfinite(demand), False)


def _as_printed(b: WegConstants, s: WegState, error: float) -> float:
    bracket = single(single(b.now * error) - single(b.kd_by_ts * s.error))
    return single(s.integral + (bracket if b.parallel else single(b.kp * bracket)))


def _by_parts(b: WegConstants, s: WegState, error: float, growth: float) -> float:
    proportional = single(b.kp * error)
    derivative = single(b.kd_by_ts * single(error - s.error))
    if not b.parallel:
        derivative = single(b.kp * derivative)
    return single(single(proportional + single(s.integral + growth)) + derivative)


def _limited(b: WegConstants, value: float) -> float:
    """Return the value within the limits; what is not a number is the lower one: the heater goes off."""
    if not value >= b.minimum:
        return b.minimum
    return b.maximum if value > b.maximum else value


def _valid(old: float, new: float) -> float:
    return new if math.isfinite(new) else old


def _exact_share(ts: float, tau: float) -> float:
    """Return 1 − exp(−Ts/Tau)."""
    return single(1.0 - exponential(-divide_single(ts, tau)))

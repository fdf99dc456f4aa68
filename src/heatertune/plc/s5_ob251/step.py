"""One call of OB251, in the order of the manual (S5-115U, section 11.2.3).

    XW_k = W_k − X_k                         U = XW, or XZ where STEU bit 1 is set
    dP_k = R·(XW_k − XW_{k−1})
    dI_k = TI·XW_k
    dD_k = ½·(TD·(U_k − 2U_{k−1} + U_{k−2}) + dD_{k−1})
    dY_k = K·(dP_k + dI_k + dD_k) + (Z_k − Z_{k−1}, where STEU bit 5 is not set)

The ½ was lost in the scans of the manual; without it D would never decay. All words are multiples of 1/1024 or whole,
so IEEE doubles hold every sum exactly but for dD, whose halving runs out of digits after some fifty calls.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint

__all__ = [
    "AUTO", "COLD", "FULL_SCALE", "GESCHW", "HANDART", "NO_Z", "REG_AUS", "XZ_EIN", "Ob251Assumptions",
    "Ob251Parameters", "Ob251State", "call", "percent", "scan", "start_up", "step",
]

#: units at the upper end of the sensor range and at full power
FULL_SCALE: Final = 2047

#: bits of the control word STEU (table 11-10)
AUTO: Final = 1
XZ_EIN: Final = 2
REG_AUS: Final = 4
GESCHW: Final = 8
HANDART: Final = 16
NO_Z: Final = 32

_APPROACH = 4  # calls in which a position controller reaches YH


class Ob251Parameters(NamedTuple):
    """The words of the controller DB as the algorithm uses them; limits and inputs are whole units."""

    gain: float  # K·R is the proportional part
    r: float
    ti: float
    td: float
    steu: int
    manual: int  # YH
    upper: int  # BGOG
    lower: int  # BGUG
    z: int = 0  # Z, where the program writes it


class Ob251Assumptions(NamedTuple):
    """The open points of the manual, see DIFFERENCES.md."""

    sum_is_limited: Annotated[bool, OpenPoint(
        name="sum", means={"unlimited": False, "limited": True},
        reason="whether Y_{k−1} is kept before or after the limiter; the 928B's DB keeps it before",
    )] = False
    flag_of_same_call: Annotated[bool, OpenPoint(
        name="integral_off", means={"previous_call": False, "same_call": True},
        reason="whether the limit of the previous call or of the same call switches the integral action off",
    )] = False
    inward_allowed: Annotated[bool, OpenPoint(
        name="integral_inward", means={"off": False, "on": True},
        reason="whether integral action that moves away from the limit stays on; the manual gives no direction",
    )] = False
    whole_increments: Annotated[bool, OpenPoint(
        name="rounding", means={"fraction_kept": False, "whole_increments": True},
        reason="whether dY keeps its fraction in the sum; the 928B calculates in floating point",
    )] = False
    limit_is_inside: Annotated[bool, OpenPoint(
        name="limit", means={"reached": False, "exceeded": True},
        reason='whether a sum that just reaches a limit is "at" it',
    )] = False
    flag_in_manual: Annotated[bool, OpenPoint(
        name="manual_flag", means={"clear": False, "by_output": True}, in_manual=True,
        reason="whether a call in manual clears the limit flag, or sets it according to YA",
    )] = False
    sum_outlives_velocity: Annotated[bool, OpenPoint(
        name="velocity_return", means={"last_increment": False, "sum_kept": True}, in_manual=True,
        reason="starting value after a change from velocity to position form; the 928B's DB has one word for "
               "Y_{k−1} and dY_{k−1}",
    )] = False
    fraction_in_manual: Annotated[bool, OpenPoint(
        name="manual_way", means={"whole": False, "fraction_kept": True}, in_manual=True,
        reason="whether each halving step towards YH is truncated to whole units; visible only if automatic returns "
               "before YH is reached",
    )] = False
    approach_begins_anew: Annotated[bool, OpenPoint(
        name="manual_count", means={"outlives": False, "begins_anew": True}, in_manual=True,
        reason="whether the count of the four calls survives a change of HANDART or GESCHW",
    )] = False
    retained: Annotated[bool, OpenPoint(
        name="start_up", means={"cleared": False, "retained": True}, chosen=True,
        reason="your choice: whether OB21 and OB22 clear DW18 to DW48, or keep the values that the battery retained",
    )] = False


class Ob251State(NamedTuple):
    """What DW18 to DW48 keep from call to call (names of the 928B's DB where the 115U's book has none)."""

    error: float = 0.0  # XW_{k−1}
    error_change: float = 0.0  # PW_{k−1}
    substitute: float = 0.0  # XZ_{k−1}
    substitute_change: float = 0.0  # PZ_{k−1}
    derivative: float = 0.0  # dD_{k−1}
    disturbance: float = 0.0  # Z_{k−1}
    total: float = 0.0  # Y_{k−1}, before the limiter
    output: int = 0  # YA
    at_limit: int = 0  # +1 upper, −1 lower, 0 inside
    approach: int = 0  # calls since the switch to manual


COLD: Final = Ob251State()


def step(
    parameters: tuple[Ob251Parameters, Ob251Assumptions], state: Ob251State, w: int, x: int, _begins: bool
) -> tuple[Ob251State, float, int, int]:
    """Compute one scan, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the DB's, and the assumptions.
        state: before the call.
        w: setpoint, in units of the sensor's range.
        x: reading, in the same.
        _begins: not looked at: the PWM is behind the output.
    """
    return _outcome(call(parameters[0], parameters[1], state, w, x, parameters[0].z, 0))


def start_up(parameters: tuple[Ob251Parameters, Ob251Assumptions], cold: Ob251State, state: Ob251State) -> Ob251State:
    """Return the state after a start-up, see `heatertune.plc.core.StepFunctions`."""
    return state if parameters[1].retained else cold


def scan(
    parameters: tuple[Ob251Parameters, Ob251Assumptions], state: Ob251State, inputs: Mapping[str, int]
) -> tuple[Ob251State, float, int, int]:
    """Compute one scan with W, X and, where named, Z, XZ, YH and STEU."""
    p, assume = parameters
    p = p._replace(manual=inputs.get("YH", p.manual), steu=inputs.get("STEU", p.steu))
    return _outcome(call(p, assume, state, inputs["W"], inputs["X"], inputs.get("Z", p.z), inputs.get("XZ", 0)))


def _outcome(after: Ob251State) -> tuple[Ob251State, float, int, int]:
    """Return the state, YA in percent, YA, and the limits as bits."""
    return after, percent(after.output), after.output, int(after.at_limit > 0) + 2 * int(after.at_limit < 0)


def percent(output: int) -> float:
    """Return the power of an output in units [0…100 %]."""
    return min(max(100.0 * output / FULL_SCALE, 0.0), 100.0)


def call(
    p: Ob251Parameters, assume: Ob251Assumptions, state: Ob251State, w: int, x: int, z: int = 0, xz: int = 0
) -> Ob251State:
    """Return the state after one call; its `output` is YA (position) or dY (velocity).

    Args:
        p: the DB's parameters.
        assume: of what the manual leaves open.
        state: before the call.
        w: setpoint.
        x: reading.
        z: disturbance variable, added to the output.
        xz: what the D part acts on where STEU bit 1 is set.
    """
    if p.steu & REG_AUS:
        return COLD
    error = float(w - x)
    change = error - state.error
    if p.steu & XZ_EIN:
        substitute = float(xz)
        substitute_change = substitute - state.substitute
        curvature = substitute_change - state.substitute_change
    else:
        substitute, substitute_change = state.substitute, state.substitute_change
        curvature = change - state.error_change
    disturbance = state.disturbance if p.steu & NO_Z else float(z)
    if p.steu & AUTO:
        derivative = 0.5 * (p.td * curvature + state.derivative)
        other = p.gain * (p.r * change + derivative) + (disturbance - state.disturbance)
        total, output, at_limit = _automatic(p, assume, state, other, p.gain * p.ti * error)
        approach = 0
    else:
        derivative = 0.0
        total, output, approach = _manual(p, assume, state)
        at_limit = _side(p, assume, float(output)) if assume.flag_in_manual else 0
    if p.steu & GESCHW and assume.sum_outlives_velocity:
        total = state.total
    return Ob251State(
        error, change, substitute, substitute_change, derivative, disturbance, total, output, at_limit, approach
    )


def _automatic(
    p: Ob251Parameters, assume: Ob251Assumptions, state: Ob251State, value: float, integral: float
) -> tuple[float, int, int]:
    """Add the increments, limit, and keep the integral action out while at a limit: Y, YA and the side."""
    before = 0.0 if p.steu & GESCHW else state.total
    at_limit = state.at_limit
    if assume.flag_of_same_call:
        at_limit = _side(p, assume, before + _whole(assume, value + integral))
    outward = at_limit * integral > 0.0 if assume.inward_allowed else at_limit != 0
    increment = _whole(assume, value if outward else value + integral)
    total = before + increment
    limited = min(max(total, float(p.lower)), float(p.upper))
    return limited if assume.sum_is_limited else total, int(limited), _side(p, assume, total)  # YA is cut towards zero


def _manual(p: Ob251Parameters, assume: Ob251Assumptions, state: Ob251State) -> tuple[float, int, int]:
    """Hold the output or approach YH, the algorithm not being computed: Y, YA and the calls since the switch."""
    approach = 0 if assume.approach_begins_anew else state.approach
    if p.steu & GESCHW:
        target = 0.0 if p.steu & HANDART else float(p.manual)
    elif p.steu & HANDART:
        target = float(state.output)
    else:
        approach = state.approach
        on_the_way = state.total if assume.fraction_in_manual and approach > 0 else float(state.output)
        target = float(p.manual) if approach + 1 >= _APPROACH else (p.manual + on_the_way) / 2.0
        approach = min(approach + 1, _APPROACH)
    total = min(max(target, float(p.lower)), float(p.upper))
    return total if assume.fraction_in_manual else float(int(total)), int(total), approach


def _side(p: Ob251Parameters, assume: Ob251Assumptions, total: float) -> int:
    if assume.limit_is_inside:
        return int(total > p.upper) - int(total < p.lower)
    return int(total >= p.upper) - int(total <= p.lower)


def _whole(assume: Ob251Assumptions, increment: float) -> float:
    return float(int(increment)) if assume.whole_increments else increment

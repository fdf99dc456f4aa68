"""One call of the standard's block as its text says it, in single precision, one rounding per operation.

    e = PV − SP        D = (3·(e − x₃) + x₁ − x₂)/(10·T)        XOUT = KP·((e + S/TR) + D·TD)

T is TIME_TO_REAL(CYCLE). In automatic S grows by e·T and the three errors x move on; by hand S is TR·(X0 − e), all x
are e and D is 0. In the first call after a start-up S and all x are 0. Nothing is limited, nothing is checked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.single_precision import divide_single, single
from heatertune.plc.st.program_text import SECONDS, TIME_UNIT, time_to_real

__all__ = ["COLD", "StandardPidAssumptions", "StandardPidBlock", "StandardPidState", "block_of", "call", "scan", "step"]


class StandardPidAssumptions(NamedTuple):
    """The open points of the standard, see DIFFERENCES.md."""

    time_unit: Annotated[int, TIME_UNIT] = SECONDS


class StandardPidBlock(NamedTuple):
    """The words as the block uses them, and what follows from them alone."""

    kp: float
    tr: float
    td: float
    t: float
    ten_t: float


class StandardPidState(NamedTuple):
    """What the instance keeps from call to call."""

    total: float = 0.0  # ITERM.XOUT
    x1: float = 0.0
    x2: float = 0.0
    x3: float = 0.0


COLD: Final = StandardPidState()


def step(
    parameters: tuple[StandardPidBlock, StandardPidAssumptions], state: StandardPidState, setpoint: float,
    feedback: float, _begins: bool
) -> tuple[StandardPidState, float, float, int]:
    """Compute one scan in automatic, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: SP, a REAL, °C.
        feedback: PV, a REAL, °C.
        _begins: not looked at: the PWM is behind the output.
    """
    return _outcome(*call(parameters[0], state, single(feedback - setpoint), setpoint, True))


def scan(
    parameters: tuple[StandardPidBlock, StandardPidAssumptions], state: StandardPidState, inputs: Mapping[str, float]
) -> tuple[StandardPidState, float, float, int]:
    """Compute one scan with SP, PV and, where named, X0 and AUTO."""
    error, auto = single(inputs["PV"] - inputs["SP"]), bool(inputs.get("AUTO", 1))
    return _outcome(*call(parameters[0], state, error, inputs.get("X0", 0.0), auto))


def block_of(values: Mapping[str, float], assume: StandardPidAssumptions) -> StandardPidBlock:
    """Return the block for its words; total for any of them."""
    t = time_to_real(int(values["CYCLE"]), assume.time_unit)
    return StandardPidBlock(kp=float(values["KP"]), tr=float(values["TR"]), td=float(values["TD"]), t=t,
                            ten_t=single(10.0 * t))


def call(b: StandardPidBlock, s: StandardPidState, error: float, x0: float, auto: bool) -> tuple[StandardPidState,
                                                                                                 float]:
    """Return the state after one call, and XOUT; total for all inputs.

    Args:
        b: the words.
        s: before the call.
        error: PV − SP, a REAL [°C].
        x0: output by hand, a REAL [%].
        auto: whether the call is in automatic.
    """
    if auto:
        total = single(s.total + single(error * b.t))
        slope = divide_single(single(single(single(3.0 * single(error - s.x3)) + s.x1) - s.x2), b.ten_t)
        after = StandardPidState(total, error, s.x1, s.x2)
    else:
        total, slope = single(b.tr * single(x0 - error)), single(0.0)
        after = StandardPidState(total, error, error, error)
    parts = single(single(error + divide_single(total, b.tr)) + single(slope * b.td))
    return after, single(b.kp * parts)


def _outcome(after: StandardPidState, output: float) -> tuple[StandardPidState, float, float, int]:
    """Return the state, an output as power, the output, and the flags as bits."""
    bits = int(output > 100.0) + 2 * int(output < 0.0) + 4 * int(not math.isfinite(output))
    power = min(max(output, 0.0), 100.0) if output >= 0.0 else 0.0  # what is no number puts no switch on
    return after, power, output, bits

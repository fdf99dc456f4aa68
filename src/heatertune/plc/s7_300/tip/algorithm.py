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
from typing import Final, NamedTuple

from heatertune.plc.s7_300.module import FULL_SCALE
from heatertune.plc.s7_300.real import Real, clamp

__all__ = ["COLD", "Assumptions", "Parameters", "State", "call", "manual"]


class Parameters(NamedTuple):
    """The four words of the instance data block; times in ms."""

    gain: float
    rate: float
    reset: float
    sample: float


class Assumptions(NamedTuple):
    """Settings of what the document leaves open, see DIFFERENCES.md."""

    truncates: bool = False
    bias_always_clamped: bool = False
    starts_at_zero: bool = False


class State(NamedTuple):
    """What the instance data block keeps from call to call."""

    bias: float = 0.0
    reading: float = 0.0  # PV_{n−1}, normalised
    started: bool = False
    output: int = 0  # OUT
    overflow: bool = False


COLD: Final = State()


def call(p: Parameters, assume: Assumptions, state: State, setpoint: int, reading: int) -> State:
    """Return the state after one call in automatic."""
    r = Real()
    sp, pv = r.quotient(setpoint, FULL_SCALE), r.quotient(reading, FULL_SCALE)
    before = state.reading if state.started or assume.starts_at_zero else pv
    factor = p.gain if p.gain != 0.0 else 1.0
    ci = r.of(r.quotient(p.sample, p.reset) * factor) if p.reset != 0.0 else 0.0
    cd = r.of(r.quotient(p.rate, p.sample) * factor)
    error = r.of(sp - pv)
    mp = r.of(p.gain * error)
    mi = r.of(r.of(ci * error) + state.bias)
    md = r.of(cd * r.of(before - pv))
    output = r.of(r.of(mp + mi) + md)
    bias = _bias(r, assume, output, mi, r.of(mp + md))
    scaled = r.of(clamp(output, 0.0, 1.0) * FULL_SCALE)
    whole = math.trunc(scaled) if assume.truncates else round(scaled)
    return State(bias=bias, reading=pv, started=True, output=whole, overflow=r.overflow)


def manual(state: State, reading: int, output: int | None = None) -> State:
    """Return the state after one call in manual: the user's OUT stays, and the bias follows it."""
    r = Real()
    out = state.output if output is None else output
    bias = clamp(r.quotient(out, FULL_SCALE), 0.0, 1.0)
    return State(bias=bias, reading=r.quotient(reading, FULL_SCALE), started=True, output=out, overflow=r.overflow)


def _bias(r: Real, assume: Assumptions, output: float, mi: float, other: float) -> float:
    """Adjust the bias so that the output ends at its limit (formulas 2.8 and 2.9)."""
    if output > 1.0:
        return clamp(r.of(1.0 - other), 0.0, 1.0)
    if output >= 0.0:
        return clamp(mi, 0.0, 1.0) if assume.bias_always_clamped else mi
    return clamp(r.of(0.0 - other), 0.0, 1.0)

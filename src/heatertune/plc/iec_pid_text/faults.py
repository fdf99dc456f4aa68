"""What is wrong in the standard's block, found by running it over its inputs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.plc.iec_pid_text.step import (
    COLD,
    StandardPidAssumptions,
    StandardPidBlock,
    StandardPidState,
    block_of,
    call,
)
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.st.program_text import MILLISECONDS
from heatertune.plc.words import Words

__all__ = ["faults"]

#: setpoints and readings that are tried [°C], and outputs by hand [%]
_TRIED: Final = range(0, 101)
_FULL: Final = 100.0
#: an error for so many reset times, and one of the other sign until the output comes back
_WINDS: Final = 5
_MOST_CALLS: Final = 100_000


def faults(words: Words) -> tuple[str, ...]:
    """Return the faults that these words bring out, one sentence each, with what was run."""
    b = block_of(words.values, StandardPidAssumptions())
    return tuple(told for told in (
        _sign(b), _by_hand(b), _limits(b), _windup(b), _no_reset(b), _first_call(b), _retuned(b), _unit(words.values),
        _no_number(b)) if told)


def _first(b: StandardPidBlock, error: float) -> float:
    """Return XOUT in the first call in automatic after one by hand at 0 %, with a memory at rest."""
    rest = StandardPidState(0.0, error, error, error)
    return call(b, rest, error, 0.0, True)[1]


def _sign(b: StandardPidBlock) -> str:
    """Return how often the output goes up where the temperature is too high, or down where it is too low."""
    pairs = [(sp, pv) for sp in _TRIED for pv in _TRIED if sp != pv]
    wrong = sum((_first(b, single(pv - sp)) > 0.0) != (sp > pv) for sp, pv in pairs)
    return (f"ERROR is PV - SP: the block heats where it is too warm and stops where it is too cold, in {wrong} of "
            f"{len(pairs)} pairs of setpoint and reading; a heater needs KP below 0") if wrong and b.kp != 0.0 else ""


def _by_hand(b: StandardPidBlock) -> str:
    outputs = [(x0, call(b, COLD, single(-10.0), float(x0), False)[1]) for x0 in _TRIED]
    wrong = [(x0, got) for x0, got in outputs if not abs(got - x0) <= 1e-3 * max(1.0, abs(x0))]
    shown = next(got for x0, got in outputs if x0 == 30)
    return (f"by hand XOUT is KP*X0, not X0: at X0 = 30 it is {shown:.4g}; {len(wrong)} of {len(outputs)} outputs by "
            "hand from 0 to 100 % are wrong") if wrong else ""


def _limits(b: StandardPidBlock) -> str:
    outputs = [_first(b, single(pv - sp)) for sp in _TRIED for pv in _TRIED]
    beyond = sum(not 0.0 <= output <= _FULL for output in outputs)
    return (f"no limits: XOUT is outside 0...100 % for {beyond} of {len(outputs)} pairs of setpoint and reading, with "
            f"an I part of 0 ({min(outputs):.4g}...{max(outputs):.4g} %)") if beyond else ""


def _windup(b: StandardPidBlock) -> str:
    """Return for how long the output stays beyond full power once the reading is above the setpoint."""
    sign, b = -1.0 if b.kp < 0.0 else 1.0, b._replace(td=single(0.0))
    if not (b.tr > 0.0 and b.t > 0.0 and b.kp != 0.0):
        return ""
    error, state, calls = single(50.0 * sign), COLD, min(_MOST_CALLS, math.ceil(_WINDS * b.tr / b.t))
    for _ in range(calls):
        state, output = call(b, state, error, 0.0, True)
    wound, back, above = output, 0, single(-5.0 * sign)
    while output >= _FULL and back < _MOST_CALLS:
        state, output = call(b, state, above, 0.0, True)
        back += 1
    if not wound > _FULL:
        return ""
    longer = "" if back < _MOST_CALLS else "more than "
    sides = ("below", "above") if b.kp < 0.0 else ("above", "below")
    return (f"no anti-windup: after {calls} calls 50 degC {sides[0]} the setpoint XOUT is {wound:.4g} %, and then 5 "
            f"degC {sides[1]} it XOUT comes below 100 % after {longer}{back} calls (without the D part)")


def _no_reset(b: StandardPidBlock) -> str:
    off = b._replace(tr=single(0.0))
    hand, output = call(off, COLD, single(-10.0), 30.0, False)
    then = call(off, hand, single(-10.0), 30.0, True)[1]
    return f"TR = 0 is not off: it divides by TR; by hand XOUT is {output:.4g}, in automatic {then:.4g}"


def _first_call(b: StandardPidBlock) -> str:
    """Return what the first call after a start-up gives, when it is in automatic."""
    if b.td == 0.0:
        return ""
    error, side = (single(-10.0), "below") if b.kp < 0.0 else (single(10.0), "above")
    cold = call(b, COLD, error, 0.0, True)[1]
    return (f"the first call after a start-up takes three errors of 0 for the history: 10 degC {side} the setpoint "
            f"XOUT is {cold:.4g}, with the history of a temperature at rest {_first(b, error):.4g}")


def _retuned(b: StandardPidBlock) -> str:
    """Return how the output jumps where TR alone is changed at rest."""
    if not b.tr > 0.0 or b.kp == 0.0:
        return ""
    state = StandardPidState(single(50.0 / b.kp * b.tr), single(0.0), single(0.0), single(0.0))
    before, after = (call(each, state, single(0.0), 0.0, True)[1] for each in (b, b._replace(tr=single(b.tr / 2.0))))
    return (f"the sum is divided by TR as it is now: at rest, TR from {b.tr:.4g} to {b.tr / 2.0:.4g} s moves XOUT from "
            f"{before:.4g} to {after:.4g}")


def _unit(values: Mapping[str, Number]) -> str:
    seconds, ms = (block_of(values, StandardPidAssumptions(time_unit=unit)) for unit in (0, MILLISECONDS))
    grown = [call(b, COLD, single(1.0), 0.0, True)[0].total for b in (seconds, ms)]
    return (f"the unit of TIME_TO_REAL is not the standard's: one call at 1 degC adds {grown[0]:.4g} to the sum where "
            f"it gives seconds, {grown[1]:.4g} where it gives ms; the I part is then {grown[1] / grown[0]:.4g} times "
            "as fast, the D part as slow")


def _no_number(b: StandardPidBlock) -> str:
    broken, _ = call(b, COLD, math.nan, 0.0, True)
    after = broken
    for _ in range(10):
        after, output = call(b, after, single(-1.0), 0.0, True)
    return f"one reading that is no number stays in the sum: ten good ones later XOUT is {output:.4g}"

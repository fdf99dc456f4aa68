"""The program's constants: encode, decode, check."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.room import Scaling, WordField, Words, check_fields

__all__ = ["COUNTS", "FIELDS", "TIMER", "check_words", "decode", "encode", "paper_words"]

#: highest reading of the 8-bit temperature input IB0 and of the analog adjustment SMB28
COUNTS: Final = 255
#: shortest, longest and step of the PWM cycle [s]: milliseconds as a signed word; below 0.1 s the scan is too slow
TIMER: Final = (0.1, 32.767, 0.001)

_MOST = 32767
_MOST_ERROR = 256 * COUNTS + 255
_DOUBLE = 2**31 - 1

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="KP", address="VW200", format="INT", low=-_MOST, high=_MOST, comment="Kp: accumulates, acts as I"),
    WordField(name="KI", address="VW202", format="INT", low=-_MOST, high=_MOST, comment="Ki: acts as I, trapezoidal"),
    WordField(name="KD", address="VW204", format="INT", low=-_MOST, high=_MOST, comment="Kd: acts as P"),
    WordField(name="T", address="VW206", format="INT", low=1, high=_MOST, comment="T: factor of Ki, divisor of Kd"),
    WordField(name="CYCLE", address="SMW68", format="INT", low=2, high=_MOST, comment="PWM cycle, ms"),
    WordField(name="SCALE", address="VW210", format="INT", low=0, high=16, comment="bits of network 7's scaling"),
    WordField(name="POT1", address="SMB29", format="BYTE", low=0, high=255, comment="low byte of the error"),
    WordField(name="PRINTED", address="-", format="BOOL", low=0, high=1, comment="1: program as printed, 0: repaired"),
)


def encode(design: PidDesign, scaling: Scaling) -> Words:
    """Return the constants of the repaired program nearest to a PI design, TA being the PWM cycle.

    Kd carries the proportional part and Kp the integral one; the scaling takes as many bits as the words and the
    32-bit sum allow for every pair of readings, so that the constants are as fine as they can be.

    Raises:
        NotRepresentable: a derivative part, no integral part, a cycle the register cannot hold, constants too large
            or too small.
    """
    ta = design.sample_time_s
    if design.derivative_time_s > 0.0:
        raise NotRepresentable("derivative action TV", design.derivative_time_s,
                               "0: the program has no second difference", "tune --structure pi would fit")
    if math.isinf(design.integral_time_s):
        raise NotRepresentable("integral-action time TN", design.integral_time_s, "finite: the program accumulates",
                               "tune --structure pi would fit")
    cycle = _cycle(ta)
    proportional = _per_count(scaling, cycle) * design.gain_pct_per_degC  # ms per count
    integral = proportional * ta / design.integral_time_s
    for bits in range(16, -1, -1):
        kd, kp = (_round(value * 2.0 ** (bits - 8)) for value in (proportional, integral))
        if max(abs(kd), abs(kp)) <= _MOST and _largest_sum(kp, 0, kd, 1) <= _DOUBLE:
            break
    else:
        raise NotRepresentable("constant KD", proportional / 256.0, f"up to {_MOST}", "a smaller K would fit")
    if kp == 0 or kd == 0:
        name, exact = ("KP", integral) if kp == 0 else ("KD", proportional)
        scaled = exact * 2.0 ** (bits - 8)
        raise NotRepresentable(f"constant {name}", scaled, "at least 1 in size", "a slower TA would fit")
    values = {"KP": kp, "KI": 0, "KD": kd, "T": 1, "CYCLE": cycle, "SCALE": bits, "POT1": 0, "PRINTED": 0}
    return Words(target="s7-200", values=values, scaling=scaling, sample_time_s=cycle / 1000.0)


def decode(words: Words) -> PidDesign:
    """Return the PI design that the repaired program runs with these constants.

    Raises:
        OutOfRange: a constant out of its range; the program as printed or Kd = 0, which have no proportional part.
    """
    check_words(words)
    v = words.whole
    if v["PRINTED"] or v["KD"] == 0:
        name = "PRINTED" if v["PRINTED"] else "KD"
        raise OutOfRange(f"word {name}", v[name], "of a program with a proportional part; this one only accumulates")
    factor = 2.0 ** (8 - v["SCALE"])  # ms per count and unit of a constant
    proportional = factor * v["KD"] / v["T"]
    integral = factor * (v["KP"] + 2 * v["KI"] * v["T"])
    ta = v["CYCLE"] / 1000.0
    tn = math.inf if integral == 0 else ta * proportional / integral
    return PidDesign(
        gain_pct_per_degC=proportional / _per_count(words.scaling, v["CYCLE"]),
        integral_time_s=tn, derivative_time_s=0.0, sample_time_s=ta, structure=structure_of(tn, 0.0),
        method="as the constants of the repaired program realise it",
    )


def check_words(words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, not whole, out of range, or overflows."""
    check_fields(FIELDS, words)
    v = words.whole
    largest = _largest_sum(v["KP"], v["KI"], v["KD"], v["T"])
    if not v["PRINTED"] and largest > _DOUBLE:
        raise OutOfRange("word KD", v["KD"], f"such that the sum stays below 2^31 (it can reach {largest})")
    if abs(words.sample_time_s - v["CYCLE"] / 1000.0) > 1e-9:
        raise OutOfRange("sample_time_s", words.sample_time_s, f"the PWM cycle, {v['CYCLE'] / 1000.0:g} s")


def paper_words(
    *, gain: int, ki: int = 0, t: int = 1, cycle_ms: int = 2000, scaling: Scaling | None = None
) -> Words:
    """Return the constants of a run of the paper, program as printed.

    The paper gives the gain (20, 60) and no more: cycle, Ki, T and the sensor range of 0…140 °C are assumptions.
    """
    values = {"KP": gain, "KI": ki, "KD": 0, "T": t, "CYCLE": cycle_ms, "SCALE": 16, "POT1": 0, "PRINTED": 1}
    scaling = scaling or Scaling(low_degC=0.0, high_degC=140.0)
    return Words(target="s7-200", values=values, scaling=scaling, sample_time_s=cycle_ms / 1000.0)


def _per_count(scaling: Scaling, cycle_ms: int) -> float:
    """Return the width [ms] per count that a gain of 1 %/°C asks for."""
    return cycle_ms / 100.0 * scaling.span_degC / COUNTS


def _largest_sum(kp: int, ki: int, kd: int, t: int) -> int:
    """Return the largest sum that any two pairs of readings can make."""
    return _MOST_ERROR * (abs(kp) + 2 * abs(t * ki) + 2 * abs(kd)) + 65535


def _round(value: float) -> int:
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


def _cycle(ta: float) -> int:
    low, high, step = TIMER
    cycle = round(ta / step)
    if not low <= ta <= high or abs(ta / step - cycle) > 1e-6:
        nearest = min(max(cycle * step, low), high)
        allowed = f"{low:g}…{high:g} s in steps of 1 ms"
        raise NotRepresentable("sampling interval TA", ta, allowed, f"{nearest:g} s would fit")
    return cycle

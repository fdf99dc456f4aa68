"""The repaired program's constants: encode, decode, check."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.controller import Scaling, WordField, Words, check_fields
from heatertune.plc.cpu.s7_200.wiring import COUNTS

__all__ = [
    "FIELDS", "MOST", "TIMER", "check_cycle", "check_words", "cycle_ms", "decode", "encode", "ms_per_count", "rounded",
    "ticks_of", "whole_cycle",
]

#: largest constant, and largest PWM cycle [ms]: a signed word
MOST: Final = 32767
#: shortest, longest and step of the PWM cycle [s]; whole tenths of a second are whole numbers of ticks
TIMER: Final = (0.1, 32.7, 0.1)

_SHORTEST_TICK, _LONGEST_TICK = 5, 255  # SMB34 of a CPU 214 [ms]
_FINEST: Final = 16

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="KP", address="VW200", format="INT", low=-MOST, high=MOST, comment="of the change of the error"),
    WordField(name="KI", address="VW202", format="INT", low=-MOST, high=MOST, comment="of the sum of two errors"),
    WordField(name="KD", address="VW204", format="INT", low=-MOST, high=MOST, comment="of the second difference of PV"),
    WordField(name="SCALE", address="SRD", format="BYTE", low=1, high=_FINEST,
              comment="constants are in ms/2^SCALE per count"),
    WordField(name="TICK", address="SMB34", format="BYTE", low=_SHORTEST_TICK, high=_LONGEST_TICK,
              comment="timed interrupt 0, ms"),
    WordField(name="TICKS", address="VW208", format="INT", low=1, high=MOST // _SHORTEST_TICK,
              comment="interrupts per PWM cycle"),
)


def encode(design: PidDesign, scaling: Scaling) -> Words:
    """Return the constants nearest to a PI or PID design, TA being the PWM cycle; each is rounded once.

    The scaling takes as many bits as the largest constant leaves room for.

    Raises:
        NotRepresentable: no integral part, a cycle the timer cannot do, constants too large or too small.
    """
    ta = design.sample_time_s
    if math.isinf(design.integral_time_s):
        raise NotRepresentable("integral-action time TN", design.integral_time_s, "finite: the program accumulates",
                               "tune --structure pi would fit")
    cycle = whole_cycle(ta)
    proportional = ms_per_count(scaling, cycle) * design.gain_pct_per_degC
    half = proportional * ta / design.integral_time_s / 2.0
    exact = {"KP": proportional + half, "KI": half, "KD": proportional * design.derivative_time_s / ta}
    scale = min(_FINEST, math.floor(math.log2((MOST + 0.5) / max(map(abs, exact.values())))))
    if scale < 1:
        worst = max(exact, key=lambda name: abs(exact[name]))
        raise NotRepresentable(f"constant {worst}", 2.0 * exact[worst], f"up to {MOST}", "a smaller K would fit")
    values = {name: rounded(value * 2.0**scale) for name, value in exact.items()}
    for name, wanted in exact.items():
        if values[name] == 0 and wanted != 0.0:
            remedy = "a slower TA would fit"
            raise NotRepresentable(f"constant {name}", wanted * 2.0**scale, "at least 1 in size", remedy)
    values |= {"SCALE": scale, **ticks_of(cycle)}
    return Words(target="s7-200", values=values, scaling=scaling, sample_time_s=cycle / 1000.0)


def decode(words: Words) -> PidDesign:
    """Return the design that the repaired program runs with these constants.

    Raises:
        OutOfRange: a constant out of its range, or KP = KI, which leaves no proportional part.
    """
    check_words(words)
    v, ta = words.whole, words.sample_time_s
    unit = 2.0 ** -v["SCALE"] / ms_per_count(words.scaling, cycle_ms(words))
    proportional = v["KP"] - v["KI"]  # the sum E + E_prev is 2·E less the change
    if proportional == 0:
        raise OutOfRange("word KP", v["KP"], "not KI: the standard form needs a P part")
    tn = math.inf if v["KI"] == 0 else ta * proportional / (2 * v["KI"])
    tv = ta * v["KD"] / proportional
    return PidDesign(
        gain_pct_per_degC=proportional * unit, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
        structure=structure_of(tn, tv), method="as the constants of the repaired program realise it",
        derivative_filter=0.0,
    )


def check_words(words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, not whole, out of range, or makes no PWM cycle."""
    check_fields(FIELDS, words)
    check_cycle(words)


def check_cycle(words: Words) -> None:
    """Raise OutOfRange where TICK and TICKS make no PWM cycle, or another than the words' sampling interval."""
    cycle = cycle_ms(words)
    if cycle > MOST:
        raise OutOfRange("word TICKS", words.whole["TICKS"], f"such that TICK·TICKS is at most {MOST} ms (now {cycle})")
    if abs(words.sample_time_s - cycle / 1000.0) > 1e-9:
        raise OutOfRange("sample_time_s", words.sample_time_s, f"the PWM cycle, {cycle / 1000.0:g} s")


def ticks_of(cycle: int) -> dict[str, int]:
    """Return the longest timed interrupt [ms] that divides a PWM cycle [ms], and how many of them make it."""
    tick = max(tick for tick in range(_SHORTEST_TICK, _LONGEST_TICK + 1) if cycle % tick == 0)
    return {"TICK": tick, "TICKS": cycle // tick}


def cycle_ms(words: Words) -> int:
    """Return the PWM cycle [ms]."""
    return words.whole["TICK"] * words.whole["TICKS"]


def ms_per_count(scaling: Scaling, cycle: int) -> float:
    """Return the width [ms] per count that a gain of 1 %/°C asks for."""
    return cycle / 100.0 * scaling.span_degC / COUNTS


def whole_cycle(ta: float) -> int:
    """Return the PWM cycle [ms] of a sampling interval.

    Raises:
        NotRepresentable: an interval that the timer cannot do.
    """
    low, high, step = TIMER
    steps = round(ta / step)
    if not low <= ta <= high or abs(ta / step - steps) > 1e-6:
        nearest = min(max(steps * step, low), high)
        allowed = f"{low:g}…{high:g} s in steps of {step:g} s"
        raise NotRepresentable("sampling interval TA", ta, allowed, f"{nearest:g} s would fit")
    return steps * round(1000 * step)


def rounded(value: float) -> int:
    """Return the nearest whole number, halves away from zero."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))

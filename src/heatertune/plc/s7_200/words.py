"""The repaired program's constants."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.cpu.s7_200.io_and_cycle import MOST, TICK_FIELDS, cycle_ms, ms_per_count, ticks_of, whole_cycle
from heatertune.plc.words import Scaling, WordField, Words, round_half_away

__all__ = ["FIELDS", "design_of", "most_gain", "values_of"]

_FINEST: Final = 16

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="KP", address="VW200", format="INT", low=-MOST, high=MOST, comment="of the change of the error"),
    WordField(name="KI", address="VW202", format="INT", low=-MOST, high=MOST, comment="of the sum of two errors"),
    WordField(name="KD", address="VW204", format="INT", low=-MOST, high=MOST, comment="of the second difference of PV"),
    WordField(name="SCALE", address="SRD", format="BYTE", low=1, high=_FINEST,
              comment="constants are in ms/2^SCALE per count"),
    *TICK_FIELDS,
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, int]:
    """Return the constants nearest to a PI or PID design, TA being the PWM cycle; each is rounded once.

    The scaling takes as many bits as the largest constant leaves room for.

    Raises:
        NotRepresentable: no integral part, constants too large or too small.
    """
    ta = design.sample_time_s
    if math.isinf(design.integral_time_s):
        raise NotRepresentable("integral-action time TN", design.integral_time_s, "finite: the program accumulates",
                               "tune --structure pi would fit")
    cycle = whole_cycle(ta)
    proportional = ms_per_count(scaling, cycle) * design.gain_pct_per_degC
    exact = {name: share * proportional for name, share in _shares(design).items()}
    scale = min(_FINEST, math.floor(math.log2((MOST + 0.5) / max(map(abs, exact.values())))))
    if scale < 1:
        worst = max(exact, key=lambda name: abs(exact[name]))
        raise NotRepresentable(f"constant {worst}", 2.0 * exact[worst], f"up to {MOST}", "a smaller K would fit")
    values = {name: round_half_away(value * 2.0**scale) for name, value in exact.items()}
    for name, wanted in exact.items():
        if values[name] == 0 and wanted != 0.0:
            remedy = "a slower TA would fit"
            raise NotRepresentable(f"constant {name}", wanted * 2.0**scale, "at least 1 in size", remedy)
    return values | {"SCALE": scale, **ticks_of(cycle)}


def most_gain(scaling: Scaling, design: PidDesign) -> float:
    """Return the largest K whose constants are words at the coarsest scaling [%/°C]."""
    per_gain = ms_per_count(scaling, round(1000.0 * design.sample_time_s)) * max(_shares(design).values())
    return MOST / 2.0 / per_gain


def _shares(design: PidDesign) -> dict[str, float]:
    """Return the constants as multiples of the proportional part."""
    half = design.sample_time_s / design.integral_time_s / 2.0
    return {"KP": 1.0 + half, "KI": half, "KD": design.derivative_time_s / design.sample_time_s}


def design_of(words: Words) -> PidDesign:
    """Return the design that the repaired program runs with these constants.

    Raises:
        OutOfRange: KP = KI, which leaves no proportional part.
    """
    v, ta = words.whole, words.sample_time_s
    unit = 2.0 ** -v["SCALE"] / ms_per_count(words.scaling, cycle_ms(v))
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

"""The words of the repaired block; the names are the standard's, XMIN and XMAX in its manner."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.pid.design_values import PidDesign, Timer, structure_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import FORMATS, Scaling, WordField, Words, check_limits, round_to_word

__all__ = ["COUNTS", "CYCLE_FIELD", "FIELDS", "KP_FIELD", "TD_FIELD", "TIMER", "TR_FIELD", "consistent", "design_of",
           "interval_s", "oddities", "real_field", "values_of"]

#: of the 12-bit input module that is assumed
COUNTS: Final = 4095

_LOWEST, _LARGEST = FORMATS["REAL"]
_LONGEST_MS: Final = 60000

TIMER: Final = Timer(shortest_s=0.001, longest_s=_LONGEST_MS / 1000.0, step_s=0.001)


def real_field(name: str, low: float, high: float, comment: str) -> WordField:
    """Return a field of the block, a REAL."""
    return WordField(name=name, address=name, format="REAL", low=low, high=high, comment=comment)


KP_FIELD: Final = real_field("KP", _LOWEST, _LARGEST, "gain, % per °C; above 0 for a heater, below 0 for a cooler")
TR_FIELD: Final = real_field("TR", 0.0, _LARGEST, "reset time TN, s; 0: no I part")
TD_FIELD: Final = real_field("TD", 0.0, _LARGEST, "derivative time TV, s")
CYCLE_FIELD: Final = WordField(name="CYCLE", address="CYCLE", format="TIME", low=1, high=_LONGEST_MS,
                               comment="interval of the calls, ms")

FIELDS: Final[tuple[WordField, ...]] = (
    KP_FIELD, TR_FIELD, TD_FIELD, real_field("XMIN", 0.0, 100.0, "lower limit of XOUT, %"),
    real_field("XMAX", 0.0, 100.0, "upper limit of XOUT, %"), CYCLE_FIELD,
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design.

    Raises:
        NotRepresentable: a number beyond single precision, or one that would be rounded to zero.
    """
    tn = design.integral_time_s
    return {
        "KP": round_to_word(KP_FIELD, design.gain_pct_per_degC, "a K nearer to 1 %/°C would fit"),
        "TR": 0.0 if math.isinf(tn) else round_to_word(TR_FIELD, tn, "a TN nearer to 1 s would fit"),
        "TD": round_to_word(TD_FIELD, design.derivative_time_s, "a TV nearer to 1 s would fit"),
        "XMIN": 0.0, "XMAX": 100.0, "CYCLE": round(1000.0 * design.sample_time_s),
    }


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run.

    Raises:
        OutOfRange: KP = 0, which has no standard form.
    """
    v = words.values
    if v["KP"] == 0.0:
        raise OutOfRange("word KP", v["KP"], "not 0: nothing acts")
    tn, tv = float(v["TR"]) or math.inf, float(v["TD"])
    return PidDesign(
        gain_pct_per_degC=float(v["KP"]), integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), method="as the words of the block realise it",
    )


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: limits that are upside down.
    """
    check_limits(words.values, "XMIN", "XMAX")


def oddities(words: Words) -> tuple[str, ...]:
    """Return warnings about a block's parameters, one sentence each."""
    v = words.values
    checks = [
        (v["KP"] == 0.0, "KP is 0: nothing acts."),
        (v["KP"] < 0.0, "KP is negative: the output falls where the temperature is too low, as for a cooler."),
        (v["TR"] == 0.0, "TR is 0: there is no I part."),
        ((v["XMIN"], v["XMAX"]) != (0.0, 100.0),
         f"XOUT is limited to {v['XMIN']:g}…{v['XMAX']:g} %, not to 0…100 %."),
    ]
    return tuple(sentence for is_odd, sentence in checks if is_odd)


def interval_s(values: Mapping[str, Number]) -> float:
    """Return CYCLE [s]."""
    return values["CYCLE"] / 1000.0

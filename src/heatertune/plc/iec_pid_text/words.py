"""The words of the standard's block."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.iec_pid.words import CYCLE_FIELD, TD_FIELD, TR_FIELD, real_field
from heatertune.plc.ramp import Number
from heatertune.plc.words import FORMATS, Scaling, WordField, Words, round_to_word

__all__ = ["FIELDS", "design_of", "values_of"]

_LOWEST, _LARGEST = FORMATS["REAL"]
_KP: Final = real_field("KP", _LOWEST, _LARGEST, "gain, % per °C; below 0 for a heater, as ERROR is PV - SP")

FIELDS: Final[tuple[WordField, ...]] = (
    _KP, real_field("TR", 0.0, _LARGEST, "reset time TN, s; 0 gives no number"), TD_FIELD, CYCLE_FIELD)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design, KP with the sign that makes the block heat.

    Raises:
        NotRepresentable: a design without an I part; a number beyond single precision, or one rounded to zero.
    """
    if math.isinf(design.integral_time_s):
        raise NotRepresentable("word TR", 0.0, "above 0: the block divides by it", "a PI or PID would fit")
    return {
        "KP": round_to_word(_KP, -design.gain_pct_per_degC, "a K nearer to 1 %/°C would fit"),
        "TR": round_to_word(TR_FIELD, design.integral_time_s, "a TN nearer to 1 s would fit"),
        "TD": round_to_word(TD_FIELD, design.derivative_time_s, "a TV nearer to 1 s would fit"),
        "CYCLE": round(1000.0 * design.sample_time_s),
    }


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run where nothing saturates and TIME_TO_REAL gives seconds.

    Raises:
        OutOfRange: KP = 0 or TR = 0, which have no standard form.
    """
    v = words.values
    for name in ("KP", "TR"):
        if v[name] == 0.0:
            raise OutOfRange(f"word {name}", v[name], "not 0: " + ("nothing acts" if name == "KP" else "0/0"))
    tn, tv = float(v["TR"]), float(v["TD"])
    return PidDesign(
        gain_pct_per_degC=-float(v["KP"]), integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), method="as the words of the block realise it",
    )

"""The words of the block (WEG, WPS help, SCA06 Ladder, block PID)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import FORMATS, Scaling, WordField, Words, check_limits, round_to_word

__all__ = [
    "ACADEMIC", "COUNTS", "DIRECT", "FIELDS", "PARALLEL", "REVERSE", "consistent", "design_of", "interval_s",
    "oddities", "values_of",
]

#: Type# and Action# in the order in which the manual lists them; its example has 0 and 0
ACADEMIC: Final = 0
PARALLEL: Final = 1
DIRECT: Final = 0
REVERSE: Final = 1

#: of the 12-bit input module that is assumed
COUNTS: Final = 4095

_LARGEST: Final = FORMATS["REAL"][1]


def _real(name: str, high: float, comment: str) -> WordField:
    return WordField(name=name, address=name, format="REAL", low=0.0, high=high, comment=comment)


FIELDS: Final[tuple[WordField, ...]] = (
    _real("Kp", _LARGEST, "proportional gain, % per °C"),
    _real("Ki", _LARGEST, "integral gain: 1/TN, 1/s (parallel form: K/TN)"),
    _real("Kd", _LARGEST, "derivative gain: TV, s (parallel form: K·TV)"),
    _real("TauSetPoint", _LARGEST, "time constant of the setpoint filter, s; 0: no filter"),
    _real("MinimumOutput", 100.0, "lower limit of Output, %"),
    _real("MaximumOutput", 100.0, "upper limit of Output, %"),
    WordField(name="Type", address="Type", format="BYTE", low=0, high=1, comment="0 academic form, 1 parallel form"),
    WordField(name="Action", address="Action", format="BYTE", low=0, high=1,
              comment="0 direct: SetPoint - Feedback, 1 reverse"),
    WordField(name="Ts", address="Ts", format="UINT", low=1, high=65535, comment="sampling time, ms"),
)

_FIELD: Final = {field.name: field for field in FIELDS}


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design in the academic form.

    Raises:
        NotRepresentable: a gain beyond single precision, or one that would be rounded to zero.
    """
    tn = design.integral_time_s
    return {
        "Kp": round_to_word(_FIELD["Kp"], abs(design.gain_pct_per_degC), "a K nearer to 1 %/°C would fit"),
        "Ki": round_to_word(_FIELD["Ki"], 0.0 if math.isinf(tn) else 1.0 / tn, "a TN nearer to 1 s would fit"),
        "Kd": round_to_word(_FIELD["Kd"], design.derivative_time_s, "a TV nearer to 1 s would fit"), "TauSetPoint": 0.0,
        "MinimumOutput": 0.0, "MaximumOutput": 100.0, "Type": ACADEMIC,
        "Action": REVERSE if design.gain_pct_per_degC < 0.0 else DIRECT, "Ts": round(1000.0 * design.sample_time_s),
    }


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run; either form, either action.

    Raises:
        OutOfRange: Kp = 0, which has no standard form.
    """
    v = words.values
    kp, ki, kd = v["Kp"], v["Ki"], v["Kd"]
    if kp == 0.0:
        raise OutOfRange("word Kp", kp, "not 0: the standard form needs a P part")
    if v["Type"] == PARALLEL:
        ki, kd = ki / kp, kd / kp
    tn, tv = math.inf if ki == 0.0 else 1.0 / ki, float(kd)
    return PidDesign(
        gain_pct_per_degC=-kp if v["Action"] == REVERSE else float(kp),
        integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), method="as the words of WEG's block realise it", derivative_filter=0.0,
    )


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: limits that are upside down.
    """
    check_limits(words.values, "MinimumOutput", "MaximumOutput")


def oddities(words: Words) -> tuple[str, ...]:
    """Return warnings about a block's parameters, one sentence each."""
    v = words.values
    checks = [
        (v["Kp"] == 0.0 and v["Type"] == ACADEMIC, "Kp is 0: in the academic form nothing acts."),
        (v["Kp"] == 0.0 and v["Type"] == PARALLEL, "Kp is 0: there is no proportional part."),
        (v["Ki"] == 0.0, "Ki is 0: there is no integral part."),
        (v["Type"] == PARALLEL, "Type is 1, the parallel form: Ki and Kd act by themselves, not times Kp."),
        (v["Action"] == REVERSE, "Action is 1: the output falls where the temperature is too low, as for a cooler."),
        (v["TauSetPoint"] > 0.0, f"TauSetPoint is {v['TauSetPoint']:g} s: the setpoint is filtered."),
        ((v["MinimumOutput"], v["MaximumOutput"]) != (0.0, 100.0),
         f"Output is limited to {v['MinimumOutput']:g}…{v['MaximumOutput']:g} %, not to 0…100 %."),
    ]
    return tuple(sentence for is_odd, sentence in checks if is_odd)


def interval_s(values: Mapping[str, Number]) -> float:
    """Return Ts [s]."""
    return values["Ts"] / 1000.0

"""The words of the block: encode, decode, check (WEG, WPS help, SCA06 Ladder, block PID)."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.controller import FORMATS, Scaling, WordField, Words, check_fields
from heatertune.plc.single import single

__all__ = ["ACADEMIC", "DIRECT", "FIELDS", "PARALLEL", "REVERSE", "TIMER", "check_words", "decode", "encode"]

#: Type# and Action# in the order in which the manual lists them; its example has 0 and 0
ACADEMIC: Final = 0
PARALLEL: Final = 1
DIRECT: Final = 0
REVERSE: Final = 1

#: shortest, longest and step of Ts [s]: milliseconds as UINT
TIMER: Final = (0.001, 65.535, 0.001)

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


def encode(design: PidDesign, scaling: Scaling) -> Words:
    """Return the words of the academic form, each gain rounded once to single precision.

    Raises:
        NotRepresentable: a gain beyond single precision, or one that would be rounded to zero; a Ts that is no whole
            number of milliseconds from 1 to 65535.
    """
    ts, tn, tv = _milliseconds(design.sample_time_s), design.integral_time_s, design.derivative_time_s
    values = {
        "Kp": _stored("Kp", abs(design.gain_pct_per_degC), "a K nearer to 1 %/°C would fit"),
        "Ki": 0.0 if math.isinf(tn) else _stored("Ki", 1.0 / tn, "a TN nearer to 1 s would fit"),
        "Kd": 0.0 if tv == 0.0 else _stored("Kd", tv, "a TV nearer to 1 s would fit"),
        "TauSetPoint": 0.0, "MinimumOutput": 0.0, "MaximumOutput": 100.0,
        "Type": ACADEMIC, "Action": REVERSE if design.gain_pct_per_degC < 0.0 else DIRECT, "Ts": ts,
    }
    return Words(target="weg", values=values, scaling=scaling, sample_time_s=ts / 1000.0)


def decode(words: Words) -> PidDesign:
    """Return the design that these words run; either form, either action.

    Raises:
        OutOfRange: a word out of its range; Kp = 0, which has no standard form.
    """
    check_words(words)
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


def check_words(words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, of the wrong kind or out of its range."""
    check_fields(FIELDS, words)
    v = words.values
    if v["MinimumOutput"] > v["MaximumOutput"]:
        raise OutOfRange("word MinimumOutput", v["MinimumOutput"], f"<= MaximumOutput = {v['MaximumOutput']:g}")
    if abs(words.sample_time_s - v["Ts"] / 1000.0) > 1e-9:
        raise OutOfRange("sample_time_s", words.sample_time_s, f"Ts, {v['Ts'] / 1000.0:g} s")


def _stored(name: str, exact: float, remedy: str) -> float:
    stored = single(exact)
    if stored == 0.0 or math.isinf(stored):
        raise NotRepresentable(f"word {name}", exact, f"1.4e-45…{_LARGEST:.9g}", remedy)
    return stored


def _milliseconds(ta: float) -> int:
    low, high, step = TIMER
    whole = round(min(max(ta, low), high) / step)
    if abs(ta / step - whole) > 1e-6:
        raise NotRepresentable("sampling interval TA", ta, f"{low:g}…{high:g} s in steps of 1 ms",
                               f"{whole * step:g} s would fit")
    return whole

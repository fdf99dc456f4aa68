"""The words of the controller DB (S5-115U manual, tables 11-10 and 11-11)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.s5_ob251.step import AUTO, FULL_SCALE, NO_Z, Ob251Parameters
from heatertune.plc.words import Scaling, WordField, Words, round_half_away

__all__ = [
    "FACTOR", "FIELDS", "FULL_SCALE", "GAIN_WITH_D", "UNREAD", "check_consistency", "consistent", "design_of",
    "most_gain", "parameters_of", "values_of",
]

_CURVED: Final = "an analog input 460 gives {}, no straight line in °C{}; take a transmitter: --input 4-20mA"
#: range of an analog module → why there is none here; units of the 464-8MA21: EWA 4NEB 812 6087, tables 7-10 to 7-12
UNREAD: Final = {
    "thermocouple": _CURVED.format("millivolts", ", and how long a 464-8MA21 with 1 °C per unit takes is not known"),
    "rtd": _CURVED.format("ohms", ", and the units of a 464-8MF21 are not known"),
    "rtd-climatic": _CURVED.format("ohms", ""),
}

#: K, R and TI are multiples of this; the manual's 0.001 is its round value (footnote of table 11-11)
FACTOR: Final = 1024

_MOST: Final = 32767

#: largest K with a derivative part (table 11-11, footnote)
GAIN_WITH_D: Final = 1500

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="K", address="DW1", format="KF", low=-32768, high=32767, comment="proportional coefficient, 1/1024"),
    WordField(name="R", address="DW3", format="KF", low=-32768, high=32767, comment="R parameter, 1/1024"),
    WordField(name="TI", address="DW5", format="KF", low=0, high=9999, comment="TA/TN, 1/1024"),
    WordField(name="TD", address="DW7", format="KF", low=0, high=999, comment="TV/TA, whole"),
    WordField(name="W", address="DW9", format="KF", low=-2047, high=2047, comment="setpoint, units"),
    WordField(name="STEU", address="DW11", format="KM", low=0, high=65535, comment="control word"),
    WordField(name="YH", address="DW12", format="KF", low=-2047, high=2047, comment="manual value, units"),
    WordField(name="BGOG", address="DW14", format="KF", low=-2047, high=2047, comment="upper limit, units"),
    WordField(name="BGUG", address="DW16", format="KF", low=-2047, high=2047, comment="lower limit, units"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, int]:
    """Return the words nearest to the design, each rounded once, halves away from zero.

    Raises:
        NotRepresentable: a word would leave its range, or rounding would switch a wanted part off.
    """
    ta = design.sample_time_s
    gain = round_half_away(FACTOR * _units_gain(scaling) * design.gain_pct_per_degC)
    ti = 0 if math.isinf(design.integral_time_s) else round_half_away(FACTOR * ta / design.integral_time_s)
    td = round_half_away(design.derivative_time_s / ta)
    if math.isfinite(design.integral_time_s):
        _demand_part("TI", FACTOR * ta / design.integral_time_s, ti, 9999, _slower(ta, design.integral_time_s))
    if design.derivative_time_s > 0.0:
        faster = f"a faster TA of at most {2.0 * design.derivative_time_s:.2g} s would fit"
        _demand_part("TD", design.derivative_time_s / ta, td, 999, faster if td == 0 else "a slower TA would fit")
    limit = GAIN_WITH_D if td else _MOST
    if abs(gain) > limit or gain == 0:
        wider = f"a sensor range of {scaling.span_degC * limit / max(abs(gain), 1):.3g} °C or a smaller K would fit"
        raise NotRepresentable("word K", gain, f"1…{limit} in size", wider)
    return {
        "K": gain, "R": FACTOR, "TI": ti, "TD": td, "W": 0, "STEU": AUTO | NO_Z, "YH": 0, "BGOG": FULL_SCALE, "BGUG": 0,
    }


def most_gain(scaling: Scaling, design: PidDesign) -> float:
    """Return the largest K that the word holds [%/°C]: less beside a D part, none where TV is no multiple of TA."""
    if design.derivative_time_s > 0.0 and round_half_away(design.derivative_time_s / design.sample_time_s) == 0:
        return 0.0
    return (GAIN_WITH_D if design.derivative_time_s > 0.0 else _MOST) / FACTOR / _units_gain(scaling)


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run: K and R together, TN and TV in seconds.

    Raises:
        OutOfRange: K or R is 0: without a proportional part there is no standard form; nor is there where a negative R
            sets it against the others.
    """
    v, ta = words.whole, words.sample_time_s
    if v["K"] == 0 or v["R"] == 0:
        raise OutOfRange("word K" if v["K"] == 0 else "word R", 0, "not 0: the standard form needs a P part")
    if v["R"] < 0 and (v["TI"] or v["TD"]):
        raise OutOfRange("word R", v["R"], "above 0 beside TI or TD: the P part would act against theirs")
    r = v["R"] / FACTOR
    tn = math.inf if v["TI"] == 0 else r * ta * FACTOR / v["TI"]
    tv = ta * v["TD"] / r if v["TD"] else 0.0
    return PidDesign(
        gain_pct_per_degC=v["K"] / FACTOR * r / _units_gain(words.scaling),
        integral_time_s=tn,
        derivative_time_s=tv,
        sample_time_s=ta,
        structure=structure_of(tn, tv),
        method="as the words of OB251 realise it",
    )


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: limits that are upside down, or a K or R that is too large with a D part.
    """
    check_consistency(words)
    limit = GAIN_WITH_D
    if words.whole["TD"] and not -limit <= words.whole["K"] <= limit:
        raise OutOfRange("word K", words.whole["K"], f"-{limit}…{limit} with a D part (TD is not 0); larger only where "
                         "XW moves in small steps (table 11-11, footnote 1), which is not proven")


def check_consistency(words: Words) -> None:
    """Refuse words that contradict one another whatever the process: a K above its limit may run where XW is smooth.

    Raises:
        OutOfRange: limits that are upside down, or an R that is too large with a D part.
    """
    if words.whole["BGUG"] > words.whole["BGOG"]:
        raise OutOfRange("word BGUG", words.whole["BGUG"], f"<= BGOG = {words.whole['BGOG']}")
    limit = GAIN_WITH_D
    if words.whole["TD"] and not -limit <= words.whole["R"] <= limit:
        raise OutOfRange("word R", words.whole["R"], f"-{limit}…{limit} with a D part (TD is not 0)")


def parameters_of(values: Mapping[str, int]) -> Ob251Parameters:
    """Return the words, name → value, as the algorithm uses them."""
    return Ob251Parameters(
        gain=values["K"] / FACTOR, r=values["R"] / FACTOR, ti=values["TI"] / FACTOR, td=float(values["TD"]),
        steu=values["STEU"], manual=values["YH"], upper=values["BGOG"], lower=values["BGUG"])


def _units_gain(scaling: Scaling) -> float:
    """Return (output units per input unit) of a gain of 1 %/°C."""
    return (FULL_SCALE / 100.0) / (FULL_SCALE / scaling.span_degC)


def _slower(ta: float, tn: float) -> str:
    return f"a slower TA of at least {math.ceil(100.0 * 0.5 * tn / FACTOR) / 100.0:g} s would fit (now {ta:g} s)"


def _demand_part(name: str, exact: float, word: int, most: int, remedy: str) -> None:
    if word == 0:
        raise NotRepresentable(f"word {name}", exact, f"1…{most} (0 switches the part off)", remedy)
    if word > most:
        raise NotRepresentable(f"word {name}", exact, f"1…{most}", "a faster TA would fit" if name == "TI" else remedy)

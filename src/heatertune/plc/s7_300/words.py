"""The four words of the tip's instance data block: encode, decode, check."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.controller import FORMATS, Scaling, WordField, Words, check_fields
from heatertune.plc.cpu.s7_300.timer import milliseconds
from heatertune.plc.single import single

__all__ = ["FIELDS", "check_words", "decode", "encode"]

_MOST: Final = FORMATS["REAL"][1]

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="GAIN", address="DBD10", format="REAL", low=-_MOST, high=_MOST, comment="gain, share per share"),
    WordField(name="RATE", address="DBD14", format="REAL", low=0.0, high=_MOST, comment="derivative time TV, ms"),
    WordField(name="RESET", address="DBD18", format="REAL", low=0.0, high=_MOST, comment="TN, ms; 0: no I part"),
    WordField(name="SAMPLE", address="DBD22", format="REAL", low=1.0, high=60000.0, comment="call interval TA, ms"),
)


def encode(design: PidDesign, scaling: Scaling) -> Words:
    """Return the words nearest to the design, each rounded once to single precision.

    Raises:
        NotRepresentable: a call interval OB35 cannot keep, a gain or time that single precision cannot hold.
    """
    sample = milliseconds(design.sample_time_s)
    exact = {
        "GAIN": design.gain_pct_per_degC * scaling.span_degC / 100.0,
        "RATE": 1000.0 * design.derivative_time_s,
        "RESET": 0.0 if math.isinf(design.integral_time_s) else 1000.0 * design.integral_time_s,
    }
    values = {name: single(value) for name, value in exact.items()}
    for name, value in exact.items():
        if math.isinf(values[name]) or (values[name] == 0.0 and value != 0.0):
            remedy = "a size between 1.2e-38 and 3.4e+38 would fit"
            raise NotRepresentable(f"word {name}", value, "a number in single precision", remedy)
    values["SAMPLE"] = float(sample)
    return Words(target="s7-300", values=values, scaling=scaling, sample_time_s=sample / 1000.0)


def decode(words: Words) -> PidDesign | None:
    """Return the design that these words run at their call interval; None for GAIN = 0, which has no P part.

    Where SAMPLE is not the call interval, the block integrates and differentiates with the wrong clock: TN and TV
    stretch by their ratio.

    Raises:
        OutOfRange: a word out of its range; words whose times together leave the range of numbers.
    """
    check_words(words)
    v = words.values
    if v["GAIN"] == 0.0:
        return None
    stretch = 1000.0 * words.sample_time_s / v["SAMPLE"]
    tn = math.inf if v["RESET"] == 0.0 else v["RESET"] / 1000.0 * stretch
    tv = v["RATE"] / 1000.0 * stretch
    return PidDesign(
        gain_pct_per_degC=v["GAIN"] * 100.0 / words.scaling.span_degC, integral_time_s=tn, derivative_time_s=tv,
        sample_time_s=words.sample_time_s, structure=structure_of(tn, tv), derivative_filter=0.0,
        method="as the words of the S7-300 PID tip realise it",
    )


def check_words(words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, not single precision or outside its range."""
    check_fields(FIELDS, words)
    if not words.sample_time_s > 0.0:
        raise OutOfRange("sample_time_s", words.sample_time_s, "> 0")

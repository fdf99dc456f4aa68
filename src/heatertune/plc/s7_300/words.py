"""The four words of the tip's instance data block."""

from __future__ import annotations

import math
from typing import Final

from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.words import FORMATS, Scaling, WordField, Words

__all__ = ["FIELDS", "design_of", "values_of"]

_MOST: Final = FORMATS["REAL"][1]

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="GAIN", address="DBD10", format="REAL", low=-_MOST, high=_MOST, comment="gain, share per share"),
    WordField(name="RATE", address="DBD14", format="REAL", low=0.0, high=_MOST, comment="derivative time TV, ms"),
    WordField(name="RESET", address="DBD18", format="REAL", low=0.0, high=_MOST, comment="TN, ms; 0: no I part"),
    WordField(name="SAMPLE", address="DBD22", format="REAL", low=1.0, high=60000.0, comment="call interval TA, ms"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, float]:
    """Return the words of a design."""
    return {
        "GAIN": design.gain_pct_per_degC * scaling.span_degC / 100.0,
        "RATE": 1000.0 * design.derivative_time_s,
        "RESET": 0.0 if math.isinf(design.integral_time_s) else 1000.0 * design.integral_time_s,
        "SAMPLE": float(round(1000.0 * design.sample_time_s)),
    }


def design_of(words: Words) -> PidDesign | None:
    """Return the design that these words run at their call interval; None for GAIN = 0, which has no P part.

    Where SAMPLE is not the call interval, the block integrates and differentiates with the wrong clock: TN and TV
    stretch by their ratio.

    Raises:
        OutOfRange: words whose times together leave the range of numbers.
    """
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

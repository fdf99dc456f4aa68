"""The words: what the section of a heater says of its PID (Klipper, klippy/extras/heaters.py)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, WordField, Words

__all__ = [
    "FIELDS", "GAIN_BASE", "PLACES", "REPORT_S", "USUAL", "design_of", "interval_s", "oddities", "past_of", "values_of",
]

#: between two reports of a thermistor (klippy/extras/adc_temperature.py) [s]
REPORT_S: Final = 0.3
#: gains are of an output of 0…255, as those of the firmwares before it
GAIN_BASE: Final = 255.0
#: decimals with which PID_CALIBRATE and SAVE_CONFIG write
PLACES: Final = 3
#: the firmware's own where the section does not say
USUAL: Final = {"max_power": 1.0, "smooth_time": 1.0}

_MOST: Final = 1e6
_LEAST: Final = 10.0 ** -PLACES


def _word(name: str, low: float, high: float, comment: str) -> WordField:
    return WordField(name=name, address=name, format="LREAL", low=low, high=high, places=PLACES, comment=comment)


FIELDS: Final[tuple[WordField, ...]] = (
    _word("pid_Kp", 0.0, _MOST, "gain: 255 is full power per °C"),
    _word("pid_Ki", 0.0, _MOST, "integral gain, per s: pid_Kp/TN"),
    _word("pid_Kd", 0.0, _MOST, "derivative gain, s: pid_Kp·TV"),
    _word("max_power", _LEAST, 1.0, "largest power, 1 is full"),
    _word("smooth_time", _LEAST, 1000.0, "smooths the derivative, s"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design, power and smoothing being the firmware's own.

    Raises:
        NotRepresentable: a cooler's gain; an integral part that three decimals make nothing of.
    """
    gain = GAIN_BASE / 100.0 * design.gain_pct_per_degC
    if gain < 0.0:
        raise NotRepresentable("gain K", design.gain_pct_per_degC, "> 0: a heater's", "a design for a heater would fit")
    tn = design.integral_time_s
    ki = 0.0 if math.isinf(tn) else gain / tn
    for name, value in (("pid_Kp", gain), ("pid_Ki", ki), ("pid_Kd", gain * design.derivative_time_s)):
        if value != 0.0 and round(value, PLACES) == 0.0:
            raise NotRepresentable(f"word {name}", value, f"a number with {PLACES} decimals, at least {_LEAST:g}",
                                   "a design of a faster heater would fit")
    return {"pid_Kp": gain, "pid_Ki": ki, "pid_Kd": gain * design.derivative_time_s, **USUAL}


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run.

    Raises:
        OutOfRange: pid_Kp = 0, which has no standard form.
    """
    v = words.values
    kp, ki, kd = v["pid_Kp"], v["pid_Ki"], v["pid_Kd"]
    if kp == 0.0:
        raise OutOfRange("word pid_Kp", kp, "not 0: the standard form needs a P part")
    tn, tv = math.inf if ki == 0.0 else kp / ki, kd / kp
    return PidDesign(
        gain_pct_per_degC=100.0 * kp / GAIN_BASE, integral_time_s=tn, derivative_time_s=tv,
        sample_time_s=words.sample_time_s, structure=structure_of(tn, tv), method="as Klipper realises it",
        derivative_filter=past_of(v["smooth_time"]),
    )


def past_of(smooth_time_s: float) -> float:
    """Return the weight of its own past in the derivative."""
    return max(0.0, 1.0 - REPORT_S / smooth_time_s)


def interval_s(values: Mapping[str, Number]) -> float:  # noqa: ARG001 - no word changes it
    """Return the interval of the reports [s]."""
    return REPORT_S


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about the words of a printer, one sentence each."""
    v = words.values
    checks = [
        (v["pid_Kp"] == 0.0, "pid_Kp is 0: there is no proportional part."),
        (v["pid_Ki"] == 0.0, "pid_Ki is 0: there is no integral part."),
        (v["max_power"] < 1.0, f"max_power is {v['max_power']:g}: the heater never gets all of its power."),
        (v["smooth_time"] < REPORT_S, "smooth_time is shorter than a report: the derivative is not smoothed."),
    ]
    return tuple(sentence for is_odd, sentence in checks if is_odd)

"""The two-level control's only word: BAND, half of the hysteresis."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign
from heatertune.plc.controller import Scaling, WordField, Words, check_fields

__all__ = ["BAND_DEGC", "COUNTS", "FIELDS", "TIMER", "check_words", "encode"]

#: highest reading: the document names no converter; one of 12 bits is taken
COUNTS: Final = 4095
#: shortest, longest and step of the scan interval [s]: the document names none
TIMER: Final = (0.01, 600.0, 0.01)
#: half of the hysteresis that is aimed at [°C]
BAND_DEGC: Final = 0.5

_MOST: Final = 2047

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="BAND", address="register 2", format="INT", low=1, high=_MOST,
              comment="half of the hysteresis, counts: on below SP - BAND, off above SP + BAND"),
)


def encode(design: PidDesign, scaling: Scaling) -> Words:
    """Return BAND, the counts nearest 0.5 °C and at least 1; of the design only TA is taken, as the scan interval.

    Raises:
        NotRepresentable: a sensor range so narrow that 0.5 °C are more than half of it, a TA the timer cannot do.
    """
    exact = BAND_DEGC * COUNTS / scaling.span_degC
    band = max(1, int(exact + 0.5))
    if band > _MOST:
        narrowest = math.ceil(100.0 * BAND_DEGC * COUNTS / _MOST) / 100.0
        raise NotRepresentable("word BAND", exact, f"1…{_MOST} counts",
                               f"a sensor range of {narrowest:g} °C or more would fit")
    ta = _scan_interval(design.sample_time_s)
    return Words(target="on-off", values={"BAND": band}, scaling=scaling, sample_time_s=ta)


def check_words(words: Words) -> None:
    """Raise OutOfRange where BAND is missing, not whole or out of its range, or the scan interval is."""
    check_fields(FIELDS, words)
    low, high, _ = TIMER
    if not low <= words.sample_time_s <= high:
        raise OutOfRange("sample_time_s", words.sample_time_s, f"{low:g}…{high:g} s")


def _scan_interval(ta: float) -> float:
    low, high, step = TIMER
    nearest = min(max(round(ta / step) * step, low), high)
    if abs(ta - nearest) > 1e-6 * step:
        raise NotRepresentable("sampling interval TA", ta, f"{low:g}…{high:g} s in steps of 10 ms",
                               f"{nearest:g} s would fit")
    return ta

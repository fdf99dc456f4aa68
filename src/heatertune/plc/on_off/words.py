"""The two-level control's only word: BAND, half of the hysteresis."""

from __future__ import annotations

import math
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, Timer
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["BAND_DEGC", "COUNTS", "FIELDS", "TIMER", "consistent", "oddities", "values_of"]

#: highest reading: the document names no converter; one of 12 bits is taken
COUNTS: Final = 4095
#: of the scan interval: the document names none
TIMER: Final = Timer(shortest_s=0.01, longest_s=600.0, step_s=0.01)
#: half of the hysteresis that is aimed at [°C]
BAND_DEGC: Final = 0.5

_MOST: Final = 2047
_WIDE: Final = 0.1  # of the sensor range

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="BAND", address="register 2", format="INT", low=1, high=_MOST,
              comment="half of the hysteresis, counts: on below SP - BAND, off above SP + BAND"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, int]:
    """Return BAND, the counts nearest 0.5 °C and at least 1; of the design only TA is taken, as the scan interval.

    Raises:
        NotRepresentable: a cooler, whose gain is negative; a sensor range so narrow that 0.5 °C are more than half.
    """
    if design.gain_pct_per_degC < 0.0:
        raise NotRepresentable("gain", design.gain_pct_per_degC, "positive: on-off switches on below the setpoint",
                               "a PID controller would fit")
    exact = BAND_DEGC * COUNTS / scaling.span_degC
    band = max(1, int(exact + 0.5))
    if band > _MOST:
        narrowest = math.ceil(100.0 * BAND_DEGC * COUNTS / _MOST) / 100.0
        raise NotRepresentable("word BAND", exact, f"1…{_MOST} counts",
                               f"a sensor range of {narrowest:g} °C or more would fit")
    return {"BAND": band}


def consistent(words: Words) -> None:
    """Refuse words whose interval the timer cannot keep.

    Raises:
        OutOfRange: a scan interval that is out of its range.
    """
    low, high = TIMER.shortest_s, TIMER.longest_s
    if not low <= words.sample_time_s <= high:
        raise OutOfRange("sample_time_s", words.sample_time_s, f"{low:g}…{high:g} s")


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about the word of a running controller."""
    band = words.whole["BAND"]
    if band <= _WIDE * COUNTS:
        return ()
    degrees = band * words.scaling.span_degC / COUNTS
    return (f"BAND is {band}: the heater switches {degrees:.3g} °C above and below the setpoint.",)

"""What TIME_TO_REAL gives of a duration: the standard leaves the unit to the implementation."""

from __future__ import annotations

from typing import Final

from heatertune.plc.open_points import OpenPoint
from heatertune.plc.single_precision import single

__all__ = ["MILLISECONDS", "NANOSECONDS", "SECONDS", "TENS_OF_MS", "TIME_UNIT", "time_to_real"]

SECONDS: Final = 0
MILLISECONDS: Final = 1
TENS_OF_MS: Final = 2
NANOSECONDS: Final = 3

TIME_UNIT: Final = OpenPoint(
    name="time_unit",
    means={"s": SECONDS, "ms": MILLISECONDS, "ten_ms": TENS_OF_MS, "ns": NANOSECONDS},
    reason="unit of TIME_TO_REAL: s (matiec: Beremiz, OpenPLC), ms (CODESYS), whole tens of ms (FPWIN Pro), ns",
)


def time_to_real(duration_ms: int, unit: int) -> float:
    """Return the REAL of a duration of whole milliseconds in a unit, one of those above.

    matiec adds whole seconds and their fraction in double precision first (lib/C/iec_std_functions.h).
    """
    if unit == MILLISECONDS:
        return single(duration_ms)
    if unit == TENS_OF_MS:
        return single(duration_ms // 10)
    if unit == NANOSECONDS:
        return single(duration_ms * 1_000_000)
    return single(duration_ms // 1000 + (duration_ms % 1000) * 1_000_000 / 1_000_000_000)

"""The clock of a cyclic interrupt: OB35 is called every 1 ms to 1 min (CPU 31x manual, cyclic interrupts)."""

from __future__ import annotations

from typing import Final

from heatertune.errors import NotRepresentable

__all__ = ["TIMER", "milliseconds"]

#: shortest, longest and step of OB35's interval [s]
TIMER: Final = (0.001, 60.0, 0.001)


def milliseconds(sample_time_s: float) -> int:
    """Return the interval in ms; raise NotRepresentable for one that OB35 cannot keep."""
    low, high, step = TIMER
    whole = round(sample_time_s / step)
    if not low <= sample_time_s <= high or abs(sample_time_s / step - whole) > 1e-6:
        nearest = min(max(whole * step, low), high)
        raise NotRepresentable("sampling interval TA", sample_time_s, "1 ms..1 min in steps of 1 ms",
                               f"{nearest:g} s would fit")
    return whole

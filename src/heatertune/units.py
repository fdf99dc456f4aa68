"""The nomenclature: symbols, names and units used everywhere, and the conversions between units.

Temperatures are in °C, times in seconds, heater power in percent of full power. A field's unit is the end
of its name: ``time_constant_s``, ``gain_degC_per_pct``.
"""

from __future__ import annotations

import math
import operator
from typing import Final

from heatertune.errors import OutOfRange

__all__ = [
    "LARGEST", "NOMENCLATURE", "SMALLEST", "check", "count", "degF_to_degC", "kelvin_to_degC", "whole", "written",
]

LARGEST: Final = 1e100
_IN_POWERS: Final = 1e9  # from here on powers of ten are easier to read
SMALLEST: Final = 1e-100

#: field name → (symbol, name, unit)
NOMENCLATURE: Final[dict[str, tuple[str, str, str]]] = {
    "gain_degC_per_pct": ("k", "process gain", "°C/%"),
    "time_constant_s": ("T1", "time constant", "s"),
    "second_time_constant_s": ("T2", "second time constant", "s"),
    "dead_time_s": ("L", "dead time", "s"),
    "ambient_degC": ("Ta", "ambient temperature", "°C"),
    "cooling_gain": ("kc/k", "cooling gain", "of full heating"),
    "gain_per_time_constant_degC_per_s_pct": ("k/T1", "gain per time constant", "°C/(s·%)"),
    "effective_dead_time_s": ("Le", "effective dead time", "s"),
    "ultimate_gain_pct_per_degC": ("Ku", "ultimate gain", "%/°C"),
    "ultimate_period_s": ("Tu", "ultimate period", "s"),
    "gain_pct_per_degC": ("K", "proportional gain", "%/°C"),
    "integral_time_s": ("TN", "integral-action time", "s"),
    "derivative_time_s": ("TV", "derivative-action time", "s"),
    "sample_time_s": ("TA", "sampling interval", "s"),
    "ms": ("Ms", "maximum sensitivity", "1"),
    "mt": ("Mt", "maximum complementary sensitivity", "1"),
    "mks": ("Mks", "maximum noise gain from reading to power", "%/°C"),
    "gain_margin": ("GM", "gain margin", "1"),
    "phase_margin_deg": ("PM", "phase margin", "°"),
    "iae_load": ("IAE", "integrated absolute error after a load step of 1 % power", "°C·s"),
}


def check(field: str, value: float, *, above: float | None = None, least: float | None = None,
          most: float | None = None, infinite: bool = False) -> None:
    """Raise `OutOfRange` unless `value` is a number that keeps the field's bounds.

    No quantity of a heater is beyond `LARGEST`, and none that has to be positive below `SMALLEST`, whatever its unit:
    further out, squares and quotients of two of them are none that floating point holds.

    Args:
        field: name of the value, unit at its end, as the error tells it.
        value: to be checked; an `int` against the bounds alone.
        above: the value has to be larger.
        least: the value has to be as large or larger.
        most: the value has to be as small or smaller.
        infinite: whether it may be infinite.

    Raises:
        OutOfRange: it is not a number, infinite, beyond `LARGEST`, or breaks a bound.
    """
    if isinstance(value, float):
        _check_size(field, value, above=above, infinite=infinite)
    rules = [
        (above is None or value > above, f"> {above:g}" if above is not None else ""),
        (least is None or value >= least, f">= {least:g}" if least is not None else ""),
        (most is None or value <= most, f"<= {most:g}" if most is not None else ""),
    ]
    for kept, rule in rules:
        if not kept:
            raise OutOfRange(field, value, rule)


def whole(field: str, value: int, *, least: int = 0, most: int | None = None) -> int:
    """Return a whole number, NumPy's as Python's; raise `OutOfRange` unless it is one that keeps its bounds.

    Raises:
        OutOfRange: likewise.
    """
    try:
        number = operator.index(value)
    except TypeError:
        raise OutOfRange(field, value, "a whole number") from None
    check(field, number, least=least, most=most)
    return number


def _check_size(field: str, value: float, *, above: float | None, infinite: bool) -> None:
    if math.isnan(value) or (math.isinf(value) and not infinite):
        raise OutOfRange(field, value, "a finite number")
    if LARGEST < abs(value) < math.inf:
        raise OutOfRange(field, value, f"within ±{LARGEST:g}")
    if above == 0.0 and 0.0 < value < SMALLEST:
        raise OutOfRange(field, value, f">= {SMALLEST:g}")


def degF_to_degC(value: float) -> float:
    """Return °C for °F: (F − 32)·5/9."""
    return (value - 32.0) * 5.0 / 9.0


def kelvin_to_degC(value: float) -> float:
    """Return °C for kelvin: K − 273.15."""
    return value - 273.15


def written(value: float, digits: int = 4) -> str:
    """Return a number as people read it, so many digits of it: 1484, never 1.48e+03."""
    return f"{value:.0f}" if 10.0**digits <= abs(value) < _IN_POWERS else f"{value:.{digits}g}"


def count(number: int, singular: str) -> str:
    """Return "1 row", "2 rows"."""
    return f"{number} {singular}" + ("s" if number != 1 else "")

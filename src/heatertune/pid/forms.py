"""The three forms in which PID settings are printed, and the way between them.

    ideal     K·(1 + 1/(TN·s) + TV·s)             also: standard, ISA, non-interacting; the form of this program
    series    K'·(1 + 1/(TN'·s))·(1 + TV'·s)      also: interacting, classical
    parallel  Kp + Ki/s + Kd·s

Every series form has an ideal one. The way back needs TN ≥ 4·TV: only then are both zeros of the ideal form real
(K. J. Åström and T. Hägglund, "PID Controllers", 2nd ed., ISA 1995, section 3.2). Derivative filters are left as they
are: the conversions hold below the corner frequency of the filter.
"""

from __future__ import annotations

import math
from typing import Any

from heatertune.errors import InputError

__all__ = ["Settings", "ideal_to_parallel", "ideal_to_series", "other_forms", "series_to_ideal"]

#: proportional gain [%/°C], integral-action time [s] (infinite: no I part), derivative-action time [s]
Settings = tuple[float, float, float]


def series_to_ideal(gain: float, integral_time_s: float, derivative_time_s: float) -> Settings:
    """Return the ideal form of a series one: K = K'·f, TN = TN'·f, TV = TV'/f with f = 1 + TV'/TN'."""
    factor = 1.0 + derivative_time_s / integral_time_s
    return gain * factor, integral_time_s * factor, derivative_time_s / factor


def ideal_to_series(gain: float, integral_time_s: float, derivative_time_s: float) -> Settings:
    """Return the series form of an ideal one; of the two that exist, the one whose TN' is the larger.

    Raises:
        InputError: TV is above TN/4, so no series form exists.
    """
    if derivative_time_s > integral_time_s / 4.0:
        raise InputError(
            f"TV = {derivative_time_s:g} s has no series form with TN = {integral_time_s:g} s; allowed: TV <= TN/4 = "
            f"{integral_time_s / 4.0:g} s"
        )
    factor = 0.5 * (1.0 + math.sqrt(1.0 - 4.0 * derivative_time_s / integral_time_s))
    return gain * factor, integral_time_s * factor, derivative_time_s / factor


def ideal_to_parallel(gain: float, integral_time_s: float, derivative_time_s: float) -> tuple[float, float, float]:
    """Return Kp [%/°C], Ki = K/TN [%/(°C·s)] and Kd = K·TV [%·s/°C]."""
    return gain, gain / integral_time_s, gain * derivative_time_s


def other_forms(gain: float, integral_time_s: float, derivative_time_s: float) -> dict[str, Any]:
    """Return the same controller as JSON holds it, "series" (None where there is none) and "parallel".

    "kp" [%/°C], "ki" [%/(°C·s)], "kd" [%·s/°C]; the series names are those of the ideal form.
    """
    forms: dict[str, Any] = {
        "series": None,
        "parallel": dict(
            zip(("kp", "ki", "kd"), ideal_to_parallel(gain, integral_time_s, derivative_time_s), strict=True)
        ),
    }
    if derivative_time_s <= integral_time_s / 4.0:
        names = ("gain_pct_per_degC", "integral_time_s", "derivative_time_s")
        series = ideal_to_series(gain, integral_time_s, derivative_time_s)
        forms["series"] = dict(zip(names, series, strict=True))
    return forms

"""Tuning rules for FOPDT models, as their authors print them.

All give the ideal form. Where a rule divides by the dead time, the sampled loop's own half sample counts as dead time
(S. Skogestad, J. Process Control 13 (2003), section 2.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from heatertune.errors import InputError, UnknownName
from heatertune.model.values import Fopdt

__all__ = ["RULES", "SOURCES", "Settings", "apply_rule"]

#: proportional gain [%/°C], TN [s], TV [s]
Settings = tuple[float, float, float]


def _simc(k: float, T: float, L: float, structure: str) -> Settings:
    if structure == "pid":
        raise InputError("SIMC gives PID settings only for a second lag; use --structure pi, or another --method")
    tau_c = L  # "tight" control
    return T / (k * (tau_c + L)), min(T, 4.0 * (tau_c + L)), 0.0


def _amigo(k: float, T: float, L: float, structure: str) -> Settings:
    if structure == "pi":
        gain = 0.15 / k + (0.35 - L * T / (L + T) ** 2) * T / (k * L)
        return gain, 0.35 * L + 13.0 * L * T**2 / (T**2 + 12.0 * L * T + 7.0 * L**2), 0.0
    gain = (0.2 + 0.45 * T / L) / k
    return gain, L * (0.4 * L + 0.8 * T) / (L + 0.1 * T), 0.5 * L * T / (0.3 * L + T)


def _lambda(k: float, T: float, L: float, structure: str) -> Settings:
    wanted = max(T, 3.0 * L)  # closed-loop time constant λ
    if structure == "pi":
        return T / (k * (wanted + L)), T, 0.0
    return (T + L / 2.0) / (k * (wanted + L / 2.0)), T + L / 2.0, T * L / (2.0 * T + L)


def _ziegler_nichols(k: float, T: float, L: float, structure: str) -> Settings:
    slope = k * L / T
    if structure == "pi":
        return 0.9 / slope, 3.0 * L, 0.0
    return 1.2 / slope, 2.0 * L, 0.5 * L


RULES: Final[dict[str, Callable[[float, float, float, str], Settings]]] = {
    "simc": _simc,
    "amigo": _amigo,
    "lambda": _lambda,
    "ziegler-nichols": _ziegler_nichols,
}

SOURCES: Final[dict[str, str]] = {
    "simc": "S. Skogestad, J. Process Control 13 (2003) 291–309, τc = θ",
    "amigo": "K. J. Åström and T. Hägglund, J. Process Control 14 (2004) 635–650",
    "lambda": "D. E. Rivera, M. Morari, S. Skogestad, Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252–265, "
    "λ = max(T, 3L)",
    "ziegler-nichols": "J. G. Ziegler and N. B. Nichols, Trans. ASME 64 (1942) 759–768, step response",
}


def apply_rule(method: str, model: Fopdt, structure: str, sample_time_s: float) -> Settings:
    """Return K, TN, TV of a rule for a model sampled every `sample_time_s` [s].

    Raises:
        UnknownName: no such rule.
        InputError: the rule does not give this structure.
    """
    if method not in RULES:
        raise UnknownName("tuning method", method, ("optimum", *RULES))
    dead = model.dead_time_s + sample_time_s / 2.0
    gain, integral, derivative = RULES[method](model.gain_degC_per_pct, model.time_constant_s, dead, structure)
    if structure == "p":
        return gain, math.inf, 0.0
    return gain, integral, derivative

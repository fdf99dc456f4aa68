"""uSORT for one lag: minimal IAE at a chosen Ms, after a load or a setpoint step.

The authors give rows for five ratios of two lags; only those for one lag stand here, each checked by the Ms it claims.
"""

from __future__ import annotations

from typing import Final

from heatertune.pid.forms import Settings
from heatertune.pid.rules.values import Formula, Rule, on_one_lag

__all__ = ["USORT"]

#: aim → structure → Ms → a0, a1, a2 of K = (a0 + a1·(L/T)^a2)/k
_GAINS: Final[dict[str, dict[str, dict[str, tuple[float, float, float]]]]] = {
    "load": {
        "pi": {
            "2.0": (0.265, 0.603, -0.971), "1.8": (0.229, 0.537, -0.952), "1.6": (0.175, 0.466, -0.911),
            "1.4": (0.016, 0.476, -0.708),
        },
        "pid": {
            "2.0": (0.235, 0.840, -0.919), "1.8": (0.210, 0.745, -0.919), "1.6": (0.179, 0.626, -0.921),
            "1.4": (0.155, 0.455, -0.939),
        },
    },
    "setpoint": {
        "pi": {"1.8": (0.243, 0.509, -1.063), "1.6": (0.209, 0.417, -1.064), "1.4": (0.164, 0.305, -1.066)},
        "pid": {
            "2.0": (0.377, 0.727, -1.041), "1.8": (0.335, 0.644, -1.040), "1.6": (0.282, 0.544, -1.038),
            "1.4": (0.214, 0.413, -1.036),
        },
    },
}

#: a copy of the authors' tables refuses this row below 0.4; at 0.1 its Ms is 1.47
_NARROWER: Final = {"pid": 0.4}


def _times(aim: str, structure: str, ratio: float) -> tuple[float, float]:
    """Return TN/T and TV/T; they are the same for every Ms."""
    if aim == "load" and structure == "pi":
        return -1.382 + 2.837 * ratio**0.211, 0.0
    if aim == "load":
        return -0.198 + 1.291 * ratio**0.485, 0.004 + 0.389 * ratio**0.869
    if structure == "pi":
        return (14.650 + 8.450 * ratio) / (15.740 + ratio), 0.0
    return (1687.0 + 339.2 * ratio + 39.86 * ratio**2) / (1299.0 + ratio), -0.016 + 0.333 * ratio**0.815


def _usort(aim: str, structure: str, ms: str) -> Formula:
    a0, a1, a2 = _GAINS[aim][structure][ms]

    def formula(k: float, T: float, L: float) -> Settings:
        integral, derivative = _times(aim, structure, L / T)
        return (a0 + a1 * (L / T) ** a2) / k, T * integral, T * derivative

    return on_one_lag(formula)


def _rule(aim: str, ms: str) -> Rule:
    return Rule(
        source="V. M. Alfaro and R. Vilanova, IFAC Proc. Vol. 45 (3) (2012) 572–577 (PID'12, Brescia), "
        f"uSORT1, {aim}, Ms {ms}",
        formulas={structure: _usort(aim, structure, ms) for structure in ("pi", "pid") if ms in _GAINS[aim][structure]},
        claim=f"Ms {ms}",
        least_ratio=0.1, most_ratio=2.0, narrower=_NARROWER if (aim, ms) == ("load", "1.4") else {},
    )


USORT: Final[dict[str, Rule]] = {
    f"usort-{aim}-{ms}": _rule(aim, ms) for aim in _GAINS for ms in ("2.0", "1.8", "1.6", "1.4")
}

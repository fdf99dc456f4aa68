"""Rules read from the reaction curve (k, T, L): Ziegler–Nichols, Cohen–Coon, Chien–Hrones–Reswick, AMIGO."""

from __future__ import annotations

import math
from typing import Final

from heatertune.pid.forms import Settings
from heatertune.pid.rules.values import Formula, Rule, on_one_lag

__all__ = ["REACTION"]

_CHR_SOURCE: Final = "K. L. Chien, J. A. Hrones, J. B. Reswick, Trans. ASME 74 (1952) 175–185"


def _ziegler_nichols_p(k: float, T: float, L: float) -> Settings:
    return T / (k * L), math.inf, 0.0


def _ziegler_nichols_pi(k: float, T: float, L: float) -> Settings:
    return 0.9 * T / (k * L), L / 0.3, 0.0  # printed as reset rate 0.3/L


def _ziegler_nichols_pid(k: float, T: float, L: float) -> Settings:
    return 1.2 * T / (k * L), 2.0 * L, 0.5 * L


def _cohen_coon_p(k: float, T: float, L: float) -> Settings:
    return (T / L + 1.0 / 3.0) / k, math.inf, 0.0


def _cohen_coon_pi(k: float, T: float, L: float) -> Settings:
    ratio = L / T
    return (0.9 / ratio + 1.0 / 12.0) / k, L * (30.0 + 3.0 * ratio) / (9.0 + 20.0 * ratio), 0.0


def _cohen_coon_pid(k: float, T: float, L: float) -> Settings:
    ratio = L / T
    gain = (4.0 / 3.0 / ratio + 1.0 / 4.0) / k
    return gain, L * (32.0 + 6.0 * ratio) / (13.0 + 8.0 * ratio), 4.0 * L / (11.0 + 2.0 * ratio)


def _amigo_pi(k: float, T: float, L: float) -> Settings:
    gain = 0.15 / k + (0.35 - L * T / (L + T) ** 2) * T / (k * L)
    return gain, 0.35 * L + 13.0 * L * T**2 / (T**2 + 12.0 * L * T + 7.0 * L**2), 0.0


def _amigo_pid(k: float, T: float, L: float) -> Settings:
    return (0.2 + 0.45 * T / L) / k, L * (0.4 * L + 0.8 * T) / (L + 0.1 * T), 0.5 * L * T / (0.3 * L + T)


#: per aim: P gain; PI gain, TN; PID gain, TN, TV. Gains over T/(k·L); TN over the unit of the aim; TV over L
_CHR: Final[dict[str, tuple[float, tuple[float, float], tuple[float, float, float]]]] = {
    "setpoint-0": (0.3, (0.35, 1.17), (0.6, 1.0, 0.5)),
    "setpoint-20": (0.7, (0.6, 1.0), (0.95, 1.36, 0.473)),
    "load-0": (0.3, (0.6, 4.0), (0.95, 2.38, 0.421)),
    "load-20": (0.7, (0.7, 2.33), (1.2, 2.0, 0.42)),
}


def _chien_hrones_reswick(aim: str) -> dict[str, Formula]:
    """Return the formulas of one aim; TN is printed in T for the setpoint and in L for the load."""
    p, (pi, pi_tn), (pid, pid_tn, tv) = _CHR[aim]
    in_lags = aim.startswith("setpoint")

    def formula(gain: float, integral: float, derivative: float) -> Formula:
        return on_one_lag(
            lambda k, T, L: (gain * T / (k * L), integral * (T if in_lags else L), derivative * L)
        )

    return {"p": formula(p, math.inf, 0.0), "pi": formula(pi, pi_tn, 0.0), "pid": formula(pid, pid_tn, tv)}


def _chr_rule(aim: str, claim: str, *errata: str) -> Rule:
    step, overshoot = aim.split("-")
    return Rule(
        source=f"{_CHR_SOURCE}, {step}, {overshoot} % overshoot",
        formulas=_chien_hrones_reswick(aim), claim=claim, least_ratio=0.11, most_ratio=1.0, errata=errata,
    )


REACTION: Final[dict[str, Rule]] = {
    "amigo": Rule(
        source="K. J. Åström and T. Hägglund, J. Process Control 14 (2004) 635–650, eqs. 5 and 7",
        formulas={"pi": on_one_lag(_amigo_pi), "pid": on_one_lag(_amigo_pid)},
        claim="Ms about 1.4",
    ),
    "ziegler-nichols": Rule(
        source="J. G. Ziegler and N. B. Nichols, Trans. ASME 64 (1942) 759–768, step response",
        formulas={
            "p": on_one_lag(_ziegler_nichols_p), "pi": on_one_lag(_ziegler_nichols_pi),
            "pid": on_one_lag(_ziegler_nichols_pid),
        },
        claim="each swing a quarter of the one before",
        most_ratio=1.0,
        errata=("Textbooks round the PI rule's TN = L/0.3 to 3·L, others to 3.3·L.",),
    ),
    "cohen-coon": Rule(
        source="G. H. Cohen and G. A. Coon, Trans. ASME 75 (1953) 827–834",
        formulas={
            "p": on_one_lag(_cohen_coon_p), "pi": on_one_lag(_cohen_coon_pi), "pid": on_one_lag(_cohen_coon_pid),
        },
        claim="each swing after a load step a quarter of the one before",
        most_ratio=1.0,
        errata=(
            "A copy drops L from TN and divides TV by it: neither is a time then.",
            "A copy in decimals prints 1.27 for 0.27 in the PI rule's TN = L·(0.9 + 0.083·L/T)/(0.27 + 0.6·L/T).",
        ),
    ),
    "chr-setpoint-0": _chr_rule(
        "setpoint-0", "no overshoot after a setpoint step", "Textbooks round the PI rule's TN = 1.17·T to 1.2·T."
    ),
    "chr-setpoint-20": _chr_rule(
        "setpoint-20", "20 % overshoot after a setpoint step",
        "Textbooks round the PID rule's TN = 1.36·T to 1.4·T or 1.35·T.",
    ),
    "chr-load-0": _chr_rule(
        "load-0", "no swing past the setpoint after a load step", "A copy prints TN = 4·T for the PI rule's 4·L."
    ),
    "chr-load-20": _chr_rule("load-20", "a swing of 20 % past the setpoint after a load step"),
}

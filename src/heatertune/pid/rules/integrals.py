"""Rules fitted to minima of error integrals: Lopez (load) and Rovira (setpoint).

Rovira's PID settings are minima only where D acts on the process variable: computed with exact dead time, all three
then lie within 9 % of the optimum for L/T = 0.3…1; with D on the error TN is 14–32 % too long. Lopez's rows for P are
left out: their criterion needs a resting value that no copy states.
"""

from __future__ import annotations

from typing import Final

from heatertune.pid.forms import Settings
from heatertune.pid.rules.values import Formula, Rule, on_one_lag

__all__ = ["INTEGRALS"]

#: a, b of K = a/k·(L/T)^b; a, b of TN = T/a·(L/T)^b; a, b of TV = a·T·(L/T)^b
_LOPEZ: Final[dict[str, dict[str, tuple[tuple[float, float], ...]]]] = {
    "iae": {
        "pi": ((0.984, -0.986), (0.608, 0.707)),
        "pid": ((1.435, -0.921), (0.878, 0.749), (0.482, 1.137)),
    },
    "ise": {
        "pi": ((1.305, -0.959), (0.492, 0.739)),
        "pid": ((1.495, -0.945), (1.101, 0.771), (0.560, 1.006)),
    },
    "itae": {
        "pi": ((0.859, -0.977), (0.674, 0.680)),
        "pid": ((1.357, -0.947), (0.842, 0.738), (0.381, 0.995)),
    },
}

#: a, b of K = a/k·(L/T)^b; a, b of TN = T/(a + b·L/T); a, b of TV = a·T·(L/T)^b
_ROVIRA: Final[dict[str, dict[str, tuple[tuple[float, float], ...]]]] = {
    "iae": {
        "pi": ((0.758, -0.861), (1.020, -0.323)),
        "pid": ((1.086, -0.869), (0.740, -0.130), (0.348, 0.914)),
    },
    "itae": {
        "pi": ((0.586, -0.916), (1.030, -0.165)),
        "pid": ((0.965, -0.850), (0.796, -0.1465), (0.308, 0.929)),
    },
}


def _lopez(row: tuple[tuple[float, float], ...]) -> Formula:
    def formula(k: float, T: float, L: float) -> Settings:
        (a, b), (c, d), (e, f) = (*row, (0.0, 0.0))[:3]
        ratio = L / T
        return a / k * ratio**b, T / c * ratio**d, e * T * ratio**f

    return on_one_lag(formula)


def _rovira(row: tuple[tuple[float, float], ...]) -> Formula:
    def formula(k: float, T: float, L: float) -> Settings:
        (a, b), (c, d), (e, f) = (*row, (0.0, 0.0))[:3]
        ratio = L / T
        return a / k * ratio**b, T / (c + d * ratio), e * T * ratio**f

    return on_one_lag(formula)


def _lopez_rule(criterion: str, *errata: str) -> Rule:
    return Rule(
        source="A. M. Lopez, J. A. Miller, C. L. Smith, P. W. Murrill, Instrum. Technol. 14 (11) (1967) 57–62, "
        f"{criterion.upper()}",
        formulas={structure: _lopez(row) for structure, row in _LOPEZ[criterion].items()},
        claim=f"the smallest {criterion.upper()} after a load step",
        least_ratio=0.1, most_ratio=1.0, errata=errata,
    )


def _rovira_rule(criterion: str, *errata: str) -> Rule:
    return Rule(
        source="A. A. Rovira, P. W. Murrill, C. L. Smith, Instrum. Control Syst. 42 (12) (1969) 67–69, "
        f"{criterion.upper()}",
        formulas={structure: _rovira(row) for structure, row in _ROVIRA[criterion].items()},
        claim=f"the smallest {criterion.upper()} after a setpoint step; PID: with the D part on the process variable",
        least_ratio=0.1, most_ratio=1.0, errata=errata,
    )


INTEGRALS: Final[dict[str, Rule]] = {
    "lopez-iae": _lopez_rule("iae"),
    "lopez-ise": _lopez_rule("ise", "Some copies print the PI gain's exponent −0.959 as −0.960."),
    "lopez-itae": _lopez_rule("itae"),
    "rovira-iae": _rovira_rule(
        "iae", "A common copy computes TN of the PID rule as T·(0.740 − 0.130·L/T), which forgets the reciprocal."
    ),
    "rovira-itae": _rovira_rule(
        "itae", "A copy prints the PID gain's exponent −0.850 as −0.865."
    ),
}

"""Tuning rules as printed by their authors, each with source, range and claim; results are in the ideal form.

Families: direct shaping of the loop (SIMC, lambda, IMC, Haalman), minima of error integrals (Lopez, Rovira), the
reaction curve (Ziegler–Nichols, Cohen–Coon, Chien–Hrones–Reswick, AMIGO), the exact ultimate cycle Ku, Pu, and uSORT
(minimal IAE at a chosen Ms; only the authors' rows for one lag, each checked against its Ms). Half a sampling interval
is added to the dead time (S. Skogestad, J. Process Control 13 (2003), section 2.2).

Rovira's PID settings are minima only if D acts on the process variable: with exact dead time all three are then within
9 % of the optimum for L/T = 0.3…1; with D on the error TN is 14–32 % too long. Lopez's rows for P are omitted: their
criterion needs a steady-state value that no available copy states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import FittedModel, HeaterModel, TwoLag
from heatertune.model.reduction import ultimate_period_s
from heatertune.pid.design_values import Settings, series_to_ideal
from heatertune.units import check

__all__ = [
    "DIRECT", "INTEGRALS", "REACTION", "RULES", "ULTIMATE", "USORT", "Formula", "Rule", "apply_rule", "model_for",
    "on_one_lag", "range_note", "ultimate_cycle",
]


#: model (dead time with the half sample in it), wanted closed-loop time constant [s] or None → settings as printed
Formula = Callable[[HeaterModel, float | None], Settings]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One tuning rule.

    Attributes:
        source: authors, journal, volume, year, pages, table or equation.
        formulas: structure → formula.
        claim: its authors' claim about the tuned loop.
        form: the form the settings are printed in, "ideal" or "series".
        least_ratio, most_ratio: dead time over time constant its authors cover.
        narrower: structure → least ratio, if a structure has a larger lower limit.
        two_lags: structures that need a model with two lags.
        closed_loop: name of its free closed-loop time constant, None if it has none.
        errata: errors and differences in common copies, one sentence each.

    Raises:
        OutOfRange: an unknown form, an empty range.
    """

    source: str
    formulas: Mapping[str, Formula]
    claim: str
    form: str = "ideal"
    least_ratio: float = 0.0
    most_ratio: float = math.inf
    narrower: Mapping[str, float] = field(default_factory=dict)
    two_lags: tuple[str, ...] = ()
    closed_loop: str | None = None
    errata: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.form not in ("ideal", "series"):
            raise OutOfRange("form", self.form, "'ideal' or 'series'")
        if not 0.0 <= self.least_ratio < self.most_ratio:
            raise OutOfRange("least_ratio", self.least_ratio, f">= 0 and < most_ratio = {self.most_ratio:g}")


def on_one_lag(formula: Callable[[float, float, float], Settings]) -> Formula:
    """Return a formula in k [°C/%], T [s] and L [s] as one that takes any model, by way of its half rule."""

    def applied(model: HeaterModel, wanted_s: float | None) -> Settings:  # noqa: ARG001 - leaves nothing open
        one = model.half_rule()
        return formula(one.gain_degC_per_pct, one.time_constant_s, one.dead_time_s)

    return applied


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
        return on_one_lag(lambda k, T, L: (gain * T / (k * L), integral * (T if in_lags else L), derivative * L))

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


def ultimate_cycle(model: HeaterModel) -> tuple[float, float]:
    """Return Ku [%/°C] and Pu [s]: the P gain at which the loop swings for ever, and the period of that swing.

    The phase ω·L + Σ atan(ω·T) = π has one root below π/L, as it rises with ω. It bends down, so Newton's method comes
    to the root from below.

    Raises:
        OutOfRange: no dead time: one or two lags alone never reach −180°.
    """
    dead = model.dead_time_s
    if dead <= 0.0:
        raise OutOfRange("dead_time_s", dead, "> 0: without dead time no P gain makes the loop swing for ever")
    if model.fast_share is not None:  # with a zero the phase does not bend down everywhere
        omega = 2.0 * math.pi / ultimate_period_s(model)
        return 1.0 / abs(complex(model.frequency_response(np.array([omega]))[0])), 2.0 * math.pi / omega

    def lacking(angle: float) -> float:
        return angle + sum(math.atan(angle * lag / dead) for lag in model.lags_s) - math.pi

    angle, last = 0.0, -1.0
    while angle > last:
        slope = 1.0 + sum(lag * dead / (dead**2 + (angle * lag) ** 2) for lag in model.lags_s)
        angle, last = angle - lacking(angle) / slope, angle
    omega = last / dead
    size = math.prod(math.hypot(1.0, omega * lag) for lag in model.lags_s)
    return size / model.gain_degC_per_pct, 2.0 * math.pi / omega


def _from_cycle(formula: Callable[[float, float], Settings]) -> Formula:
    """Return a formula in Ku and Pu as one that takes a model."""

    def applied(model: HeaterModel, wanted_s: float | None) -> Settings:  # noqa: ARG001 - leaves nothing open
        return formula(*ultimate_cycle(model))

    return applied


ULTIMATE: Final[dict[str, Rule]] = {
    "ziegler-nichols-ultimate": Rule(
        source="J. G. Ziegler and N. B. Nichols, Trans. ASME 64 (1942) 759–768, ultimate sensitivity",
        formulas={
            "p": _from_cycle(lambda Ku, Pu: (0.5 * Ku, math.inf, 0.0)),  # noqa: ARG005 - Pu plays no part
            "pi": _from_cycle(lambda Ku, Pu: (0.45 * Ku, Pu / 1.2, 0.0)),
            "pid": _from_cycle(lambda Ku, Pu: (0.6 * Ku, Pu / 2.0, Pu / 8.0)),
        },
        claim="each swing a quarter of the one before",
        errata=("A textbook prints 0.4·Ku and 0.8·Pu for PI.",),
    ),
    "tyreus-luyben": Rule(
        source="B. D. Tyreus and W. L. Luyben, Ind. Eng. Chem. Res. 31 (1992) 2625–2628 (PI); "
        "W. L. Luyben, Ind. Eng. Chem. Res. 35 (1996) 3480–3483 (PID)",
        formulas={
            "pi": _from_cycle(lambda Ku, Pu: (0.31 * Ku, 2.2 * Pu, 0.0)),
            "pid": _from_cycle(lambda Ku, Pu: (0.46 * Ku, 2.2 * Pu, Pu / (2.0 * math.pi))),
        },
        form="series",
        claim="Mt of 2 dB (1.26) where the lag acts as an integrator",
        errata=(
            "Textbooks round the gains to Ku/3.2 and Ku/2.2, and TV = 1/ωu to Pu/6.3; a copy gives PID the gain of PI.",
            "The PID rule is for the series form; most copies print it without saying so.",
        ),
    ),
}


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


def _rule_direct(aim: str, ms: str) -> Rule:
    return Rule(
        source="V. M. Alfaro and R. Vilanova, IFAC Proc. Vol. 45 (3) (2012) 572–577 (PID'12, Brescia), "
        f"uSORT1, {aim}, Ms {ms}",
        formulas={structure: _usort(aim, structure, ms) for structure in ("pi", "pid") if ms in _GAINS[aim][structure]},
        claim=f"Ms {ms}",
        least_ratio=0.1, most_ratio=2.0, narrower=_NARROWER if (aim, ms) == ("load", "1.4") else {},
    )


USORT: Final[dict[str, Rule]] = {
    f"usort-{aim}-{ms}": _rule_direct(aim, ms) for aim in _GAINS for ms in ("2.0", "1.8", "1.6", "1.4")
}


def _simc_pi(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    total = (one.dead_time_s if wanted_s is None else wanted_s) + one.dead_time_s
    return one.time_constant_s / (one.gain_degC_per_pct * total), min(one.time_constant_s, 4.0 * total), 0.0


def _simc_pid(model: HeaterModel, wanted_s: float | None) -> Settings:
    two = _two_lags(model, "SIMC")
    total = (two.dead_time_s if wanted_s is None else wanted_s) + two.dead_time_s
    slow = two.time_constant_s
    return slow / (two.gain_degC_per_pct * total), min(slow, 4.0 * total), two.second_time_constant_s


def _improved_pi(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    return _simc_pi(replace(one, time_constant_s=one.time_constant_s + one.dead_time_s / 3.0), wanted_s)


def _improved_pid(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    gain, integral, _ = _simc_pi(one, wanted_s)
    return gain, integral, one.dead_time_s / 3.0


def _lambda_pi(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    lam = max(one.time_constant_s, 3.0 * one.dead_time_s) if wanted_s is None else wanted_s
    return one.time_constant_s / (one.gain_degC_per_pct * (lam + one.dead_time_s)), one.time_constant_s, 0.0


def _lambda_pid(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    return _imc_pid(model, max(one.time_constant_s, 3.0 * one.dead_time_s) if wanted_s is None else wanted_s)


def _imc_pi(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    lam = max(0.1 * one.time_constant_s, 1.7 * one.dead_time_s) if wanted_s is None else wanted_s
    integral = one.time_constant_s + one.dead_time_s / 2.0
    return integral / (one.gain_degC_per_pct * lam), integral, 0.0


def _imc_pid(model: HeaterModel, wanted_s: float | None) -> Settings:
    one = model.half_rule()
    T, L = one.time_constant_s, one.dead_time_s
    lam = max(0.1 * T, 0.8 * L) if wanted_s is None else wanted_s
    integral = T + L / 2.0
    return integral / (one.gain_degC_per_pct * (lam + L / 2.0)), integral, T * L / (2.0 * T + L)


def _haalman_pi(model: HeaterModel, wanted_s: float | None) -> Settings:  # noqa: ARG001 - leaves nothing open
    one = model.half_rule()
    return 2.0 * one.time_constant_s / (3.0 * one.gain_degC_per_pct * one.dead_time_s), one.time_constant_s, 0.0


def _haalman_pid(model: HeaterModel, wanted_s: float | None) -> Settings:  # noqa: ARG001 - leaves nothing open
    two = _two_lags(model, "Haalman's rule")
    slow = two.time_constant_s
    return 2.0 * slow / (3.0 * two.gain_degC_per_pct * two.dead_time_s), slow, two.second_time_constant_s


def _two_lags(model: HeaterModel, rule: str) -> TwoLag:
    if isinstance(model, TwoLag) and model.fast_share is None:
        return model
    raise InputError(f"{rule} gives PID settings only for a second lag; use --structure pi, or another --method")


_RIVERA: Final = "D. E. Rivera, M. Morari, S. Skogestad, Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252–265"

DIRECT: Final[dict[str, Rule]] = {
    "simc": Rule(
        source="S. Skogestad, J. Process Control 13 (2003) 291–309, eqs. 23–25",
        formulas={"pi": _simc_pi, "pid": _simc_pid},
        claim="τc = θ: Ms 1.59, gain margin 3.14, phase margin 61.4°; Ms 1.70 where the lag acts as an integrator",
        form="series",
        two_lags=("pid",),
        closed_loop="τc",
        errata=("Copies that give SIMC's PID in the ideal form without the factor 1 + τD/τI change the rule.",),
    ),
    "lambda": Rule(
        source=f"E. B. Dahlin, Instrum. Control Syst. 41 (1968) 77–83 (PI); {_RIVERA}, table 2 (PID)",
        formulas={"pi": _lambda_pi, "pid": _lambda_pid},
        claim="a setpoint response without overshoot, 63 % of it after L + λ; λ = max(T, 3·L) here",
        closed_loop="λ",
    ),
    "imc": Rule(
        source=f"{_RIVERA}, table 2",
        formulas={"pi": _imc_pi, "pid": _imc_pid},
        claim="a first-order response with the time constant λ, 1.7·θ (PI), 0.8·θ (PID) or 0.1·τ at least, as here",
        closed_loop="λ",
        errata=("A copy prints TN = τ + θ/τ, which is no time: it is τ + θ/2.",),
    ),
    "simc-improved": Rule(
        source="C. Grimholt and S. Skogestad, IFAC Proc. Vol. 45 (3) (2012) 11–22 (PID'12, Brescia), section 5 (PI); "
        "J. Process Control 70 (2018) 36–46 (PID)",
        formulas={"pi": _improved_pi, "pid": _improved_pid},
        claim="τc = θ: as robust as SIMC where the lag acts as an integrator (PI: Ms 1.70), and no mere integrator "
        "where dead time prevails",
        form="series",
        closed_loop="τc",
        errata=("Two rules go by this name: T grows by θ/3 in the PI rule of 2012, TV is θ/3 in the PID rule of 2018.",
                ),
    ),
    "haalman": Rule(
        source="A. Haalman, Control Eng. 12 (7) (1965) 71–73; K. J. Åström and T. Hägglund, PID Controllers, "
        "2nd ed. (ISA, 1995), section 4.5",
        formulas={"pi": _haalman_pi, "pid": _haalman_pid},
        claim="the loop is 2/(3·L·s)·e^(−L·s) whatever the lags: Ms 1.9; slow to recover from a load on a slow lag",
        form="series",
        two_lags=("pid",),
    ),
}


RULES: Final[dict[str, Rule]] = DIRECT | REACTION | ULTIMATE | INTEGRALS | USORT


def apply_rule(
    method: str, model: HeaterModel, structure: str, sample_time_s: float, *, closed_loop_s: float | None = None
) -> Settings:
    """Return K [%/°C], TN [s] and TV [s] of a rule, in the ideal form.

    Args:
        method: name of the rule.
        model: the heater; a rule for one lag takes the half rule of two.
        structure: "p", "pi" or "pid".
        sample_time_s: TA [s]; half of it counts as dead time.
        closed_loop_s: τc of SIMC, λ of lambda tuning and IMC [s]; None: the rule's own choice.

    Raises:
        UnknownName: no such rule.
        OutOfRange: a closed-loop time that is not positive; no dead time at all.
        InputError: the rule does not give this structure or has no free closed-loop time, or its formula gives
            negative times because the model is far outside its range.
    """
    rule = _rule(method)
    if structure not in rule.formulas:
        settings = " and ".join(name.upper() for name in rule.formulas)
        raise InputError(f"{method} gives {settings} settings, none for {structure.upper()}; "
                         "use another --structure or --method")
    if closed_loop_s is not None:
        check("closed_loop_s", closed_loop_s, above=0.0)
        if rule.closed_loop is None:
            open_ones = ", ".join(name for name, other in RULES.items() if other.closed_loop is not None)
            raise InputError(f"{method} has no free closed-loop time constant; rules that have one: {open_ones}")
    sampled_model = _as_sampled(model, sample_time_s)
    printed = rule.formulas[structure](sampled_model, closed_loop_s)
    gain, integral, derivative = series_to_ideal(*printed) if rule.form == "series" else printed
    if integral <= 0.0 or derivative < 0.0:
        raise InputError(f"{method} gives K = {gain:.4g} %/°C, TN = {integral:.4g} s, TV = {derivative:.4g} s here, "
                         f"which no controller can hold; {range_note(method, model, structure, sample_time_s)}")
    return gain, integral, derivative


def model_for(method: str, structure: str, fitted: FittedModel) -> HeaterModel:
    """Return the model a rule is applied to.

    This is the working model, with two lags if it has them, or the candidate with two lags that fits best if the rule
    needs two.

    Raises:
        UnknownName: no such rule.
    """
    if structure in _rule(method).two_lags:
        return next((plant for plant in fitted.plants if isinstance(plant, TwoLag) and plant.fast_share is None),
                    fitted.model)
    return next((plant for plant in fitted.plants if plant.half_rule() == fitted.model), fitted.model)


def range_note(method: str, model: HeaterModel, structure: str, sample_time_s: float) -> str | None:
    """Return in one sentence that a model lies outside the range of a rule; None if it lies inside.

    Raises:
        UnknownName, OutOfRange: as `apply_rule`.
    """
    rule = _rule(method)
    one = _as_sampled(model, sample_time_s).half_rule()
    ratio = one.dead_time_s / one.time_constant_s
    least = rule.narrower.get(structure, rule.least_ratio)
    if least <= ratio <= rule.most_ratio:
        return None
    low = f"{least:g} <= " if least > 0.0 else ""
    return f"Made for {low}L/T <= {rule.most_ratio:g}; L/T is {ratio:.3g} here, half a sample included."


def _rule(method: str) -> Rule:
    if method not in RULES:
        raise UnknownName("tuning method", method, ("optimum", *RULES))
    return RULES[method]


def _as_sampled(model: HeaterModel, sample_time_s: float) -> HeaterModel:
    dead = model.dead_time_s + sample_time_s / 2.0
    if dead <= 0.0:
        raise OutOfRange("dead_time_s", dead, "> 0 with half a sampling interval added: the rules divide by it")
    return replace(model, dead_time_s=dead)

"""Rules that shape the loop directly: SIMC, as it was and improved, lambda tuning, IMC, Haalman's."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from heatertune.errors import InputError
from heatertune.model.values import HeaterModel, TwoLag
from heatertune.pid.forms import Settings
from heatertune.pid.rules.values import Rule

__all__ = ["DIRECT"]


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
    if isinstance(model, TwoLag):
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

"""Every rule by its own claim, on the continuous loop with exact dead time that `exact_loop` computes."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.pid import exact_loop
from tests.pid.exact_loop import one_lag, two_lags

from heatertune.errors import OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.rules import RULES, apply_rule, range_note, ultimate_cycle

EACH = [(name, structure) for name, rule in RULES.items() for structure in rule.formulas]
N = 10.0  # filter of the derivative part, where the authors have one


def _margins(settings, model, n=math.inf):
    return exact_loop.margins(settings, model.gain_degC_per_pct, model.lags_s, model.dead_time_s, n)


def _rule(method, ratio, structure):
    return apply_rule(method, one_lag(ratio), structure, 0.0)


# --- the helper itself -----------------------------------------------------------------------------------------------


def test_the_helper_gives_the_margins_of_a_loop_worked_out_by_hand():
    # L(s) = e^(-s)/(2s): gain margin π, phase margin 90° − ½ rad
    _, _, gain_margin, phase_margin = _margins((5.0, 10.0, 0.0), one_lag(0.1, lag=10.0))
    assert gain_margin == pytest.approx(math.pi, rel=1e-4)
    assert phase_margin == pytest.approx(90.0 - math.degrees(0.5), abs=0.01)


def test_the_helper_gives_a_response_worked_out_by_hand():
    # P control of a lag, before the dead time is over a second time: k·K·(1 − e^(−(t − L)/T))
    time, y = exact_loop.respond((2.0, math.inf, 0.0), 1.0, [3.0], 1.0, until=1.9, setpoint=1.0)
    assert y == pytest.approx(np.where(time > 1.0, 2.0 * (1.0 - np.exp(-(time - 1.0) / 3.0)), 0.0), abs=0.005)


# --- robustness the authors claim ------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.13, 0.3, 1.0, 3.0])
def test_simc_on_one_lag(ratio):
    # Skogestad 2003, table 1, first-order column: Ms 1.59, Mt 1.00, gain margin 3.14, phase margin 61.4°
    found = _margins(_rule("simc", ratio, "pi"), one_lag(ratio))
    assert found == pytest.approx((1.59, 1.00, 3.14, 61.4), abs=0.05)
    assert found[0] == pytest.approx(1.59, abs=0.005)


def test_simc_where_the_lag_acts_as_an_integrator():
    # Skogestad 2003, table 1, integrating column: Ms 1.70, Mt 1.30, gain margin 2.96, phase margin 46.9°
    model = one_lag(1e-4, gain=1e4, lag=1e4)
    found = _margins(apply_rule("simc", model, "pi", 0.0), model)
    assert found == pytest.approx((1.70, 1.30, 2.96, 46.9), abs=0.05)
    assert found[:2] == pytest.approx((1.70, 1.30), abs=0.005)


@pytest.mark.parametrize("lags", [(7.0, 3.0), (4.0, 4.0), (2.0, 0.5)])
def test_simc_on_two_lags_has_the_margins_of_one_lag(lags):
    # Skogestad 2003, section 4: for τ1 ≤ 8θ both lags cancel and the loop is e^(−θs)/(2θs) once more
    found = _margins(apply_rule("simc", two_lags(*lags), "pid", 0.0), two_lags(*lags))
    assert found == pytest.approx((1.59, 1.00, 3.14, 61.4), abs=0.05)


def test_simc_gives_the_settings_of_its_first_example():
    # Skogestad 2003, table 3, E1: PI for k 1, τ 2.5, θ 1.47: 0.85, 2.5; series PID for τ 2 and 1.2, θ 0.77: 1.30, 2, 1.2
    assert apply_rule("simc", one_lag(1.47 / 2.5, lag=2.5), "pi", 0.0) == pytest.approx((0.85, 2.5, 0.0), rel=0.005)
    factor = 1.6
    assert apply_rule("simc", two_lags(2.0, 1.2, dead=0.77), "pid", 0.0) == pytest.approx(
        (1.30 * factor, 2.0 * factor, 1.2 / factor), rel=0.005
    )


def test_the_improved_simc_is_simc_where_the_lag_acts_as_an_integrator():
    # Grimholt and Skogestad 2012, section 5: T + θ/3 is T there; Skogestad 2003, table 1: Ms 1.70, Mt 1.30
    model = one_lag(1e-4, gain=1e4, lag=1e4)
    found = _margins(apply_rule("simc-improved", model, "pi", 0.0), model)
    assert found[:2] == pytest.approx((1.70, 1.30), abs=0.005)


@pytest.mark.parametrize("ratio", [3.0, 10.0, 100.0])
def test_the_improved_simc_is_faster_than_simc_where_dead_time_prevails(ratio):
    # the same, abstract: SIMC's pure integrator is sluggish there. The settings for a pure dead
    # time are K = 1/(6k), TN = θ/3 (section 5 with T = 0, τc = θ)
    model = one_lag(ratio)
    plain, improved = (apply_rule(name, model, "pi", 0.0) for name in ("simc", "simc-improved"))
    if ratio == 100.0:
        assert improved == pytest.approx((1.0 / 6.0, ratio / 3.0, 0.0), rel=0.04)
    assert _margins(improved, model)[0] < 1.61
    costs = []
    for settings in (plain, improved):
        time, y = exact_loop.respond(settings, 1.0, [1.0], ratio, until=30.0 * ratio, setpoint=1.0)
        costs.append(np.abs(1.0 - y).mean() * time[-1] / ratio)
    assert costs[1] < 0.95 * costs[0]


@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0])
def test_the_improved_simc_pid_is_simcs_loop_with_a_lead_of_a_third_of_the_dead_time(ratio):
    # Grimholt and Skogestad 2018, abstract: τD = θ/3 in the series form; for T ≤ 8θ the lag cancels and the loop is
    # e^(−θs)·(1 + θs/3)/(2θs), whatever T is
    s = 1j * np.geomspace(1e-2, 1e2, 40)
    loop = exact_loop.controller(_rule("simc-improved", ratio, "pid"), s) * exact_loop.plant(1.0, [1.0], ratio, s)
    assert loop == pytest.approx(np.exp(-ratio * s) * (1.0 + ratio * s / 3.0) / (2.0 * ratio * s), rel=1e-9)


@pytest.mark.parametrize("model", [one_lag(0.13), one_lag(0.3), one_lag(3.0), two_lags(7.0, 3.0), two_lags(2.0, 0.5)])
def test_haalmans_loop_is_the_same_whatever_the_lags(model):
    # Åström and Hägglund 1995, section 4.5: Ms 1.9; by hand, for 2/(3s)·e^(−s): gain margin 3π/4 at π/2, phase margin
    # 90° − 2/3 rad
    structure = "pid" if len(model.lags_s) == 2 else "pi"
    ms, _, gain_margin, phase_margin = _margins(apply_rule("haalman", model, structure, 0.0), model)
    assert ms == pytest.approx(1.9, abs=0.05)
    assert gain_margin == pytest.approx(0.75 * math.pi, rel=1e-3)
    assert phase_margin == pytest.approx(90.0 - math.degrees(2.0 / 3.0), abs=0.05)


@pytest.mark.parametrize("ratio", [0.05, 0.2, 0.7, 1.5])
def test_amigo_pid_has_the_sensitivity_it_is_made_for(ratio):
    # Åström and Hägglund 2004, section 5: Ms = 1.4 within 15 % over their batch; the FOPDT lies near the middle
    assert _margins(_rule("amigo", ratio, "pid"), one_lag(ratio))[0] == pytest.approx(1.4, abs=0.015)


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.5, 1.0, 2.0])
def test_amigo_pi_is_no_less_robust_than_it_is_made_for(ratio):
    # the same: the PI rule is fitted to a batch whose hardest plants reach 1.4; the FOPDT stays below
    assert 1.2 < _margins(_rule("amigo", ratio, "pi"), one_lag(ratio))[0] < 1.41


@pytest.mark.parametrize(("method", "structure"), [each for each in EACH if each[0].startswith("usort")])
@pytest.mark.parametrize("ratio", [0.1, 0.2, 0.4, 1.0, 2.0])
def test_usort_has_the_ms_in_its_name(method, structure, ratio):
    # Alfaro and Vilanova 2012: each row claims its Ms, the derivative filtered with N = 10. The coefficients come from
    # one copy, so this is their only witness: what is mistyped in it (11 of 75 rows) does not meet its claim
    if range_note(method, one_lag(ratio), structure, 0.0) is None:
        ms = _margins(_rule(method, ratio, structure), one_lag(ratio), N)[0]
        assert ms == pytest.approx(float(method.rsplit("-", 1)[1]), abs=0.03)


def test_tyreus_and_luyben_reach_two_decibels_on_an_integrator_with_dead_time():
    # Tyreus and Luyben 1992 print K = 0.487/(k·L), TN = 8.75·L, made for a closed-loop peak of +2 dB
    model = one_lag(1e-4, gain=1e4, lag=1e4)
    settings = apply_rule("tyreus-luyben", model, "pi", 0.0)
    assert settings == pytest.approx((0.487, 8.75, 0.0), rel=0.01)
    assert _margins(settings, model)[1] == pytest.approx(10.0 ** (2.0 / 20.0), rel=0.01)


def test_luybens_pid_reaches_two_decibels_in_the_series_form_and_only_there():
    # Luyben 1996: 0.46·Ku, 2.2·Pu, 1/ωu with a filter of TV/10 behind the series D part
    model = one_lag(1e-4, gain=1e4, lag=1e4)
    Ku, Pu = ultimate_cycle(model)
    tv = Pu / (2.0 * math.pi)
    s = 1j * np.geomspace(1e-4, 30.0, 40_000)
    plant = exact_loop.plant(1e4, (1e4,), 1.0, s)
    series = 0.46 * Ku * (1.0 + 1.0 / (2.2 * Pu * s)) * (1.0 + tv * s) / (1.0 + 0.1 * tv * s) * plant
    ideal = exact_loop.controller((0.46 * Ku, 2.2 * Pu, tv), s, N) * plant
    peaks = [20.0 * math.log10(np.max(np.abs(loop / (1.0 + loop)))) for loop in (series, ideal)]
    assert peaks[0] == pytest.approx(2.0, abs=0.1)
    assert peaks[1] > 2.4
    gain, tn, tv_ideal = apply_rule("tyreus-luyben", model, "pid", 0.0)
    unfiltered = 0.46 * Ku * (1.0 + 1.0 / (2.2 * Pu * s)) * (1.0 + tv * s)
    assert exact_loop.controller((gain, tn, tv_ideal), s) == pytest.approx(unfiltered, rel=1e-6)


# --- responses the authors claim -------------------------------------------------------------------------------------


def _overshoot(settings, ratio):
    """Overshoot after a setpoint step as a share of where the response comes to rest."""
    time, y = exact_loop.respond(settings, 1.0, [1.0], ratio, until=25.0, setpoint=1.0)
    assert abs(y[-1] - y[len(time) // 2]) < 0.01
    return y.max() / y[-1] - 1.0


def _load_swings(settings, ratio):
    _, y = exact_loop.respond(settings, 1.0, [1.0], ratio, until=25.0, load=1.0)
    return exact_loop.swings(y - y[-1])


@pytest.mark.parametrize("structure", ["pi", "pid"])
@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0])
def test_lambda_tuning_responds_without_overshoot_in_lambda_and_the_dead_time(ratio, structure):
    # Dahlin 1968; λ = max(T, 3L) here. PI aims at e^(−Ls) ≈ 1 − Ls, so T(s) = (1 − Ls)/(λs + 1) covers 63.2 % in
    # λ(1 + ln(1 + L/λ)); PID aims at Padé's (1 − Ls/2)/(λs + 1)
    lam, late = max(1.0, 3.0 * ratio), ratio if structure == "pi" else ratio / 2.0
    settings = _rule("lambda", ratio, structure)
    time, y = exact_loop.respond(settings, 1.0, [1.0], ratio, until=25.0, setpoint=1.0)
    assert y.max() < 1.003
    assert time[np.argmax(y > 1.0 - math.exp(-1.0))] == pytest.approx(
        lam * (1.0 + math.log(1.0 + late / lam)), rel=0.05
    )


@pytest.mark.parametrize("ratio", [0.1, 0.5, 2.0])
def test_imc_pid_cancels_the_lag_and_leaves_the_loop_rivera_derives(ratio):
    # Rivera et al. 1986, section 4: a first-order Padé plant gives G·C = e^(−Ls)·(1 + Ls/2)/((λ + L/2)s), λ = 0.8L or 0.1T
    lam = max(0.1, 0.8 * ratio)
    s = 1j * np.geomspace(1e-2, 1e2, 40)
    expected = np.exp(-ratio * s) * (1.0 + ratio * s / 2.0) / ((lam + ratio / 2.0) * s)
    loop = exact_loop.controller(_rule("imc", ratio, "pid"), s) * exact_loop.plant(1.0, [1.0], ratio, s)
    assert loop == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.1, 0.5, 2.0])
def test_imc_pi_costs_lambda_per_unit_of_load(ratio):
    # Rivera et al. 1986, table 2, improved PI: TN/K = k·λ, TN = τ + θ/2, λ = 1.7θ or 0.1τ
    gain, tn, _ = _rule("imc", ratio, "pi")
    assert tn / gain == pytest.approx(max(0.1, 1.7 * ratio))
    assert tn == pytest.approx(1.0 + ratio / 2.0)


@pytest.mark.parametrize(("method", "structure", "least", "most"), [
    # 0 %: what the authors saw as none is up to 7 % with exact dead time
    ("chr-setpoint-0", "p", 0.0, 0.03), ("chr-setpoint-0", "pi", 0.0, 0.01), ("chr-setpoint-0", "pid", 0.0, 0.07),
    # 20 %: P meets it; PI stays at 12 %; PID runs from 35 % to 4 % over the range
    ("chr-setpoint-20", "p", 0.19, 0.24), ("chr-setpoint-20", "pi", 0.10, 0.14), ("chr-setpoint-20", "pid", 0.03, 0.36),
])
def test_chien_hrones_reswick_overshoot_after_a_setpoint_step(method, structure, least, most):
    for ratio in (0.12, 0.3, 0.6, 1.0):
        assert least <= _overshoot(_rule(method, ratio, structure), ratio) + 1e-6 <= most, ratio


@pytest.mark.parametrize(("method", "structure", "least", "most"), [
    # the swing past the rest as a share of the first one; P and PI at small L/T show what the authors aimed at
    ("chr-load-0", "p", 0.0, 0.03), ("chr-load-0", "pi", 0.0, 0.01), ("chr-load-0", "pid", 0.0, 0.06),
    ("chr-load-20", "p", 0.18, 0.23), ("chr-load-20", "pi", 0.15, 0.27),
])
def test_chien_hrones_reswick_swing_past_the_setpoint_after_a_load_step(method, structure, least, most):
    for ratio in (0.12, 0.16):
        deviation = _load_swings(_rule(method, ratio, structure), ratio)
        past = max(0.0, -float(deviation.min()) / float(deviation.max())) if len(deviation) else 0.0
        assert least <= past <= most, ratio


@pytest.mark.parametrize(("method", "structure", "least", "most"), [
    # both claim a quarter. Cohen and Coon meet it, with exact dead time, at 0.1 ≤ L/T ≤ 0.5; Ziegler and Nichols, who
    # tuned by hand, come as near as told here
    ("cohen-coon", "p", 0.23, 0.27), ("cohen-coon", "pi", 0.21, 0.27), ("cohen-coon", "pid", 0.23, 0.29),
    ("ziegler-nichols", "p", 0.15, 0.22), ("ziegler-nichols", "pi", 0.10, 0.22), ("ziegler-nichols", "pid", 0.25, 0.31),
    ("ziegler-nichols-ultimate", "p", 0.08, 0.15), ("ziegler-nichols-ultimate", "pi", 0.07, 0.11),
    ("ziegler-nichols-ultimate", "pid", 0.09, 0.16),
])
def test_swings_decay_to_about_a_quarter(method, structure, least, most):
    for ratio in (0.1, 0.3, 0.5):
        assert least <= exact_loop.decay_ratio(_rule(method, ratio, structure), 1.0, [1.0], ratio) <= most, ratio


# --- optima the authors claim ----------------------------------------------------------------------------------------


def _cost(settings, ratio, criterion, aim):
    if min(settings[:2]) <= 0.0 or settings[2] < 0.0:
        return 1e9
    step = {"setpoint": 1.0} if aim == "setpoint" else {"load": 1.0}
    on_measurement = aim == "setpoint"
    time, y = exact_loop.respond(
        settings, 1.0, [1.0], ratio, until=max(15.0, 20.0 * ratio), parts=60, on_measurement=on_measurement, **step
    )
    error = step.get("setpoint", 0.0) - y
    return min(exact_loop.criterion(criterion, time, error), 1e9) if np.all(np.isfinite(error)) else 1e9


@pytest.mark.long
@pytest.mark.parametrize(("method", "structure"), [each for each in EACH if each[0].startswith(("lopez", "rovira"))])
@pytest.mark.parametrize("ratio", [0.3, 0.6])
def test_the_integral_rules_lie_where_a_general_minimiser_finds_the_minimum(method, structure, ratio):
    # Lopez 1967 (load) and Rovira 1969 (setpoint; D on the process variable): their claim is the minimum itself. Their
    # power laws miss it by up to 13 % in a setting and 12 % in cost, a mistyped digit by more
    criterion, aim = method.split("-")[1], "load" if method.startswith("lopez") else "setpoint"
    settings = np.array(_rule(method, ratio, structure)[: len(structure)])

    def cost(logarithms):
        return _cost((*np.exp(logarithms), 0.0)[:3], ratio, criterion, aim)

    best = minimize(cost, np.log(settings), method="Nelder-Mead", options={"maxfev": 220, "xatol": 1e-3, "fatol": 1e-6})
    assert settings / np.exp(best.x) == pytest.approx(np.ones(len(settings)), abs=0.135)
    assert cost(np.log(settings)) < 1.12 * best.fun


# --- other printings of the same tables ------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "structure", "expected"), [
    # K. J. Åström and T. Hägglund, "PID Controllers", 2nd ed. (ISA 1995), tables 4.1–4.5, for k = 1, T = 10, L = 1
    # (a = 0.1); they round what the authors print, so 3 % apart. Ziegler–Nichols' PI, which they round to 3L, and
    # Cohen–Coon in decimals, (0.9 + 0.083r)/r and so on, come from the tables of a public tuning program
    ("cohen-coon", "p", (10.335, math.inf, 0.0)),
    ("cohen-coon", "pi", (9.083, 0.9083 / 0.33, 0.0)),
    ("cohen-coon", "pid", (13.75, 1.375 / 0.573, 0.5 / 1.375)),
    ("ziegler-nichols", "p", (10.0, math.inf, 0.0)),
    ("ziegler-nichols", "pi", (9.0, 3.33, 0.0)),
    ("ziegler-nichols", "pid", (12.0, 2.0, 0.5)),
    ("chr-setpoint-0", "p", (3.0, math.inf, 0.0)),
    ("chr-setpoint-0", "pi", (3.5, 12.0, 0.0)),
    ("chr-setpoint-0", "pid", (6.0, 10.0, 0.5)),
    ("chr-setpoint-20", "p", (7.0, math.inf, 0.0)),
    ("chr-setpoint-20", "pi", (6.0, 10.0, 0.0)),
    ("chr-setpoint-20", "pid", (9.5, 14.0, 0.47)),
    ("chr-load-0", "p", (3.0, math.inf, 0.0)),
    ("chr-load-0", "pi", (6.0, 4.0, 0.0)),
    ("chr-load-0", "pid", (9.5, 2.4, 0.42)),
    ("chr-load-20", "p", (7.0, math.inf, 0.0)),
    ("chr-load-20", "pi", (7.0, 2.3, 0.0)),
    ("chr-load-20", "pid", (12.0, 2.0, 0.42)),
])
def test_a_textbook_prints_the_same_within_its_rounding(method, structure, expected):
    assert apply_rule(method, one_lag(0.1, lag=10.0), structure, 0.0) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize(("method", "expected"), [
    # a public rule collection's own example: K 1.25, τ 4, θ 0.9. Its Cohen–Coon times (2.253, 0.388) are the misprint
    # that the rule's errata name: θ is missing in one and divides the other; put right here
    ("ziegler-nichols", (4.266666666666667, 1.8, 0.45)),
    ("cohen-coon", (4.940740740740741, 2.253378378378379 * 0.9, 0.38816108685104317 * 0.9**2)),
])
def test_a_public_rule_collection_computes_the_same(method, expected):
    model = Fopdt(gain_degC_per_pct=1.25, time_constant_s=4.0, dead_time_s=0.9)
    assert apply_rule(method, model, "pid", 0.0) == pytest.approx(expected)


def test_the_ultimate_rule_takes_the_shares_its_authors_print():
    # Ziegler and Nichols 1942: 0.5·Ku; 0.45·Ku, Pu/1.2; 0.6·Ku, Pu/2, Pu/8
    Ku, Pu = ultimate_cycle(one_lag(0.5))
    found = [apply_rule("ziegler-nichols-ultimate", one_lag(0.5), structure, 0.0) for structure in ("p", "pi", "pid")]
    assert found == [(0.5 * Ku, math.inf, 0.0), (0.45 * Ku, Pu / 1.2, 0.0), (0.6 * Ku, Pu / 2.0, Pu / 8.0)]


# --- the ultimate cycle ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [one_lag(0.02), one_lag(1.0), one_lag(20.0), two_lags(9.0, 2.0), two_lags(3.0, 3.0, gain=0.2)])
def test_at_ku_the_loop_passes_through_minus_one_at_the_period_pu_and_not_before(model):
    Ku, Pu = ultimate_cycle(model)
    omega = np.append(np.linspace(1e-3, 1.0, 400)[:-1], 1.0) * 2.0 * math.pi / Pu
    loop = Ku * exact_loop.plant(model.gain_degC_per_pct, model.lags_s, model.dead_time_s, 1j * omega)
    assert loop[-1] == pytest.approx(-1.0, abs=1e-9)
    assert np.all(loop.imag[:-1] < 0.0)


def test_the_ultimate_cycle_of_a_dominant_lag_is_that_of_an_integrator():
    # e^(−s)/s: Ku = π/2, Pu = 4, both in closed form
    assert ultimate_cycle(one_lag(1e-6, gain=1e6, lag=1e6)) == pytest.approx((math.pi / 2.0, 4.0), rel=1e-5)


def test_without_dead_time_there_is_no_ultimate_cycle():
    with pytest.raises(OutOfRange, match="dead_time_s"):
        ultimate_cycle(one_lag(0.0))

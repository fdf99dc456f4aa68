import math

import numpy as np
import pytest

from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid import sampled_loop as response
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import (
    control_margins,
    dominant_time_s,
    iae_load,
    iae_setpoint,
    loop_response,
    loop_transfer_function,
    margins,
    respond,
)

PLANTS = {
    "one lag": Fopdt(gain_degC_per_pct=0.36, time_constant_s=163.0, dead_time_s=15.9),
    "no dead time": Fopdt(gain_degC_per_pct=0.36, time_constant_s=131.0, dead_time_s=0.0),
    "two lags": TwoLag(gain_degC_per_pct=0.83, time_constant_s=378.0, second_time_constant_s=108.0, dead_time_s=9.2),
    "equal lags": TwoLag(gain_degC_per_pct=0.6, time_constant_s=170.0, second_time_constant_s=170.0, dead_time_s=8.0),
}


def _design(gain, tn, tv=0.0, ta=10.0):
    structure = "p" + ("i" if math.isfinite(tn) else "") + ("d" if tv else "")
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta, structure=structure,
        method="test",
    )


DESIGNS = {"pi": _design(3.0, 300.0), "pid": _design(4.0, 200.0, 30.0), "p": _design(5.0, math.inf)}


def test_simc_has_the_margins_its_author_prints():
    # Skogestad 2003, table 1, τc = θ: Ms 1.59, Mt 1.00, gain margin 3.14, phase margin 61.4°; TA is made negligible
    plant = Fopdt(gain_degC_per_pct=1.0, time_constant_s=8.0, dead_time_s=1.0)
    found = margins(plant, _design(4.0, 8.0, ta=1e-3))
    assert found.ms == pytest.approx(1.59, abs=0.005)
    assert found.mt == pytest.approx(1.00, abs=0.005)
    assert found.gain_margin == pytest.approx(3.14, abs=0.01)
    assert found.phase_margin_deg == pytest.approx(61.4, abs=0.1)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
@pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
def test_python_control_sees_the_same_loop(plant, design):
    omega = np.geomspace(1e-4, 0.3, 50)
    theirs = loop_transfer_function(plant, design)(np.exp(1j * omega * design.sample_time_s))
    assert loop_response(plant, design, omega) == pytest.approx(theirs, rel=1e-6)
    ours, opinion = margins(plant, design), control_margins(plant, design)
    assert ours.ms == pytest.approx(opinion.ms, rel=2e-3)
    assert ours.mt == pytest.approx(opinion.mt, rel=2e-3)
    assert ours.phase_margin_deg == pytest.approx(opinion.phase_margin_deg, abs=0.1)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
@pytest.mark.parametrize("design", [DESIGNS["pi"], DESIGNS["pid"]], ids=["pi", "pid"])
def test_python_control_sees_the_same_setpoint_response(plant, design):
    import control  # noqa: PLC0415 - takes longer to import than everything else together

    closed = control.feedback(loop_transfer_function(plant, design), 1)
    theirs = control.step_response(closed, np.arange(120) * design.sample_time_s).outputs
    assert respond(plant, design, 120, setpoint_degC=1.0) == pytest.approx(theirs, abs=1e-6)


@pytest.mark.long
def test_stability_is_judged_as_python_controls_poles_judge_it():
    plant = PLANTS["two lags"]
    seen = set()
    for gain in np.geomspace(1.0, 60.0, 10):
        design = _design(float(gain), 200.0)
        stable = margins(plant, design).stable
        assert stable == control_margins(plant, design).stable, gain
        seen.add(stable)
    assert seen == {True, False}


def test_the_gain_margin_is_the_factor_that_makes_the_loop_unstable():
    plant, design = PLANTS["two lags"], DESIGNS["pi"]
    factor = margins(plant, design).gain_margin
    assert margins(plant, _design(3.0 * factor * 0.99, 300.0)).stable
    assert not margins(plant, _design(3.0 * factor * 1.01, 300.0)).stable


def test_without_oscillation_the_load_iae_is_tn_over_k():
    # IE = TN/K exactly, and IAE = IE where the response does not change sign (tuning page)
    plant = PLANTS["one lag"]
    assert iae_load(plant, _design(2.0, 400.0)) == pytest.approx(200.0, rel=0.01)


def test_a_loop_that_keeps_an_offset_or_diverges_has_no_finite_iae():
    assert iae_load(PLANTS["one lag"], DESIGNS["p"]) == math.inf
    assert iae_setpoint(PLANTS["two lags"], _design(100.0, 100.0)) == math.inf


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
@pytest.mark.parametrize("design", [*DESIGNS.values(), _design(900.0, 20.0)], ids=[*DESIGNS, "diverging"])
def test_a_response_is_the_same_plain_and_compiled_bit_for_bit(plant, design, monkeypatch):
    found = []
    for most_plain in (10**12, -1):
        for name in ("_PLAIN_SAMPLES", "_PLAIN_SAMPLES_READY"):
            monkeypatch.setattr(response, name, most_plain)
        found.append(respond(plant, design, 700, setpoint_degC=1.0, load_pct=2.0).tobytes())
    assert found[0] == found[1]


def test_trdom_of_a_first_order_closed_loop_is_its_time_constant():
    # K chosen so that PI cancels the lag: L = 1/(λs), closed loop 1/(λs + 1), 63.2 % at λ
    plant = Fopdt(gain_degC_per_pct=0.5, time_constant_s=200.0, dead_time_s=0.0)
    lam = 80.0
    design = _design(200.0 / (0.5 * lam), 200.0, ta=0.2)
    assert dominant_time_s(plant, design) == pytest.approx(lam, rel=0.01)


def test_python_control_judges_a_loop_of_many_samples_of_dead_time():
    """Its own `poles` lie at 1.38 here, from 84 zeros at 0; the roots of its polynomial, inside."""
    plant = Fopdt(gain_degC_per_pct=2.6, time_constant_s=3550.0, dead_time_s=5461.0, ambient_degC=22.0)
    design = PidDesign(gain_pct_per_degC=0.26, integral_time_s=6337.0, derivative_time_s=0.0, sample_time_s=65.5, structure="pi",
                       method="", derivative_filter=0.0)
    assert margins(plant, design).ms == pytest.approx(control_margins(plant, design).ms, rel=1e-4)

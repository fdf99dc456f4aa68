"""Heaters, designs and loops as objects of python-control, there and back, and the program of CasADi behind an optimum."""

import math
import sys

import control
import numpy as np
import pytest

import heatertune as ht
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import DEFAULT_PADE

HEATERS = {
    "one lag": ht.Fopdt(gain_degC_per_pct=0.8, time_constant_s=120.0, dead_time_s=8.0, ambient_degC=21.0),
    "no dead time": ht.Fopdt(gain_degC_per_pct=0.8, time_constant_s=120.0, dead_time_s=0.0),
    "cooler": ht.Fopdt(gain_degC_per_pct=-0.3, time_constant_s=900.0, dead_time_s=61.3),
    "two lags": ht.TwoLag(gain_degC_per_pct=2.0, time_constant_s=300.0, second_time_constant_s=20.0, dead_time_s=11.0),
}


@pytest.fixture(scope="module")
def model():
    return ht.model_by_hand(HEATERS["one lag"])


@pytest.fixture(scope="module")
def design(model):
    return ht.tune(model, structure="pid", sample_time_s=2.0)


@pytest.mark.parametrize("heater", HEATERS.values(), ids=HEATERS)
@pytest.mark.parametrize("form", [{}, {"pade": 1}, {"pade": 6}, {"sample_time_s": 5.0}, {"sample_time_s": 3.7}], ids=str)
def test_a_heater_comes_back_from_its_transfer_function(heater, form):
    back = type(heater).from_tf(heater.to_tf(**form), ambient_degC=heater.ambient_degC)
    for name in ("gain_degC_per_pct", "dead_time_s"):
        assert getattr(back, name) == pytest.approx(getattr(heater, name), rel=1e-5, abs=1e-6)
    assert back.lags_s == pytest.approx(heater.lags_s, rel=1e-5)
    assert back.ambient_degC == heater.ambient_degC


def test_without_arguments_the_dead_time_is_a_pade_approximant_of_the_stated_order_and_accuracy():
    heater = HEATERS["one lag"]
    system = heater.to_tf()
    assert len(system.den[0][0]) - 1 == DEFAULT_PADE + 1
    omega = np.geomspace(1e-4, 3.4 / heater.dead_time_s, 300)
    apart = np.degrees(np.angle(system(1j * omega) / heater.frequency_response(omega)))
    assert np.max(np.abs(apart)) < 0.1  # as `to_tf` says
    assert np.max(np.abs(np.degrees(np.angle(system(7j / heater.dead_time_s) / heater.frequency_response(np.array([7.0 / heater.dead_time_s])))))) > 0.1


@pytest.mark.parametrize(("system", "message"), [
    (lambda: control.tf([1.0], [1.0, 0.0]), "does not come to rest"),
    (lambda: control.tf([1.0], [1.0, -2.0]), "does not come to rest"),
    (lambda: control.tf([1.0], [1.0, 0.2, 4.0]), "2 lags; expected a gain, one or two real lags"),
    (lambda: control.tf([1.0, 3.0], [1.0, 3.0, 2.0]), "a zero at -3 with lags of 1 and 0.5 s"),
    (lambda: control.tf([-1.0, 1.0], [6.0, 5.0, 1.0]), "a zero at 1 that no Padé approximant has"),
    (lambda: control.tf([1.0], [1.0, 6.0, 11.0, 6.0]), "3 lags"),
    (lambda: control.tf([1.0], [1.0, 0.5], 1.0), "poles at"),
    (lambda: 3.0, "float; expected a transfer function"),
])
def test_what_is_no_heater_is_refused_with_its_reason(system, message):
    with pytest.raises(InputError, match=message):
        ht.Fopdt.from_tf(system())


def test_a_zero_that_cancels_a_lag_leaves_the_other():
    """(s + 1) / ((s + 1)(s + 2)) is 1 / (s + 2)."""
    heater = ht.Fopdt.from_tf(control.tf([1.0, 1.0], [1.0, 3.0, 2.0]))
    assert (heater.gain_degC_per_pct, heater.time_constant_s, heater.dead_time_s) == pytest.approx((0.5, 0.5, 0.0), abs=1e-9)


def test_a_system_with_two_lags_is_no_fopdt_but_its_half_rule_is():
    two = HEATERS["two lags"]
    with pytest.raises(InputError, match=r"TwoLag.from_tf takes them"):
        ht.Fopdt.from_tf(two.to_tf())
    with pytest.raises(InputError, match=r"no TwoLag: Fopdt.from_tf takes it"):
        ht.TwoLag.from_tf(HEATERS["one lag"].to_tf())


def test_tune_takes_a_transfer_function_as_the_heater_that_it_is(model):
    assert ht.tune(HEATERS["one lag"]) == ht.tune(model)
    found = ht.tune(HEATERS["one lag"].to_tf(sample_time_s=2.0), sample_time_s=2.0)
    assert found.gain_pct_per_degC == pytest.approx(ht.tune(model, sample_time_s=2.0).gain_pct_per_degC, rel=1e-3)


def test_the_sampled_loop_has_the_margins_that_heatertune_computes(model, design):
    own, loop = ht.margins(model, design), ht.loop(model, design)
    assert loop.dt == design.sample_time_s
    gain, phase, *_ = control.stability_margins(loop)
    assert gain == pytest.approx(own.gain_margin, rel=1e-3)
    assert phase == pytest.approx(own.phase_margin_deg, rel=1e-3)
    omega = np.geomspace(1e-4, math.pi / design.sample_time_s, 2000)
    sensitivity = ht.loop(model, design, of="sensitivity")(np.exp(1j * omega * design.sample_time_s))
    assert np.max(np.abs(sensitivity)) == pytest.approx(own.ms, rel=1e-3)


def test_the_parts_of_the_loop_belong_together(model, design):
    parts = {of: ht.loop(model, design, of=of)(np.exp(0.05j)) for of in ("open", "closed", "load", "sensitivity")}
    assert parts["closed"] + parts["sensitivity"] == pytest.approx(1.0)
    assert parts["closed"] == pytest.approx(parts["open"] * parts["sensitivity"])
    assert parts["load"] * design.to_tf()(np.exp(0.05j)) == pytest.approx(parts["closed"])
    with pytest.raises(UnknownName, match="unknown part of the loop 'close'; did you mean 'closed'"):
        ht.loop(model, design, of="close")


def test_the_closed_loop_ends_at_its_setpoint_continuous_and_sampled(model):
    apart = []
    for ta in (2.0, 0.5):
        design = ht.PidDesign(gain_pct_per_degC=3.0, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=ta, structure="pi", method="")
        instants = np.arange(0.0, 1200.0, ta)
        sampled, continuous = (control.step_response(ht.loop(model, design, of="closed", continuous=each, pade=None if not each else 6), instants)
                               .outputs for each in (False, True))
        assert sampled[-1] == pytest.approx(1.0, abs=1e-3)
        assert continuous[-1] == pytest.approx(1.0, abs=1e-3)
        apart.append(np.max(np.abs(sampled - continuous)[instants > 30.0]))
    # the error of the hold as a delay of TA/2 is of second order, that of backward differences of first: a quarter of TA, a quarter or less
    assert apart[1] < 0.3 * apart[0] < 0.02


def test_a_continuous_design_has_the_filter_that_its_margins_were_computed_with(model):
    design = ht.tune(model, structure="pid", sample_time_s=0.0)
    omega = np.geomspace(1e-4, 1.0, 4000)
    loop = design.to_tf()(1j * omega) * HEATERS["one lag"].frequency_response(omega)  # with the exact dead time
    assert np.max(1.0 / np.abs(1.0 + loop)) == pytest.approx(design.margins.ms, rel=2e-3)


def test_a_loop_of_too_many_samples_of_dead_time_is_refused_with_the_way_on(model):
    design = ht.tune(model, sample_time_s=0.05)
    with pytest.raises(OutOfRange, match="continuous=True"):
        ht.loop(model, design)
    assert ht.loop(model, design, continuous=True).dt == 0


def test_the_parameters_of_a_controller_have_a_loop_too(model):
    words = ht.encode(ht.tune(model, target="s7-300"), "s7-300", model)
    z = np.exp(1j * np.geomspace(1e-3, 3.0, 50))
    assert np.array_equal(ht.loop(model, words)(z), ht.loop(model, ht.decode(words))(z))


def test_the_program_of_casadi_ends_at_the_optimum_and_can_be_changed(model):
    optimum = ht.tune(model, structure="pid", sample_time_s=2.0)
    program = ht.problem(model, structure="pid", sample_time_s=2.0)
    found = program.solve()
    assert ht.iae_load(model, found) == pytest.approx(ht.iae_load(model, optimum), rel=0.01)
    slower = program.solve(limits=[0.5 * optimum.gain_pct_per_degC - program.gain_pct_per_degC])
    assert slower.gain_pct_per_degC == pytest.approx(0.5 * optimum.gain_pct_per_degC, rel=1e-3)
    calmer = program.solve(cost=program.cost + 1e4 * program.derivative_time_s)
    assert calmer.derivative_time_s < found.derivative_time_s
    with pytest.raises(InputError, match="IPOPT ended with"):
        program.solve(limits=[-1.0 - program.gain_pct_per_degC])


def test_an_inequality_limits_the_program_of_casadi_and_no_truth_value_does(model):
    ca = pytest.importorskip("casadi")
    program = ht.problem(model, structure="pi", sample_time_s=2.0)
    free = program.solve().integral_time_s
    for limit in (program.integral_time_s <= 0.8 * free, 0.8 * free > program.integral_time_s,
                  ca.vertcat(program.integral_time_s <= 0.8 * free, program.gain_pct_per_degC >= 0.0)):
        assert program.solve(limits=[limit]).integral_time_s == pytest.approx(0.8 * free, rel=1e-3)
    assert program.solve(limits=[program.integral_time_s >= 1.2 * free]).integral_time_s == pytest.approx(1.2 * free, rel=1e-3)
    for limit in (program.integral_time_s == free, False, True, ca.logic_and(program.integral_time_s <= free, free >= 0.0)):
        with pytest.raises(InputError, match="write a <= b, a >= b, or an expression that is not negative"):
            program.solve(limits=[limit])


@pytest.mark.parametrize(("given", "way_on"), [
    ("model.json", r"str; .* load\(path\) reads a model"), (None, "NoneType; expected a transfer function .*, or a model"),
    (control.ss(control.tf([0.5], [300.0, 1.0])), r"StateSpace; .* control.tf\(system\) is one")])
def test_what_is_no_heater_is_refused_by_every_verb_with_the_way_to_one(model, given, way_on):
    design = ht.tune(model)
    for verb in (ht.tune, ht.problem, lambda each: ht.loop(each, design)):
        with pytest.raises(InputError, match=f"no heater: {way_on}"):
            verb(given)
    with pytest.raises(InputError, match=r"no heater: PidDesign; .* the model comes first, then the design"):
        ht.loop(design, model)
    with pytest.raises(InputError, match=r"no design: .*; expected what tune\(\) finds, or parameters of encode\(\)"):
        ht.loop(model, given)


def test_the_ways_to_a_heater_work(model, tmp_path):
    system = control.ss(control.tf([0.5], [300.0, 1.0]) * control.tf(*control.pade(30.0, 2)))
    assert ht.tune(control.tf(system)).gain_pct_per_degC > 0.0
    ht.fit("table4").save(tmp_path / "model.json")
    assert ht.tune(ht.load(tmp_path / "model.json")).gain_pct_per_degC > 0.0


def test_the_program_of_casadi_refuses_what_is_no_expression_of_its_symbols(model):
    ca = pytest.importorskip("casadi")
    program, other = ht.problem(model, structure="pi"), ht.problem(model, structure="pi")
    for given, message in (
        ({"cost": ca.SX.sym("q")}, "cost holds the symbol q, which is not one of this program's: x_0, x_1"),
        ({"cost": other.cost}, "cost holds the symbol x_0, x_1, which is not one"), ({"cost": "a"}, "cost holds 'a'; it must be an expr"),
        ({"cost": ca.MX.sym("q")}, "a casadi.SX"), ({"cost": ca.vertcat(program.cost, program.cost)}, "cost has 2 values; it must be one"),
        ({"limits": [ca.SX.sym("z")]}, "limits holds the symbol z"), ({"limits": 5}, "limits is 5; it must be a list"),
        ({"limits": "x"}, "limits is 'x'; it must be a list"),
    ):
        with pytest.raises(InputError, match=message):
            program.solve(**given)


@pytest.mark.parametrize(("options", "message"), [
    ({"method": "simc"}, "simc is a rule"), ({"structure": "p"}, "no program"), ({"sample_time_s": 0.0}, "leave sample_time_s = 0 out"),
    ({"objective": "ki"}, "no program"), ({"structur": "pi"}, "did you mean 'structure'"),
])
def test_what_has_no_program_is_refused(model, options, message):
    with pytest.raises(InputError, match=message):
        ht.problem(model, **options)


def test_without_casadi_the_built_in_search_is_used_and_says_so(model, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    monkeypatch.setitem(sys.modules, "casadi", None)
    design = ht.tune(model, sample_time_s=2.5)
    assert "IPOPT was not used: CasADi is not installed (pip install casadi); the result of the feasible-set search is used." in design.notes
    with pytest.raises(InputError, match="CasADi is not installed"):
        ht.problem(model, sample_time_s=2.5)

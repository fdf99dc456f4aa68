"""What surrounds the rules' formulas: choice of model, range, closed-loop time, refusals."""

import argparse
import itertools
import math
import re

import pytest
from tests.pid.exact_loop import one_lag, two_lags

from heatertune.cli import common
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.rules import RULES, Rule, apply_rule, model_for, range_note
from heatertune.pid.tune import tune

EACH = [(name, structure) for name, rule in RULES.items() for structure in rule.formulas]


@pytest.mark.parametrize(("method", "structure"), EACH)
def test_every_rule_scales_with_gain_and_time(method, structure):
    # a heater 1/3 as strong and 7 times as slow needs 3 times the gain and 7 times the times
    small = two_lags(1.0, 0.4, dead=0.45) if structure in RULES[method].two_lags else one_lag(0.45)
    large = (
        two_lags(7.0, 2.8, dead=3.15, gain=1.0 / 3.0) if isinstance(small, TwoLag) else one_lag(0.45, lag=7.0, gain=1.0 / 3.0)
    )
    one, other = (apply_rule(method, model, structure, 0.0) for model in (small, large))
    assert other == pytest.approx((3.0 * one[0], 7.0 * one[1], 7.0 * one[2]))
    assert math.isfinite(one[1]) == ("i" in structure)
    assert (one[2] > 0.0) == ("d" in structure)


@pytest.mark.parametrize("method", [name for name in RULES if "pi" in RULES[name].formulas])
def test_half_a_sample_counts_as_dead_time(method):
    # Skogestad 2003, section 2.2: a sampled controller adds half its interval to the dead time
    assert apply_rule(method, one_lag(0.4), "pi", 0.2) == pytest.approx(apply_rule(method, one_lag(0.5), "pi", 0.0))


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_every_rule_names_its_source_with_a_year_and_what_it_claims(rule):
    assert re.search(r"\((19|20)\d\d\)", rule.source)
    assert rule.claim


def test_the_closed_loop_time_can_be_chosen_where_the_rule_leaves_it_open():
    # SIMC: T/(k(τc + θ)), min(T, 4(τc + θ)). Lambda: T/(k(λ + L)), T. IMC PID: (T + L/2)/(k(λ + L/2))
    heater = Fopdt(gain_degC_per_pct=0.5, time_constant_s=100.0, dead_time_s=10.0)
    found = {name: apply_rule(name, heater, "pi", 0.0, closed_loop_s=5.0) for name in ("simc", "lambda", "imc")}
    assert found["simc"] == pytest.approx((100.0 / 7.5, 60.0, 0.0))
    assert found["lambda"] == pytest.approx((100.0 / 7.5, 100.0, 0.0))
    assert found["imc"] == pytest.approx((105.0 / 2.5, 105.0, 0.0))
    for name in ("lambda", "imc"):
        assert apply_rule(name, heater, "pid", 0.0, closed_loop_s=5.0)[0] == pytest.approx(105.0 / 5.0)
    two = two_lags(20.0, 5.0, dead=2.0)
    assert apply_rule("simc", two, "pid", 0.0, closed_loop_s=8.0)[0] == pytest.approx(20.0 / 10.0 * 1.25)


def test_tune_hands_the_closed_loop_time_on():
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=0.5, time_constant_s=100.0, dead_time_s=10.0))
    design = tune(fitted, method="simc", sample_time_s=2.0, closed_loop_s=5.0)
    assert design.gain_pct_per_degC == pytest.approx(100.0 / (0.5 * 16.0))
    with pytest.raises(InputError, match="optimum takes no closed-loop time"):
        tune(fitted, closed_loop_s=5.0)


def test_a_rule_is_applied_to_the_two_lags_it_needs_or_knows_how_to_use():
    two = two_lags(100.0, 30.0, dead=5.0)
    fitted = model_by_hand(two)
    assert model_for("simc", "pid", fitted) is two
    assert model_for("tyreus-luyben", "pi", fitted) == two
    assert apply_rule("simc", two, "pi", 0.0) == apply_rule("simc", two.half_rule(), "pi", 0.0)
    assert tune(fitted, method="simc", structure="pid", sample_time_s=1.0).structure == "pid"


def test_what_a_rule_does_not_give_is_refused():
    heater = one_lag(0.3)
    refused = {
        "amigo gives PI and PID settings, none for P": ("amigo", heater, "p", None),
        "usort-setpoint-2.0 gives PID settings, none for PI": ("usort-setpoint-2.0", heater, "pi", None),
        "rules that have one: simc, lambda, imc": ("cohen-coon", heater, "pi", 5.0),
        "closed_loop_s = 0.0": ("simc", heater, "pi", 0.0),
        "second lag": ("simc", heater, "pid", None),
        "which no controller can hold; Made for 0.1 <= L/T <= 2; L/T is 0.01": ("usort-load-2.0", one_lag(0.01), "pi", None),
        "which no controller can hold; Made for 0.1 <= L/T <= 2; L/T is 0.02": ("usort-setpoint-1.6", one_lag(0.02), "pid", None),
        "dead_time_s = 0.0": ("ziegler-nichols", one_lag(0.0), "pi", None),
    }
    for message, (method, model, structure, wanted) in refused.items():
        with pytest.raises(InputError, match=message):
            apply_rule(method, model, structure, 0.0, closed_loop_s=wanted)
    with pytest.raises(UnknownName, match="optimum, simc"):
        apply_rule("luck", heater, "pi", 0.0)


def test_outside_its_range_a_rule_says_so():
    # Rovira and Lopez fitted 0.1 ≤ L/T ≤ 1; with TA = 0.1·T half a sample makes 0.06 into 0.11
    assert range_note("lopez-iae", one_lag(0.06), "pi", 0.1) is None
    assert "0.1 <= L/T <= 1; L/T is 0.06 here" in range_note("lopez-iae", one_lag(0.06), "pi", 0.0)
    assert "L/T is 1.2 here" in range_note("rovira-iae", one_lag(1.2), "pid", 0.0)
    assert range_note("usort-load-1.4", one_lag(0.2), "pi", 0.0) is None
    assert "0.4 <= L/T" in range_note("usort-load-1.4", one_lag(0.2), "pid", 0.0)
    fitted = model_by_hand(one_lag(0.02, lag=100.0))
    assert any("Made for 0.1" in note for note in tune(fitted, method="lopez-itae", sample_time_s=1.0).notes)
    assert not any("Made for" in note for note in tune(fitted, method="simc", sample_time_s=1.0).notes)


def test_a_rule_with_an_unknown_form_or_an_empty_range_is_refused():
    with pytest.raises(OutOfRange, match="form"):
        Rule(source="", formulas={}, claim="", form="cascade")
    with pytest.raises(OutOfRange, match="least_ratio"):
        Rule(source="", formulas={}, claim="", least_ratio=2.0, most_ratio=1.0)


def test_the_help_of_method_names_every_rule():
    parser = argparse.ArgumentParser()
    common.add_tuning_options(parser)
    text = next(action.help for action in parser._actions if action.dest == "method")
    named = {"".join(parts) for group in re.split(r", (?![^{]*\})", text.split("rule: ")[1]) for parts in _expanded(group)}
    assert named == set(RULES)


def _expanded(group):
    pieces = re.split(r"\{(.*?)\}", group)
    return itertools.product(*(piece.split(",") if i % 2 else [piece] for i, piece in enumerate(pieces)))

"""Limits kept over heaters that a fit leaves open, and gains for the two faces of a heater."""

import importlib.util
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.signal import lti, step

from heatertune.errors import InputError, UnknownName
from heatertune.model.model_values import Candidate, Fopdt, model_by_hand
from heatertune.model.statistics import RATIO, Interval
from heatertune.pid.sampled_loop import noise_gain
from heatertune.pid.search.robust import draw_heaters
from heatertune.pid.tune import tune

_SPEC = importlib.util.spec_from_file_location("brute_force", Path(__file__).with_name("brute_force.py"))
brute_force = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(brute_force)

HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=160.0, dead_time_s=16.0)
WIDE = {"gain_degC_per_pct": Interval(low=0.32, high=0.5), "dead_time_s": Interval(low=12.0, high=21.0)}


def _fitted(**ci95):
    return replace(model_by_hand(HEATER), ci95=ci95)


def _dense_ms(heaters, gain, tn):
    """Ms of each heater's continuous PI loop by plain evaluation, shape (n,)."""
    k, lag, dead = (np.array([getattr(h, name) for h in heaters])[:, None]
                    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s"))
    s = 1j * np.geomspace(0.05, 8.0, 160) / dead
    loop = k * np.exp(-s * dead) / (lag * s + 1.0) * gain * (1.0 + 1.0 / (tn * s))
    return (1.0 / np.abs(1.0 + loop)).max(axis=1)


@pytest.mark.brute
@pytest.mark.long
def test_over_all_drawn_heaters_no_brute_force_finds_a_better_pi():
    fitted = _fitted(**WIDE)
    heaters = draw_heaters(fitted)
    design = tune(fitted, sample_time_s=0.0, robust="worst")
    assert _dense_ms(heaters, design.gain_pct_per_degC, design.integral_time_s).max() <= 1.6 * 1.0001
    feasible = [
        (gain, tn) for tn in np.geomspace(50.0, 130.0, 24) for gain in np.geomspace(5.0, 9.0, 80)
        if tn / gain < design.iae_load and _dense_ms(heaters, gain, tn).max() <= 1.6  # ∫|e| dt is at least ∫e dt = TN/K
    ]
    gains, tns = np.array(feasible).T
    costs = brute_force.iae_load((0.4, 160.0, 16.0), gains, tns, np.zeros(len(gains)))
    assert 0.95 * costs.min() < design.iae_load < 1.01 * costs.min()


def _sampled_ms(heaters, design):
    """Ms of each heater's sampled PI loop; the pulse transfer function is summed from the hold's step response."""
    z, k, ta = np.exp(1j * np.geomspace(0.02, math.pi, 200)), np.arange(1, 400), design.sample_time_s
    delays = z[:, None] ** -k
    control = design.gain_pct_per_degC * (1.0 + ta / design.integral_time_s / (1.0 - 1.0 / z))
    found = []
    for h in heaters:
        step_response = h.gain_degC_per_pct * -np.expm1(-np.maximum(k * ta - h.dead_time_s, 0.0) / h.time_constant_s)
        found.append((1.0 / np.abs(1.0 + delays @ np.diff(step_response, prepend=0.0) * control)).max())
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_the_promise_on_95_percent_holds_on_heaters_it_was_not_made_on(seed):
    fitted = _fitted(**WIDE)
    design = tune(fitted, sample_time_s=8.0, robust="p95")
    assert np.mean(_sampled_ms(draw_heaters(fitted, 2000, seed=seed), design) > 1.6 * 1.006) <= 0.05


@pytest.mark.long
def test_of_a_sampled_loop_the_limit_is_kept_on_as_many_heaters_as_asked():
    fitted = _fitted(**WIDE)
    heaters, found = draw_heaters(fitted), {}
    for way in ("none", "p95", "worst"):
        design = tune(fitted, sample_time_s=8.0, robust=way)
        ms = _sampled_ms(heaters, design)
        found[way] = (np.mean(ms > 1.6 * 1.006), ms.max(), design.iae_load, design.notes)
    assert found["none"][0] > 0.3
    assert 0.02 < found["p95"][0] <= 0.05
    assert found["worst"][0] == 0.0
    assert found["worst"][1] == pytest.approx(1.6, rel=0.01)
    assert found["none"][2] < found["p95"][2] < found["worst"][2]
    more = 100.0 * (found["worst"][2] / found["none"][2] - 1.0)
    assert any("the limits hold on all of them" in note and f"This costs {more:.1f} %" in note for note in found["worst"][3])


@pytest.mark.long
@pytest.mark.parametrize("sample_time_s", [0.0, 8.0])
def test_every_limit_is_kept_not_that_of_ms_alone(sample_time_s):
    fitted = _fitted(**WIDE)
    heaters = draw_heaters(fitted)
    design = tune(fitted, sample_time_s=sample_time_s, ms=3.0, mks=9.0, robust="worst")
    plain = tune(fitted, sample_time_s=sample_time_s, ms=3.0, mks=9.0)
    if sample_time_s:
        assert max(noise_gain(heater, plain) for heater in heaters) > 9.3
        assert max(noise_gain(heater, design) for heater in heaters) <= 9.0 * 1.004
    assert design.gain_pct_per_degC < 0.99 * plain.gain_pct_per_degC
    tight = tune(fitted, sample_time_s=sample_time_s, ms=3.0, mt=1.2, robust="worst")
    loose = tune(fitted, sample_time_s=sample_time_s, ms=3.0, mt=1.2)
    assert tight.iae_load > 1.05 * loose.iae_load


@pytest.mark.long
def test_a_structure_without_integral_action_is_guarded_too():
    fitted = _fitted(**WIDE)
    plain, kept = (tune(fitted, structure="p", sample_time_s=0.0, robust=way) for way in ("none", "worst"))
    # the weakest of all drawn heaters' own largest gains is the largest for all: a P loop has one unknown
    alone = [tune(model_by_hand(h), structure="p", sample_time_s=0.0).gain_pct_per_degC for h in draw_heaters(fitted)]
    assert kept.gain_pct_per_degC == pytest.approx(min(alone), rel=0.004)
    assert plain.gain_pct_per_degC > 1.3 * kept.gain_pct_per_degC
    more = 100.0 * (plain.gain_pct_per_degC / kept.gain_pct_per_degC - 1.0)
    assert any(f"This costs {more:.1f} %" in note for note in kept.notes)


@pytest.mark.long
def test_where_the_log_leaves_next_to_nothing_open_robustness_costs_as_little():
    # of 200 heaters drawn with a standard deviation of 1.3e-4 none has a gain more than 4 of these above the middle one
    narrow = _fitted(gain_degC_per_pct=Interval(low=0.3999, high=0.4001))
    plain, kept = (tune(narrow, sample_time_s=8.0, robust=way) for way in ("none", "worst"))
    assert kept.integral_time_s == pytest.approx(plain.integral_time_s, rel=0.01)
    assert 1.0 - 4 * 1.3e-4 < kept.gain_pct_per_degC / plain.gain_pct_per_degC <= 1.0
    assert any("This costs 0.0 %" in note for note in kept.notes)


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="robust = p95 needs a model with intervals"):
        tune(model_by_hand(HEATER), sample_time_s=8.0, robust="p95")
    with pytest.raises(InputError, match="the rule simc has no limits to keep"):
        tune(_fitted(**WIDE), method="simc", robust="worst")
    with pytest.raises(UnknownName, match="p95"):
        tune(_fitted(**WIDE), robust="p99")


# ---- the draw -------------------------------------------------------------------------------------------------------


def _logs(heaters):
    return np.log([[h.gain_degC_per_pct, h.time_constant_s] for h in heaters]).T


@pytest.mark.long
def test_the_interval_of_gain_per_time_constant_correlates_the_two():
    ratio = (0.0025, Interval(low=0.0023, high=0.0027))
    fitted = replace(_fitted(gain_degC_per_pct=WIDE["gain_degC_per_pct"], time_constant_s=Interval(low=128.0, high=200.0)),
                     combinations={RATIO: ratio})
    gain, lag = _logs(draw_heaters(fitted, 4000))
    spreads = [np.std(values) * 2 * 1.96 for values in (gain, lag, gain - lag)]
    # by definition of the three intervals, whatever the correlation
    assert spreads == pytest.approx([math.log(0.5 / 0.32), math.log(200.0 / 128.0), math.log(27.0 / 23.0)], rel=0.05)


def test_where_gain_or_time_constant_is_open_their_ratio_is_drawn_alone():
    fitted = replace(_fitted(time_constant_s=Interval(low=128.0, high=None)),
                     combinations={RATIO: (0.0025, Interval(low=0.0023, high=0.0027))})
    gain, lag = _logs(draw_heaters(fitted, 4000))
    assert np.ptp(lag) == 0.0
    assert np.std(gain) * 2 * 1.96 == pytest.approx(math.log(27.0 / 23.0), rel=0.05)


# ---- two faces ------------------------------------------------------------------------------------------------------


def _two_faced(heating, cooling):
    names = (("power logged", HEATER), ("power logged, heating", heating), ("power logged, cooling", cooling))
    return replace(model_by_hand(HEATER), candidates=tuple(
        Candidate(model=model, log="", window_s=(0.0, 1.0), law=law, fit_pct=90.0, rmse_degC=1.0, delta_bic=0.0)
        for law, model in names
    ))


@pytest.mark.long
@pytest.mark.parametrize("sample_time_s", [0.0, 4.0])
def test_a_heater_that_cools_slower_is_told_gains_for_each_and_what_one_set_costs(sample_time_s):
    heating, cooling = HEATER, replace(HEATER, time_constant_s=480.0)
    told = tune(_two_faced(heating, cooling), sample_time_s=sample_time_s).notes[-1]
    assert "(160 s and 480 s)" in told
    assert re.search(r"costs \d+ % more than its own set when it heats and \d+ % more than its own set when it cools\.$", told)
    for face, plant in (("heating", heating), ("cooling", cooling)):
        own = tune(model_by_hand(plant), sample_time_s=sample_time_s)
        stated = next(part for part in told.split(";") if f"for {face}" in part)
        numbers = [float(part.split()[0]) for part in stated.split("= ")[1:]]
        assert numbers[0] == pytest.approx(own.gain_pct_per_degC, rel=0.02)
        assert numbers[1] == pytest.approx(own.integral_time_s, rel=0.05)


@pytest.mark.long
def test_what_one_set_costs_is_the_ratio_of_the_load_responses_of_a_linear_program():
    # without dead time the loop is of finite order and scipy knows its response
    heating = Fopdt(gain_degC_per_pct=0.4, time_constant_s=160.0, dead_time_s=0.0)
    cooling = replace(heating, time_constant_s=480.0)
    fitted = replace(_two_faced(heating, cooling), model=heating)
    fitted = replace(fitted, candidates=fitted.candidates[1:])
    design = tune(fitted, sample_time_s=0.0, mks=10.0)
    own = tune(model_by_hand(cooling), sample_time_s=0.0, mks=10.0)
    costs = []
    for found in (design, own):
        gain, tn, k, lag = found.gain_pct_per_degC, found.integral_time_s, 0.4, 480.0
        closed = lti([k * tn, 0.0], [lag * tn, tn * (1.0 + k * gain), k * gain])
        t = np.linspace(0.0, 6000.0, 60_001)
        costs.append(trapezoid(np.abs(step(closed, T=t)[1]), t))
    assert f"and {100.0 * (costs[0] / costs[1] - 1.0):.0f} % more than its own set when it cools" in design.notes[-1]


def test_a_heater_with_one_face_is_told_nothing_of_the_kind():
    assert not any("warms and cools" in note for note in tune(model_by_hand(HEATER), sample_time_s=8.0).notes)

"""Heaters drawn from what a fit leaves open."""

import math
from dataclasses import replace

import numpy as np
import pytest

from heatertune.errors import OutOfRange
from heatertune.model.model_values import Candidate, Fopdt, TwoLag, model_by_hand
from heatertune.model.statistics import Interval
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import margins
from heatertune.pid.search.robust import draw_heaters, ms_over

HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=160.0, dead_time_s=12.0)
OTHER = TwoLag(gain_degC_per_pct=0.8, time_constant_s=380.0, second_time_constant_s=100.0, dead_time_s=9.0)
DESIGN = PidDesign(gain_pct_per_degC=8.0, integral_time_s=90.0, derivative_time_s=0.0, sample_time_s=4.0, structure="pi",
                   method="")


def _fitted(*models, **ci95):
    candidates = tuple(Candidate(model=m, log="", window_s=(0.0, 1.0), law="", fit_pct=90.0, rmse_degC=1.0, delta_bic=0.0)
                       for m in models)
    return replace(model_by_hand(HEATER), candidates=candidates, ci95=ci95)


def test_the_draw_has_the_width_of_the_interval():
    fitted = _fitted(HEATER, gain_degC_per_pct=Interval(low=0.3, high=0.5), dead_time_s=None)
    drawn = draw_heaters(fitted, 4000)
    gains = np.array([heater.gain_degC_per_pct for heater in drawn])
    # the interval of a lognormal: 2.5 and 97.5 % of the draws, around the estimate
    low, high = np.quantile(gains, [0.025, 0.975])
    assert high / low == pytest.approx(0.5 / 0.3, rel=0.05)
    assert np.exp(np.mean(np.log(gains))) == pytest.approx(0.4, rel=0.02)
    assert {heater.dead_time_s for heater in drawn} == {12.0}
    assert {heater.time_constant_s for heater in drawn} == {160.0}


def test_every_candidate_is_drawn_and_both_lags_stretch_together():
    drawn = draw_heaters(_fitted(HEATER, OTHER, time_constant_s=Interval(low=120.0, high=200.0)), 100)
    kinds = [type(heater) for heater in drawn]
    assert kinds.count(Fopdt) == kinds.count(TwoLag) == 50
    ratios = {round(h.time_constant_s / h.second_time_constant_s, 9) for h in drawn if isinstance(h, TwoLag)}
    assert ratios == {3.8}
    assert len({h.time_constant_s for h in drawn}) == 100
    assert drawn == draw_heaters(_fitted(HEATER, OTHER, time_constant_s=Interval(low=120.0, high=200.0)), 100)


@pytest.mark.parametrize("interval", [None, Interval(low=None, high=0.5), Interval(low=0.3, high=None)])
def test_an_interval_that_is_open_or_missing_adds_nothing(interval):
    assert draw_heaters(_fitted(HEATER, gain_degC_per_pct=interval)) == ()
    assert ms_over((), DESIGN) is None


def test_the_quantiles_are_those_of_each_heater_judged_alone():
    heaters = tuple(replace(HEATER, gain_degC_per_pct=0.4 * factor) for factor in np.linspace(0.5, 1.5, 101))
    found, alone = ms_over(heaters, DESIGN), [margins(heater, DESIGN).ms for heater in heaters]
    assert (found.count, found.worst, found.unstable) == (101, max(alone), 0)
    assert found.median == pytest.approx(np.quantile(alone, 0.5))
    assert found.p95 == pytest.approx(np.quantile(alone, 0.95))
    assert found.median < found.p95 < found.worst
    wild = ms_over((HEATER, replace(HEATER, gain_degC_per_pct=8.0)), DESIGN)
    assert (wild.unstable, wild.worst) == (1, math.inf)


@pytest.mark.parametrize("asked", [{"count": -1}, {"count": 1.5}, {"count": None}, {"seed": -1}, {"seed": "a"}])
def test_a_count_or_a_seed_that_is_no_whole_number_from_0_on_is_refused(asked):
    fitted = _fitted(HEATER, gain_degC_per_pct=Interval(low=0.3, high=0.5))
    with pytest.raises(OutOfRange, match=f"{next(iter(asked))} = .* is out of range: must be (a whole number|>= 0)"):
        draw_heaters(fitted, **asked)
    assert len(draw_heaters(fitted, np.int64(3), seed=np.uint8(1))) == 3

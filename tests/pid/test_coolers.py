"""A cooler's loop is the mirror image of a heater's: the same numbers, with the signs of gain and K changed."""

from dataclasses import replace

import pytest

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Candidate, Fopdt, TwoLag, model_by_hand
from heatertune.model.reduction import cools, mirror_heater
from heatertune.model.statistics import RATIO, Interval
from heatertune.pid.alternatives import alternatives, front
from heatertune.pid.sampled_loop import margins
from heatertune.pid.search.robust import draw_heaters, interval_ends
from heatertune.pid.tune import quick_tune, tune

HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=160.0, dead_time_s=16.0, ambient_degC=20.0)
OTHER = TwoLag(gain_degC_per_pct=0.5, time_constant_s=150.0, second_time_constant_s=20.0, dead_time_s=8.0)
OPEN = {"gain_degC_per_pct": Interval(low=0.32, high=0.5), "dead_time_s": Interval(low=12.0, high=21.0),
        "ambient_degC": Interval(low=19.0, high=22.0)}
ASKED = {
    "pi": {"sample_time_s": 8.0}, "p": {"sample_time_s": 8.0, "structure": "p"}, "ta found": {},
    "pid": {"sample_time_s": 8.0, "structure": "pid", "objective": "setpoint"},
    "continuous": {"sample_time_s": 0.0, "mks": 40.0}, "simc": {"sample_time_s": 8.0, "method": "simc"},
    "robust": {"sample_time_s": 8.0, "robust": "worst"},
}


def _heater():
    hand = model_by_hand(HEATER)
    other = Candidate(model=OTHER, log="", window_s=(0.0, 1.0), law="", fit_pct=90.0, rmse_degC=1.0, delta_bic=0.0)
    return replace(hand, candidates=(*hand.candidates, other), ci95=OPEN,
                   combinations={RATIO: (0.0025, Interval(low=0.0024, high=0.0026))})


@pytest.mark.long
@pytest.mark.parametrize("asked", [
    pytest.param(asked, id=name, marks=[pytest.mark.long] if name == "continuous" else []) for name, asked in ASKED.items()])
def test_a_cooler_is_tuned_as_its_mirror_image_to_the_last_digit(asked):
    heating, cooling = tune(_heater(), **asked), tune(mirror_heater(_heater()), **asked)
    assert cooling.gain_pct_per_degC == -heating.gain_pct_per_degC < 0.0
    assert replace(cooling, gain_pct_per_degC=heating.gain_pct_per_degC) == heating


def test_the_margins_of_a_cooler_are_those_of_its_mirror_image_and_the_wrong_sign_is_unstable():
    design = tune(model_by_hand(HEATER), sample_time_s=8.0)
    cooler, cooling = replace(HEATER, gain_degC_per_pct=-0.4), replace(design, gain_pct_per_degC=-design.gain_pct_per_degC)
    assert margins(cooler, cooling) == margins(HEATER, design)
    assert not margins(cooler, design).stable
    assert not margins(HEATER, cooling).stable
    assert cooling.step_power_pct_per_degC == design.step_power_pct_per_degC > 0.0


@pytest.mark.long
@pytest.mark.parametrize("sample_time_s", [0.0, 8.0])
def test_every_rule_gives_a_cooler_the_settings_of_its_mirror_image(sample_time_s):
    pairs = [alternatives(fitted, tune(fitted, sample_time_s=sample_time_s, method="simc"))
             for fitted in (_heater(), mirror_heater(_heater()))]
    for heating, cooling in zip(*pairs, strict=True):
        if heating["gain_pct_per_degC"] is not None:
            assert cooling.pop("gain_pct_per_degC") == pytest.approx(-heating.pop("gain_pct_per_degC"))
        assert cooling == pytest.approx(heating)


def test_front_and_quick_gains_of_a_cooler_are_those_of_its_mirror_image():
    heating, cooling = (front(fitted, points=2, sample_time_s=8.0)["rows"] for fitted in (_heater(), mirror_heater(_heater())))
    assert [row["gain_pct_per_degC"] for row in cooling] == [-row["gain_pct_per_degC"] for row in heating]
    assert [row["cost"] for row in cooling] == [row["cost"] for row in heating]
    quick = [quick_tune((plant,)) for plant in (HEATER, replace(HEATER, gain_degC_per_pct=-0.4))]
    assert replace(quick[1], gain_pct_per_degC=-quick[1].gain_pct_per_degC) == quick[0]


def test_the_mirror_exchanges_the_ends_of_intervals_and_twice_is_once_too_often():
    cooler = mirror_heater(_heater(), 40.0)
    assert cools(cooler)
    assert not cools(_heater())
    assert cooler.ci95["gain_degC_per_pct"] == Interval(low=-0.5, high=-0.32)
    assert cooler.ci95["ambient_degC"] == Interval(low=58.0, high=61.0)  # 2·40 − 22, 2·40 − 19
    assert cooler.combinations[RATIO] == (-0.0025, Interval(low=-0.0026, high=-0.0024))
    assert cooler.model.ambient_degC == 60.0
    back = mirror_heater(cooler, 40.0)
    assert (back.model, back.ci95, back.combinations) == (HEATER, OPEN, _heater().combinations)


def test_heaters_are_drawn_from_a_coolers_intervals_as_from_its_mirror_image():
    drawn = [draw_heaters(fitted, 20) for fitted in (_heater(), mirror_heater(_heater()))]
    assert [replace(plant, gain_degC_per_pct=-plant.gain_degC_per_pct) for plant in drawn[1]] == [
        replace(plant, ambient_degC=None) for plant in drawn[0]]
    assert len(interval_ends(mirror_heater(_heater()))) == len(interval_ends(_heater())) == 4


def test_what_neither_heats_nor_cools_or_does_both_is_refused():
    with pytest.raises(OutOfRange, match="not zero: above for a heater, below for a cooler"):
        Fopdt(gain_degC_per_pct=0.0, time_constant_s=1.0, dead_time_s=0.1)
    both = replace(_heater(), candidates=(*_heater().candidates, *mirror_heater(_heater()).candidates))
    with pytest.raises(InputError, match="some of the possible models cool and others heat"):
        tune(both)

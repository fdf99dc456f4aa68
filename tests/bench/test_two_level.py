"""The long run is `python tests/bench/two_level.py`, and `python tests/bench/whose_heater.py`."""

import re

import pytest

from heatertune.chain.stages import fit
from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import FitOutcome
from heatertune.model.temperature.two_level import Thermostat
from tests.bench import two_level, whose_heater


@pytest.mark.parametrize("seed", [2, 9, 51, 72])
@pytest.mark.long
def test_the_heater_behind_a_thermostat_lies_within_its_intervals_without_power(seed):
    drawn = two_level.draw(seed)
    for options in ({}, {"thermostat": (drawn.low, drawn.high, *drawn.least)}):
        verdict = two_level.fit_text(drawn, drawn.text(False), **options)
        assert verdict.intervals, verdict.message
        assert all(holds for _, holds in verdict.intervals), verdict.intervals


@pytest.mark.parametrize("seed", [10, 41, 55])
@pytest.mark.long
def test_switchings_between_rows_do_not_make_the_gain_too_small(seed):
    drawn = two_level.draw(seed)
    verdict = two_level.fit_text(drawn, drawn.text(True))
    assert verdict.outcome == FitOutcome.IDENTIFIED.name
    assert all(holds for _, holds in verdict.intervals), verdict.intervals


@pytest.mark.long
def test_stated_thresholds_that_a_log_does_not_reach_are_refused_and_the_remedy_works():
    drawn = two_level.draw(9)
    refused = two_level.fit_text(drawn, drawn.text(False), thermostat=(drawn.low + 500.0, drawn.high + 500.0))
    assert "correct --thermostat, or leave it out" in refused.message
    assert two_level.fit_text(drawn, drawn.text(False)).outcome != "refused"


@pytest.mark.parametrize("numbers", [(20.0,), (60.0, 50.0), (50.0, 60.0, -1.0), (1.0, 2.0, 3.0, 4.0, 5.0)])
def test_a_thermostat_is_two_thresholds_and_up_to_two_times(numbers):
    with pytest.raises(OutOfRange, match="thermostat"):
        Thermostat.stated(numbers)


@pytest.mark.long
def test_a_thermostat_is_not_stated_for_a_log_with_power():
    drawn = two_level.draw(10)
    with pytest.raises(InputError, match="contains the power"):
        fit((drawn.time_s, drawn.temperature, drawn.power), thermostat=(50.0, 60.0))


@pytest.mark.parametrize("kind", ["opens", "probe"])
@pytest.mark.parametrize("way", whose_heater.WAYS)
@pytest.mark.long
def test_the_instant_from_which_it_is_another_heater_is_named_and_the_cut_log_is_fitted(kind, way):
    drawn = whose_heater.draw(kind, way, 1)
    word, message = whose_heater.verdict_of(kind, drawn)
    assert word == "told and cut", message
    assert abs(float(re.search(r"--until ([\d.]+)", message)[1]) - drawn.at) < 0.05 * drawn.length


@pytest.mark.parametrize("kind", ["reset", "second"])
@pytest.mark.long
def test_a_reset_or_a_second_heater_does_not_make_a_wrong_gain(kind):
    word, message = whose_heater.verdict_of(kind, whose_heater.draw(kind, "loop", 0))
    # nothing is to be cut out after a reset; a second heater is told with the option that cuts it out, which is tried here
    assert word == {"reset": "fitted", "second": "told and cut"}[kind], message


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.long
def test_a_second_heater_is_told_with_its_instant_and_the_option_that_cuts_it_out(seed):
    drawn = whose_heater.draw("second", "steps", seed)
    _, holds, message = whose_heater.fitted_or_refused(drawn)
    assert holds
    told = re.search(r"At ([\d.]+) s an unlogged load.*--until (\d+) leaves it out", message)
    assert told, message
    assert abs(float(told[1]) - drawn.at) < 0.02 * drawn.length
    outcome, holds, message = whose_heater.fitted_or_refused(drawn, until_s=float(told[2]))
    assert outcome != "refused"
    assert holds
    assert "unlogged load" not in message


@pytest.mark.long
def test_thresholds_that_are_not_stated_are_told_as_the_range_that_holds_them():
    drawn = two_level.draw(9)
    notes = " ".join(fit((drawn.time_s, drawn.temperature)).notes)
    low, high = map(float, re.search(r"they lie within (-?[\d.]+) to (-?[\d.]+) °C", notes).groups())
    assert low <= drawn.low < drawn.high <= high

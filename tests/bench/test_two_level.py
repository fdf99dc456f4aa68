"""The long run is `python tests/bench/two_level.py`, and `python tests/bench/whose_heater.py`."""

import re

import numpy as np
import pytest

from heatertune.chain.stages import fit
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.model_values import FitOutcome
from heatertune.model.relay_test import find_relay
from heatertune.model.temperature.evidence import Thermostat
from heatertune.model.temperature.two_level import fit_two_level
from heatertune.model.temperature.two_level_result import two_level_model
from tests.bench import two_level, whose_heater


# one lag without least times and with them, and two lags
@pytest.mark.parametrize("seed", [2, 9, pytest.param(51, marks=pytest.mark.sample), 72])
@pytest.mark.long
def test_the_heater_behind_a_thermostat_lies_within_its_intervals_without_power(seed):
    drawn = two_level.draw(seed)
    for options in ({}, {"thermostat": (drawn.low, drawn.high, *drawn.least)}):
        verdict = two_level.fit_text(drawn, drawn.text(False), **options)
        assert verdict.intervals, verdict.message
        assert all(holds for _, holds in verdict.intervals), verdict.intervals


@pytest.mark.parametrize("seed", [10, pytest.param(41, marks=pytest.mark.sample), pytest.param(55, marks=pytest.mark.sample)])
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


def _steps_of_output(share_pct, rows):
    """Return a log of a PI loop whose output moves in steps: 1 °C/%, 120 s, dead time 8 s, 20 °C; target 62 °C."""
    temperature, part, pipe, readings = 20.0, 0.0, [0.0] * 4, []
    noise = np.random.default_rng(4).normal(0.0, 0.03, rows)
    for k in range(rows):
        read = temperature + noise[k]
        readings.append(read)
        wanted = 5.0 * (62.0 - read) + part
        output = share_pct * round(min(100.0, max(0.0, wanted)) / share_pct)
        part += 5.0 * 2.0 / 100.0 * (62.0 - read) if 0.0 < wanted < 100.0 else 0.0
        pipe.append(output)
        temperature += (1.0 - np.exp(-2.0 / 120.0)) * (20.0 + pipe.pop(0) - temperature)
    return np.arange(rows) * 2.0, np.array(readings)


@pytest.mark.parametrize("share_pct", [20.0, pytest.param(25.0, marks=pytest.mark.sample)])
@pytest.mark.long
def test_the_lower_step_of_an_output_in_steps_is_not_no_power(share_pct):
    time_s, readings = _steps_of_output(share_pct, 900)
    log = Log(name="steps", source="", time_s=time_s[400:], temperature_degC=readings[400:])
    found = fit_two_level(log, ambient_degC=None)
    assert found.explains, "two neighbouring steps look like full power and none in a hot room"
    model = two_level_model(found, None)
    assert model.ci95["gain_degC_per_pct"] is None
    assert model.ci95["ambient_degC"] is None
    assert "lower level is no power" in " ".join(finding.message for finding in model.findings)


@pytest.mark.parametrize("numbers", [(20.0,), (60.0, 50.0), (50.0, 60.0, -1.0), (1.0, 2.0, 3.0, 4.0, 5.0)])
def test_a_thermostat_is_two_thresholds_and_up_to_two_times(numbers):
    with pytest.raises(OutOfRange, match="thermostat"):
        Thermostat.stated(numbers)


@pytest.mark.parametrize("seed", [10, pytest.param(41, marks=pytest.mark.sample)])
@pytest.mark.long
def test_stated_thresholds_of_a_log_with_power_are_compared_with_those_that_it_shows(seed):
    drawn = two_level.draw(seed)
    assert drawn.powered
    fit((drawn.time_s, drawn.temperature, drawn.power), thermostat=(drawn.low, drawn.high, *drawn.least))
    with pytest.raises(InputError, match="its heater is switched off at"):
        fit((drawn.time_s, drawn.temperature, drawn.power), thermostat=(drawn.low - 30.0, drawn.high - 30.0))


def test_the_power_of_a_staircase_is_no_thermostat_s():
    time = np.arange(0.0, 1200.0, 4.0)
    power = np.where(time < 100.0, 0.0, np.where(time < 600.0, 60.0, 30.0))
    heater = np.zeros(len(time))
    for k in range(1, len(time)):  # Euler's rule
        heater[k] = heater[k - 1] + 4.0 / 150.0 * (0.5 * power[max(k - 5, 0)] - heater[k - 1])
    with pytest.raises(InputError, match="does not switch at two temperatures; leave out --thermostat"):
        fit((time, 20.0 + heater + np.random.default_rng(1).normal(0.0, 0.05, len(time)), power), thermostat=(40.0, 45.0))


@pytest.mark.parametrize("seed", range(12))
def test_the_thresholds_between_the_rows_of_a_log_with_power_hold_those_that_switched_it(seed):
    drawn = two_level.draw(seed)
    record = find_relay(Log(name="log", source="", time_s=drawn.time_s, temperature_degC=drawn.temperature, power_pct=drawn.power))
    if record is None:
        return
    shown = record.thresholds
    assert drawn.high <= shown.high.high
    assert drawn.low >= shown.low.low
    if not any(drawn.least):
        assert shown.high.low <= drawn.high
        assert drawn.low <= shown.low.high
        assert shown.hysteresis.low <= drawn.high - drawn.low <= shown.hysteresis.high


@pytest.mark.long
def test_thresholds_that_the_curve_contradicts_are_refused_and_the_remedy_works():
    drawn = two_level.draw(9)
    off = drawn.high - 0.9 * (drawn.high - drawn.plant.ambient)
    refused = two_level.fit_text(drawn, drawn.text(False), thermostat=(off - 1.0, off))
    assert "correct --thermostat" in refused.message
    assert two_level.fit_text(drawn, drawn.text(False), thermostat=(drawn.low, drawn.high)).outcome != "refused"


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
    told = re.search(r"At ([\d.]+) s \(between [\d.]+ and [\d.]+ s\) an unlogged load.*--until (\d+) leaves it out", message)
    assert told, message
    assert abs(float(told[1]) - drawn.at) < 0.02 * drawn.length
    outcome, holds, message = whose_heater.fitted_or_refused(drawn, until_s=float(told[2]))
    assert outcome != "refused"
    assert holds
    assert "unlogged load" not in message


@pytest.mark.long
def test_thresholds_that_are_not_stated_are_noted_as_intervals_that_hold_them():
    drawn = two_level.draw(6)
    assert not any(drawn.least)
    verdict = two_level.fit_text(drawn, drawn.text(False))
    noted = two_level.judged_thresholds(drawn, verdict.message)
    assert [name for name, holds in noted if holds] == ["threshold off", "threshold on", "hysteresis"]


@pytest.mark.parametrize("powered", [True, False], ids=["power", "temperature alone"])
@pytest.mark.long
def test_a_controller_that_was_off_until_the_heater_had_cooled_is_told_with_the_option_that_leaves_it_out(powered):
    drawn = whose_heater.draw("restart", "loop", 1)
    outcome, holds, message = whose_heater.fitted_or_refused(drawn, powered)
    options, instant = whose_heater.cut_of(message)
    assert options, message
    assert drawn.at - 0.02 * drawn.length < instant < drawn.at + 0.25 * drawn.length  # it is off for 1.2 time constants
    assert powered or list(options) == ["until_s"], "the part after it does not begin at the room's temperature"
    assert holds if powered else outcome == "LAW_UNKNOWN"
    cut, holds, message = whose_heater.fitted_or_refused(drawn, powered, **options)
    assert cut in ("IDENTIFIED", "COMBINATIONS_ONLY"), message
    assert holds is not False


@pytest.mark.long
def test_a_part_of_a_log_without_power_that_begins_warm_is_not_fitted_as_if_that_were_the_room():
    drawn = whose_heater.draw("restart", "loop", 1)
    _, holds, message = whose_heater.fitted_or_refused(drawn, False, from_s=4053.0)  # at 67 °C, in a room of 26 °C
    assert holds is not False, message
    assert "The room is that of the log's first reading" in message


@pytest.mark.parametrize(("seed", "lags", "dead"), [
    pytest.param(0, (110.0, 38.0), 6.0, marks=pytest.mark.sample), (1, (160.0, 128.0), 9.0)])
@pytest.mark.long
def test_pulses_that_the_temperature_does_not_show_are_taken_at_their_rows(seed, lags, dead):
    """A PI loop with time-proportioned power over ten rows of 2 s; free instants made 73 s of dead time out of the lags."""
    gain, rng, fine = (0.56, 0.72)[seed], np.random.default_rng(seed), 0.1
    inner = outer = total = duty = 0.0
    late, rows = [0.0] * round(dead / fine), []
    for i in range(1400):
        setpoint = 0.0 if i < 30 else gain * 45.0 if i < 700 else gain * 55.0
        if i % 10 == 0:
            error = setpoint - outer - rng.normal(0.0, 0.05)
            proportional = 0.45 * lags[0] / (gain * (lags[1] + dead))
            duty = min(max(proportional * error + total, 0.0), 100.0)
            total += proportional * error * 20.0 / sum(lags) if 0.0 < duty < 100.0 else 0.0
        power = 100.0 if i % 10 < round(duty / 10.0) else 0.0
        rows.append((2.0 * i, round(22.0 + outer + rng.normal(0.0, 0.05), 1), power))
        for _ in range(20):
            late.append(power)
            inner += fine * (gain * late.pop(0) - inner) / lags[0]
            outer += fine * (inner - outer) / lags[1]
    found = fit(tuple(np.array(rows).T))
    two = [each.model for each in found.candidates if len(each.model.lags_s) == 2]
    assert any(each.lags_s == pytest.approx(lags, rel=0.1) and each.dead_time_s == pytest.approx(dead, abs=2.0) for each in two)

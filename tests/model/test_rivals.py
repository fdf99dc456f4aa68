"""Loads under feedback, and what drift, loads and initial state may have swallowed."""

import numpy as np
import pytest
from tests.model.twins import GAIN, LAG, closed_loop, doublet, logged

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import FitOutcome
from heatertune.model.power.candidates import widen_intervals
from heatertune.model.power.explanation import part
from heatertune.model.statistics import Interval


def _told(fitted, words):
    return [note for note in fitted.notes if words in note]


@pytest.mark.long
def test_a_load_in_a_closed_loop_is_found_though_the_fit_without_it_is_far_off():
    # without the load the direct fit ends at a twentieth of the gain, its ambient near the setpoint
    fitted = fit(closed_loop(load_degC=-4.0), power_before_pct=0.0)
    assert fitted.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.01)
    assert fitted.model.time_constant_s == pytest.approx(LAG, rel=0.02)
    load = _told(fitted, "unlogged load")[0]
    assert float(load.split()[1]) == pytest.approx(1300.0, abs=8.0)
    assert "cools loop by 4 °C" in load
    without = [c for c in fitted.candidates if "without drift and loads" in c.law]
    assert all(c.model.gain_degC_per_pct > 0.5 * GAIN for c in without), "no rival with the setpoint for its ambient"


@pytest.mark.long
def test_a_slow_wall_that_passes_for_the_initial_state_is_a_rival_and_no_gain_is_believed():
    # 0.3 °C/% at once and 0.2 °C/% through the wall: 0.5 °C/% in the long run, from 20 °C
    fitted = fit(closed_loop(wall=True), power_before_pct=0.0)
    assert fitted.outcome is FitOutcome.COMBINATIONS_ONLY
    rival = next(c for c in fitted.candidates if "ambient at the lowest reading" in c.law)
    assert rival.model.ambient_degC == pytest.approx(20.0, abs=0.2)
    assert 0.3 < rival.model.gain_degC_per_pct < 0.5
    gain = fitted.ci95["gain_degC_per_pct"]
    assert gain is None or gain.low < 0.3 < gain.high
    assert _told(fitted, "no heater is colder than its room")


@pytest.mark.long
def test_drift_that_swallows_a_slow_heater_in_a_loop_leaves_both_as_candidates(real_logs):
    from tests.conftest import load_csv  # noqa: PLC0415 - beside its only use

    # two minutes of a loop: 47 °C/h of drift and 14 s, or no drift and 86 s; published direct fit 0.342 °C/%, 90.5 s
    log = load_csv(real_logs / "normalised" / "tec_run11.csv", "tec_run11")
    fitted = fit(log)
    assert len([c for c in fitted.candidates if "without drift" in c.law]) == 1
    for name, published in (("gain_degC_per_pct", 0.3423), ("time_constant_s", 90.4677)):
        found = fitted.ci95[name]
        assert found.low < getattr(fitted.model, name) < found.high
        assert found.high == pytest.approx(published, rel=0.06)
    assert fitted.outcome is FitOutcome.COMBINATIONS_ONLY
    assert "in a closed loop the power answers them" in _told(fitted, "With drift fitted")[0]


@pytest.mark.long
def test_a_chamber_whose_plain_fit_would_have_begun_colder_than_its_room_is_told(real_logs):
    from tests.conftest import load_csv  # noqa: PLC0415 - beside its only use

    # at rest (25.02 − 23.55 °C)/61 % = 0.0241 °C/% if it began at the ambient; the published direct fit has 0.0188
    fitted = fit(load_csv(real_logs / "normalised" / "chamber_run13.csv", "chamber"))
    rival = next(c.model for c in fitted.candidates if "without drift" in c.law)
    assert rival.gain_degC_per_pct == pytest.approx(0.0241, rel=0.03)
    assert fitted.ci95["gain_degC_per_pct"].low <= rival.gain_degC_per_pct < fitted.model.gain_degC_per_pct
    assert fitted.outcome is FitOutcome.COMBINATIONS_ONLY


@pytest.mark.long
@pytest.mark.parametrize("what", ["drift", "load"])
def test_in_an_open_loop_a_drift_or_load_that_foretells_the_rest_has_no_rival(what):
    time, power = doublet()
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(time))
    noise += 4.0 * time / 3600.0 if what == "drift" else 6.0 * np.expm1(-np.clip(time - 703.0, 0.0, None) / LAG)
    fitted = fit(logged(time, power, noise=noise))
    assert fitted.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.01)
    assert not _told(fitted, "both are candidates")
    assert fitted.outcome is FitOutcome.IDENTIFIED


@pytest.mark.long
def test_one_step_and_a_load_are_fitted_where_two_lags_alone_would_not_need_the_power():
    time = np.arange(0.0, 1500.0, 4.0)
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(time))
    noise += 6.0 * np.expm1(-np.clip(time - 803.0, 0.0, None) / LAG)
    fitted = fit(logged(time, np.where(time < 60.0, 0.0, 50.0), noise=noise))
    assert fitted.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.05)


def test_intervals_are_widened_to_the_rivals_and_an_open_end_stays_open():
    inside = {"a": Interval(low=1.0, high=2.0), "b": Interval(low=None, high=2.0)}
    assert widen_intervals(inside, []) == inside
    found = widen_intervals(inside, [{"a": 3.0, "b": 0.5}, {"a": 1.5, "b": float("nan")}])
    assert found == {"a": Interval(low=1.0, high=3.0), "b": Interval(low=None, high=2.0)}


# --- columns that do not belong together: one sentence each -------------------------------------------------------

def _bad(power=None, temperature=None):
    time, pulses = doublet()
    good = logged(time, pulses, noise=np.random.default_rng(1).normal(0.0, 0.1, len(time)))
    return Log(name="bad", source="", time_s=time,
               temperature_degC=good.temperature_degC if temperature is None else temperature(good),
               power_pct=pulses if power is None else power(pulses))


@pytest.mark.parametrize(("log", "told"), [
    (lambda: _bad(power=lambda p: np.full(len(p), 40.0)), "40 % throughout"),
    (lambda: _bad(temperature=lambda log: 100.0 - log.temperature_degC), "falls as the power rises"),
    (lambda: _bad(power=lambda p: np.roll(p, 20)), "in different clocks"),
    (lambda: _bad(temperature=lambda log: 20.0 + np.random.default_rng(1).normal(0.0, 0.1, len(log.time_s))),
     "dead time is longer than the log"),
], ids=["constant power", "gain of the wrong sign", "different clocks", "no answer"])
def test_columns_that_do_not_belong_together_end_in_one_sentence(log, told):
    with pytest.raises(InputError, match=told) as problem:
        fit(log())
    assert "\n" not in str(problem.value)


def test_a_clock_that_runs_behind_is_found_to_the_sample():
    # the power's column 80 s late, the dead time 12 s: the temperature moves 68 s before its power
    with pytest.raises(InputError, match="different clocks") as problem:
        fit(_bad(power=lambda p: np.roll(p, 20)))
    assert float(str(problem.value).split(" moves ")[1].split(" s ")[0]) == pytest.approx(68.0, abs=4.0)


@pytest.mark.long
@pytest.mark.parametrize(("late", "told"), [(0, False), (40, True)])
def test_a_dead_time_longer_than_the_time_constant_may_be_a_clock_of_the_power_that_runs_ahead(late, told):
    # the power's column 160 s early looks like 160 s more of dead time: 172 s against a time constant of 150 s.
    # SciPy's FOPDT fits to the step responses of 2…10 equal lags have L/T = 0.31, 0.56, 0.79, 0.98, 1.16 … 1.75
    fitted = fit(_bad(power=lambda p: np.roll(p, -late)))
    assert fitted.model.dead_time_s == pytest.approx(12.0 + 4.0 * late, abs=3.0)
    notes = _told(fitted, "runs ahead of the temperature's")
    assert bool(notes) == told
    if told:
        assert notes[0].startswith(f"The dead time of {fitted.model.dead_time_s:.3g} s is longer than the time const")


@pytest.mark.long
@pytest.mark.parametrize("logs", [1, 2])
def test_a_step_in_a_gap_leaves_the_dead_time_open_by_the_gap(logs):
    # lsim's heater of 60 s dead time; nobody saw that the power came 100 s before the reading after the gap
    time, parts = np.arange(0.0, 1500.0, 5.0), []
    for seed in range(logs):
        noise = np.random.default_rng(seed).normal(0.0, 0.1, len(time))
        log = logged(time, np.where(time >= 100.0, 60.0, 0.0), dead=60.0, noise=noise, name=f"gap {seed}")
        parts.append(part(log, (time <= 60.0) | (time >= 200.0)))
    fitted = fit(parts[0]) if logs == 1 else fit_together(parts)
    dead = fitted.ci95["dead_time_s"]
    assert (dead.low or 0.0) < 60.0 < dead.high
    # it had begun by 200 s: 140 s at most; each segment has an initial state of its own, so a little less explains it exactly as well
    # and two rows (10 s) more, by which the power may be late
    assert 130.0 < max(each.model.dead_time_s for each in fitted.candidates) < 150.5
    assert any("changed in a gap" in note for note in fitted.notes)
    assert all(each.delta_bic < 100.0 for each in fitted.candidates), "no heater of a power that the log does not have"


@pytest.mark.long
def test_beside_a_step_that_was_seen_the_right_reading_of_one_in_a_gap_is_the_best_candidate():
    time = np.arange(0.0, 3000.0, 5.0)
    power = np.select([time < 100.0, time < 1500.0], [0.0, 60.0], 20.0)
    log = logged(time, power, dead=60.0, noise=np.random.default_rng(1).normal(0.0, 0.1, len(time)))
    fitted = fit(part(log, (time <= 60.0) | (time >= 200.0)))
    best = min(fitted.candidates, key=lambda each: each.delta_bic)
    assert "changed as gaps began" in best.law
    assert best.model.dead_time_s == pytest.approx(60.0, abs=1.0)
    assert best.model.time_constant_s == pytest.approx(LAG, rel=0.01)

"""Power that PWM switches while its mean is logged: the truth is known, the logs are those of a bench that shares no code."""

from dataclasses import replace

import numpy as np
import pytest
from tests.bench import causes, identification

from heatertune.errors import InputError, OutOfRange
from heatertune.log import read_log
from heatertune.log.cells import MARK, SWITCHED
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.statistics import holds


def test_pulses_have_the_asked_mean_and_begin_each_period():
    time, power = np.arange(0.0, 40.0, 4.0), np.array([0.0] * 5 + [25.0] * 5)
    held, since = identification.pulses(time, power, 8.0, -2.0)
    assert since[1:].reshape(-1, 2)[:, 0].tolist() == [-2.0, 6.0, 14.0, 22.0, 30.0]
    # what is asked from 20 s on waits for the period that begins at 22 s
    assert np.diff(since[1:])[::2].tolist() == [0.0, 0.0, 0.0, 2.0, 2.0]
    assert held[1:].tolist() == [100.0, 0.0] * 5


def test_the_dead_time_of_a_switched_heater_lies_in_its_interval_once_the_fit_knows_the_period():
    case = identification.make(8, 2.0)  # one step, a period of 0.85 log intervals, pulses that wait for it
    truth = case.plant.dead_time_s
    plain, told = fit(case.log), fit(case.log, log_pwm_period_s=case.period_s)
    assert not holds(plain.ci95["dead_time_s"], truth), "the bench says how many: --pwm 2"
    assert holds(told.ci95["dead_time_s"], truth)
    assert told.model == plain.model, "what was fitted is told as it is"
    dead, before = told.ci95["dead_time_s"], plain.ci95["dead_time_s"]
    assert (before.low - dead.low, dead.high - before.high) == pytest.approx((case.period_s, 0.5 * case.period_s))
    possible = [plant.dead_time_s for plant in told.plants]
    assert min(possible) <= dead.low + 1e-9, "the verdict hears both ends"
    assert max(possible) >= dead.high - 1e-9
    assert told.assumed == {"log_pwm_period_s": case.period_s}
    assert any("switched by PWM" in note for note in told.notes)


def test_power_that_is_on_or_off_in_the_log_hides_nothing():
    case = identification.make(0)
    log = replace(case.log, power_pct=np.where(case.log.power_pct > 0.0, 100.0, 0.0))
    assert fit(log, log_pwm_period_s=5.0).ci95 == fit(log).ci95


def test_a_recording_tells_its_period_and_the_user_another(tmp_path):
    case = identification.make(8, 2.0)
    rows = "\n".join(f"{t!r},{y!r},{u!r}" for t, y, u in zip(
        *(column.tolist() for column in (case.log.time_s, case.log.temperature_degC, case.log.power_pct)), strict=True))
    head = f"{MARK}; s7://plc/0/2/db30; begun now; time: scans{SWITCHED}6.25 s; a row may hold two"
    (tmp_path / "log.csv").write_text(f"{head}\ntime_s,temperature_degC,power_pct\n{rows}\n")
    log = read_log(tmp_path / "log.csv")
    assert log.pwm_period_s == log.window(0.0, log.time_s[50]).pwm_period_s == 6.25
    assert fit(log).assumed == {"log_pwm_period_s": 6.25}
    assert fit(log, log_pwm_period_s=3.0).assumed == {"log_pwm_period_s": 3.0}
    assert fit(log, log_pwm_period_s=0.0).assumed == {}
    assert read_log(tmp_path / "x.csv", content=f"{MARK}; s7\ntime_s,temperature_degC,power_pct\n{rows}\n".encode()
                    ).pwm_period_s == 0.0


def test_a_negative_period_is_refused():
    with pytest.raises((InputError, OutOfRange), match="log_pwm_period"):
        fit(identification.make(0).log, log_pwm_period_s=-1.0)


@pytest.mark.parametrize("form", ["late", "mean", "early", "exact"])
def test_a_power_column_that_is_a_row_off_leaves_the_true_dead_time_possible(form):
    for seed in (1, 2):
        case = causes._read_as(np.random.default_rng(seed), form)
        fitted = fit(Log(name=form, source="", time_s=case.time, temperature_degC=case.temperature, power_pct=case.power))
        # two lags answer later than one by the second lag: the half rule adds half of it to the dead time
        effective = case.heater.dead + 0.5 * float(-1.0 / case.heater.a[1, 1])
        assert max(plant.half_rule().dead_time_s for plant in fitted.plants) >= effective
        assert any("a row late" in note for note in fitted.notes)


def test_a_longest_dead_time_that_the_user_knows_bounds_a_row_more():
    case = identification.make(0)
    most = float(fit(case.log).model.dead_time_s) + 1.0
    fitted = fit(case.log, dead_time_at_most_s=most)
    assert fitted.ci95["dead_time_s"].high <= most + 1e-9
    assert max(plant.dead_time_s for plant in fitted.plants) <= most + 1e-9

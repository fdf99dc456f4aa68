"""A heater that stops answering is found, near the instant; one that goes on is not accused."""

import re

import numpy as np
import pytest
from tests.bench import causes, whose_heater

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.power.changed_heater import opening
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings


def _opened(seed, *, loop):
    """Return a log, in a loop or of steps, whose heater gets no power from an instant on, the instant and the length."""
    rng = np.random.default_rng(seed)
    heater, rows = causes._drawn_series(rng), 900
    interval = heater.slowest / 60.0
    at = rng.uniform(0.3, 0.85) * rows * interval
    law = (causes._loop(heater, rng, rows, interval, rng.uniform(25.0, 60.0, 2)) if loop
           else causes._steps(rng, rows, 40, 25.0, 60.0))
    h, x = interval / 20, np.zeros(len(heater.b))
    late, y, u = [0.0] * round(heater.dead / h), np.empty(rows), np.empty(rows)
    for i in range(rows):
        y[i] = 22.0 + x[-1] + rng.normal(0.0, 0.06)
        u[i] = law(i, y[i])
        for _ in range(20):
            late.append(u[i] if i * interval < at else 0.0)
            x = x + h * (heater.a @ x + heater.b * late.pop(0))
    log = Log(name="opened", source="", time_s=np.arange(rows) * interval, temperature_degC=y, power_pct=u)
    return log, at, rows * interval


def _found(log):
    return opening(PowerProblem(readings=Readings.of(log)))


@pytest.mark.long
@pytest.mark.parametrize("loop", [True, False])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_interval_holds_the_instant_within_three_rows(seed, loop):
    log, at, _ = _opened(seed, loop=loop)
    found, row = _found(log), float(log.time_s[1])
    assert found.low_s - 3.0 * row <= at <= found.high_s + 3.0 * row
    after = log.power_pct[(log.time_s > at + 3.0 * row) & (log.time_s < found.until_s)]
    assert not after.any(), "no power that was lost is in the part to be fitted"


@pytest.mark.long
def test_the_fit_refuses_such_a_log_and_accepts_it_up_to_there():
    log, at, _ = _opened(1, loop=True)
    with pytest.raises(InputError, match=r"stops answering at t=.*--until") as told:
        fit(log)
    until = float(str(told.value).rpartition(" ")[2])
    assert until == pytest.approx(at, abs=3.0 * float(log.time_s[1]))
    assert fit(log, until_s=until).fit_pct > 90.0


@pytest.mark.long
@pytest.mark.parametrize("kind", ["plain", "small-load", "door", "cooling", "two-scales", "two-scales-loop"])
def test_no_heater_that_goes_on_is_accused(kind):
    for seed in range(3):
        case = causes.make(kind, seed)
        assert _found(Log(name=kind, source="", time_s=case.time, temperature_degC=case.temperature, power_pct=case.power)) is None


@pytest.mark.long
def test_a_slow_part_of_a_heater_is_no_change_of_it_and_its_gain_is_found():
    case = causes.make("two-scales-loop", 5)
    model = fit(Log(name="slow part", source="", time_s=case.time, temperature_degC=case.temperature, power_pct=case.power))
    gain, truth = model.ci95["gain_degC_per_pct"], -float(np.linalg.solve(case.heater.a, case.heater.b)[-1])
    assert gain.low <= truth <= gain.high
    assert "shared-mass" in {finding.name for finding in model.findings}


def test_an_opening_while_the_power_is_off_is_stated_as_that_interval_and_cut_at_its_end():
    # 0.5 °C/% with 60 s, 40 % but for 500 to 620 s; open from 560 s on, which nothing shows before 620 s
    time = np.arange(0.0, 1000.0, 2.0)
    power = np.where((time < 20.0) | ((time >= 500.0) & (time < 620.0)), 0.0, 40.0)
    y, temperature = 20.0, []
    for t, u in zip(time, power, strict=True):
        temperature.append(y)
        y = 20.0 + (u if t < 560.0 else 0.0) * 0.5 + (y - 20.0 - (u if t < 560.0 else 0.0) * 0.5) * np.exp(-2.0 / 60.0)
    temperature = np.array(temperature) + np.random.default_rng(3).normal(0.0, 0.05, len(time))
    found = _found(Log(name="off", source="", time_s=time, temperature_degC=temperature, power_pct=power))
    assert found.low_s == pytest.approx(500.0, abs=6.0)
    assert found.high_s == pytest.approx(620.0, abs=6.0)
    assert found.until_s == pytest.approx(620.0, abs=6.0)


@pytest.mark.long
@pytest.mark.parametrize("seed", [103, 106])
def test_the_begin_of_a_second_heater_is_stated_with_its_interval(seed):
    drawn = whose_heater.draw("second", "steps", seed, noise_times=5.0)
    row = drawn.rows[1][0]
    _, holds, message = whose_heater.fitted_or_refused(drawn)
    low, high = map(float, re.search(r"between ([\d.]+) and ([\d.]+) s\) an unlogged load", message).groups())
    assert holds
    assert low - 3.0 * row <= drawn.at <= high + 3.0 * row

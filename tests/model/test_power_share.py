"""Which cause moves a fit by how much, and what blocks a PASS; the heaters are those of tests/bench/causes.py."""

import re

import numpy as np
import pytest
from tests.bench import causes

from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.power.fit_power import contributions_of
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings


def _log(case, name="made"):
    return Log(name=name, source="", time_s=case.time, temperature_degC=case.temperature, power_pct=case.power)


def _unexplained(fitted):
    return [finding.message for finding in fitted.findings if finding.name == "unexplained-by-power"]


def _steps(heater, *, other=None, seed=1, rows=900, levels=(0.0, 40.0, 20.0)):
    rng = np.random.default_rng(seed)
    return causes.run(heater, lambda i, _: levels[np.searchsorted([60, 500], i, side="right")], rows,
                      heater.slowest / 80.0, rng, other=other)


PLAIN = causes.series(0.5, (120.0, 15.0), 10.0)


def test_the_power_moves_a_plain_heater_by_its_gain_times_its_step():
    case = _steps(causes.series(0.5, (120.0,), 10.0))
    problem = PowerProblem(readings=Readings.of(_log(case)))
    moved = contributions_of(problem, problem.fit())
    assert moved.power == pytest.approx(0.5 * 40.0, rel=0.02)  # 440 rows of 1.5 s are five time constants and a half
    assert (moved.events, moved.drift, moved.loads) == (0.0, 0.0, 0.0)
    assert moved.start < 0.5


# gain, share of the fast element, its lag, lag of the mass, sensor, dead time: those of the issue
@pytest.mark.parametrize(("parameters", "seed"), [((0.60, 0.30, 12, 1000, 8, 3.0), 100), ((0.70, 0.20, 9, 1300, 10, 4.0), 102)])
def test_a_fast_element_beside_a_slow_mass_is_identified_and_its_neighbours_are_told(parameters, seed):
    heater = causes.two_scales(*parameters)
    case = causes.run(heater, lambda i, _: 0.0 if i < 60 else 55.0 if i < 1000 else 25.0 if i < 1800 else 60.0, 2600, 1.0,
                      np.random.default_rng(seed))
    fitted = fit(_log(case))
    assert fitted.plants[0].gain_degC_per_pct == pytest.approx(parameters[0], rel=0.02)
    assert fitted.plants[0].lags_s == pytest.approx((parameters[3], parameters[2] + parameters[4]), rel=0.4)  # the sensor's lag beside the element's
    assert [finding.name for finding in fitted.findings] == ["shared-mass"]
    told = float(re.search(r"([\d.]+) % of its rise come within", " ".join(fitted.notes))[1])
    assert told == pytest.approx(100.0 * parameters[1], abs=8.0)


def test_a_small_step_in_a_large_drift_blocks():
    length = 900 * PLAIN.slowest / 80.0
    case = _steps(PLAIN, other=lambda t: 12.0 * t / length, levels=(0.0, 12.0, 24.0))
    assert _unexplained(fit(_log(case)))


@pytest.mark.parametrize("size", [-4.0, -8.0])
def test_a_door_that_opens_beside_a_good_step_blocks_nothing(size):
    begins = 300 * PLAIN.slowest / 80.0  # 2.5 time constants after the step

    def cooled(t):
        return size * (1.0 - np.exp(-max(t - begins, 0.0) / PLAIN.slowest))

    assert _unexplained(fit(_log(_steps(PLAIN, other=cooled)))) == []


def test_of_several_logs_the_one_that_the_power_does_not_explain_is_named():
    length = 900 * PLAIN.slowest / 80.0
    good = _log(_steps(PLAIN), "good")
    bad = _log(_steps(PLAIN, other=lambda t: 12.0 * t / length, levels=(0.0, 12.0, 24.0), seed=2), "bad")
    told = _unexplained(fit_together([good, bad]))
    assert told
    assert all(sentence.startswith("bad") for sentence in told)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["plain", "row-late", "row-exact"])
def test_a_log_that_only_its_power_moves_is_explained_by_it(kind):
    assert not any(_unexplained(fit(_log(causes.make(kind, seed)))) for seed in range(6))

"""A heater of two time scales against two one-lag heaters in parallel, integrated by Euler steps: no formula is shared."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.bench import causes

import heatertune as ht
from heatertune import cache
from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_document import from_document, to_document
from heatertune.model.model_values import model_by_hand
from heatertune.model.reduction import match_fopdt, ultimate_period_s
from heatertune.model.two_scales import TwoScale
from heatertune.model.validate import validate
from heatertune.pid.rules import ultimate_cycle
from heatertune.pid.sampled_loop import sample_plant

ELEMENT_S, MASS_S, SHARE, GAIN, DEAD_S = 15.0, 900.0, 0.3, 0.6, 6.0
#: share of the rise on the fast lag, in parallel → share that passes the mass, in series: the zeros are the same
HEATER = TwoScale(gain_degC_per_pct=GAIN, time_constant_s=MASS_S, second_time_constant_s=ELEMENT_S, dead_time_s=DEAD_S,
                  ambient_degC=22.0, fast_share=SHARE + (1.0 - SHARE) * ELEMENT_S / MASS_S)


def _parallel(time, power, base=0.0, step=0.01):
    """Return the rise of two one-lag heaters in parallel, by Euler steps, at instants that are multiples of the step."""
    fast, slow = GAIN * SHARE * base, GAIN * (1.0 - SHARE) * base
    late, rows, n = [base] * round(DEAD_S / step), [], 0
    for i, until in enumerate(time):
        while n * step < until - 0.5 * step:
            late.append(power[i - 1])
            u = late.pop(0)
            fast += step * (GAIN * SHARE * u - fast) / ELEMENT_S
            slow += step * (GAIN * (1.0 - SHARE) * u - slow) / MASS_S
            n += 1
        rows.append(fast + slow)
    return np.array(rows)


def test_its_response_is_that_of_two_lags_in_parallel():
    time = np.arange(0.0, 600.0, 5.0)
    power = np.where(time < 100.0, 60.0, np.where(time < 400.0, 10.0, 90.0))
    expected = 22.0 + _parallel(time, power, base=20.0)
    assert HEATER.predict(time, power, power_before_pct=20.0) == pytest.approx(expected, abs=0.01)
    assert HEATER.step(time, power_pct=60.0) == pytest.approx(_parallel(time, np.full(len(time), 60.0)), abs=0.01)


def test_its_frequency_response_is_that_of_two_lags_in_parallel():
    omega = np.geomspace(1e-4, 1.0, 30)
    s = 1j * omega
    expected = GAIN * np.exp(-s * DEAD_S) * (SHARE / (1.0 + ELEMENT_S * s) + (1.0 - SHARE) / (1.0 + MASS_S * s))
    assert HEATER.frequency_response(omega) == pytest.approx(expected, rel=1e-12)
    slow = omega[omega < 0.05]  # far below the sampling frequency, held power is a delay of half an interval
    held = HEATER.frequency_response(slow) * np.exp(-0.5j * slow)
    assert sample_plant(HEATER, 1.0).frequency_response(slow) == pytest.approx(held, rel=1e-3)


def test_it_swings_at_its_ultimate_gain():
    gain, period = ultimate_cycle(HEATER)
    assert period == pytest.approx(ultimate_period_s(HEATER))
    assert gain * HEATER.frequency_response(np.array([2.0 * math.pi / period])) == pytest.approx(-1.0, abs=1e-9)


def test_the_half_rule_has_its_gain_and_its_rise_after_a_step():
    soon = np.array([DEAD_S + 0.01])
    one = HEATER.half_rule()
    assert one.gain_degC_per_pct == GAIN
    assert one.step(soon) == pytest.approx(HEATER.step(soon), rel=1e-2)
    near = 2.0 * math.pi / ultimate_period_s(HEATER) / 2.0
    ratio = match_fopdt(HEATER).frequency_response(np.array([near])) / HEATER.frequency_response(np.array([near]))
    assert abs(ratio[0] - 1.0) < 0.05


@pytest.mark.parametrize("share", [0.5 * ELEMENT_S / MASS_S, 1.01, -0.1])
def test_a_share_that_makes_no_two_time_scales_is_refused(share):
    with pytest.raises(OutOfRange, match="fast_share"):
        replace(HEATER, fast_share=share)


def test_with_the_share_of_one_lag_it_is_one_lag():
    time = np.linspace(0.0, 3000.0, 50)
    one = ht.Fopdt(gain_degC_per_pct=GAIN, time_constant_s=MASS_S, dead_time_s=DEAD_S)
    assert replace(HEATER, fast_share=ELEMENT_S / MASS_S).step(time) == pytest.approx(one.step(time), abs=1e-12)


def test_it_outlives_its_document():
    assert from_document(to_document(model_by_hand(HEATER))).candidates[0].model == HEATER


def test_a_sampled_transfer_function_is_refused_and_the_continuous_one_has_the_zero():
    with pytest.raises(InputError, match="sample_time_s"):
        HEATER.to_tf(sample_time_s=1.0)
    omega = 0.02
    assert complex(HEATER.to_tf()(1j * omega)) == pytest.approx(
        complex(HEATER.frequency_response(np.array([omega]))[0]), rel=1e-4)


@pytest.mark.long
def test_the_loop_of_the_proof_moves_it_as_two_lags_in_parallel():
    fitted = model_by_hand(HEATER)
    words = ht.encode(ht.tune(fitted, structure="pi", ms=1.6, target="fb41"), target="fb41")
    trace = ht.simulate(words, HEATER, 45.0)
    calm = [each for each in trace.scenario.disturbances if type(each).__name__ == "TemperatureStep"]
    end = min([each.time_s for each in calm], default=math.inf)
    since, _, _, target = trace.stretches.T
    rows = since < min(end, 400.0)
    step = 0.001
    edges, power = np.round(since[rows] / step) * step, (target[rows] - 22.0) / GAIN
    # the stretches tell when the heater feels the power, so the dead time is in them
    fast = slow = 0.0
    asked = np.arange(20.0, min(end, 400.0), 20.0)
    values, place, now = [], 0, 0.0
    for until in asked:
        while now < until - 0.5 * step:
            while place + 1 < len(edges) and edges[place + 1] <= now + 0.5 * step:
                place += 1
            fast += step * (GAIN * SHARE * power[place] - fast) / ELEMENT_S
            slow += step * (GAIN * (1.0 - SHARE) * power[place] - slow) / MASS_S
            now += step
        values.append(22.0 + fast + slow)
    assert np.max(np.abs(trace.temperature_at(asked) - values)) < 0.02
    assert np.ptp(values) > 10.0


@pytest.mark.parametrize("seed", [0, 1])
def test_a_log_of_two_time_scales_gives_both(seed, tmp_path):
    case = causes.make("two-scales", seed)
    (tmp_path / "log.csv").write_text(case.text(), encoding="utf-8")
    with cache.cache_disabled():
        fitted = ht.fit(tmp_path / "log.csv")
    model, slow_s = fitted.candidates[0].model, case.heater.slowest
    gain = -float(np.linalg.solve(case.heater.a, case.heater.b)[-1])
    assert isinstance(model, TwoScale)
    assert {finding.name for finding in fitted.findings} <= {"shared-mass"}
    assert model.gain_degC_per_pct == pytest.approx(gain, rel=0.03)
    assert model.time_constant_s == pytest.approx(slow_s, rel=0.06)
    # fast lag, sensor and dead time add up to the same delay
    fast = -1.0 / case.heater.a[0, 0] - 1.0 / case.heater.a[2, 2] + case.heater.dead
    assert model.second_time_constant_s + model.dead_time_s == pytest.approx(fast, rel=0.1)
    assert any("two time scales" in note for note in fitted.notes)
    verdict = validate(fitted, ht.read_log(tmp_path / "log.csv"))
    assert verdict.runs[1].fit_pct > 98.0  # the first run is of the FOPDT that rules are applied to
    assert not verdict.fails


@pytest.mark.parametrize("kind", ["plain", "door"])
def test_a_log_that_needs_no_two_time_scales_gets_none(kind, tmp_path):
    (tmp_path / "log.csv").write_text(causes.make(kind, 3).text(), encoding="utf-8")
    with cache.cache_disabled():
        fitted = ht.fit(tmp_path / "log.csv")
    assert all(each.model.fast_share is None for each in fitted.candidates)

"""What is measured on a run, against a plain integration of the same heater in steps of a millisecond."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.witness.trace_measures import judge

from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.proof import (
    Acceptance,
    Actuator,
    Load,
    LoopLimits,
    Scenario,
    TemperatureStep,
    prove_models,
    simulate,
)
from heatertune.proof.meter import faults

STEP_S = 0.001
SCENARIO = Scenario(setpoint_degC=40.0, duration_s=400.0, disturbances=(
    TemperatureStep(time_s=150.37, temperature_degC=-6.0), Load(time_s=280.11, power_pct=-15.0)))
#: PWM ripple of some degrees around the setpoint: the error changes sign twice in each period
COARSE = Actuator(pwm_period_s=8.0)
ONE_LAG = Fopdt(gain_degC_per_pct=0.5, time_constant_s=25.0, dead_time_s=2.3, ambient_degC=20.0)
TWO_LAGS = TwoLag(gain_degC_per_pct=0.5, time_constant_s=20.0, second_time_constant_s=6.0, dead_time_s=1.1, ambient_degC=20.0)


def errors(trace, model):
    """Instants and the error there, by Euler's rule from the switch's edges and the disturbances alone."""
    grid = np.arange(0.0, trace.time_s[-1], STEP_S) + STEP_S / 2.0
    jump, load = trace.scenario.disturbances
    switched = np.searchsorted(trace.edge_time_s + model.dead_time_s, grid)
    power = np.where(switched % 2 == 1, 100.0, 0.0) + load.power_pct * (grid > load.time_s + model.dead_time_s)
    parts, states = [], [20.0] * len(model.lags_s)
    for part in np.split(20.0 + model.gain_degC_per_pct * power, [np.searchsorted(grid, jump.time_s)]):
        for number, lag in reversed(list(enumerate(model.lags_s))):
            share = STEP_S / lag
            part, _ = lfilter([share], [1.0, share - 1.0], part, zi=[(1.0 - share) * states[number]])  # noqa: PLW2901
            states[number] = part[-1] + jump.temperature_degC
        parts.append(part)
    return grid + STEP_S / 2.0, np.concatenate(parts) - trace.setpoint_degC


def stays(times, error, start, end, band):
    inside = (times > start) & (times <= end)
    outside = times[inside][np.abs(error[inside]) > band]
    return (outside[-1] if len(outside) else start) - start


@pytest.mark.parametrize("model", [ONE_LAG, TWO_LAGS], ids=["one lag", "two lags"])
def test_integrals_and_crossings_are_those_of_a_fine_integration(tenths, words, model):
    limits = LoopLimits(tolerance_degC=4.0, steady_share=0.5)
    trace = simulate(tenths, words(gain=2.5, tn=30), model, SCENARIO, COARSE)
    times, error = errors(trace, model)
    stops = (0.0, 150.37, 280.11, 400.0)
    assert np.count_nonzero(np.diff(np.sign(error[times > 60.0]))) > 25, "the error changes sign again and again"
    settled, *recovered = [stays(times, error, start, end, 4.0) for start, end in pairwise(stops)]
    rest = (times > 150.37 - 72.0) & (times <= 150.37)  # nine whole PWM periods in half of the heat-up
    expected = {
        "iae": np.abs(error).sum() * STEP_S, "settling_time": settled, "recovery_time": max(recovered),
        "steady_offset": abs(error[rest].mean()), "limit_cycle": np.ptp(error[rest]) / 2.0,
    }
    assert all(value > 0.01 for value in expected.values())
    (run,) = prove_models(tenths, words(gain=2.5, tn=30), [("heater", model)], SCENARIO, COARSE, Acceptance(limits=limits)).runs
    for criteria in (run.criteria, judge(trace, limits)):
        measured = {each.name: each.value for each in criteria}
        assert {name: measured[name] for name in expected} == pytest.approx(expected, rel=1e-3)


def test_the_bits_of_a_byte_of_flags_are_counted():
    assert [faults(bits) for bits in range(256)] == [f"{bits:b}".count("1") for bits in range(256)]

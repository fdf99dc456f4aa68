import numpy as np
import pytest
from scipy.signal import lsim, lti

from heatertune.errors import OutOfRange
from heatertune.model.experiment.fisher import Schedule, peak_rise, rise, rows_of, sensitivities
from heatertune.model.model_values import Fopdt, TwoLag

ONE = Fopdt(gain_degC_per_pct=0.5, time_constant_s=90.0, dead_time_s=12.3)
TWO = TwoLag(gain_degC_per_pct=0.4, time_constant_s=90.0, second_time_constant_s=40.0, dead_time_s=7.1)
MODELS = pytest.mark.parametrize("model", [ONE, TWO], ids=["one lag", "two lags"])

DOUBLET = Schedule(base_pct=10.0, time_s=np.array([20.0, 200.0, 420.0]), power_pct=np.array([70.0, 0.0, 10.0]))


def _by_scipy(model, schedule, instants):
    """The rise by SciPy's linear simulation, on a grid on which the dead time falls."""
    fine = np.arange(0.0, instants[-1] + 1.0, 0.1)
    denominator = np.array([1.0])
    for lag in model.lags_s:
        denominator = np.polymul(denominator, [lag, 1.0])
    system = lti([model.gain_degC_per_pct], denominator)
    held = schedule.at(fine - model.dead_time_s + 1e-9) - schedule.base_pct
    return np.interp(instants, fine, lsim(system, held, fine, interp=False)[1])


@MODELS
def test_steps_are_answered_as_by_scipys_simulation(model):
    instants = np.arange(0.0, 900.0, 3.0)
    expected = _by_scipy(model, DOUBLET, instants)
    assert np.ptp(expected) > 15.0
    assert rise(rows_of([model]), DOUBLET, instants)[0] == pytest.approx(expected, abs=1e-6)


@MODELS
def test_sensitivities_are_the_differences_of_the_answer(model):
    # central differences of the rise, which the test above holds against SciPy; columns: gain, dead time, lags
    instants, row = np.arange(0.5, 900.0, 3.0), rows_of([model])
    found = sensitivities(row, DOUBLET, instants)[0]
    for column in range(row.shape[1]):
        step = 1e-4 * row[0, column]
        up, down = row.copy(), row.copy()
        up[0, column] += step
        down[0, column] -= step
        expected = (rise(up, DOUBLET, instants) - rise(down, DOUBLET, instants))[0] / (2.0 * step)
        if column == 0:
            expected = expected + DOUBLET.base_pct  # the rest at the base power rises with the gain too
        assert found[:, column] == pytest.approx(expected, abs=2e-6 * np.abs(expected).max() + 1e-9)
    assert np.array_equal(found[:, row.shape[1]], np.ones(len(instants)))  # ambient
    for i, lag in enumerate(model.lags_s):
        assert found[:, row.shape[1] + 1 + i] == pytest.approx(np.exp(-instants / lag))


def test_nearly_equal_lags_are_the_limit_of_different_ones():
    # two equal lags: 1 − (1 + t/T)·exp(−t/T), any table of Laplace transforms
    equal = TwoLag(gain_degC_per_pct=1.0, time_constant_s=50.0, second_time_constant_s=50.0, dead_time_s=0.0)
    instants = np.linspace(0.0, 400.0, 50)
    step = Schedule(base_pct=0.0, time_s=np.array([0.0]), power_pct=np.array([1.0]))
    expected = 1.0 - (1.0 + instants / 50.0) * np.exp(-instants / 50.0)
    assert rise(rows_of([equal]), step, instants)[0] == pytest.approx(expected, abs=5e-5)


@MODELS
@pytest.mark.parametrize("power", [(70.0, 0.0, 10.0), (70.0, 40.0, 10.0), (5.0, 90.0, 60.0), (30.0, 35.0, 10.0)])
def test_the_peak_is_the_highest_of_a_fine_grid(model, power):
    schedule = Schedule(base_pct=10.0, time_s=np.array([20.0, 60.0, 130.0]), power_pct=np.array(power))
    expected = _by_scipy(model, schedule, np.arange(0.0, 1500.0, 0.1)).max()
    assert expected > 0.5
    assert peak_rise(rows_of([model]), schedule)[0] == pytest.approx(expected, rel=1e-5)


def test_several_heaters_are_answered_as_each_alone():
    other = Fopdt(gain_degC_per_pct=0.9, time_constant_s=30.0, dead_time_s=0.0)
    instants, both = np.arange(0.0, 600.0, 7.0), rows_of([ONE, other])
    for found in (rise(both, DOUBLET, instants), sensitivities(both, DOUBLET, instants), peak_rise(both, DOUBLET)):
        assert not np.allclose(found[0], found[1])
    for i, model in enumerate((ONE, other)):
        alone = rows_of([model])
        assert np.array_equal(rise(both, DOUBLET, instants)[i], rise(alone, DOUBLET, instants)[0])
        assert np.array_equal(sensitivities(both, DOUBLET, instants)[i], sensitivities(alone, DOUBLET, instants)[0])
        assert peak_rise(both, DOUBLET)[i] == peak_rise(alone, DOUBLET)[0]


def test_a_schedule_holds_each_power_from_its_instant_on():
    assert DOUBLET.at(np.array([0.0, 19.9, 20.0, 199.0, 200.0, 1e6])).tolist() == [10.0, 10.0, 70.0, 70.0, 0.0, 10.0]


@pytest.mark.parametrize(("time", "power", "told"), [
    ([0.0, 5.0], [1.0], "power_pct"), ([5.0, 0.0], [1.0, 2.0], "not decreasing"), ([-1.0], [1.0], "time_s"),
    ([0.0], [101.0], "power_pct"), ([0.0], [float("nan")], "power_pct"), ([], [], "power_pct"),
])
def test_a_schedule_that_cannot_be_is_refused(time, power, told):
    with pytest.raises(OutOfRange, match=told):
        Schedule(base_pct=0.0, time_s=np.array(time), power_pct=np.array(power))

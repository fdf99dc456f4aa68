import numpy as np
import pytest
from scipy.integrate import quad
from tests.bench.identification import answer

from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings

PLANT = Fopdt(gain_degC_per_pct=0.6, time_constant_s=300.0, dead_time_s=25.03, ambient_degC=20.0)


def _log(n=2000, length=20_000.0, noise=0.0, start=20.0):
    time = np.linspace(0.0, length, n)
    share = time / length
    power = np.select([share < 0.05, share < 0.4, share < 0.7], [0.0, 60.0, 20.0], 80.0)
    temperature = answer(PLANT, time, power, start) + np.random.default_rng(1).normal(0.0, noise, n)
    return Log(name="long", source="", time_s=time, temperature_degC=temperature, power_pct=power)


def _power_at(log, instant):
    return log.power_pct[np.searchsorted(log.time_s, instant, side="right") - 1]


@pytest.mark.parametrize("second", [0.0, 40.0])
def test_the_model_is_averaged_over_the_same_time_as_the_readings(second):
    # expected: SciPy's quadrature of the closed form of a step's answer, over the run in which the edge acts
    log = _log()
    readings = Readings.of(log).average(100)
    problem = PowerProblem(readings=readings, two_lags=second > 0.0)
    basis = problem.basis(np.array([np.log(300.0), 25.03, second / 300.0]))
    edge = readings.edge_s[1] + 25.03
    run = int(np.flatnonzero(readings.time_s + readings.half_s > edge)[0])

    def step(t):
        since = max(t - edge, 0.0)
        if second == 0.0:
            return 60.0 * -np.expm1(-since / 300.0)
        return 60.0 * (1.0 - (300.0 * np.exp(-since / 300.0) - second * np.exp(-since / second)) / (300.0 - second))

    for i in (run, run + 1, run + 5):
        low, high = readings.time_s[i] - readings.half_s[i], readings.time_s[i] + readings.half_s[i]
        area = quad(step, low, high, points=[edge] if low < edge < high else None)[0]
        assert basis[0, i] == pytest.approx(area / (high - low), rel=1e-9, abs=1e-9)
        decay = quad(lambda t: np.exp(-(t - readings.time_s[0]) / 300.0), low, high)[0]
        assert basis[3, i] == pytest.approx(decay / (high - low), rel=1e-6)


def test_a_run_ends_at_an_edge_and_at_a_gap_and_no_reading_is_lost():
    log = _log()
    keep = (log.time_s < 9000.0) | (log.time_s > 9400.0)
    cut = Log(
        name="gap", source="", time_s=log.time_s[keep], temperature_degC=log.temperature_degC[keep],
        power_pct=log.power_pct[keep],
    )
    readings = Readings.of(cut).average(90)
    low, high = readings.time_s - readings.half_s, readings.time_s + readings.half_s
    assert not np.any((low < 9100.0) & (high > 9300.0))
    interval = log.time_s[1] - log.time_s[0]
    for edge in readings.edge_s[1:]:
        assert np.abs(low - (edge - 0.5 * interval)).min() < 1e-6  # half an interval: each reading stands for its own
    sizes = np.maximum(np.rint(2.0 * readings.half_s / interval), 1)
    assert sizes.sum() == keep.sum()
    assert readings.temperature_degC @ sizes == pytest.approx(cut.temperature_degC.sum(), rel=1e-12)


@pytest.mark.long
def test_a_long_log_is_fitted_without_bias_to_averages_of_a_hundred_rows():
    fitted = fit(_log(n=100_000, noise=0.2))
    assert any("Runs of up to 100 readings were averaged" in note for note in fitted.notes)
    assert fitted.model.time_constant_s == pytest.approx(300.0, abs=0.3)  # a tenth of a percent
    assert fitted.model.gain_degC_per_pct == pytest.approx(0.6, rel=1e-3)
    assert fitted.model.dead_time_s == pytest.approx(25.03, abs=0.15)  # a run is 20 s long
    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC"):
        assert fitted.ci95[name].low < getattr(PLANT, name) < fitted.ci95[name].high


def test_a_power_that_never_rests_is_averaged_with_its_integral_and_its_large_moves_kept():
    rng = np.random.default_rng(4)
    time = np.arange(20_000.0)
    power = 50.0 + rng.normal(0.0, 0.5, len(time)) + 30.0 * (time > 7321.5)
    log = Log(name="busy", source="", time_s=time, temperature_degC=20.0 + rng.random(len(time)), power_pct=power)
    readings = Readings.of(log).average(1000)
    assert len(readings.edge_s) < 5000
    held = np.diff(readings.edge_s, append=time[-1])
    assert held @ readings.level_pct == pytest.approx(power[:-1].sum(), rel=1e-9)
    assert 7322.0 in readings.edge_s


def test_no_averaged_reading_reaches_into_the_one_before_beside_rows_that_are_missing():
    time = np.delete(np.arange(900.0), [463, 540, 541, 700])
    log = Log(name="gaps", source="made here", time_s=time, temperature_degC=20.0 + 0.01 * time, power_pct=np.full(len(time), 10.0))
    readings = Readings.of(log).average(400)
    ends, starts = readings.time_s + readings.half_s, readings.time_s - readings.half_s
    assert (starts[1:] >= ends[:-1] - 1e-9).all()

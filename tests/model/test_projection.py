"""The linear unknowns where columns are one and the same; NumPy's least squares by singular values is the reference."""

import numpy as np
import pytest
from tests.bench.identification import answer

from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt
from heatertune.model.power.open_loop import PowerProblem, _solve
from heatertune.model.power.regressors import Readings


@pytest.mark.parametrize("columns", [
    [[1, 2, 3, 4], [1, 2, 3, 4]],
    [[1, 1, 1, 1], [0, 1, 2, 3], [3, 2, 1, 0]],
    [[0, 0, 0, 0], [1, 1, 1, 1], [1, 0, 0, 2], [2, 1, 1, 3]],
    [[1e8, 1e8, 1e8, 1e8], [1e-8, 2e-8, 3e-8, 4e-8], [1, 2, 3, 4]],
])
def test_columns_that_say_the_same_explain_what_they_can(columns):
    basis, record = np.array(columns, dtype=np.float64).T, np.array([1.0, 5.0, 2.0, 7.0])
    found = basis.T @ record
    _solve(basis.T @ basis, found, np.empty(basis.shape[1]), basis.shape[1])
    best = basis @ np.linalg.lstsq(basis, record, rcond=None)[0]
    assert basis @ found == pytest.approx(best, rel=1e-9)


def test_a_load_that_begins_with_the_log_is_ambient_and_start_and_no_error():
    plant = Fopdt(gain_degC_per_pct=0.5, time_constant_s=60.0, dead_time_s=4.0, ambient_degC=20.0)
    time = np.arange(0.0, 400.0, 2.0)
    power = np.where((time > 50.0) & (time < 200.0), 60.0, 0.0)
    log = Log(name="made", source="", time_s=time, power_pct=power, temperature_degC=answer(plant, time, power, 35.0))
    problem = PowerProblem(readings=Readings.of(log), loads_s=(0.0, 0.0, 100.0, 100.0))
    residuals, linear = problem.solve(np.array([[np.log(60.0), 4.0, 0.0]]), log.temperature_degC[None, :])
    assert np.max(np.abs(residuals)) < 1e-5
    assert linear[0, 0] == pytest.approx(0.5, rel=1e-6)


"""The loss curve of a log with two powers: found where it is there, and only there; what holds a setpoint beyond the log."""

from dataclasses import replace

import numpy as np
import pytest
from tests.bench.bent_heaters import Kiln, Running
from tests.bench.bent_heaters import log_of as text_of

from heatertune.chain.stages import fit
from heatertune.log.read import log_of
from heatertune.model.loss_curve import (
    for_setpoints,
    has_loss_curve,
    steady_power_pct,
    top_degC,
)
from heatertune.model.model_document import from_document, to_document
from heatertune.proof.heaters import BY_CURVE, beyond_by_curve, beyond_log, reach_degC

ROOM, ABSOLUTE = 22.0, 273.15
#: 3 kW, 9 kJ/K, 1.2 W/K and 0.018 m² of black surface: in % of full power (the kiln of issue 43, which ends at 903 °C)
KILN = Kiln("radiation", 0, capacity=300.0, convection=0.04, glow=0.018 * 5.67e-8 / 30.0, bent=0.0, exponent=1.0, room=ROOM,
            dead=20.0, sensor=25.0, noise=0.3, works_at=900.0, row_s=10.0, levels=(20.0, 35.0), holds_s=(14000.0, 14000.0))


def rows_of(kiln):
    table = np.array([[float(cell) for cell in line.split(",")] for line in text_of(kiln).splitlines()[1:]])
    return table.T


@pytest.fixture(scope="module")
def kiln_fit():
    return fit(log_of(tuple(rows_of(KILN))))


def test_the_kiln_ends_where_physics_says():
    assert KILN.rests_at(100.0) == pytest.approx(903.0, abs=1.0)
    running = Running(replace(KILN, dead=0.0, sensor=0.0))
    running.set(35.0)
    assert running.run(200_000.0) == pytest.approx(KILN.rests_at(35.0), abs=1e-6)


def test_a_log_of_two_powers_tells_the_loss_at_twice_its_temperatures(kiln_fit):
    assert has_loss_curve(kiln_fit)
    assert not kiln_fit.findings
    heaters = [each.model for each in kiln_fit.candidates]
    for degC in (300.0, 500.0, 700.0, 900.0):
        powers = [steady_power_pct(model, degC) for model in heaters]
        assert powers[0] == pytest.approx(KILN.lost(degC), rel=0.005)
        if degC > 540.0:  # beyond the log
            assert min(powers) <= KILN.lost(degC) <= max(powers)
    assert top_degC(heaters[0]) == pytest.approx(903.0, abs=5.0)
    assert sum(heaters[0].lags_s[1:]) + heaters[0].dead_time_s == pytest.approx(45.0, abs=5.0)
    assert any("convection and radiation" in note for note in kiln_fit.notes)


def test_the_working_model_is_the_tangent_at_the_setpoint(kiln_fit):
    hot = for_setpoints(kiln_fit, (300.0, 850.0))
    assert hot.model.gain_degC_per_pct == pytest.approx(1.0 / KILN.slope(850.0), rel=0.01)
    assert hot.model.time_constant_s == pytest.approx(KILN.capacity / KILN.slope(850.0), rel=0.02)
    assert hot.model.ambient_degC == pytest.approx(ROOM, abs=1.0)
    gains = sorted({round(plant.gain_degC_per_pct, 2) for plant in hot.plants})
    assert gains[0] == pytest.approx(1.0 / KILN.slope(850.0), rel=0.05)
    assert gains[-1] == pytest.approx(1.0 / KILN.slope(300.0), rel=0.05)


def test_a_document_keeps_the_loss_curve(kiln_fit):
    again = from_document(to_document(kiln_fit))
    assert again.candidates == kiln_fit.candidates
    assert all(each.model.loss is not None for each in again.candidates)
    assert all(plant.loss is None for plant in again.plants)  # what is tuned is linear


def test_a_setpoint_beyond_the_log_is_told_and_one_beyond_the_curve_blocks(kiln_fit):
    assert kiln_fit.logged_range_degC[1] < 540.0
    assert list(beyond_log(kiln_fit, [880.0])) == []
    assert list(beyond_by_curve(kiln_fit, [500.0])) == []
    remark, = beyond_by_curve(kiln_fit, [880.0])
    assert remark.startswith(f"880 °C from a log up to 536 °C, {BY_CURVE}")
    beyond, = beyond_log(kiln_fit, [reach_degC(kiln_fit) + 1.0])
    assert beyond.name == "beyond-the-log"


def test_one_power_does_not_tell_the_curve():
    one = fit(log_of(tuple(rows_of(replace(KILN, levels=(30.0, 30.0))))))
    assert not has_loss_curve(one)
    assert "one-level" in {finding.name for finding in one.findings}
    assert [finding.name for finding in beyond_log(one, [900.0])] == ["beyond-the-log"]


def test_a_linear_heater_has_no_curve():
    # the loss of the kiln at 900 °C, all of it proportional to the rise
    straight = replace(KILN, glow=0.0, convection=KILN.lost(900.0) / (900.0 - ROOM))
    fitted = fit(log_of(tuple(rows_of(straight))))
    assert all(each.model.loss is None for each in fitted.candidates)
    assert "nonlinear" not in {finding.name for finding in fitted.findings}


@pytest.mark.parametrize("bent", ["power", "ceiling"])
def test_another_nonlinearity_is_no_loss_curve(bent):
    # half of the power's upper part is lost, or the temperature ends at 470 °C, whatever the power
    time, temperature, power = rows_of(replace(KILN, glow=0.0, convection=0.065, levels=(20.0, 27.5 if bent == "power" else 35.0)))
    if bent == "power":
        power = np.where(power > 20.0, 35.0, power)
    else:
        temperature = np.minimum(temperature, 470.0 + np.random.default_rng(1).normal(0.0, 0.3, len(time)).round(1))
    fitted = fit(log_of((time, temperature, power)))
    assert not has_loss_curve(fitted)
    assert [finding.name for finding in beyond_log(fitted, [900.0])] == ["beyond-the-log"]

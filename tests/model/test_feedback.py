"""Power that answers the temperature is a controller's; the loops are simulated here, one Euler step a second."""

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.power.feedback import feedback_notes, is_feedback

TIME = np.arange(0.0, 1200.0, 5.0)


def _loop(law, setpoint, start=22.0, noise=0.05, seed=1):
    """A heater of 0.6 °C/%, 200 s at 22 °C under a law (error, sum of errors, was on) → power."""
    rng = np.random.default_rng(seed)
    y, total, power, rows = start, 0.0, 0.0, []
    for k in range(1200):
        if k % 5 == 0:
            seen = y + rng.normal(0.0, noise)
            error = setpoint[k // 5] - seen
            power, total = law(error, total, power)
            rows.append((seen, power))
        y += (22.0 + 0.6 * power - y) / 200.0
    seen, powers = np.array(rows).T
    return Log(name="loop", source="simulated", time_s=TIME, temperature_degC=seen, power_pct=powers,
               setpoint_degC=np.asarray(setpoint))


def _pi(error, total, _was):
    wanted = 5.0 * (error + total / 100.0)
    return (min(max(wanted, 0.0), 100.0), total + 5.0 * error * (0.0 < wanted < 100.0))


def _two_level(error, total, was):
    return (100.0 if error > (0.5 if was == 0.0 else -0.5) else 0.0), total


HELD = np.full(len(TIME), 50.0)


def test_a_pi_loop_from_cold_is_feedback_that_the_heat_up_moves():
    (note,) = feedback_notes(_loop(_pi, HELD))
    assert "closed loop" in note
    assert "heat-up to the setpoint moves it" in note


def test_two_level_control_is_feedback():
    assert is_feedback(_loop(_two_level, HELD))


def test_a_loop_at_rest_is_moved_by_noise_alone():
    settled = _loop(_pi, HELD, start=50.0)
    rest = settled.window(600.0, 1195.0)
    (note,) = feedback_notes(rest)
    assert "Nothing but noise" in note
    assert "setpoint" in note


def test_a_setpoint_change_moves_a_loop_at_rest():
    stepped = np.where(TIME < 900.0, 50.0, 52.0)
    (note,) = feedback_notes(_loop(_pi, stepped, start=50.0).window(600.0, 1195.0))
    assert "setpoint changes" in note


@pytest.mark.parametrize("kind", ["step", "doublets", "random"])
def test_an_open_loop_record_is_no_feedback(kind):
    power = {
        "step": np.where(TIME < 100.0, 0.0, 40.0),
        "doublets": np.where((TIME // 150.0) % 2 == 0.0, 20.0, 60.0),
        "random": np.repeat(np.random.default_rng(2).uniform(10.0, 90.0, 24), 10),
    }[kind]
    sequence = iter(power)
    open_loop = _loop(lambda _error, total, _was: (next(sequence), total), HELD)
    assert feedback_notes(open_loop) == ()
    assert not is_feedback(open_loop)

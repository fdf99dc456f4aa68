"""Loops that were closed for a part of the log only; simulated here by Euler's rule with the switch known."""

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.power.feedback import closed_loop, loop_remarks

SAMPLE, COUNT = 4.0, 600


def _log(law, *, closed, lag=150.0, noise=0.1, seed=1):
    """A heater of 0.6 °C/% at 22 °C; steps by hand outside the readings of `closed`, there P, PI or PID at 50 °C."""
    rng = np.random.default_rng(seed)
    by_hand = np.repeat(rng.choice([10.0, 30.0, 50.0, 65.0], 8), COUNT // 8)
    gain, y, power, total, last, rows = 5.0, 22.0, 0.0, 0.0, 22.0, []
    for i in range(COUNT):
        seen = y + rng.normal(0.0, noise)
        error = 50.0 - seen
        if i not in closed:
            power = total = by_hand[i]
        else:
            if i == closed[0] and law != "P":
                total = power - gain * error  # without a bump
            base = 40.0 if law == "P" else total
            asked = base + gain * error - (20.0 * gain * (seen - last) / SAMPLE if law == "PID" else 0.0)
            power = float(np.clip(asked, 0.0, 100.0))
            total += gain * error * SAMPLE / 150.0 * (0.0 < asked < 100.0)
        last = seen
        rows.append((seen, power))
        for _ in range(8):
            y += 0.5 * (22.0 + 0.6 * power - y) / lag
    temperature, powers = np.array(rows).T
    return Log(name="loop", source="Euler", time_s=SAMPLE * np.arange(COUNT), temperature_degC=temperature, power_pct=powers)


@pytest.mark.parametrize("law", ["P", "PI", "PID"])
@pytest.mark.parametrize("closed", [range(200, 600), range(300, 600), range(400, 600), range(300), range(150, 450)])
def test_a_loop_that_was_closed_for_a_while_is_found_with_its_beginning_and_end(law, closed):
    for lag in (60.0, 150.0, 400.0):
        found = closed_loop(_log(law, closed=closed, lag=lag))
        assert found is not None
        # to within a part and a half: the log is looked at in eighths
        assert found[0] == pytest.approx(SAMPLE * closed[0], abs=450.0)
        assert found[1] == pytest.approx(SAMPLE * closed[-1], abs=450.0)


def _manual(kind):
    time, rng = SAMPLE * np.arange(COUNT), np.random.default_rng(4)
    share = time / time[-1]
    return {
        "steps": np.repeat(rng.uniform(10.0, 90.0, 24), 25), "doublets": np.where((time // 340.0) % 2 == 1, 60.0, 20.0),
        "ramp": 5.0 + 90.0 * share, "pulses": np.repeat(rng.choice([0.0, 100.0], 200), 3),
        "random": rng.uniform(0.0, 100.0, COUNT), "sine": 50.0 + 30.0 * np.sin(8.0 * np.pi * share),
    }[kind]


@pytest.mark.parametrize("kind", ["steps", "doublets", "ramp", "pulses", "random", "sine"])
@pytest.mark.parametrize("lag", [60.0, 150.0])
def test_what_is_moved_by_hand_or_clock_is_no_loop_in_any_part(kind, lag):
    power, y, rows = _manual(kind), 22.0, []
    rng = np.random.default_rng(2)
    for each in power:
        rows.append(y + rng.normal(0.0, 0.1))
        for _ in range(8):
            y += 0.5 * (22.0 + 0.6 * each - y) / lag
    log = Log(name="open", source="Euler", time_s=SAMPLE * np.arange(COUNT), temperature_degC=np.array(rows),
              power_pct=power)
    assert closed_loop(log) is None
    assert loop_remarks(log) == ()


@pytest.mark.long
def test_the_fit_of_such_a_log_tells_from_when_to_when_and_has_the_finding():
    fitted = fit(_log("PI", closed=range(300, 600)))
    (found,) = [each for each in fitted.findings if each.name == "closed-loop"]
    assert "from 1200 to 2396 s the power answers the temperature" in found.message
    assert found.message in fitted.notes


def test_a_part_in_which_a_coarse_sensor_rests_is_no_loop_and_no_error():
    log = _log("PI", closed=range(600, 600), noise=0.0)
    resting = np.where(log.time_s < 1200.0, 22.0, log.temperature_degC)
    assert closed_loop(Log(name="rest", source="", time_s=log.time_s, temperature_degC=resting, power_pct=log.power_pct)) is None

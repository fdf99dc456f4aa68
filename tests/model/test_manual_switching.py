"""Logs without power of heaters that were switched manually; made by SciPy's lsim, which shares nothing with the fit."""

import numpy as np
import pytest
from scipy.signal import lsim

from heatertune.chain.stages import fit
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.model.model_values import FitOutcome
from heatertune.model.temperature.evidence import is_faster_than_rows

ROOM, GAIN, LAG, DEAD = 22.0, 1.2, 500.0, 20.0
NOISE = 0.1  # ten steps of the reading


def _log(plan, *, second=0.0, until=9000.0, begin=0.0, every=20.0):
    time = np.arange(0.0, until, 1.0)
    power = np.array([next(level for at, level in reversed(plan) if at <= t - DEAD) if t >= DEAD else 0.0 for t in time])
    rise = lsim(([GAIN], np.polymul([LAG, 1.0], [second, 1.0]) if second else [LAG, 1.0]), power, time)[1]
    kept = (time >= begin) & (time % every == 0.0)
    noise = np.random.default_rng(5).normal(0.0, NOISE, int(kept.sum()))
    return Log(name="manual", source="", time_s=time[kept], temperature_degC=np.round(ROOM + rise[kept] + noise, 2))


UP_DOWN = ((0.0, 0.0), (300.0, 60.0), (4500.0, 0.0))
LOGS = {
    "on and off": (_log(UP_DOWN), 60.0), "on and off, two lags": (_log(UP_DOWN, second=90.0), 60.0),
    "on from the first reading": (_log(((0.0, 60.0),), until=4000.0), 60.0),
    "switched off while it is hot": (_log(((0.0, 80.0), (3600.0, 0.0)), begin=3400.0), 80.0),
}


@pytest.mark.parametrize("name", [
    "on and off", pytest.param("on and off, two lags", marks=pytest.mark.long), pytest.param("on from the first reading", marks=pytest.mark.long),
    pytest.param("switched off while it is hot", marks=pytest.mark.long)])
def test_time_constant_and_gain_times_power_are_found_and_nothing_else(name):
    log, power = LOGS[name]
    fitted = fit(log)
    lags = LAG + 0.5 * 90.0 if "two" in name else LAG  # by the half rule, see Skogestad (2003)
    assert {"no-power", "not-regulated"} <= {each.name for each in fitted.findings}
    # what only heats may be a P controller's loop, whose time constant is shorter than the heater's
    is_heat_up = name == "on from the first reading"
    assert fitted.outcome is (FitOutcome.LAW_UNKNOWN if is_heat_up else FitOutcome.COMBINATIONS_ONLY)
    assert (fitted.ci95["time_constant_s"] is None) == is_heat_up
    assert fitted.model.time_constant_s == pytest.approx(lags, rel=0.02)
    assert fitted.model.ambient_degC + 100.0 * fitted.model.gain_degC_per_pct == pytest.approx(ROOM + GAIN * power, abs=0.5)
    if not is_heat_up:  # one exponential: it ends where the power leads, and shows no room
        assert 100.0 * fitted.model.gain_degC_per_pct == pytest.approx(GAIN * power, rel=0.02)
    assert fitted.ci95["gain_degC_per_pct"] is None
    dead = [each.model.dead_time_s for each in fitted.candidates]
    assert min(dead) == 0.0
    assert max(dead) >= DEAD  # also where the log begins after the switching on


@pytest.mark.long
def test_a_stated_power_gives_the_gain():
    log, power = LOGS["on and off"]
    fitted = fit(log, largest_power_pct=power)
    inside = fitted.ci95["gain_degC_per_pct"]
    assert inside is not None
    assert inside.low - 0.005 <= GAIN <= inside.high + 0.005
    assert "not-regulated" in {each.name for each in fitted.findings}


@pytest.mark.parametrize("seed", range(8))
def test_noise_of_a_fine_sensor_is_no_swing_of_a_few_rows(seed):
    chance, time = np.random.default_rng(seed), np.arange(0.0, 4000.0, 10.0)
    slow = 60.0 - 30.0 * np.exp(-time / 700.0)
    def log(readings):
        return Log(name="late", source="", time_s=time, temperature_degC=np.round(readings, 2))
    assert not is_faster_than_rows(log(slow + chance.normal(0.0, 0.1, len(time))))
    for period in (2.1, 2.5, 3.3, 4.7):  # rows
        assert is_faster_than_rows(log(slow + np.sin(2.0 * np.pi * np.arange(len(time)) / period) + chance.normal(0.0, 0.05, len(time))))


def _p_loop(gain, rows, *, every=5.0, seed=2):
    """P control (60 % at most, no integral) of the heater to 60 °C, in Euler steps of one second."""
    late, y, rng, readings = [0.0] * round(DEAD), ROOM, np.random.default_rng(seed), []
    for _ in range(rows):
        readings.append(round(y + rng.normal(0.0, 0.03), 2))
        power = min(60.0, max(0.0, gain * (60.0 - readings[-1])))
        for _ in range(round(every)):
            late.append(power)
            y += (ROOM + GAIN * late.pop(0) - y) / LAG
    return Log(name="loop", source="", time_s=every * np.arange(rows), temperature_degC=np.array(readings))


@pytest.mark.long
@pytest.mark.parametrize(("gain", "rows"), [(1.5, 60), (1.5, 200), (3.0, 120)])
def test_a_p_controller_s_heat_up_is_not_taken_for_that_of_a_quicker_heater(gain, rows):
    # its loop of first order has the time constant LAG/(1 + GAIN·gain): 179 and 109 s in place of 500 s
    fitted = fit(_p_loop(gain, rows))
    inside = fitted.ci95["time_constant_s"]
    assert inside is None or inside.low <= LAG <= (np.inf if inside.high is None else inside.high)
    assert fitted.outcome is not FitOutcome.IDENTIFIED


@pytest.mark.parametrize("rows", [20, 42])
def test_a_beginning_of_a_heat_up_is_refused_by_its_findings_alone(rows):
    # no switching in it, and of 20 rows none is left for a hold-out: neither may end in a warning or an error
    assert fit(_p_loop(50.0, rows)).outcome is FitOutcome.LAW_UNKNOWN


def test_a_file_with_each_change_of_the_power_gives_the_heater(tmp_path):
    # what the finding not-regulated names; of steps with unknown levels nothing is identified without it
    steps = ((0.0, 0.0), (300.0, 30.0), (2700.0, 60.0), (5200.0, 45.0), (7000.0, 0.0))
    log = _log(steps, until=10000.0)
    rows = [f"{t:g},{y:g}" for t, y in zip(log.time_s, log.temperature_degC, strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(["time_s,temperature_degC", *rows, ""]), encoding="utf-8")
    (tmp_path / "p.csv").write_text("\n".join(["time_s,power_pct", *(f"{at:g},{u:g}" for at, u in steps), ""]), encoding="utf-8")
    fitted = fit(read_log(tmp_path / "t.csv", power_log=str(tmp_path / "p.csv")))
    assert fitted.outcome is FitOutcome.IDENTIFIED
    for name, value in {"gain_degC_per_pct": GAIN, "time_constant_s": LAG, "dead_time_s": DEAD}.items():
        assert fitted.ci95[name].low - 0.005 * value <= value <= fitted.ci95[name].high + 0.005 * value
    assert not any(finding.name == "halves-disagree" for finding in fitted.findings)  # they differ by 0.1 % of the gain

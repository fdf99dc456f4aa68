"""Heat-ups that end by switching off, without power: one stated temperature identifies the heater.

The heaters and their numbers are made here, by Euler's steps of their own equations; nothing of the program's
simulation is used.
"""

from collections import deque

import numpy as np
import pytest

import heatertune as ht
from heatertune.log.log_values import Log
from heatertune.model.findings import KINDS

ROOM = 21.0


def _heat_up(gain, lags, dead, off_at, *, rest_s=0.0, on_before=False, row_s=2.0, after_s=300.0, noise=0.1, seed=1):
    """Return a log: full power from `rest_s` on, none from the first row at or above `off_at`; one switch-off."""
    rng, steps = np.random.default_rng(seed), 20
    step = row_s / steps
    late = deque([100.0 if on_before else 0.0] * round(dead / step))
    inner = outer = ROOM
    time, readings, off_s = [], [], None
    while off_s is None or time[-1] < off_s + after_s:
        now = row_s * len(time)
        off_s = now if off_s is None and outer >= off_at else off_s
        time.append(now)
        readings.append(round((outer + rng.normal(0.0, noise)) / 0.25) * 0.25)
        for _ in range(steps):
            late.append(100.0 if now >= rest_s and off_s is None else 0.0)
            inner += step * (ROOM + gain * late.popleft() - inner) / lags[0]
            outer = inner if len(lags) == 1 else outer + step * (inner - outer) / lags[1]
    return Log(name="kiln", source="made here", time_s=np.array(time), temperature_degC=np.array(readings))


HEATERS = {
    "log cropped at the first rise": ((7.2, (520.0, 260.0), 14.0, 323.0), {"on_before": True}),
    "begins with the log": ((5.1, (380.0, 90.0), 8.0, 279.0), {}),
    "rests first": ((6.3, (700.0, 480.0), 6.0, 258.0), {"rest_s": 60.0, "after_s": 900.0}),
    "one lag, a long rest": ((5.8, (245.0,), 9.0, 352.0), {"rest_s": 106.0, "row_s": 1.0, "after_s": 60.0}),
    "noise that turns at every row": ((1.4, (744.0,), 22.0, 89.0), {"on_before": True, "noise": 0.2}),
}


@pytest.mark.parametrize("made", HEATERS)
def test_the_temperature_of_the_switch_off_identifies_the_heater(made):
    (gain, lags, dead, off_at), how = HEATERS[made]
    log = _heat_up(gain, lags, dead, off_at, **how)
    fitted = ht.fit(log, thermostat=(float(log.temperature_degC.min()), off_at))
    assert fitted.outcome.name == "IDENTIFIED"
    inside = fitted.ci95
    assert inside["gain_degC_per_pct"].low <= gain <= inside["gain_degC_per_pct"].high
    assert inside["gain_degC_per_pct"].high < 1.1 * inside["gain_degC_per_pct"].low
    # the half rule (S. Skogestad, J. Process Control 13, 2003, eq. 10): half of the second lag delays
    late = dead + (0.5 * lags[1] if len(lags) > 1 else 0.0)
    row_s = how.get("row_s", 2.0)  # the heater is switched off at a row, up to one after the crossing
    assert inside["dead_time_s"].low - row_s <= late <= inside["dead_time_s"].high + row_s
    assert {finding.name for finding in fitted.findings} == {"no-power", "thermostat"}


def test_without_it_the_remedy_names_it():
    (gain, lags, dead, off_at), how = HEATERS["log cropped at the first rise"]
    fitted = ht.fit(_heat_up(gain, lags, dead, off_at, **how))
    assert "not-regulated" in {finding.name for finding in fitted.findings}
    assert "--thermostat ROOM OFF" in KINDS["not-regulated"].remedy


def test_a_log_that_ends_before_the_temperature_falls_is_fitted_from_its_crossing():
    """No turn shows the switch-off; the crossing of the stated temperature does."""
    log = _heat_up(2.43, (303.0, 135.0), 16.5, 152.0, rest_s=32.0, row_s=1.0, after_s=62.0, noise=0.2)
    fitted = ht.fit(log, thermostat=(float(log.temperature_degC.min()), 152.0))
    inside = fitted.ci95["gain_degC_per_pct"]
    assert inside.low <= 2.43 <= inside.high

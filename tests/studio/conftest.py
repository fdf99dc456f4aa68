"""What the studio's tests share."""

import numpy as np
import pytest

from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.studio import background_work as work_module
from heatertune.studio.background_work import Work
from heatertune.studio.session import Session
from heatertune.studio.sheet_card import DroppedFile


@pytest.fixture(scope="session")
def heater():
    return model_by_hand(Fopdt(gain_degC_per_pct=0.6, time_constant_s=200.0, dead_time_s=20.0, ambient_degC=20.0))


@pytest.fixture(scope="session")
def step_log():
    """A CSV of 30 % power switched on at 60 s, from the heater's equation solved by hand; read in steps of 0.1 °C."""
    time = np.arange(0.0, 1500.0, 5.0)
    power = np.where(time < 60.0, 0.0, 30.0)
    rise = 30.0 * 0.6 * (1.0 - np.exp(-np.maximum(time - 80.0, 0.0) / 200.0))
    rows = [f"{t:g},{20.0 + r:.1f},{p:g}" for t, r, p in zip(time, rise, power, strict=True)]
    return ("\n".join(["time_s,temperature_degC,power_pct", *rows]) + "\n").encode()


@pytest.fixture
def work(heater, step_log, monkeypatch):
    monkeypatch.setattr(work_module, "_REST_S", 0.0)
    monkeypatch.setattr(work_module, "_TICK_S", 0.01)
    session = Session()
    session.fit_done(session.begin(DroppedFile.of("step.csv", step_log).log), heater)
    return Work(session)


MALFORMED = b"time_s,temperature_degC\n0,20\n" + b"".join(b"%d,warm\n" % t for t in range(5, 40, 5)) + b"".join(b"%d,21\n" % t for t in range(40, 200, 5))


@pytest.fixture
def malformed():
    return MALFORMED

"""A heater that stops answering is found, near the instant; one that goes on is not accused."""

import numpy as np
import pytest
from tests.bench import causes

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.power.explanation import opened_at_s
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings


def _opened(seed, *, loop):
    """Return a log, in a loop or of steps, whose heater gets no power from an instant on, the instant and the length."""
    rng = np.random.default_rng(seed)
    heater, rows = causes._drawn_series(rng), 900
    interval = heater.slowest / 60.0
    at = rng.uniform(0.3, 0.85) * rows * interval
    law = (causes._loop(heater, rng, rows, interval, rng.uniform(25.0, 60.0, 2)) if loop
           else causes._steps(rng, rows, 40, 25.0, 60.0))
    h, x = interval / 20, np.zeros(len(heater.b))
    late, y, u = [0.0] * round(heater.dead / h), np.empty(rows), np.empty(rows)
    for i in range(rows):
        y[i] = 22.0 + x[-1] + rng.normal(0.0, 0.06)
        u[i] = law(i, y[i])
        for _ in range(20):
            late.append(u[i] if i * interval < at else 0.0)
            x = x + h * (heater.a @ x + heater.b * late.pop(0))
    log = Log(name="opened", source="", time_s=np.arange(rows) * interval, temperature_degC=y, power_pct=u)
    return log, at, rows * interval


def _found(log):
    return opened_at_s(PowerProblem(readings=Readings.of(log)))


@pytest.mark.long
@pytest.mark.parametrize("loop", [True, False])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_instant_is_found_within_a_twentieth_of_the_log(seed, loop):
    log, at, length = _opened(seed, loop=loop)
    assert _found(log) == pytest.approx(at, abs=0.05 * length)


@pytest.mark.long
def test_the_fit_refuses_such_a_log_and_accepts_it_up_to_there():
    log, at, length = _opened(1, loop=True)
    with pytest.raises(InputError, match=r"stops answering at t=.*--until") as told:
        fit(log)
    until = float(str(told.value).rpartition(" ")[2])
    assert until == pytest.approx(at, abs=0.05 * length)
    assert fit(log, until_s=until).fit_pct > 90.0


@pytest.mark.long
@pytest.mark.parametrize("kind", ["plain", "small-load", "door", "cooling", "two-scales", "two-scales-loop"])
def test_no_heater_that_goes_on_is_accused(kind):
    for seed in range(3):
        case = causes.make(kind, seed)
        assert _found(Log(name=kind, source="", time_s=case.time, temperature_degC=case.temperature, power_pct=case.power)) is None

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from heatertune.model.temperature.closed_loop import simulate_many
from heatertune.plc.s7_200_paper.step import LAWS


def _loop(law, plant, constants, setpoints, h, readings, event_s=np.inf, at=0, columns=None):
    """Return the temperature before scans, of a plant (gain, lag, ratio, dead time, ambient, start, inner start)."""
    gain, lag, *others = plant
    low, high = setpoints
    searched = [np.log(v) if c.logarithmic else v for v, c in zip(constants, law.constants, strict=True)]
    out = np.full((1, columns or len(readings)), np.nan)
    z = np.array([[np.log(gain), np.log(lag), *others, low, high - low, event_s, *searched]])
    simulate_many(law, z, 4, h, readings, out, at)
    return out[0]


def _bang(form, constants, memory, error, h):
    return 100.0 if error > 0.0 else 0.0


def _integrated(plant, power, h, n):
    """The same plant by SciPy's ODE solver, one hold interval after the other; dead time by splitting them."""
    gain, first, ratio, dead, ambient, y, x = plant
    second = ratio * first
    out = []
    edges = sorted({k * h for k in range(n + 1)} | {k * h + dead for k in range(n + 1)})
    for left, right in itertools.pairwise(edges):
        if left in {k * h for k in range(n)}:
            out.append(y)
        k = int(np.floor((left - dead) / h + 1e-9))
        target = ambient + gain * (power[k] if 0 <= k < n else 0.0)

        def slope(_, state, target=target):
            inner = (target - state[1]) / first
            outer = (state[1] - state[0]) / second if ratio else (target - state[0]) / first
            return [outer, inner]

        y, x = solve_ivp(slope, (left, right), [y, x], rtol=1e-10, atol=1e-10).y[:, -1]
        if right >= n * h:
            break
    return np.array(out[:n])


@pytest.mark.parametrize("ratio", [0.0, 0.4, 1.0], ids=["one lag", "two lags", "equal lags"])
@pytest.mark.parametrize("dead", [0.0, 6.5], ids=["no dead time", "fractional dead time"])
@pytest.mark.long
def test_the_loop_agrees_with_an_ode_solver(ratio, dead):
    plant = (0.5, 90.0, ratio, dead, 20.0, 25.0, 30.0)
    h, n = 2.0, 60
    ours = _loop(SimpleNamespace(step=_bang, form=0, constants=()), plant, (), (40.0, 40.0), h, np.arange(n))
    power = np.where(40.0 - ours > 0.0, 100.0, 0.0)
    assert power.min() == 0.0, "the loop has to switch, or half of it is not tested"
    assert ours == pytest.approx(_integrated(plant, power, h, n), abs=1e-6)


def test_the_setpoint_steps_at_its_event():
    law = next(law for law in LAWS if law.name == "positional P")
    plant = (0.5, 50.0, 0.0, 0.0, 20.0, 20.0, 20.0)
    out = _loop(law, plant, (2.0,), (30.0, 40.0), 1.0, np.arange(1000), 500.0)
    # a P loop rests at ambient + kK/(1 + kK)·(setpoint − ambient) with kK = 1: half way
    assert out[499] == pytest.approx(25.0, abs=1e-3)
    assert out[999] == pytest.approx(30.0, abs=1e-3)


def test_what_is_read_in_columns_is_what_every_scan_shows():
    law = next(law for law in LAWS if law.name == "PI with anti-windup")
    given = law, (0.5, 50.0, 0.3, 7.3, 20.0, 20.0, 22.0), (4.0, 80.0, 30.0), (40.0, 40.0), 2.0
    readings = np.array([0, 3, 3, 99])  # two readings between the same scans
    out = _loop(*given, readings, at=2, columns=7)
    assert np.array_equal(out[2:6], _loop(*given, np.arange(100))[readings])
    assert np.isnan(out[[0, 1, 6]]).all()


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_every_law_keeps_the_power_between_nothing_and_full(law):
    rng = np.random.default_rng(0)
    for _ in range(50):
        constants = np.array([rng.uniform(0.3, 50), rng.uniform(15, 500), rng.uniform(0, 100), rng.uniform(1e-3, 1)])
        memory = np.zeros(4)
        for error in rng.normal(0.0, 20.0, 20):
            assert 0.0 <= law.step(law.form, constants, memory, error, 2.0) <= 100.0


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_loop_that_is_closed_later_from_rest_answers_later(law):
    # nothing moves before: the whole curve is shifted
    plant, constants, h, later = (0.5, 90.0, 0.4, 6.5, 20.0, 20.0, 20.0), (2.0, 60.0, 10.0, 0.01), 2.0, 7
    searched = [np.log(v) if c.logarithmic else v for v, c in zip(constants, law.constants, strict=False)]
    gain, lag, *others = plant
    z = np.array([[np.log(gain), np.log(lag), *others, 60.0, 0.0, np.inf, *searched]])
    out = np.empty((2, 60))
    for row, closes in enumerate((0, later)):
        simulate_many(law, z, 4, h, np.arange(60), out[row:row + 1], 0, closes)
    assert out[1, later:] == pytest.approx(out[0, :-later], abs=1e-12)
    assert out[1, :later] == pytest.approx(20.0)


def test_a_loop_that_ran_before_the_log_has_its_first_power_on_the_way():
    # a controller at 100 %: one lag rises at once, whatever the dead time
    law, time = SimpleNamespace(step=_bang, form=0, constants=()), 2.0 * np.arange(40)
    z, out = np.array([[np.log(0.5), np.log(90.0), 0.0, 30.0, 20.0, 20.0, 20.0, 900.0, 0.0, np.inf]]), np.empty((1, 40))
    simulate_many(law, z, 4, 2.0, np.arange(40), out, 0, -1)
    assert out[0] == pytest.approx(20.0 + 50.0 * (1.0 - np.exp(-time / 90.0)), abs=1e-9)

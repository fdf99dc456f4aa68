import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from heatertune.model.temperature.kernel import simulate_many
from heatertune.plc.s7_200_paper.laws import LAWS


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
    plant = np.array([[0.5, 90.0, ratio, dead, 20.0, 25.0, 30.0]])
    h, n = 2.0, 60
    ours = simulate_many(_bang, 0, plant, np.zeros((1, 4)), np.array([[40.0, 40.0]]), h, n, np.array([n]))[0]
    power = np.where(40.0 - ours > 0.0, 100.0, 0.0)
    assert power.min() == 0.0, "the loop has to switch, or half of it is not tested"
    assert ours == pytest.approx(_integrated(plant[0], power, h, n), abs=1e-6)


def test_the_setpoint_steps_at_its_event():
    law = next(law for law in LAWS if law.name == "positional P")
    plant = np.array([[0.5, 50.0, 0.0, 0.0, 20.0, 20.0, 20.0]])
    out = simulate_many(
        law.step, law.form, plant, np.array([[2.0, 0, 0, 0]]), np.array([[30.0, 40.0]]), 1.0, 1000, np.array([500])
    )
    # a P loop rests at ambient + kK/(1 + kK)·(setpoint − ambient) with kK = 1: half way
    assert out[0, 499] == pytest.approx(25.0, abs=1e-3)
    assert out[0, 999] == pytest.approx(30.0, abs=1e-3)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_every_law_keeps_the_power_between_nothing_and_full(law):
    rng = np.random.default_rng(0)
    for _ in range(50):
        constants = np.array([rng.uniform(0.3, 50), rng.uniform(15, 500), rng.uniform(0, 100), rng.uniform(1e-3, 1)])
        memory = np.zeros(4)
        for error in rng.normal(0.0, 20.0, 20):
            assert 0.0 <= law.step(law.form, constants, memory, error, 2.0) <= 100.0

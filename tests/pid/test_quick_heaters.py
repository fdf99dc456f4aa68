"""Heaters whose dead time is a small part of their lag: the sampled optimum beside a brute force of its own code."""

import numpy as np
import pytest

from heatertune.model.model_values import Fopdt
from heatertune.pid.search.feasible import Problem, largest_gain, search

LAG = 1000.0  # [s]; the gain is 1 °C/%, the dead time three samples: no fraction of a sample, no modified z-transform
WAIT = 3


def _distance(share, tn_in_samples, gain):
    """Smallest |1 + L| of PI loops, shape (m,): L = K·(1 + 1/(TN·(1 − 1/z)))·(1 − a)/(z − a)·z⁻³, a = 1 − share."""
    z = np.exp(1j * np.geomspace(1e-2 * share, np.pi, 300))
    c = gain[:, None] * (1.0 + 1.0 / (tn_in_samples[:, None] * (1.0 - 1.0 / z)))
    return np.abs(1.0 + c * share / (z - 1.0 + share) * z**-WAIT).min(axis=1)


@np.errstate(all="ignore")  # what swings grows without bound
def _iae(share, tn, gain, samples):
    """∑|e| after a load step of 1 %, in samples, shape (m,)."""
    y, summed, area = np.zeros(len(tn)), np.zeros(len(tn)), np.zeros(len(tn))
    powers = [np.zeros(len(tn))] * (WAIT + 1)
    for k in range(samples):
        area += np.abs(y)
        summed -= y / tn
        powers = [*powers[1:], gain * (summed - y)]
        y = y + share * (powers[0] + (1.0 if k >= WAIT else 0.0) - y)
    return area


@pytest.mark.parametrize("ratio", [1e-4, 2e-3, 0.05, 0.6])
@pytest.mark.parametrize("ms", [1.4, 2.0])
def test_no_gains_of_a_brute_force_are_better_however_short_the_dead_time(ratio, ms):
    ta = ratio * LAG / WAIT
    share = -np.expm1(-ta / LAG)  # of the way to rest that the heater goes in one sample
    # a lag alone, so many samples long, is all but an integrator: it swings for ever at K = 2·sin(π/14)/share
    tn, gain = (grid.ravel() for grid in np.meshgrid(np.geomspace(0.5, 100.0, 50), np.geomspace(0.03, 0.45, 120) / share))
    kept = _distance(share, tn, gain) > 1.0 / ms
    costs = _iae(share, tn[kept], gain[kept], 500) * ta
    best = np.min(costs[costs >= 0.99 * (tn / gain)[kept] * ta])  # ∑e is TN/K: with less it is not at rest yet
    plant = Fopdt(gain_degC_per_pct=1.0, time_constant_s=LAG, dead_time_s=ratio * LAG)
    problem = Problem(plants=(plant,), structure="pi", ms=ms, sample_time_s=ta)
    assert 0.95 * best < problem.cost(search(problem)) < 1.001 * best


@pytest.mark.parametrize("structure", ["pi", "pid"])
def test_which_heater_is_looked_at_first_decides_nothing(structure):
    plants = tuple(Fopdt(gain_degC_per_pct=gain, time_constant_s=LAG, dead_time_s=dead)
                   for gain, dead in ((0.8, 60.0), (1.0, 20.0), (0.9, 40.0)))
    found = []
    for turned in (plants, plants[::-1], (*plants[1:], plants[0])):
        problem = Problem(plants=turned, structure=structure, ms=1.6, sample_time_s=20.0)
        design = search(problem)
        found.append((design.gain_pct_per_degC, design.integral_time_s, design.derivative_time_s))
        # a grid of this test's own, all of whose points are looked at on all heaters
        near = [design.integral_time_s * share for share in (0.5, 0.8, 0.95, 1.05, 1.25, 2.0)]
        others = [problem.design(gain, tn, design.derivative_time_s) for tn in near
                  for gain in largest_gain(problem, tn, design.derivative_time_s)[:1]]
        assert problem.cost(design) < min(map(problem.cost, others))
    assert found[1:] == [pytest.approx(found[0], rel=1e-12)] * 2

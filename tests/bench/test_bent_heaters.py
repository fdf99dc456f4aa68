"""Drawn heaters with a loss curve: what holds the working temperature, and no dangerous PASS."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.bench import bent_heaters
from tests.bench.bent_heaters import Running


def test_the_heaters_are_what_they_say():
    # against SciPy's integration, and at rest against the equation itself
    for kind in bent_heaters.KINDS:
        kiln = bent_heaters.draw(kind, 1)
        running = Running(kiln)
        running.set(60.0)
        seconds = 2.0 * kiln.capacity / kiln.slope(kiln.works_at)
        exact = solve_ivp(
            lambda _, y, kiln=kiln: [(60.0 - kiln.lost(y[0])) / kiln.capacity,
                                     (y[0] - y[1]) / kiln.sensor if kiln.sensor else 0.0],
            (kiln.dead, seconds), [kiln.room, kiln.room], rtol=1e-10, atol=1e-9).y[1 if kiln.sensor else 0, -1]
        assert running.run(seconds) == pytest.approx(exact, abs=1e-3)
        assert kiln.lost(kiln.rests_at(60.0)) == pytest.approx(60.0)
        step = 1e-3
        slope = (kiln.lost(300.0 + step) - kiln.lost(300.0 - step)) / (2.0 * step)
        assert kiln.slope(300.0) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("kind", bent_heaters.KINDS)
def test_the_loss_curve_of_drawn_heaters_is_found(kind):
    findings = [bent_heaters.study(kind, seed) for seed in range(3)]
    for each in findings:
        assert each.found == "loss curve"
        assert each.power[0] == pytest.approx(1.0, abs=0.05)
        assert min(each.power) <= 1.0 <= max(each.power)
        assert abs(each.end) < 20.0
        assert math.isnan(each.exponent) or abs(each.exponent) < 0.05
    assert np.isfinite([each.seconds for each in findings]).all()


@pytest.mark.long
def test_no_pass_beyond_the_log_is_dangerous():
    findings = [bent_heaters.study(kind, 0, ["fb41"]) for kind in bent_heaters.KINDS]
    assert [each.dangers for each in findings] == [(), ()]
    assert any(ending.startswith("PASS") for each in findings for ending in each.ends.values())


def test_an_unstable_loop_is_dangerous_and_a_calm_one_is_not():
    kiln, words = bent_heaters.draw("radiation", 0), []

    class Law:
        def __init__(self, k):
            lag = kiln.capacity / kiln.slope(kiln.works_at)
            self.k, self.i_now, self.i_before, self.d, self.past = k, 0.1 * kiln.dead / lag, 0.0, 0.0, 0.0
            self.interval, self.slope = 0.1 * kiln.dead, (1.0, -1.0)

        def polynomials(self):
            # k·(1 + i/(1 − z⁻¹))
            return np.array([self.k * (1.0 + self.i_now), -self.k]), np.array([1.0, -1.0])

    lag, late = kiln.capacity / kiln.slope(kiln.works_at), kiln.dead + kiln.sensor
    usual = 0.5 * lag * kiln.slope(kiln.works_at) / late  # Skogestad's gain
    judged = []
    for times in (1.0, 20.0):
        law = Law(times * usual)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(bent_heaters, "law_of", lambda _, law=law: law)
            judged.append(bent_heaters.judge(kiln, words, kiln.works_at, 40.0))
    assert judged[0] == ""
    assert judged[1] == "unstable"

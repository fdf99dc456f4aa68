"""Panel instruments against the witness of their law, which another hand wrote from the manuals' definitions."""

import math

import numpy as np
import pytest
from tests.witness.pband import PBand, band_pct

from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Scaling, controller_for
from heatertune.plc.pband.makes import MAKES
from heatertune.plc.pband.step import PbandAssumptions, PbandBlock, PbandState, step

#: both round in double precision, in another order: the sum over a stretch of samples differs by some last digits
_CLOSE = 1e-9


class ZeroOutside(PBand):
    """The witness with the third reading of the switch: no integral outside the band, and never more than the range."""

    def __call__(self, sp, pv):
        e, kept = sp - pv, self.integral_degC_s
        self.kind = "band"
        before = super().__call__(sp, pv)
        if self.Ti <= 0.0:
            return before
        limit = self.high * self.band * self.Ti / 100.0
        self.integral_degC_s = 0.0 if abs(e) >= self.band else min(max(kept + e * self.TA, -limit), limit)
        return min(max(self._asked(e, self.integral_degC_s), self.low), self.high)


def _differences(scans, seed):
    """Return the largest difference in output [%] of random instruments on random walks, a new one every 400 samples."""
    rng, worst = np.random.default_rng(seed), 0.0
    for _ in range(scans // 400):
        band, ta = float(rng.uniform(0.5, 200.0)), float(rng.choice([0.05, 0.25, 0.4, 2.0]))
        ti = float(rng.choice([0.0, rng.uniform(1.0, 2000.0)]))
        td = float(rng.choice([0.0, rng.uniform(0.5, 200.0)]))
        high, unit, kind = float(rng.choice([100.0, 60.0])), float(rng.choice([0.01, 0.04])), int(rng.choice([0, 2]))
        on_error, slow = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
        law = (PBand if kind == 0 else ZeroOutside)(
            band, ti, td, ta, high=high, on_error=on_error, n=(4 if slow else 8) if td else None)
        lag = td / (4.0 if slow else 8.0)
        block = PbandBlock(gain=100.0 * unit / band, growth=ta / ti if ti else 0.0, slope=td / ta, share=ta / (lag + ta), high=high, least=0.0,
                      band=band / unit, approach=math.inf, alpha=1.0, follows=0.0, tenth=0.1 / unit)
        assume, state = PbandAssumptions(anti_windup=kind, on_error=on_error, slow=slow), PbandState()
        walk = np.clip(np.cumsum(rng.integers(-60, 61, 400)) + int(rng.integers(0, 10_000)), -32768, 32767)
        wanted = np.repeat(rng.integers(0, 10_000, 4), 100)
        for setpoint, reading in zip(wanted.tolist(), walk.tolist(), strict=True):
            state, power, _, _ = step((block, assume), state, setpoint, reading, False)
            worst = max(worst, abs(power - law(unit * setpoint, unit * reading)))
    return worst


def test_the_law_is_the_witness():
    assert _differences(40_000, 1) < _CLOSE


@pytest.mark.long
def test_the_law_is_the_witness_over_200_000_samples():  # a million showed no more
    assert _differences(200_000, 2) < _CLOSE


@pytest.mark.parametrize("name", MAKES)
def test_the_words_of_each_make_run_the_law_of_their_own_numbers(name):
    which, scaling = controller_for(name), Scaling(low_degC=0.0, high_degC=400.0)
    ta = min(max(0.25, which.timer.shortest_s), which.timer.longest_s)
    words = which.encode(PidDesign(gain_pct_per_degC=8.13, integral_time_s=133.0, derivative_time_s=21.0, sample_time_s=ta,
                                   structure=structure_of(133.0, 21.0), method=""), scaling)
    band = next(words.values[word] for word in ("Pb", "P", "PB", "XP1") if word in words.values)
    percent = name in ("eurotherm-3200", "abb-commander-300")
    band_degC = float(band) if name == "jumo-dicon" else 4.0 * band / 10.0 if percent else band / 10.0
    assert not percent or band_pct(band_degC, 400.0) == pytest.approx(band / 10.0)
    law, running, rng = PBand(band_degC, 133.0, 21.0, ta, n=8), which.start(words, {}), np.random.default_rng(4)
    for reading in np.clip(np.cumsum(rng.integers(-9, 12, 2000)) + 3500, 0, 10_000).tolist():
        running, scan = which.step(running, 4000, reading)
        assert scan.power_pct == pytest.approx(law(160.0, 0.04 * reading), abs=_CLOSE)

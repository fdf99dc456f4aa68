"""Loops of heaters that share heat: the bench's judge against single loops, and a design of one zone in three."""

import numpy as np
import pytest

import heatertune as ht
from heatertune import cache
from tests.bench import danger, neighbours, truth

GAIN, LAG, DEAD, EXCHANGED, INTERVAL = 1.2, 240.0, 12.0, 4.0, 2.0


def _law(k, ti):
    return truth.Law(k=k, i_now=INTERVAL / ti, i_before=0.0, d=0.0, past=0.0, interval=INTERVAL)


@pytest.mark.parametrize("k", [1.0, 3.0, 60.0])
def test_equal_zones_in_a_ring_are_as_good_as_the_worse_of_their_two_motions(k):
    # all together a zone loses nothing to others; one against another it has 1 + 3·exchange times the loss
    law = _law(k, 150.0)
    heaters = neighbours.exchange(neighbours.row(3, EXCHANGED, ring=True), GAIN, (LAG,) * 3, DEAD)
    radius, sigma = neighbours.joint(heaters, [law] * 3)
    motions = [truth.sampled(np.array([[-loss / LAG]]), np.array([GAIN / LAG]), DEAD, INTERVAL)
               for loss in (1.0, 1.0 + 3.0 * EXCHANGED)]
    assert (radius < 1.0) == all(truth.stable(motion, law) for motion in motions)
    assert sigma == pytest.approx(max(truth.peak(motion, law, LAG) for motion in motions), rel=2e-3)
    verdict = neighbours.Joint(["PASS"] * 3, [], radius, sigma)
    assert verdict.danger == (k == 60.0)


def test_a_heater_of_elements_on_a_mass_has_about_its_gain_alone_and_more_with_others():
    heaters = neighbours.on_a_mass(3, 0.6, 20.0, 800.0, 0.3, 6.0)
    # element 0.18 °C/% above the mass; the mass, 2.33 times as much by one element, loses what its own slow lag says
    assert heaters.steady[0, 0] == pytest.approx(0.6)
    assert heaters.steady[0].sum() == pytest.approx(0.18 + 3 * 0.42)


@pytest.mark.long(seconds=25)
def test_a_design_from_the_log_of_one_zone_holds_where_all_zones_move(tmp_path):
    heaters = neighbours.exchange(neighbours.row(3, EXCHANGED), GAIN, (LAG,) * 3, DEAD)
    (tmp_path / "log.csv").write_text(neighbours.log_text(heaters, 1, np.random.default_rng(1)), encoding="utf-8")
    sigmas, overshoots = [], []
    for alone in (True, False):
        with cache.cache_disabled():
            fitted = ht.fit(tmp_path / "log.csv", alone=alone)
            words = ht.encode(ht.tune(fitted, structure="pi", target="fb41", sample_time_s=INTERVAL), target="fb41")
        laws = [danger.law_of(words)] * 3
        radius, sigma = neighbours.joint(heaters, laws)
        assert radius < 1.0
        sigmas.append(sigma)
        overshoots.append(neighbours.overshoot_pct(heaters, laws, 80.0))
    assert sigmas[1] < 1.5
    assert sigmas[1] < sigmas[0]
    assert overshoots[1] < overshoots[0]

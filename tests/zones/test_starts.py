"""Zones started one after the other: which orders are run, and that a zone at rest may not overshoot meanwhile; a judge in C."""

import shutil
from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np
import pytest

from heatertune.plc import controller_for
from heatertune.settings import Conditions
from heatertune.zones import design_zones, network_by_hand, prove_zones
from heatertune.zones.joint_design import _start_together as start_with_ramp
from heatertune.zones.joint_loop import name_order, start_orders, summarize_orders
from heatertune.zones.joint_proof import specification_for
from heatertune.zones.joint_tuning import JointTuner
from tests.bench.zone_judge import simulated
from tests.bench.zone_starts import started
from tests.zones.networks import chain


@pytest.mark.parametrize("count", [1, 2, 3])
def test_up_to_three_zones_are_started_in_every_order(count):
    orders = start_orders(count)
    assert {tuple((zone,) for zone in order) for order in permutations(range(count))} <= {*orders}
    assert len({*orders}) == len(orders)


@pytest.mark.parametrize("count", [4, 5, 8])
def test_of_many_zones_each_is_started_first_and_last_and_before_all_others_at_once(count):
    orders, every = start_orders(count), {*range(count)}
    assert all(sorted(zone for group in order for zone in group) == [*range(count)] for order in orders)
    assert {order[0] for order in orders} >= {(zone,) for zone in every}
    assert {order[-1] for order in orders} >= {(zone,) for zone in every}
    assert {order for order in orders if len(order) == 2} >= {((zone,), tuple(every - {zone})) for zone in every}
    assert len(orders) == 2 * count + 4


def test_a_verdict_says_that_any_order_is_proven_only_where_all_were_run():
    runs = [name_order(order, "abc") for order in start_orders(3)]
    assert runs[0] == "zones started in turn: a, then b and c"
    assert runs[-1] == "zones started in turn: c, then b, then a"
    assert "one after the other in every order" in summarize_orders("abc", runs)[0]
    assert summarize_orders("abc", runs[:-1]) == []


@pytest.mark.long(seconds=10)
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")
def test_a_zone_at_rest_that_its_neighbours_push_beyond_its_setpoint_breaks_the_limit_of_the_overshoot():
    network = chain(3, 2.0)
    proof = design_zones(network_by_hand(network), "s7-300", 50.0)
    assert proof.verdict == "PASS", proof.summary()
    assert "starts: all zones together; one after the other in every order" in proof.brief()
    worst = next(each for each in proof.criteria if each.name == "overshoot [%]")
    assert worst.where == "zone b, start, zones started in turn: b, then a and c, in quick succession"  # all at once: 8 %
    interval = proof.words[0].sample_time_s
    found = [started(network, proof, (1, 0, 2), np.array([round(gap_s / interval), 0]), round(6000.0 / interval), noise_degC=0.0)
             for gap_s in (100.0, 150.0, 200.0, 250.0, 300.0, 400.0, 6000.0)]
    assert not any(each.complaint for each in found)
    assert max(each.pushed for each in found) * 20.0 == pytest.approx(worst.value, rel=0.05)  # of the general limit of 20 %
    assert found[-1].pushed < 0.9 * max(each.pushed for each in found)  # those that start when b rests push it less
    limits = replace(proof.specification.limits, overshoot_pct=9.0)
    strict = prove_zones(proof.design, proof.fitted, replace(proof.specification, limits=limits))
    assert strict.verdict == "FAIL"
    assert "zone 2 overshoots by 1" in started(network, strict, (1, 0, 2), np.array([round(200.0 / interval), 0]), 2000).complaint


@pytest.mark.parametrize("target", ["s5-ob251", pytest.param("s7-300", marks=pytest.mark.sample)])
@pytest.mark.long(seconds=10)
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")
def test_a_judge_counts_no_more_heaters_on_at_once_than_were_proven(target):
    """Zones that were started at any instants, each with its PWM's offset; four of 45 % need two heaters at once."""
    network = chain(4, 0.5, gain=1.0)
    spec = specification_for(network_by_hand(network), 22.0 + 45.0, Conditions())
    proof = design_zones(network_by_hand(network), target, specification=replace(spec, staggered=True))
    assert proof.verdict == "PASS", proof.summary()
    assert proof.heaters_bound == 2 <= proof.peak_heaters  # that on weaker mains, too, where four of 56 % need three
    scans = round(9000.0 / proof.words[0].sample_time_s)
    asked = np.full((scans, 4), 67.0)
    for most, judged in ((2, proof), (4, replace(proof, offsets_s=(0.0,) * 4))):
        *_, pulses = simulated(network, judged, asked, np.zeros(asked.shape), begins=[0, 37, 211, 500])
        assert at_once(pulses, 7000.0) == most


def at_once(pulses, from_s):
    """Return how many pulses are on at once at most; one that ends at an instant is off then."""
    _, begins, ends = pulses[pulses[:, 2] > from_s].T
    return max(int(np.sum((begins <= begin + 1e-6) & (ends > begin + 1e-6))) for begin in begins)


def overshoot_pct(words, network, power):
    """Return the overshoot of zones that heat up together, by Euler's steps, the power without PWM [% of the rise]."""
    controllers = [controller_for(each.target).instantiate(each, {}) for each in words]
    step_s, late = words[0].sample_time_s / 32.0, round(network.dead_times_s[0] / (words[0].sample_time_s / 32.0))
    degC, highest = np.full(2, 22.0), 0.0
    matrix = (network.exchange - np.diag(1.0 + network.exchange.sum(axis=1))) / network.time_constants_s[0]
    queue, demand = [np.zeros(2)] * late, np.zeros(2)
    for k in range(32 * 1000):
        if k % 32 == 0:
            demand = np.array([each(float(one), 60.0) for each, one in zip(controllers, degC, strict=True)])
        queue.append(demand)
        heat = 22.0 + power * np.array(network.gains_degC_per_pct) * queue.pop(0)
        degC = degC + step_s * (matrix @ degC + heat / network.time_constants_s[0])
        highest = max(highest, float(degC.max()))
    return 100.0 * (highest - 60.0) / 38.0


def test_zones_that_overshoot_as_they_start_get_a_ramp_that_a_second_simulation_finds_better():
    """Without a C compiler; the shielded sensor of tests/bench/odd_networks.py is the case by which it was found."""
    network, conditions = chain(2, 1.0), Conditions(limit=("overshoot=5%",))
    fitted = network_by_hand(network)
    spec = specification_for(fitted, 60.0, conditions)
    prove = partial(prove_zones, fitted=fitted, specification=spec, conditions=conditions)
    plain = prove(JointTuner(fitted, "s7-300", sample_time_s=4.0).design_for((1.5, 1.5)), up_to_failure=True)
    assert {each.name for each in plain.criteria if not each.ok} == {"overshoot [%]"}
    led = start_with_ramp(plain, prove)
    assert led.verdict == "PASS", led.summary()
    line, = (line for line in led.brief().splitlines() if line.startswith("setpoint ramp of all zones"))
    assert line.endswith("contained in the program of each")  # starts in every order are proven with it
    for power in (0.81, 1.0):
        free, ramped = (overshoot_pct(each.words, network, power) for each in (plain, led))
        assert ramped < free - 2.0
        assert ramped < 5.0

"""Zones started in any order, at any intervals: does a PASS hold? python -m tests.bench.zone_starts [COUNT] [SEED] [NETWORKS…].

Networks are drawn, logged, fitted and designed as in `networks`; with "known", the network is known and its design costs no fit; with "decoupled", zones are decoupled where that helps.
What passes is started on the true network in drawn orders: at once, in quick succession, or each zone when those before it
rest. All is judged by `zone_judge`: from its start on, no zone may exceed its setpoint by more than the limit of the
overshoot, whoever is started meanwhile, and at the end all rest. The last columns are the largest overshoot as a share of
that limit while a zone heats up, and while zones are started after it.
"""

import sys
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from heatertune.plc import Scaling, controller_for
from heatertune.settings import Conditions
from heatertune.zones import design_zones, fit_network, network_by_hand
from heatertune.zones.joint_proof import specification_for
from tests.bench.networks import DECOUPLED, TARGETS, drawn_log
from tests.bench.second_opinion import SWITCHES
from tests.bench.second_opinion import TARGETS as SENSORS
from tests.bench.zone_judge import SLACK, settling, simulated
from tests.zones.networks import at_rest, radius

ORDERS = 24
NOISE_DEGC = 0.03


class Start(NamedTuple):
    """What became of one order: a complaint, and the overshoot while heating up and later, as a share of its limit."""

    complaint: str
    own: float
    pushed: float


def started(network, proof, order, gaps, rest, *, settings=None, seed=0, noise_degC=NOISE_DEGC):
    """Start zones one after the other and judge what follows.

    Args:
        network: the true one.
        proof: whose words run.
        order: numbers of the zones.
        gaps: scans from one start to the next, one fewer than zones.
        rest: scans after the last start.
        settings: of the open points.
        seed: of the noise.
        noise_degC: of the readings.
    """
    setpoints, (ambient, _) = np.array(proof.specification.setpoints_degC), at_rest(network)
    at = np.concatenate([[0], np.cumsum(gaps)]).astype(int)
    begins = np.zeros(len(order), dtype=int)
    begins[list(order)] = at
    asked = np.tile(setpoints, (int(at[-1]) + rest, 1))
    temperatures, highest, *_ = simulated(network, proof, asked, np.zeros(asked.shape), noise_degC=noise_degC, seed=seed,
                                          settings=settings, begins=begins)
    low, high = proof.words[0].scaling.sensor_degC
    count = (high - low) / SENSORS[proof.words[0].target][1]
    limits, complaint, own, pushed = proof.specification.limits, "", 0.0, 0.0
    for zone, begin in enumerate(begins):
        later = min((each for each in begins if each > begin), default=len(asked))
        beyond = 100.0 * (highest[:, zone] - setpoints[zone] - count) / (setpoints[zone] - ambient[zone])
        own = max(own, beyond[begin:later].max() / limits.overshoot_pct)
        pushed = max(pushed, beyond[later:].max(initial=0.0) / limits.overshoot_pct)
        if (most := beyond[begin:].max()) > SLACK * limits.overshoot_pct:
            complaint = complaint or f"zone {zone + 1} overshoots by {most:.1f} %"
        last = np.abs(temperatures[-rest // 5:, zone] - setpoints[zone]).max()
        if last > SLACK * limits.tolerance_degC + count:
            complaint = complaint or f"zone {zone + 1} {last:.2f} °C off at the end"
    return Start(complaint, own, pushed)


def judged(network, proof, random, orders=ORDERS):
    """Yield each drawn order, its gaps and what becomes of it."""
    words, zones = proof.words[0], len(proof.words)
    added = 0.0 if proof.design.decoupling is None else np.array(proof.design.decoupling.pct_per_degC)
    size = radius(network, proof.design.designs, words.sample_time_s, controller_for(words.target).delayed_s(words.scaling), added)
    rest = int(settling(network, proof, size) / words.sample_time_s) * 2
    choices = SWITCHES[words.target]
    for _ in range(orders):
        order = [int(each) for each in random.permutation(zones)]
        longest = float(random.choice([0.05, 0.3, 1.0]))
        gaps = np.round(rest * longest * random.uniform(0.0, 1.0, zones - 1) ** 2) if longest < 1.0 else np.full(zones - 1, rest)
        settings = {name: str(random.choice(each)) for name, each in choices.items()}
        yield order, gaps, started(network, proof, order, gaps, rest, settings=settings, seed=int(random.integers(1 << 30)))


def designed(seed, *, known=False, decouple=False):
    """Return a drawn network, its design, and what draws further."""
    network, log, random = drawn_log(seed, 5)
    fitted = network_by_hand(network) if known else fit_network(log)
    cold, rise = at_rest(network)
    setpoints = cold + rise @ random.uniform(22.0, 40.0, len(network.zones))
    spec = replace(specification_for(fitted, list(setpoints.round(1)), Conditions()), decouple=decouple)
    return network, design_zones(fitted, (DECOUPLED if decouple else TARGETS)[seed % 2], specification=spec, scaling=Scaling(high_degC=200.0)), random


def main(count=40, first=0, *kinds):
    """Print a line for each network and the totals; return whether a PASS was broken."""
    verdicts, false = Counter(), 0
    for seed in range(int(first), int(first) + int(count)):
        network, proof, random = designed(seed, known="known" in kinds, decouple="decoupled" in kinds)
        verdicts[proof.verdict] += 1
        if proof.verdict != "PASS":
            print(f"{seed}: {proof.verdict} {proof.summary().splitlines()[1]}", flush=True)
            continue
        found = list(judged(network, proof, random))
        broken = [(order, list(gaps), each.complaint) for order, gaps, each in found if each.complaint]
        false += bool(broken)
        proven = max(each.share for each in proof.criteria if each.name == "overshoot [%]")
        print(f"{seed}: {len(proof.words)} zones, proven {proven:.2f}, own {max(each.own for *_, each in found):.2f}, "
              f"pushed {max(each.pushed for *_, each in found):.2f} {broken[0] if broken else ''}", flush=True)
    print(f"{dict(verdicts)}; {false} false PASS")
    return false > 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

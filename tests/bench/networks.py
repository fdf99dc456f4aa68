"""Drawn thermal networks, designed as zones and judged by a simulation that shares nothing with heatertune.

    python -m tests.bench.networks [COUNT] [SEED] [sag | weak-sag | ignored-sag | together | decoupled]

Each network is logged with noise, fitted, tuned and proven. What passes runs on the true network with its words, PWM,
loads and noisy readings, see `zone_judge`, under the first and under drawn settings of the open points. A PASS that the
judge breaks is false. With sag, two or three heaters take power from each other on one supply: 10 to 35 %, or up to 15 %
(weak-sag). With ignored-sag, the true network is designed as if its supply did not sag: the judge has to break some PASS.
With together, the spread of the zones while they heat up is limited to 3 to 15 °C, and the judge measures it. With
decoupled, the programs of FB 41 and of structured text add power for the neighbours' temperatures; the last column is
the share of the static gains, and the largest neighbour deviation on the true network with and without it.
"""

import sys
import time
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from heatertune.plc import Scaling, controller_for
from heatertune.settings import Conditions
from heatertune.zones import design_zones, fit_network, network_by_hand
from heatertune.zones.identify import ZoneLog
from heatertune.zones.joint_proof import specification_for
from tests.bench.second_opinion import SWITCHES
from tests.bench.zone_judge import judge, live, settling
from tests.zones.networks import balance, drawn, logged, radius, steps

TARGETS = ("s7-300", "s5-ob251")
DECOUPLED = ("fb41", "iec-pid")


class Case(NamedTuple):
    """A drawn network, its verdict, what the judge says of it, and couplings inside their intervals."""

    verdict: str
    complaint: str
    inside: int
    couplings: int
    seconds: float
    summary: str
    ramp: str = ""


#: shares of the power of all others that a heater takes, smallest and largest, by kind of bench
SHARES = {"sag": (0.1, 0.35), "weak-sag": (0.0, 0.15), "ignored-sag": (0.1, 0.35)}


def on_one_supply(network, random, least=0.1, most=0.35):
    """Return a network with equal dead times whose heaters take such a share of the power of all others."""
    count = len(network.zones)
    return replace(network, dead_times_s=network.dead_times_s[:1] * count,
                   supply_shares=tuple(random.uniform(least, most, count) / (count - 1)))


def drawn_log(seed, most_zones=8, kind=""):
    """Return a drawn network, its log, and what draws further; `kind`: see the head of this file."""
    random = np.random.default_rng(seed)
    network = drawn(random, int(random.integers(2, (3 if kind in SHARES else most_zones) + 1)))
    network = on_one_supply(network, random, *SHARES[kind]) if kind in SHARES else network
    shares = np.array(network.supply_shares or (0.0,) * len(network.zones))
    count = len(network.zones)
    length = int(12 * max(network.time_constants_s)) + 1500 * count
    course = np.vstack([steps(count, length, 15.0, 65.0), np.full((int(6 * max(network.time_constants_s)), count), 45.0)])
    lost = course @ np.diag(shares) / 100.0
    reaching = course * (1.0 - (lost.sum(axis=1, keepdims=True) - lost))
    instants, readings, _ = logged(network, reaching, 1.0, 2, random, 0.03)  # at last all up to the setpoints
    log = ZoneLog(name="drawn", zones=network.zones, time_s=instants, temperatures_degC=readings, powers_pct=course[::2])
    return network, log, random


def case(seed, most_zones=8, *, kind=""):
    """Return what becomes of one drawn network; `kind`: see the head of this file."""
    begun = time.process_time()
    network, log, random = drawn_log(seed, most_zones, kind)
    fitted = network_by_hand(replace(network, supply_shares=())) if kind == "ignored-sag" else fit_network(log)
    intervals = dict(zip(
        fitted.layout.pairs, list(fitted.ci95.values())[-len(fitted.layout.pairs):], strict=True))
    inside = sum(interval.low <= network.exchange[pair] <= interval.high for pair, interval in intervals.items())
    states, inputs, constant = balance(network)
    held_pct = random.uniform(*((75.0, 85.0) if kind == "ignored-sag" else (22.0, 40.0)), len(network.zones))  # that sags, it needs more
    setpoints = np.linalg.solve(states, -(inputs @ held_pct + constant)).round(1)
    spec = specification_for(fitted, list(setpoints), Conditions())
    spec = replace(spec, spread_degC=round(random.uniform(3.0, 15.0), 1)) if kind == "together" else spec
    spec = replace(spec, decouple=kind == "decoupled")
    proof = design_zones(fitted, (DECOUPLED if spec.decouple else TARGETS)[seed % 2], specification=spec, scaling=Scaling(low_degC=0.0, high_degC=400.0 if kind == "ignored-sag" else 200.0))
    complaint = complaint_of(network, proof, random) if proof.verdict == "PASS" else ""
    more = f"{proof.words[0].ramp or ''} {gain_of(network, proof) if spec.decouple else ''}".strip()
    return Case(proof.verdict, complaint, inside, len(intervals), time.process_time() - begun, proof.summary(), more)


def gain_of(network, proof):
    """Return the share of decoupling, and the neighbour deviation on the true network with and without it, a text."""
    if proof.design.decoupling is None:
        return proof.remarks[0]
    off = [neighbour_deviation(network, each) for each in (proof, replace(proof, design=replace(proof.design, decoupling=None)))]
    return f"share {proof.design.decoupling.share:g}: {off[0]:.2f} °C, the same words without {off[1]:.2f} °C"


def neighbour_deviation(network, proof):
    """Return how far a zone is at most from its setpoint while another one's changes, by the judge [°C]."""
    lasts_s = settling(network, proof, proof.design.radius)
    phases, temperatures, highest, asked = live(network, proof, settle_s=lasts_s, noise_degC=0.0, seed=0, settings=None)
    return max((np.abs(np.delete(each[phase.first:phase.end] - asked[phase.first:phase.end], phase.zone, axis=1)).max()
                for phase in phases if phase.kind.startswith("setpoint") for each in (temperatures, highest)), default=0.0)


def complaint_of(network, proof, random):
    """Return what a true network breaks under the words of a proof; "" where it breaks nothing."""
    words, designs = proof.words[0], proof.design.designs
    added = 0.0 if proof.design.decoupling is None else np.array(proof.design.decoupling.pct_per_degC)
    size = radius(network, designs, words.sample_time_s, controller_for(words.target).delayed_s(words.scaling), added)
    if size >= 1.0:
        return f"unstable, largest eigenvalue {size:.4f}"
    lasts_s = settling(network, proof, size)
    choices = SWITCHES[words.target]
    drawn_settings = {name: str(random.choice(each)) for name, each in choices.items()}
    for settings in ({name: each[0] for name, each in choices.items()}, drawn_settings):
        if complaint := judge(network, proof, settle_s=lasts_s, seed=int(random.integers(1 << 30)), settings=settings):
            return f"{complaint} ({settings})"
    return ""


def run(count=200, first=0, kind=""):
    """Print a line for each network and the totals."""
    verdicts, false, inside, couplings = Counter(), 0, 0, 0
    for seed in range(first, first + count):
        found = case(seed, kind=kind)
        verdicts[found.verdict] += 1
        false += bool(found.complaint)
        inside, couplings = inside + found.inside, couplings + found.couplings
        why = found.ramp if found.verdict == "PASS" else " | ".join(found.summary.splitlines()[1:3])
        print(f"{seed}: {found.verdict}{f', FALSE: {found.complaint}' if found.complaint else ''} {found.seconds:.1f} s {why}", flush=True)
    print(f"{dict(verdicts)}; {false} false PASS; {inside} of {couplings} couplings inside their 95 % intervals")


if __name__ == "__main__":
    run(*map(int, sys.argv[1:3]), *sys.argv[3:])

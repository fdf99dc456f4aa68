"""Drawn thermal networks, designed as zones and judged by a simulation that shares nothing with heatertune.

    python -m tests.bench.networks [COUNT] [SEED]

Each network is logged with noise, fitted, tuned and proven. What passes runs on the true network: PI in double precision
with a limited integral, power without PWM, SciPy's matrix exponential on a grid. A PASS that the judge breaks is false.
"""

import sys
import time
from collections import Counter
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from heatertune.plc import Scaling, controller_for
from heatertune.zones import design_zones, fit_network
from heatertune.zones.identify import ZoneLog
from tests.zones.networks import balance, drawn, logged, radius, steps

TARGETS = ("s7-300", "s5-ob251")
PARTS = 8  # steps of the judge from one sample to the next
#: what the judge allows beyond the proof's own limits: it knows neither PWM nor rounding
MARGIN = 1.1


class Case(NamedTuple):
    """A drawn network, its verdict, what the judge says of it, and couplings inside their intervals."""

    verdict: str
    complaint: str
    inside: int
    couplings: int
    seconds: float
    summary: str


def judge(network, proof):
    """Return what the true network breaks under the words of a proof; "" where it breaks nothing."""
    designs, spec = proof.design.designs, proof.specification
    interval, count = designs[0].sample_time_s, len(designs)
    delay = controller_for(proof.words[0].target).delayed_s(proof.words[0].scaling)
    if (size := radius(network, designs, interval, delay)) >= 1.0:
        return f"unstable, largest eigenvalue {size:.4f}"
    step = interval / PARTS
    states, inputs, constant = balance(network)
    block = np.zeros((2 * count, 2 * count))
    block[:count, :count], block[:count, count:] = states, np.eye(count)
    exact = expm(block * step)
    late = [round((dead + delay) / step) for dead in network.dead_times_s]
    temperature = np.linalg.solve(states, -constant)
    setpoint, sums = np.array(spec.setpoints_degC), np.zeros(count)
    rise = setpoint - temperature
    gain = np.array([design.gain_pct_per_degC for design in designs])
    share = np.array([interval / design.integral_time_s for design in designs])
    settle = 12.0 * max(design.integral_time_s for design in designs) - 8.0 * interval / np.log(size)
    heat_up = 4.0 * max(network.time_constants_s) + settle
    asked = [(0.0, setpoint)]
    for zone in range(count):
        moved = setpoint.copy()
        moved[zone] += min(spec.step_degC, 0.9 * _room(network, setpoint, zone))
        asked += [(heat_up + 2 * zone * settle, moved), (heat_up + (2 * zone + 1) * settle, setpoint)]
    ends = [*(instant for instant, _ in asked[1:]), heat_up + 2 * count * settle]
    powers, number = [np.zeros(count)], 0
    for (_, wanted), end in zip(asked, ends, strict=True):
        errors = []
        while number * step < end:
            if number % PARTS == 0:
                error = wanted - temperature
                power = gain * (error + sums + share * error)
                sums = np.where((power > 0.0) & (power < 100.0), sums + share * error, sums)
                power = np.clip(power, 0.0, 100.0)
            powers.append(power)
            arriving = np.array([powers[max(number + 1 - late[zone], 0)][zone] for zone in range(count)])
            temperature = exact[:count, :count] @ temperature + exact[:count, count:] @ (inputs @ arriving + constant)
            errors.append(temperature - wanted)
            number += 1
        if complaint := _broken(np.array(errors), wanted, setpoint, rise, spec):
            return complaint
    return ""


def _room(network, setpoint, zone):
    """Return by how much a zone's setpoint can rise before a neighbour needs no power, or it needs more than all [°C]."""
    states, inputs, constant = balance(network)
    base = np.linalg.solve(inputs, -(states @ setpoint + constant))
    slope = np.linalg.solve(inputs, -states[:, zone])
    room = [(base[i] - 1.0) / -slope[i] if slope[i] < 0.0 else (95.0 - base[i]) / slope[i] for i in range(len(base)) if slope[i]]
    return max(min(room), 0.0)


def _broken(errors, wanted, setpoint, rise, spec):
    last = errors[-len(errors) // 5 :]
    if (offset := np.abs(last).max()) > MARGIN * spec.limits.tolerance_degC:
        return f"{offset:.2f} °C off at the end"
    moved = wanted != setpoint
    if not moved.any():
        over = (100.0 * errors.max(axis=0) / rise).max()
        return f"overshoot {over:.0f} %" if over > MARGIN * spec.limits.overshoot_pct else ""
    change = float((wanted - setpoint).max())
    off = np.abs(errors[:, ~moved]).max()
    return f"a neighbour {off:.2f} °C off" if off > MARGIN * spec.deviation_limit_degC(change) else ""


def case(seed, most_zones=8):
    """Return what becomes of one drawn network."""
    random, begun = np.random.default_rng(seed), time.perf_counter()
    network = drawn(random, int(random.integers(2, most_zones + 1)))
    count = len(network.zones)
    length = int(12 * max(network.time_constants_s)) + 1500 * count
    course = np.vstack([steps(count, length, 15.0, 65.0), np.full((int(6 * max(network.time_constants_s)), count), 45.0)])
    instants, readings, powers = logged(network, course, 1.0, 2, random, 0.03)  # at last all up to the setpoints
    log = ZoneLog(name="drawn", zones=network.zones, time_s=instants, temperatures_degC=readings, powers_pct=powers)
    fitted = fit_network(log)
    intervals = dict(zip(
        fitted.layout.pairs, list(fitted.ci95.values())[-len(fitted.layout.pairs):], strict=True))
    inside = sum(interval.low <= network.exchange[pair] <= interval.high for pair, interval in intervals.items())
    states, inputs, constant = balance(network)
    setpoints = np.linalg.solve(states, -(inputs @ random.uniform(22.0, 40.0, count) + constant)).round(1)
    proof = design_zones(fitted, TARGETS[seed % 2], list(setpoints), scaling=Scaling(low_degC=0.0, high_degC=200.0))
    complaint = judge(network, proof) if proof.verdict == "PASS" else ""
    return Case(proof.verdict, complaint, inside, len(intervals), time.perf_counter() - begun, proof.summary())


def run(count=200, first=0):
    """Print a line for each network and the totals."""
    verdicts, false, inside, couplings = Counter(), 0, 0, 0
    for seed in range(first, first + count):
        found = case(seed)
        verdicts[found.verdict] += 1
        false += bool(found.complaint)
        inside, couplings = inside + found.inside, couplings + found.couplings
        why = "" if found.verdict == "PASS" else " | ".join(found.summary.splitlines()[1:3])
        print(f"{seed}: {found.verdict}{f', FALSE: {found.complaint}' if found.complaint else ''} {found.seconds:.1f} s {why}", flush=True)
    print(f"{dict(verdicts)}; {false} false PASS; {inside} of {couplings} couplings inside their 95 % intervals")


if __name__ == "__main__":
    run(*map(int, sys.argv[1:]))

"""Couplings inside their 95 % intervals, on drawn networks whose power changes between the rows of the log.

    python -m tests.bench.late_powers [COUNT] [SEED]

Each edge of each zone's power lies anywhere between two rows, which are 2 to 20 s apart; the logs are SciPy's.
"""

import sys
from collections import Counter

import numpy as np

from heatertune.zones import fit_network
from heatertune.zones.identify import ZoneLog
from tests.zones.networks import drawn, logged

ROWS_S = (2, 5, 10, 20)


def case(seed):
    """Return kind of quantity → (inside their intervals, all) of one drawn network."""
    random = np.random.default_rng(seed)
    count, every = int(random.integers(2, 5)), int(random.choice(ROWS_S))
    network = drawn(random, count)
    powers = np.full((1500 * (count + 1), count), 20.0)
    for zone in range(count):
        begin = int((zone + 0.3) * len(powers) / (count + 0.5)) + int(random.integers(0, 2 * ROWS_S[-1]))
        end = begin + 1500 + int(random.integers(0, 2 * ROWS_S[-1]))
        powers[begin:end, zone] = random.uniform(40.0, 70.0)
    time, readings, rows = logged(network, powers, 1.0, every, random, 0.05)
    fitted = fit_network(ZoneLog(
        name="twin", zones=network.zones, time_s=time, temperatures_degC=readings, powers_pct=rows))
    truth = {f"{name} {zone}": value for name, values in (
        ("gain_degC_per_pct", network.gains_degC_per_pct), ("time_constant_s", network.time_constants_s),
        ("dead_time_s", [float(round(dead)) for dead in network.dead_times_s]))  # as `logged` makes them
        for zone, value in zip(network.zones, values, strict=True)}
    for zone, other in fitted.layout.pairs:
        truth[f"exchange {network.zones[zone]}-{network.zones[other]}"] = network.exchange[zone, other]
    inside, total = Counter(), Counter()
    for name, value in truth.items():
        interval, kind = fitted.ci95[name], name.split()[0]
        total[kind] += 1
        inside[kind] += bool(interval.low <= value <= interval.high)
    return {kind: (inside[kind], total[kind]) for kind in total}


def run(count=100, first=0):
    """Return the totals of drawn networks, kind of quantity → (inside, all)."""
    cases = [case(seed) for seed in range(first, first + count)]
    return {kind: tuple(sum(each[kind][place] for each in cases) for place in (0, 1)) for kind in cases[0]}


if __name__ == "__main__":
    print(run(*map(int, sys.argv[1:])))

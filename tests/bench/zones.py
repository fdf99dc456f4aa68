"""What a zone of a fleet costs, and whether it costs more among many.

    python tests/bench/zones.py                 50, 100 and 200 zones on one process per processor
    python tests/bench/zones.py 1000 --jobs 2   the thousand

Each zone is a log of 240 rows, 44 minutes of a heater drawn anew, simulated here by plain Euler steps of 0.5 s;
fitted, tuned, rounded and proven as `heatertune fleet --samples 200` does it. Processor time is that of the processes
of the pool, start-up included; one zone before them fills the cache of machine code.
"""

import argparse
import os
import resource
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from heatertune.batch import in_processes
from heatertune.batch.fleets import ZoneSettings, fleet
from heatertune.proof.closing import Asked

ROWS, SPACING_S, STEP_S = 240, 11.0, 0.5


def heater(seed):
    """Return gain [°C/%], time constant [s], dead time [s] and ambient [°C] of the heater behind a log."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.3, 0.8), rng.uniform(100.0, 400.0), rng.uniform(5.0, 30.0), rng.uniform(18.0, 26.0)


def log_text(seed):
    """Return the log of a zone: power off, on at a level of its own, and at another one."""
    gain, lag, dead, ambient = heater(seed)
    rng = np.random.default_rng([seed, 1])
    levels = (0.0, *rng.choice([30, 40, 50, 60, 70, 80], 2, replace=False).tolist())
    begins = (0.0, 15 * SPACING_S, 150 * SPACING_S)

    def power(t):
        return levels[sum(t >= begin for begin in begins) - 1] if t >= 0.0 else 0.0

    temperature, lines = ambient, ["time_s,temperature_degC,power_pct"]
    per_row = round(SPACING_S / STEP_S)
    for row in range(ROWS):
        t = row * SPACING_S
        lines.append(f"{t:.2f},{temperature + rng.normal(0.0, 0.05):.2f},{power(t):g}")
        for k in range(per_row):
            temperature += STEP_S / lag * (ambient + gain * power(t + k * STEP_S - dead) - temperature)
    return "\n".join([*lines, ""])


def write_logs(folder, zones):
    """Write the logs of so many zones."""
    folder.mkdir()
    for seed in range(zones):
        (folder / f"zone{seed:05d}.csv").write_text(log_text(seed), encoding="utf-8")


def run(folder, zones, target, samples, jobs):
    """Return seconds, processor seconds of the pool, and how the zones ended."""
    write_logs(folder / f"logs{zones}", zones)
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    summary = fleet(folder / f"logs{zones}", ZoneSettings(asked=Asked(target=target), samples=samples),
                    out=folder / f"fleet{zones}.parquet", workers=in_processes(jobs))
    spent = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, summary["outcomes"]


def main():
    asked = argparse.ArgumentParser()
    asked.add_argument("zones", nargs="*", type=int, default=[50, 100, 200])
    asked.add_argument("--target", default="weg")
    asked.add_argument("--samples", type=int, default=200)
    asked.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    settings = asked.parse_args()
    print(f"{settings.jobs} processes, {settings.target}, {settings.samples} samples a zone")
    print(f"{'zones':>6} {'s':>7} {'s per zone':>11} {'CPU s per zone':>15}  outcomes; load of the machine")
    found = []
    with tempfile.TemporaryDirectory() as place:
        run(Path(place), 1, settings.target, settings.samples, 1)
        for zones in settings.zones:
            spent, cpu, outcomes = run(Path(place), zones, settings.target, settings.samples, settings.jobs)
            found.append((zones, spent, cpu))
            told = ", ".join(f"{number} {name}" for name, number in outcomes.items())
            print(f"{zones:6d} {spent:7.1f} {spent / zones:11.3f} {cpu / zones:15.3f}  {told}; "
                  f"{os.getloadavg()[0]:.1f}", flush=True)
    for (few, wall, cpu), (many, later, more) in pairwise(found):
        print(f"from {few} to {many} zones, each further one: {(later - wall) / (many - few):.3f} s, "
              f"{(more - cpu) / (many - few):.3f} CPU s")


if __name__ == "__main__":
    main()

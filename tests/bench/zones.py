"""What a zone of a fleet costs, and whether it costs more among many.

    python tests/bench/zones.py                 50, 100 and 200 zones on one process per processor
    python tests/bench/zones.py 1000 --jobs 2   the thousand
    python tests/bench/zones.py 100 1000 10000 --dask    on a local Dask cluster (extra dask): memory and disk, too
    python tests/bench/zones.py 10000 --dask --empty     logs without rows: what is neither heater nor proof

Each zone is a log of 240 rows, 44 minutes of a heater drawn anew, simulated here by plain Euler steps of 0.5 s;
fitted, tuned, rounded and proven as `heatertune fleet --samples 200` does it. Processor time is that of the processes
of the pool, start-up included; one zone before them fills the cache of machine code. With --dask, the scheduler runs in
this process, each worker in one of its own; memory is the most that each ever had.
"""

import argparse
import os
import resource
import tempfile
import time
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np

from heatertune.batch import in_processes
from heatertune.batch.engine import on_dask
from heatertune.batch.fleets import ZoneSettings, fleet
from heatertune.proof.design_request import DesignRequest
from heatertune.settings import SampleSettings

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


def write_logs(folder, zones, *, empty=False):
    """Write the logs of so many zones."""
    folder.mkdir()
    for seed in range(zones):
        (folder / f"zone{seed:05d}.csv").write_text("" if empty else log_text(seed), encoding="utf-8")


@contextmanager
def dask_workers(jobs):
    """Give the workers of a local Dask cluster, and say at its end what memory it took."""
    from distributed import LocalCluster  # noqa: PLC0415 - an extra

    with LocalCluster(n_workers=jobs, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster:
        yield on_dask(cluster.scheduler_address)
        pids = [os.getpid(), *(nanny.pid for nanny in cluster.workers.values())]
        most = [round(_most_memory_kb(pid) / 1024) for pid in pids]
        print(f"       scheduler and client {most[0]} MB, workers {', '.join(map(str, most[1:]))} MB")


def _most_memory_kb(pid):
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


@contextmanager
def pool_workers(jobs):
    """Give those of a pool of processes."""
    yield in_processes(jobs)


def run(folder, zones, settings, cluster=pool_workers):
    """Return seconds, processor seconds of the workers, and how the zones ended; `settings`: of `settings_of`."""
    write_logs(folder / f"logs{zones}", zones, empty=settings.empty)
    before, begun, table = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter(), folder / f"{zones}.parquet"
    with cluster(settings.jobs) as workers:
        asked = DesignRequest(target=settings.target, sample_settings=SampleSettings(samples=settings.samples or None))
        summary = fleet(folder / f"logs{zones}", ZoneSettings(request=asked), out=table, workers=workers)
        spent = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if cluster is dask_workers:
        print(f"       table {table.stat().st_size / 1024:.0f} kB")
    return spent, cpu, summary["outcomes"]


def settings_of(words):
    """Return the settings that a command line gives."""
    asked = argparse.ArgumentParser()
    asked.add_argument("zones", nargs="*", type=int, default=[50, 100, 200])
    asked.add_argument("--target", default="weg")
    asked.add_argument("--samples", type=int, default=200)
    asked.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    asked.add_argument("--empty", action="store_true", help="logs without rows")
    asked.add_argument("--dask", action="store_true", help="on a local Dask cluster")
    return asked.parse_args(words)


def main():
    settings = settings_of(None)
    print(f"{settings.jobs} processes, {settings.target}, {settings.samples} samples a zone")
    print(f"{'zones':>6} {'s':>7} {'s per zone':>11} {'CPU s per zone':>15}  outcomes; load of the machine")
    found = []
    with tempfile.TemporaryDirectory() as place:
        run(Path(place), 1, settings)
        for zones in settings.zones:
            spent, cpu, outcomes = run(Path(place), zones, settings, dask_workers if settings.dask else pool_workers)
            found.append((zones, spent, cpu))
            told = ", ".join(f"{number} {name}" for name, number in outcomes.items())
            print(f"{zones:6d} {spent:7.1f} {spent / zones:11.3f} {cpu / zones:15.3f}  {told}; "
                  f"{os.getloadavg()[0]:.1f}", flush=True)
    for (few, wall, cpu), (many, later, more) in pairwise(found):
        print(f"from {few} to {many} zones, each further one: {(later - wall) / (many - few):.3f} s, "
              f"{(more - cpu) / (many - few):.3f} CPU s")


if __name__ == "__main__":
    main()

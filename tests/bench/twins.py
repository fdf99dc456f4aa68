"""Do the intervals hold on logs like the real ones? python tests/bench/twins.py LOGS --runs 500.

Each real log is fitted; its twins have the fitted heater, the logged power and the log's own instants, and noise of the
residuals' size and lag-one correlation. Each twin is fitted as any log is, and its 95 % intervals should hold the
heater it was made with. A log whose own fit explains too little to be repeated is named and left out.
"""

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from heatertune.errors import InputError
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt

PARAMETERS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
LEAST_FIT_PCT = 85.0


@cache
def original(path):
    """Return log and fit of a file, or None and why not."""
    try:
        log = read_log(path)
        if log.power_pct is None:
            return None, "no power"
        fitted = fit(log)
    except InputError as refusal:
        return None, str(refusal)
    if fitted.fit_pct < LEAST_FIT_PCT:
        return None, f"fit {fitted.fit_pct:.1f} %"
    return log, fitted


def twin(path, seed):
    """Return for each parameter whether the twin's interval holds the truth, or why it was refused."""
    log, fitted = original(path)
    left = fitted.residuals.measured_degC - fitted.residuals.simulated_degC
    rho = float(np.clip(fitted.residuals.autocorrelation[0], 0.0, 0.98))
    made = one_lag(fitted, log)
    drive = math.sqrt(1.0 - rho**2) * float(np.std(left))
    noise = lfilter([drive], [1.0, -rho], np.random.default_rng(seed).normal(size=len(made) + 500))[500:]
    record = Log(name=f"{log.name} twin", source="made", time_s=log.time_s, temperature_degC=made + noise,
                 power_pct=log.power_pct)
    try:
        ci95 = fit(record).ci95
    except InputError as refusal:
        return str(refusal)
    return [_holds(ci95[name], getattr(fitted.model, name)) for name in PARAMETERS]


def one_lag(fitted, log):
    """Return the answer of the fitted heater alone, from the first simulated temperature: no drift, no load."""
    model: Fopdt = fitted.model
    ambient = model.ambient_degC if model.ambient_degC is not None else float(np.min(log.temperature_degC))
    plant = replace(model, ambient_degC=ambient)
    y = float(fitted.residuals.simulated_degC[0])
    times, power = log.time_s, log.power_pct
    made = np.empty(len(times))
    made[0] = y
    edges = np.append(times, math.inf) + plant.dead_time_s
    acting, place = power[0], 1  # the first power had been there before the log
    for i in range(1, len(times)):
        now = times[i - 1]
        while now < times[i]:
            until = min(times[i], edges[place] if place < len(times) else math.inf)
            target = ambient + plant.gain_degC_per_pct * acting
            y = target + (y - target) * math.exp(-(until - now) / plant.time_constant_s)
            now = until
            if place < len(times) and now >= edges[place]:
                acting, place = power[place], place + 1
        made[i] = y
    return made


def _holds(found, truth):
    return found is None or ((found.low is None or found.low <= truth) and (found.high is None or truth <= found.high))


def main(arguments=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path, help="folder of logs")
    parser.add_argument("--runs", type=int, default=500, help="twins of all logs together")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    settings = parser.parse_args(arguments)
    paths = [str(path) for path in sorted(settings.logs.glob("*.csv"))]
    able = [path for path in paths if original(path)[0] is not None]
    for path in sorted(set(paths) - set(able)):
        print(f"left out: {Path(path).stem}: {original(path)[1]}")
    work = [(able[i % len(able)], i) for i in range(settings.runs)]
    with ProcessPoolExecutor(settings.jobs) as pool:
        found = list(pool.map(twin, *zip(*work, strict=True), chunksize=4))
    print("| log | twins | refused | 95 % intervals that hold k, T, L (%) |\n| --- | --- | --- | --- |")
    for name, group in [(Path(p).stem, [f for (q, _), f in zip(work, found, strict=True) if q == p]) for p in able] + [
        ("all", found)
    ]:
        held = [f for f in group if not isinstance(f, str)]
        shares = ", ".join(f"{100.0 * share:.1f}" for share in np.mean(held, axis=0)) if held else ""
        print(f"| {name} | {len(group)} | {len(group) - len(held)} | {shares} |")


if __name__ == "__main__":
    main()

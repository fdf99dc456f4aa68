"""How often a tuned design breaks what was asked for: random heaters × limits × structures, sampled and continuous.

    python tests/bench/tolerance.py               2,000 designs
    python tests/bench/tolerance.py --count 200   fewer

The judge is the one of `verify` (sampled: `heatertune.pid.sampled_loop.margins`; continuous: `margins` of
`heatertune.pid.continuous_optimum`), without a tolerance. A design that is refused with a sentence breaks nothing.
"""

import argparse
import math
from collections import Counter

import numpy as np

from heatertune.errors import InputError
from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, Fopdt, TwoLag, model_by_hand
from heatertune.pid.continuous_optimum import margins as continuous_margins
from heatertune.pid.sampled_loop import margins, noise_gain
from heatertune.pid.tune import tune

OBJECTIVES = ("load", "load", "setpoint", "itae", "ki")


def random_heater(rng):
    """Return one lag or two, dead time over lag log-uniform in 1e-4…10."""
    gain, lag = math.exp(rng.uniform(-2.3, 2.3)), math.exp(rng.uniform(2.3, 8.9))
    dead = lag * math.exp(rng.uniform(math.log(1e-4), math.log(10.0)))
    if rng.random() < 0.7:
        return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead)
    return TwoLag(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead,
                  second_time_constant_s=lag * math.exp(rng.uniform(-4.0, -0.1)))


def family(rng, heaters):
    """Return a fit of one heater, or of two beside each other."""
    if len(heaters) == 1:
        return model_by_hand(heaters[0])
    rows = tuple(Candidate(model=m, log="", window_s=(0.0, 1.0), law="", fit_pct=90.0, rmse_degC=1.0, delta_bic=0.0)
                 for m in heaters)
    return FittedModel(model=heaters[0].half_rule(), outcome=FitOutcome.COMBINATIONS_ONLY, method="", candidates=rows)


def case(rng):
    """Return a fit and what is asked of it."""
    heaters = [random_heater(rng) for _ in range(1 if rng.random() < 0.8 else 2)]
    asked = {"structure": str(rng.choice(["p", "pi", "pi", "pid"])), "ms": float(rng.choice([1.2, 1.4, 1.6, 1.8, 2.0, rng.uniform(1.1, 3.0)]))}
    weakest = min(heater.gain_degC_per_pct for heater in heaters)
    if rng.random() < 0.15:
        asked["mt"] = float(rng.uniform(1.0, 1.5))
    if rng.random() < 0.15:
        asked["mks"] = float(rng.uniform(1.5, 30.0)) / weakest
    if asked["structure"] != "p":
        asked["objective"] = str(rng.choice(OBJECTIVES))
    if rng.random() < 0.35:
        asked["sample_time_s"] = 0.0
    elif rng.random() < 0.5:
        asked["sample_time_s"] = float(np.round(sum(heaters[0].lags_s) * math.exp(rng.uniform(-7.0, -1.0)), 2)) or 0.01
    return family(rng, heaters), asked


def broken(fitted, asked):
    """Return "kept", "refused: …" or which limit is broken and by how much."""
    try:
        design = tune(fitted, **asked)
    except InputError as refused:
        return f"refused: {' '.join(str(refused).split()[:4])}"
    ms, mt, mks = judged(fitted, design)
    for name, value in (("ms", ms), ("mt", mt), ("mks", mks)):
        limit = asked.get(name, math.inf)
        if value > limit:
            return f"BROKEN {name} {value!r} > {limit!r}"
    return "kept"


def judged(fitted, design):
    """Return Ms, Mt and Mks, the worst over the candidates."""
    if design.sample_time_s == 0.0:
        found, noise = continuous_margins(fitted.plants, design)
        return found.ms, found.mt, noise
    each = [margins(plant, design) for plant in fitted.plants]
    return max(m.ms for m in each), max(m.mt for m in each), max(noise_gain(plant, design) for plant in fitted.plants)


def main():
    asked = argparse.ArgumentParser()
    asked.add_argument("--count", type=int, default=2000)
    count, rng, ends = asked.parse_args().count, np.random.default_rng(13), Counter()
    for number in range(count):
        fitted, wanted = case(rng)
        end = broken(fitted, wanted)
        if end.startswith("BROKEN"):
            print(number, wanted, fitted.plants, end, flush=True)
        ends[end.split(" ")[0] if end.startswith("BROKEN") else end] += 1
    for end, times in ends.most_common():
        print(f"{times:6d}  {end}")


if __name__ == "__main__":
    main()

"""Do designs that were closed on drawn heaters pass on those that nobody has seen? Random heaters; run as a program.

    python tests/bench/drawn_designs.py                 60 heaters on each of three controllers
    python tests/bench/drawn_designs.py 20 weg s7-300

A design that was changed until samples pass it is judged by others. What it says then, with 95 % confidence, is held
against the share of 5,000 more. Exit status 1 where more PASSes are wrong than one in twenty lets be, by chance, too.
"""

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.cache import cache_disabled
from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.monte_carlo.run import run_samples
from heatertune.proof.redesign.on_samples import closed_on_samples
from heatertune.settings import SampleSettings

DRAWN, MORE, MUST = SampleSettings(samples=200), SampleSettings(samples=5000, seed=1_000_000), 0.95


def heater_of(number):
    """Return a heater drawn from its number."""
    rng = np.random.default_rng(number)
    lag = float(np.exp(rng.uniform(np.log(30.0), np.log(1000.0))))
    return model_by_hand(Fopdt(
        gain_degC_per_pct=float(rng.uniform(0.3, 1.5)), time_constant_s=lag, dead_time_s=lag * float(rng.uniform(0.03, 0.4)),
        ambient_degC=float(rng.uniform(10.0, 30.0))))


def main(count="60", *targets):
    """Print a line for each controller; return whether too many PASSes are wrong."""
    changed, wrong = 0, 0
    for target in targets or ("weg", "s7-300", "pid-compact"):
        ended = Counter()
        for number in range(int(count)):
            heater = heater_of(number)
            try:
                with cache_disabled():
                    found = closed_on_samples(heater, DesignRequest(target=target, sample_settings=DRAWN))
            except HeatertuneError:
                ended["refused"] += 1
                continue
            drawn, proof = found.proof.samples, found.proof
            ended[f"{proof.verdict}, {'made for drawn heaters' if drawn.seed else 'as asked for'}"] += 1
            if proof.verdict == "PASS" and drawn.seed:
                changed += 1
                share = run_samples(proof.words, heater, MORE, found.conditions).passing
                if share < MUST:
                    wrong += 1
                    print(f"{target} heater {number}: PASS, but {100.0 * share:.2f} % of {MORE.samples} keep every limit")
        print(f"{target}: " + ", ".join(f"{how} {kind}" for kind, how in sorted(ended.items())), flush=True)
    print(f"{wrong} of {changed} that were made for drawn heaters pass by chance")
    return int(wrong > 1 + (1.0 - MUST) * changed)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

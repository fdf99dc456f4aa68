"""What the best words gain over naive rounding, on random heaters: `python tests/bench/words.py [HEATERS]`.

Each heater is tuned (PI, Ms <= 1.6) at a sampling interval drawn between a hundredth and a half of its slowest part,
its words for OB251 are rounded and searched, and the search is checked by brute force over the neighbourhood.
"""

import itertools
import os
import sys
import time

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.sampled_loop import iae_load, margins
from heatertune.pid.search.feasible import Problem, search
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.design import encode
from heatertune.plc.word_selection import choose_words

TARGET = "s5-ob251"


def random_case(rng):
    """Return a heater and a sampling interval: gain 0.1…3 °C/%, 30…1500 s, dead time 2…100 % of that."""
    constant = 30.0 * 50.0 ** rng.random()
    plant = Fopdt(gain_degC_per_pct=0.1 * 30.0 ** rng.random(), time_constant_s=constant,
                  dead_time_s=constant * 0.02 * 50.0 ** rng.random(), ambient_degC=20.0)
    interval = (constant + plant.dead_time_s) * 0.0015 * 60.0 ** rng.random()
    return plant, max(0.01, round(interval, 2))


def best_near(words, plant, ms):
    """Return the least cost over all words within ±25 of K and ±3 of TI, each judged alone."""
    best = np.inf
    for dk, dt in itertools.product(range(-25, 26), range(-3, 4)):
        values = dict(words.values) | {"K": words.values["K"] + dk, "TI": words.values["TI"] + dt}
        if min(values["K"], values["TI"]) < 1 or values["K"] > 32767:
            continue
        design = controller_for(TARGET).decode(
            Words(target=TARGET, values=values, scaling=words.scaling, sample_time_s=words.sample_time_s))
        if margins(plant, design).ms <= ms:
            best = min(best, iae_load(plant, design))
    return best


def compare(heaters=200, seed=5, *, brute=True):
    """Return one row per heater that rounding can serve.

    A row: TI word of rounding, its IAE and Ms over those of the design, and the same of the best words; whether
    proven; by how much brute force was better (relative, 0 where it was not).
    """
    rng, rows = np.random.default_rng(seed), []
    for _ in range(heaters):
        plant, ta = random_case(rng)
        try:
            design = search(Problem(plants=(plant,), structure="pi", ms=1.6, sample_time_s=ta))
            rounded = encode(design, TARGET, scaling=Scaling())
        except HeatertuneError:
            continue
        choice = choose_words(design, TARGET, model_by_hand(plant))
        wished, ms = iae_load(plant, design), margins(plant, design).ms
        row = [rounded.values["TI"]]
        for words in (rounded, choice.words):
            real = controller_for(TARGET).decode(words)
            row += [iae_load(plant, real) / wished, margins(plant, real).ms / ms]
        better = max(0.0, 1.0 - best_near(choice.words, plant, ms) / (row[3] * wished)) if brute else 0.0
        rows.append([*row, choice.search.optimum is not None and choice.search.optimum.proven, better])
    return np.array(rows, dtype=float)


def main():
    """Print the table."""
    os.environ["HEATERTUNE_CACHE"] = ""
    begun = time.perf_counter()
    rows = compare(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    word, iae, ms, best_iae, best_ms, proven, better = rows.T
    print(f"{len(rows)} heaters whose rounded words fit, {time.perf_counter() - begun:.0f} s")
    print(f"proven: {int(proven.sum())}; brute force better: {int((better > 1e-4).sum())} (most {better.max():.1e})")
    print("TI word      heaters  rounded: IAE median, worst; Ms worst, broken   best: IAE median, worst; Ms worst")
    for low, high in ((1, 2), (3, 9), (10, 29), (30, 9999), (1, 9999)):
        at = (word >= low) & (word <= high)
        if at.any():
            print(f"{low:4d}…{high:<5d} {at.sum():9d}  {np.median(iae[at]):8.3f} {iae[at].max():8.3f} "
                  f"{ms[at].max():8.3f} {(ms[at] > 1.0).sum():8d}      {np.median(best_iae[at]):8.4f} "
                  f"{best_iae[at].max():8.4f} {best_ms[at].max():8.4f}")
    kept = ms <= 1.0
    gain = 100.0 * (iae[kept] / best_iae[kept] - 1.0)
    print(f"where rounding keeps Ms ({kept.sum()}): gain in IAE median {np.median(gain):.2f} %, worst {gain.min():.2f} %, "
          f"best {gain.max():.1f} %")


if __name__ == "__main__":
    main()

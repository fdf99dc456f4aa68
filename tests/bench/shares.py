"""How often drawn heaters say PASS where too few keep the limits, and FAIL where enough do; run as a program.

    python tests/bench/shares.py              20,000 samples of WEG's block, under every setting
    python tests/bench/shares.py s7-300 5000

A limit is put where a known share of all these samples keeps it under the worst setting; then the verdict is asked of one
group of them after the other, by what counts in `heatertune verify --samples`. Exit status 1 where a wrong PASS is likelier
than 5 %, by more than the number of groups lets it be.
"""

import math
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.proof import LoopLimits
from heatertune.proof.criteria import columns_of
from heatertune.proof.monte_carlo.draw import measure
from heatertune.proof.verdict import verdict_of_samples
from tests.proof.test_lanes import default_drawing

NAMES, SHARES, GROUPS, AT_ONCE = ("overshoot", "recovery_overshoot", "settling_time"), (0.94, 0.949, 0.96), (59, 100, 200), 2500
MUST, WRONG = 0.95, 0.05


def values_of(target, count):
    """Return what the samples came to: criterion → array of shape (settings, samples)."""
    drawing, limits, found = default_drawing(target), LoopLimits(), {name: [] for name in NAMES}
    for seed in range(0, count, AT_ONCE):
        for column in columns_of(measure(drawing, limits, min(AT_ONCE, count - seed), seed=seed), limits):
            if column.name in found:
                found[column.name].append(column.values.reshape(len(drawing.controllers), -1))
    return {name: np.concatenate(parts, axis=1) for name, parts in found.items()}


def verdicts_of(kept, group):
    """Return the verdict of each group of samples, given which keep the limit, shape (settings, samples)."""
    whole = kept[:, : kept.shape[1] // group * group].reshape(len(kept), -1, group)
    return [verdict_of_samples(group, MUST, numbers.tolist()) for numbers in whole.sum(axis=2).T]


def main(target="weg", count="20000"):
    """Print a table; return whether a wrong PASS is too likely."""
    print("| criterion | keep it | samples | groups | PASS | FAIL |\n" + "| --- " * 6 + "|")
    wrong = False
    for name, values in values_of(target, int(count)).items():
        for share in SHARES:
            kept = values <= max(np.quantile(row, share, method="lower") for row in values)
            for group in GROUPS:
                verdicts = verdicts_of(kept, group)
                passes, fails = (verdicts.count(verdict) / len(verdicts) for verdict in ("PASS", "FAIL"))
                print(f"| {name} | {100 * share:g} % | {group} | {len(verdicts)} | {100 * passes:.1f} % | {100 * fails:.1f} % |")
                wrong |= share < MUST and passes > WRONG + 3.0 * math.sqrt(WRONG * (1.0 - WRONG) / len(verdicts))
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

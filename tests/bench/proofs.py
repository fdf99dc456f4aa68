"""How long a proof takes, judged by the kernel's meter and by the traces of its runs, and how far both are apart.

    python tests/bench/proofs.py --count 10
    python tests/bench/proofs.py --count 3 --plain --targets weg s7-200

Heaters, words and conditions are those of tests/proof/test_metered.py. Exit status 1 where they differ by more than
rounding, or in a verdict.
"""

import argparse
import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.compiled import decide
from heatertune.plc import TARGETS
from heatertune.proof import Acceptance, prove_models, simulate
from heatertune.proof.scenario import delay_heater
from tests.proof.test_metered import NEAR, drawn
from tests.witness.trace_measures import judge

_LEAST = 5  # each proof is timed so often, and the least counts


def least(work):
    """Return the least processor time of some repeats [ms]."""
    spent = []
    for _ in range(_LEAST):
        begun = time.process_time()
        work()
        spent.append(1e3 * (time.process_time() - begun))
    return min(spent)


def apart(one, other):
    """Return how far two values are apart, of the larger of 1 and the second."""
    return 0.0 if one == other else abs(one - other) / max(1.0, abs(other)) if math.isfinite(one + other) else math.inf


def compared(target, seed):
    """Return the number of runs, both times [ms], and how far the values and verdicts are apart, of one proof."""
    which, words, models, scenario, actuator, limits = drawn(target, seed)

    def by_traces():
        return [judge(simulate(which, words, delay_heater(dict(models)[run.model], which.delay_s), scenario, actuator, run.switches), limits)
                for run in proof.runs]

    def by_meter():
        return prove_models(which, words, models, scenario, actuator, Acceptance(limits=limits))

    proof = by_meter()  # what is to be compiled is
    by_traces()
    spent, longer = least(by_meter), least(by_traces)
    pairs = [pair for run, own in zip(proof.runs, by_traces(), strict=True) for pair in zip(run.criteria, own, strict=False)]
    furthest = max(apart(one.value, other.value) for one, other in pairs)
    return len(proof.runs), spent, longer, furthest, sum(one.ok != other.ok for one, other in pairs)


def main(arguments=None):
    """Print a line for each target; return 1 where both ways differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5, help="proofs for each target (default: 5)")
    parser.add_argument("--targets", nargs="+", default=list(TARGETS), choices=TARGETS, metavar="TARGET")
    parser.add_argument("--plain", action="store_true", help="without the compiler")
    settings = parser.parse_args(arguments)
    decide(not settings.plain)
    print("| target | runs | by meter, ms a run | by traces | apart | verdicts that differ |")
    print("| --- | --- | --- | --- | --- | --- |")
    same = True
    for target in settings.targets:
        rows = [compared(target, seed) for seed in range(settings.count)]
        runs, spent, longer, furthest, differing = zip(*rows, strict=True)
        same &= max(furthest) <= NEAR["rel"] and not any(differing)
        print(f"| {target} | {sum(runs)} | {sum(spent) / sum(runs):.3f} | {sum(longer) / sum(runs):.3f} | "
              f"{max(furthest):.1e} | {sum(differing)} |", flush=True)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())

"""How often words change with digits that mean nothing: `python tests/bench/same_words.py [TARGET] [COUNT] [LOG]`.

The parameters of every candidate heater of a log are multiplied by random factors of 1 ± 1e-9 to 1 ± 1e-7, as another
version of a library or another processor might leave them, and each time design and words are made anew. Words are
whole numbers, so some change must move them; the rate tells how seldom one so small does.
"""

import sys
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.log import read_log
from heatertune.plc.design import tune
from heatertune.plc.word_selection import choose_words

PARAMETERS = ("gain_degC_per_pct", "time_constant_s", "second_time_constant_s", "dead_time_s")
LEAST, MOST = 1e-9, 1e-7


def shaken(fitted, rng, size):
    """Return a fit whose heaters have every parameter changed by a share of at most `size`."""
    def heater(model):
        names = [name for name in PARAMETERS if hasattr(model, name)]
        return replace(model, **{name: getattr(model, name) * (1.0 + size * rng.uniform(-1.0, 1.0)) for name in names})

    candidates = tuple(replace(candidate, model=heater(candidate.model)) for candidate in fitted.candidates)
    return replace(fitted, model=heater(fitted.model), candidates=candidates)


def words_of(fitted, target):
    """Return the words of the optimum, as names and values."""
    choice = choose_words(tune(fitted, target=target), target, fitted)
    return tuple((name, value) for name, value in choice.words.values.items() if value)


def rate(fitted, target, count, seed=1):
    """Return how often words came out that differ from those of the fit as it is, and all that came out."""
    rng, seen = np.random.default_rng(seed), Counter()
    with cache.cache_disabled():
        own = words_of(fitted, target)
        for _ in range(count):
            size = LEAST * (MOST / LEAST) ** rng.random()
            seen[words_of(shaken(fitted, rng, size), target)] += 1
    return count - seen[own], seen


def main():
    """Print the rate and the words."""
    target, count, log = [*sys.argv[1:], *("s5-ob251", "200", "table4")[len(sys.argv) - 1:]]
    fitted = fit(read_log(log, errata=True), companions=True)
    begun = time.perf_counter()
    changed, seen = rate(fitted, target, int(count))
    print(f"{target}, {log}: {changed} of {count} changed; {time.perf_counter() - begun:.0f} s")
    for words, times in seen.most_common():
        print(f"{times:6d}  " + "  ".join(f"{name} {value}" for name, value in words))


if __name__ == "__main__":
    main()

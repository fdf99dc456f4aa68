"""No way to write a log gives a better verdict than its plain rows: real and drawn logs in the ways of `thinning.py`.

A log that is thinned, late, averaged or in two files holds no more than its plain rows. Where these are blocked, a form
of the log that passes has lost what blocks them. Readings that stand for a while leave the heater what it is: of such a
loop only a PASS on intervals that miss the heater counts; the plain rows may be blocked for a reason that is none.

    python -m tests.bench.thinned_verdicts real [WORD]        the real logs, or those with this word in their names
    python -m tests.bench.thinned_verdicts [COUNT] [FIRST]    so many drawn loops with a fault that no log shows, from a seed on

A fit or a design ends after `thinning.BOUND_S` of processor time, as "no end". Exit status 1 where a verdict is better.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.cache import cache_disabled
from heatertune.model.model_values import FittedModel
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.redesign import find_passing_design
from tests.bench import thinning
from tests.bench.on_change import Case, missed
from tests.bench.thinning import Rows

TARGET = "fb41"
PASS, BLOCKED = "PASS", "NOT PROVEN"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Verdict on a log in one of its forms, and what blocks it or why there is none."""

    verdict: str
    reason: str
    missed: tuple[str, ...] = ()


def outcome_of(texts: list[str], folder: Path, truth: Case | None = None, **stated: Any) -> Outcome:
    """Return the verdict on a log in one file, or in two, within `thinning.BOUND_S` of processor time."""
    outcome = thinning.bounded(lambda: designed(thinning.fitted(texts, folder, **stated), truth), thinning.BOUND_S)
    if isinstance(outcome, str):
        verdict, _, reason = outcome.partition(": ")
        return Outcome(verdict=verdict, reason=reason)
    assert isinstance(outcome, Outcome)
    return outcome


def designed(model: FittedModel, truth: Case | None) -> Outcome:
    """Return the verdict on a controller designed for a heater; what blocks a fit needs no design to be known."""
    if thinning.blocks(model):
        return Outcome(verdict=BLOCKED, reason=" ".join(thinning.blocks(model)))
    with cache_disabled():
        proof = find_passing_design(model, DesignRequest(target=TARGET)).proof
    reasons = [each.name for each in proof.criteria if not each.ok]
    reasons += [each.name for each in proof.diagnostics.findings if each.kind.effect == "blocks"]
    misses = [] if truth is None else missed(truth, model, 2.0 * truth.poll_s)  # a row late, or the mean of one
    return Outcome(verdict=proof.verdict, reason=" ".join(reasons), missed=tuple(misses))


#: what happens in a drawn loop that its log does not show
FAULTS = ("neighbour", "door", "radiation", "opened", "frozen", "drift")


def drawn_loop(seed: int) -> tuple[str, Rows, Case | None]:
    """Return name, rows and heater of a PI loop with a fine, noisy reading and something that its log does not show.

    The heater is None where it is not the same throughout.

    "neighbour": an unlogged heater is switched; "door": twice the loss for a while; "radiation": a loss that grows with the
    temperature; "opened": no heat for a while; "frozen": readings stand for a while; "drift": the room warms.
    """
    rng, fault = np.random.default_rng([42, seed]), FAULTS[seed % len(FAULTS)]
    lag, gain, ambient = rng.uniform(40.0, 400.0), rng.uniform(0.4, 2.0), rng.uniform(17.0, 28.0)
    poll, scans = max(0.25, round(lag / rng.uniform(60.0, 200.0), 2)), 10
    dead = int(rng.uniform(0.03, 0.15) * lag / poll * scans)
    digits, target = rng.choice([3, 2, 1]), ambient + gain * rng.uniform(25.0, 45.0)
    rows = int(rng.uniform(5.0, 8.0) * lag / poll)
    begin, end = sorted(rng.uniform(0.3, 0.8, 2) * rows)
    k, ti = 0.3 * lag / (gain * (dead / scans * poll + poll)), lag
    x, integral, read, pipe = ambient, 0.0, ambient, [0.0] * dead
    powers, readings = [], []
    for row in range(rows):
        during = begin <= row < end
        if not (fault == "frozen" and (row // 9) % 3 == 1 and during):
            read = round(x + rng.normal(0.0, 1.5 * 10.0 ** -int(digits)), int(digits))
        step = gain * 20.0 if row < rows // 2 else gain * 5.0
        wanted = k * (target + step - ambient - (read - ambient) - gain * 20.0) + integral
        power = round(min(max(wanted, 0.0), 100.0), 1)
        integral += k * poll / ti * (target + step - gain * 20.0 - read) if 0.0 < wanted < 100.0 else 0.0
        powers.append(power)
        readings.append(read)
        for _ in range(scans):
            pipe.append(power if not (fault == "opened" and during) else 0.0)
            room = ambient + (0.1 * gain * 100.0 * row / rows if fault == "drift" else 0.0)
            loss = (x - room) * (2.0 if fault == "door" and during else 1.0)
            loss *= 1.0 + (x - room) / (40.0 * gain) if fault == "radiation" else 1.0
            x += poll / scans / lag * (gain * (pipe.pop(0) + (25.0 if fault == "neighbour" and during else 0.0)) - loss)
    time_s, power_pct = np.arange(rows) * poll, np.array(powers)
    changed = np.concatenate([[True], np.diff(power_pct) != 0.0])
    truth = Case(gain=gain, time_constant_s=lag, second_s=0.0, dead_time_s=dead * poll / scans, ambient_degC=ambient,
                 plan=(), end_s=rows * poll, poll_s=poll, step_degC=0.0)
    return (f"loop {seed} {fault}", Rows(time_s=time_s, temperature_degC=np.array(readings), power_s=time_s[changed],
                                         power_pct=power_pct[changed]), truth if fault == "frozen" else None)


def drawn_loops(count: int, first: int) -> Iterator[tuple[str, Rows, Case | None]]:
    """Yield name, rows and heater of drawn loops."""
    yield from (drawn_loop(seed) for seed in range(first, first + count))


def main(cases: Iterable[tuple[str, Rows, Case | None]], folder: Path) -> int:
    """Print the verdict on each log in each of its forms; return how many are better than that on its plain rows, or faults."""
    tally, better = Counter[str](), 0
    for name, rows, truth in cases:
        plain = None
        for writer in thinning.WRITERS:
            outcome = outcome_of(writer(rows), folder, truth, **thinning.FIT.get(name, {}))
            plain = plain or outcome
            is_better = outcome.verdict == PASS and plain.verdict != PASS and (truth is None or bool(outcome.missed))
            better += is_better or outcome.verdict == "FAULT"
            tally[f"{writer.__name__}: {outcome.verdict}"] += 1
            print(f"{name} {writer.__name__} {outcome.verdict}{' BETTER THAN ITS PLAIN ROWS' if is_better else ''} {outcome.reason}", flush=True)
            if plain.verdict == PASS:
                break  # no form can be better
    for key, number in sorted(tally.items()):
        print(f"{key} {number}")
    print(f"{better} verdicts are better than those on the plain rows")
    return better


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        if sys.argv[1:2] == ["real"]:
            sys.exit(min(main(((name, rows, None) for name, rows, _ in thinning.real_rows([*sys.argv, ""][2])), Path(made)), 1))
        sys.exit(min(main(drawn_loops(int([*sys.argv, 12][1]), int([*sys.argv, 0, 0][2])), Path(made)), 1))

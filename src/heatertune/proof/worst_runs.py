"""Other words in the runs that words have failed: a first look, before a whole proof is worth its time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

from heatertune.model.model_values import FittedModel
from heatertune.plc import Words
from heatertune.proof.criteria import Criterion
from heatertune.proof.long_outage import BRIEF, JUDGED, wound
from heatertune.proof.proof import Proof, RunResult
from heatertune.proof.prove_words import prove
from heatertune.proof.verdict import Run
from heatertune.settings import Conditions

__all__ = ["NOTICEABLE", "RunScreen", "WorstRuns"]

_MOST: Final = 10.0  # strain of a limit that is broken without end
#: share of a limit: broken is not kept, by however little
NOTICEABLE: Final = 1e-9


class WorstRuns(NamedTuple):
    """What words break in runs.

    Attributes:
        badness: by how much, as shares of the limits: the sum over the criteria, of the worst run; 0: they keep all.
            What is broken without end counts as tenfold.
        names: of the criteria.
    """

    badness: float
    names: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScreen:
    """Runs that were failed.

    Attributes:
        fitted: the heater and its candidates.
        runs: the hardest first.
        nights: name of another open circuit → runs with it.
        names: of the criteria that count; None: all.
        night_times: how many times as long as in a proof the longest open circuit lasts.
    """

    fitted_model: FittedModel
    runs: tuple[Run, ...] = ()
    nights: Mapping[str, tuple[Run, ...]] = field(default_factory=dict)
    names: frozenset[str] | None = None
    night_times: float = 1.0

    def with_failed(self, proof: Proof) -> RunScreen:
        """Return it with the worst run of each criterion that a proof breaks, before what is there."""
        broken = sorted(self._broken(proof), key=lambda criterion: -criterion.strain)
        runs = {run.label: run.run for run in proof.runs}
        worst = dict.fromkeys(criterion.where for criterion in broken)
        new = [runs[label] for label in worst if label in runs and runs[label] not in self.runs]
        return replace(self, runs=(*new, *self.runs))

    def with_nights(self, proofs: Iterable[Proof]) -> RunScreen:
        """Return it with the runs that proofs make of the open circuits after which they break a limit, too."""
        hardest = dict(self.nights)
        for name, proof in ((name, each) for each in proofs for name in wound(each.diagnostics)):
            kept = hardest.get(name, ())
            hardest[name] = (*kept, *(run for run in proof.nights[name] if run not in kept))
        return replace(self, nights={name: hardest[name] for name in sorted(hardest)})

    def with_shorter_outages(self) -> RunScreen:
        """Return it with shorter open circuits in its hardest run, for a search whose whole proofs are dear."""
        return replace(self, nights={**self.nights, BRIEF: self.runs[:1]})

    def look(self, words: Words, conditions: Conditions, *, bound: float = math.inf) -> WorstRuns:
        """Return what words break in these runs and nights.

        Args:
            words: to look at.
            conditions: of the proof.
            bound: from here on any badness is as good as another: the hardest run may do.

        Raises:
            InputError, OutOfRange, UnknownName: as `prove`.
        """
        badness, names = 0.0, frozenset[str]()
        for broken in self._looks(words, conditions, at_once=math.isinf(bound)):
            badness = max(badness, *(sum(map(_beyond, criteria)) for criteria in broken))
            names |= {criterion.name for criteria in broken for criterion in criteria}
            if badness >= bound:
                break
        return WorstRuns(badness, names)

    def _looks(self, words: Words, conditions: Conditions, *, at_once: bool) -> Iterator[list[list[Criterion]]]:
        """Yield what runs break, the hardest first where not all are made at once, the nights last."""
        for runs in filter(None, (self.runs,) if at_once else (self.runs[:1], self.runs[1:])):
            yield [self._broken(run) for run in prove(words, self.fitted_model, conditions, only=runs).runs]
        if self.nights:
            yield [self._broken(run, of) for of, run in self._nights(words, conditions)]

    def badness(self, words: Words, conditions: Conditions) -> float:
        """Return by how much words break the limits in these runs, see `WorstRuns`; errors as `look`."""
        return self.look(words, conditions).badness

    def keeps(self, words: Words, conditions: Conditions) -> bool:
        """Return whether words keep the limits in these runs; errors as `look`."""
        return self.look(words, conditions, bound=NOTICEABLE).badness == 0.0

    def settles(self, words: Words, conditions: Conditions) -> float | None:
        """Return when the worst of these runs and nights has settled [s], None where one breaks a limit.

        Errors as `look`.
        """
        last = 0.0
        for some in filter(None, (self.runs[:1], self.runs[1:])):
            runs = prove(words, self.fitted_model, conditions, only=some).runs
            if any(map(self._broken, runs)):
                return None
            last = max(last, *(each.value for run in runs for each in run.criteria if each.name == "settling_time"))
        return None if self.wound(words, conditions) else last

    def wound(self, words: Words, conditions: Conditions) -> list[Criterion]:
        """Return the criteria that words break in the nights; errors as `look`."""
        return [each for of, run in self._nights(words, conditions) for each in self._broken(run, of)]

    def _nights(self, words: Words, conditions: Conditions) -> Iterator[tuple[frozenset[str], RunResult]]:
        """Yield the runs of the nights, each with the names of the criteria that count in it."""
        for night, runs in self.nights.items():
            for run in prove(words, self.fitted_model, conditions, only=runs, night=night,
                             night_times=self.night_times).runs:
                yield frozenset(JUDGED[night]), run

    def _broken(self, proof: Proof | RunResult, of: frozenset[str] | None = None) -> list[Criterion]:
        return [criterion for criterion in proof.criteria
                if not criterion.ok and all(names is None or criterion.name in names for names in (self.names, of))]


def _beyond(criterion: Criterion) -> float:
    return max(NOTICEABLE, min(criterion.strain, _MOST) - 1.0)

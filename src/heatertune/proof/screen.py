"""Other words in the runs that words have failed: a first look, before a whole proof is worth its time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from heatertune.model.values import FittedModel
from heatertune.plc import Words
from heatertune.proof.criteria import Criterion
from heatertune.proof.fitted import prove
from heatertune.proof.prove import Proof, RunResult
from heatertune.settings import Conditions

__all__ = ["Run", "Screen"]

_MOST: Final = 10.0  # strain of a limit that is broken without end
_LEAST: Final = 1e-9  # broken is not kept, by however little

#: label of a model, setting of each switch
Run = tuple[str, Mapping[str, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Screen:
    """Runs that were failed.

    Attributes:
        fitted: the heater and its candidates.
        runs: the hardest first.
        names: of the criteria that count; None: all.
    """

    fitted: FittedModel
    runs: tuple[Run, ...] = ()
    names: frozenset[str] | None = None

    def with_failed(self, proof: Proof) -> Screen:
        """Return it with the worst run of each criterion that a proof breaks, before what is there."""
        broken = sorted(self._broken(proof), key=lambda each: -each.strain)
        runs = {run.label: (run.model, run.switches) for run in proof.runs}
        worst = dict.fromkeys(each.where for each in broken)
        new = [runs[label] for label in worst if label in runs and runs[label] not in self.runs]
        return replace(self, runs=(*new, *self.runs))

    def badness(self, words: Words, conditions: Conditions) -> float:
        """Return by how much words break the limits in these runs, as shares of them; 0: they keep all.

        The sum over the criteria, of the worst run. What is broken without end counts as tenfold.

        Raises:
            InputError, OutOfRange, UnknownName: as `prove`.
        """
        if not self.runs:
            return 0.0
        runs = prove(words, self.fitted, conditions, only=self.runs).runs
        return max(sum(_beyond(each) for each in self._broken(run)) for run in runs)

    def _broken(self, proof: Proof | RunResult) -> list[Criterion]:
        return [each for each in proof.criteria if not each.ok and (self.names is None or each.name in self.names)]


def _beyond(criterion: Criterion) -> float:
    return max(_LEAST, min(criterion.strain, _MOST) - 1.0)

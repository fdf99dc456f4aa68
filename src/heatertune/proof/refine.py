"""The last step of tuning, in the proof's own loop: limits, anti-windup, PWM and rounding as the target has them.

The linear optimum knows none of these, and the same gains can cost many times more under another anti-windup rule.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

from heatertune.errors import NotRepresentable
from heatertune.model.model_values import FittedModel
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import sensitivity_peaks
from heatertune.pid.search.robust import Open
from heatertune.plc import Words, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.design import encode, loop_fit
from heatertune.plc.word_selection import WordChoice, broken_by, realised_as
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof, prove
from heatertune.settings import Conditions
from heatertune.units import written

__all__ = ["WORTH", "refine"]

#: gains are changed only where the scenario then costs less by this share
WORTH: Final = 0.05

_STEPS: Final = (0.3, 0.15, 0.07)  # of ln K and ln TN
_MOST_ROUNDS: Final = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class _RefinementTrial:
    """Words and what they run, judged over the heaters.

    Attributes:
        broken: the criteria that they break.
        excess: by how much the worst of them, as a share of its limit.
        cost: worst IAE [°C·s].
    """

    words: Words
    design: PidDesign
    broken: frozenset[str]
    excess: float
    cost: float

    @property
    def order(self) -> tuple[float, float]:
        """What is to be least: first what is broken, then the cost."""
        return self.excess, self.cost


def refine(
    choice: WordChoice, fitted: FittedModel, conditions: Conditions | None = None, *, progress: ProgressCallback = str
) -> WordChoice:
    """Return words that keep what the proof asks for and whose IAE in its scenario is the least nearby.

    The IAE is the worst over the heaters. K and TN are changed together by factors, and only where that saves `WORTH`
    or mends a criterion. The limit on Ms stays that of the choice, and no criterion may break that
    the words to begin with keep. Each step is a whole proof: all heaters, all open points of the manual.

    Args:
        choice: the words to begin with.
        fitted: the heater and its candidates.
        conditions: of the proof.
        progress: called with a few words as each step begins.

    Raises:
        InputError, OutOfRange, UnknownName: as `prove`.
    """
    design, limit = controller_for(choice.words.target).decode(choice.words), choice.search.ms_limit
    if design is None or limit is None or math.isinf(design.integral_time_s):
        return choice.with_note("The gains were not refined: that needs a stable controller with an I part.")
    progress(f"refining the gains in the loop of {choice.words.target}")
    promise = choice.search.promise
    loop = _RefinementLoop(
        choice=choice, fitted_model=fitted, conditions=conditions, ms=max(limit, choice.search.realised.ms or limit),
        drawn=None if promise is None else Open.of(
            loop_fit(fitted, choice.words.target, choice.words.scaling), promise.way))
    first = best = loop.run(choice.words, design)
    history = {tuple(choice.words.values.items())}
    for step in _STEPS:
        for _ in range(_MOST_ROUNDS):
            tried = [loop.run(*near) for near in loop.around(best.design, step, history)]
            better = min((t for t in tried if t.broken <= first.broken), key=lambda t: t.order, default=best)
            if better.order >= best.order:
                break
            best = better
    saved = 1.0 - best.cost / first.cost
    mended = sorted(first.broken - best.broken)
    if saved < WORTH and not mended:
        return choice.with_note(f"In the simulated loop no gains nearby cost {WORTH:.0%} less IAE, so the gains were "
                                "not changed.")
    mended_text = f"; {' and '.join(mended)} is kept now" if mended else ""
    changes = (
        f"Refined in the loop of the proof, limits, anti-windup and PWM included: K by {_factor(best, first, 'gain')}, "
        f"TN by {_factor(best, first, 'time')}; the worst IAE of the scenario goes from {written(first.cost)} "
        f"to {written(best.cost)} °C·s{mended_text}."
    )
    real = realised_as(best.words, fitted, choice.search.iae_load_wished)
    return replace(choice, words=best.words,
                   search=replace(choice.search, way="refined", realised=real)).with_note(changes)


@dataclass(frozen=True, slots=True, kw_only=True)
class _RefinementLoop:
    choice: WordChoice
    fitted_model: FittedModel
    conditions: Conditions | None
    ms: float
    drawn: Open | None

    def run(self, words: Words, design: PidDesign) -> _RefinementTrial:
        proof: Proof = prove(words, self.fitted_model, self.conditions)
        cost = next(criterion.value for criterion in proof.criteria if criterion.name == "iae")
        broken = frozenset(proof.broken_criteria)
        excess = max(0.0, max(criterion.strain for criterion in proof.criteria) - 1.0)
        return _RefinementTrial(words=words, design=design, broken=broken, excess=excess, cost=cost)

    def around(self, design: PidDesign, step: float, visited: set[Any]) -> Iterator[tuple[Words, PidDesign]]:
        """Return the words a step away that are new, fit the target and keep the limit on Ms."""
        target, scaling = self.choice.words.target, self.choice.words.scaling
        plants = loop_fit(self.fitted_model, target, scaling).plants
        gain_of_cooler = None if self.conditions is None else self.conditions.cooling_gain
        for gain, time in product((-step, 0.0, step), repeat=2):
            changed = replace(
                design, gain_pct_per_degC=design.gain_pct_per_degC * math.exp(gain),
                integral_time_s=design.integral_time_s * math.exp(time),
            )
            try:
                words = with_cooling(encode(changed, target, scaling=scaling), gain_of_cooler)
            except NotRepresentable:
                continue
            key = tuple(words.values.items())
            real = controller_for(target).decode(words)
            if key in visited or real is None:
                continue
            visited.add(key)
            worst = max(sensitivity_peaks(plant, real)[0] for plant in plants)
            if worst <= self.ms and self.keeps(words):
                yield words, real

    def keeps(self, words: Words) -> bool:
        """Return whether words keep what the choice to begin with promises on drawn heaters."""
        promise = self.choice.search.promise
        return promise is None or self.drawn is None or broken_by(words, self.drawn, promise) is None


def _factor(best: _RefinementTrial, first: _RefinementTrial, what: str) -> str:
    name = "gain_pct_per_degC" if what == "gain" else "integral_time_s"
    return f"{getattr(best.design, name) / getattr(first.design, name):.3g}"

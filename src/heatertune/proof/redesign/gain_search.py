"""The gains of a design that is closed on the verdict: within a frame of changes, the cheapest that pass."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from heatertune.errors import HeatertuneError, InputError
from heatertune.pid.tune import assessed_sampled
from heatertune.plc import Scaling
from heatertune.plc.cooler import with_cooling
from heatertune.plc.design import encode, loop_fit
from heatertune.plc.word_selection import choose_words
from heatertune.proof.design_request import Candidate, DesignRequest, DesignResult
from heatertune.proof.nearest_specification import broken_names
from heatertune.proof.prove_words import tune_settings_for
from heatertune.proof.redesign.design_changes import DesignChange
from heatertune.proof.redesign.gain_points import GainFamily, GainPoint
from heatertune.proof.setpoint_ramp import BY_RAMP
from heatertune.proof.worst_runs import NOTICEABLE, RunScreen, WorstRuns

if TYPE_CHECKING:
    from heatertune.proof.redesign.redesign_search import RedesignSearch

__all__ = ["GainSearch"]

_HELPS: Final = 0.9  # of the least badness so far: where a change leaves more, no gains are looked for around it
_STEPS: Final = (0.24, 0.12, 0.06, 0.03)  # around the best place of a frame
_MOST_PROOFS: Final = 3  # whole proofs in a frame
_HALVINGS: Final = 3  # of the way from the optimum to gains that pass


@dataclass(slots=True, kw_only=True)
class GainSearch:
    """The search for gains within a frame.

    Raises:
        InputError: no gains keep the limits.
    """

    search: RedesignSearch
    frame: DesignChange
    request: DesignRequest = field(init=False)
    family: GainFamily = field(init=False)
    proofs: int = 0

    def __post_init__(self) -> None:
        self.request = asked = self.search.request_within(self.frame)
        self.family = GainFamily.of(
            self.search.first.ideal, self.search.fitted_model, tune_settings_for(asked.tune_settings, asked.conditions),
            asked.target,
            asked.scaling or Scaling())

    def cheapest(self) -> DesignResult | None:
        """Return the cheapest that passes; None where none does, or where the frame helps too little to look on."""
        search, family = self.search, self.family
        changed = self.frame != DesignChange()
        places = [family.place, *([search.place] if search.place else [])] if changed else family.places()
        looks = [] if changed or search.best else [(WorstRuns(search.least), family.place)]
        for place in places:
            looks.append((self.look(place, search.least), place))
            if looks[-1][0].badness == 0.0 and (mended := self.best_passing(place)):
                return mended
        look, place = min(looks, key=lambda pair: pair[0].badness)
        in_vain = changed and (look.badness > _HELPS * search.least or search.unwound_by_others(look, self.frame))
        return self.nearby((look.badness, place), () if in_vain else _STEPS)

    def nearby(self, best: tuple[float, GainPoint], steps: Sequence[float]) -> DesignResult | None:
        """Return what passes in ever smaller steps from the best place so far; if nothing does, what is best stays."""
        for step in steps:
            screen = self.search.screen
            for place in self.family.near(best[1], step):
                bad = self.badness(place, bound=best[0])
                if bad == 0.0 and (mended := self.best_passing(place)):
                    return mended
                best = min(best, (bad, place), key=lambda pair: pair[0])
            if self.search.screen is not screen:
                best = self.badness(best[1]), best[1]
        if best[0] < self.search.least:
            if self.search.best is None:
                self.search.calmer = self.frame
            self.search.least, self.search.place, self.search.best = *best, self
        return None

    def badness(self, place: GainPoint, *, bound: float = math.inf) -> float:
        """Return by how much the words at a place break the limits in the runs that others have failed."""
        return self.look(place, bound).badness

    def look(self, place: GainPoint, bound: float = math.inf, screen: RunScreen | None = None) -> WorstRuns:
        """Return what the words at a place break in the runs that others have failed (None), or in others."""
        design, asked = self.family.at(place), self.request
        if design is None:
            return WorstRuns(math.inf)
        try:
            words = encode(design, asked.target, scaling=asked.scaling)
            words = self.frame.on(with_cooling(words, asked.conditions.cooling_gain))
            return (screen or self.search.screen).look(words, asked.conditions, bound=bound)
        except HeatertuneError as problem:
            self.search.way_on.left_out(self.search.summary(self.frame), problem)
            return WorstRuns(math.inf)

    def keeps(self, place: GainPoint, screen: RunScreen | None = None) -> bool:
        """Return whether they keep all of them."""
        return self.look(place, NOTICEABLE, screen).badness == 0.0

    def beside_a_ramp(self) -> Iterator[GainPoint]:
        """Return what to try with a ramp: the optimum, what helped so far, and what keeps all that no ramp mends."""
        search, own = self.search, self.family.place
        yield from dict.fromkeys((own, search.place or own))
        if unled := broken_names(search.first.proof) - BY_RAMP:
            screen = RunScreen(fitted_model=search.fitted_model, names=frozenset(unled)).with_failed(search.first.proof)
            kept = next((place for place in self.family.places() if self.keeps(place, screen)), own)
            yield from dict.fromkeys((self.bisect(kept, screen), kept) if kept != own else ())

    def bisect(self, place: GainPoint, screen: RunScreen | None = None) -> GainPoint:
        """Return what still keeps them nearest to the optimum on the way to a place that does."""
        failing, passing = self.family.place, place
        for _ in range(_HALVINGS if place != failing else 0):
            between = failing.towards(passing, 0.5)
            failing, passing = (failing, between) if self.keeps(between, screen) else (between, passing)
        return passing

    def best_passing(self, place: GainPoint) -> DesignResult | None:
        """Return what passes nearest to the optimum on the way to a place, None where the whole proof fails."""
        for simpler in self.frame.without_one():
            inside = GainSearch(search=self.search, frame=simpler)
            if inside.keeps(place) and (mended := inside.best_passing(place)):
                return mended
        if self.proofs >= _MOST_PROOFS:
            return None
        self.proofs += 1
        places = dict.fromkeys((self.bisect(place), place))
        tried = (self.search.prove_design(self.frame, self.candidate(near)) for near in places)
        return next((mended for mended in tried if mended is not None), None)

    def candidate(self, place: GainPoint) -> Candidate:
        """Return the design at a place and its words.

        Raises:
            InputError: no gain keeps the limits there.
            HeatertuneError: as `choose_words`.
        """
        design, asked, fitted, first = self.family.at(place), self.request, self.search.fitted_model, self.search.first
        if design is None:
            raise InputError("no gain keeps the limits")
        if design is first.ideal and not self.search.request.refined:
            return first.ideal, replace(first.choice, words=self.frame.on(first.choice.words))
        assessed = assessed_sampled(loop_fit(fitted, asked.target, asked.scaling).plants, design)
        choice = choose_words(assessed, asked.target, fitted, scaling=asked.scaling, way=asked.words_by)
        return assessed, replace(choice, words=self.frame.on(choice.words))

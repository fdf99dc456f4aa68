"""The gains of a design that is closed on the verdict: within a frame of changes, the cheapest that pass."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from heatertune.errors import HeatertuneError, InputError
from heatertune.pid.tune import assessed_sampled
from heatertune.plc import Scaling
from heatertune.plc.choose import choose_words
from heatertune.plc.cooler import cooled
from heatertune.plc.design import encode, loop_fit
from heatertune.proof.asked import Asked, Closed, Made
from heatertune.proof.closing.frames import Frame
from heatertune.proof.closing.gains import Family, Place
from heatertune.proof.fitted import aimed
from heatertune.proof.nearest import broken_names
from heatertune.proof.screen import NOTICEABLE, Look, Screen
from heatertune.proof.setpoint_ramp import BY_RAMP

if TYPE_CHECKING:
    from heatertune.proof.closing.search import Search

__all__ = ["Within"]

_HELPS: Final = 0.9  # of the least badness so far: where a change leaves more, no gains are looked for around it
_STEPS: Final = (0.24, 0.12, 0.06, 0.03)  # around the best place of a frame
_MOST_PROOFS: Final = 3  # whole proofs in a frame
_HALVINGS: Final = 3  # of the way from the optimum to gains that pass


@dataclass(slots=True, kw_only=True)
class Within:
    """The search for gains within a frame.

    Raises:
        InputError: no gains keep the limits.
    """

    search: Search
    frame: Frame
    asked: Asked = field(init=False)
    family: Family = field(init=False)
    proofs: int = 0

    def __post_init__(self) -> None:
        self.asked = asked = self.search.framed(self.frame)
        self.family = Family.of(
            self.search.first.wished, self.search.fitted, aimed(asked.tuned, asked.conditions), asked.target,
            asked.scaling or Scaling())

    def cheapest(self) -> Closed | None:
        """Return the cheapest that passes; None where none does, or where the frame helps too little to look on."""
        search, family = self.search, self.family
        changed = self.frame != Frame()
        places = [family.place, *([search.place] if search.place else [])] if changed else family.places()
        looks = [] if changed or search.best else [(Look(search.least), family.place)]
        for place in places:
            looks.append((self.look(place, search.least), place))
            if looks[-1][0].badness == 0.0 and (mended := self.mended(place)):
                return mended
        look, place = min(looks, key=lambda pair: pair[0].badness)
        in_vain = changed and (look.badness > _HELPS * search.least or search.unwound_by_others(look, self.frame))
        return self.nearby((look.badness, place), () if in_vain else _STEPS)

    def nearby(self, best: tuple[float, Place], steps: Sequence[float]) -> Closed | None:
        """Return what passes in ever smaller steps from the best place so far; if nothing does, what is best stays."""
        for step in steps:
            screen = self.search.screen
            for place in self.family.near(best[1], step):
                bad = self.badness(place, bound=best[0])
                if bad == 0.0 and (mended := self.mended(place)):
                    return mended
                best = min(best, (bad, place), key=lambda pair: pair[0])
            if self.search.screen is not screen:
                best = self.badness(best[1]), best[1]
        if best[0] < self.search.least:
            if self.search.best is None:
                self.search.calmer = self.frame
            self.search.least, self.search.place, self.search.best = *best, self
        return None

    def badness(self, place: Place, *, bound: float = math.inf) -> float:
        """Return by how much the words at a place break the limits in the runs that others have failed."""
        return self.look(place, bound).badness

    def look(self, place: Place, bound: float = math.inf, screen: Screen | None = None) -> Look:
        """Return what the words at a place break in the runs that others have failed (None), or in others."""
        design, asked = self.family.at(place), self.asked
        if design is None:
            return Look(math.inf)
        try:
            words = encode(design, asked.target, scaling=asked.scaling)
            words = self.frame.on(cooled(words, asked.conditions.cooling_gain))
            return (screen or self.search.screen).look(words, asked.conditions, bound=bound)
        except HeatertuneError as problem:
            self.search.way_on.left_out(self.search.told(self.frame), problem)
            return Look(math.inf)

    def keeps(self, place: Place, screen: Screen | None = None) -> bool:
        """Return whether they keep all of them."""
        return self.look(place, NOTICEABLE, screen).badness == 0.0

    def beside_a_ramp(self) -> Iterator[Place]:
        """Return what to try with a ramp: the optimum, what helped so far, and what keeps all that no ramp mends."""
        search, own = self.search, self.family.place
        yield from dict.fromkeys((own, search.place or own))
        if unled := broken_names(search.first.proof) - BY_RAMP:
            screen = Screen(fitted=search.fitted, names=frozenset(unled)).with_failed(search.first.proof)
            kept = next((place for place in self.family.places() if self.keeps(place, screen)), own)
            yield from dict.fromkeys((self.halved(kept, screen), kept) if kept != own else ())

    def halved(self, place: Place, screen: Screen | None = None) -> Place:
        """Return what still keeps them nearest to the optimum on the way to a place that does."""
        failing, passing = self.family.place, place
        for _ in range(_HALVINGS if place != failing else 0):
            between = failing.towards(passing, 0.5)
            failing, passing = (failing, between) if self.keeps(between, screen) else (between, passing)
        return passing

    def mended(self, place: Place) -> Closed | None:
        """Return what passes nearest to the optimum on the way to a place, None where the whole proof fails."""
        for simpler in self.frame.without_one():
            inside = Within(search=self.search, frame=simpler)
            if inside.keeps(place) and (mended := inside.mended(place)):
                return mended
        if self.proofs >= _MOST_PROOFS:
            return None
        self.proofs += 1
        places = dict.fromkeys((self.halved(place), place))
        tried = (self.search.proven(self.frame, self.made(near)) for near in places)
        return next((mended for mended in tried if mended is not None), None)

    def made(self, place: Place) -> Made:
        """Return the design at a place and its words.

        Raises:
            InputError: no gain keeps the limits there.
            HeatertuneError: as `choose_words`.
        """
        design, asked, fitted, first = self.family.at(place), self.asked, self.search.fitted, self.search.first
        if design is None:
            raise InputError("no gain keeps the limits")
        if design is first.wished and not self.search.asked.refined:
            return first.wished, replace(first.choice, words=self.frame.on(first.choice.words))
        assessed = assessed_sampled(loop_fit(fitted, asked.target, asked.scaling).plants, design)
        choice = choose_words(assessed, asked.target, fitted, scaling=asked.scaling, way=asked.words_by)
        return assessed, replace(choice, words=self.frame.on(choice.words))

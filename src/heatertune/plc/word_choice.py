"""Words that were chosen, and how they were found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from heatertune.pid.document import promise_document
from heatertune.pid.values import Promise
from heatertune.plc import Number, Words

__all__ = ["Optimum", "RealisedResult", "WordChoice", "WordSearch"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RealisedResult:
    """What words are on the heaters; a number that is not finite, and all of a controller that is no PID, are None.

    Attributes:
        iae_load: mean load IAE [°C·s].
        gap_pct: how much more than that of the unrounded design [%].
        ms: the worst Ms.
    """

    iae_load: float | None
    gap_pct: float | None
    ms: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimum:
    """What a search over whole numbers shows, and what plain rounding would have been.

    Attributes:
        proven: whether no other words are better.
        left_open_pct: by how much others may be [%].
        rounded_words: the words of plain rounding.
        rounded: what they are on the heaters.
    """

    proven: bool
    left_open_pct: float
    rounded_words: Mapping[str, Number]
    rounded: RealisedResult


@dataclass(frozen=True, slots=True, kw_only=True)
class WordSearch:
    """How words were found.

    Attributes:
        way: "rounded", "optimum" or "refined".
        realised: what the words are on the heaters.
        ms_limit: they had to keep; None: the design itself is not stable on all heaters.
        iae_load_wished: mean load IAE of the unrounded design [°C·s]; None: without end.
        notes: one sentence each.
        optimum: what the search shows; None: the words are rounded.
        promise: what they keep on drawn heaters, too.
    """

    way: str
    realised: RealisedResult
    ms_limit: float | None
    iae_load_wished: float | None
    notes: tuple[str, ...]
    optimum: Optimum | None = None
    promise: Promise | None = None

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object."""
        document: dict[str, Any] = {
            "way": self.way, **asdict(self.realised), "ms_limit": self.ms_limit,
            "iae_load_wished": self.iae_load_wished}
        if self.optimum is not None:
            plain = self.optimum.rounded
            document |= {
                "proven": self.optimum.proven, "left_open_pct": self.optimum.left_open_pct,
                "rounded": {"words": dict(self.optimum.rounded_words), "iae_load": plain.iae_load, "ms": plain.ms,
                            "gap_pct": plain.gap_pct}}
        document["notes"] = list(self.notes)
        return document if self.promise is None else document | {"robust": promise_document(self.promise)}


@dataclass(frozen=True, slots=True, kw_only=True)
class WordChoice:
    """Words, and how they were found."""

    words: Words
    search: WordSearch

    def with_note(self, note: str) -> WordChoice:
        """Return the same with one more sentence."""
        return replace(self, search=replace(self.search, notes=(*self.search.notes, note)))

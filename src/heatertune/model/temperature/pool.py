"""The candidates of several logs of one heater, together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from heatertune.model.values import FittedModel

__all__ = ["pool_candidates"]


def pool_candidates(fitted: FittedModel, others: Sequence[FittedModel]) -> FittedModel:
    """Return the fit with the candidates of other logs of the same heater added."""
    added = tuple(candidate for other in others for candidate in other.candidates)
    if not added:
        return fitted
    logs = ", ".join(dict.fromkeys(candidate.log for candidate in added))
    note = f"Candidates of {logs}, a log of the same heater, were added: a design has to serve them too."
    ranges = [each.logged_range_degC for each in (fitted, *others)]
    known = [limits for limits in ranges if limits is not None]
    whole = (min(low for low, _ in known), max(high for _, high in known)) if known else None
    return replace(fitted, candidates=fitted.candidates + added, notes=(*fitted.notes, note), logged_range_degC=whole)

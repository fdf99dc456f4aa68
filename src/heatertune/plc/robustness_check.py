"""Whether words keep what their design promises on the heaters drawn from a fit: rounding may break it."""

from __future__ import annotations

from heatertune.errors import NotRepresentable
from heatertune.model.values import FittedModel
from heatertune.pid.search.robust import ROBUST, BrokenLimit, Open
from heatertune.pid.values import Promise
from heatertune.plc import Words, controller_for

__all__ = ["broken_by", "demand_kept"]


def broken_by(words: Words, heaters: Open, promise: Promise) -> BrokenLimit | None:
    """Return where words break a promise, None where they keep it, are no PID controller, or have no heaters."""
    design = controller_for(words.target).decode(words)
    return None if design is None else heaters.broken(promise, design)


def demand_kept(words: Words, promise: Promise, fitted: FittedModel, *, told_only: bool = False) -> str:
    """Return the sentence that tells whether words keep a promise.

    Args:
        words: what the PLC will hold.
        promise: on the heaters drawn from the fit.
        fitted: what they are drawn from.
        told_only: words that break the promise are told, not refused.

    Raises:
        NotRepresentable: the words break it.
    """
    heaters, where = Open.of(fitted, promise.way), ROBUST[promise.way]
    if not len(heaters):
        return "Whether the words keep the limits on drawn heaters cannot be told: this model has no intervals."
    broken = broken_by(words, heaters, promise)
    if broken is None:
        return f"Of the {len(heaters)} heaters drawn from the fit, {where} keep the limits with the words too."
    name, limit = broken.name.capitalize(), promise.limits[broken.name]
    if not told_only:
        raise NotRepresentable(
            f"{name} of the words on the heaters drawn from the fit ({where})", broken.value, f"<= {limit:g}",
            "a slower TA makes the words finer (--sample-time words seeks one), or loosen the limit",
        )
    return (f"Rounding breaks the limits that were asked for on the heaters drawn from the fit ({where}): {name} is "
            f"{broken.value:.4g}, {100.0 * (broken.value / limit - 1.0):.2g} % above {limit:g}.")

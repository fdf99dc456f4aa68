"""The design closed on the verdict: where the plain optimum fails, the least change that passes, or what would pass."""

from typing import TYPE_CHECKING

from heatertune.lazy import offered

if TYPE_CHECKING:
    from heatertune.proof.asked import Asked, Closed
    from heatertune.proof.closing.on_samples import closed_on_samples
    from heatertune.proof.closing.search import closed, closed_on_runs

__all__ = ["Asked", "Closed", "closed", "closed_on_runs", "closed_on_samples"]

__getattr__, __dir__ = offered(__name__, {
    "proof.asked": ("Asked", "Closed"),
    "proof.closing.on_samples": ("closed_on_samples",),
    "proof.closing.search": ("closed", "closed_on_runs"),
})

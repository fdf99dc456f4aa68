"""The design closed on the verdict: where the plain optimum fails, the least change that passes, or what would pass."""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.proof.design_request import DesignRequest, DesignResult
    from heatertune.proof.redesign.on_samples import closed_on_samples
    from heatertune.proof.redesign.redesign_search import closed_on_runs, find_passing_design

__all__ = ["DesignRequest", "DesignResult", "closed_on_runs", "closed_on_samples", "find_passing_design"]

__getattr__, __dir__ = lazy_attributes(__name__, {
    "proof.design_request": ("DesignRequest", "DesignResult"),
    "proof.redesign.on_samples": ("closed_on_samples",),
    "proof.redesign.redesign_search": ("find_passing_design", "closed_on_runs"),
})

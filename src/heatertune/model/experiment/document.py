"""The experiment to make → the JSON document that `heatertune plan` writes."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np

from heatertune.model.experiment.doublet import ExperimentPlan, best_step
from heatertune.model.experiment.prior import QUANTITIES, ExperimentSetup, Prior
from heatertune.model.experiment.relay import RelayPlan

__all__ = ["SCHEMA", "to_document"]

SCHEMA: Final = "heatertune/plan/1"

_Z95 = 1.96  # half width of a 95 % interval in standard errors


def to_document(prior: Prior, setup: ExperimentSetup, tried: list[ExperimentPlan]) -> dict[str, Any]:
    """Return the document of the experiments tried, the last of which is proposed.

    Args:
        prior: heaters that are served.
        setup: limits and aim.
        tried: as `propose` returns them.
    """
    chosen = tried[-1]
    document: dict[str, Any] = {
        "schema": SCHEMA, "kind": chosen.kind, "duration_s": chosen.duration_s,
        "conditions": asdict(setup),
        "schedule": {
            "base_pct": chosen.schedule.base_pct, "time_s": chosen.schedule.time_s,
            "power_pct": chosen.schedule.power_pct,
        },
        "highest_degC": float(chosen.peaks_degC.max()),
        "quantities": {name: _quantity(prior, chosen, i) for i, name in enumerate(QUANTITIES)},
        "worst_share": chosen.worst, "reached": chosen.worst <= setup.aim,
        "durations": [{"duration_s": proposal.duration_s, "worst_share": proposal.worst} for proposal in tried],
        "step_worst_share": best_step(prior, setup, chosen.duration_s).worst,
        "heaters": [
            {"label": label, "errors": dict(zip(QUANTITIES, errors, strict=True)), "highest_degC": peak}
            for label, errors, peak in zip(prior.models, chosen.errors, chosen.peaks_degC, strict=True)
        ],
    }
    if isinstance(chosen, RelayPlan):
        shortest, longest = float(chosen.periods_s.min()), float(chosen.periods_s.max())
        document["relay"] = asdict(chosen.relay) | {
            "on_degC": chosen.relay.on_degC, "off_degC": chosen.relay.off_degC, "rest_s": chosen.rest_s,
            "period_s": [shortest, longest],
        }
    return document


def _quantity(prior: Prior, plan: ExperimentPlan, index: int) -> dict[str, Any]:
    """Return one quantity: its range over the prior, the interval on the first heater, the worst of all."""
    values, half = prior.values[:, index], _Z95 * plan.errors[:, index]
    worst = int(np.argmax(plan.shares[:, index])) if index < plan.shares.shape[1] else int(np.argmax(half))
    return {
        "before": [float(values.min()), float(values.max())],
        "value": float(values[0]), "after": [float(values[0] - half[0]), float(values[0] + half[0])],
        "worst_half_width": float(half[worst]), "worst_on": list(prior.models)[worst],
        "worst_share": float(plan.shares[worst, index]) if index < plan.shares.shape[1] else None,
    }

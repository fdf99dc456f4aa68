"""The experiment that makes a heater known best within limits.

The figure of merit is the worst half width of a 95 % interval, as a share of its value, over gain, time constant and
dead time and over every heater of the prior.

The experiment to make → the JSON document that `heatertune plan` writes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError, UnknownName
from heatertune.model.experiment.doublet import ExperimentPlan, RelayPlan, best_step, plan_doublet, plan_relay
from heatertune.model.experiment.fisher import QUANTITIES, ExperimentSetup, Prior, demand_room

__all__ = ["KINDS", "SCHEMA", "propose", "to_document"]


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


KINDS = ("best", "doublet", "relay")

_DURATIONS = (0.25, 0.5, 0.75, 1.0)  # of the longest


def propose(
    prior: Prior, setup: ExperimentSetup, *, kind: str = "best", progress: Callable[[str], object] = str
) -> list[ExperimentPlan]:
    """Return the best experiment of each duration tried, the shortest first; the last one is the proposal.

    Durations grow until the aim is reached or the longest is used.

    Args:
        prior: heaters to serve.
        setup: limits and aim.
        kind: "doublet", "relay", or "best" of both.
        progress: told what begins.

    Raises:
        UnknownName: another kind.
        OutOfRange: a limit that the heater reaches without any experiment, or that leaves less than 0.1 % of power.
        InputError: a relay is wanted and swings on no duration for two periods on every heater.
    """
    if kind not in KINDS:
        raise UnknownName("kind of experiment", kind, KINDS)
    demand_room(prior, setup)
    plans: list[ExperimentPlan] = []
    for share in _DURATIONS:
        duration = min(setup.longest_s, setup.noise.nearest_reading(share * setup.longest_s))
        progress(f"searching the best experiment of {duration:g} s on {len(prior.models)} heaters")
        made = [] if kind == "relay" else [plan_doublet(prior, setup, duration)]
        relay = None if kind == "doublet" else plan_relay(prior, setup, duration)
        made += [] if relay is None else [relay]
        plans += sorted(made, key=lambda plan: plan.worst)[:1]
        if plans and plans[-1].worst <= setup.aim:
            break
    if not plans:
        raise InputError(
            f"no relay test swings for two periods on every heater of the prior below {setup.limit_degC:g} °C "
            f"within {setup.longest_s:g} s: raise the limit, lengthen the test, or make a doublet first"
        )
    return plans

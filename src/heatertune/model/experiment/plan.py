"""The experiment that makes a heater known best within limits.

The figure of merit is the worst half width of a 95 % interval, as a share of its value, over gain, time constant and
dead time and over every heater of the prior.
"""

from __future__ import annotations

from collections.abc import Callable

from heatertune.errors import InputError, UnknownName
from heatertune.model.experiment.doublet import ExperimentPlan, plan_doublet
from heatertune.model.experiment.prior import ExperimentSetup, Prior, demand_room
from heatertune.model.experiment.relay import plan_relay

__all__ = ["KINDS", "propose"]

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

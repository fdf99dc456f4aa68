"""What happens to many loops, as the kernel is told it: each disturbance at its instant, the earliest first."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from heatertune.proof.kernel import JUMP, LOAD, MAINS, PHASE
from heatertune.proof.scenario import Disturbance, Load, NewSetpoint, Scenario, TemperatureStep

__all__ = ["events_of"]

Array = npt.NDArray[np.float64]
Numbers = Array | float


def events_of(
    scenario: Scenario, dead_times_s: Sequence[float], sizes: Array | None = None,
    marks: Sequence[tuple[float, int]] = (),
) -> tuple[Array, npt.NDArray[np.int64], Array]:
    """Return the disturbances as three arrays of a `Batch`: instants, kinds and values, each of shape (n, events).

    Args:
        scenario: whose disturbances.
        dead_times_s: of the n heaters [s].
        sizes: by what each disturbance is multiplied, shape (n, disturbances); None: by nothing.
        marks: (instant, kind) of what divides what is measured.
    """
    dead = np.array(dead_times_s)
    factors = np.ones((len(dead), len(scenario.disturbances))) if sizes is None else sizes
    happening = zip(scenario.disturbances, _powers(scenario), factors.T, strict=True)
    acting = [event for what, power, factor in happening for event in _acting(what, power, factor, dead)]
    acting += [*((time, kind, 0.0) for time, kind in marks), (math.inf, LOAD, 0.0)]
    times, kinds, values = (np.column_stack([np.broadcast_to(each, dead.shape) for each in same])
                            for same in zip(*acting, strict=True))
    order = np.lexsort((values, kinds, times), axis=1)
    times, kinds, values = (np.take_along_axis(each, order, axis=1) for each in (times, kinds, values))
    return times, kinds.astype(np.int64), values


def _powers(scenario: Scenario) -> list[float]:
    """Return what full power is from each disturbance on, as a share of the rated one: none while the PLC is off."""
    return [mains * supplied for mains, supplied in zip(scenario.mains, scenario.supplied, strict=True)][1:]


def _acting(event: Disturbance, power: float, factor: Array, dead_s: Array) -> list[tuple[Numbers, int, Numbers]]:
    """Return what the kernels are told of a disturbance; only temperature steps and loads have a size."""
    if isinstance(event, TemperatureStep):
        return [(event.time_s, JUMP, factor * event.temperature_degC)]
    begins = (event.time_s, PHASE, 0.0)
    if isinstance(event, Load):
        return [begins, (event.time_s + dead_s, LOAD, factor * event.power_pct)]
    if isinstance(event, NewSetpoint):
        return [begins]
    return [begins, (event.time_s + dead_s, MAINS, power)]  # also of a led setpoint, with which a PLC gets its supply

"""What happens to many loops, as the kernel is told it: each disturbance at its instant, the earliest first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.proof.kernel import JUMP, LOAD, MAINS, PHASE
from heatertune.proof.scenario import Disturbance, Load, NewSetpoint, Scenario, TemperatureStep

__all__ = ["events_of"]

Array = npt.NDArray[np.float64]


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
    happening = zip(scenario.disturbances, _powers(scenario), strict=True)
    acting = [event for number, (what, power) in enumerate(happening) for event in _acting(number, what, power)]
    acting += [*(_Acting(time, kind, 0.0) for time, kind in marks), _Acting(math.inf, LOAD, 0.0)]
    begins, kind, value, late, sized = zip(*acting, strict=True)
    times = np.add(begins, np.multiply.outer(dead, late))
    values = np.broadcast_to(np.array(value), times.shape)
    if sizes is not None:
        values = values * np.column_stack([sizes, np.ones(len(dead))])[:, sized]  # behind them that of what has none
    kinds = np.broadcast_to(np.array(kind, dtype=np.int64), times.shape)
    order = np.lexsort((values, kinds, times), axis=1)
    times, kinds, values = (np.take_along_axis(each, order, axis=1) for each in (times, kinds, values))
    return times, kinds, values


class _Acting(NamedTuple):
    """What the kernels are told of: an instant [s], kind and value, and what differs from heater to heater.

    `late` is by how many dead times it is, `sized` the number of the disturbance whose size counts, −1: of none.
    """

    time_s: float
    kind: int
    value: float
    late: float = 0.0
    sized: int = -1


def _powers(scenario: Scenario) -> list[float]:
    """Return what full power is from each disturbance on, as a share of the rated one: none while the PLC is off."""
    return [mains * supplied for mains, supplied in zip(scenario.mains, scenario.supplied, strict=True)][1:]


def _acting(number: int, event: Disturbance, power: float) -> list[_Acting]:
    """Return what the kernels are told of a disturbance; temperature steps, loads and full power have a size."""
    if isinstance(event, TemperatureStep):
        return [_Acting(event.time_s, JUMP, event.temperature_degC, sized=number)]
    begins = _Acting(event.time_s, PHASE, 0.0)
    if isinstance(event, Load):
        return [begins, _Acting(event.time_s, LOAD, event.power_pct, 1.0, number)]
    if isinstance(event, NewSetpoint):
        return [begins]
    return [begins, _Acting(event.time_s, MAINS, power, 1.0, number)]  # also where a PLC gets its supply

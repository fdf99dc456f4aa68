"""A design in milliseconds, for a slider: the largest integral gain that keeps Ms on every model.

|1 + K·h|² ≥ 1/Ms² at one frequency is a quadratic in K. Its smallest positive root over all frequencies and models ends
the piece of feasible gains that begins at zero, where every heater's loop is stable. The best TN of a grid
has the largest K/TN: a load step's ∫e dt is TN/K (K. J. Åström, T. Hägglund, "Advanced PID Control", ISA
2006, MIGO design).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, UnknownName
from heatertune.model.model_values import HeaterModel
from heatertune.pid.design_values import PidDesign, Timer
from heatertune.pid.sampled_loop import frequencies, part_responses, sample_plant
from heatertune.pid.tune import STRUCTURES, settle
from heatertune.units import check

__all__ = ["quick_tune"]


_FREQUENCIES: Final = 160
_TIMES: Final = 40
_TV_OF_TN: Final = 0.25  # both zeros of the controller together: J. G. Ziegler, N. B. Nichols (1942)


def quick_tune(
    plants: Sequence[HeaterModel], *, structure: str = "pi", ms: float = 1.6, sample_time_s: float | None = None,
    timer: Timer | None = None, derivative_filter: float = 0.5,
) -> PidDesign:
    """Return the design with the largest integral gain (P: the largest gain) that keeps `ms` on every heater.

    Margins and costs are not computed. With TV = TN/4 the PID is not optimal; `heatertune.pid.tune` finds the optimum.

    Args:
        plants: the heaters to serve.
        structure: "p", "pi" or "pid".
        ms: limit of the maximum sensitivity, above 1.
        sample_time_s: TA [s]; None: TRdom/10, found together with the gains.
        timer: of the target.
        derivative_filter: of the target, see `PidDesign`.

    Raises:
        UnknownName: no such structure.
        OutOfRange: an invalid limit or interval.
        InputError: no heaters.
    """
    if structure not in STRUCTURES:
        raise UnknownName("structure", structure, STRUCTURES)
    if not plants:
        raise InputError("a design needs at least one heater")
    check("ms", ms, above=1.0)
    if sample_time_s is not None:
        check("sample_time_s", sample_time_s, above=0.0)

    sign = math.copysign(1.0, plants[0].gain_degC_per_pct)
    upright = [replace(plant, gain_degC_per_pct=sign * plant.gain_degC_per_pct) for plant in plants]

    def one_round(ta: float, before: PidDesign | None) -> PidDesign:  # noqa: ARG001 - a grid needs no start
        gain, tn = _best(upright, structure, ms, ta, derivative_filter)
        return PidDesign(
            gain_pct_per_degC=sign * gain, integral_time_s=tn, sample_time_s=ta, structure=structure,
            derivative_time_s=_TV_OF_TN * tn if structure == "pid" else 0.0, derivative_filter=derivative_filter,
            method=f"quick (largest integral gain with Ms <= {ms:g} on {len(plants)} models)",
        )

    return settle(one_round, plants, sample_time_s, timer or Timer(), str)[0]


def _best(
    plants: Sequence[HeaterModel], structure: str, ms: float, ta: float, derivative_filter: float
) -> tuple[float, float]:
    """Return K and TN; TN is infinite for a P controller."""
    slow = max(sum(plant.lags_s) + plant.dead_time_s for plant in plants)
    omega = frequencies(ta, slow, _FREQUENCIES)
    proportional, summed, difference = part_responses(omega, ta, derivative_filter)
    if structure == "p":
        times, controllers = np.array([math.inf]), proportional[None, :]
    else:
        times = np.geomspace(slow / 12.0, 3.0 * slow, _TIMES)
        rates = times[:, None] / ta
        derivative = _TV_OF_TN * rates * difference if structure == "pid" else 0.0
        controllers = proportional + summed / rates + derivative
    gains = np.full(len(times), math.inf)
    for plant in plants:
        h = sample_plant(plant, ta).frequency_response(omega) * controllers
        gains = np.minimum(gains, _end_of_first_piece(h, 1.0 - 1.0 / ms**2))
    if structure == "p":
        return float(gains[0]), math.inf
    at = int(np.argmax(gains / times))
    return float(gains[at]), float(times[at])


def _end_of_first_piece(h: npt.NDArray[np.complex128], rest: float) -> Array:
    """Return per row the smallest K > 0 with |h|²·K² + 2·Re h·K + rest = 0; infinite if it does not exist."""
    square = h.real**2 - rest * np.abs(h) ** 2
    hit = (square > 0.0) & (h.real < 0.0)
    root = np.where(hit, np.sqrt(np.maximum(square, 0.0)) - h.real, 0.0)
    ends = np.full(h.shape, math.inf)
    np.divide(rest, root, out=ends, where=hit)
    return np.asarray(ends.min(axis=1))

"""Whether the halves of a log give one heater, and how far its intervals have to be widened until they do.

Noise that a fit sees says how far the halves of a log may lie from the whole. Where a heater is not quite linear or
something else moves the temperature, they lie further, and the whole log's intervals do not hold what the next log
says. They are widened by the Birge ratio (R. T. Birge, "The calculation of errors by the method of least squares",
Phys. Rev. 40 (1932) 207–227): the root mean square of the deviations, each measured by what is expected of it. A half
that knows little is expected to lie far off, and so counts for little.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from heatertune.model.held_out import half_of, sides
from heatertune.model.intervals import RATIO
from heatertune.model.open_loop import PowerFit, PowerProblem
from heatertune.model.uncertainty import READINGS, Noise, held_squares, noise_of, value_of
from heatertune.units import NOMENCLATURE

__all__ = ["widening", "widening_notes"]

_TOLD = 1.1  # a smaller factor changes no decision
_NORMAL = float(ndtri(0.975))

Rows = npt.NDArray[np.bool_]


def widening(problem: PowerProblem, fit: PowerFit) -> dict[str, float]:
    """Return for each parameter the factor, at least 1, by which its interval has to be widened."""
    thin = problem.thinned(READINGS)
    told = thin.refined(fit.vector[None, :])
    noise = noise_of(thin, told)
    # the ambient of a half is its own: a load that began before is part of it
    values = {name: value_of(told, name) for name in noise.deviation if name != "ambient_degC"}
    surprises = [_surprises(problem, rows, values, noise) for rows in sides(problem)]
    return {name: _ratio([each[name] for each in surprises if name in each]) for name in values}


def widening_notes(factors: Mapping[str, float]) -> tuple[str, ...]:
    """Tell which intervals were widened."""
    widest = {name: factor for name, factor in factors.items() if factor > _TOLD and name != RATIO}
    if not widest:
        return ()
    told = ", ".join(f"{NOMENCLATURE[name][1]} {factor:.2g}-fold" for name, factor in widest.items())
    return (f"Intervals were widened, {told}: the halves of the log differ more than their noise explains.",)


def _ratio(squares: list[float]) -> float:
    return max(float(np.sqrt(np.mean(squares))), 1.0) if squares else 1.0


def _surprises(problem: PowerProblem, rows: Rows, values: Mapping[str, float], whole: Noise) -> dict[str, float]:
    """Return how far the whole log's values lie from those of a half, squared, 1 on average where noise is all.

    The distance is the rise of the half's sum of squares, so that a half that hardly bounds a value is not surprised.
    """
    part = half_of(problem, rows)
    found = None if part is None else part.fit()
    if part is None or found is None or found.model is None:
        return {}
    noise = noise_of(part, found)
    least = float(np.sum((part.readings.temperature_degC - found.simulated_degC) ** 2))
    normal = (_NORMAL / noise.quantile) ** 2  # a short half does not know its noise well
    surprises = {}
    for name in set(values) & set(noise.deviation):
        scale, deviation = noise.inflation[name] * noise.variance, noise.deviation[name]
        if scale > 0.0:
            apart = (float(held_squares(part, found, name, np.array([values[name]]))[0]) - least) / scale
            if not np.isfinite(apart):  # no model of the half has that value
                apart = ((values[name] - value_of(found, name)) / deviation) ** 2
            surprises[name] = max(apart, 0.0) * normal * _expected(deviation, whole.deviation[name])
    return surprises


def _expected(half: float, whole: float) -> float:
    """Return the variance of a half's value by that of its distance from the whole log's, in which it has its share.

    A half that knows more than the whole log is measured by the whole: its interval is the one to be widened.
    """
    return half**2 / max(half**2 - whole**2, whole**2)

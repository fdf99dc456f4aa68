"""Whether the halves of a log give one heater, and how far its intervals have to be widened until they do.

Noise that a fit sees says how far the halves of a log may lie from the whole. Where a heater is not quite linear or
something else moves the temperature, they lie further, and the whole log's intervals do not hold what the next log
says. They are widened by the Birge ratio (R. T. Birge, "The calculation of errors by the method of least squares",
Phys. Rev. 40 (1932) 207–227): the root mean square of the deviations, each measured by what is expected of it. A half
that knows little is expected to lie far off, and so counts for little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from heatertune.model.check_results import Half, Validation
from heatertune.model.intervals import RATIO, Interval, holds
from heatertune.model.power.cross_validation import half_of, plain_halves, sides
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.uncertainty import READINGS, ParameterNoise, bounds_of, held_squares, noise_of, value_of
from heatertune.units import NOMENCLATURE

__all__ = ["halves_notes", "interval_widening", "said_by_halves", "widening_notes"]

_TOLD = 1.1  # a smaller factor changes no decision
_TWICE = 2.0  # two halves alone say about this much less than the whole
_MOST = 10.0  # a larger one is rounding: the log holds no noise
_FOUR_OF_FIVE = NormalDist().inv_cdf(0.9) / NormalDist().inv_cdf(0.975)  # of the reach of a 95 % interval
_KNOWS = 5.0  # a half that knows a number within this factor has a say
_NORMAL = NormalDist().inv_cdf(0.975)

Rows = npt.NDArray[np.bool_]


def interval_widening(problem: PowerProblem, fit: PowerFit) -> dict[str, float]:
    """Return for each parameter the factor, 1 to 10, by which its interval has to be widened."""
    thin = problem.average(READINGS)
    refit = thin.refine(fit.vector[None, :])
    noise = noise_of(thin, refit)
    # the ambient of a half is its own: a load that began before is part of it
    values = {name: value_of(refit, name) for name in noise.deviation if name != "ambient_degC"}
    surprises = [_surprises(problem, rows, values, noise) for rows in sides(problem)]
    return {name: _ratio([surprise[name] for surprise in surprises if name in surprise]) for name in values}


def widening_notes(factors: Mapping[str, float]) -> tuple[str, ...]:
    """Tell which intervals were widened."""
    widest = {name: factor for name, factor in factors.items() if factor > _TOLD and name != RATIO}
    if not widest:
        return ()
    listed = ", ".join(f"{NOMENCLATURE[name][1]} {factor:.2g}-fold" for name, factor in widest.items())
    return (f"Intervals were widened, {listed}: the halves of the log differ more than their noise explains.",)


def said_by_halves(
    problem: PowerProblem, fit: PowerFit, validation: Validation, ci95: Mapping[str, Interval]
) -> tuple[Mapping[str, float], ...]:
    """Return the values that intervals have to hold where more than noise parts the log from its model.

    These are both ends of what each half of the log says, right four times of five; not a number where it says little.
    """
    halves = *(validation.halves or ()), *plain_halves(problem, fit, validation.halves)
    correlation = validation.input_correlation
    if (correlation is None or correlation.ok) and all(
            holds(ci95[name], value) for half in halves for name, value in half.values.items()):
        return ()
    bounds, silent = bounds_of(problem), dict.fromkeys(ci95, math.nan)
    return tuple(
        silent | {name: float(np.clip(_said(half, name, sign), *bounds[name])) for name in half.values}
        for half in halves for sign in (-1.0, 1.0))


def _said(half: Half, name: str, sign: float) -> float:
    """Return an end; of gain and time constant on a logarithmic scale: known badly, they are not known as zero."""
    value, high = half.values[name], half.ci95[name].high
    if high is None:
        return math.nan
    reach = sign * _FOUR_OF_FIVE * (high - value)
    if name == "dead_time_s":
        return value + reach
    return value * math.exp(reach / value) if high - value < math.log(_KNOWS) * value else math.nan


def halves_notes(before: Mapping[str, Interval], after: Mapping[str, Interval | None]) -> Iterator[str]:
    """Tell which intervals had to be widened to hold what each half of the log says alone."""
    widest = [NOMENCLATURE[name][1] for name, end in before.items()
              if (held := after.get(name)) is not None and _width(held) > _TWICE * _width(end)]
    if widest:
        yield f"Intervals hold what each half of the log says alone, and are wider for it: {', '.join(widest)}."


def _width(interval: Interval) -> float:
    return math.inf if interval.low is None or interval.high is None else interval.high - interval.low


def _ratio(squares: list[float]) -> float:
    return float(np.clip(np.sqrt(np.mean(squares)), 1.0, _MOST)) if squares else 1.0


def _surprises(problem: PowerProblem, rows: Rows, values: Mapping[str, float], whole: ParameterNoise) -> dict[str,
                                                                                                              float]:
    """Return how far the whole log's values lie from those of a half, squared, 1 on average where noise is all.

    The distance is the rise of the half's sum of squares, so that a half that hardly bounds a value is not surprised.
    """
    part = half_of(problem, rows)
    fit = None if part is None else part.fit()
    if part is None or fit is None or fit.model is None:
        return {}
    noise = noise_of(part, fit)
    least = float(np.sum((part.readings.temperature_degC - fit.simulated_degC) ** 2))
    normal = (_NORMAL / noise.quantile) ** 2  # a short half does not know its noise well
    surprises = {}
    for name in set(values) & set(noise.deviation):
        scale, deviation = noise.inflation[name] * noise.variance, noise.deviation[name]
        if scale > 0.0:
            apart = (float(held_squares(part, fit, name, np.array([values[name]]))[0]) - least) / scale
            if not np.isfinite(apart):  # no model of the half has that value
                apart = ((values[name] - value_of(fit, name)) / deviation) ** 2
            surprises[name] = max(apart, 0.0) * normal * _expected(deviation, whole.deviation[name])
    return surprises


def _expected(half: float, whole: float) -> float:
    """Return the variance of a half's value by that of its distance from the whole log's, in which it has its share.

    A half that knows more than the whole log is measured by the whole: its interval is the one to be widened.
    """
    return half**2 / max(half**2 - whole**2, whole**2)

"""Binary power logged slower than it switches: what was logged is on or off by chance, and not what the heater got."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.diagnostics import Remark
from heatertune.model.power.load_steps import bic_of
from heatertune.model.power.open_loop import PowerFit, PowerProblem

__all__ = ["alias_of", "alias_remarks"]

Array = npt.NDArray[np.float64]

_BINARY = 0.98  # share of the readings at one of two values
_FEWEST = 10  # switchings
_SINGLE = 0.3  # share of the switchings' runs that are one reading long: slower switching has longer ones
_WINDOWS = (5, 11, 25, 61)  # readings that the power's mean is taken over
_READINGS = 500
_SURE = 10.0  # BIC points


def alias_of(log: Log, problem: PowerProblem, fit: PowerFit) -> str:
    """Return the sentence about a binary power that switches faster than it was logged; empty where it does not.

    The temperature decides: it follows the mean of such a power over some readings better than the power as logged.

    Args:
        log: with power.
        problem: of one lag.
        fit: its best fit.
    """
    power = log.power_pct
    assert power is not None
    if not _may_be(power):
        return ""
    thin = problem.average(_READINGS)
    as_logged = bic_of(thin, thin.refine(fit.vector[None, :]))
    least, window = min((_bic_of_mean(log, problem, n), n) for n in _WINDOWS if n < len(power))
    if least > as_logged - _SURE:
        return ""
    switched = 100.0 * np.count_nonzero(np.diff(power)) / (len(power) - 1)
    spacing = float(np.median(np.diff(log.time_s)))
    return (
        f"The power is logged as {power.min():g} or {power.max():g} % alone and changes at {switched:.0f} % of the "
        f"readings, but the temperature follows its mean over about {window * spacing:.3g} s instead: it switches "
        "faster than it was logged, so what was logged is not what the heater got; log the power's mean over each "
        "interval (the controller's output), or every switching."
    )


def alias_remarks(sentence: str) -> tuple[Remark, ...]:
    """Return the finding that the sentence, unless it is empty, stands for."""
    return (Remark("alias", sentence),) if sentence else ()


def _may_be(power: Array) -> bool:
    """Return whether a power has two values and often keeps one for a single reading."""
    on = power > 0.5 * (power.min() + power.max())
    binary = np.isin(power, (power.min(), power.max()))
    switched = np.flatnonzero(np.diff(on))
    if np.mean(binary) < _BINARY or len(switched) < _FEWEST:
        return False
    return bool(np.mean(np.diff(switched) == 1) >= _SINGLE)


def _bic_of_mean(log: Log, problem: PowerProblem, count: int) -> float:
    """Return the criterion of one lag driven by the power's mean over so many readings around each."""
    assert log.power_pct is not None
    mean = _running_mean(log.power_pct, count)
    before = -0.5 * count * float(np.median(np.diff(log.time_s)))
    driven = replace(
        problem.average(_READINGS), least_dead_time_s=before,  # the mean looks ahead by half its length
        readings=replace(problem.readings, edge_s=log.time_s, level_pct=mean).average(_READINGS),
    )
    return bic_of(driven, driven.fit())


def _running_mean(values: Array, count: int) -> Array:
    """Return the mean of so many values around each; the first and last go on beyond the ends."""
    beside = np.pad(values, (count // 2, count - 1 - count // 2), mode="edge")
    first = np.cumsum(beside[:count])[-1]
    return np.cumsum(np.concatenate([[first], beside[count:] - beside[:-count]])) / count

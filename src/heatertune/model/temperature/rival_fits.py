"""Fits of other heaters to logs without power that explain them about as well as the best.

The laws are readings of one program. A controller that samples more slowly, or feeds its noise back, may fit its
own law worse than another law with another heater, by far more than the criterion's 10 points. Nor does such a log
show when its loop was closed: the onset of a heat-up shows the sum of that instant and the dead time, and only the
swing of the loop tells them apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.model.reduction import COMBINATIONS, FIELDS
from heatertune.model.temperature.closed_loop import Hypothesis, LogSegment
from heatertune.model.temperature.evidence import noise_degC
from heatertune.model.temperature.hypothesis_fits import RANDOM_STARTS, Fit, best_of, fit_at, local_optima

__all__ = ["extremes", "rival_fits"]

_OPTIMA: Final = 24  # starts of each hypothesis
_ADOPTED: Final = 3  # optima of a hypothesis that begin where its loop is closed at another instant
_AS_CLOSE: Final = 1.5  # times the smallest error
_HOPELESS: Final = 4.0  # times the smallest error, after a short descent
_ONSET: Final = 5.0  # times the noise, that a reading has left the first ones by
_EARLIER: Final = (0, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 35, 40, 45)  # scans from a closing to the onset


def rival_fits(ranked: Sequence[Fit], seed: int) -> list[Fit]:
    """Return the fits without events whose error is at most half as large again as the smallest.

    Args:
        ranked: a fit of each hypothesis.
        seed: of the random starts.
    """
    fits: list[Fit] = []
    descents: list[tuple[float, Hypothesis, Array, Fit]] = []
    for fit in filter(_is_still, ranked):
        optima = _optima(fit, seed)
        fits += optima
        descents += _other_descents(fit, optima)
    moved = _at_rest(descents, min(fit.rmse_degC for fit in (*ranked, *fits)))
    most = _AS_CLOSE * min(fit.rmse_degC for fit in (*ranked, *fits, *moved))
    near, moved = ([fit for fit in some if fit.rmse_degC <= most] for some in (fits, moved))
    return [*near, *dict.fromkeys([*sorted(moved, key=lambda fit: fit.bic)[:1], *extremes(moved)])]


def _is_still(fit: Fit) -> bool:
    """Return whether no setpoint steps."""
    return not any(segment.event for segment in fit.hypothesis.segments)


def _optima(fit: Fit, seed: int) -> list[Fit]:
    """Return the local optima of a hypothesis from many starts, the best first."""
    hypothesis = fit.hypothesis
    starts = best_of(hypothesis, hypothesis.starts(np.random.default_rng(seed), RANDOM_STARTS), _OPTIMA)
    return [fit_at(hypothesis, z, fit.hold_out_rmse_degC) for z in local_optima(hypothesis, starts, 60)]


def _other_descents(fit: Fit, optima: Sequence[Fit]) -> list[tuple[float, Hypothesis, Array, Fit]]:
    """Return error [°C], hypothesis, vectors (k, p) and fit of loops closed at other instants, a short descent away."""
    z = np.array([each.vector for each in (fit, *optima[:_ADOPTED])])
    return [(*_begin(other, _moved(fit.hypothesis, other, z)), fit) for other in _other_closings(fit.hypothesis)]


def _at_rest(descents: Sequence[tuple[float, Hypothesis, Array, Fit]], rmse_degC: float) -> list[Fit]:
    """Return the fits at rest of what was begun, where it is not far worse than the best."""
    most = _HOPELESS * min([rmse_degC, *(error for error, *_ in descents)])
    return [fit_at(hypothesis, local_optima(hypothesis, z, 60)[0], fit.hold_out_rmse_degC)
            for error, hypothesis, z, fit in descents if error <= most]


def extremes(fits: Sequence[Fit]) -> list[Fit]:
    """Return the fits with the least and the largest of each measure among those on no bound of their search."""
    inside = [fit for fit in fits if not fit.hypothesis.limits_reached(fit.vector)]
    ends: list[Fit] = []
    for measure in (FIELDS | COMBINATIONS).values():
        values = [measure(fit.hypothesis.plant(fit.vector)) for fit in inside]
        ends += [inside[int(place(values))] for place in (np.argmin, np.argmax) if values]
    return list(dict.fromkeys(ends))


def _begin(hypothesis: Hypothesis, starts: Array) -> tuple[float, Hypothesis, Array]:
    """Return the error after a short descent [°C], the hypothesis, and the vectors that were reached, (k, p)."""
    z = local_optima(hypothesis, starts, 10)
    return float(np.sqrt(hypothesis.squares(z[:1])[0] / len(hypothesis.measured))), hypothesis, z


def _other_closings(hypothesis: Hypothesis) -> Iterator[Hypothesis]:
    """Yield the hypothesis with loops that are closed long before the logs, and at instants up to their onsets."""
    yield hypothesis.closing([-1] * len(hypothesis.segments))
    onsets = [_onset(segment) for segment in hypothesis.segments]
    yield from (hypothesis.closing([max(0, onset - earlier) for onset in onsets])
                for earlier in _EARLIER if earlier < max(onsets))


def _onset(segment: LogSegment) -> int:
    """Return the scan of the last reading before the temperature leaves the first one."""
    y = segment.log.temperature_degC
    left = np.abs(y - y[0]) > _ONSET * noise_degC(segment.log)
    return int(segment.readings[max(0, int(np.argmax(left)) - 1)])


def _moved(hypothesis: Hypothesis, target: Hypothesis, z: Array) -> Array:
    """Return vectors of a hypothesis for another instant of closing: the power acts at the same one."""
    later = max(max(segment.closes, 0) for segment in target.segments) * hypothesis.segments[0].interval_s
    place = hypothesis.names.index("dead_time_s")
    z = z.copy()
    z[:, place] = np.maximum(z[:, place] - later, 0.0)
    return z

"""From a hypothesis to its best fit: random starts, a race, a descent, and the information criterion."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.model.least_squares import Residuals, minimise
from heatertune.model.statistics import ar1_bic, fit_pct
from heatertune.model.temperature.closed_loop import Hypothesis
from heatertune.model.validation import cross_rmse, hold_out_rmse

__all__ = ["EARLY", "Fit", "fit_all", "residuals_of"]

Array = npt.NDArray[np.float64]

_RANDOM, _RACERS, _FINALISTS = 1500, 12, 3
_ROUNDING = 1e-9  # of a sum of squares, many times what the order of adding up may change
_EVENT_INSTANTS = 24  # instants tried for a setpoint step
#: share of the record that the first look takes
EARLY = 0.4
_HOPELESS = 40.0  # BIC behind the leader after the race


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A hypothesis at its best.

    Attributes:
        hypothesis: what was fitted.
        vector: the unknowns, shape (p,).
        simulated_degC: its readings, shape (m,).
        fit_pct, rmse_degC, bic: how well it explains them; of several logs together, each about its own mean.
        hold_out_rmse_degC: error on the later readings of a fit to the beginning alone [°C].
        cross_rmse_degC: error on blocks left out of the fit [°C], None for what was given up on the way.
    """

    hypothesis: Hypothesis
    vector: Array
    simulated_degC: Array
    fit_pct: float
    rmse_degC: float
    bic: float
    hold_out_rmse_degC: float
    cross_rmse_degC: float | None = None


class _Beginning(NamedTuple):
    """What explains a record's beginning: vectors, BIC there, and the error on the rest [°C]."""

    vectors: Array
    bic: float
    hold_out_rmse_degC: float


def residuals_of(hypothesis: Hypothesis, measured: Array) -> Residuals:
    """Return the residual function; `measured` is one record for all rows, shape (m,), or one per row, shape (n, m)."""

    def residuals(z: Array, rows: npt.NDArray[np.intp]) -> Array:
        record = measured if measured.ndim == 1 else measured[rows]
        return hypothesis.simulate(z) - record

    return residuals


def fit_all(hypotheses: Sequence[Hypothesis], *, seed: int = 1, thorough: bool = False) -> list[Fit]:
    """Return the fit of every hypothesis that keeps up, the best by BIC first.

    Each is looked at on the record's beginning first; what explains that, races on the whole; what is not more than
    40 BIC points behind the leader there, descends to the end. The compiled loops run side by side.

    Args:
        hypotheses: on the same readings.
        seed: of the random starts.
        thorough: carry every hypothesis to the end, however far behind it is.
    """
    behind = np.inf if thorough else _HOPELESS
    forms = {hypothesis.form: hypothesis for hypothesis in hypotheses}
    with ThreadPoolExecutor(max_workers=2) as pool:
        begun = dict(zip(forms, pool.map(lambda form: _begin(forms[form], seed), forms), strict=True))
        first = min(beginning.bic for beginning in begun.values())
        able = [h for h in hypotheses if begun[h.form].bic < first + behind]
        raced = list(pool.map(lambda hypothesis: _race(hypothesis, begun[hypothesis.form], seed), able))
        leader = min(fit.bic for fit in raced)
        near = [fit.bic < leader + behind for fit in raced]
        fits = list(pool.map(lambda fit, worth: _descend(fit) if worth else fit, raced, near))
    return sorted(fits, key=lambda fit: fit.bic)


def _begin(hypothesis: Hypothesis, seed: int) -> _Beginning:
    """Return what explains the record's beginning: free of most events, and it holds the heat-up."""
    rng = np.random.default_rng(seed)
    early = hypothesis.early(EARLY)
    finalists = _descent(early, _best_of(early, early.starts(rng, _RANDOM), _RACERS), 25)[:_FINALISTS]
    error = early.measured - early.simulate(finalists[:1])[0]
    held_out = hold_out_rmse(hypothesis, early, _descent(early, finalists[:1], 60)[0])
    return _Beginning(finalists, _bic(early, error), held_out)


def _race(hypothesis: Hypothesis, beginning: _Beginning, seed: int) -> Fit:
    """Return the leader of a short race between random starts and the fits of the record's beginning."""
    rng = np.random.default_rng(seed)
    seeds = hypothesis.adopt(beginning.vectors, rng, _EVENT_INSTANTS)
    fresh = _best_of(hypothesis, _able(hypothesis, hypothesis.starts(rng, _RANDOM), _RACERS // 2), _RACERS // 2)
    leaders = _descent(hypothesis, np.concatenate([seeds, fresh]), 8)[:_RACERS]
    return _fit(hypothesis, _descent(hypothesis, leaders, 15)[0], beginning.hold_out_rmse_degC)


def _descend(fit: Fit) -> Fit:
    """Return the fit at rest; an event's instant is moved by some scans each way until that gains nothing."""
    hypothesis = fit.hypothesis
    z = _descent(hypothesis, fit.vector[None, :], 60)[0]
    for _ in range(4 * any(segment.event for segment in hypothesis.segments)):
        moved = _descent(hypothesis, hypothesis.shifted_events(z), 10)[0]
        if np.array_equal(moved, z):
            break
        z = moved
    return replace(_fit(hypothesis, z, fit.hold_out_rmse_degC), cross_rmse_degC=cross_rmse(hypothesis, z))


def _best_of(hypothesis: Hypothesis, z: Array, n: int) -> Array:
    """Return the n vectors with the smallest sums of squares, best first."""
    return np.asarray(z[np.argsort(hypothesis.squares(z), kind="stable")[:n]])


def _able(hypothesis: Hypothesis, z: Array, n: int) -> Array:
    """Return the vectors among which those n are, in their order.

    Squares only add up: what has more at the record's beginning than n others have in all is none of them.
    """
    begun = hypothesis.squares(z, EARLY)
    most = float(hypothesis.squares(z[np.argsort(begun, kind="stable")[:n]]).max())
    return np.asarray(z[begun <= most * (1.0 + _ROUNDING)])


def _descent(hypothesis: Hypothesis, starts: Array, iterations: int) -> Array:
    """Return where the starts lead to, best first."""
    residuals = residuals_of(hypothesis, hypothesis.measured)
    minima = minimise(residuals, starts, hypothesis.low, hypothesis.high, iterations=iterations)
    return np.asarray(minima.parameters[np.argsort(minima.cost, kind="stable")])


def _fit(hypothesis: Hypothesis, z: Array, hold_out_rmse_degC: float) -> Fit:
    measured, simulated = hypothesis.measured, hypothesis.simulate(z[None, :])[0]
    error = measured - simulated
    # a log's level is no merit of a model, so each log is taken about its own mean
    about_means = np.concatenate([part - part.mean() for part in hypothesis.parts(measured)])
    return Fit(
        hypothesis=hypothesis, vector=z, simulated_degC=simulated,
        fit_pct=fit_pct(about_means, about_means - error),
        rmse_degC=float(np.sqrt(np.mean(error**2))),
        bic=_bic(hypothesis, error), hold_out_rmse_degC=hold_out_rmse_degC,
    )


def _bic(hypothesis: Hypothesis, error: Array) -> float:
    """Return the BIC over all logs; the noise of each is its own."""
    alone = sum(ar1_bic(part, 0) for part in hypothesis.parts(error))
    return alone + hypothesis.unknowns * float(np.log(len(error)))

"""Fits of hypotheses to logs without power: random starts, a race, a descent, and the errors on rows left out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.model.least_squares import ResidualFunction, minimise
from heatertune.model.statistics import ar1_bic, fit_pct
from heatertune.model.temperature.closed_loop import Hypothesis

__all__ = [
    "EARLY", "RANDOM_STARTS", "Fit", "best_of", "constant_rmse", "cross_rmse", "fit_all", "fit_at", "hold_out_rmse",
    "local_optima", "residuals_of",
]

_FOLDS, _BLOCKS = 5, 20  # each fold leaves out every fifth of twenty blocks: longer than the residuals remember


#: random vectors, of which the best begin
RANDOM_STARTS = 1500
_RACERS, _FINALISTS = 12, 3
_ROUNDING = 1e-9  # of a sum of squares, many times the effect of the order of summation
_EVENT_INSTANTS = 24  # instants tried for a setpoint step
#: share of the record that the first look takes
EARLY = 0.4
_HOPELESS = 40.0  # BIC behind the leader after the race


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """The best fit of a hypothesis.

    Attributes:
        hypothesis: the fitted one.
        vector: the unknowns, shape (p,).
        simulated_degC: its readings, shape (m,).
        fit_pct, rmse_degC, bic: quality of the fit; for several logs together, each about its own mean.
        hold_out_rmse_degC: error on the later readings of a fit to the beginning alone [°C].
        cross_rmse_degC: error on omitted blocks [°C], None for a hypothesis that was dropped.
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
    """Fits to the start of a record: vectors, BIC there, and the error on the rest [°C]."""

    vectors: Array
    bic: float
    hold_out_rmse_degC: float


def residuals_of(hypothesis: Hypothesis, measured: Array) -> ResidualFunction:
    """Return the residual function; `measured` is one record for all rows, shape (m,), or one per row, shape (n, m)."""

    def residuals(z: Array, rows: npt.NDArray[np.intp]) -> Array:
        record = measured if measured.ndim == 1 else measured[rows]
        return hypothesis.simulate(z) - record

    return residuals


def fit_all(hypotheses: Sequence[Hypothesis], *, seed: int = 1, thorough: bool = False) -> list[Fit]:
    """Return the fits of all competitive hypotheses, the best by BIC first.

    Each is first fitted to the start of the record; the successful ones are fitted to the whole; those no more than 40
    BIC points behind the best are fitted to convergence. The compiled loops run in parallel.

    Args:
        hypotheses: on the same readings.
        seed: of the random starts.
        thorough: fit every hypothesis completely, even if it is far behind.
    """
    behind = np.inf if thorough else _HOPELESS
    forms = {hypothesis.form: hypothesis for hypothesis in hypotheses}
    with ThreadPoolExecutor(max_workers=2) as pool:
        beginnings = dict(zip(forms, pool.map(lambda form: _begin(forms[form], seed), forms), strict=True))
        first = min(beginning.bic for beginning in beginnings.values())
        able = [h for h in hypotheses if beginnings[h.form].bic < first + behind]
        raced = list(pool.map(lambda hypothesis: _race(hypothesis, beginnings[hypothesis.form], seed), able))
        leader = min(fit.bic for fit in raced)
        near = [fit.bic < leader + behind for fit in raced]
        fits = list(pool.map(lambda fit, worth: _descend(fit) if worth else fit, raced, near))
    return sorted(fits, key=lambda fit: fit.bic)


def _begin(hypothesis: Hypothesis, seed: int) -> _Beginning:
    """Fit the start of the record, which has few events and contains the heat-up."""
    rng = np.random.default_rng(seed)
    early = hypothesis.early(EARLY)
    finalists = local_optima(early, best_of(early, early.starts(rng, RANDOM_STARTS), _RACERS), 25)[:_FINALISTS]
    error = early.measured - early.simulate(finalists[:1])[0]
    held_out = hold_out_rmse(hypothesis, early, local_optima(early, finalists[:1], 60)[0])
    return _Beginning(finalists, _bic(early, error), held_out)


def _race(hypothesis: Hypothesis, beginning: _Beginning, seed: int) -> Fit:
    """Return the leader of a short race between random starts and the fits of the record's beginning."""
    rng = np.random.default_rng(seed)
    seeds = hypothesis.adopt(beginning.vectors, rng, _EVENT_INSTANTS)
    fresh = best_of(hypothesis, _able(hypothesis, hypothesis.starts(rng, RANDOM_STARTS), _RACERS // 2), _RACERS // 2)
    leaders = local_optima(hypothesis, np.concatenate([seeds, fresh]), 8)[:_RACERS]
    return fit_at(hypothesis, local_optima(hypothesis, leaders, 15)[0], beginning.hold_out_rmse_degC)


def _descend(fit: Fit) -> Fit:
    """Return the fit at rest; an event's instant is moved by some scans each way until that gains nothing."""
    hypothesis = fit.hypothesis
    z = local_optima(hypothesis, fit.vector[None, :], 60)[0]
    for _ in range(4 * any(segment.event for segment in hypothesis.segments)):
        moved = local_optima(hypothesis, hypothesis.shifted_events(z), 10)[0]
        if np.array_equal(moved, z):
            break
        z = moved
    return replace(fit_at(hypothesis, z, fit.hold_out_rmse_degC), cross_rmse_degC=cross_rmse(hypothesis, z))


def best_of(hypothesis: Hypothesis, z: Array, n: int) -> Array:
    """Return the n vectors with the smallest sums of squares, best first, shape (n, p)."""
    return np.asarray(z[np.argsort(hypothesis.squares(z), kind="stable")[:n]])


def _able(hypothesis: Hypothesis, z: Array, n: int) -> Array:
    """Return the vectors that can be among the n best, in order.

    Sums of squares only grow: a vector with more at the start than n others have in total is excluded.
    """
    early_squares = hypothesis.squares(z, EARLY)
    most = float(hypothesis.squares(z[np.argsort(early_squares, kind="stable")[:n]]).max())
    return np.asarray(z[early_squares <= most * (1.0 + _ROUNDING)])


def local_optima(hypothesis: Hypothesis, starts: Array, iterations: int) -> Array:
    """Return the local optima of the starts, shape (n, p), best first."""
    residuals = residuals_of(hypothesis, hypothesis.measured)
    minima = minimise(residuals, starts, hypothesis.low, hypothesis.high, iterations=iterations)
    return np.asarray(minima.parameters[np.argsort(minima.cost, kind="stable")])


def fit_at(hypothesis: Hypothesis, z: Array, hold_out_rmse_degC: float) -> Fit:
    """Rate one vector, shape (p,), of a hypothesis; the error on its later readings is given."""
    measured, simulated = hypothesis.measured, hypothesis.simulate(z[None, :])[0]
    error = measured - simulated
    # a log's level is no merit of a model, so each log is taken about its own mean
    about_means = np.concatenate([part - part.mean() for part in hypothesis.parts(measured)])
    return Fit(
        hypothesis=hypothesis, vector=z, simulated_degC=simulated, fit_pct=fit_pct(about_means, about_means - error),
        rmse_degC=float(np.sqrt(np.mean(error**2))), bic=_bic(hypothesis, error), hold_out_rmse_degC=hold_out_rmse_degC,
    )


def _bic(hypothesis: Hypothesis, error: Array) -> float:
    """Return the BIC over all logs; the noise of each is its own."""
    alone = sum(ar1_bic(part, 0) for part in hypothesis.parts(error))
    return alone + hypothesis.unknowns * float(np.log(len(error)))


def hold_out_rmse(hypothesis: Hypothesis, early: Hypothesis, vector: Array) -> float:
    """Return the error on the readings after `early`, which `vector`, shape (p,), was fitted to [°C]."""
    whole = hypothesis.without_events()
    error = whole.simulate(vector[None, :])[0] - whole.measured
    return _rms(np.concatenate(_later(hypothesis, early, error)))


def constant_rmse(hypothesis: Hypothesis, early: Hypothesis) -> float:
    """Return the error of predicting the same readings by their mean [°C]: a larger error means no predictive value."""
    return _rms(np.concatenate([part - part.mean() for part in _later(hypothesis, early, hypothesis.measured)]))


def cross_rmse(hypothesis: Hypothesis, vector: Array) -> float:
    """Return the prediction error on blocks of readings omitted from the fit, each block once [°C].

    The first block of a log is never omitted, because it defines the initial state. Each fit starts at `vector`, shape
    (p,).
    """
    measured = hypothesis.measured
    rows = [len(segment.log.time_s) for segment in hypothesis.segments]
    block = np.concatenate([np.arange(n) * _BLOCKS // n for n in rows])
    left_out = np.array([(block % _FOLDS == fold) & (block > 0) for fold in range(_FOLDS)])

    def residuals(z: Array, rows: npt.NDArray[np.intp]) -> Array:
        return np.where(left_out[rows], 0.0, hypothesis.simulate(z) - measured)

    starts = np.repeat(vector[None, :], _FOLDS, axis=0)
    refits = minimise(residuals, starts, hypothesis.low, hypothesis.high, iterations=15).parameters
    return _rms((hypothesis.simulate(refits) - measured)[left_out])


def _later(hypothesis: Hypothesis, early: Hypothesis, values: Array) -> list[Array]:
    """Return each log's part of the values after its beginning, of the logs that have any."""
    early_lengths = [len(segment.log.time_s) for segment in early.segments]
    parts = zip(hypothesis.parts(values), early_lengths, strict=True)
    return [part[n:] for part, n in parts if len(part) > n] or [np.full(1, np.nan)]


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))

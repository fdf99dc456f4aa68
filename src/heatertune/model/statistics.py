"""Statistics of residuals: goodness of fit, correlation, information criterion, resampling.

Also one-sided and open intervals, and intervals from resampled values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import OutOfRange

__all__ = [
    "LJUNG_BOX_95",
    "PERIOD",
    "RATIO",
    "Interval",
    "ar1_bic",
    "ar1_weighted",
    "autocorrelation",
    "block_resamples",
    "envelope",
    "fit_pct",
    "holds",
    "hull",
    "identified_interval",
    "identified_parts",
    "interval",
    "ljung_box",
    "long_run_noise",
    "percentile_interval",
    "student_t",
]


#: 95 % point of χ² with 20 degrees of freedom
LJUNG_BOX_95: Final = 31.41


def fit_pct(measured: Array, simulated: Array) -> float:
    """Return 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) of readings y and simulated ŷ, both shape (n,) [%]."""
    return float(100.0 * (1.0 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - measured.mean())))


_MOST_CORRELATION: Final = 0.99
_LEAST_NOISE: Final = 1e-6  # of the span


def autocorrelation(residuals: Array, lags: int = 20) -> Array:
    """Return the sample autocorrelation at lags 1…`lags`, shape (lags,)."""
    e = residuals - residuals.mean()
    power = float(e @ e)
    lags = min(lags, len(e) - 1)
    return np.array([float(e[lag:] @ e[:-lag]) / power if power else 0.0 for lag in range(1, lags + 1)])


def long_run_noise(measured: Array, simulated: Array) -> float:
    """Return the deviation that white noise of the same size in the long run would have; both of shape (n,).

    It is at least a millionth of the span: a log made without noise does not outweigh all others without limit.
    """
    left = measured - simulated
    rho = float(np.clip(autocorrelation(left, 1)[0], 0.0, _MOST_CORRELATION))
    return max(float(np.std(left)) * float(np.sqrt((1.0 + rho) / (1.0 - rho))), _LEAST_NOISE * float(np.ptp(measured)))


def ar1_bic(residuals: Array, unknowns: int) -> float:
    """Return the Bayesian information criterion of residuals, shape (n,), with first-order autoregressive errors.

    n·ln(variance of the innovations) + (unknowns + 1)·ln n: heater residuals are strongly coloured, and a white-noise
    criterion would let every extra parameter in.
    """
    n = len(residuals)
    power = float(residuals @ residuals)
    rho = float(residuals[1:] @ residuals[:-1]) / power if power else 0.0
    innovations = residuals[1:] - rho * residuals[:-1]
    variance = max(float(innovations @ innovations) / n, 1e-12)
    return n * float(np.log(variance)) + (unknowns + 1) * float(np.log(n))


def ar1_weighted(rows: Array, rho: Array | float) -> Array:
    """Return Σⱼ ρ^|i−j|·rowⱼ, rows of shape (…, m) times the correlation of first-order autoregressive noise.

    Each way the sum over k of ρᵏ and a shift by k is Π (1 + ρ^(2ⁿ) and a shift by 2ⁿ): a few passes, and no matrix.
    `rho` is a number below 1 or broadcasts with the rows.
    """

    def one_way(values: Array) -> Array:
        total, weight, shift = values + 0.0 * rho, np.asarray(rho, dtype=np.float64), 1
        while shift < total.shape[-1]:
            total[..., shift:] += weight * total[..., :-shift]
            weight, shift = weight**2, 2 * shift
        return np.asarray(total)

    return np.asarray(one_way(rows) + one_way(rows[..., ::-1])[..., ::-1] - rows)


def block_resamples(residuals: Array, n: int, rng: np.random.Generator) -> Array:
    """Return n circular block resamples of the residuals, shape (n, m).

    Blocks keep the correlation (H. R. Künsch, "The jackknife and the bootstrap for general stationary
    observations", Ann. Statist. 17 (1989) 1217–1241). Their length is where the autocorrelation first falls
    below 1/e, times three, at least 5 and at most a fifth of the record.
    """
    m = len(residuals)
    centred = residuals - residuals.mean()
    correlation = autocorrelation(residuals, m // 5)
    below = np.flatnonzero(correlation < np.exp(-1.0))
    length = int(np.clip(3 * (below[0] + 1 if len(below) else m), 5, max(5, m // 5)))
    starts = rng.integers(0, m, (n, -(-m // length)))
    index = (starts[:, :, None] + np.arange(length)) % m
    return np.asarray(centred[index.reshape(n, -1)[:, :m]])


def percentile_interval(values: Array) -> tuple[float, float]:
    """Return the ends of the central 95 % of the values, shape (n,)."""
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def share_bounds(passing_count: int, count: int) -> tuple[float, float]:
    """Return lower and upper bound of a proportion, from `passing_count` of `count` samples.

    Each bound holds with 95 % confidence, exactly (C. J. Clopper and E. S. Pearson, "The use of confidence or fiducial
    limits illustrated in the case of the binomial", Biometrika 26 (1934) 404–413); NaN if not applicable.
    """
    from scipy.special import betaincinv

    least = 0.0 if passing_count == 0 else float(betaincinv(passing_count, count - passing_count + 1, 0.05))
    return least, 1.0 if passing_count == count else float(betaincinv(passing_count + 1, count - passing_count, 0.95))


def student_t(freedom: float) -> float:
    """Return the 97.5 % point of Student's t with so many degrees of freedom, not necessarily whole."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.975))


#: name of the combination that is identified if gain and time constant are not
RATIO = "gain_per_time_constant_degC_per_s_pct"

#: name of the period at which the heater lags by half a turn
PERIOD = "ultimate_period_s"

_WIDE = 0.3  # an interval wider than ±30 % of its centre identifies nothing


def interval(values: Array, low: float, high: float) -> Interval:
    """Return the central 95 % of resampled values, shape (n,); an end on a bound of the search is open (None).

    Values that are not finite are ignored; if there are no others, both ends are open.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return Interval(low=None, high=None)
    lower, upper = percentile_interval(known)
    margin = 1e-9 * (high - low) if np.isfinite(high - low) else 0.0
    return Interval(low=None if lower <= low + margin else lower, high=None if upper >= high - margin else upper)


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A 95 % confidence interval; an end that lies on a bound of the search is open and None."""

    low: float | None
    high: float | None

    def __post_init__(self) -> None:
        if self.low is not None and self.high is not None and self.low > self.high:
            raise OutOfRange("low", self.low, f"<= high = {self.high:g}")


def envelope(parts: Interval, values: list[float]) -> Interval:
    """Return the interval widened until it holds every value."""
    low = None if parts.low is None else min(parts.low, *values)
    high = None if parts.high is None else max(parts.high, *values)
    return Interval(low=low, high=high)


def hull(first: Interval, second: Interval) -> Interval:
    """Return the narrowest interval that holds both; an end that is open in one stays open."""
    low = None if first.low is None or second.low is None else min(first.low, second.low)
    high = None if first.high is None or second.high is None else max(first.high, second.high)
    return Interval(low=low, high=high)


def holds(interval: Interval, value: float) -> bool:
    """Return whether an interval holds a value."""
    return (interval.low is None or value >= interval.low) and (interval.high is None or value <= interval.high)


def identified_parts(ci95: Interval | None) -> bool:
    """Return whether an interval is closed and no wider than ±30 % of its centre."""
    if ci95 is None or ci95.low is None or ci95.high is None:
        return False
    return ci95.high - ci95.low <= _WIDE * abs(ci95.high + ci95.low)


def identified_interval(ci95: Interval) -> Interval | None:
    """Return the interval, or None if it identifies nothing."""
    return ci95 if identified_parts(ci95) else None


def ljung_box(residuals: Array, lags: int = 20) -> float:
    """Return n(n + 2)·Σ ρₖ²/(n − k) over the lags; white residuals stay below `LJUNG_BOX_95` in 95 of 100 logs.

    G. M. Ljung and G. E. P. Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978) 297–303.
    The residuals are of shape (n,).
    """
    n = len(residuals)
    rho = autocorrelation(residuals, lags)
    return float(n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, len(rho) + 1))))

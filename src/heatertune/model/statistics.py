"""What residuals say: goodness of fit, correlation, information criterion, resampling."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = [
    "ar1_bic", "ar1_weighted", "autocorrelation", "block_resamples", "fit_pct", "percentile_interval", "student_t",
]

Array = npt.NDArray[np.float64]


def fit_pct(measured: Array, simulated: Array) -> float:
    """Return 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) of readings y and simulated ŷ, both shape (n,) [%]."""
    return float(100.0 * (1.0 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - measured.mean())))


def autocorrelation(residuals: Array, lags: int = 20) -> Array:
    """Return the sample autocorrelation at lags 1…`lags`, shape (lags,)."""
    e = residuals - residuals.mean()
    power = float(e @ e)
    lags = min(lags, len(e) - 1)
    return np.array([float(e[lag:] @ e[:-lag]) / power if power else 0.0 for lag in range(1, lags + 1)])


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


def share_bounds(kept: int, count: int) -> tuple[float, float]:
    """Return what share of all at least, and at most, is of a kind of which `kept` of `count` draws are.

    Each bound holds with 95 % confidence, exactly (C. J. Clopper and E. S. Pearson, "The use of confidence or fiducial
    limits illustrated in the case of the binomial", Biometrika 26 (1934) 404–413); not a number where none is meant.
    """
    from scipy.special import betaincinv  # noqa: PLC0415 - as below

    least = 0.0 if kept == 0 else float(betaincinv(kept, count - kept + 1, 0.05))
    return least, 1.0 if kept == count else float(betaincinv(kept + 1, count - kept, 0.95))


def student_t(freedom: float) -> float:
    """Return the 97.5 % point of Student's t with so many degrees of freedom, not necessarily whole."""
    from scipy.special import stdtrit  # noqa: PLC0415 - a tenth of a second, which no log without power needs

    return float(stdtrit(freedom, 0.975))

"""Statistics of readings and residuals: outliers, goodness of fit, correlation, information criterion, resampling.

Each residual is compared with the running median of the residuals, in robust standard deviations (L. Davies and U.
Gather, "The identification of multiple outliers", J. Am. Stat. Assoc. 88 (1993) 782–792). An outlier is replaced by the
value of its neighbours, and the least-squares fit is repeated. It must also deviate from the neighbouring readings: a
stretch that the model cannot follow for a while is not an outlier.

Also the first disturbance of a log, as a model has to explain the part before it; the stretches in which its controller
gives no power; one-sided and open intervals, and intervals from resampled values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import OutOfRange
from heatertune.log.log_values import MIN_SAMPLES, Log

__all__ = [
    "LJUNG_BOX_95", "PERIOD", "RATIO", "SWITCHED_OFF", "Interval", "ar1_bic", "ar1_weighted", "autocorrelation",
    "block_resamples", "disturbance_s", "envelope", "fit_pct", "holds", "hull", "identified_interval",
    "identified_parts", "interruption_note", "interval", "ljung_box", "long_run_noise", "percentile_interval",
    "replace_outliers", "rescale", "sensor_step", "student_t", "undisturbed_part", "without_outliers",
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
    finite = values[np.isfinite(values)]
    if not len(finite):
        return Interval(low=None, high=None)
    lower, upper = percentile_interval(finite)
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


def rescale(interval: Interval, factor: float, shift: float = 0.0) -> Interval:
    """Return the interval times a positive factor, with both ends shifted; an open end stays open."""
    low, high = (None if end is None else factor * end + shift for end in (interval.low, interval.high))
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


#: of the span: no overshoot of a usable loop is followed by such a fall without a rise after it
SWITCHED_OFF: Final = 0.35


_NEIGHBOURS = 11  # readings of the running median: up to five consecutive outliers are detected
_COMMON = 0.05  # share of the readings: more frequent deviations are the model's fault, not the sensor's
_LIMIT = 6.0  # standard deviations: fewer than one in 100 million normal readings deviates more
_WILD = 0.1
_FEW_VALUES = 0.5  # of the readings: a column with more distinct values does not count as quantised


def without_outliers(
    measured: Array, simulated: Array, begun: npt.NDArray[np.intp] | None = None
) -> tuple[Array, npt.NDArray[np.intp]]:
    """Return the readings with outliers put where their neighbours are [°C], and the outliers' places.

    `begun`: places of the first readings of later segments, shape (k,); no reading has its neighbours across such a
    place. Readings are of shape (n,), the outliers' places of shape (o,).
    """
    residuals = measured - simulated
    off = residuals - _medians(residuals, begun)
    deviation = 1.4826 * float(np.median(np.abs(off)))
    # the error of a rounded reading is uniform: its standard deviation is the step over the root of 12
    step = sensor_step(measured) or 0.0
    limit = _LIMIT * max(deviation, step / np.sqrt(12.0), 1e-6 * float(np.ptp(simulated)))
    odd: npt.NDArray[np.bool_] = (np.abs(off) > limit) & (np.abs(measured - _medians(measured, begun)) > limit)
    if np.mean(odd) > _COMMON:
        odd = np.zeros(len(odd), dtype=np.bool_)
    return np.where(odd, measured - off, measured), np.flatnonzero(odd)


def replace_outliers(measured: Array, neighbours: int = _NEIGHBOURS, share: float = _WILD) -> Array:
    """Return the readings with outliers, off by this fraction of the span, replaced by their neighbours [°C].

    Up to half of this number of neighbours may be consecutive outliers. All readings are of shape (n,).
    """
    smooth = _median(measured, neighbours)
    return np.where(np.abs(measured - smooth) > share * float(np.ptp(smooth)), smooth, measured)


def _medians(values: Array, begun: npt.NDArray[np.intp] | None) -> Array:
    return np.concatenate([_median(part) for part in np.split(values, [] if begun is None else begun)])


def _median(values: Array, neighbours: int = _NEIGHBOURS) -> Array:
    extension = np.pad(values, (neighbours // 2, neighbours - 1 - neighbours // 2), mode="edge")
    # for an even number the upper of the middle two, as SciPy's median_filter, whose import takes longer than this
    windows = np.lib.stride_tricks.sliding_window_view(extension, neighbours)
    return np.partition(windows, neighbours // 2)[:, neighbours // 2]


def sensor_step(measured: Array) -> float | None:
    """Return the resolution of the sensor's readings [°C], None if they have no common step.

    The step is the smallest difference between two values; nearly all others have to be integer multiples of it. The
    readings are of shape (n,).
    """
    values = np.unique(np.round(measured, 6))
    if len(values) < 3 or len(values) > _FEW_VALUES * len(measured):
        return None
    between = np.diff(values)
    step = float(np.median(between[between < 1.5 * between.min()]))
    multiples = between / step
    whole = np.abs(multiples - np.rint(multiples)) < 0.1 * np.maximum(multiples, 1.0)
    return step if np.mean(whole) > 0.9 else None


_SHARE = 0.1  # of the log's span: a jump no heater makes between two readings
_SPIKE = 5  # neighbours of a reading: two odd ones in a row are a spike, three a disturbance that is over soon
_ABSURD = 0.5  # of the span: no disturbance leaves so far and comes back within a few readings
_TIMES = 10.0  # the usual departure from the neighbouring slopes


def disturbance_s(log: Log) -> float | None:
    """Return the instant of the last reading before the first jump [s], None without one.

    A jump deviates from the median slope of its neighbours by more than a tenth of the log's span and by more than ten
    times the usual deviation. Jumps within the first 20 readings are ignored: they would leave too little to fit. Two
    outliers that return are not a jump.
    """
    readings = replace_outliers(replace_outliers(log.temperature_degC, share=_ABSURD), _SPIKE)
    departure = _departures(readings)
    # of the original log: in pure noise, limited readings look quieter than they are
    typical = 1.4826 * float(np.median(_departures(log.temperature_degC)))
    threshold = max(_SHARE * float(np.ptp(readings)), _TIMES * typical)
    jumps = np.flatnonzero(departure > threshold)
    jumps = jumps[jumps >= MIN_SAMPLES]
    return float(log.time_s[jumps[0]]) if len(jumps) else None


def _departures(readings: Array) -> Array:
    """Return the deviation of each slope from the median of its neighbours."""
    change = np.diff(readings)
    padded = np.pad(change, 3, mode="edge")
    return np.asarray(np.abs(change - np.median(np.lib.stride_tricks.sliding_window_view(padded, 7), axis=1)))


def undisturbed_part(log: Log) -> tuple[Log, tuple[str, ...]]:
    """Return the log up to its first disturbance, and a sentence about any omitted part."""
    end = disturbance_s(log)
    if end is None:
        return log, ()
    left = int(np.count_nonzero(log.time_s > end))
    return log.window(float(log.time_s[0]), end), (
        f"The temperature jumps after {end:g} s; the {left} readings from there on were left out of the fit.",
    )


def _longest_part(time_s: Array, stretches: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Return first and last row of the longest part of a log outside stretches, each from its first row to its last.

    Args:
        time_s: of all rows, shape (n,) [s].
        stretches: in order.
    """
    firsts = [0, *(last for _, last in stretches)]
    lasts = [*(first for first, _ in stretches), len(time_s) - 1]
    return max(zip(firsts, lasts, strict=True), key=lambda part: float(time_s[part[1]] - time_s[part[0]]))


def _part_flags(time_s: Array, part: tuple[int, int]) -> str:
    """Return the options that leave only a part of a log, from its first row to its last."""
    first, last = part
    flags = [f"--from {time_s[first]:.10g}"] if first else []
    return " ".join([*flags, *([f"--until {time_s[last]:.10g}"] if last < len(time_s) - 1 else [])])


def interruption_note(log: Log) -> str:
    """Return the advice about stretches without power in a loop, through which the temperature falls far; or nothing.

    Args:
        log: of a closed loop, with power.
    """
    power, y, time = log.power_pct, log.temperature_degC, log.time_s
    assert power is not None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], power <= max(0.0, float(power.min())), [False]])))
    rests = [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2] - 1, strict=True) if first]
    far = SWITCHED_OFF * float(np.ptp(y))
    falls = [(first, last) for first, last in rests if y[first] - y[last] > far]
    if not falls:
        return ""
    places = ", ".join(f"from {time[first]:.4g} to {time[last]:.4g} s" for first, last in falls)
    return (f" It gives no power {places} while the temperature falls: its setpoint was lowered, or it was reset or "
            f"switched off. The fit uses that; {_part_flags(time, _longest_part(time, falls))} leaves the longest part "
            "without it.")

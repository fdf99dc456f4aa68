"""What acts on the temperature next to the heater: a cooler's power, a fan that multiplies the loss, a moving room.

A fan or a flow that multiplies the heat loss: found by the log, and taken out of its readings.

dx/dt = (k·u(t − L) − (1 + m·f(t − L′))·x)/T above ambient, with a second lag behind it, f from 0 at the calm level to 1
at the strong one. Against it stand the same heater without the effect, and with f as equivalent power. For given lags,
delays and m the readings are linear in the rest (variable projection); the interval of m is that of the linearised
problem with AR(1) errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.log.log_values import Log, LogSignal
from heatertune.model.diagnostics import Remark, findings_of
from heatertune.model.disturbance import CoolingEffect, DisturbanceEffect, LossEffect
from heatertune.model.model_values import Candidate, FittedModel, HeaterModel
from heatertune.model.power.disturbance_fit import TAILS_PCT, ar1_covariance, cooling_effect, without_disturbance
from heatertune.model.statistics import Interval, ar1_bic, hull
from heatertune.model.temperature.closed_loop import Bounds

__all__ = ["cleared", "fit_two_way", "in_its_room", "with_loss", "without_loss"]


_GRID: Final = 2000  # intervals of the simulation
_READINGS: Final = 400  # averaged, of the search
_NORMAL: Final = 1.96  # of a 95 % interval
_SURE: Final = 10.0  # BIC points
_FAR: Final = 3.0  # times the log's length: the longest lag
_SMALL: Final = 1e-4  # step of a difference quotient, of the unknown's range
_LEAST, _MOST = 0.02, 40.0  # of m


class _Inputs(NamedTuple):
    """Power and fan, 0…1, as running sums over a uniform grid, and how many of its intervals a reading averages."""

    time_s: Array
    energy: Array
    blown: Array
    merged: int
    measured: Array
    length_s: float


class _LossSolution(NamedTuple):
    """A least-squares solution: lag, dead time, ratio of the lags, delay of the fan [s], ln m; the linear part."""

    z: Array
    linear: Array
    residuals: Array
    bic: float


def without_loss(log: Log, name: str, side: LogSignal) -> tuple[Log, LossEffect] | None:
    """Return a log as if a fan had always been at its calm level, and the effect; None if the loss is not multiplied.

    Args:
        log: with power.
        name: of the fan, for messages.
        side: its level.
    """
    calm, strong = np.percentile(side.at(log.time_s), TAILS_PCT).tolist()
    if not strong > calm:
        return None
    inputs = _inputs(log, side._replace(values=np.clip((side.values - calm) / (strong - calm), 0.0, 1.0)))
    none, load, loss = (_searched(inputs, kind) for kind in ("none", "load", "loss"))
    if loss.bic > min(load.bic, none.bic) - _SURE or loss.linear[0] <= 0.0:
        return None
    factor, spread = math.exp(loss.z[4]), _spread(inputs, loss)
    effect = LossEffect(
        column=name, factor=factor, factor_ci95=(factor * math.exp(-spread), factor * math.exp(spread)), calm=calm,
        strong=strong, delta_bic=none.bic - loss.bic, delta_bic_as_power=load.bic - loss.bic)
    still = inputs._replace(blown=np.zeros(len(inputs.blown)))
    moved = (_columns(inputs, loss.z, "loss", whole=True) - _columns(still, loss.z, "loss", whole=True)) @ loss.linear
    middle = inputs.time_s[:-1] + 0.5 * np.diff(inputs.time_s)
    return log.with_rows(temperature_degC=log.temperature_degC - np.interp(log.time_s, middle, moved)), effect


def _inputs(log: Log, side: LogSignal) -> _Inputs:
    """Return the held signals on a uniform grid, finer than the readings where these are few."""
    time = log.time_s - log.time_s[0]
    count = max(_READINGS, min(_GRID, len(time)) // _READINGS * _READINGS)
    grid = np.linspace(0.0, time[-1], count + 1)
    steps = np.diff(time)
    sums = [signal.integral(grid, log.time_s[0]) for signal in (log.signals["power"], side)]
    readings = np.concatenate([[0.0], np.cumsum(0.5 * (log.temperature_degC[1:] + log.temperature_degC[:-1]) * steps)])
    ends = grid[:: count // _READINGS]
    measured = np.diff(np.interp(ends, time, readings)) / np.diff(ends)
    return _Inputs(log.time_s[0] + grid, sums[0], sums[1], count // _READINGS, measured, float(time[-1]))


def _mean(sums: Array, time: Array, delay: float) -> Array:
    """Return the mean of a held signal over each interval, so much earlier; before the log it is as at its start."""
    since, rate = time - time[0] - delay, (sums[1] - sums[0]) / (time[1] - time[0])
    total = np.interp(since, time - time[0], sums) + np.minimum(since, 0.0) * rate
    return np.asarray(np.diff(total) / np.diff(time))


def _simulate(step: float, lag: float, second: float, power: Array, side: Array, fan: Array, out: Array) -> None:
    """Fill out (4, n): what power, fan as power, and the two initial states do, as means over the intervals."""
    for row in range(4):
        x = 1.0 if row == 2 else 0.0
        y = 1.0 if row == 3 else 0.0
        for i in range(len(power)):
            rate = (1.0 + side[i]) / lag
            drive = power[i] if row == 0 else fan[i] if row == 1 else 0.0
            end = drive / (1.0 + side[i])
            fast, slow = math.exp(-rate * step), math.exp(-step / second)
            apart = 1.0 - rate * second
            if abs(apart) < 1e-6:
                apart = 1e-6
            later = end + (y - end) * slow + (x - end) * (fast - slow) / apart
            out[row, i] = 0.5 * (y + later)
            x = end + (x - end) * fast
            y = later


def _columns(inputs: _Inputs, z: Array, kind: str, *, whole: bool = False) -> Array:
    """Return the columns of the linear part, shape (readings, 4 or 5), or over the whole grid."""
    lag, dead, ratio, delay = math.exp(z[0]), z[1], z[2], z[3]
    power = _mean(inputs.energy, inputs.time_s, dead)
    fan = _mean(inputs.blown, inputs.time_s, delay)
    out = np.empty((4, len(power)))
    side = math.exp(z[4]) * fan if kind == "loss" else np.zeros(len(fan))
    compile_function(_simulate)(float(inputs.time_s[1] - inputs.time_s[0]), lag, ratio * lag, power, side, fan, out)
    means = out if whole else out.reshape(4, -1, inputs.merged).mean(axis=2)
    rows = [means[0], np.ones(means.shape[1]), means[2], means[3]] + ([means[1]] if kind == "load" else [])
    return np.column_stack(rows)


def _searched(inputs: _Inputs, kind: str) -> _LossSolution:
    """Return the best fit of a kind: "none", "load" (the fan as power) or "loss" (it multiplies the loss)."""
    from scipy.optimize import least_squares

    shortest = inputs.length_s / _READINGS
    bounds = np.array([(math.log(shortest), math.log(_FAR * inputs.length_s)), (0.0, inputs.length_s / 4.0),
                       (0.01, 0.98), (0.0, inputs.length_s / 4.0), (math.log(_LEAST), math.log(_MOST))])
    free = {"none": [0, 1, 2], "load": [0, 1, 2, 3], "loss": [0, 1, 2, 3, 4]}[kind]

    def full(part: Array, start: Array) -> Array:
        z = start.copy()
        z[free] = part
        return z

    def left(part: Array, start: Array) -> Array:
        columns = _columns(inputs, full(part, start), kind)
        return np.asarray(columns @ np.linalg.lstsq(columns, inputs.measured, rcond=None)[0] - inputs.measured)

    starts = sorted(_starts(bounds), key=lambda z: float(np.sum(left(z[free], z) ** 2)))[:3]
    tried = [(least_squares(left, z[free], bounds=bounds[free].T, x_scale=np.ptp(bounds[free], axis=1), max_nfev=60,
                            args=(z,)), z) for z in starts]
    best, start = min(tried, key=lambda pair: float(pair[0].cost))
    z = full(best.x, start)
    columns = _columns(inputs, z, kind)
    linear = np.asarray(np.linalg.lstsq(columns, inputs.measured, rcond=None)[0], dtype=np.float64)
    residuals = np.asarray(columns @ linear - inputs.measured)
    return _LossSolution(z, linear, residuals, ar1_bic(residuals, len(free) + columns.shape[1]))


def _starts(bounds: Array) -> Iterator[Array]:
    for lag in np.linspace(bounds[0, 0], bounds[0, 1], 9)[1:-1]:
        for dead in (0.005, 0.05, 0.2):
            for ratio in (0.02, 0.3):
                for size in (0.3, 2.0):
                    yield np.array([lag, dead * bounds[1, 1], ratio, dead * bounds[3, 1], math.log(size)])


def _spread(inputs: _Inputs, fit: _LossSolution) -> float:
    """Return half the 95 % interval of ln m."""
    base = _columns(inputs, fit.z, "loss")
    slopes = []
    for place in range(len(fit.z)):
        moved = fit.z.copy()
        size = _SMALL * max(abs(moved[place]), 1.0 if place != 2 else 0.1)
        moved[place] += size
        slopes.append((_columns(inputs, moved, "loss") - base) @ fit.linear / size)
    matrix = np.column_stack([*slopes, base])
    norms = np.linalg.norm(matrix, axis=0)
    norms[norms == 0.0] = 1.0
    covariance = ar1_covariance(matrix / norms, fit.residuals) / np.outer(norms, norms)
    return min(_NORMAL * math.sqrt(max(float(covariance[4, 4]), 0.0)), 5.0)


_SENSOR_DEGC: Final = 1.0  # error of a room's sensor, and of its place
_MOVES: Final = 0.03  # of the span of the readings: a room that moves by more is fitted


def cleared(log: Log) -> tuple[Log, DisturbanceEffect | None, LossEffect | None]:
    """Return a log without the effect of its disturbance, and this effect: as power, or on the heat loss.

    Raises:
        InputError: as `without_disturbance`.
    """
    assert log.disturbance is not None
    name = ("disturbance" if log.taken is None else log.taken.columns["disturbance"][0]).strip("'")
    log.demand_heater_alone(f"and {name!r} acts next to it: leave the latter out (--disturbance-column none) where it "
                            "does not change, or log a step of each alone")
    multiplied = without_loss(log, name, log.signals["disturbance"])
    if multiplied is not None:
        return multiplied[0].with_rows(disturbance=None), None, multiplied[1]
    return *without_disturbance(log), None


def in_its_room(log: Log, bounds: Bounds | None) -> tuple[Log, Bounds | None, tuple[str, ...]]:
    """Return a log as if its room had kept one temperature, the bounds of that, and what was done.

    Args:
        log: with power.
        bounds: the ambient as the user states it, which counts; None: as the log has it.
    """
    column, room, log = log.signals.get("ambient"), log.ambient_degC, log.with_rows(ambient_degC=None)
    if column is None or room is None:
        return log, bounds, ()
    low, high = np.percentile(room, TAILS_PCT).tolist()
    if bounds is not None or high + _SENSOR_DEGC >= float(log.temperature_degC.max()):
        return log, bounds, ("The column of the room's temperature was not used: " + (
            "the ambient is stated." if bounds is not None else "it is no colder than the heater."),)
    notes = f"The ambient was taken from the column of the room's temperature, {low:.3g}…{high:.3g} °C"
    if log.cooling_pct is None and high - low > _MOVES * float(np.ptp(log.temperature_degC)):
        try:
            steady, effect = without_disturbance(
                replace(log, signals=dict(log.signals) | {"disturbance": column}))
        except InputError:
            effect = None
        if effect is not None and effect.acts and effect.pct_per_unit > 0.0:
            return (steady.with_rows(disturbance=log.disturbance), (low - _SENSOR_DEGC, low + _SENSOR_DEGC),
                    (f"{notes}; the readings were fitted as if it had always been {low:.3g} °C.",))
    return log, (low - _SENSOR_DEGC, high + _SENSOR_DEGC), (f"{notes}.",)


def fit_two_way(
    logs: Sequence[Log], fit_all: Callable[[Sequence[Log]], FittedModel]
) -> tuple[FittedModel, list[Log]]:
    """Return the heater of logs of which some hold a cooler, and the logs with one power, below 0 where it cools.

    The heater is fitted with the best cooling gain and with both ends of its interval; its intervals hold all three.
    Logs of one heater have one cooler.

    Raises:
        InputError: as `cooling_effect`; coolers that differ, or one of several logs that multiplies the heat loss.
    """
    cooled = [log for log in logs if "cooling" in log.signals]
    effects = [cooling_effect(log) for log in cooled]
    lossy = [without_loss(log.with_rows(cooling_pct=None), "the cooler", log.signals["cooling"]) for log in cooled]
    for log, multiplied in zip(cooled, lossy, strict=True):
        if multiplied is not None and len(logs) > 1:
            raise InputError(f"{log.name}: the cooler multiplies the heat loss, which can only be fitted from a single "
                             "log: fit it separately")
        if multiplied is not None:
            still, loss = multiplied
            fitted = fit_all([still])
            cools = log.signals["cooling"].at(log.time_s) > 0.0
            effect = _as_power(effects[0], loss, fitted, log.temperature_degC[cools])
            return _with_cooling(with_loss(fitted, loss), cooled, effect), [still]
    effect, leads_s = _of_all(cooled, effects), {id(log): 0.0 if each.at_once else each.lead_s
                                                 for log, each in zip(cooled, effects, strict=True)}
    gains = (effect.cooling_gain, *effect.cooling_gain_ci95)
    middle, *ends = ([_net(log, max(gain, 0.0), leads_s.get(id(log))) for log in logs] for gain in gains)
    fitted, others = fit_all(middle), [fit_all(end) for end in ends]
    ci95 = {name: _hull([own, *(other.ci95.get(name) for other in others)]) for name, own in fitted.ci95.items()}
    parts = tuple(replace(fitted.candidates[0], model=other.model, part=f"cooling gain at its {end} end")
                  for other, end in zip(others, ("low", "high"), strict=True))
    return _with_cooling(replace(fitted, ci95=ci95, candidates=(*fitted.candidates, *parts)), cooled, effect), middle


def _net(log: Log, cooling_gain: float, lead_s: float | None) -> Log:
    """Return a log with one power, its cooler so much earlier [s]; None: it has no cooler."""
    if lead_s is None:
        return log
    cooling = _earlier(log.signals["cooling"], lead_s) if lead_s else log.signals["cooling"]
    return replace(log, signals=dict(log.signals) | {"cooling": cooling}).with_net_power(cooling_gain)


def _of_all(logs: Sequence[Log], effects: Sequence[CoolingEffect]) -> CoolingEffect:
    """Return the cooler of several logs, each weighted by its interval.

    Raises:
        InputError: two intervals do not meet.
    """
    if len(effects) == 1:
        return effects[0]
    low = max(range(len(effects)), key=lambda i: effects[i].cooling_gain_ci95[0])
    high = min(range(len(effects)), key=lambda i: effects[i].cooling_gain_ci95[1])
    if effects[low].cooling_gain_ci95[0] > effects[high].cooling_gain_ci95[1]:
        raise InputError(
            f"{logs[low].name} and {logs[high].name}: their coolers differ, {effects[low].cooling_gain:.3g} and "
            f"{effects[high].cooling_gain:.3g} times full heating, so they are not of one heater and cooler; fit them "
            "separately")
    halves = np.array([0.5 * (effect.cooling_gain_ci95[1] - effect.cooling_gain_ci95[0]) for effect in effects])
    weights = halves**-2.0 / np.sum(halves**-2.0)
    gain, half = float(weights @ [effect.cooling_gain for effect in effects]), float(np.sum(halves**-2.0)) ** -0.5
    return replace(max(effects, key=lambda effect: effect.delta_bic), cooling_gain=gain,
                   cooling_gain_ci95=(gain - half, gain + half))


def _hull(intervals: Sequence[Interval | None]) -> Interval | None:
    """Return the narrowest interval that holds all, None if one of them is not known."""
    limits = [interval for interval in intervals if interval is not None]
    return reduce(hull, limits) if len(limits) == len(intervals) else None


def _as_power(effect: CoolingEffect, loss: LossEffect, fitted: FittedModel, cooled_degC: Array) -> CoolingEffect:
    """Return a cooler that multiplies the loss as the power it takes, over the readings at which it cooled."""
    model, ambient = fitted.model, fitted.model.ambient_degC
    assert ambient is not None
    per_degC = loss.factor / loss.strong / model.gain_degC_per_pct
    low, middle, high = (max(float(per_degC * (np.quantile(cooled_degC, share) - ambient)), 0.0)
                         for share in (0.0, 0.5, 1.0))
    return replace(effect, cooling_gain=middle, cooling_gain_ci95=(low, high),
                   delta_bic=loss.delta_bic, delta_bic_loss=loss.delta_bic_as_power)


def _earlier(signal: LogSignal, lead_s: float) -> LogSignal:
    """Return a held signal as it is so much later, at the same instants."""
    rows = np.searchsorted(signal.time_s, signal.time_s + lead_s, side="right") - 1
    return signal._replace(values=signal.values[np.clip(rows, 0, len(rows) - 1)])


def _with_cooling(fitted: FittedModel, logs: Sequence[Log], effect: CoolingEffect) -> FittedModel:
    if any(log.taken is not None and "power" in log.taken.assumed for log in logs):
        return replace(fitted, cooling=effect)  # whether it cools below 0 has to be stated first
    name = " and ".join(log.name for log in logs)
    remarks = [Remark("cooler", f"{name}: {effect.sentence}{''.join(f' But {doubt}.' for doubt in effect.doubts)}")]
    if effect.misleads:
        remarks.append(Remark("cooler-differs", f"{name}: {'; '.join(effect.doubts)}."))
    return replace(fitted, cooling=effect, notes=(*(remark.sentence for remark in remarks), *fitted.notes),
                   findings=(*fitted.findings, *findings_of(remarks)))


def with_loss(fitted: FittedModel, effect: LossEffect | None) -> FittedModel:
    """Return a fit at the calm level of a fan with the heaters at its strong level added."""
    if effect is None:
        return fitted

    def blown(candidate: Candidate, factor: float) -> Candidate:
        model: HeaterModel = candidate.model
        return replace(candidate, part=f"{effect.column} at {effect.strong:.3g}", model=replace(
            model, gain_degC_per_pct=model.gain_degC_per_pct / (1.0 + factor),
            time_constant_s=model.time_constant_s / (1.0 + factor)))

    strong = [blown(each, effect.factor) for each in fitted.candidates if not each.part]
    strong += [blown(fitted.candidates[0], factor) for factor in effect.factor_ci95]
    return replace(
        fitted, candidates=(*fitted.candidates, *strong), notes=(effect.sentence, *fitted.notes),
        findings=(*fitted.findings, *findings_of([Remark("loss-changes", effect.sentence)])))

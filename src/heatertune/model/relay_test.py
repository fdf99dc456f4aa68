"""The relay test: simulated, in closed form for one lag and dead time, and recognised in a log.

A recognised test gives ultimate gain and period, and the heater behind them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.heater.exact import advance_step, factors, turning_time
from heatertune.log.log_values import Log
from heatertune.model.experiment.fisher import Schedule
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.statistics import Interval, student_t
from heatertune.model.temperature.evidence import (
    Thermostat,
    Thresholds,
    reading_margin_degC,
    threshold_between,
)
from heatertune.units import check

__all__ = [
    "Oscillation", "RelayEstimate", "RelayRecord", "TwoLevelRelay", "estimate", "find_relay", "oscillating_fopdt",
    "oscillation", "simulate_relay", "with_relay",
]


_MOST_SWITCHES = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoLevelRelay:
    """A two-level controller: low power from `setpoint + hysteresis` up, high power from `setpoint − hysteresis` down.

    Attributes:
        setpoint_degC: middle of the two thresholds [°C].
        hysteresis_degC: half the distance between them [°C].
        high_pct, low_pct: the two powers [%]; asymmetric where their middle does not hold the setpoint.

    Raises:
        OutOfRange: a negative hysteresis, powers outside 0…100 % or in the wrong order.
    """

    setpoint_degC: float
    hysteresis_degC: float
    high_pct: float
    low_pct: float = 0.0

    def __post_init__(self) -> None:
        check("setpoint_degC", self.setpoint_degC, least=-273.15)
        check("hysteresis_degC", self.hysteresis_degC, least=0.0)
        check("low_pct", self.low_pct, least=0.0, most=100.0)
        check("high_pct", self.high_pct, above=self.low_pct, most=100.0)

    @property
    def off_degC(self) -> float:
        """Where the low power begins [°C]."""
        return self.setpoint_degC + self.hysteresis_degC

    @property
    def on_degC(self) -> float:
        """Where the high power begins [°C]."""
        return self.setpoint_degC - self.hysteresis_degC


class Oscillation(NamedTuple):
    """The steady oscillation: how long the power is high and low [s], highest and lowest temperature [°C]."""

    on_s: float
    off_s: float
    highest_degC: float
    lowest_degC: float

    @property
    def period_s(self) -> float:
        """One whole oscillation [s]."""
        return self.on_s + self.off_s


class _RelayState(NamedTuple):
    """Temperature, and that of the lag before it [°C]."""

    outer: float
    inner: float


def oscillation(model: Fopdt, relay: TwoLevelRelay) -> Oscillation:
    """Return the exact oscillation of one lag and dead time under a relay.

    With a = how far full relay power would warm above the setpoint, b = how far the low power would cool below it,
    ε = hysteresis, E = e^(−L/T): the peak is a(1 − E) + εE, the power is high for T·ln(((a + b)/E − b + ε)/(a − ε))
    and low for T·ln(((a + b)/E − a + ε)/(b − ε)) (Q.-G. Wang, C.-C. Hang, B. Zou, "Low-order modeling from relay
    feedback", Ind. Eng. Chem. Res. 36 (1997) 375–381, equations 2–5).

    Raises:
        OutOfRange: the powers do not hold the temperature on both sides of the thresholds.
    """
    up, down = _reach(model, relay)
    eps, decay, lag = relay.hysteresis_degC, math.exp(-model.dead_time_s / model.time_constant_s), model.time_constant_s
    both = (up + down) / decay
    return Oscillation(
        on_s=lag * math.log((both - down + eps) / (up - eps)),
        off_s=lag * math.log((both - up + eps) / (down - eps)),
        highest_degC=relay.setpoint_degC + up * (1.0 - decay) + eps * decay,
        lowest_degC=relay.setpoint_degC - down * (1.0 - decay) - eps * decay,
    )


def simulate_relay(
    model: HeaterModel, relay: TwoLevelRelay, duration_s: float, *, base_pct: float = 0.0,
    sample_time_s: float | None = None
) -> Schedule:
    """Return the powers that a relay sets on a heater in steady state at the base power, for the duration.

    Between two changes of the acting power the temperature is a closed form. Without a sampling interval the relay
    switches exactly at the crossing; with one, at the first reading on or beyond the threshold.

    Args:
        model: with ambient.
        relay: its high power comes first if the heater starts below `relay.off_degC`.
        duration_s: of the test [s].
        base_pct: initial steady power [%].
        sample_time_s: interval between two readings [s]; None: the relay sees the temperature at every instant.

    Raises:
        OutOfRange: as `oscillation`; a heater without ambient; a duration or an interval that is not positive.
        InputError: more than 10,000 switches: without hysteresis and dead time a relay switches infinitely often.
    """
    check("duration_s", duration_s, above=0.0)
    if sample_time_s is not None:
        check("sample_time_s", sample_time_s, above=0.0)
    _reach(model, relay)
    rest = _ambient(model) + model.gain_degC_per_pct * base_pct
    state = _RelayState(rest, rest)
    high = state.outer < relay.off_degC
    times, powers = [0.0], [relay.high_pct if high else relay.low_pct]
    coming = deque([(model.dead_time_s, powers[0])])
    now, acting, readings = 0.0, base_pct, 0
    while now < duration_s:
        threshold = relay.off_degC if high else relay.on_degC
        reading = math.inf if sample_time_s is None else readings * sample_time_s
        until = min(duration_s, reading, coming[0][0] if coming else math.inf)
        course = _ConstantPowerResponse(model, state, acting)
        crossing = course.crossing(threshold, until - now, rising=high) if sample_time_s is None else None
        if crossing is not None:
            until = now + crossing
        state, now = course.after(until - now), until
        if coming and coming[0][0] <= now:
            acting = coming.popleft()[1]
        if now == reading:
            readings += 1
            crossed = state.outer >= threshold if high else state.outer <= threshold
        else:
            crossed = crossing is not None
        if crossed and now < duration_s:
            high = not high
            times.append(now)
            powers.append(relay.high_pct if high else relay.low_pct)
            coming.append((now + model.dead_time_s, powers[-1]))
            if len(times) > _MOST_SWITCHES:
                raise InputError("the relay switches more than 10000 times: give it a hysteresis or a shorter duration")
    return Schedule(base_pct=base_pct, time_s=np.array(times), power_pct=np.array(powers))


class _ConstantPowerResponse:
    """The temperature under one acting power."""

    def __init__(self, model: HeaterModel, state: _RelayState, power_pct: float) -> None:
        self._outer, self._inner = (*model.lags_s[::-1], 0.0)[:2]
        self._target = _ambient(model) + model.gain_degC_per_pct * power_pct
        self._begun = state

    def after(self, t: float) -> _RelayState:
        """Return outer and inner temperature after t seconds."""
        return _RelayState(*advance_step(*self._begun, self._target, factors(t, self._outer, self._inner)))

    def crossing(self, threshold: float, length: float, *, rising: bool) -> float | None:
        """Return when the temperature first reaches the threshold within a length [s], or None."""
        sign = 1.0 if rising else -1.0

        def beyond(t: float) -> float:
            return sign * (self.after(t).outer - threshold)

        ends = sorted({0.0, length, *self._turns(length)})
        if beyond(0.0) >= 0.0:
            return 0.0
        for start, end in pairwise(ends):
            if beyond(end) >= 0.0:
                return _root(beyond, start, end, 1e-9)
        return None

    def _turns(self, length: float) -> tuple[float, ...]:
        """Return where the slope vanishes within the length: never with one lag, at most once with two."""
        start, ended = self._begun, self.after(length)
        if self._inner == 0.0 or (start.inner - start.outer) * (ended.inner - ended.outer) >= 0.0:
            return ()
        return (turning_time(*start, self._target, self._outer, self._inner),)


def _ambient(model: HeaterModel) -> float:
    if model.ambient_degC is None:
        raise OutOfRange("ambient_degC", None, "known: a relay switches on temperatures")
    return model.ambient_degC


def _reach(model: HeaterModel, relay: TwoLevelRelay) -> tuple[float, float]:
    """Return how far the high power would heat above the setpoint, and the low power cool below it [°C]."""
    up = _ambient(model) + model.gain_degC_per_pct * relay.high_pct - relay.setpoint_degC
    down = relay.setpoint_degC - _ambient(model) - model.gain_degC_per_pct * relay.low_pct
    if min(up, down) <= relay.hysteresis_degC:
        low, high = relay.setpoint_degC - down + relay.hysteresis_degC, relay.setpoint_degC + up - relay.hysteresis_degC
        raise OutOfRange("setpoint_degC", relay.setpoint_degC, f"> {low:.4g} and < {high:.4g}, or it never swings")
    return up, down


Rows = npt.NDArray[np.intp]

_PERIODS = 2  # least number of whole ones
_LEAST_STEP = 2.0  # % of power: a P controller answers a step of the reading by less
_SPREAD = 0.25  # of the swing: how far the temperatures at equal switches may lie apart
_PASSED = 1.2  # times the distance of the thresholds: a smaller swing may have been switched by a clock
_CLOCK = 2.0  # sampling intervals: then the periods differ by more
_PHASES = 400  # of the mean period
_STILL = 0.05  # of the log's span: a rest moves less
_LONG = 0.1  # of the period: a shorter stretch does not show whether the heater rested
_LOPSIDED = 0.1  # a smaller difference of on and off time does not identify the gain
_LEAST_DELAY = 0.85  # rad: less lag beyond a quarter turn, at the relay's period, leaves the half turn too far away
_MOST_DELAY = 2.0  # rad: more is no heater's
_ONE_LAG = 0.12  # of ultimate gain and period: how far the way to the half turn errs with one lag
#: the same for a second lag in place of dead time, for each such way, relative to the frequency: of 200 sampled heaters
#: the ultimate gain was higher by up to 4.5, and the period shorter by up to 0.6
_HIGHER_GAIN, _SHORTER_PERIOD = 5.0, 0.7
_SHIFT = 0.05  # of the relay's step: how far the mean power has to be from that of the rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelayRecord:
    """A log of a relay test.

    Attributes:
        log: with power.
        off, on: rows at which the power went down and up; off[0] < on[0] < off[1] …, settled periods only.
        high_pct, low_pct: the two powers [%].
        rest: power [%] and temperature [°C] of the steady state before, or None.
    """

    log: Log
    off: Rows
    on: Rows
    high_pct: float
    low_pct: float
    rest: tuple[float, float] | None

    @property
    def periods(self) -> int:
        """Number of whole periods, each from one switching off to the next."""
        return len(self.off) - 1

    @property
    def relay(self) -> TwoLevelRelay:
        """The relay as it switched: thresholds are the mean temperatures at the switches."""
        y = self.log.temperature_degC
        off, on = float(np.mean(y[self.off])), float(np.mean(y[self.on]))
        return TwoLevelRelay(
            setpoint_degC=0.5 * (off + on), hysteresis_degC=max(0.0, 0.5 * (off - on)), high_pct=self.high_pct,
            low_pct=self.low_pct,
        )

    @property
    def thresholds(self) -> Thresholds:
        """The thresholds that lie between each switching's row and the one before, as far as the readings are exact."""
        y, margin = self.log.temperature_degC, 2.0 * reading_margin_degC(self.log)
        return Thresholds.between(*(threshold_between(y[rows - 1], y[rows], margin) for rows in (self.on, self.off)))

    def swings(self) -> Array:
        """Return highest less lowest reading of each period, shape (periods,) [°C]."""
        spans = zip(self.off[:-1], self.off[1:], strict=True)
        return np.array([float(np.ptp(self.log.temperature_degC[a : b + 1])) for a, b in spans])

    def extremes(self) -> tuple[float, float]:
        """Return highest and lowest temperature of the mean period [°C]: noise lifts those of a single one."""
        time, y = self.log.time_s, self.log.temperature_degC
        phases = np.linspace(0.0, 1.0, _PHASES)
        spans = zip(time[self.off[:-1]], time[self.off[1:]], strict=True)
        mean = np.mean([np.interp(a + phases * (b - a), time, y) for a, b in spans], axis=0)
        return float(mean.max()), float(mean.min())

    def times(self) -> tuple[float, float]:
        """Return the mean on and off times [s]."""
        time = self.log.time_s
        on = float(np.mean(time[self.off[1:]] - time[self.on]))
        return on, float(time[self.off[-1]] - time[self.off[0]]) / self.periods - on

    def responses(self) -> npt.NDArray[np.complex128]:
        """Return the heater's frequency response at each period's own frequency, shape (periods,) [°C/%].

        In a steady oscillation the first harmonics of temperature and power have the ratio G(jω) exactly, however
        unequal the power's two parts and however wide the thresholds are.
        """
        assert self.log.power_pct is not None
        ratios = []
        for first, last in zip(self.off[:-1], self.off[1:], strict=True):
            time, y = self.log.time_s[first:last + 1], self.log.temperature_degC[first:last + 1]
            length = float(time[-1] - time[0])
            turns = np.exp(-2j * math.pi * (time - time[0]) / length)
            level = y - y[0] - (y[-1] - y[0]) * (time - time[0]) / length  # the scatter from one period to the next
            temperature = np.sum(np.diff(time) * (level[1:] * turns[1:] + level[:-1] * turns[:-1])) / 2.0
            power = np.sum(self.log.power_pct[first:last] * np.diff(turns)) * length / (-2j * math.pi)
            ratios.append(temperature / power)
        return np.array(ratios)

    def means(self) -> tuple[float, float]:
        """Return mean power [%] and mean temperature [°C] over the whole periods, from their integrals."""
        part = slice(self.off[0], self.off[-1] + 1)
        assert self.log.power_pct is not None
        time, y, u = self.log.time_s[part], self.log.temperature_degC[part], self.log.power_pct[part]
        length = float(time[-1] - time[0])
        return float(np.diff(time) @ u[:-1]) / length, float(np.sum(np.diff(time) * (y[1:] + y[:-1]) / 2.0)) / length


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayEstimate:
    """The results of the oscillation.

    Attributes:
        periods: number of whole periods used.
        period_s: of the oscillation, with its 95 % interval [s].
        ultimate_gain: gain of a P controller at the stability limit [%/°C]; NaN if the oscillation is too far
            from it.
        ultimate_period_s: period there [s], or NaN.
        oscillation: the FOPDT with this oscillation, None if its gain is unknown.
        source: how the gain was found, or why it was not.
        output_error: the FOPDT of the output-error fit that starts there, None without a start.
    """

    periods: int
    period_s: tuple[float, Interval]
    ultimate_gain: tuple[float, Interval]
    ultimate_period_s: tuple[float, Interval]
    oscillation: Fopdt | None
    source: str
    output_error: Fopdt | None


def find_relay(log: Log, *, ambient_degC: float | None = None) -> RelayRecord | None:
    """Find a relay test in a log; None if there is none.

    The power alternates between two values for two whole periods or more; it goes down where the temperature is high
    and up where it is low, each time at nearly the same temperature. Either the temperature overshoots both, or the
    periods differ: timed switching of a steady loop would show neither.
    """
    power = log.power_pct
    if power is None:
        return None
    starts = np.concatenate([[0], np.flatnonzero(np.diff(power)) + 1])
    first, last = _alternation(power[starts])
    switches, up = starts[first + 1 : last], np.diff(power[starts[first:last]]) > 0.0
    off, on = switches[~up], switches[up]
    if len(off) > _PERIODS + 1:  # the first swing still remembers the heat-up
        off = off[1:]
    if len(off) <= _PERIODS:
        return None
    if abs(float(power[off[0]] - power[off[0] - 1])) < _LEAST_STEP:
        return None
    on = on[(on > off[0]) & (on < off[-1])]
    y = log.temperature_degC
    swing = float(np.ptp(y[off[0] : off[-1] + 1]))
    apart = float(np.mean(y[off]) - np.mean(y[on]))
    if max(float(np.ptp(y[off])), float(np.ptp(y[on]))) > _SPREAD * swing or not 0.0 <= apart <= swing:
        return None
    sample = float(np.median(np.diff(log.time_s)))
    if swing < _PASSED * apart and float(np.ptp(np.diff(log.time_s[off]))) <= _CLOCK * sample:
        return None
    return RelayRecord(
        log=log, off=off, on=on, high_pct=float(power[off[0] - 1]), low_pct=float(power[off[0]]),
        rest=_rest(log, int(starts[1]), off) if ambient_degC is None else (0.0, ambient_degC),
    )


def estimate(record: RelayRecord, *, ambient_degC: float | None = None) -> RelayEstimate:
    """Evaluate a relay test.

    If the output switches at thresholds 2ε apart, the oscillation is not that at the stability limit: the describing
    function of such a relay turns the phase by asin(ε/A), A half the swing (K. J. Åström, T. Hägglund, "Automatic
    tuning of simple regulators with specifications on phase and amplitude margins", Automatica 20 (1984) 645–651,
    section 3). So the heater's response G(jω) is taken from the first harmonics of power and temperature, and followed
    to −180° as that of an integrator with dead time θ/ω, θ what G lags beyond a quarter turn: the ultimate frequency is
    ω·(π/2)/θ, and the ultimate gain 1/|G| times as much.
    """
    relay, log = record.relay, record.log
    lengths = np.diff(log.time_s[record.off])
    sample = float(np.median(np.diff(log.time_s)))
    highest, lowest = record.extremes()
    period_s = _mean(lengths, float(np.mean(lengths)), sample / record.periods)
    gains, periods = _at_half_turn(record.responses(), lengths)
    ultimate, ultimate_s = float(np.mean(gains)), float(np.mean(periods))
    further = max(0.0, period_s[0] / ultimate_s - 1.0)
    on_s, off_s = record.times()
    gain, source = _static_gain(record)
    oscillation = oscillating_fopdt(relay, on_s=on_s, off_s=off_s, highest_degC=highest, lowest_degC=lowest, gain=gain)
    if oscillation is None and (gain is not None or _lopsided(on_s, off_s)):
        source = f"{source}, but no FOPDT swings like this"
    return RelayEstimate(
        periods=record.periods, period_s=period_s,
        ultimate_gain=_mean(gains, ultimate, _ONE_LAG * ultimate, (_ONE_LAG + _HIGHER_GAIN * further) * ultimate),
        ultimate_period_s=_mean(
            periods, ultimate_s, (_ONE_LAG + _SHORTER_PERIOD * further) * ultimate_s, _ONE_LAG * ultimate_s),
        oscillation=oscillation, source=source,
        output_error=None if oscillation is None else _refined(record, oscillation, ambient_degC),
    )


def _at_half_turn(responses: npt.NDArray[np.complex128], lengths_s: Array) -> tuple[Array, Array]:
    """Return ultimate gains [%/°C] and periods [s] from responses at each period, nan where they are too far away."""
    unknown = np.full(len(responses), math.nan)
    mean = complex(np.mean(responses))
    if mean == 0.0 or not np.all(responses):  # no oscillation
        return unknown, unknown
    # the spread of a lag beyond the quarter turn about that of their mean, so that no noise turns it by a whole turn
    lag = float(np.angle(-1.0 / mean)) % (2.0 * math.pi) + 0.5 * math.pi
    delay = lag - 2.0 * math.pi * (lag > 1.5 * math.pi) + np.angle(mean / responses)
    if not bool(np.all((delay > _LEAST_DELAY) & (delay < _MOST_DELAY))):
        return unknown, unknown
    further = 0.5 * math.pi / delay
    return further / np.abs(responses), lengths_s / further


def oscillating_fopdt(
    relay: TwoLevelRelay, *, on_s: float, off_s: float, highest_degC: float, lowest_degC: float, gain: float | None
) -> Fopdt | None:
    """Return the FOPDT with this relay oscillation, or None: the inverse of `relay.oscillation`.

    With the gain k known, the share E = e^(−L/T) follows from the swing, (kΔu − swing)/(kΔu − 2ε). Without it, E is
    where the equations of the on and of the off time give the same ratio; that needs an asymmetric swing.

    Args:
        relay: with thresholds and powers as they were.
        on_s: how long the power is high in one oscillation [s].
        off_s: how long it is low [s].
        highest_degC: upper peak of the temperature [°C].
        lowest_degC: lower peak [°C].
        gain: k, if known otherwise [°C/%], or None.
    """
    eps = relay.hysteresis_degC
    above, below = highest_degC - relay.setpoint_degC, relay.setpoint_degC - lowest_degC
    step = relay.high_pct - relay.low_pct

    def reach(decay: float) -> tuple[float, float]:
        return (above - eps * decay) / (1.0 - decay), (below - eps * decay) / (1.0 - decay)

    def logs(decay: float) -> tuple[float, float]:
        up, down = reach(decay)
        both = (up + down) / decay
        return math.log((both - down + eps) / (up - eps)), math.log((both - up + eps) / (down - eps))

    if min(above, below) <= eps:
        return None
    if gain is None:
        decay = _decay_of(logs, on_s / off_s) if _lopsided(on_s, off_s) else None
    elif gain * step <= above + below:
        decay = None
    else:
        decay = (gain * step - above - below) / (gain * step - 2.0 * eps)
    if decay is None:
        return None
    (up, down), (on, off) = reach(decay), logs(decay)
    static_gain = (up + down) / step
    lag = (on_s + off_s) / (on + off)
    return Fopdt(
        gain_degC_per_pct=static_gain, time_constant_s=lag, dead_time_s=-lag * math.log(decay),
        ambient_degC=relay.setpoint_degC + up - static_gain * relay.high_pct,
    )


def with_relay(log: Log, fitted: FittedModel, *, ambient_degC: float | None, thermostat: Thermostat | None = None
               ) -> FittedModel:
    """Return the fit with the results of the log as a relay test, or unchanged if it is not one.

    Args:
        log: with power.
        fitted: its heater.
        ambient_degC: if known, or None.
        thermostat: that switched the power, if stated.

    Raises:
        InputError: the power is not that of the stated thermostat.
    """
    record = find_relay(log.on_one_clock(), ambient_degC=ambient_degC)
    if record is None:
        if thermostat is not None:
            raise InputError(f"{log.name}: its power does not switch at two temperatures; leave out --thermostat")
        return fitted
    if thermostat is not None:
        record.thresholds.check_stated(log.name, thermostat)
    test = estimate(record, ambient_degC=ambient_degC)
    summary = (
        f"{log.name} is a relay test: {record.low_pct:g} and {record.high_pct:g} %, {test.periods} whole periods of "
        f"{test.period_s[0]:.4g} s, {record.thresholds.summary}."
    )
    model = f"No FOPDT from the oscillation: {test.source}."
    if test.oscillation is not None and test.output_error is not None:
        model = (
            f"FOPDT from the oscillation ({test.source}): {_numbers(test.oscillation)}; output-error fit that starts "
            f"there: {_numbers(test.output_error)}."
        )
    if math.isnan(test.ultimate_gain[0]):
        doubt = "The oscillation is too far from the limit of stability to show the ultimate gain and period."
        return replace(fitted, notes=(*fitted.notes, summary, model, doubt))
    combinations = {
        "ultimate_gain_pct_per_degC": test.ultimate_gain, "ultimate_period_s": test.ultimate_period_s,
        **fitted.combinations,
    }
    return replace(fitted, notes=(*fitted.notes, summary, model), combinations=combinations)


def _alternation(values: Array) -> tuple[int, int]:
    """Return first and behind-last index of the longest stretch that alternates between two values."""
    best, first = (0, 1), 0
    for i in range(1, len(values)):
        if i >= first + 2 and values[i] != values[i - 2]:
            first = i - 1
        if i + 1 - first > best[1] - best[0]:
            best = (first, i + 1)
    return best


def _rest(log: Log, end: int, off: Rows) -> tuple[float, float] | None:
    """Return power and temperature of the log's first stretch, where that shows that the heater rested."""
    assert log.power_pct is not None
    y = log.temperature_degC[: end + 1]  # the reading at the switch is still one of the rest
    third = max(1, len(y) // 3)
    moved = abs(float(np.mean(y[-third:]) - np.mean(y[:third]))) > _STILL * float(np.ptp(log.temperature_degC))
    short = log.time_s[end] - log.time_s[0] < _LONG * float(np.mean(np.diff(log.time_s[off])))
    return None if moved or short else (float(log.power_pct[0]), float(np.mean(y)))


def _static_gain(record: RelayRecord) -> tuple[float | None, str]:
    """Return rise over power from the rest to the mean of whole periods [°C/%], and a word on it."""
    if record.rest is not None:
        power, temperature = record.means()
        if abs(power - record.rest[0]) > _SHIFT * (record.high_pct - record.low_pct):
            gain = (temperature - record.rest[1]) / (power - record.rest[0])
            return (gain, "gain from the integrals over whole periods") if gain > 0.0 else (None, "negative gain")
    if _lopsided(*record.times()):
        return None, "gain from the unequal on and off times"
    return None, "the relay is symmetric, and neither a rest before it nor the ambient is known"


def _lopsided(on_s: float, off_s: float) -> bool:
    return abs(on_s - off_s) > _LOPSIDED * (on_s + off_s)


def _decay_of(logs: Callable[[float], tuple[float, float]], ratio: float) -> float | None:
    """Return the e^(−L/T) that gives the ratio of on to off time, None if no value or every value does."""

    def surplus(decay: float) -> float:
        on, off = logs(decay)
        return on - ratio * off

    for low, high in pairwise(np.linspace(0.005, 0.995, 100).tolist()):
        if surplus(low) * surplus(high) < 0.0:
            return _root(surplus, low, high, 1e-12)
    return None


def _root(function: Callable[[float], float], low: float, high: float, within: float) -> float:
    from scipy.optimize import brentq  # which a log without a relay test does not wait for

    return float(brentq(function, low, high, xtol=within))


def _mean(values: Array, centre: float, margin: float, margin_above: float | None = None) -> tuple[float, Interval]:
    """Return the centre and its 95 % interval from the scatter, wider by a margin below and above; nan: unknown."""
    n = len(values)
    if not np.isfinite([centre, *values]).all():
        return math.nan, Interval(low=None, high=None)
    half = float(student_t(n - 1) * np.std(values, ddof=1) / math.sqrt(n))
    above = margin if margin_above is None else margin_above
    return centre, Interval(low=centre - half - margin, high=centre + half + above)


def _refined(record: RelayRecord, start: Fopdt, ambient_degC: float | None) -> Fopdt | None:
    """Return the output-error fit that a start leads to.

    Without an initial steady state it begins at the first switch of whole periods, where the previous power is known.
    """
    log, before = record.log, None
    if record.rest is None or ambient_degC is not None:
        log, before = log.window(float(log.time_s[record.off[0]]), float(log.time_s[-1])), record.high_pct
    problem = PowerProblem(readings=Readings.of(log), ambient_degC=ambient_degC, power_before_pct=before)
    model = problem.refine(np.array([[math.log(start.time_constant_s), start.dead_time_s, 0.0]])).model
    return model if isinstance(model, Fopdt) else None  # None: even at the start, high power does not heat


def _numbers(model: Fopdt) -> str:
    """Return a heater in words; an output-error fit may leave its ambient unknown."""
    ambient = "unknown" if model.ambient_degC is None else f"{model.ambient_degC:.3g} °C"
    return (
        f"{model.gain_degC_per_pct:.3g} °C/%, time constant {model.time_constant_s:.4g} s, dead time "
        f"{model.dead_time_s:.3g} s, ambient {ambient}"
    )

"""Diagnose a control loop from its log: faults, their severity and certainty, and the words that would cure them.

temperature = heater[power] + rest. The rest, which the fitted heater does not explain by the logged power, is that
day's loads, room and noise. It is the same under another controller, so the logged day can be simulated with other
words: those that are proposed are designed for the heater of the log, proven, and simulated through its day.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from heatertune import cache
from heatertune.arrays import Array
from heatertune.errors import HeatertuneError, InputError
from heatertune.log.log_values import Log
from heatertune.loops.measures import (
    Cause,
    LoopEntry,
    LoopFault,
    RegularLog,
    Swings,
    at_limit,
    course_of,
    offset_degC,
    swings,
    switching_period_s,
    switchings_per_h,
)
from heatertune.loops.unlogged_loads import CoolerGain, LoadFreeLog, LoadStep, cooler_gain, without_loads
from heatertune.model.fit import fit
from heatertune.model.model_values import FitOutcome, FittedModel, HeaterModel
from heatertune.model.statistics import Interval
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import SampledPlant, sample_plant
from heatertune.pid.tune import quick_tune
from heatertune.plc import Words
from heatertune.proof.heaters import ROOM_DEGC
from heatertune.proof.redesign import DesignRequest, DesignResult, find_passing_design
from heatertune.proof.ripple_and_wear import SWITCHES, propose_period
from heatertune.proof.verdict import NOT_PROVEN, combined_verdict
from heatertune.units import written

__all__ = ["Cure", "Day", "Diagnosis", "cure_words", "day", "diagnose", "ideal", "times_worse"]


#: (reading [°C], setpoint [°C]) → power until the next scan [%]
Controller = Callable[[float, float], float]

_MOST_SCANS: Final = 20_000
_WARM: Final = 10.0  # errors that are noise: nearer than so many to its setpoint a loop was at work before the log
_TO_REST: Final = 12.0  # lags and dead times: as long, at least, as a loop gets to come to rest before the log begins
_NEAR: Final = 0.2  # errors that are noise: a slower loop gets longer, until it is so near
_BAND: Final = 0.1  # of a step: there its end begins


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """A day as it was, and as it would have been.

    Attributes:
        time_s: of the scans [s], shape (n,).
        setpoint_degC, measured_degC, relived_degC: at each [°C], shape (n,).
    """

    time_s: Array
    setpoint_degC: Array
    measured_degC: Array
    relived_degC: Array


class _Plant:
    """A heater from scan to scan."""

    def __init__(self, model: HeaterModel, scan_s: float, before_pct: float) -> None:
        self._sampled: SampledPlant = sample_plant(model, scan_s)
        sampled = self._sampled
        self._late = [before_pct] * (sampled.delay + 2)
        self._modes = (sampled.now + sampled.before) / (1.0 - sampled.poles) * before_pct

    def step(self, power_pct: float) -> float:
        """Return the temperature's share of the power after a scan [°C]."""
        self._late.insert(0, power_pct)
        self._late.pop()
        sampled = self._sampled
        now, before = self._late[sampled.delay], self._late[sampled.delay + 1]
        self._modes = sampled.poles * self._modes + sampled.now * now + sampled.before * before
        return float(self._modes.sum())

    @property
    def share(self) -> float:
        """The temperature's share of the power so far [°C]."""
        return float(self._modes.sum())


def ideal(design: PidDesign, lowest_pct: float = 0.0) -> Controller:
    """Return a design that runs without anybody's arithmetic: P and I on the error, the sum held at the limits.

    Args:
        design: of the heater.
        lowest_pct: power at full cooling, 0 without a cooler [% of full heating].
    """
    total = 0.0
    k, rate = design.gain_pct_per_degC, design.sample_time_s / design.integral_time_s

    def step(reading: float, setpoint: float) -> float:
        nonlocal total
        error = setpoint - reading
        wish = k * (error + total + rate * error)
        if lowest_pct <= wish <= 100.0 or (wish > 100.0) != (k * error > 0.0):
            total += rate * error
        return min(max(k * (error + total), lowest_pct), 100.0)

    return step


def day(course: RegularLog, model: HeaterModel, controller: Controller, scan_s: float) -> Day:
    """Return the day of a course under another controller.

    Args:
        course: with power.
        model: the heater.
        controller: called once a scan, from its cold state on; a loop that was at work before the log gets time to
            come to rest first.
        scan_s: between two calls [s].
    """
    assert course.power_pct is not None
    length = float(course.time_s[-1] - course.time_s[0])
    h = max(scan_s, length / _MOST_SCANS)
    time = course.time_s[0] + h * np.arange(int(length / h) + 1)
    step = float(course.time_s[1] - course.time_s[0])
    energy = np.concatenate([[0.0], np.cumsum(course.power_pct) * step])
    ends = np.append(course.time_s, course.time_s[-1] + step)
    power = np.diff(np.interp(np.append(time, time[-1] + h), ends, energy)) / h
    measured = np.interp(time, course.time_s, course.temperature_degC)
    rows = np.clip(np.searchsorted(course.time_s, time + 1e-9 * h, side="right") - 1, 0, None)
    setpoint = course.setpoint_degC[rows]
    warm = abs(float(course.error_degC[0])) <= _WARM * course.least_degC
    was = _Plant(model, h, float(course.power_pct[0]) if warm else 0.0)
    rest = measured - np.array([was.share, *(was.step(each) for each in power[:-1].tolist())])
    relived = _relived(model, controller, h, rest, setpoint, course.least_degC if warm else None)
    return Day(time_s=time, setpoint_degC=setpoint, measured_degC=measured, relived_degC=relived)


def _relived(
    model: HeaterModel, controller: Controller, h: float, rest: Array, setpoint: Array, warm_degC: float | None
) -> Array:
    plant = _Plant(model, h, 0.0)
    if warm_degC is not None:
        settle = int(_TO_REST * (sum(model.lags_s) + model.dead_time_s) / h)
        quiet = float(np.median(rest[:max(1, len(rest) // 200)]))
        now = float(setpoint[0])
        for count in range(_MOST_SCANS):
            if count > settle and abs(plant.share + quiet - now) < _NEAR * warm_degC:
                break
            plant.step(controller(plant.share + quiet, now))
    temperatures, share = [], plant.share
    for other, setpoint_degC in zip(rest.tolist(), setpoint.tolist(), strict=True):
        temperatures.append(share + other)
        share = plant.step(controller(share + other, setpoint_degC))
    return np.array(temperatures)


def _near(error: Array, least_degC: float) -> int | None:
    """Return the first row of a stretch that is near its setpoint, None where none is."""
    off = np.abs(error)
    near = np.flatnonzero(off <= np.maximum(least_degC, _BAND * off[:1]))
    return int(near[0]) if len(near) else None


def times_worse(lived: Day, course: RegularLog) -> tuple[float, float, float]:
    """Return how many times the mean error of a day is what it would have been, and both means [°C].

    After a change of the setpoint the comparison begins where the other controller is near it: until then both can
    but heat. Where it never is, it begins where the day as it was is near. Errors that are noise count as nothing, and
    a quarter of one is added to both means: a loop that is never off its setpoint is as good as any.
    """
    counted = np.ones(len(lived.time_s), dtype=bool)
    ends = [*course.changes_s[1:], np.inf]
    for start, end in zip(course.changes_s, ends, strict=True):
        part = np.flatnonzero((lived.time_s >= start) & (lived.time_s < end))
        near = [first for day_degC in (lived.relived_degC, lived.measured_degC)
                if (first := _near(lived.setpoint_degC[part] - day_degC[part], course.least_degC)) is not None]
        counted[part[:near[0] if near else len(part)]] = False
    if not np.any(counted):
        return 1.0, 0.0, 0.0

    def mean(temperature: Array) -> float:
        off = np.abs(lived.setpoint_degC - temperature)[counted]
        return float(np.mean(np.maximum(off - course.least_degC, 0.0)))

    was, would = mean(lived.measured_degC), mean(lived.relived_degC)
    quarter = course.least_degC / 4.0
    return (was + quarter) / (would + quarter), was, would


_WORSE: Final = 2.5  # times the mean error that is possible: further off, other words are worth it
_STEPS: Final = 2.5  # of a reading, peak to peak
_HALF_CYCLES: Final = 5  # a well-tuned loop is done after three
_ABOUT: Final = 0.05  # of the PWM period, as far as what is said of it is off
_SHARE: Final = 0.3  # of the log at a limit
_LONGER: Final = 2.0  # a PWM period that may be so many times as long wears for nothing
_DRIFT: Final = 0.25  # of a parameter: less is what two fits of closed loops differ by
_LATER: Final = 0.4  # of the dead time, which a loop tells less well
_RIPPLE: Final = 2.0  # errors that are noise: ripple, peak to peak, that a longer PWM period may have
_STILL: Final = 0.3  # of the log with one and the same reading
_MOVED_PCT: Final = 10.0  # of power meanwhile, averaged over a tenth of that time
_FEW: Final = 30  # readings that are too few to average the power of
_SURE: Final = 1.5  # times what is accepted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnosis:
    """What is known of one loop.

    Attributes:
        course: as it went.
        loads: that the log shows.
        fitted: the heater; None where the log does not tell.
        why_not: why there is no heater, or why it is not to be trusted; empty: it is.
        possible: the design that it is measured against.
        lived: the day with that.
        worse: times the mean error that is possible; None without a heater.
        swings: of the error.
        switchings_per_h: of the switch; None: not known.
        pwm_period_s: in force; None: not known.
        longer_period_s: that would do as well [s]; None: not known, or nothing wears.
        switch_ticks: whole ones in a PWM period, that the log shows; None: it shows none.
        cooling: how strong the loop's cooler is; None: it has none.
        found: what is wrong, the cause first.
    """

    course: RegularLog
    loads: tuple[LoadStep, ...]
    fitted_model: FittedModel | None
    why_not: str
    possible: PidDesign | None
    replayed_day: Day | None
    worse: float | None
    swings: Swings
    switchings_per_h: float | None
    pwm_period_s: float | None
    longer_period_s: float | None
    switch_ticks: int | None
    cooling: CoolerGain | None
    faults: tuple[LoopFault, ...]

    @property
    def cause(self) -> Cause:
        """What is wrong first of all."""
        return self.faults[0].cause if self.faults else Cause.WELL

    @property
    def excess(self) -> float:
        """How far the loop is beyond what is accepted; below 1 it is well."""
        if self.faults:
            return max(fault.excess for fault in self.faults)
        return min(0.99, (self.worse or 1.0) / _WORSE)

    @property
    def confidence(self) -> str:
        """How sure the cause is: high, medium or low."""
        if self.cause is Cause.UNKNOWN:
            return "low"
        if self.cause in (Cause.FULL_POWER, Cause.NO_POWER):
            return "high"
        clear = self.excess >= _SURE or self.cause is Cause.WELL
        return ("high" if clear else "medium") if not self.why_not else ("medium" if clear else "low")


def diagnose(
    log: Log, loop: LoopEntry, before: FittedModel | None = None, cooling_before: float | None = None
) -> Diagnosis:
    """Return the diagnosis of a loop.

    Args:
        log: with its setpoint, and with its power where that is known.
        loop: what else is known of it.
        before: the heater that its words were made for.
        cooling_before: full cooling as a fraction of full heating then; None: not known.

    Raises:
        InputError: no setpoint is known, or a cooler whose strength the log does not show.
    """
    if loop.setpoint_degC is not None:
        log = log.with_rows(setpoint_degC=np.full(len(log.time_s), loop.setpoint_degC))
    log, cooling = _one_power(log.on_one_clock(), loop)  # switchings and mean powers between two readings count
    if log.setpoint_degC is None:
        raise InputError(f"{log.name}: the log holds no setpoint; log it, or give setpoint_degC in the list")
    period = _pwm_period_s(log, loop)
    course = course_of(log, period)
    cleared = None if (why_not := _no_power(log)) else without_loads(log, period)
    loads, fitted = () if cleared is None else cleared.loads, None
    if cleared is not None:
        fitted, why_not = _heater(cleared)
    worse, lived, possible = None, None, None
    if fitted is not None:
        possible = quick_tune(fitted.hypothetical)
        lived = day(course, fitted.hypothetical[0], ideal(possible, course.lowest_pct), possible.sample_time_s)
        worse = times_worse(lived, course)[0]
    dead = 0.0 if fitted is None else fitted.model.dead_time_s
    swung = swings(course, [*course.changes_s, *(load.instant_s for load in loads)], dead)
    result = Diagnosis(
        course=course, loads=loads, fitted_model=fitted, why_not=why_not, possible=possible, replayed_day=lived,
        worse=worse, swings=swung, switchings_per_h=switchings_per_h(log, period), pwm_period_s=period,
        longer_period_s=_longer(loop, fitted, course, period), switch_ticks=cleared and cleared.ticks,
        cooling=cooling, faults=())
    return replace(result, faults=tuple(_still(log)) or tuple(_faults(result, loop, before, cooling_before)))


def _one_power(log: Log, loop: LoopEntry) -> tuple[Log, CoolerGain | None]:
    """Return a log with one power, below 0 that of its cooler, and how strong that is; None: there is none.

    Raises:
        InputError: the log does not show how strong the cooler is.
    """
    if log.cooling_pct is None:
        return log, None
    gain = None if _no_power(log) else cooler_gain(log, _pwm_period_s(log, loop))
    if gain is None or gain.low <= 0.0:
        raise InputError(f"{log.name}: the log does not show how strong the cooler is; take one in which the loop both "
                         "heats and cools, or judge this one by its temperature alone: --power-column none")
    return log.with_net_power(gain.fraction), gain


def _pwm_period_s(log: Log, loop: LoopEntry) -> float | None:
    """Return the PWM period: that of the logged switch where it is about the stated one, as it is finer [s]."""
    stated, own = loop.pwm_period_s, switching_period_s(log)
    return own if own is not None and (stated is None or abs(own / stated - 1.0) < _ABOUT) else stated


def _still(log: Log) -> Iterator[LoopFault]:
    """Yield that nothing can be said of a loop whose reading stands still while its power moves.

    A loop at rest on a coarse sensor shows the same reading for long, too: its power then rests as well. A file with
    one and the same reading in every row is no log.
    """
    readings = log.temperature_degC
    edges = np.flatnonzero(np.diff(readings)) + 1
    longest = max(np.split(np.arange(len(readings)), edges), key=len)
    seconds = float(log.time_s[longest[-1]] - log.time_s[longest[0]])
    share = len(longest) / len(readings)
    # the mean of a tenth: pulses of a switch are no movement
    moved = 0.0
    if log.power_pct is not None and len(longest) >= _FEW:
        means = [float(part.mean()) for part in np.array_split(log.power_pct[longest], 10)]
        moved = max(means) - min(means)
    if share >= _STILL and moved > _MOVED_PCT:
        yield LoopFault(cause=Cause.UNKNOWN, excess=1.0, message=(
            f"not judged: the reading stands still at {readings[longest[0]]:.4g} °C for {seconds:.0f} s while the "
            f"power moves by {moved:.3g} %: is the sensor there, or its reading frozen?"))


def _no_power(log: Log) -> str:
    """Return why a log's power says nothing of its heater; empty: it does."""
    if log.power_pct is None:
        return "the power was not logged"
    return "the power does not change" if float(log.power_pct.max() - log.power_pct.min()) < 1.0 else ""


def _heater(cleared: LoadFreeLog) -> tuple[FittedModel | None, str]:
    """Return the heater of a log without its loads, and what is to be said against it."""
    try:
        fitted = fit(cleared.log, power_before_pct=cleared.power_before_pct, ambient_degC=cleared.ambient_degC,
                     dead_time_at_most_s=cleared.most_dead_time_s)
    except InputError as problem:
        return None, str(problem).removeprefix(f"{cleared.log.name}: ")
    if fitted.outcome is FitOutcome.POOR_FIT:
        return None, "no heater explains the log well"
    if any(_open(fitted.ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s")):
        return None, "the log leaves gain or time constant open, so the power that holds the setpoint is unknown"
    return fitted, "; ".join(finding.kind.short for finding in fitted.findings if finding.kind.effect == "blocks")


def _open(interval: Interval | None) -> bool:
    return interval is None or interval.low is None or interval.high is None


def _longer(loop: LoopEntry, fitted: FittedModel | None, course: RegularLog, period_s: float | None) -> float | None:
    """Return the PWM period that suits a switch with contacts and the heater [s]; None: not known, or none wears."""
    if loop.switch is None or fitted is None or period_s is None or math.isinf(SWITCHES[loop.switch].life):
        return None
    most = max(plant.dead_time_s for plant in fitted.plants)
    shortest = SWITCHES[loop.switch].shortest_s
    proposal = propose_period(
        fitted.plants, kind=loop.switch, sample_time_s=max(most, shortest),
        setpoint_degC=float(course.setpoint_degC[-1]),
        ambient_degC=ROOM_DEGC if fitted.model.ambient_degC is None else fitted.model.ambient_degC,
        ripple_degC_most=_RIPPLE * course.least_degC)
    return max(shortest, float(math.floor(proposal.period_s)))


def _faults(
    diagnosis: Diagnosis, loop: LoopEntry, before: FittedModel | None, cooling_before: float | None
) -> Iterator[LoopFault]:
    """Yield what is wrong, the cause before what follows from it."""
    limits = list(_limits(diagnosis.course))
    yield from limits
    if before is not None and diagnosis.fitted_model is not None and not limits:
        yield from _drift(diagnosis.fitted_model, before, diagnosis.cooling, cooling_before)
    if not limits:
        yield from _error(diagnosis)
    if diagnosis.longer_period_s is not None and diagnosis.switchings_per_h and diagnosis.pwm_period_s:
        ratio = diagnosis.longer_period_s / diagnosis.pwm_period_s
        if ratio > _LONGER:
            assert loop.switch is not None
            life = SWITCHES[loop.switch].life / diagnosis.switchings_per_h / 24.0
            yield LoopFault(cause=Cause.WEAR, excess=ratio / _LONGER, message=(
                f"{diagnosis.switchings_per_h:.0f} switchings an hour: the {loop.switch} is due after {life:.0f} days; "
                f"a PWM period of {diagnosis.longer_period_s:g} s would do in place of {diagnosis.pwm_period_s:.3g} s"))


def _limits(course: RegularLog) -> Iterator[LoopFault]:
    for cause, high, what in ((Cause.FULL_POWER, True, "at full power"), (Cause.NO_POWER, False, "without power")):
        share = at_limit(course, high=high)
        if share >= _SHARE:
            error = float(course.error_degC[-len(course.error_degC) // 5:].mean())
            yield LoopFault(cause=cause, excess=share / (0.5 * _SHARE), message=(
                f"{100.0 * share:.0f} % of the time {what} and the setpoint not in reach, "
                f"{abs(error):.3g} °C {'below' if error > 0.0 else 'above'} it at the end"))


def _drift(
    now: FittedModel, before: FittedModel, cooling: CoolerGain | None, cooling_before: float | None
) -> Iterator[LoopFault]:
    """Yield the parameters that moved by more than two fits differ by, the one that moved most first.

    The gain of a cooler is told next to that of the heater: a fouled cooler leaves the heater as it was.
    """
    moved = [(name.rpartition("_degC")[0] if "degC" in name else name[:-2], most, getattr(before.model, name),
              getattr(now.model, name))
             for name, most in (("gain_degC_per_pct", _DRIFT), ("time_constant_s", _DRIFT), ("dead_time_s", _LATER))]
    faults = [_moved(*parameter) for parameter in moved]
    if cooling is not None and cooling_before is not None:
        is_ = now.model.gain_degC_per_pct
        was = before.model.gain_degC_per_pct * cooling_before
        if not is_ * cooling.low <= was <= is_ * cooling.high:
            faults.append(_moved("cooling_gain", _DRIFT, was, is_ * cooling.fraction))
    drifted = sorted((fault for fault in faults if fault.excess > 1.0), key=lambda fault: -fault.excess)
    yield from drifted if cooling_before is not None else drifted[:1]


def _moved(name: str, most: float, was: float, is_: float) -> LoopFault:
    """Return by how much a parameter moved, in excess of what two fits differ by; 0: it is not known in one of them."""
    has_both = was > 0.0 and is_ > 0.0
    return LoopFault(
        cause=Cause.DRIFTED, excess=abs(math.log(is_ / was)) / math.log1p(most) if has_both else 0.0,
        message=f"{name.replace('_', ' ')} {was:.3g} → {is_:.3g} since the words were made "
                f"({100.0 * (is_ / was - 1.0) if has_both else 0.0:+.0f} %)")


def _error(diagnosis: Diagnosis) -> Iterator[LoopFault]:
    """Yield what the error says: swings, a rest that stays, or slow recovery."""
    swung, worse, course = diagnosis.swings, diagnosis.worse, diagnosis.course
    times = "" if worse is None else f"; mean error {worse:.2g} times what is possible"
    excess = 1.0 if worse is None else max(1.0, worse / _WORSE)
    # one step of the reading to either side is how a loop at rest looks
    steps = swung.size_degC < _STEPS * course.step_degC and worse is not None and worse < _WORSE
    if swung.count >= _HALF_CYCLES and swung.even and not steps:
        yield LoopFault(cause=Cause.OSCILLATING, excess=max(excess, swung.count / _HALF_CYCLES), message=(
            f"swings {swung.size_degC:.2g} °C peak to peak, period {swung.period_s:.3g} s, "
            f"{swung.count} half cycles in a row{times}"))
        return
    rest = offset_degC(course)
    if rest != 0.0 and (worse is None or worse > _WORSE):
        yield LoopFault(cause=Cause.OFFSET, excess=excess, message=(
            f"rests {abs(rest):.2g} °C {'below' if rest > 0.0 else 'above'} the setpoint{times}"))
    elif worse is not None and worse > _WORSE:
        yield LoopFault(cause=Cause.SLUGGISH, excess=excess, message=f"comes back slowly{times}")
    elif worse is None and diagnosis.fitted_model is None:
        yield LoopFault(cause=Cause.UNKNOWN, excess=1.0, message=f"not told: {diagnosis.why_not}")


#: causes that other words cure, as far as words can
_BY_WORDS: Final = (Cause.OSCILLATING, Cause.OFFSET, Cause.SLUGGISH, Cause.DRIFTED, Cause.WEAR)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cure:
    """What would be typed in.

    Attributes:
        words: of the target; None: there are none, see `why`.
        verdict: of their proof; no PASS where the logged day lived with them is worse.
        why: what the proof does not keep, what is not proven, or why there are no words.
        design: what the words make.
        pwm_period_s: that they were proven with.
        was_degC, would_degC: mean error of the logged day, as it was and with them, noise left out; None: not lived.
    """

    words: Words | None
    verdict: str
    reason: str
    design: PidDesign | None = None
    pwm_period_s: float | None = None
    was_degC: float | None = None
    would_degC: float | None = None


def cure_words(diagnosis: Diagnosis, loop: LoopEntry, request: DesignRequest | None) -> Cure | None:
    """Return the words that would cure a loop, None where words are not what it needs.

    Args:
        diagnosis: what is wrong with it.
        loop: a switch that is known gets the PWM period that suits it; else the period stays.
        request: controller, range and the rest of the design; None: the controller is not known.
    """
    if diagnosis.cause not in _BY_WORDS:
        return None
    if diagnosis.fitted_model is None:
        return Cure(words=None, verdict="", reason=f"no heater to design for: {diagnosis.why_not}")
    if diagnosis.cooling is not None:
        return Cure(words=None, verdict="", reason=(
            "a loop that cools as well is designed from its log alone: heatertune design LOG --target pid-temp "
            f"--cooling-gain {diagnosis.cooling.fraction:.3g}"))
    if request is None:
        return Cure(words=None, verdict="", reason="name the controller: --target, or target in the list")
    try:
        with cache.cache_disabled():
            done = find_passing_design(diagnosis.fitted_model, _request_for(diagnosis, loop, request))
    except HeatertuneError as problem:
        return Cure(words=None, verdict="", reason=str(problem))
    return _lived(diagnosis, diagnosis.fitted_model, done)


def _request_for(diagnosis: Diagnosis, loop: LoopEntry, request: DesignRequest) -> DesignRequest:
    """Return what is asked for, with what is known of the loop in the place of what nobody said."""
    conditions = request.conditions
    if conditions.setpoint_degC is None:
        conditions = replace(conditions, setpoint_degC=round(float(diagnosis.course.setpoint_degC.max()), 6))
    kind, tuned = request.switch_kind or loop.switch, request.tune_settings
    if conditions.pwm_period_s is None and any(fault.cause is Cause.WEAR for fault in diagnosis.faults):
        conditions = replace(conditions, pwm_period_s=diagnosis.longer_period_s)
        tuned = replace(tuned, sample_time_s=tuned.sample_time_s or diagnosis.longer_period_s)
    elif conditions.pwm_period_s is None and kind is None:
        conditions = replace(conditions, pwm_period_s=loop.pwm_period_s)
    return replace(request, conditions=conditions, switch_kind=kind, tune_settings=tuned)


def _lived(diagnosis: Diagnosis, fitted: FittedModel, done: DesignResult) -> Cure:
    proof, words = done.proof, done.proof.words
    broken = ", ".join(proof.broken_criteria).replace("_", " ")
    why, open_points = [f"not kept: {broken}"] if broken else [], [*proof.diagnostics.blocking]
    running = words.controller()
    lived = day(diagnosis.course, fitted.hypothetical[0], running, running.scan_s)
    _, was, would = times_worse(lived, diagnosis.course)
    if would > was + diagnosis.course.least_degC:
        open_points.append(
            f"the logged day lived with them is worse, mean error {written(was, 2)} → {written(would, 2)} °C")
    why += [f"not proven: {point}" for point in open_points]
    verdict = combined_verdict([proof.verdict, *([NOT_PROVEN] if open_points else [])])
    return Cure(words=words, verdict=verdict, reason="; ".join(why), design=done.ideal,
                pwm_period_s=proof.actuator.pwm_period_s, was_degC=was, would_degC=would)

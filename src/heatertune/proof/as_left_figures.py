"""The criteria of a proof, measured on readings: what a trace shows of them, and what it cannot.

What a trace of the commissioned loop shows: where it begins, what is asked for, and what comes after.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log, LogSignal
from heatertune.model.circumstances import reading_step_degC
from heatertune.model.model_values import HeaterModel
from heatertune.model.statistics import sensor_step
from heatertune.proof.criteria import CRITERION, TIME_OF, CriterionKind, phases_measured
from heatertune.proof.phase_statistics import (
    PhaseMeasure,
    behind_degC,
    beyond_degC,
    first_within,
    offset_degC,
    reserve_pct,
    ripple_degC,
    settling_s,
    swing_degC,
    switchings_per_h,
)
from heatertune.proof.proof_document import ProofView
from heatertune.settings import AsLeftSettings

__all__ = [
    "LEAST_STEP_DEGC", "LEAVES", "ProvenLoop", "TraceMeasurement", "TracePart", "TraceParts", "begins_mid_way",
    "begun_mid_way", "leaves_s", "measured_criteria", "parts_of",
]


_OFF_PCT: Final = 0.5  # a power that is none
_AT_START: Final = 5  # readings whose median is the temperature at the start
_ONE_MOVE: Final = 3  # readings within which setpoints that follow one another are one move: a ramp
LEAST_STEP_DEGC: Final = 0.01  # of a reading, for when a temperature has left its rest
_FARTHER: Final = 3.0  # times as far as it takes to have left the rest: there the slope of the way is seen
_WHOLE: Final = 0.75  # of a whole heat-up: a shorter one begins warm
LEAVES: Final = 3.0  # steps or noise of a reading beyond which the temperature has left its rest


@dataclass(frozen=True, slots=True, kw_only=True)
class TracePart:
    """A part of a trace, from one event to the next.

    Attributes:
        kind: "heat-up", "change" (of the setpoint) or "recovery" (from a load), as `heatertune.proof.scenario.Phase`.
        begin_s, end_s: since the trace's beginning [s].
        setpoint_degC: what is asked for [°C].
        from_degC: what was asked for before, or where the heat-up begins [°C].
    """

    kind: str
    begin_s: float
    end_s: float
    setpoint_degC: float
    from_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceParts:
    """What a trace shows.

    Attributes:
        begins_s: instant in the log at which its first part begins [s].
        begins_by: how that is known: "told", by "setpoint", "power" or "temperature" (it leaves its rest), or it is the
            "first reading".
        unsure_s: how much earlier it may have begun [s].
        start_degC: temperature there [°C].
        step_degC: step or noise of a reading [°C].
        parts: what it shows, in order of time.
        notes: what is odd, one sentence each.
    """

    begins_s: float
    begins_by: str
    unsure_s: float
    start_degC: float
    step_degC: float
    parts: tuple[TracePart, ...]
    notes: tuple[str, ...] = ()

    def delay(self, later_s: float) -> TraceParts:
        """Return the same with the beginning later by so much, and what follows at its instant."""
        first, *others = self.parts
        rest = [replace(part, begin_s=part.begin_s - later_s, end_s=part.end_s - later_s) for part in others]
        return replace(self, begins_s=self.begins_s + later_s,
                       parts=(replace(first, end_s=first.end_s - later_s), *rest))


def parts_of(log: Log, settings: AsLeftSettings, *, setpoint_degC: float, band_degC: float, heats: bool) -> TraceParts:
    """Return what a trace shows.

    Args:
        log: the trace.
        settings: what its user says of it.
        setpoint_degC: what is asked for, where neither the user nor the trace says so [°C].
        band_degC: how far from a setpoint is still right [°C].
        heats: whether power heats; it cools otherwise.

    Raises:
        InputError: nothing in it can be judged: it begins at its setpoint, or beyond it; an instant outside of it.
    """
    moves = _moves(log, settings, setpoint_degC)
    running = _runs(log, moves, band_degC, settings)
    index, by = _begin(log, moves, settings, band_degC, running=running, heats=heats)
    before = 0.0 if index == 0 else float(log.time_s[index] - log.time_s[index - 1])
    begins, unsure = float(log.time_s[index]), before if by in ("setpoint", "power") else _interval_s(log)
    if by == "power":
        power = log.signals["power"]
        begins = float(power.time_s[power.values > _OFF_PCT][0])
    start = float(np.median(log.temperature_degC[max(0, index - _AT_START + 1):index + 1]))
    asked_first = [value for at, value in moves if at <= index][-1]
    _demand_way(log, start, asked_first, band_degC, heats=heats, running=running)
    return TraceParts(
        begins_s=begins, begins_by=by, unsure_s=unsure, start_degC=start, step_degC=reading_step_degC(log),
        parts=tuple(_parts(log, moves, settings, index, begins, start, running=running)), notes=tuple(_doubts(by)))


def leaves_s(time_s: Array, temperature_degC: Array, start_degC: float, end_degC: float, least_degC: float) -> float:
    """Return the last instant before half of a way at which the temperature has not left its start yet [s].

    Args:
        time_s: [s], shape (n,).
        temperature_degC: [°C], shape (n,).
        start_degC: where the way begins [°C].
        end_degC: where it leads [°C].
        least_degC: how far from the start it has left it [°C].
    """
    sign = np.sign(end_degC - start_degC)
    travel_degC = sign * (temperature_degC - start_degC)
    half = np.flatnonzero(travel_degC > 0.5 * abs(end_degC - start_degC))
    still = np.flatnonzero(travel_degC[: int(half[0]) if len(half) else None] <= least_degC)
    return float(time_s[still[-1]]) if len(still) else float(time_s[0])


def begins_mid_way(log: Log, parts: TraceParts, whole_degC: float) -> bool:
    """Return whether a trace begins in the middle of a heat-up: it shows no rest before the temperature moves.

    Args:
        log: the trace.
        parts: what it shows.
        whole_degC: of a heat-up from the ambient to the setpoint of the proof [°C].
    """
    first = parts.parts[0]
    if first.kind != "heat-up" or parts.begins_by not in ("temperature", "first reading", "power"):
        return False  # a power that is off at first may be between two pulses
    if abs(first.setpoint_degC - parts.start_degC) < _WHOLE * whole_degC:
        return True  # it is warm already, and nobody knows since when
    time, temperature = log.time_s, log.temperature_degC
    least = LEAVES * max(parts.step_degC, LEAST_STEP_DEGC)
    start, sign = float(temperature[0]), np.sign(first.setpoint_degC - parts.start_degC)
    travel_degC = sign * (temperature - start)
    departure_s = leaves_s(time, temperature, start, first.setpoint_degC, least) - float(time[0])
    far = min(_FARTHER * least, float(travel_degC.max()))
    if far <= least:
        return True
    # at rest the temperature stays within `least` for longer than it takes to leave it at the slope that follows
    passed = float(time[np.flatnonzero(travel_degC >= far)[0]] - time[0]) - departure_s
    return departure_s <= _interval_s(log) + passed * least / (far - least)


def begun_mid_way(log: Log, parts: TraceParts) -> TraceParts:
    """Return a trace that begins in the middle of a heat-up with its first reading as its beginning."""
    moved = parts.delay(float(log.time_s[0]) - parts.begins_s)
    return replace(moved, begins_by="first reading", start_degC=float(log.temperature_degC[0]), notes=())


def _interval_s(log: Log) -> float:
    return float(np.median(np.diff(log.time_s)))


def _moves(log: Log, settings: AsLeftSettings, setpoint_degC: float) -> list[tuple[int, float]]:
    """Return the reading from which on each setpoint is asked for [°C], the first from the first one on.

    A setpoint that is led to its end, reading by reading, is one move to that end.
    """
    stated_degC = settings.setpoint_degC
    if stated_degC is not None or log.setpoint_degC is None:
        return [(0, setpoint_degC if stated_degC is None else stated_degC)]
    column = log.setpoint_degC
    moves, last = [(0, float(column[0]))], -_ONE_MOVE
    for index in (np.flatnonzero(np.diff(column)) + 1).tolist():
        if index - last < _ONE_MOVE and len(moves) > 1:
            moves[-1] = (moves[-1][0], float(column[index]))
        else:
            moves.append((index, float(column[index])))
        last = index
    return moves


def _runs(log: Log, moves: list[tuple[int, float]], band_degC: float, settings: AsLeftSettings) -> bool:
    """Return whether the loop is at its first setpoint already when another one is asked for."""
    if len(moves) == 1 or settings.begins_s is not None:
        return False
    upto = log.temperature_degC[:moves[1][0]]
    return bool(np.all(np.abs(upto - moves[0][1]) <= band_degC))


def _begin(
    log: Log, moves: list[tuple[int, float]], settings: AsLeftSettings, band_degC: float, *, running: bool, heats: bool
) -> tuple[int, str]:
    """Return the reading with which the first part begins, and how that is known."""
    if settings.begins_s is not None:
        _demand_inside(log, "begins-at", settings.begins_s)
        return int(np.searchsorted(log.time_s, settings.begins_s)), "told"
    sign = 1.0 if heats else -1.0
    if running:
        return moves[1][0], "setpoint"
    calling = [index for index, value in moves if sign * (value - float(log.temperature_degC[index])) > band_degC]
    if not calling or calling[0] > 0:
        return (calling[0], "setpoint") if calling else (0, "first reading")
    power = log.signals.get("power")  # it may be on between two readings alone
    if power is not None and power.values[0] <= _OFF_PCT and np.any(power.values > _OFF_PCT):
        on_s = power.time_s[power.values > _OFF_PCT][0]
        return min(int(np.searchsorted(log.time_s, on_s)), len(log.time_s) - 1), "power"
    if power is not None and power.values[0] > _OFF_PCT:
        return 0, "first reading"
    start = float(np.median(log.temperature_degC[:_AT_START]))
    left = leaves_s(log.time_s, log.temperature_degC, start, moves[0][1], LEAVES * reading_step_degC(log))
    return int(np.searchsorted(log.time_s, left)), "temperature"


def _demand_way(
    log: Log, start_degC: float, setpoint_degC: float, band_degC: float, *, heats: bool, running: bool
) -> None:
    where = f"{log.name}: begins at {start_degC:.4g} °C"
    if not running and abs(setpoint_degC - start_degC) <= band_degC:
        raise InputError(f"{where}, at its setpoint of {setpoint_degC:g} °C: no heat-up and no change of the setpoint "
                         "to be judged; log from before the heater is switched on, or say --setpoint")
    if not running and (setpoint_degC > start_degC) != heats:
        raise InputError(f"{where}, beyond its setpoint of {setpoint_degC:g} °C: log from before the way to it, or say "
                         "--setpoint")


def _demand_inside(log: Log, name: str, instant_s: float) -> None:
    first, last = float(log.time_s[0]), float(log.time_s[-1])
    if not first <= instant_s < last:
        raise InputError(f"--{name} = {instant_s:g} s: {log.name} goes from {first:g} to {last:g} s")


def _parts(
    log: Log, moves: list[tuple[int, float]], settings: AsLeftSettings, index: int, begins: float, start_degC: float, *,
    running: bool
) -> Iterator[TracePart]:
    end = float(log.time_s[-1])
    before = [value for at, value in moves if at <= index]
    events = [("change" if running else "heat-up", begins, before[-1])]
    events += [("change", float(log.time_s[at]), value) for at, value in moves if at > index]
    if settings.load_at_s is not None:
        _demand_inside(log, "load-at", settings.load_at_s)
        if settings.load_at_s <= begins:
            raise InputError(f"--load-at = {settings.load_at_s:g} s: the heat-up of {log.name} begins at {begins:g} s")
        asked_then = [value for _, at, value in sorted(events, key=lambda event: event[1]) if at <= settings.load_at_s]
        events.append(("recovery", settings.load_at_s, asked_then[-1]))
    events.sort(key=lambda event: event[1])
    last = before[-2] if running else start_degC
    for number, (kind, instant, value) in enumerate(events):
        until = events[number + 1][1] if number + 1 < len(events) else end
        yield TracePart(kind=kind, begin_s=instant - begins, end_s=until - begins, setpoint_degC=value, from_degC=last)
        last = value


def _doubts(by: str) -> Iterator[str]:
    if by == "temperature":
        yield ("Neither setpoint nor power in the trace shows when the heat-up began: it is taken from where the "
               "temperature starts to move.")
    elif by == "first reading":
        yield "The heater is on from the first reading on: the heat-up may have begun earlier, and times be longer."


_PERIODS_AT_REST: Final = 3  # PWM periods that a time at rest spans at least
_AT_REST: Final = 10  # readings in it
_SEEN_ON: Final = 1.5  # times as long as it took to get there: before, it may leave the band again
_CALM: Final = 0.1  # of a part: so long within the band, and left again, is more than a swing
_BETWEEN: Final = 1.5  # sampling intervals of the controller: a power written as often is written at each
_EVENLY: Final = 0.01  # of the mean gap: instants as even may be samples in step with the pulses
_OF_PERIOD: Final = 8  # readings in a PWM period that show its pulses and its ripple
_HOUR_S: Final = 3600.0

_NO_EVENT: Final = {
    "heat-up": "no heat-up from cold in the trace", "change": "no change of the setpoint in the trace",
    "small-change": "changes of the setpoint are held against the rise",
    "recovery": "no load in the trace, or its time is not stated (--load-at)",
    "reheat": "the heater's circuit was not open in the trace", "restart": "no start-up of the controller in the trace",
}


class TraceMeasurement(NamedTuple):
    """What a trace shows of a criterion: its value, infinite for what never happened, or None and why not."""

    value: float | None
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PartReadings:
    """The readings of one part, which begins at an instant of the log [s].

    Instants since its begin [s] and distances from its setpoint [°C], shape (n,).
    """

    part: TracePart
    begins_s: float
    time_s: Array
    error_degC: Array
    power: LogSignal | None

    @property
    def length_s(self) -> float:
        return self.part.end_s - self.part.begin_s


class ProvenLoop(NamedTuple):
    """What a proof knows of its loop: the plausible heaters, a count of its reading [°C], its sampling interval [s].

    With the ambient during the trace, if the user states it [°C].
    """

    heaters: Sequence[HeaterModel]
    count_degC: float
    scan_s: float
    ambient_degC: float | None


def measured_criteria(
    log: Log, parts: TraceParts, proof: ProofView, step_degC: float, loop: ProvenLoop, *, forgiven_degC: float = 0.0
) -> dict[str, TraceMeasurement]:
    """Return what a trace shows of each criterion of a proof.

    Times are those of readings: the first one from which on the temperature stays in the band. Extremes are those of
    readings, their noise included; what the temperature does between two of them is not seen.

    Args:
        log: the trace.
        parts: what it shows.
        proof: that it is held against.
        step_degC: of which overshoot is told in percent [°C].
        loop: whose proof it is.
        forgiven_degC: by which each reading is taken nearer to its setpoint [°C]; above 0 a power is the least that the
            trace leaves possible.
    """
    courses = [_course(log, parts, part, forgiven_degC) for part in parts.parts]
    ruler = _Ruler.of(proof, step_degC, loop, log)
    rests = [rest for course in courses if (rest := ruler.rest_of(course)) is not None]
    over_all = {**_at_rest(rests, ruler, at_best=forgiven_degC > 0.0), switchings_per_h: _switchings(log, ruler)}

    def seen(kind: CriterionKind) -> TraceMeasurement:
        if kind.measure in (settling_s, *_OF_PART):
            return ruler.worst(kind, [course for course in courses if course.part.kind in kind.phases])
        return over_all.get(kind.measure) or TraceMeasurement(None, kind.not_in_trace)

    return {name: seen(CRITERION[name]) for name in proof.criteria}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ruler:
    """What the readings are held against.

    Attributes:
        band_degC: how far from the setpoint is right [°C].
        pct: percent of the step in a degree [%/°C].
        limits: of the proof's criteria, None where a number informs.
        rests_after_s: how long after its begin a part is at rest [s].
        period_s: of the PWM [s].
        slowest_s: that a proven run took to be back in the band after a disturbance [s].
        interval_s: between two readings [s].
        highest_degC: highest setpoint of the proof [°C].
        loop: whose proof it is.
        power_interval_s: between two instants of the power; 0: each change of it has its own [s].
        power_step_pct: of the power as it is written [%].
        reading_degC: a step of the readings, or of the controller's own where that is larger [°C].
        proof_ambient_degC: of the proof; None: that of each heater [°C].
    """

    band_degC: float
    pct: float
    limits: Mapping[str, float | None]
    rests_after_s: float
    period_s: float
    slowest_s: float
    interval_s: float
    highest_degC: float
    loop: ProvenLoop
    power_interval_s: float
    power_step_pct: float
    reading_degC: float
    proof_ambient_degC: float | None

    @classmethod
    def of(cls, proof: ProofView, step_degC: float, loop: ProvenLoop, log: Log) -> _Ruler:
        period = proof.actuator.pwm_period_s
        first = phases_measured(proof.scenario, proof.limits, proof.scenario.duration_s, period)[0]
        times = [proof.criteria[name].value for name in ("recovery_time", "change_time") if name in proof.criteria]
        limits = {name: criterion.limit for name, criterion in proof.criteria.items()}
        power = log.signals.get("power")
        return cls(band_degC=limits["limit_cycle"] or proof.limits.tolerance_degC, pct=100.0 / step_degC, limits=limits,
                   rests_after_s=first.rest_s - first.begin_s, period_s=period, interval_s=_interval_s(log),
                   slowest_s=max(times, default=first.end_s), highest_degC=max(proof.scenario.setpoints_degC),
                   loop=loop, power_interval_s=0.0 if power is None else _power_interval_s(log, power),
                   power_step_pct=0.0 if power is None else sensor_step(power.values) or 0.0,
                   reading_degC=max(sensor_step(log.temperature_degC) or 0.0, loop.count_degC),
                   proof_ambient_degC=proof.scenario.ambient_degC)

    @property
    def shows_pulses(self) -> bool:
        """Whether the readings are near enough to one another to show what the PWM does."""
        return _OF_PERIOD * self.interval_s <= self.period_s

    @property
    def shows_power(self) -> bool:
        """Whether the instants of the power are near enough to one another to show its pulses."""
        return _OF_PERIOD * self.power_interval_s <= self.period_s

    def worst(self, kind: CriterionKind, courses: Sequence[_PartReadings]) -> TraceMeasurement:
        """Return what the worst of some parts shows; one that cannot be measured leaves the criterion so."""
        if not courses:
            return TraceMeasurement(None, _NO_EVENT[kind.phases[0]])
        limit, factor = self.limits.get(kind.name), self.pct if kind.of else 1.0
        if kind.measure is settling_s:
            return _worst(self._settled(course, limit) for course in courses)
        limit_s = self.limits.get(TIME_OF[kind.phases[0]])
        return _worst(self._at_most(course, factor * _OF_PART[kind.measure](course, self), limit, limit_s)
                      for course in courses)

    def _settled(self, course: _PartReadings, limit_s: float | None) -> TraceMeasurement:
        first = first_within(course.error_degC, self.band_degC)
        if first == 0:
            long_enough = course.length_s >= min(self.slowest_s, math.inf if limit_s is None else limit_s)
            return TraceMeasurement(0.0) if long_enough else TraceMeasurement(
                None, f"within the band, but seen for {course.length_s:.0f} s only")
        if first < len(course.time_s):
            settled = float(course.time_s[first])
            if course.length_s < min(_SEEN_ON * settled, math.inf if limit_s is None else limit_s):
                return TraceMeasurement(None, f"within the band from {settled:.0f} s on, but seen for "
                            f"{course.length_s - settled:.0f} s more only")
            calm_s = self._calm_before(course)
            return TraceMeasurement(settled, f"stays there for the {course.length_s - settled:.0f} s that follow"
                                    if calm_s is None
                        else f"within the band before that, and left it at {course.begins_s + calm_s:.0f} s: where a "
                        f"load came then, say --load-at {course.begins_s + calm_s:.0f}")
        if limit_s is not None and course.length_s >= limit_s:
            return TraceMeasurement(math.inf)
        return TraceMeasurement(None,
                                f"not yet within ±{self.band_degC:.3g} °C after {course.length_s:.0f} s, where it ends")

    def _calm_before(self, course: _PartReadings) -> float | None:
        """Return when the temperature left the band after a long time within it [s], None where it did not."""
        outside = np.flatnonzero(np.abs(course.error_degC) > self.band_degC)
        apart = np.diff(course.time_s[outside])
        calm = np.flatnonzero(apart > max(_CALM * course.length_s, _AT_REST * self.interval_s))
        return float(course.time_s[outside[calm[0] + 1]]) if len(calm) else None

    def _at_most(self, course: _PartReadings, largest: float, limit: float | None,
                 limit_s: float | None) -> TraceMeasurement:
        """Return the largest distance of a part, unless a larger one may come: it is not seen to settle yet."""
        if self._settled(course, limit_s).value is None and (limit is None or largest <= limit):
            return TraceMeasurement(None, f"the trace ends after {course.length_s:.0f} s, before it is seen to settle")
        return TraceMeasurement(largest)

    def rest_of(self, course: _PartReadings) -> _PartReadings | None:
        """Return the readings of a part at rest, None where there are too few."""
        at_rest = course.time_s >= self.rests_after_s
        long_enough = course.length_s - self.rests_after_s >= _PERIODS_AT_REST * self.period_s
        if not long_enough or np.count_nonzero(at_rest) < _AT_REST:
            return None
        time = course.time_s[at_rest]
        return replace(course, time_s=time, error_degC=course.error_degC[at_rest],
                       power=course.power and course.power.window(float(time[0]), float(time[-1])))


def _course(log: Log, parts: TraceParts, part: TracePart, forgiven_degC: float) -> _PartReadings:
    since = log.time_s - parts.begins_s
    inside = (since >= part.begin_s) & (since <= part.end_s)
    if part is not parts.parts[-1]:
        inside &= since < part.end_s
    error, time = log.temperature_degC[inside] - part.setpoint_degC, since[inside] - part.begin_s
    power = log.signals.get("power")
    if power is not None and len(time):
        power = power._replace(time_s=power.time_s - parts.begins_s - part.begin_s).window(time[0], time[-1])
    return _PartReadings(part=part, begins_s=parts.begins_s + part.begin_s, time_s=time, power=power,
                   error_degC=np.sign(error) * np.maximum(np.abs(error) - forgiven_degC, 0.0))


def _worst(measurements: Iterable[TraceMeasurement]) -> TraceMeasurement:
    entries = list(measurements)
    with_value = [item for item in entries if item.value is not None]
    without_value = [item for item in entries if item.value is None]
    if not with_value:
        return without_value[0]
    return max(with_value, key=lambda entry: entry.value if entry.value is not None else 0.0)


def _beyond(course: _PartReadings, ruler: _Ruler) -> float:
    """Return how far the readings go beyond the setpoint [°C]; after a load, on the side to which they leave first."""
    if course.part.kind == "recovery":
        return _after_load(course, ruler)[0]
    sign = math.copysign(1.0, course.part.setpoint_degC - course.part.from_degC)
    return max(0.0, float((sign * course.error_degC).max()))


def _behind(course: _PartReadings, ruler: _Ruler) -> float:
    """Return how far the readings go to the other side after a load [°C]."""
    return _after_load(course, ruler)[1]


def _after_load(course: _PartReadings, ruler: _Ruler) -> tuple[float, float]:
    """Return the largest distances after a load [°C]: on the side to which the temperature leaves first, and beyond."""
    outside = np.flatnonzero(np.abs(course.error_degC) > ruler.band_degC)
    first = outside[0] if len(outside) else int(np.abs(course.error_degC).argmax())
    along = math.copysign(1.0, float(course.error_degC[first])) * course.error_degC
    return max(0.0, float(along.max())), max(0.0, float(-along.min()))


#: what one part shows, beside the time that it takes
_OF_PART: Final[dict[PhaseMeasure | None, Callable[[_PartReadings, _Ruler], float]]] = {
    beyond_degC: _beyond, behind_degC: _behind}


def _at_rest(
    rests: Sequence[_PartReadings], ruler: _Ruler, *, at_best: bool
) -> dict[PhaseMeasure | None, TraceMeasurement]:
    """Return what the readings at rest show."""
    if not rests:
        why = TraceMeasurement(None, f"no rest in the trace: it begins {ruler.rests_after_s:.0f} s after the setpoint "
                                     "change")
        return dict.fromkeys((offset_degC, swing_degC, ripple_degC, reserve_pct), why)
    return {
        offset_degC: TraceMeasurement(max(abs(_mean(rest.time_s, rest.error_degC)) for rest in rests)),
        swing_degC: TraceMeasurement(max(float(np.ptp(rest.error_degC)) / 2.0 for rest in rests)),
        ripple_degC: TraceMeasurement(max(_ripple(rest, ruler.period_s) for rest in rests)) if ruler.shows_pulses
        else _too_slow(ruler),
        reserve_pct: _reserve(rests, ruler, at_best=at_best),
    }


def _reserve(rests: Sequence[_PartReadings], ruler: _Ruler, *, at_best: bool) -> TraceMeasurement:
    """Return the power that is left over at rest at the highest setpoint."""
    at_highest = [rest for rest in rests if abs(rest.part.setpoint_degC - ruler.highest_degC) <= ruler.band_degC
                  and rest.part.kind != "recovery" and rest.power is not None]
    if not at_highest:
        return TraceMeasurement(None, "no power at the highest setpoint's rest in the trace")
    if any(map(_is_pulses, at_highest)) and not ruler.shows_power:
        return _too_slow(ruler)  # in step with the period, the mean of such readings may be any
    least, unsure = min(((100.0 - _mean_power(rest), _unsure_pct(rest, ruler)) for rest in at_highest),
                        key=lambda entry: entry[0] + at_best * entry[1].total)
    return TraceMeasurement(least + at_best * (unsure.total + _of_room_pct(ruler)), unsure.summary)


def _mean(time_s: Array, values: Array) -> float:
    return float(0.5 * np.diff(time_s) @ (values[1:] + values[:-1]) / (time_s[-1] - time_s[0]))


def _mean_power(rest: _PartReadings) -> float:
    """Return the mean of a power that is held from one of its instants to the next [%]."""
    assert rest.power is not None
    time, end = rest.power.time_s, rest.time_s[-1]
    held_s = np.diff(time if time[-1] == end else np.append(time, end))
    return float(np.sum(rest.power.values[:len(held_s)] * held_s) / (end - rest.time_s[0]))


class _PowerTolerance(NamedTuple):
    """By how much a mean power may be below what a trace shows [% of full power], by what that follows from.

    Attributes:
        resolution: half a step of the power as written; of sampled pulses one sample in each period, of another sampled
            power twice the standard error of its mean.
        reading: what it takes to hold half a step of the readings, and what they are beyond the setpoint on average.
        ripple: what it takes to hold half the ripple of the PWM, of which a controller in step with it sees one side.
        length: heat that went into the heater since the rest began, and the part of a PWM period at its end.
        length_s: of the rest [s].
    """

    resolution: float
    reading: float
    ripple: float
    length: float
    length_s: float

    @property
    def total(self) -> float:
        return self.resolution + self.reading + self.ripple + self.length

    @property
    def summary(self) -> str:
        return (f"known to within {self.total:.2g} %: {self.resolution:.2g} % for the steps of the power, "
                f"{self.reading:.2g} % for those of the readings, {self.ripple:.2g} % for the ripple, "
                f"{self.length:.2g} % for a rest of {self.length_s:.0f} s")


def _unsure_pct(rest: _PartReadings, ruler: _Ruler) -> _PowerTolerance:
    """Return what a mean power at rest is known to within."""
    assert rest.power is not None
    length, interval, duty = float(np.ptp(rest.time_s)), ruler.power_interval_s, _mean_power(rest) / 100.0
    swing = 100.0 * abs(duty * (1.0 - duty)) * ruler.period_s  # of the energy within a PWM period [% s]
    if _is_pulses(rest):
        resolution, cut = 100.0 * interval / ruler.period_s, swing / length  # it may end within a period
    else:
        between = interval > _BETWEEN * ruler.loop.scan_s  # it is set more often than it is written
        spread = 2.0 * float(np.std(rest.power.values)) / math.sqrt(len(rest.power.values))
        resolution, cut = ruler.power_step_pct / 2.0 + between * spread, 0.0
    sign = math.copysign(1.0, ruler.loop.heaters[0].gain_degC_per_pct)
    slope, mean = float(np.polyfit(rest.time_s, rest.error_degC, 1)[0]), _mean(rest.time_s, rest.error_degC)
    warmed, beyond = max(0.0, sign * slope * length) + ruler.reading_degC, max(0.0, sign * mean)
    gains = [abs(heater.gain_degC_per_pct) for heater in ruler.loop.heaters]
    slowest = max(sum(heater.lags_s) / gain for heater, gain in zip(ruler.loop.heaters, gains, strict=True))
    reading_pct = (ruler.reading_degC / 2.0 + beyond) / min(gains)
    fastest = min(max(heater.lags_s) for heater in ruler.loop.heaters)
    return _PowerTolerance(resolution, reading_pct, swing / 2.0 / fastest, cut + slowest * warmed / length, length)


def _of_room_pct(ruler: _Ruler) -> float:
    """Return the power that a room as the user states it takes more than that of the proof [% of full power]."""
    if ruler.loop.ambient_degC is None:
        return 0.0
    rooms = [heater.ambient_degC if ruler.proof_ambient_degC is None else ruler.proof_ambient_degC
             for heater in ruler.loop.heaters]
    return max((float(room or 0.0) - ruler.loop.ambient_degC) / heater.gain_degC_per_pct
               for room, heater in zip(rooms, ruler.loop.heaters, strict=True))


def _power_interval_s(log: Log, power: LogSignal) -> float:
    """Return how far apart the instants of a power are [s]; 0: there is one for each of its changes, and no others."""
    gaps = np.diff(power.time_s)
    if power.time_s is not log.time_s and len(gaps) and np.all(np.diff(power.values) != 0.0) and (
            float(np.ptp(gaps)) > _EVENLY * float(gaps.mean())):
        return power.late_s
    return float(np.median(gaps)) if len(gaps) else 0.0


def _is_pulses(rest: _PartReadings) -> bool:
    """Return whether a power is that of a switch, not that asked for."""
    assert rest.power is not None
    return bool(np.isin(rest.power.values, (0.0, 100.0)).all())


def _ripple(rest: _PartReadings, period_s: float) -> float:
    number = ((rest.time_s - rest.time_s[0]) / period_s).astype(int)
    _, firsts = np.unique(number, return_index=True)
    return float(np.median(np.maximum.reduceat(rest.error_degC, firsts)[:-1]
                           - np.minimum.reduceat(rest.error_degC, firsts)[:-1]))


def _too_slow(ruler: _Ruler) -> TraceMeasurement:
    return TraceMeasurement(None, f"a reading every {ruler.interval_s:.3g} s does not show a PWM period of "
                                  f"{ruler.period_s:.3g} s")


def _switchings(log: Log, ruler: _Ruler) -> TraceMeasurement:
    power = log.signals.get("power")
    if power is None or not np.isin(power.values, (0.0, 100.0)).all():
        return TraceMeasurement(None, "the heater's switch is not in the trace")
    if not ruler.shows_power:
        return _too_slow(ruler)
    closings = float(np.count_nonzero(np.diff(power.values) > 0.0))
    return TraceMeasurement(closings / (float(np.ptp(log.time_s)) / _HOUR_S))

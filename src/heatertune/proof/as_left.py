"""As-left test: a trace of the commissioned loop compared with the proof of its words.

Its figures are the criteria of the proof, measured on the readings. Its curve is compared with the band between the
lowest and the highest proven run, all of them repeated from the initial state and setpoint of the trace. What the
trace does not show is reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.codec import LEFT_OUT, OrInfinite, register_schema
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.circumstances import reading_step_degC
from heatertune.model.model_values import FittedModel
from heatertune.model.reduction import cools
from heatertune.model.statistics import sensor_step
from heatertune.options import merge_options
from heatertune.plc import Words
from heatertune.plc.controller import controller_for
from heatertune.processors import ProgressCallback
from heatertune.proof.as_left_figures import (
    LEAST_STEP_DEGC,
    LEAVES,
    ProvenLoop,
    TraceMeasurement,
    TracePart,
    TraceParts,
    begins_mid_way,
    begun_mid_way,
    leaves_s,
    measured_criteria,
    parts_of,
)
from heatertune.proof.criteria import TIME_OF, CriterionView
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.proof_document import ProofView
from heatertune.proof.runs import Runs
from heatertune.proof.scenario import NewSetpoint, Scenario
from heatertune.proof.trace import Trace
from heatertune.proof.verdict import Coverage
from heatertune.settings import AsLeftSettings
from heatertune.units import count

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import AsLeftOptions

__all__ = ["AS_LEFT_SCHEMA", "AsLeft", "Foretold", "Measurement", "Outside", "as_left", "foretold", "foretold_mid_way"]


_OF_PERIOD: Final = 8  # instants in a PWM period
_MOST: Final = 20_000  # instants of a run
_LONGEST: Final = 0.25  # of the whole proof, for a way to the first reading that never settles
#: where a heat-up may have begun, as shares of the way from the ambient to the first reading
_STARTS: Final = (0.0, 0.5, 1.0)


class Foretold(NamedTuple):
    """Runs: instants since the trace's begin, shape (n,) [s], and temperatures, shape (runs, n) [°C]."""

    time_s: Array
    temperature_degC: Array

    def band(self, since_s: Array, early_s: float, late_s: float) -> tuple[Array, Array]:
        """Return the lowest and highest temperature around some instants, [t − early, t + late], shapes (n,) [°C]."""
        low, high = self.temperature_degC.min(axis=0), self.temperature_degC.max(axis=0)
        step = self.time_s[1] - self.time_s[0]
        begins = np.clip(np.floor((since_s - early_s) / step).astype(int), 0, len(self.time_s) - 1)
        ends = np.clip(np.ceil((since_s + late_s) / step).astype(int) + 1, begins + 1, len(self.time_s))
        around = [(low[begin:end].min(), high[begin:end].max()) for begin, end in zip(begins, ends, strict=True)]
        lows, highs = zip(*around, strict=True)
        return np.array(lows), np.array(highs)


def foretold(
    words: Words, fitted: FittedModel, proof: ProofView, parts: TraceParts, ambient_degC: float | None = None,
    progress: ProgressCallback = str,
) -> Foretold:
    """Return what every proven run does from where a trace begins, up to its first load or its end.

    Args:
        words: that were proven.
        fitted: the heater they were proven on.
        proof: of the words.
        parts: what the trace shows.
        ambient_degC: temperature without power; None: as in the proof [°C].
        progress: called with how far the runs are.

    Raises:
        InputError: other heaters than those of the proof, or as `heatertune.proof.simulate`.
        OutOfRange: a setpoint that the sensor does not see or no heater reaches.
    """
    calm_parts = parts.parts[:_loaded(parts.parts)]
    scenario, before_s = _scenario(calm_parts, parts, proof, ambient_degC)
    traces, step = list[Array](), _step_s(proof, calm_parts[-1].end_s)
    for trace in _traces(words, fitted, proof, scenario, progress):
        time = np.arange(0.0, min(calm_parts[-1].end_s, float(trace.time_s[-1]) - before_s), step)
        traces.append(trace.temperature_at(before_s + time))
    return Foretold(time, np.array(traces))


def foretold_mid_way(
    words: Words, fitted: FittedModel, proof: ProofView, parts: TraceParts, margin_degC: float,
    ambient_degC: float | None = None, progress: ProgressCallback = str,
) -> tuple[Foretold, float, float]:
    """Return what every proven run does after it has come to where a trace begins in the middle of its heat-up.

    Nobody knows where that heat-up began, nor when. The runs begin at the ambient, at the first reading and half way
    between; each is moved so that it passes the first reading where the trace begins.

    Args:
        words: that were proven.
        fitted: the heater they were proven on.
        proof: of the words.
        parts: what the trace shows; only its first part is foretold.
        margin_degC: by which the first reading may be off [°C].
        ambient_degC: temperature without power; None: as in the proof, else as each heater has it [°C].
        progress: called with how far the runs are.

    Returns:
        the runs, how much earlier and later than the first reading they may have passed it, and how long before it
        the heat-up may have begun [s].

    Raises:
        InputError, OutOfRange: as `foretold`.
    """
    first, end_s = parts.parts[0], parts.parts[0].end_s
    heaters = dict(labelled_heaters(fitted))
    scenario, _ = _scenario((first,), parts, proof, ambient_degC)
    cold = [float(model.ambient_degC or 0.0) for model in heaters.values()] if scenario.ambient_degC is None else [
        scenario.ambient_degC]
    goes_up = first.setpoint_degC > parts.start_degC
    coldest = min([*cold, parts.start_degC]) if goes_up else max([*cold, parts.start_degC])
    step, rows, passes = _step_s(proof, end_s), list[Array](), list[tuple[float, float, float]]()
    time, settles_s = np.arange(0.0, end_s, step), proof.criteria["settling_time"].value
    longest_s = settles_s if math.isfinite(settles_s) else _LONGEST * proof.scenario.duration_s
    for share in _STARTS:
        start = coldest + share * (parts.start_degC - coldest)
        run_scenario = replace(scenario, start_degC=start, duration_s=scenario.duration_s + longest_s)
        for trace in _traces(words, fitted, proof, run_scenario, progress):
            passed = _passes(trace, start, parts.start_degC, margin_degC, goes_up=goes_up)
            if passed is not None:
                passes.append(passed)
                rows.append(trace.temperature_at(np.minimum(passed[1] + time, float(trace.time_s[-1]))))
    if not rows:
        raise InputError(f"no proven run comes to {parts.start_degC:.4g} °C, where the trace begins; log from before "
                         "the heater is switched on")
    unsure = max(max(middle - early, late - middle) for early, middle, late in passes)
    return Foretold(time, np.array(rows)), unsure, max(late for _, _, late in passes)


def _passes(
    trace: Trace, start_degC: float, first_degC: float, margin_degC: float, *, goes_up: bool
) -> tuple[float, float, float] | None:
    """Return when a run passes a temperature less a margin, the temperature, and with the margin [s]; None: never."""
    sign = 1.0 if goes_up else -1.0
    travel_degC = sign * (trace.temperature_degC - start_degC)
    way = sign * (first_degC - start_degC)
    crossings = [np.flatnonzero(travel_degC >= way + off) for off in (-margin_degC, 0.0, margin_degC)]
    if not len(crossings[0]):
        return None
    early = float(trace.time_s[crossings[0][0]])
    middle = float(trace.time_s[crossings[1][0]]) if len(crossings[1]) else early
    late = float(trace.time_s[crossings[2][0]]) if len(crossings[2]) else middle
    return early, middle, late


def _step_s(proof: ProofView, end_s: float) -> float:
    return max(proof.actuator.pwm_period_s / _OF_PERIOD, end_s / _MOST)


def _traces(
    words: Words, fitted: FittedModel, proof: ProofView, scenario: Scenario, progress: ProgressCallback
) -> Iterator[Trace]:
    """Yield every run of a proof in another scenario; errors as `foretold`."""
    heaters = dict(labelled_heaters(fitted))
    ran = [(run.model, dict(run.switches), None) for run in proof.runs if run.mains_power is None]
    if missing := [model for model, *_ in ran if model not in heaters]:
        raise InputError(f"proof.json: runs: on {missing[0]!r}, which is none of the plausible heaters of model.json")
    models = [(label, heaters[label]) for label in dict.fromkeys(model for model, *_ in ran)]
    runs = Runs.of(
        controller_for(words.target), words, models, scenario, proof.actuator, proof.limits,
        Coverage(stated_settings=proof.stated_settings, only=ran), interlock=proof.interlock)
    for run in range(len(runs.cases)):
        progress(f"running what was proven ({run + 1} of {len(runs.cases)})")
        yield runs.trace(run, direct=True)


def _loaded(parts: Sequence[TracePart]) -> int:
    """Return the number of the first part with a load, of which nobody knows how large it is."""
    return next((number for number, part in enumerate(parts) if part.kind == "recovery"), len(parts))


def _scenario(
    sections: Sequence[TracePart], parts: TraceParts, proof: ProofView, ambient_degC: float | None
) -> tuple[Scenario, float]:
    """Return what the runs live through, and when in it the trace begins [s]."""
    first, *later = sections
    scan = proof.sample_time_s
    ambient = proof.scenario.ambient_degC if ambient_degC is None else ambient_degC
    events = [NewSetpoint(time_s=part.begin_s, setpoint_degC=part.setpoint_degC) for part in later]
    plain = replace(proof.scenario, ambient_degC=ambient, disturbances=(), rests_s=())
    if first.kind == "heat-up":
        return replace(plain, setpoint_degC=first.setpoint_degC, start_degC=parts.start_degC,
                       duration_s=sections[-1].end_s + 2.0 * scan, disturbances=tuple(events)), 0.0
    # the loop is at rest at another setpoint before the trace begins: there the runs get first, as in the proof
    before = proof.scenario.disturbances[0].time_s if proof.scenario.disturbances else proof.scenario.duration_s
    before = scan * np.ceil(before / scan)
    moved = [NewSetpoint(time_s=before + max(0.0, part.begin_s), setpoint_degC=part.setpoint_degC) for part in sections]
    return replace(plain, setpoint_degC=first.from_degC, start_degC=None, disturbances=tuple(moved),
                   duration_s=before + sections[-1].end_s + 2.0 * scan), float(before)


AS_LEFT_SCHEMA: Final = "heatertune/as-left/2"

Numbers = tuple[float, ...]

_NEIGHBOURS: Final = 2  # readings outside the band one after the other that are more than a disturbed one
_SIGMAS: Final = 3.0  # of a reading's step or noise, which the band is widened by
_SEEN_OF_WAY: Final = 0.5  # of a heat-up that began before the trace: less of it shows too little
_STILL: Final = 10  # equal readings one after the other that may be a frozen sensor's
_DRAWN: Final = 1500  # instants of a picture
_ENDS: Final = frozenset(TIME_OF.values())
_LESS_RESERVE: Final = ": a weaker heater, a lower mains voltage, or a room colder than in the proof (--ambient)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One criterion of the acceptance test: limit, proven worst, measured.

    Attributes:
        name: of the criterion.
        unit: of all three.
        bound: whether it must be at most the limit or at least.
        limit: None: the number informs.
        worst: of all proven runs; infinite: never, or without end.
        measured: on the trace; infinite: never; None: it does not show it.
        told: why it does not, or what belongs to the number.
        keeps: whether the limit is kept; None: not measured.
        as_proven: whether it is no worse than the worst proven, within what the readings can tell; None: not measured.
    """

    name: str
    unit: str
    bound: Literal["<=", ">="]
    limit: float | None
    worst: OrInfinite
    measured: float | Literal["never"] | None
    message: str
    keeps: bool | None
    as_proven: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Outside:
    """A stretch of a trace outside of what the proven runs do.

    Attributes:
        begin_s, end_s: its first and last reading, since the trace's begin [s].
        most_degC: how far at the most, above the band, or negative below it [°C].
    """

    begin_s: float
    end_s: float
    most_degC: float


@register_schema(AS_LEFT_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class AsLeft:
    """A trace beside the proof.

    Attributes:
        trace: name of the log.
        digest: of the proof that it is held against.
        verdict: "AS PROVEN"; "NOT AS PROVEN": a limit is broken, a figure is worse than the worst proven, or the curve
            is outside of what the proven runs do; "NOT SHOWN": none of these, but the loop is not seen to settle.
        told: why, one sentence each.
        notes: what to know of the trace, one sentence each.
        setpoint_degC, start_degC: of its first part [°C].
        begins_s, begins_by, unsure_s: see `TraceParts`.
        interval_s, step_degC: between two readings [s], and of one reading [°C].
        measurements: in the order of the proof's criteria.
        outside: of the band, in order of time.
        margin_degC: by which the band is widened for what a reading cannot tell [°C].
        time_s, temperature_degC, power_pct: the trace, since its begin, as a picture shows it.
        power_s: instants of the power, since the trace's begin [s]; None: `time_s`.
        band_s, low_degC, high_degC: the band, not widened.
    """

    trace: str
    digest: str
    verdict: Literal["AS PROVEN", "NOT AS PROVEN", "NOT SHOWN"]
    messages: tuple[str, ...]
    notes: tuple[str, ...]
    setpoint_degC: float
    start_degC: float
    begins_s: float
    begins_by: str
    unsure_s: float
    interval_s: float
    step_degC: float
    measurements: tuple[Measurement, ...]
    outside: tuple[Outside, ...]
    margin_degC: float
    time_s: Numbers
    temperature_degC: Numbers
    power_pct: Numbers | None
    band_s: Numbers
    low_degC: Numbers
    high_degC: Numbers
    power_s: Numbers | None = field(default=None, metadata=LEFT_OUT)


def as_left(
    log: Log, words: Words, fitted: FittedModel, proof: ProofView, settings: AsLeftSettings | None = None, *,
    progress: ProgressCallback = str, **changed: Unpack[AsLeftOptions],
) -> AsLeft:
    """Return a trace of the commissioned loop beside what was proven of its words.

    Args:
        log: the trace, as `read_log` returns it.
        words: that the PLC holds.
        fitted: the heater they were proven on.
        proof: of the words.
        settings: what is known beside the trace; None: nothing.
        progress: called with how far the runs are.
        changed: fields of the settings that are other than in `settings`.

    Raises:
        InputError: a trace in which nothing can be judged; as `foretold`.
        OutOfRange: a setpoint that the sensor does not see or no heater reaches.
    """
    if proof.actuator.cooling_gain is None:
        log.demand_heater_alone("which was not proven; the temperature is compared without its power: "
                                "--power-column none")
    options, heats = merge_options(AsLeftSettings, settings, changed), not cools(fitted)
    parts = parts_of(log, options, setpoint_degC=proof.scenario.setpoint_degC, band_degC=_band_degC(proof), heats=heats)
    runs = foretold(words, fitted, proof, parts, options.ambient_degC, progress)
    early, late = 0.0 if parts.begins_by == "power" else words.sample_time_s, parts.unsure_s
    temperature, margin, before_s = log.temperature_degC, _margin_degC(log, words, fitted), 0.0
    if begins_mid_way(log, parts, _step_degC(parts, fitted, proof, mid_way=True)):
        parts = begun_mid_way(log, parts)
        runs, unsure, before_s = foretold_mid_way(words, fitted, proof, parts, margin, options.ambient_degC, progress)
        early = late = unsure + parts.unsure_s + words.sample_time_s
    elif parts.begins_by == "temperature":
        parts, early, late = _placed(log, parts, runs)
        early += words.sample_time_s
    elif parts.begins_by == "first reading":
        late += _before_first_s(log, parts, runs)
    since = log.time_s - parts.begins_s
    shown = since[(since >= 0.0) & (since <= runs.time_s[-1])]
    low, high = runs.band(shown, early, late)
    beyond = _beyond(temperature[np.isin(since, shown)], low - margin, high + margin)
    outside = tuple(_outside(shown, beyond))
    step = _step_degC(parts, fitted, proof, mid_way=before_s > 0.0)
    loop = ProvenLoop([model for _, model in labelled_heaters(fitted)], _count_degC(words), words.sample_time_s,
                      options.ambient_degC)
    figures = measured_criteria(log, parts, proof, step, loop)
    at_best = measured_criteria(log, parts, proof, step, loop, forgiven_degC=margin)
    slack_s = parts.unsure_s + float(np.median(np.diff(log.time_s)))
    lines = tuple(_measurement(name, criterion, figures[name], at_best[name], slack_s,
                               before_s if name == TIME_OF["heat-up"] else 0.0)
                  for name, criterion in proof.criteria.items())
    against = tuple(_against(lines, outside))
    whole_degC = step if before_s > 0.0 else 0.0
    unseen = (*_frozen(since, temperature, runs, _count_degC(words)), *_unseen(parts, lines),
              *_too_late(parts, lines, whole_degC))[:1]
    drawn, banded = _drawn(since, temperature), _drawn(shown, low, high)
    return AsLeft(
        trace=log.name, digest=proof.digest, messages=against or unseen,
        verdict="NOT AS PROVEN" if against else "NOT SHOWN" if unseen else "AS PROVEN",
        notes=(*parts.notes, *_mid_way(before_s), *_notes(log, parts, proof, margin), *_alone(beyond, outside)),
        setpoint_degC=parts.parts[0].setpoint_degC, start_degC=parts.start_degC, begins_s=parts.begins_s,
        begins_by=parts.begins_by, unsure_s=parts.unsure_s, interval_s=float(np.median(np.diff(log.time_s))),
        step_degC=parts.step_degC, measurements=lines, outside=outside, margin_degC=margin,
        time_s=_numbers(since[drawn]), temperature_degC=_numbers(temperature[drawn]),
        **_drawn_power(log, parts.begins_s, drawn),
        band_s=_numbers(shown[banded]), low_degC=_numbers(low[banded]), high_degC=_numbers(high[banded]))


def _band_degC(proof: ProofView) -> float:
    """Return how far from the setpoint is right, as the proof judged it [°C]."""
    return proof.criteria["limit_cycle"].limit or proof.limits.tolerance_degC


def _margin_degC(log: Log, words: Words, fitted: FittedModel) -> float:
    """Return what a reading cannot tell, and what the best of the plausible heaters left over of its own log [°C]."""
    step = sensor_step(log.temperature_degC) or 0.0
    reading = reading_step_degC(log)
    noise = _SIGMAS * reading if reading > step else step
    left = [candidate.rmse_degC for candidate in fitted.candidates if math.isfinite(candidate.rmse_degC)]
    return max(noise, _count_degC(words)) + min(left, default=0.0)


def _count_degC(words: Words) -> float:
    """Return the step of the controller's own reading [°C]."""
    scale = words.scaling
    return scale.span_degC / controller_for(words.target).sensor(scale).counts


def _placed(log: Log, parts: TraceParts, runs: Foretold) -> tuple[TraceParts, float, float]:
    """Return a trace that begins as long before its temperature leaves its rest as the runs do, and how sure that is.

    Returns:
        the trace, and how far before and after an instant of it the runs may be at the same place [s].
    """
    waits = _waits_s(parts, runs)
    middle = float(np.median(waits))
    before = min(middle, parts.begins_s - float(log.time_s[0]))
    # a run that waits longer is at the place of the trace later than the trace is
    return parts.delay(-before), max(0.0, before - min(waits)), max(0.0, max(waits) - before) + parts.unsure_s


def _before_first_s(log: Log, parts: TraceParts, runs: Foretold) -> float:
    """Return how long before the first reading a heat-up may have begun whose rest the trace still shows [s]."""
    least = LEAVES * max(parts.step_degC, LEAST_STEP_DEGC)
    shown = leaves_s(log.time_s, log.temperature_degC, parts.start_degC, parts.parts[0].setpoint_degC, least)
    return max(0.0, max(_waits_s(parts, runs)) - (shown - float(log.time_s[0])))


def _waits_s(parts: TraceParts, runs: Foretold) -> list[float]:
    """Return how long after its beginning the temperature of each run leaves its rest [s]."""
    least, goal = LEAVES * max(parts.step_degC, LEAST_STEP_DEGC), parts.parts[0].setpoint_degC
    return [leaves_s(runs.time_s, run, float(run[0]), goal, least) for run in runs.temperature_degC]


def _step_degC(parts: TraceParts, fitted: FittedModel, proof: ProofView, *, mid_way: bool) -> float:
    """Return the step of which overshoot is told in percent: that of the whole heat-up, else that of the proof [°C]."""
    first = parts.parts[0]
    if first.kind == "heat-up" and not mid_way:
        return abs(first.setpoint_degC - parts.start_degC)
    nominal = dict(labelled_heaters(fitted))[proof.runs[0].model]
    ambient = nominal.ambient_degC if proof.scenario.ambient_degC is None else proof.scenario.ambient_degC
    return abs(proof.scenario.setpoint_degC - float(ambient or 0.0))


def _beyond(own: Array, low: Array, high: Array) -> Array:
    """Return how far each reading is above a band, negative below it, 0 within [°C], shape (n,)."""
    return np.asarray(np.maximum(own - high, 0.0) - np.maximum(low - own, 0.0))


def _outside(since: Array, beyond: Array) -> Iterator[Outside]:
    """Return the stretches of neighbouring readings outside of a band, on one side of it."""
    edges = np.flatnonzero(np.diff(np.sign(beyond))) + 1
    for stretch in np.split(np.arange(len(beyond)), edges):
        if len(stretch) >= _NEIGHBOURS and beyond[stretch[0]] != 0.0:
            most = beyond[stretch][np.abs(beyond[stretch]).argmax()]
            yield Outside(begin_s=float(since[stretch[0]]), end_s=float(since[stretch[-1]]), most_degC=float(most))


def _alone(beyond: Array, outside: Sequence[Outside]) -> Iterator[str]:
    """Tell of readings outside of the band that have no neighbour there."""
    if not outside and (lone := np.count_nonzero(beyond)):
        yield f"{count(int(lone), 'reading')} outside the band without a neighbour there: taken as disturbed."


def _measurement(
    name: str, criterion: CriterionView, measurement: TraceMeasurement, at_best: TraceMeasurement, slack_s: float,
    before_s: float
) -> Measurement:
    """Return a criterion on the trace; before_s: how much longer it may have lasted before the trace began [s]."""
    value, keeps, as_proven = measurement.value, None, None
    if value is not None and before_s > 0.0 and criterion.keeps(value) and not criterion.keeps(value + before_s):
        measurement = TraceMeasurement(None, f"{value:.0f} s of the trace, and up to {before_s:.0f} s before it")
        value = None
    if value is not None:
        best = value if at_best.value is None else at_best.value
        slack = slack_s if criterion.unit == "s" else 0.0
        keeps = criterion.keeps(value)
        as_proven = best >= criterion.value if criterion.bound == ">=" else best <= criterion.value + slack
    return Measurement(
        name=name, unit=criterion.unit, bound=criterion.bound, limit=criterion.limit, worst=criterion.value,
        measured="never" if value is not None and math.isinf(value) else value, message=measurement.note, keeps=keeps,
        as_proven=as_proven)


def _against(lines: Sequence[Measurement], outside: Sequence[Outside]) -> Iterator[str]:
    """Tell what speaks against the loop's being as proven."""
    for line in lines:
        quantity = line.name.replace("_", " ")
        if line.keeps is False:
            yield f"The {quantity} does not keep its limit{f': {line.message}' if '--load-at' in line.message else ''}."
        elif line.as_proven is False:
            reason = _LESS_RESERVE if line.name == "power_reserve" else ""
            yield f"The {quantity} is worse than that of every proven run{reason}."
    if outside:
        worst = max(outside, key=lambda stretch: abs(stretch.most_degC))
        side = "above" if worst.most_degC > 0.0 else "below"
        others = f", and elsewhere {count(len(outside) - 1, 'time')}" if len(outside) > 1 else ""
        yield (f"From {worst.begin_s:.0f} to {worst.end_s:.0f} s the curve is up to {abs(worst.most_degC):.3g} °C "
               f"{side} the proven runs{others}: it is another heater, or other parameters.")


def _mid_way(before_s: float) -> Iterator[str]:
    """Yield the note that the heat-up began before the trace, where it did."""
    if before_s > 0.0:
        yield (f"The trace begins in the middle of a heat-up, up to {before_s:.0f} s after it began: where and when it "
               "began is unknown. The proven runs are placed where they pass the first reading.")


def _unseen(parts: TraceParts, lines: Sequence[Measurement]) -> Iterator[str]:
    """Tell where no way to a setpoint and none back from a load is seen to its end."""
    ways = {line.name: line for line in lines if line.name in _ENDS}
    if all(way.measured is None for way in ways.values()):
        first = ways.get(TIME_OF[parts.parts[0].kind])
        why = "" if first is None else f" ({first.message})"
        yield (f"The loop does not settle within the trace{why}: log until it is at rest. So far it agrees with the "
               "proof.")


def _frozen(since: Array, own: Array, runs: Foretold, count_degC: float) -> Iterator[str]:
    """Yield that the longest stretch of equal readings is a frozen sensor's, where every proven run moves in it.

    Args:
        since: instants of the trace, since its beginning [s], shape (n,).
        own: its readings [°C], shape (n,).
        runs: what the proven runs do.
        count_degC: step of the controller's own reading [°C].
    """
    edges = np.flatnonzero(np.diff(own)) + 1
    longest = max(np.split(np.arange(len(own)), edges), key=len)
    begin_s, end_s = float(since[longest[0]]), float(since[longest[-1]])
    if len(longest) < _STILL or not np.any((runs.time_s >= begin_s) & (runs.time_s <= end_s)):
        return
    least = _SIGMAS * max(sensor_step(own) or 0.0, count_degC)
    moved = _least_move_degC(since[longest], runs)
    if moved > least:
        yield (f"From {begin_s:.0f} to {end_s:.0f} s the reading stands still at {own[longest[0]]:.4g} °C, while every "
               f"proven run moves by at least {moved:.2g} °C: the sensor or its reading is frozen.")


def _least_move_degC(since: Array, runs: Foretold) -> float:
    """Return the least peak-to-peak movement of a proven run at readings of a given interval [°C].

    Readings in step with the PWM period all see the same instant of it, whatever the ripple in between.

    Args:
        since: instants of the readings, since the trace's beginning [s], shape (n,).
        runs: what the proven runs do.
    """
    step_s = float(runs.time_s[1] - runs.time_s[0])
    shifts = range(max(1, round(float(np.median(np.diff(since))) / step_s)))
    at = np.round((since - runs.time_s[0]) / step_s).astype(int)
    at = at[(at >= 0) & (at + len(shifts) <= len(runs.time_s))]
    if not len(at):
        return 0.0
    return min(float(np.ptp(runs.temperature_degC[:, at + shift], axis=1).min()) for shift in shifts)


def _too_late(parts: TraceParts, lines: Sequence[Measurement], whole_degC: float) -> Iterator[str]:
    """Yield that too little of a heat-up is seen, where nothing that comes later is seen to its end.

    Args:
        parts: what the trace shows.
        lines: the criteria on it.
        whole_degC: of a heat-up that began before the trace [°C]; 0: it did not.
    """
    way = abs(parts.parts[0].setpoint_degC - parts.start_degC)
    others = (line for line in lines if line.name in _ENDS and line.name != TIME_OF["heat-up"])
    if way < _SEEN_OF_WAY * whole_degC and all(line.measured is None for line in others):
        yield (f"The trace shows only the last {way:.3g} °C of a heat-up of {whole_degC:.3g} °C: log from before the "
               "heater is switched on, or through a change of the setpoint. So far nothing speaks against it.")


def _notes(log: Log, parts: TraceParts, proof: ProofView, margin_degC: float) -> Iterator[str]:
    interval = float(np.median(np.diff(log.time_s)))
    yield (f"A reading every {interval:.3g} s: times are known to within that, and nothing is known between two "
           f"readings. The band is widened by {margin_degC:.2g} °C for the resolution of the readings and the "
           "residuals of the model on its own log.")
    setpoint, proven = parts.parts[0].setpoint_degC, proof.scenario.setpoint_degC
    if abs(setpoint - proven) > _band_degC(proof):
        yield (f"The setpoint of the trace is {setpoint:g} °C, that of the proof {proven:g} °C: the proven worst "
               "values are for the latter.")


def _drawn(time: Array, *curves: Array) -> npt.NDArray[np.intp]:
    """Return the numbers of the instants that a picture shows: all, or the first and the extremes of each stretch."""
    if len(time) <= _DRAWN:
        return np.arange(len(time))
    stretches = np.array_split(np.arange(len(time)), _DRAWN // (2 * len(curves)))
    numbers = [stretch[pick] for stretch in stretches for curve in curves
               for pick in (0, int(curve[stretch].argmin()), int(curve[stretch].argmax()))]
    return np.unique([*numbers, len(time) - 1])


def _drawn_power(log: Log, begins_s: float, drawn: npt.NDArray[np.intp]) -> dict[str, Numbers | None]:
    """Return the power as a picture shows it: at its own instants where it has any, else at those drawn of the rows."""
    power = log.signals.get("power")
    if power is None or power.time_s is log.time_s:
        return {"power_pct": None if power is None else _numbers(power.values[drawn])}
    own = power.window(float(log.time_s[0]), float(log.time_s[-1]))
    time, values = own.until(float(log.time_s[-1]))
    shown = _drawn(time, values)
    return {"power_pct": _numbers(values[shown]), "power_s": _numbers(time[shown] - begins_s)}


def _numbers(values: Array) -> Numbers:
    return tuple(np.round(values, 3).tolist())

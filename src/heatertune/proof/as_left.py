"""As left: a trace of the commissioned loop is held against what was proven of its words.

Its figures are the proof's criteria, measured on the readings; its curve is held against the band between the lowest
and the highest of the proven runs, which are run anew from where the trace begins. What it does not show is told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from heatertune.codec import OrInfinite, registered
from heatertune.commissioned import AsLeftSettings
from heatertune.log.values import Log
from heatertune.model.circumstances import reading_step_degC
from heatertune.model.mirrored import cools
from heatertune.model.outliers import sensor_step
from heatertune.model.values import FittedModel
from heatertune.options import merged
from heatertune.plc import Words
from heatertune.plc.controller import controller_for
from heatertune.progress import Told
from heatertune.proof.as_left_band import Foretold, foretold
from heatertune.proof.as_left_figures import Seen, seen_in
from heatertune.proof.as_left_parts import LEAVES, TraceParts, leaves_s, parts_of
from heatertune.proof.criteria import CriterionView
from heatertune.proof.document import ProofView
from heatertune.proof.heaters import labelled
from heatertune.proof.scenario import WAYS
from heatertune.units import count

__all__ = ["AS_LEFT_SCHEMA", "AsLeft", "Measurement", "Outside", "as_left"]

AS_LEFT_SCHEMA: Final = "heatertune/as-left/1"

Array = npt.NDArray[np.float64]
Numbers = tuple[float, ...]

_NEIGHBOURS: Final = 2  # readings outside the band one after the other that are more than a disturbed one
_SIGMAS: Final = 3.0  # of a reading's step or noise, which the band is widened by
_DRAWN: Final = 1500  # instants of a picture
#: kind of a part → the criterion that tells when it is over
_END_OF: Final = {kind: time for kind, (_, time, *_) in WAYS.items()} | {"recovery": "recovery_time"}
_ENDS: Final = frozenset(_END_OF.values())
_LEAST_STEP_DEGC: Final = 0.01  # of a reading, for when a temperature has left its rest


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
    told: str
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


@registered(AS_LEFT_SCHEMA)
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
        band_s, low_degC, high_degC: the band, not widened.
    """

    trace: str
    digest: str
    verdict: Literal["AS PROVEN", "NOT AS PROVEN", "NOT SHOWN"]
    told: tuple[str, ...]
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


def as_left(
    log: Log, words: Words, fitted: FittedModel, proof: ProofView, settings: AsLeftSettings | None = None, *,
    progress: Told = str, **changed: float,
) -> AsLeft:
    """Return a trace of the commissioned loop beside what was proven of its words.

    Args:
        log: the trace, as `read_log` returns it.
        words: that the PLC holds.
        fitted: the heater they were proven on.
        proof: of the words.
        settings: what is known beside the trace; None: nothing.
        progress: told how far the runs are.
        changed: fields of the settings that are other than in `settings`.

    Raises:
        InputError: a trace in which nothing can be judged; as `foretold`.
        OutOfRange: a setpoint that the sensor does not see or no heater reaches.
    """
    asked, heats = merged(AsLeftSettings, settings, changed), not cools(fitted)
    parts = parts_of(log, asked, setpoint_degC=proof.scenario.setpoint_degC, band_degC=_band_degC(proof), heats=heats)
    runs = foretold(words, fitted, proof, parts, asked.ambient_degC, progress)
    early, late = 0.0 if parts.begins_by == "power" else words.sample_time_s, parts.unsure_s
    if parts.begins_by == "temperature":
        parts, early, late = _placed(log, parts, runs)
    since, own, margin = log.time_s - parts.begins_s, log.temperature_degC, _margin_degC(log, words, fitted)
    shown = since[(since >= 0.0) & (since <= runs.time_s[-1])]
    low, high = runs.band(shown, early, late)
    beyond = _beyond(own[np.isin(since, shown)], low - margin, high + margin)
    outside = tuple(_outside(shown, beyond))
    step = _step_degC(parts, fitted, proof)
    seen, at_best = seen_in(log, parts, proof, step), seen_in(log, parts, proof, step, forgiven_degC=margin)
    slack_s = parts.unsure_s + float(np.median(np.diff(log.time_s)))
    lines = tuple(_measurement(name, criterion, seen[name], at_best[name], slack_s)
                  for name, criterion in proof.criteria.items())
    against, unseen = tuple(_against(lines, outside)), tuple(_unseen(parts, lines))
    drawn, banded = _drawn(since, own), _drawn(shown, low, high)
    return AsLeft(
        trace=log.name, digest=proof.digest, told=against or unseen,
        verdict="NOT AS PROVEN" if against else "NOT SHOWN" if unseen else "AS PROVEN",
        notes=(*parts.notes, *_notes(log, parts, proof, margin), *_alone(beyond, outside)),
        setpoint_degC=parts.parts[0].setpoint_degC, start_degC=parts.start_degC, begins_s=parts.begins_s,
        begins_by=parts.begins_by, unsure_s=parts.unsure_s, interval_s=float(np.median(np.diff(log.time_s))),
        step_degC=parts.step_degC, measurements=lines, outside=outside, margin_degC=margin,
        time_s=_numbers(since[drawn]), temperature_degC=_numbers(own[drawn]),
        power_pct=None if log.power_pct is None else _numbers(log.power_pct[drawn]),
        band_s=_numbers(shown[banded]), low_degC=_numbers(low[banded]), high_degC=_numbers(high[banded]))


def _band_degC(proof: ProofView) -> float:
    """Return how far from the setpoint is right, as the proof judged it [°C]."""
    return proof.criteria["limit_cycle"].limit or proof.limits.tolerance_degC


def _margin_degC(log: Log, words: Words, fitted: FittedModel) -> float:
    """Return what a reading cannot tell, and what the best of the possible heaters left over of its own log [°C]."""
    step, scale = sensor_step(log.temperature_degC) or 0.0, words.scaling
    reading = reading_step_degC(log)
    noise = _SIGMAS * reading if reading > step else step
    step_of_count = scale.span_degC / controller_for(words.target).sensor(scale).counts
    left = [candidate.rmse_degC for candidate in fitted.candidates if math.isfinite(candidate.rmse_degC)]
    return max(noise, step_of_count) + min(left, default=0.0)


def _placed(log: Log, parts: TraceParts, runs: Foretold) -> tuple[TraceParts, float, float]:
    """Return a trace that begins as long before its temperature leaves its rest as the runs do, and how sure that is.

    Returns:
        the trace, and how much earlier and later than that it may have begun [s].
    """
    least, goal = LEAVES * max(parts.step_degC, _LEAST_STEP_DEGC), parts.parts[0].setpoint_degC
    waits = [leaves_s(runs.time_s, run, float(run[0]), goal, least) for run in runs.temperature_degC]
    middle = float(np.median(waits))
    before = min(middle, parts.begins_s - float(log.time_s[0]))
    return parts.moved(-before), max(waits) - before, before - min(waits) + parts.unsure_s


def _step_degC(parts: TraceParts, fitted: FittedModel, proof: ProofView) -> float:
    """Return the step of which overshoot is told in percent: that of the heat-up, else that of the proof [°C]."""
    first = parts.parts[0]
    if first.kind == "heat-up":
        return abs(first.setpoint_degC - parts.start_degC)
    nominal = dict(labelled(fitted))[proof.runs[0].model]
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


def _measurement(name: str, criterion: CriterionView, seen: Seen, at_best: Seen, slack_s: float) -> Measurement:
    value, keeps, as_proven = seen.value, None, None
    if value is not None:
        best = value if at_best.value is None else at_best.value
        slack = slack_s if criterion.unit == "s" else 0.0
        keeps = criterion.keeps(value)
        as_proven = best >= criterion.value if criterion.bound == ">=" else best <= criterion.value + slack
    return Measurement(
        name=name, unit=criterion.unit, bound=criterion.bound, limit=criterion.limit, worst=criterion.value,
        measured="never" if value is not None and math.isinf(value) else value, told=seen.told, keeps=keeps,
        as_proven=as_proven)


def _against(lines: Sequence[Measurement], outside: Sequence[Outside]) -> Iterator[str]:
    """Tell what speaks against the loop's being as proven."""
    for line in lines:
        called = line.name.replace("_", " ")
        if line.keeps is False:
            yield f"The {called} does not keep its limit{f': {line.told}' if '--load-at' in line.told else ''}."
        elif line.as_proven is False:
            yield f"The {called} is worse than that of every proven run."
    if outside:
        worst = max(outside, key=lambda stretch: abs(stretch.most_degC))
        side = "above" if worst.most_degC > 0.0 else "below"
        others = f", and elsewhere {count(len(outside) - 1, 'time')}" if len(outside) > 1 else ""
        yield (f"From {worst.begin_s:.0f} to {worst.end_s:.0f} s the curve is up to {abs(worst.most_degC):.3g} °C "
               f"{side} what the proven runs do{others}: it is another heater, or not these words.")


def _unseen(parts: TraceParts, lines: Sequence[Measurement]) -> Iterator[str]:
    """Tell where no way to a setpoint and none back from a load is seen to its end."""
    ways = {line.name: line for line in lines if line.name in _ENDS}
    if all(way.measured is None for way in ways.values()):
        first = ways.get(_END_OF[parts.parts[0].kind])
        why = "" if first is None else f" ({first.told})"
        yield f"The loop is not seen to settle{why}: log on until it is at rest. So far nothing speaks against it."


def _notes(log: Log, parts: TraceParts, proof: ProofView, margin_degC: float) -> Iterator[str]:
    interval = float(np.median(np.diff(log.time_s)))
    yield (f"A reading every {interval:.3g} s: times are known to within that, and what is between two readings is not "
           f"seen. The band is widened by {margin_degC:.2g} °C: what a reading cannot tell, and what the model left "
           "over of its own log.")
    asked, proven = parts.parts[0].setpoint_degC, proof.scenario.setpoint_degC
    if abs(asked - proven) > _band_degC(proof):
        yield f"The trace's setpoint is {asked:g} °C, that of the proof {proven:g} °C: the worst proven are of that."


def _drawn(time: Array, *curves: Array) -> npt.NDArray[np.intp]:
    """Return the numbers of the instants that a picture shows: all, or the first and the extremes of each stretch."""
    if len(time) <= _DRAWN:
        return np.arange(len(time))
    stretches = np.array_split(np.arange(len(time)), _DRAWN // (2 * len(curves)))
    kept = [stretch[pick] for stretch in stretches for curve in curves
            for pick in (0, int(curve[stretch].argmin()), int(curve[stretch].argmax()))]
    return np.unique([*kept, len(time) - 1])


def _numbers(values: Array) -> Numbers:
    return tuple(np.round(values, 3).tolist())

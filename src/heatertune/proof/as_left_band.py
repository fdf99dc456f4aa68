"""What the proven runs foretell of a trace: they are run anew from where it begins, with what it is asked for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.model.values import FittedModel
from heatertune.plc import Words, controller_for
from heatertune.progress import ProgressCallback
from heatertune.proof.as_left_parts import TracePart, TraceParts
from heatertune.proof.coverage import Coverage
from heatertune.proof.document import ProofView
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.runs import Runs
from heatertune.proof.scenario import NewSetpoint, Scenario
from heatertune.proof.trace import Trace

__all__ = ["Foretold", "foretold", "foretold_mid_way"]

Array = npt.NDArray[np.float64]

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
        progress: told how far the runs are.

    Raises:
        InputError: other heaters than those of the proof, or as `heatertune.proof.simulate`.
        OutOfRange: a setpoint that the sensor does not see or no heater reaches.
    """
    known = parts.parts[:_loaded(parts.parts)]
    scenario, before_s = _scenario(known, parts, proof, ambient_degC)
    traces, step = list[Array](), _step_s(proof, known[-1].end_s)
    for trace in _traces(words, fitted, proof, scenario, progress):
        time = np.arange(0.0, min(known[-1].end_s, float(trace.time_s[-1]) - before_s), step)
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
        begun = replace(scenario, start_degC=start, duration_s=scenario.duration_s + longest_s)
        for trace in _traces(words, fitted, proof, begun, progress):
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
    gone = sign * (trace.temperature_degC - start_degC)
    way = sign * (first_degC - start_degC)
    found = [np.flatnonzero(gone >= way + off) for off in (-margin_degC, 0.0, margin_degC)]
    if not len(found[0]):
        return None
    early = float(trace.time_s[found[0][0]])
    middle = float(trace.time_s[found[1][0]]) if len(found[1]) else early
    late = float(trace.time_s[found[2][0]]) if len(found[2]) else middle
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
    known: Sequence[TracePart], parts: TraceParts, proof: ProofView, ambient_degC: float | None
) -> tuple[Scenario, float]:
    """Return what the runs live through, and when in it the trace begins [s]."""
    first, *later = known
    scan = proof.sample_time_s
    ambient = proof.scenario.ambient_degC if ambient_degC is None else ambient_degC
    events = [NewSetpoint(time_s=part.begin_s, setpoint_degC=part.setpoint_degC) for part in later]
    plain = replace(proof.scenario, ambient_degC=ambient, disturbances=(), rests_s=())
    if first.kind == "heat-up":
        return replace(plain, setpoint_degC=first.setpoint_degC, start_degC=parts.start_degC,
                       duration_s=known[-1].end_s + 2.0 * scan, disturbances=tuple(events)), 0.0
    # the loop is at rest at another setpoint before the trace begins: there the runs get first, as in the proof
    before = proof.scenario.disturbances[0].time_s if proof.scenario.disturbances else proof.scenario.duration_s
    before = scan * np.ceil(before / scan)
    moved = [NewSetpoint(time_s=before + max(0.0, part.begin_s), setpoint_degC=part.setpoint_degC) for part in known]
    return replace(plain, setpoint_degC=first.from_degC, start_degC=None, disturbances=tuple(moved),
                   duration_s=before + known[-1].end_s + 2.0 * scan), float(before)

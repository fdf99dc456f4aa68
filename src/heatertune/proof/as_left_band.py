"""What the proven runs foretell of a trace: they are run anew from where it begins, with what it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.model.values import FittedModel
from heatertune.plc import Words, controller_for
from heatertune.progress import Told
from heatertune.proof.as_left_parts import Part, TraceParts
from heatertune.proof.coverage import Coverage
from heatertune.proof.document import ProofView
from heatertune.proof.heaters import labelled
from heatertune.proof.runs import Runs
from heatertune.proof.scenario import NewSetpoint, Scenario

__all__ = ["Foretold", "foretold"]

Array = npt.NDArray[np.float64]

_OF_PERIOD: Final = 8  # instants in a PWM period
_MOST: Final = 20_000  # instants of a run


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
    progress: Told = str,
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
    heaters = dict(labelled(fitted))
    ran = [(run.model, dict(run.switches), None) for run in proof.runs if run.mains_power is None]
    if missing := [model for model, *_ in ran if model not in heaters]:
        raise InputError(f"proof.json: runs: on {missing[0]!r}, which is none of the possible heaters of model.json")
    models = [(label, heaters[label]) for label in dict.fromkeys(model for model, *_ in ran)]
    runs = Runs.of(
        controller_for(words.target), words, models, scenario, proof.actuator, proof.limits,
        Coverage(known=proof.known, only=ran), interlock=proof.interlock)
    traces = []
    for run in range(len(runs.cases)):
        progress(f"running what was proven ({run + 1} of {len(runs.cases)})")
        trace = runs.traced(run, direct=True)
        step = max(runs.actuator.pwm_period_s / _OF_PERIOD, known[-1].end_s / _MOST)
        time = np.arange(0.0, min(known[-1].end_s, float(trace.time_s[-1]) - before_s), step)
        traces.append(trace.temperature_at(before_s + time))
    return Foretold(time, np.array(traces))


def _loaded(parts: Sequence[Part]) -> int:
    """Return the number of the first part with a load, of which nobody knows how large it is."""
    return next((number for number, part in enumerate(parts) if part.kind == "recovery"), len(parts))


def _scenario(
    known: Sequence[Part], parts: TraceParts, proof: ProofView, ambient_degC: float | None
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

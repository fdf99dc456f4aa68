"""Manual retuning: the symptom that a logged response shows, WEG's advice for it, and its effect on the model.

The advice is the table of WEG's manual (WPS help, SCA06 Ladder, block PID, second NOTE): symptom → changes of the
gains. It applies to the academic form, where Kp scales all three parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.model_values import FittedModel
from heatertune.model.statistics import undisturbed_part
from heatertune.pid.design_document import DesignProvenance
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.design import encode
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof, prove
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.nearest_specification import setting_sentences
from heatertune.proof.phase_statistics import first_within, turning_points
from heatertune.proof.repetition import apply_provenance, scaling_of
from heatertune.proof.specification import specification_of
from heatertune.proof.verdict import NOT_PROVEN
from heatertune.settings import Conditions

__all__ = ["ADVICE", "SCHEMA", "AcademicGains", "Change", "Response", "Symptom", "advise", "apply_changes", "observe"]


class Symptom(Enum):
    """What a response to a setpoint step looks like; the value is the sentence for people."""

    OVERSHOOT = "almost good, but the overshoot is a bit high"
    SLOW = "almost good, but late at the setpoint, without overshoot"
    RESTLESS = "good, but the temperature varies too much"
    OSCILLATING = "bad: several periods of oscillation that hardly decay"
    FAR = "bad: creeps towards the setpoint without overshoot, and is still far from it"
    NONE = "good: none of the manual's symptoms"


class AcademicGains(NamedTuple):
    """Kp [% per °C], Ki [1/s] and Kd [s] of the academic form."""

    kp: float
    ki: float
    kd: float


class Change(NamedTuple):
    """One numbered step of an advice: a gain of `Gains` and by how much [%]."""

    gain: str
    percent: int

    @property
    def label(self) -> str:
        """The step as people write it."""
        return f"{self.gain.capitalize()} {self.percent:+d} %"


#: in the order and with the figures of the manual
ADVICE: Final[dict[Symptom, tuple[Change, ...]]] = {
    Symptom.OVERSHOOT: (Change("kp", -20), Change("ki", -20), Change("kd", -50)),
    Symptom.SLOW: (Change("kp", 20), Change("ki", 20), Change("kd", 50)),
    Symptom.RESTLESS: (Change("kd", 50), Change("kp", -20)),
    Symptom.OSCILLATING: (Change("kp", -50),),
    Symptom.FAR: (Change("kp", 50), Change("ki", 50), Change("kd", 70)),
    Symptom.NONE: (),
}


def apply_changes(gains: AcademicGains, changes: tuple[Change, ...]) -> AcademicGains:
    """Return the gains after all of the changes."""
    for change in changes:
        gains = gains._replace(**{change.gain: getattr(gains, change.gain) * (100 + change.percent) / 100.0})
    return gains


_HIGH_PCT: Final = 5.0  # overshoot that is high, as well as beyond the tolerance [% of the step]
_NO_PCT: Final = 2.0  # overshoot that is none [% of the step]
_FAR_PCT: Final = 20.0  # still very far [% of the step]
_BAND_PCT: Final = 5.0  # at the setpoint [% of the step]
_SWINGS: Final = 4  # half periods that are "several periods"
_WIDE_PCT: Final = 10.0  # a swing, peak to peak, that belongs to an oscillation and is no unrest [% of the step]
_HARDLY: Final = math.sqrt(0.5)  # a period that leaves half of the swing or more hardly decays
_REST: Final = 0.2  # last share of the record that counts as rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What was seen.

    Attributes:
        symptom: the first that holds of: oscillating, far, overshoot, slow, restless.
        setpoint_degC, step_degC: setpoint, and its distance from the first reading, signed [°C].
        overshoot_pct: beyond the setpoint [% of the step].
        settled_s: time after the first reading from which on the temperature stays within the band; infinite where it
            never does [s].
        expected_s: time in which it should have [s].
        distance_degC: how far short of the setpoint the last fifth of the record is in the mean [°C]; negative: beyond.
        swing_degC: half of the peak to peak in the last fifth [°C].
        swings: whole half periods after the first turn, each of more than a tenth of the step and the tolerance.
        decay: what a swing leaves of the one before, in the geometric mean; None with fewer than two swings.
    """

    symptom: Symptom
    setpoint_degC: float
    step_degC: float
    overshoot_pct: float
    settled_s: float
    expected_s: float
    distance_degC: float
    swing_degC: float
    swings: int
    decay: float | None


def observe(
    time_s: Array, temperature_degC: Array, setpoint_degC: float, *, expected_s: float | None = None,
    tolerance_degC: float = 1.0,
) -> Response:
    """Return what a response to one setpoint step shows; nothing else may disturb it.

    Args:
        time_s: instants, increasing [s], shape (n,).
        temperature_degC: readings [°C], shape (n,).
        setpoint_degC: constant over the record [°C].
        expected_s: time in which the band should be reached for good [s]; None: half of the record.
        tolerance_degC: how far from the setpoint is still right [°C].

    Raises:
        OutOfRange: the first reading is within the tolerance of the setpoint, so that there is no step to judge.
    """
    step = setpoint_degC - float(temperature_degC[0])
    if abs(step) <= tolerance_degC:
        rule = f"more than {tolerance_degC:g} °C from the first reading, {temperature_degC[0]:g} °C: a step to judge"
        raise OutOfRange("setpoint_degC", setpoint_degC, rule)
    time = time_s - time_s[0]
    error = (temperature_degC - setpoint_degC) * math.copysign(1.0, step)  # negative: short of the setpoint
    size, end = abs(step), float(time[-1])
    final_error = error[time >= (1.0 - _REST) * end]
    first = first_within(error, max(tolerance_degC, _BAND_PCT / 100.0 * size))
    swings = _swings(error, max(tolerance_degC, _WIDE_PCT / 100.0 * size))
    response = Response(
        symptom=Symptom.NONE, setpoint_degC=setpoint_degC, step_degC=step,
        overshoot_pct=100.0 * max(0.0, float(error.max())) / size,
        settled_s=math.inf if first == len(time) else float(time[first]),
        expected_s=end / 2.0 if expected_s is None else expected_s,
        distance_degC=0.0 - float(final_error.mean()), swing_degC=float(np.ptp(final_error)) / 2.0, swings=len(swings),
        decay=float((swings[-1] / swings[0]) ** (1.0 / (len(swings) - 1))) if len(swings) > 1 else None,
    )
    return replace(response, symptom=_symptom(response, tolerance_degC))


def _symptom(response: Response, tolerance_degC: float) -> Symptom:
    percent = abs(response.step_degC) / 100.0
    without = response.overshoot_pct * percent <= max(_NO_PCT * percent, tolerance_degC)
    if response.swings >= _SWINGS and response.decay is not None and response.decay >= _HARDLY:
        return Symptom.OSCILLATING
    if without and response.distance_degC > _FAR_PCT * percent:
        return Symptom.FAR
    if response.overshoot_pct * percent > max(_HIGH_PCT * percent, tolerance_degC):
        return Symptom.OVERSHOOT
    if without and response.settled_s > response.expected_s:
        return Symptom.SLOW
    return Symptom.RESTLESS if response.swing_degC > tolerance_degC else Symptom.NONE


def _swings(error: Array, least: float) -> Array:
    """Return the heights of the swings after the first peak; what turns by no more than `least` is no turn."""
    turns = error[turning_points(error.tolist(), math.nextafter(least, math.inf))]
    return np.abs(np.diff(turns[1:] if len(turns) > 1 and turns[0] < turns[1] else turns))


SCHEMA: Final = "heatertune/advice/2"

#: the criterion of the proof that a symptom is about
_AIM: Final = {
    Symptom.OVERSHOOT: "overshoot", Symptom.SLOW: "settling_time", Symptom.RESTLESS: "limit_cycle",
    Symptom.OSCILLATING: "ms", Symptom.FAR: "iae", Symptom.NONE: "iae",
}
_TOLD: Final = ("overshoot", "settling_time", "iae", "limit_cycle", "ms")
#: a difference of less is none [share]
_SAME: Final = 0.005
_RANKS: Final = {"FAIL": 0, NOT_PROVEN: 1, "PASS": 2}
_LAGS: Final = 3.0  # time constants after which a heater has done 95 % of a step


def advise(
    design: PidDesign, fitted: FittedModel, recipe: DesignProvenance, log: Log | None = None, *,
    until_s: float | None = None,
    progress: ProgressCallback = str,
) -> dict[str, Any]:
    """Return the symptom, and every step of the advice with the proof before and after it.

    Args:
        design: that ran, or is to run.
        fitted: the heater to prove on.
        recipe: controller, sensor range, what the words get beside the gains, and conditions of the proof; their
            setpoint is that of the log, too, None: as logged.
        log: the response; None: the one of the design's own proof.
        until_s: last instant of the log to look at [s]; None: up to a disturbance.
        progress: called with a few words as each step begins.

    Raises:
        InputError: a log without setpoint, and none is given.
        OutOfRange: no step to judge; as the proof.
        NotRepresentable: the design itself does not fit the target.
    """
    log_part = None if log is None else _part(log, until_s)
    assumed = recipe.conditions
    if assumed.highest_degC is None and log_part is not None:
        assumed = replace(assumed, setpoint_degC=_setpoint(log_part))
    proven = partial(_proven, fitted, replace(recipe, conditions=assumed))
    progress("proving the design as it is")
    before = proven(design)
    expected = max(m.dead_time_s + _LAGS * sum(m.lags_s) for _, m in labelled_heaters(fitted))
    response = _observed(log_part, before, assumed, expected)
    gains, aim = _gains(design), _AIM[response.symptom]
    cases = [_case("as it is", gains, before)]
    for label, changes in _steps(response.symptom):
        progress(f"proving {label}")
        after = apply_changes(gains, changes)
        cases.append(_tried(label, gains, after, design, proven))
        cases[-1]["effect"] = _effect(cases[0], cases[-1], aim)
    return {
        "schema": SCHEMA, "target": recipe.target, "log": None if log is None else log.name,
        "symptom": response.symptom.name, "symptom_text": response.symptom.value,
        "response": {name: value for name, value in asdict(response).items() if name != "symptom"}, "aim": aim,
        "cases": cases, "best": _best(cases, aim), "notes": setting_sentences(before, "the design as it is"),
    }


def _part(log: Log, until_s: float | None) -> Log:
    """Return the log from its last setpoint change, if it has one, up to its disturbance."""
    part = undisturbed_part(log)[0] if until_s is None else log.window(float(log.time_s[0]), until_s)
    if part.setpoint_degC is None:
        return part
    changes = np.flatnonzero(np.diff(part.setpoint_degC))
    return part.window(float(part.time_s[changes[-1] + 1]), float(part.time_s[-1])) if len(changes) else part


def _setpoint(log: Log) -> float:
    if log.setpoint_degC is None:
        raise InputError(f"{log.name} holds no setpoint: give --setpoint")
    return float(log.setpoint_degC[-1])


def _proven(fitted: FittedModel, recipe: DesignProvenance, design: PidDesign) -> Proof:
    words = encode(design, recipe.target, scaling=scaling_of(recipe))
    return prove(apply_provenance(words, recipe), fitted, recipe.conditions)


def _observed(log: Log | None, before: Proof, assumed: Conditions, expected_s: float) -> Response:
    if log is not None and assumed.highest_degC is not None:
        time, temperature, setpoint = log.time_s, log.temperature_degC, assumed.highest_degC
    else:
        trace = before.nominal
        stop = [event.time_s for event in trace.scenario.disturbances] or [math.inf]
        keep = trace.time_s < stop[0]
        time, temperature, setpoint = trace.time_s[keep], trace.temperature_degC[keep], trace.setpoint_degC
    tolerance = specification_of(assumed).tolerance_degC
    return observe(time, temperature, setpoint, expected_s=expected_s, tolerance_degC=tolerance)


def _steps(symptom: Symptom) -> list[tuple[str, tuple[Change, ...]]]:
    """Return each numbered step alone, then the whole list where it is longer."""
    changes = ADVICE[symptom]
    whole = [("all of them", changes)] if len(changes) > 1 else []
    return [*((f"({k}) {change.label}", (change,)) for k, change in enumerate(changes, start=1)), *whole]


def _gains(design: PidDesign) -> AcademicGains:
    """Return the gains of the academic form; Ki is 0 for an infinite TN."""
    return AcademicGains(design.gain_pct_per_degC, 1.0 / design.integral_time_s, design.derivative_time_s)


def _tried(
    label: str, gains: AcademicGains, after: AcademicGains, design: PidDesign, proven: Callable[[PidDesign], Proof]
) -> dict[str, Any]:
    if after == gains:
        return _case(label, after, None) | {"verdict": "nothing changes"}
    tn = math.inf if after.ki == 0.0 else 1.0 / after.ki
    wished = replace(
        design, gain_pct_per_degC=after.kp, integral_time_s=tn, derivative_time_s=after.kd, margins=None,
        structure=structure_of(tn, after.kd), method=f"WEG's advice: {label}", iae_load=None, iae_setpoint=None,
    )
    try:
        return _case(label, after, proven(wished))
    except NotRepresentable as problem:
        return _case(label, after, None) | {"verdict": "not representable", "why": str(problem)}


def _case(label: str, gains: AcademicGains, proof: Proof | None) -> dict[str, Any]:
    criteria = () if proof is None else proof.criteria
    values = {criterion.name: criterion.value for criterion in criteria if criterion.name in _TOLD}
    failed = [] if proof is None else list(proof.shortfalls)
    case = {"step": label, **gains._asdict(), "words": None, "verdict": "", "fails": failed, "effect": "", **values}
    return case if proof is None else case | {"words": dict(proof.words.values), "verdict": proof.verdict}


def _effect(before: Mapping[str, Any], after: Mapping[str, Any], aim: str) -> str:
    """Return what a step does to the criterion it is meant for, and to the verdict."""
    if after["verdict"] not in _RANKS:
        return "none"
    old, new = before[aim], after[aim]
    if _RANKS[after["verdict"]] < _RANKS[before["verdict"]]:
        return "worse: no longer PASS" if before["verdict"] == "PASS" else f"worse: now {after['verdict']}"
    if new == old or abs(new - old) <= _SAME * max(abs(old), abs(new)):
        return "no difference" if before["verdict"] == after["verdict"] else f"better: now {after['verdict']}"
    return "better" if new < old else "worse"


def _best(cases: list[dict[str, Any]], aim: str) -> str | None:
    """Return the step that helps most among those that pass; None where none does."""
    helping = [case for case in cases if case["effect"].startswith("better") and case["verdict"] == "PASS"]
    return min(helping, key=lambda case: float(case[aim]))["step"] if helping else None

"""Retuning by hand: what a logged response shows, what WEG advises, and what that would do on the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError, NotRepresentable
from heatertune.log.values import Log
from heatertune.model.values import FittedModel
from heatertune.model.windows import undisturbed_part
from heatertune.pid.design_provenance import DesignProvenance
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.design import encode
from heatertune.plc.weg.advice import ADVICE, AcademicGains, Change, Symptom, apply_changes
from heatertune.progress import ProgressCallback
from heatertune.proof import Proof, prove
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.nearest_specification import settings_told
from heatertune.proof.rebuild_words import apply_provenance, scaling_of
from heatertune.proof.spec_file import specification_of
from heatertune.proof.symptoms import Response, observe
from heatertune.proof.verdict import NOT_PROVEN
from heatertune.settings import Conditions

__all__ = ["SCHEMA", "advise"]

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
        progress: told what begins.

    Raises:
        InputError: a log without setpoint, and none is given.
        OutOfRange: no step to judge; as the proof.
        NotRepresentable: the design itself does not fit the target.
    """
    seen_log = None if log is None else _part(log, until_s)
    assumed = recipe.conditions
    if assumed.highest_degC is None and seen_log is not None:
        assumed = replace(assumed, setpoint_degC=_setpoint(seen_log))
    proven = partial(_proven, fitted, replace(recipe, conditions=assumed))
    progress("proving the design as it is")
    before = proven(design)
    expected = max(m.dead_time_s + _LAGS * sum(m.lags_s) for _, m in labelled_heaters(fitted))
    seen = _observed(seen_log, before, assumed, expected)
    gains, aim = _gains(design), _AIM[seen.symptom]
    cases = [_case("as it is", gains, before)]
    for label, changes in _steps(seen.symptom):
        progress(f"proving {label}")
        after = apply_changes(gains, changes)
        cases.append(_tried(label, gains, after, design, proven))
        cases[-1]["effect"] = _effect(cases[0], cases[-1], aim)
    return {
        "schema": SCHEMA, "target": recipe.target, "log": None if log is None else log.name,
        "symptom": seen.symptom.name, "symptom_text": seen.symptom.value,
        "response": {name: value for name, value in asdict(seen).items() if name != "symptom"},
        "aim": aim, "cases": cases, "best": _best(cases, aim),
        "notes": settings_told(before, "the design as it is"),
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

"""What a proof's document holds, and whether it holds together: a proof is checked, not believed.

Verdicts, ok flags, the worst of each criterion and its limits follow from the values of the runs and from the limits
that the proof was held against; a document that says otherwise was changed by hand. So was one whose digest is another.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from heatertune.codec import decode, registered
from heatertune.documents import plain
from heatertune.errors import DocumentError
from heatertune.model.findings import KINDS
from heatertune.proof.verdict import ASSUMED, NOT_PROVEN, PROOF_SCHEMA, blocking, combined

__all__ = ["ProofView", "checked", "digested"]

Verdict = Literal["PASS", "FAIL", "NOT PROVEN"]

#: criteria of every run, and those of a run with disturbances, of a controller that is a PID, behind an interlock
_ALWAYS: Final = ("overshoot", "settling_time", "steady_offset", "limit_cycle", "pwm_ripple", "iae", "saturation",
                  "switchings", "overflow")
_DISTURBED: Final = ("recovery_time", "recovery_overshoot", "deviation")
_OF_PID: Final = ("stability", "ms", "gain_margin", "phase_margin", "step_power")
_GUARDED: Final = ("interlock_trips",)
#: criterion → the limit it is held against, by its name among the limits
_LIMITS: Final = {
    "overshoot": "overshoot_pct", "pwm_ripple": "pwm_ripple_degC", "iae": "iae_degC_s",
    "recovery_overshoot": "recovery_overshoot_pct", "deviation": "deviation_degC", "saturation": "saturation_pct",
    "switchings": "switchings_per_h", "overflow": "overflows", "ms": "ms", "gain_margin": "gain_margin",
    "phase_margin": "phase_margin_deg", "step_power": "step_power_pct",
}
_AT_LEAST: Final = ("stability", "gain_margin", "phase_margin")


@dataclass(frozen=True, slots=True, kw_only=True)
class CriterionView:
    """The worst of one criterion over all runs; null is infinite."""

    value: float | None
    limit: float | None
    bound: Literal["<=", ">="]
    ok: bool
    unit: str
    where: str
    what: str

    def keeps(self, value: float | None) -> bool:
        """Return whether a run's value keeps the limit."""
        if self.limit is None:
            return True
        number = math.inf if value is None else value
        return number >= self.limit if self.bound == ">=" else number <= self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class OutcomeView:
    """One criterion of one run."""

    value: float | None
    ok: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RunView:
    """One run."""

    model: str
    switches: Mapping[str, str]
    verdict: Literal["PASS", "FAIL"]
    criteria: Mapping[str, OutcomeView]


@dataclass(frozen=True, slots=True, kw_only=True)
class KickView:
    """A step of the temperature, or of the power."""

    time_s: float
    temperature_degC: float | None = None
    power_pct: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioView:
    """What happened in each run."""

    setpoint_degC: float
    duration_s: float
    ambient_degC: float | None
    start_degC: float | None
    disturbances: tuple[KickView, ...]
    noise_degC: float
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuatorView:
    """The switch."""

    pwm_period_s: float
    resolution_s: float
    minimum_on_s: float
    minimum_off_s: float
    minimum_rule: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlockView:
    """What watched the heater."""

    name: str
    limit_degC: float
    fan_stops_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RampView:
    """The setpoint ramp."""

    step: float
    calls: int
    degC_per_min: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ScalingView:
    """Temperatures at the lowest and the highest reading."""

    low_degC: float
    high_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HeardView:
    """A finding of the fit, and whether the user accepted it."""

    name: Literal[tuple(KINDS)]  # type: ignore[valid-type]  # the kinds are declared once
    effect: str
    told: str
    accepted: bool

    def __post_init__(self) -> None:
        effect = KINDS[self.name].effect
        if self.effect != effect:
            raise DocumentError(f"effect: {self.effect!r}; a finding {self.name} {effect}")
        if self.accepted and effect != "blocks":
            raise DocumentError(f"accepted: a finding {self.name} blocks nothing")


@registered(PROOF_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class ProofView:
    """The document of a proof.

    Raises:
        DocumentError: what it says does not follow from its values.
    """

    verdict: Verdict
    target: str
    words: Mapping[str, float | str]
    sample_time_s: float
    scaling: ScalingView
    setpoint_ramp: RampView | None
    criteria: Mapping[str, CriterionView]
    runs: tuple[RunView, ...]
    scenario: ScenarioView
    actuator: ActuatorView
    limits: Mapping[str, float | tuple[str, ...] | None]
    known: Mapping[str, str]
    faults: tuple[str, ...]
    interlock: InterlockView | None
    findings: tuple[HeardView, ...]
    assumed: Mapping[Literal[tuple(ASSUMED)], float]  # type: ignore[valid-type]  # declared once
    remarks: tuple[str, ...]
    samples: Mapping[str, Any] | None = field(default=None)
    digest: str

    def __post_init__(self) -> None:
        if not self.runs:
            raise DocumentError("runs: none; a proof without a run proves nothing")
        self._demand_all_criteria()
        for number, run in enumerate(self.runs):
            self._check_run(f"runs[{number}]", run)
        for name, criterion in self.criteria.items():
            self._check_criterion(f"criteria.{name}", name, criterion)
        if self.verdict != self.derived:
            raise DocumentError(f"verdict: {self.verdict!r}; its values make it {self.derived!r}")

    @property
    def derived(self) -> str:
        """The verdict that follows from the values."""
        kept = all(criterion.keeps(criterion.value) for criterion in self.criteria.values())
        drawn = [] if self.samples is None else [str(self.samples.get("verdict", "FAIL"))]
        heard = [{"name": each.name, "accepted": each.accepted} for each in self.findings]
        return combined(["PASS" if kept else "FAIL", *drawn, *([NOT_PROVEN] if blocking({"findings": heard}) else [])])

    def _demand_all_criteria(self) -> None:
        needed = [*_ALWAYS, *(_DISTURBED if self.scenario.disturbances else ()), *(_GUARDED if self.interlock else ())]
        if any(name in self.criteria for name in _OF_PID):
            needed += _OF_PID
        if missing := [name for name in needed if name not in self.criteria]:
            raise DocumentError(f"criteria.{missing[0]}: is missing")
        if more := [name for name in self.criteria if name not in needed]:
            raise DocumentError(f"criteria.{more[0]}: no such criterion")

    def _check_run(self, at: str, run: RunView) -> None:
        if set(run.criteria) != set(self.criteria):
            raise DocumentError(f"{at}.criteria: others than those of the proof")
        for name, outcome in run.criteria.items():
            if outcome.ok != self.criteria[name].keeps(outcome.value):
                raise DocumentError(f"{at}.criteria.{name}.ok: {outcome.ok}; its value says otherwise")
        kept = all(outcome.ok for outcome in run.criteria.values())
        if run.verdict != ("PASS" if kept else "FAIL"):
            raise DocumentError(f"{at}.verdict: {run.verdict!r}; its values say otherwise")

    def _check_criterion(self, at: str, name: str, criterion: CriterionView) -> None:
        if criterion.bound != (">=" if name in _AT_LEAST else "<="):
            raise DocumentError(f"{at}.bound: {criterion.bound!r}; the other way round is right")
        if name in _LIMITS and criterion.limit != self.limits.get(_LIMITS[name]):
            raise DocumentError(f"{at}.limit: {criterion.limit}; limits.{_LIMITS[name]} says otherwise")
        values = [math.inf if value is None else value for value in (run.criteria[name].value for run in self.runs)]
        worst = min(values) if criterion.bound == ">=" else max(values)
        if worst != (math.inf if criterion.value is None else criterion.value):
            raise DocumentError(f"{at}.value: {criterion.value}; the worst run has {worst:g}")
        if criterion.ok != criterion.keeps(criterion.value):
            raise DocumentError(f"{at}.ok: {criterion.ok}; its value says otherwise")


def digested(proof: Mapping[str, Any]) -> dict[str, Any]:
    """Return a proof's document with the digest of all the rest as its last field."""
    rest = {name: value for name, value in proof.items() if name != "digest"}
    return rest | {"digest": _digest(rest)}


def _digest(document: Mapping[str, Any]) -> str:
    text = json.dumps(plain(document), sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def checked(proof: Mapping[str, Any], where: str | Path) -> dict[str, Any]:
    """Return a proof's document, which is whole and follows from its values.

    Raises:
        DocumentError: a field is missing, unknown or of the wrong kind, it does not follow from the others, or the
            digest is of another proof.
    """
    try:
        view = decode(ProofView, dict(proof), where)
    except DocumentError as problem:
        raise DocumentError(f"{problem}: no whole proof; prove the words again") from problem
    if view.digest != digested(proof)["digest"]:
        raise DocumentError(f"{where}: digest: of another proof, so this one was changed; prove the words again")
    return dict(proof)

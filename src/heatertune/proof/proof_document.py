"""The document of a proof: its fields, and the check of its consistency.

Verdicts, ok flags, the worst case of each criterion and its limits follow from the values of the runs and from the
specified limits; a document that differs, or has another digest, was edited and is refused. Also the documents of log,
pictures and comparison.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from itertools import chain
from pathlib import Path
from typing import Any, Final, Literal

from heatertune.codec import LEFT_OUT, Document, EarlierDocument, OrInfinite, decode, encode, plain, register_schema
from heatertune.errors import DocumentError
from heatertune.pid.design_document import BoostView, RampView
from heatertune.plc import Scaling
from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import CRITERIA, CRITERION, LIMITS, CriterionKind, CriterionView, LoopLimits
from heatertune.proof.heaters import RATED_ONLY, MainsScenario
from heatertune.proof.scenario import Scenario, kinds_of, phases_of
from heatertune.proof.specification import Specification
from heatertune.proof.verdict import (
    ASSUMED,
    NOT_PROVEN,
    PROOF_SCHEMA,
    FitDiagnosticsView,
    Interlock,
    combined_verdict,
    verdict_of_samples,
)
from heatertune.show import NotebookDisplay

__all__ = [
    "ComparisonView", "LogView", "OutcomeView", "PicturesView", "ProofView", "RunView", "check_document", "digest_of",
    "with_digest",
]


Numbers = tuple[float, ...]

_MOST = 1e9  # of any number in a picture


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnView:
    """A column of a log's file."""

    name: str
    written: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TakenView:
    """What was taken of a log's file."""

    line: str
    rows: int
    interval_s: float
    columns: Mapping[str, ColumnView]
    rows_read: int
    left_out: int
    repeats: int
    repaired: int
    repaired_share: float
    unused: tuple[str, ...]
    reading: Mapping[str, str | float | bool | tuple[float, ...]]


@register_schema("heatertune/log/2")
@dataclass(frozen=True, slots=True, kw_only=True)
class LogView:
    """A log as it was understood."""

    name: str
    source: str
    time_s: Numbers
    temperature_degC: Numbers
    power_pct: Numbers | None
    setpoint_degC: Numbers | None
    repairs: tuple[str, ...]
    warnings: tuple[str, ...]
    taken: TakenView | None
    cooling_pct: Numbers | None = field(default=None, metadata=LEFT_OUT)
    #: role → instants and values of signals that have instants of their own
    signals: Mapping[str, tuple[Numbers, Numbers]] | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        _demand_drawable(time_s=self.time_s, temperature_degC=self.temperature_degC)
        for role, (time, values) in (self.signals or {}).items():
            _demand_drawable(time_s=time, **{role: values})
        for name, column in (("power_pct", self.power_pct), ("setpoint_degC", self.setpoint_degC),
                             ("cooling_pct", self.cooling_pct)):
            if column is not None:
                _demand_drawable(time_s=self.time_s, **{name: column})


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherRunView:
    """The temperature of a run."""

    label: str
    time_s: Numbers
    temperature_degC: Numbers

    def __post_init__(self) -> None:
        _demand_drawable(time_s=self.time_s, temperature_degC=self.temperature_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesView:
    """A run: temperature at even instants, power asked for, switching instants."""

    label: str
    setpoint_degC: float
    time_s: Numbers
    temperature_degC: Numbers
    followed_degC: Numbers | None
    request_time_s: Numbers
    request_pct: Numbers
    edge_s: Numbers
    edge_pct: Numbers

    def __post_init__(self) -> None:
        _demand_drawable(time_s=self.time_s, temperature_degC=self.temperature_degC)
        _demand_drawable(setpoint_degC=(self.setpoint_degC,))
        _demand_drawable(request_time_s=self.request_time_s, request_pct=self.request_pct)
        if self.followed_degC is not None:
            _demand_drawable(request_time_s=self.request_time_s, followed_degC=self.followed_degC)
        if len(self.edge_s) or len(self.edge_pct):
            _demand_drawable(edge_s=self.edge_s, edge_pct=self.edge_pct)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveView:
    """Nyquist curve and sensitivity of the words on one model."""

    label: str
    omega: Numbers
    sensitivity: Numbers
    real: Numbers
    imaginary: Numbers
    worst: bool

    def __post_init__(self) -> None:
        _demand_drawable(omega=self.omega, sensitivity=self.sensitivity)
        if any(value <= 0.0 for value in self.omega):
            raise DocumentError("omega: expected frequencies above 0")
        if len(self.real) or len(self.imaginary):
            _demand_drawable(real=self.real, imaginary=self.imaginary)


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseView:
    """What begins when in a run, and when its time at rest begins and ends."""

    label: str
    begin_s: float
    rest_s: float
    end_s: float

    def __post_init__(self) -> None:
        _demand_drawable(phase_s=(self.begin_s, self.rest_s, self.end_s))
        if not self.begin_s <= self.rest_s <= self.end_s:
            raise DocumentError("begin_s, rest_s, end_s: expected in ascending order")


@register_schema("heatertune/pictures/3")
@dataclass(frozen=True, slots=True, kw_only=True)
class PicturesView:
    """The series that the report draws."""

    phases: tuple[PhaseView, ...]
    ms_limit: float | None
    nominal: SeriesView
    worst: SeriesView
    others: tuple[OtherRunView, ...]
    ideal: SeriesView
    curves: tuple[CurveView, ...]

    def __post_init__(self) -> None:
        if not self.phases:
            raise DocumentError("phases: none; expected at least the heat-up")
        if self.curves and not (self.ms_limit is not None and 1.0 < self.ms_limit < _MOST):
            raise DocumentError(f"ms_limit: {self.ms_limit}; expected a number above 1 beside curves")


@dataclass(frozen=True, slots=True, kw_only=True)
class RivalView:
    """What another design does in the same proof."""

    gain_pct_per_degC: float | None = None
    integral_time_s: float | None = None
    label: str
    verdict: str
    ms: float | None
    fails: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperRunView:
    """One of the paper's runs."""

    label: str
    overshoot_degC: float
    offset_degC: float
    offset_after_degC: float
    series: SeriesView


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperView:
    """What the paper's own settings do."""

    message: str
    runs: tuple[PaperRunView, ...]


@register_schema("heatertune/comparison/2")
@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonView:
    """What other designs, and the paper's own settings, do in the same loop."""

    cost: str | None
    rivals: tuple[RivalView, ...]
    paper: PaperView | None


def _demand_drawable(**series: Numbers) -> None:
    """Refuse series of a picture that are empty, of different lengths, or whose numbers no axis can hold."""
    if len({len(numbers) for numbers in series.values()}) > 1 or not all(map(len, series.values())):
        lengths = ", ".join(f"{len(numbers)} of {name}" for name, numbers in series.items())
        raise DocumentError(f"{lengths}; expected as many of each, and at least one")
    if not all(abs(number) <= _MOST for number in chain(*series.values())):
        raise DocumentError(f"{' and '.join(series)}: a number beyond ±{_MOST:g}")


Verdict = Literal["PASS", "FAIL", "NOT PROVEN"]

#: limits that may be in the lags and dead time of a heater
_IN_HEATERS: Final = {limit.units["T+L"].field for limit in LIMITS.values() if "T+L" in limit.units}


@dataclass(frozen=True, slots=True, kw_only=True)
class OutcomeView:
    """One criterion of one run."""

    value: OrInfinite
    ok: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RunView:
    """One run."""

    model: str
    switches: Mapping[str, str]
    verdict: Literal["PASS", "FAIL"]
    criteria: Mapping[str, OutcomeView]
    mains_power: float | None = field(default=None, metadata=LEFT_OUT)


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingView:
    """A setting of what the manual leaves open, and how many of the samples keep every limit under it."""

    switches: Mapping[str, str]
    passing_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplesView:
    """What many samples show."""

    verdict: Verdict
    count: int
    seed: int
    quantile: float
    passing: float
    settings: tuple[SettingView, ...]
    worst_seed: int
    spread: Mapping[str, Any]
    criteria: Mapping[str, Any]

    def __post_init__(self) -> None:
        if self.count < 1:
            raise DocumentError(f"count: {self.count}; no samples prove nothing")
        if not 0.0 < self.quantile <= 1.0:
            raise DocumentError(f"quantile: {self.quantile:g}; expected a share > 0 and <= 1")
        if not self._passing_counts:
            raise DocumentError("settings: none; a proof needs at least one run")
        if not 0 <= min(self._passing_counts) <= max(self._passing_counts) <= self.count:
            raise DocumentError(f"settings: passing_count: expected numbers from 0 to {self.count}")
        if self.passing != min(self._passing_counts) / self.count:
            raise DocumentError(f"passing: {self.passing:g}; under the worst setting {min(self._passing_counts)} of "
                                f"{self.count} pass")
        if self.verdict != self.derived:
            raise DocumentError(f"verdict: {self.verdict!r}; its values make it {self.derived!r}")

    @property
    def derived(self) -> str:
        """The verdict that follows from the values."""
        return verdict_of_samples(self.count, self.quantile, self._passing_counts)

    @property
    def _passing_counts(self) -> list[int]:
        return [setting.passing_count for setting in self.settings]


@register_schema(PROOF_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class ProofView(NotebookDisplay):
    """A proof as its document has it, without traces, so without a picture; see `demand_whole`."""

    verdict: Verdict
    target: str
    words: Mapping[str, float | str]
    sample_time_s: float
    scaling: Scaling
    setpoint_ramp: RampView | None
    boost: BoostView | None = field(default=None, metadata=LEFT_OUT)
    criteria: Mapping[str, CriterionView]
    runs: tuple[RunView, ...]
    scenario: Scenario
    actuator: Actuator
    limits: LoopLimits
    specification: Specification | None
    stated_settings: Mapping[str, str]
    faults: tuple[str, ...]
    interlock: Interlock | None
    findings: tuple[FitDiagnosticsView, ...]
    assumed: Mapping[Literal[tuple(ASSUMED)], float]  # type: ignore[valid-type]  # declared once
    remarks: tuple[str, ...]
    not_tested: tuple[str, ...]
    samples: SamplesView | None = field(default=None, metadata=LEFT_OUT)
    mains: tuple[MainsScenario, ...] = field(default=(), metadata=LEFT_OUT)
    digest: str

    def __repr__(self) -> str:
        """Return verdict, controller, setpoint and number of runs in one line."""
        return (f"<ProofView {self.verdict} of {self.target} at {self.scenario.setpoint_degC:g} °C in "
                f"{len(self.runs)} runs>")

    def demand_whole(self, where: str | Path) -> None:
        """Refuse a proof that lacks criteria, or says what does not follow from its values.

        Raises:
            DocumentError: it does.
        """
        try:
            self._check()
        except DocumentError as problem:
            raise DocumentError(f"{where}: {problem}") from problem

    def _check(self) -> None:
        if not self.runs:
            raise DocumentError("runs: none; a proof needs at least one run")
        if self.specification is not None:
            self._check_limits(self.specification)
        self._demand_all_criteria()
        self._demand_band()
        for number, run in enumerate(self.runs):
            self._check_run(f"runs[{number}]", run)
        for name, criterion in self.criteria.items():
            self._check_criterion(f"criteria.{name}", name, criterion)
        if self.verdict != self.derived:
            raise DocumentError(f"verdict: {self.verdict!r}; its values make it {self.derived!r}")

    def _check_limits(self, specification: Specification) -> None:
        """Refuse limits that the specification does not mean; times may be in units of a heater that is not here."""
        meant = specification.limits_for(1.0)
        for name in (one.name for one in fields(LoopLimits) if one.name not in _IN_HEATERS):
            if getattr(self.limits, name) != getattr(meant, name):
                raise DocumentError(f"limits.{name}: {getattr(self.limits, name)}; the specification says otherwise")

    @property
    def derived(self) -> str:
        """The verdict that follows from the values."""
        keeps_all = all(criterion.keeps(criterion.value) for criterion in self.criteria.values())
        drawn = [] if self.samples is None else [self.samples.derived]
        blocked = any(finding.effect == "blocks" and not finding.accepted for finding in self.findings)
        return combined_verdict(["PASS" if keeps_all else "FAIL", *drawn, *([NOT_PROVEN] if blocked else [])])

    def _demand_all_criteria(self) -> None:
        is_pid = any(kind.source == "words" and kind.name in self.criteria for kind in CRITERIA)
        untold = {"words": not is_pid, "interlock": self.interlock is None}
        needed = dict.fromkeys(kind.name for kind in CRITERIA if self._has(kind, self.scenario)
                               and not untold.get(kind.source))
        for name in needed | dict.fromkeys(self.criteria):
            if name not in self.criteria or name not in needed:
                raise DocumentError(f"criteria.{name}: {'is missing' if name in needed else 'no such criterion'}")

    def _has(self, criterion: CriterionKind, scenario: Scenario) -> bool:
        """Return whether runs of a scenario have a criterion."""
        kinds = [kind for kind, *_ in kinds_of(scenario)]
        resting = [kind for kind, rest_s in zip(kinds, scenario.rests_s, strict=False) if rest_s > 0.0]
        return criterion.occurs(kinds, [kinds[0], *resting], self.limits)

    def _demand_band(self) -> None:
        """Refuse a band that is wider than the tolerance without the finding that says so."""
        coarse = "coarse-sensor" in {finding.name for finding in self.findings}
        for name in (name for name in self.criteria if CRITERION[name].otherwise == "band"):
            band, own_limit = self.criteria[name].limit, CRITERION[name].limit_in(self.limits)
            tolerance, wider = (self.limits.tolerance_degC, coarse) if own_limit is None else (own_limit, False)
            if band is None or (band > tolerance and not wider):
                raise DocumentError(f"criteria.{name}.limit: {band}; the tolerance is {tolerance:g} °C")

    def _check_run(self, at: str, run: RunView) -> None:
        self._demand_criteria_of(at, run)
        for name, outcome in run.criteria.items():
            longest_s = self._longest_s(name, run.mains_power)
            keeps = self.criteria[name].keeps(outcome.value) if longest_s is None else (
                outcome.ok and outcome.value <= longest_s)
            if outcome.ok != keeps:
                raise DocumentError(f"{at}.criteria.{name}.ok: {outcome.ok}; its value says otherwise")
        keeps_all = all(outcome.ok for outcome in run.criteria.values())
        if run.verdict != ("PASS" if keeps_all else "FAIL"):
            raise DocumentError(f"{at}.verdict: {run.verdict!r}; its values say otherwise")

    def _demand_criteria_of(self, at: str, run: RunView) -> None:
        """Refuse a run without the criteria of its power, or of a power at which nothing was run."""
        power = run.mains_power
        if power not in self._scenarios:
            raise DocumentError(f"{at}.mains_power: {power:g}; the proof has no scenario of this power")
        if set(run.criteria) != set(self.criteria) - (set() if power is None else self._left_out(power)):
            where = "of the proof" if power is None else "at this power"
            raise DocumentError(f"{at}.criteria: others than those {where}")

    def _left_out(self, power: float) -> set[str]:
        """Return the criteria that runs at another power do not have: no load is tested where it is too low."""
        kinds = {kind for kind, *_ in kinds_of(self._scenarios[power])}
        return {kind.name for kind in CRITERIA if kind.name in RATED_ONLY or kind.source == "words"
                or (kind.phases == ("recovery",) and "recovery" not in kinds)}

    @property
    def _scenarios(self) -> dict[float | None, Scenario]:
        """The scenario at each power, None: the rated one."""
        return {None: self.scenario, **{one.mains_power: one.scenario for one in self.mains}}

    def _check_criterion(self, at: str, name: str, criterion: CriterionView) -> None:
        kind = CRITERION[name]
        if criterion.bound != (">=" if kind.at_least else "<="):
            raise DocumentError(f"{at}.bound: {criterion.bound!r}; the other way round is right")
        if not kind.otherwise and criterion.limit != kind.limit_in(self.limits):
            raise DocumentError(f"{at}.limit: {criterion.limit}; limits.{kind.limit or name} says otherwise")
        self._check_worst(at, name, criterion)

    def _check_worst(self, at: str, name: str, criterion: CriterionView) -> None:
        """Refuse a criterion that is not the worst of the runs."""
        own = [run for run in self.runs if name in run.criteria]
        values = [run.criteria[name].value for run in own]
        worst = min(values) if criterion.bound == ">=" else max(values)
        alike = all(self._longest_s(name, run.mains_power) is None for run in own)
        if worst != criterion.value and (alike or criterion.value not in values):
            raise DocumentError(f"{at}.value: {encode(criterion.value)}; the worst run has {worst:g}")
        if criterion.ok != criterion.keeps(criterion.value):
            raise DocumentError(f"{at}.ok: {criterion.ok}; its value says otherwise")
        if criterion.ok != all(run.criteria[name].ok for run in own):
            raise DocumentError(f"{at}.ok: {criterion.ok}; its runs say otherwise")

    def _longest_s(self, name: str, mains_power: float | None = None) -> float | None:
        """Return the longest part of the story that a run has for a way, where each has its own; else None.

        At other than the rated power that is all that limits a time.
        """
        kind, rated = CRITERION[name], mains_power is None
        if kind.otherwise != "part" or (rated and ("heat-up" in kind.phases or kind.limit_in(self.limits) is not None)):
            return None
        scenario = self._scenarios[mains_power]
        parts = phases_of(scenario, scenario.duration_s, 0.0)
        return max((part.limit_s for part in parts if part.kind in kind.phases), default=0.0)


def with_digest(proof: Document) -> dict[str, Any]:
    """Return a proof's document with the digest of all the rest as its last field."""
    rest = {name: value for name, value in proof.items() if name != "digest"}
    return rest | {"digest": digest_of(rest)}


def digest_of(document: Document) -> str:
    """Return the SHA-256 of a document's content, however its file is laid out."""
    text = json.dumps(plain(document), sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def check_document(proof: Document, where: str | Path) -> dict[str, Any]:
    """Return a proof's document, which is whole and follows from its values.

    Raises:
        DocumentError: a field is missing, unknown or of the wrong kind, it does not follow from the others, or the
            digest is of another proof.
    """
    try:
        view = decode(ProofView, dict(proof), where)
        view.demand_whole(where)
    except DocumentError as problem:
        raise DocumentError(f"{problem}: no whole proof; prove the words again") from problem
    original = proof.original if isinstance(proof, EarlierDocument) else proof
    if view.digest != with_digest(original)["digest"]:
        raise DocumentError(f"{where}: digest: of another proof, so this one was changed; prove the words again")
    return dict(proof)

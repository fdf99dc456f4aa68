"""FittedModel ↔ the JSON document of `heatertune fit`: its fields in order, and their values.

The document is flat: the interval of a parameter is next to it, as `dead_time_s` and `dead_time_s_ci95`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.codec import (
    FLAT,
    LEFT_OUT,
    Document,
    OrUnknown,
    construct_from,
    decode,
    encode,
    plain,
    read_document,
    register_schema,
)
from heatertune.errors import DocumentError
from heatertune.heater.heat_loss import LossCurve
from heatertune.model.disturbance import CoolingEffect, DisturbanceEffect
from heatertune.model.findings import Finding
from heatertune.model.loss_curve import LossFopdt, LossTwoLag
from heatertune.model.model_values import (
    Candidate,
    FitOutcome,
    FittedModel,
    Fopdt,
    Half,
    HeaterModel,
    HeldOut,
    InputCorrelation,
    OneLog,
    Residuals,
    TwoLag,
    Validation,
    disagreeing_parameters,
    model_by_hand,
)
from heatertune.model.statistics import LJUNG_BOX_95, Interval
from heatertune.model.two_scales import TwoScale

__all__ = [
    "SCHEMA", "CorrelationView", "ModelView", "ValidationView", "WhitenessView", "from_document", "read_model",
    "to_document",
]

#: those of the first held no ends of intervals and no findings
SCHEMA = "heatertune/model/3"

Pair = tuple[float | None, float | None]
#: parameters in a document, each with its interval: x, x_ci95
SideBySide = Mapping[str, float | Pair]

_MOST = 1e150  # of any reading: its square is a number, too

_FIELDS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")


def to_document(fitted: FittedModel) -> dict[str, Any]:
    """Return the document; the keys of the working FOPDT are at top level, each with `<name>_ci95`."""
    document: dict[str, Any] = encode(ModelView.of(fitted))
    return document


def read_model(path: str | Path) -> FittedModel:
    """Return the model of a file; a document that contains only the FOPDT is a model given by its parameters.

    Raises:
        DocumentError: a field is missing, unknown, of the wrong type or out of range.
    """
    return from_document(read_document(path, SCHEMA), where=path)


def from_document(document: Document, *, where: str | Path = "model") -> FittedModel:
    """Return the model of a document; errors as in `read_model`."""
    return decode(ModelView, plain(document), where).value


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reduced:
    time_constant_s: float
    dead_time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateView:
    """A candidate or hypothesis; the two reductions are for readers alone."""

    gain_degC_per_pct: float
    time_constant_s: float
    dead_time_s: float
    ambient_degC: float | None = None
    second_time_constant_s: float | None = field(default=None, metadata=LEFT_OUT)
    loss: LossCurve | None = field(default=None, metadata=LEFT_OUT)
    fast_share: float | None = field(default=None, metadata=LEFT_OUT)
    half_rule: _Reduced | None = field(default=None, metadata=LEFT_OUT)
    matched: _Reduced | None = field(default=None, metadata=LEFT_OUT)
    log: str
    window_s: tuple[float, float]
    law: str
    controller: Mapping[str, float] = field(default_factory=dict)
    fit_pct: OrUnknown
    rmse_degC: OrUnknown
    delta_bic: OrUnknown
    fits_pct: Mapping[str, float] = field(default_factory=dict)
    hold_out_rmse_degC: float | None = None
    cross_rmse_degC: float | None = None
    on_bound: tuple[str, ...] = ()
    part: str = ""

    @classmethod
    def of(cls, candidate: Candidate) -> CandidateView:
        """Return the document of a candidate."""
        plant = candidate.model
        if isinstance(plant, Fopdt) or plant.loss is not None:  # the reductions are those of a linear heater
            return construct_from(cls, candidate, plant, half_rule=None)
        from heatertune.model.reduction import match_fopdt

        return construct_from(cls, candidate, plant, half_rule=construct_from(_Reduced, plant.half_rule()),
                     matched=construct_from(_Reduced, match_fopdt(plant)))

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> Candidate:
        """The candidate."""
        return construct_from(Candidate, self, model=_heater(self))


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinationView:
    """An identifiable combination of parameters."""

    value: float
    ci95: Pair | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingView:
    """A finding; its effect follows from its name."""

    name: str
    effect: str = ""
    message: str

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> Finding:
        """The finding."""
        return construct_from(Finding, self)


@dataclass(frozen=True, slots=True, kw_only=True)
class OneLogView:
    """The results of one of several logs; `alone` contains its own parameters, each with its interval."""

    name: str
    fit_pct: float
    alone_fit_pct: float
    ambient_degC: float
    drift_degC_per_s: float
    noise_degC: float
    alone: SideBySide

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> OneLog:
        """The value for this log."""
        values, ci95 = _parameters(self.alone)
        return construct_from(OneLog, self, values=values, ci95=ci95)


@dataclass(frozen=True, slots=True, kw_only=True)
class WhitenessView:
    """The whiteness of residuals with its limit."""

    ljung_box: float
    limit: float
    ok: bool

    @classmethod
    def of(cls, ljung_box: float) -> WhitenessView:
        """Return the document of a Ljung–Box statistic."""
        return cls(ljung_box=ljung_box, limit=LJUNG_BOX_95, ok=ljung_box <= LJUNG_BOX_95)


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationView:
    """The correlation of residuals and power with its limit."""

    largest: float
    at_lag_s: float
    limit: float
    ok: bool = True

    @classmethod
    def of(cls, correlation: InputCorrelation | None) -> CorrelationView | None:
        """Return its document."""
        return None if correlation is None else construct_from(cls, correlation)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Window:
    start_s: float
    end_s: float
    rmse_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _HeldOut:
    fit_pct: float
    rmse_degC: float
    windows: tuple[_Window, ...]

    @property
    def value(self) -> HeldOut:
        return construct_from(HeldOut, self, windows_s=tuple((window.start_s, window.end_s) for window in self.windows),
                     rmses_degC=tuple(window.rmse_degC for window in self.windows))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Half:
    window_s: tuple[float, float]
    ambient_degC: float | None
    fit_pct: float
    rmse_degC: float
    gain_degC_per_pct: float
    gain_degC_per_pct_ci95: Pair
    time_constant_s: float
    time_constant_s_ci95: Pair
    dead_time_s: float
    dead_time_s_ci95: Pair

    @property
    def value(self) -> Half:
        shown = [name for parameter in _FIELDS[:3] for name in (parameter, f"{parameter}_ci95")]
        values, ci95 = _parameters({name: getattr(self, name) for name in shown})
        return construct_from(Half, self, values=values, ci95=ci95)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Halves:
    parts: tuple[_Half, _Half]
    disagree: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationView:
    """Checks of the working model; null if not possible."""

    whiteness: WhitenessView
    input_crosscorrelation: CorrelationView | None = None
    held_out: _HeldOut
    halves: _Halves | None = None

    @classmethod
    def of(cls, validation: Validation) -> ValidationView:
        """Return their document."""
        parts, halves = validation.held_out, validation.halves
        windows = tuple(_Window(start_s=start, end_s=end, rmse_degC=rmse)
                        for (start, end), rmse in zip(parts.windows_s, parts.rmses_degC, strict=True))
        return cls(
            whiteness=WhitenessView.of(validation.ljung_box), held_out=construct_from(_HeldOut, parts, windows=windows),
            input_crosscorrelation=CorrelationView.of(validation.input_correlation),
            halves=None if halves is None else _Halves(
                parts=(_half(halves[0]), _half(halves[1])), disagree=disagreeing_parameters(halves)))

    @property
    def value(self) -> Validation:
        """The checks."""
        correlation, halves = self.input_crosscorrelation, self.halves
        return Validation(
            ljung_box=self.whiteness.ljung_box, held_out=self.held_out.value,
            input_correlation=None if correlation is None else construct_from(InputCorrelation, correlation),
            halves=None if halves is None else (halves.parts[0].value, halves.parts[1].value))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Residuals:
    time_s: tuple[OrUnknown, ...]
    measured_degC: tuple[OrUnknown, ...]
    simulated_degC: tuple[OrUnknown, ...]
    autocorrelation: tuple[OrUnknown, ...]

    def __post_init__(self) -> None:
        lengths = {len(series) for series in (self.time_s, self.measured_degC, self.simulated_degC)}
        if len(lengths) > 1:
            raise DocumentError(f"series of {', '.join(map(str, sorted(lengths)))} readings; expected as many in each")
        for column in fields(self):
            numbers = np.abs(np.asarray(getattr(self, column.name), dtype=np.float64))
            if np.any((numbers > _MOST) & (numbers < np.inf)):
                raise DocumentError(f"{column.name}: a number beyond ±{_MOST:g}")

    @property
    def value(self) -> Residuals:
        return Residuals(**{
            column.name: np.array(getattr(self, column.name), dtype=np.float64) for column in fields(self)})


@register_schema(SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class ModelView:
    """The document of a model; one that contains only the heater is a model given by its parameters."""

    gain_degC_per_pct: float
    gain_degC_per_pct_ci95: Pair | None = None
    time_constant_s: float
    time_constant_s_ci95: Pair | None = None
    dead_time_s: float
    dead_time_s_ci95: Pair | None = None
    ambient_degC: float | None = None
    ambient_degC_ci95: Pair | None = None
    second_time_constant_s: float | None = field(default=None, metadata=LEFT_OUT)
    fit_pct: float | None = None
    outcome: FitOutcome = FitOutcome.BY_HAND
    outcome_text: str = ""
    method: str = "given by hand"
    combinations: Mapping[str, CombinationView] = field(default_factory=dict)
    candidates: tuple[CandidateView, ...] = ()
    hypotheses: tuple[CandidateView, ...] = ()
    notes: tuple[str, ...] = ()
    log_summary: tuple[str, ...] = ()
    findings: tuple[FindingView, ...] = ()
    setpoint_degC: float | None = None
    logged_range_degC: tuple[float, float] | None = field(default=None, metadata=LEFT_OUT)
    log_interval_s: float | None = None
    least_dead_time_s: float | None = None
    reading_step_degC: float | None = None
    assumed: Mapping[str, float] = field(default_factory=dict)
    disturbance: DisturbanceEffect | None = field(default=None, metadata=LEFT_OUT)
    cooling: CoolingEffect | None = field(default=None, metadata=LEFT_OUT)
    logs: tuple[OneLogView, ...] = field(default=(), metadata=LEFT_OUT)
    validation: ValidationView | None = field(default=None, metadata=FLAT)
    residuals: _Residuals | None = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def of(cls, fitted: FittedModel) -> ModelView:
        """Return the document of a model."""
        rest, checks = fitted.residuals, fitted.validation
        return construct_from(
            cls, fitted, fitted.model, **{f"{name}_ci95": _pair(fitted.ci95.get(name)) for name in _FIELDS},
            outcome_text=fitted.outcome_text,
            combinations={name: CombinationView(value=value, ci95=_pair(ci95))
                          for name, (value, ci95) in fitted.combinations.items()},
            candidates=tuple(map(CandidateView.of, fitted.candidates)),
            hypotheses=tuple(map(CandidateView.of, fitted.hypotheses)),
            findings=tuple(construct_from(FindingView, finding,
                                          effect=finding.kind.effect) for finding in fitted.findings),
            logs=tuple(construct_from(OneLogView, log,
                                      alone=_side_by_side(log.values, log.ci95)) for log in fitted.logs),
            validation=None if checks is None else ValidationView.of(checks),
            residuals=None if rest is None else construct_from(
                _Residuals, rest, simulated_degC=np.round(rest.simulated_degC, 4),
                autocorrelation=np.round(rest.autocorrelation, 4)))

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> FittedModel:
        """The model.

        Raises:
            DocumentError: a working model of two lags.
        """
        model = _heater(self)
        if not self.candidates:
            return model_by_hand(model)
        if not isinstance(model, Fopdt):
            raise DocumentError("second_time_constant_s: the working model has one lag")
        return construct_from(
            FittedModel, self, model=model, ci95={name: _interval(getattr(self, f"{name}_ci95")) for name in _FIELDS},
            combinations={name: (view.value, _interval(view.ci95) or Interval(low=None, high=None))
                          for name, view in self.combinations.items()},
            candidates=tuple(candidate.value for candidate in self.candidates),
            hypotheses=tuple(hypothesis.value for hypothesis in self.hypotheses),
            residuals=None if self.residuals is None else self.residuals.value,
            validation=None if self.validation is None else self.validation.value,
            logs=tuple(log.value for log in self.logs), findings=tuple(finding.value for finding in self.findings),
            log_interval_s=self.log_interval_s or 0.0, least_dead_time_s=self.least_dead_time_s or 0.0,
            reading_step_degC=self.reading_step_degC or 0.0)


def _heater(view: CandidateView | ModelView) -> HeaterModel:
    if isinstance(view, CandidateView) and view.loss is not None:
        if view.second_time_constant_s is None:
            return construct_from(LossFopdt, view)
        return construct_from(LossTwoLag, view)
    if isinstance(view, CandidateView) and view.fast_share is not None:
        return construct_from(TwoScale, view)
    return construct_from(Fopdt, view) if view.second_time_constant_s is None else construct_from(TwoLag, view)


def _half(half: Half) -> _Half:
    return construct_from(_Half, half, **_side_by_side(half.values, half.ci95))


def _pair(interval: Interval | None) -> Pair | None:
    return None if interval is None else (interval.low, interval.high)


def _interval(pair: Pair | None) -> Interval | None:
    return None if pair is None else Interval(low=pair[0], high=pair[1])


def _side_by_side(values: Mapping[str, float], ci95: Mapping[str, Interval]) -> SideBySide:
    return {key: item for name, interval in ci95.items()
            for key, item in ((name, values[name]), (f"{name}_ci95", (interval.low, interval.high)))}


def _parameters(flat: SideBySide) -> tuple[dict[str, float], dict[str, Interval]]:
    """Return the values and intervals of parameters that are stored side by side."""
    names = [name for name in flat if not name.endswith("_ci95")]
    if sorted(flat) != sorted([*names, *(f"{name}_ci95" for name in names)]):
        raise DocumentError(f"{', '.join(flat)}; expected each parameter with its interval, its name and _ci95")
    values = {name: item for name, item in flat.items() if not isinstance(item, tuple)}
    if values.keys() != set(names):
        raise DocumentError("a parameter is no number, or its interval no pair")
    pairs = {name: item for name, item in flat.items() if isinstance(item, tuple)}
    return values, {name: Interval(low=low, high=high) for name in names for low, high in [pairs[f"{name}_ci95"]]}

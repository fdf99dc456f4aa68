"""What a model's document holds, field by field as it is written, and the values that stand for it.

The document is flat for its readers: each parameter has its interval beside it, `dead_time_s` and `dead_time_s_ci95`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from heatertune.codec import OrUnknown, registered
from heatertune.errors import DocumentError
from heatertune.model.by_hand import model_by_hand
from heatertune.model.findings import Finding
from heatertune.model.intervals import Interval
from heatertune.model.judgement import Half, HeldOut, InputCorrelation, Validation
from heatertune.model.values import (
    Candidate,
    FittedModel,
    Fopdt,
    HeaterModel,
    OneLog,
    Outcome,
    Residuals,
    TwoLag,
)

__all__ = ["SCHEMA", "ModelView"]

#: those of the first held no ends of intervals and no findings
SCHEMA = "heatertune/model/2"

Pair = tuple[float | None, float | None]

_FIELDS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plant:
    gain_degC_per_pct: float
    time_constant_s: float
    dead_time_s: float
    ambient_degC: float | None = None
    second_time_constant_s: float | None = None

    @property
    def heater(self) -> HeaterModel:
        settings = {"gain_degC_per_pct": self.gain_degC_per_pct, "time_constant_s": self.time_constant_s,
                    "dead_time_s": self.dead_time_s}
        if self.second_time_constant_s is None:
            return Fopdt(**settings, ambient_degC=self.ambient_degC)
        return TwoLag(**settings, second_time_constant_s=self.second_time_constant_s, ambient_degC=self.ambient_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reduced:
    time_constant_s: float
    dead_time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateView(_Plant):
    """A candidate or hypothesis; the two reductions are for readers alone."""

    half_rule: _Reduced | None = None
    matched: _Reduced | None = None
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

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> Candidate:
        """The candidate."""
        return Candidate(
            model=self.heater, log=self.log, window_s=self.window_s, law=self.law, controller=self.controller,
            fit_pct=self.fit_pct, rmse_degC=self.rmse_degC, delta_bic=self.delta_bic, fits_pct=self.fits_pct,
            hold_out_rmse_degC=self.hold_out_rmse_degC, cross_rmse_degC=self.cross_rmse_degC, on_bound=self.on_bound,
            part=self.part)


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinationView:
    """An identifiable combination of parameters."""

    value: float
    ci95: Pair | None

    @property
    def pair(self) -> tuple[float, Interval]:
        """Its value and interval."""
        return self.value, _interval(self.ci95) or Interval(low=None, high=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingView:
    """A finding; its effect follows from its name."""

    name: str
    effect: str = ""
    told: str

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> Finding:
        """The finding."""
        return Finding(name=self.name, told=self.told)


@dataclass(frozen=True, slots=True, kw_only=True)
class OneLogView:
    """What one of several logs says; `alone` holds its own parameters, each with its interval."""

    name: str
    fit_pct: float
    alone_fit_pct: float
    ambient_degC: float
    drift_degC_per_s: float
    noise_degC: float
    alone: Mapping[str, float | Pair]

    def __post_init__(self) -> None:
        _ = self.value

    @property
    def value(self) -> OneLog:
        """What the log says."""
        values, ci95 = _parameters(self.alone)
        return OneLog(
            name=self.name, fit_pct=self.fit_pct, alone_fit_pct=self.alone_fit_pct, ambient_degC=self.ambient_degC,
            drift_degC_per_s=self.drift_degC_per_s, noise_degC=self.noise_degC, values=values, ci95=ci95)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Whiteness:
    ljung_box: float
    limit: float
    ok: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Correlation:
    largest: float
    at_lag_s: float
    limit: float
    ok: bool = True

    @property
    def value(self) -> InputCorrelation:
        return InputCorrelation(largest=self.largest, at_lag_s=self.at_lag_s, limit=self.limit)


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
        return HeldOut(fit_pct=self.fit_pct, rmse_degC=self.rmse_degC,
                       windows_s=tuple((each.start_s, each.end_s) for each in self.windows),
                       rmses_degC=tuple(each.rmse_degC for each in self.windows))


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
        shown = [name for field_ in _FIELDS[:3] for name in (field_, f"{field_}_ci95")]
        values, ci95 = _parameters({name: getattr(self, name) for name in shown})
        return Half(window_s=self.window_s, values=values, ci95=ci95, ambient_degC=self.ambient_degC,
                    fit_pct=self.fit_pct, rmse_degC=self.rmse_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Halves:
    parts: tuple[_Half, _Half]
    disagree: tuple[str, ...] = ()


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

    @property
    def value(self) -> Residuals:
        return Residuals(**{each.name: np.array(getattr(self, each.name), dtype=np.float64) for each in fields(self)})


@registered(SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class ModelView(_Plant):
    """The document of a model; one that holds only the heater is a model given by hand."""

    gain_degC_per_pct_ci95: Pair | None = None
    time_constant_s_ci95: Pair | None = None
    dead_time_s_ci95: Pair | None = None
    ambient_degC_ci95: Pair | None = None
    fit_pct: float | None = None
    outcome: Outcome = Outcome.BY_HAND
    outcome_text: str = ""
    method: str = "given by hand"
    combinations: Mapping[str, CombinationView] = field(default_factory=dict)
    candidates: tuple[CandidateView, ...] = ()
    hypotheses: tuple[CandidateView, ...] = ()
    notes: tuple[str, ...] = ()
    log_told: tuple[str, ...] = ()
    findings: tuple[FindingView, ...] = ()
    setpoint_degC: float | None = None
    log_interval_s: float | None = None
    least_dead_time_s: float | None = None
    reading_step_degC: float | None = None
    assumed: Mapping[str, float] = field(default_factory=dict)
    logs: tuple[OneLogView, ...] = ()
    whiteness: _Whiteness | None = None
    input_crosscorrelation: _Correlation | None = None
    held_out: _HeldOut | None = None
    halves: _Halves | None = None
    residuals: _Residuals | None = None

    def __post_init__(self) -> None:
        _ = self.value
        if (self.held_out is None) != (self.whiteness is None):
            raise DocumentError("held_out and whiteness belong together; one is missing")

    @property
    def value(self) -> FittedModel:
        """The model."""
        model = self.heater
        if not self.candidates:
            return model_by_hand(model)
        if not isinstance(model, Fopdt):
            raise DocumentError("second_time_constant_s: the working model has one lag")
        return FittedModel(
            model=model, outcome=self.outcome, method=self.method,
            ci95={name: _interval(getattr(self, f"{name}_ci95")) for name in _FIELDS},
            combinations={name: item.pair for name, item in self.combinations.items()},
            candidates=tuple(each.value for each in self.candidates),
            hypotheses=tuple(each.value for each in self.hypotheses),
            fit_pct=self.fit_pct, notes=self.notes, residuals=None if self.residuals is None else self.residuals.value,
            validation=self._validation, logs=tuple(each.value for each in self.logs), log_told=self.log_told,
            findings=tuple(each.value for each in self.findings), setpoint_degC=self.setpoint_degC,
            assumed=self.assumed, log_interval_s=self.log_interval_s or 0.0,
            least_dead_time_s=self.least_dead_time_s or 0.0, reading_step_degC=self.reading_step_degC or 0.0)

    @property
    def _validation(self) -> Validation | None:
        if self.held_out is None or self.whiteness is None:
            return None
        seen, halves = self.input_crosscorrelation, self.halves
        return Validation(
            ljung_box=self.whiteness.ljung_box, input_correlation=None if seen is None else seen.value,
            held_out=self.held_out.value,
            halves=None if halves is None else (halves.parts[0].value, halves.parts[1].value))


def _interval(pair: Pair | None) -> Interval | None:
    return None if pair is None else Interval(low=pair[0], high=pair[1])


def _parameters(flat: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, Interval]]:
    """Return the values and intervals of parameters that stand side by side."""
    names = [name for name in flat if not name.endswith("_ci95")]
    if sorted(flat) != sorted([*names, *(f"{name}_ci95" for name in names)]):
        raise DocumentError(f"{', '.join(flat)}; expected each parameter with its interval, its name and _ci95")
    if any(isinstance(flat[name], tuple) or not isinstance(flat[f"{name}_ci95"], tuple) for name in names):
        raise DocumentError("a parameter is no number, or its interval no pair")
    return ({name: flat[name] for name in names},
            {name: Interval(low=low, high=high) for name in names for low, high in [flat[f"{name}_ci95"]]})

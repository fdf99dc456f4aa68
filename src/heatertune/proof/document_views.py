"""What log, pictures and comparison hold as documents, field by field as they are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain

from heatertune.codec import register_schema
from heatertune.errors import DocumentError

__all__ = ["ComparisonView", "LogView", "PicturesView"]

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
    reading: Mapping[str, str | float | bool]


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

    def __post_init__(self) -> None:
        _demand_drawable(time_s=self.time_s, temperature_degC=self.temperature_degC)
        for name, column in (("power_pct", self.power_pct), ("setpoint_degC", self.setpoint_degC)):
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
        told = ", ".join(f"{len(numbers)} of {name}" for name, numbers in series.items())
        raise DocumentError(f"{told}; expected as many of each, and at least one")
    if not all(abs(number) <= _MOST for number in chain(*series.values())):
        raise DocumentError(f"{' and '.join(series)}: a number beyond ±{_MOST:g}")

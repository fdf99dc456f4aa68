"""What checks of a fit found: values only."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from heatertune.model.intervals import Interval

__all__ = ["Half", "HeldOut", "InputCorrelation", "Validation", "disagreeing_parameters"]

Bounds = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class InputCorrelation:
    """The lag at which the residuals follow the power most, measured by what chance allows there.

    Attributes:
        largest: normalised correlation at that lag, both series whitened.
        at_lag_s: the power's lead over the residual [s].
        limit: what the magnitude stays below in 95 of 100 logs of a right model, all lags taken together.
    """

    largest: float
    at_lag_s: float
    limit: float

    @property
    def ok(self) -> bool:
        """Whether nothing but chance is seen."""
        return abs(self.largest) <= self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Windows that were left out of the fit, each in turn, and foretold by what the others gave.

    Attributes:
        fit_pct: 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) over all of them [%].
        rmse_degC: error over all of them [°C].
        windows_s: first and last instant of each [s].
        rmses_degC: error in each [°C].
    """

    fit_pct: float
    rmse_degC: float
    windows_s: tuple[Bounds, ...]
    rmses_degC: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Half:
    """One lag fitted to one half of a log.

    Attributes:
        window_s: first and last instant [s].
        values: parameter → its value, unit in the name.
        ci95: parameter → 95 % interval, symmetrical; an end that no heater can have is open.
        ambient_degC: of this half, None where no temperature there is [°C].
        fit_pct, rmse_degC: on this half [%, °C].
    """

    window_s: Bounds
    values: Mapping[str, float]
    ci95: Mapping[str, Interval]
    ambient_degC: float | None
    fit_pct: float
    rmse_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Checks of the working model of a log with power.

    Attributes:
        ljung_box: whiteness of the residuals; see `validation.ljung_box`.
        input_correlation: None where the power does not move within reach.
        held_out: windows that the fit had not seen.
        halves: None where one of them holds no heater, or too few readings.
    """

    ljung_box: float
    input_correlation: InputCorrelation | None
    held_out: HeldOut
    halves: tuple[Half, Half] | None


def disagreeing_parameters(halves: tuple[Half, Half]) -> tuple[str, ...]:
    """Return the parameters whose two values lie further apart than their intervals allow at 95 %.

    The standard deviations of two independent estimates add up as squares.
    """
    first, second = halves
    return tuple(
        name for name, value in first.values.items()
        if abs(value - second.values[name]) > math.hypot(*(_reach(half, name) for half in halves))
    )


def _reach(half: Half, name: str) -> float:
    high = half.ci95[name].high
    return math.inf if high is None else high - half.values[name]

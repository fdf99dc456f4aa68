"""Mirror a cooler into a heater: the same parameters with opposite direction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final, TypeVar

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.model_values import Candidate, FittedModel, HeaterModel
from heatertune.model.statistics import RATIO, Interval

__all__ = ["cools", "middle_degC", "mirror_heater", "mirrored_log", "mirrored_model"]

_Model = TypeVar("_Model", bound=HeaterModel)

#: numbers that change their sign in the mirror
_SIGNED: Final = ("gain_degC_per_pct", RATIO)


def cools(fitted: FittedModel) -> bool:
    """Return whether more power makes it colder.

    Raises:
        InputError: some candidates cool and others heat.
    """
    signs = {plant.gain_degC_per_pct < 0.0 for plant in fitted.plants}
    if len(signs) > 1:
        raise InputError("some of the possible models cool and others heat: no controller serves both")
    return signs.pop()


def mirror_heater(fitted: FittedModel, about_degC: float = 0.0) -> FittedModel:
    """Return the heater for a cooler and the cooler for a heater, its temperatures mirrored at one [°C]."""
    def turned(candidate: Candidate) -> Candidate:
        return replace(candidate, model=mirrored_model(candidate.model, about_degC))

    combinations = {name: (-value, _turned(its, 0.0)) if name in _SIGNED else (value, its)
                    for name, (value, its) in fitted.combinations.items()}
    rest, limits = fitted.residuals, fitted.logged_range_degC
    return replace(
        fitted, model=mirrored_model(fitted.model, about_degC), ci95=_intervals(fitted.ci95, about_degC),
        combinations=combinations, candidates=tuple(map(turned, fitted.candidates)),
        hypotheses=tuple(map(turned, fitted.hypotheses)),
        setpoint_degC=None if fitted.setpoint_degC is None else 2.0 * about_degC - fitted.setpoint_degC,
        logged_range_degC=None if limits is None else (2.0 * about_degC - limits[1], 2.0 * about_degC - limits[0]),
        residuals=None if rest is None else replace(
            rest, measured_degC=2.0 * about_degC - rest.measured_degC,
            simulated_degC=2.0 * about_degC - rest.simulated_degC),
    )


def middle_degC(log: Log) -> float:
    """Return the middle of a log's readings: mirrored there, they stay where they are possible [°C]."""
    return 0.5 * float(log.temperature_degC.min() + log.temperature_degC.max())


def mirrored_log(log: Log, about_degC: float) -> Log:
    """Return the log of the heater for that of a cooler, its temperatures mirrored at one [°C]."""
    setpoint, rest, room = log.setpoint_degC, log.rests_at_degC, log.ambient_degC
    turned = log.with_rows(
        temperature_degC=2.0 * about_degC - log.temperature_degC,
        setpoint_degC=None if setpoint is None else 2.0 * about_degC - setpoint,
        ambient_degC=None if room is None else 2.0 * about_degC - room)
    return replace(turned, rests_at_degC=None if rest is None else 2.0 * about_degC - rest)


def mirrored_model(model: _Model, about_degC: float) -> _Model:
    """Return the heater for a cooler and the cooler for a heater, its ambient mirrored at a temperature [°C]."""
    ambient = None if model.ambient_degC is None else 2.0 * about_degC - model.ambient_degC
    return replace(model, gain_degC_per_pct=-model.gain_degC_per_pct, ambient_degC=ambient)


def _intervals(ci95: Mapping[str, Interval | None], about_degC: float) -> dict[str, Interval | None]:
    turns = dict.fromkeys(_SIGNED, 0.0) | {"ambient_degC": about_degC}
    return {name: its if its is None or name not in turns else _turned(its, turns[name]) for name, its in ci95.items()}


def _turned(interval: Interval, about: float) -> Interval:
    """Return the interval with its ends mirrored, and so exchanged."""
    low, high = (None if end is None else 2.0 * about - end for end in (interval.high, interval.low))
    return Interval(low=low, high=high)

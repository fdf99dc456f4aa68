"""A heater in another form: two lags as one for tuning, a cooler as a heater; what a closed loop identifies of it.

The half rule (`TwoLag.half_rule`) was made for one tuning rule. The reduction here keeps the gain and matches lag and
dead time to the frequency response within an octave of the crossover frequency.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.model_values import Candidate, FittedModel, Fopdt, HeaterModel, TwoLag
from heatertune.model.statistics import RATIO, Interval, rescale

__all__ = [
    "COMBINATIONS", "FIELDS", "PROPORTIONAL_TO_GAIN", "cools", "crossover_rad_s", "half_rule_intervals", "match_fopdt",
    "middle_degC", "mirror_heater", "mirrored_log", "mirrored_model", "ultimate_period_s", "zero_s",
]


_BISECTIONS = 60


def zero_s(plant: HeaterModel) -> float:
    """Return the time of the zero of a heater of two time scales [s], 0 if there is none."""
    return (plant.fast_share or 0.0) * plant.lags_s[0]


def ultimate_period_s(plant: HeaterModel) -> float:
    """Return the period at which the heater lags by half a turn [s]; infinite if it never does.

    A proportional controller that is turned up swings at it (J. G. Ziegler and N. B. Nichols, "Optimum settings for
    automatic controllers", Trans. ASME 64 (1942) 759–768).
    """
    if plant.dead_time_s == 0.0:
        return float("inf")  # two lags alone come near half a turn and never reach it

    def turned(omega: float) -> float:
        lead = float(np.arctan(omega * zero_s(plant)))
        return omega * plant.dead_time_s + sum(float(np.arctan(omega * lag)) for lag in plant.lags_s) - lead

    low, high = 0.0, np.pi / plant.dead_time_s
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if turned(middle) < np.pi else (low, middle)
    return 2.0 * np.pi / high


Measure = Callable[[HeaterModel], float]

#: field of the working model → its value for a heater
FIELDS: Final[dict[str, Measure]] = {
    "gain_degC_per_pct": lambda plant: plant.half_rule().gain_degC_per_pct,
    "time_constant_s": lambda plant: plant.half_rule().time_constant_s,
    "dead_time_s": lambda plant: plant.half_rule().dead_time_s,
    "ambient_degC": lambda plant: float(plant.ambient_degC or 0.0),
}

#: combination → its value for a heater
COMBINATIONS: Final[dict[str, Measure]] = {
    "gain_per_time_constant_degC_per_s_pct": lambda plant: plant.gain_degC_per_pct / plant.half_rule().time_constant_s,
    "effective_dead_time_s": lambda plant: plant.half_rule().dead_time_s,
    "ultimate_period_s": ultimate_period_s,
}
#: names of what is proportional to the gain
PROPORTIONAL_TO_GAIN: Final = ("gain_degC_per_pct", "gain_per_time_constant_degC_per_s_pct")


def half_rule_intervals(model: HeaterModel, ci95: Mapping[str, Interval]) -> dict[str, Interval]:
    """Return the intervals of a heater's own parameters as those of its half rule, which scales and shifts them."""
    half = model.half_rule()
    longer, later_s = half.time_constant_s / model.lags_s[0], half.dead_time_s - model.dead_time_s
    changes = {"time_constant_s": (longer, 0.0), "dead_time_s": (1.0, later_s), RATIO: (1.0 / longer, 0.0)}
    return {name: rescale(interval, *changes.get(name, (1.0, 0.0))) for name, interval in ci95.items()}


#: phase at which a PI loop with Ms about 1.6 is cut [°]: the controller and the phase margin take the rest
_CUT_DEG: Final = 120.0
_OCTAVES: Final = 0.5
_POINTS: Final = 60
_LEAST: Final = 1e-4  # share of a step below which no step gains


def crossover_rad_s(model: HeaterModel) -> float:
    """Return the frequency at which the heater lags by 120°, where loops around it are cut [rad/s]."""
    slowest, quickest = sum(model.lags_s) + model.dead_time_s, min((*model.lags_s, model.dead_time_s or math.inf))

    def beyond(log_omega: float) -> float:
        return _lag_deg(model, math.exp(log_omega)) - _CUT_DEG

    low, high = math.log(1e-3 / slowest), math.log(1e3 / quickest)
    if beyond(high) < 0.0:  # one lag, or two scales, without dead time never lags by so much
        return math.exp(high)
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if beyond(middle) > 0.0 else (middle, high)
    return math.exp(low)


def _lag_deg(model: HeaterModel, omega: float) -> float:
    lags = sum(math.atan(lag * omega) for lag in model.lags_s) - math.atan(zero_s(model) * omega)
    return math.degrees(lags + omega * model.dead_time_s)


def match_fopdt(model: HeaterModel) -> Fopdt:
    """Return the FOPDT with the same gain whose frequency response is nearest around the crossover.

    The relative error is weighted by a Gaussian over ln ω, half an octave wide, up to two widths on either side. A
    heater with one lag is returned unchanged.
    """
    if not isinstance(model, TwoLag):
        return model
    octave = math.log(2.0)
    spread = np.linspace(-2.0, 2.0, _POINTS)
    omega = crossover_rad_s(model) * np.exp(spread * _OCTAVES * octave)
    weight = np.exp(-0.5 * spread**2)
    response = model.frequency_response(omega)

    def error(lag: float, dead: float) -> tuple[Array, Array]:
        """Return the weighed relative error as 2·n real numbers, and its slopes by ln T and by L, shape (2·n, 2)."""
        turned = 1j * omega * lag
        ratio = weight * model.gain_degC_per_pct * np.exp(-1j * omega * dead) / (1.0 + turned) / response
        parts = np.array([ratio - weight, -ratio * turned / (1.0 + turned), -1j * omega * ratio])
        real = np.concatenate([parts.real, parts.imag], axis=1)
        return real[0], real[1:].T

    start = model.half_rule()
    lag, dead, share = start.time_constant_s, start.dead_time_s, 1.0
    left, slopes = error(lag, dead)
    while share > _LEAST:  # Gauss and Newton, less far where that is no gain
        by = -share * np.linalg.lstsq(slopes, left, rcond=None)[0]
        further = lag * math.exp(by[0]), max(dead + float(by[1]), 0.0)
        tried, beyond = error(*further)
        if tried @ tried < left @ left:
            (lag, dead), left, slopes, share = further, tried, beyond, 1.0
        else:
            share /= 4.0
    return Fopdt(gain_degC_per_pct=model.gain_degC_per_pct, time_constant_s=lag, dead_time_s=dead,
                 ambient_degC=model.ambient_degC)


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

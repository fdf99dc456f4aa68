"""Whether a heater is linear: gain by power, loss by temperature, heating against cooling, a ceiling.

A linear fit to a heater that is not lies between its ends, and the worst design is made for a third of the true gain.
Where another shape explains a log better, the local heaters at both its ends are candidates, so that a design serves
both. A load that sets in with an edge of the power is such a shape until none explains it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import ABSOLUTE_ZERO_DEGC
from heatertune.model.diagnostics import Remark
from heatertune.model.power.events import Way, refit_all
from heatertune.model.power.input_curve import InputCurve, fit_input_curve, knots_of
from heatertune.model.power.load_steps import bic_of, coincides, left_over, with_loads
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.state_dependent import CEILING, COOLING, LOSS, BentHeater, fit_bent_heater
from heatertune.model.statistics import ar1_bic
from heatertune.model.values import Fopdt, HeaterModel, TwoLag

__all__ = ["Bend", "bend_remarks", "judged_linear"]

Array = npt.NDArray[np.float64]

_NEAR = 10.0  # BIC points
_MISFIT = 1.3  # times the noise between neighbours, that a linear fit may leave over
_READINGS = 400  # averaged, on which the noise is told from the misfit
_SATURATED = 0.1  # of the largest gain: less is no gain to control with
_ALIKE = 1.1  # ends nearer than that are one heater
_USE = 0.75  # of the span of the readings: where the heater is used, if nobody says


class LocalHeater(NamedTuple):
    """A local heater, and where it is one."""

    model: HeaterModel
    at: str

    @property
    def rate(self) -> float:
        """Gain per time constant [°C/(s·%)]."""
        return self.model.gain_degC_per_pct / self.model.lags_s[0]


class Bend(NamedTuple):
    """A shape that explains a log better than a straight line: its two ends, the one with more gain per lag first."""

    ends: tuple[LocalHeater, LocalHeater]
    simulated_degC: Array
    bic: float
    sentence: str


class LinearityResult(NamedTuple):
    """The linear way to be believed, the bend that explains the log better, if any, and what cannot be told."""

    way: Way
    bend: Bend | None = None
    notes: tuple[str, ...] = ()


def bend_remarks(bend: Bend | None) -> tuple[Remark, ...]:
    """Return what a bend means, nothing without one."""
    return () if bend is None else (Remark("nonlinear", bend.sentence),)


def judged_linear(plain: Way, eventful: Way) -> LinearityResult:
    """Return whether the heater is linear.

    Args:
        plain: one lag and two, their start as found, without drift and loads.
        eventful: with the drift and loads that a linear heater asks for.
    """
    if len(plain.problems[0].readings.restart_s) or not _misses(plain):
        return LinearityResult(eventful)
    tried = [(bend, way) for way in _without_loads(plain, eventful) for bend in _bends(way)]
    bend, way = min(tried, key=lambda pair: pair[0].bic, default=(None, eventful))
    if bend is None or not _is_better(bend, eventful):
        return LinearityResult(eventful, None, _untold(eventful))
    return LinearityResult(way, bend)


def _is_better(bend: Bend, eventful: Way) -> bool:
    """Return whether a bend explains more than the linear heater with its drift, and loads apart from the edges."""
    dead = max(float(eventful.fits[0].vector[1]), bend.ends[0].model.dead_time_s)
    kept = tuple(t for t in eventful.problems[0].loads_s if not coincides(eventful.problems[0], dead, t))
    if kept == eventful.problems[0].loads_s:
        return bend.bic < eventful.bic - _NEAR
    problems = [replace(problem, loads_s=kept) for problem in eventful.problems]
    honest = Way(*with_loads(problems, refit_all(problems, eventful.fits), edges_dead_time_s=dead))
    # a load that no bend explains as well did set in with an edge
    return bend.bic < honest.bic - _NEAR and bend.bic < eventful.bic + _NEAR


def _untold(eventful: Way) -> tuple[str, ...]:
    if len(knots_of(eventful.problems[0])) > 2:
        return ()
    return ("What one lag and two leave over may be a gain that depends on the power, which a log of two powers cannot "
            "tell: log steps between three.",)


def _misses(way: Way) -> bool:
    """Return whether the better of one lag and two leaves more than what differs between neighbours."""
    place = int(np.argmin([bic_of(*pair) for pair in zip(*way, strict=True)]))
    if not left_over(way.problems[place], way.fits[place]):
        return False
    thin = way.problems[place].average(_READINGS)
    fit = thin.refine(way.fits[place].vector[None, :])
    left = thin.readings.temperature_degC - fit.simulated_degC
    noise = float(np.sqrt(np.mean(np.diff(left, 2) ** 2) / 6.0))
    return float(np.sqrt(np.mean(left**2))) > _MISFIT * noise


def _without_loads(plain: Way, eventful: Way) -> Iterator[Way]:
    yield plain
    if eventful.problems[0].drift:
        problems = [replace(problem, drift=True) for problem in plain.problems]
        yield Way(problems, refit_all(problems, plain.fits))


def _bends(way: Way) -> Iterator[Bend]:
    """Yield every bend that a log shows, each with one lag and with two."""
    for problem, fit in zip(*way, strict=True):
        if fit.model is not None:
            curve = fit_input_curve(problem, fit)
            if curve is not None:
                yield from _of_curve(problem, curve)
            for bend in (COOLING, LOSS, CEILING):
                yield from _of_bent(problem, fit_bent_heater(problem, fit, bend), bend)


def _of_curve(problem: PowerProblem, curve: InputCurve) -> Iterator[Bend]:
    knots, gains = curve.knots_pct, curve.gains_degC_per_pct
    lag, dead, ratio = float(np.exp(curve.vector[0])), float(curve.vector[1]), float(curve.vector[2])
    able = np.flatnonzero(gains > _SATURATED * gains.max())
    if not len(able):  # no power warms it at all
        return
    strong, weak = able[np.argmax(gains[able])], able[np.argmin(gains[able])]
    if (strong == weak and len(able) == len(gains)) or _alike(gains[strong], gains.min()):
        return
    rises = np.append(0.0, np.cumsum(gains * np.diff(knots)))
    readings = problem.readings.temperature_degC
    use, lowest = _use(readings), float(readings.min())
    power = float(np.interp(use - lowest, rises, knots)) if rises[-1] > 0.0 else float(knots[-1])
    ends = tuple(
        LocalHeater(_heater(float(gains[i]), (lag, lag * ratio), dead, max(use - float(gains[i]) * power, lowest)),
            f"{knots[i]:.3g}…{knots[i + 1]:.3g} %")
        for i in (strong, weak)
    )
    clause = f"gain from {gains[strong]:.3g} °C/% at {ends[0].at} to {float(gains.min()):.3g} °C/% at " + (
        f"{knots[int(np.argmin(gains))]:.3g}…{knots[int(np.argmin(gains)) + 1]:.3g} % of power")
    yield _bend(problem, ends, curve.simulated_degC, curve.unknowns, clause)


def _of_bent(problem: PowerProblem, bent: BentHeater, bend: int) -> Iterator[Bend]:
    if bent.on_bound:
        return
    readings, ambient = problem.readings.temperature_degC, bent.ambient_degC
    dead, second = bent.dead_time_s, bent.ratio * bent.lags_s[0]

    def at(lag: float, stiff: float) -> HeaterModel:
        gain = bent.gain_degC_per_pct / stiff
        above = _use(readings) - ambient
        power = above * (1.0 + bent.loss_per_degC * above) / bent.gain_degC_per_pct
        return _heater(gain, (lag / stiff, second), dead, max(_use(readings) - gain * power, ambient))

    if bend == COOLING:
        ends = (LocalHeater(at(bent.lags_s[0], 1.0), "heating"), LocalHeater(at(bent.lags_s[1], 1.0), "cooling"))
        if not _alike(*bent.lags_s):
            clause = (f"it warms with a time constant of {bent.lags_s[0]:.3g} s and cools with {bent.lags_s[1]:.3g} s, "
                      f"gain {bent.gain_degC_per_pct:.3g} °C/% at both")
            yield _bend(problem, ends, bent.simulated_degC, bent.unknowns, clause)
    elif bend == LOSS:
        places = (float(readings.min()), float(readings.max()))
        stiff = [1.0 + 2.0 * bent.loss_per_degC * max(place - ambient, 0.0) for place in places]
        if not _alike(*stiff):
            cold, hot = (LocalHeater(at(bent.lags_s[0], s), f"{t:.3g} °C") for s, t in zip(stiff, places, strict=True))
            clause = (f"gain from {cold.model.gain_degC_per_pct:.3g} °C/% at {cold.at} to "
                      f"{hot.model.gain_degC_per_pct:.3g} °C/% at {hot.at}, and the time constant with it")
            yield _bend(problem, (cold, hot), bent.simulated_degC, bent.unknowns, clause)
    else:
        model = at(bent.lags_s[0], 1.0)
        end = LocalHeater(model, f"below {bent.ceiling_degC:.3g} °C")
        clause = (f"gain from {model.gain_degC_per_pct:.3g} °C/% at less than {bent.ceiling_degC:.4g} °C to 0 °C/% at "
                  "that temperature, which it does not pass")
        yield _bend(problem, (end, end), bent.simulated_degC, bent.unknowns, clause)


def _bend(problem: PowerProblem, ends: Sequence[LocalHeater], simulated: Array, unknowns: int, clause: str) -> Bend:
    first, second = sorted(ends, key=lambda end: -end.rate)
    return Bend(
        (first, second), simulated, ar1_bic(problem.readings.temperature_degC - simulated, unknowns),
        f"The heater is not linear: {clause}.",
    )


def _heater(gain: float, lags: tuple[float, float], dead: float, ambient: float) -> HeaterModel:
    ambient_degC = ambient if ambient >= ABSOLUTE_ZERO_DEGC else None
    second, first = sorted(lags)
    if second <= 0.0:
        return Fopdt(gain_degC_per_pct=gain, time_constant_s=first, dead_time_s=dead, ambient_degC=ambient_degC)
    return TwoLag(gain_degC_per_pct=gain, time_constant_s=first, second_time_constant_s=second, dead_time_s=dead,
                  ambient_degC=ambient_degC)


def _use(readings: Array) -> float:
    return float(readings.min()) + _USE * float(np.ptp(readings))


def _alike(first: float, second: float) -> bool:
    return max(first, second) < _ALIKE * min(first, second)

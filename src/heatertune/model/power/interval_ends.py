"""The heaters at the ends of what a log leaves open: one number at its end, the others fitted anew there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.log.values import Log
from heatertune.model.measures import ultimate_period_s
from heatertune.model.power.load_steps import bic_of
from heatertune.model.power.open_loop import FAR, PowerFit, PowerProblem
from heatertune.model.power.uncertainty import READINGS, held_at, value_of
from heatertune.model.statistics import PERIOD, RATIO, Interval, fit_pct, identified_parts
from heatertune.model.values import Candidate, Fopdt, Half, HeaterModel, disagreeing_parameters

__all__ = ["AtEnd", "ends_of", "halves_of", "held_by", "told_apart"]

_SAME: Final = 0.03  # of each number: such a heater adds nothing to a family
_ON_BOUND: Final = 0.99  # of the longest time constant that is searched
_HALVINGS: Final = 6  # of the way to an end that no heater has


class AtEnd(NamedTuple):
    """A heater with one number held: its fit [%], its error [°C], and its BIC above the best one's."""

    model: HeaterModel
    fit_pct: float
    rmse_degC: float
    bic: float = 0.0


#: name and value of a number → the heater with it held, None where there is none
FitWithHeld = Callable[[str, float], AtEnd | None]


class _ParameterEnd(NamedTuple):
    name: str
    side: str
    what: str


_ENDS: Final = (
    _ParameterEnd("dead_time_s", "low", "dead time at its low end"),
    _ParameterEnd("dead_time_s", "high", "dead time at its high end"),
    _ParameterEnd(RATIO, "high", "gain per time constant at its high end"),
    _ParameterEnd(PERIOD, "low", "ultimate period at its low end"),
    _ParameterEnd(PERIOD, "high", "ultimate period at its high end"),
)


def ends_of(
    best: Candidate, values: Mapping[str, float], ci95: Mapping[str, Interval | None], held: FitWithHeld, *,
    least_dead_time_s: float,
) -> Iterator[Candidate]:
    """Return the heater at each closed end of its intervals; a dead time without a low end is taken at the least.

    Where no heater has that value (it would cool while heated), the nearest to it that is one stands for it.

    Args:
        best: the candidate that these are the ends of.
        values: its own dead time, gain per time constant and ultimate period.
        ci95: their intervals.
        held: name and value → the heater with this number held.
        least_dead_time_s: no dead time below this is believed.
    """
    for end in _ENDS:
        value = _value(ci95.get(end.name), end, least_dead_time_s)
        if value is not None and (at := _nearest(held, end.name, values[end.name], value)) is not None:
            yield Candidate(
                model=at.model, log=best.log, window_s=best.window_s, law=best.law, fit_pct=at.fit_pct,
                rmse_degC=at.rmse_degC, delta_bic=best.delta_bic + at.bic, part=end.what)


def _nearest(held: FitWithHeld, name: str, best: float, end: float) -> AtEnd | None:
    """Return the heater at an end, or as near to it as there is one on the way from the best value."""
    at, nearest, beyond = held(name, end), best, end
    for _ in range(0 if at is not None else _HALVINGS):
        middle = 0.5 * (nearest + beyond)
        there = held(name, middle)
        at, nearest, beyond = (at, nearest, middle) if there is None else (there, middle, beyond)
    return at


def held_by(problem: PowerProblem, fit: PowerFit) -> tuple[Mapping[str, float], FitWithHeld]:
    """Return the numbers of a fit to one log that have ends, and what holds one of them at another value."""
    thin = problem.average(READINGS)
    best = thin.refine(fit.vector[None, :])
    record, least = thin.readings.temperature_degC, bic_of(thin, best)

    def held(name: str, value: float) -> AtEnd | None:
        at = held_at(thin, best, name, value)
        if at.model is None:
            return None
        left = record - at.simulated_degC
        return AtEnd(at.model, fit_pct(record, at.simulated_degC), math.sqrt(float(left @ left) / len(left)),
                     max(bic_of(thin, at) - least, 0.0))

    return {name: value_of(best, name) for name in ("dead_time_s", RATIO, PERIOD)}, held


def _value(ci95: Interval | None, end: _ParameterEnd, least_dead_time_s: float) -> float | None:
    if ci95 is None:
        return None
    value = ci95.low if end.side == "low" else ci95.high
    if end.name != "dead_time_s":
        return value if value else None
    if end.side == "low":
        return max(value or 0.0, least_dead_time_s)
    return None if value is None else max(value, least_dead_time_s)


def halves_of(log: Log, halves: tuple[Half, Half], *, law: str) -> Iterator[Candidate]:
    """Return the heater of each half of a log, where the two disagree in what both of them know.

    A half whose time constant lies on the bound of its search stands for no heater: the readings show no curvature,
    and the test sequence of such a heater would last for days. The log's intervals hold what that half knows.
    """
    apart = [name for name in disagreeing_parameters(halves)
             if all(identified_parts(half.ci95[name]) for half in halves)]
    if not apart:
        return
    for half, which in zip(halves, ("first", "second"), strict=True):
        start, end = half.window_s
        if half.values["time_constant_s"] >= _ON_BOUND * FAR * (end - start):
            continue
        yield Candidate(
            model=Fopdt(**half.values, ambient_degC=half.ambient_degC), log=log.name, window_s=half.window_s, law=law,
            fit_pct=half.fit_pct, rmse_degC=half.rmse_degC, delta_bic=0.0, part=f"{which} half alone",
        )


def told_apart(candidates: Sequence[Candidate], least_dead_time_s: float) -> tuple[Candidate, ...]:
    """Return the candidates without the ends that differ from another one by less than 3 % in every number."""
    kept = [candidate for candidate in candidates if not candidate.part]
    for candidate in candidates:
        if candidate.part and not any(_alike(candidate.model, other.model, least_dead_time_s) for other in kept):
            kept.append(candidate)
    return tuple(kept)


def _alike(first: HeaterModel, second: HeaterModel, least_dead_time_s: float) -> bool:
    if len(first.lags_s) != len(second.lags_s):
        return False
    pairs = zip(_numbers(first, least_dead_time_s), _numbers(second, least_dead_time_s), strict=True)
    return all(abs(a - b) <= _SAME * max(abs(a), abs(b)) for a, b in pairs)


def _numbers(model: HeaterModel, least_dead_time_s: float) -> tuple[float, ...]:
    dead = max(model.dead_time_s, least_dead_time_s)
    gain, total = model.gain_degC_per_pct, sum(model.lags_s)
    return gain, gain / total, total, dead + sum(model.lags_s[1:]), ultimate_period_s(model)

"""The heaters at the ends of what a log leaves open: one number at its end, the others fitted anew there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.log.values import Log
from heatertune.model.intervals import PERIOD, RATIO, identified_parts
from heatertune.model.judgement import Half, disagreeing
from heatertune.model.loads import bic_of
from heatertune.model.measures import ultimate_period_s
from heatertune.model.open_loop import PowerFit, PowerProblem
from heatertune.model.statistics import fit_pct
from heatertune.model.uncertainty import READINGS, held_at
from heatertune.model.values import Candidate, Fopdt, HeaterModel, Interval

__all__ = ["Held", "ends_of", "halves_of", "joint_ends", "told_apart"]

#: name and value of a number → the heater with it held, its fit [%] and its error [°C]
Held = Callable[[str, float], tuple[HeaterModel | None, float, float]]

_SAME: Final = 0.03  # of each number: such a heater adds nothing to a family


class _End(NamedTuple):
    name: str
    side: str
    what: str


_ENDS: Final = (
    _End("dead_time_s", "low", "dead time at its low end"),
    _End("dead_time_s", "high", "dead time at its high end"),
    _End(RATIO, "high", "gain per time constant at its high end"),
    _End(PERIOD, "low", "ultimate period at its low end"),
    _End(PERIOD, "high", "ultimate period at its high end"),
)


def ends_of(
    log: Log, problem: PowerProblem, fit: PowerFit, ci95: Mapping[str, Interval | None], *, law: str,
    delta_bic: float, least_dead_time_s: float,
) -> Iterator[Candidate]:
    """Return the model at each closed end of its intervals; a dead time without a low end is taken at the least.

    Args:
        log: for its name and times.
        problem: of one lag or two.
        fit: its best fit.
        ci95: the intervals of this order, gain per time constant and ultimate period among them.
        law: of the candidate that these are the ends of.
        delta_bic: of that candidate; an end's own comes on top.
        least_dead_time_s: no dead time below this is believed.
    """
    thin = problem.thinned(READINGS)
    best = thin.refined(fit.vector[None, :])
    record, least = thin.readings.temperature_degC, bic_of(thin, best)
    for end in _ENDS:
        value = _value(ci95.get(end.name), end, least_dead_time_s)
        found = None if value is None else held_at(thin, best, end.name, value)
        if found is None or found.model is None:
            continue
        left = record - found.simulated_degC
        yield Candidate(
            model=found.model, log=log.name, window_s=(float(log.time_s[0]), float(log.time_s[-1])), law=law,
            fit_pct=fit_pct(record, found.simulated_degC), rmse_degC=math.sqrt(float(left @ left) / len(left)),
            delta_bic=delta_bic + max(bic_of(thin, found) - least, 0.0), part=end.what,
        )


def joint_ends(
    names: str, window_s: tuple[float, float], ci95: Mapping[str, Interval | None], held: Held, *, law: str,
    least_dead_time_s: float,
) -> Iterator[Candidate]:
    """Return the heater of several logs at each closed end of dead time and gain per time constant.

    Args:
        names: of the logs.
        window_s: first and last instant [s].
        ci95: intervals of what the logs share.
        held: name and value → the heater with this number held, its fit [%] and error [°C] on all logs.
        law: of the candidate that these are the ends of.
        least_dead_time_s: no dead time below this is believed.
    """
    for end in _ENDS:
        value = _value(ci95.get(end.name), end, least_dead_time_s)
        if value is None:
            continue
        model, fit, rmse = held(end.name, value)
        if model is not None:
            yield Candidate(model=model, log=names, window_s=window_s, law=law, fit_pct=fit, rmse_degC=rmse,
                            delta_bic=0.0, part=end.what)


def _value(found: Interval | None, end: _End, least_dead_time_s: float) -> float | None:
    if found is None:
        return None
    value = found.low if end.side == "low" else found.high
    if end.name != "dead_time_s":
        return value if value else None
    if end.side == "low":
        return max(value or 0.0, least_dead_time_s)
    return None if value is None else max(value, least_dead_time_s)


def halves_of(log: Log, halves: tuple[Half, Half], *, law: str) -> Iterator[Candidate]:
    """Return the heater of each half of a log, where the two disagree in what both of them know."""
    apart = [name for name in disagreeing(halves) if all(identified_parts(half.ci95[name]) for half in halves)]
    if not apart:
        return
    for half, which in zip(halves, ("first", "second"), strict=True):
        yield Candidate(
            model=Fopdt(**half.values, ambient_degC=half.ambient_degC), log=log.name, window_s=half.window_s, law=law,
            fit_pct=half.fit_pct, rmse_degC=half.rmse_degC, delta_bic=0.0, part=f"{which} half alone",
        )


def told_apart(candidates: Sequence[Candidate], least_dead_time_s: float) -> tuple[Candidate, ...]:
    """Return the candidates without the ends that differ from another one by less than 3 % in every number."""
    kept = [each for each in candidates if not each.part]
    for each in candidates:
        if each.part and not any(_alike(each.model, other.model, least_dead_time_s) for other in kept):
            kept.append(each)
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

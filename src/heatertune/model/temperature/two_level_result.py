"""The heater behind two-level control: dead time, intervals, plausible heaters and notes, from its switchings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.model.diagnostics import Remark, findings_of, poor_remarks
from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, HeaterModel, Residuals
from heatertune.model.reduction import COMBINATIONS, FIELDS, PROPORTIONAL_TO_GAIN
from heatertune.model.statistics import Interval, autocorrelation, fit_pct, identified_interval
from heatertune.model.temperature.evidence import Thresholds, end_of_rest, reading_margin_degC, threshold_between
from heatertune.model.temperature.two_level import LONGEST, SwitchingSolution, TwoLevelFit, change_s

__all__ = ["two_level_model"]


_MOST_OF: Final = 0.9  # of the switchings, that come after the dead time
_TRIGGERS: Final = 3.5  # standard deviations by which noise may switch early, of many readings
_DELAYS: Final = 41  # dead times at which the thresholds are sought
_POOR: Final = 60.0
_FALLS_WITH_GAIN: Final = ("ambient_degC", "ultimate_gain_pct_per_degC")
_LAW: Final = "two-level control"
_MANUAL: Final = "constant power, switched manually"
_LOGGED: Final = "power logged, switched between its rows"
#: what a log without power shows where no controller made it: by whether it cools
_SHOWS: Final = {
    True: "The log shows gain times power, not each of them.",
    False: "It only heats: a controller that reduced its power would make the heater look quicker than it is."}


class _DeadTimes(NamedTuple):
    low: float
    high: float


def _dead_times(solution: SwitchingSolution, fit: TwoLevelFit) -> _DeadTimes:
    """Return the shortest and the longest dead time that the thresholds, or their order, allow [s]."""
    instants, problem = solution.instants, solution.problem
    offs = instants[0 if problem.is_on else 1 :: 2]
    if fit.switched_rows is not None:
        return _by_rows(solution, fit)
    if fit.is_manual:
        return _by_rest(solution, fit)
    stretches = np.diff(instants)
    longest = float(np.median(stretches)) if len(stretches) else float(instants[0] - problem.time_s[0])
    row = float(np.median(np.diff(fit.log.time_s)))
    most = _longest_dead_time(solution, longest)
    if fit.thermostat is None:
        return _DeadTimes(0.0, most + row)
    return _by_thresholds(solution, fit, offs, most + row)


def _thresholds(fit: TwoLevelFit) -> Thresholds | None:
    """Return the thresholds that the curve and the dead times up to the longest allow, None with few switchings.

    The first switching on is from cold; the instants of the others are those at which the temperature turns.
    """
    if fit.is_manual:
        return None
    best = fit.best[0]
    begin, row = float(best.problem.time_s[0]), float(np.median(np.diff(fit.log.time_s)))
    first = 0 if best.problem.is_on else 1
    offs, ons = best.instants[first::2], best.instants[first + 1 :: 2]
    margin, thresholds = reading_margin_degC(fit.log) + fit.rmse_degC, None
    for late in np.linspace(0.0, _longest_dead_time(best, float(np.ptp(best.instants))), _DELAYS):
        instants = [turns[turns - late - row > begin] - late for turns in (ons, offs)]
        if not all(map(len, instants)):
            break
        inside = Thresholds.between(*(threshold_between(
            best.temperature_degC(turns - row), best.temperature_degC(turns), margin) for turns in instants))
        thresholds = inside if thresholds is None else thresholds.or_of(inside)
    return thresholds


def _by_rest(solution: SwitchingSolution, fit: TwoLevelFit) -> _DeadTimes:
    """Return the dead times up to the rest at first, or of a log that may begin later up to the time constant [s]."""
    is_off = end_of_rest(fit.log) is not None and len(solution.instants) > 0 and not solution.problem.is_on
    rest_s = float(solution.instants[0] - solution.problem.time_s[0]) if is_off else 0.0
    return _DeadTimes(0.0, rest_s + fit.instant_margin_s if rest_s > 0.0 else math.exp(solution.lag))


def _by_rows(solution: SwitchingSolution, fit: TwoLevelFit) -> _DeadTimes:
    """Return the dead times by which the effective instants come after switchings between two rows [s]."""
    rows, time, power = fit.switched_rows, fit.log.time_s, fit.log.power_pct
    assert rows is not None
    assert power is not None
    # one more at the beginning, if it began to rise after the log had begun; the fit may also have one more at the end
    first = int(solution.problem.is_on != bool(power[0] == power.max()))
    instants = solution.instants[first:first + len(rows)]
    low = float(np.quantile(instants - time[rows], _MOST_OF)) - fit.instant_margin_s
    high = float(np.quantile(instants - time[rows - 1], 1.0 - _MOST_OF)) + fit.instant_margin_s
    if low > high:
        low, high = high, low
    return _DeadTimes(max(low, 0.0), max(high, 0.0))


def _longest_dead_time(solution: SwitchingSolution, longest_s: float) -> float:
    """Return the dead time at which it would switch off at the temperature at which it switches on [s]."""
    instants, first = solution.instants, 0 if solution.problem.is_on else 1
    offs, ons = instants[first::2], instants[1 - first :: 2]
    ons = ons[1:] if first == 1 and len(ons) > 1 else ons  # the first one is from cold
    if not len(ons) or not len(offs):
        return longest_s
    begin = float(solution.problem.time_s[0])
    for late in np.linspace(0.0, longest_s, 81):
        off, on = offs[offs - late > begin] - late, ons[ons - late > begin] - late
        if len(off) and len(on) and (
                np.mean(solution.temperature_degC(off)) < np.mean(solution.temperature_degC(on))):
            return float(late)
    return longest_s


def _by_thresholds(solution: SwitchingSolution, fit: TwoLevelFit, offs: Array, most_s: float) -> _DeadTimes:
    """Return the dead times by which each effective instant comes after the crossing of its threshold [s]."""
    thermostat = fit.thermostat
    assert thermostat is not None
    instants, time = solution.instants, fit.log.time_s
    row = float(np.median(np.diff(time)))
    step = float(np.min(np.diff(np.unique(fit.log.temperature_degC))))
    early, late = 0.5 * step + _TRIGGERS * fit.noise_degC, 0.5 * step + fit.noise_degC
    lows, highs = [], []
    for i, instant in enumerate(instants):
        is_off = bool(np.any(offs == instant))
        if instant <= time[0]:
            continue
        before = float(instants[i - 1]) if i else float(time[0])
        least = (thermostat.least_on_s if is_off else thermostat.least_off_s)
        grid = np.linspace(max(before, float(time[0])), float(instant), 241)
        y = solution.temperature_degC(grid)
        beyond = (y - thermostat.high_degC) if is_off else (thermostat.low_degC - y)
        if not np.any(beyond >= -early):
            continue
        # the last time at which it was surely not yet beyond, and the first at which it surely is
        if i > 0 or is_off:  # from cold it may have been switched on before the log began
            highs.append(float(instant - grid[int(np.argmax(beyond >= -early))]))
        is_delayed = i > 0 and instant - before <= least + 2.0 * row and least > 0.0
        if np.any(beyond >= late) and not is_delayed and (i > 0 or is_off):
            lows.append(float(instant - grid[int(np.argmax(beyond >= late))]) - row)
    high = min([most_s, *highs]) + (0.0 if not highs else row * 0.25)
    low, high = max([0.0, *lows]), max(high, 0.0)
    if low > high:  # some switchings came later than the thresholds: a minimum time that was not stated
        low = max(0.0, min(lows))
    return _DeadTimes(min(low, high), high)


def two_level_model(fit: TwoLevelFit, ambient_degC: tuple[float, float] | None, hypotheses: Sequence[Candidate] = ()
                    ) -> FittedModel:
    """Return the fitted heater with its intervals, and heaters at their ends.

    Args:
        fit: of the log.
        ambient_degC: stated bounds of the ambient [°C], or None.
        hypotheses: hypotheses of continuous controllers that were compared.

    Raises:
        InputError: the log contradicts the stated thresholds.
    """
    log, best = fit.log, fit.best[0]
    family = list(_family(fit))
    members = [plant for plant, *_ in family]
    values = {name: [measure(plant) for plant in members] for name, measure in (FIELDS | COMBINATIONS).items()}
    # without dead time two lags never lag by half a turn: the limit is a period of zero
    values["ultimate_period_s"] = [each if math.isfinite(each) else 0.0 for each in values["ultimate_period_s"]]
    values["ultimate_gain_pct_per_degC"] = [_ultimate_gain(plant) for plant in members]
    ranges = {name: _hull(numbers) for name, numbers in values.items()}
    ambient = ranges["ambient_degC"]
    ranges["ambient_degC"] = Interval(
        low=None if ambient.low is None else ambient.low - fit.ambient_margin_degC,
        high=None if ambient.high is None else ambient.high + fit.ambient_margin_degC)
    is_open = any(math.exp(each.lag) > 0.5 * LONGEST * float(np.ptp(each.problem.time_s)) for each in fit.profile)
    if is_open:
        for name in ("gain_degC_per_pct", "time_constant_s"):
            ranges[name] = replace(ranges[name], high=None)
        ranges["ambient_degC"] = replace(ranges["ambient_degC"], low=None)
    is_assumed = _is_assumed(fit, ambient_degC)
    if is_assumed:  # full power in place of a part of it makes the gain too small
        ranges |= {name: Interval(low=ranges[name].low, high=None) for name in PROPORTIONAL_TO_GAIN}
        ranges |= {name: Interval(low=None, high=ranges[name].high) for name in _FALLS_WITH_GAIN}
    ci95: dict[str, Interval | None] = {name: identified_interval(ranges[name]) for name in FIELDS}
    if ambient_degC is not None and ambient_degC[0] == ambient_degC[1]:
        ci95["ambient_degC"] = None
    dead, thresholds = _dead_times(best, fit), _thresholds(fit)
    if fit.thermostat is not None and fit.switched_rows is None and thresholds is not None:
        thresholds.check_stated(log.name, fit.thermostat)
    plant = best.plant(best.gains[0], 0.5 * (dead.low + dead.high))
    simulated = best.temperature_degC(log.time_s)
    share = fit_pct(log.temperature_degC, simulated)
    outcome = _outcome(share, ci95) if fit.explains else FitOutcome.POOR_FIT
    rmse = float(np.sqrt(np.mean((log.temperature_degC - simulated) ** 2)))
    window = float(log.time_s[0]), float(log.time_s[-1])
    candidates = [Candidate(
        model=model, log=log.name, window_s=window,
        law=_MANUAL if fit.is_manual else _LAW if fit.switched_rows is None else _LOGGED,
        controller=_controller(thresholds, fit), fit_pct=share, rmse_degC=rmse, delta_bic=solution.bic - best.bic,
        part=part) for model, solution, part in _ends(family, plant, best)]
    notes = list(_notes(fit, dead, thresholds))
    measures = {"ultimate_gain_pct_per_degC": _ultimate_gain, **COMBINATIONS}
    return FittedModel(
        model=plant.half_rule(), outcome=outcome,
        findings=findings_of([
            *_remarks(fit, notes[0], thresholds, is_assumed), *poor_remarks(outcome, share, log.name)]),
        method="switching instants fitted together with the heater; profile likelihood",
        ci95=ci95, candidates=tuple(candidates), hypotheses=(candidates[0], *hypotheses),
        combinations={name: (measure(plant), ranges[name]) for name, measure in measures.items()
                      if math.isfinite(measure(plant))},
        fit_pct=share, notes=tuple(notes),
        residuals=Residuals(time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=simulated,
                            autocorrelation=autocorrelation(log.temperature_degC - simulated)))


def _remarks(fit: TwoLevelFit, note: str, thresholds: Thresholds | None, is_assumed: bool) -> Iterator[Remark]:
    """Yield the findings: that no power was logged, and whether that full power was switched is stated or assumed."""
    if fit.switched_rows is not None:
        return
    yield Remark("no-power", note)
    if fit.is_manual:
        yield Remark("not-regulated", f"{note} No controller holds its temperature. {_FEW_FACTS}")
        return
    if fit.thermostat is not None:
        yield Remark("thermostat", f"{note} Full power and none are those of the stated thermostat, "
                                   f"{fit.thermostat.low_degC:g} and {fit.thermostat.high_degC:g} °C.")
        return
    where = "" if thresholds is None else f" It switches {thresholds.summary}."
    if is_assumed:
        where += (" The log begins warm and does not show that the lower level is no power; if the output of a "
                  "controller moves in steps, it is not, and the gain is larger.")
    yield Remark("two-level", f"{note}{where} That it is full power is assumed; --thermostat LOW HIGH states it.")


#: what is missing of a log without power that no controller made
_FEW_FACTS: Final = (
    "A column with the power gives gain and dead time, or a file with each change of it (columns time_s,power_pct) as "
    "--power-log; or --largest-power, and --thermostat with the temperatures of the room and of the switching off.")


def _is_assumed(fit: TwoLevelFit, ambient_degC: tuple[float, float] | None) -> bool:
    """Return whether neither the log nor a statement shows that it switches full power and none."""
    if fit.is_manual:
        return not fit.is_power_stated
    return (fit.thermostat is None and fit.switched_rows is None and ambient_degC is None) and not fit.shows_ambient


def _outcome(share: float, ci95: Mapping[str, Interval | None]) -> FitOutcome:
    if share < _POOR:
        return FitOutcome.POOR_FIT
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    return FitOutcome.IDENTIFIED if all(ci95[name] is not None for name in names) else FitOutcome.COMBINATIONS_ONLY


def _family(fit: TwoLevelFit) -> Iterator[tuple[HeaterModel, SwitchingSolution]]:
    """Yield every heater that the log cannot tell from the best, at both ends of its dead time and gain."""
    for solution in (*fit.best, *fit.profile):
        dead = _dead_times(solution, fit)
        for gain in solution.gains:
            for factor in (1.0 - fit.gain_margin, 1.0, 1.0 + fit.gain_margin):
                for late in dict.fromkeys(dead):
                    yield solution.plant(max(gain * factor, 1e-6), late), solution


def _ends(family: Sequence[tuple[HeaterModel, SwitchingSolution]], plant: HeaterModel, best: SwitchingSolution
          ) -> Iterator[tuple[HeaterModel, SwitchingSolution, str]]:
    """Yield the best heater, and those at the ends of what a loop feels: ultimate gain and period, gain, lag."""
    yield plant, best, ""
    chosen = list[int]()
    for name, measure in {
            "ultimate gain": _ultimate_gain, "ultimate period": COMBINATIONS["ultimate_period_s"],
            "gain": FIELDS["gain_degC_per_pct"], "time constant": FIELDS["time_constant_s"]}.items():
        numbers = [measure(model) for model, _ in family]
        for end, place in (("low", int(np.argmin(numbers))), ("high", int(np.argmax(numbers)))):
            if place not in chosen:
                chosen.append(place)
                yield *family[place], f"{name} at its {end} end"


def _controller(thresholds: Thresholds | None, fit: TwoLevelFit) -> dict[str, float]:
    """Return the thresholds: as stated, or the ends of what the log shows of them."""
    if fit.thermostat is not None:
        return {"low_degC": fit.thermostat.low_degC, "high_degC": fit.thermostat.high_degC}
    if thresholds is None:
        return {}
    ends = {f"{name}_{side}_degC": value for name, inside in (("low", thresholds.low), ("high", thresholds.high))
            for side, value in (("least", inside.low), ("most", inside.high))}
    return {name: value for name, value in ends.items() if value is not None}


def _notes(fit: TwoLevelFit, dead: _DeadTimes, thresholds: Thresholds | None) -> Iterator[str]:
    best, log = fit.best[0], fit.log
    count = len(best.instants)
    if fit.switched_rows is not None:
        row = float(np.median(np.diff(log.time_s)))
        yield (f"{log.name}: the power switches between two rows ({row:.3g} s), and the temperature shows when: the "
               f"instants of {count} switchings were fitted together with the heater.")
        yield from _mains_notes(best)
        return
    if fit.is_manual:
        when = ", ".join(f"{instant:.4g} s" for instant in best.instants) or "never"
        is_on = "on" if best.problem.is_on else "off"
        yield (f"The power was not logged; {log.name} was fitted as constant power that is {is_on} at first and was "
               f"switched at {when}, dead time included. {_SHOWS[fit.shows_cooling]}")
        yield (f"It does not show the dead time, which may be {dead.low:.3g} to {dead.high:.3g} s. {_FEW_FACTS}")
        return
    yield (f"The power was not logged; {log.name} is two-level control: {count} switchings between full power and none "
           "were fitted together with the heater.")
    if fit.thermostat is None:
        state = "not in the log" if thresholds is None else f"known by the curve alone, {thresholds.summary}"
        yield (f"Its thresholds are {state}; the dead time may be {dead.low:.3g} to {dead.high:.3g} s. If you know at "
               "which temperatures the thermostat switches, state them: --thermostat LOW HIGH, with its minimum on and "
               "off times if it has any.")
    else:
        yield (f"Its thresholds of {fit.thermostat.low_degC:g} and {fit.thermostat.high_degC:g} °C, as stated, leave a "
               f"dead time between {dead.low:.3g} and {dead.high:.3g} s.")
    yield from _mains_notes(best)
    yield "If the heater had another power than full power and none, its gain is wrong by the same factor."


def _mains_notes(best: SwitchingSolution) -> Iterator[str]:
    if len(best.gains) > 1:
        yield (f"Full power changes by {100.0 * (best.gains[1] / best.gains[0] - 1.0):+.0f} % at "
               f"{float(change_s(best.problem, best.instants)[0]):.0f} s (mains voltage, or an element that failed); "
               "the interval of the gain holds both values.")


def _hull(values: Sequence[float]) -> Interval:
    low, high = min(values), max(values)
    return Interval(low=low, high=high if math.isfinite(high) else None)


def _ultimate_gain(plant: HeaterModel) -> float:
    """Return the gain of a P controller at the limit of stability [%/°C]; infinite without dead time."""
    period = COMBINATIONS["ultimate_period_s"](plant)
    if not math.isfinite(period):
        return math.inf
    omega = 2.0 * math.pi / period
    return math.prod(math.hypot(1.0, omega * lag) for lag in plant.lags_s) / plant.gain_degC_per_pct

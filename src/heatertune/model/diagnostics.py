"""Convert the check results of a fit to the findings that a verdict uses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC, Log, ReadSummary
from heatertune.model.findings import Finding
from heatertune.model.model_values import FitOutcome, FittedModel
from heatertune.model.statistics import Interval
from heatertune.units import degF_to_degC, kelvin_to_degC

__all__ = ["DROP_PCT", "Remark", "fast_remarks", "findings_of", "level_remarks", "neighbour_findings",
           "poor_remarks", "unit_change_findings", "unit_findings"]

#: allowed loss of fit in cross-validation [%]
DROP_PCT = 10.0
_BESIDE = 1.01  # times the least time constant
_TWO = 2  # levels of power
_FULL = 99.0  # %
_NEAR = 0.2  # share of a log's span
_ROOM_DEGC = (10.0, 35.0)
_DAY_S = 86400.0
#: around a heater that is off [°C], time constant and dead time [s]: what heaters have, and what is possible
_HARDLY_EXCEEDED = ((-40.0, 50.0), (0.5, 3.0 * _DAY_S), 3600.0)  # a wire in a stream of air is as fast
_NEVER_EXCEEDED = ((-100.0, 150.0), (0.01, 60.0 * _DAY_S), _DAY_S)
_MOST_RISE_DEGC = 3000.0  # at full power: of graphite and tungsten, which no controller's heater is
_JUMP = 8.0  # times the usual change from row to row
_USUAL = 0.99  # share of the changes that are no larger
_LEAST_DEGC = 0.05
_ROWS_EACH_SIDE = 5  # of a jump, without another one
_HOLDS = {"time": "the time", "temperature": "the temperature", "power": "the power"}


class Remark(NamedTuple):
    """A sentence about a fit, and the name of its finding; empty if it does not affect the verdict."""

    finding: str
    sentence: str


def findings_of(remarks: Iterable[Remark]) -> tuple[Finding, ...]:
    """Return the findings among some sentences."""
    return tuple(Finding(name=remark.finding, message=remark.sentence) for remark in remarks if remark.finding)


def poor_remarks(outcome: FitOutcome, fit_pct: float, name: str) -> tuple[Remark, ...]:
    """Return the findings of a poor fit of the named log or logs; empty for other outcomes."""
    if outcome is not FitOutcome.POOR_FIT:
        return ()
    return (Remark("poor-fit", f"{fit_pct:.0f} % of {name} are explained."),)


def level_remarks(log: Log) -> tuple[Remark, ...]:
    """Return the findings of a log with only one level of power besides 0; on/off at full power counts as linear."""
    levels = np.unique(np.round(log.signals["power"].values))
    if len(levels) > _TWO or levels[0] > 0.0 or levels[-1] >= _FULL:
        return ()
    return (Remark("one-level", (
        f"{log.name} has no powers other than 0 and {levels[-1]:g} %, so it does not show whether the gain is the same "
        "at others."
    )),)


def fast_remarks(least_s: float, time_constant_s: float, name: str) -> tuple[Remark, ...]:
    """Return the findings of a time constant at the lower bound of its search."""
    if time_constant_s > _BESIDE * least_s:
        return ()
    return (Remark("faster-than-log", (
        f"The time constant ended at {time_constant_s:.3g} s, half the interval of {name} and the smallest value "
        "searched: the heater responds faster than the log shows."
    )),)


def unit_findings(fitted: FittedModel, logs: Sequence[Log]) -> tuple[Finding, ...]:
    """Return a finding for each log with an assumed unit without evidence, or with a unit that the fit contradicts.

    A unit stated by the user is questioned only where no heater can be as the fit says.
    """
    findings = []
    for log, summary in ((log, log.taken) for log in logs if log.taken is not None):
        doubts = {role: doubt for role, doubt in _implausible(fitted, log, *_HARDLY_EXCEEDED).items()
                  if role in summary.columns and role not in summary.stated}
        wrong = {role: doubt for role, doubt in _implausible(fitted, log, *_NEVER_EXCEEDED).items()
                 if role in summary.stated}
        if wrong:
            stated = ", ".join(map(summary.unit_option, wrong))
            findings.append(Finding(name="unit-contradicted", message=(
                f"{'; '.join(wrong.values())}: no heater can be so, check what is stated for {log.name} ({stated})")))
        if summary.assumed or doubts:
            findings.append(Finding(name="unit-assumed", message=_unit_sentence(summary, doubts)))
        if summary.begins_as_room and "temperature" not in doubts:
            findings.append(_begins_as_room(summary, float(log.temperature_degC[0])))
    return tuple(findings)


def unit_change_findings(logs: Sequence[Log]) -> tuple[Finding, ...]:
    """Return a finding for each log whose temperature goes on in another unit from some row on.

    It jumps there by many times its usual change, to what the last reading is in the other unit, and stays.
    """
    return tuple(finding for log in logs if (finding := _unit_change(log)) is not None)


def _unit_change(log: Log) -> Finding | None:
    time, readings = log.time_s, log.temperature_degC
    steps, changes = np.diff(time), np.diff(readings)
    if len(changes) < _ROWS_EACH_SIDE:
        return None
    usual = max(float(np.quantile(np.abs(changes), _USUAL)), _LEAST_DEGC)
    jumps = np.flatnonzero((np.abs(changes) > _JUMP * usual) & (steps <= 2.0 * np.median(steps)))
    for row in (int(jump) for jump in jumps if _ROWS_EACH_SIDE <= jump < len(changes) - _ROWS_EACH_SIDE):
        before, after = float(readings[row]), float(readings[row + 1])
        until, begin = f"--until {time[row]:g}", f"--from {time[row + 1]:g}"
        for change, same, parts in (
                ("°F to °C", degF_to_degC(before), f"{until} or {begin}"), ("K to °C", kelvin_to_degC(before), begin),
                ("°C to °F", 1.8 * before + 32.0, f"{until} or {begin}"),
                ("°C to K", before - ABSOLUTE_ZERO_DEGC, until)):
            if abs(after - same) <= 2.0 * usual and np.count_nonzero(np.abs(jumps - row) <= _ROWS_EACH_SIDE) == 1:
                return Finding(name="unit-assumed", message=(
                    f"the temperature of {log.name} jumps from {before:.4g} to {after:.4g} after {time[row]:g} s, as "
                    f"from {change}: check, and use one part with its unit (--temperature-unit): {parts}"))
    return None


def _begins_as_room(taken: ReadSummary, first_degC: float) -> Finding:
    return Finding(name="begins-as-room", message=(
        f"nothing in {taken.file} shows the unit of {_HOLDS['temperature']} ({taken.columns['temperature'][0]}); it is "
        f"taken as °C because it begins at {first_degC:.3g}, a room temperature only in °C; state it for a heater in "
        f"the cold: {taken.unit_option('temperature')}"))


def neighbour_findings(logs: Sequence[Log]) -> tuple[Finding, ...]:
    """Return a finding for each log in which the power of another heater changes."""
    moving = ((log.taken.file, log.taken.moving_heaters) for log in logs if log.taken is not None)
    return tuple(Finding(name="neighbours-moved", message=(
        f"other heaters were moving in {file}: {', '.join(map(repr, names))}")) for file, names in moving if names)


def _unit_sentence(taken: ReadSummary, doubts: Mapping[str, str]) -> str:
    """Return which units are assumed or contradicted, with the options that state them all."""
    parts = []
    if taken.assumed:
        columns = [f"{_HOLDS[role]} ({', '.join(taken.columns[role])})" for role in taken.assumed]
        parts.append(f"nothing in {taken.file} shows the unit of {' and '.join(columns)}")
    parts += doubts.values()
    options = dict(taken.assumed)
    for role in doubts:
        options.setdefault(role, taken.unit_option(role))
    return f"{'; '.join(parts)}; check, and state: {' '.join(options.values())}"


def _implausible(
    fitted: FittedModel, log: Log, ambient_degC: tuple[float, float], time_constant_s: tuple[float, float],
    most_dead_time_s: float
) -> dict[str, str]:
    """Return role → result of the fit beyond some bounds, which makes the unit of that column doubtful.

    The ambient counts only if the log comes near it; from a log far above it, it is an extrapolation.
    """
    ends = {name: _ends(fitted.ci95.get(name), getattr(fitted.model, name)) for name in (
        "gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")}
    doubts = {}
    low, high = ends["ambient_degC"]
    readings = log.temperature_degC
    near = float(readings.min()) - (fitted.model.ambient_degC or 0.0) < _NEAR * float(np.ptp(readings))
    if near and (high < ambient_degC[0] or low > ambient_degC[1]):
        doubts["temperature"] = _ambient_doubt(float(fitted.model.ambient_degC or 0.0))
    low, high = ends["time_constant_s"]
    if high < time_constant_s[0] or low > time_constant_s[1]:
        doubts["time"] = f"a time constant of {fitted.model.time_constant_s:.3g} s is hardly a heater's"
    if ends["dead_time_s"][0] > most_dead_time_s:
        doubts["time"] = f"a dead time of {fitted.model.dead_time_s / 3600.0:.3g} h is hardly a heater's"
    if 100.0 * abs(ends["gain_degC_per_pct"][0]) > _MOST_RISE_DEGC:
        doubts["power"] = f"full power would heat by {100.0 * fitted.model.gain_degC_per_pct:,.0f} °C"
    return doubts


def _ambient_doubt(ambient_degC: float) -> str:
    """Return why an ambient is implausible, and the unit in which it would be a room temperature [°C]."""
    least, most = _ROOM_DEGC
    other = next((f": {value:.3g} °C if the readings are in {unit}" for unit, value in (
        ("°F", degF_to_degC(ambient_degC)), ("tenths of a degree", ambient_degC / 10.0)) if least <= value <= most), "")
    return f"an ambient of {ambient_degC:.3g} °C is no room's{other}"


def _ends(interval: Interval | None, value: float | None) -> tuple[float, float]:
    """Return the ends of an interval; NaN, for which no comparison is true, if an end or the value is unknown."""
    if interval is None or value is None:
        return math.nan, math.nan
    return (math.nan if interval.low is None else interval.low, math.nan if interval.high is None else interval.high)

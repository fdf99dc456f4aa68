"""What a power column hides of the heater's power: a PWM behind it, and a row by which it may be late.

A power column may hold the power of the row before, or the mean since then. The heater then answers earlier than
it seems, so that a fit's dead time is too short by up to one row; nothing in the log shows it.

A log that holds the controller's output while PWM switched the heater leaves dead times and gains open.

A value that is held until the next period begins acts later by up to a period P. With the pulse first in each period
the power's centre comes earlier by up to P·(1 − u)/2, u its share; and readings at one phase see the ripple
shifted by up to P/4 of the gain per time constant. Which of it a log has, its phase decides, and nobody logged that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from heatertune.model.findings import Finding
from heatertune.model.intervals import Interval
from heatertune.model.measures import ultimate_period_s
from heatertune.model.power.interval_ends import told_apart
from heatertune.model.values import Candidate, FittedModel

__all__ = ["with_late_power", "with_pwm_hidden"]

_EARLIER: Final = 0.5  # periods by which the heater's dead time may be longer than it looks
_LATE: Final = 0.05  # time constants by which a power may be late before gain and time constant are wrong as well
_RIPPLE: Final = 0.25  # periods per time constant by which the gain may differ


def with_pwm_hidden(fitted: FittedModel, period_s: float) -> FittedModel:
    """Return the fit with what a PWM of unknown phase leaves open: intervals, and plausible heaters at their ends.

    Args:
        fitted: as if the logged power had been the heater's.
        period_s: of the PWM [s].
    """
    if period_s == 0.0:
        return fitted
    dead, gain = fitted.ci95.get("dead_time_s"), fitted.ci95.get("gain_degC_per_pct")
    share = _RIPPLE * period_s / fitted.model.time_constant_s
    note = (f"The heater was switched by PWM of {period_s:.3g} s whose phase is not in the log: the dead time may be "
            f"shorter by {period_s:.3g} s than it looks, or longer by {_EARLIER * period_s:.3g} s; its interval and "
            "the plausible heaters hold that.")
    return replace(
        fitted, notes=(*fitted.notes, note), candidates=(*fitted.candidates, *_ends(fitted.candidates, period_s)),
        ci95={**fitted.ci95, "dead_time_s": _moved(dead, period_s, _EARLIER * period_s),
              "gain_degC_per_pct": _stretched(gain, share)},
    )


def with_late_power(
    fitted: FittedModel, row_s: float, *, gap_s: float, most_s: float | None, least_s: float
) -> FittedModel:
    """Return the fit with a dead time that may be longer, as the power may have changed before the row that shows it.

    It may by a row of the log, whose column may be a row late or the mean of the row before, and in a log that is
    written on change by the gap before that row.

    Args:
        fitted: as if the power column were exact.
        row_s: interval of the log's rows [s].
        gap_s: by which the power may have changed before its row; 0: its instants are those of the rows [s].
        most_s: no dead time is longer, None where no bound is known [s].
        least_s: no dead time below this is believed [s].
    """
    late_s = max(row_s, gap_s)
    note = (f"The power column may be one row ({row_s:.3g} s) late, or the mean of the row before: the dead time may "
            "be longer by that; its interval and the plausible heaters hold it.") if late_s == row_s else (
            f"The power may have changed up to {late_s:.3g} s before the row that shows it: the dead time may be "
            "longer by as much; its interval and the plausible heaters hold that.")
    part = "dead time longer by a row of the log" if late_s == row_s else "power changed before its row"
    dead = fitted.ci95.get("dead_time_s")
    later = [_later(each, _room(_dead_time_s(each), late_s, most_s), part)
             for each in _hardest(fitted.candidates, late_s)]
    is_distorted = gap_s > _LATE * fitted.model.time_constant_s  # beyond what a longer dead time stands for
    return replace(
        fitted, notes=(*fitted.notes, note), candidates=told_apart([*fitted.candidates, *later], least_s),
        findings=(*fitted.findings, *((Finding(name="alias", message=note),) if is_distorted else ())),
        ci95=fitted.ci95 if dead is None or dead.high is None else {
            **fitted.ci95, "dead_time_s": replace(dead, high=dead.high + _room(dead.high, late_s, most_s))},
    )


def _hardest(candidates: Sequence[Candidate], row_s: float) -> Iterator[Candidate]:
    """Yield, of one lag and of two, the longest dead time, and what a row more leaves with the least ultimate gain."""
    for lags in sorted({len(each.model.lags_s) for each in candidates}):
        known = [each for each in candidates if len(each.model.lags_s) == lags]
        longest = max(known, key=_dead_time_s)
        hardest = min(known, key=lambda each: _ultimate_gain(_later(each, row_s, "")))
        yield longest
        if hardest is not longest:
            yield hardest


def _ultimate_gain(candidate: Candidate) -> float:
    """Return the gain of a P controller at which the heater swings for ever [%/°C]; its dead time is above 0."""
    omega = 2.0 * math.pi / ultimate_period_s(candidate.model)
    lost = math.prod(math.hypot(1.0, omega * lag) for lag in candidate.model.lags_s)
    return lost / abs(candidate.model.gain_degC_per_pct)


def _room(dead_time_s: float, row_s: float, most_s: float | None) -> float:
    """Return by how much a dead time may be longer: a row, but not beyond what is known [s]."""
    return row_s if most_s is None else max(min(row_s, most_s - dead_time_s), 0.0)


def _ends(candidates: Sequence[Candidate], period_s: float) -> Iterator[Candidate]:
    """Return, of one lag and of two, the shortest dead time made shorter and the longest one made longer."""
    for lags in sorted({len(each.model.lags_s) for each in candidates}):
        known = sorted((each for each in candidates if len(each.model.lags_s) == lags), key=_dead_time_s)
        yield _later(known[0], -period_s, "dead time shorter by a PWM period")
        yield _later(known[-1], _EARLIER * period_s, "dead time longer by half a PWM period")


def _later(candidate: Candidate, by_s: float, part: str) -> Candidate:
    moved = replace(candidate.model, dead_time_s=max(_dead_time_s(candidate) + by_s, 0.0))
    return replace(candidate, model=moved, part=part)


def _dead_time_s(candidate: Candidate) -> float:
    return candidate.model.dead_time_s


def _moved(interval: Interval | None, down: float, up: float) -> Interval | None:
    if interval is None:
        return None
    return Interval(low=None if interval.low is None else max(interval.low - down, 0.0),
                    high=None if interval.high is None else interval.high + up)


def _stretched(interval: Interval | None, share: float) -> Interval | None:
    if interval is None:
        return None
    return Interval(low=None if interval.low is None else interval.low / (1.0 + share),
                    high=None if interval.high is None else interval.high * (1.0 + share))

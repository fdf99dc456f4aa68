"""A log that holds the controller's output while PWM switched the heater: the dead times and gains that hides.

A value that is held until the next period begins acts later by up to a period P. With the pulse first in each period
the power's centre comes earlier by up to P·(1 − u)/2, u its share; and readings at one phase see the ripple
shifted by up to P/4 of the gain per time constant. Which of it a log has, its phase decides, and nobody logged that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from heatertune.model.findings import Finding
from heatertune.model.intervals import Interval
from heatertune.model.values import Candidate, FittedModel

__all__ = ["with_late_power", "with_pwm_hidden"]

_EARLIER: Final = 0.5  # periods by which the heater's dead time may be longer than it looks
_LATE: Final = 0.05  # time constants by which a power may be late before the log leaves the dead time open
_RIPPLE: Final = 0.25  # periods per time constant by which the gain may differ


def with_pwm_hidden(fitted: FittedModel, period_s: float) -> FittedModel:
    """Return the fit with what a PWM of unknown phase leaves open: intervals, and possible heaters at their ends.

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
            "the possible heaters hold that.")
    return replace(
        fitted, notes=(*fitted.notes, note), candidates=(*fitted.candidates, *_ends(fitted.candidates, period_s)),
        ci95={**fitted.ci95, "dead_time_s": _moved(dead, period_s, _EARLIER * period_s),
              "gain_degC_per_pct": _stretched(gain, share)},
    )


def with_late_power(fitted: FittedModel, late_s: float, most_s: float | None) -> FittedModel:
    """Return the fit with what a power leaves open that may have changed before the row that shows it.

    Args:
        fitted: as if the power had changed in that row.
        late_s: by which it may have changed earlier; 0: it did not [s].
        most_s: no dead time is longer, as the user knows; None: nobody knows [s].
    """
    if late_s == 0.0:
        return fitted
    dead = fitted.ci95.get("dead_time_s")
    note = (f"The power may have changed up to {late_s:.3g} s before the row that shows it: the dead time may be "
            "longer by as much; its interval and the possible heaters hold that.")
    added = []
    for lags in sorted({len(each.model.lags_s) for each in fitted.candidates}):
        longest = max((each for each in fitted.candidates if len(each.model.lags_s) == lags), key=_dead_time_s)
        by_s = late_s if most_s is None else min(late_s, max(most_s - _dead_time_s(longest), 0.0))
        added.append(_later(longest, by_s, "power changed before its row"))
    high = None if dead is None or dead.high is None else dead.high + late_s
    high = high if high is None or most_s is None else max(min(high, most_s), dead.high if dead and dead.high else 0.0)
    opened = most_s is None and late_s > _LATE * fitted.model.time_constant_s
    findings = (Finding(name="dead-time-open", told=note),) if opened else ()
    return replace(
        fitted, notes=(*fitted.notes, note), candidates=(*fitted.candidates, *added),
        findings=(*fitted.findings, *findings),
        ci95={**fitted.ci95, "dead_time_s": None if dead is None else Interval(low=dead.low, high=high)})


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

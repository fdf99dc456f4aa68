"""Properties of a log besides its heater: sampling, sensor resolution, operating point, effects of its power column.

A power column may hold the power of the previous row or the mean since then. The heater then seems to respond earlier,
and the fitted dead time is too short by up to one row, which the log does not show.

If the controller output was logged while a PWM of period P switched the heater, dead time and gain are uncertain: a
value held until the next period acts up to P later; with the pulse at the start of each period, the centre of power is
up to P·(1 − u)/2 earlier at duty cycle u; readings at a fixed phase see the ripple, shifted by up to P/4 of gain/time
constant. Which applies depends on the phase, which is not logged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import Log
from heatertune.model.findings import Finding
from heatertune.model.model_values import Candidate, FittedModel
from heatertune.model.power.uncertainty import distinct_candidates
from heatertune.model.reduction import ultimate_period_s, zero_s
from heatertune.model.statistics import Interval, replace_outliers, sensor_step
from heatertune.model.two_scales import TwoScale
from heatertune.units import check

__all__ = [
    "DelaysKnown", "logged_range_degC", "pool_candidates", "reading_step_degC", "setpoint_of", "with_late_power",
    "with_neighbours", "with_power_a_row_late", "with_pwm_hidden", "without_neighbours",
]


_EARLIER: Final = 0.5  # periods by which the heater's dead time may be longer than it looks
_ROWS: Final = 2  # of the log by which a power may be late: one in which it changed, and one of a logger
_LATE: Final = 0.05  # time constants by which a power may be late before gain and time constant are wrong as well
_RIPPLE: Final = 0.25  # periods per time constant by which the gain may differ
_HEATERS: Final = 8  # equal ones on one mass: extruders and ovens rarely have more zones
_MOVING: Final = f"{_HEATERS} equal heaters on its mass move alike"


def with_pwm_hidden(fitted: FittedModel, period_s: float) -> FittedModel:
    """Return the fit with the uncertainty of a PWM of unknown phase: intervals, and plausible heaters at their ends.

    Args:
        fitted: under the assumption that the logged power was the heater's.
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
    """Return the fit with a longer dead time as an option, because the power may have changed before its row.

    Between two rows it may have changed at any instant, and the column may be one row late, or a mean: up to two rows
    earlier. In a log that is written on change it may have changed up to the gap before that row.

    Args:
        fitted: as if the power column were exact.
        row_s: interval of the log's rows [s].
        gap_s: how much earlier than its row the power may have changed; 0: it changes at the rows [s].
        most_s: longest possible dead time, None if unknown [s].
        least_s: shortest plausible dead time [s].
    """
    late_s = max(_ROWS * row_s, gap_s)
    note = (f"The power may have changed up to {_ROWS} rows ({late_s:.3g} s) before the row that shows it: between two "
            "rows, and the column may be a row late or a mean; the dead time may be longer by that; its interval "
            "and the plausible heaters hold it.") if late_s > gap_s else (
            f"The power may have changed up to {late_s:.3g} s before the row that shows it: the dead time may be "
            "longer by as much; its interval and the plausible heaters hold that.")
    part = f"dead time longer by {_ROWS} rows of the log" if late_s > gap_s else "power changed before its row"
    dead = fitted.ci95.get("dead_time_s")
    later = [_later(each, _room(_dead_time_s(each), late_s, most_s), part)
             for each in _hardest(fitted.candidates, late_s)]
    is_distorted = gap_s > _LATE * fitted.model.time_constant_s  # beyond what a longer dead time can represent
    return replace(
        fitted, notes=(*fitted.notes, note), candidates=distinct_candidates([*fitted.candidates, *later], least_s),
        findings=(*fitted.findings, *((Finding(name="alias", message=note),) if is_distorted else ())),
        ci95=fitted.ci95 if dead is None or dead.high is None else {
            **fitted.ci95, "dead_time_s": replace(dead, high=dead.high + _room(dead.high, late_s, most_s))},
    )


def with_power_a_row_late(fitted: FittedModel, row_s: float) -> FittedModel:
    """Return the fit of a log whose power column was taken as a row late; it may be late by less, as a mean is.

    Args:
        fitted: as if the power had changed a row before the one that shows it.
        row_s: interval of the log's rows [s].
    """
    note = ("The temperature answers before the row that shows the power's change, so the power column was taken as a "
            f"row late; the dead time may be shorter by {row_s:.3g} s; its interval and the plausible heaters hold it.")
    shortest = min(fitted.candidates, key=_dead_time_s)
    return replace(
        fitted, notes=(*fitted.notes, note),
        candidates=(*fitted.candidates, _later(shortest, -row_s, "dead time shorter by a row of the log")),
        ci95={**fitted.ci95, "dead_time_s": _moved(fitted.ci95.get("dead_time_s"), row_s, 0.0)})


def with_neighbours(fitted: FittedModel, *, alone: bool) -> FittedModel:
    """Return the fit with the heaters that a controller sees where other equal ones heat the same slow mass.

    The log of one heater of two time scales looks the same with and without others that rest. Controllers that pass
    one by one may swing together, so each is designed and proven on both: alone, and with all others moving like it.

    Args:
        fitted: a heater with its plausible ones.
        alone: the user knows that no other heater heats the mass.
    """
    moving = [
        replace(each, model=each.model.with_neighbours(_HEATERS), part=f"{each.part}; {_MOVING}".removeprefix("; "))
        for each in fitted.candidates if isinstance(each.model, TwoScale)]
    if not moving:
        note = ("--alone changes nothing: the log shows one time scale. Heaters that heat one block look like that "
                "too: if others do, design them together (heatertune design LOG --zones NAMES).")
        return replace(fitted, notes=(*fitted.notes, note)) if alone else fitted
    if alone:
        message = "no other heater heats its slow mass, as was stated (--alone)"
        return replace(fitted, findings=(*fitted.findings, Finding(name="alone", message=message)))
    message = (f"The log looks the same whether other heaters heat the slow mass or not. If {_HEATERS} equal ones move "
               f"alike, each has a gain of {moving[0].model.gain_degC_per_pct:.3g} °C/%, and controllers that pass "
               "alone may swing together; the plausible heaters hold that as well. It makes the controller slower; "
               "--alone states that no other heater heats the mass.")
    return replace(fitted, candidates=(*fitted.candidates, *moving), notes=(*fitted.notes, message),
                   findings=(*fitted.findings, Finding(name="shared-mass", message=message)))


def without_neighbours(fitted: FittedModel) -> FittedModel:
    """Return the fit without the heaters that `with_neighbours` added: what a log of the heater alone can show."""
    return replace(fitted, candidates=tuple(each for each in fitted.candidates if not each.part.endswith(_MOVING)))


def _hardest(candidates: Sequence[Candidate], late_s: float) -> Iterator[Candidate]:
    """Yield, for one lag and for two, the longest dead time, and the lowest ultimate gain with so many seconds more."""
    for lags in sorted({len(each.model.lags_s) for each in candidates}):
        subset = [each for each in candidates if len(each.model.lags_s) == lags]
        longest = max(subset, key=_dead_time_s)
        hardest = min(subset, key=lambda entry: _ultimate_gain(_later(entry, late_s, "")))
        yield longest
        if hardest is not longest:
            yield hardest


def _ultimate_gain(candidate: Candidate) -> float:
    """Return the gain of a P controller at which the heater swings for ever [%/°C]; its dead time is above 0."""
    omega = 2.0 * math.pi / ultimate_period_s(candidate.model)
    lost = math.prod(math.hypot(1.0, omega * lag) for lag in candidate.model.lags_s)
    return lost / math.hypot(1.0, omega * zero_s(candidate.model)) / abs(candidate.model.gain_degC_per_pct)


def _room(dead_time_s: float, late_s: float, most_s: float | None) -> float:
    """Return how much longer a dead time may be, within the known maximum [s]."""
    return late_s if most_s is None else max(min(late_s, most_s - dead_time_s), 0.0)


def _ends(candidates: Sequence[Candidate], period_s: float) -> Iterator[Candidate]:
    """Return, of one lag and of two, the shortest dead time made shorter and the longest one made longer."""
    for lags in sorted({len(each.model.lags_s) for each in candidates}):
        subset = sorted((each for each in candidates if len(each.model.lags_s) == lags), key=_dead_time_s)
        yield _later(subset[0], -period_s, "dead time shorter by a PWM period")
        yield _later(subset[-1], _EARLIER * period_s, "dead time longer by half a PWM period")


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


_SECOND_DIFFERENCE: Final = 6.0**0.5  # standard deviation of y₋ − 2y + y₊ of white noise of 1
_USED: Final = 0.75  # of the range that the heater reached: the middle of the upper half
_ABOVE: Final = 0.25  # of the same: a setpoint below is a heater that was switched off
_HELD: Final = 0.05  # of the log: what is asked for shorter is on a ramp


@dataclass(frozen=True, slots=True, kw_only=True)
class DelaysKnown:
    """Delays known to the user in addition to the log.

    Attributes:
        dead_time_at_most_s: longest possible dead time, None if unknown [s].
        sensor_delay_s: delay of the sensor [s].
        pwm_period_s: of the PWM that switched the heater, 0 without PWM, None: as in each log [s].

    Raises:
        OutOfRange: a negative delay or period, a longest dead time that is not positive or shorter than the sensor's
            delay.
    """

    dead_time_at_most_s: float | None = None
    sensor_delay_s: float = 0.0
    pwm_period_s: float | None = None

    def __post_init__(self) -> None:
        check("sensor_delay_s", self.sensor_delay_s, least=0.0)
        check("log_pwm_period_s", self.pwm_period_s or 0.0, least=0.0)
        if self.dead_time_at_most_s is not None:
            check("dead_time_at_most_s", self.dead_time_at_most_s, above=0.0, least=self.sensor_delay_s)

    def least_dead_time_s(self, logs: Sequence[Log]) -> float:
        """Return the shortest plausible dead time [s].

        A dead time shorter than half the interval between two readings is not observable.
        """
        return _interval_s(logs) / 2.0 + self.sensor_delay_s

    def apply_to(self, fitted: FittedModel, logs: Sequence[Log]) -> FittedModel:
        """Return the model with the other properties of its logs; the operating point is that of the first."""
        period_s = max(self._hidden_period_s(log) for log in logs)
        delays = {"dead_time_at_most_s": self.dead_time_at_most_s, "sensor_delay_s": self.sensor_delay_s or None,
                  "log_pwm_period_s": period_s or None}
        fitted = with_pwm_hidden(fitted, period_s)
        powered = [log for log in logs if log.power_pct is not None]
        if powered:
            fitted = with_late_power(
                fitted, _interval_s(powered), gap_s=max(log.signals["power"].late_s for log in powered),
                most_s=self.dead_time_at_most_s, least_s=self.least_dead_time_s(logs))
        return replace(
            fitted, setpoint_degC=setpoint_of(logs[0]), logged_range_degC=logged_range_degC(logs),
            log_interval_s=_interval_s(logs),
            least_dead_time_s=self.least_dead_time_s(logs), reading_step_degC=max(map(reading_step_degC, logs)),
            assumed={**fitted.assumed, **{name: value for name, value in delays.items() if value is not None}},
        )

    def _hidden_period_s(self, log: Log) -> float:
        """Return the period of the PWM that a log's power does not show [s]; power that is on or off shows all."""
        power = log.signals.get("power")
        shown = power is not None and bool(np.all((power.values == 0.0) | (power.values == 100.0)))
        if shown:
            return 0.0
        return log.pwm_period_s if self.pwm_period_s is None else self.pwm_period_s


def _interval_s(logs: Sequence[Log]) -> float:
    return max(float(np.median(np.diff(log.time_s))) for log in logs)


def logged_range_degC(logs: Sequence[Log]) -> tuple[float, float]:
    """Return the lowest and the highest temperature of some logs, single odd readings left out [°C]."""
    readings = [replace_outliers(log.temperature_degC) for log in logs]
    return min(float(each.min()) for each in readings), max(float(each.max()) for each in readings)


def reading_step_degC(log: Log) -> float:
    """Return the step of the sensor, or the standard deviation of one reading's noise where that is more [°C]."""
    readings = log.temperature_degC
    bends = np.abs(readings[:-2] - 2.0 * readings[1:-1] + readings[2:])
    noise = 1.4826 * float(np.median(bends)) / _SECOND_DIFFERENCE
    return max(sensor_step(readings) or 0.0, noise)


def setpoint_of(log: Log) -> float:
    """Return the operating temperature of the heater [°C].

    It is the last value of the setpoint column, unless this lies in the lowest quarter of the reached range: then the
    heater was switched off, as a printer is after each print, and it is the value that was asked for longest.
    Otherwise it is the steady state given by the log's source, or the middle of the upper half of the reached range.
    """
    reached = replace_outliers(log.temperature_degC)
    low, span = float(reached.min()), float(np.ptp(reached))
    if log.setpoint_degC is not None:
        if (last := float(log.setpoint_degC[-1])) > low + _ABOVE * span:
            return last
        used = (log.setpoint_degC > low + _ABOVE * span) & (log.setpoint_degC <= low + span)
        if (longest := _longest(log.setpoint_degC, log.time_s, used)) is not None:
            return longest
    return round(low + _USED * span, 1) if log.rests_at_degC is None else log.rests_at_degC


def _longest(values: Array, time_s: Array, used: npt.NDArray[np.bool_]) -> float | None:
    """Return which of the used values stood longest; None where none stood for `_HELD` of the log, as on a ramp."""
    levels, which = np.unique(values[used], return_inverse=True)
    stood_s = np.bincount(which, weights=np.diff(time_s, append=time_s[-1])[used], minlength=1)
    longest = int(np.argmax(stood_s))
    return float(levels[longest]) if len(levels) and stood_s[longest] >= _HELD * np.ptp(time_s) else None


def pool_candidates(fitted: FittedModel, others: Sequence[FittedModel]) -> FittedModel:
    """Return the fit with the candidates of other logs of the same heater added."""
    added = tuple(candidate for other in others for candidate in other.candidates)
    if not added:
        return fitted
    logs = ", ".join(dict.fromkeys(candidate.log for candidate in added))
    note = f"Candidates of {logs}, a log of the same heater, were added: a design has to serve them too."
    ranges = [each.logged_range_degC for each in (fitted, *others)]
    intervals = [limits for limits in ranges if limits is not None]
    whole = (min(low for low, _ in intervals), max(high for _, high in intervals)) if intervals else None
    return replace(fitted, candidates=fitted.candidates + added, notes=(*fitted.notes, note), logged_range_degC=whole)

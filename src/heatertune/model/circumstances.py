"""What a log tells beside its heater: how it was sampled, how fine its sensor is, and where the heater was used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from heatertune.log.values import Log
from heatertune.model.outliers import replace_outliers, sensor_step
from heatertune.model.switched import with_late_power, with_pwm_hidden
from heatertune.model.values import FittedModel
from heatertune.units import check

__all__ = ["DelaysKnown", "logged_range_degC", "reading_step_degC", "setpoint_of"]

_SECOND_DIFFERENCE: Final = 6.0**0.5  # standard deviation of y₋ − 2y + y₊ of white noise of 1
_USED: Final = 0.75  # of what the heater reached: the middle of the upper half
_ABOVE: Final = 0.25  # of the same: a setpoint below is a heater that was switched off


@dataclass(frozen=True, slots=True, kw_only=True)
class DelaysKnown:
    """What the user knows of the heater's delay beside the log.

    Attributes:
        dead_time_at_most_s: no dead time is longer, None where nobody knows [s].
        sensor_delay_s: by which the sensor lags behind [s].
        pwm_period_s: of the PWM that switched the heater, 0 where none did, None: as each log says [s].

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
        """Return the least dead time that is believed [s].

        One shorter than half the interval between two readings cannot be seen.
        """
        return _interval_s(logs) / 2.0 + self.sensor_delay_s

    def apply_to(self, fitted: FittedModel, logs: Sequence[Log]) -> FittedModel:
        """Return the model with what its logs tell beside the heater; the first one tells where it was used."""
        period_s = max(self._hidden_period_s(log) for log in logs)
        given = {"dead_time_at_most_s": self.dead_time_at_most_s, "sensor_delay_s": self.sensor_delay_s or None,
                 "log_pwm_period_s": period_s or None}
        fitted = with_pwm_hidden(fitted, period_s)
        powered = [log for log in logs if log.power_pct is not None]
        if powered:
            fitted = with_late_power(
                fitted, _interval_s(powered), gap_s=max(log.power_late_s for log in powered),
                most_s=self.dead_time_at_most_s, least_s=self.least_dead_time_s(logs))
        return replace(
            fitted, setpoint_degC=setpoint_of(logs[0]), logged_range_degC=logged_range_degC(logs),
            log_interval_s=_interval_s(logs),
            least_dead_time_s=self.least_dead_time_s(logs), reading_step_degC=max(map(reading_step_degC, logs)),
            assumed={**fitted.assumed, **{name: value for name, value in given.items() if value is not None}},
        )

    def _hidden_period_s(self, log: Log) -> float:
        """Return the period of the PWM that a log's power does not show [s]; power that is on or off shows all."""
        power = log.power_pct
        shown = power is not None and bool(np.all((power == 0.0) | (power == 100.0)))
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
    """Return where the heater was used [°C].

    The setpoint column's last value, unless that lies in the lowest quarter of what the heater reached: then it was
    switched off. Else where the log's source says that it rests; else the middle of the upper half of what it reached.
    """
    reached = replace_outliers(log.temperature_degC)
    low, span = float(reached.min()), float(np.ptp(reached))
    asked = None if log.setpoint_degC is None else float(log.setpoint_degC[-1])
    if asked is not None and asked > low + _ABOVE * span:
        return asked
    return round(low + _USED * span, 1) if log.rests_at_degC is None else log.rests_at_degC

"""A controller called scan by scan, as its PLC calls it: for loops of a user's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from heatertune.errors import InputError
from heatertune.plc.core import ControllerState, Scan, Timing
from heatertune.plc.ramp import Number, Ramp, next_setpoint
from heatertune.units import check

__all__ = ["RunningController"]


class RunningController:
    """Words that run: `power_pct = c(reading_degC, setpoint_degC)`, one scan for each call.

    Attributes:
        scan_s: interval at which it is to be called [s].
        pwm_period_s: of the PWM that it makes itself [s], else None: the PWM is an actuator behind it.
        scan: what the last scan gave, in a controller with its own PWM also between two periods; None before the first.
    """

    def __init__(
        self, *, begin: ControllerState, step: Callable[..., tuple[ControllerState, Scan]],
        measure: Callable[[float], Number],
        timing: Timing, ramp: Ramp | None = None,
    ) -> None:
        """Take what `Controller.called` hands in.

        Args:
            begin: the cold state.
            step: `Controller.step`.
            measure: temperature [°C] → reading.
            timing: when it is to be called.
            ramp: how the setpoint moves; None: at once.
        """
        self._begin, self._step, self._measure, self._ramp = begin, step, measure, ramp
        self.scan_s, self.pwm_period_s = timing.scan_s, timing.pwm_period_s
        self._per_period = 1 if timing.pwm_period_s is None else max(1, round(timing.pwm_period_s / timing.scan_s))
        self.reset()

    def reset(self) -> None:
        """Go back to the cold state; the setpoint is forgotten, too."""
        self._running, self._calls, self._held_pct = self._begin, 0, 0.0
        self._setpoint_degC: float | None = None
        self._followed: Number = 0
        self.scan: Scan | None = None

    @property
    def flags(self) -> Mapping[str, bool]:
        """The flags after the last scan, name → set?; empty before the first."""
        return {} if self.scan is None else self.scan.flags

    def __call__(self, reading_degC: float, setpoint_degC: float | None = None) -> float:
        """Run one scan.

        Args:
            reading_degC: the temperature, which is quantised and limited as the input module does it [°C].
            setpoint_degC: likewise; None: as at the scan before [°C].

        Returns:
            The power until the next scan [0…100 %]. A controller that makes the PWM itself takes up a new power where a
            period begins, at the first scan for the first time: it is the mean over that period.

        Raises:
            InputError: no setpoint at the first scan.
            OutOfRange: a reading or setpoint that is no finite number; nothing has changed then.
        """
        asked_degC = self._setpoint_degC if setpoint_degC is None else setpoint_degC
        if asked_degC is None:
            raise InputError("the first scan needs a setpoint: c(reading_degC, setpoint_degC)")
        check("reading_degC", float(reading_degC))
        check("setpoint_degC", float(asked_degC))
        reading, begins = self._measure(float(reading_degC)), self._calls % self._per_period == 0
        self._followed = self._follow(self._measure(float(asked_degC)), reading)
        self._running, self.scan = self._step(self._running, self._followed, reading, cycle_start=begins)
        self._setpoint_degC, self._calls = asked_degC, self._calls + 1
        self._held_pct = self.scan.power_pct if begins else self._held_pct
        return self._held_pct

    def _follow(self, asked: Number, reading: Number) -> Number:
        """Return the setpoint word at this scan, as `heatertune.plc.ramp.course` has it."""
        if self._ramp is None:
            return asked
        word = self._followed if self._calls else reading
        return next_setpoint(word, asked, self._ramp, reading, due=(self._calls + 1) % self._ramp.calls == 0)

"""The wish: the design as it was meant, in floating point, on the same heater and switch."""

from __future__ import annotations

from collections.abc import Callable

from heatertune.model.values import HeaterModel
from heatertune.pid.values import PidDesign
from heatertune.proof.loop import Controller, run_loop
from heatertune.proof.pwm import Actuator
from heatertune.proof.scenario import Scenario
from heatertune.proof.trace import Trace

__all__ = ["simulate_wish"]


def simulate_wish(design: PidDesign, model: HeaterModel, scenario: Scenario, actuator: Actuator) -> Trace:
    """Return what the heater would do if the controller knew no words.

    The law is that of the sampled margins: u = K·(e + I + D), I by the backward rectangle, D filtered as the
    design says; readings and power are not rounded. While the power is at a limit, an I step that would
    drive it further is left out.

    Raises:
        InputError, OutOfRange: as `simulate`.
    """
    controller = Controller(
        step=_law(design, scenario.setpoint_degC), measure=lambda temperature: temperature, scan_s=design.sample_time_s
    )
    return run_loop(controller, model, scenario, actuator)


def _law(design: PidDesign, setpoint: float) -> Callable[[float, bool], float]:
    gain, integral = design.gain_pct_per_degC, design.sample_time_s / design.integral_time_s
    past = design.derivative_filter
    derivative = (1.0 - past) * design.derivative_time_s / design.sample_time_s
    summed = filtered = last = 0.0

    def step(reading: float, _cycle_start: bool) -> float:
        nonlocal summed, filtered, last
        error = setpoint - reading
        filtered = past * filtered + derivative * (error - last)
        last = error
        wanted = gain * (error + summed + integral * error + filtered)
        power = min(100.0, max(0.0, wanted))
        if power == wanted or (wanted - power) * gain * error < 0.0:
            summed += integral * error
        return power

    return step

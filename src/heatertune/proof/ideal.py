"""The wish: the design as it was meant, in floating point, on the same heater and switch."""

from __future__ import annotations

import math
from collections.abc import Callable

from heatertune.model.values import HeaterModel
from heatertune.pid.values import PidDesign
from heatertune.proof.loop import Controller, run_loop
from heatertune.proof.pwm import Actuator
from heatertune.proof.scenario import Scenario
from heatertune.proof.trace import Trace

__all__ = ["simulate_wish"]


def simulate_wish(
    design: PidDesign, model: HeaterModel, scenario: Scenario, actuator: Actuator, *,
    ramp_degC_per_min: float = math.inf,
) -> Trace:
    """Return what the heater would do if the controller knew no words.

    The law is that of the sampled margins: u = K·(e + I + D), I by the backward rectangle, D filtered as the
    design says; readings and power are not rounded. While the power is at a limit, an I step that would
    drive it further is left out. With a ramp the setpoint starts at the reading and has moved once when the first
    power is asked for.

    Raises:
        InputError, OutOfRange: as `simulate`.
    """
    per_scan, asked = ramp_degC_per_min / 60.0 * design.sample_time_s, scenario.setpoint_degC
    controller = Controller(
        step=_law(design), measure=lambda temperature: temperature, scan_s=design.sample_time_s,
        setpoints=lambda first, scans: [_on_the_way(first, asked, (k + 1) * per_scan) for k in range(scans)],
    )
    return run_loop(controller, model, scenario, actuator)


def _on_the_way(begin: float, asked: float, distance: float) -> float:
    return min(begin + distance, asked) if begin <= asked else max(begin - distance, asked)


def _law(design: PidDesign) -> Callable[[float, float, bool], float]:
    gain, integral = design.gain_pct_per_degC, design.sample_time_s / design.integral_time_s
    past = design.derivative_filter
    derivative = (1.0 - past) * design.derivative_time_s / design.sample_time_s
    summed = filtered = last = 0.0

    def step(setpoint: float, reading: float, _cycle_start: bool) -> float:
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

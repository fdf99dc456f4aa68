"""The wish: the design as it was meant, in floating point, on the same heater and switch."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from heatertune.model.values import HeaterModel
from heatertune.pid.design_provenance import BoostView
from heatertune.pid.values import PidDesign
from heatertune.plc.core import StepFunctions
from heatertune.plc.pwm import Actuator
from heatertune.proof.loop import LoopController, run_loop
from heatertune.proof.scenario import Scenario
from heatertune.proof.trace import Trace

__all__ = ["simulate_wish"]


class _Law(NamedTuple):
    gain: float
    integral: float  # TA/TI
    past: float
    derivative: float
    within: float  # of the boost, see `heatertune.plc.boost.Boost`
    again: float
    cooling: float  # full power of a cooler as a part of the heater's


class _IdealState(NamedTuple):
    summed: float
    filtered: float
    error: float
    enabled: bool = True


def simulate_wish(
    design: PidDesign, model: HeaterModel, scenario: Scenario, actuator: Actuator, *,
    ramp_degC_per_min: float = math.inf, hold_degC: float | None = None, boost: BoostView | None = None,
) -> Trace:
    """Return what the heater would do if the controller knew no words.

    The law is that of the sampled margins: u = K·(e + I + D), I by the backward rectangle, D filtered as the
    design says; readings and power are not rounded. While the power is at a limit, an I step that would
    drive it further is left out. With a ramp the setpoint starts at the reading and has moved once when the first
    power is asked for; see `heatertune.plc.ramp.Ramp` for the holdback.

    Args:
        design: what was meant.
        model: the heater.
        scenario: what happens.
        actuator: the switch.
        ramp_degC_per_min: of the setpoint [°C/min].
        hold_degC: how far from the reading it may be on its way [°C]; None: as far as it goes.
        boost: where it is full power that is asked for, and the sums are none; None: nowhere.

    Raises:
        InputError, OutOfRange: as `simulate`.
    """
    ramped = math.isfinite(ramp_degC_per_min)
    controller = LoopController(
        core=_CORE, parameters=_law_of(design, boost, actuator.cooling_gain or 0.0),
        state=_IdealState(0.0, 0.0, 0.0, boost is None), sensor=0.0, setpoints=scenario.setpoints_degC,
        scan_s=design.sample_time_s, ramp_calls=int(ramped),
        ramp_step=ramp_degC_per_min / 60.0 * design.sample_time_s if ramped else 0.0, ramp_hold=hold_degC or 0.0,
    )
    return run_loop(controller, model, scenario, actuator)


def _law_of(design: PidDesign, boost: BoostView | None = None, cooling: float = 0.0) -> _Law:
    past, never = design.derivative_filter, (math.inf, math.inf)
    return _Law(
        design.gain_pct_per_degC, design.sample_time_s / design.integral_time_s, past,
        (1.0 - past) * design.derivative_time_s / design.sample_time_s,
        *(never if boost is None else (boost.within_degC, boost.again_degC)), cooling,
    )


def _step(p: _Law, s: _IdealState, setpoint: float, reading: float, _begins: bool) -> tuple[_IdealState, float, float,
                                                                                            int]:
    error = setpoint - reading
    if (error if p.gain > 0.0 else -error) > (p.again if s.enabled else p.within):
        return _IdealState(0.0, 0.0, error, False), 100.0, 100.0, 0
    filtered = p.past * s.filtered + p.derivative * (error - s.error)
    wanted = p.gain * (error + s.summed + p.integral * error + filtered)
    power = min(100.0, max(-100.0 * p.cooling, wanted))
    summed = s.summed
    if power == wanted or (wanted - power) * p.gain * error < 0.0:
        summed += p.integral * error
    return _IdealState(summed, filtered, error, True), power if power >= 0.0 else power / p.cooling, wanted, 0


def _as_it_is(_sensor: float, temperature_degC: float) -> float:
    return temperature_degC


_CORE: Final = StepFunctions(step=_step, measure=_as_it_is, flags=())

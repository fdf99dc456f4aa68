"""The linear sampled loop in time: load and setpoint responses, their integrals, and TRdom.

Few responses run as plain Python, which loads no compiler; a search's run as machine code, with the same numbers.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function, worth_compiling
from heatertune.model.values import HeaterModel
from heatertune.pid.loop.sampled import sample_plant
from heatertune.pid.values import PidDesign

__all__ = ["dominant_time_s", "horizon", "iae_load", "iae_setpoint", "itae_load", "respond"]

Array = npt.NDArray[np.float64]
#: an array where the loop is compiled, a list in plain Python
Places = Array | list[float]


_PLAIN_SAMPLES = 300_000  # take as long as the compiler's start
_PLAIN_SAMPLES_READY = 30_000  # as long as this function's compilation, where the compiler was started for other work


def _respond(
    plant: tuple[Places, Places, Places, int], controller: tuple[float, float, float, float],
    steps: tuple[float, float], x: Places, inputs: Places, out: Places,
) -> None:
    """Write the temperature deviation at each sample to `out`; `x` and `inputs` are zero and of the loop's size.

    `plant` holds poles, now, before and delay, `controller` K, TA/TN, TV/TA and the weight of the past in the D part,
    `steps` the heights of setpoint and load.
    """
    poles, now, before, delay = plant
    setpoint, load = steps
    gain, integral, derivative, past = controller
    summed = filtered = last = 0.0
    for k in range(len(out)):
        y = 0.0
        for i in range(len(x)):
            y += x[i]
        out[k] = y
        error = setpoint - y
        summed += integral * error
        filtered = past * filtered + (1.0 - past) * derivative * (error - last)
        last = error
        inputs[k] = gain * (error + summed + filtered) + load
        u_now = inputs[k - delay] if k >= delay else 0.0
        u_before = inputs[k - delay - 1] if k > delay else 0.0
        for i in range(len(x)):
            x[i] = poles[i] * x[i] + now[i] * u_now + before[i] * u_before


def respond(
    model: HeaterModel, design: PidDesign, samples: int, *, setpoint_degC: float = 0.0, load_pct: float = 0.0
) -> Array:
    """Return the deviation at each sample [°C] after a step of setpoint and load at t = 0, shape (samples,).

    Args:
        model: the heater, at rest before the step.
        design: of the sampled controller.
        samples: how many, the first at t = 0.
        setpoint_degC: height of the setpoint's step [°C].
        load_pct: height of the load's step, as heater power [%].
    """
    plant, ta = sample_plant(model, design.sample_time_s), design.sample_time_s
    controller = (
        float(design.gain_pct_per_degC), float(ta / design.integral_time_s), float(design.derivative_time_s / ta),
        float(design.derivative_filter),
    )
    modes = (plant.poles, plant.now, plant.before)
    space = (np.zeros(len(plant.poles)), np.zeros(samples), np.zeros(samples))
    steps = (float(setpoint_degC), float(load_pct))
    run: Callable[..., None] = _respond
    if worth_compiling(samples, "response", _PLAIN_SAMPLES_READY if "numba" in sys.modules else _PLAIN_SAMPLES):
        compile_function(run)((*modes, plant.delay), controller, steps, *space)
        return space[-1]
    plain = [array.tolist() for array in space]
    run((*(array.tolist() for array in modes), plant.delay), controller, steps, *plain)
    return np.array(plain[-1])


def horizon(model: HeaterModel, design: PidDesign) -> int:
    """Return the number of samples in which a well-damped loop comes to rest."""
    loop_gain = abs(design.gain_pct_per_degC * model.gain_degC_per_pct)
    slow = sum(model.lags_s) + model.dead_time_s
    if math.isfinite(design.integral_time_s):
        slow += design.integral_time_s * (1.0 + 1.0 / loop_gain)
    return int(np.clip(10.0 * slow / design.sample_time_s, 50, 20_000))


def iae_load(model: HeaterModel, design: PidDesign) -> float:
    """Return ∫|e| dt after a load step of 1 % power [°C·s]; infinite where the loop keeps an offset or diverges."""
    deviation = respond(model, design, horizon(model, design), load_pct=1.0)
    return _integral(deviation, design.sample_time_s, abs(model.gain_degC_per_pct))


def iae_setpoint(model: HeaterModel, design: PidDesign) -> float:
    """Return ∫|e| dt after a setpoint step of 1 °C, power unlimited [s]; infinite where it does not converge."""
    deviation = 1.0 - respond(model, design, horizon(model, design), setpoint_degC=1.0)
    return _integral(deviation, design.sample_time_s, 1.0)


def itae_load(model: HeaterModel, design: PidDesign) -> float:
    """Return ∫t·|e| dt after a load step of 1 % power [°C·s²]; infinite as `iae_load`."""
    deviation = respond(model, design, horizon(model, design), load_pct=1.0)
    if math.isinf(_integral(deviation, design.sample_time_s, abs(model.gain_degC_per_pct))):
        return math.inf
    return float(np.arange(len(deviation)) @ np.abs(deviation)) * design.sample_time_s**2


def dominant_time_s(model: HeaterModel, design: PidDesign) -> float:
    """Return TRdom: the time in which the closed loop's setpoint response covers 63.2 % of its way [s].

    S5-115U manual, section 11.2.3 and figure 11-4; the drawing is lost, the 63.2 % reading is this project's.
    Infinite where the response does not settle.
    """
    response = respond(model, design, horizon(model, design), setpoint_degC=1.0)
    final = 1.0 if math.isfinite(design.integral_time_s) else _p_final(model, design)
    if not math.isfinite(response[-1]) or abs(response[-1] - final) > 0.2 * final:
        return math.inf
    reached = response >= (1.0 - math.exp(-1.0)) * final
    k = int(np.argmax(reached))
    before = response[k - 1]
    share = ((1.0 - math.exp(-1.0)) * final - before) / (response[k] - before)
    return float((k - 1 + share) * design.sample_time_s)


def _p_final(model: HeaterModel, design: PidDesign) -> float:
    loop_gain = design.gain_pct_per_degC * model.gain_degC_per_pct
    return loop_gain / (1.0 + loop_gain)


def _integral(deviation: Array, sample_time_s: float, scale: float) -> float:
    if not np.isfinite(deviation[-1]) or abs(deviation[-1]) > 0.02 * scale:
        return math.inf
    return float(np.sum(np.abs(deviation)) * sample_time_s)

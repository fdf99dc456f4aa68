"""The loop as a PLC runs it: a sampled controller, power held between samples, exact fractional dead time.

    C(z) = K·[1 + TA/TN·1/(1 − 1/z) + (1 − f)·TV/TA·(1 − 1/z)/(1 − f/z)]

with the derivative filter D_k = f·D_{k−1} + (1 − f)·TV/TA·(e_k − e_{k−1}); f is ½ in OB251, 0 without a filter. Each
lag is a first-order mode after a hold; a dead time of d samples and a fraction splits each input between two samples
(K. J. Åström and B. Wittenmark, "Computer-Controlled Systems", 3rd ed., section 2.3).

Also time responses to load and setpoint, their integrals and TRdom (plain Python for a few, machine code for a search,
the same results), and the exact margins. Plants, frequencies and responses are cached and read-only.

The same sampled loop in python-control, as an independent check of margins and linear responses.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, TypeVar

import numpy as np

from heatertune.arrays import Array, Complex
from heatertune.compiled import compile_function, worth_compiling
from heatertune.heater.exact import apart
from heatertune.model.model_values import HeaterModel, TwoLag
from heatertune.pid.design_values import Margins, PidDesign

__all__ = [
    "SampledPlant", "combine_responses", "control_margins", "controller_response", "crossings", "dominant_time_s",
    "encloses_nothing", "frequencies", "horizon", "iae_load", "iae_setpoint", "itae_load", "loop_response",
    "loop_transfer_function", "margins", "noise_gain", "part_responses", "parts_at",
    "plant_and_controller_response", "plant_at", "respond", "sample_plant", "second_opinion", "sensitivity_peaks",
    "worst",
]


_Numbers = TypeVar("_Numbers", Array, Complex)

_KEPT = 64  # of each; a response takes up to 72 kB


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledPlant:
    """G behind a hold, as modes in parallel: x⁺ = pole·x + now·u[k−delay] + before·u[k−delay−1].

    Attributes:
        poles, now, before: per mode, shape (m,); the output is the sum of the modes [°C].
        delay: whole samples of dead time.
        sample_time_s: TA [s].
    """

    poles: Array
    now: Array
    before: Array
    delay: int
    sample_time_s: float

    def frequency_response(self, omega: Array) -> Complex:
        """Return the pulse transfer function at e^(jω·TA) [°C/%], shape (n,)."""
        z = np.exp(1j * np.asarray(omega) * self.sample_time_s)
        modes = (self.now[:, None] + self.before[:, None] / z) / (z - self.poles[:, None])
        return np.asarray(modes.sum(axis=0) * z ** (-self.delay))


@lru_cache(maxsize=_KEPT)
def sample_plant(model: HeaterModel, sample_time_s: float, *, computing_delay_s: float = 0.0) -> SampledPlant:
    """Return the plant as seen by a controller with a hold and interval `sample_time_s` [s]."""
    dead = model.dead_time_s + computing_delay_s
    delay = math.floor(dead / sample_time_s)
    late = dead - delay * sample_time_s
    lags, shares = _modes(model)
    whole = np.exp(-sample_time_s / lags)
    rest = np.exp(-(sample_time_s - late) / lags)
    gains = model.gain_degC_per_pct * shares
    return SampledPlant(
        poles=_lock(whole), now=_lock(gains * (1.0 - rest)), before=_lock(gains * (rest - whole)), delay=delay,
        sample_time_s=sample_time_s,
    )


def controller_response(design: PidDesign, omega: Array) -> Complex:
    """Return C(e^(jω·TA)) [%/°C], shape (n,)."""
    return combine_responses(design, part_responses(omega, design.sample_time_s, design.derivative_filter))


def combine_responses(design: PidDesign, parts: Complex) -> Complex:
    """Return C [%/°C], shape (n,), from the responses of its parts, shape (3, n)."""
    proportional, summed, difference = parts
    integral = design.sample_time_s / design.integral_time_s
    derivative = design.derivative_time_s / design.sample_time_s
    return np.asarray(design.gain_pct_per_degC * (proportional + integral * summed + derivative * difference))


def part_responses(omega: Array, sample_time_s: float, derivative_filter: float) -> Complex:
    """Return the frequency responses of the P, I and D part at e^(jω·TA), per unit of kP, kI, kD, shape (3, n).

    P: 1; I: 1/(1 − z⁻¹), the sum; D: (1 − f)·(1 − z⁻¹)/(1 − f·z⁻¹), the filtered difference.
    """
    backward = np.exp(-1j * np.asarray(omega) * sample_time_s)
    past = derivative_filter
    difference = (1.0 - past) * (1.0 - backward) / (1.0 - past * backward)
    return np.stack([np.ones_like(backward), 1.0 / (1.0 - backward), difference])


@lru_cache(maxsize=_KEPT)
def plant_at(model: HeaterModel, sample_time_s: float, slowest_s: float, n: int = 1500) -> Complex:
    """Return the plant's pulse transfer function [°C/%] at `frequencies`, shape (n,)."""
    return _lock(sample_plant(model, sample_time_s).frequency_response(frequencies(sample_time_s, slowest_s, n)))


@lru_cache(maxsize=_KEPT)
def parts_at(derivative_filter: float, sample_time_s: float, slowest_s: float, n: int = 1500) -> Complex:
    """Return `part_responses` at `frequencies`, shape (3, n)."""
    return _lock(part_responses(frequencies(sample_time_s, slowest_s, n), sample_time_s, derivative_filter))


@lru_cache(maxsize=_KEPT)
def frequencies(sample_time_s: float, slowest_s: float, n: int = 1500) -> Array:
    """Return frequencies from far below 1/`slowest_s` up to half the sampling frequency, shape (n,) [rad/s]."""
    return _lock(np.geomspace(min(1e-3 / slowest_s, 1e-2 * math.pi / sample_time_s), math.pi / sample_time_s, n))


def _lock(array: _Numbers) -> _Numbers:
    array.flags.writeable = False
    return array


def _modes(model: HeaterModel) -> tuple[Array, Array]:
    if not isinstance(model, TwoLag):
        return np.array([model.time_constant_s]), np.ones(1)
    first, second = apart(*model.lags_s)
    zero = (model.fast_share or 0.0) * first
    return np.array([first, second]), np.array([first - zero, -(second - zero)]) / (first - second)


#: an array in the compiled loop, a list in plain Python
Places = Array | list[float]


_PLAIN_SAMPLES = 300_000  # take as long as the compiler's start
_PLAIN_SAMPLES_READY = 30_000  # as long as the compilation of this function, if the compiler was started for other work


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
    """Return ∫|e| dt after a load step of 1 % power [°C·s]; infinite if the loop keeps an offset or diverges."""
    deviation = respond(model, design, horizon(model, design), load_pct=1.0)
    return _integral(deviation, design.sample_time_s, abs(model.gain_degC_per_pct))


def iae_setpoint(model: HeaterModel, design: PidDesign) -> float:
    """Return ∫|e| dt after a setpoint step of 1 °C, power unlimited [s]; infinite if it does not converge."""
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


def loop_response(model: HeaterModel, design: PidDesign, omega: Array) -> Complex:
    """Return L = G·C of the sampled loop at `omega` [rad/s], shape (n,)."""
    return sample_plant(model, design.sample_time_s).frequency_response(omega) * controller_response(design, omega)


@lru_cache(maxsize=256)  # a search proves the same gains with many other changes
def margins(model: HeaterModel, design: PidDesign) -> Margins:
    """Return Ms, Mt, gain and phase margin of the sampled loop; Ms and Mt are infinite if it is unstable."""
    plant, controller = plant_and_controller_response(model, design)
    loop = plant * controller
    ms, mt = _peaks(loop, design)
    gain, phase = crossings(loop)
    return Margins(ms=ms, mt=mt, gain_margin=gain, phase_margin_deg=phase)


def sensitivity_peaks(model: HeaterModel, design: PidDesign) -> tuple[float, float]:
    """Return Ms and Mt of `margins`, in a third of its time."""
    plant, controller = plant_and_controller_response(model, design)
    return _peaks(plant * controller, design)


def noise_gain(model: HeaterModel, design: PidDesign) -> float:
    """Return Mks = max |C·S| of a stable sampled loop: how much of a reading's noise reaches the power [%/°C]."""
    plant, controller = plant_and_controller_response(model, design)
    return float(np.max(np.abs(controller / (1.0 + plant * controller))))


def plant_and_controller_response(model: HeaterModel, design: PidDesign) -> tuple[Complex, Complex]:
    """Return G [°C/%] and C [%/°C] at the frequencies of the margins, each of shape (n,)."""
    slowest = max(*model.lags_s, model.dead_time_s, design.sample_time_s)
    if math.isfinite(design.integral_time_s):
        slowest = max(slowest, design.integral_time_s)
    parts = parts_at(design.derivative_filter, design.sample_time_s, slowest)
    return plant_at(model, design.sample_time_s, slowest), combine_responses(design, parts)


def _peaks(loop: Complex, design: PidDesign) -> tuple[float, float]:
    if not encloses_nothing(loop, integrating=math.isfinite(design.integral_time_s)):
        return math.inf, math.inf
    return float(np.max(1.0 / np.abs(1.0 + loop))), float(np.max(np.abs(loop / (1.0 + loop))))


def worst(judged: Sequence[Margins]) -> Margins:
    """Return the worst of each margin."""
    return Margins(
        ms=max(m.ms for m in judged),
        mt=max(m.mt for m in judged),
        gain_margin=min(m.gain_margin for m in judged),
        phase_margin_deg=min(m.phase_margin_deg for m in judged),
    )


def encloses_nothing(loop: Complex, *, integrating: bool) -> bool:
    """Return whether the Nyquist curve leaves −1 outside (open loop stable but for one integrator): a stable loop.

    1 + L turns from −90° (integrator) or from a positive real number to the real axis at half the sampling
    frequency; without encirclement it ends on the positive side after exactly that turn. L, shape (n,), is given at
    ascending frequencies up to there.
    """
    phase = np.angle(1.0 + loop)
    steps = np.diff(phase)
    rounds = np.count_nonzero(steps < -math.pi) - np.count_nonzero(steps > math.pi)  # across the cut at 180°
    turned = float(phase[-1] - phase[0]) + 2.0 * math.pi * rounds
    expected = math.pi / 2.0 if integrating else 0.0
    begins_well = phase[0] < 0.0 if integrating else 1.0 + loop[0].real > 0.0
    return bool(begins_well and abs(turned - expected) < math.pi / 2.0)


def crossings(loop: Complex, *, sampled: bool = True) -> tuple[float, float]:
    """Return of L at ascending frequencies the gain margin (smallest factor to a real −1) and the phase margin [°].

    `loop`: L, shape (n,).
    `sampled`: whether the last frequency is half the sampling frequency, where L is real.
    """
    phase = np.unwrap(np.angle(loop))
    size = np.abs(loop)
    gain = math.inf
    levels = np.arange(-9, 2) * 2.0 * math.pi - math.pi
    for level in levels[(levels > phase.min()) & (levels <= phase.max())]:
        for k in np.flatnonzero(np.diff(np.signbit(phase - level))):
            share = (level - phase[k]) / (phase[k + 1] - phase[k])
            at = float(np.exp(np.log(size[k]) + share * np.log(size[k + 1] / size[k])))
            gain = min(gain, 1.0 / at)
    if sampled and loop[-1].real < 0.0:
        gain = min(gain, 1.0 / abs(float(loop[-1].real)))
    margin = math.inf
    for k in np.flatnonzero(np.diff(np.signbit(size - 1.0))):
        share = math.log(1.0 / size[k]) / math.log(size[k + 1] / size[k])
        at = float(phase[k] + share * (phase[k + 1] - phase[k]))
        margin = min(margin, math.degrees(at) + 180.0)
    return gain, margin


#: samples of dead time up to which python-control's polynomials keep their digits
MOST_DELAY: Final = 100


def loop_transfer_function(model: HeaterModel, design: PidDesign) -> Any:
    """Return L(z) = G(z)·C(z) as a python-control TransferFunction with dt = TA, dead time as powers of z."""
    import control

    ta = design.sample_time_s
    plant = sample_plant(model, ta)
    modes = [
        control.tf([now, before], [1.0, -pole], ta)
        for pole, now, before in zip(plant.poles, plant.now, plant.before, strict=True)
    ]
    shift = control.tf([1.0], np.append(1.0, np.zeros(plant.delay + 1)), ta)
    return sum(modes[1:], modes[0]) * shift * design.to_tf()


def control_margins(model: HeaterModel, design: PidDesign) -> Margins | None:
    """Return the margins by python-control: poles, frequency response and `stability_margins`.

    None if the dead time spans so many samples that the polynomials lose all digits. It does not treat a crossing at
    half the sampling frequency, where L is real, as a gain margin.
    """
    if sample_plant(model, design.sample_time_s).delay > MOST_DELAY:
        return None
    import control

    loop = loop_transfer_function(model, design)
    omega = np.geomspace(1e-5, math.pi / design.sample_time_s, 4000)
    response = loop(np.exp(1j * omega * design.sample_time_s))
    gain, phase, *_ = control.stability_margins((np.abs(response), np.degrees(np.angle(response)), omega))
    characteristic = control.feedback(loop, 1).den[0][0]  # its own poles() lose all digits from 80 samples of delay on
    if float(np.max(np.abs(np.roots(characteristic)))) >= 1.0:
        return Margins(ms=math.inf, mt=math.inf, gain_margin=float(gain), phase_margin_deg=float(phase))
    ms = float(np.max(1.0 / np.abs(1.0 + response)))
    mt = float(np.max(np.abs(response / (1.0 + response))))
    return Margins(ms=ms, mt=mt, gain_margin=float(gain), phase_margin_deg=float(phase))


def second_opinion(plants: Sequence[HeaterModel], design: PidDesign) -> str:
    """Compare Ms with python-control on the heater with the largest Ms, as a sentence."""
    if design.sample_time_s == 0.0:
        return "Not compared with python-control, which has no exact dead time for continuous loops."
    own = [margins(plant, design).ms for plant in plants]
    at = max(range(len(own)), key=own.__getitem__)
    theirs = control_margins(plants[at], design)
    if theirs is None:
        return "Not compared with python-control: the dead time spans too many samples for its polynomials."
    return f"python-control calculates Ms = {theirs.ms:.5g}, heatertune {own[at]:.5g}."

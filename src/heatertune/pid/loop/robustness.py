"""How much the plant may differ before the loop misbehaves: margins of the sampled loop, exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from heatertune.model.values import HeaterModel
from heatertune.pid.loop.sampled import combine_responses, controller_response, parts_seen, plant_seen, sample_plant
from heatertune.pid.values import Margins, PidDesign

__all__ = [
    "crossings", "encloses_nothing", "loop_response", "margins", "noise_gain", "plant_and_controller_response",
    "sensitivity_peaks", "worst",
]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def loop_response(model: HeaterModel, design: PidDesign, omega: Array) -> Complex:
    """Return L = G·C of the sampled loop at `omega` [rad/s], shape (n,)."""
    return sample_plant(model, design.sample_time_s).frequency_response(omega) * controller_response(design, omega)


@lru_cache(maxsize=256)  # a search proves the same gains with many other changes
def margins(model: HeaterModel, design: PidDesign) -> Margins:
    """Return Ms, Mt, gain and phase margin of the sampled loop; Ms and Mt are infinite where it is unstable."""
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
    parts = parts_seen(design.derivative_filter, design.sample_time_s, slowest)
    return plant_seen(model, design.sample_time_s, slowest), combine_responses(design, parts)


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

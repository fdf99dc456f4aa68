"""The same sampled loop in python-control, as an independent check of margins and linear responses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from heatertune.model.values import HeaterModel
from heatertune.pid.sampled_loop import margins, sample_plant
from heatertune.pid.values import Margins, PidDesign

__all__ = ["control_margins", "loop_transfer_function", "second_opinion"]


_MOST_DELAY = 100  # samples of dead time


def loop_transfer_function(model: HeaterModel, design: PidDesign) -> Any:
    """Return L(z) = G(z)·C(z) as a python-control TransferFunction with dt = TA, dead time as powers of z."""
    import control

    ta = design.sample_time_s
    plant = sample_plant(model, ta)
    z = control.tf([1.0, 0.0], [1.0], ta)
    modes = [
        control.tf([now, before], [1.0, -pole], ta)
        for pole, now, before in zip(plant.poles, plant.now, plant.before, strict=True)
    ]
    shift = control.tf([1.0], np.append(1.0, np.zeros(plant.delay + 1)), ta)
    parts = control.tf([1.0], [1.0], ta)
    if math.isfinite(design.integral_time_s):
        parts = parts + (ta / design.integral_time_s) * z / (z - 1.0)
    if design.derivative_time_s > 0.0:
        past = design.derivative_filter
        parts = parts + ((1.0 - past) * design.derivative_time_s / ta) * (z - 1.0) / (z - past)
    return sum(modes[1:], modes[0]) * shift * (design.gain_pct_per_degC * parts)


def control_margins(model: HeaterModel, design: PidDesign) -> Margins | None:
    """Return the margins by python-control: poles, frequency response and `stability_margins`.

    None if the dead time spans so many samples that the polynomials lose all digits. It does not treat a crossing at
    half the sampling frequency, where L is real, as a gain margin.
    """
    if sample_plant(model, design.sample_time_s).delay > _MOST_DELAY:
        return None
    import control

    loop = loop_transfer_function(model, design)
    omega = np.geomspace(1e-5, math.pi / design.sample_time_s, 4000)
    response = loop(np.exp(1j * omega * design.sample_time_s))
    gain, phase, *_ = control.stability_margins((np.abs(response), np.degrees(np.angle(response)), omega))
    closed = control.feedback(loop, 1)
    if float(np.max(np.abs(closed.poles()))) >= 1.0:
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

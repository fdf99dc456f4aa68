"""How fast this machine runs heatertune: the closed loop, a proof on samples, a fit."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from heatertune.codec import registered
from heatertune.log.values import Log
from heatertune.model.fit import fit
from heatertune.model.values import Fopdt
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.progress import Told
from heatertune.proof import Actuator, Drawing, Limits, Scenario, Spread, simulate
from heatertune.proof.samples import measure
from heatertune.units import check

__all__ = ["Loop", "Rates", "Speed", "speed"]

#: the loop that is timed: an ordinary heater, a PI every 1 s, PWM of 10 s, 3,000 s long
_HEATER: Final = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.3, ambient_degC=20.0)
_SCENARIO: Final = Scenario(setpoint_degC=50.0, duration_s=3000.0)
_PWM: Final = Actuator(pwm_period_s=10.0)
_ROWS: Final = (300, 100_000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """Times of the closed loop: of a scan [ns], and of the first samples [s], the compiler's start among them."""

    plain_ns_per_scan: float
    compiled_ns_per_scan: float
    first_samples_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Samples a second on one processor and on all."""

    one: float
    all: float


@registered("heatertune/bench/1")
@dataclass(frozen=True, slots=True, kw_only=True)
class Speed:
    """How long a scan of the closed loop, samples of a proof and a fit take here.

    Attributes:
        target: the controller.
        samples: how many were timed, of 3,000 s each.
        processors: how many "all" are.
        loop: one closed loop.
        samples_per_s: drawn, run and measured.
        fit_ms: rows of a log → time of its fit [ms].
    """

    target: str
    samples: int
    processors: int
    loop: Loop
    samples_per_s: Rates
    fit_ms: Mapping[str, float]


def speed(target: str, samples: int = 1000, *, progress: Told = str) -> Speed:
    """Return how fast this machine is.

    The compiled loop is timed as a proof on samples runs it: drawn, run and measured, on one processor and on all.

    Args:
        target: the controller.
        samples: how many, of 3,000 s each; at least 100, of which the compiler's start is no part.
        progress: called with a short message when a stage begins.

    Raises:
        UnknownName: no such target.
        OutOfRange: too few samples.
        NotRepresentable: a controller that cannot hold an ordinary PI, every second.
    """
    check("samples", samples, least=100)
    which = controller_for(target)
    design = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=1.0,
                       structure="pi", method="")
    words = which.encode(design, Scaling())
    scans = _SCENARIO.duration_s / which.timing(words).scan_s
    progress(f"{target}: the loop in plain Python")
    plain = _seconds(lambda: simulate(which, words, _HEATER, _SCENARIO, _PWM))
    drawing = Drawing.of(which, words, [_HEATER], _SCENARIO, Spread(heater=(0.1, 0.1, 0.2)), _PWM)
    workers = os.cpu_count() or 1
    progress(f"{target}: compiling the loop, where it is not kept")
    start = _seconds(lambda: measure(drawing, Limits(), max(100, math.ceil(60_000 / scans)), workers=1))
    progress(f"{target}: {samples} samples on one processor, then on {workers}")
    one, many = (_seconds(partial(measure, drawing, Limits(), samples, workers=share)) for share in (1, workers))
    progress("fitting logs, once unwatched")
    fit(_log(_ROWS[0]))
    fits = {str(rows): 1000.0 * _seconds(partial(fit, _log(rows))) for rows in _ROWS}
    return Speed(
        target=target, samples=samples, processors=workers,
        loop=Loop(plain_ns_per_scan=1e9 * plain / scans, compiled_ns_per_scan=1e9 * one / samples / scans,
                  first_samples_s=start),
        samples_per_s=Rates(one=samples / one, all=samples / many), fit_ms=fits)


def _seconds(task: Callable[[], object]) -> float:
    begun = time.perf_counter()
    task()
    return time.perf_counter() - begun


def _log(rows: int) -> Log:
    """Return a step of 60 % at 300 s and its answer over 3,000 s, with white noise of 0.1 °C."""
    at = np.linspace(0.0, 3000.0, rows)
    since = np.maximum(at - 300.0 - _HEATER.dead_time_s, 0.0)
    rise = _HEATER.gain_degC_per_pct * 60.0 * -np.expm1(-since / _HEATER.time_constant_s)
    noise = np.random.default_rng(1).normal(0.0, 0.1, rows)
    return Log(name=f"{rows} rows", source="made", time_s=at, temperature_degC=20.0 + rise + noise,
               power_pct=np.where(at < 300.0, 0.0, 60.0))

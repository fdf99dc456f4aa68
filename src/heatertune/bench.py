"""How fast this machine runs heatertune: the closed loop, a proof on samples, a fit; yardsticks beside them."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import Final

import numpy as np

from heatertune.codec import register_schema
from heatertune.compiled import decide
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Controller, Scaling, Words, controller_for
from heatertune.plc.open_points import settings_of
from heatertune.processors import ProgressCallback, processors
from heatertune.proof import Actuator, LoopLimits, SampleRequest, SampleSpread, Scenario, simulate
from heatertune.proof.monte_carlo.draw import measure
from heatertune.units import check

__all__ = ["Loop", "Rates", "Throughput", "Times", "Yardsticks", "speed"]

#: the loop that is timed: an ordinary heater, a PI every 1 s, PWM of 10 s, 3,000 s long
_HEATER: Final = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.3, ambient_degC=20.0)
_SCENARIO: Final = Scenario(setpoint_degC=50.0, duration_s=3000.0)
_PWM: Final = Actuator(pwm_period_s=10.0)
_DESIGN: Final = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=1.0,
                           structure="pi", method="")
_ROWS: Final = (300, 100_000)
_SCANS: Final = 3000  # of the loop in plain Python
_VALUES: Final = 100_000  # that lfilter takes


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """The least, the median and the most of some runs."""

    least: float
    median: float
    most: float

    @classmethod
    def of(cls, runs: Sequence[float], unit: float = 1.0) -> Times:
        """Return those of some runs, each divided by the unit."""
        values = [run / unit for run in runs]
        return cls(least=min(values), median=median(values), most=max(values))


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """Times of the closed loop: of a scan [ns], and of the first samples [s], the compiler's start among them."""

    plain_ns_per_scan: Times
    compiled_ns_per_scan: Times
    first_samples_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Yardsticks:
    """What others take on this machine in the same minutes [ns].

    Attributes:
        python_ns_per_scan: of a PI in plain Python, the heater moved exactly once a scan: no words, no PWM.
        lfilter_ns_per_value: of SciPy's lfilter, a filter of first order: compiled code that is not heatertune's.
    """

    python_ns_per_scan: Times
    lfilter_ns_per_value: Times


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Samples a second on one processor and on all."""

    single_processor: Times
    all: Times


@register_schema("heatertune/bench/3")
@dataclass(frozen=True, slots=True, kw_only=True)
class Throughput:
    """How long a scan of the closed loop, samples of a proof and a fit take here, beside yardsticks.

    All of it runs once unwatched, then in turns: what disturbs the machine disturbs each alike.

    Attributes:
        target: the controller.
        samples: how many were timed, of 3,000 s each.
        rounds: how many runs of each are behind its three numbers.
        processors: how many "all" are.
        loop: one closed loop.
        yardsticks: what others take.
        samples_per_s: drawn, run and measured.
        fit_ms: rows of a log → time of its fit [ms].
    """

    target: str
    samples: int
    rounds: int
    processors: int
    loop: Loop
    yardsticks: Yardsticks
    samples_per_s: Rates
    fit_ms: Mapping[str, Times]


def speed(target: str, samples: int = 1000, *, rounds: int = 7, progress: ProgressCallback = str) -> Throughput:
    """Return how fast this machine is.

    The compiled loop is timed as a proof on samples runs it: drawn, run and measured, on one processor and on all.

    Args:
        target: the controller.
        samples: how many, of 3,000 s each; at least 100, of which the compiler's start is no part.
        rounds: how many runs of each.
        progress: called with a short message when a stage begins.

    Raises:
        UnknownName: no such target.
        OutOfRange: too few samples or rounds.
        NotRepresentable: a controller that cannot hold an ordinary PI, every second.
    """
    check("samples", samples, least=100)
    check("rounds", rounds, least=1)
    which = controller_for(target)
    words = which.encode(_DESIGN, Scaling())
    scans = _SCENARIO.duration_s / which.timing(words).scan_s
    drawing = SampleRequest.of(which, words, [_HEATER], _SCENARIO, SampleSpread(heater=(0.1, 0.1, 0.2)), _PWM,
                         settings_of(which.switches, {}))
    workers = processors()
    progress(f"{target}: compiling the loop, where it is not kept")
    start = _seconds(lambda: measure(drawing, LoopLimits(), max(100, math.ceil(60_000 / scans)), workers=1))
    tasks: dict[str, Callable[[], object]] = {
        "plain": lambda: _plainly(which, words), "python": _python, "lfilter": _lfilter(),
        "one": partial(measure, drawing, LoopLimits(), samples, workers=1),
        "all": partial(measure, drawing, LoopLimits(), samples, workers=workers),
        **{str(rows): partial(fit, _log(rows)) for rows in _ROWS},
    }
    runs = _in_turns(tasks, rounds, progress)
    return Throughput(
        target=target, samples=samples, rounds=rounds, processors=workers,
        loop=Loop(plain_ns_per_scan=Times.of(runs["plain"], 1e-9 * scans),
                  compiled_ns_per_scan=Times.of(runs["one"], 1e-9 * samples * scans), first_samples_s=start),
        yardsticks=Yardsticks(python_ns_per_scan=Times.of(runs["python"], 1e-9 * _SCANS),
                              lfilter_ns_per_value=Times.of(runs["lfilter"], 1e-9 * _VALUES)),
        samples_per_s=Rates(single_processor=Times.of([samples / run for run in runs["one"]]),
                            all=Times.of([samples / run for run in runs["all"]])),
        fit_ms={str(rows): Times.of(runs[str(rows)], 1e-3) for rows in _ROWS})


def _in_turns(tasks: Mapping[str, Callable[[], object]], rounds: int, progress: ProgressCallback) -> dict[str,
                                                                                                          list[float]]:
    """Return the seconds of each task's runs, each task once a round, after one that does not count."""
    runs: dict[str, list[float]] = {name: [] for name in tasks}
    for each in range(rounds + 1):
        progress(f"round {each} of {rounds}: loop, samples, fits and yardsticks in turn" if each else "once unwatched")
        for name, task in tasks.items():
            runs[name].append(_seconds(task))
    return {name: seconds[1:] for name, seconds in runs.items()}


def _seconds(task: Callable[[], object]) -> float:
    start_s = time.perf_counter()
    task()
    return time.perf_counter() - start_s


def _plainly(which: Controller, words: Words) -> None:
    """Run the loop in plain Python."""
    before = decide(False)
    try:
        simulate(which, words, _HEATER, _SCENARIO, _PWM)
    finally:
        decide(before)


def _python() -> float:
    """Run a PI on the heater in plain Python; return the sum of |e| at the scans [°C]."""
    heater, setpoint = _HEATER, _SCENARIO.setpoint_degC
    ambient, decay = heater.ambient_degC or 0.0, math.exp(-1.0 / heater.time_constant_s)
    kp, ki = _DESIGN.gain_pct_per_degC, _DESIGN.gain_pct_per_degC / _DESIGN.integral_time_s
    y, integral, total = ambient, 0.0, 0.0
    late = deque([0.0] * round(heater.dead_time_s))
    for _ in range(_SCANS):
        e = setpoint - y
        total += abs(e)
        integral = min(max(integral + ki * e, 0.0), 100.0)
        late.append(min(max(kp * e + integral, 0.0), 100.0))
        target = ambient + heater.gain_degC_per_pct * late.popleft()
        y = target + (y - target) * decay
    return total


def _lfilter() -> Callable[[], object]:
    from scipy.signal import lfilter

    values = np.random.default_rng(1).normal(size=_VALUES)
    return lambda: lfilter([0.0, 0.01], [1.0, -0.99], values)


def _log(rows: int) -> Log:
    """Return a step of 60 % at 300 s and its answer over 3,000 s, with white noise of 0.1 °C."""
    at = np.linspace(0.0, 3000.0, rows)
    since = np.maximum(at - 300.0 - _HEATER.dead_time_s, 0.0)
    rise = _HEATER.gain_degC_per_pct * 60.0 * -np.expm1(-since / _HEATER.time_constant_s)
    noise = np.random.default_rng(1).normal(0.0, 0.1, rows)
    return Log(name=f"{rows} rows", source="made", time_s=at, temperature_degC=20.0 + rise + noise,
               power_pct=np.where(at < 300.0, 0.0, 60.0))

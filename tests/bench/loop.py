"""The closed loop beside what else computes it; run as a program, it only reports.

    python tests/bench/loop.py [--slow] [ROOM …]

First every rival and the loop of the proof run the same heater, PI and PWM (`yardsticks.Case`) and must find the same
sum of |e|. Then their times stand beside those of rooms, in nanoseconds of processor time per scan of 1 s: alone,
measured as a sample is, and on all processors; with them how the cost grows with the horizon, the PWM's resolution and
the number of samples. Heaters that are drawn and ordered as samples run one after the other and side by side, which must
find the same. `--slow` also runs the rivals that take seconds to minutes.
"""

import argparse
import gc
import os
import tempfile
import time
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import starmap
from typing import NamedTuple

import numpy as np
import yardsticks

from heatertune.compiled import dispatch
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.core import StepFunctions
from heatertune.plc.open_points import settings_of
from heatertune.proof import Actuator, LoopLimits, SampleRequest, SampleSpread, Scenario, TemperatureStep
from heatertune.proof.kernel import LOAD, LoopBatch, SetpointProgram, TraceArrays
from heatertune.proof.lanes import choice
from heatertune.proof.lanes.choice import order_by_edges, run_side_by_side
from heatertune.proof.loop import LoopController, in_loop, pulses_of, ring_size, run_compiled, run_plainly
from heatertune.proof.meter import COLUMNS, TOTALS, Meter, no_meter
from heatertune.proof.monte_carlo.draw import measure

CASE = yardsticks.Case()
PWM = Actuator(pwm_period_s=yardsticks.PERIOD_S, resolution_s=yardsticks.RESOLUTION_S)
LOOPS = 32
DESIGN = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                   method="")
SCENARIO = Scenario(setpoint_degC=40.0, duration_s=3000.0, disturbances=(TemperatureStep(time_s=1620.0, temperature_degC=-8.8),))
HEATER = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.3, ambient_degC=20.0)


class Gains(NamedTuple):
    """Of the benchmark's PI."""

    kp: float
    ki: float


def pi_step(gains, total, setpoint, reading, _begins):
    """Compute as `yardsticks.Pi`."""
    e = setpoint - reading
    total = min(max(total + gains.ki * e, 0.0), 100.0)
    return total, min(max(gains.kp * e + total, 0.0), 100.0), e, 0


def as_it_is(_sensor, temperature):
    """Read without a sensor."""
    return temperature


@dataclass(frozen=True)
class Ours:
    """A controller in the loop of the proof."""

    controller: LoopController

    @classmethod
    def pi(cls):
        """Return the benchmark's PI."""
        core = StepFunctions(step=pi_step, measure=as_it_is, flags=())
        return cls(LoopController(core=core, parameters=Gains(CASE.kp, CASE.kp / CASE.ti), state=0.0, sensor=0.0, setpoints=[CASE.setpoint],
                          scan_s=yardsticks.CALL_S, ramp_step=0.0))

    @classmethod
    def of(cls, target):
        """Return a room that holds the words of the same PI."""
        which = controller_for(target)
        words = which.encode(DESIGN, Scaling())
        return cls(in_loop(which, words, [CASE.setpoint], {each.name: each.default for each in which.switches}, direct=True))

    def given(self, *, calls=CASE.calls, resolution=yardsticks.RESOLUTION_S, loops=LOOPS, keeps=False, measures=False):
        """Return `run_all`'s arguments for heaters that differ a little in their dead time."""
        pwm = Actuator(pwm_period_s=yardsticks.PERIOD_S, resolution_s=resolution)
        zero = np.zeros((1, 1))
        plants = np.array([[CASE.gain, CASE.lag, 0.0, CASE.dead + 0.01 * i, 0.0, CASE.start] for i in range(loops)])
        batch = LoopBatch(calls, zero, zero.copy(), plants, np.full((loops, 1), np.inf), np.full((loops, 1), LOAD),
                      np.zeros((loops, 1)))
        places = [np.empty(calls if keeps else 0) for _ in range(4)]
        record = TraceArrays(keeps, *places, np.zeros(calls if keeps else 0, dtype=np.int64),
                        *(np.empty(calls if keeps else 0) for _ in range(4)))
        meter = no_meter(loops)
        if measures:
            ends = np.empty((loops, 1)), np.empty((loops, 1))
            phases, totals = np.zeros((loops, COLUMNS)), np.zeros((loops, TOTALS))
            meter = Meter(True, np.array([CASE.setpoint]), 1.0, yardsticks.PERIOD_S, 0, phases, totals, *ends)
        edges = np.empty(ring_size(pulses_of(CASE.dead + 15.0, pwm)))
        c, asked = self.controller, np.array(self.controller.setpoints)
        program = SetpointProgram(asked, np.ones(1, dtype=np.int64), c.ramp_step, c.ramp_calls, c.ramp_hold)
        return c.parameters, c.state, c.sensor, c.scan_s, program, batch, pwm.switches, np.inf, edges, record, meter

    def drawn(self, loops=4 * LOOPS):
        """Return `given` for drawn heaters: gain and lag by 10 %, dead time by 20 %, mains even within ±10 %."""
        chance, (*given, meter) = np.random.default_rng(1), self.given(loops=loops, measures=True)
        gain, lag, dead = np.exp([[0.1], [0.1], [0.2]] * chance.standard_normal((3, loops)))
        plants = given[5].plants * np.column_stack([gain * (1.0 + 0.1 * chance.uniform(-1.0, 1.0, loops)) ** 2, lag, np.ones(loops), dead,
                                                    np.ones((loops, 2))])
        given[5] = given[5]._replace(plants=plants[order_by_edges(plants, CASE.setpoint, yardsticks.PERIOD_S)])
        given[8] = np.empty(ring_size(pulses_of(plants[:, 3].max() + 15.0, PWM)))
        return *given, meter

    def both_ways(self):
        """Return nanoseconds per scan of drawn heaters, one after the other and side by side, in turn."""
        alone, together = self.drawn(), self.drawn()
        ways = (lambda: run_compiled(self.controller.core, alone),
                lambda: run_side_by_side(self.controller, together[4], together[5], PWM, together[-1]))
        for way in ways:
            way()
        assert np.array_equal(alone[-1].phases, together[-1].phases)
        assert np.array_equal(alone[-1].totals, together[-1].totals)
        times = [[elapsed(way) for way in ways] for _ in range(15)]
        return np.min(times, axis=0) / len(alone[5].plants) / CASE.calls

    def absolute(self, run):
        """Return the sum of |e| at the calls."""
        given = self.given(loops=1, keeps=True)
        run(self.controller.core, given)
        return float(np.sum(np.abs(CASE.setpoint - given[-2].temperature)))

    def ns(self, **shape):
        """Return nanoseconds per scan, compiled."""
        given = self.given(**shape)
        return least(lambda: run_compiled(self.controller.core, given)) / LOOPS / shape.get("calls", CASE.calls)

    def plain_ns(self):
        """Return the same in plain Python."""
        given = self.given(loops=1)
        return least(lambda: run_plainly(self.controller.core, given), 2) / CASE.calls


def least(task, repeats=9, clock=time.process_time):
    """Return the least time of some runs [ns]; the first one, which may compile, does not count."""
    task()
    best = np.inf
    for _ in range(repeats):
        begun = clock()
        task()
        best = min(best, clock() - begun)
    return 1e9 * best


def elapsed(task):
    """Return the processor time of a task in this thread [ns]."""
    begun = time.thread_time()
    task()
    return 1e9 * (time.thread_time() - begun)


def rivals(c, slow):
    """Return name → (sum of |e|, ns per scan) of what others have."""
    cases = [CASE] * yardsticks.LANES
    found = {
        "C, scalar": (c.scalar(CASE), least(lambda: [c.scalar(CASE) for _ in range(LOOPS)]) / LOOPS),
        "C, 16 lanes": (c.lanes(cases)[0], least(lambda: c.lanes(cases)) / yardsticks.LANES),
    }
    ways = [(yardsticks.plain_python, 3), (yardsticks.simple_pid, 1)]
    ways += [(yardsticks.control_discrete, 1), (yardsticks.solve_ivp, 1), (yardsticks.control_with_pwm, 1)] if slow else []
    for way, repeats in ways:
        begun = time.process_time()
        total = way(CASE)
        once = 1e9 * (time.process_time() - begun)
        found[way.__name__] = total, once if repeats == 1 else least(lambda way=way: way(CASE), repeats)
    return {name: (total, ns / CASE.calls) for name, (total, ns) in found.items()}


def check(others):
    """Hold the sums against each other before any time is told; raise AssertionError where they differ."""
    own = Ours.pi()
    sums = {name: total for name, (total, _) in others.items() if name != "control_discrete"}  # which has no PWM
    sums |= {"ours, plain": own.absolute(run_plainly), "ours, compiled": own.absolute(run_compiled)}
    assert sums["ours, plain"] == sums["ours, compiled"], sums
    reference = sums["C, scalar"]
    assert all(abs(each / reference - 1.0) < 1e-6 for each in sums.values()), sums
    print(f"sum of |e|: {reference:.6f} °C, by all ways the same within 1e-6\n")


def samples(target, count, workers):
    """Return seconds of wall clock that many samples take, drawn, run and measured, side by side where they fit."""
    which = controller_for(target)
    drawing = SampleRequest.of(which, which.encode(DESIGN, Scaling()), [HEATER], SCENARIO, SampleSpread(heater=(0.1, 0.1, 0.2)),
                         Actuator(pwm_period_s=10.0), settings_of(which.switches, {}))
    return least(lambda: measure(drawing, LoopLimits(), count, workers=workers), 2, time.perf_counter) / 1e9


def memory(target):
    """Return the largest memory in use by Python and NumPy while 1,000 and 20,000 samples run [MB], results included."""
    peaks = []
    for count in (1000, 20_000):
        gc.collect()
        tracemalloc.start()
        measured = samples_once(target, count)
        peaks.append((tracemalloc.get_traced_memory()[1] / 1e6, measured / 1e6))
        tracemalloc.stop()
    return peaks


def samples_once(target, count):
    """Run samples and return the bytes of what they leave."""
    which = controller_for(target)
    drawing = SampleRequest.of(which, which.encode(DESIGN, Scaling()), [HEATER], SCENARIO, SampleSpread(), Actuator(pwm_period_s=10.0),
                         settings_of(which.switches, {}))
    found = measure(drawing, LoopLimits(), count)
    return sum(each.nbytes for each in (found.rows, found.table, found.totals, found.ripple))


def threads(own, count):
    """Return the share of `count` threads' time that is not lost: 1 where n threads do n times the work of one."""
    given = [own.given(loops=4 * LOOPS, measures=True) for _ in range(count)]

    def together(work):
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(lambda each: run_compiled(own.controller.core, each), work))

    one = least(lambda: together(given[:1]), 5, time.perf_counter)
    return one / least(lambda: together(given), 5, time.perf_counter)


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slow", action="store_true")
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("rooms", nargs="*", default=["weg", "s5-ob251"])
    settings = parser.parse_args()
    dispatch._PLAIN_SCANS = -1
    choice._MOST = choice._MOST_KEPT = 0  # as where machine code is kept: all samples that fit run side by side
    with tempfile.TemporaryDirectory() as folder:
        others = rivals(yardsticks.Compiled(folder), settings.slow)
    check(others)
    unit, all_ours = others["C, scalar"][1], {"the same PI": Ours.pi()} | {name: Ours.of(name) for name in settings.rooms}
    rows = [(name, ns) for name, (_, ns) in others.items()]
    for name, own in all_ours.items():
        rows += [(f"{name}: plain", own.plain_ns()), (f"{name}: compiled", own.ns()),
                 (f"{name}: compiled and measured", own.ns(measures=True))]
    print("| closed loop | ns per scan | times C |\n| --- | --- | --- |")
    print("\n".join(starmap("| {0} | {1:.3g} | {2:.3g} |".format, ((name, ns, ns / unit) for name, ns in rows))))
    print("\n| ns per scan, measured, drawn heaters | one after the other | side by side | times |\n" + "| --- " * 4 + "|")
    for name, own in all_ours.items():
        alone, together = own.both_ways()
        print(f"| {name} | {alone:.3g} | {together:.3g} | {alone / together:.2f} |")
    print("\n| ns per scan, measured | 1500 s | 3000 s | 6000 s | PWM in 0.1 s | 0.01 s | 0.001 s |\n" + "| --- " * 7 + "|")
    for name, own in all_ours.items():
        horizons = [own.ns(calls=calls, measures=True) for calls in (1500, 3000, 6000)]
        steps = [own.ns(resolution=step, measures=True) for step in (0.1, 0.01, 0.001)]
        print(f"| {name} | " + " | ".join(f"{ns:.3g}" for ns in horizons + steps) + " |")
    cores = len(os.sched_getaffinity(0))
    print(f"\n| {settings.samples} samples of 3000 s | 1 thread | {cores} threads | efficiency of the loop alone | peak MB "
          "(results) of 1,000 | of 20,000 |\n" + "| --- " * 6 + "|")
    for name in settings.rooms:
        times = [samples(name, settings.samples, workers) for workers in (1, cores)]
        peaks = " | ".join(f"{peak:.3g} ({kept:.3g})" for peak, kept in memory(name))
        print(f"| {name} | {times[0]:.3g} s | {times[1]:.3g} s | {threads(all_ours[name], cores):.2f} | {peaks} |")


if __name__ == "__main__":
    os.environ["HEATERTUNE_CACHE"] = ""  # what is kept on disk would not notice a change of the PI here
    main()

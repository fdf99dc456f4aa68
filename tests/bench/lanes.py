"""Loops side by side against the same loops one after the other: the same bits, and the time of each; run as a program.

    python tests/bench/lanes.py                    times, beside C's
    python tests/bench/lanes.py --attack 2000      so many drawn cases, bit for bit; exit status 1 where one differs

A case of the attack is a room, a design, a switch, a setpoint ramp, a story with whatever can happen, noise, and 1 to 70
heaters drawn around one of one lag or of two. Times are processor time of drawn heaters ordered as samples are, in the
whole story of a default proof and in one without events, each way and C in turn; then 10,000 samples of 3,000 s.
"""

import argparse
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.compiled import dispatch
from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.open_points import settings_of
from heatertune.proof import (
    Actuator,
    Load,
    LoopLimits,
    Mains,
    NewSetpoint,
    SampleRequest,
    SampleSpread,
    Scenario,
    TemperatureStep,
)
from heatertune.proof.lanes import choice
from heatertune.proof.loop import scans_of
from heatertune.proof.monte_carlo.draw import measure
from heatertune.proof.runs import measure_runs
from heatertune.proof.scenario import PlcPower
from tests.proof.test_lanes import ROOMS, default_drawing

PERIODS = (0.5, 1.0, 3.0, 7.3, 10.0, 21.0)
FOUND = ("table", "totals", "ripple")


def both(drawing, places, limits=None):
    """Return the two ways to run samples of the first setting, as functions."""
    rows, sizes = drawing.heaters_of(places)
    order = choice.order_by_edges(rows, drawing.scenario.setpoint_degC, drawing.actuator.pwm_period_s)
    noise, late = drawing.scans_of([places[place] for place in order], scans_of(drawing.controllers[0], drawing.scenario))
    given = drawing.controllers[0], rows[order], drawing.scenario, drawing.actuator, limits or LoopLimits(), noise, late, sizes[order]
    return [lambda way=way: measure_runs(*given, side_by_side=way) for way in (False, True)]


def differs(ways):
    """Return which numbers of both ways differ in a bit."""
    one, other = (way() for way in ways)
    return [name for name in FOUND if not np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)]


def story(chance, setpoint, duration):
    """Return drawn events in order of time: on whole scans and between them, close together and far apart."""
    times = np.sort(chance.uniform(0.02, 0.98, chance.integers(0, 9))) * duration
    times, on, events = np.unique(np.where(chance.random(len(times)) < 0.5, np.round(times), times)), True, []
    for when in times[times > 0.0].tolist():
        if not on or chance.random() < 0.3:
            on = not on
            events.append(PlcPower(time_s=when, on=on))
            continue
        kind = chance.integers(4)
        if kind == 0:
            events.append(TemperatureStep(time_s=when, temperature_degC=chance.normal(0.0, 8.0)))
        elif kind == 1:
            events.append(Load(time_s=when, power_pct=chance.normal(0.0, 10.0)))
        elif kind == 2:
            events.append(Mains(time_s=when, share=chance.choice([0.0, 0.9, 1.0, 1.1])))
        else:
            events.append(NewSetpoint(time_s=when, setpoint_degC=setpoint + chance.normal(0.0, 5.0)))
    return tuple(events)


def drawn(chance, room):
    """Return a case: the drawing, and the seeds of its samples."""
    which, lag = controller_for(room), float(chance.uniform(5.0, 400.0))
    known = {"gain_degC_per_pct": float(chance.uniform(0.3, 2.0)), "time_constant_s": lag, "ambient_degC": 20.0,
             "dead_time_s": float(chance.choice([0.0, chance.uniform(0.0, 0.3 * lag)]))}
    two = chance.random() < 0.5
    heater = TwoLag(**known, second_time_constant_s=lag * float(chance.choice([1.0, 0.999999, chance.uniform(0.01, 1.0)]))) if two else Fopdt(**known)
    sample = which.timer.round(float(chance.choice([0.5, 1.0, 2.0, 5.0])))
    design = PidDesign(gain_pct_per_degC=float(chance.uniform(0.3, 8.0)), integral_time_s=sample * int(chance.integers(5, 200)),
                       derivative_time_s=sample * int(chance.integers(0, 4)), sample_time_s=sample, structure="pid", method="")
    words = which.encode(design, Scaling())
    if chance.random() < 0.3:
        words = replace(words, ramp=which.ramp(words, float(chance.uniform(1.0, 30.0)), float(chance.choice([0.5, 3.0]))))
    setpoint, period = 20.0 + float(chance.uniform(0.2, 0.9)) * min(100.0 * known["gain_degC_per_pct"], 75.0), float(chance.choice(PERIODS))
    shortest = float(chance.choice([0.0, 0.05 * period]))
    switch = Actuator(pwm_period_s=period, resolution_s=float(chance.choice([0.01, 0.1, period / 50.0])), minimum_on_s=shortest,
                      minimum_off_s=shortest, minimum_rule=str(chance.choice(["drop", "carry"])))
    duration = float(chance.uniform(100.0, 1500.0))
    scenario = Scenario(setpoint_degC=setpoint, duration_s=duration, noise_degC=float(chance.choice([0.0, 0.05, 1.0])),
                        disturbances=story(chance, setpoint, duration))
    settings = settings_of(which.switches, {})
    spread = SampleSpread(heater=(0.1, 0.1, float(chance.choice([0.0, 0.2 * known["dead_time_s"], 3.0]))))
    begin = int(chance.integers(10**6))
    return SampleRequest.of(which, words, [heater], scenario, spread, switch, settings), range(begin, begin + int(chance.choice([chance.integers(1, 17), chance.integers(17, 71)])))


def attack(cases, rooms, seed):
    """Run drawn cases both ways; return how many differed."""
    chance, wrong, ran, refused, begun = np.random.default_rng(seed), 0, 0, 0, time.process_time()
    while ran < cases:
        number, room = int(chance.integers(2**32)), str(chance.choice(rooms))
        try:
            drawing, seeds = drawn(np.random.default_rng(number), room)
        except HeatertuneError:  # words that a room cannot hold, a setpoint out of its range
            refused += 1
            continue
        found = differs(both(drawing, seeds))
        ran, wrong = ran + 1, wrong + bool(found)
        if found:
            print(f"DIFFERS {room} case {number}: {', '.join(found)}", flush=True)
        if ran % 200 == 0:
            print(f"{ran} cases, {wrong} differ, {refused} refused, {time.process_time() - begun:.0f} s", flush=True)
    print(f"{ran} cases, {wrong} differ, {refused} refused before they ran, {time.process_time() - begun:.0f} s")
    return wrong


def spent(work, clock=time.thread_time):
    """Return the time of some work [s]."""
    begun = clock()
    work()
    return clock() - begun


def interleaved(name, drawing, yardstick, repeats=9):
    """Print nanoseconds a scan of 64 samples from the middle of 512, each way and C in turn."""
    order = choice.order_by_edges(drawing.heaters_of(range(512))[0], drawing.scenario.setpoint_degC, drawing.actuator.pwm_period_s)
    ways = both(drawing, order[224:288].tolist())
    assert not differs(ways), name
    times = np.min([[spent(work) for work in (*ways, yardstick)] for _ in range(repeats)], axis=0)
    scans = 64 * scans_of(drawing.controllers[0], drawing.scenario)
    alone, beside, c = 1e9 * times / [scans, scans, 32 * 3000]
    print(f"| {name} | {alone:.1f} | {beside:.1f} | {alone / beside:.2f} | {c:.2f} | {beside / c:.2f} |", flush=True)


def timed(rooms):
    """Print the tables."""
    import loop  # noqa: PLC0415 - needs simple-pid and a C compiler
    import yardsticks  # noqa: PLC0415 - likewise

    with tempfile.TemporaryDirectory() as folder:
        c = yardsticks.Compiled(folder)

    def yardstick():
        for _ in range(32):
            c.scalar(yardsticks.Case())

    print("| ns of processor time a scan, judged | one after the other | side by side | times | C | times C |\n" + "| --- " * 6 + "|")
    for room in rooms:
        which = controller_for(room)
        plain = SampleRequest.of(which, which.encode(loop.DESIGN, Scaling()), [loop.HEATER], loop.SCENARIO, SampleSpread(heater=(0.1, 0.1, 2.8)), loop.PWM)
        whole = default_drawing(room)
        interleaved(f"{room}, one disturbance, scans of 1 s", plain, yardstick)
        for lags, heater in zip(("one lag", "two lags"), whole.heaters, strict=True):
            interleaved(f"{room}, whole story, {lags}", replace(whole, heaters=[heater]), yardstick)
    print("\n| 10,000 samples of 3,000 s | noise | threads | processor time | wall |\n" + "| --- " * 5 + "|")
    choice._MOST = choice._MOST_KEPT = 0
    for room in rooms:
        which = controller_for(room)
        for noise in (0.0, 0.1):
            drawing = SampleRequest.of(which, which.encode(loop.DESIGN, Scaling()), [loop.HEATER], replace(loop.SCENARIO, noise_degC=noise),
                                 SampleSpread(heater=(0.1, 0.1, 2.8)), loop.PWM, settings_of(which.switches, {}))
            measure(drawing, LoopLimits(), 400)
            for workers in (1, len(os.sched_getaffinity(0))):
                best = min(spent(lambda w=workers, d=drawing: measure(d, LoopLimits(), 10_000, workers=w), time.perf_counter) for _ in range(5))
                cpu = spent(lambda w=workers, d=drawing: measure(d, LoopLimits(), 10_000, workers=w), time.process_time)
                print(f"| {room} | {noise:g} °C | {workers} | {cpu:.2f} s | {best:.2f} s |", flush=True)


def main(arguments=None):
    """Print the times, or attack."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--attack", type=int, default=0, metavar="CASES")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("rooms", nargs="*", help="default: WEG and OB251; of the attack, all that run side by side")
    settings = parser.parse_args(arguments)
    dispatch.decide(True)
    if settings.attack:
        return min(attack(settings.attack, settings.rooms or ROOMS, settings.seed), 1)
    timed(settings.rooms or ["weg", "s5-ob251"])
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    raise SystemExit(main())

"""How long a scan of the compiled closed loop takes, and a proof of 10,000 samples; run as a program, it only reports.

    python tests/bench/loop.py [TARGET …]
"""

import os
import sys
import time

import numpy as np

from heatertune import compiled
from heatertune.model.values import Fopdt
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, room
from heatertune.proof import Actuator, Drawing, Kick, Limits, Scenario, Spread, prove_samples, simulate
from heatertune.proof.samples import measure

HEATER = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.3, ambient_degC=24.0)
DESIGN = PidDesign(gain_pct_per_degC=3.0, integral_time_s=150.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                   method="")
SCENARIO = Scenario(setpoint_degC=53.3, duration_s=3000.0, disturbances=(Kick(time_s=1620.0, temperature_degC=-8.8),))
PWM = Actuator(pwm_period_s=10.0)
SAMPLES = 10_000


def _timed(task, clock=time.perf_counter):
    begin = clock()
    task()
    return clock() - begin


def _report(target):
    which = room(target)
    words = which.encode(DESIGN, Scaling())
    scans = SCENARIO.duration_s / which.timing(words).scan_s
    drawing = Drawing.of(which, words, [HEATER], SCENARIO, Spread(heater=(0.1, 0.1, 0.2)), PWM)
    compiled._PLAIN_SCANS = 10**12
    plain = _timed(lambda: simulate(which, words, HEATER, SCENARIO, PWM))
    compiled._PLAIN_SCANS = -1
    first = _timed(lambda: measure(drawing, Limits(), 1, workers=1))
    one = min(_timed(lambda: measure(drawing, Limits(), 320, workers=1), time.process_time) for _ in range(5)) / 320
    workers = len(os.sched_getaffinity(0))
    many = min(_timed(lambda: prove_samples(drawing, Limits(), SAMPLES)) for _ in range(3))
    processor = _timed(lambda: prove_samples(drawing, Limits(), SAMPLES), time.process_time)
    print(f"{target}: plain {1e9 * plain / scans:.0f} ns per scan; first compiled call {first:.2f} s; drawn, run and "
          f"measured {1e9 * one / scans:.1f} ns per scan (processor time); {SAMPLES} samples: {many:.2f} s on {workers} "
          f"cores, {processor:.2f} s of processor time")


if __name__ == "__main__":
    np.seterr(all="raise")
    for name in sys.argv[1:] or ("weg", "s5-ob251", "s7-200", "on-off"):
        _report(name)

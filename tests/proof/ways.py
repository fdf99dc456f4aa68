"""One loop in both ways: compiled, and as plain Python."""

import numpy as np

from heatertune.compiled import decide
from heatertune.proof.loop import in_loop, run_loop

NAMES = ("temperature_degC", "reading_degC", "followed_degC", "power_asked_pct", "edge_time_s", "stretches")


def assert_same_compiled_and_plain(controller, words, model, scenario, actuator):
    traces = []
    try:
        for way in (True, False):
            decide(way)
            loop = in_loop(controller, words, scenario.setpoints_degC, {}, direct=True)
            traces.append(run_loop(loop, model, scenario, actuator))
    finally:
        decide(None)
    for name in NAMES:
        assert np.array_equal(getattr(traces[0], name), getattr(traces[1], name)), name

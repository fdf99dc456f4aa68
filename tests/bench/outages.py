"""Does a PASS hold when the circuit is open for longer or shorter than in the proof? python -m tests.bench.outages [HEATERS].

Heaters are drawn, designed for on targets whose I part may wind up, and each PASS is proven again with the open
circuits 0.25…10 times as long. Ends with status 1 where one breaks a limit that it kept. Found in this way: a boost that
took the heater back within the dead time, so that the proof never saw it nearly do so.
"""

import sys
from unittest import mock

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import Fopdt
from heatertune.proof import Mains, story
from heatertune.proof.closing import Asked, closed
from heatertune.proof.fitted import prove
from heatertune.settings import Conditions

TARGETS = ("weg", "arduino-pid", "esphome", "simple-pid", "pband", "s5-ob251")
TIMES = (0.25, 0.5, 0.75, 0.9, 1.1, 1.5, 3.0, 10.0)


def heater(seed):
    rng = np.random.default_rng([seed, 20261123])
    gain, lag, ambient = rng.uniform(0.5, 3.0), rng.uniform(60.0, 500.0), rng.uniform(15.0, 28.0)
    setpoint = ambient + rng.uniform(0.3, 0.6) * min(100.0 * gain, 90.0 - ambient)
    return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=rng.uniform(0.03, 0.3) * lag, ambient_degC=ambient), setpoint


def longer(times):
    """The story with its open circuits so many times as long."""
    plain = story._Teller._off
    return mock.patch.object(story._Teller, "_off", lambda self, event, seconds: plain(
        self, event, seconds * times if isinstance(event, Mains) else seconds))


def main(heaters=6):
    proven = broken = 0
    for seed in range(heaters):
        drawn, setpoint = heater(seed)
        fitted = model_by_hand(drawn)
        for target in TARGETS:
            try:
                design = closed(fitted, Asked(target=target, conditions=Conditions(setpoint_degC=setpoint)))
            except HeatertuneError as problem:
                print(f"{seed} {target}: {problem}")
                continue
            if design.proof.verdict != "PASS":
                continue
            proven += 1
            for times in TIMES:
                with longer(times):
                    proof = prove(design.proof.words, fitted, design.conditions)
                lost = {each.name: (round(each.value, 1), each.limit) for each in proof.criteria if not each.ok}
                broken += bool(lost)
                if lost:
                    print(f"{seed} {target} {design.proof.words.boost}, {times} times as long: {lost}", flush=True)
    print(f"{proven} PASS, each with {len(TIMES)} other lengths: {broken} break a limit")
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))

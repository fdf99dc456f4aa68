"""What a proof measures on random loops, against a plain integration of the same heater in steps of a millisecond.

    python tests/bench/measures.py --count 60

IAE, settling and recovery are of all loops that settle. Exit status 1 where one is apart by more than 0.1 %; a time by no
less than two steps of the integration, which it cannot tell apart.
"""

import argparse
import math
import random
import sys
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.proof import (
    Acceptance,
    Actuator,
    Coverage,
    Load,
    LoopLimits,
    Scenario,
    TemperatureStep,
    prove_models,
    simulate,
)
from heatertune.proof.scenario import delay_heater
from tests.proof.test_exact_measures import STEP_S, errors, stays
from tests.witness.trace_measures import judge

_SHARE = 1e-3


def loop(chance):
    """Return room, words, heater, scenario and switch, from fast and rippled to slow."""
    lag = math.exp(chance.uniform(math.log(8.0), math.log(300.0)))
    made = {"gain_degC_per_pct": chance.uniform(0.4, 2.0), "time_constant_s": lag, "dead_time_s": chance.uniform(0.02, 0.3) * lag,
            "ambient_degC": 20.0}
    heater = Fopdt(**made) if chance.random() < 0.5 else TwoLag(**made, second_time_constant_s=chance.uniform(0.05, 1.0) * lag)
    room, period = controller_for(chance.choice(list(TARGETS))), chance.choice([0.5, 1.0, 4.0])
    words = room.encode(PidDesign(
        gain_pct_per_degC=chance.uniform(0.2, 0.5) * lag / heater.dead_time_s / heater.gain_degC_per_pct, integral_time_s=lag,
        derivative_time_s=0.0, sample_time_s=round(max(0.5, heater.dead_time_s / 2.0), 1), structure="pi", method=""),
        Scaling(high_degC=300.0))
    jump, load, end = 12.0 * lag + chance.random(), 20.0 * lag + chance.random(), 30.0 * lag
    scenario = Scenario(setpoint_degC=20.0 + 100.0 * heater.gain_degC_per_pct * chance.uniform(0.2, 0.7), duration_s=end, disturbances=(
        TemperatureStep(time_s=jump, temperature_degC=-chance.uniform(2.0, 9.0)), Load(time_s=load, power_pct=-chance.uniform(3.0, 15.0))))
    return room, words, delay_heater(heater, room.delay_s), heater, scenario, Actuator(pwm_period_s=period * words.sample_time_s)


def apart(room, words, seen, heater, scenario, switch):
    """Return how far each measure is apart, as a share of what is allowed."""
    limits = LoopLimits(tolerance_degC=2.0)
    trace = simulate(room, words, seen, scenario, switch)
    (run,) = prove_models(room, words, [("heater", heater)], scenario, switch, Acceptance(limits=limits),
                          Coverage(open_points=False)).runs
    times, error = errors(trace, seen)
    stops = (0.0, *(event.time_s for event in scenario.disturbances), float(trace.time_s[-1]))
    band = max(2.0, 2.0 * trace.resolution_degC)
    settled, *recovered = (stays(times, error, begin, end, band) for begin, end in pairwise(stops))
    witness = {"iae": abs(error).sum() * STEP_S, "settling_time": settled}
    both = [{criterion.name: criterion.value for criterion in criteria} for criteria in (run.criteria, judge(trace, limits))]
    if math.isfinite(both[0]["recovery_time"]):
        lengths = [end - begin for begin, end in pairwise(stops[1:])]
        witness["recovery_time"] = max(zip(recovered, lengths, strict=True), key=lambda pair: pair[0] / pair[1])[0]
    return {name: max(abs(one[name] - value) / max(_SHARE * value, 0.0 if name == "iae" else 2.0 * STEP_S) for one in both)
            for name, value in witness.items() if math.isfinite(both[0][name])}


def main(arguments=None):
    """Print the worst of each measure; return 1 where one is apart by more than is allowed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="loops (default: 60)")
    parser.add_argument("--seed", type=int, default=1)
    settings = parser.parse_args(arguments)
    worst, judged = {}, 0
    for seed in range(settings.seed, settings.seed + settings.count):
        try:
            made = loop(random.Random(seed))
            shares = apart(*made)
        except (NotRepresentable, OutOfRange):
            continue
        judged += 1
        for name, share in shares.items():
            worst[name] = max(worst.get(name, (0.0, 0)), (share, seed))
    for name, (share, seed) in worst.items():
        print(f"{name:14} {100.0 * _SHARE * share:.2g} % apart at worst (seed {seed})")
    print(f"{judged} of {settings.count} loops")
    return int(not worst or max(share for share, _ in worst.values()) > 1.0)


if __name__ == "__main__":
    sys.exit(main())

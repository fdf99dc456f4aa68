"""Would a preload of the integral part be a cheaper way to PASS? `python tests/bench/preload.py fb41 --count 100`.

The heaters of passes.py, where the optimum as asked for fails and closing finds what passes. A program that holds the I part
at a share of the power that holds the setpoint, while the output is at its upper limit, lets the loop leave the limit with
it, however long it was there: in heat-up as after an open circuit. CONT_C has inputs for that (I_ITL_ON, I_ITLVAL). WEG's
block has none; of it this is what an input would be worth. What its program can do is not to enable the block ("cold") while
the P part alone is at the limit, and to give full power itself: the edge of EN then clears the I part, and costs a call.
The gains as asked for are proven with such a preload and the PWM that closing took, and so are closing's own gains
without its ramp and limit of the output.

Told for each heater: what closing took and when all has settled then; the share that passes and settles first. At the end: how
often a preload passes at all, and where it is cheaper: it settles earlier by a tenth at no more IAE.

Measured, seed 0 (no text run, no hysteresis, no noise). fb41, heaters 0 to 99: 41 fail as asked for, closing FAILs on none and
takes a ramp on none; a preload passes on 28 and is cheaper on 7, on 3 of them in place of gains or a limit of the output: not worth
its program. weg, heaters 0 to 59: all fail as asked for, closing takes a ramp on 42; a preload, had the block an input,
passes on 53 and is cheaper on 45 (settled after 0.59 of the time, median), "cold" passes on 23 and is cheaper on all (0.61).
That is built since, as a boost (`heatertune.plc.ramp`), with hysteresis and nearer distances, too; closing goes without here.
"""

import argparse
import os
from dataclasses import replace
from functools import cache

from heatertune.errors import HeatertuneError
from heatertune.model.model_values import model_by_hand
from heatertune.pid.sampled_loop import margins
from heatertune.plc import Scaling, controller_for
from heatertune.plc.core import ControllerState, StepFunctions
from heatertune.plc.fb41.controller import ContC
from heatertune.plc.fb41.step import call, outcome, restart, scale_reading
from heatertune.plc.fb41.words import parameters_of
from heatertune.plc.weg.controller import Weg
from heatertune.plc.weg.step import COLD, WegState, block_of
from heatertune.plc.weg.step import step as weg_step
from heatertune.proof import Acceptance, Coverage, prove_models, setpoint_ramp
from heatertune.proof.design_request import DesignRequest, plainly
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.prove_words import actuator_for, course_for, limits_of
from heatertune.proof.redesign import find_passing_design
from heatertune.proof.redesign.design_changes import more_iae
from heatertune.proof.specification import specification_of
from heatertune.settings import Conditions
from tests.bench.passes import _STEPS, case

SHARES = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)
COLD_UNTIL_P = -1.0  # in place of a share
_FULL = {"fb41": "LMN_HLM", "weg": "MaximumOutput"}
_EARLIER = 0.9  # times closing's settling time
_MORE_IAE = 0.005


def step_contc(parameters, state, setpoint, reading, _begins):
    """One call; at the upper limit the I part stands at its initial value."""
    plain, held, assume = parameters
    asked, _ = scale_reading(plain, setpoint)
    pv, os = scale_reading(plain, reading)
    return outcome(call(held if state.at_upper else plain, assume, state, asked, pv, os))


def step_weg(parameters, state, setpoint, reading, begins):
    """One call, likewise."""
    block, assume, power = parameters
    if power < 0.0:
        if setpoint - reading >= block.maximum / block.kp:
            waits = WegState(False, state.reference, state.error, state.integral, block.maximum, False, False)
            return waits, min(max(waits.output, 0.0), 100.0), waits.output, 1
    elif state.output >= block.maximum:
        state = WegState(state.enabled, state.reference, state.error, power, state.output, state.overflow, state.skips)
    return weg_step((block, assume), state, setpoint, reading, begins)


@cache
def preloaded(target, power):
    """Return a controller whose program holds the I part at a power while the output is at its upper limit [%]."""

    def begin_contc(_, words, assume):
        held = parameters_of(words.values)._replace(initial=power, i_itl_on=True)
        return ControllerState((held._replace(i_itl_on=False), held, assume), restart(held))

    def begin_weg(_, words, assume):
        return ControllerState((block_of(words.values, assume), assume, power), COLD)

    kind, step, begin = {"fb41": (ContC, step_contc, begin_contc), "weg": (Weg, step_weg, begin_weg)}[target]
    core = StepFunctions(step=step, measure=kind.core.measure, flags=kind.core.flags, singles=kind.core.singles)
    return type("Preloaded", (kind,), {"core": core, "begin": begin}, name=f"bench-{target}-{power}")()


def proven(words, fitted, conditions, power):
    """Return the proof of words with a preload."""
    course = course_for(words, fitted.plants, conditions, conditions.highest_degC)
    acceptance = Acceptance(limits=limits_of(specification_of(conditions), fitted.plants), margins_of=margins)
    return prove_models(preloaded(words.target, power), words, labelled_heaters(fitted), course.scenario, actuator_for(conditions, words),
                        acceptance, Coverage(stated_settings=conditions.switches))


def settles(proof):
    """Return the worst settling time [s]."""
    return next(each.value for each in proof.criteria if each.name == "settling_time")


def tried(one, target):
    """Return what closing took, its settling time, and of each share that passes its settling time and more IAE; None: no question."""
    tolerance = max(one.tolerance, _STEPS * 1.001 * one.high / controller_for(target).counts)
    asked = DesignRequest(target=target, scaling=Scaling(low_degC=0.0, high_degC=one.high),
                  conditions=Conditions(setpoint_degC=one.setpoint, tolerance_degC=tolerance), boost="none")
    fitted = model_by_hand(one.model)
    plain = plainly(fitted, replace(asked, setpoint_ramp="none"))
    if plain.proof.verdict != "FAIL":
        return None
    found = find_passing_design(fitted, asked)
    held = (one.setpoint - one.model.ambient_degC) / one.model.gain_degC_per_pct
    same_ta = found.choice.words.sample_time_s == plain.choice.words.sample_time_s
    free = replace(found.choice.words, ramp=None, values=found.choice.words.values | {_FULL[target]: 100.0})
    ways = [(plain.choice.words, found.conditions if same_ta else plain.conditions, 0.0),
            (free, found.conditions, more_iae(plain, found))]
    passing = {}
    for words, conditions, more in ways:
        for share in (*SHARES, *([COLD_UNTIL_P] if target == "weg" else [])):
            try:
                proof = proven(words, fitted, conditions, COLD_UNTIL_P if share < 0.0 else share * held)
            except HeatertuneError:
                continue
            if proof.verdict == "PASS":
                passing[share, more] = settles(proof)
    broken = ",".join(each.name for each in plain.proof.criteria if not each.ok)
    took = found.proof.diagnostics.remarks[-1] if found.proof.verdict == "PASS" else found.proof.verdict
    return took, found.proof.verdict, settles(found.proof), more_iae(plain, found), passing, broken


def main():
    """Print a line for each heater that fails as asked for, and what they come to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", choices=list(_FULL))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=60)
    given = parser.parse_args()
    os.environ["HEATERTUNE_CACHE"] = ""
    setpoint_ramp.as_exported = lambda proof: proof  # the text is not what is asked
    fails = saves = 0
    passes, cheaper = {"any": 0, "cold": 0}, {"any": 0, "cold": 0}
    for number in range(given.first, given.first + given.count):
        result = tried(case(number, given.seed), given.target)
        if result is None:
            continue
        took, verdict, seconds, more, passing, broken = result
        fails, saves = fails + 1, saves + (verdict == "FAIL" and bool(passing))
        told = []
        for shares, ways in {"any": {way: at for way, at in passing.items() if way[0] >= 0.0},
                             "cold": {way: at for way, at in passing.items() if way[0] < 0.0}}.items():
            if not ways:
                told.append(f"{shares}: none passes")
                continue
            (share, extra), at = min(ways.items(), key=lambda way: (way[0][1] > _MORE_IAE, way[1]))
            is_cheaper = verdict == "PASS" and extra <= more + _MORE_IAE and (at < _EARLIER * seconds or extra < more - 0.05)
            passes[shares], cheaper[shares] = passes[shares] + 1, cheaper[shares] + is_cheaper
            told.append(f"{'cold' if share < 0.0 else f'share {share:g}'}: {at:.4g} s, {extra:+.0%} IAE{' CHEAPER' if is_cheaper else ''}")
        print(f"{number:3d} breaks {broken}; {took}: {seconds:.4g} s, {more:+.0%} IAE; {'; '.join(told)}", flush=True)
    print(f"{fails} of {given.count} fail as asked for; where closing FAILs a preload passes on {saves}")
    for shares, count in passes.items():
        print(f"preload, {shares}: passes on {count}, cheaper than what closing took on {cheaper[shares]}")


if __name__ == "__main__":
    main()

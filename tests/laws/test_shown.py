"""Where a switch says that no run shows it, every setting gives the same, bit for bit: one of them is run for all.

Judged by the controller's own steps, one after the other, and by runs of every setting.
"""

import random
from itertools import pairwise

import numpy as np
import pytest

from heatertune.errors import NotRepresentable
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import COOLING, TARGETS, Scaling, controller_for
from heatertune.plc.open_points import always, settings_to_prove
from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.loop import in_loop, scans_of
from heatertune.proof.monte_carlo.draw import SampleRequest, SampleSpread, measure
from heatertune.proof.phase_statistics import join_tables
from heatertune.proof.runs import measure_runs
from heatertune.proof.scenario import Load, Mains, Scenario

pytestmark = pytest.mark.law

SOMETIMES = [name for name in (*TARGETS, *COOLING.values())
             if any(switch.shows is not always for switch in controller_for(name).switches)]


def words_of(which, chance):
    """Words from sluggish to unstable, with or without I and D parts."""
    while True:
        ta = which.timer.round(chance.choice([0.5, 2.0]))
        tn, tv = chance.choice([np.inf, 60.0, 300.0]), chance.choice([0.0, 0.0, 12.0])
        design = PidDesign(gain_pct_per_degC=chance.uniform(0.5, 9.0), integral_time_s=tn, derivative_time_s=tv,
                           sample_time_s=ta, structure=structure_of(tn, tv), method="")
        try:
            return which.encode(design, Scaling())
        except NotRepresentable:
            continue


def outputs(which, words, settings, seed):
    """What the steps give for readings and setpoints drawn, from the cold state on, with start-ups in between."""
    chance, running = random.Random(seed), which.start(words, settings)
    cold, state, given = which.core.own(running.state), which.core.own(running.state), []
    reading, setpoint, often = chance.uniform(0.0, 60.0), chance.uniform(20.0, 90.0), chance.choice([0.02, 0.5])
    for _ in range(400):
        reading = min(max(reading + chance.gauss(0.0, 1.0) + 0.05 * (setpoint - reading), 0.0), 100.0)
        setpoint = chance.uniform(20.0, 90.0) if chance.random() < often else setpoint
        if chance.random() < 0.01:
            state = which.core.warm_start(running.parameters, cold, state)
        state, power, output, flags = which.core.step(
            running.parameters, state, which.measure(words, setpoint), which.measure(words, reading), True)
        given.append((power, output, flags))
    return given


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("target", SOMETIMES)
def test_settings_that_no_run_shows_give_the_same_power_at_every_step(target, seed):
    which, chance = controller_for(target), random.Random(seed)
    words = words_of(which, chance)
    base = {switch.name: chance.choice(switch.settings) for switch in which.switches}
    silent = [switch for switch in which.switches if not switch.shows(which.start(words, base).parameters)]
    for switch in silent:
        alike = [base | {switch.name: setting} for setting in switch.settings]
        alike = [each for each in alike if not switch.shows(which.start(words, each).parameters)]
        assert all(one == other for one, other in pairwise(outputs(which, words, each, seed) for each in alike))


@pytest.mark.parametrize("target", SOMETIMES)
def test_drawn_heaters_show_the_same_where_one_setting_runs_for_all(target):
    which, chance = controller_for(target), random.Random(target)
    words = words_of(which, chance)
    heater = Fopdt(gain_degC_per_pct=0.8, time_constant_s=60.0, dead_time_s=6.0, ambient_degC=20.0)
    scenario = Scenario(
        setpoint_degC=50.0, duration_s=400.0, noise_degC=0.1,
        disturbances=(Load(time_s=250.0, power_pct=-10.0), Mains(time_s=300.0, share=0.0), Mains(time_s=330.0, share=1.0)))
    cooling = {"cooling_gain": 1.0} if target in COOLING.values() else {}
    drawing = SampleRequest.of(which, words, [heater], scenario, SampleSpread(heater=(0.1, 0.1, 2.0)),
                         Actuator(pwm_period_s=2.0, **cooling))
    assert [each.switches for each in drawing.controllers] == settings_to_prove(which.switches)
    seeds, limits = range(7, 47), LoopLimits()
    rows, sizes = drawing.heaters_of(seeds)
    noise, late = drawing.scans_of(seeds, scans_of(drawing.controllers[0], scenario))
    every = join_tables([measure_runs(each, rows, scenario, drawing.actuator, limits, noise, late, sizes,
                            cooling=drawing.cooling_of(seeds)) for each in drawing.controllers])
    found = measure(drawing, limits, len(seeds), seed=seeds[0], workers=2)
    for name in ("rows", "table", "totals", "ripple"):
        assert np.array_equal(getattr(found, name), getattr(every, name), equal_nan=True), name


def test_what_needs_no_d_part_is_run_once_where_there_is_none():
    made = {}
    for tv in (0.0, 12.0):
        design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=60.0, derivative_time_s=tv, sample_time_s=2.0,
                           structure=structure_of(60.0, tv), method="")
        for target in ("weg", "s7-300", "pid-compact"):
            which = controller_for(target)
            words = which.encode(design, Scaling())
            made[target, tv] = len({in_loop(which, words, [50.0], setting, direct=True).shown
                                    for setting in settings_to_prove(which.switches)})
    # by hand from DIFFERENCES.md: of WEG's 9 settings, two are manual's and one a filter's that is off; PV of the first
    # call counts in 4 of the tip's 8 with D alone; three lags of PID_Compact's 10 settings are of D
    assert made == {("weg", 0.0): 6, ("weg", 12.0): 6, ("s7-300", 0.0): 4, ("s7-300", 12.0): 8,
                    ("pid-compact", 0.0): 7, ("pid-compact", 12.0): 10}

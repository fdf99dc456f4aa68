from dataclasses import replace

import numpy as np
import pytest

from heatertune.errors import LogError, UnknownName
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.plc.replay import read_inputs, replay
from heatertune.proof import Actuator, Scenario, simulate

DESIGN = PidDesign(gain_pct_per_degC=3.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=5.0, structure="pi",
                   method="")
HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0)


@pytest.mark.parametrize("target", TARGETS)
def test_a_closed_loop_replayed_from_its_readings_gives_the_same_power(target):
    # the loop is the second implementation here: it calls the room through another door
    which = controller_for(target)
    words = which.encode(replace(DESIGN, sample_time_s=which.timer.round(DESIGN.sample_time_s)), Scaling())
    switch = Actuator(pwm_period_s=words.sample_time_s)
    trace = simulate(which, words, HEATER, Scenario(setpoint_degC=45.0, duration_s=600.0), switch)
    setpoint, reading = list(which.inputs)[:2]
    timing = which.timing(words)
    scans = max(1, round((timing.pwm_period_s or timing.scan_s) / timing.scan_s))
    rows = [
        {setpoint: which.measure(words, 45.0), reading: which.measure(words, float(t) + 1e-5), "CYCLE_START": k % scans == 0}
        for k, t in enumerate(trace.reading_degC)
    ]
    power = [scan.power_pct for scan in replay(which, words, rows)]
    assert power == pytest.approx(trace.power_asked_pct.tolist())
    assert np.ptp(power) > 10.0


def test_all_inputs_of_ob251_reach_it():
    which = controller_for("s5-ob251")
    words = which.encode(DESIGN, Scaling())
    rows = [{"W": 100, "X": 100, "STEU": 32, "YH": 800}] * 4 + [{"W": 100, "X": 100, "STEU": 4}, {"W": 100, "X": 100, "Z": 50, "STEU": 1}]
    assert [scan.output for scan in replay(which, words, rows)] == [400, 600, 700, 800, 0, 50]


def test_switches_are_looked_up_by_name():
    which = controller_for("s5-ob251")
    words = which.encode(DESIGN, Scaling())
    with pytest.raises(UnknownName, match="rounding"):
        replay(which, words, [], {"colour": "red"})
    with pytest.raises(UnknownName, match="whole_increments"):
        replay(which, words, [], {"rounding": "up"})


@pytest.mark.parametrize(("text", "named"), [
    ("", "none"), ("W\n1\n", "W, X and"), ("W,X,Q\n1,2,3\n", "Q"), ("W,X\n1,2\n3,x\n", "line 3, column X"),
    ("W,X\n1,70000\n", "'70000'"), ("W,X\n1\n", "line 2"), ("W,X,X\n1,2,3\n", "the column X is there twice"),
])
def test_inputs_that_cannot_be_are_refused_by_line_and_column(tmp_path, text, named):
    path = tmp_path / "inputs.csv"
    path.write_text(text)
    with pytest.raises(LogError, match=r"inputs\.csv") as caught:
        read_inputs(path, controller_for("s5-ob251"))
    assert named in str(caught.value)

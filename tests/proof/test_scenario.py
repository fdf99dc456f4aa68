import re
from dataclasses import replace

import pytest

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.proof import Load, Scenario, TemperatureStep, paper_scenario, scenario_for
from heatertune.proof.loop import check_words
from heatertune.proof.scenario import conditions


def _heater(time_constant, gain=1.0, ambient=20.0):
    return Fopdt(gain_degC_per_pct=gain, time_constant_s=time_constant, dead_time_s=20.0, ambient_degC=ambient)


def test_the_paper_falls_from_53_3_to_44_5_in_the_27th_minute():
    (jump,) = paper_scenario().disturbances
    assert (jump.time_s, paper_scenario().setpoint_degC + jump.temperature_degC) == (27 * 60.0, pytest.approx(44.5))


@pytest.mark.parametrize(("time_constant", "jump_s", "duration_s"), [
    (5.0, 1620.0, 3000.0), (580.0, 1620.0, 3000.0), (1180.0, 3240.0, 6000.0),
])
def test_a_slow_heater_gets_more_time(time_constant, jump_s, duration_s):
    scenario = scenario_for([_heater(50.0), _heater(time_constant)], setpoint_degC=60.0)
    assert (scenario.disturbances[0].time_s, scenario.duration_s) == pytest.approx((jump_s, duration_s))


def test_both_lags_count():
    slow = TwoLag(gain_degC_per_pct=1.0, time_constant_s=800.0, second_time_constant_s=380.0, dead_time_s=20.0,
                  ambient_degC=20.0)
    assert scenario_for([slow], setpoint_degC=60.0).disturbances[0].time_s == pytest.approx(3240.0)


def test_the_jump_is_thirty_percent_of_the_step_unless_told():
    heaters = [_heater(100.0, ambient=24.0), _heater(100.0, ambient=25.0)]
    assert scenario_for(heaters, setpoint_degC=53.3).disturbances[0].temperature_degC == pytest.approx(-8.8, abs=0.02)
    told = scenario_for(heaters, setpoint_degC=53.3, temperature_step_degC=-3.0, noise_degC=0.1, seed=7)
    assert (told.disturbances[0].temperature_degC, told.noise_degC, told.seed) == (-3.0, 0.1, 7)


def test_a_scenario_needs_a_heater():
    with pytest.raises(InputError, match="at least one model"):
        scenario_for([], setpoint_degC=60.0)


@pytest.mark.parametrize("setpoint", [20.0, 19.0, 120.0, 200.0])
def test_a_setpoint_that_the_heater_cannot_hold_is_refused_with_the_numbers(setpoint):
    with pytest.raises(OutOfRange, match=r"> 20 .* and < 120 .*1 °C/%"):
        conditions(Scenario(setpoint_degC=setpoint, duration_s=10.0), _heater(100.0))


def test_the_scenarios_ambient_wins_and_the_start_follows_it():
    scenario = Scenario(setpoint_degC=60.0, duration_s=10.0, ambient_degC=10.0)
    assert conditions(scenario, _heater(100.0)) == (10.0, 10.0)


def test_an_ambient_that_nobody_knows_is_asked_for():
    with pytest.raises(InputError, match="ambient_degC is unknown"):
        conditions(Scenario(setpoint_degC=60.0, duration_s=10.0), _heater(100.0, ambient=None))


@pytest.mark.parametrize(("field", "settings"), [
    ("duration_s", {"duration_s": 0.0}),
    ("setpoint_degC", {"setpoint_degC": float("nan")}),
    ("noise_degC", {"noise_degC": -0.1}),
    ("start_degC", {"start_degC": 60.0}),
    ("ambient_degC", {"ambient_degC": 60.0}),
    ("disturbances", {"disturbances": (TemperatureStep(time_s=100.0, temperature_degC=-1.0),)}),
    ("disturbances", {"disturbances": (TemperatureStep(time_s=9.0, temperature_degC=-1.0), Load(time_s=9.0, power_pct=5.0))}),
])
def test_a_scenario_without_meaning_is_refused(field, settings):
    with pytest.raises(OutOfRange, match=field):
        Scenario(**({"setpoint_degC": 60.0, "duration_s": 100.0} | settings))


@pytest.mark.parametrize(("sign", "ambient", "start", "field"), [
    (1.0, 61.0, None, "setpoint_degC = 60.0 is out of range: must be > 61"), (1.0, 20.0, 61.0, "start_degC"),
    (-1.0, 59.0, None, "setpoint_degC = 60.0 is out of range: must be < 59"), (-1.0, 90.0, 59.0, "start_degC"),
])
def test_a_heater_begins_below_its_setpoint_and_a_cooler_above(sign, ambient, start, field):
    heater = replace(_heater(100.0), gain_degC_per_pct=sign)
    with pytest.raises(OutOfRange, match=field):
        conditions(Scenario(setpoint_degC=60.0, duration_s=10.0, ambient_degC=ambient, start_degC=start), heater)
    kept = Scenario(setpoint_degC=60.0, duration_s=10.0, ambient_degC=60.0 - 30.0 * sign, start_degC=60.0 - sign)
    assert conditions(kept, heater) == (60.0 - 30.0 * sign, 60.0 - sign)


@pytest.mark.parametrize("setpoint", [435.8, 100.0, 1250.0, 4000.0, -3.0, 0.0, -77.0])
def test_the_range_named_for_a_setpoint_that_the_sensor_cannot_read_takes_it(setpoint):
    controller = controller_for("s7-300")
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                       method="")
    scenario = Scenario(setpoint_degC=setpoint, duration_s=100.0)
    with pytest.raises(OutOfRange) as refused:
        check_words(controller, controller.encode(design, Scaling()), scenario)
    low, high = map(float, re.search(r"--range (\S+) (\S+), say", str(refused.value)).groups())
    check_words(controller, controller.encode(design, Scaling(low_degC=low, high_degC=high)), scenario)

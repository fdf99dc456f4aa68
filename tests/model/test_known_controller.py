"""A log of a simulated loop whose words are known gives its power back: the truth is the simulation's own."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.log.log_values import Log
from heatertune.model.fit import fit_known
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.model.power.known_controller import records, replay_controller
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.proof import Actuator, Scenario, simulate
from heatertune.proof.known_controller_check import closed_again, controllers

ONE = Fopdt(gain_degC_per_pct=0.6, time_constant_s=300.0, dead_time_s=25.0, ambient_degC=22.0)
TWO = TwoLag(gain_degC_per_pct=0.6, time_constant_s=300.0, second_time_constant_s=60.0, dead_time_s=12.0,
             ambient_degC=22.0)
DESIGN = PidDesign(gain_pct_per_degC=8.0, integral_time_s=240.0, derivative_time_s=0.0, sample_time_s=6.0,
                   structure="pi", method="by hand")
SETPOINT = 50.0


def _words(target):
    return controller_for(target).encode(DESIGN, Scaling())


def _trace(target, plant, *, switches=None, noise=0.05):
    scenario = Scenario(setpoint_degC=SETPOINT, duration_s=1800.0, noise_degC=noise, seed=3)
    return simulate(controller_for(target), _words(target), plant, scenario, Actuator(pwm_period_s=6.0), switches)


def _log(trace, target):
    """The readings the controller saw, in the middle of their counts, as a display shows them."""
    step = 100.0 / controller_for(target).counts
    return Log(name="twin", source="proof.simulate", time_s=trace.time_s, temperature_degC=trace.reading_degC + step / 2)


@pytest.mark.parametrize("target", ["s5-ob251", "s7-200", "s7-200-pid", "s7-300", "fb41", "weg", "on-off"])
def test_the_power_comes_back_to_the_last_bit_where_the_log_holds_what_the_controller_saw(target):
    trace = _trace(target, TWO)
    (controller, *_) = controllers(_words(target))
    found = replay_controller(_log(trace, target), controller, SETPOINT)
    assert 0.0 < np.mean(trace.power_asked_pct) < 100.0
    assert found.power_pct == pytest.approx(trace.power_asked_pct, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("plant", [ONE, TWO], ids=["one lag", "two lags"])
@pytest.mark.parametrize("target", ["s5-ob251", "s7-300", "weg", "on-off"])
def test_the_heater_behind_a_known_controller_is_found(target, plant):
    fitted = fit_known(_log(_trace(target, plant), target), controllers(_words(target)), setpoint_degC=SETPOINT)
    best = next(each for each in fitted.hypotheses if each.law == f"{target} replayed")  # as it was simulated
    assert len(best.model.lags_s) == len(plant.lags_s), "the order is the simulation's"
    # pulses of 6 s are taken as their mean, and noise is fed back: within 12 %, the dead time within one period
    assert best.model.gain_degC_per_pct == pytest.approx(plant.gain_degC_per_pct, rel=0.12)
    assert best.model.lags_s == pytest.approx(plant.lags_s, rel=0.15)
    assert best.model.dead_time_s == pytest.approx(plant.dead_time_s, abs=6.0)
    assert best in fitted.candidates
    assert fitted.hypotheses[0].delta_bic == 0.0


@pytest.mark.long
def test_a_wrong_setting_of_an_open_point_is_ruled_out_by_the_log():
    trace = _trace("weg", ONE, switches={"anti_windup": "none"})
    log, tried = _log(trace, "weg"), controllers(_words("weg"))
    fitted = fit_known(log, tried, setpoint_degC=SETPOINT)
    assert float(closed_again(log, fitted, tried, SETPOINT).split()[-2]) > 95.0, "with this setting, not the default"
    assert fitted.hypotheses[0].law == "weg, anti_windup = none replayed"
    assert all("anti_windup = none" in each.law for each in fitted.candidates)
    assert any("speaks against" in note and "weg replayed (" in note for note in fitted.notes)


@pytest.mark.long
def test_readings_cut_by_half_a_step_are_told_and_mended():
    trace = _trace("s5-ob251", ONE)
    log = _log(trace, "s5-ob251")
    step = 100.0 / controller_for("s5-ob251").counts
    shifted = replace(log, temperature_degC=log.temperature_degC - step)
    fitted = fit_known(shifted, controllers(_words("s5-ob251")), setpoint_degC=SETPOINT)
    assert fitted.model.gain_degC_per_pct == pytest.approx(ONE.gain_degC_per_pct, rel=0.1)
    # the readings are half a step below whole counts, and a whole count is read as itself
    assert any(f"the log's +{step / 2.0:.3g} °C" in note for note in fitted.notes)
    plain = fit_known(log, controllers(_words("s5-ob251")), setpoint_degC=SETPOINT)
    assert not any("the log's" in note for note in plain.notes)


@pytest.mark.long
def test_the_loop_closed_again_repeats_the_log():
    log = _log(_trace("s7-300", ONE), "s7-300")
    tried = controllers(_words("s7-300"))
    fitted = fit_known(log, tried, setpoint_degC=SETPOINT)
    told = closed_again(log, fitted, tried, SETPOINT)
    assert float(told.split()[-2]) > 97.0
    logged = replace(log, setpoint_degC=np.full(len(log.time_s), SETPOINT))
    assert closed_again(logged, fitted, tried, None) == told
    stepped = replace(log, setpoint_degC=np.where(log.time_s < 900.0, SETPOINT, 55.0))
    assert "setpoint changes" in closed_again(stepped, fitted, tried, None)
    assert "not closed" in closed_again(log, fitted, tried, 99.0)


@dataclass(frozen=True)
class _Ten:
    """Asks for ten per cent per degree, every second, from the second scan on."""

    name: str = "ten"
    interval_s: float = 1.0
    resolution_degC: float = 0.1

    def power_pct(self, temperature_degC, setpoint_degC):
        asked = 10.0 * (setpoint_degC - temperature_degC)
        asked[0] = 0.0
        return np.clip(asked, 0.0, 100.0)


def _ramp(setpoint=None):
    """20 °C rising by 0.1 °C a second, one reading in four seconds."""
    time = np.arange(0.0, 81.0, 4.0)
    return Log(name="ramp", source="by hand", time_s=time, temperature_degC=20.0 + 0.1 * time, setpoint_degC=setpoint)


def test_a_row_has_the_mean_power_of_the_scans_up_to_the_next():
    found = replay_controller(_ramp(), _Ten(), 25.0)
    # scans at 0, 1, 2, 3 s ask for 0, 49, 48, 47 %; at 4, 5, 6, 7 s for 46, 45, 44, 43 %
    assert found.power_pct[:2] == pytest.approx([36.0, 44.5])
    assert found.power_pct[-1] == 0.0


def test_scans_slower_than_the_log_are_held():
    found = replay_controller(_ramp(), _Ten(interval_s=8.0), 25.0)
    assert found.power_pct[:5] == pytest.approx([0.0, 0.0, 42.0, 42.0, 34.0])


def test_the_logged_setpoint_is_used_where_none_is_given():
    time = _ramp().time_s
    found = replay_controller(_ramp(np.where(time < 40.0, 25.0, 28.0)), _Ten(interval_s=4.0), None)
    assert found.power_pct[9:11] == pytest.approx([10.0 * (25.0 - 23.6), 10.0 * (28.0 - 24.0)])
    assert replay_controller(_ramp(np.full(21, 99.0)), _Ten(interval_s=4.0), 25.0).power_pct[1] == pytest.approx(46.0)


def test_an_offset_is_added_to_what_the_controller_sees():
    assert replay_controller(_ramp(), _Ten(interval_s=4.0), 25.0, 0.5).power_pct[1] == pytest.approx(41.0)


def test_records_that_are_the_same_come_once():
    made = records(_ramp(), [_Ten(), _Ten(name="twin"), _Ten(name="slow", interval_s=4.0)], 25.0)
    assert [name for name, _ in made] == ["ten", "slow"]


def test_what_cannot_be_replayed_is_refused():
    with pytest.raises(InputError, match="--setpoint"):
        replay_controller(_ramp(), _Ten(), None)
    with pytest.raises(InputError, match="holds the power"):
        replay_controller(replace(_ramp(), power_pct=np.linspace(0.0, 50.0, 21)), _Ten(), 25.0)
    with pytest.raises(InputError, match="too many"):
        replay_controller(_ramp(), _Ten(interval_s=1e-4), 25.0)
    with pytest.raises(InputError, match="never changes"):
        fit_known(_ramp(), [_Ten()], setpoint_degC=-100.0)
    with pytest.raises(OutOfRange, match="power_before_pct"):
        fit_known(_ramp(), [_Ten()], setpoint_degC=25.0, power_before_pct=101.0)
    with pytest.raises(UnknownName, match="switch"):
        controllers(_words("weg"), {"no_such": "on"})


def test_a_switch_that_is_known_is_not_tried_otherwise():
    names = [each.name for each in controllers(_words("weg"), {"anti_windup": "none"})]
    assert names
    assert all("anti_windup = none" in name for name in names)

"""The witnesses know a heater whose truth is known, and no PASS of a small choice of real logs breaks on its rig."""

import argparse
from dataclasses import replace

import numpy as np
import pytest

from tests.bench import danger_real, witness
from tests.bench.heaters import Heater, Rig
from tests.bench.witness import Record

HEATER = Heater(gain=0.8, lags=(120.0,), dead=20.0, ambient=22.0)


def _record(heater, first=0, last=300, noise=0.02):
    """Run a heater by Runge-Kutta steps, none of the witnesses' own arithmetic: pulses of 60 % and 20 %, 5 s apart."""
    rig, chance = Rig(heater, heater.ambient), np.random.default_rng(4)
    power = np.repeat([0.0, 60.0, 20.0, 60.0, 0.0, 20.0], 50)
    temperature = []
    for k, u in enumerate(power):
        temperature.append(rig.run(5.0 * k) + noise * chance.standard_normal())
        rig.set(u)
    return Record(5.0, power, np.array(temperature), first, last)


@pytest.mark.long
@pytest.mark.parametrize("part", [(0, 300), (0, 150), (150, 300)])
def test_a_witness_of_one_lag_is_the_heater(part):
    found = witness.witnesses(_record(HEATER, *part))
    one = next(each.heater for each in found if len(each.heater.lags) == 1)
    assert (one.gain, *one.lags, one.dead, one.ambient) == pytest.approx((0.8, 120.0, 20.0, 22.0), rel=0.01)


@pytest.mark.long
def test_a_witness_of_two_lags_is_the_heater_and_one_lag_is_ruled_out():
    found = witness.witnesses(_record(replace(HEATER, lags=(120.0, 40.0))))
    assert [len(each.heater.lags) for each in found] == [2]
    assert found[0].heater.lags == pytest.approx((120.0, 40.0), rel=0.03)
    assert found[0].heater.dead == pytest.approx(20.0, abs=1.0)
    assert found[0].fit_pct > 99.0


def test_a_part_whose_power_never_changes_bears_no_witness():
    record = _record(HEATER)
    assert witness.witnesses(replace(record, first=60, last=100)) == []


@pytest.mark.long
def test_a_part_that_no_model_explains_bears_no_witness():
    assert witness.witnesses(_record(HEATER, noise=40.0)) == []


def test_a_half_is_written_as_it_was_read(real_logs):
    source = next(each for each in danger_real.SOURCES if "unal_profile" in each.path)
    held = danger_real.readings(source, real_logs)
    lines = held.text("half 2").splitlines()
    assert lines[0] == "time_s,temp_C,duty_pct,setpoint_C"
    first = len(held.time) // 2
    assert [float(cell) for cell in lines[1].split(",")] == pytest.approx(
        [0.0, held.temperature[first], held.power[first], held.setpoint[first]])
    assert len(lines) == 1 + len(held.time) - first


def test_raw_logs_are_those_that_others_have_made_common_columns_of(real_logs):
    # the README beside the logs: apm_siso_doublet is the kelvin log, pypidtune_prc the one without time
    by_name = {danger_real.name_of(source): source for source in danger_real.SOURCES}
    for raw, common in (("tclab_step_kelvin_pwm255", "apm_siso_doublet"),
                        ("reaction_curve_semicolon_no_time", "pypidtune_prc")):
        ours, theirs = (danger_real.readings(by_name[name], real_logs) for name in (raw, common))
        assert ours.temperature == pytest.approx(theirs.temperature, abs=0.006)
        assert ours.power == pytest.approx(theirs.power, abs=0.006)
        assert ours.time == pytest.approx(theirs.time, abs=0.006)


@pytest.mark.long(seconds=25)
def test_no_pass_on_a_real_log_breaks_on_its_rig(real_logs):
    settings = argparse.Namespace(
        only=["unal_prbs", "apm_mimo_steps"], targets=["s7-300"], structure="pi", plain=False, workers=1)
    found = danger_real.run(real_logs, settings)
    assert danger_real.dangers(found) == []
    assert sum(bool(each.judged.get("s7-300")) for each in found) >= 2  # a PASS that a witness saw

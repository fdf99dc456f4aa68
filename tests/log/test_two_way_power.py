"""Powers below 0, signals with a live zero, and columns of a cooler, a fan and the room."""

import numpy as np
import pytest

from heatertune.errors import LogError
from heatertune.log import read_log

PLAN = [0.0] * 20 + [50.0] * 20 + [-30.0] * 20


def read(header, *columns, **options):
    rows = [",".join([f"{2 * k}", f"{20 + 0.1 * k + 0.3 * (k % 3):.1f}", *(f"{cell}" for cell in cells)])
            for k, cells in enumerate(zip(*columns, strict=True))]
    return read_log("log.csv", content=("\n".join([header, *rows]) + "\n").encode(), **options)


def test_a_power_below_0_is_a_coolers_and_a_name_is_evidence_of_it():
    log = read("time [s],temp [degC],PID_Temp_1.PidOutputSum [%]", PLAN)
    assert log.power_pct.tolist() == [0.0] * 20 + [50.0] * 20 + [0.0] * 20
    assert log.cooling_pct.tolist() == [0.0] * 40 + [30.0] * 20
    assert "power" not in log.taken.assumed
    assert log.window(80.0, 118.0).cooling_pct.tolist() == [30.0] * 20


def test_without_evidence_a_power_below_0_is_asked_for_and_both_answers_work():
    header = "time [s],temp [degC],output [%]"
    log = read(header, PLAN)
    assert log.taken.assumed["power"] == "--power-full-scale 100"
    assert "--power-levels -100 100" in log.taken.line
    assert "power" not in read(header, PLAN, power_full_scale=100).taken.assumed
    bipolar = read(header, PLAN, power_levels=(-100, 100))
    assert bipolar.cooling_pct is None
    assert set(bipolar.power_pct) == {50.0, 75.0, 35.0}
    assert read(header, PLAN, **bipolar.taken.reading).power_pct.tolist() == bipolar.power_pct.tolist()


def test_a_power_that_never_heats_is_no_heaters():
    header, cooling = "time [s],temp [degC],output [%]", [-abs(each) for each in PLAN]
    with pytest.raises(LogError, match=r"never heats.*--power-levels 0 -100 and --cooler"):
        read(header, cooling)
    assert read(header, cooling, power_levels=(0, -100)).power_pct.max() == 50.0


def test_just_below_0_is_the_error_of_an_analogue_signal():
    log = read("time [s],temp [degC],output [%]", [-0.4] * 20 + [50.0] * 40)
    assert log.cooling_pct is None
    assert log.power_pct[0] == 0.0
    assert any("just below 0" in repair for repair in log.repairs)


def test_two_columns_are_heater_and_cooler():
    heat, cool = [max(each, 0.0) for each in PLAN], [max(-each, 0.0) for each in PLAN]
    for names in ("OutputHeat [%],OutputCool [%]", "Heizen %,Kühlen %"):
        log = read(f"time [s],temp [degC],{names}", heat, cool)
        assert (log.power_pct.tolist(), log.cooling_pct.tolist()) == (heat, cool)
    log = read("time [s],temp [degC],OutputCool [%],OutputHeat [%]", cool, heat)
    assert (log.power_pct.tolist(), log.cooling_pct.tolist()) == (heat, cool)
    assert read("time [s],temp [degC],OutputHeat [%],OutputCool [%]", heat, cool, cooling_column="none").cooling_pct is None
    with pytest.raises(LogError, match=r"heater and cooler are on at once.*--disturbance-column \"OutputCool \[%\]\""):
        read("time [s],temp [degC],OutputHeat [%],OutputCool [%]", heat, [5.0] * 60)


@pytest.mark.parametrize(("name", "off", "full", "asked"), [
    ("heater [mA]", 4.0, 20.0, "--power-levels 4 20"), ("heater [V]", 1.0, 5.0, "--power-levels 1 5"),
    ("heater [V]", 2.0, 10.0, "--power-levels 2 10"), ("output", 4.0, 20.0, "--power-levels 4 20")])
def test_a_live_zero_is_asked_for_and_its_answer_works(name, off, full, asked):
    percent = [0.0] * 20 + [100.0] * 20 + [25.0] * 20
    header, cells = f"time [s],temp [degC],{name}", [off + each * (full - off) / 100.0 for each in percent]
    with pytest.raises(LogError, match=f"live zero.*{asked}"):
        read(header, cells)
    np.testing.assert_allclose(read(header, cells, power_levels=(off, full)).power_pct, percent)
    low = [cell - 0.01 * (full - off) for cell in cells]  # the card's error: 0 %, not a cooler
    assert read(header, low, power_levels=(off, full)).power_pct.min() == 0.0
    with pytest.raises(LogError, match="as --power-levels says"):
        read(header, [*cells[:-1], 2.0 * full], power_levels=(off, full))


def test_a_fan_and_a_room_are_read_by_their_names_and_left_out_on_request():
    fan, room = [0.0] * 30 + [80.0] * 30, [21.0] * 60
    header = "time [s],temp [degC],heater [%],fan [%],room temp [degF]"
    log = read(header, [max(each, 0.0) for each in PLAN], fan, [69.8] * 60)
    assert log.disturbance.tolist() == fan
    np.testing.assert_allclose(log.ambient_degC, room)
    bare = read(header, [max(each, 0.0) for each in PLAN], fan, room, disturbance_column="none", ambient_column="none")
    assert bare.disturbance is bare.ambient_degC is None
    heats = read("time [s],temp [degC],fan heater [%]", [max(each, 0.0) for each in PLAN])
    assert heats.disturbance is None  # a heater with a fan is a heater
    assert heats.power_pct.max() == 50.0


def test_a_tag_of_a_cooler_is_not_passed_over():
    rows = ["time [s],tag,value"]
    for k, power in enumerate(PLAN):
        rows += [f"{2 * k},PV [degC],{20 + 0.1 * k:.1f}", f"{2 * k},OutputHeat [%],{max(power, 0)}", f"{2 * k},OutputCool [%],{max(-power, 0)}"]
    content = ("\n".join(rows) + "\n").encode()
    with pytest.raises(LogError, match=r"a tag of a cooler's power.*OutputCool.*--cooling-column none"):
        read_log("log.csv", content=content, power_tag="OutputHeat [%]")
    assert read_log("log.csv", content=content, power_tag="OutputHeat [%]", cooling_column="none").power_pct.max() == 50.0


@pytest.mark.parametrize(("options", "flag"), [({"power_levels": (4, 20)}, "--power-levels"), ({"power_full_scale": 255}, "--power-full-scale")])
def test_readings_that_are_stated_of_a_power_that_was_not_logged_are_refused(tmp_path, options, flag):
    path = tmp_path / "log.csv"
    path.write_text("time [s],temperature [°C]\n" + "".join(f"{k},{20 + 0.1 * k:.1f}\n" for k in range(60)), encoding="utf-8")
    with pytest.raises(LogError, match=f"no column of the power, whose readings {flag} states"):
        read_log(path, **options)
    assert read_log(path).power_pct is None

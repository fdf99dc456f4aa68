"""A design from a klippy.log names the heater that the user read, and no other."""

import pytest

from heatertune.chain import encode, pipeline, prove, tune
from heatertune.log import read_log
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling
from heatertune.proof.design_request import DesignRequest, with_printer_range
from heatertune.proof.verdict import verdict_line, wear_text
from heatertune.report import verify_brief
from heatertune.settings import Conditions, ReadSettings


@pytest.fixture
def klippy(tmp_path):
    path = tmp_path / "klippy.log"
    path.write_text("".join(
        f"Stats {1000 + k}.0: heater_bed: target=60 temp={30 + k / 10:.1f} pwm=0.500 chamber: target=40 temp={25 + k / 30:.1f} pwm=0.100 "
        f"extruder: target=200 temp={40 + k / 2:.1f} pwm=0.700\n" for k in range(120)))
    return path


@pytest.mark.parametrize(("target", "tag", "told", "expected"), [
    ("klipper", "heater_bed", {}, {"heater": "heater_bed"}), ("klipper", "extruder", {}, {"heater": "extruder"}),
    # the names in klippy.log are those of the sections of printer.cfg: the one that was read is known without --tag
    ("klipper", None, {}, {"heater": "extruder"}), ("klipper", "chamber", {}, {}),
    ("klipper", "heater_bed", {"heater": "heater_generic"}, {"heater": "heater_generic"}),
    ("klipper", "heater_bed", {"firmware": "kalico"}, {"firmware": "kalico", "heater": "heater_bed"}),
    ("marlin", "heater_bed", {}, {"heater": "bed"}), ("marlin", None, {}, {"heater": "hotend"}), ("marlin", "chamber", {}, {}),
    ("weg", "heater_bed", {}, {})])
def test_the_tag_of_the_log_is_the_heater_of_the_export(klippy, target, tag, told, expected):
    log = read_log(klippy, ReadSettings(tag=tag))
    asked = pipeline._of_its_heater(DesignRequest(target=target, conditions=Conditions(setpoint_degC=50.0, switches=told)), log)
    assert dict(asked.conditions.switches) == expected


@pytest.mark.parametrize(("target", "tag", "expected"), [
    ("marlin", "T", {"heater": "hotend"}), ("marlin", "B", {"heater": "bed"}), ("klipper", "B", {"heater": "heater_bed"}),
    ("klipper", "T", {"heater": "extruder"})])
def test_the_letter_of_a_printers_report_is_the_heater_of_the_export(tmp_path, target, tag, expected):
    path = tmp_path / "serial.log"
    path.write_text("".join(f"10:00:{k:02d}.000 :  T:{30 + k:.2f} /200.00 B:{25 + k / 2:.2f} /60.00 @:64 B@:127\n" for k in range(60)))
    log = read_log(path, ReadSettings(tag=tag))
    assert dict(pipeline._of_its_heater(DesignRequest(target=target), log).conditions.switches) == expected


@pytest.mark.parametrize("tag", ["B", "T"])
def test_a_letter_in_any_other_table_is_no_heater_of_a_printer(tmp_path, tag):
    path = tmp_path / "plant.csv"
    path.write_text("time_s,zone,temperature_degC,power_pct\n" + "".join(
        f"{k},{zone},{20 + k / 3:.1f},50\n" for k in range(80) for zone in "BT"))
    log = read_log(path, ReadSettings(tag=tag, tag_column="zone"))
    assert log.taken.reading["tag"] == tag
    assert dict(pipeline._of_its_heater(DesignRequest(target="marlin"), log).conditions.switches) == {}


@pytest.mark.parametrize(("target", "tag", "stated", "expected"), [
    ("klipper", None, None, (0.0, 300.0)), ("marlin", None, None, (0.0, 300.0)),
    ("klipper", "heater_bed", None, None),  # a bed stays within the default range
    ("klipper", None, (0.0, 260.0), (0.0, 260.0)), ("weg", None, None, None)])
def test_a_printer_that_is_hotter_than_the_default_range_needs_no_range(hot, target, tag, stated, expected):
    scaling = None if stated is None else Scaling(low_degC=stated[0], high_degC=stated[1])
    hottest = float(read_log(hot, ReadSettings(tag=tag)).temperature_degC.max())
    asked = with_printer_range(DesignRequest(target=target, scaling=scaling), hottest)
    assert (None if asked.scaling is None else asked.scaling.sensor_degC) == expected


@pytest.fixture
def hot(tmp_path):
    path = tmp_path / "klippy.log"
    path.write_text("".join(
        f"Stats {1000 + k}.0: heater_bed: target=60 temp={30 + k / 10:.1f} pwm=0.500 "
        f"extruder: target=200 temp={40 + k:.1f} pwm=0.700\n" for k in range(160)))
    return path


def test_the_file_of_one_heater_is_of_that_heater(klippy):
    klippy.write_text("\n".join(line.replace(": ", ": gcodein=0 ", 1).partition(" chamber:")[0] for line in klippy.read_text().splitlines()))
    log = read_log(klippy)
    asked = pipeline._of_its_heater(DesignRequest(target="klipper"), log)
    assert dict(asked.conditions.switches) == {"heater": "heater_bed"}


@pytest.mark.parametrize(("target", "text"), [
    ("klipper", "a MOSFET does not wear"), ("marlin", "a MOSFET does not wear"), ("esphome", "a relay lasts "), ("s7-300", "a contactor lasts ")])
def test_what_wears_is_what_switches_such_a_heater(target, text):
    assert wear_text(target, 400.0).startswith(text)


@pytest.mark.parametrize("target", ["klipper", "marlin", "arduino-pid", "esphome", "simple-pid"])
def test_a_makers_verdict_speaks_of_no_contactor_and_no_input_module(target):
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.8, time_constant_s=120.0, dead_time_s=8.0, ambient_degC=21.0))
    words = encode(tune(heater, target=target), target, heater)
    document = prove(words, heater, setpoint_degC=60.0, first_look=True).to_document()
    told = verdict_line(document) + verify_brief(document)
    assert "contactor" not in told
    assert "input module" not in told

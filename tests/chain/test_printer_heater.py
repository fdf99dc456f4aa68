"""A design from a klippy.log names the heater that the user read, and no other."""

import pytest

from heatertune.chain import pipeline
from heatertune.log import read_log
from heatertune.proof.design_request import DesignRequest
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
    ("klipper", None, {}, {}), ("klipper", "chamber", {}, {}),
    ("klipper", "heater_bed", {"heater": "heater_generic"}, {"heater": "heater_generic"}),
    ("klipper", "heater_bed", {"firmware": "kalico"}, {"firmware": "kalico", "heater": "heater_bed"}),
    ("weg", "heater_bed", {}, {})])
def test_the_tag_of_the_log_is_the_heater_of_the_export(klippy, target, tag, told, expected):
    log = read_log(klippy, ReadSettings(tag=tag))
    asked = pipeline._of_its_heater(DesignRequest(target=target, conditions=Conditions(setpoint_degC=50.0, switches=told)), log)
    assert dict(asked.conditions.switches) == expected

import math

import pytest

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import TARGETS, controller_for
from heatertune.studio.controls import Controls
from heatertune.studio.loop_settings import SLIDERS, StudioSettings, settings_for


@pytest.mark.parametrize("wrong", [
    {"target": "s5"}, {"structure": "pd"}, {"ms": 1.0}, {"ms": math.nan}, {"sample_time_s": 0.0}, {"pwm_period_s": -1.0},
    {"setpoint_degC": -300.0}, {"noise_degC": -0.1}, {"low_degC": 100.0, "high_degC": 100.0},
])
def test_a_setting_without_meaning_is_refused_by_its_name(wrong):
    with pytest.raises((OutOfRange, UnknownName), match="|".join(wrong)):
        StudioSettings(**wrong)


def test_every_slider_has_a_setting_a_name_and_room_to_move():
    for slider in SLIDERS:
        assert hasattr(StudioSettings(), slider.field)
        assert slider.label
        assert slider.low < slider.high
        assert slider.auto == (getattr(StudioSettings(), slider.field) is None)
    assert len({slider.label for slider in SLIDERS}) == len(SLIDERS)


def test_every_end_of_every_slider_is_a_setting():
    for slider in SLIDERS:
        for end in (slider.low, slider.high):
            StudioSettings(**{slider.field: end})


def test_the_resolution_is_that_of_the_manual():
    # S5-115U: 2048 units over the range; OB251's W and X go to 2047 (CPU 944 manual, section 11.2.3)
    assert StudioSettings(target="s5-ob251").resolution_degC == pytest.approx(100.0 / 2047, rel=1e-3)
    assert StudioSettings(target="s7-300", input="thermocouple", high_degC=200.0).resolution_degC == pytest.approx(0.1)  # per digit
    with pytest.raises(InputError, match="no analog module"):
        StudioSettings(target="weg", input="4-20mA")
    assert StudioSettings(target="s5-ob251", high_degC=200.0).resolution_degC == pytest.approx(200.0 / 2047, rel=1e-3)


def test_a_new_heater_gets_a_sensor_that_sees_its_setpoint_and_forgets_what_was_moved_for_the_last():
    hot = model_by_hand(Fopdt(gain_degC_per_pct=5.0, time_constant_s=100.0, dead_time_s=5.0, ambient_degC=-30.0))
    found = settings_for(hot, StudioSettings(target="weg", ms=1.4, sample_time_s=3.0, setpoint_degC=55.0))
    # half way up: −30 + 50 · 5 = 220 °C; times 1.25 is 275, the next fifty is 300; −30 needs a range from −50
    assert (found.low_degC, found.high_degC) == (-50.0, 300.0)
    assert (found.target, found.ms, found.sample_time_s, found.setpoint_degC) == ("weg", 1.4, None, None)


def test_every_target_has_its_timer():
    for target in TARGETS:
        timer = controller_for(target).timer
        assert 0.0 < timer.step_s <= timer.longest_s
        assert timer.shortest_s <= timer.longest_s
    assert controller_for("s5-ob251").timer.longest_s > 60.0


@pytest.mark.parametrize(("field", "text", "said"), [
    ("sample_time_s", "17", {"sample_time_s": 17.0}), ("sample_time_s", "17,5", {"sample_time_s": 17.5}),
    ("setpoint_degC", " ", {"setpoint_degC": None}),
    ("setpoint_degC", "6O", {}), ("sample_time_s", "17 s", {}), ("high_degC", "", {}), ("high_degC", "x", {})])
def test_what_is_typed_moves_nothing_where_it_is_no_number(field, text, said):
    heard, controls = [], Controls.__new__(Controls)  # without a page
    controls._moved, controls._seen, controls._silent, controls._placed = lambda **moved: heard.append(moved), int, False, {}
    controls._typed(next(slider for slider in SLIDERS if slider.field == field), text, 1)
    assert (heard, controls._placed) == ([said], {field: text})

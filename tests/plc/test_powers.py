"""The power a controller gives to a list of temperatures; the room is worked out by hand."""

from dataclasses import dataclass

import pytest

from heatertune.errors import UnknownName
from heatertune.plc.controller import Controller
from heatertune.plc.core import Scan, Timing
from heatertune.plc.open_points import OpenPoint, settings_of
from heatertune.plc.replay import powers
from heatertune.plc.words import Scaling, Words

WORDS = Words(target="counting", values={}, scaling=Scaling(), sample_time_s=1.0)


@dataclass(frozen=True)
class _Counting:
    """Asks for setpoint − reading + scan number + 50 where a period begins; `sign` turns the difference round."""

    pwm_period_s: float | None = None
    switches: tuple = (OpenPoint(name="sign", means={"plus": False, "minus": True}, reason="for the test"),)

    instantiate = Controller.instantiate

    def check(self, words):
        assert words is WORDS

    def check_ramp(self, _words):
        pass

    def timing(self, _words):
        return Timing(scan_s=1.0, pwm_period_s=self.pwm_period_s)

    def measure(self, _words, temperature_degC):
        return int(temperature_degC)

    def start(self, _words, switches):
        return (1 if settings_of(self.switches, switches)["sign"] == "plus" else -1), 0

    def step(self, state, setpoint, reading, *, cycle_start=True):
        sign, scans = state
        return (sign, scans + 1), Scan(power_pct=sign * (setpoint - reading) + scans + 50.0 * cycle_start, output=0)


def test_every_scan_sees_its_own_reading_and_setpoint_as_the_input_module_gives_them():
    assert powers(_Counting(), WORDS, [20.9, 21.0, 22.5], [30.2, 30.2, 40.0]) == [60.0, 60.0, 70.0]


def test_a_switch_that_is_named_has_its_setting():
    assert powers(_Counting(), WORDS, [20.0, 20.0], [30.0, 30.0], {"sign": "minus"}) == [40.0, 41.0]
    with pytest.raises(UnknownName, match="colour"):
        powers(_Counting(), WORDS, [20.0], [30.0], {"colour": "red"})


def test_a_controller_with_its_own_pwm_holds_what_it_asks_for_where_a_period_begins():
    found = powers(_Counting(pwm_period_s=3.0), WORDS, [20.0] * 7, [20.0] * 7)
    assert found == [50.0, 50.0, 50.0, 53.0, 53.0, 53.0, 56.0]

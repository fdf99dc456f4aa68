"""Every program that heatertune exports, in each of its variants: the material of the tests that read exported files.

Words are legal and arbitrary: nothing here is proven, and the certificate says so.
"""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
from tests.proof.test_supervision import OFF

from heatertune.errors import HeatertuneError
from heatertune.pid.design_values import PidDesign
from heatertune.plc import NAMES, Boost, Certificate, Scaling, Words, controller_for
from heatertune.plc.feed_forward import feed_forward
from heatertune.plc.pwm import Actuator
from heatertune.supervision.faulty_loops import Card, Ran
from heatertune.supervision.text import program_check

PWM = Actuator(pwm_period_s=2.0, resolution_s=0.1, minimum_on_s=0.2)
#: remarks with the signs that end or begin a comment somewhere, and letters outside ASCII
REMARKS = ("name of two\nL     4711;\r\nlines", "setpoint of 45 °C ≤ 50 °C", "specification *) x := 1; (* by name", "*/ end // begin /* \" ' $ # ;")
_HEAD = ("monitor of 45 °C", *REMARKS)
_NUMBERS = OFF._replace(low=5, high=900, jump=50, still=9, full=20, growths=2, slow_blocks=2, slow_scale=64, slow_gain=3, slow_rest=-900)


class Export(NamedTuple):
    """Files of one export: label, words, certificate (None: none is written), file name → content."""

    label: str
    words: Words
    certificate: Certificate | None
    files: dict[str, str | bytes]

    @property
    def texts(self):
        """The files that are text: name → content."""
        return {name: content for name, content in self.files.items() if isinstance(content, str)}


@cache
def controller_exports(target):
    """Return the exports of a controller: structures, heater and cooler, ramp, boost, with and without a switch of its own."""
    controller, found = controller_for(target), []
    for label, words in _words(target):
        for switch, actuator in (("no switch", None), ("PWM", PWM)):
            certificate = Certificate(verdict="FAIL", lines=REMARKS, forced=True, setpoint_degC=60.0, actuator=actuator)
            files = controller.export(words, certificate)
            found.append(Export(f"{target}, {label}, {switch}", words, certificate, dict(files)))
    return found


@cache
def monitors():
    """Return the programs of `supervise`, one for each target that has one."""
    ran = Ran(counts=np.arange(400, 520, dtype=np.int32), power=np.full(120, 50, dtype=np.int16), temperature_degC=np.zeros(120))
    found = []
    for target in NAMES:
        words = next(_words(target))[1]
        made = program_check.export_monitor(_NUMBERS, words, Card(0.0, 0.1, 1000), list(_HEAD), [ran])
        if made.file is not None:
            found.append(Export(f"{target}, monitor", words, None, {made.file: made.text}))
    return found


@cache
def feed_forwards():
    """Return the programs of `feed-forward`, for a sensor and for a contact."""
    found = []
    for target in NAMES:
        controller = controller_for(target)
        if controller.feed is None:
            continue
        for switched in (False, True):
            line = feed_forward(controller.feed, column="door; * \" \n open", pct_per_unit=2.0, calm=0.0, low=0.0, high=1.0 + 9.0 * (not switched),
                                switched=switched)
            certificate = Certificate(verdict="PASS", lines=REMARKS)
            files = dict(controller.feed.listing(line, certificate))
            found.append(Export(f"{target}, feed-forward, {'contact' if switched else 'sensor'}", next(_words(target))[1], certificate, files))
    return found


def every_export():
    """Return all exports of all targets."""
    return [*(one for target in NAMES for one in controller_exports(target)), *monitors(), *feed_forwards()]


def _words(target):
    """Yield label and words of one target."""
    controller = controller_for(target)
    timer = controller.timer
    ta = timer.step_s * round(min(max(1.0, timer.shortest_s), timer.longest_s) / timer.step_s)
    base = PidDesign(gain_pct_per_degC=0.5, integral_time_s=120.0, derivative_time_s=10.0, sample_time_s=ta, structure="pid", method="")
    designs = {"PID": base, "PI": replace(base, derivative_time_s=0.0, structure="pi"), "cooler": replace(base, gain_pct_per_degC=-0.5)}
    made = 0
    for name, design in designs.items():
        try:
            words = controller.encode(design, Scaling(low_degC=-20.0, high_degC=130.0))
        except HeatertuneError:
            continue  # not every controller cools, and not every one has an I part
        made += 1
        yield name, words
        if name == "PI":
            continue
        if controller.has_ramp:
            yield f"{name}, ramp", replace(words, ramp=controller.ramp(words, 60.0))
            yield f"{name}, ramp with hold", replace(words, ramp=controller.ramp(words, 6.0, 6.0))
        if controller.has_boost:
            yield f"{name}, boost", words.with_boost(Boost(within_degC=5.0, again_degC=15.0))
    assert made, target

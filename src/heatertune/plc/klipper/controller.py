"""The PID of Klipper and Kalico."""

from __future__ import annotations

from typing import ClassVar

from heatertune.pid.values import Timer
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions
from heatertune.plc.klipper.export import entries, export_words, from_text, loaders
from heatertune.plc.klipper.step import COLD, FLAGS, KlipperAssumptions, loop_of, measure, step
from heatertune.plc.klipper.words import FIELDS, REPORT_S, USUAL, design_of, interval_s, oddities, past_of, values_of
from heatertune.plc.words import Words

__all__ = ["Klipper"]


class Klipper(Controller, name="klipper"):
    """The PID that the host of a printer computes with each report of a thermistor."""

    title = "Klipper and Kalico, control: pid of a heater (klippy/extras/heaters.py)"
    main_file = "klipper_heater.cfg"
    can = (
        "P, PI and PID in double precision, a smoothed derivative of the reading; gains with three decimals",
        "a report each 0.3 s; power changes below 5 % that are not sent; the switch a report later, PWM of 0.1 s",
        "exported as lines of the heater's section, and as G-code to try them",
    )
    cannot = (
        "control: pid_v, mpc and dual_loop_pid of Kalico are not run", "no sensor that reports at another interval",
        "no setpoint ramp: the firmware has none",
        "a change below 5 % waits for the next refresh, up to 2.4 s; a heater that is off never gets less than 5 %",
    )
    fields, assumptions = FIELDS, KlipperAssumptions
    timer = Timer(shortest_s=REPORT_S, longest_s=REPORT_S, step_s=REPORT_S)
    inputs: ClassVar = {"target": "LREAL", "temperature": "LREAL"}
    #: 0.1 °C of 0…300 °C: a thermistor of 100 kΩ behind 4.7 kΩ, eight samples of twelve bits summed, at 300 °C
    counts = 3000
    #: a duty takes effect a report after the last of eight samples of 1 ms each
    delay_s = REPORT_S + 0.008
    tick_s = 1e-5
    pwm_period_s = 0.1
    keyed_entries = staticmethod(entries)
    derivative_filter = past_of(USUAL["smooth_time"])
    most_power = ("max_power", 1.0)
    core = StepFunctions(step=step, measure=measure, flags=FLAGS)
    values, design, interval_s = staticmethod(values_of), staticmethod(design_of), staticmethod(interval_s)
    export, text, oddities = staticmethod(export_words), staticmethod(from_text), staticmethod(oddities)
    text_of_heater = staticmethod(from_text)
    load_exported = staticmethod(loaders)

    def begin(self, words: Words, assume: KlipperAssumptions) -> ControllerState:
        """Return the state of a host that has started and read the temperature with its heater off."""
        return ControllerState(loop_of(words.values, assume), COLD)

"""The controller in Arduino's library PID_v1."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.arduino_pid.export import export_words, from_text, loaders
from heatertune.plc.arduino_pid.step import FIRST_MS, ArduinoPidAssumptions, parameters_of, scan
from heatertune.plc.arduino_pid.words import (
    COUNTS,
    FIELDS,
    FULL,
    TIMER,
    consistent,
    design_of,
    interval_s,
    oddities,
    values_of,
)
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.parallel.step import COLD, PARALLEL, with_boost
from heatertune.plc.words import Words

__all__ = ["ArduinoPid"]


class ArduinoPid(Controller, name="arduino-pid"):
    """PID_v1 in double or single precision; the sketch around it switches the heater in windows of time."""

    title = "Arduino, library PID by Brett Beauregard 1.2.1 (PID_v1.cpp)"
    main_file = "arduino_pid.ino"
    can = (
        "P, PI, PD and PID, D on the reading; P on the error, or on the measurement where words are read",
        "exported as a whole sketch: constructor, boost, window of time for a relay; a broken sensor is off",
    )
    cannot = (
        "no derivative filter: noise and steps of the reading reach the output times Kd/SampleTime",
        "the integral part goes on while the output is at a limit; it ends at that limit itself",
        "no coolers (REVERSE), no lower limit but 0, no gains that the sketch changes later",
        "no setpoint ramp in the sketch; pulses that make up for others are left to a switch behind it",
    )
    fields, timer, counts, assumptions = FIELDS, TIMER, COUNTS, ArduinoPidAssumptions
    inputs: ClassVar = {"Setpoint": "REAL", "Input": "REAL", "Mode": "BOOL", "Output": "REAL", "Elapsed": "UINT"}
    derivative_filter = 0.0
    most_power = ("OutMax", FULL)
    tick_s = 0.01
    has_boost = True
    core = PARALLEL
    values, design, export = staticmethod(values_of), staticmethod(design_of), staticmethod(export_words)
    consistent, interval_s = staticmethod(consistent), staticmethod(interval_s)
    oddities, text, scan_all = staticmethod(oddities), staticmethod(from_text), staticmethod(scan)
    load_exported = staticmethod(loaders)

    def begin(self, words: Words, assume: ArduinoPidAssumptions) -> ControllerState:
        """Return the state before SetMode(AUTOMATIC), the output being 0."""
        return ControllerState(with_boost(parameters_of(words.values, assume), words.boost),
                               COLD._replace(waited=FIRST_MS))

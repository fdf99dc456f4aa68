"""The controller in Python's simple-pid."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.parallel.step import COLD, PARALLEL, with_boost
from heatertune.plc.simple_pid.export import export_words, from_text, loaders
from heatertune.plc.simple_pid.step import SimplePidAssumptions, parameters_of, scan
from heatertune.plc.simple_pid.words import COUNTS, FIELDS, FULL, TIMER, design_of, interval_s, oddities, values_of
from heatertune.plc.words import Words

__all__ = ["SimplePid"]


class SimplePid(Controller, name="simple-pid"):
    """simple-pid in double precision; the loop around it switches the heater in windows of time."""

    title = "simple-pid 2.0.1 for Python (simple_pid/pid.py)"
    main_file = "simple_pid_heater.py"
    can = (
        "P, PI, PD and PID in double precision by the measured interval, D on the reading",
        "P on the measurement and D on the error where words are read",
        "exported as a Python module: the object, a loop with a boost and a window of time; a broken sensor is off",
    )
    cannot = (
        "no derivative filter: noise and steps of the reading reach the output times Kd/interval",
        "the integral part goes on while the output is at a limit; it ends at that limit itself",
        "no coolers, no lower limit but 0, no error_map, no starting_output",
        "no setpoint ramp in the module; pulses that make up for others are left to a switch behind it",
    )
    fields, timer, counts, assumptions = FIELDS, TIMER, COUNTS, SimplePidAssumptions
    inputs: ClassVar = {"setpoint": "REAL", "input_": "REAL", "auto_mode": "BOOL", "last_output": "REAL", "dt": "REAL"}
    derivative_filter = 0.0
    most_power = ("output_max", FULL)
    tick_s = 0.01
    has_boost = True
    core = PARALLEL
    values, design, export = staticmethod(values_of), staticmethod(design_of), staticmethod(export_words)
    interval_s, oddities, text = staticmethod(interval_s), staticmethod(oddities), staticmethod(from_text)
    scan_all, load_exported = staticmethod(scan), staticmethod(loaders)

    def begin(self, words: Words, assume: SimplePidAssumptions) -> ControllerState:
        """Return the state of a new object."""
        return ControllerState(with_boost(parameters_of(words.values, assume), words.boost), COLD)

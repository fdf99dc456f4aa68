"""The controller in ESPHome's PID climate."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.esphome.export import entries, export_words, from_text, loaders
from heatertune.plc.esphome.step import EspHomeAssumptions, parameters_of, scan
from heatertune.plc.esphome.words import COUNTS, FIELDS, TIMER, consistent, design_of, interval_s, oddities, values_of
from heatertune.plc.parallel.step import COLD, PARALLEL, with_boost
from heatertune.plc.words import Words

__all__ = ["EspHome"]


class EspHome(Controller, name="esphome"):
    """ESPHome's PID in single precision, called by each reading; slow_pwm behind it switches the heater."""

    title = "ESPHome 2026.6.5, PID climate (components/pid/pid_controller.cpp)"
    main_file = "esphome_pid.yaml"
    can = (
        "P, PI, PD and PID in single precision by the measured interval, D on the reading",
        "limits of the integral part, mean of up to 8 changes in the derivative part",
        "exported as YAML: climate with control_parameters, slow_pwm output, and a boost between",
    )
    cannot = (
        "the integral part goes on while the output is at a limit; its own limits end it",
        "no dead band, no averaged output, no starting integral term, no cool_output",
        "no setpoint ramp in the file; slow_pwm knows no shortest pulse",
        "a change of the mode keeps the integral part: it goes on summing while the climate is off",
    )
    fields, timer, counts, assumptions = FIELDS, TIMER, COUNTS, EspHomeAssumptions
    inputs: ClassVar = {
        "target_temperature": "REAL", "current_temperature": "REAL", "mode": "BOOL", "elapsed_ms": "UINT"}
    keyed_entries = staticmethod(entries)
    derivative_filter = 0.0
    tick_s = 0.1
    has_boost = True
    core = PARALLEL
    values, design, export = staticmethod(values_of), staticmethod(design_of), staticmethod(export_words)
    consistent, interval_s = staticmethod(consistent), staticmethod(interval_s)
    oddities, text, scan_all = staticmethod(oddities), staticmethod(from_text), staticmethod(scan)
    load_exported = staticmethod(loaders)

    def begin(self, words: Words, assume: EspHomeAssumptions) -> ControllerState:
        """Return the state after a restart."""
        return ControllerState(with_boost(parameters_of(words.values, assume), words.boost), COLD)

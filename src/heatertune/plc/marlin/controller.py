"""The controller in Marlin's PID."""

from __future__ import annotations

from typing import ClassVar, Final

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.marlin.export import entries, export_words, from_text, loaders
from heatertune.plc.marlin.step import MarlinAssumptions, parameters_of, scan
from heatertune.plc.marlin.words import COUNTS, FIELDS, TIMER, design_of, interval_s, oddities, values_of
from heatertune.plc.parallel.step import COLD, PARALLEL
from heatertune.plc.words import Words

__all__ = ["Marlin"]

_ROUNDED_DEGC: Final = 0.5  # the setpoint, to whole degrees


class Marlin(Controller, name="marlin"):
    """Marlin's PID in single precision; the firmware makes the PWM behind its 127 steps."""

    title = "Marlin 2.1, PID of a hot end (Marlin/src/module/temperature.h; M301)"
    main_file = "marlin_pid.h"
    can = (
        "P, PI, PD and PID in single precision, D on the reading and filtered (PID_K1)",
        "full power below the window PID_FUNCTIONAL_RANGE around the setpoint, none above",
        "exported as lines of Configuration.h and as G-code: M301, or M304 of a bed (`--assume heater=bed`)",
    )
    cannot = (
        "127 steps of power; the setpoint is whole degrees",
        "TA is PID_dT: 0.16 s, or up to 0.256 s where words are read of a build with many sensors",
        "no setpoint ramp, no boost of heatertune's: outside the window the firmware gives full power itself",
        "no coolers; no terms for extrusion and fan (PID_EXTRUSION_SCALING, PID_FAN_SCALING)",
        "the firmware's own supervision (MINTEMP, MAXTEMP, thermal runaway) is not simulated",
    )
    fields, timer, counts, assumptions = FIELDS, TIMER, COUNTS, MarlinAssumptions
    inputs: ClassVar = {"target": "REAL", "celsius": "REAL"}
    keyed_entries = staticmethod(entries)
    derivative_filter = 0.95
    tick_s = 0.001
    pwm_period_s = 0.127
    core = PARALLEL
    values, design, export = staticmethod(values_of), staticmethod(design_of), staticmethod(export_words)
    interval_s, oddities, text = staticmethod(interval_s), staticmethod(oddities), staticmethod(from_text)
    text_of_heater = staticmethod(from_text)
    scan_all, load_exported = staticmethod(scan), staticmethod(loaders)

    def again_degC(self, words: Words) -> float | None:
        """Return the firmware's window, less what the rounded setpoint and the reading's steps may take of it."""
        return float(words.values["PID_FUNCTIONAL_RANGE"]) - _ROUNDED_DEGC - words.scaling.span_degC / COUNTS

    def forgets_degC(self, words: Words) -> float | None:
        """Return the window, and what may be added to it."""
        return float(words.values["PID_FUNCTIONAL_RANGE"]) + _ROUNDED_DEGC + words.scaling.span_degC / COUNTS

    def begin(self, words: Words, assume: MarlinAssumptions) -> ControllerState:
        """Return the state after power-on."""
        return ControllerState(parameters_of(words.values, assume), COLD)

"""The controller in WEG's PID block."""

from __future__ import annotations

from typing import ClassVar

from heatertune.pid.design_values import Timer
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, Sensor, StepFunctions, count
from heatertune.plc.pwm import HALF_WAVE_S
from heatertune.plc.single_precision import single
from heatertune.plc.weg.export import entries, export_words, from_text, loaders, setpoint_entry
from heatertune.plc.weg.step import COLD, WegAssumptions, block_of, scan, step
from heatertune.plc.weg.words import COUNTS, FIELDS, consistent, design_of, interval_s, oddities, values_of
from heatertune.plc.words import Words

__all__ = ["Weg"]


def _measure(sensor: Sensor, temperature_degC: float) -> float:
    return single(sensor.low + sensor.span * count(sensor, temperature_degC) / sensor.counts)


class Weg(Controller, name="weg"):
    """WEG's PID block in single precision, temperatures in °C; the program around it makes the PWM of its scans."""

    title = "WEG SCA06 Ladder, block PID (WPS help; equation of the CFW501 programming manual V1.8x)"
    main_file = "weg_pid_call.st"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "P, PI, PD and PID in single precision, academic or parallel form, direct or reverse action",
        "setpoint filter of first order, limits of the output, manual output, enabling; Ts of 1 to 65535 ms",
        "exported as a whole program in structured text: calls each Ts, EN FALSE is off, PWM, setpoint ramp, boost",
    )
    cannot = (
        "no derivative filter: noise and steps of the reading reach the output times K*TV/TA",
        "TauSetPoint does not soften a start: the filter begins at the setpoint (the proof tries both readings)",
        "a PWM by PID_Compact's rule is left to a switch behind Output",
        "an integral step below half a digit of the sum is lost: a slower Ts makes it larger",
    )
    fields, assumptions = FIELDS, WegAssumptions
    timer = Timer(shortest_s=0.001, longest_s=65.535, step_s=0.001)  # milliseconds as UINT
    inputs: ClassVar = {
        "SetPoint": "REAL", "Feedback": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL", "EN": "BOOL",
    }
    counts = COUNTS
    tick_s = HALF_WAVE_S
    keyed_entries = staticmethod(entries)
    derivative_filter = 0.0
    has_ramp = has_boost = True
    most_power = ("MaximumOutput", 100.0)
    core = StepFunctions(step=step, measure=_measure, flags=("upper limit", "lower limit", "overflow"), singles=True)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(consistent)
    interval_s, export, scan_all = staticmethod(interval_s), staticmethod(export_words), staticmethod(scan)
    text, oddities, load_exported = staticmethod(from_text), staticmethod(oddities), staticmethod(loaders)

    def begin(self, words: Words, assume: WegAssumptions) -> ControllerState:
        """Return the state before EN has ever been TRUE."""
        block = block_of(words.values, assume)
        if words.boost is not None:
            block = block._replace(within=words.boost.within_degC, again=words.boost.again_degC)
        return ControllerState((block, assume), COLD)

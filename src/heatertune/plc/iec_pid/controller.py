"""The controller in the repaired PID of IEC 61131-3."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, Sensor, StepFunctions, count
from heatertune.plc.iec_pid.export import entries, export_words, from_text, loaders, setpoint_entry
from heatertune.plc.iec_pid.step import COLD, IecPidAssumptions, block_of, disturbance_step, scan, step
from heatertune.plc.iec_pid.words import (
    COUNTS,
    FIELDS,
    TIMER,
    consistent,
    design_of,
    interval_s,
    oddities,
    values_of,
)
from heatertune.plc.pwm import HALF_WAVE_S
from heatertune.plc.single_precision import single
from heatertune.plc.words import Words

__all__ = ["IecPid", "measure"]


def measure(sensor: Sensor, temperature_degC: float) -> float:
    """Return PV for a temperature, in °C on the counts of the input module."""
    return single(sensor.low + sensor.span * count(sensor, temperature_degC) / sensor.counts)


class IecPid(Controller, name="iec-pid"):
    """The PID of the IEC 61131-3 text with its faults repaired, in single precision; temperatures in °C."""

    title = "IEC 61131-3 PID, repaired; structured text for OpenPLC, Beremiz, CODESYS and others"
    main_file = "iec_pid.st"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "P, PI, PD and PID in single precision; TR = 0 leaves the I part out",
        "limits with anti-windup, return from hand without a bump; CYCLE of 1 to 60000 ms, whatever the unit of "
        "TIME_TO_REAL",
        "exported as a whole program in structured text and PLCopen XML: calls each CYCLE, PWM, setpoint ramp, boost",
    )
    cannot = (
        "no derivative filter but the standard's own four points",
        "a PWM by PID_Compact's rule is left to a switch behind XOUT",
        "a step of the I part below half a digit of its sum is lost: a slower CYCLE makes it larger",
    )
    fields, assumptions, timer, counts = FIELDS, IecPidAssumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "REAL", "PV": "REAL", "X0": "REAL", "AUTO": "BOOL", "RUN": "BOOL"}
    keyed_entries = staticmethod(entries)
    tick_s = HALF_WAVE_S
    has_ramp = has_boost = True
    most_power = ("XMAX", 100.0)
    core = StepFunctions(step=step, measure=measure, flags=("upper limit", "lower limit", "overflow"), singles=True,
                         disturbance_step=disturbance_step)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(consistent)
    interval_s, export, scan_all = staticmethod(interval_s), staticmethod(export_words), staticmethod(scan)
    text, oddities, load_exported = staticmethod(from_text), staticmethod(oddities), staticmethod(loaders)

    def begin(self, words: Words, assume: IecPidAssumptions) -> ControllerState:
        """Return the state before the first call."""
        block = block_of(words.values, assume)
        if words.boost is not None:
            block = block._replace(within=words.boost.within_degC, again=words.boost.again_degC)
        return ControllerState((block, assume), COLD)

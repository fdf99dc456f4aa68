"""The controllers in PID_Temp: heating, and heating and cooling."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import ClassVar, Final

from heatertune.plc.controller import Controller, CoolingSupport
from heatertune.plc.core import ControllerState
from heatertune.plc.pid_compact.controller import CORE, COUNTS, DELAY_S, INPUTS, TIMER, UNREAD
from heatertune.plc.pid_compact.export import LAW, InstructionLaw
from heatertune.plc.pid_compact.export import export_words as exported_words
from heatertune.plc.pid_compact.export import loaders as loads_of
from heatertune.plc.pid_compact.readback import from_text as read_text
from heatertune.plc.pid_temp.step import (
    COLD,
    COLD_PAIR,
    CoolingAssumptions,
    PidCompactAssumptions,
    block_of,
    pair_of,
    pair_scan,
    pair_step,
    scan,
)
from heatertune.plc.pid_temp.words import (
    COOLING_FIELDS,
    FIELDS,
    TEMP,
    TEMP_COOLING,
    consistent,
    cooling_consistent,
    cooling_design_of,
    cooling_gain_of,
    cooling_oddities,
    cooling_values_of,
    design_of,
    interval_s,
    oddities,
    values_of,
    with_cooling_gain,
)
from heatertune.plc.words import Words

__all__ = [
    "PidTemp", "PidTempCooling", "cooling_export_words", "cooling_exported", "cooling_from_text", "export_words",
    "exported", "from_text",
]


export_words: Final = partial(exported_words, TEMP, FIELDS)
exported: Final = partial(loads_of, TEMP, FIELDS, LAW)
from_text: Final = partial(read_text, TEMP, FIELDS)

cooling_export_words: Final = partial(exported_words, TEMP_COOLING, COOLING_FIELDS)
cooling_exported: Final = partial(loads_of, TEMP_COOLING, COOLING_FIELDS, InstructionLaw(COLD_PAIR, pair_of, pair_scan))
cooling_from_text: Final = partial(read_text, TEMP_COOLING, COOLING_FIELDS)


#: as that of heating
COOLING_CORE = replace(CORE, step=pair_step)


class PidTemp(Controller, name="pid-temp"):
    """PID_Temp with its cooling off, called from a cyclic interrupt OB; it makes the PWM itself."""

    title = "SIMATIC S7-1200/1500, PID_Temp V1 and V2, heating (function manual PID control, A5E35300227)"
    main_file = "pid_temp_words.scl"
    can = (
        "P, PI, PD and PID in single precision with setpoint weights and a lag of the derivative",
        "its own PWM of Cycle or a shorter period, shortest times, what is left out made up; broken sensor: 0 %",
        "exported as SCL: words at start-up, call, rollback by LoadBackUp; and as rows of a watch table",
    )
    cannot = (
        "no cooling: OutputCool stays 0; pid-temp-cooling, or --cooling-gain, is the block with a cooler",
        "no inverted control (a cooler alone: pid-compact), no dead zone, no control zone, no cascade",
        "no setpoint ramp, no feed-forward (Disturbance), no manual in the proof",
    )
    fields, assumptions, timer, counts, inputs, core = FIELDS, PidCompactAssumptions, TIMER, COUNTS, INPUTS, CORE
    tick_s, delay_s, unread = 0.1, DELAY_S, UNREAD
    own_pwm = ("pid-compact", 10.0)
    most_power: ClassVar = ("OutputUpperLimit", 100.0)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(consistent)
    interval_s, export, scan_all = staticmethod(interval_s), staticmethod(export_words), staticmethod(scan)
    text, oddities = staticmethod(from_text), staticmethod(oddities)
    load_exported: ClassVar = staticmethod(exported)

    def begin(self, words: Words, assume: PidCompactAssumptions) -> ControllerState:
        """Return the state before automatic has ever been on."""
        return ControllerState((block_of(words.values, assume), assume), COLD)


class PidTempCooling(Controller, name="pid-temp-cooling"):
    """PID_Temp with its cooling on: one more set of parameters, and one more output with pulses of its own."""

    title = "SIMATIC S7-1200/1500, PID_Temp V1 and V2, heating and cooling (function manual PID control, A5E35300227)"
    main_file = "pid_temp_words.scl"
    can = (
        "P, PI, PD and PID in single precision, by heating's set and CoolFactor or by two sets of parameters",
        "its own two PWMs of one period, shortest times of each, what is left out made up; broken sensor: 0 %",
        "exported as SCL: words at start-up, call, rollback by LoadBackUp; and as rows of a watch table",
    )
    cannot = (
        "no cooler of another lag or dead time than the heater's, none whose power bends",
        "no two sampling times: Cycle is that of both sets; no dead zone, no control zone, no cascade",
        "no setpoint below the ambient, no setpoint ramp, no feed-forward (Disturbance), no manual in the proof",
    )
    fields, assumptions, timer, counts, inputs = COOLING_FIELDS, CoolingAssumptions, TIMER, COUNTS, INPUTS
    core, tick_s, delay_s, unread = COOLING_CORE, 0.1, DELAY_S, UNREAD
    own_pwm = ("pid-compact", 10.0)
    most_power: ClassVar = ("OutputUpperLimit", 100.0)
    baseline = None
    cooling = CoolingSupport(words=with_cooling_gain, gain=cooling_gain_of, design=cooling_design_of)
    values, design = staticmethod(cooling_values_of), staticmethod(design_of)
    consistent = staticmethod(cooling_consistent)
    interval_s, export, scan_all = staticmethod(interval_s), staticmethod(cooling_export_words), staticmethod(pair_scan)
    text, oddities = staticmethod(cooling_from_text), staticmethod(cooling_oddities)
    load_exported: ClassVar = staticmethod(cooling_exported)

    def begin(self, words: Words, assume: CoolingAssumptions) -> ControllerState:
        """Return the state before automatic has ever been on."""
        return ControllerState((pair_of(words.values, assume), assume), COLD_PAIR)

"""The controller OB251."""

from __future__ import annotations

from typing import ClassVar

from heatertune.pid.design_values import Timer
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.inputs import FOUR_TO_TWENTY, Range
from heatertune.plc.s5_ob251.export import (
    FEED,
    export_words,
    from_image,
    from_text,
    keyed_entries,
    loaders,
    oddities,
    setpoint_entry,
)
from heatertune.plc.s5_ob251.step import COLD, Ob251Assumptions, scan, start_up, step
from heatertune.plc.s5_ob251.words import (
    FIELDS,
    FULL_SCALE,
    UNREAD,
    check_consistency,
    consistent,
    design_of,
    most_gain,
    parameters_of,
    values_of,
)
from heatertune.plc.words import Words

__all__ = ["Ob251"]


class Ob251(Controller, name="s5-ob251"):
    """OB251: words in 1024ths, output and limits in units; the PWM is an actuator behind YA."""

    title = "SIMATIC S5-115U, OB251 (manual 4NEB 811 6130, section 11.2.3)"
    main_file = "program_listing.txt"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "P, PI and PID; feed-forward of Z; manual with a bumpless return; position or velocity algorithm",
        "derivative of the control error, or of XZ",
        "setpoint ramp: the export brings the function block that moves W",
    )
    cannot = (
        "no PWM of its own: a switch behind YA is proven with it",
        "TV is a whole multiple of TA; K is limited to ±1500/1024 units per unit with a D part",
    )
    fields, assumptions, counts = FIELDS, Ob251Assumptions, FULL_SCALE
    ranges: ClassVar = {FOUR_TO_TWENTY: Range()}
    unread: ClassVar = UNREAD
    timer = Timer(shortest_s=0.01, longest_s=600.0, step_s=0.01)  # OB10 to OB13
    inputs: ClassVar = {"W": "KF", "X": "KF", "Z": "KF", "XZ": "KF", "YH": "KF", "STEU": "KM"}
    input_ranges: ClassVar = dict.fromkeys(("W", "X", "Z", "XZ", "YH"), (-FULL_SCALE, FULL_SCALE))  # table 11-11
    integers, written = ("K", "TI", "TD"), ("W",)
    has_ramp = True
    # analog input 460, eight channels at their slowest (S5-115U manual EWA 4NEB 811 6130, tables of analog modules);
    # OB13 reads it and writes the output directly, by L PW and T PY, whatever the cycle of OB1
    delay_s = 0.48
    tick_s = 0.1  # of OB13 on every CPU (S5-115U, 100U, 95U); 10 to 50 ms by SD97 on the faster ones
    most_power = ("BGOG", 2047)
    core = StepFunctions(step=step, measure=count, flags=("upper limit", "lower limit"), warm_start=start_up)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(consistent)
    export, keyed_entries = staticmethod(export_words), staticmethod(keyed_entries)
    image, oddities = staticmethod(from_image), staticmethod(oddities)
    text, check_consistency = staticmethod(from_text), staticmethod(check_consistency)
    load_exported = staticmethod(loaders)
    scan_all, most_gain, feed = staticmethod(scan), staticmethod(most_gain), FEED

    def begin(self, words: Words, assume: Ob251Assumptions) -> ControllerState:
        """Return the cold state: DW18 to DW48 cleared."""
        return ControllerState((parameters_of(words.whole), assume), COLD)

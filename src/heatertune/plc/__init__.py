"""Design → words → text: one class per controller, in a folder named as the target.

What stands here is imported when it is first used: who only asks for the names of the targets waits for no arithmetic.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes
from heatertune.plc.targets import ALIKE, COOLING, GROUPS, NAMES, TARGETS

if TYPE_CHECKING:
    from heatertune.plc.controller import Controller, controller_for
    from heatertune.plc.core import ControllerState, Scan, StepFunctions, Timing, count
    from heatertune.plc.open_points import OpenPoint
    from heatertune.plc.ramp import Boost, Number, Ramp
    from heatertune.plc.words import Certificate, Scaling, WordField, Words

__all__ = [
    "ALIKE", "COOLING", "GROUPS", "NAMES", "TARGETS", "Boost", "Certificate", "Controller", "ControllerState", "Number",
    "OpenPoint", "Ramp", "Scaling", "Scan", "StepFunctions", "Timing", "WordField", "Words", "controller_for", "count",
]

__getattr__, __dir__ = lazy_attributes(__name__, {
    "plc.ramp": ("Boost", "Number", "Ramp"),
    "plc.controller": ("Controller", "controller_for"),
    "plc.core": ("StepFunctions", "ControllerState", "Scan", "Timing", "count"),
    "plc.open_points": ("OpenPoint",),
    "plc.words": ("Certificate", "Scaling", "WordField", "Words"),
})

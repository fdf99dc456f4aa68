"""Design → words → text: one class per controller, in a folder named as the target.

What stands here is imported when it is first used: who only asks for the names of the targets waits for no arithmetic.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from heatertune.lazy import offered
from heatertune.plc.targets import ALIKE, COOLING, GROUPS, NAMES, TARGETS

if TYPE_CHECKING:
    from heatertune.plc.boost import Boost
    from heatertune.plc.controller import Controller, controller_for
    from heatertune.plc.core import Core, Running, Scan, Timing, count
    from heatertune.plc.open_points import Switch
    from heatertune.plc.ramp import Number, Ramp
    from heatertune.plc.words import Certificate, Scaling, WordField, Words

__all__ = [
    "ALIKE", "COOLING", "GROUPS", "NAMES", "TARGETS", "Boost", "Certificate", "Controller", "Core", "Number", "Ramp",
    "Running", "Scaling", "Scan", "Switch", "Timing", "WordField", "Words", "controller_for", "count",
]

__getattr__, __dir__ = offered(__name__, {
    "plc.boost": ("Boost",),
    "plc.controller": ("Controller", "controller_for"),
    "plc.core": ("Core", "Running", "Scan", "Timing", "count"),
    "plc.open_points": ("Switch",),
    "plc.ramp": ("Number", "Ramp"),
    "plc.words": ("Certificate", "Scaling", "WordField", "Words"),
})

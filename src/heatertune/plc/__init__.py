"""Design → words → text: one class per controller, in a folder named as the target.

What stands here is imported when it is first used: who only asks for the names of the targets waits for no arithmetic.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

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

_FROM: Final = {
    "boost": ("Boost",),
    "controller": ("Controller", "controller_for"),
    "core": ("Core", "Running", "Scan", "Timing", "count"),
    "open_points": ("Switch",),
    "ramp": ("Number", "Ramp"),
    "words": ("Certificate", "Scaling", "WordField", "Words"),
}


def __getattr__(name: str) -> Any:
    for module, names in _FROM.items():
        if name in names:
            return getattr(import_module(f"heatertune.plc.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)

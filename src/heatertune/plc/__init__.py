"""Design → words → text; one room per controller, each with the same four doors."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from heatertune.errors import UnknownName
from heatertune.plc.controller import (
    Certificate,
    Number,
    Room,
    Scaling,
    Scan,
    Timing,
    WordField,
    Words,
)
from heatertune.plc.open_points import Switch
from heatertune.plc.ramp import Ramp

__all__ = [
    "FAITHFUL", "TARGETS", "Certificate", "Number", "Ramp", "Room", "Scaling", "Scan", "Switch", "Timing",
    "WordField", "Words", "room",
]

#: name on the command line → package of the room (which has a value ROOM)
TARGETS: Final[dict[str, str]] = {
    "s5-ob251": "heatertune.plc.s5_ob251",
    "s7-200": "heatertune.plc.s7_200",
    "s7-200-paper": "heatertune.plc.s7_200_paper",
    "s7-200-pid": "heatertune.plc.s7_200_pid",
    "s7-300": "heatertune.plc.s7_300",
    "fb41": "heatertune.plc.fb41",
    "weg": "heatertune.plc.weg",
    "on-off": "heatertune.plc.on_off",
}

#: target → the same as its source prints it, faults included
FAITHFUL: Final[dict[str, str]] = {"s7-200": "s7-200-paper"}


def room(target: str) -> Room:
    """Return the room of a target; raise UnknownName with the known ones."""
    if target not in TARGETS:
        raise UnknownName("target", target, TARGETS)
    found: Room = import_module(TARGETS[target]).ROOM
    return found

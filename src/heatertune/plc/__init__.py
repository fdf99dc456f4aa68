"""Design → words → text; one room per controller, each with the same four doors."""

from __future__ import annotations

from importlib import import_module
from typing import Final

from heatertune.errors import UnknownName
from heatertune.plc.room import Certificate, Imaged, Number, Room, Scaling, Scan, Switch, Timing, WordField, Words

__all__ = [
    "TARGETS", "Certificate", "Imaged", "Number", "Room", "Scaling", "Scan", "Switch", "Timing", "WordField", "Words",
    "room",
]

#: name on the command line → package of the room (which has a value ROOM)
TARGETS: Final[dict[str, str]] = {
    "s5-ob251": "heatertune.plc.s5_ob251",
    "s7-200": "heatertune.plc.s7_200",
    "weg": "heatertune.plc.weg",
}


def room(target: str) -> Room:
    """Return the room of a target; raise UnknownName with the known ones."""
    if target not in TARGETS:
        raise UnknownName("target", target, TARGETS)
    found: Room = import_module(TARGETS[target]).ROOM
    return found

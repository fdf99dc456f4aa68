"""What both rooms ask of their switches, and the analog input module."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from heatertune.plc.room import Switch, settings_of

__all__ = ["FULL_SCALE", "chosen"]

#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648


def chosen(switches: Sequence[Switch], given: Mapping[str, str]) -> list[bool]:
    """Return for each switch whether it differs from its default; raise UnknownName for an unknown setting."""
    settings = settings_of(switches, given)
    return [settings[switch.name] != switch.default for switch in switches]

"""What both rooms ask of their switches and of the analog input module."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from heatertune.plc.room import Switch, Words, settings_of

__all__ = ["FULL_SCALE", "chosen", "counts"]

#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648


def chosen(switches: Sequence[Switch], given: Mapping[str, str]) -> list[bool]:
    """Return for each switch whether it differs from its default; raise UnknownName for an unknown setting."""
    settings = settings_of(switches, given)
    return [settings[switch.name] != switch.default for switch in switches]


def counts(words: Words, temperature_degC: float) -> int:
    """Return the analog value of a temperature, cut towards zero as a converter does, limited to 0…27648."""
    scaled = (temperature_degC - words.scaling.low_degC) * FULL_SCALE / words.scaling.span_degC
    return int(min(max(scaled, 0.0), FULL_SCALE))

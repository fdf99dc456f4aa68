"""The controllers that come with heatertune: the one list of them, for the command line, the manual and the tests."""

from __future__ import annotations

from typing import Final

__all__ = ["GROUPS", "TARGETS"]

#: what holds the controller → its controllers, by their names on the command line
GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "PLC": (
        "s5-ob251", "s7-200", "s7-200-paper", "s7-200-pid", "s7-300", "fb41", "weg", "iec-pid", "iec-pid-text",
        "on-off",
    ),
}

#: name on the command line → its package: the folder named as the target, whose controller.py has the class
TARGETS: Final[dict[str, str]] = {
    name: f"heatertune.plc.{name.replace('-', '_')}" for names in GROUPS.values() for name in names
}

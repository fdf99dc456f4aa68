"""The controllers that come with heatertune: the one list of them, for the command line, the manual and the tests."""

from __future__ import annotations

from typing import Final

__all__ = ["TARGETS"]

#: name on the command line → its package: the folder named as the target, whose controller.py has the class
TARGETS: Final[dict[str, str]] = {
    name: f"heatertune.plc.{name.replace('-', '_')}"
    for name in ("s5-ob251", "s7-200", "s7-200-paper", "s7-200-pid", "s7-300", "fb41", "weg", "on-off")
}

"""Which heater of a printer its gains are of: what the exports of Klipper and Marlin call it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.open_points import OpenPoint, never

__all__ = ["KLIPPER_HEATER", "MARLIN_HEATER", "PLACEHOLDER", "UNKNOWN", "several"]

UNKNOWN: Final = "unknown"
#: name of a heater that is not known: a printer refuses a file that has it
PLACEHOLDER: Final = "YOUR_HEATER"

KLIPPER_HEATER: Final = OpenPoint(
    name="heater", means={UNKNOWN: 0, "extruder": 1, "heater_bed": 2, "heater_generic": 3},
    summary=("extruder", "heater_bed", "heater_generic"), shows=never,
    reason="heater that the gains belong to: the section of printer.cfg; if it is unknown, the exported files name "
           "no heater",
)
MARLIN_HEATER: Final = OpenPoint(
    name="heater", means={UNKNOWN: 0, "hotend": 1, "bed": 2}, summary=("hotend", "bed"), shows=never,
    reason="heater that the gains belong to: M301 and DEFAULT_Kp of a hot end, or M304 and DEFAULT_bedKp of a bed; "
           "if it is unknown, the exported files contain both as comments",
)


def several(source: str, heads: str, kinds: Sequence[str]) -> InputError:
    """Construct the error of a text with the gains of several heaters.

    Args:
        source: name of the text.
        heads: what the text calls the heaters.
        kinds: settings of the open point `heater` that select one of them.
    """
    ways = " or ".join(f"--assume heater={kind}" for kind in kinds) or "a text without the others"
    return InputError(f"{source}: gains of {heads}; expected those of one heater: {ways}")

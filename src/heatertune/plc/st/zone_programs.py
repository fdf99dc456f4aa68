"""Structured text of several zones in one source: the function block once, a program with an instance for each zone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from heatertune.plc.st.program_text import comment

__all__ = ["source_of_zones"]

#: where the block and the program of one heater begin
_BLOCK: Final = "\nFUNCTION_BLOCK "
_PROGRAM: Final = "\nPROGRAM Heater"


def source_of_zones(sources: Sequence[tuple[str, str]]) -> str:
    """Return one source of the programs of all zones, Heater1, Heater2 and so on, each behind the remarks on its zone.

    Args:
        sources: of each zone its name and the text of its program, all with the same function block.
    """
    blocks, programs = "", list[str]()
    for number, (zone, text) in enumerate(sources, start=1):
        head, _, rest = text.partition(_BLOCK)
        block, _, program = rest.partition(_PROGRAM)
        blocks = f"{_BLOCK.lstrip()}{block}\n"
        title = comment(f"zone {number} of {len(sources)}: {zone}; run Heater{number} from the same task as the others")
        programs.append(f"{title}{head}{_PROGRAM}{number}{program}")
    return blocks + "\n".join(programs)

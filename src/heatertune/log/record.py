"""What a log of `heatertune record` has that others have not: lines that a kill tore, and gaps that are marked."""

from __future__ import annotations

from typing import Final

from heatertune.log.header import count

__all__ = ["MARK", "TORN", "without_torn"]

#: begins the first line
MARK: Final = "# heatertune record"
#: ends a line that was torn, once the file has been continued; else it is the last and has no line's end
TORN: Final = "#torn"
_GAP: Final = "# gap "
_SHOWN: Final = 3


def without_torn(text: str, repairs: list[str]) -> str:
    """Return the text with its torn lines blank, as many lines as before; what it marks is told in the repairs."""
    lines = text.split("\n")
    torn = [i for i, line in enumerate(lines) if line.endswith(TORN) or (line and i == len(lines) - 1)]
    for i in torn:
        repairs.append(f"Line {i + 1} was torn when the recording was cut off, and is left out: {lines[i]!r}.")
        lines[i] = ""
    gaps = [line.removeprefix(_GAP) for line in lines if line.startswith(_GAP)]
    if gaps:
        more = f"; and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
        repairs.append(f"The recording marks {count(len(gaps), 'gap')}: {'; '.join(gaps[:_SHOWN])}{more}.")
    return "\n".join(lines)

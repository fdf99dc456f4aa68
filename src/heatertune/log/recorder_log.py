"""What a log of `heatertune record` has that others have not: lines that a kill tore, and gaps that are marked."""

from __future__ import annotations

import re
from typing import Final

from heatertune.units import count

__all__ = ["MARK", "SWITCHED", "TORN", "pwm_period_of", "without_torn"]

#: begins the first line
MARK: Final = "# heatertune record"
#: in the first line, before the PWM period of the switch [s]
SWITCHED: Final = "; PWM period: "
#: ends a line that was torn, once the file has been continued; else it is the last and has no line's end
TORN: Final = "#torn"
_GAP: Final = "# gap "
_SHOWN: Final = 3
_PERIOD: Final = re.compile(re.escape(SWITCHED) + r"(\d+(?:\.\d+)?(?:e-?\d+)?) s\b")


def pwm_period_of(text: str) -> float:
    """Return the PWM period that the first line tells, 0 where it tells none [s]."""
    told = _PERIOD.search(text.split("\n", 1)[0])
    return float(told[1]) if told else 0.0


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

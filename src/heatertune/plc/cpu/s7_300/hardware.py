"""The analog modules of an S7-300/400, and the clock of a cyclic interrupt (CPU 31x manual)."""

from typing import Final

from heatertune.pid.timer import Timer

__all__ = ["FULL_SCALE", "TIMER"]

#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648

#: OB35 is called every 1 ms to 1 min
TIMER: Final = Timer(shortest_s=0.001, longest_s=60.0, step_s=0.001)

"""The analog modules of an S7-300/400, and the clock of a cyclic interrupt (CPU 31x manual)."""

from typing import Final

from heatertune.pid.timer import Timer

__all__ = ["FULL_SCALE", "TICK_S", "TIMER"]

#: analog value at the upper end of a module's nominal range
FULL_SCALE: Final = 27648

#: OB35 is called every 1 ms to 1 min
TIMER: Final = Timer(shortest_s=0.001, longest_s=60.0, step_s=0.001)

#: OB35 as the exported program ticks where nobody asks for more: a half-wave of 50 Hz mains
TICK_S: Final = 0.01

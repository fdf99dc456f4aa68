"""The block in which a virtual PLC says what it does: its number, its cells, and its status as a value."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Final

__all__ = [
        "DEAD_MAN", "FAULTY", "GUARDED", "HEARTBEAT", "OWN", "OWN_CELLS", "OWN_LENGTH", "RELEASED", "RUNS", "SHOWN",
    "STATUS_BYTES", "STATUS_MARK", "SimulatorStatus",
]

#: number of the simulator's own block, which no real PLC has
OWN: Final = 1000

#: what stands in that block, in turn, high byte first, as `Told` has it; clients write `released` and `heartbeat`
_FORMATS: Final = {
    "intervals": "I", "scans": "I", "released": "I", "heartbeat": "H", "status": "H", "temperature_degC": "d",
    "power_pct": "d", "setpoint": "d", "reading": "d", "mark": "4s", "shown": "I", "interval_s": "d"}
STATUS_BYTES: Final = struct.Struct(">" + "".join(_FORMATS.values()))
OWN_LENGTH: Final = STATUS_BYTES.size


def _cells() -> dict[str, tuple[int, str]]:
    cells, start = dict[str, tuple[int, str]](), 0
    for name, code in _FORMATS.items():
        cells[name] = start, f">{code}"
        start += struct.calcsize(f">{code}")
    return cells


#: name → its first byte in that block, and its format as `struct` has it
OWN_CELLS: Final[Mapping[str, tuple[int, str]]] = _cells()


def _part(name: str) -> slice:
    start, code = OWN_CELLS[name]
    return slice(start, start + struct.calcsize(code))


RELEASED: Final = _part("released")
HEARTBEAT: Final = _part("heartbeat")
SHOWN: Final = _part("shown")
#: bits of `status`: the CPU is in RUN, the dead man has acted, a fault of the timetable is there, a dead man watches
RUNS: Final = 1
DEAD_MAN: Final = 2
FAULTY: Final = 4
GUARDED: Final = 8
#: what makes a block the simulator's own, and not a machine's that has the same number
STATUS_MARK: Final = b"HTVP"


class SimulatorStatus:
    """What the simulator's own block says, by name.

    Attributes:
        intervals: of the plant's time that are over, each as long as the time between two scans.
        scans: that the CPU ran in them; it runs none in STOP.
        released: up to how many intervals may pass, with `--step`.
        heartbeat: as the host wrote it last.
        status: `RUNS`, `DEAD_MAN`, `FAULTY` and `GUARDED`.
        temperature_degC: that the sensor sees, noise included [°C].
        power_pct: asked for [%].
        setpoint, reading: in the controller's units.
        marked: whether this is a simulator's block at all.
        shown: the interval, counted from 1, whose scan the controller's block shows; 0: none yet.
        interval_s: how long an interval is [s].
    """

    __slots__ = ("heartbeat", "interval_s", "intervals", "marked", "power_pct", "reading", "released", "scans",
                 "setpoint", "shown", "status", "temperature_degC")

    def __init__(self, content: bytes) -> None:
        """Take the bytes of the block."""
        (self.intervals, self.scans, self.released, self.heartbeat, self.status, self.temperature_degC, self.power_pct,
         self.setpoint, self.reading, mark, self.shown, self.interval_s) = STATUS_BYTES.unpack(content)
        self.marked = mark == STATUS_MARK

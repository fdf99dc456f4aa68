"""The memory of a virtual PLC: its blocks as bytes, shared by the scan and by every protocol that serves them.

One word of a block as bytes, as somebody at a programming unit writes it, or as a client reads it.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from enum import Enum
from threading import Condition
from typing import Final, NamedTuple

from heatertune.errors import OutOfRange, UnknownName
from heatertune.plc.single_precision import single
from heatertune.plc.words import FORMATS, WordField

__all__ = [
    "DEAD_MAN",
    "FAULTY",
    "GUARDED",
    "OWN",
    "OWN_CELLS",
    "OWN_LENGTH",
    "RUNS",
    "STRUCTS",
    "Access",
    "BlockMemory",
    "Refusal",
    "Signal",
    "SimulatorStatus",
    "bytes_of",
    "field_of",
    "to_word_format",
]


#: format → how its bytes stand, the high one first
STRUCTS: Final = {"INT": ">h", "KF": ">h", "KM": ">H", "WORD": ">H", "UINT": ">H", "REAL": ">f", "TIME": ">i",
                  "DINT": ">i", "UDINT": ">I", "LREAL": ">d", "BYTE": ">B"}


class Signal(NamedTuple):
    """A quantity that a block shows.

    Attributes:
        start: its first byte.
        format: of `STRUCTS`.
        raw: two numbers as they stand there.
        shown: what they mean, in the quantity's unit; the scale is straight.
        turned: whether the low one of two words comes first.
    """

    start: int
    format: str
    raw: tuple[float, float] = (0.0, 1.0)
    shown: tuple[float, float] = (0.0, 1.0)
    turned: bool = False

    @property
    def size(self) -> int:
        """Its bytes."""
        return struct.calcsize(STRUCTS[self.format])

    def of(self, content: bytes, begin: int = 0) -> float:
        """Return the quantity in bytes of the block that begin at one of its bytes."""
        own = content[self.start - begin : self.start - begin + self.size]
        found: float = struct.unpack(STRUCTS[self.format], own[2:] + own[:2] if self.turned else own)[0]
        (raw_0, raw_1), (shown_0, shown_1) = self.raw, self.shown
        return shown_0 + (found - raw_0) * (shown_1 - shown_0) / (raw_1 - raw_0)

    def bytes_of(self, quantity: float) -> bytes:
        """Return the bytes that show a quantity, or that nearest to it.

        Raises:
            OutOfRange: the format does not hold it.
        """
        (raw_0, raw_1), (shown_0, shown_1) = self.raw, self.shown
        raw = raw_0 + (quantity - shown_0) * (raw_1 - raw_0) / (shown_1 - shown_0)
        try:
            if not math.isfinite(raw):
                raise OverflowError
            return struct.pack(STRUCTS[self.format], raw if self.format == "REAL" else round(raw))
        except (struct.error, OverflowError):
            raise OutOfRange("quantity", quantity, f"one that {self.format} holds") from None


def field_of(fields: Sequence[WordField], name: str) -> WordField:
    """Return the word of a name.

    Raises:
        UnknownName: the controller has no such word.
    """
    for field in fields:
        if field.name == name:
            return field
    raise UnknownName("word", name, [field.name for field in fields])


def to_word_format(field: WordField, value: float) -> float:
    """Return a number as the word's format has it; whatever that holds goes, as on a real PLC.

    Raises:
        OutOfRange: a number that the format does not hold.
    """
    low, high = FORMATS[field.format]
    whole = field.format != "REAL"
    if not low <= value <= high or (whole and value != int(value)):
        kind = "a whole number" if whole else "a number"
        raise OutOfRange(f"word {field.name}", value, f"{kind} {low:.9g}…{high:.9g}")
    return int(value) if whole else single(value)


def bytes_of(field: WordField, value: float) -> bytes:
    """Return a number as the word's bytes; raise OutOfRange as `checked`."""
    return struct.pack(STRUCTS[field.format], to_word_format(field, value))


#: number of the simulator's own block, which no real PLC has
OWN: Final = 1000

#: what stands in that block, in turn, high byte first, as `Told` has it; clients write `released` and `heartbeat`
_FORMATS: Final = {
    "intervals": "I", "scans": "I", "released": "I", "heartbeat": "H", "status": "H", "temperature_degC": "d",
    "power_pct": "d", "setpoint": "d", "reading": "d", "mark": "4s", "shown": "I", "interval_s": "d"}
_TOLD: Final = struct.Struct(">" + "".join(_FORMATS.values()))
OWN_LENGTH: Final = _TOLD.size


def _cells() -> dict[str, tuple[int, str]]:
    found, start = dict[str, tuple[int, str]](), 0
    for name, code in _FORMATS.items():
        found[name] = start, f">{code}"
        start += struct.calcsize(f">{code}")
    return found


#: name → its first byte in that block, and its format as `struct` has it
OWN_CELLS: Final[Mapping[str, tuple[int, str]]] = _cells()


def _part(name: str) -> slice:
    start, code = OWN_CELLS[name]
    return slice(start, start + struct.calcsize(code))


_RELEASED: Final = _part("released")
_HEARTBEAT: Final = _part("heartbeat")
_SHOWN: Final = _part("shown")
#: bits of `status`: the CPU is in RUN, the dead man has acted, a fault of the timetable is there, a dead man watches
RUNS: Final = 1
DEAD_MAN: Final = 2
FAULTY: Final = 4
GUARDED: Final = 8
#: what makes a block the simulator's own, and not a machine's that has the same number
_MARK: Final = b"HTVP"


class Access(Enum):
    """Why a block cannot be read or written."""

    MISSING = "there is no such block"
    OUTSIDE = "beyond the end of the block"
    PROTECTED = "the block is write-protected"


class Refusal(Exception):
    """Raised when a client asks for what a PLC refuses; never a user's error."""

    def __init__(self, why: Access) -> None:
        self.why = why
        super().__init__(why.value)


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
         self.setpoint, self.reading, mark, self.shown, self.interval_s) = _TOLD.unpack(content)
        self.marked = mark == _MARK


class BlockMemory:
    """Blocks by number; each read and each write is whole, whoever asks.

    Attributes:
        changed: the lock of all blocks, notified at each write of a client.
        main: number of the controller's block.
        missing, protected: whether the controller's block is not there, or cannot be written.
        length: of the controller's block as clients see it [bytes].
    """

    def __init__(
        self, main: int, content: bytes, interval_s: float, also: Mapping[int, int] | None = None
    ) -> None:
        """Lay out the blocks.

        Args:
            main: number of the controller's block.
            content: of that block.
            interval_s: time between two scans [s].
            also: other numbers under which it is known.
        """
        self.changed = Condition()
        self.main, self.length, self._interval_s = main, len(content), interval_s
        self.missing = self.protected = False
        self._blocks = {main: bytearray(content), OWN: bytearray(OWN_LENGTH)}
        self._names = {main: main, OWN: OWN, **(also or {})}
        self.tell(0, 0, 0, (0.0, 0.0, 0.0, 0.0))

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of all blocks."""
        return tuple(self._blocks)

    def size(self, number: int) -> int:
        """Return how long a block is, whatever is wrong with it [bytes]."""
        return len(self._blocks[number])

    def block_size(self, number: int) -> int:
        """Return how long a client finds a block [bytes]."""
        return self.length if number == self.main else self.size(number)

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block, for a client; raise `Refusal` where the PLC would refuse."""
        with self.changed:
            return bytes(self._block(number, start, count)[start : start + count])

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block, all of them or none, for a client; raise `Refusal` where the PLC would refuse."""
        with self.changed:
            block = self._block(number, start, len(content))
            if self.protected and block is self._blocks[self.main]:
                raise Refusal(Access.PROTECTED)
            block[start : start + len(content)] = content
            self.changed.notify_all()

    def _block(self, number: int, start: int, count: int) -> bytearray:
        known = self._names.get(number)
        if known is None or (self.missing and known == self.main):
            raise Refusal(Access.MISSING)
        block = self._blocks[known]
        if start < 0 or count < 0 or start + count > self.block_size(known):
            raise Refusal(Access.OUTSIDE)
        return block

    def image(self) -> bytes:
        """Return the controller's block as the scan finds it."""
        with self.changed:
            return bytes(self._blocks[self.main])

    def write_changes(
        self, before: bytes, after: bytes | bytearray, part: slice = slice(None), *, scan_of: int | None = None
    ) -> None:
        """Write what a scan has changed, and nothing else: what clients wrote meanwhile stays.

        Args:
            before: as the scan found the controller's block.
            after: as it left it.
            part: of it.
            scan_of: the interval whose scan it was, which is told at the same instant.
        """
        with self.changed:
            if scan_of is not None:
                self._blocks[OWN][_SHOWN] = (scan_of & 0xFFFFFFFF).to_bytes(4, "big")
            if before == after:
                return
            block = self._blocks[self.main]
            for at in range(*part.indices(len(block))):
                if before[at] != after[at]:
                    block[at] = after[at]

    def tell(self, intervals: int, scans: int, status: int, seen: tuple[float, float, float, float]) -> None:
        """Write what the simulator tells into its own block; see `Told` for the meaning.

        Args:
            intervals: that are over.
            scans: that were run.
            status: bits.
            seen: temperature, power, setpoint, reading.
        """
        with self.changed:
            own = self._blocks[OWN]
            kept = [(part, own[part]) for part in (_RELEASED, _HEARTBEAT, _SHOWN)]
            own[:] = _TOLD.pack(intervals & 0xFFFFFFFF, scans & 0xFFFFFFFF, 0, 0, status, *seen, _MARK, 0,
                                self._interval_s)
            for part, content in kept:
                own[part] = content

    @property
    def released(self) -> int:
        """Up to how many intervals clients let pass."""
        return int.from_bytes(self._blocks[OWN][_RELEASED], "big")

    @property
    def heartbeat(self) -> bytes:
        """As a client wrote it last."""
        return bytes(self._blocks[OWN][_HEARTBEAT])

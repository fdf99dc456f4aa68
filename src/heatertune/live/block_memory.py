"""The memory of a virtual PLC: its blocks as bytes, shared by the scan and by every protocol that serves them.

Also the layout of a controller's block (`Layout`), one scan of a controller on the cells of its block (`Laid`), and
the conversion of a word to bytes and back.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from threading import Condition
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.live.simulator_status import HEARTBEAT, OWN, OWN_LENGTH, RELEASED, SHOWN, STATUS_BYTES, STATUS_MARK
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import FORMATS, WordField

__all__ = [
    "ALL",
    "BLOCKS",
    "MODBUS",
    "STRUCTS",
    "WORDS",
    "Access",
    "BlockMemory",
    "BlockSignal",
    "CellAddress",
    "Laid",
    "Layout",
    "Refusal",
    "RegisterRange",
    "bytes_of",
    "field_of",
    "members",
    "registers",
    "to_word_format",
]


#: format → how its bytes stand, the high one first
STRUCTS: Final = {"INT": ">h", "KF": ">h", "KM": ">H", "WORD": ">H", "UINT": ">H", "REAL": ">f", "TIME": ">i",
                  "DINT": ">i", "UDINT": ">I", "LREAL": ">d", "BYTE": ">B"}


class BlockSignal(NamedTuple):
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
        raw = self.number(content[self.start - begin : self.start - begin + self.size])
        (raw_0, raw_1), (shown_0, shown_1) = self.raw, self.shown
        return shown_0 + (raw - raw_0) * (shown_1 - shown_0) / (raw_1 - raw_0)

    def number(self, cells: bytes) -> float:
        """Return the number in its own bytes."""
        number: float = struct.unpack(STRUCTS[self.format], cells[2:] + cells[:2] if self.turned else cells)[0]
        return number

    def stored(self, number: Number) -> bytes:
        """Return the bytes of a number that the format holds."""
        cells = struct.pack(STRUCTS[self.format], number)
        return cells[2:] + cells[:2] if self.turned else cells

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
    for word in fields:
        if word.name == name:
            return word
    raise UnknownName("word", name, [word.name for word in fields])


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


class BlockMemory:
    """Blocks by number; each read and each write is whole, whoever asks.

    Attributes:
        changed: the lock of all blocks, notified at each write of a client.
        main: number of the controller's block.
        missing, protected: whether the controller's block is not there, or cannot be written.
        length: of the controller's block as clients see it [bytes].
        gateway: what stands between clients and the controller's block; None: nothing.
    """

    gateway: Any = None

    def __init__(
        self, main: int, content: bytes, interval_s: float, also: Mapping[int, int] | None = None, *,
        first: BlockMemory | None = None,
    ) -> None:
        """Lay out the blocks.

        Args:
            main: number of the controller's block.
            content: of that block.
            interval_s: time between two scans [s].
            also: other numbers under which it is known.
            first: memory of the first controller in the same PLC, which clients access, and which reaches this block,
                too; None: this is the first.
        """
        self.changed: Condition = Condition() if first is None else first.changed
        self.main, self.length, self._interval_s = main, len(content), interval_s
        self.missing = self.protected = False
        own: bytearray = bytearray(OWN_LENGTH) if first is None else first._blocks[OWN]
        self._blocks: dict[int, bytearray] = {main: bytearray(content), OWN: own}
        self._names = {main: main, OWN: OWN, **(also or {})}
        self._others: dict[int, BlockMemory] = {}
        if first is None:
            self.tell(0, 0, 0, (0.0, 0.0, 0.0, 0.0))
        else:
            first._others[main] = self

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of all blocks."""
        return *self._blocks, *self._others

    def size(self, number: int) -> int:
        """Return how long a block is, whatever is wrong with it [bytes]."""
        return len(self._holder(number)._blocks[number])

    def block_size(self, number: int) -> int:
        """Return how long a client finds a block [bytes]."""
        holder = self._holder(number)
        return holder.length if number == holder.main else self.size(number)

    def _holder(self, number: int) -> BlockMemory:
        """Return the memory of the controller whose block has a number."""
        return self._others.get(number, self)

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block, for a client; raise `Refusal` where the PLC would refuse."""
        if number in self._others:
            return self._others[number].read(number, start, count)
        with self.changed:
            block: bytes | bytearray = self._block(number, start, count)
            if self.gateway is not None and block is self._blocks[self.main]:
                block = self.gateway.read(block)
            return bytes(block[start : start + count])

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block, all of them or none, for a client; raise `Refusal` where the PLC would refuse."""
        if number in self._others:
            self._others[number].write(number, start, content)
            return
        with self.changed:
            block = self._block(number, start, len(content))
            if self.protected and block is self._blocks[self.main]:
                raise Refusal(Access.PROTECTED)
            if self.gateway is None or block is not self._blocks[self.main]:
                block[start : start + len(content)] = content
            else:
                for at, arriving in self.gateway.write(block, start, content):
                    block[at : at + len(arriving)] = arriving
            self.changed.notify_all()

    def carry_out(self, start: int, content: bytes) -> None:
        """Write bytes of the controller's block that a client sent earlier."""
        with self.changed:
            self._blocks[self.main][start : start + len(content)] = content
            self.changed.notify_all()

    def _block(self, number: int, start: int, count: int) -> bytearray:
        block_name = self._names.get(number)
        if block_name is None or (self.missing and block_name == self.main):
            raise Refusal(Access.MISSING)
        block = self._blocks[block_name]
        if start < 0 or count < 0 or start + count > self.block_size(block_name):
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
                self._blocks[OWN][SHOWN] = (scan_of & 0xFFFFFFFF).to_bytes(4, "big")
            if before == after:
                return
            block = self._blocks[self.main]
            for at in range(*part.indices(len(block))):
                if before[at] != after[at]:
                    block[at] = after[at]

    def tell(self, intervals: int, scans: int, status: int, signals: tuple[float, float, float, float]) -> None:
        """Write what the simulator tells into its own block; see `Told` for the meaning.

        Args:
            intervals: that are over.
            scans: that were run.
            status: bits.
            signals: temperature, power, setpoint, reading.
        """
        with self.changed:
            own = self._blocks[OWN]
            own_parts = [(part, own[part]) for part in (RELEASED, HEARTBEAT, SHOWN)]
            own[:] = STATUS_BYTES.pack(
                intervals & 0xFFFFFFFF, scans & 0xFFFFFFFF, 0, 0, status, *signals, STATUS_MARK, 0, self._interval_s)
            for part, content in own_parts:
                own[part] = content

    @property
    def released(self) -> int:
        """Up to how many intervals clients let pass."""
        return int.from_bytes(self._blocks[OWN][RELEASED], "big")

    @property
    def heartbeat(self) -> bytes:
        """As a client wrote it last."""
        return bytes(self._blocks[OWN][HEARTBEAT])


#: protocols of a PLC whose block is a data block; Modbus has it word by word, as gateways give it
BLOCKS: Final = ("s7", "modbus", "opcua")
#: of one that only Modbus reaches
MODBUS: Final = ("modbus",)

#: what a start-up leaves as before the first scan, see `Layout`
WORDS: Final = "words"
ALL: Final = "all"

_STRUCTS: Final = {format_: struct.Struct(code) for format_, code in STRUCTS.items()}


class CellAddress(NamedTuple):
    """Where a number stands in a block.

    Attributes:
        byte: its first.
        format: BOOL, or of `heatertune.live.block_memory.STRUCTS`.
        bit: of that byte, for a BOOL.
        turned: whether the two words of a REAL stand with the low one first.
    """

    byte: int
    format: str
    bit: int = 0
    turned: bool = False

    @property
    def part(self) -> slice:
        """Its bytes."""
        return slice(self.byte, self.byte + (1 if self.format == "BOOL" else _STRUCTS[self.format].size))

    def read(self, cells: bytes | bytearray) -> Any:
        """Return the number that stands there, whatever it is."""
        if self.format == "BOOL":
            return bool(cells[self.byte] >> self.bit & 1)
        return _STRUCTS[self.format].unpack(self._turned(cells[self.part]))[0]

    def write(self, cells: bytearray, value: Number) -> None:
        """Write a number that the format holds; of a REAL the nearest single."""
        if self.format == "BOOL":
            cells[self.byte] = cells[self.byte] & ~(1 << self.bit) | bool(value) << self.bit
        else:
            number = single(value) if self.format == "REAL" else int(value)
            cells[self.part] = self._turned(_STRUCTS[self.format].pack(number))

    def _turned(self, content: bytes | bytearray) -> bytes | bytearray:
        return content[2:] + content[:2] if self.turned else content


class RegisterRange(NamedTuple):
    """Modbus registers that stand one after the other.

    Attributes:
        first: register.
        byte: of the block, where it stands.
        size: how many.
    """

    first: int
    byte: int
    size: int


def members(named: Sequence[tuple[str, str]]) -> dict[str, CellAddress]:
    """Return name → place for names and formats in the order of a data block of standard access.

    Bits stand one after the other, all else from an even byte on.
    """
    addresses, byte, bit = dict[str, CellAddress](), 0, 0
    for name, format_ in named:
        if format_ == "BOOL":
            byte, bit = (byte + 1, 0) if bit > 7 else (byte, bit)
            addresses[name] = CellAddress(byte, format_, bit)
            bit += 1
            continue
        byte, bit = byte + bool(bit), 0
        addresses[name] = place = CellAddress(byte + byte % 2, format_)
        byte = place.part.stop
    return addresses


def registers(wanted: Mapping[str, tuple[int, str]], *, turned: bool = False) -> tuple[dict[str, CellAddress],
                                                                                       list[RegisterRange]]:
    """Return name → place, and the runs, of registers that are anywhere; the block has them without gaps.

    Args:
        wanted: name → register and format.
        turned: whether a REAL has its low word first.
    """
    addresses, runs, byte = dict[str, CellAddress](), list[RegisterRange](), 0
    for name, (register, format_) in sorted(wanted.items(), key=lambda entry: entry[1][0]):
        addresses[name] = place = CellAddress(byte, format_, turned=turned and format_ == "REAL")
        size = (place.part.stop - byte) // 2
        if runs and runs[-1].first + runs[-1].size == register:
            runs[-1] = runs[-1]._replace(size=runs[-1].size + size)
        else:
            runs.append(RegisterRange(register, byte, size))
        byte = place.part.stop
    return addresses, runs


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where the cells of a block stand.

    Attributes:
        number, told, speaks, registers: see `heatertune.live.controller_block.ServedBlock`.
        length: of the block [bytes].
        setpoint, reading, power: places of setpoint, reading and output.
        mode: place of what tells manual from automatic; None: it has none.
        manual_is: what stands there in manual, 0 or 1; in automatic it is the other.
        hand: place of the power in manual [%], beside the mode; None: there is none, or the program writes it.
        words: word → its place.
        inputs: what the controller's `scan_all` reads → its place.
        state: field of the controller's state → its place, as far as the real block keeps it where clients reach it.
        first: place → what stands there before the first scan, of cells that are not words.
        anew: what a start-up leaves as before the first scan: WORDS, ALL or nothing.
    """

    number: int = 1
    description: str
    speaks: tuple[str, ...] = BLOCKS
    registers: Sequence[RegisterRange] = ()
    length: int
    setpoint: CellAddress
    reading: CellAddress
    power: CellAddress
    mode: CellAddress | None = None
    manual_is: int = 0
    hand: CellAddress | None = None
    words: Mapping[str, CellAddress]
    inputs: Mapping[str, CellAddress] = field(default_factory=dict)
    state: Mapping[str, CellAddress] = field(default_factory=dict)
    first: Mapping[CellAddress, Number] = field(default_factory=dict)
    anew: str = ""


class Laid:
    """A controller's block, cell by cell; see `heatertune.live.controller_block.ServedBlock`.

    Attributes:
        layout: where its cells stand.
    """

    layout: Layout

    def __init__(self, controller: Controller, words: Words, assume: Any) -> None:
        """Take words that run under assumptions.

        Args:
            controller: whose block it is.
            words: that it holds at the beginning.
            assume: what the manual leaves open.
        """
        layout = self.layout
        self.number, self.description, self.manual = layout.number, layout.description, layout.mode is not None
        self.speaks, self.registers = layout.speaks, layout.registers
        self.signals = self._signals((words.scaling.low_degC, words.scaling.high_degC))
        self.words = {name: self._signal(place) for name, place in layout.words.items() if place.format in STRUCTS}
        self.bits = {name: (place.byte, place.bit) for name, place in layout.words.items() if place.format == "BOOL"}
        self.mode = layout.mode.part if layout.mode is not None else slice(0)
        self.undone_by = "a start-up of the CPU loads the words of its program" if layout.anew else ""
        self.operators: tuple[str, ...] = ()
        self._controller, self._words, self._assume = controller, words, assume
        self._running = controller.begin(words, assume)
        self._asked: Number | None = None
        self._anew = ""
        cells = bytearray(layout.length)
        for place, value in layout.first.items():
            place.write(cells, value)
        self.into_automatic(cells)
        self._load(cells)
        self._keep(cells, self._running.state)
        self._image, self._held = bytes(cells), _parts(cells, layout.words)

    def image(self) -> bytes:
        """Return the block before the first scan."""
        return self._image

    def begin(self) -> Any:
        """Return the cold state."""
        return self._running.state

    def scan(self, cells: bytearray, state: Any, setpoint: Number, reading: Number) -> tuple[Any, float, Number, int]:
        """Run one scan; see `heatertune.live.controller_block.ServedBlock`."""
        if self._anew == ALL:
            cells[:] = self._image
        elif self._anew == WORDS:
            self._load(cells)
        self._anew = ""
        running = self._taken(cells)
        if setpoint != self._asked:
            self.ask(cells, running, setpoint)
            self._asked = setpoint
        self.read_in(cells, reading)
        if self.layout.state and _parts(cells, self.layout.state) != self._kept:
            state = state._replace(**{name: place.read(cells) for name, place in self.layout.state.items()})
        after, power, output, flags = self.run(cells, running, state, reading)
        self.tell(cells, running, after, output)
        self._keep(cells, after)
        return after, power, output, flags

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:  # noqa: ARG002 - some need them
        """Return where it shows temperature, power and setpoint; `degC` are both ends of the sensor."""
        at = self.layout
        return {"temperature": self._signal(at.reading), "power": self._signal(at.power),
                "setpoint": self._signal(at.setpoint)}

    def _signal(self, place: CellAddress, raw: tuple[float, float] = (0.0, 1.0),
                shown: tuple[float, float] = (0.0, 1.0)) -> BlockSignal:
        """Return the content of a place; of registers that are not in a row, register r is at byte 2·r."""
        start = place.byte if len(self.registers) < 2 else next(
            2 * run.first + place.byte - run.byte for run in self.registers
            if run.byte <= place.byte < run.byte + 2 * run.size)
        return BlockSignal(start, place.format, raw, shown, place.turned)

    def ask(self, cells: bytearray, running: ControllerState, setpoint: Number) -> None:  # noqa: ARG002 - some need them
        """Write another setpoint than at the scan before."""
        self.layout.setpoint.write(cells, setpoint)

    def read_in(self, cells: bytearray, reading: Number) -> None:
        """Write the reading."""
        self.layout.reading.write(cells, reading)

    def run(
        self, cells: bytearray, running: ControllerState, state: Any, reading: Number  # noqa: ARG002 - some need it
    ) -> tuple[Any, float, Number, int]:
        """Return the result of the controller's own step for the inputs as they stand there."""
        assert self._controller.scan_all is not None
        inputs = {name: place.read(cells) for name, place in self.layout.inputs.items()}
        return self._controller.scan_all(running.parameters, state, inputs)

    def tell(self, cells: bytearray, running: ControllerState, after: Any, output: Number) -> None:  # noqa: ARG002 - some tell
        """Write what the block shows of a scan."""
        self.layout.power.write(cells, output)

    def _load(self, cells: bytearray) -> None:
        for name, place in self.layout.words.items():
            place.write(cells, self._words.values[name])

    def _taken(self, cells: bytearray) -> ControllerState:
        """Return the controller with the words that stand there, in the cold state."""
        parts = _parts(cells, self.layout.words)
        if parts != self._held:
            values = {name: place.read(cells) for name, place in self.layout.words.items()}
            self._running = self._controller.begin(replace(self._words, values=values), self._assume)
            self._held = parts
        return self._running

    def _keep(self, cells: bytearray, state: Any) -> None:
        for name, place in self.layout.state.items():
            place.write(cells, getattr(state, name))
        self._kept = _parts(cells, self.layout.state)

    def restarted(self, state: Any) -> Any:
        """Return the state after a start-up."""
        self._anew = self.layout.anew
        self._asked = None if self._anew == ALL else self._asked
        return self._controller.core.warm_start(self._running.parameters, self._running.state, state)

    def in_manual(self, cells: bytes | bytearray) -> bool:
        """Return whether it is in manual."""
        return self.layout.mode is not None and bool(self.layout.mode.read(cells)) == bool(self.layout.manual_is)

    def into_automatic(self, cells: bytearray) -> None:
        """Put it in automatic."""
        if self.layout.mode is not None:
            self.layout.mode.write(cells, 1 - self.layout.manual_is)

    def put_in_manual(self, cells: bytes, power_pct: float) -> tuple[int, bytes]:
        """Return mode and power, side by side; see `heatertune.live.controller_block.ServedBlock`.

        Raises:
            InputError: there is no manual mode, or the program around writes mode and power at each call.
        """
        mode, hand = self.layout.mode, self.layout.hand
        if mode is None or hand is None:
            why = "has no manual mode here" if mode is None else (
                "is told mode and power in manual by its program at each call (the exported one has them in DB101), so "
                "that what a client writes into the instance does not stay")
            raise InputError(f"{self._controller.name} {why}: set the powers manually, and record")
        image = bytearray(cells)
        mode.write(image, self.layout.manual_is)
        hand.write(image, power_pct)
        begin, end = min(mode.byte, hand.byte), max(mode.part.stop, hand.part.stop)
        return begin, bytes(image[begin:end])

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word; errors as `heatertune.live.block_memory`."""
        field = field_of([each for each in self._controller.fields if each.name in self.layout.words], name)
        self.layout.words[name].write(cells, to_word_format(field, value))


def _parts(cells: bytes | bytearray, places: Mapping[str, CellAddress]) -> bytes:
    return b"".join(cells[place.part] for place in places.values())

"""A controller's block whose cells stand at known places: one scan on them, by the controller's own step."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Final, NamedTuple

from heatertune.live.cells import checked, field_of
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.core import Running
from heatertune.plc.ramp import Number
from heatertune.plc.single import single

__all__ = ["BOTH", "MODBUS", "Laid", "Place", "Run", "members", "registers"]

#: protocols of a PLC whose block is a data block; Modbus has it word by word, as gateways give it
BOTH: Final = ("s7", "modbus")
#: of one that only Modbus reaches
MODBUS: Final = ("modbus",)

#: format → how its bytes stand, the high one first
_STRUCTS: Final = {format_: struct.Struct(code) for format_, code in {
    "INT": ">h", "UINT": ">H", "TIME": ">i", "REAL": ">f"}.items()}


class Place(NamedTuple):
    """Where a number stands in a block.

    Attributes:
        byte: its first.
        format: BOOL, INT, UINT, TIME or REAL.
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


class Run(NamedTuple):
    """Modbus registers that stand one after the other.

    Attributes:
        first: register.
        byte: of the block, where it stands.
        count: of registers.
    """

    first: int
    byte: int
    count: int


def members(named: Sequence[tuple[str, str]]) -> dict[str, Place]:
    """Return name → place for names and formats in the order of a data block of standard access.

    Bits stand one after the other, all else from an even byte on.
    """
    found, byte, bit = dict[str, Place](), 0, 0
    for name, format_ in named:
        if format_ == "BOOL":
            byte, bit = (byte + 1, 0) if bit > 7 else (byte, bit)
            found[name] = Place(byte, format_, bit)
            bit += 1
            continue
        byte, bit = byte + bool(bit), 0
        found[name] = place = Place(byte + byte % 2, format_)
        byte = place.part.stop
    return found


def registers(wanted: Mapping[str, tuple[int, str]], *, turned: bool = False) -> tuple[dict[str, Place], list[Run]]:
    """Return name → place, and the runs, of registers that are anywhere; the block has them without gaps.

    Args:
        wanted: name → register and format.
        turned: whether a REAL has its low word first.
    """
    found, runs, byte = dict[str, Place](), list[Run](), 0
    for name, (register, format_) in sorted(wanted.items(), key=lambda each: each[1][0]):
        found[name] = place = Place(byte, format_, turned=turned and format_ == "REAL")
        count = (place.part.stop - byte) // 2
        if runs and runs[-1].first + runs[-1].count == register:
            runs[-1] = runs[-1]._replace(count=runs[-1].count + count)
        else:
            runs.append(Run(register, byte, count))
        byte = place.part.stop
    return found, runs


class Laid:
    """A controller's block, cell by cell; see `heatertune.live.blocks.Block`.

    A class says where its cells stand. What the real block keeps there of its state is found there in the next scan,
    with what somebody has written to it since; what it keeps elsewhere nobody reaches.

    Attributes:
        LENGTH: of the block [bytes].
        SETPOINT, READING, POWER: places of setpoint, reading and output.
        MODE: place of the bit or word that tells manual from automatic; None: it has none.
        AUTOMATIC: what stands there in automatic.
        MANUAL: what stands there in manual.
        WORDS: word → its place.
        INPUTS: what the controller's `scan_all` reads → its place.
        STATE: field of the controller's state → its place.
        FIRST: place → what stands there before the first scan, of cells that are not words.
        reloads: whether the program loads the words anew at a start-up.
    """

    number: int = 1
    told: str = ""
    speaks: tuple[str, ...] = BOTH
    registers: Sequence[Run] = ()
    LENGTH: ClassVar[int]
    SETPOINT: ClassVar[Place]
    READING: ClassVar[Place]
    POWER: ClassVar[Place]
    MODE: ClassVar[Place | None] = None
    AUTOMATIC: ClassVar[int] = 1
    MANUAL: ClassVar[int] = 0
    WORDS: ClassVar[Mapping[str, Place]]
    INPUTS: ClassVar[Mapping[str, Place]]
    STATE: ClassVar[Mapping[str, Place]] = {}
    FIRST: ClassVar[Mapping[Place, Number]] = {}
    reloads: ClassVar[bool] = False

    def __init__(self, controller: Controller, words: Words, assume: Any) -> None:
        """Take words that run under assumptions.

        Args:
            controller: whose block it is.
            words: that it holds at the beginning.
            assume: what the manual leaves open.
        """
        self._controller, self._words, self._assume = controller, words, assume
        self._running = controller.begin(words, assume)
        self._asked: Number | None = None
        self._loads = False
        cells = bytearray(self.LENGTH)
        for place, value in self.FIRST.items():
            place.write(cells, value)
        if self.MODE is not None:
            self.MODE.write(cells, self.AUTOMATIC)
        self._load(cells)
        self._keep(cells, self._running.state)
        self._image, self._held = bytes(cells), _parts(cells, self.WORDS)

    @property
    def manual(self) -> bool:
        """Whether there is a manual mode."""
        return self.MODE is not None

    def image(self) -> bytes:
        """Return the block before the first scan."""
        return self._image

    def begin(self) -> Any:
        """Return the cold state."""
        return self._running.state

    def scan(
        self, cells: bytearray, state: Any, setpoint: Number, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Run one scan; see `heatertune.live.blocks.Block`."""
        if self._loads:
            self._load(cells)
            self._loads = False
        running = self._taken(cells)
        if setpoint != self._asked:
            self.ask(cells, running, setpoint)
            self._asked = setpoint
        self.read_in(cells, reading)
        if self.STATE and _parts(cells, self.STATE) != self._kept:
            state = state._replace(**{name: place.read(cells) for name, place in self.STATE.items()})
        after, power, output, flags = self.run(cells, running, state, reading)
        self.tell(cells, running, after, output)
        self._keep(cells, after)
        return after, power, output, flags

    def ask(self, cells: bytearray, running: Running, setpoint: Number) -> None:  # noqa: ARG002 - some need them
        """Write another setpoint than at the scan before."""
        self.SETPOINT.write(cells, setpoint)

    def read_in(self, cells: bytearray, reading: Number) -> None:
        """Write the reading."""
        self.READING.write(cells, reading)

    def run(
        self, cells: bytearray, running: Running, state: Any, reading: Number  # noqa: ARG002 - some need it
    ) -> tuple[Any, float, Number, int]:
        """Return what the controller's own step gives for the inputs as they stand there."""
        assert self._controller.scan_all is not None
        inputs = {name: place.read(cells) for name, place in self.INPUTS.items()}
        return self._controller.scan_all(running.parameters, state, inputs)

    def tell(self, cells: bytearray, running: Running, after: Any, output: Number) -> None:  # noqa: ARG002 - some tell
        """Write what the block shows of a scan."""
        self.POWER.write(cells, output)

    def _load(self, cells: bytearray) -> None:
        for name, place in self.WORDS.items():
            place.write(cells, self._words.values[name])

    def _taken(self, cells: bytearray) -> Running:
        """Return the controller with the words that stand there, in the cold state."""
        held = _parts(cells, self.WORDS)
        if held != self._held:
            values = {name: place.read(cells) for name, place in self.WORDS.items()}
            self._running = self._controller.begin(replace(self._words, values=values), self._assume)
            self._held = held
        return self._running

    def _keep(self, cells: bytearray, state: Any) -> None:
        for name, place in self.STATE.items():
            place.write(cells, getattr(state, name))
        self._kept = _parts(cells, self.STATE)

    def restarted(self, state: Any) -> Any:
        """Return the state after a start-up."""
        self._asked, self._loads = None, self.reloads
        return self._controller.core.restarted(self._running.parameters, self._running.state, state)

    def in_manual(self, cells: bytes | bytearray) -> bool:
        """Return whether it is in manual."""
        return self.MODE is not None and bool(self.MODE.read(cells)) == bool(self.MANUAL)

    def into_automatic(self, cells: bytearray) -> None:
        """Put it in automatic."""
        if self.MODE is not None:
            self.MODE.write(cells, self.AUTOMATIC)

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word; errors as `heatertune.live.cells`."""
        field = field_of([field for field in self._controller.fields if field.name in self.WORDS], name)
        self.WORDS[name].write(cells, checked(field, value))


def _parts(cells: bytes | bytearray, places: Mapping[str, Place]) -> bytes:
    return b"".join(cells[place.part] for place in places.values())

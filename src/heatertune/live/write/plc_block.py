"""One block of a PLC over a link that may fail, and the words of a controller in it as write requests.

Reads are repeated after a failure; a write is sent once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from heatertune.errors import InputError, LinkDown, LinkError, PlcRefused, ReplyLost
from heatertune.live.block_memory import BlockSignal, field_of, to_word_format
from heatertune.live.client.connection import Address, Client, ClosesOnExit, SignOfLife, connect, status_of_simulator
from heatertune.live.controller_block import SERVED, ServedBlock, block_for
from heatertune.live.hold import HOST, Clock
from heatertune.live.siemens_blocks import TAGGED, instance_of
from heatertune.live.simulator_status import RUNS, SimulatorStatus
from heatertune.plc import Controller, Words, controller_for
from heatertune.plc.ramp import Number

__all__ = ["BlockImage", "BlockSnapshot", "LinkSettings", "Peer", "WritePart", "block_image", "runs"]


#: target → why its words are not written, though a virtual PLC serves it
_OUT_OF_REACH: Final[Mapping[str, str]] = {
    "s7-200": "the program types its words in itself, and keeps setpoint, scale and ticks where no client reaches them"}
#: protocol over which words of one request do not reach the CPU together
_WORD_BY_WORD: Final = "as511"


@dataclass(frozen=True, slots=True)
class WritePart:
    """What one request writes.

    Attributes:
        names: the words in it.
        start: its first byte in the block.
        before, after: its bytes.
    """

    names: tuple[str, ...]
    start: int
    before: bytes
    after: bytes

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        return {"names": list(self.names), "start": self.start, "before": self.before.hex(), "after": self.after.hex()}


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockImage:
    """The words of a controller in one block of a PLC.

    Attributes:
        controller: whose words these are.
        block: as a virtual PLC has it, too.
        number: of the block in the PLC.
        spans: first byte, and how many, of what has to be read: all words and what is watched.
        whole: bytes that are written together at least: 2 where there are registers.
        together: whether neighbours that one request writes reach the CPU together.
    """

    controller: Controller
    block: ServedBlock
    number: int
    spans: tuple[tuple[int, int], ...]
    whole: int
    together: bool

    @property
    def begin(self) -> int:
        """First byte that is read."""
        return self.spans[0][0]

    @property
    def count(self) -> int:
        """Bytes that are read."""
        return sum(count for _, count in self.spans)

    @property
    def own(self) -> list[str]:
        """The words that the program around does not write."""
        return [name for name in self.block.words if name not in self.controller.written]

    def at(self, start: int) -> int:
        """Return where a byte of the block stands in what is read."""
        before = 0
        for begin, count in self.spans:
            if begin <= start < begin + count:
                return before + start - begin
            before += count
        raise ValueError(f"byte {start} is not read")

    def read(self, client: Client) -> bytes:
        """Return the content of the block; errors as `Client.read`."""
        return b"".join(client.read(self.number, begin, count) for begin, count in self.spans)

    def values(self, content: bytes) -> dict[str, Number]:
        """Return every word in the bytes of the block; a whole number is one."""
        raw = {name: self._of(content, signal) for name, signal in self.block.words.items()}
        return {name: value if self.block.words[name].format == "REAL" else int(value) for name, value in raw.items()}

    def bits(self, content: bytes) -> dict[str, int]:
        """Return the words of one bit that the program around does not write; they are looked at alone."""
        return {name: content[self.at(byte)] >> bit & 1 for name, (byte, bit) in self.block.bits.items()
                if name not in self.controller.written}

    def words(self, content: bytes, others: Words) -> Words:
        """Return what a PLC runs; what does not stand in the block is as in other words."""
        interval_s = self.interval_s(content)
        return replace(others, values={**others.values, **self.values(content), **self.bits(content)},
                       sample_time_s=others.sample_time_s if interval_s is None else interval_s)

    def interval_s(self, content: bytes) -> float | None:
        """Return the interval at which the controller is called, where words in the block tell it [s]."""
        words, rule = {**self.values(content), **self.bits(content)}, self.controller.interval_s
        return None if rule is None or any(field.name not in words for field in self.controller.fields) else rule(words)

    def signal(self, content: bytes, role: str) -> float:
        """Return a signal of the block, see `heatertune.live.controller_block.ServedBlock`."""
        return self._of(content, self.block.signals[role])

    def _of(self, content: bytes, signal: BlockSignal) -> float:
        return signal.of(content, signal.start - self.at(signal.start))

    def with_words(self, content: bytes, values: Mapping[str, Number]) -> bytes:
        """Return bytes of the block with words in them.

        Raises:
            OutOfRange: a number that its word does not hold.
        """
        cells = bytearray(content)
        for name, value in values.items():
            signal = self.block.words[name]
            field = replace(field_of(self.controller.fields, name), format=signal.format)
            at = self.at(signal.start)
            cells[at : at + signal.size] = signal.stored(to_word_format(field, value))
        return bytes(cells)

    def is_torn(self, name: str, value: Number, before: Number, after: Number) -> bool:
        """Return whether a word is at neither value, but has the first bytes of one and the last of the other.

        Bytes count in the order in which the block has them: a request, or an answer to it, ends behind any of them.
        """
        signal = self.block.words[name]
        stands, one, other = (signal.stored(each) for each in (value, before, after))
        if stands in (one, other):
            return False
        cuts = range(1, signal.size)
        mixtures = [first[:cut] + last[cut:] for first, last in ((one, other), (other, one)) for cut in cuts]
        read = [*map(signal.number, mixtures)]
        return value in read or stands in (*mixtures, *map(signal.stored, read))  # of many NaN one stays, and of zeros

    def parts(self, content: bytes, values: Mapping[str, Number]) -> list[WritePart]:
        """Return the parts to write so that words stand there: those that differ, neighbours together.

        Args:
            content: bytes of the block as they are.
            values: the words that are to stand there; others stay.

        Raises:
            OutOfRange: as `typed`.
        """
        now, then = self.values(content), self.with_words(content, values)
        runs: list[tuple[list[str], int, int]] = []
        for name, signal in sorted(self._changed(now, values), key=lambda entry: entry[1].start):
            begin, end = self._around(signal)
            if runs and runs[-1][2] >= begin and self.together:
                names, first, last = runs[-1]
                runs[-1] = [*names, name], first, max(last, end)
            else:
                runs.append(([name], begin, end))
        return [WritePart(tuple(names), first, content[self.at(first) : self.at(first) + last - first],
                     then[self.at(first) : self.at(first) + last - first]) for names, first, last in runs]

    def _changed(self, now: Mapping[str, Number], values: Mapping[str, Number]) -> Iterator[tuple[str, BlockSignal]]:
        return ((name, self.block.words[name]) for name, value in values.items() if now[name] != value)

    def _around(self, signal: BlockSignal) -> tuple[int, int]:
        begin = signal.start - signal.start % self.whole
        return begin, signal.start + signal.size + (signal.start + signal.size) % self.whole

    def in_manual(self, content: bytes) -> bool:
        """Return whether the controller is in manual."""
        mode = self.block.mode
        if not self.block.manual:
            return False
        at = self.at(mode.start)
        return self.block.in_manual(bytes(mode.start) + content[at : at + mode.stop - mode.start])


def block_image(words: Words, address: Address, switches: Mapping[str, str]) -> BlockImage:
    """Return where words stand in the PLC of an address.

    Raises:
        InputError: heatertune does not know where this controller keeps them, or the protocol does not reach it.
    """
    why = _OUT_OF_REACH.get(words.target, "" if words.target in SERVED else
                            "which cells of a PLC hold its words is not known")
    controller = controller_for(words.target)
    if not why:
        block = block_for(controller, words, switches)
        if address.protocol not in block.speaks:
            why = f"it is reached over {' and '.join(block.speaks)}, not over {address.protocol}"
        if instance_of(address.node) and words.target != TAGGED:
            why = f"only the tags of a PID_Compact ({TAGGED}) are known"
    if why:
        typed = ", ".join(f"{field.name} = {words.values[field.name]:.9g}" for field in controller.fields)
        raise InputError(f"{words.target} at {address.text}: {why}; enter its parameters manually: {typed}")
    number = block.number if address.protocol != "s7" or address.block is None else address.block
    together = address.protocol != _WORD_BY_WORD and not instance_of(address.node)
    return BlockImage(controller=controller, block=block, number=number, spans=_spans(block),
                      whole=2 if address.protocol == "modbus" else 1, together=together)


def _spans(block: ServedBlock) -> tuple[tuple[int, int], ...]:
    """Return the ranges to read: all at once, or, of registers that are not in a row, run by run."""
    if len(block.registers) > 1:
        return tuple((2 * run.first, 2 * run.size) for run in block.registers)
    cells = [slice(each.start, each.start + each.size) for each in (*block.words.values(), *block.signals.values())]
    cells += [slice(byte, byte + 1) for byte, _ in block.bits.values()]
    cells += [block.mode] if block.manual else []
    begin, end = min(each.start for each in cells), max(each.stop for each in cells)
    begin -= begin % 2  # whole registers
    return ((begin, end + end % 2 - begin),)


_SOON_S: Final = 0.002  # between two looks at a simulator, whose time may go fast
_LEAST_WAIT_S: Final = 5.0
_NOTHING_TOLD: Final = SignOfLife()


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """How a link is held.

    Attributes:
        tries: connections that are tried, one after the other, where one is lost.
        pause_s: before each but the first [s].
        timeout_s: after which an answer is lost [s].
        clock: of this machine.
    """

    tries: int = 5
    pause_s: float = 1.0
    timeout_s: float = 2.0
    clock: Clock = field(default_factory=lambda: HOST)


@dataclass(frozen=True, slots=True)
class BlockSnapshot:
    """What was seen in one moment.

    Attributes:
        content: bytes of the block, from the first that holds a word to the last.
        values: the words in them.
        told: the simulator's own block; None: this is none.
        time_s: of the plant where the simulator tells it, else of this machine [s].
        life: what the protocol tells of the CPU, where this is no simulator.
    """

    content: bytes
    values: Mapping[str, Number]
    status: SimulatorStatus | None
    time_s: float
    life: SignOfLife = _NOTHING_TOLD

    def is_new(self, last: BlockSnapshot) -> bool | None:
        """Return whether this is of another scan than the last look, None where nothing tells."""
        if self.status is not None and last.status is not None:
            return bool(self.status.scans != last.status.scans)
        return self.life.is_new(last.life)

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        scan = {} if self.status is None else {"scan": self.status.scans, "plc_s": self.time_s}
        return {**scan, "bytes": self.content.hex()}


class Peer(ClosesOnExit):
    """A PLC; it is connected to when it is first asked.

    Attributes:
        address: of the PLC.
        standing: what is there.
        clock: of this machine.
        moved: whether a look has shown anything else than the first one; if not, all may be a gateway's copy.
    """

    def __init__(self, address: Address, standing: BlockImage, interval_s: float,
                 link: LinkSettings | None = None) -> None:
        """Take an address.

        Args:
            address: of the PLC.
            standing: what is there.
            interval_s: time between two scans [s].
            link: how the link is held.
        """
        self.address, self.standing, self._interval_s = address, standing, interval_s
        self._link, self._client = link or LinkSettings(), None
        self.clock = self._link.clock
        self._simulated: bool | None = None
        self._first: BlockSnapshot | None = None
        self.moved = False

    _client: Client | None

    def look(self) -> BlockSnapshot:
        """Return the content of the block; a lost connection is opened again, as often as `Link` allows.

        Raises:
            LinkError: no connection, or the PLC says that there is no such block.
        """
        for number in range(self._link.tries):
            if number:
                self.clock.sleep(self._link.pause_s)
            try:
                return self._look()
            except PlcRefused:
                raise
            except LinkError as problem:
                self.close()
                last = problem
        raise last

    def _look(self) -> BlockSnapshot:
        client, at = self._connected(), self.standing
        content = at.read(client)
        status = self._simulator_status(client)
        clock_s = self.clock.now_s() if status is None else status.intervals * status.interval_s
        life = client.sign_of_life() if status is None else _NOTHING_TOLD
        look = BlockSnapshot(content, at.values(content), status, clock_s, life)
        first = self._first = self._first or look
        self.moved = self.moved or content != first.content or look.is_new(first) is True
        return look

    def _simulator_status(self, client: Client) -> SimulatorStatus | None:
        if self._simulated is False:
            return None
        status = status_of_simulator(client)
        self._simulated = status is not None
        return status

    def _connected(self) -> Client:
        if self._client is None:
            self._client = connect(self.address, self._link.timeout_s)
        return self._client

    def write(self, part: WritePart, content: bytes) -> None:
        """Write a part's bytes, once.

        Raises:
            PlcRefused, LinkDown: they were not written.
            ReplyLost: whether they were is not known.
        """
        try:
            self._connected().write(self.standing.number, part.start, content)
        except (LinkDown, ReplyLost):
            self.close()
            raise

    def later(self, since: BlockSnapshot, scans: int) -> BlockSnapshot:
        """Return the content so many scans later, or, where none pass, in STOP at once, else after a while.

        Raises:
            LinkError: as `look`.
        """
        if since.status is None:
            self.clock.sleep(scans * self._interval_s)
            return self.look()
        ends = self.clock.now_s() + max(_LEAST_WAIT_S, 2.0 * scans * self._interval_s)
        while True:
            look = self.look()
            if look.status is None or look.status.scans - since.status.scans >= scans or not runs(look):
                return look
            if self.clock.now_s() > ends:
                return look
            self.clock.sleep(_SOON_S)

    def pause(self) -> None:
        """Wait until the next look is worth its while."""
        self.clock.sleep(_SOON_S if self._simulated else 0.5 * self._interval_s)

    def close(self) -> None:
        """Close the connection, if there is one."""
        if self._client is not None:
            self._client.close()
            self._client = None


def runs(look: BlockSnapshot) -> bool | None:
    """Return whether the CPU runs, None where nobody tells."""
    return look.life.runs if look.status is None else bool(look.status.status & RUNS)

"""Where the words of a controller stand in a PLC, and what is to be written there, request by request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.live.blocks import Block, block_for
from heatertune.live.cells import Signal, bytes_of, field_of
from heatertune.live.client.address import Address
from heatertune.plc import Controller, Words, controller_for
from heatertune.plc.ramp import Number

__all__ = ["Part", "Standing", "standing"]

#: controllers whose words all stand in whole cells, which one look reads
_KNOWN: Final = ("s5-ob251", "s7-200-pid")


@dataclass(frozen=True, slots=True)
class Part:
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
class Standing:
    """The words of a controller in one block of a PLC.

    Attributes:
        controller: whose words these are.
        block: as a virtual PLC has it, too.
        number: of the block in the PLC.
        begin, count: bytes of it that hold all words and what is watched.
        whole: bytes that are written together at least: 2 where there are registers.
        most: bytes of one request.
    """

    controller: Controller
    block: Block
    number: int
    begin: int
    count: int
    whole: int

    @property
    def own(self) -> list[str]:
        """The words that the program around does not write."""
        return [name for name in self.block.words if name not in self.controller.written]

    def values(self, content: bytes) -> dict[str, Number]:
        """Return every word in the bytes of the block; a whole number is one."""
        found = {name: signal.of(content, self.begin) for name, signal in self.block.words.items()}
        return {name: value if self.block.words[name].format == "REAL" else int(value)
                for name, value in found.items()}

    def words(self, content: bytes, others: Words) -> Words:
        """Return what a PLC runs; what does not stand in the block is as in other words."""
        return replace(others, values={**others.values, **self.values(content)})

    def shown(self, content: bytes, role: str) -> float:
        """Return a signal of the block, see `heatertune.live.blocks.Block.signals`."""
        return self.block.signals[role].of(content, self.begin)

    def typed(self, content: bytes, values: Mapping[str, Number]) -> bytes:
        """Return bytes of the block with words in them.

        Raises:
            OutOfRange: a number that its word does not hold.
        """
        cells = bytearray(content)
        for name, value in values.items():
            signal = self.block.words[name]
            field = field_of(self.controller.fields, name)
            one = bytes_of(replace(field, format=signal.format), value)
            cells[signal.start - self.begin : signal.start - self.begin + signal.size] = one
        return bytes(cells)

    def parts(self, content: bytes, values: Mapping[str, Number]) -> list[Part]:
        """Return what is to be written so that words stand there: those that differ, neighbours together.

        Args:
            content: bytes of the block as they are.
            values: the words that are to stand there; others stay.

        Raises:
            OutOfRange: as `typed`.
        """
        now, then = self.values(content), self.typed(content, values)
        runs: list[tuple[list[str], int, int]] = []
        for name, signal in sorted(self._changed(now, values), key=lambda one: one[1].start):
            begin, end = self._around(signal)
            if runs and runs[-1][2] >= begin:
                names, first, last = runs[-1]
                runs[-1] = [*names, name], first, max(last, end)
            else:
                runs.append(([name], begin, end))
        return [Part(tuple(names), first, content[first - self.begin : last - self.begin],
                     then[first - self.begin : last - self.begin]) for names, first, last in runs]

    def _changed(self, now: Mapping[str, Number], values: Mapping[str, Number]) -> Iterator[tuple[str, Signal]]:
        return ((name, self.block.words[name]) for name, value in values.items() if now[name] != value)

    def _around(self, signal: Signal) -> tuple[int, int]:
        begin = signal.start - signal.start % self.whole
        return begin, signal.start + signal.size + (signal.start + signal.size) % self.whole

    def in_manual(self, content: bytes) -> bool:
        """Return whether the controller is in manual."""
        return self.block.manual and self.block.in_manual(bytes(self.begin) + content)


def standing(words: Words, address: Address, switches: Mapping[str, str]) -> Standing:
    """Return where words stand in the PLC of an address.

    Raises:
        InputError: heatertune does not know where this controller keeps them.
    """
    if words.target not in _KNOWN:
        raise InputError(f"words of {words.target} are not written to a PLC: which of its cells hold them all is not "
                         f"known; known: {', '.join(_KNOWN)}")
    controller = controller_for(words.target)
    block = block_for(controller, words, switches)
    begin, end = _hull([*block.words.values(), *block.signals.values()])
    number = block.number if address.protocol != "s7" or address.block is None else address.block
    return Standing(controller=controller, block=block, number=number, begin=begin, count=end - begin,
                    whole=2 if address.protocol == "modbus" else 1)


def _hull(signals: Sequence[Signal]) -> tuple[int, int]:
    """Return the first byte of signals, and the one behind the last; whole registers."""
    begin, end = min(each.start for each in signals), max(each.start + each.size for each in signals)
    return begin - begin % 2, end + end % 2

"""The repaired program's constants in text: its statement list, or a data block with VW200 to VD220."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_200.readback import DataBlockMemory, LoadedNumber, difference, is_program, loads, statements
from heatertune.plc.readback import ReadBack, WordCollector, whole_of, wrong
from heatertune.plc.s7_200.listing import repaired_program
from heatertune.plc.s7_200.words import FIELDS

__all__ = ["from_text"]

_IN_V: Final = {field.name: field.address for field in FIELDS if field.address.startswith("VW")}
#: the words of a cycle [ms], and of 2^SCALE - 1
_CYCLE: Final = "VD220"
_REST: Final = "VD212"


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a statement list, or in the text of a data block.

    Raises:
        InputError: a bad line, a constant that is missing, there with two values or out of its range.
    """
    collected = WordCollector(source, FIELDS)
    if not is_program(text):
        memory = DataBlockMemory(text, source)
        _from_memory(memory, collected, source)
        return ReadBack(collected.values(), memory.rest)
    loaded = loads(text, source)
    for name, address in {**_IN_V, "TICK": "SMB34"}.items():
        for number in loaded.get(address, ()):
            collected.put(name, number.value, number.line, number.shown)
    for line, name, operands in statements(text):
        if name == "SRD" and operands[0] == "AC0":
            collected.put("SCALE", whole_of(operands[-1]), line, operands[-1])
    return ReadBack(collected.values(), unlike=lambda words: difference(text, repaired_program(words)))


def _from_memory(memory: DataBlockMemory, collected: WordCollector, source: str) -> None:
    for name, address in _IN_V.items():
        _put(collected, name, memory.read(name, address, real=False))
    rest, cycle = memory.read("SCALE", _REST, real=False), memory.read("TICK", _CYCLE, real=False)
    if rest is not None:
        scale = int(rest.value).bit_length()
        if rest.value != (1 << scale) - 1:
            raise wrong(source, rest.line, _REST, rest.shown, "2^SCALE - 1, the part of a sum that is kept")
        collected.put("SCALE", scale, rest.line, rest.shown)
    ticks = memory.read("TICKS", _IN_V["TICKS"], real=False)
    if cycle is not None and ticks is not None:
        if ticks.value <= 0 or cycle.value % ticks.value:
            raise wrong(source, cycle.line, _CYCLE, cycle.shown, f"whole ticks: a multiple of VW208 = {ticks.shown}")
        collected.put("TICK", int(cycle.value // ticks.value), cycle.line, cycle.shown)


def _put(collected: WordCollector, name: str, number: LoadedNumber | None) -> None:
    if number is not None:
        collected.put(name, number.value, number.line, number.shown)

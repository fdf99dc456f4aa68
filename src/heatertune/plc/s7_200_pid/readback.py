"""The loop table's words in text: the statement list that loads them, or the text of a data block."""

from __future__ import annotations

from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.cycle import ticks_of, whole_cycle
from heatertune.plc.cpu.s7_200.readback import DataBlockMemory, difference, is_program, loads
from heatertune.plc.readback import ReadBack, WordCollector, wrong
from heatertune.plc.s7_200_pid.listing import pid_program
from heatertune.plc.s7_200_pid.words import FIELDS

__all__ = ["from_text"]

_REALS: Final = tuple(field for field in FIELDS if field.format == "REAL")


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a statement list, or in the text of a data block, which knows no timed interrupt.

    Raises:
        InputError: a bad line, a word that is missing, there with two values or out of its range; a data block without
            the interval at which the loop is called.
        NotRepresentable: an interval that the PWM program cannot do.
    """
    collected = WordCollector(source, FIELDS)
    if not is_program(text):
        return _from_memory(DataBlockMemory(text, source), collected, sample_time_s)
    loaded = loads(text, source)
    for field in _REALS:
        for number in loaded.get(field.address, ()):
            collected.put(field.name, number.value, number.line, number.shown)
    for tick in loaded.get("SMB34", ()):
        collected.put("TICK", tick.value, tick.line, tick.shown)
        for cycle in loaded.get("SMW68", ()):
            if tick.value <= 0 or cycle.value % tick.value:
                whole = f"whole ticks: a multiple of SMB34 = {tick.shown}"
                raise wrong(source, cycle.line, "SMW68", cycle.shown, whole)
            collected.put("TICKS", int(cycle.value // tick.value), cycle.line, cycle.shown)
    return ReadBack(collected.values(), unlike=lambda words: difference(text, pid_program(words)))


def _from_memory(memory: DataBlockMemory, collected: WordCollector, sample_time_s: float | None) -> ReadBack:
    for field in _REALS:
        number = memory.read(field.name, field.address, real=True)
        if number is not None:
            collected.put(field.name, number.value, number.line, number.shown)
    if sample_time_s is None:
        raise InputError("--called-every is needed: a data block does not tell how often the loop is called")
    for name, ticks in ticks_of(whole_cycle(sample_time_s)).items():
        collected.put(name, ticks, 0, str(ticks))
    return ReadBack(collected.values(), memory.rest)

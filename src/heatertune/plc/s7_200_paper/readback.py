"""The printed program's constants in its statement list."""

from __future__ import annotations

from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.readback import difference, loads, statements
from heatertune.plc.readback import ReadBack, WordCollector, whole_of
from heatertune.plc.s7_200_paper.listing import printed_program
from heatertune.plc.s7_200_paper.words import FIELDS

__all__ = ["from_text"]

#: the factors of network 6 in their order, and its divisor
_FACTORS: Final = ("KP", "KI", "T", "KD")
_POT1: Final = "POT1 is a potentiometer, which no program holds: taken as 0"


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a statement list; the potentiometer's is 0.

    Raises:
        InputError: a bad line, a constant that is missing, there with two values or out of its range.
    """
    collected = WordCollector(source, FIELDS)
    constants = [(line, name, operands[0]) for line, name, operands in statements(text) if name in ("MUL", "DIV")]
    factors = [(line, shown) for line, name, shown in constants if name == "MUL"]
    if len(factors) != len(_FACTORS):
        raise InputError(f"{source}: {len(factors)} instructions MUL; expected {len(_FACTORS)}, those of network 6")
    for name, (line, shown) in zip(_FACTORS, factors, strict=True):
        collected.put(name, whole_of(shown), line, shown)
    for line, name, shown in constants:
        if name == "DIV":
            collected.put("T", whole_of(shown), line, shown)
    for cycle in loads(text, source).get("SMW68", ()):
        collected.put("CYCLE", cycle.value, cycle.line, cycle.shown)
    collected.put("POT1", 0, 0, "0")
    return ReadBack(collected.values(), (_POT1,), lambda words: difference(text, printed_program(words)))

"""The printed program as a statement list, with its certificate and its faults; and its constants read back.

Source: Alia 2007, Table 2; networks 5 to 12 from their descriptions. The paper's INT1 is INT0, which Micro/WIN
requires. The faults are found by running the printed arithmetic for every pair of setpoint and reading.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.assembler import Network, block, program
from heatertune.plc.cpu.s7_200.io_and_cycle import COUNTS, counts_wired, head
from heatertune.plc.cpu.s7_200.readback import difference, loads, statements
from heatertune.plc.readback import ReadBack, WordCollector, whole_of
from heatertune.plc.s7_200_paper.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "faults", "from_text", "printed_program", "setpoint_entry"]


def printed_program(words: Words, head: Sequence[str] = ()) -> str:
    """Return the program; the same words and head give the same bytes."""
    return program(
        block("OB1", "PID/PWM heater controller, as printed in the paper", _main(words), head),
        block("SBR0", "initialization", _initialisation(words.whole["CYCLE"])),
        block("INT0", "output updating", _output()),
    )


def _main(words: Words) -> list[Network]:
    v = words.whole
    return [
        Network("1: first scan", ["LD SM0.1", "S Q0.0, 1", "CALL SBR0"]),
        Network("2: Q0.0 is wired to I0.0, its rising edge updates the output", ["LD SM0.0", "ATCH INT0, 0"]),
        Network("3: process variable", ["LD SM0.0", "MOVB IB0, VB0"]),
        Network("4: its bit 0 is wired to I1.0", ["LD I1.0", "= V0.0"]),
        Network("5: previous error, set point, error", [
            "LD SM0.0", "MOVW VW10, VW20", "MOVW SMW28, VW10", "-I VW0, VW10",
        ]),
        Network("6: proportional, integral, differential part", [
            "LD SM0.0", "MOVW VW20, AC0", f"MUL {v['KP']:+d}, AC0",
            "MOVW VW20, AC1", "+I VW10, AC1", f"MUL {v['KI']:+d}, AC1", f"MUL {v['T']:+d}, AC1", "+D AC1, AC0",
            "MOVW VW10, AC1", "-I VW20, AC1", f"MUL {v['KD']:+d}, AC1", f"DIV {v['T']:+d}, AC1", "+D AC1, AC0",
        ]),
        Network("7: scaling by 65536, VW100 is the high word", ["LD SM0.0", "MOVD AC0, VD100"]),
    ]


def _initialisation(cycle_ms: int) -> list[Network]:
    return [
        Network("10: PWM on Q0.0", [
            "LD SM0.0", "MOVB 16#CA, SMB67", f"MOVW {cycle_ms:+d}, SMW68", "MOVW +0, SMW70", "PLS 0", "ENI",
        ]),
    ]


def _output() -> list[Network]:
    return [
        Network("12: add to the pulse width", ["LD SM0.0", "+I VW100, SMW70"]),
        Network("not above the cycle", ["LDW>= SMW70, SMW68", "MOVW SMW68, SMW70"]),
        Network("not below zero", ["LDW<= SMW70, +0", "MOVW +0, SMW70"]),
        Network("out; no more edges in this scan", ["LD SM0.0", "PLS 0", "DTCH 0"]),
    ]


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


Array = npt.NDArray[np.int64]

_PAIRS = (COUNTS + 1) ** 2


def faults(words: Words) -> tuple[str, ...]:
    """Return the faults that these constants bring out, one sentence each, with how many pairs they concern.

    Sums of two errors are those of a loop at rest, E = E_prev; changes are those from one pair to a zero error.
    """
    v = words.whole
    setpoint, reading = np.meshgrid(np.arange(COUNTS + 1), np.arange(COUNTS + 1), indexing="ij")
    first, second = _word(256 * setpoint + v["POT1"]), _word(256 * reading)
    error = np.where(first - second == _word(first - second), first - second, first)  # an overflow keeps the operand
    integral, change = v["KI"] * _word(2 * error), _word(v["KD"] * error)
    wrong = {
        "the error word is wrong (128 counts apart or more, or across 128)":
            error != 256 * (setpoint - reading) + v["POT1"],
        "the sum of two errors overflows in network 6": (2 * error != _word(2 * error)) & (v["KI"] != 0),
        "Ki times that sum is cut to its low word before T is multiplied": integral != _word(integral),
        "DIV leaves a remainder in the high word, added as 65536 times as much": np.fmod(change, v["T"]) != 0,
    }
    counts = [(int(np.count_nonzero(where)), text) for text, where in wrong.items()]
    counted = tuple(f"{text}: {pairs} of {_PAIRS} pairs of setpoint and reading" for pairs, text in counts if pairs)
    return (
        *counted,
        "the P part is added to the pulse width in every PWM cycle, so it integrates; the D part acts as P",
        "SMB67 = 16#CA does not load the cycle time: without another load the PWM cycle is 2 ms",
        "a pulse width of 0 or of the whole cycle gives no more edges: the output sticks there",
    )


def _word(value: Array) -> Array:
    return (value + 32768) % 65536 - 32768


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program, its faults and its certificate in the head."""
    lines = [*head(counts_wired(words), certificate, ()), *[f"fault: {fault}" for fault in faults(words)]]
    return {"s7_200_paper.awl": printed_program(words, lines)}


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"SMB28 = {units} (analog adjustment 0)"

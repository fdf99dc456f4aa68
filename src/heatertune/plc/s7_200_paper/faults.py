"""What is wrong in the printed program, found by running its arithmetic on every pair of setpoint and reading."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.plc.cpu.s7_200.wiring import COUNTS
from heatertune.plc.words import Words

__all__ = ["faults"]

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


"""The two-level control, as the bit processor runs it and directly: off above SP + BAND, on below SP − BAND."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

from heatertune.plc.cpu.one_bit.machine import OneBitState, Wiring, assemble, scan
from heatertune.plc.cpu.one_bit.programs import ON_OFF, ON_OFF_NAMES

__all__ = ["PROGRAM", "OnOffState", "listing_step", "step"]

#: lines and addresses fit four bits
PROGRAM: Final = assemble(ON_OFF, ON_OFF_NAMES, operand_bits=4)

_OUT: Final = ON_OFF_NAMES.bits["OUT"]
_WIRING: Final = Wiring(results={ON_OFF_NAMES.bits["AC1<AC2"]: -1, ON_OFF_NAMES.bits["AC1>AC2"]: 1})


class OnOffState(NamedTuple):
    """What the direct form keeps from scan to scan."""

    is_on: bool = False


@lru_cache(maxsize=1 << 16)  # a pure function, and near the setpoint the same few readings come again and again
def listing_step(band: int, state: OneBitState, setpoint: int, reading: int, _begins: bool) -> tuple[OneBitState, float,
                                                                                                     int, int]:
    """Compute one scan by the program, see `heatertune.plc.core.StepFunctions`.

    Args:
        band: half the hysteresis [counts].
        state: of the bit processor before the scan.
        setpoint: in counts.
        reading: in counts.
        _begins: not looked at: there is no PWM.
    """
    after = scan(PROGRAM, _WIRING, state, registers=(setpoint, reading, band))
    is_on = after.is_on(_OUT)
    return after, 100.0 if is_on else 0.0, int(is_on), int(after.overflow) + 2 * int(after.endless)


def step(band: int, state: OnOffState, setpoint: int, reading: int, _begins: bool) -> tuple[OnOffState, float, int,
                                                                                            int]:
    """Compute the same without the program, all in 16 bits.

    Args:
        band: half the hysteresis [counts].
        state: the memory before the scan.
        setpoint: in counts.
        reading: in counts.
        _begins: not looked at: there is no PWM.
    """
    w, x, b = _word(setpoint), _word(reading), _word(band)
    above, below = w + b, w - b
    overflow = above != _word(above)
    is_on = state.is_on
    if x > _word(above):
        is_on = False
    else:
        overflow = overflow or below != _word(below)
        is_on = is_on or x < _word(below)
    return OnOffState(is_on), 100.0 if is_on else 0.0, int(is_on), int(overflow)


def _word(number: int) -> int:
    return ((number + 0x8000) & 0xFFFF) - 0x8000

"""Example 1 of the document: the heater's control unit as a microprogram, figure 3, figure 4 and Table 1.

Push button A switches the fan on, B the heater; C: temperature reached; D: the fan turns. The address is the state
Q1 Q0 and the input that the state selects; the word is the next state, the fan and the heater.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

__all__ = ["CONDITION", "OFF", "ROM", "ControlUnit", "clock"]

#: state 1 of figure 3: heater and fan off; 0b10: fan on, 0b11: fan and heater on, 0b00: the same, watching the fan
OFF: Final = 0b01

#: state Q1 Q0 → the input that the multiplexer of figure 4 selects
CONDITION: Final[Mapping[int, str]] = {0b00: "D", 0b01: "A", 0b10: "B", 0b11: "C"}

#: Table 1, in the order of the addresses A2 A1 A0: next state (2 bits), fan, heater
ROM: Final = (0b0111, 0b1111, 0b0100, 0b1000, 0b1010, 0b1110, 0b0011, 0b0111)


class ControlUnit(NamedTuple):
    """State and outputs of the control unit."""

    state: int = OFF
    fan: bool = False
    heater: bool = False


def clock(unit: ControlUnit, inputs: Mapping[str, bool]) -> ControlUnit:
    """Return the unit after one clock pulse; the outputs are those of its new state.

    Args:
        unit: before the pulse.
        inputs: "A", "B", "C" and "D"; only the one that the state selects is looked at.
    """
    state = _word(unit.state, inputs) >> 2
    word = _word(state, inputs)  # fan and heater stand in both words of a state alike
    return ControlUnit(state, bool(word & 2), bool(word & 1))


def _word(state: int, inputs: Mapping[str, bool]) -> int:
    return ROM[state << 1 | inputs[CONDITION[state]]]

"""Programs of the one-bit PLC: those that the document prints, and heatertune's two-level control of a heater.

The listings keep the document's words. Its address columns contain misprints (two signals at one address), so each has
the printed addresses and, where these cannot work, corrected ones; see DIFFERENCES.md.

Example 1 is the control unit as a microprogram (figures 3 and 4, Table 1): button A switches the fan on, B the heater;
C: temperature reached; D: the fan turns. The address is the state Q1 Q0 and the input selected by the state; the word
is the next state, the fan and the heater.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from heatertune.plc.cpu.one_bit.machine import Names

__all__ = [
    "CONDITION", "DELAY", "DELAY_NAMES", "FLIP_FLOP", "FLIP_FLOP_CODED", "FLIP_FLOP_NAMES", "FLIP_FLOP_PRINTED",
    "HEATER", "HEATER_NAMES", "HEATER_PRINTED", "OFF", "ON_OFF", "ON_OFF_NAMES", "ROM", "TWO_LEVEL", "TWO_LEVEL_NAMES",
    "ControlUnit", "clock",
]


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


#: Example 2, below figure 8; resets where R is 0: a normally closed contact
FLIP_FLOP: Final = """\
0. Test R
1. Jump(CFF=0) line6
2. Test S
3. Jump(CFF=1) line5
4. Test Q
5. Set(CFF=1) Q
6. Reset(CFF=0) Q
7. Jump line0
"""

#: Example 2, beside the code words, which say the same; it never resets
FLIP_FLOP_CODED: Final = FLIP_FLOP.replace("1. Jump(CFF=0)", "1. Jump(CFF=1)")

#: addresses of figure 8
FLIP_FLOP_NAMES: Final = Names(bits={"S": 3, "Q": 4, "R": 5})
#: addresses beside the code words
FLIP_FLOP_PRINTED: Final = Names(bits={"S": 3, "Q": 5, "R": 5})

#: heater with fan sensor, below figure 9: R main switch (1 switches all off), A fan on, B heater on, C temperature
#: reached, D fan turns; F fan, H heater
HEATER: Final = """\
0. Test R
1. Jump(CFF=1) line15
2. Test H
3. Jump(CFF=0) line10
4. Test D
5. Reset(CFF=0) H
6. Reset(CFF=0) F
7. Test C
8. Reset(CFF=1) H
9. Reset(CFF=1) F
10. Test A
11. Set(CFF=1) F
12. Test B
13. Set(CFF=1) H
14. Jump line0
15. Reset H
16. Reset F
17. Jump line0
"""

#: R and B at the two free addresses below F
HEATER_NAMES: Final = Names(bits={"A": 0, "B": 1, "C": 2, "D": 3, "R": 4, "F": 5, "H": 6})
#: addresses beside the code words
HEATER_PRINTED: Final = Names(bits={"A": 0, "B": 2, "C": 2, "D": 3, "R": 5, "F": 5, "H": 6})

#: section "From Simple to Developed PLC"; what follows in line 7 is left to the reader there, here the cycle ends
DELAY: Final = """\
0. Test Condition
1. Jump(CFF=0) line3
2. Set(CFF=1) Timer
3. Test Timer
4. Jump(CFF=0) line7
5. Set(CFF=1) Output
6. Reset Timer
7. Jump line0
"""

#: no addresses are printed
DELAY_NAMES: Final = Names(bits={"Condition": 0, "Timer": 1, "Output": 2})

#: Example 3; resets above 150 and sets below 50
TWO_LEVEL: Final = """\
0. Load IN
1. Load 150
2. Comp
3. Test AC1<AC2
4. Reset(CFF=1) OUT
5. Jump(CFF=1) line11
6. Load IN
7. Load 50
8. Comp
9. Test AC1>AC2
10. Set(CFF=1) OUT
11. Jump line0
"""

#: no addresses are printed; the registers are IN and the two numbers
TWO_LEVEL_NAMES: Final = Names(
    bits={"OUT": 0, "AC1<AC2": 1, "AC1>AC2": 2}, registers={"IN": 0, "150": 1, "50": 2}
)

#: the project's own: heater off above SP + BAND, on below SP - BAND, as it was in between
ON_OFF: Final = """\
0. Load SP
1. Load BAND
2. Add
3. Load PV
4. Comp
5. Test AC1>AC2
6. Reset(CFF=1) OUT
7. Jump(CFF=1) line0
8. Load SP
9. Load BAND
10. Sub
11. Load PV
12. Comp
13. Test AC1<AC2
14. Set(CFF=1) OUT
15. Jump line0
"""

#: registers: setpoint, reading, half the hysteresis
ON_OFF_NAMES: Final = Names(
    bits={"OUT": 0, "AC1<AC2": 1, "AC1>AC2": 2}, registers={"SP": 0, "PV": 1, "BAND": 2}
)

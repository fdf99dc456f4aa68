"""What the document prints for the one-bit PLC beside the heater's program: examples 1 to 3 and the delay.

E. Hryniewicz, M. Chmiel, "About Programmable Logic Controller - step by step", Przegląd Elektrotechniczny 88(9a), 2012.
The address columns contain misprints (two signals at one address), so each listing has the printed addresses and,
where these cannot work, corrected ones; see DIFFERENCES.md.

Example 1 is the control unit as a microprogram (figures 3 and 4, Table 1): button A switches the fan on, B the heater;
C: temperature reached; D: the fan turns. The address is the state Q1 Q0 and the input selected by the state; the word
is the next state, the fan and the heater.
"""

from typing import NamedTuple

from heatertune.plc.cpu.one_bit.machine import Names

#: state 1 of figure 3: heater and fan off; 0b10: fan on, 0b11: fan and heater on, 0b00: the same, watching the fan
OFF = 0b01

#: state Q1 Q0 → the input that the multiplexer of figure 4 selects
CONDITION = {0b00: "D", 0b01: "A", 0b10: "B", 0b11: "C"}

#: Table 1, in the order of the addresses A2 A1 A0: next state (2 bits), fan, heater
ROM = (0b0111, 0b1111, 0b0100, 0b1000, 0b1010, 0b1110, 0b0011, 0b0111)


class ControlUnit(NamedTuple):
    """State and outputs of the control unit."""

    state: int = OFF
    fan: bool = False
    heater: bool = False


def clock(unit, inputs):
    """Return the unit after one clock pulse; the outputs are those of its new state.

    Args:
        unit: before the pulse.
        inputs: "A", "B", "C" and "D"; only the one that the state selects is looked at.
    """
    state = _word(unit.state, inputs) >> 2
    word = _word(state, inputs)  # fan and heater stand in both words of a state alike
    return ControlUnit(state, bool(word & 2), bool(word & 1))


def _word(state, inputs):
    return ROM[state << 1 | inputs[CONDITION[state]]]


#: Example 2, below figure 8; resets where R is 0: a normally closed contact
FLIP_FLOP = """\
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
FLIP_FLOP_CODED = FLIP_FLOP.replace("1. Jump(CFF=0)", "1. Jump(CFF=1)")

#: addresses of figure 8
FLIP_FLOP_NAMES = Names(bits={"S": 3, "Q": 4, "R": 5})
#: addresses beside the code words
FLIP_FLOP_PRINTED = Names(bits={"S": 3, "Q": 5, "R": 5})

#: addresses beside the code words
HEATER_PRINTED = Names(bits={"A": 0, "B": 2, "C": 2, "D": 3, "R": 5, "F": 5, "H": 6})

#: section "From Simple to Developed PLC"; what follows in line 7 is left to the reader there, here the cycle ends
DELAY = """\
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
DELAY_NAMES = Names(bits={"Condition": 0, "Timer": 1, "Output": 2})

#: Example 3; resets above 150 and sets below 50
TWO_LEVEL = """\
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
TWO_LEVEL_NAMES = Names(bits={"OUT": 0, "AC1<AC2": 1, "AC1>AC2": 2}, registers={"IN": 0, "150": 1, "50": 2})

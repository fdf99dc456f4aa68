"""Input, output and PWM cycle that the S7-200 programs share; their memory and blocks as the outside sees them.

The paper wires the CPU 214 (Table 1, Fig. 2) with an 8-bit converter on the inputs and the heater's switch on Q0.0. A
timed interrupt counts ticks and runs the control program once per PWM cycle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.errors import OutOfRange
from heatertune.pid.design_values import Timer
from heatertune.plc.cpu.s7_200.assembler import block_number
from heatertune.plc.cpu.s7_200.cpu import S7200Program, carry_out
from heatertune.plc.cpu.s7_200.memory import (
    ATTACHED,
    BEGUN,
    CYCLE,
    ENABLED,
    FAULTS,
    PULSED,
    V_BEGIN,
    V_END,
    WHOLE,
    WIDTH,
    bit,
    cell,
    number,
    put_word,
    word,
    write_number,
)
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.ramp import Number
from heatertune.plc.words import Certificate, Scaling, WordField, Words, timer_interval_s

__all__ = [
    "COLD", "COUNTS", "MOST", "SWITCH", "TICK_FIELDS", "TIMER", "WIDTH_APPLIES", "S7200State", "TimedProgram",
    "check_cycle", "clock", "cold_start", "counts_wired", "cycle_ms", "cycle_s", "head", "ms_per_count", "own",
    "run", "run_cycle", "ticks_of", "timed_program", "warm_start", "whole_cycle", "wire",
]


#: largest constant, and largest PWM cycle [ms]: a signed word
MOST: Final = 32767
#: whole tenths of a second are whole numbers of ticks
TIMER: Final = Timer(shortest_s=0.1, longest_s=32.7, step_s=0.1)

_SHORTEST_TICK, _LONGEST_TICK = 5, 255  # SMB34 of a CPU 214 [ms]
_UNSIGNED: Final = 0xFFFF  # as SMW70 is: 0 to 65535 ms
_TIMED: Final = 10  # event of timed interrupt 0
_FIRST_BYTE, _FIRST_BIT = bit("SM0.1")  # the first scan

TICK_FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="TICK", address="SMB34", format="BYTE", low=_SHORTEST_TICK, high=_LONGEST_TICK,
              comment="timed interrupt 0, ms"),
    WordField(name="TICKS", address="VW208", format="INT", low=1, high=MOST // _SHORTEST_TICK,
              comment="interrupts per PWM cycle"),
)


def check_cycle(words: Words) -> None:
    """Refuse words whose TICK and TICKS make no PWM cycle.

    Raises:
        OutOfRange: the cycle is too long for a signed word.
    """
    cycle = cycle_ms(words.whole)
    if cycle > MOST:
        raise OutOfRange("word TICKS", words.whole["TICKS"], f"such that TICK·TICKS is at most {MOST} ms (now {cycle})")


def ticks_of(cycle: int) -> dict[str, int]:
    """Return the longest timed interrupt [ms] that divides a PWM cycle [ms], and how many of them make it."""
    tick = max(tick for tick in range(_SHORTEST_TICK, _LONGEST_TICK + 1) if cycle % tick == 0)
    return {"TICK": tick, "TICKS": cycle // tick}


def cycle_ms(values: Mapping[str, int]) -> int:
    """Return the PWM cycle [ms]."""
    return values["TICK"] * values["TICKS"]


def cycle_s(values: Mapping[str, Number]) -> float:
    """Return the PWM cycle [s]."""
    return values["TICK"] * values["TICKS"] / 1000.0


def whole_cycle(ta: float) -> int:
    """Return the PWM cycle [ms] of a sampling interval [s]; raise NotRepresentable for one that no cycle can have."""
    return round(1000.0 * timer_interval_s(TIMER, ta))


class TimedProgram(NamedTuple):
    """A program that computes in timed interrupt 0.

    Attributes:
        program: as assembled.
        cycle_ms: PWM cycle [ms].
        countdown: place of the word of the ticks to go.
        next_cycle: whether a width shapes the PWM cycle after the one in which it is written.
    """

    program: S7200Program
    cycle_ms: int
    countdown: int
    next_cycle: bool


def timed_program(program: S7200Program, values: Mapping[str, int], countdown: str, *,
                  next_cycle: bool) -> TimedProgram:
    """Return a program that computes in timed interrupt 0.

    Args:
        program: as assembled.
        values: the words, TICK and TICKS among them.
        countdown: address of the word of the ticks to go.
        next_cycle: as the attribute.
    """
    return TimedProgram(program, cycle_ms(values), cell(countdown, 2).start, next_cycle)


def run_cycle(timed: TimedProgram, memory: bytearray) -> tuple[float, int, int]:
    """Run the first scan, once, and the timed interrupt in which the program computes.

    Args:
        timed: the program.
        memory: of the CPU before the cycle, the inputs written; it is changed.

    Returns:
        The power [%], the pulse width [ms], and SM1.1 and SM1.3 as bits.
    """
    if not memory[BEGUN]:
        memory[BEGUN] = 1
        memory[_FIRST_BYTE] |= _FIRST_BIT
        carry_out(timed.program, memory, 0, False)
        memory[_FIRST_BYTE] &= 0xFF - _FIRST_BIT
    before = word(memory, WIDTH) & _UNSIGNED
    if memory[ENABLED] and memory[ATTACHED + _TIMED]:
        # the ticks before this one do nothing but count down; a test runs them all
        put_word(memory, timed.countdown, 1)
        carry_out(timed.program, memory, memory[ATTACHED + _TIMED] * 1, False)
    width = before if timed.next_cycle else word(memory, WIDTH) & _UNSIGNED
    power = 100.0 * min(width, timed.cycle_ms) / timed.cycle_ms
    return power, width, (memory[FAULTS] >> 1 & 1) + (memory[FAULTS] >> 2 & 2)


#: highest reading of the 8-bit temperature input and of the analog adjustment SMB28
COUNTS: Final = 255
_INPUTS: Final = cell("IB0", 1).start
_ADJUSTMENT_0: Final = cell("SMB28", 1).start

WIDTH_APPLIES: Final = OpenPoint(
    name="width_applies", means={"this_cycle": False, "next_cycle": True},
    reason="whether a width written at the start of a PWM cycle applies to that cycle or to the next one",
)


def wire(memory: bytearray, setpoint: int, reading: int) -> None:
    """Write what the CPU reads: PV on I0.1 to I0.7 and, bit 0, I1.0; I0.0 takes back Q0.0; SP on adjustment 0."""
    memory[_INPUTS] = reading & 0xFE | 1
    memory[_INPUTS + 1] = memory[_INPUTS + 1] & 0xFE | reading & 1
    memory[_ADJUSTMENT_0] = setpoint & 0xFF


def ms_per_count(scaling: Scaling, cycle: int) -> float:
    """Return the width [ms] per count that a gain of 1 %/°C asks for, the PWM cycle being so long [ms]."""
    return cycle / 100.0 * scaling.span_degC / COUNTS


def counts_wired(words: Words) -> list[str]:
    """Return the meaning of an 8-bit converter and an analog adjustment, for the head of an exported program."""
    s = words.scaling
    return [
        f"sensor {s.low_degC:g}...{s.high_degC:g} degC = 0...{COUNTS} counts on I0.1-I0.7, I1.0 (bit 0)",
        "setpoint in counts on analog adjustment 0; heater switch on Q0.0",
    ]


def head(facts: Sequence[str], certificate: Certificate, by_hand: Sequence[str]) -> list[str]:
    """Return the comment lines that an exported program begins with, ASCII: they read the same in any code page.

    Args:
        facts: about inputs, outputs and clock.
        certificate: of the proof.
        by_hand: what is left to do, a step each.
    """
    steps = [f"{number}. {step}" for number, step in enumerate(by_hand, start=1)]
    lines = [*facts, *certificate.head, "not tried in STEP 7-Micro/WIN", *(["to do by hand:", *steps] if steps else [])]
    return [in_ascii(line) for line in lines]


def clock(values: Mapping[str, int]) -> str:
    """Return how the program keeps its time, for its head; `values` are TICK and TICKS."""
    cycle = values["TICK"] * values["TICKS"] / 1000.0
    return (f"TA and PWM cycle {cycle:g} s: {values['TICKS']} timed interrupts of {values['TICK']} ms; "
            "pulse width in steps of 1 ms")


#: steps that every program with its PWM on Q0.0 leaves
SWITCH: Final = (
    "wire the heater's switch to Q0.0, a transistor output: a solid-state relay, no contactor for short cycles",
    "system block, output table: Q0.0 off in STOP",
)


_ALWAYS: Final = bit("SM0.0")


class S7200State(NamedTuple):
    """An S7-200 between two passes through a block.

    Attributes:
        memory: the areas of `cells`, and what lies behind them. What runs a program changes it in its place; the
            methods here do not.
    """

    memory: bytearray

    def read(self, name: str) -> int:
        """Return a byte (unsigned), word or double word (signed) by its address."""
        return number(self.memory, *cell(name, _width_of(name)))

    def written(self, values: Mapping[str, int]) -> S7200State:
        """Return the state with some bytes, words or bits written from outside: inputs, special memory."""
        memory = bytearray(self.memory)
        for name, value in values.items():
            if "." in name:
                byte, mask = bit(name)
                memory[byte] = memory[byte] | mask if value else memory[byte] & ~mask
            else:
                write_number(memory, *cell(name, _width_of(name)), value)
        return S7200State(memory)

    @property
    def cycle(self) -> int:
        """Cycle of the PWM generator on Q0.0 [units of its time base]."""
        return number(self.memory, CYCLE, 2) & 0xFFFF

    @property
    def width(self) -> int:
        """Pulse width of that generator [units of its time base]."""
        return number(self.memory, WIDTH, 2) & 0xFFFF

    @property
    def pulsed(self) -> bool:
        """Whether the last pass carried out PLS 0."""
        return self.memory[PULSED] != 0

    @property
    def overflow(self) -> bool:
        """Whether SM1.1 was set during the last pass."""
        return bool(self.memory[FAULTS] & 2)

    @property
    def zero_division(self) -> bool:
        """Whether SM1.3 was set during the last pass."""
        return bool(self.memory[FAULTS] & 8)


def _width_of(name: str) -> int:
    return {"B": 1, "W": 2, "D": 4}[name.rstrip("0123456789")[-1]]


def own(state: S7200State) -> S7200State:
    """Return a copy, whose memory may be changed."""
    return S7200State(bytearray(state.memory))


def cold_start(_parameters: object, state: S7200State) -> S7200State:
    """Return the state, made that of a CPU whose memory was lost; SM0.0 is always 1."""
    for at in range(WHOLE):
        state.memory[at] = 0
    state.memory[_ALWAYS[0]] = _ALWAYS[1]
    return state


def warm_start(_parameters: object, _cold: S7200State, state: S7200State) -> S7200State:
    """Return the state, made that after a start-up that finds V memory as it was, and all else cleared."""
    for at in range(WHOLE):
        if at < V_BEGIN or at >= V_END:
            state.memory[at] = 0
    state.memory[_ALWAYS[0]] = _ALWAYS[1]
    return state


#: after power-up with nothing retained
COLD: Final = cold_start(None, S7200State(bytearray(WHOLE)))


def run(program: S7200Program, block: str, state: S7200State, *, wrap: bool = False) -> S7200State:
    """Return the state after one pass through a block; OB1 once is one scan.

    Args:
        program: as assembled.
        block: its name.
        state: before the pass.
        wrap: left open by the manual, see `carry_out`.
    """
    memory = bytearray(state.memory)
    carry_out(program, memory, block_number(block), wrap)
    return S7200State(memory)

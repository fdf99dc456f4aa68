"""What an S7-200 keeps, as the outside sees it: its memory by addresses, and a pass through one block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from heatertune.plc.cpu.s7_200.assembler import block_number
from heatertune.plc.cpu.s7_200.cpu import S7200Program, carry_out
from heatertune.plc.cpu.s7_200.memory import (
    CYCLE,
    FAULTS,
    PULSED,
    V_BEGIN,
    V_END,
    WHOLE,
    WIDTH,
    bit,
    cell,
    number,
    write_number,
)

__all__ = ["COLD", "S7200State", "cold_start", "own", "run", "warm_start"]

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

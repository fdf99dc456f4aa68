"""An S7-200 that runs statement list: the very text of an export.

Followed: S7-200 System Manual C79000-G7076-C233-01, chapters 5 (memory) and 9 (instructions).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.plc.cpu.s7_200.cells import SIZE, Cell, bit, cell

__all__ = ["COLD", "Action", "Cpu", "Program", "State", "run"]

_ZERO, _OVERFLOW, _NEGATIVE, _BY_ZERO = 1, 2, 4, 8  # bits of SMB1
_SMB1: Final = cell("SMB1", 1).start
_CONTROL, _CYCLE, _WIDTH = cell("SMB67", 1), cell("SMW68", 2), cell("SMW70", 2)
_PWM_ENABLED: Final = 0xC0


class State(NamedTuple):
    """What an S7-200 keeps from one block run to the next.

    Attributes:
        memory: all areas of `cells`.
        cycle, width: of the PWM generator on Q0.0 [units of its time base].
        attached: (event, interrupt block).
        enabled: whether interrupts are enabled.
        pulsed: whether the run carried out PLS 0.
        overflow, zero_division: whether SM1.1, SM1.3 was set during the run.
        loops: PID loops that have been called.
    """

    memory: bytes
    cycle: int = 0
    width: int = 0
    attached: tuple[tuple[int, str], ...] = ()
    enabled: bool = False
    pulsed: bool = False
    overflow: bool = False
    zero_division: bool = False
    loops: frozenset[int] = frozenset()

    def read(self, name: str) -> int:
        """Return a byte (unsigned), word or double word (signed) by its address."""
        place = cell(name, _width_of(name))
        return int.from_bytes(self.memory[place.start : place.start + place.width], "big", signed=place.width > 1)

    def written(self, values: Mapping[str, int]) -> State:
        """Return the state with some bytes, words or bits written from outside: inputs, special memory."""
        memory = bytearray(self.memory)
        for name, value in values.items():
            if "." in name:
                byte, mask = bit(name)
                memory[byte] = memory[byte] | mask if value else memory[byte] & ~mask
            else:
                place = cell(name, _width_of(name))
                mask = (1 << 8 * place.width) - 1
                memory[place.start : place.start + place.width] = (value & mask).to_bytes(place.width, "big")
        return self._replace(memory=bytes(memory))


def _width_of(name: str) -> int:
    return {"B": 1, "W": 2, "D": 4}[name.rstrip("0123456789")[-1]]


#: after power-up; SM0.0 is always 1
COLD: Final = State(memory=bytes(SIZE)).written({"SM0.0": 1})


@dataclass(slots=True)
class Cpu:
    """One CPU while it runs a block.

    Attributes:
        memory: all areas.
        state: the rest.
        program: block name → instructions.
        wrap: whether an overflowing sum writes its wrapped result.
        bumpless: whether the first call of a PID loop sets its setpoint to the process variable.
        top: top of the logic stack; instructions other than loads are carried out where it is 1.
        returned: whether the block has come to a return.
    """

    memory: bytearray
    state: State
    program: Program
    wrap: bool
    bumpless: bool
    top: bool = True
    returned: bool = False

    def call(self, block: str) -> None:
        """Carry out a block up to its end or its return."""
        outer, self.returned = self.top, False
        for action in self.program[block]:
            action(self)
            if self.returned:
                break
        self.top, self.returned = outer, False

    def get(self, at: Cell) -> int:
        """Return a cell as a signed number, a byte as an unsigned one."""
        return int.from_bytes(self.memory[at.start : at.start + at.width], "big", signed=at.width > 1)

    def put(self, at: Cell, value: int) -> None:
        """Write the low bytes of a number."""
        mask = (1 << (8 * at.width)) - 1
        self.memory[at.start : at.start + at.width] = (value & mask).to_bytes(at.width, "big")

    def flag(self, result: int, *, overflow: bool = False, by_zero: bool = False) -> None:
        """Set SM1.0 to SM1.3 as an arithmetic instruction leaves them."""
        self.memory[_SMB1] = (
            _OVERFLOW * overflow | _BY_ZERO * by_zero if overflow or by_zero
            else _ZERO * (result == 0) | _NEGATIVE * (result < 0)
        )
        if overflow or by_zero:
            self.state = self.state._replace(
                overflow=self.state.overflow or overflow, zero_division=self.state.zero_division or by_zero
            )

    def pulse(self) -> None:
        """PLS 0: hand those registers to the PWM generator whose update bits in SMB67 are set."""
        control = self.get(_CONTROL)
        if control & _PWM_ENABLED != _PWM_ENABLED:
            return
        cycle, width = self.get(_CYCLE) & 0xFFFF, self.get(_WIDTH) & 0xFFFF
        self.state = self.state._replace(
            cycle=cycle if control & 1 else self.state.cycle,
            width=width if control & 2 else self.state.width, pulsed=True,
        )


Action = Callable[[Cpu], None]
Program = Mapping[str, Sequence[Action]]


def run(
    program: Program, block: str, state: State, *, wrap: bool = False, bumpless: bool = True,
) -> State:
    """Return the state after one pass through a block; OB1 once is one scan.

    Args:
        program: block name → instructions.
        block: which of them.
        state: before the pass.
        wrap: left open by the manual, see `Cpu`.
        bumpless: left open by the manual, see `Cpu`.
    """
    fresh = state._replace(pulsed=False, overflow=False, zero_division=False)
    cpu = Cpu(bytearray(state.memory), fresh, program, wrap, bumpless)
    cpu.call(block)
    return cpu.state._replace(memory=bytes(cpu.memory))

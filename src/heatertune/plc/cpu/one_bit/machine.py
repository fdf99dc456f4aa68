"""The bit processor at work: one scan is a pass through the program, from line 0 until it comes back there.

Figures 6, 10 and 11 of the document: condition flip-flop (CFF), timers and counters, accumulators AC1 and AC2.
Inputs, outputs, timers, counters and the results of Comp share one space of bit addresses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from heatertune.errors import OutOfRange
from heatertune.plc.cpu.one_bit.assembler import OneBitProgram, Op

__all__ = ["MOST_STEPS", "START", "OneBitState", "Wiring", "scan"]

#: instructions after which a scan that has not come back to line 0 is cut
MOST_STEPS: Final = 1000

_WORD: Final = 1 << 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """What stands at the bit addresses; an address not named here is an output.

    Attributes:
        inputs: addresses of the inputs.
        timers: address → delay [ms].
        counters: address → count that is to be reached.
        results: address → sign of AC1 − AC2 at the last Comp (−1, 0, 1) for which it reads 1.

    Raises:
        OutOfRange: two things at one address, a negative delay or count.
    """

    inputs: frozenset[int] = frozenset()
    timers: Mapping[int, int] = field(default_factory=dict)
    counters: Mapping[int, int] = field(default_factory=dict)
    results: Mapping[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        taken = [*self.inputs, *self.timers, *self.counters, *self.results]
        for address in taken:
            if taken.count(address) > 1:
                raise OutOfRange("address", address, "that of one input, timer, counter or result only")
        for preset in (*self.timers.values(), *self.counters.values()):
            if preset < 0:
                raise OutOfRange("preset", preset, ">= 0")


class OneBitState(NamedTuple):
    """What the processor remembers from one scan to the next.

    `outputs` has bit n set where the output at address n is on; `timers` holds address → time since the start [ms] of
    each timer that runs, `counters` address → count; `compared` is the sign of AC1 − AC2 at the last Comp; `overflow`
    and `endless` tell whether the scan overflowed a word and whether it had to be cut.
    """

    outputs: int = 0
    cff: bool = False
    in_series: bool = False
    ac1: int = 0
    ac2: int = 0
    compared: int = 0
    timers: tuple[tuple[int, int], ...] = ()
    counters: tuple[tuple[int, int], ...] = ()
    overflow: bool = False
    endless: bool = False

    def is_on(self, address: int) -> bool:
        """Return whether an output is on."""
        return bool(self.outputs >> address & 1)


#: after power-on: everything off
START: Final = OneBitState()


def scan(
    program: OneBitProgram, wiring: Wiring, state: OneBitState, *, on: frozenset[int] = frozenset(),
    registers: tuple[int, ...] = (), elapsed_ms: int = 0,
) -> OneBitState:
    """Run one scan; pure and total.

    Args:
        program: what the ROM holds.
        wiring: what stands at the addresses.
        state: after the scan before.
        on: addresses of the inputs that are 1.
        registers: the numbers that Load reads, taken as 16-bit words; one that is not there reads 0.
        elapsed_ms: time since the scan before [ms].
    """
    machine = _OneBitProcessor(wiring, state, on, registers, elapsed_ms)
    lines, line = program.lines, 0
    for _ in range(MOST_STEPS):
        if line >= len(lines):  # blank ROM does nothing until the program counter rolls over
            return machine.state(endless=False)
        target = machine.execute(*lines[line])
        if target == 0:
            return machine.state(endless=False)
        line = line + 1 if target is None else target
    return machine.state(endless=True)


class _OneBitProcessor:
    """The processor within one scan."""

    def __init__(
        self, wiring: Wiring, state: OneBitState, on: frozenset[int], registers: tuple[int, ...], elapsed_ms: int
    ) -> None:
        self._wiring, self._on, self._registers = wiring, on, registers
        self._outputs, self._cff, self._in_series = state.outputs, state.cff, state.in_series
        self._ac1, self._ac2, self._compared, self._overflow = state.ac1, state.ac2, state.compared, False
        # a timer stands still once its delay has passed
        self._timers = {at: min(since + elapsed_ms, wiring.timers[at]) for at, since in state.timers}
        self._counters = dict(state.counters)

    def state(self, *, endless: bool) -> OneBitState:
        """Return what is remembered."""
        return OneBitState(
            self._outputs, self._cff, self._in_series, self._ac1, self._ac2, self._compared,
            tuple(self._timers.items()), tuple(self._counters.items()), self._overflow, endless,
        )

    def execute(self, op: Op, operand: int) -> int | None:
        """Run one instruction; return the line it jumps to, None where it does not jump."""
        if op is Op.TEST:
            # the CFF is set before the first Test of a series, so that a series gives the logical product
            self._cff = (self._cff or not self._in_series) and self._read(operand)
            self._in_series = True
            return None
        self._in_series = False
        if op in _NUMERIC:
            _NUMERIC[op](self, operand)
            return None
        action, wanted = _BINARY[op]
        if wanted not in (None, self._cff):
            return None
        if action is Op.JUMP:
            return operand
        self._write(operand, action is Op.SET)
        return None

    def _read(self, address: int) -> bool:
        wiring = self._wiring
        if address in wiring.inputs:
            return address in self._on
        if address in wiring.timers:
            return self._timers.get(address, -1) >= wiring.timers[address]
        if address in wiring.counters:
            return self._counters.get(address, 0) >= wiring.counters[address]
        if address in wiring.results:
            return wiring.results[address] == self._compared
        return bool(self._outputs >> address & 1)

    def _write(self, address: int, value: bool) -> None:
        """Set or reset what stands at an address: an output; a timer starts, a counter counts, or is cleared."""
        wiring = self._wiring
        if address in wiring.timers:
            if value:
                self._timers.setdefault(address, 0)
            else:
                self._timers.pop(address, None)
        elif address in wiring.counters:
            count = self._counters.get(address, 0) + 1
            self._counters[address] = min(count, wiring.counters[address]) if value else 0
        elif address not in wiring.inputs and address not in wiring.results:
            mask = 1 << address
            self._outputs = self._outputs | mask if value else self._outputs & ~mask

    def load(self, register: int) -> None:
        """AC1 goes to AC2, the number to AC1."""
        number = self._registers[register] if register < len(self._registers) else 0
        self._ac1, self._ac2 = _signed(number), self._ac1

    def add(self, sign: int) -> None:
        """AC1 := AC2 ± AC1."""
        result = self._ac2 + sign * self._ac1
        self._ac1 = _signed(result)
        self._overflow = self._overflow or self._ac1 != result

    def compare(self) -> None:
        """Keep the sign of AC1 − AC2."""
        self._compared = (self._ac1 > self._ac2) - (self._ac1 < self._ac2)


#: what needs no condition flip-flop
_NUMERIC: Final[dict[Op, Callable[[_OneBitProcessor, int], None]]] = {
    Op.NOP: lambda _machine, _operand: None,
    Op.LOAD: _OneBitProcessor.load,
    Op.ADD: lambda machine, _operand: machine.add(1),
    Op.SUB: lambda machine, _operand: machine.add(-1),
    Op.COMP: lambda machine, _operand: machine.compare(),
}

#: instruction → what it does, and the CFF it needs for that; None: any
_BINARY: Final[dict[Op, tuple[Op, bool | None]]] = {
    Op.SET: (Op.SET, None),
    Op.SET_IF_1: (Op.SET, True),
    Op.SET_IF_0: (Op.SET, False),
    Op.RESET: (Op.RESET, None),
    Op.RESET_IF_1: (Op.RESET, True),
    Op.RESET_IF_0: (Op.RESET, False),
    Op.JUMP: (Op.JUMP, None),
    Op.JUMP_IF_1: (Op.JUMP, True),
    Op.JUMP_IF_0: (Op.JUMP, False),
}


def _signed(number: int) -> int:
    """Return the low 16 bits as a signed word."""
    return (number + _WORD // 2) % _WORD - _WORD // 2

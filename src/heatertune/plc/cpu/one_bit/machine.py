"""The one-bit PLC of Hryniewicz and Chmiel: its instructions, its assembler, and the processor that runs a program.

A line of text is a line number with a dot (optional), a mnemonic, and an operand: a name, a number, or for jumps
`line` and a number; `0. Test R`, `1. Jump(CFF=1) line15`. A semicolon begins a comment. One scan is a pass through
the program from line 0 until it returns there. Inputs, outputs, timers, counters and the results of Comp share one
space of bit addresses.

Source: E. Hryniewicz, M. Chmiel, "About Programmable Logic Controller - step by step", Przegląd Elektrotechniczny
88(9a), 2012, section "PLC Programming", figures 6, 10, 11. It does not print the codes of Load, Add, Sub and Comp; see
DIFFERENCES.md.

The programs keep the document's words. Its address columns contain misprints (two signals at one address), so the
heater has addresses that work; see DIFFERENCES.md.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final, NamedTuple

from heatertune.errors import InputError, OutOfRange

__all__ = [
    "HEATER", "HEATER_NAMES", "MNEMONICS", "MOST_STEPS", "ON_OFF", "ON_OFF_NAMES", "OPERAND", "START", "Names",
    "OneBitInstruction", "OneBitProgram", "OneBitState", "Op", "Operand", "Wiring", "assemble", "disassemble",
    "from_image", "from_words", "scan",
]


_CODE_BITS: Final = 4


class Op(IntEnum):
    """Operation codes, four bits."""

    NOP = 0b0000
    TEST = 0b0001
    SET = 0b0010
    SET_IF_1 = 0b0011
    SET_IF_0 = 0b0100
    RESET = 0b0101
    RESET_IF_1 = 0b0110
    RESET_IF_0 = 0b0111
    JUMP = 0b1000
    JUMP_IF_1 = 0b1001
    JUMP_IF_0 = 0b1010
    LOAD = 0b1011
    ADD = 0b1100
    SUB = 0b1101
    COMP = 0b1110


class Operand(IntEnum):
    """What the operand of an instruction names."""

    NONE = 0
    BIT = 1
    LINE = 2
    REGISTER = 3


#: operation → mnemonic as the document writes it; Add and Sub stand there as "+" and "-"
MNEMONICS: Final[dict[Op, str]] = {
    Op.NOP: "NOP",
    Op.TEST: "Test",
    Op.SET: "Set",
    Op.SET_IF_1: "Set(CFF=1)",
    Op.SET_IF_0: "Set(CFF=0)",
    Op.RESET: "Reset",
    Op.RESET_IF_1: "Reset(CFF=1)",
    Op.RESET_IF_0: "Reset(CFF=0)",
    Op.JUMP: "Jump",
    Op.JUMP_IF_1: "Jump(CFF=1)",
    Op.JUMP_IF_0: "Jump(CFF=0)",
    Op.LOAD: "Load",
    Op.ADD: "Add",
    Op.SUB: "Sub",
    Op.COMP: "Comp",
}

#: operation → what its operand names
OPERAND: Final[dict[Op, Operand]] = (
    dict.fromkeys(Op, Operand.BIT)
    | dict.fromkeys((Op.JUMP, Op.JUMP_IF_1, Op.JUMP_IF_0), Operand.LINE)
    | dict.fromkeys((Op.NOP, Op.ADD, Op.SUB, Op.COMP), Operand.NONE)
    | {Op.LOAD: Operand.REGISTER}
)


class OneBitInstruction(NamedTuple):
    """One line: operation and operand (a bit's address, a line number, a register's address; 0 where it has none)."""

    op: Op
    operand: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class OneBitProgram:
    """The lines of a program from line 0 on; the rest of the ROM is blank, which is NOP.

    Attributes:
        operand_bits: width of addresses and line numbers; the ROM has 2^operand_bits lines.
        lines: the instructions.

    Raises:
        OutOfRange: more lines than the ROM has, an operand that is too wide.
    """

    operand_bits: int
    lines: tuple[OneBitInstruction, ...]

    def __post_init__(self) -> None:
        if len(self.lines) > self.size:
            raise OutOfRange("lines", len(self.lines), f"<= {self.size}, the lines of this ROM")
        for number, line in enumerate(self.lines):
            if not 0 <= line.operand < self.size:
                raise OutOfRange(f"operand of line {number}", line.operand, f"0…{self.size - 1}")

    @property
    def size(self) -> int:
        """Lines of the ROM."""
        return 1 << self.operand_bits

    @property
    def words(self) -> tuple[int, ...]:
        """Each line as its code word: operation code, then operand."""
        return tuple(line.op << self.operand_bits | line.operand for line in self.lines)

    @property
    def image(self) -> bytes:
        """The code words as bytes, each in as few whole bytes as hold it, high byte first."""
        return b"".join(word.to_bytes(_width(self.operand_bits), "big") for word in self.words)


def from_words(words: tuple[int, ...], operand_bits: int) -> OneBitProgram:
    """Return the program of these code words.

    Raises:
        OutOfRange: a word with a code that is no instruction, or too wide.
    """
    lines = []
    for number, word in enumerate(words):
        code, operand = word >> operand_bits, word & (1 << operand_bits) - 1
        if code not in Op.__members__.values():
            raise OutOfRange(f"code of line {number}", code, f"0…{max(Op)}")
        lines.append(OneBitInstruction(Op(code), operand))
    return OneBitProgram(operand_bits=operand_bits, lines=tuple(lines))


def from_image(image: bytes, operand_bits: int) -> OneBitProgram:
    """Return the program of a ROM image.

    Raises:
        OutOfRange: as `from_words`.
        InputError: the last word is broken.
    """
    width = _width(operand_bits)
    if len(image) % width:
        raise InputError(f"ROM image of {len(image)} bytes; expected whole words of {width} bytes")
    words = (int.from_bytes(image[k : k + width], "big") for k in range(0, len(image), width))
    return from_words(tuple(words), operand_bits)


def _width(operand_bits: int) -> int:
    return -(-(_CODE_BITS + operand_bits) // 8)


_LINE: Final = re.compile(r"(?:(?P<number>\d+)\.\s*)?(?P<mnemonic>[A-Za-z]+(?:\(CFF=[01]\))?)(?:\s+(?P<operand>.+))?")
_OPS: Final = {mnemonic: op for op, mnemonic in MNEMONICS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """What a program's operands are called.

    Attributes:
        bits: name → address of an input, output, timer, counter or result of Comp.
        registers: name → address of a number.
    """

    bits: Mapping[str, int] = field(default_factory=dict)
    registers: Mapping[str, int] = field(default_factory=dict)


def assemble(text: str, names: Names, *, operand_bits: int) -> OneBitProgram:
    """Return the program of a listing.

    Raises:
        InputError: a line that cannot be understood, an unknown name, a line number out of order.
        OutOfRange: an operand or the program is too large for the ROM.
    """
    lines: list[OneBitInstruction] = []
    for row in text.splitlines():
        line = row.partition(";")[0].strip()
        if line:
            lines.append(_instruction(line, len(lines), names))
    return OneBitProgram(operand_bits=operand_bits, lines=tuple(lines))


def _instruction(line: str, number: int, names: Names) -> OneBitInstruction:
    match = _LINE.fullmatch(line)
    if match is None or match["mnemonic"] not in _OPS:
        raise InputError(f"line {number}: {line!r} is no instruction; known: {', '.join(_OPS)}")
    if match["number"] is not None and int(match["number"]) != number:
        raise InputError(f"line {number}: {line!r} is numbered {match['number']}")
    op = _OPS[match["mnemonic"]]
    kind, operand = OPERAND[op], match["operand"]
    if (operand is None) != (kind is Operand.NONE):
        need = "no operand" if kind is Operand.NONE else "an operand"
        raise InputError(f"line {number}: {line!r}; {match['mnemonic']} has {need}")
    return OneBitInstruction(op) if operand is None else OneBitInstruction(op, _operand(operand, kind, number, names))


def _operand(text: str, kind: Operand, number: int, names: Names) -> int:
    if kind is Operand.LINE:
        text = text.removeprefix("line").strip()
    table = _table(kind, names)
    if text in table:
        return table[text]
    if not text.isascii() or not text.isdigit():
        expected = ", ".join([*table, "a number"])
        raise InputError(f"line {number}: unknown operand {text!r}; expected {expected}")
    return int(text)


def _table(kind: Operand, names: Names) -> Mapping[str, int]:
    return {Operand.BIT: names.bits, Operand.REGISTER: names.registers}.get(kind, {})


def disassemble(program: OneBitProgram, names: Names | None = None) -> str:
    """Return the listing; an address that has one name goes by it, others by their number."""
    names = names or Names()
    lines = []
    for number, (op, operand) in enumerate(program.lines):
        kind = OPERAND[op]
        table = _table(kind, names)
        shared = Counter(table.values())
        labels = {address: name for name, address in table.items() if shared[address] == 1}
        text = {Operand.NONE: "", Operand.LINE: f" line{operand}"}.get(kind, f" {labels.get(operand, operand)}")
        lines.append(f"{number}. {MNEMONICS[op]}{text}")
    return "\n".join(lines) + "\n"


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
        addresses = [*self.inputs, *self.timers, *self.counters, *self.results]
        for address in addresses:
            if addresses.count(address) > 1:
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
        """Return the state that is remembered."""
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
        action, condition = _BINARY[op]
        if condition not in (None, self._cff):
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
ON_OFF_NAMES: Final = Names(bits={"OUT": 0, "AC1<AC2": 1, "AC1>AC2": 2}, registers={"SP": 0, "PV": 1, "BAND": 2})

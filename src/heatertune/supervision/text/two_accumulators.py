"""The text of the monitor for CPUs with two accumulators: S5 and S7-300.

The monitor for CPUs with two accumulators, the S5 and the S7-300: loads, sums, comparisons, short jumps.

The monitor as function blocks of the S5-115U, in data words; only its margins have 32 bits, by FB242 and carries.

The monitor as a function block of the S7-300, in 32 bits, with its instance.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Final, final

from heatertune.errors import InputError
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.cpu.s7_300 import source as awl
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE
from heatertune.plc.cpu.s7_300.machine import S7300Cpu
from heatertune.plc.s5_ob251.blocks import WORK
from heatertune.plc.s5_ob251.step import FULL_SCALE as S5_FULL_SCALE
from heatertune.plc.single_precision import word_of
from heatertune.supervision.text.structured_text import (
    INPUTS,
    OUTPUTS,
    WIDE,
    Group,
    Operand,
    Set,
    Statements,
    Step,
    SumTerm,
    alarms_told,
    steps,
)

__all__ = ["S5_FILE", "S7_300_FILE", "Printer", "S5Text", "S7300Text", "s5_text", "s7_300_text"]


#: what jumps over the statements under a comparison
_ELSE: Final = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "=": "<>"}


class Printer(ABC):
    """Prints statements of one block; the labels count on from one group to the next."""

    def __init__(self) -> None:
        """Begin with the first label."""
        self._label, self._pending = 0, ""

    @final
    def print_group(self, group: Group) -> Iterator[str]:
        """Yield the lines of a group; where its last comparison jumps to, stands before the next line."""
        for step in steps(group):
            over = self._next() if step.condition else ""
            for line in self._step(step, over):
                yield self.next(*line)
            self._pending = over

    @final
    def next(self, operation: str, operand: str = "", remark: str = "") -> str:
        """Return the next line, with its label if there is a jump to it."""
        label, self._pending = self._pending, ""
        return self.line(label, operation, operand, remark)

    @abstractmethod
    def line(self, label: str, operation: str, operand: str = "", remark: str = "") -> str:
        """Return a line of the text."""

    @abstractmethod
    def operand(self, what: Operand) -> str:
        """Return a cell or a constant."""

    @abstractmethod
    def operation(self, sign: str) -> str:
        """Return the sum, difference or comparison that a sign means."""

    @abstractmethod
    def jump(self, label: str) -> tuple[str, str]:
        """Return the jump under a condition."""

    @abstractmethod
    def wide(self, made: Set) -> Iterator[tuple[str, ...]]:
        """Yield what gives `Margin` a sum of products."""

    @abstractmethod
    def sign_of_wide(self) -> tuple[str, Operand]:
        """Return what is loaded to ask whether `Margin` is below 0, and what it is compared with."""

    def _next(self) -> str:
        self._label += 1
        return f"M{self._label:03d}"

    def _step(self, step: Step, over: str) -> Iterator[tuple[str, ...]]:
        if step.condition:
            relation, first, second = step.condition
            loaded, beside = self.sign_of_wide() if first == WIDE else (self.operand(first), second)
            yield "L", loaded, f"IF {first} {relation} {second}"
            yield "L", self.operand(beside)
            yield (self.operation(_ELSE[relation]),)
            yield self.jump(over)
        held: tuple[SumTerm, ...] = ()  # what is in the accumulator
        for made in step.sets:
            if made.cell == WIDE:
                yield from self.wide(made)
                continue
            text = made.text.upper()
            if made.terms != held:
                yield "L", self.operand(made.terms[0].what), text
                text = ""
                for term in made.terms[1:]:
                    yield "L", self.operand(term.what)
                    yield (self.operation("+" if term.sign > 0 else "-"),)
            yield "T", self.operand(made.cell), text
            held = made.terms if len(made.terms) == 1 else ()


S5_FILE: Final = "monitor_listing.txt"
#: numbers of the blocks: each call, end of a block, addition in 32 bits, begin anew; and of the data block
_CALL: Final = 34
_BLOCK: Final = 35
_ADD: Final = 36
_ANEW: Final = 37
_DB: Final = 32
#: words that only products and sums need
_SCRATCH: Final = {"Z1": "factor", "Z2": "factor", "Z32": "product, high word", "Z31": "product, low word",
                   "Z": "for the carry"}
_BESIDE_CALL: Final = ("NAME", "Z1", "Z2", "Z3=0", "Z32", "Z31")
_MOST_WORDS: Final = 256
_WIDTH: Final = 20


class _S5Printer(Printer):
    def __init__(self, at: Mapping[str, int]) -> None:
        super().__init__()
        self._at = at

    def line(self, label: str, operation: str, operand: str = "", remark: str = "") -> str:
        if operation in _BESIDE_CALL:
            return f"{operation:5s}:{operand}"
        statement = f"{operation:2s} {operand}".rstrip()
        return f"{label:5s}:{f'{statement:{_WIDTH}s};{remark}' if remark else statement}"

    def operand(self, what: Operand) -> str:
        return f"KF {what:+d}" if isinstance(what, int) else f"DW {self._at[what.upper()]}"

    def operation(self, sign: str) -> str:
        return {"=": "!=F", "<>": "><F"}.get(sign, f"{sign}F")

    def jump(self, label: str) -> tuple[str, str]:
        return "JC", f"={label}"

    def wide(self, made: Set) -> Iterator[tuple[str, ...]]:
        rest = [term for term in made.terms if isinstance(term.what, int)]
        value = sum(term.sign * int(term.what) for term in rest) & 0xFFFFFFFF
        high = self._at[WIDE]
        yield "L", f"KH {value >> 16:04X}", made.text.upper()
        yield "T", f"DW {high}"
        yield "L", f"KH {value & 0xFFFF:04X}"
        yield "T", f"DW {high + 1}"
        for term in made.terms:
            if term in rest:
                continue
            factor = term.sign * term.factor
            yield "L", self.operand(term.what), f"{factor:+d} * {term.what}"
            yield "T", self.operand("Z1")
            yield "L", self.operand(factor)
            yield "T", self.operand("Z2")
            yield "JU", "FB 242"
            yield "NAME", "MUL:16"
            yield "Z1", self.operand("Z1")
            yield "Z2", self.operand("Z2")
            yield "Z3=0", "F 200.0"
            yield "Z32", self.operand("Z32")
            yield "Z31", self.operand("Z31")
            yield "JU", f"FB {_ADD}"
            yield "NAME", "ADD"

    def sign_of_wide(self) -> tuple[str, Operand]:
        return self.operand(WIDE), 0


def s5_text(statements: Statements, head: list[str]) -> str:
    """Return the listing.

    Args:
        statements: of the monitor.
        head: remarks at its beginning.

    Raises:
        InputError: its cells do not fit into a data block.
    """
    cells = _cells(statements)
    at = {name.upper(): dw for dw, (name, _) in enumerate(cells)}
    if len(cells) > _MOST_WORDS:
        raise InputError(f"no program: {len(cells)} words; a data block has {_MOST_WORDS}")
    printer = _S5Printer(at)
    blocks = [
        [f"DB{_DB}", *(f"{f'{dw:4d}:  KF = +00000;'.ljust(33)}{name.upper()}: {meaning}"
                       for dw, (name, meaning) in enumerate(cells))],
        [f"FB {_CALL}", "NAME :MONITOR", *_each_call(statements, printer)],
        [f"FB {_BLOCK}", "NAME :BLOCK", *_each_block(statements, printer)],
        *([[f"FB {_ADD}", "NAME :ADD", *_sum(printer)]] if WIDE in at else []),
        [f"FB {_ANEW}", "NAME :ANEW", printer.next("C", f"DB {_DB}"), printer.next("L", "KF +0"),
         printer.next("T", printer.operand("Begun"), "begin anew"), printer.next("BE")],
    ]
    text = [*(f"// {line}" for line in [*head, *_by_hand(at)]), *(line for block in blocks for line in ("", *block))]
    return "\n".join(text) + "\n"


def _cells(statements: Statements) -> list[tuple[str, str]]:
    cells = list[tuple[str, str]]()
    for name, meaning in {**OUTPUTS, **INPUTS, "YA": f"0...{S5_FULL_SCALE}", **statements.cells, **_SCRATCH}.items():
        wide = name.upper() == WIDE
        cells += [(name, f"{meaning}, high word"), (f"{name}_LOW", "low word")] if wide else [(name, meaning)]
    return cells


def _by_hand(at: Mapping[str, int]) -> list[str]:
    return [
        "to do by hand:",
        f"1. FB30, behind T DW 4 of CALL, where YA is kept: JU FB {_CALL}, NAME :MONITOR.",
        f"2. FB30, behind the first two statements of BROK, and FB31 before BE: JU FB {_ANEW}, NAME :ANEW; the monitor "
        "begins anew where the heater does.",
        f"3. Contactor in series with the heater's switch: on while DW {at['TOLD']} of DB{_DB} is 0.",
        f"4. Acknowledge an alarm: write 0 to DW {at['TOLD']} of DB{_DB}.",
        f"DB{_DB} and FB{_CALL} to FB{_ANEW} must be free; FB242 (MUL:16) is integral, and uses flags from 200 on.",
        f"alarms: {alarms_told()}",
    ]


def _each_call(statements: Statements, printer: _S5Printer) -> Iterator[str]:
    output, power = printer.operand("YA"), printer.operand("Power")
    for operation, operand, remark in (
            ("C", f"DB {WORK}", ""), ("L", "DW 1", "X"), ("L", "DW 4", "YA"), ("C", f"DB {_DB}", ""), ("T", output, ""),
            ("TAK", "", ""), ("T", printer.operand("Reading"), ""),
            ("L", output, "whole percent: (25 YA + YA/128 + YA/256 + 257)/512"), ("SLW", "4", ""), ("L", output, ""),
            ("SLW", "3", ""), ("+F", "", ""), ("L", output, ""), ("+F", "", ""), ("L", output, ""), ("SRW", "7", ""),
            ("+F", "", ""), ("L", output, ""), ("SRW", "8", ""), ("+F", "", ""), ("L", "KF +257", ""), ("+F", "", ""),
            ("SRW", "9", ""), ("T", power, "")):
        yield printer.next(operation, operand, remark)
    yield from _groups(statements.each_call, printer)
    yield printer.next("L", printer.operand("In_Block"), "is a block over?")
    for operation, operand in (("L", printer.operand(statements.block)), ("<F", ""), ("BEC", ""),
                               ("JU", f"FB {_BLOCK}"), ("NAME", "BLOCK"), ("BE", "")):
        yield printer.next(operation, operand)


def _each_block(statements: Statements, printer: _S5Printer) -> Iterator[str]:
    yield from _groups(statements.each_block, printer)
    yield printer.next("BE")


def _groups(groups: tuple[Group, ...], printer: _S5Printer) -> Iterator[str]:
    for group in groups:
        yield f"// {group.title}"
        yield from printer.print_group(group)


def _sum(printer: _S5Printer) -> Iterator[str]:
    """Yield what adds Z32 and Z31 to the margin; a carry shows where a sum, taken without a sign, is the smaller."""
    high = int(printer.operand(WIDE).removeprefix("DW "))
    one, low = printer.operand("Z31"), f"DW {high + 1}"
    for operation, operand, remark in (
            ("L", one, ""), ("L", low, ""), ("+F", "", ""), ("T", low, ""), ("L", "KH 8000", "carry: sum below Z31"),
            ("+F", "", ""), ("T", printer.operand("Z"), ""), ("L", one, ""), ("L", "KH 8000", ""), ("+F", "", ""),
            ("L", printer.operand("Z"), ""), ("<=F", "", ""), ("JC", "=NONE", ""), ("L", f"DW {high}", ""),
            ("L", "KF +1", ""), ("+F", "", ""), ("T", f"DW {high}", "")):
        yield printer.next(operation, operand, remark)
    yield printer.line("NONE", "L", f"DW {high}")
    for operation, operand in (("L", printer.operand("Z32")), ("+F", ""), ("T", f"DW {high}"), ("BE", "")):
        yield printer.next(operation, operand)


class S5Text:
    """The listing in its CPU, see `heatertune.supervision.text.program_check.Text`."""

    def __init__(self, listing: str) -> None:
        """Load it; raise InputError where it has what the CPU does not know."""
        self._cpu = S5Cpu(f"{listing}\nDB{WORK}\n" + "".join(f"{dw:4d}:  KF = +00000;\n" for dw in range(5)), {})
        self._given, self._own = self._cpu.block(WORK, 4), self._cpu.block(_DB, len(OUTPUTS) + len(INPUTS))

    def start(self) -> None:
        """Run the block that lets the monitor begin anew."""
        self._cpu.run(f"FB {_ANEW}")

    def acknowledge(self) -> None:
        """Write 0 to the first alarm's word."""
        self._own[1] = 0

    def outputs(self) -> list[tuple[float, float]]:
        """Return outputs of the controller and the power that each is [%]."""
        return [(value, 100.0 * value / S5_FULL_SCALE) for value in range(S5_FULL_SCALE + 1)]

    def output_of(self, percent: int) -> float:
        """Return an output of the controller that is so much power."""
        return percent * S5_FULL_SCALE // 100

    def call(self, count: int, output: float) -> tuple[int, int, int]:
        """Run the block; return its alarm, the first one kept, and the power in whole percent."""
        self._given[1], self._given[4] = count, int(output)
        self._cpu.run(f"FB {_CALL}")
        return self._own[0], self._own[1], self._own[3]


S7_300_FILE: Final = "monitor.awl"
#: of the function block and its instance: free beside the controller's program
_NUMBER: Final = 105

_PERCENT_OF_INT: Final = f"""\
      L     #OUT;
      ITD   ;
      L     L#200;
      *D    ;
      L     L#{FULL_SCALE};
      +D    ;
      L     L#{2 * FULL_SCALE};
      /D    ;
      T     #POWER;"""
_PERCENT_OF_REAL: Final = f"""\
      L     #OUT;
      L     {awl.real(0.5)};
      +R    ;
      TRUNC ;
      T     #POWER;"""


class _S7300Printer(Printer):
    def line(self, label: str, operation: str, operand: str = "", remark: str = "") -> str:
        mark = f"{label}:" if label else ""
        return f"{mark:6s}{operation:6s}{operand};" + (f"  // {remark}" if remark else "")

    def operand(self, what: Operand) -> str:
        return f"L#{what}" if isinstance(what, int) else f"#{what}"

    def operation(self, sign: str) -> str:
        return f"{'==' if sign == '=' else sign}D"

    def jump(self, label: str) -> tuple[str, str]:
        return "JC", label

    def wide(self, made: Set) -> Iterator[tuple[str, ...]]:
        cell, text = self.operand(made.cell), made.text.upper()
        for place, term in enumerate(made.terms):
            yield "L", self.operand(term.what), text
            text = ""
            if term.factor != 1:
                yield "L", f"L#{term.factor}"
                yield ("*D",)
            if place:
                yield "L", cell
                yield ("TAK",)
                yield (self.operation("+" if term.sign > 0 else "-"),)
            yield "T", cell

    def sign_of_wide(self) -> tuple[str, Operand]:
        return "#MARGIN", 0


def s7_300_text(statements: Statements, head: list[str], *, real: bool) -> str:
    """Return the source.

    Args:
        statements: of the monitor.
        head: remarks at its beginning.
        real: whether the controller's output is a REAL in percent, and not 0…27648.
    """
    return awl.text([*(f"// {line}" for line in [*head, *_by_hand_s7_300()]), *_block(statements, real), *_instance()])


def _by_hand_s7_300() -> list[str]:
    at = f"DB{_NUMBER}"
    return [
        "to do by hand:",
        "  1. OB 35, behind the call of the controller, before the network of its ticks:",
        f"     CALL FB {_NUMBER}, DB {_NUMBER} (PV := #reading, OUT := DB101.POWER)",
        "     DB101.POWER by its address, as the program writes it in the network before",
        f"  2. FC 101: write L#0 to {at}.BEGUN, so that it begins anew where the heater begins anew",
        f"  3. wire a contactor in series with the heater's switch: on while {at}.TOLD is L#0",
        f"  4. acknowledge an alarm: write L#0 to {at}.TOLD",
        f"FB {_NUMBER} and DB {_NUMBER} must be free. Alarms: {alarms_told()}",
    ]


def _block(statements: Statements, real: bool) -> Iterator[str]:
    kind, printer = ("REAL", "% of full power") if real else ("INT", f"0..{FULL_SCALE}"), _S7300Printer()
    yield from (
        f"FUNCTION_BLOCK FB {_NUMBER}", "TITLE =monitor of the heater; it does not replace a thermal cut-out",
        "VERSION : 0.1", "VAR_INPUT", "  PV : INT ;  // analog value", f"  OUT : {kind[0]} ;  // {kind[1]}", "END_VAR",
        "VAR_OUTPUT", *_declared(OUTPUTS), "END_VAR", "VAR", *_declared({**INPUTS, **statements.cells}), "END_VAR",
        "BEGIN", "NETWORK", "TITLE =reading and power in whole percent",
        "      L     #PV;", "      ITD   ;", "      T     #READING;",
        *(_PERCENT_OF_REAL if real else _PERCENT_OF_INT).splitlines())
    for group in statements.each_call:
        yield from ("NETWORK", f"TITLE ={group.title}", *printer.print_group(group))
    yield from ("NETWORK", "TITLE =is a block over?", printer.next("L", "#IN_BLOCK"),
                f"      L     L#{statements.block};", "      <D    ;", "      JC    end;")
    for group in statements.each_block:
        yield from ("NETWORK", f"TITLE ={group.title}", *printer.print_group(group))
    yield from (printer.next("NOP", "0"), "end:  NOP   0;", "END_FUNCTION_BLOCK", "")


def _declared(cells: Mapping[str, str]) -> Iterator[str]:
    return (f"  {name.upper()} : DINT ;  // {meaning}" for name, meaning in cells.items())


def _instance() -> list[str]:
    return [f"DATA_BLOCK DB {_NUMBER}", "TITLE =instance of the heater's monitor", "VERSION : 0.1", f"FB {_NUMBER}",
            "BEGIN", "END_DATA_BLOCK"]


class S7300Text:
    """The source in its CPU, see `heatertune.supervision.text.program_check.Text`."""

    def __init__(self, source: str, *, real: bool) -> None:
        """Load it; raise InputError where it has what the CPU does not know."""
        self._cpu, self._real = S7300Cpu(source, {}), real
        data, block = f"DB {_NUMBER}", f"FB {_NUMBER}"
        if block not in self._cpu.memory and f"L {block}" not in self._cpu.memory:
            raise InputError(f"the source has no {block}")
        self._block, self._cpu.instance = block, data
        self._at = {name: self._cpu.member(data, name) for name in ("PV", "OUT", "BEGUN", "ALARM", "TOLD", "POWER")}

    def start(self) -> None:
        """Write 0 to BEGUN."""
        self._cpu.put(self._at["BEGUN"], 0)

    def acknowledge(self) -> None:
        """Write 0 to TOLD."""
        self._cpu.put(self._at["TOLD"], 0)

    def outputs(self) -> list[tuple[float, float]]:
        """Return outputs of the controller and the power that each is [%]."""
        if self._real:
            return [(tenths / 10.0, tenths / 10.0) for tenths in range(1001)]
        return [(value, 100.0 * value / FULL_SCALE) for value in range(0, FULL_SCALE + 1, 12)]

    def output_of(self, percent: int) -> float:
        """Return an output of the controller that is so much power."""
        return percent if self._real else percent * FULL_SCALE // 100

    def call(self, count: int, output: float) -> tuple[int, int, int]:
        """Run the block; return its alarm, the first one kept, and the power in whole percent."""
        cpu, at = self._cpu, self._at
        cpu.put(at["PV"], count)
        cpu.put(at["OUT"], word_of(output) if self._real else int(output))
        cpu.run(self._block)
        return cpu.get(at["ALARM"]), cpu.get(at["TOLD"]), cpu.get(at["POWER"])

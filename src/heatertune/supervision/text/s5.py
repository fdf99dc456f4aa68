"""The monitor as function blocks of the S5-115U, in data words; only its margins have 32 bits, by FB242 and carries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.print.statements import Set
from heatertune.plc.print.stl import S5Printer
from heatertune.plc.s5_ob251.blocks import WORK
from heatertune.plc.s5_ob251.step import FULL_SCALE
from heatertune.supervision.text.monitor_statements import INPUTS, OUTPUTS, WIDE, Statements, alarm_text

__all__ = ["FILE", "S5Text", "written"]

FILE: Final = "monitor_listing.txt"
#: numbers of the blocks: each call, end of a block, addition in 32 bits, begin anew; and of the data block
_CALL: Final = 34
_BLOCK: Final = 35
_ADD: Final = 36
_ANEW: Final = 37
_DB: Final = 32
#: words that only products and sums need
_SCRATCH: Final = {"Z1": "factor", "Z2": "factor", "Z32": "product, high word", "Z31": "product, low word",
                   "Z": "for the carry"}
_MOST_WORDS: Final = 256


class _S5MonitorPrinter(S5Printer):
    def assign(self, assignment: Set) -> Iterator[tuple[str, ...]] | None:
        return self._wide(assignment) if assignment.cell == WIDE else None

    def _wide(self, assignment: Set) -> Iterator[tuple[str, ...]]:
        rest = [term for term in assignment.terms if isinstance(term.what, int)]
        value = sum(term.sign * int(term.what) for term in rest) & 0xFFFFFFFF
        high = self.at[WIDE]
        yield "L", f"KH {value >> 16:04X}", assignment.text.upper()
        yield "T", f"DW {high}"
        yield "L", f"KH {value & 0xFFFF:04X}"
        yield "T", f"DW {high + 1}"
        for term in assignment.terms:
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


def written(statements: Statements, head: list[str]) -> str:
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
    printer = _S5MonitorPrinter(at)
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
    for name, meaning in {**OUTPUTS, **INPUTS, "YA": f"0...{FULL_SCALE}", **statements.cells, **_SCRATCH}.items():
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
        f"alarms: {alarm_text()}",
    ]


def _each_call(statements: Statements, printer: _S5MonitorPrinter) -> Iterator[str]:
    output, power = printer.operand("YA"), printer.operand("Power")
    for operation, operand, remark in (
            ("C", f"DB {WORK}", ""), ("L", "DW 1", "X"), ("L", "DW 4", "YA"), ("C", f"DB {_DB}", ""), ("T", output, ""),
            ("TAK", "", ""), ("T", printer.operand("Reading"), ""),
            ("L", output, "whole percent: (25 YA + YA/128 + YA/256 + 257)/512"), ("SLW", "4", ""), ("L", output, ""),
            ("SLW", "3", ""), ("+F", "", ""), ("L", output, ""), ("+F", "", ""), ("L", output, ""), ("SRW", "7", ""),
            ("+F", "", ""), ("L", output, ""), ("SRW", "8", ""), ("+F", "", ""), ("L", "KF +257", ""), ("+F", "", ""),
            ("SRW", "9", ""), ("T", power, "")):
        yield printer.next(operation, operand, remark)
    yield from printer.print_groups(statements.each_call)
    yield printer.next("L", printer.operand("In_Block"), "is a block over?")
    for operation, operand in (("L", printer.operand(statements.block)), ("<F", ""), ("BEC", ""),
                               ("JU", f"FB {_BLOCK}"), ("NAME", "BLOCK"), ("BE", "")):
        yield printer.next(operation, operand)


def _each_block(statements: Statements, printer: _S5MonitorPrinter) -> Iterator[str]:
    yield from printer.print_groups(statements.each_block)
    yield printer.next("BE")


def _sum(printer: _S5MonitorPrinter) -> Iterator[str]:
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
    """The listing in its CPU, see `heatertune.supervision.text.program_check.LoadedText`."""

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
        return [(value, 100.0 * value / FULL_SCALE) for value in range(FULL_SCALE + 1)]

    def output_of(self, percent: int) -> float:
        """Return an output of the controller that is so much power."""
        return percent * FULL_SCALE // 100

    def call(self, count: int, output: float) -> tuple[int, int, int]:
        """Run the block; return its alarm, the first one kept, and the power in whole percent."""
        self._given[1], self._given[4] = count, int(output)
        self._cpu.run(f"FB {_CALL}")
        return self._own[0], self._own[1], self._own[3]

"""The monitor as a function block of the S7-300, in 32 bits, with its instance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300 import source as awl
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, S7300Cpu
from heatertune.plc.print.statements import Set
from heatertune.plc.print.stl import S7300Printer
from heatertune.plc.single_precision import word_of
from heatertune.supervision.text.monitor_statements import INPUTS, OUTPUTS, WIDE, Statements, alarm_text

__all__ = ["FILE", "S7300Text", "written"]

FILE: Final = "monitor.awl"
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


class _S7300MonitorPrinter(S7300Printer):
    def assign(self, assignment: Set) -> Iterator[tuple[str, ...]] | None:
        return self._wide(assignment) if assignment.cell == WIDE else None

    def _wide(self, assignment: Set) -> Iterator[tuple[str, ...]]:
        cell, text = self.operand(assignment.cell), assignment.text.upper()
        for place, term in enumerate(assignment.terms):
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


def written(statements: Statements, head: list[str], *, real: bool) -> str:
    """Return the source.

    Args:
        statements: of the monitor.
        head: remarks at its beginning.
        real: whether the controller's output is a REAL in percent, and not 0…27648.
    """
    return awl.text([*(f"// {line}" for line in [*head, *_by_hand()]), *_block(statements, real), *_instance()])


def _by_hand() -> list[str]:
    at = f"DB{_NUMBER}"
    return [
        "to do by hand:",
        "  1. OB 35, behind the call of the controller, before the network of its ticks:",
        f"     CALL FB {_NUMBER}, DB {_NUMBER} (PV := #reading, OUT := DB101.POWER)",
        "     DB101.POWER by its address, as the program writes it in the network before",
        f"  2. FC 101: write L#0 to {at}.BEGUN, so that it begins anew where the heater begins anew",
        f"  3. wire a contactor in series with the heater's switch: on while {at}.TOLD is L#0",
        f"  4. acknowledge an alarm: write L#0 to {at}.TOLD",
        f"FB {_NUMBER} and DB {_NUMBER} must be free. Alarms: {alarm_text()}",
    ]


def _block(statements: Statements, real: bool) -> Iterator[str]:
    kind, printer = ("REAL", "% of full power") if real else ("INT", f"0..{FULL_SCALE}"), _S7300MonitorPrinter()
    yield from (
        f"FUNCTION_BLOCK FB {_NUMBER}", "TITLE =monitor of the heater; it does not replace a thermal cut-out",
        "VERSION : 0.1", "VAR_INPUT", "  PV : INT ;  // analog value", f"  OUT : {kind[0]} ;  // {kind[1]}", "END_VAR",
        "VAR_OUTPUT", *_declared(OUTPUTS), "END_VAR", "VAR", *_declared({**INPUTS, **statements.cells}), "END_VAR",
        "BEGIN", "NETWORK", "TITLE =reading and power in whole percent", "      L     #PV;", "      ITD   ;",
        "      T     #READING;", *(_PERCENT_OF_REAL if real else _PERCENT_OF_INT).splitlines())
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
    """The source in its CPU, see `heatertune.supervision.text.program_check.LoadedText`."""

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

"""The monitor as two subroutines of the S7-200, in words of V memory; each comparison begins a network."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200 import assemble
from heatertune.plc.cpu.s7_200.assembler import Network, block, block_number, program
from heatertune.plc.cpu.s7_200.cpu import carry_out
from heatertune.plc.cpu.s7_200.memory import V_BEGIN, V_END, WHOLE, bit, cell, put_word, word
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.print.stl import ALWAYS, networks
from heatertune.supervision.text.monitor_statements import INPUTS, OUTPUTS, WIDE, Statements, alarm_text

__all__ = ["FILE", "S7200Text", "reading_of", "written"]

FILE: Final = "monitor.awl"
#: first of its words: those below are the controller's
_FIRST: Final = 300
_WORD: Final = 1 << 15
_CALLS: Final = (
    Network("monitor of the heater", [ALWAYS, "CALL SBR1"]),
    Network("a block of its calls is over", ["LDW>= {in_block}, {block:+d}", "CALL SBR2"]),
)


def reading_of(target: str, per_count: int) -> list[str]:
    """Return the instructions that leave the card's count in AC0.

    Args:
        target: `s7-200` or `s7-200-pid`.
        per_count: of the analog input word.
    """
    return ["MOVW VW0, AC0"] if target == "s7-200" else ["MOVW VW86, AC0", f"DIV {per_count:+d}, AC0"]


def written(statements: Statements, head: list[str], reading: list[str], cycle_ms: int) -> str:
    """Return the text of the two subroutines.

    Args:
        statements: of the monitor.
        head: remarks at its beginning.
        reading: instructions that leave the card's count in AC0.
        cycle_ms: PWM cycle, of which the width in SMW70 is a part [ms].

    Raises:
        InputError: its cells do not fit into V memory.
    """
    at = _places(statements)
    legend = [f"{place}: {name.upper()}, {meaning}" for (name, meaning), place in zip(
        _cells(statements).items(), at.values(), strict=True)]
    lines = [in_ascii(line) for line in [*head, *_by_hand(statements, at), *legend]]
    call = [Network("reading", [ALWAYS, *reading, f"MOVW AC0, {at['READING']}"]), *_percent(cycle_ms, at["POWER"])]
    return program(
        block("SBR1", "monitor of the heater: each call", [*call, *networks(statements.each_call, at)], lines),
        block("SBR2", "monitor of the heater: a block is over", [*networks(statements.each_block, at)]))


def _cells(statements: Statements) -> Mapping[str, str]:
    return {**OUTPUTS, **INPUTS, **statements.cells}


def _places(statements: Statements) -> dict[str, str]:
    """Return name → address; a double word begins at an even one, too."""
    at, byte = dict[str, str](), _FIRST
    for name in map(str.upper, _cells(statements)):
        at[name] = f"V{'D' if name == WIDE else 'W'}{byte}"
        byte += 4 if name == WIDE else 2
    if byte > V_END - V_BEGIN:
        raise InputError(f"no program: it needs {byte - _FIRST} bytes of V memory from VB{_FIRST} on, up to "
                         f"VB{V_END - V_BEGIN - 1} are counted on")
    return at


def _by_hand(statements: Statements, at: Mapping[str, str]) -> Iterator[str]:
    yield "to do by hand:"
    yield "1. INT0, at its end, these networks:"
    for network in _calls(statements, at):
        yield f"   // {network.comment}: {'; '.join(network.instructions)}"
    yield (f"2. SBR0, and where a broken wire puts the heater off: MOVW +0, {at['BEGUN']}; the monitor begins anew "
           "where the heater does")
    yield f"3. contactor in series with the heater's switch: on while {at['TOLD']} is 0"
    yield f"4. acknowledge an alarm: MOVW +0, {at['TOLD']}"
    yield f"SBR1, SBR2 and V memory from VB{_FIRST} on must be free; AC0 and AC1 are written"
    yield f"alarms: {alarm_text()}"


def _calls(statements: Statements, at: Mapping[str, str]) -> list[Network]:
    return [Network(network.comment, [line.format(in_block=at["IN_BLOCK"], block=statements.block)
                                      for line in network.instructions]) for network in _CALLS]


def _percent(cycle_ms: int, power: str) -> Iterator[Network]:
    """Yield what makes whole percent of the pulse width: an estimate not above, and what is left of it."""
    shift = 16
    while (100 << shift) // cycle_ms >= _WORD:
        shift -= 1
    half = (cycle_ms + 1) // 2
    yield Network("power asked for, a first guess", [
        ALWAYS, "MOVW SMW70, AC0", f"MUL {(100 << shift) // cycle_ms:+d}, AC0", f"SRD AC0, {shift}",
        f"MOVW AC0, {power}"])
    yield Network("100 times the width less the guess times the cycle", [
        ALWAYS, "MOVW SMW70, AC0", "MUL +100, AC0", f"MOVW {power}, AC1", f"MUL {cycle_ms:+d}, AC1", "-D AC1, AC0"])
    for more in (half, half + cycle_ms):
        yield Network("nearest whole percent", [f"LDD>= AC0, {more:+d}", f"+I +1, {power}"])


class S7200Text:
    """The subroutines in their CPU, see `heatertune.supervision.text.program_check.LoadedText`."""

    def __init__(self, text: str, statements: Statements, target: str, per_count: int, cycle_ms: int) -> None:
        """Load them; raise InputError where they have what the CPU does not know."""
        at = _places(statements)
        calls = program(block("OB1", "caller", []), block("INT0", "caller", _calls(statements, at)))
        self._program = assemble(calls + text)
        self._memory = bytearray(WHOLE)
        byte, mask = bit("SM0.0")
        self._memory[byte] |= mask
        self._at = {name: cell(at[name.upper()], 2).start for name in (*OUTPUTS, *INPUTS, "Begun")}
        self._reading, self._width = (cell(name, 2).start for name in (
            "VW0" if target == "s7-200" else "VW86", "SMW70"))
        self._per_count, self._cycle = per_count, cycle_ms

    def start(self) -> None:
        """Write 0 to BEGUN."""
        put_word(self._memory, self._at["Begun"], 0)

    def acknowledge(self) -> None:
        """Write 0 to TOLD."""
        put_word(self._memory, self._at["Told"], 0)

    def outputs(self) -> list[tuple[float, float]]:
        """Return widths and the power that each is [%]."""
        return [(width, 100.0 * width / self._cycle) for width in range(self._cycle + 1)]

    def output_of(self, percent: int) -> float:
        """Return a width that is so much power."""
        return percent * self._cycle // 100

    def call(self, count: int, output: float) -> tuple[int, int, int]:
        """Run INT0; return the alarm, the first one kept, and the power in whole percent."""
        memory, at = self._memory, self._at
        put_word(memory, self._reading, count * self._per_count)
        put_word(memory, self._width, int(output))
        compile_function(carry_out)(self._program, memory, block_number("INT0"), False)
        return word(memory, at["Alarm"]), word(memory, at["Told"]), word(memory, at["Power"])

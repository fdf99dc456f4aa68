"""The monitor's text in the machine of its target, call by call beside the monitor that was proven: the same alarms.

What a one-bit PLC can do of the monitor: a sensor that is gone, and heat for too long.

It compares numbers but stores none: no rate, no frozen sensor, no sum, no window. A timer stands for counted calls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.plc import Words
from heatertune.plc.cpu.one_bit.assembler import Names, OneBitProgram, assemble, disassemble
from heatertune.plc.cpu.one_bit.machine import START, Wiring, scan
from heatertune.plc.cpu.s7_200.cycle import cycle_ms
from heatertune.plc.s7_200_pid.words import FULL
from heatertune.supervision.faulty_loops import Card, Ran
from heatertune.supervision.monitor import ALARMS, STATE, Numbers, alarms
from heatertune.supervision.text.s7_200 import S7_200_FILE, S7200Text, reading_of, s7_200_text
from heatertune.supervision.text.structured_text import (
    STRUCTURED_FILE,
    Statements,
    StructuredText,
    check_reach,
    statements_of,
    structured_text,
)
from heatertune.supervision.text.two_accumulators import S5_FILE, S7_300_FILE, S5Text, S7300Text, s5_text, s7_300_text

__all__ = [
    "ONE_BIT_FILE", "ONE_BIT_TARGET", "LoadedText", "MonitorProgram", "export_monitor", "one_bit_departure",
    "one_bit_text", "reduce_monitor",
]


ONE_BIT_TARGET: Final = "on-off"
ONE_BIT_FILE: Final = "monitor_listing.txt"
_NAMES: Final = Names(
    bits={"TRIP": 0, "AC1<AC2": 1, "AC1>AC2": 2, "HEAT": 3, "LONG": 4}, registers={"PV": 0, "LOW": 1, "HIGH": 2})
_ENDS: Final = """\
0. Load HIGH
1. Load PV
2. Comp
3. Test AC1>AC2
4. Set(CFF=1) TRIP
5. Load LOW
6. Load PV
7. Comp
8. Test AC1<AC2
9. Set(CFF=1) TRIP
"""
_LONG: Final = """\
10. Test HEAT
11. Set(CFF=1) LONG
12. Reset(CFF=0) LONG
13. Test LONG
14. Set(CFF=1) TRIP
15. Jump line0
"""
_NEVER: Final = 1 << 30


def reduce_monitor(numbers: Numbers) -> Numbers:
    """Return the monitor that is left: without all rules that need a memory for numbers."""
    return numbers._replace(jump=_NEVER, still=0, still_moved=0, slow_blocks=0, fast_blocks=0, growths=0)


def one_bit_text(numbers: Numbers, scan_s: float, head: Sequence[str]) -> str:
    """Return the listing.

    Args:
        numbers: of the monitor.
        scan_s: of the two-level control [s].
        head: remarks at its beginning.
    """
    long = f"; bit 4 (LONG): timer of {_delay_ms(numbers, scan_s)} ms" if numbers.full else "; no rule for long heat"
    lines = [
        *(f"; {line}" for line in head), "; for a bit processor of its own, beside the one that switches the heater",
        f"; registers: 0 (PV) reading, 1 (LOW) = {numbers.low}, 2 (HIGH) = {numbers.high} counts",
        "; bit 3 (HEAT): input, wired to OUT of the two-level control", long,
        "; bit 0 (TRIP): output, stays on until the processor is switched off; wire it to R of the heater's interlock,",
        "; or to a contactor in series that opens when it is on",
        "; it stores no numbers: it sees no rate, no frozen sensor, and no heater that is too slow or too hot",
    ]
    program = _program(numbers)
    body = [f"{line.ljust(28)}; {word >> 4:04b} {word & 15:04b}" for line, word in zip(
        disassemble(program, _NAMES).splitlines(), program.words, strict=True)]
    return "\n".join([*lines, *body]) + "\n"


def one_bit_departure(text: str, numbers: Numbers, scan_s: float, runs: Sequence[Ran]) -> str | None:
    """Return where the listing says other than the monitor that is left, None for nowhere."""
    program, low_high = assemble(text, _NAMES, operand_bits=4), (numbers.low, numbers.high)
    wiring = Wiring(inputs=frozenset({3}), results={1: -1, 2: 1}, timers={4: _delay_ms(numbers, scan_s)})
    for one in runs:
        wanted = np.empty(len(one.counts), dtype=np.int64)
        compile_function(alarms)(reduce_monitor(numbers), np.zeros(STATE, dtype=np.int64), one.counts, one.power,
                                 wanted)
        state, tripped = START, False
        for k, (count, power, alarm) in enumerate(
                zip(one.counts.tolist(), one.power.tolist(), wanted.tolist(), strict=True)):
            if power < 0:
                state, tripped = START, False
                continue
            state = scan(program, wiring, state, on=frozenset({3} if power >= 100 else ()),
                         registers=(count, *low_high), elapsed_ms=_ms(scan_s))
            tripped = tripped or alarm > 0
            if state.is_on(0) != tripped:
                return f"in scan {k + 1} TRIP is {'on' if state.is_on(0) else 'off'}; the monitor says otherwise"
    return None


def _program(numbers: Numbers) -> OneBitProgram:
    return assemble(_ENDS + (_LONG if numbers.full else "10. Jump line0\n"), _NAMES, operand_bits=4)


def _ms(scan_s: float) -> int:
    return round(1000.0 * scan_s)


def _delay_ms(numbers: Numbers, scan_s: float) -> int:
    return numbers.full * _ms(scan_s)


_LONGEST: Final = 50_000  # calls with the same reading that a run to the limits holds
_REAL: Final = "fb41"  # its output is a REAL in percent


class LoadedText(Protocol):
    """A text that was loaded into its machine."""

    def start(self) -> None:
        """Let the monitor begin anew."""

    def acknowledge(self) -> None:
        """Let it forget its first alarm."""

    def outputs(self) -> list[tuple[float, float]]:
        """Return outputs of the controller, in the unit of its program, and the power that each is [%]."""

    def output_of(self, percent: int) -> float:
        """Return an output of the controller that is so much power."""

    def call(self, count: int, output: float) -> tuple[int, int, int]:
        """Run one call with the count of the card and the controller's output.

        Returns:
            Its alarm, the first alarm since the last acknowledgement, and the power as the text has it [%].
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorProgram:
    """The program of a monitor.

    Attributes:
        file: its name; None: no program.
        text: of the program.
        calls: that it was run for beside the monitor, on how many runs.
        runs: of loops, in order and broken, and one to each limit and beyond.
        why: there is no program, or it does other than the monitor; None: it is proven.
    """

    file: str | None = None
    text: str = ""
    calls: int = 0
    runs: int = 0
    why: str | None = None


#: name of the file, the text, and what loads it into its machine
_Written = tuple[str, str, Callable[[], LoadedText]]


def export_monitor(numbers: Numbers, words: Words, card: Card, head: Sequence[str],
                   runs: Sequence[Ran]) -> MonitorProgram:
    """Return the program of a monitor, proven on runs.

    Args:
        numbers: of the monitor.
        words: of the controller beside which it runs.
        card: the input module.
        head: remarks at its beginning.
        runs: of loops, in order and broken.
    """
    write = _TARGETS.get(words.target)
    runs, head = [*runs, _to_limits(numbers, card)], [" ".join(line.split()) for line in head]
    if words.target == ONE_BIT_TARGET:
        return _of_one_bit(numbers, words.sample_time_s, head, runs)
    if write is None:
        return MonitorProgram(why=f"no program is written for {words.target}")
    try:
        check_reach(numbers, card.highest, _BITS.get(words.target, 32))
        file, source, load = write(statements_of(numbers), words, card, list(head))
        text = load()
        why = _other_power(text) or _other_alarm(numbers, text, runs)
    except InputError as problem:
        return MonitorProgram(why=str(problem))
    if why is not None:
        return MonitorProgram(why=f"{file}: {why}")
    return MonitorProgram(file=file, text=source, calls=sum(len(one.counts) for one in runs), runs=len(runs))


def _to_limits(numbers: Numbers, card: Card) -> Ran:
    """Return a run that goes to each limit of a reading, of a rate and of a time, and one beyond."""
    low, high = max(numbers.low, 0), min(numbers.high, card.highest)
    middle = (low + high) // 2
    calls = list[tuple[int, int]]()

    def rest(length: int, power: int = 50) -> None:
        calls.extend((middle + k % 2, power) for k in range(length))

    for size in (numbers.jump, numbers.jump + 1):
        rest(4)
        calls.extend((count, 50) for count in (low, low + size, low, low + size))
    for count in (low, low - 1, high, high + 1):
        rest(4)
        calls.append((count, 50))
    for held, power in ((numbers.still, 50), (numbers.still_moved, 49 + numbers.moved), (
            numbers.still_moved, 50 + numbers.moved), (numbers.still_moved, 50 - numbers.moved)):
        rest(4)
        calls += [(middle, 50), *[(middle, power)] * min(held + 2, _LONGEST)]
    rest(4)
    rest(min(numbers.full + 2, _LONGEST), 100)
    inside = [(count, power) for count, power in calls if 0 <= count <= card.highest]
    counts, powers = np.array(inside, dtype=np.int32).T
    return Ran(counts=counts, power=powers.astype(np.int16), temperature_degC=np.zeros(len(counts)))


def _of_one_bit(numbers: Numbers, scan_s: float, head: Sequence[str], runs: Sequence[Ran]) -> MonitorProgram:
    text = one_bit_text(numbers, scan_s, head)
    why = one_bit_departure(text, numbers, scan_s, runs)
    if why is not None:
        return MonitorProgram(why=f"{ONE_BIT_FILE}: {why}")
    return MonitorProgram(file=ONE_BIT_FILE, text=text, calls=sum(len(one.counts) for one in runs), runs=len(runs))


def _other_power(text: LoadedText) -> str | None:
    """Return where the power in whole percent is other than the nearest one."""
    for output, power in text.outputs():
        made = text.call(0, output)[2]
        if made != math.floor(power + 0.5):
            return f"it takes the output {output:g} for {made} %; it is {power:g} %"
    return None


def _other_alarm(numbers: Numbers, text: LoadedText, runs: Sequence[Ran]) -> str | None:
    """Return where it says other than the monitor."""
    for one in runs:
        wanted = np.empty(len(one.counts), dtype=np.int64)
        compile_function(alarms)(numbers, np.zeros(STATE, dtype=np.int64), one.counts, one.power, wanted)
        text.start()
        text.acknowledge()
        first, supplied = 0, True
        for k, (count, power, alarm) in enumerate(
                zip(one.counts.tolist(), one.power.tolist(), wanted.tolist(), strict=True)):
            before, supplied = supplied, power >= 0
            if not supplied:
                continue
            if not before:
                text.start()
            first = first or alarm
            made = text.call(count, text.output_of(power))
            if made != (alarm, first, power):
                return (f"in call {k + 1} it says {ALARMS[made[0]]}, first {ALARMS[made[1]]}; the monitor says "
                        f"{ALARMS[alarm]}, first {ALARMS[first]}")
    return None


def _for_s7_300(statements: Statements, words: Words, _card: Card, head: list[str]) -> _Written:
    real = words.target == _REAL
    source = s7_300_text(statements, head, real=real)
    return S7_300_FILE, source, lambda: S7300Text(source, real=real)


def _structured(statements: Statements, _words: Words, card: Card, head: list[str]) -> _Written:
    low, step, highest = card
    source = structured_text(statements, head, low_degC=low, step_degC=step, highest=highest)
    return STRUCTURED_FILE, source, lambda: StructuredText(source, low_degC=low, step_degC=step)


def _for_s7_200(statements: Statements, words: Words, card: Card, head: list[str]) -> _Written:
    target, cycle = words.target, cycle_ms(words.whole)
    per_count = 1 if target == "s7-200" else FULL // card.highest
    source = s7_200_text(statements, head, reading_of(target, per_count), cycle)
    return S7_200_FILE, source, lambda: S7200Text(source, statements, target, per_count, cycle)


def _for_s5(statements: Statements, _words: Words, _card: Card, head: list[str]) -> _Written:
    source = s5_text(statements, head)
    return S5_FILE, source, lambda: S5Text(source)


_TARGETS: Final[dict[str, Callable[[Statements, Words, Card, list[str]], _Written]]] = {
    "s5-ob251": _for_s5, "s7-300": _for_s7_300, "fb41": _for_s7_300, "s7-200": _for_s7_200,
    "s7-200-pid": _for_s7_200, "weg": _structured, "iec-pid": _structured,
}
#: target → bits of its cells, where they are not 32
_BITS: Final = {"s5-ob251": 16, "s7-200": 16, "s7-200-pid": 16}

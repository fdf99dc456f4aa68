"""What a one-bit PLC can do of the monitor: a sensor that is gone, and heat for too long.

It compares numbers but stores none: no rate, no frozen sensor, no sum, no window. A timer stands for counted calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from heatertune.compiled import compile_function
from heatertune.plc.cpu.one_bit.machine import START, Names, OneBitProgram, Wiring, assemble, disassemble, scan
from heatertune.supervision.faulty_loops import Ran
from heatertune.supervision.monitor import STATE, Numbers, alarms

__all__ = ["FILE", "TARGET", "departs", "reduce_monitor", "written"]

TARGET: Final = "on-off"
FILE: Final = "monitor_listing.txt"
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


def written(numbers: Numbers, scan_s: float, head: Sequence[str]) -> str:
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


def departs(text: str, numbers: Numbers, scan_s: float, runs: Sequence[Ran]) -> str | None:
    """Return where the listing says other than the monitor that is left, None for nowhere."""
    program, low_high = assemble(text, _NAMES, operand_bits=4), (numbers.low, numbers.high)
    wiring = Wiring(inputs=frozenset({3}), results={1: -1, 2: 1}, timers={4: _delay_ms(numbers, scan_s)})
    for one in runs:
        alarm_codes = np.empty(len(one.counts), dtype=np.int64)
        compile_function(alarms)(reduce_monitor(numbers), np.zeros(STATE, dtype=np.int64), one.counts, one.power,
                                 alarm_codes)
        state, tripped = START, False
        for k, (count, power, alarm) in enumerate(
                zip(one.counts.tolist(), one.power.tolist(), alarm_codes.tolist(), strict=True)):
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

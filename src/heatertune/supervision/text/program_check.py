"""The monitor's text in the machine of its target, call by call beside the monitor that was proven: the same alarms."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.plc import Words
from heatertune.plc.cpu.s7_200.io_and_cycle import cycle_ms
from heatertune.plc.s7_200_pid.words import FULL
from heatertune.supervision.faulty_loops import Card, Ran
from heatertune.supervision.monitor import ALARMS, STATE, Numbers, alarms
from heatertune.supervision.text import one_bit, s5, s7_200, s7_300, structured
from heatertune.supervision.text.monitor_statements import Statements, check_reach, statements_of

__all__ = ["LoadedText", "MonitorProgram", "export_monitor"]

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
    if words.target == one_bit.TARGET:
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
    for scans, power in ((numbers.still, 50), (numbers.still_moved, 49 + numbers.moved), (
            numbers.still_moved, 50 + numbers.moved), (numbers.still_moved, 50 - numbers.moved)):
        rest(4)
        calls += [(middle, 50), *[(middle, power)] * min(scans + 2, _LONGEST)]
    rest(4)
    rest(min(numbers.full + 2, _LONGEST), 100)
    inside = [(count, power) for count, power in calls if 0 <= count <= card.highest]
    counts, powers = np.array(inside, dtype=np.int32).T
    return Ran(counts=counts, power=powers.astype(np.int16), temperature_degC=np.zeros(len(counts)))


def _of_one_bit(numbers: Numbers, scan_s: float, head: Sequence[str], runs: Sequence[Ran]) -> MonitorProgram:
    text = one_bit.written(numbers, scan_s, head)
    why = one_bit.departs(text, numbers, scan_s, runs)
    if why is not None:
        return MonitorProgram(why=f"{one_bit.FILE}: {why}")
    return MonitorProgram(file=one_bit.FILE, text=text, calls=sum(len(one.counts) for one in runs), runs=len(runs))


def _other_power(text: LoadedText) -> str | None:
    """Return where the power in whole percent is other than the nearest one."""
    for output, power in text.outputs():
        output_pct = text.call(0, output)[2]
        if output_pct != math.floor(power + 0.5):
            return f"it takes the output {output:g} for {output_pct} %; it is {power:g} %"
    return None


def _other_alarm(numbers: Numbers, text: LoadedText, runs: Sequence[Ran]) -> str | None:
    """Return where it says other than the monitor."""
    for one in runs:
        alarm_codes = np.empty(len(one.counts), dtype=np.int64)
        compile_function(alarms)(numbers, np.zeros(STATE, dtype=np.int64), one.counts, one.power, alarm_codes)
        text.start()
        text.acknowledge()
        first, supplied = 0, True
        for k, (count, power, alarm) in enumerate(
                zip(one.counts.tolist(), one.power.tolist(), alarm_codes.tolist(), strict=True)):
            before, supplied = supplied, power >= 0
            if not supplied:
                continue
            if not before:
                text.start()
            first = first or alarm
            result = text.call(count, text.output_of(power))
            if result != (alarm, first, power):
                return (f"in call {k + 1} it says {ALARMS[result[0]]}, first {ALARMS[result[1]]}; the monitor says "
                        f"{ALARMS[alarm]}, first {ALARMS[first]}")
    return None


def _for_s7_300(statements: Statements, words: Words, _card: Card, head: list[str]) -> _Written:
    real = words.target == _REAL
    source = s7_300.written(statements, head, real=real)
    return s7_300.FILE, source, lambda: s7_300.S7300Text(source, real=real)


def _structured(statements: Statements, _words: Words, card: Card, head: list[str]) -> _Written:
    low, step, highest = card
    source = structured.written(statements, head, low_degC=low, step_degC=step, highest=highest)
    return structured.FILE, source, lambda: structured.StructuredText(source, low_degC=low, step_degC=step)


def _for_s7_200(statements: Statements, words: Words, card: Card, head: list[str]) -> _Written:
    target, cycle = words.target, cycle_ms(words.whole)
    per_count = 1 if target == "s7-200" else FULL // card.highest
    source = s7_200.written(statements, head, s7_200.reading_of(target, per_count), cycle)
    return s7_200.FILE, source, lambda: s7_200.S7200Text(source, statements, target, per_count, cycle)


def _for_s5(statements: Statements, _words: Words, _card: Card, head: list[str]) -> _Written:
    source = s5.written(statements, head)
    return s5.FILE, source, lambda: s5.S5Text(source)


_TARGETS: Final[dict[str, Callable[[Statements, Words, Card, list[str]], _Written]]] = {
    "s5-ob251": _for_s5, "s7-300": _for_s7_300, "fb41": _for_s7_300, "s7-200": _for_s7_200,
    "s7-200-pid": _for_s7_200, "weg": _structured, "iec-pid": _structured,
}
#: target → bits of its cells, where they are not 32
_BITS: Final = {"s5-ob251": 16, "s7-200": 16, "s7-200-pid": 16}

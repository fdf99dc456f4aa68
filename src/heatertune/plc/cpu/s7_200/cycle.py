"""The PWM cycle of an S7-200: a timed interrupt counts ticks, and computes once in each cycle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from heatertune.errors import OutOfRange
from heatertune.pid.timer import Timer
from heatertune.plc.cpu.s7_200.cpu import COLD, Program, State, run
from heatertune.plc.ramp import Number
from heatertune.plc.words import WordField, Words, kept_by

__all__ = [
    "MOST", "TICK_FIELDS", "TIMER", "Interrupted", "Timed", "check_cycle", "cycle_ms", "cycle_s", "run_cycle",
    "ticks_of", "whole_cycle",
]

#: largest constant, and largest PWM cycle [ms]: a signed word
MOST: Final = 32767
#: whole tenths of a second are whole numbers of ticks
TIMER: Final = Timer(shortest_s=0.1, longest_s=32.7, step_s=0.1)

_SHORTEST_TICK, _LONGEST_TICK = 5, 255  # SMB34 of a CPU 214 [ms]
_TIMED: Final = 10  # event of timed interrupt 0

TICK_FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="TICK", address="SMB34", format="BYTE", low=_SHORTEST_TICK, high=_LONGEST_TICK,
              comment="timed interrupt 0, ms"),
    WordField(name="TICKS", address="VW208", format="INT", low=1, high=MOST // _SHORTEST_TICK,
              comment="interrupts per PWM cycle"),
)


def check_cycle(words: Words) -> None:
    """Refuse words whose TICK and TICKS make no PWM cycle.

    Raises:
        OutOfRange: the cycle is too long for a signed word.
    """
    cycle = cycle_ms(words.whole)
    if cycle > MOST:
        raise OutOfRange("word TICKS", words.whole["TICKS"], f"such that TICK·TICKS is at most {MOST} ms (now {cycle})")


def ticks_of(cycle: int) -> dict[str, int]:
    """Return the longest timed interrupt [ms] that divides a PWM cycle [ms], and how many of them make it."""
    tick = max(tick for tick in range(_SHORTEST_TICK, _LONGEST_TICK + 1) if cycle % tick == 0)
    return {"TICK": tick, "TICKS": cycle // tick}


def cycle_ms(values: Mapping[str, int]) -> int:
    """Return the PWM cycle [ms]."""
    return values["TICK"] * values["TICKS"]


def cycle_s(values: Mapping[str, Number]) -> float:
    """Return the PWM cycle [s]."""
    return values["TICK"] * values["TICKS"] / 1000.0


def whole_cycle(ta: float) -> int:
    """Return the PWM cycle [ms] of a sampling interval [s]; raise NotRepresentable for one that no cycle can have."""
    return round(1000.0 * kept_by(TIMER, ta))


class Timed(NamedTuple):
    """A program that computes in timed interrupt 0.

    Attributes:
        countdown: word of the ticks to go.
        next_cycle: whether a width shapes the PWM cycle after the one in which it is written.
        bumpless: of the PID instruction, see `Cpu`.
    """

    program: Program
    cycle_ms: int
    countdown: str
    next_cycle: bool
    bumpless: bool = True


class Interrupted(NamedTuple):
    """What a running program keeps: the CPU, and the block attached to the timed interrupt once it has begun."""

    cpu: State = COLD
    interrupt: str | None = None
    begun: bool = False


def run_cycle(
    timed: Timed, state: Interrupted, inputs: Mapping[str, int]
) -> tuple[Interrupted, float, int, int]:
    """Run the first scan, once, and the timed interrupt in which the program computes.

    Args:
        timed: the program.
        state: before the cycle.
        inputs: address → what stands there.

    Returns:
        The state, the power [%], the pulse width [ms], and SM1.1 and SM1.3 as bits.
    """
    cpu, interrupt = state.cpu.written(inputs), state.interrupt
    if not state.begun:
        cpu = run(timed.program, "OB1", cpu.written({"SM0.1": 1})).written({"SM0.1": 0})
        interrupt = dict(cpu.attached).get(_TIMED) if cpu.enabled else None
    before = cpu.width
    if interrupt is not None:
        # the ticks before this one do nothing but count down; a test runs them all
        cpu = run(timed.program, interrupt, cpu.written({timed.countdown: 1}), bumpless=timed.bumpless)
    width = before if timed.next_cycle else cpu.width
    power = 100.0 * min(width, timed.cycle_ms) / timed.cycle_ms
    return Interrupted(cpu, interrupt, True), power, width, int(cpu.overflow) + 2 * int(cpu.zero_division)

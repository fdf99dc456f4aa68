"""The PWM behind YA in sums of 16 bits, as STEP 5 has no multiplication: a staircase over the ticks of a period.

At tick j of N the staircase stands at c = floor((2j + 1)·2047/(2N)), and the output is on while c < YA: at the nearest
number of ticks to YA·N/2047, for a tie would ask for 2·YA·N = 2047·odd, an even number for an odd one.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from heatertune.plc.pwm import INSTANT_S, Actuator, Ticks, on_time
from heatertune.plc.s5_ob251.step import FULL_SCALE

__all__ = ["Staircase", "staircase"]

_MOST: Final = 32767


class Staircase(NamedTuple):
    """What is summed up.

    Attributes:
        ticks: of a call and of a period.
        parts: 2N, by which the remainder counts.
        first, first_part: whole units and remainder at tick 0.
        step, step_part: of each further tick.
        least: YA below this gives no pulse, for it would be too short; None: it would not.
        full: from this YA on there is no pause, likewise.
    """

    ticks: Ticks
    parts: int
    first: int
    first_part: int
    step: int
    step_part: int
    least: int | None
    full: int | None


def staircase(actuator: Actuator | None, sample_time_s: float) -> Staircase | None:
    """Return the staircase of a switch; None: no clock of OB13 makes it, its sums overflow, or it carries over.

    Args:
        actuator: the switch that was proven; None: none is known.
        sample_time_s: TA [s].
    """
    ticks = None if actuator is None else actuator.ticks(sample_time_s)
    if actuator is None or ticks is None or actuator.minimum_rule == "carry":
        return None
    parts = 2 * ticks.per_period
    if ticks.per_call > _MOST or 2 * parts > _MOST or not _of_ten_ms(actuator.resolution_s):
        return None
    least, full = _limits(actuator, ticks.per_period)
    return Staircase(ticks, parts, *divmod(FULL_SCALE, parts), *divmod(2 * FULL_SCALE, parts), least=least, full=full)


def _limits(actuator: Actuator, ticks: int) -> tuple[int | None, int | None]:
    """Return `Staircase.least` and `Staircase.full` of a switch whose period is so many ticks."""
    least = full = None
    for ya in range(FULL_SCALE + 1):
        on_s, _ = on_time(100.0 * ya / FULL_SCALE, 0.0, actuator.numbers)
        on, nearest = round(on_s / actuator.resolution_s), (2 * ya * ticks + FULL_SCALE) // (2 * FULL_SCALE)
        if on < nearest:
            least = ya + 1
        elif on > nearest and full is None:
            full = ya
    return least, full


def _of_ten_ms(tick_s: float) -> bool:
    """Return whether OB13 keeps an interval: its system data counts 10 ms."""
    counts = 100.0 * tick_s
    return round(counts) > 0 and abs(round(counts) - counts) <= INSTANT_S

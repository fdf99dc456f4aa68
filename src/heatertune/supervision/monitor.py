"""The monitor: readings and requested power give an alarm, in whole numbers, one scan per call.

All arithmetic fits into 32-bit integers, so a PLC computes the same. It does not replace a thermal cut-out: it uses
the controller's own sensor. Each block of scans gives the sum of its readings (level) and of its powers. Over a window
of N blocks the level moves by D; the powers are those of N blocks, `delay_low`…`delay_high` blocks ago. With R the
level at the start of the window, no plausible heater (one lag, slowest and fastest) violates

    slow_scale·D  ≥  slow_gain·(least sum of powers) − slow_loss·R + slow_rest
    fast_scale·D  ≤  fast_gain·(largest sum of powers) − fast_loss·R + fast_rest
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

__all__ = [
    "ALARMS", "RING", "STATE", "Numbers", "alarms", "cold", "in_a_row", "is_full", "restart", "scan", "scan_counts",
    "unseen", "watch", "window_sums",
]

#: alarm → what it says; 0 is none
ALARMS: Final = (
    "none", "sensor gone", "implausible rate", "frozen", "heats too slowly", "falls although heated",
    "too hot for its power", "setpoint out of reach", "swing grows",
)
_GONE: Final = 1
_RATE: Final = 2
_FROZEN: Final = 3
_SLOW: Final = 4
_FALLS: Final = 5
_HOT: Final = 6
_FULL: Final = 7
_SWING: Final = 8

#: blocks that are remembered
RING: Final = 64
# places in the state before the two rings
_IN_BLOCK: Final = 0
_LEVEL: Final = 1
_POWER: Final = 2
_BLOCKS: Final = 3
_LAST: Final = 4
_STILL: Final = 5
_HELD: Final = 6
_MOVED_FOR: Final = 7
_FULL_FOR: Final = 8
_END: Final = 9
_TURN: Final = 10
_RISES: Final = 11
_SWUNG: Final = 12
_GREW: Final = 13
_BEGUN: Final = 14
_LEVELS: Final = 16
_POWERS: Final = _LEVELS + RING
#: whole numbers of the state
STATE: Final = _POWERS + RING
_FULL_PCT: Final = 100
_LONG: Final = 1 << 30


class Numbers(NamedTuple):
    """What the monitor holds, all whole numbers; 0 switches a rule off where it says so.

    Attributes:
        block: scans of a block.
        low, high: a reading below or above: sensor gone [counts].
        jump: most that a reading moves from scan to scan [counts].
        still: scans for which a reading may stay the same; 0: as long as it likes.
        still_moved: the same after the power has moved by `moved` or more; 0: as long as it likes.
        moved: [% of power].
        delay_low, delay_high: blocks after which power acts.
        slow_blocks, slow_scale, slow_gain, slow_loss, slow_rest: the least movement; no blocks: off.
        fast_blocks, fast_scale, fast_gain, fast_loss, fast_rest: the largest; no blocks: off.
        full: scans for which full power may be asked for; 0: as long as it likes.
        swing: least swing that is one [counts times scans of a block].
        growths: of so many swings in a row each is larger than the one before: it grows; 0: off.
    """

    block: int
    low: int
    high: int
    jump: int
    still: int
    still_moved: int
    moved: int
    delay_low: int
    delay_high: int
    slow_blocks: int
    slow_scale: int
    slow_gain: int
    slow_loss: int
    slow_rest: int
    fast_blocks: int
    fast_scale: int
    fast_gain: int
    fast_loss: int
    fast_rest: int
    full: int
    swing: int
    growths: int


def scan_counts(state: Any) -> tuple[int, int, int, int, bool, int]:
    """Return for how many scans the reading stood still, so after the power moved, and full power was asked for.

    Then how many swings grew, whether a block has just ended, and its level.
    """
    level = state[_LEVELS + (state[_BLOCKS] + RING - 1) % RING]
    return state[_STILL], state[_MOVED_FOR], state[_FULL_FOR], state[_GREW], state[_IN_BLOCK] == 0, level


def in_a_row(numbers: Numbers) -> int:
    """Return after how many scans all its windows are full; before, it does not hold the level against the power."""
    return numbers.block * (1 + numbers.delay_high + max(numbers.slow_blocks, numbers.fast_blocks))


def restart(state: Any) -> None:
    """Forget everything, as a start-up of the PLC does; the state is a list or array of `STATE` whole numbers."""
    for place in range(STATE):
        state[place] = 0


def cold() -> list[int]:
    """Return a state that knows nothing."""
    return [0] * STATE


def scan(numbers: Numbers, state: Any, reading: int, power: int) -> int:
    """Run one scan and return the alarm, 0 for none.

    Args:
        numbers: of the monitor.
        state: `STATE` whole numbers, changed in their place.
        reading: of the card [counts].
        power: that the controller asks for, 0…100 %.
    """
    alarm = _of_scan(numbers, state, reading, power)
    state[_LEVEL] += reading
    state[_POWER] += power
    state[_IN_BLOCK] += 1
    if state[_IN_BLOCK] >= numbers.block:
        blocks = state[_BLOCKS]
        state[_LEVELS + blocks % RING] = state[_LEVEL]
        state[_POWERS + blocks % RING] = state[_POWER]
        state[_IN_BLOCK] = state[_LEVEL] = state[_POWER] = 0
        # only its place in the ring and whether the windows are full count: it stays small for ever
        state[_BLOCKS] = blocks + 1 if blocks + 1 < 2 * RING else RING
        block_alarm = _of_block(numbers, state)
        alarm = alarm if alarm != 0 else block_alarm
    return alarm


def unseen(numbers: Numbers, state: Any, reading: int, power: int) -> int:
    """Run a scan that nobody saw, as `scan` does; it does not count for a reading or a power that stays the same."""
    before = state[_STILL], state[_MOVED_FOR], state[_FULL_FOR]
    alarm = scan(numbers, state, reading, power)
    for place, counted_before in zip((_STILL, _MOVED_FOR, _FULL_FOR), before, strict=True):
        state[place] = min(state[place], counted_before)
    return alarm


def _of_scan(numbers: Numbers, state: Any, reading: int, power: int) -> int:
    alarm, first = 0, state[_BEGUN] == 0
    moved = reading - state[_LAST]
    state[_FULL_FOR] = min(state[_FULL_FOR] + 1, _LONG) if power >= _FULL_PCT else 0
    if first or moved != 0:
        state[_STILL], state[_MOVED_FOR], state[_HELD] = 0, 0, power
    else:
        # none is counted further than any limit goes
        state[_STILL] = min(state[_STILL] + 1, _LONG)
        away = power - state[_HELD]
        if state[_MOVED_FOR] > 0 or away >= numbers.moved or -away >= numbers.moved:
            state[_MOVED_FOR] = min(state[_MOVED_FOR] + 1, _LONG)
    if 0 < numbers.full < state[_FULL_FOR]:
        alarm = _FULL
    if 0 < numbers.still < state[_STILL] or 0 < numbers.still_moved < state[_MOVED_FOR]:
        alarm = _FROZEN
    if not first and (moved > numbers.jump or -moved > numbers.jump):
        alarm = _RATE
    if reading < numbers.low or reading > numbers.high:
        alarm = _GONE
    state[_LAST], state[_BEGUN] = reading, 1
    return alarm


def is_full(numbers: Numbers, state: Any, blocks: int) -> bool:
    """Return whether a block has just ended and there are as many as a window of so many blocks looks back."""
    return bool(state[_IN_BLOCK] == 0 and state[_BLOCKS] - numbers.delay_high > blocks)


def window_sums(numbers: Numbers, state: Any, blocks: int, largest: bool) -> tuple[int, int, int]:
    """Return movement, level at the window's begin and the largest or least sum of powers of a window's blocks."""
    newest = state[_BLOCKS] - 1 + RING  # no place is negative
    level = state[_LEVELS + newest % RING]
    before = state[_LEVELS + (newest - blocks) % RING]
    power = 0
    for back in range(blocks):
        power += state[_POWERS + (newest - numbers.delay_low - back) % RING]
    most = power
    for delay in range(numbers.delay_low + 1, numbers.delay_high + 1):
        power += state[_POWERS + (newest - delay - blocks + 1) % RING]
        power -= state[_POWERS + (newest - delay + 1) % RING]
        most = max(most, power) if largest else min(most, power)
    return level - before, before, most


def _of_block(numbers: Numbers, state: Any) -> int:
    alarm = 0
    if numbers.growths > 0 and _grew(numbers, state) >= numbers.growths:
        alarm = _SWING
    if numbers.slow_blocks > 0 and is_full(numbers, state, numbers.slow_blocks):
        move, level, power = window_sums(numbers, state, numbers.slow_blocks, False)
        if numbers.slow_scale * move < numbers.slow_gain * power - numbers.slow_loss * level + numbers.slow_rest:
            alarm = _FALLS if move <= -numbers.swing else _SLOW
    if numbers.fast_blocks > 0 and is_full(numbers, state, numbers.fast_blocks):
        move, level, power = window_sums(numbers, state, numbers.fast_blocks, True)
        if numbers.fast_scale * move > numbers.fast_gain * power - numbers.fast_loss * level + numbers.fast_rest:
            alarm = _HOT
    return alarm


def _grew(numbers: Numbers, state: Any) -> int:
    """Follow the swings of the level; return how many in a row were larger than the one before."""
    level = state[_LEVELS + (state[_BLOCKS] - 1 + RING) % RING]
    if state[_BLOCKS] == 1:
        state[_END] = state[_TURN] = level
    if state[_RISES] == 0:  # which way is not known yet: END is the highest level, TURN the lowest
        state[_END], state[_TURN] = max(state[_END], level), min(state[_TURN], level)
        if level <= state[_END] - numbers.swing:
            state[_RISES], state[_TURN], state[_END] = -1, state[_END], level
        elif level >= state[_TURN] + numbers.swing:
            state[_RISES], state[_END] = 1, level
        return 0
    way = state[_RISES]
    if way * (level - state[_END]) >= 0:
        state[_END] = level
    elif way * (state[_END] - level) >= numbers.swing:
        swung = way * (state[_END] - state[_TURN])
        state[_GREW] = state[_GREW] + 1 if 0 < state[_SWUNG] < swung else 0
        state[_SWUNG], state[_TURN], state[_END], state[_RISES] = swung, state[_END], level, -way
    return int(state[_GREW])


def watch(numbers: Numbers, state: Any, readings: Any, powers: Any, first: int) -> tuple[int, int]:
    """Run the monitor over a record; return the scan of the first alarm (-1: none) and the alarm.

    Args:
        numbers: of the monitor.
        state: places for its state.
        readings: [counts].
        powers: [%]; negative: no supply, the monitor does not run, and starts anew after.
        first: alarms before this scan are not looked at.
    """
    restart(state)
    off = False
    for k in range(len(readings)):
        if powers[k] < 0:
            off = True
            continue
        if off:
            restart(state)
            off = False
        alarm = scan(numbers, state, int(readings[k]), int(powers[k]))
        if alarm != 0 and k >= first:
            return k, alarm
    return -1, 0


def alarms(numbers: Numbers, state: Any, readings: Any, powers: Any, out: Any) -> None:
    """Run the monitor over a record as `watch` does, and write the alarm of each scan.

    Args:
        numbers: of the monitor.
        state: places for its state.
        readings: [counts].
        powers: [%]; negative: no supply.
        out: for the alarms; -1 where there is no supply.
    """
    restart(state)
    off = False
    for k in range(len(readings)):
        if powers[k] < 0:
            out[k], off = -1, True
            continue
        if off:
            restart(state)
            off = False
        out[k] = scan(numbers, state, int(readings[k]), int(powers[k]))

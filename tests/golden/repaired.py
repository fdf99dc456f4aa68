"""The repaired program a second time: once per PWM cycle, in exact numbers, the increments of the paper's equation."""

from typing import NamedTuple


class Constants(NamedTuple):
    """What the programmer writes."""

    kp: int
    ki: int
    kd: int
    scale: int
    cycle_ms: int


class Memory(NamedTuple):
    """What the program keeps from cycle to cycle: errors and readings in counts, the width in ms."""

    error: int = 0
    reading: int = 0
    before: int = 0
    rest: int = 0
    width: int = 0
    begun: bool = False


def cycle(c: Constants, m: Memory, setpoint: int, reading: int) -> Memory:
    """Return the memory after one PWM cycle's computation; `setpoint` and `reading` are bytes."""
    error = setpoint - reading
    last, before = (m.reading, m.before) if m.begun else (reading, reading)
    total = c.kp * (error - m.error) + c.ki * (error + m.error) + c.kd * (2 * last - reading - before) + m.rest
    width = min(max(m.width + (total >> c.scale), 0), c.cycle_ms)
    return Memory(error, reading, last, total & ((1 << c.scale) - 1), width, True)

"""The program, network by network, as printed and as repaired.

As printed (Alia 2007, Table 2), every scan: VW10 = setpoint − process variable, both in the high byte of their words;
AC0 = Kp·E_prev + T·Ki·(E + E_prev) + Kd·(E − E_prev)/T; VW100 = its high word. The interrupt on the rising edge of
Q0.0 adds VW100 to the pulse width SMW70. So what is called P accumulates (acts as I) and what is called D acts as P.

As repaired, the same constants, once per PWM cycle and in exact arithmetic: the velocity PI controller that the
printed one means to be.
"""

from __future__ import annotations

from typing import NamedTuple

from heatertune.plc.s7_200.arithmetic import (
    add_double,
    add_word,
    divide,
    high_word,
    low_word,
    multiply,
    subtract_word,
)

__all__ = ["Constants", "Memory", "printed_scan", "repaired_scan"]


_FIRST_EDGE = 3  # S Q0.0,1 reaches I0.0 behind its input filter, some scans after the first


class Constants(NamedTuple):
    """What the programmer writes, and how open points are read."""

    kp: int
    ki: int
    kd: int
    t: int
    cycle_ms: int
    scale_bits: int
    pot1: int
    wrap: bool  # overflowing +I and −I write their wrapped result
    next_cycle: bool  # a width takes effect one PWM cycle later
    stops_at_rails: bool  # no edge, so no interrupt, at a width of 0 or of the whole cycle


class Memory(NamedTuple):
    """What the program keeps from scan to scan; width and cycle in ms."""

    error: int = 0  # VW10
    previous: int = 0  # VW20
    change: int = 0  # VW100
    width: int = 0  # SMW70
    applied: int = 0  # width of the running PWM cycle
    rest: int = 0  # repaired program: what the scaling has left over
    scans: int = 0  # counted up to the scan in which the edge of S Q0.0,1 is served
    overflow: bool = False  # SM1.1
    zero_division: bool = False  # SM1.3


def printed_scan(c: Constants, m: Memory, setpoint: int, reading: int, cycle_start: bool) -> Memory:
    """Run the interrupt where Q0.0 rises, then networks 3 to 7.

    A width of 0 or of the whole cycle has no rising edge: no interrupt comes any more, and the width stays.
    """
    m = m._replace(overflow=False, zero_division=False, scans=min(m.scans + 1, _FIRST_EDGE + 1))
    rises = 0 < m.applied < c.cycle_ms or not c.stops_at_rails
    if m.scans == _FIRST_EDGE or (cycle_start and rises):
        m = _output_interrupt(c, m)
    word, flag_0 = subtract_word(_byte_in_high(setpoint, c.pot1), _byte_in_high(reading, 0), wrap=c.wrap)
    previous = m.error
    ac0 = multiply(c.kp, previous)
    ac1, flag_1 = add_word(word, previous, wrap=c.wrap)
    ac1 = multiply(c.t, multiply(c.ki, ac1))  # the second MUL reads the low word of the first one's product
    ac0, flag_2 = add_double(ac1, ac0, wrap=c.wrap)
    ac1, flag_3 = subtract_word(word, previous, wrap=c.wrap)
    ac1, zero = divide(multiply(c.kd, ac1), c.t)  # the remainder stays in the high word
    ac0, flag_4 = add_double(ac1, ac0, wrap=c.wrap)
    overflow = m.overflow or flag_0 or flag_1 or flag_2 or flag_3 or flag_4
    return m._replace(
        error=word, previous=previous, change=high_word(ac0), overflow=overflow, zero_division=zero
    )


def _output_interrupt(c: Constants, m: Memory) -> Memory:
    """Network 12: add, limit to the cycle, limit to zero, PLS."""
    width, overflow = add_word(m.change, m.width, wrap=c.wrap)
    width = c.cycle_ms if width >= c.cycle_ms else max(width, 0)
    return m._replace(width=width, applied=m.width if c.next_cycle else width, overflow=overflow)


def repaired_scan(c: Constants, m: Memory, setpoint: int, reading: int) -> Memory:
    """Run once per PWM cycle: exact 32-bit error and products, quotient only, the scaling's rest carried on."""
    error = 256 * (setpoint - reading) + c.pot1
    proportional = c.kd * (error - m.error)
    quotient = abs(proportional) // c.t * (1 if proportional >= 0 else -1)
    total = c.kp * m.error + c.t * c.ki * (error + m.error) + quotient + m.rest
    change = total >> c.scale_bits
    width = min(max(m.width + change, 0), c.cycle_ms)
    return m._replace(
        error=error, previous=m.error, change=change, rest=total - (change << c.scale_bits), width=width,
        applied=m.width if c.next_cycle else width,
    )


def _byte_in_high(byte: int, low: int) -> int:
    return low_word(256 * (byte & 0xFF) + (low & 0xFF))

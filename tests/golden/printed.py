"""The printed program a second time, network by network in plain numbers, written from Alia 2007, Table 2.

Every scan: VW10 = setpoint − process variable, both in the high byte of their words; AC0 = Kp·E_prev +
T·Ki·(E + E_prev) + Kd·(E − E_prev)/T; VW100 = its high word. The interrupt on the rising edge of Q0.0 adds VW100 to the
pulse width SMW70.
"""

from typing import NamedTuple

from heatertune.plc import controller_for
from heatertune.plc.cpu.s7_200.cpu import add_integers, divide_integers, high_word, multiply_integers, to_signed
from heatertune.plc.s7_200_paper.step import S7200PaperAssumptions

FIRST_EDGE = 3  # S Q0.0,1 reaches I0.0 behind its input filter, some scans after the first
_UNLOADED = 2  # cycle of the generator without a cycle time [ms]: "less than 2 units → 2 units"


def constants(words, switches):
    """What the program holds under settings of its open points."""
    v = words.values
    assume = controller_for(words.target).start(words, switches).parameters.assume
    return Constants(v["KP"], v["KI"], v["KD"], v["T"], v["CYCLE"], v["POT1"], assume)


class Constants(NamedTuple):
    """What the programmer writes, and how open points are read."""

    kp: int
    ki: int
    kd: int
    t: int
    cycle_ms: int
    pot1: int
    assume: S7200PaperAssumptions = S7200PaperAssumptions()


class Memory(NamedTuple):
    """What the program keeps from scan to scan; width in ms."""

    error: int = 0  # VW10
    previous: int = 0  # VW20
    change: int = 0  # VW100
    width: int = 0  # SMW70
    applied: int = 0  # width of the running PWM cycle
    scans: int = 0  # counted up to the scan in which the edge of S Q0.0,1 is served
    overflow: bool = False  # SM1.1
    zero_division: bool = False  # SM1.3


def counted(m: Memory) -> Memory:
    """Return the memory at the beginning of the next scan, the flags cleared."""
    return Memory(m.error, m.previous, m.change, m.width, m.applied, min(m.scans + 1, FIRST_EDGE + 1), False, False)


def rises(c: Constants, m: Memory, cycle_start: bool) -> bool:
    """Return whether Q0.0 rises before the next scan."""
    if m.scans == FIRST_EDGE:
        return True
    if not c.assume.loads_cycle:  # a cycle of 2 ms begins in every scan
        return 0 < m.applied < _UNLOADED or not c.assume.stops_at_rails
    return cycle_start and (0 < m.applied < c.cycle_ms or not c.assume.stops_at_rails)


def power_pct(c: Constants, applied: int) -> float:
    """Return the share of the PWM cycle in which Q0.0 is on [%], its width being `applied` [ms]."""
    cycle = c.cycle_ms if c.assume.loads_cycle else _UNLOADED
    return 100.0 * min(applied, cycle) / cycle


def scan(c: Constants, m: Memory, setpoint: int, reading: int, cycle_start: bool) -> Memory:
    """Return the memory after one scan: the interrupt where Q0.0 rises, then networks 3 to 7.

    Args:
        c: the program's constants.
        m: the memory before the scan.
        setpoint: a byte.
        reading: a byte.
        cycle_start: whether a PWM cycle begins with this scan.
    """
    m = counted(m)
    if rises(c, m, cycle_start):
        m = _output_interrupt(c, m)
    word, flag_0 = add_integers(_in_high_byte(setpoint, c.pot1), -_in_high_byte(reading, 0), 16, c.assume.wrap)
    previous = m.error
    ac0 = multiply_integers(c.kp, previous)
    ac1, flag_1 = add_integers(previous, word, 16, c.assume.wrap)
    ac1 = multiply_integers(c.t, multiply_integers(c.ki, ac1))  # the second MUL reads the low word of the first one's product
    ac0, flag_2 = add_integers(ac0, ac1, 32, c.assume.wrap)
    ac1, flag_3 = add_integers(word, -previous, 16, c.assume.wrap)
    ac1, zero = divide_integers(multiply_integers(c.kd, ac1), c.t)  # the remainder stays in the high word
    ac0, flag_4 = add_integers(ac0, ac1, 32, c.assume.wrap)
    overflow = m.overflow or flag_0 or flag_1 or flag_2 or flag_3 or flag_4
    return Memory(word, previous, high_word(ac0), m.width, m.applied, m.scans, overflow, zero)


def _output_interrupt(c: Constants, m: Memory) -> Memory:
    """Network 12: add, limit to the cycle, limit to zero, PLS."""
    width, overflow = add_integers(m.width, m.change, 16, c.assume.wrap)
    width = c.cycle_ms if width >= c.cycle_ms else max(width, 0)
    applied = m.width if c.assume.next_cycle else width
    return Memory(m.error, m.previous, m.change, width, applied, m.scans, overflow, m.zero_division)


def _in_high_byte(byte: int, low: int) -> int:
    return to_signed(256 * (byte & 0xFF) + (low & 0xFF), 16)

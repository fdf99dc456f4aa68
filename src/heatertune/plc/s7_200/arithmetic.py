"""Integer instructions of the S7-200 (System Manual C79000-G7076-C233-01, pp. 9-70 to 9-77): widths and overflow.

Words and double words are signed Python integers. Each function returns the result and whether SM1.1 (overflow) is set.
"""

from __future__ import annotations

from typing import Final

__all__ = ["add_double", "add_word", "divide", "high_word", "low_word", "multiply", "subtract_word"]

_WORD: Final = 1 << 16
_DOUBLE: Final = 1 << 32


def low_word(value: int) -> int:
    """Return the low 16 bits as a signed word."""
    return (value + _WORD // 2) % _WORD - _WORD // 2


def high_word(value: int) -> int:
    """Return the high 16 bits of a double word as a signed word: the floor of value/65536."""
    return value >> 16


def add_word(first: int, second: int, *, wrap: bool) -> tuple[int, bool]:
    """+I: an overflow sets SM1.1 and, unless `wrap`, leaves the output operand (`second`) as it was."""
    return _kept(first + second, second, low_word(first + second), wrap)


def subtract_word(first: int, second: int, *, wrap: bool) -> tuple[int, bool]:
    """−I: first − second; the output operand is `first`."""
    return _kept(first - second, first, low_word(first - second), wrap)


def add_double(first: int, second: int, *, wrap: bool) -> tuple[int, bool]:
    """+D; the output operand is `second`."""
    total = first + second
    return _kept(total, second, (total + _DOUBLE // 2) % _DOUBLE - _DOUBLE // 2, wrap)


def multiply(first: int, second: int) -> int:
    """MUL: the low words of both → double word; it cannot overflow."""
    return low_word(first) * low_word(second)


def divide(dividend: int, divisor: int) -> tuple[int, bool]:
    """DIV: low word of `dividend` / divisor → remainder in the high word, quotient in the low word.

    Returns the double word and whether SM1.3 (division by zero) is set; then the operand stays.
    """
    low = low_word(dividend)
    if divisor == 0:
        return dividend, True
    quotient = abs(low) // abs(divisor) * (1 if (low < 0) == (divisor < 0) else -1)
    remainder = low - quotient * divisor
    return (remainder << 16) | (quotient & 0xFFFF), False


def _kept(exact: int, old: int, wrapped: int, wrap: bool) -> tuple[int, bool]:
    if exact == wrapped:
        return exact, False
    return (wrapped if wrap else old), True

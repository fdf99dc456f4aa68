"""Integer instructions of the S7-200 (System Manual C79000-G7076-C233-01, pp. 9-70 to 9-77): widths and overflow.

Words and double words are signed Python integers. The sums return the result and whether SM1.1 (overflow) is set; an
overflow leaves the output operand as it was or, with `wrap`, writes the wrapped result.
"""

from __future__ import annotations

from typing import Final

__all__ = ["add_integers", "divide_integers", "high_word", "multiply_integers", "to_signed"]

_WORD: Final = 1 << 16


def to_signed(value: int, bits: int) -> int:
    """Return the low bits of a number as a signed one."""
    half = 1 << (bits - 1)
    return (value + half) % (2 * half) - half


def high_word(value: int) -> int:
    """Return the high 16 bits of a double word as a signed word: the floor of value/65536."""
    return value >> 16


def add_integers(output: int, operand: int, bits: int, wrap: bool) -> tuple[int, bool]:
    """+I, −I, +D, −D: output plus operand (negative for a difference), and whether it overflows."""
    wrapped = to_signed(output + operand, bits)
    if wrapped == output + operand:
        return wrapped, False
    return (wrapped if wrap else output), True


def multiply_integers(first: int, second: int) -> int:
    """MUL: the low words of both → double word; it cannot overflow."""
    return to_signed(first, 16) * to_signed(second, 16)


def divide_integers(dividend: int, divisor: int) -> tuple[int, bool]:
    """DIV: low word of `dividend` / divisor → remainder in the high word, quotient in the low word.

    Returns the double word and whether SM1.3 (division by zero) is set; then the operand stays.
    """
    low = to_signed(dividend, 16)
    if divisor == 0:
        return dividend, True
    quotient = abs(low) // abs(divisor) * (1 if (low < 0) == (divisor < 0) else -1)
    remainder = low - quotient * divisor
    return (remainder << 16) | (quotient & 0xFFFF), False

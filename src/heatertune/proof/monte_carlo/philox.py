"""Philox4x32-10: random numbers of many keys at once, each a function of its key and its number alone.

J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11, 2011.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

__all__ = ["normal", "parts", "uniform", "words"]

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

_ROUNDS: Final = 10
_FIRST: Final = 0xD2511F53
_SECOND: Final = 0xCD9E8D57
_LOW: Final = 0x9E3779B9
_HIGH: Final = 0xBB67AE85
_WORD: Final = 0xFFFFFFFF
_PER_CALL: Final = 2  # numbers of four words: 27 and 26 bits of two make the 53 of one


def words(counter: tuple[Any, Any, Any, Any], key: tuple[Any, Any]) -> tuple[Any, Any, Any, Any]:
    """Return four words of 32 bits for a counter of four and a key of two.

    All are whole numbers, or arrays of them that have or take one shape. A product of two words may have a bit more
    than a number with a sign holds; what stands in its two halves is right all the same.
    """
    a, b, c, d = counter
    low, high = key
    for _ in range(_ROUNDS):
        first, second = _FIRST * a, _SECOND * c
        a, b, c, d = (
            (second >> 32 & _WORD) ^ b ^ low, second & _WORD, (first >> 32 & _WORD) ^ d ^ high, first & _WORD)
        low, high = low + _LOW & _WORD, high + _HIGH & _WORD
    return a, b, c, d


def parts(seeds: Sequence[int]) -> Whole:
    """Return the four lowest words of each seed, the lowest first, shape (seeds, 4)."""
    return np.array([[seed >> shift & _WORD for shift in (0, 32, 64, 96)] for seed in seeds], dtype=np.int64)


def uniform(seeds: Sequence[int], count: int, stream: int = 0) -> Array:
    """Return numbers between 0 and 1, both excluded, for each seed: shape (seeds, count).

    The lowest 64 bits of a seed are the key, the next 64 one half of the counter; each stream has numbers of its own.
    """
    low, high, third, fourth = parts(seeds).T[:, :, None]
    calls = np.arange(-(-count // _PER_CALL))
    numbers = np.empty((len(seeds), len(calls), _PER_CALL))
    drawn = words((calls, np.full(1, stream), third, fourth), (low, high))
    for place in range(_PER_CALL):
        whole = (drawn[2 * place] >> 5 << 26) + (drawn[2 * place + 1] >> 6)
        numbers[:, :, place] = (whole + 0.5) * 2.0**-53
    return numbers.reshape(len(seeds), -1)[:, :count]


def normal(even: Array) -> Array:
    """Return standard normal numbers made of as many uniform ones by Box and Muller's way, shape (n, 2·m)."""
    radius, angle = np.sqrt(-2.0 * np.log(even[:, ::2])), 2.0 * np.pi * even[:, 1::2]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=2).reshape(even.shape)

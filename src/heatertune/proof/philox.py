"""Philox4x32-10: random numbers of many keys at once, each a function of its key and its number alone.

J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11, 2011.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["normal", "uniform", "words"]

Array = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint64]

_ROUNDS: Final = 10
_FACTORS: Final = (np.uint64(0xD2511F53), np.uint64(0xCD9E8D57))
_STEPS: Final = (np.uint64(0x9E3779B9), np.uint64(0xBB67AE85))
_BITS: Final = np.uint64(32)
_WORD: Final = np.uint64(0xFFFFFFFF)
_SPLIT: Final = (np.uint64(5), np.uint64(6))  # 27 and 26 bits of two words make the 53 of a number
_PER_CALL: Final = 2  # numbers of four words


def words(counter: Sequence[Words], key: Sequence[Words]) -> tuple[Words, ...]:
    """Return four words of 32 bits for a counter of four and a key of two, all of one shape."""
    a, b, c, d = counter
    low, high = key
    for _ in range(_ROUNDS):
        first, second = _FACTORS[0] * a, _FACTORS[1] * c
        a, b, c, d = (second >> _BITS) ^ b ^ low, second & _WORD, (first >> _BITS) ^ d ^ high, first & _WORD
        low, high = (low + _STEPS[0]) & _WORD, (high + _STEPS[1]) & _WORD
    return a, b, c, d


def uniform(seeds: Sequence[int], count: int) -> Array:
    """Return numbers between 0 and 1, both excluded, for each seed: shape (seeds, count).

    The lowest 64 bits of a seed are the key, the next 64 one half of the counter.
    """
    parts = [np.array([seed >> shift & int(_WORD) for seed in seeds], dtype=np.uint64) for shift in (0, 32, 64, 96)]
    numbers = list[Array]()
    for call in range(-(-count // _PER_CALL)):
        counter = np.full(len(seeds), call, dtype=np.uint64), np.zeros(len(seeds), dtype=np.uint64), *parts[2:]
        drawn = words(counter, parts[:2])
        for high, low in (drawn[:2], drawn[2:]):
            whole = ((high >> _SPLIT[0]) << np.uint64(26)) + (low >> _SPLIT[1])
            numbers.append((whole.astype(np.float64) + 0.5) * 2.0**-53)
    return np.column_stack(numbers[:count]) if count else np.empty((len(seeds), 0))


def normal(even: Array) -> Array:
    """Return standard normal numbers made of as many uniform ones by Box and Muller's way, shape (n, 2·m)."""
    radius, angle = np.sqrt(-2.0 * np.log(even[:, ::2])), 2.0 * np.pi * even[:, 1::2]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=2).reshape(even.shape)

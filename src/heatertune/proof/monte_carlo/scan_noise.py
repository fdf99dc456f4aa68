"""Noise of the scans of many samples: standard normal numbers, each a function of its sample's seed and its scan alone.

Four words of Philox4x32-10 (`heatertune.proof.monte_carlo.philox`, a stream of its own) make four numbers by Box and
Muller's way:
√(−2·ln u)·(cos, sin) of an even angle, u and the angle of 32 bits each, so none is beyond 6.8. All is written out in
sums and products, as in `heatertune.heater.elementary`: the same bits compiled, where vector instructions draw several
at once, and in plain Python.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function, worth_compiling
from heatertune.heater.elementary import logarithm
from heatertune.proof.meter import Places
from heatertune.proof.monte_carlo.philox import parts, words

__all__ = ["BLOCK", "STREAM", "block_of", "normals"]

#: of Philox, see `heatertune.proof.monte_carlo.philox.uniform`
STREAM: Final = 1

_CALLS: Final = 32  # of a block: their first numbers, their second ones and so on stand together
#: scans whose numbers are drawn together
BLOCK: Final = 4 * _CALLS

_MOST_PLAIN: Final = 200_000  # numbers that take as long in plain Python as the compiler
_QUARTER: Final = 2**30  # a word's two highest bits tell the quarter of the circle
_ALL: Final = 0.5 * math.pi / _QUARTER


def normals(seeds: Sequence[int], count: int, deviation: float = 1.0) -> npt.NDArray[np.float64]:
    """Return so many numbers of a standard deviation for each seed, shape (seeds, count)."""
    places, spare = np.empty((len(seeds), count)), np.empty(BLOCK)
    if worth_compiling(places.size, "noise", _MOST_PLAIN, _all_drawn):
        compile_function(_all_drawn)(places, spare, parts(seeds), deviation)
    else:
        plain = places.tolist()
        _all_drawn(plain, spare.tolist(), parts(seeds).tolist(), deviation)
        places[:] = plain
    return places


def block_of(seed: int, number: int) -> list[float]:
    """Return a seed's numbers of one block of scans, in plain Python: who asks scan by scan waits for no compiler."""
    places = [0.0] * BLOCK
    _drawn(places, 0, 1.0, number * _CALLS, *parts([seed])[0].tolist())
    return places


def _all_drawn(places: Places, spare: Places, keys: Places, deviation: float) -> None:
    """Fill rows, each for the four words of a seed; `spare` is for blocks of which not all is asked for."""
    for row in range(len(places)):
        key, own, blocks = keys[row], places[row], len(places[row]) // BLOCK
        for block in range(blocks):
            _drawn(own, block * BLOCK, deviation, block * _CALLS, key[0], key[1], key[2], key[3])
        if blocks * BLOCK < len(own):
            _drawn(spare, 0, deviation, blocks * _CALLS, key[0], key[1], key[2], key[3])
        for place in range(blocks * BLOCK, len(own)):
            own[place] = spare[place - blocks * BLOCK]


def _drawn(
    places: Places, begin: int, deviation: float, first: int, low: int, high: int, third: int, fourth: int
) -> None:
    """Fill a block from a place on with its numbers from a call on; a compiler makes vector instructions of it."""
    for call in range(_CALLS):
        a, b, c, d = words((first + call, STREAM, third, fourth), (low, high))
        one, two = _pair(a, b)
        three, four = _pair(c, d)
        place = begin + call
        places[place], places[place + _CALLS] = deviation * one, deviation * two
        places[place + 2 * _CALLS], places[place + 3 * _CALLS] = deviation * three, deviation * four


def _pair(size: int, turn: int) -> tuple[float, float]:
    """Return two numbers of two words."""
    radius = math.sqrt(-2.0 * logarithm((size + 0.5) * 2.0**-32))
    angle = ((turn & _QUARTER - 1) + 0.5 - 0.5 * _QUARTER) * _ALL  # within ±π/4, the middle of the first quarter
    z = angle * angle
    sine = angle + angle * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (
        1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (1.0 / 6227020800.0))))))
    cosine = 1.0 + z * (-1.0 / 2.0 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0 + z * (
        -1.0 / 3628800.0 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0)))))))
    odd, behind = turn & _QUARTER != 0, turn & 2 * _QUARTER != 0
    along, across = (sine, cosine) if odd else (cosine, sine)
    return (-radius if odd != behind else radius) * along, (-radius if behind else radius) * across

"""A long line → the few points that draw it: least and most of each pixel, nothing that lies on a straight line."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["downsample", "step_corners", "straight"]

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]


def downsample(across: Array, values: Array, pixels: int) -> Places:
    """Return the places of first, least, most and last value of each pixel, ascending.

    Args:
        across: where each value stands in the picture, ascending, shape (n,).
        values: shape (n,).
        pixels: the picture is as wide as so many.
    """
    if len(across) <= 4 * pixels:
        return np.arange(len(across))
    pixel = np.minimum(((across - across[0]) / (across[-1] - across[0]) * pixels).astype(np.intp), pixels - 1)
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    last = np.append(first[1:], len(across)) - 1
    inside = last - first + 1
    kept = np.zeros(len(across), dtype=np.bool_)
    kept[first] = kept[last] = True
    for extreme in (np.minimum, np.maximum):
        kept |= values == np.repeat(extreme.reduceat(values, first), inside)
    return np.flatnonzero(kept)


def step_corners(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the corners of a line, shape (m,), whose values, shape (n,), hold until the next instant."""
    change = np.flatnonzero(np.diff(values)) + 1
    return (np.concatenate([time[:1], np.repeat(time[change], 2), time[-1:]]),
            np.concatenate([values[:1], np.stack([values[change - 1], values[change]], axis=1).ravel(), values[-1:]]))


def straight(across: Array, values: Array, within: float, begun: int = 1) -> Places:
    """Return the places at which a line of shape (n,) bends: all others lie as near as `within` to those between these.

    The line is looked at in so many pieces of equal width, whose ends stay: a saw of a thousand teeth takes one piece
    a thousand rounds, and a thousand pieces a few.

    U. Ramer, "An iterative procedure for the polygonal approximation of plane curves" (1972), distances taken along
    the values.
    """
    kept = np.zeros(len(across), dtype=np.bool_)
    kept[[0, -1]] = True
    kept[np.searchsorted(across, np.linspace(across[0], across[-1], begun + 1)[1:-1])] = True
    ends = np.flatnonzero(kept)
    begin, end = ends[:-1], ends[1:]
    while len(begin):  # all pieces at once, level by level
        begin, end = begin[end - begin > 1], end[end - begin > 1]
        worst, off = _farthest(across, values, begin, end)
        far = off > within
        begin, end, worst = begin[far], end[far], worst[far]
        kept[worst] = True
        begin, end = np.concatenate([begin, worst]), np.concatenate([worst, end])
    return np.flatnonzero(kept)


def _farthest(across: Array, values: Array, begin: Places, end: Places) -> tuple[Places, Array]:
    """Return where each piece of a line is farthest from its chord, the first such place, and how far; shape (m,)."""
    if not len(begin):
        return begin, np.empty(0)
    inside = end - begin - 1
    first = np.cumsum(inside) - inside
    piece = np.repeat(np.arange(len(begin)), inside)
    place = np.arange(len(piece)) + (begin + 1 - first)[piece]
    slope = (values[end] - values[begin]) / np.maximum(across[end] - across[begin], 1e-9)
    off = np.abs(values[place] - values[begin][piece] - slope[piece] * (across[place] - across[begin][piece]))
    most = np.maximum.reduceat(off, first)
    at = np.flatnonzero(off == most[piece])
    return place[at[np.searchsorted(piece[at], np.arange(len(begin)))]], most

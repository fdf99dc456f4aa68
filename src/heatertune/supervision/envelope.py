"""The least and the largest movement that a heater in order makes: planes over level and power, in whole numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["Plane", "plane_of"]

Table = npt.NDArray[np.int64]

_BINS: Final = 48
_ALL_WEIGHT: Final = 0.05  # of a plane's mean distance, beside that at the point it is made for
#: what products of a monitor's numbers may reach: half of a 32-bit whole number
_MOST: Final = 1 << 30
_SCALES: Final = (4096, 1024, 256, 64, 16, 4, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """movement · scale ≤ gain · power − loss · level + rest, as whole numbers; for the least movement ≥."""

    scale: int
    gain: int
    loss: int
    rest: int


def plane_of(
    rows: Table, points: npt.NDArray[np.float64], *, largest: bool, share: float, more: float,
) -> Plane | None:
    """Return the closest plane that no row crosses, None where no whole numbers hold it.

    Args:
        rows: movement, level and power of windows, shape (n, 3).
        points: (level, power) at which it shall be close, shape (m, 2).
        largest: whether it bounds the largest movement.
        share: of the plane's distance from standstill at the first point that is left as a margin.
        more: further margin, in the unit of the movement.
    """
    sign = 1.0 if largest else -1.0
    move, level, power = (rows[:, column].astype(float) for column in range(3))
    gain, loss, rest = _fitted(sign * move, level, power, points, sign)
    # in the sense of the sign: move·s ≤ s·(gain·power − loss·level) + rest
    left = float(np.max(sign * move - sign * (gain * power - loss * level) - rest))
    at = points[0]
    standing = abs(sign * (gain * at[1] - loss * at[0]) + rest + left)
    rest += max(left, 0.0) + share * standing + more
    for scale in _SCALES:
        whole_gain, whole_loss = round(gain * scale), round(loss * scale)
        # the rest takes up what rounding the others moved
        moved = np.max(sign * ((gain * scale - whole_gain) * power - (loss * scale - whole_loss) * level))
        whole_rest = int(np.ceil(rest * scale + max(float(moved), 0.0)))
        reach = max(scale * np.abs(move).max() * 4, whole_gain * power.max() * 1.5, whole_loss * level.max() * 1.5)
        if max(reach, abs(whole_rest)) < _MOST:
            return Plane(scale=scale, gain=whole_gain, loss=whole_loss, rest=int(sign) * whole_rest)
    return None


def _fitted(
    move: npt.NDArray[np.float64], level: npt.NDArray[np.float64], power: npt.NDArray[np.float64],
    points: npt.NDArray[np.float64], sign: float,
) -> tuple[float, float, float]:
    """Return gain, loss and rest of the closest plane above the largest movement of each part of the field."""
    from scipy.optimize import linprog  # noqa: PLC0415 - only a design needs it

    units = max(np.abs(move).max(), 1.0), max(level.max(), 1.0), max(power.max(), 1.0)
    m, r, u = move / units[0], level / units[1], power / units[2]
    field = (np.clip(r * _BINS, 0, _BINS - 1).astype(int) * _BINS + np.clip(u * _BINS, 0, _BINS - 1).astype(int))
    order = np.lexsort((m, field))
    last = order[np.append(field[order][1:] != field[order][:-1], True)]
    m, r, u = m[last], r[last], u[last]
    above = np.column_stack([sign * u, -sign * r, np.ones(len(m))])
    near = np.column_stack([sign * points[:, 1] / units[2], -sign * points[:, 0] / units[1], np.ones(len(points))])
    cost = near.mean(axis=0) + _ALL_WEIGHT * above.mean(axis=0)
    found = linprog(cost, A_ub=-above, b_ub=-m, bounds=[(0.0, None), (0.0, None), (None, None)], method="highs")
    gain, loss, rest = found.x if found.success else (0.0, 0.0, float(m.max()))
    return gain * units[0] / units[2], loss * units[0] / units[1], rest * units[0]

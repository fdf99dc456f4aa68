"""The best whole numbers a controller can hold: branch and bound over boxes of words.

The words make a controller by `decode`, which is handed in. Its parallel gains kP, kI, kD must be multi-affine in the
words (each word on its own enters linearly): then the gains at the corners of a box of words bound all that is inside,
and the bounds of `heatertune.pid.search.bounds` rule out whole boxes. What is left at the end is proven, not sampled.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.model.values import HeaterModel
from heatertune.pid.loop.response import iae_load
from heatertune.pid.loop.robustness import sensitivity_peaks
from heatertune.pid.search.uncertain import peaks_on
from heatertune.pid.values import PidDesign

if TYPE_CHECKING:
    from heatertune.pid.search.bounds import LoopBounds

__all__ = ["IntegerOptimum", "Integers", "Vector", "best_integers"]

Array = npt.NDArray[np.float64]

#: the words of a controller, in the order of the ranges
Vector = tuple[int, ...]
_Box = tuple[tuple[int, int], ...]

_EQUAL = 1e-5  # relative; costs closer than this are one cost
_MOST_BOXES = 8_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Integers:
    """Minimise the mean load IAE over the heaters and over whole numbers, subject to Ms ≤ `ms` on each heater.

    Attributes:
        decode: words → the controller they make, None where the words are not allowed.
        ranges: smallest and largest value of each word, at least 1 where it may vary.
        plants: the heaters to serve.
        ms: limit of the maximum sensitivity.
        guards: heaters that count for no cost, on which `limits` hold.
        limits: "ms", "mt", "mks" [%/°C] → largest value on each guard.
        step_power: largest power that one scan may move per °C of a reading [%/°C].
        start: words to begin with, near the best; their sampling interval and filter are those of all.
    """

    decode: Callable[[Vector], PidDesign | None]
    ranges: _Box
    plants: tuple[HeaterModel, ...]
    ms: float
    start: Vector
    guards: tuple[HeaterModel, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    step_power: float = math.inf

    def cost(self, words: Vector) -> float:
        """Return the mean load IAE [°C·s]; infinite for words that are not allowed, break Ms or do not settle."""
        design = self.decode(words)
        if design is None or design.step_power_pct_per_degC > self.step_power:
            return math.inf
        if max(sensitivity_peaks(plant, design)[0] for plant in self.plants) > self.ms:
            return math.inf
        for guard in self.guards:
            peaks = peaks_on(guard, design)
            if any(peaks[name] > limit for name, limit in self.limits.items()):
                return math.inf
        return float(np.mean([iae_load(plant, design) for plant in self.plants]))

    @cached_property
    def bounds(self) -> LoopBounds:
        """The bounds for boxes of gains.

        Raises:
            InputError: the words to begin with are not allowed.
        """
        from heatertune.pid.search.bounds import bounds_of  # noqa: PLC0415 - compiles; words that are rounded need no search

        design = self.decode(self.start)
        if design is None:
            raise InputError(f"words {self.start} to begin with are not allowed")
        return bounds_of(
            self.plants, ms=self.ms, sample_time_s=design.sample_time_s, derivative_filter=design.derivative_filter,
            guards=self.guards, guard_ms=self.limits.get("ms", math.inf),
        )

    @cached_property
    def _form(self) -> tuple[list[int], Array, Array]:
        """The words that vary, the two values each was tried at, and the gains at the corners, shape (2, …, 2, 3)."""
        varied = [i for i, (low, high) in enumerate(self.ranges) if low < high]
        # doubled or halved: far apart, so that differences keep their digits
        for factors in product((2.0, 0.5), repeat=len(varied)):
            pairs = [(self.start[i], int(factor * self.start[i])) for i, factor in zip(varied, factors, strict=True)]
            inside = all(self.ranges[i][0] <= other <= self.ranges[i][1]
                         for i, (_, other) in zip(varied, pairs, strict=True))
            designs = [self.decode(self._with(varied, tried)) for tried in product(*pairs)] if inside else [None]
            gains = [_gains(design) for design in designs if design is not None]
            if len(gains) == len(designs):
                return varied, np.array(pairs, dtype=np.float64), np.array(gains).reshape(*[2] * len(varied), 3)
        raise InputError(f"words {self.start}: doubling or halving them makes words the controller does not allow")

    def corners(self, box: _Box) -> Array:
        """Return kP, kI, kD at the corners of a box of words, shape (m, 3)."""
        varied, pairs, form = self._form
        gains = form
        for axis, i in enumerate(varied):
            ends = np.array(sorted(set(box[i])), dtype=np.float64)
            share = (ends - pairs[axis, 0]) / (pairs[axis, 1] - pairs[axis, 0])
            first, second = np.take(gains, 0, axis=axis), np.take(gains, 1, axis=axis)
            # linear in this word; the ends take the place of the two values tried
            shape = [1] * gains.ndim
            shape[axis] = len(ends)
            grown = share.reshape(shape)
            gains = np.expand_dims(first, axis) * (1.0 - grown) + np.expand_dims(second, axis) * grown
        return gains.reshape(-1, 3)

    def _with(self, varied: Sequence[int], values: Sequence[int]) -> Vector:
        words = list(self.start)
        for i, value in zip(varied, values, strict=True):
            words[i] = value
        return tuple(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegerOptimum:
    """The best words and what the search proves.

    Attributes:
        words: None where no words keep the limit.
        cost: their mean load IAE [°C·s].
        least: no words cost less [°C·s]: the cost itself where the search came to its end.
        boxes: how many boxes were looked at.
    """

    words: Vector | None
    cost: float
    least: float
    boxes: int

    @property
    def proven(self) -> bool:
        """Whether no words are better by more than two hundred-thousandths."""
        return self.least >= self.cost * (1.0 - 2.0 * _EQUAL)


def best_integers(problem: Integers, *, most_boxes: int = _MOST_BOXES) -> IntegerOptimum:
    """Return the best words over all ranges, the box with the lowest bound first.

    Where `most_boxes` do not suffice, the best so far is returned with the bound that is proven by then.

    Raises:
        InputError: the start, or its words doubled or halved, are not allowed.
    """
    cost = problem.cost(problem.start)
    words = None if math.isinf(cost) else problem.start
    waiting: list[tuple[float, _Box]] = [(0.0, problem.ranges)]
    boxes = 0
    while waiting and waiting[0][0] < cost * (1.0 - _EQUAL):
        if boxes >= most_boxes:
            return IntegerOptimum(words=words, cost=cost, least=waiting[0][0], boxes=boxes)
        _, box = heapq.heappop(waiting)
        for part in _halves(box):
            boxes += 1
            bound = problem.bounds.least_cost(problem.corners(part), cost)
            if bound >= cost * (1.0 - _EQUAL):
                continue
            middle = tuple((low + high) // 2 for low, high in part)
            exact = problem.cost(middle)
            if exact < cost:
                words, cost = middle, exact
            if any(low < high for low, high in part):
                heapq.heappush(waiting, (bound, part))
    return IntegerOptimum(words=words, cost=cost, least=cost, boxes=boxes)


def _halves(box: _Box) -> Iterator[_Box]:
    """Return the box cut at the geometric middle of its widest word; a box of one point as it is."""
    widest = max(range(len(box)), key=lambda i: (box[i][1] + 0.5) / (box[i][0] + 0.5) if box[i][0] < box[i][1] else 0.0)
    low, high = box[widest]
    if low == high:
        yield box
        return
    middle = min(max(math.isqrt(low * high), low), high - 1)
    for part in ((low, middle), (middle + 1, high)):
        yield (*box[:widest], part, *box[widest + 1 :])


def _gains(design: PidDesign) -> Array:
    ta = design.sample_time_s
    parts = np.array([1.0, ta / design.integral_time_s, design.derivative_time_s / ta])
    return np.asarray(design.gain_pct_per_degC * parts)

"""The optimal integers that a controller can store: branch and bound over boxes of words, proven, not sampled.

`decode` converts words to a controller, L = kP·P + kI·I + kD·D with kP = K, kI = K·TA/TN, kD = K·TV/TA. These gains
must be multi-affine in the words: each controller of a box is a convex combination of its corners. Three bounds hold:
1. |1 + L| is convex: if all corners violate 1/Ms at one frequency, so does the whole box.
2. If no convex combination makes 1 + L zero at any frequency, all controllers of the box are stable, or none is.
3. From e_ref = (1 + Σ Δk·Part·S_ref)·e, any controller costs at least a stable reference's cost, divided by 1 +
   Σ |Δk|·‖closed loop from the reference's error through that part‖₁; and at least its own net error, TA/kI.
Frequencies are a grid, as for the margins; the horizon is that of the load response.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np

from heatertune.arrays import Array, Complex
from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.model.model_values import HeaterModel
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import (
    encloses_nothing,
    frequencies,
    iae_load,
    part_responses,
    sample_plant,
    sensitivity_peaks,
)
from heatertune.pid.search.robust import peaks_on
from heatertune.processors import interruption_point

__all__ = ["IntegerOptimum", "Integers", "LoopBounds", "Vector", "best_integers", "bounds_of", "norms"]


_FREQUENCIES = 400
_PER_DELAY = 12  # frequencies per sample of dead time, whose phase has to be followed
_BESIDE = 2e-4  # relative; the margins use other frequencies, so their Ms may be smaller by this much
_HORIZON = 10.0  # times the slowest part of the loop
_MOST_SAMPLES = 20_000


def _distances(parts: Complex, corners: Array, least: float, values: Complex) -> int:
    """Return 1: all corners are nearer than `least` at one frequency; 2: no mixture is zero at any; 0: neither.

    `values` is working space, one for each corner.
    """
    free = True
    for k in range(parts.shape[1]):
        farthest = 0.0
        middle = 0.0 + 0.0j
        for j in range(len(corners)):
            v = 1.0 + corners[j, 0] * parts[0, k] + corners[j, 1] * parts[1, k] + corners[j, 2] * parts[2, k]
            values[j] = v
            middle += v
            farthest = max(farthest, v.real * v.real + v.imag * v.imag)
        if farthest < least * least:
            return 1
        if free:
            for v in values:
                if v.real * middle.real + v.imag * middle.imag <= 0.0:
                    free = False
    return 2 if free else 0


def _norms(  # noqa: PLR0913 - as it is compiled
    poles: Array, now: Array, before: Array, delay: int, gains: Array, past: float, samples: int, modes: Array,
    queues: Array, sizes: Array,
) -> None:
    """Fill sizes (4,) as `norms` returns it.

    modes (4, n) and queues (4, delay + 2), one row of each answer, are working space; all three are zero.
    """
    total, changing, last = 0.0, 0.0, 0.0  # after the impulse: sum, filtered difference, last error
    total_load, changing_load, last_load = 0.0, 0.0, 0.0  # after the step
    for k in range(samples):
        error = 1.0 if k == 0 else 0.0
        for part in range(4):
            y = 0.0
            for i in range(len(poles)):
                y += modes[part, i]
            sizes[part] += abs(y)
            if part < 3:
                error -= gains[part] * y
            else:
                total_load -= y
                changing_load, last_load = past * changing_load + (1.0 - past) * (-y - last_load), -y
        total += error
        changing, last = past * changing + (1.0 - past) * (error - last), error
        here, then, earlier = k % (delay + 2), (k - delay) % (delay + 2), (k - delay - 1) % (delay + 2)
        queues[0, here], queues[1, here], queues[2, here] = error, total, changing
        queues[3, here] = 1.0 + gains[0] * last_load + gains[1] * total_load + gains[2] * changing_load
        for i in range(len(poles)):
            for part in range(3):
                fed = now[i] * queues[part, then] + before[i] * queues[part, earlier]
                modes[part, i] = poles[i] * modes[part, i] + fed
            modes[3, i] = poles[i] * modes[3, i] + now[i] * queues[3, then] + before[i] * queues[3, earlier]


def norms(poles: Array, now: Array, before: Array, delay: int, gains: Array, past: float, samples: int) -> Array:
    """Return Σ|output of each part| after a setpoint impulse, per unit of its gain, and Σ|e| after a load step of 1.

    Args:
        poles: of the sampled heater, see `pid.loop.sampled.SampledPlant`, shape (n,).
        now: see there.
        before: see there.
        delay: see there [samples].
        gains: kP, kI, kD.
        past: weight of its past in the derivative part.
        samples: length of the responses.
    """
    sizes = np.zeros(4)
    modes, queues = np.zeros((4, len(poles))), np.zeros((4, delay + 2))
    compile_function(_norms)(poles, now, before, delay, gains, past, samples, modes, queues, sizes)
    return sizes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _SampledHeater:
    """One heater as the bounds see it: its sampled modes, the frequency response of each part, shape (3, n), its Ms."""

    modes: tuple[Array, Array, Array, int]
    parts: Complex
    slowest_s: float
    gain: float
    ms: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopBounds:
    """The bounds for a set of heaters, one sampling interval and one derivative filter; see `bounds_of`."""

    sample_time_s: float
    derivative_filter: float
    heaters: tuple[_SampledHeater, ...]
    guards: tuple[_SampledHeater, ...]

    def least_cost(self, corners: Array, enough: float) -> float:
        """Return a lower bound of the mean load IAE of the box [°C·s]; infinite if no controller in it keeps Ms.

        Args:
            corners: gains (kP, kI, kD) at the corners, shape (m, 3), kI positive; kP must be positive somewhere.
            enough: a bound above this value needs no further refinement [°C·s].
        """
        low, high = corners.min(axis=0), corners.max(axis=0)
        if high[0] <= 0.0:
            return math.inf
        least = self.sample_time_s / float(high[1])
        if least >= enough:
            return least
        limited = (*self.heaters, *self.guards)
        distances, values = compile_function(_distances), np.empty(len(corners), dtype=np.complex128)
        verdicts = [int(distances(heater.parts, corners, (1.0 - _BESIDE) / heater.ms, values)) for heater in limited]
        if 1 in verdicts:
            return math.inf
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        stable = [encloses_nothing(middle @ heater.parts, integrating=True) for heater in limited]
        if any(verdict == 2 and not calm for verdict, calm in zip(verdicts, stable, strict=True)):
            return math.inf
        if not all(stable) or middle[0] <= 0.0:  # the reference gives no bound
            return least
        costs = []
        for heater in self.heaters:
            *parts, load = norms(*heater.modes, middle, self.derivative_filter, self._samples(heater, middle))
            costs.append(self.sample_time_s * float(load) / (1.0 + float(half @ np.array(parts))))
        return max(least, float(np.mean(costs)))

    def _samples(self, heater: _SampledHeater, gains: Array) -> int:
        reset_s = self.sample_time_s * gains[0] / gains[1]
        slow = heater.slowest_s + reset_s * (1.0 + 1.0 / (gains[0] * heater.gain))
        return int(np.clip(_HORIZON * slow / self.sample_time_s, 50, _MOST_SAMPLES))


def bounds_of(
    plants: Sequence[HeaterModel], *, ms: float, sample_time_s: float, derivative_filter: float,
    guards: Sequence[HeaterModel] = (), guard_ms: float = math.inf,
) -> LoopBounds:
    """Return the bounds for these heaters.

    Args:
        plants: the heaters to serve.
        ms: largest sensitivity on each.
        sample_time_s: TA [s].
        derivative_filter: weight of its past in the derivative part, see `PidDesign`.
        guards: heaters that count for no cost, on which `guard_ms` holds.
        guard_ms: largest sensitivity on each of them.
    """
    slowest = max(sum(plant.lags_s) + plant.dead_time_s for plant in (*plants, *guards))
    heaters = []
    for place, plant in enumerate((*plants, *guards)):
        sampled = sample_plant(plant, sample_time_s)
        omega = frequencies(sample_time_s, slowest, max(_FREQUENCIES, _PER_DELAY * sampled.delay))
        heaters.append(_SampledHeater(
            modes=(sampled.poles, sampled.now, sampled.before, sampled.delay),
            parts=sampled.frequency_response(omega) * part_responses(omega, sample_time_s, derivative_filter),
            slowest_s=sum(plant.lags_s) + plant.dead_time_s,
            gain=plant.gain_degC_per_pct,
            ms=ms if place < len(plants) else guard_ms,
        ))
    return LoopBounds(
        sample_time_s=sample_time_s, derivative_filter=derivative_filter,
        heaters=tuple(heaters[: len(plants)]), guards=tuple(heaters[len(plants) :]),
    )


#: the words of a controller, in the order of the ranges
Vector = tuple[int, ...]
_Box = tuple[tuple[int, int], ...]

_EQUAL = 1e-5  # relative; costs closer than this are one cost
_MOST_BOXES = 8_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Integers:
    """Minimise the mean load IAE over the heaters, in integers, subject to Ms ≤ `ms` on each heater.

    Attributes:
        decode: words → controller, None if the words are not allowed.
        ranges: smallest and largest value of each word, at least 1 if it varies.
        plants: the heaters to serve.
        ms: limit of the maximum sensitivity.
        guards: heaters that only add the constraints `limits`, not cost.
        limits: "ms", "mt", "mks" [%/°C] → largest value on each guard.
        step_power: largest change of power in one scan per °C of a reading [%/°C].
        start: initial words, near the optimum; their sampling interval and filter apply to all.
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
        design = self.decode(self.start)
        if design is None:
            raise InputError(f"the controller does not allow the initial words {self.start}")
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
        raise InputError(f"words {self.start}: the controller allows neither twice nor half these values")

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
    """The optimal words, and the bound that the search proves.

    Attributes:
        words: None if no words keep the limit.
        cost: their mean load IAE [°C·s].
        least: lower bound of the cost of all words [°C·s]: the cost itself if the search was completed.
        boxes: number of boxes evaluated.
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
    """Return the optimal words over all ranges by best-first search.

    If `most_boxes` do not suffice, the best words found are returned with the bound proven so far.

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
        interruption_point()
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
    """Split the box at the geometric mean of its widest word; a box of one point is returned unchanged."""
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

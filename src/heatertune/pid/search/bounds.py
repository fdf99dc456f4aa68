"""What can be said of a whole box of controllers at once: three bounds, and no controller inside can beat them.

The loop is L = kP·P + kI·I + kD·D with the parallel gains kP = K, kI = K·TA/TN, kD = K·TV/TA. A box is given by the
gains at its corners, and every controller inside is a convex mixture of these.

1. Where all corners come nearer to −1 than 1/Ms at one frequency, so does the whole box: |1 + L| is convex.
2. Where no mixture of the corners makes 1 + L zero at any frequency, all controllers of the box are stable, or none is.
3. The error of any controller costs at least what the error of a stable reference costs, divided by
   1 + Σ |Δk|·‖closed loop from the reference's error through that part‖₁: from e_ref = (1 + Σ Δk·Part·S_ref)·e. It also
   costs at least its own net error, TA/kI.

Frequencies are a grid, as they are for the margins; the horizon is the one of the load response.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function
from heatertune.model.values import HeaterModel
from heatertune.pid.loop.robustness import encloses_nothing
from heatertune.pid.loop.sampled import frequencies, part_responses, sample_plant

__all__ = ["LoopBounds", "bounds_of", "norms"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_FREQUENCIES = 400
_PER_DELAY = 12  # frequencies per sample of dead time, whose phase has to be followed
_BESIDE = 2e-4  # relative; the margins' own frequencies lie beside these, so their Ms may be smaller by so much
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
    kept, changing, last = 0.0, 0.0, 0.0  # after the impulse: sum, filtered difference, last error
    kept_load, changing_load, last_load = 0.0, 0.0, 0.0  # after the step
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
                kept_load -= y
                changing_load, last_load = past * changing_load + (1.0 - past) * (-y - last_load), -y
        kept += error
        changing, last = past * changing + (1.0 - past) * (error - last), error
        here, then, earlier = k % (delay + 2), (k - delay) % (delay + 2), (k - delay - 1) % (delay + 2)
        queues[0, here], queues[1, here], queues[2, here] = error, kept, changing
        queues[3, here] = 1.0 + gains[0] * last_load + gains[1] * kept_load + gains[2] * changing_load
        for i in range(len(poles)):
            for part in range(3):
                fed = now[i] * queues[part, then] + before[i] * queues[part, earlier]
                modes[part, i] = poles[i] * modes[part, i] + fed
            modes[3, i] = poles[i] * modes[3, i] + now[i] * queues[3, then] + before[i] * queues[3, earlier]


def norms(poles: Array, now: Array, before: Array, delay: int, gains: Array, past: float, samples: int) -> Array:
    """Return Σ|output of each part| after a setpoint impulse, per unit of its gain, and Σ|e| after a load step of 1.

    Args:
        poles: of the sampled heater, see `pid.loop.sampled.SampledPlant`, shape (n,).
        now: likewise.
        before: likewise.
        delay: likewise [samples].
        gains: kP, kI, kD.
        past: weight of its past in the derivative part.
        samples: length of the answers.
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
        """Return what the mean load IAE of the box is not below [°C·s]; infinite where nothing in it keeps Ms.

        Args:
            corners: gains (kP, kI, kD) at the corners, shape (m, 3), kI positive; without kP > 0 it is no controller.
            enough: the search does not care how far above this the bound lies [°C·s].
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
        if any(seen == 2 and not calm for seen, calm in zip(verdicts, stable, strict=True)):
            return math.inf
        if not all(stable) or middle[0] <= 0.0:  # the reference tells nothing
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

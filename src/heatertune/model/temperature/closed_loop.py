"""Hypotheses about a loop without logged power: a plant, a control law, and the instants of setpoint changes.

One plant may have several logs (segments); each segment has its own ambient, initial state, setpoint and law
parameters. The setpoint of the law includes a bias: the temperature shows only their sum.

The simulation of the closed loop inside a fit has one or two lags, exact dead time, and a control law as argument. The
law sees the simulated temperature, as the controller saw the real one. It runs every `h` seconds and its output is held
in between; between two calls the response of the plant is exact. All instants are multiples of `h` after the start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import bound, compile_function
from heatertune.compiled.plain_functions import law_step
from heatertune.heater.exact import advance, advance_step, factors
from heatertune.log.log_values import MIN_SAMPLES, Log
from heatertune.model.model_values import Fopdt, HeaterModel, TwoLag

__all__ = [
    "CONSTANTS", "OWN", "PLANT", "Bounds", "Constant", "ControllerLaw", "Hypothesis", "LogSegment", "Step",
    "simulate_many",
]


#: laws: (which of them, its constants, four numbers of memory, error °C, interval s) → power 0…100 %
Step = Callable[[int, Array, Array, float, float], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """One unknown constant of a law, with the bounds of its search.

    A logarithmic one is searched by ratio.
    """

    name: str
    low: float
    high: float
    logarithmic: bool = False


class ControllerLaw(Protocol):
    """A hypothesis about the controller of a log.

    The caller supplies its step function; the model stage only calls it.
    """

    @property
    def name(self) -> str:
        """Short name for tables."""

    @property
    def constants(self) -> tuple[Constant, ...]:
        """At most four unknown constants."""

    @property
    def step(self) -> Step:
        """Plain function of its module, compiled together with the loop around it; memory begins at 0.

        Laws that are compared share one, as a loop around each would have to be compiled.
        """

    @property
    def form(self) -> int:
        """Which of the step's laws it is."""


Whole = npt.NDArray[np.int64]

#: a vector begins with the plant, gain and time constant by their logarithms; lag ratio: of the second lag, 0: one lag
PLANT = ("gain_degC_per_pct", "time_constant_s", "lag_ratio", "dead_time_s")
#: a log's own parameters in a vector, before its law's constants; from the event on the setpoint is a step higher
OWN = ("ambient_degC", "start_degC", "inner_start_degC", "setpoint_degC", "setpoint_step_degC", "event_s")
#: most constants of a law
CONSTANTS = 4


def simulate_many(
    law: ControllerLaw, z: Array, own: int, h: float, readings: Whole, out: Array, at: int, closes: int = 0,
) -> Array:
    """Write the temperature of n loops at the readings into the columns of out (n, m) from `at` on [°C].

    Returns the power of the last of them, scan by scan [%].

    Args:
        law: of the controller.
        z: vectors, shape (n, p): `PLANT`, and from the place `own` on `OWN` and the law's constants.
        own: that place.
        h: interval between scans [s].
        readings: scans before which the temperature was read, in order, shape (k,).
        out: of row after row, in C's order.
        at: column of the first reading.
        closes: scan from which the law runs, the power being 0 before; below 0: it ran before, with the power of its
            first scan.
    """
    run = compile_function(bound(_simulate_many, law_step=law.step))
    logarithmic = np.array([float(constant.logarithmic) for constant in law.constants])
    power = np.empty(int(readings[-1]) + 1)
    run(law.form, np.ascontiguousarray(z), own, logarithmic, float(h), readings, np.empty(4), np.zeros(CONSTANTS),
        power, out, at, closes)
    return power


def _simulate_many(  # noqa: PLR0913 - compiled for the types of each
    form: int, z: Array, own: int, logarithmic: Array, h: float, readings: Whole, memory: Array, constants: Array,
    power: Array, out: Array, at: int, closes: int,
) -> None:
    """Fill out, arguments as above; `logarithmic`: 1 for each of the law's constants that is so given, else 0.

    Memory (4,), constants (4,) and power (scans,) are working space.
    """
    scans = len(power)
    for i in range(out.shape[0]):
        gain, first, ratio, dead = math.exp(z[i, 0]), math.exp(z[i, 1]), z[i, 2], z[i, 3]
        ambient, y = z[i, own], z[i, own + 1]
        x = z[i, own + 2] if ratio > 0.0 else y
        before, after = z[i, own + 3], z[i, own + 3] + z[i, own + 4]
        event = int(min(z[i, own + 5] / h, float(scans)))
        for k in range(len(logarithmic)):
            constants[k] = z[i, own + 6 + k]
            if logarithmic[k] != 0.0:
                constants[k] = math.exp(constants[k])
        whole = int(dead / h)
        late = dead - whole * h  # the older power value still acts for this long
        outer, inner = (ratio * first, first) if ratio > 0.0 else (first, 0.0)
        begin, end = factors(late, outer, inner), factors(h - late, outer, inner)
        for k in range(len(memory)):
            memory[k] = 0.0
        read = 0
        for k in range(scans):
            while read < len(readings) and readings[read] == k:
                out[i, at + read] = y
                read += 1
            power[k] = 0.0 if k < closes else law_step(
                form, constants, memory, (before if k < event else after) - y, h)
            earlier = power[0] if closes < 0 else 0.0
            older = power[k - whole - 1] if k > whole else earlier
            newer = power[k - whole] if k >= whole else earlier
            y, x = advance_step(y, x, ambient + gain * older, begin)
            y, x = advance_step(y, x, ambient + gain * newer, end)


#: lowest and highest value
Bounds = tuple[float, float]

_SCANS_PER_SAMPLE = 5  # the controller's interval is unknown; a fifth of the log's is short for every lag searched
_GAIN = (0.1, 4.0)  # °C/%: full power warms by 10 to 400 °C
_LAG_RATIO = (0.02, 0.995)
#: bounds that only keep a search finite
_ARBITRARY = {
    "gain_degC_per_pct": ("low", "high"), "time_constant_s": ("low", "high"), "dead_time_s": ("high",),
    "setpoint_degC": ("low", "high"), "setpoint_step_degC": ("low", "high"), "gain_pct_per_degC": ("low", "high"),
    "gain_pct_per_degC_s": ("low", "high"), "integral_time_s": ("low",),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogSegment:
    """One log, its control law, and the bounds of its own parameters.

    Attributes:
        log: the readings to explain.
        law: the controller hypothesis.
        event: whether the setpoint steps once.
        ambient_degC: bounds of the ambient temperature.
        closes: scan from which the law runs, as in `simulate_many`; the simulation begins a row before the log.
    """

    log: Log
    law: ControllerLaw
    event: bool
    ambient_degC: Bounds
    closes: int = 0
    interval_s: float = field(init=False)
    scans: int = field(init=False)
    readings: npt.NDArray[np.intp] = field(init=False)

    def __post_init__(self) -> None:
        sample = float(np.median(np.diff(self.log.time_s)))
        elapsed = self.log.time_s - self.log.time_s[0] + sample  # the loop was closed before the first reading
        object.__setattr__(self, "interval_s", sample / _SCANS_PER_SAMPLE)
        object.__setattr__(self, "readings", np.rint(elapsed / self.interval_s).astype(np.intp))
        object.__setattr__(self, "scans", int(self.readings[-1]) + 1)

    def bounds(self, two_lags: bool) -> list[tuple[str, float, float]]:
        """Return name, low and high of the segment's own unknowns, in the order of the vector."""
        y = self.log.temperature_degC
        start, last, span = float(y[0]), float(np.median(y[-10:])), float(np.ptp(y))
        inner = (start - 0.2 * span, start + span) if two_lags else (0.0, 0.0)
        own = [
            ("ambient_degC", *self.ambient_degC),
            ("start_degC", start - 0.2 * span, start + 0.1 * span),
            ("inner_start_degC", *inner),
            ("setpoint_degC", last - 0.3 * span, last + span),
            ("setpoint_step_degC", -0.3 * span * self.event, 0.3 * span * self.event),
            ("event_s", 0.0, 0.0),  # held in a descent: its times differ from start to start
        ]
        for constant in self.law.constants:
            ends = (constant.low, constant.high)
            low, high = map(math.log, ends) if constant.logarithmic else ends
            own.append((constant.name, float(low), float(high)))
        return own

    def event_times(self, rng: np.random.Generator, n: int) -> Array:
        """Return random instants [s] for a step of the setpoint, after the heat-up, shape (n,); inf where it stays."""
        length = self.scans * self.interval_s
        if not self.event:
            return np.full(n, np.inf)
        return np.asarray(rng.uniform(0.2 * length, 0.9 * length, n))

    def rows(self, share: float) -> int:
        """Return the number of readings in the first part of the log."""
        return max(1, round(share * len(self.readings)))

    def simulate(self, z: Array, own: int, out: Array, at: int, rows: int) -> Array:
        """Write the temperature at the log's first instants, for vectors of shape (n, p), as `simulate_many`.

        Args:
            z: the vectors.
            own: place of the segment's first unknown in a vector.
            out: shape (n, m) [°C].
            at: its column of the segment's first reading.
            rows: how many readings.
        """
        return simulate_many(self.law, z, own, self.interval_s, self.readings[:rows], out, at, self.closes)

    @property
    def title(self) -> str:
        """The law, whether the setpoint steps, and when the loop was closed, if not just before the log."""
        parts = [self.law.name, *(["setpoint step"] if self.event else [])]
        if self.closes < 0:
            parts.append("closed long before the log")
        elif self.closes > 0:
            first_s = float(self.log.time_s[0]) - (int(self.readings[0]) - self.closes) * self.interval_s
            parts.append(f"closed at {first_s:.4g} s")
        return ", ".join(parts)



@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """One plant and its segments, as a bounded least-squares problem.

    The vector holds ln gain, ln time constant, lag ratio, dead time, then each segment's own unknowns. Shapes of the
    arrays: a vector and its bounds (p,), vectors (n, p), readings (m,), segment after segment.

    A temperature does not show the unit of the power: twice the gain with half the power gives the same curve. So the
    power of the laws, 0…100 %, is in a unit of its own unless the largest power in the logs is stated.

    Attributes:
        segments: one for each log.
        two_lags: whether the heater has two lags.
        largest_power_pct: largest power in the logs [%]; None: that of the laws is taken as it is.
    """

    segments: tuple[LogSegment, ...]
    two_lags: bool
    largest_power_pct: float | None = None
    names: tuple[str, ...] = field(init=False)
    low: Array = field(init=False)
    high: Array = field(init=False)

    def __post_init__(self) -> None:
        sample = float(np.median(np.diff(self.segments[0].log.time_s)))
        length = max(float(np.ptp(s.log.time_s)) for s in self.segments)
        ratio = _LAG_RATIO if self.two_lags else (0.0, 0.0)
        rows = [
            ("gain_degC_per_pct", *map(math.log, _GAIN)),
            ("time_constant_s", math.log(2.0 * sample), math.log(length)),
            ("lag_ratio", *ratio),
            ("dead_time_s", 0.0, min(9.0 * sample, length / 5.0)),
        ]
        for segment in self.segments:
            rows += segment.bounds(self.two_lags)
        object.__setattr__(self, "names", tuple(name for name, _, _ in rows))
        object.__setattr__(self, "low", np.array([low for _, low, _ in rows], dtype=np.float64))
        object.__setattr__(self, "high", np.array([high for _, _, high in rows], dtype=np.float64))

    @property
    def form(self) -> tuple[object, ...]:
        """Key of hypotheses that differ only in their events."""
        return (self.two_lags, *(segment.law.name for segment in self.segments))

    @property
    def law_name(self) -> str:
        """The laws, whether the setpoint steps, and when the loop was closed, log after log."""
        return " + ".join(segment.title for segment in self.segments)

    @property
    def title(self) -> str:
        """Short name for people."""
        return f"{'two lags' if self.two_lags else 'one lag'}, {self.law_name}"

    @property
    def measured(self) -> Array:
        """All readings, segment after segment [°C], shape (m,)."""
        return np.concatenate([s.log.temperature_degC for s in self.segments])

    @property
    def unknowns(self) -> int:
        """Number of fitted numbers; the instant of an event counts."""
        return int(np.count_nonzero(self.high > self.low)) + sum(s.event for s in self.segments)

    def parts(self, values: Array) -> list[Array]:
        """Return values that belong to the readings, (m,), log by log."""
        return np.split(values, np.cumsum([len(s.log.time_s) for s in self.segments])[:-1])

    def without_events(self) -> Hypothesis:
        """Return the hypothesis with setpoints that stay."""
        return self._with(tuple(replace(segment, event=False) for segment in self.segments))

    def starts(self, rng: np.random.Generator, n: int) -> Array:
        """Return n random vectors within the bounds, shape (n, p)."""
        return self.spread_events(self.low + (self.high - self.low) * rng.random((n, len(self.low))), rng)

    def early(self, share: float) -> Hypothesis:
        """Return the hypothesis without events on the first part of each record."""
        parts = []
        for segment in self.segments:
            time = segment.log.time_s
            rows = max(MIN_SAMPLES, int(share * len(time)))
            end = float(time[min(rows, len(time)) - 1])
            parts.append(replace(segment, log=segment.log.window(float(time[0]), end), event=False))
        return self._with(tuple(parts))

    def closing(self, scans: Sequence[int]) -> Hypothesis:
        """Return the hypothesis with loops that are closed at these scans, log by log."""
        return self._with(tuple(replace(segment, closes=closes)
                                for segment, closes in zip(self.segments, scans, strict=True)))

    def adopt(self, z: Array, rng: np.random.Generator, n: int) -> Array:
        """Return vectors (k, p) of the hypothesis without events, each with n random instants for them: (n·k, p)."""
        z = np.clip(z, self.low, self.high)
        if not any(segment.event for segment in self.segments):
            return z
        for first in self._offsets():
            z[:, first + 4] = 0.0
        return self.spread_events(np.repeat(z, n, axis=0), rng)

    def spread_events(self, z: Array, rng: np.random.Generator) -> Array:
        """Return the vectors (n, p) with random instants for their events."""
        z = z.copy()
        for segment, first in zip(self.segments, self._offsets(), strict=True):
            z[:, first + 5] = segment.event_times(rng, len(z))
        return z

    def shifted_events(self, z: Array) -> Array:
        """Return the vector with its events moved by some scans each way, shape (k, p)."""
        moved = [z]
        for segment, first in zip(self.segments, self._offsets(), strict=True):
            for scans in (-20, -8, -3, -1, 1, 3, 8, 20):
                if segment.event:
                    other = z.copy()
                    other[first + 5] += scans * segment.interval_s
                    moved.append(other)
        return np.array(moved)

    def simulate(self, z: Array, share: float = 1.0) -> Array:
        """Return the simulated readings of the first part of each log, shape (n, m), for vectors (n, p)."""
        rows = [segment.rows(share) for segment in self.segments]
        out = np.empty((len(z), sum(rows)))
        begins = np.cumsum([0, *rows[:-1]]).tolist()
        for segment, first, at, many in zip(self.segments, self._offsets(), begins, rows, strict=True):
            segment.simulate(z, first, out, at, many)
        return out

    def squares(self, z: Array, share: float = 1.0) -> Array:
        """Return the sums of squares over the first part of each log [°C²], shape (n,); infinite if one has none."""
        measured = np.concatenate([s.log.temperature_degC[:s.rows(share)] for s in self.segments])
        cost = np.sum((self.simulate(z, share) - measured) ** 2, axis=1)
        return np.where(np.isfinite(cost), cost, np.inf)

    def free_response(self, z: Array, segment: int = 0) -> Array:
        """Return the temperature without any power, from the initial state on, at one log's readings [°C], (k,)."""
        own, first = self.segments[segment], self._offsets()[segment]
        ambient, start, inner_start = z[first : first + 3]
        lag, ratio = math.exp(z[1]), float(z[2])
        outer, inner = (ratio * lag, lag) if ratio > 0.0 else (lag, 0.0)
        elapsed: Array = np.asarray(own.readings * own.interval_s, dtype=np.float64)
        y, x, target = (np.full(len(elapsed), value) for value in (start, inner_start, ambient))
        return advance(y, x, target, elapsed, outer, inner)

    def plant(self, z: Array, segment: int = 0) -> HeaterModel:
        """Return the heater of one vector (p,), with the ambient of a segment."""
        gain, lag = self._power_unit(z) * math.exp(z[0]), math.exp(z[1])
        ambient = float(z[self._offsets()[segment]])
        dead = float(z[3])
        if not self.two_lags:
            return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead, ambient_degC=ambient)
        return TwoLag(
            gain_degC_per_pct=gain, time_constant_s=lag, second_time_constant_s=lag * float(z[2]),
            dead_time_s=dead, ambient_degC=ambient,
        )

    def controller(self, z: Array, segment: int = 0) -> dict[str, float]:
        """Return the controller of one segment for a vector (p,), name → value, unit in the name."""
        first, law = self._offsets()[segment], self.segments[segment].law
        fitted = {"setpoint_degC": float(z[first + 3])}
        if self.segments[segment].event:
            event_s = float(z[first + 5]) + float(self.segments[segment].log.time_s[0])
            fitted |= {"setpoint_step_degC": float(z[first + 4]), "setpoint_step_at_s": event_s}
        unit = self._power_unit(z)
        for i, constant in enumerate(law.constants):
            value = float(z[first + 6 + i])
            value = math.exp(value) if constant.logarithmic else value
            fitted[constant.name] = value / unit if "_pct" in constant.name else value
        return fitted

    def on_bound(self, z: Array) -> tuple[str, ...]:
        """Return the names of the unknowns that ended on a bound of their search, of a vector (p,)."""
        margin = 1e-3 * (self.high - self.low)
        touching = (self.high > self.low) & ((z <= self.low + margin) | (z >= self.high - margin))
        return tuple(name for name, is_touching in zip(self.names, touching, strict=True) if is_touching)

    def limits_reached(self, z: Array) -> dict[str, str]:
        """Return which unknowns of a vector (p,) ended on an arbitrary bound of their search: name → "low" or "high".

        Bounds that nature or the user sets do not count: no dead time below zero, no power beyond 0 and 100 %, equal
        lags, no second lag, no integral action, the interval of the ambient.
        """
        margin = 1e-3 * (self.high - self.low)
        reached = {}
        for name, is_free, low, high in zip(
                self.names, self.high > self.low, z <= self.low + margin, z >= self.high - margin, strict=True):
            sides = _ARBITRARY.get(name, ())
            if is_free and ((low and "low" in sides) or (high and "high" in sides)):
                reached[name] = "low" if low else "high"
        return reached

    def _with(self, segments: tuple[LogSegment, ...]) -> Hypothesis:
        return Hypothesis(segments=segments, two_lags=self.two_lags, largest_power_pct=self.largest_power_pct)

    def _power_unit(self, z: Array) -> float:
        """Return by how much a percent of the laws' power, for a vector (p,), exceeds one of the heater's."""
        if self.largest_power_pct is None:
            return 1.0
        powers = [s.simulate(z[None, :], first, np.empty((1, len(s.readings))), 0, len(s.readings)).max()
                  for s, first in zip(self.segments, self._offsets(), strict=True)]
        return max(powers) / self.largest_power_pct or 1.0

    def _width(self, segment: LogSegment) -> int:
        return 6 + len(segment.law.constants)

    def _offsets(self) -> list[int]:
        widths = [self._width(s) for s in self.segments]
        return [4 + sum(widths[:i]) for i in range(len(widths))]

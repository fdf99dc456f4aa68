"""What a loop did: samples at the scans, the switch's edges, and the temperature at any instant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.heater.exact import advance, area, turning_times
from heatertune.heater.heat_loss import Loss, loss_at
from heatertune.model.loss_curve import loss_above
from heatertune.model.model_values import HeaterModel
from heatertune.plc.pwm import Actuator
from heatertune.plc.words import Words
from heatertune.proof.criteria import Criterion
from heatertune.proof.scenario import Scenario, phases_of, temperatures
from heatertune.proof.verdict import Interlock
from heatertune.show import NotebookDisplay

__all__ = ["Trace"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace(NotebookDisplay):
    """One run of the closed loop; all arrays are read-only.

    Attributes:
        time_s: instants of the scans, shape (n,).
        temperature_degC: the true temperature at each scan, shape (n,).
        reading_degC: what the controller saw, noise and resolution included, shape (n,).
        followed_degC: the setpoint that the controller followed, a ramp on its way included, shape (n,).
        power_asked_pct: what the controller asked for, shape (n,).
        edge_time_s: instants at which the heater was switched, shape (e,).
        edge_pct: 100 where it was switched on, -100 where its cooler was, else 0 [%], shape (e,).
        stretches: one row per stretch of constant power at the plant: instant from which it acts [s], temperature,
            state of the smaller lag and ambient + gain·power there [°C], shape (m, 4). Of a heater with a loss curve
            each of its tangents begins one, and the third column is the mass in front of the sensor.
        model, scenario, actuator: what was simulated; the actuator is the PLC's own where it makes the PWM.
        resolution_degC: of the reading [°C]; 0 for an ideal controller.
        words, switches: what the PLC ran; None and empty for an ideal controller.
        flags: name → number of scans after which the flag was set.
        interlock, cut_s: what watched the heater, if anything did, and the instant from which on it kept it off [s].
        criteria: what the run amounts to, in a fixed order; empty where it was not measured. All temperatures are the
            true ones, at any instant, not the sensor's, and the setpoint is the one asked for, also during a ramp.
    """

    def __repr__(self) -> str:
        """Return what was simulated in one line; `summary()` has the rest."""
        who = "an ideal controller" if self.words is None else self.words.target
        return f"<Trace of {who} at {self.scenario.setpoint_degC:.4g} °C: {len(self.time_s)} scans>"

    time_s: Array
    temperature_degC: Array
    reading_degC: Array
    followed_degC: Array
    power_asked_pct: Array
    edge_time_s: Array
    edge_pct: Array
    stretches: Array
    model: HeaterModel
    scenario: Scenario
    actuator: Actuator
    resolution_degC: float = 0.0
    words: Words | None = None
    switches: Mapping[str, str] = field(default_factory=dict)
    flags: Mapping[str, int] = field(default_factory=dict)
    interlock: Interlock | None = None
    cut_s: float = math.inf
    criteria: tuple[Criterion, ...] = ()

    def __post_init__(self) -> None:
        for attribute in fields(self):
            value = getattr(self, attribute.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def edge_on(self) -> npt.NDArray[np.bool_]:
        """Whether something was switched on at each edge, shape (e,)."""
        return np.not_equal(self.edge_pct, 0.0)

    @property
    def setpoint_degC(self) -> float:
        """The setpoint [°C]."""
        return self.scenario.setpoint_degC

    def temperature_at(self, time_s: npt.ArrayLike, *, before: bool = False) -> Array:
        """Return the exact temperature at instants within the run [°C], same shape.

        Where it jumps at an instant: the value after the jump, or the one before it.
        """
        times = np.asarray(time_s, dtype=np.float64)
        since, y, x, target = self._stretch_at(times, before=before)
        return advance(y, x, target, times - since, *self._lags(y, x))

    def areas(self, instants_s: Array) -> Array:
        """Return ∫temperature dt from each of some ascending instants to the next, shape (n − 1,) [°C·s].

        No power changes and nothing jumps between two of them, as with those of `course`.
        """
        since, y, x, target = self._stretch_at(instants_s[:-1])

        def up_to(times: Array) -> Array:
            return area(y, x, target, times - since, *self._lags(y, x))

        return up_to(instants_s[1:]) - up_to(instants_s[:-1])

    def course(self, start_s: float, end_s: float, *, most: float = math.inf) -> tuple[Array, Array]:
        """Return instants and temperatures between which it neither jumps nor turns, both of shape (n,).

        The first is `start_s` after a jump, the last `end_s` before one; disturbances in between are not
        expected. So the extremes of the temperature are among the values, unless the run has more stretches than
        `most`: then the instants between are scans, at most a fifth as many, and a fast PWM's ripple is not
        seen.
        """
        if len(self.stretches) > most:
            scans = slice(None, None, math.ceil(5.0 * len(self.time_s) / most))
            instants, temperatures = self.time_s[scans], self.temperature_degC[scans]
        else:
            instants, temperatures = self._instants, self._temperatures
        first, last = np.searchsorted(instants, start_s, "right"), np.searchsorted(instants, end_s)
        ends = np.array([start_s] if start_s < end_s else []), np.array([end_s])
        values = self.temperature_at(ends[0]), temperatures[first:last], self.temperature_at(ends[1], before=True)
        return np.concatenate([ends[0], instants[first:last], ends[1]]), np.concatenate(values)

    def below_until(self, level_degC: float) -> float:
        """Return an instant up to which the temperature is below a level [s]; infinite where it always is."""
        end = float(self.time_s[-1])
        for phase in phases_of(self.scenario, end, end):
            times, temperature = self.course(phase.begin_s, phase.end_s)
            reached = np.flatnonzero(temperature >= level_degC)
            if len(reached):
                return float(times[max(0, int(reached[0]) - 1)])
        return math.inf

    def _stretch_at(self, times: Array, *, before: bool = False) -> tuple[Array, ...]:
        rows = np.searchsorted(self.stretches[:, 0], times, side="left" if before else "right") - 1
        rows = np.maximum(rows, 0)
        return tuple(column[rows] for column in self.stretches.T)

    def _lags(self, y: Array, x: Array) -> tuple[float | Array, float | Array]:
        """Return the lags: of the temperature, and before it; of a loss curve, those of stretches that begin there."""
        first, *rest = self.model.lags_s
        if self._loss is None:
            return (first, rest[0] if rest else 0.0) if self.model.fast_share is None else (rest[0], first)
        room, loss = self._loss
        slopes = np.vectorize(lambda degC: loss_at(degC, room, loss)[1], otypes=[float])(x if rest else y)
        mass = first / slopes
        return (rest[0], mass) if rest else (mass, 0.0)

    @cached_property
    def _loss(self) -> tuple[float, Loss] | None:
        """The room [°C] and the loss curve above it, if the heater has one."""
        if self.model.loss is None:
            return None
        room, _ = temperatures(self.scenario, self.model)
        return room, loss_above(self.model, room)

    @cached_property
    def _instants(self) -> Array:
        """Instants between which the temperature neither jumps nor turns [s]."""
        return np.unique(np.concatenate([self.time_s, self.stretches[:, 0], self._turns()]))

    @cached_property
    def _temperatures(self) -> Array:
        """Temperatures at `_instants` [°C]."""
        return self.temperature_at(self._instants)

    def _turns(self) -> Array:
        since, y, x, target = self.stretches.T
        first, second = self._lags(y, x)
        if not np.any(second):
            return np.empty(0)
        turns = since + turning_times(y, x, target, first, second)
        return np.asarray(turns[turns < np.append(since[1:], self.time_s[-1])])

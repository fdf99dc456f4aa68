"""Heaters whose heat loss is a curve of the temperature, and their tangents at the setpoints of use.

    time constant·T′ = gain·power(t − dead time) − loss(T)

Gain and time constant are those of the chord: the linear heater that needs the same power at one temperature, and none
at the ambient. So what holds that temperature is that of the chord, and what happens near it that of the tangent. The
curve is that of `heatertune.heater.heat_loss`: convection and radiation, or a power of the rise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypedDict

import numpy as np

from heatertune.arrays import Array
from heatertune.heater.exact import advance_step, factors
from heatertune.heater.heat_loss import STEPS, Loss, LossCurve, loss_at, tangent_at
from heatertune.model.model_values import Candidate, FittedModel, Fopdt, HeaterModel, TwoLag
from heatertune.model.statistics import Interval

__all__ = [
    "LossFopdt", "LossTwoLag", "for_setpoints", "has_loss_curve", "heater_with_loss", "loss_above",
    "loss_numbers", "rest_degC", "same_beyond", "slower_cooling", "steady_power_pct", "top_degC", "working_values",
]

_HALVINGS: Final = 60
_HOTTEST_DEGC: Final = 5000.0
_FOR_EVER: Final = 1e30  # [s]
_SAME_POWER: Final = 0.01


def _tangent(model: LossFopdt | LossTwoLag, degC: float) -> HeaterModel:
    """Return the linear heater at a temperature."""
    room = _room(model)
    line = tangent_at(degC, model.gain_degC_per_pct, model.time_constant_s, room, model.loss.loss(room))
    lags = sorted((line.lag, *model.lags_s[1:]))
    parameters = {"gain_degC_per_pct": line.gain, "time_constant_s": lags[-1], "dead_time_s": model.dead_time_s,
                  "ambient_degC": line.ambient}
    return Fopdt(**parameters) if len(lags) == 1 else TwoLag(**parameters, second_time_constant_s=lags[0])


def _tangents(model: LossFopdt | LossTwoLag) -> tuple[HeaterModel, ...]:
    curve = model.loss
    uses = (curve.at_degC,) if curve.low_degC is None else (curve.at_degC, curve.low_degC)
    return tuple(_tangent(model, degC) for degC in uses)


@dataclass(frozen=True, slots=True, kw_only=True)
class LossFopdt(Fopdt):
    """One lag with a loss curve; gain and time constant are those of the chord.

    Attributes:
        loss: the curve.
    """

    loss: LossCurve

    @property
    def _heater(self) -> HeaterModel:  # type: ignore[override]
        return replace(self.linear[0], ambient_degC=self.ambient_degC)

    @property
    def linear(self) -> tuple[HeaterModel, ...]:
        """Its tangents at the setpoints of use."""
        return _tangents(self)

    def _predicted(self, time: Array, power: Array, ambient: float, before: float) -> Array:
        return _simulated(self, time, power, ambient, before)


@dataclass(frozen=True, slots=True, kw_only=True)
class LossTwoLag(TwoLag):
    """A mass with a loss curve and a sensor behind it; gain and time constant are those of the chord.

    Attributes:
        loss: the curve.
    """

    loss: LossCurve

    @property
    def _heater(self) -> HeaterModel:  # type: ignore[override]
        return replace(self.linear[0], ambient_degC=self.ambient_degC)

    @property
    def linear(self) -> tuple[HeaterModel, ...]:
        """Its tangents at the setpoints of use."""
        return _tangents(self)

    def _predicted(self, time: Array, power: Array, ambient: float, before: float) -> Array:
        return _simulated(self, time, power, ambient, before)

    def half_rule(self) -> LossFopdt:
        """Return one lag with the same loss curve, see `TwoLag.half_rule`."""
        half = self.second_time_constant_s / 2.0
        return LossFopdt(
            gain_degC_per_pct=self.gain_degC_per_pct, time_constant_s=self.time_constant_s + half,
            dead_time_s=self.dead_time_s + half, ambient_degC=self.ambient_degC, loss=self.loss)


def _simulated(model: HeaterModel, time: Array, power: Array, room: float, before: float) -> Array:
    """Return the temperature that powers give from rest at the one before, shape of `time` (n,) [°C]."""
    loss = loss_above(model, room)
    longest = loss_numbers(model, room)[-1]
    sensor = model.lags_s[1] if len(model.lags_s) > 1 else 0.0
    edges = [*(time + model.dead_time_s).tolist(), math.inf]
    levels = [before, *power.tolist()]
    mass = reading = rest_degC(model, before, room)
    now, place, rows = float(time[0]), 0, []
    for until in time.tolist():
        while now < until:
            while edges[place] <= now:
                place += 1
            end = min(until, edges[place], now + longest)
            line = tangent_at(mass, model.gain_degC_per_pct, model.lags_s[0], room, loss)
            target = line.ambient + line.gain * levels[place]
            if sensor > 0.0:
                reading, mass = advance_step(reading, mass, target, factors(end - now, sensor, line.lag))
            else:
                reading, _ = advance_step(mass, mass, target, factors(end - now, line.lag, 0.0))
                mass = reading
            now = end
        rows.append(reading)
    return np.array(rows)


def _room(model: HeaterModel) -> float:
    return float(model.ambient_degC or 0.0)


def has_loss_curve(fitted: FittedModel) -> bool:
    """Return whether every plausible heater of a fit has a loss curve."""
    return bool(fitted.candidates) and all(each.model.loss is not None for each in fitted.candidates)


def heater_with_loss(model: HeaterModel, at_degC: float, low_degC: float | None = None) -> HeaterModel:
    """Return a heater with the chord at another temperature: the same heater. A linear one is returned as it is.

    Args:
        model: the heater.
        at_degC: above its ambient; at or below it, the heater is returned as it is [°C].
        low_degC: the lowest setpoint of use, None if there is no other [°C].
    """
    curve, room = model.loss, _room(model)
    if curve is None or at_degC <= room:
        return model
    loss = curve.loss(room)
    lost, _ = loss_at(at_degC, room, loss)
    bent, _ = loss_at(at_degC, room, loss._replace(straight=0.0))
    scale = (at_degC - room) / lost
    low = None if low_degC is None or not room < low_degC < at_degC else low_degC
    moved = replace(curve, share=min(max(bent / lost, 0.0), 1.0), at_degC=at_degC, low_degC=low)
    return replace(model, gain_degC_per_pct=scale * model.gain_degC_per_pct,
                   time_constant_s=scale * model.time_constant_s, loss=moved)  # type: ignore[call-arg]


def steady_power_pct(model: HeaterModel, degC: float) -> float:
    """Return the power that holds a temperature [%]; it may be above 100."""
    curve, room = model.loss, _room(model)
    lost = degC - room if curve is None else loss_at(degC, room, curve.loss(room))[0]
    return lost / model.gain_degC_per_pct


def top_degC(model: HeaterModel, room_degC: float | None = None) -> float:
    """Return the temperature to which full power leads [°C]; the room is the model's own where none is given."""
    return rest_degC(model, 100.0, _room(model) if room_degC is None else room_degC)


def rest_degC(model: HeaterModel, power_pct: float, room_degC: float) -> float:
    """Return the temperature to which a power leads in a room [°C]."""
    room = room_degC
    if model.loss is None or power_pct <= 0.0:
        return room + power_pct * model.gain_degC_per_pct
    low, high, loss = room, _HOTTEST_DEGC, loss_above(model, room)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        reached = loss_at(middle, room, loss)[0] < power_pct * model.gain_degC_per_pct
        low, high = (middle, high) if reached else (low, middle)
    return low


def same_beyond(first: HeaterModel, second: HeaterModel) -> bool:
    """Return whether two loss curves need the same power at twice the rise of their chord, within 1 %.

    Of linear heaters there is nothing to compare: True.
    """
    if first.loss is None or second.loss is None:
        return first.loss is second.loss
    far = 2.0 * first.loss.at_degC - _room(first)
    return abs(steady_power_pct(first, far) / steady_power_pct(second, far) - 1.0) < _SAME_POWER


def slower_cooling(model: HeaterModel, degC: float) -> float:
    """Return how many times as long a heater takes to cool down to a temperature as its chord, at most.

    The loss is convex, so its share of the chord's loss is least at the end.
    """
    curve, room = model.loss, _room(model)
    if curve is None:
        return 1.0
    lost, slope = loss_at(max(degC, room), room, curve.loss(room))
    return max(1.0, (degC - room) / lost if degC > room else 1.0 / slope)


def loss_above(model: HeaterModel, room_degC: float) -> Loss:
    """Return the loss curve of a heater above a room, which may differ from its own; of a linear one, a straight line.

    A curve that counts from the ambient moves with it.
    """
    curve = model.loss
    if curve is None:
        return Loss(1.0, 0.0, 1.0, room_degC, 1.0)
    loss = curve.loss(_room(model))
    return loss if curve.origin_degC is not None else loss._replace(origin=room_degC)


def loss_numbers(model: HeaterModel, room_degC: float) -> tuple[float, ...]:
    """Return the numbers of a heater's loss curve in a row of the loop's heaters, and the longest time of a tangent.

    A linear heater has those of a straight line: its tangent is exact for any time.
    """
    loss, curve = loss_above(model, room_degC), model.loss
    if curve is None:
        return (*loss, _FOR_EVER)
    hottest = max(curve.at_degC, min(top_degC(model, room_degC), 2.0 * curve.at_degC))
    return (*loss, model.time_constant_s / loss_at(hottest, room_degC, loss)[1] / STEPS)


def for_setpoints(fitted: FittedModel, setpoints_degC: Sequence[float]) -> FittedModel:
    """Return a fit whose heaters with a loss curve have their chords and tangents at the setpoints of use.

    Args:
        fitted: the heater; without a loss curve it is returned as it is.
        setpoints_degC: every setpoint of use [°C].
    """
    if not any(each.model.loss is not None for each in fitted.candidates):
        return fitted
    far, near = max(setpoints_degC), min(setpoints_degC)
    candidates = tuple(replace(each, model=heater_with_loss(each.model, far, near)) for each in fitted.candidates)
    return replace(fitted, candidates=candidates, **working_values(candidates))


class WorkingValues(TypedDict):
    """Working model, and its intervals."""

    model: Fopdt
    ci95: Mapping[str, Interval | None]


def working_values(candidates: Sequence[Candidate]) -> WorkingValues:
    """Return the working model of heaters with a loss curve, and intervals that hold all of them.

    Gain and time constant are those of the first one's tangent, the ambient is its room.
    """
    every = [replace(each.model.linear[0].half_rule(), ambient_degC=each.model.ambient_degC) for each in candidates]
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")
    return {"model": every[0], "ci95": {name: Interval(low=min(_values(every, name)), high=max(_values(every, name)))
                                     for name in names}}


def _values(models: Sequence[Fopdt], name: str) -> Iterator[float]:
    return (float(getattr(model, name)) for model in models)

"""The heater between two switching instants: `heatertune.heater.exact` with the values of the proof.

Its exponentials and logarithms are those of `heatertune.heater.exact`, so that all ways of running the loop give
the same bits.

y is the temperature [°C], behind the larger lag; x the state of the smaller lag before it, unused with one lag.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from heatertune.compiled import bound
from heatertune.heater import exact
from heatertune.heater.exact import Factors, advance_step, decay, expm1_negative, logarithm, logarithm_beside_1
from heatertune.heater.heat_loss import Loss, tangent_at

__all__ = [
    "AGAIN", "MOST_ROUNDS", "CrossingSearch", "Flow", "LossPlant", "Plant", "advance_heater", "area", "closer",
    "factors", "is_linear", "level_crossing", "linear_plant", "loss_plant", "plant_from", "searched_from", "tangent",
    "turn", "unchanged", "with_loss",
]

_NEAR: Final = 1e-9  # a root is followed until it moves by no more [s]
MOST_ROUNDS: Final = 200

turning_time: Callable[..., float] = bound(exact.turning_time, log1p=logarithm_beside_1)


class Plant(NamedTuple):
    """The heater: gain [°C/%], the larger lag, the smaller one (0: none) and dead time [s], ambient [°C].

    And what is divided by again and again: 1/first, 1/second, their difference [1/s] and 1 by that [s]; 0 where there
    is none, see `plant_from`.
    """

    gain: float
    first: float
    second: float
    dead: float
    ambient: float
    by_first: float
    by_second: float
    apart: float
    by_apart: float


class Flow(NamedTuple):
    """The heater at an instant [s]: y and x, the target they go to [°C], power and load [%], share of the mains."""

    now: float
    y: float
    x: float
    target: float
    heat: float
    load: float
    mains: float = 1.0


def plant_from(gain: float, first: float, second: float, dead: float, ambient: float) -> Plant:
    """Return a heater; arguments as the attributes of `Plant`.

    Args:
        gain: [°C/%].
        first: the larger lag [s].
        second: the smaller one, 0: none [s].
        dead: [s].
        ambient: [°C].
    """
    by_first, by_second = 1.0 / first, 1.0 / second if second > 0.0 else 0.0
    apart = by_first - by_second if second > 0.0 else 0.0
    return Plant(gain, first, second, dead, ambient, by_first, by_second, apart, 1.0 / apart if apart != 0.0 else 0.0)


class LossPlant(NamedTuple):
    """A heater with a loss curve: its tangent at present, as `Plant`, of a sensor behind the mass that loses heat.

    With one lag, the tangent has the mass alone. `until` is the instant at which the next one is due [s]; what follows
    is the heater itself: gain [°C/%], lag of the mass and of the sensor (0: none) [s], room [°C], loss, and the longest
    time for which a tangent is taken [s].

    Of a heater of two time scales, `fast` is the share of the power's effect that passes the mass, `led` where the
    power leads [°C]. The sensor follows fast·led + (1 − fast)·mass. x is that sum: under constant power x and y move as
    those of any two lags, and where the power changes x jumps by the share of the change.
    """

    gain: float
    first: float
    second: float
    dead: float
    ambient: float
    by_first: float
    by_second: float
    apart: float
    by_apart: float
    until: float
    base_gain: float
    mass: float
    sensor: float
    room: float
    loss: Loss
    step: float
    fast: float
    led: float


#: kind of an event of a heater with a loss curve: its tangent is taken again
AGAIN: Final = 6


def linear_plant(row: Any) -> Plant:
    """Return the heater of a row of `LoopBatch.plants`."""
    return plant_from(row[0], row[1], row[2], row[3], row[4])


def loss_plant(row: Any) -> LossPlant:
    """Return the heater with a loss curve of a row of `LoopBatch.plants`, at its start."""
    loss = Loss(row[6], row[7], row[8], row[9], row[10])
    bare = LossPlant(row[0], row[1], row[2], row[3], row[4], 0.0, 0.0, 0.0, 0.0, 0.0, row[0], row[1], row[2], row[4],
                     loss, row[11], row[12], row[5])
    return _tangent_of(bare, row[5], 0.0, row[5])


def is_linear(_plant: Any) -> bool:
    """Return whether the lags are the same all the time; `with_loss` is bound where they are not."""
    return True


def with_loss(_plant: Any) -> bool:
    """Return False: of a heater with a loss curve they are not."""
    return False


def unchanged(plant: Any, flow: Flow) -> tuple[Any, Flow]:
    """Return a linear heater as it is; `tangent` is bound in its place for one with a loss curve."""
    return plant, flow


def tangent(plant: LossPlant, flow: Flow) -> tuple[LossPlant, Flow]:
    """Return the heater's tangent at its temperature, and where the power leads on that."""
    power = (flow.heat * flow.mains if flow.heat > 0.0 else flow.heat) + flow.load
    led = plant.room + plant.base_gain * power if plant.fast > 0.0 else plant.led
    here = _tangent_of(plant, flow.x if plant.sensor > 0.0 else flow.y, flow.now, led)
    x = flow.x + plant.fast * (led - plant.led)
    return here, Flow(flow.now, flow.y, x, here.ambient + here.gain * power, flow.heat, flow.load, flow.mains)


def _tangent_of(plant: LossPlant, degC: float, now: float, led: float) -> LossPlant:
    line = tangent_at(degC, plant.base_gain, plant.mass, plant.room, plant.loss)
    first, second = (plant.sensor, line.lag) if plant.sensor > 0.0 else (line.lag, 0.0)
    by_first, by_second = 1.0 / first, 1.0 / second if second > 0.0 else 0.0
    apart = -abs(by_first - by_second) if second > 0.0 else 0.0
    return LossPlant(line.gain, first, second, plant.dead, line.ambient, by_first, by_second, apart,
                     1.0 / apart if apart != 0.0 else 0.0, now + plant.step, plant.base_gain, plant.mass, plant.sensor,
                     plant.room, plant.loss, plant.step, plant.fast, led)


def factors(t: float, plant: Plant) -> Factors:
    """Return what `t` seconds of constant power leave, not negative: `exact.factors` without its divisions."""
    left = decay(-t * plant.by_first)
    if plant.second == 0.0:
        return Factors(left, 0.0, 1.0)
    stretch = t if plant.apart == 0.0 else expm1_negative(plant.apart * t) * plant.by_apart
    other = decay(-t * plant.by_second)
    slow = left if plant.first >= plant.second else other  # of a loss curve, the first lag may be the smaller one
    return Factors(left, slow * stretch * plant.by_first, other)


def advance_heater(flow: Flow, now: float, f: Factors) -> Flow:
    """Return the heater at `now`, the power being constant since; the factors are those of the time between."""
    y, x = advance_step(flow.y, flow.x, flow.target, f)
    return Flow(now, y, x, flow.target, flow.heat, flow.load, flow.mains)


def turn(before: Flow, after: Flow, plant: Plant) -> float:
    """Return the instant between two, the power being constant, at which y turns [s]; infinite where it does not."""
    if plant.second == 0.0 or (before.x - before.y) * (after.x - after.y) >= 0.0:
        return math.inf
    return before.now + turning_time(before.y, before.x, before.target, plant.first, plant.second)


def area(before: Flow, after: Flow, plant: Plant) -> float:
    """Return ∫y dt between two instants, the power being constant [°C·s].

    Of each lag ∫(what goes in − its state) is the lag times what its state has gained.
    """
    gained = plant.first * (after.y - before.y) + plant.second * (after.x - before.x)
    return before.target * (after.now - before.now) - gained


def level_crossing(before: Flow, after: Flow, level: float, plant: Plant) -> Flow:
    """Return the heater where y reaches a level between two instants, the power being constant and y not turning."""
    if plant.second == 0.0:
        return _reached_by_one_lag(before, after, level, plant)
    search = searched_from(before, after, level, plant)
    for _ in range(MOST_ROUNDS):
        search = closer(before, after, level, plant, search)
        if search.is_crossed:
            break
    return Flow(search.now, search.y, search.x, before.target, before.heat, before.load, before.mains)


class CrossingSearch(NamedTuple):
    """Where two lags are looked for at a level: it lies within two instants [s].

    Attributes:
        low: the first one.
        high: the last one.
        now: instant to look at next, or the one found [s].
        y: of the instant looked at last [°C].
        x: likewise.
        last: whether nothing better follows `now`.
        found: whether y and x are those of `now`.
    """

    low: float
    high: float
    now: float
    y: float
    x: float
    last: bool
    is_crossed: bool


def searched_from(before: Flow, after: Flow, level: float, plant: Plant) -> CrossingSearch:
    """Return where a search begins: on the cubic that leaves both ends as y does, from a parabola on.

    It needs no exponential, and beside a turn, where Newton's steps from a line would halve the way again and again, it
    is as good as elsewhere.

    Args:
        before: as there.
        after: likewise.
        level: likewise.
        plant: likewise.
    """
    seconds, rise, way = after.now - before.now, after.y - before.y, level - before.y
    first = (before.x - before.y) * plant.by_first * seconds
    last = (after.x - after.y) * plant.by_first * seconds
    below = first + math.copysign(math.sqrt(max(first * first + 4.0 * (rise - first) * way, 0.0)), rise)
    share = 2.0 * way / below if below != 0.0 else 0.0
    share = _nearer(share if 0.0 < share < 1.0 else 0.5, way, rise, first, last)
    return CrossingSearch(before.now, after.now, before.now + share * seconds, before.y, before.x, False, False)


def _nearer(share: float, way: float, rise: float, first: float, last: float) -> float:
    """Return Newton's next share of a stretch on the cubic that has its rise and leaves both ends as y does."""
    rest = share * (first + share * (3.0 * rise - 2.0 * first - last + share * (first + last - 2.0 * rise))) - way
    slope = first + share * (2.0 * (3.0 * rise - 2.0 * first - last) + share * 3.0 * (first + last - 2.0 * rise))
    nearer = share - rest / slope if slope != 0.0 else 0.0
    return nearer if 0.0 < nearer < 1.0 else share


def closer(before: Flow, after: Flow, level: float, plant: Plant, search: CrossingSearch) -> CrossingSearch:
    """Return the next step of a search, by Newton; arguments as of `reached`.

    Args:
        before: as there.
        after: likewise.
        level: likewise.
        plant: likewise.
        search: so far.
    """
    there = advance_heater(before, search.now, factors(search.now - before.now, plant))
    beyond = (there.y > level) == (after.y > before.y)
    low, high = search.low if beyond else there.now, there.now if beyond else search.high
    slope = (there.x - there.y) * plant.by_first
    now = low if slope == 0.0 else there.now - (there.y - level) / slope
    step = abs(now - there.now)
    # so near that the next step would be nothing, by how much the slope changes
    bend = abs(((before.target - there.x) * plant.by_second - slope) * plant.by_first)
    last = step <= _NEAR or (low < now < high and step * step * bend <= _NEAR * abs(slope))
    if not last and not low < now < high:  # Newton's step leads out: halve
        now = 0.5 * (low + high)
        last = high - low <= _NEAR
    return CrossingSearch(low, high, search.now if search.last else now, there.y, there.x, last, search.last)


def _reached_by_one_lag(before: Flow, after: Flow, level: float, plant: Plant) -> Flow:
    left, ahead = level - before.target, before.y - before.target
    seconds = plant.first * logarithm(ahead / left) if left * ahead > 0.0 else math.inf
    now = min(max(before.now + seconds, before.now), after.now)  # by rounding alone it lies outside
    return Flow(now, level, before.x, before.target, before.heat, before.load, before.mains)

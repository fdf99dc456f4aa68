"""What acts on the temperature next to the heater: a cooler's power, a fan that multiplies the loss, a moving room."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.values import Log
from heatertune.model.diagnostics import Remark, findings_of
from heatertune.model.disturbance import CoolingEffect, DisturbanceEffect, LossEffect
from heatertune.model.power.disturbance_fit import TAILS_PCT, cooling_effect, without_disturbance
from heatertune.model.power.loss_fit import without_loss
from heatertune.model.statistics import Interval, hull
from heatertune.model.temperature.closed_loop import Bounds
from heatertune.model.values import Candidate, FittedModel, HeaterModel

__all__ = ["cleared", "fit_two_way", "in_its_room", "with_loss"]


_SENSOR_DEGC: Final = 1.0  # error of a room's sensor, and of its place
_MOVES: Final = 0.03  # of the span of the readings: a room that moves by more is fitted


def cleared(log: Log) -> tuple[Log, DisturbanceEffect | None, LossEffect | None]:
    """Return a log without the effect of its disturbance, and this effect: as power, or on the heat loss.

    Raises:
        InputError: as `without_disturbance`.
    """
    assert log.disturbance is not None
    name = ("disturbance" if log.taken is None else log.taken.columns["disturbance"][0]).strip("'")
    log.demand_heater_alone(f"and {name!r} acts next to it: leave the latter out (--disturbance-column none) where it "
                            "does not change, or log a step of each alone")
    multiplied = without_loss(log, name, log.disturbance)
    if multiplied is not None:
        return replace(multiplied[0], disturbance=None), None, multiplied[1]
    return *without_disturbance(log), None


def in_its_room(log: Log, bounds: Bounds | None) -> tuple[Log, Bounds | None, tuple[str, ...]]:
    """Return a log as if its room had kept one temperature, the bounds of that, and what was done.

    Args:
        log: with power.
        bounds: the ambient as the user states it, which counts; None: as the log has it.
    """
    room, log = log.ambient_degC, replace(log, ambient_degC=None)
    if room is None:
        return log, bounds, ()
    low, high = np.percentile(room, TAILS_PCT).tolist()
    if bounds is not None or high + _SENSOR_DEGC >= float(log.temperature_degC.max()):
        return log, bounds, ("The column of the room's temperature was not used: " + (
            "the ambient is stated." if bounds is not None else "it is no colder than the heater."),)
    notes = f"The ambient was taken from the column of the room's temperature, {low:.3g}…{high:.3g} °C"
    if log.cooling_pct is None and high - low > _MOVES * float(np.ptp(log.temperature_degC)):
        try:
            steady, effect = without_disturbance(replace(log, disturbance=room))
        except InputError:
            effect = None
        if effect is not None and effect.acts and effect.pct_per_unit > 0.0:
            return (replace(steady, disturbance=log.disturbance), (low - _SENSOR_DEGC, low + _SENSOR_DEGC),
                    (f"{notes}; the readings were fitted as if it had always been {low:.3g} °C.",))
    return log, (low - _SENSOR_DEGC, high + _SENSOR_DEGC), (f"{notes}.",)


def fit_two_way(log: Log, fit_one: Callable[[Log], FittedModel]) -> tuple[FittedModel, Log]:
    """Return the heater of a log with a cooler, and the log with one power, below 0 where it cools.

    The heater is fitted with the best cooling gain and with both ends of its interval; its intervals hold all three.

    Raises:
        InputError: as `cooling_effect`.
    """
    assert log.cooling_pct is not None
    alone = replace(log, cooling_pct=None)
    effect, multiplied = cooling_effect(log), without_loss(alone, "the cooler", log.cooling_pct)
    if multiplied is not None:
        still, loss = multiplied
        fitted = fit_one(still)
        effect = _as_power(effect, loss, fitted, log.temperature_degC[log.cooling_pct > 0.0])
        return _with_cooling(with_loss(fitted, loss), log, effect), still
    shifted = log if effect.at_once else replace(log, cooling_pct=_earlier(log.time_s, log.cooling_pct, effect.lead_s))
    gains = (effect.cooling_gain, *effect.cooling_gain_ci95)
    middle, *ends = (shifted.with_net_power(max(gain, 0.0)) for gain in gains)
    fitted, others = fit_one(middle), [fit_one(end) for end in ends]
    ci95 = {name: _hull([own, *(other.ci95.get(name) for other in others)]) for name, own in fitted.ci95.items()}
    parts = tuple(replace(fitted.candidates[0], model=other.model, part=f"cooling gain at its {end} end")
                  for other, end in zip(others, ("low", "high"), strict=True))
    return _with_cooling(replace(fitted, ci95=ci95, candidates=(*fitted.candidates, *parts)), log, effect), middle


def _hull(intervals: Sequence[Interval | None]) -> Interval | None:
    """Return the narrowest interval that holds all, None if one of them is not known."""
    known = [interval for interval in intervals if interval is not None]
    return reduce(hull, known) if len(known) == len(intervals) else None


def _as_power(effect: CoolingEffect, loss: LossEffect, fitted: FittedModel, cooled_degC: Array) -> CoolingEffect:
    """Return a cooler that multiplies the loss as the power it takes, over the readings at which it cooled."""
    model, ambient = fitted.model, fitted.model.ambient_degC
    assert ambient is not None
    per_degC = loss.factor / loss.strong / model.gain_degC_per_pct
    low, middle, high = (max(float(per_degC * (np.quantile(cooled_degC, share) - ambient)), 0.0)
                         for share in (0.0, 0.5, 1.0))
    return replace(effect, cooling_gain=middle, cooling_gain_ci95=(low, high),
                   delta_bic=loss.delta_bic, delta_bic_loss=loss.delta_bic_as_power)


def _earlier(time: Array, held: Array, lead_s: float) -> Array:
    """Return a held signal as it is so much later, on the same rows, shape (n,)."""
    rows = np.searchsorted(time, time + lead_s, side="right") - 1
    return held[np.clip(rows, 0, len(held) - 1)]


def _with_cooling(fitted: FittedModel, log: Log, effect: CoolingEffect) -> FittedModel:
    if log.taken is not None and "power" in log.taken.assumed:  # whether it cools below 0 has to be stated first
        return replace(fitted, cooling=effect)
    name = log.name
    remarks = [Remark("cooler", f"{name}: {effect.sentence}{''.join(f' But {doubt}.' for doubt in effect.doubts)}")]
    if effect.misleads:
        remarks.append(Remark("cooler-differs", f"{name}: {'; '.join(effect.doubts)}."))
    return replace(fitted, cooling=effect, notes=(*(remark.sentence for remark in remarks), *fitted.notes),
                   findings=(*fitted.findings, *findings_of(remarks)))


def with_loss(fitted: FittedModel, effect: LossEffect | None) -> FittedModel:
    """Return a fit at the calm level of a fan with the heaters at its strong level added."""
    if effect is None:
        return fitted

    def blown(candidate: Candidate, factor: float) -> Candidate:
        model: HeaterModel = candidate.model
        return replace(candidate, part=f"{effect.column} at {effect.strong:.3g}", model=replace(
            model, gain_degC_per_pct=model.gain_degC_per_pct / (1.0 + factor),
            time_constant_s=model.time_constant_s / (1.0 + factor)))

    strong = [blown(each, effect.factor) for each in fitted.candidates if not each.part]
    strong += [blown(fitted.candidates[0], factor) for factor in effect.factor_ci95]
    return replace(
        fitted, candidates=(*fitted.candidates, *strong), notes=(effect.sentence, *fitted.notes),
        findings=(*fitted.findings, *findings_of([Remark("loss-changes", effect.sentence)])))

"""A model against another log; where that holds no power, its known controller gives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from heatertune.log.values import Log
from heatertune.model.power.known_controller import replayed
from heatertune.model.validate import LEAST_FIT_PCT, Verdict
from heatertune.model.validate import validate as judge
from heatertune.model.values import FittedModel
from heatertune.plc import Words
from heatertune.proof.known import controllers

__all__ = ["validate"]


def validate(
    fitted: FittedModel, log: Log, *, words: Words | None = None, setpoint_degC: float | None = None,
    known: Mapping[str, str] | None = None, ambient_degC: float | None = None, power_before_pct: float | None = None,
    until_s: float | None = None, least_fit_pct: float = LEAST_FIT_PCT,
) -> Verdict:
    """Judge a model by another log of its heater; arguments and errors as `heatertune.model.validate.validate`.

    Args:
        fitted: the model.
        log: with power, or without where words are given.
        words: what the controller of a log without power held; its open points are taken at their defaults.
        setpoint_degC: its setpoint [°C]; None: as logged.
        known: switch → setting of what is known of this very controller.
        ambient_degC: ambient during this log [°C].
        power_before_pct: power before the first reading [%].
        until_s: last instant to use [s].
        least_fit_pct: fit that every model has to reach [%].

    Raises:
        InputError: words for a log with power, or no setpoint.
        UnknownName: no such switch or setting.
    """
    conditions: dict[str, Any] = {
        "ambient_degC": ambient_degC, "power_before_pct": power_before_pct, "until_s": until_s,
        "least_fit_pct": least_fit_pct,
    }
    if words is None:
        return judge(fitted, log, **conditions)
    controller = controllers(words, known)[0]
    verdict = judge(fitted, replayed(log, controller, setpoint_degC), **conditions)
    note = f"The power was not logged; {controller.name} was run on the readings, from a cold start at the first one."
    return replace(verdict, notes=(note, *verdict.notes))

"""A model against another log; where that holds no power, its known controller gives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from heatertune.log.values import Log
from heatertune.model.power.known_controller import replay_controller
from heatertune.model.validate import Verdict
from heatertune.model.validate import validate as judge
from heatertune.model.values import FittedModel
from heatertune.plc import Words
from heatertune.proof.known_controller_check import controllers
from heatertune.settings import ValidateSettings

__all__ = ["validate"]


def validate(
    fitted: FittedModel, log: Log, settings: ValidateSettings | None = None, *, words: Words | None = None,
    setpoint_degC: float | None = None, known: Mapping[str, str] | None = None, **changed: Any,
) -> Verdict:
    """Judge a model by another log of its heater; arguments and errors as `heatertune.model.validate.validate`.

    Args:
        fitted: the model.
        log: with power, or without where words are given.
        settings: how it is judged; None: as usual.
        words: what the controller of a log without power held; its open points are taken at their defaults.
        setpoint_degC: its setpoint [°C]; None: as logged.
        known: switch → setting of what is known of this very controller.
        changed: fields of `ValidateSettings` that are other than in `settings`.

    Raises:
        InputError: words for a log with power, or no setpoint.
        UnknownName: no such switch or setting.
    """
    if words is None:
        return judge(fitted, log, settings, **changed)
    controller = controllers(words, known)[0]
    verdict = judge(fitted, replay_controller(log, controller, setpoint_degC), settings, **changed)
    note = f"The power was not logged; {controller.name} was run on the readings, from a cold start at the first one."
    return replace(verdict, notes=(note, *verdict.notes))

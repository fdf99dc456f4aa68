"""A proof on many drawn heaters: model + words → quantiles, and one sample again by its seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from heatertune.chain.stages import default_pwm_period_s, default_setpoint, holding
from heatertune.errors import InputError
from heatertune.model.values import FittedModel
from heatertune.pid.search.uncertain import spreads_of
from heatertune.plc import Words, room
from heatertune.proof import Actuator, Drawing, Limits, Spread, judge, prove_samples, replay, scenario_for
from heatertune.proof.series import trace_series
from heatertune.units import check

__all__ = ["SCHEMA", "replay_document", "sample_document"]

SCHEMA: Final = "heatertune/sample/1"
_MOST_SAMPLES: Final = 10_000_000


def sample_document(
    words: Words, fitted: FittedModel, count: int, *, seed: int = 0, quantile: float = 0.95,
    spread: Mapping[str, float] | None = None, tolerance_degC: float = 1.0, **conditions: Any,
) -> dict[str, Any]:
    """Return the verdict on many samples of the proof that `heatertune.chain.prove` makes, as its JSON object.

    Args:
        words: what the PLC will hold.
        fitted: the heater; its candidates and intervals are drawn from.
        count: how many samples.
        seed: of the first one.
        quantile: share of the samples that must keep every limit.
        spread: what else is drawn how wide, see `heatertune.proof.Spread`; what is missing has its default.
        tolerance_degC: as for `prove`.
        conditions: as for `prove`.

    Raises:
        InputError: an interlock, which samples do not have; or as `prove`.
        OutOfRange, UnknownName: as `prove`, or a spread, count or quantile without meaning.
    """
    check("samples", count, least=1, most=_MOST_SAMPLES)
    drawing = _drawing(words, fitted, spread or {}, **conditions)
    limits = Limits(tolerance_degC=tolerance_degC)
    return prove_samples(drawing, limits, count, seed=seed, quantile=quantile).to_document()


def replay_document(
    words: Words, fitted: FittedModel, seed: int, *, spread: Mapping[str, float] | None = None,
    tolerance_degC: float = 1.0, **conditions: Any,
) -> dict[str, Any]:
    """Return the one sample that has this seed: its heater, criteria and trace, as a JSON object.

    Raises:
        InputError, OutOfRange, UnknownName: as `sample_document`.
    """
    trace = replay(_drawing(words, fitted, spread or {}, **conditions), seed)
    found = judge(trace, Limits(tolerance_degC=tolerance_degC))
    model = trace.model
    return {
        "schema": SCHEMA, "seed": seed, "verdict": "PASS" if all(each.ok for each in found) else "FAIL",
        "target": words.target, "words": dict(words.values),
        "heater": {
            "gain_degC_per_pct": model.gain_degC_per_pct, "lags_s": list(model.lags_s),
            "dead_time_s": model.dead_time_s, "ambient_degC": model.ambient_degC,
        },
        "criteria": {each.name: each.to_document() for each in found}, "faults": [],
        "trace": trace_series(trace, f"sample {seed}"),
    }


def _drawing(
    words: Words, fitted: FittedModel, spread: Mapping[str, float], *, setpoint_degC: float | None = None,
    noise_degC: float = 0.0, actuator: Actuator | None = None, known: Mapping[str, str] | None = None,
    interlock: str | None = None, limit_degC: float | None = None, fan_stops_s: float | None = None,
    step_power_pct: float = 10.0, accept: Sequence[str] = (),
) -> Drawing:
    del limit_degC, fan_stops_s  # the interlock's
    del step_power_pct, accept  # the same for every sample: the proof judges them
    if interlock is not None:
        raise InputError("samples are run without an interlock: leave out --interlock, or --samples and --replay")
    setpoint = default_setpoint(fitted) if setpoint_degC is None else setpoint_degC
    family = [model for _, model in holding(fitted, setpoint)]
    heaters = [model for _, model in holding(replace(
        fitted, candidates=tuple(each for each in fitted.candidates if not each.part)), setpoint)]
    scenario = scenario_for(family, noise_degC=noise_degC, setpoint_degC=setpoint)
    return Drawing.of(
        room(words.target), words, heaters, scenario,
        Spread(heater=spreads_of(fitted), least_dead_time_s=fitted.least_dead_time_s, **spread),
        actuator or Actuator(pwm_period_s=default_pwm_period_s(words.sample_time_s)), dict(known or {}),
    )

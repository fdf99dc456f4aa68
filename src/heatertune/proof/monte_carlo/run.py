"""A proof on many drawn heaters: model + words → quantiles, and one sample again by its seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.model.model_values import FittedModel
from heatertune.options import merge_options
from heatertune.pid.search.robust import spreads_of
from heatertune.plc import Words, controller_for
from heatertune.proof import LoopLimits, Proof, SampleRequest, SampleSpread, prove_samples, replay
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.monte_carlo.draw import SampleProof, hardest_setting
from heatertune.proof.prove_words import actuator_for, course_for, limits_of, setpoints_for
from heatertune.proof.report_curves import trace_series
from heatertune.proof.specification import specification_of
from heatertune.proof.verdict import demand_none
from heatertune.settings import Conditions, SampleSettings
from heatertune.units import whole

__all__ = ["SCHEMA", "drawing_for", "replay_document", "run_samples", "sample_document", "with_samples"]

SCHEMA: Final = "heatertune/sample/2"


def run_samples(
    words: Words, fitted: FittedModel, drawn: SampleSettings, conditions: Conditions | None = None, *,
    workers: int | None = None,
) -> SampleProof:
    """Return what the samples asked for of the proof that `heatertune.chain.prove` makes amount to.

    Args:
        words: what the PLC will hold.
        fitted: the heater; its candidates and intervals are drawn from.
        drawn: how many, from which seed on, and what is drawn how wide.
        conditions: as for `prove`.
        workers: how many processors share them; None: all.

    Raises:
        InputError: none are asked for; an interlock, which samples do not have; or as `prove`.
        OutOfRange, UnknownName: as `prove`.
    """
    if drawn.samples is None:
        raise InputError("samples: none are asked for; expected how many")
    assumed = conditions or Conditions()
    drawing = drawing_for(words, fitted, drawn.spread, assumed)
    return prove_samples(drawing, _limits(assumed, fitted), drawn.samples, seed=drawn.seed,
                         quantile=drawn.quantile, workers=workers)


def with_samples(
    proof: Proof, fitted: FittedModel, drawn: SampleSettings, conditions: Conditions | None = None
) -> Proof:
    """Return a proof that heard the samples, too, or as it is where none are asked for; errors as `sampled`."""
    if drawn.samples is None:
        return proof
    return replace(proof, samples=run_samples(proof.words, fitted, drawn, conditions))


def sample_document(
    words: Words, fitted: FittedModel, count: int, conditions: Conditions | None = None, *, seed: int = 0,
    quantile: float = 0.95, spread: Mapping[str, float] | None = None, workers: int | None = None,
) -> dict[str, Any]:
    """Return the verdict on many samples, see `sampled`, as its JSON object.

    Args:
        words: what the PLC will hold.
        fitted: the heater.
        count: how many samples.
        conditions: as for `prove`.
        seed: of the first one.
        quantile: share of all such heaters that must keep every limit.
        spread: what else is drawn how wide, as `SampleSettings.spread` names it; what is missing has its default.
        workers: how many processors share them; None: all.

    Raises:
        InputError, UnknownName: as `sampled`.
        OutOfRange: likewise, or a spread, count or quantile without meaning.
    """
    drawn = merge_options(SampleSettings, SampleSettings(samples=count, seed=seed, quantile=quantile),
                          dict(spread or {}))
    return run_samples(words, fitted, drawn, conditions, workers=workers).to_document()


def replay_document(
    words: Words, fitted: FittedModel, seed: int, conditions: Conditions | None = None, *,
    spread: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return the one sample that has this seed: its heater, criteria and trace, as a JSON object.

    It runs under the setting of what the manual leaves open that it bears worst of those that `conditions` leaves open.

    Args:
        words: what the PLC will hold.
        fitted: the heater.
        seed: of the sample.
        conditions: as for `prove`.
        spread: as for `sample_document`.

    Raises:
        InputError, OutOfRange, UnknownName: as `sample_document`.
    """
    assumed, seed = conditions or Conditions(), whole("seed", seed)
    drawing = drawing_for(words, fitted, spread or {}, assumed)
    limits = _limits(assumed, fitted)
    trace = replay(drawing, seed, hardest_setting(drawing, limits, seed), limits)
    criteria, model = trace.criteria, trace.model
    return {
        "schema": SCHEMA, "seed": seed, "verdict": "PASS" if all(criterion.ok for criterion in criteria) else "FAIL",
        "target": words.target, "words": dict(words.values), "switches": dict(trace.switches),
        "heater": {
            "gain_degC_per_pct": model.gain_degC_per_pct, "lags_s": list(model.lags_s),
            "dead_time_s": model.dead_time_s, "ambient_degC": model.ambient_degC,
        },
        "criteria": {criterion.name: criterion.to_document() for criterion in criteria}, "faults": [],
        "trace": trace_series(trace, f"sample {seed}"),
    }


def _limits(assumed: Conditions, fitted: FittedModel) -> LoopLimits:
    """Return what a sample must keep, as the proof has it: times in T+L are those of the slowest plausible heater.

    The power that a step moves is the same on each sample: the proof judges it.
    """
    _, farthest = setpoints_for(fitted, assumed)
    return limits_of(specification_of(assumed), [model for _, model in holding_heaters(fitted, farthest)])


def drawing_for(words: Words, fitted: FittedModel, spread: Mapping[str, float], assumed: Conditions) -> SampleRequest:
    """Return whose samples are drawn; arguments as in `sample_document`.

    Raises:
        InputError: an interlock, which samples do not have; or as `heatertune.proof.prove_words.prove`.
        OutOfRange, UnknownName: likewise, or a spread without meaning.
    """
    demand_none(assumed.interlock)
    setpoint, farthest = setpoints_for(fitted, assumed)
    family = [model for _, model in holding_heaters(fitted, farthest)]
    heaters = [model for _, model in holding_heaters(replace(
        fitted, candidates=tuple(candidate for candidate in fitted.candidates if not candidate.part)), farthest)]
    scenario = course_for(words, family, assumed, setpoint).scenario
    return SampleRequest.of(
        controller_for(words.target), words, heaters, scenario,
        SampleSpread(heater=spreads_of(fitted), least_dead_time_s=fitted.least_dead_time_s, **spread),
        actuator_for(assumed, words), dict(assumed.switches),
    )

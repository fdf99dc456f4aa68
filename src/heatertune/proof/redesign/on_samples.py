"""The design closed on drawn heaters, too: where too few keep every limit, it is made for the worst of them, too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from heatertune.errors import HeatertuneError, InputError
from heatertune.model.loss_curve import for_setpoints
from heatertune.model.model_values import Candidate, FittedModel, HeaterModel
from heatertune.processors import ProgressCallback
from heatertune.proof.design_request import DesignRequest, DesignResult
from heatertune.proof.monte_carlo.draw import SampleProof
from heatertune.proof.monte_carlo.run import drawing_for, with_samples
from heatertune.proof.prove_words import every_setpoint, prove
from heatertune.proof.redesign.design_changes import costs, gain_factors_text
from heatertune.proof.redesign.redesign_search import closed_on_runs
from heatertune.proof.redesign.suggestion import known_as, pass_sentences
from heatertune.proof.repetition import repeat_words
from heatertune.proof.verdict import NOTHING_PASSES, samples_text, verdict_of_samples
from heatertune.settings import SampleSettings
from heatertune.units import count

__all__ = ["closed_on_samples"]

_MORE: Final = 3  # drawn heaters that a design is made for, too, each time it fails
_MOST_ROUNDS: Final = 3


def closed_on_samples(
    fitted: FittedModel, request: DesignRequest, *, ways_on: bool = True, progress: ProgressCallback = str,
    stage: ProgressCallback = str
) -> DesignResult:
    """Return the design of `closed_on_runs`, where too few samples pass made for the worst of them, too.

    Who looks for a design that passes on some samples finds one that suits them: what was found so is judged by as many
    others, whose verdict stands. Where none is found, for heaters lack the power, say, it is the design as asked for.

    Args:
        fitted: the heater and its candidates.
        request: what the design is asked for; without samples it is that of `closed_on_runs`.
        ways_on: as `closed_on_runs`.
        progress: called with a few words as each step begins.
        stage: as `closed_on_runs`.

    Raises:
        HeatertuneError: as `closed_on_runs`; as `heatertune.proof.monte_carlo.run.run_samples`.
    """
    drawn, fitted = request.sample_settings, for_setpoints(fitted, every_setpoint(fitted, request.conditions))
    plain = closed_on_runs(fitted, request, ways_on=ways_on, progress=progress, stage=stage)
    if drawn.samples is None:
        return plain
    progress(f"proving the parameters on {count(drawn.samples, 'sample')}")
    first = _with_samples(plain, fitted, drawn)
    if request.as_is or plain.proof.verdict == "FAIL" or _samples_of(first).verdict == "PASS" or _hopeless(first):
        return first
    if (mended := _made_for_more(first, plain.proof.verdict, fitted, request, progress)) is not None or not ways_on:
        return mended or first
    return _with_way_on(_remarked(first, f"{NOTHING_PASSES} makes the samples pass"), fitted, request, progress)


def _made_for_more(
    first: DesignResult, verdict: str, fitted: FittedModel, request: DesignRequest, progress: ProgressCallback
) -> DesignResult | None:
    """Return the first design that passes as it is made for ever more drawn heaters, too; None where none does.

    Args:
        first: the design as it was asked for, which the samples fail.
        verdict: of it without them, which another one has to reach.
        fitted: as `closed_on_samples`.
        request: likewise.
        progress: likewise.
    """
    drawn, latest, heaters = request.sample_settings, first, dict[int, HeaterModel]()
    drawing = drawing_for(first.proof.words, fitted, drawn.spread, first.conditions)
    same = request
    if request.conditions.setpoint_degC is None:  # it would hang on the heaters
        setpoint = first.proof.scenario.setpoint_degC
        same = replace(request, conditions=replace(request.conditions, setpoint_degC=setpoint))
    for _ in range(_MOST_ROUNDS):
        new = [seed for seed in _samples_of(latest).broken if seed not in heaters][:_MORE]
        heaters |= {seed: drawing.heater(seed) for seed in new}
        progress(f"too few samples keep every limit: trying a design that includes {len(heaters)} of them")
        try:
            wider = closed_on_runs(_with(fitted, heaters), same, ways_on=False, progress=progress)
            if wider.proof.verdict not in ("PASS", verdict):
                return None
            bare = _proven_on(fitted, request, wider)
        except HeatertuneError:  # there is no design for all of them
            return None
        if (bare.proof.words, bare.conditions) == (latest.proof.words, latest.conditions):
            return None  # what they break a limit by is not their heaters
        latest = _with_samples(bare, fitted, drawn)
        if bare.proof.verdict in ("PASS", verdict) and _samples_of(latest).verdict == "PASS":
            others = replace(drawn, seed=drawn.seed + _samples_of(first).count)
            return _changed(first, _with_samples(bare, fitted, others), len(heaters))
    return None


def _with(fitted: FittedModel, heaters: Mapping[int, HeaterModel]) -> FittedModel:
    """Return a fit with drawn heaters, by their seeds, among the possible ones; nothing is drawn around them."""
    def candidate(model: HeaterModel, log: str, part: str = "") -> Candidate:
        return Candidate(model=model, log=log, window_s=(0.0, 0.0), law="", fit_pct=0.0, rmse_degC=0.0, delta_bic=0.0,
                         part=part)

    own = fitted.candidates or (candidate(fitted.model, "by hand"),)
    return replace(fitted, candidates=(
        *own, *(candidate(model, "drawn", f"number {seed}") for seed, model in heaters.items())))


def _proven_on(fitted: FittedModel, request: DesignRequest, wider: DesignResult) -> DesignResult:
    """Return a design that was made for more heaters, its words as `verify` makes them again, on the possible ones."""
    setpoint = request.conditions.setpoint_degC
    conditions, recipe = replace(wider.conditions, setpoint_degC=setpoint), replace(
        wider.recipe, conditions=replace(wider.recipe.conditions, setpoint_degC=setpoint))
    choice = repeat_words(wider.ideal, fitted, recipe)
    proof = prove(choice.words, fitted, conditions)
    changes = [remark for remark in wider.proof.diagnostics.remarks if remark.startswith("with ")]
    basis = replace(proof.diagnostics, remarks=(*proof.diagnostics.remarks, *changes))
    return replace(wider, choice=choice, proof=replace(proof, diagnostics=basis), conditions=conditions, recipe=recipe)


def _with_way_on(first: DesignResult, fitted: FittedModel, request: DesignRequest,
                 progress: ProgressCallback) -> DesignResult:
    """Return a design that says with which setting of an open point one would pass, where it fails for another."""
    drawn = _samples_of(first)
    assumed, worst = drawn.settings[0].switches, min(drawn.settings, key=lambda setting: setting.passing_count).switches
    for name in (name for name, setting in assumed.items() if worst[name] != setting):
        counts = [setting.passing_count for setting in drawn.settings if setting.switches[name] == assumed[name]]
        if verdict_of_samples(drawn.count, drawn.quantile, counts) != "PASS":
            continue
        variant, options = known_as(request, {name: assumed[name]})
        progress(f"too few samples keep every limit: trying {' '.join(options)}")
        trial = closed_on_samples(fitted, variant, ways_on=False, progress=progress)
        if trial.proof.verdict == "PASS":
            return replace(_remarked(first, pass_sentences(options)), passes_with=options)
    return first


def _with_samples(result: DesignResult, fitted: FittedModel, drawn: SampleSettings) -> DesignResult:
    return replace(result, proof=with_samples(result.proof, fitted, drawn, result.conditions))


def _samples_of(result: DesignResult) -> SampleProof:
    """Return what the samples showed.

    Raises:
        InputError: there are none.
    """
    if result.proof.samples is None:
        raise InputError("samples: none")
    return result.proof.samples


def _hopeless(result: DesignResult) -> bool:
    """Return whether no design would pass: samples so few show nothing, or one in twenty lacks the power."""
    drawn = _samples_of(result)
    reserve = next(spot.p95 for spot in drawn.criteria if spot.name == "power_reserve")
    return reserve <= 0.0 or verdict_of_samples(drawn.count, drawn.quantile, [drawn.count]) != "PASS"


def _changed(first: DesignResult, result: DesignResult, more: int) -> DesignResult:
    """Return a design that was made for more heaters; it says so, and what that costs."""
    before, now = (samples_text(_samples_of(each).to_document()) for each in (first, result))
    what = f"designed for {more} of them as well"
    if result.proof.design and first.proof.design and (gains := gain_factors_text(first.ideal, result.ideal)):
        what = f"with {gains}, {what}"
    note = f"As requested, {before}; {what}, of as many new ones, {now}; {costs(first, result)}."
    return replace(_remarked(result, what.replace("them", "the drawn heaters")), notes=(note, *result.notes))


def _remarked(result: DesignResult, remark: str) -> DesignResult:
    return replace(result, proof=result.proof.led_by(remark))

"""Validate a model against another log: simulate it with the power of that log and judge the residuals.

The simulation is free-running: no reading corrects it. Only the heater's state at the first reading is fitted, because
it is not logged. The ambient is that of the model, or a given one, because rooms differ from day to day.

Also the JSON document of `heatertune validate`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from heatertune.arrays import Array
from heatertune.codec import construct_from, encode, register_schema
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.circumstances import without_neighbours
from heatertune.model.model_document import CorrelationView, WhitenessView
from heatertune.model.model_values import FittedModel, HeaterModel, InputCorrelation, TwoLag
from heatertune.model.power.feedback import feedback_notes, input_correlation
from heatertune.model.power.open_loop import FixedUnknowns, PowerProblem
from heatertune.model.power.regressors import AMBIENT, FIRST_STATE, GAIN, SECOND_STATE, Readings
from heatertune.model.reduction import cools, middle_degC, mirror_heater, mirrored_log, mirrored_model
from heatertune.model.statistics import fit_pct, ljung_box, replace_outliers, undisturbed_part
from heatertune.options import merge_options
from heatertune.settings import ValidateSettings

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import ValidateOptions

__all__ = ["MOST_BIAS_PCT", "ValidationRun", "Verdict", "VerdictView", "to_document", "validate"]


MOST_BIAS_PCT = 5.0  # of the span of the readings
_READINGS = 500  # averaged, for the correlation
_SEED = 1
_GAINED = 5.0  # fit [%] for which a free ambient is worth a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationRun:
    """One model on the log.

    Attributes:
        label: of the model.
        model: the heater.
        ambient_degC: ambient of the simulation [°C].
        fit_pct: 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) [%].
        bias_degC: mean of measured − simulated [°C].
        rmse_degC: root mean square of the same [°C].
        free_fit_pct: fit with the ambient fitted to the log [%].
        free_ambient_degC: that ambient [°C].
        ljung_box: whiteness; see `validation.ljung_box`.
        input_correlation: None if the power does not change within the horizon.
    """

    label: str
    model: HeaterModel
    ambient_degC: float
    fit_pct: float
    bias_degC: float
    rmse_degC: float
    free_fit_pct: float
    free_ambient_degC: float
    ljung_box: float
    input_correlation: InputCorrelation | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether a model holds on another log.

    Attributes:
        log: its name.
        runs: the working model first, then every plausible heater used for designs; the first is judged only
            if it is one of them.
        worst: index of the run with the worst fit; all have to pass.
        least_fit_pct: required fit of each run [%].
        bias_degC: the largest of all judged runs [°C].
        most_bias_degC: limit of the bias [°C].
        fails: failed criteria, "fit" or "bias"; empty: the model passes.
        notes: the meaning of the result, one sentence each.
    """

    log: str
    runs: tuple[ValidationRun, ...]
    worst: int
    least_fit_pct: float
    bias_degC: float
    most_bias_degC: float
    fails: tuple[str, ...]
    notes: tuple[str, ...]


def validate(
    fitted: FittedModel, log: Log, settings: ValidateSettings | None = None, **changed: Unpack[ValidateOptions]
) -> Verdict:
    """Simulate a model and every plausible heater with the power of a log, and judge them by the log's readings.

    Designs use all of them, so every one has to pass.

    Args:
        fitted: of another log of the same heater.
        log: with power.
        settings: of the validation; None: the defaults. Without an ambient it is the model's own; without a power
            before
            the first reading, the first logged one or 0, whichever fits; without a last instant the log is
            used up to its first disturbance.
        changed: fields of `ValidateSettings` that differ from `settings`.

    Raises:
        InputError: the log has no power, or has a disturbance, which is not simulated.
        OutOfRange: fewer than 20 readings are left, a power outside 0…100 %, an ambient below absolute zero.
    """
    if log.power_pct is None:
        raise InputError(
            f"{log.name}: the power was not logged, so the model cannot be run; name its --controller, or log the power"
        )
    if log.disturbance is not None:
        raise InputError(f"{log.name}: a model is run with the power alone, without what the disturbance does; leave "
                         "it out with --disturbance-column none, and --until the instant before it changes")
    options = merge_options(ValidateSettings, settings, changed)
    if options.until_s is not None:
        log = log.window(float(log.time_s[0]), options.until_s)
    if log.cooling_pct is not None and fitted.cooling is not None and not fitted.cooling.doubts:
        log = log.with_net_power(fitted.cooling.cooling_gain)
    log.demand_heater_alone("which this model does not know; validate a model that was fitted to a log with both, or "
                            "--until the instant before it cools")
    if cools(fitted):
        about = middle_degC(log)
        turned = None if options.ambient_degC is None else 2.0 * about - options.ambient_degC
        return _turned_back(
            validate(mirror_heater(fitted, about), mirrored_log(log, about), replace(options, ambient_degC=turned)),
            about)
    used, notes = undisturbed_part(log) if options.until_s is None else (log, ())
    labelled: list[tuple[str, HeaterModel]] = [("working model", fitted.model)]
    labelled += [(label, model) for label, model in without_neighbours(fitted).heaters if model != fitted.model]
    runs = tuple(_run(label, model, used, options.ambient_degC, options.power_before_pct) for label, model in labelled)
    designed_for = [i for i, run in enumerate(runs) if run.model in fitted.plants]
    worst = min(designed_for, key=lambda i: runs[i].fit_pct)
    limit = MOST_BIAS_PCT / 100.0 * float(np.ptp(replace_outliers(used.temperature_degC)))
    bias = max((runs[i].bias_degC for i in designed_for), key=abs)
    checks = {"fit": runs[worst].fit_pct >= options.least_fit_pct, "bias": abs(bias) <= limit}
    fails = tuple(name for name, is_kept in checks.items() if not is_kept)
    meaning = _verdict_notes(runs, worst, len(designed_for), fails, options.least_fit_pct, limit)
    return Verdict(
        log=log.name, runs=runs, worst=worst, least_fit_pct=options.least_fit_pct, bias_degC=bias, most_bias_degC=limit,
        fails=fails, notes=(*notes, *feedback_notes(used), *meaning),
    )


def _turned_back(verdict: Verdict, about_degC: float) -> Verdict:
    """Return the verdict on a cooler for the one on its mirror image."""
    runs = tuple(replace(
        run, model=mirrored_model(run.model, about_degC), ambient_degC=2.0 * about_degC - run.ambient_degC,
        bias_degC=-run.bias_degC, free_ambient_degC=2.0 * about_degC - run.free_ambient_degC,
    ) for run in verdict.runs)
    return replace(verdict, runs=runs, bias_degC=-verdict.bias_degC)


def _run(label: str, model: HeaterModel, log: Log, ambient_degC: float | None,
         before_pct: float | None) -> ValidationRun:
    problems = [PowerProblem(
        readings=replace(Readings.of(log), temperature_degC=replace_outliers(log.temperature_degC)),
        two_lags=isinstance(model, TwoLag), power_before_pct=before,
    ) for before in ((None, 0.0) if before_pct is None else (before_pct,))]
    own = model.ambient_degC if ambient_degC is None else ambient_degC
    solutions = [_simulated(problem, model, math.nan if own is None else own) for problem in problems]
    place = min(range(len(problems)), key=lambda i: float(np.sum(solutions[i][0] ** 2)))
    problem, (residuals, linear) = problems[place], solutions[place]
    free, freely = _simulated(problem, model, math.nan)
    record = problem.readings.temperature_degC
    return ValidationRun(
        label=label, model=model, ambient_degC=float(linear[AMBIENT]), fit_pct=fit_pct(record, record - residuals),
        bias_degC=float(np.mean(residuals)), rmse_degC=float(np.sqrt(np.mean(residuals**2))),
        free_fit_pct=fit_pct(record, record - free), free_ambient_degC=float(freely[AMBIENT]),
        ljung_box=ljung_box(residuals), input_correlation=_correlation(problem, model, linear),
    )


def _simulated(problem: PowerProblem, model: HeaterModel, ambient_degC: float) -> tuple[Array, Array]:
    """Return measured − simulated, and the linear part; nan: the ambient is fitted."""
    fixed = problem.fixed
    fixed[GAIN], fixed[AMBIENT] = (1.0 - (model.fast_share or 0.0)) * model.gain_degC_per_pct, ambient_degC
    record = problem.readings.temperature_degC - _past_mass(problem, model)
    residuals, linear = problem.solve(_vector(model)[None, :], record[None, :], FixedUnknowns(values=fixed[None, :]))
    return -residuals[0], linear[0]


def _correlation(problem: PowerProblem, model: HeaterModel, linear: Array) -> InputCorrelation | None:
    thin, vector = problem.average(_READINGS), _vector(model)
    basis = thin.basis(vector)
    states = basis[[FIRST_STATE, SECOND_STATE] if isinstance(model, TwoLag) else [FIRST_STATE]]  # all that was fitted
    return input_correlation(
        thin.readings, thin.readings.temperature_degC - _past_mass(thin, model) - linear @ basis, states.T,
        before_pct=thin.power_before,
        horizon_s=model.dead_time_s + model.lags_s[0], seed=_SEED,
    )


def _past_mass(problem: PowerProblem, model: HeaterModel) -> Array:
    """Return the part of the temperature that passes the slow mass of a heater of two time scales, shape (n,) [°C]."""
    if model.fast_share is None:
        return np.zeros(1)
    element = replace(problem, two_lags=False).basis(np.array([math.log(model.lags_s[1]), model.dead_time_s, 0.0]))
    return np.asarray(model.fast_share * model.gain_degC_per_pct * element[GAIN])


def _vector(model: HeaterModel) -> Array:
    first, *second = model.lags_s
    return np.array([math.log(first), model.dead_time_s, second[0] / first if second else 0.0])


def _verdict_notes(
    runs: tuple[ValidationRun, ...], place: int, count: int, fails: tuple[str, ...], least_fit_pct: float, limit: float
) -> list[str]:
    worst = runs[place]
    reached = f"{worst.label} explains {worst.fit_pct:.1f} % of the log with a bias of {worst.bias_degC:+.2g} °C"
    if not fails:
        notes = [f"The model holds: {reached}, the worst of {count} that designs are made for."]
    else:
        broken = {"fit": f"the fit (at least {least_fit_pct:g} %)", "bias": f"the bias (at most {limit:.2g} °C)"}
        notes = [f"The model does not hold, by {' and '.join(broken[name] for name in fails)}: {reached}, the worst of "
                 f"{count} that designs are made for."]
    best = max(runs, key=lambda run: run.fit_pct)
    if best.free_fit_pct > best.fit_pct + _GAINED:
        notes.append(
            f"With an ambient of {best.free_ambient_degC:.3g} °C instead of {best.ambient_degC:.3g} °C it would "
            f"explain {best.free_fit_pct:.1f} %: if the room was that warm, give --ambient."
        )
    test = best.input_correlation
    if test is not None and not test.ok:
        notes.append(
            f"What is left still follows the power, most after {test.at_lag_s:.3g} s (correlation {test.largest:+.2f}, "
            f"by chance up to {test.limit:.2f}): gain, lags or dead time are not quite those of this log."
        )
    return notes


@dataclass(frozen=True, slots=True, kw_only=True)
class _CriterionDocument:
    value: float
    limit: float
    unit: str
    ok: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Criteria:
    fit: _CriterionDocument
    bias: _CriterionDocument


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    label: str
    ambient_degC: float
    fit_pct: float
    bias_degC: float
    rmse_degC: float
    free_fit_pct: float
    free_ambient_degC: float
    whiteness: WhitenessView
    input_crosscorrelation: CorrelationView | None


@register_schema("heatertune/validation/1")
@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictView:
    """Document of a verdict: the criteria with their limits, and every model's run."""

    log: str
    verdict: Literal["PASS", "FAIL"]
    fails: tuple[str, ...]
    worst: str
    criteria: _Criteria
    runs: tuple[_Run, ...]
    notes: tuple[str, ...]


def to_document(verdict: Verdict) -> dict[str, Any]:
    """Return the document of a verdict."""
    worst = verdict.runs[verdict.worst]
    runs = tuple(construct_from(
        _Run, run, whiteness=WhitenessView.of(run.ljung_box),
        input_crosscorrelation=CorrelationView.of(run.input_correlation)) for run in verdict.runs)
    document: dict[str, Any] = encode(construct_from(
        VerdictView, verdict, verdict="FAIL" if verdict.fails else "PASS", worst=worst.label, runs=runs,
        criteria=_Criteria(
            fit=_CriterionDocument(value=worst.fit_pct, limit=verdict.least_fit_pct, unit="%",
                                   ok="fit" not in verdict.fails),
            bias=_CriterionDocument(value=verdict.bias_degC, limit=verdict.most_bias_degC, unit="°C",
                            ok="bias" not in verdict.fails))))
    return document

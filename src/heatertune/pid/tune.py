"""FittedModel → PidDesign: rule or optimum; the sampling interval is found together with the design.

`quick_tune` gives a design in milliseconds, for a slider: the largest integral gain that keeps Ms on every model.
|1 + K·h|² ≥ 1/Ms² at one frequency is a quadratic in K. Its smallest positive root over all frequencies and models ends
the piece of feasible gains that begins at zero, where every heater's loop is stable. The best TN of a grid has the
largest K/TN: a load step's ∫e dt is TN/K (K. J. Åström, T. Hägglund, "Advanced PID Control", ISA 2006, MIGO design).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, UnknownName
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.model.reduction import cools, mirror_heater
from heatertune.options import merge_options, options_of
from heatertune.pid.continuous_optimum import tune_continuous
from heatertune.pid.design_values import PidDesign, Promise, Timer
from heatertune.pid.rules import RULES, apply_rule, model_for, range_note
from heatertune.pid.sampled_loop import (
    dominant_time_s,
    frequencies,
    iae_load,
    iae_setpoint,
    margins,
    noise_gain,
    part_responses,
    sample_plant,
    worst,
)
from heatertune.pid.search.feasible import Problem, polish, search
from heatertune.pid.search.robust import Open, RobustDesign, robust_design
from heatertune.pid.specs import ROOM, Specs, explain, heating_cooling_notes, refuse_boundless
from heatertune.settings import STEP_POWER_PCT, TuneSettings
from heatertune.units import check, written

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import TuneOptions

__all__ = [
    "METHODS", "STRUCTURES", "assessed_sampled", "quick_tune", "refuse_contradictions", "settle",
    "stated_problem", "tune",
]


STRUCTURES = options_of(TuneSettings)["structure"].choices
METHODS = ("optimum", *RULES)

_SAMPLES_PER_TRDOM = 10.0  # S5-115U manual, section 11.2.3: TA ≈ TRdom/10
_ROUNDS = 8
_SETTLED = 0.02
_UNSETTLED = 0
_WHOLE = 1e-9  # of a timer's step: rounding


def tune(
    fitted: FittedModel, settings: TuneSettings | None = None, *, timer: Timer | None = None,
    derivative_filter: float = 0.5, resolution_degC: float = 0.0,
    most_gain: Callable[[PidDesign], float] | None = None, progress: Callable[[str], object] = str,
    **changed: Unpack[TuneOptions],
) -> PidDesign:
    """Find K, TN, TV and TA for a heater and all its candidate models.

    The optimum minimises the mean of the objective of the sampled loop over the candidates, subject to the limits on
    Ms, Mt and Mks on each. A rule is applied to the working FOPDT, and its margins are reported for the worst
    candidate. A cooler is tuned as its mirror image, with a negative K. TA = TRdom/10 of the fastest candidate's closed
    loop, iterated until it converges.

    Args:
        fitted: model and candidates.
        settings: the request; None: the defaults.
        timer: of the target.
        derivative_filter: weight of its past in the target's derivative part, see `PidDesign`.
        resolution_degC: of the controller's reading [°C]; 0 if unknown.
        most_gain: design → the largest K that the target can store with its times [%/°C]; None: unlimited.
        progress: called with a short message when a round begins.
        changed: fields of `TuneSettings` that differ from `settings`.

    Raises:
        UnknownName: no such method, structure, objective or robustness setting.
        OutOfRange: a limit that no controller can keep.
        InputError: no design keeps the limits, or the rule has no such structure or no closed-loop time, or
            robustness is requested for a rule or for a fit without intervals.
    """
    options = merge_options(TuneSettings, settings, changed)
    if cools(fitted):
        design = tune(mirror_heater(fitted), options, timer=timer, derivative_filter=derivative_filter,
                      most_gain=most_gain, resolution_degC=resolution_degC, progress=progress)
        return replace(design, gain_pct_per_degC=-design.gain_pct_per_degC)
    method, structure, robust, closed_loop_s = options.method, options.structure, options.robust, options.closed_loop_s
    refuse_contradictions(options)
    plants, sample_time_s = fitted.plants, options.sample_time_s
    specs = _specs(options)
    specs.refuse_contradictions(plants, structure)
    if sample_time_s == 0.0:
        return tune_continuous(
            fitted, method=method, structure=structure, specs=specs, closed_loop_s=closed_loop_s, robust=robust
        )
    check("derivative_filter", derivative_filter, least=0.0, most=0.99)
    if method == "optimum":
        refuse_boundless(plants, structure, options.mks)
    problem = replace(stated_problem(fitted, options, sample_time_s or 1.0, resolution_degC=resolution_degC),
                      derivative_filter=derivative_filter)
    if most_gain is not None:
        problem = replace(problem, most_gain=most_gain)
    one_round = (
        _rule_round(fitted, method, structure, derivative_filter, closed_loop_s) if method in RULES
        else _search_round(problem)
    )
    its = timer or Timer()
    timer = _shown_by(fitted, its)
    design, rounds = settle(one_round, plants, sample_time_s, timer, progress)
    problem = replace(problem, sample_time_s=design.sample_time_s)
    notes = [_told_about_ta(design, plants, rounds, sample_time_s),
             *_told_about_log(design, fitted, timer, sample_time_s)]
    if sample_time_s is None:
        notes += _told_about_stop(design, its, _trdom(plants, design))
    if method in RULES:
        outside = range_note(method, model_for(method, structure, fitted), structure, design.sample_time_s)
        notes += [f"The rule claims: {RULES[method].claim}.", *([] if outside is None else [outside])]
    if method == "optimum":
        design, why = _improved(problem, fitted, design, robust, progress)
        notes += [*why, *heating_cooling_notes(fitted, design, partial(_alone, problem))]
    return _finished(design, fitted, method, specs, notes)


def stated_problem(
    fitted: FittedModel, settings: TuneSettings, sample_time_s: float, *, resolution_degC: float = 0.0
) -> Problem:
    """Return the problem of the optimum for a heater and all its candidate models.

    Args:
        fitted: model and candidates.
        settings: objective and limits.
        sample_time_s: TA [s].
        resolution_degC: of the controller's reading [°C]; 0 if unknown.

    Raises:
        InputError: a continuous design, which has no sampled problem.
    """
    if sample_time_s == 0.0:
        raise InputError("a continuous design has no sampled problem: leave sample_time_s = 0 out")
    specs, step = _specs(settings), max(fitted.reading_step_degC, resolution_degC)
    step_power_pct = STEP_POWER_PCT if settings.step_power_pct is None else settings.step_power_pct
    return Problem(
        plants=fitted.plants, structure=settings.structure, sample_time_s=sample_time_s, ms=specs.ms, mt=specs.mt,
        mks=specs.mks, objective=specs.objective, weight=specs.weight,
        step_power=step_power_pct / step if step > 0.0 else math.inf)


def _specs(settings: TuneSettings) -> Specs:
    return Specs(ms=settings.ms, mt=settings.mt, mks=settings.mks, objective=settings.objective, weight=settings.weight)


def _alone(problem: Problem, plant: HeaterModel) -> tuple[PidDesign, Callable[[PidDesign], float]]:
    own = replace(problem, plants=(plant,))
    return search(own), own.cost


def refuse_contradictions(settings: TuneSettings) -> None:
    """Refuse settings that contradict each other, before anything is computed.

    Raises:
        UnknownName: no such method.
        InputError: a closed-loop time of the optimum, or a limit on drawn heaters of a rule.
    """
    if settings.method not in METHODS:
        raise UnknownName("tuning method", settings.method, METHODS)
    if settings.closed_loop_s is not None and settings.method == "optimum":
        raise InputError("the optimum takes no closed-loop time constant; give --ms, or a rule with --method")
    if settings.robust != "none" and settings.method != "optimum":
        raise InputError(f"the rule {settings.method} has no limits to keep; --robust goes with --method optimum")


def _improved(
    problem: Problem, fitted: FittedModel, design: PidDesign, robust: str, progress: Callable[[str], object]
) -> tuple[PidDesign, list[str]]:
    """Return the design of the search improved by IPOPT and with its robustness constraints, and the notes."""
    strategy: RobustDesign | None = None
    heaters: Open | None = None
    plain, plainly = design, problem
    if robust != "none":
        progress("keeping the limits on heaters sampled from the fit")
        heaters = Open.of(fitted, robust)
        strategy = robust_design(
            heaters, problem.specs, robust, lambda guards: search(replace(plainly, guards=guards)), plain
        )
        problem, design = replace(problem, guards=strategy.guards), strategy.design
    notes = []
    if problem.structure != "p":
        progress("improving the optimum by a second method")
        polished, comparison = polish(problem, design)
        better = None if strategy is None or heaters is None else strategy.with_design(heaters, problem.specs, polished)
        if strategy is not None and better is None:
            comparison = ("IPOPT's optimum would break a limit on the sampled heaters; the result of the "
                          "feasible-set search is used.")
        else:
            design, strategy = polished, better
        notes = [comparison, *_explained(problem, design)]
    if strategy is not None:
        notes.insert(0, strategy.sentence(problem.cost(plain), problem.cost(design)))
        design = replace(design, promise=Promise(way=robust, limits=problem.specs.limits))
    return design, notes


def _rule_round(
    fitted: FittedModel, method: str, structure: str, derivative_filter: float, closed_loop_s: float | None
) -> Callable[[float, PidDesign | None], PidDesign]:
    model = model_for(method, structure, fitted)

    def one_round(ta: float, before: PidDesign | None) -> PidDesign:  # noqa: ARG001 - a rule needs no start
        gain, tn, tv = apply_rule(method, model, structure, ta, closed_loop_s=closed_loop_s)
        return PidDesign(
            gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
            structure=structure, method=method, derivative_filter=derivative_filter,
        )

    return one_round


def _search_round(problem: Problem) -> Callable[[float, PidDesign | None], PidDesign]:
    def one_round(ta: float, before: PidDesign | None) -> PidDesign:  # noqa: ARG001 - a grid needs no start
        return search(replace(problem, sample_time_s=ta))

    return one_round


def _explained(problem: Problem, design: PidDesign) -> list[str]:
    if problem.objective == "ise":
        return []  # the feasible-set search does not know this cost
    of_all = worst([margins(plant, design) for plant in problem.limited])
    peaks = {"ms": of_all.ms, "mt": of_all.mt, "mks": max(noise_gain(plant, design) for plant in problem.limited)}

    def solve(specs: Specs) -> float:
        other = replace(problem, ms=specs.ms, mt=specs.mt, mks=specs.mks)
        return other.cost(search(other))

    return explain(problem.specs, peaks, problem.cost(design), solve, _other_restrictions(problem, design))


def _other_restrictions(problem: Problem, design: PidDesign) -> list[str]:
    """Return other restrictions of K than the limits, one sentence each."""
    almost, most = 1.0 - 10.0 * ROOM, problem.most_gain(design)
    sentences = []
    if design.gain_pct_per_degC >= almost * most:
        sentences.append(f"K is at the largest value that the target can store with this sensor range, {most:.4g} "
                         "%/°C; a narrower range would allow more.")
    if design.step_power_pct_per_degC >= almost * problem.step_power:
        sentences.append("K is limited by --step-power: one step of the reading changes the power by this limit.")
    return sentences


def settle(
    one_round: Callable[[float, PidDesign | None], PidDesign],
    plants: Sequence[HeaterModel],
    given_s: float | None,
    timer: Timer,
    progress: Callable[[str], object],
) -> tuple[PidDesign, int]:
    """Return the design whose TA is a tenth of its own TRdom, and the number of iterations (0: not converged).

    Args:
        one_round: TA [s] and the design of the previous round (None in the first) → the design at this TA.
        plants: the heaters to serve; the fastest closed loop counts.
        given_s: fixed TA [s]; None: find it.
        timer: of the target.
        progress: called with a short message when a round begins.
    """
    if given_s is not None:
        return one_round(given_s, None), 1
    ta = timer.round(min(sum(p.lags_s) + p.dead_time_s for p in plants) / 10.0)
    design: PidDesign | None = None
    for count in range(1, _ROUNDS + 1):
        progress(f"tuning with TA = {ta:g} s")
        design = one_round(ta, design)
        aim_s = _trdom(plants, design) / _SAMPLES_PER_TRDOM
        following = timer.round(aim_s) if math.isfinite(aim_s) else ta
        if abs(following - ta) <= max(_SETTLED * ta, timer.step_s):
            return design, count
        # half way in the logarithm: the design answers to TA, and whole steps can swing
        ta = timer.round(math.sqrt(ta * following)) if count > 2 else following
    assert design is not None
    return design, _UNSETTLED


def _trdom(plants: Sequence[HeaterModel], design: PidDesign) -> float:
    return min(dominant_time_s(plant, design) for plant in plants)


def _told_about_ta(design: PidDesign, plants: Sequence[HeaterModel], rounds: int, given_s: float | None) -> str:
    trdom = _trdom(plants, design)
    if math.isinf(trdom):
        return f"TA = {design.sample_time_s:g} s; TRdom is unknown: the loop does not settle within the simulated time."
    share = f"TA = {design.sample_time_s:g} s, TRdom = {written(trdom, 3)} s of the fastest closed loop"
    if given_s is not None:
        return f"{share}; TA was given."
    if rounds == _UNSETTLED:
        return f"{share}; the iteration did not converge, so TA is that of the last of {_ROUNDS} rounds, not TRdom/10."
    return f"{share}; found in {rounds} iterations."


def _shown_by(fitted: FittedModel, timer: Timer) -> Timer:
    """Return the timer with the log's interval as its shortest, because the log shows nothing faster."""
    least = math.ceil(fitted.log_interval_s / timer.step_s - _WHOLE) * timer.step_s
    return replace(timer, shortest_s=min(max(timer.shortest_s, least), timer.longest_s))


def _told_about_log(design: PidDesign, fitted: FittedModel, timer: Timer, given_s: float | None) -> list[str]:
    """Return a sentence if TA is limited by the log's interval, or was given below it, otherwise an empty list."""
    interval, ta = fitted.log_interval_s, design.sample_time_s
    if given_s is None and timer.shortest_s == ta >= interval > 0.0:
        return [f"TA is not shorter than the log's own interval of {interval:g} s, because the log does not show what "
                "the heater does in between; log at a shorter interval, or give --sample-time."]
    if given_s is not None and 0.0 < ta < interval:
        return [f"TA = {ta:g} s is shorter than the log's own interval of {interval:g} s; the log does not show what "
                "the heater does in between."]
    return []


def _told_about_stop(design: PidDesign, timer: Timer, trdom: float) -> list[str]:
    """Return a sentence if the target's timer determines TA, otherwise an empty list."""
    ta, aim_s = design.sample_time_s, trdom / _SAMPLES_PER_TRDOM
    for stop, beyond, which in ((timer.longest_s, aim_s > ta, "longest"), (timer.shortest_s, aim_s < ta, "shortest")):
        if ta == stop and beyond and abs(aim_s - ta) > _SETTLED * ta:
            return [f"TA = {ta:g} s is the {which} interval of the timer; TRdom/{_SAMPLES_PER_TRDOM:g} would be "
                    f"{written(aim_s, 3)} s."]
    return []


def _finished(design: PidDesign, fitted: FittedModel, method: str, specs: Specs, notes: list[str]) -> PidDesign:
    plants = fitted.plants
    judged = [margins(plant, design) for plant in plants]
    if any(not m.stable for m in judged):
        notes.append(f"Unstable on {sum(not m.stable for m in judged)} of {len(plants)} candidate models.")
    limit = f"{specs.text} on {len(plants)} models" if method == "optimum" else RULES[method].source
    return replace(assessed_sampled(plants, design), method=f"{method} ({limit})", notes=tuple(notes))


def assessed_sampled(plants: Sequence[HeaterModel], design: PidDesign) -> PidDesign:
    """Return the design of a sampled loop with its margins and costs, worst over the models."""
    of_all = worst([margins(plant, design) for plant in plants])
    return replace(
        design,
        margins=of_all,
        iae_load=max(iae_load(plant, design) for plant in plants),
        iae_setpoint=max(iae_setpoint(plant, design) for plant in plants),
        mks=max(noise_gain(plant, design) for plant in plants) if of_all.stable else None,
    )


_FREQUENCIES: Final = 160
_TIMES: Final = 40
_TV_OF_TN: Final = 0.25  # both zeros of the controller together: J. G. Ziegler, N. B. Nichols (1942)


def quick_tune(
    plants: Sequence[HeaterModel], *, structure: str = "pi", ms: float = 1.6, sample_time_s: float | None = None,
    timer: Timer | None = None, derivative_filter: float = 0.5,
) -> PidDesign:
    """Return the design with the largest integral gain (P: the largest gain) that keeps `ms` on every heater.

    Margins and costs are not computed. With TV = TN/4 the PID is not optimal; `heatertune.pid.tune` finds the optimum.

    Args:
        plants: the heaters to serve.
        structure: "p", "pi" or "pid".
        ms: limit of the maximum sensitivity, above 1.
        sample_time_s: TA [s]; None: TRdom/10, found together with the gains.
        timer: of the target.
        derivative_filter: of the target, see `PidDesign`.

    Raises:
        UnknownName: no such structure.
        OutOfRange: an invalid limit or interval.
        InputError: no heaters.
    """
    if structure not in STRUCTURES:
        raise UnknownName("structure", structure, STRUCTURES)
    if not plants:
        raise InputError("a design needs at least one heater")
    check("ms", ms, above=1.0)
    if sample_time_s is not None:
        check("sample_time_s", sample_time_s, above=0.0)

    sign = math.copysign(1.0, plants[0].gain_degC_per_pct)
    upright = [replace(plant, gain_degC_per_pct=sign * plant.gain_degC_per_pct) for plant in plants]

    def one_round(ta: float, before: PidDesign | None) -> PidDesign:  # noqa: ARG001 - a grid needs no start
        gain, tn = _best(upright, structure, ms, ta, derivative_filter)
        return PidDesign(
            gain_pct_per_degC=sign * gain, integral_time_s=tn, sample_time_s=ta, structure=structure,
            derivative_time_s=_TV_OF_TN * tn if structure == "pid" else 0.0, derivative_filter=derivative_filter,
            method=f"quick (largest integral gain with Ms <= {ms:g} on {len(plants)} models)",
        )

    return settle(one_round, plants, sample_time_s, timer or Timer(), str)[0]


def _best(
    plants: Sequence[HeaterModel], structure: str, ms: float, ta: float, derivative_filter: float
) -> tuple[float, float]:
    """Return K and TN; TN is infinite for a P controller."""
    slow = max(sum(plant.lags_s) + plant.dead_time_s for plant in plants)
    omega = frequencies(ta, slow, _FREQUENCIES)
    proportional, summed, difference = part_responses(omega, ta, derivative_filter)
    if structure == "p":
        times, controllers = np.array([math.inf]), proportional[None, :]
    else:
        times = np.geomspace(slow / 12.0, 3.0 * slow, _TIMES)
        rates = times[:, None] / ta
        derivative = _TV_OF_TN * rates * difference if structure == "pid" else 0.0
        controllers = proportional + summed / rates + derivative
    gains = np.full(len(times), math.inf)
    for plant in plants:
        h = sample_plant(plant, ta).frequency_response(omega) * controllers
        gains = np.minimum(gains, _end_of_first_piece(h, 1.0 - 1.0 / ms**2))
    if structure == "p":
        return float(gains[0]), math.inf
    at = int(np.argmax(gains / times))
    return float(gains[at]), float(times[at])


def _end_of_first_piece(h: npt.NDArray[np.complex128], rest: float) -> Array:
    """Return per row the smallest K > 0 with |h|²·K² + 2·Re h·K + rest = 0; infinite if it does not exist."""
    square = h.real**2 - rest * np.abs(h) ** 2
    hit = (square > 0.0) & (h.real < 0.0)
    root = np.where(hit, np.sqrt(np.maximum(square, 0.0)) - h.real, 0.0)
    ends = np.full(h.shape, math.inf)
    np.divide(rest, root, out=ends, where=hit)
    return np.asarray(ends.min(axis=1))

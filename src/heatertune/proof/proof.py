"""A proof: words, every model and every open point of the manual give one verdict.

Noise is random, so the run nearest to a limit is repeated with many draws. If n draws all keep the limits, at least a
share p of all draws does with a confidence of 1 − p^n, however the noise acts (S. S. Wilks, "Determination of sample
sizes for setting tolerance limits", Annals of Mathematical Statistics 12, 1941): 59 draws for 95 % with 95 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache as remember
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from heatertune.codec import construct_from, encode
from heatertune.errors import InputError
from heatertune.model.findings import Finding
from heatertune.model.model_values import HeaterModel
from heatertune.pid.design_document import BoostView, RampView
from heatertune.pid.design_values import PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.pwm import Actuator
from heatertune.plc.words import Words
from heatertune.proof.criteria import Criterion, LoopLimits, band_of, criteria_of_words, worst_of
from heatertune.proof.heaters import MainsScenario, mains_label
from heatertune.proof.long_outage import (
    JUDGED,
    LOADED,
    ONLY_TOLD,
    OVERSHOOTS,
    WINDOW,
    LongOutage,
    OutageTiming,
    nights_of,
)
from heatertune.proof.proof_document import OutcomeView, ProofView, RunView, with_digest
from heatertune.proof.runs import (
    CLOSE,
    SAME,
    STATES,
    AllRuns,
    Runs,
    near_limit,
    nearest_to_limits,
    other_states,
    outside_budget,
    worst_state,
)
from heatertune.proof.scenario import Scenario, heat_up, lengthen
from heatertune.proof.specification import Specification
from heatertune.proof.trace import Trace
from heatertune.proof.verdict import NOT_PROVEN, Acceptance, Coverage, FitDiagnostics, Interlock, Run, combined_verdict
from heatertune.show import NotebookDisplay

if TYPE_CHECKING:
    from heatertune.proof.monte_carlo.draw import SampleProof

__all__ = ["DRAWS", "NoiseDraws", "Proof", "Run", "RunResult", "draw_noise", "nearest", "prove_models"]


DRAWS: Final = 59
_SHARE_PCT: Final = 95  # of all draws, and confidence: 0.95**59 < 0.05
_MOST_NUMBERS: Final = 2_000_000  # of noise at once: 16 MB
_AT_REST: Final = ("steady_offset", "limit_cycle")

#: seeds → what the run amounts to with each
Again = Callable[[Sequence[int]], Sequence[tuple[Criterion, ...]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseDraws:
    """What many draws of the noise do to one run.

    Attributes:
        criteria: each the worst of all draws.
        seed: of the draw that strains its limits most.
        told: what that means, a few words.
    """

    criteria: tuple[Criterion, ...]
    seed: int
    summary: str


def nearest(runs: Sequence[Sequence[Criterion]]) -> int:
    """Return the number of the run that comes nearest to a limit that noise may break."""
    return max(range(len(runs)), key=lambda run: _nearness(runs[run]))


def _nearness(criteria: Sequence[Criterion]) -> float:
    """Return how much of a limit is used; at rest offset and swing together, which is how far a band is left behind."""
    at_rest = sum(one.strain for one in criteria if one.name in _AT_REST)
    return max(at_rest, *(one.strain for one in criteria if one.name != "power_reserve"))


def draw_noise(first: tuple[Criterion, ...], again: Again, *, seed: int, scans: int, noise_degC: float) -> NoiseDraws:
    """Return a run with more draws of its noise, until one of them breaks a limit or all are made.

    Args:
        first: what the run amounts to with the first draw.
        again: runs it with others.
        seed: of the first draw; the others follow.
        scans: of the run.
        noise_degC: standard deviation [°C].
    """
    draws, at_once = {seed: first}, max(1, _MOST_NUMBERS // scans)
    while len(draws) < DRAWS and all(one.ok for criteria in draws.values() for one in criteria):
        seeds = range(seed + len(draws), seed + min(len(draws) + at_once, DRAWS))
        draws.update(zip(seeds, again(seeds), strict=True))
    broken = sum(not all(one.ok for one in criteria) for criteria in draws.values())
    worst = max(draws, key=lambda entry: sorted((criterion.strain for criterion in draws[entry]), reverse=True))
    return NoiseDraws(criteria=tuple(worst_of(same) for same in zip(*draws.values(), strict=True)), seed=worst,
                 summary=_noise_text(noise_degC, len(draws), broken))


def _noise_text(noise_degC: float, draws: int, broken: int) -> str:
    noise = f"noise of {noise_degC:.3g} °C"
    if broken:
        return f"{noise}: {broken} of {draws} draws break a limit on the run nearest to one"
    return (f"{noise}: {draws} draws on the run nearest to a limit keep all, so {_SHARE_PCT} % of all draws do "
            f"({_SHARE_PCT} % confidence)")


_NEAR: Final = 0.5  # of a limit after few places: between those no drawn design without a boost went 1.8 times as far


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """One model under one setting of the controller's switches.

    Attributes:
        model: the model's label.
        switches: setting of each switch.
        label: model, the settings that are not the default, and the mains voltage where it is not the rated one.
        criteria: of this run.
        mains_power: full power as a share of the rated one; None: the rated power.

    Raises:
        InputError: no criterion.
    """

    model: str
    switches: Mapping[str, str]
    label: str
    criteria: tuple[Criterion, ...]
    mains_power: float | None = None

    def __post_init__(self) -> None:
        if not self.criteria:
            raise InputError(f"run {self.label}: no criteria; what is judged by nothing proves nothing")

    @property
    def run(self) -> Run:
        """Which run it is."""
        return self.model, self.switches, self.mains_power

    @property
    def verdict(self) -> str:
        """"PASS" where every criterion is ok, else "FAIL"."""
        return "PASS" if all(criterion.ok for criterion in self.criteria) else "FAIL"

    @property
    def strains(self) -> list[float]:
        """How much of each limit is used, the most first: the greater of two lists is the worse run."""
        return sorted((criterion.strain for criterion in self.criteria), reverse=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proof(NotebookDisplay):
    """What the words do in every run.

    Attributes:
        words: that were proven.
        design: as the words realise it; None where the controller is no PID.
        limits: they were held against.
        specification: behind the limits, in its user's words; None: the limits were given as they are.
        criteria: each the worst over all runs, with the label of the run it comes from.
        runs: first model and default settings first, those at other mains voltages last.
        scenario: of each run at the rated power.
        actuator: the switch; the controller's own where it makes the PWM itself.
        interlock: what watches the heater in every run; None: nothing.
        traced: number of a run → its trace, made when it is asked for first.
        known: settings that were taken as known.
        faults: what is known to be wrong in the controller with these words, one sentence each.
        ramp_degC_per_min: how fast the words' ramp moves the setpoint [°C/min]; infinite without one.
        hold_degC: how far from the reading their ramp lets the setpoint be [°C]; None: as far as it goes.
        open_points: whether every setting the manual leaves open was run, not only the defaults.
        heard: what the fit found and the user knows, which no run shows.
        nights: name of what was found in `heatertune.proof.long_outage` → runs in which it was.
        samples: what the words do on drawn heaters; None: none were drawn.
        mains: the test sequence at other mains voltages, where runs are made at them.

    Raises:
        InputError: no run.
    """

    words: Words
    design: PidDesign | None
    limits: LoopLimits
    criteria: tuple[Criterion, ...]
    runs: tuple[RunResult, ...]
    scenario: Scenario
    actuator: Actuator
    interlock: Interlock | None
    trace: Callable[[int], Trace] = field(repr=False)
    stated_settings: Mapping[str, str] = field(default_factory=dict)
    faults: tuple[str, ...] = ()
    ramp_degC_per_min: float = math.inf
    hold_degC: float | None = None
    open_points: bool = True
    diagnostics: FitDiagnostics = field(default_factory=FitDiagnostics)
    specification: Specification | None = None
    nights: Mapping[str, tuple[Run, ...]] = field(default_factory=dict, repr=False)
    samples: SampleProof | None = None
    mains: tuple[MainsScenario, ...] = ()

    def __repr__(self) -> str:
        """Return target, verdict and setpoint in one line; `summary()` has the rest."""
        return (f"<Proof {self.verdict} of {self.words.target} at {self.scenario.setpoint_degC:.4g} °C in "
                f"{len(self.runs)} runs>")

    def __post_init__(self) -> None:
        if not (self.runs and self.criteria):
            raise InputError("runs: none; a proof needs at least one run")

    def led_by(self, remark: str) -> Proof:
        """Return the proof with the result of a search before all other remarks."""
        return replace(self, diagnostics=self.diagnostics.led_by(remark))

    @property
    def nominal(self) -> Trace:
        """Trace of the first run."""
        return self.trace(0)

    @property
    def worst(self) -> Trace:
        """Trace of the run of `worst_run`."""
        return self.trace(self.worst_run)

    @property
    def worst_run(self) -> int:
        """Number of the run at the rated power whose criteria strain their limits most.

        A picture can show it with the nominal run, as their events coincide. Without such a run it is the worst of all.
        """
        rated = [run for run in self.runs if run.mains_power is None] or self.runs
        return self.runs.index(rated[_worst(rated)])

    def with_findings(self, findings: Iterable[Finding]) -> Proof:
        """Return the proof with further findings."""
        return replace(self, diagnostics=replace(
            self.diagnostics, findings=(*self.diagnostics.findings, *findings)))

    @property
    def verdict(self) -> str:
        """"FAIL" where a run or the samples failed, else "NOT PROVEN" where they leave something open, else "PASS".

        What the fit leaves open no run shows; too few samples do not show what share of all heaters passes.
        """
        fit_verdicts = [NOT_PROVEN] if self.diagnostics.blocking else []
        broken = ["FAIL"] if not all(criterion.ok for criterion in self.criteria) else []
        drawn = [] if self.samples is None else [self.samples.verdict]
        return combined_verdict([*(run.verdict for run in self.runs), *broken, *fit_verdicts, *drawn])

    @property
    def shortfalls(self) -> tuple[str, ...]:
        """Names of the criteria that are not kept, then of the findings that leave the words unproven."""
        return (*self.broken_criteria, *self.diagnostics.blocking)

    @property
    def broken_criteria(self) -> tuple[str, ...]:
        """Names of the criteria that are not kept."""
        return tuple(criterion.name for criterion in self.criteria if not criterion.ok)

    @property
    def setpoint_ramp(self) -> RampView | None:
        """The words' setpoint ramp as documents hold it, None without one."""
        ramp = self.words.ramp
        view = {"degC_per_min": self.ramp_degC_per_min, "hold_degC": self.hold_degC}
        return None if ramp is None else construct_from(RampView, ramp, **view)

    @property
    def boost(self) -> BoostView | None:
        """The words' boost as documents hold it, None without one."""
        return None if self.words.boost is None else construct_from(BoostView, self.words.boost)

    def to_document(self) -> dict[str, Any]:
        """Return the JSON document; traces are not part of it, numbers that are not finite are null."""
        runs = (
            construct_from(RunView, run, criteria={criterion.name: construct_from(OutcomeView, criterion)
                                                   for criterion in run.criteria})
            for run in self.runs)
        document = encode(construct_from(
            ProofView, self, self.words, self.diagnostics, words=self.words.values, runs=tuple(runs), samples=None,
            criteria={criterion.name: criterion.view for criterion in self.criteria}, findings=self.diagnostics.views,
            digest=""))
        drawn = {} if self.samples is None else {"samples": self.samples.to_document()}
        return with_digest(document | drawn)


def prove_models(
    controller: Controller, words: Words, models: Sequence[tuple[str, HeaterModel]], scenario: Scenario,
    actuator: Actuator | None = None, acceptance: Acceptance | None = None, coverage: Coverage | None = None, *,
    interlock: Interlock | None = None,
) -> Proof:
    """Run the words on every model under every setting the manual leaves open, and judge the worst.

    Where a controller exports a listing, the first and the worst run are the listing's own; the others, which its
    direct form runs, step by step the same, take a hundredth of the time.

    Args:
        controller: that runs the words; its delay is added to the dead times.
        words: what it holds.
        models: (label, heater); the first is the nominal one.
        scenario: what happens in each run.
        actuator: the switch; not used where the controller makes the PWM itself.
        acceptance: what the runs are held against; None: the default limits, without margins.
        coverage: which runs are made; None: all.
        interlock: what watches the heater in every run; None: nothing.

    Raises:
        InputError: no model or no run, or as in `simulate`, with the model's label.
        OutOfRange, UnknownName: as in `simulate`.
    """
    acceptance, coverage, design = acceptance or Acceptance(), coverage or Coverage(), controller.decode(words)
    runs = _all_runs(controller, words, models, scenario, actuator, acceptance.limits, coverage, interlock)
    traced = remember(partial(runs.trace, direct=not coverage.open_points))  # a quick look waits for no listing
    judged = runs.judge_all() if coverage.open_points or runs.has_others else [runs.judge(traced(0), 0)]
    first = runs.parts[0]
    step = acceptance.step_power_pct(
        _with_cooling(controller, words, design, first.actuator), max(first.resolution_degC, scenario.noise_degC))
    results = _results(runs, judged, acceptance, step, _with_cooling(controller, words, design, first.actuator))
    diagnostics = _with_unshown(_with_band(acceptance.diagnostics, acceptance.limits, first.resolution_degC),
                                coverage.in_question(controller.switches), results)
    if controller.direct is not None and coverage.whole:  # measured on traces, whose last digits differ
        for run in {0, _worst(results)}:
            results[run] = _ran(results[run], runs.judge(traced(run), run))
    states = [*_with_late_calls(runs, results, judged, coverage), *_with_other_states(runs, results, judged, coverage)
              ] if coverage.draws else []
    seeds, remarks = _with_draws(runs, results, judged) if coverage.draws else ({}, [])
    diagnostics = replace(diagnostics, remarks=(*diagnostics.remarks, *states, *remarks))
    broken: Mapping[str, tuple[Run, ...]] = {}
    if coverage.whole and all(result.verdict == "PASS" for result in results):
        findings, broken = _after_nights(runs, results, coverage)
        diagnostics = replace(diagnostics, findings=(*diagnostics.findings, *findings))
    return Proof(
        words=words,
        design=design,
        limits=acceptance.limits,
        criteria=tuple(map(worst_of, _by_name(results))),
        runs=tuple(results),
        scenario=scenario if coverage.night is None else first.scenario,
        actuator=first.actuator,
        interlock=interlock,
        trace=lambda run: traced(run, seeds[run]) if run in seeds else traced(run),
        stated_settings=dict(coverage.stated_settings),
        faults=() if controller.faults is None else controller.faults(words),
        ramp_degC_per_min=math.inf if words.ramp is None else controller.ramp_degC_per_min(words),
        hold_degC=None if words.ramp is None else controller.hold_degC(words),
        open_points=coverage.whole,
        diagnostics=diagnostics,
        specification=acceptance.specification,
        nights=broken,
        mains=tuple(MainsScenario(mains_power=part.mains_power, scenario=part.scenario) for part in runs.parts
                    if part.mains_power is not None),
    )


def _all_runs(
    controller: Controller, words: Words, models: Sequence[tuple[str, HeaterModel]], scenario: Scenario,
    actuator: Actuator | None, limits: LoopLimits, coverage: Coverage, interlock: Interlock | None,
) -> AllRuns:
    """Return the runs at the rated power and at each other one."""
    parts = list[Runs]()
    for mains_power, heaters, story in (
        (None, models, scenario), *((each.mains_power, each.models, each.scenario) for each in coverage.supplies),
    ):
        if coverage.supplies and not coverage.runs_any(mains_power):
            continue
        of = partial(Runs.of, controller, words, heaters, actuator=actuator, limits=limits, coverage=coverage,
                     interlock=interlock, mains_power=mains_power)
        if coverage.night is None:
            parts.append(of(scenario=story))
            continue
        nights = (night for night in _nights(controller, words, story, heaters) if night.name == coverage.night)
        if (night := next(nights, None)) is None:  # other words may have had it
            parts.append(of(scenario=heat_up(story)))
        else:
            reference = (night, of(scenario=story)) if night.compares else None
            lasts = lengthen(night.scenario, coverage.night_times) if night.compares else night.scenario
            parts.append(replace(of(scenario=lasts), reference=reference))
    return AllRuns.of(parts)


def _results(
    runs: AllRuns, judged: Sequence[tuple[Criterion, ...]], acceptance: Acceptance, step: float | None,
    designs: Sequence[PidDesign],
) -> list[RunResult]:
    """Return the result of each run; margins and step power are those of the words at the rated power."""
    rated = [part for part in runs.parts if part.mains_power is None]
    margins = acceptance.margins(designs, (model for part in rated for _, model, _ in part.cases))
    results = list[RunResult]()
    for part in runs.parts:
        for run, (name, model, switches) in enumerate(part.cases):
            label, ran = part.label(run), judged[len(results)]
            words = () if part.mains_power is not None else criteria_of_words(
                acceptance.limits, margins.get(model), step, label)
            results.append(RunResult(model=name, switches=switches, label=label, criteria=(*ran, *words),
                                     mains_power=part.mains_power))
    return results


def _by_name(results: Sequence[RunResult]) -> list[list[Criterion]]:
    """Return the criteria of all runs, those of one name together; some do not hold at each power."""
    same: dict[str, list[Criterion]] = {}
    for result in results:
        for criterion in result.criteria:
            same.setdefault(criterion.name, []).append(criterion)
    return list(same.values())


def _with_cooling(
    controller: Controller, words: Words, design: PidDesign | None, actuator: Actuator
) -> tuple[PidDesign, ...]:
    """Return the design, and that of a cooler's parameters as the heater would have it; none where there is no PID."""
    own = None if controller.cooling is None or not actuator.cooling_gain else controller.cooling.design(words)
    gain = actuator.cooling_gain or 0.0
    cooling = () if own is None else (replace(own, gain_pct_per_degC=own.gain_pct_per_degC * gain),)
    return (() if design is None else (design,)) + cooling


def _with_other_states(
    runs: AllRuns, results: list[RunResult], judged: Sequence[tuple[Criterion, ...]], coverage: Coverage
) -> list[str]:
    """Enter what the runs nearest to a limit use of it from other initial states, if all runs pass; return a remark.

    Noise has a state of its own in each draw: there its draws decide.

    Args:
        runs: what ran.
        results: of all runs.
        judged: the criteria of each that need a run.
        coverage: of the proof.
    """
    if runs.parts[0].scenario.noise_degC > 0.0 or any(result.verdict != "PASS" for result in results):
        return []
    near = nearest_to_limits(
        [result.criteria[:len(ran)] for result, ran in zip(results, judged, strict=True)],
        [near_limit(part.step_s, model.dead_time_s) for part in runs.parts for _, model, _ in part.cases],
        [tick_degC for part in runs.parts for tick_degC in part.ticks_degC])
    others = dict[int, list[tuple[Criterion, ...]]]()
    for run in near:
        part, _ = runs.place(run)
        others[run] = [part.again(state, [results[run].run], replace(coverage, progress=str)).judge_all()[0]
                       for state in other_states(part.scenario, part.loops[0].scan_s, part.step_s)]
    return _enter(results, judged, others, f"{STATES} other initial states")


def _most(criteria: Sequence[Criterion]) -> float:
    """Return how much of a limit is used at most."""
    return max(one.strain for one in criteria)


def _with_late_calls(
    runs: AllRuns, results: list[RunResult], judged: Sequence[tuple[Criterion, ...]], coverage: Coverage
) -> list[str]:
    """Enter what runs use of their limits where other calls are missed, if all runs pass; return a remark.

    Args:
        runs: what ran.
        results: of all runs.
        judged: the criteria of each that need a run.
        coverage: of the proof.
    """
    others, first = dict[int, list[tuple[Criterion, ...]]](), 0
    if any(result.verdict != "PASS" for result in results):
        return []
    for part in runs.parts:
        same = part.with_late_calls(judged[first:first + len(part.cases)], replace(coverage, progress=str))
        others |= {first + run: each for run, each in same.items()}
        first += len(part.cases)
    return _enter(results, judged, others, "calls missed at any scan")


def _enter(
    results: list[RunResult], judged: Sequence[tuple[Criterion, ...]],
    others: Mapping[int, Sequence[tuple[Criterion, ...]]], summary: str,
) -> list[str]:
    """Enter the worst of the same runs made otherwise, where a verdict depends on it; return a remark.

    Args:
        results: of all runs.
        judged: the criteria of each that need a run.
        others: number of a run → its criteria in each other way.
        summary: what is other, in words.
    """
    before = after = 0.0
    for run, same in others.items():
        ran = results[run].criteria[:len(judged[run])]
        worst = worst_state(ran, same)
        if _most(worst) <= CLOSE:  # no verdict hangs on it
            continue
        if not 1.0 < _most(worst) <= SAME:
            results[run] = _ran(results[run], worst)
        before, after = max(before, _most(ran)), max(after, _most(worst))
    return [f"{summary}: {100.0 * after:.4g} % of a limit is used, {100.0 * before:.4g} % before"
            ] if after > before else []


def _with_draws(
    runs: AllRuns, results: list[RunResult], judged: Sequence[tuple[Criterion, ...]]
) -> tuple[dict[int, int], list[str]]:
    """Enter what more draws of noise do to the hardest of runs that all pass; return its seed, and what is told.

    Args:
        runs: what ran.
        results: of all runs.
        judged: the criteria of each that need a run.
    """
    if not runs.parts[0].scenario.noise_degC > 0.0 or any(result.verdict != "PASS" for result in results):
        return {}, []
    run = nearest(judged)
    part, own = runs.place(run)
    draws = draw_noise(results[run].criteria[:len(judged[run])], lambda seeds: part.criteria_with(seeds, own),
                  seed=part.scenario.seed, scans=part.scans, noise_degC=part.scenario.noise_degC)
    results[run] = _ran(results[run], draws.criteria)
    return {run: draws.seed}, [draws.summary]


def _hardest_after(results: Sequence[RunResult], night: str) -> list[RunResult]:
    """Return of each setting the run that overshoots most, for its limit, after what a night tries in other lengths.

    Where the time to return counts too, also the run that needs the most of it. That which overshoots most of all comes
    last.
    """
    def by(names: Sequence[str]) -> Callable[[RunResult], float]:
        return lambda result: max(each.strain for each in result.criteria if each.name in names)

    over = by(OVERSHOOTS[night])
    judged = {each.name for each in results[0].criteria}
    times = [name for name in JUDGED[night] if name in judged and name not in OVERSHOOTS[night]]
    hardest = [run for strain in (*([by(times)] if times else []), over) for run in
               {tuple(run.switches.items()): run for run in sorted(results, key=strain)}.values()]
    return sorted({run.label: run for run in hardest}.values(), key=over)


def _after_nights(
    runs: AllRuns, results: Sequence[RunResult], coverage: Coverage
) -> tuple[list[Finding], dict[str, tuple[Run, ...]]]:
    """Return what other lengths show at each power, a finding once, and the runs that show it, by its name."""
    findings, broken = dict[str, Finding](), dict[str, tuple[Run, ...]]()
    for part in runs.parts:
        part_results = [result for result in results if result.mains_power == part.mains_power]
        part_findings, over = _after_a_night(part, part_results, coverage)
        for finding in part_findings:
            message = finding.message if part.mains_power is None else (
                f"{finding.message.removesuffix('.')} ({mains_label(part.mains_power)}).")
            findings.setdefault(finding.name, replace(finding, message=message))
        broken |= {name: (*broken.get(name, ()), *some) for name, some in over.items()}
    return list(findings.values()), broken


def _after_a_night(
    runs: Runs, results: Sequence[RunResult], coverage: Coverage
) -> tuple[list[Finding], dict[str, tuple[Run, ...]]]:
    """Return what other lengths show, and the runs that show it, by its name.

    Each setting is run on the heater that overshoots most after the story's lengths, and on that which does so here
    under the hardest setting: it may be another one. Where a few places come near to a limit, many are looked at.
    Whether a setting winds up does not show in the story where the setpoint is held near the reading.
    """
    coarse, fine = (_nights(runs.controller, runs.words, runs.scenario, runs.models, closely=closely)
                    for closely in (False, True))
    findings, broken = list[Finding](), dict[str, tuple[Run, ...]]()
    for first, closer in zip(coarse, fine, strict=True):
        with outside_budget(only_told=first.name in ONLY_TOLD):
            outcomes = _judged_after(runs, results, coverage, first, closer)
        if new_findings := closer.findings(criterion for _, criteria in outcomes for criterion in criteria):
            findings += new_findings
            over = [run for run, criteria in outcomes if closer.findings(criteria)]
            broken[closer.name] = tuple(run for place, run in enumerate(over) if run not in over[:place])
    return findings, broken


def _judged_after(
    runs: Runs, results: Sequence[RunResult], coverage: Coverage, first: LongOutage, closer: LongOutage
) -> list[tuple[Run, tuple[Criterion, ...]]]:
    """Return what the hardest runs do after an outage, and at more places where these come near to a limit."""
    before, power = {result.label: result.criteria for result in results}, runs.mains_power

    def judged(night: LongOutage, only: Sequence[Run]) -> list[tuple[Run, tuple[Criterion, ...]]]:
        again = runs.again(night.scenario, only, replace(
            coverage, progress=lambda message: coverage.progress(f"{message} after longer outages")))
        return [((name, switches, power), night.compare(criteria, before[again.label(number)]))
                for number, ((name, _, switches), criteria) in enumerate(zip(
                    again.cases, again.judge_all(), strict=True))]

    hardest = _hardest_after(results, first.name)
    outcomes = judged(first, [*(run.run for run in hardest),
                              *((name, hardest[-1].switches, power) for name, _ in runs.models)])
    (model, *_), _ = max(outcomes, key=lambda entry: first.strain(entry[1]))
    ran = [run for run, _ in outcomes]
    if others := [run for run in ((model, run.switches, power) for run in hardest) if run not in ran]:
        outcomes += judged(first, others)
    near = [run for run, criteria in outcomes if first.strain(criteria) > _NEAR]
    return outcomes + (judged(closer, near) if near and closer.scenario != first.scenario else [])


def _nights(
    controller: Controller, words: Words, scenario: Scenario, models: Sequence[tuple[str, HeaterModel]], *,
    closely: bool = True,
) -> Iterator[LongOutage]:
    heaters = [model for _, model in models]
    cooling = OutageTiming(controller, words, controller.decode(words), scenario, heaters, closely)
    again = "" if controller.again_degC(words) is None else WINDOW if words.boost is None else LOADED
    return nights_of(scenario, heaters, cooling.openings_s(), cooling.restarts_s(), cooling.lows_degC(),
                     cooling.lower_s(), again=again, held_back=controller.hold_degC(words) is not None)


def _with_band(diagnostics: FitDiagnostics, limits: LoopLimits, resolution_degC: float) -> FitDiagnostics:
    """Return what is heard, and that the band is wider than what was asked for, where the sensor makes it so."""
    band = band_of(limits, resolution_degC)
    if band <= limits.tolerance_degC:
        return diagnostics
    widened = f"requested ±{limits.tolerance_degC:.3g} °C, proven ±{band:.3g} °C"
    coarse = Finding(name="coarse-sensor", message=f"{widened}: the sensor's step is {resolution_degC:.3g} °C.")
    return replace(diagnostics, findings=(*diagnostics.findings, coarse), remarks=(*diagnostics.remarks, widened))


def _with_unshown(diagnostics: FitDiagnostics, switches: Sequence[OpenPoint],
                  results: Sequence[RunResult]) -> FitDiagnostics:
    """Return what is heard, and the points that the manual leaves open whose settings no run tells apart."""
    unshown = [switch.name for switch in switches if _unshown(switch, results)]
    if not unshown:
        return diagnostics
    settings = f"settings of {', '.join(unshown)} (they change no run)"
    return replace(diagnostics, not_tested=(*diagnostics.not_tested, settings))


def _unshown(switch: OpenPoint, results: Sequence[RunResult]) -> bool:
    """Return whether a switch was set in several ways, and runs that differ in it alone gave the same, or could not."""
    if switch.in_manual:
        return True
    alike: dict[tuple[str, ...], set[tuple[str, tuple[float, ...]]]] = {}
    for run in results:
        others = tuple(f"{name} = {setting}" for name, setting in run.switches.items() if name != switch.name)
        others = (*others, f"{run.mains_power}")
        values = tuple(criterion.value for criterion in run.criteria)
        alike.setdefault((run.model, *others), set()).add((run.switches[switch.name], values))
    compared = [same for same in alike.values() if len({setting for setting, _ in same}) > 1]
    return bool(compared) and all(len({values for _, values in same}) == 1 for same in compared)


def _worst(results: Sequence[RunResult]) -> int:
    """Return the number of the run whose criteria strain their limits most."""
    return max(range(len(results)), key=lambda run: results[run].strains)


def _ran(result: RunResult, ran: tuple[Criterion, ...]) -> RunResult:
    """Return a run as its listing ran it, as what is exported shall have its say, or as more draws of its noise did."""
    return replace(result, criteria=(*ran, *result.criteria[len(ran):]))

"""Words, the heaters that a fit leaves possible, and what is assumed → the proof.

Other words are first proven in the runs that words have failed (`WorstRuns`), before a whole proof is worth its time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, NamedTuple

from heatertune.errors import InputError, OutOfRange
from heatertune.model.loss_curve import for_setpoints
from heatertune.model.model_values import FitOutcome, FittedModel, HeaterModel
from heatertune.model.reduction import cools
from heatertune.options import merge_options, with_options
from heatertune.pid.sampled_loop import margins
from heatertune.plc import Words, controller_for
from heatertune.plc.controller import with_cooler
from heatertune.plc.inputs import has_ends
from heatertune.plc.pwm import Actuator, in_ticks, switched_by, tick_for
from heatertune.plc.targets import GROUPS
from heatertune.processors import ProgressCallback, log_progress
from heatertune.proof.criteria import Criterion, LoopLimits, band_of
from heatertune.proof.heaters import (
    MAINS_POWERS,
    RESERVE_PCT,
    Supply,
    beyond_by_curve,
    beyond_log,
    cooler_findings,
    default_setpoint,
    holding_heaters,
    left_out,
    limits_off_rated,
    mains_label,
    range_is_unknown,
    scale_power,
    unreachable_findings,
)
from heatertune.proof.long_outage import BRIEF, JUDGED, wound
from heatertune.proof.loop import MOST_SCANS
from heatertune.proof.proof import Proof, RunResult, prove_models
from heatertune.proof.scenario import opening
from heatertune.proof.specification import Specification, specification_of
from heatertune.proof.test_sequence import LoopTiming, SequencePlan, story_for
from heatertune.proof.verdict import Acceptance, Coverage, FitDiagnostics, Interlock, Run
from heatertune.settings import Conditions, TuneSettings

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import ConditionOptions

__all__ = [
    "NEIGHBOURS_AT_REST", "NOTICEABLE", "RunScreen", "WorstRuns", "actuator_for", "aim_sentences", "course_for",
    "default_pwm_period_s", "every_setpoint", "limits_of", "prove", "setpoints_for", "tune_settings_for",
]


#: of which no run knows, and which a log of one heater need not show
NEIGHBOURS_AT_REST: Final = "other heaters that move (a neighbour at rest was assumed)"
NEIGHBOURS_UNLIKE: Final = "other heaters that move unlike this one (at rest, and all moving alike was tested)"
#: of the band of soaks: as near to the ambient a heater has to be before a profile
_OF_BAND: Final = 0.5
#: times how far from the setpoint is still right: the least setpoint change that is judged by itself, so that half of
#: it, its limit, is no less than what is right
_IN_BANDS: Final = 2.0
#: of each time at rest, in a first look that ends early
_OPENING_RESTS: Final = 0.05


@with_options(Conditions)
def prove(
    words: Words, fitted: FittedModel, conditions: Conditions | None = None, *, first_look: bool | int = False,
    only: Sequence[Run] | None = None, night: str | None = None, night_times: float = 1.0,
    progress: ProgressCallback = log_progress,
    **changed: Unpack[ConditionOptions],
) -> Proof:
    """Run the words in the closed loop on every candidate model, under every open point of the manual.

    Without a setpoint, the loop is proven where the log says that the heater was used, or, without a log, half way
    between ambient and full power on the weakest model.

    Args:
        words: what the PLC will hold.
        fitted: the heater and its candidates.
        conditions: what is assumed; None: the defaults.
        first_look: only the nominal model under the default settings, in the same scenario; `export` refuses it. A
            number: a test sequence of more scans ends after its first event, and rests less.
        only: only these runs, in the same scenario; `export` refuses it too.
        night: with `only`: the heat-up and one of `heatertune.proof.long_outage` alone, by its name, if the words have
            it.
        night_times: with `night`: the longest open circuit lasts so many times as long.
        progress: called with how many runs are done.
        changed: fields of `Conditions` that are other than in `conditions`.

    Raises:
        InputError: an interlock for a cooler; or as `heatertune.proof.prove_models`.
        OutOfRange: as `heatertune.proof.prove_models`.
        UnknownName: no such interlock, switch or setting, or no finding to accept.
    """
    assumptions = merge_options(Conditions, conditions, changed, also=("conditions", "first_look", "only", "progress"))
    if assumptions.interlock is not None and cools(fitted):
        raise InputError("an interlock switches off a heater that gets too hot; for a cooler leave --interlock out")
    fitted = for_setpoints(fitted, every_setpoint(fitted, assumptions))
    setpoint, farthest = setpoints_for(fitted, assumptions)
    models, setpoints = holding_heaters(fitted, farthest), every_setpoint(fitted, assumptions)
    heaters = [model for _, model in models]
    course, specification = course_for(words, heaters, assumptions, setpoint), specification_of(assumptions)
    powers = () if first_look else MAINS_POWERS if only is None else dict.fromkeys(power for *_, power in only if power)
    supplies, notes, untested = _supplies(words, models, assumptions, (setpoint, farthest), powers, course.notes)
    actuator = actuator_for(assumptions, words)
    diagnostics = FitDiagnostics(
        findings=(*cooler_findings(fitted, actuator.cooling_gain), *unreachable_findings(fitted, len(models), farthest),
                  *beyond_log(fitted, setpoints)), accepted=assumptions.accept,
        assumed=fitted.assumed, not_tested=(*course.not_tested, *untested, *_neighbours_not_tested(fitted)),
        remarks=(*beyond_by_curve(fitted, setpoints), *_remarks(words, fitted, assumptions, setpoints),
                 *left_out(fitted, len(models), farthest), *course.notes, *notes))
    acceptance = Acceptance(
        limits=limits_of(specification, heaters), specification=specification, margins_of=margins,
        reading_step_degC=fitted.reading_step_degC, diagnostics=diagnostics)
    coverage = Coverage(
        stated_settings=assumptions.switches, open_points=not first_look, only=only, night=night,
        night_times=night_times, draws=not first_look and night is None,  # as in a whole proof: nights have one draw
        progress=progress, supplies=supplies)
    scenario, most_s = course.scenario, first_look * controller_for(words.target).timing(words).scan_s
    if first_look is not True and 0.0 < most_s < scenario.duration_s:
        scenario = opening(scenario, _OPENING_RESTS)
    return prove_models(
        controller_for(words.target), words, models[:1] if first_look else models, scenario, actuator,
        acceptance, coverage, interlock=_interlock(assumptions, words))


def _neighbours_not_tested(fitted: FittedModel) -> Iterator[str]:
    """Yield what no run shows of other heaters, where the user does not state that there are none."""
    names = {finding.name for finding in fitted.findings}
    if "shared-mass" in names:
        yield NEIGHBOURS_UNLIKE
    elif "alone" not in names:
        yield NEIGHBOURS_AT_REST


def _supplies(
    words: Words, models: Sequence[tuple[str, HeaterModel]], conditions: Conditions,
    setpoints_degC: tuple[float, float], powers: Iterable[float], rated_notes: Collection[str],
) -> tuple[list[Supply], list[str], list[str]]:
    """Return the test sequence at other mains voltages, what is easier in it, and where it is not run, and why.

    Args:
        words: what the PLC will hold.
        models: (label, heater) of the proof.
        conditions: of the proof.
        setpoints_degC: the upper end of the setpoints of use, and the farthest of it and a profile's targets [°C].
        powers: full power as a share of the rated one, of each voltage.
        rated_notes: what is easier at the rated power, which need not be repeated.
    """
    supplies, notes, untested = list[Supply](), list[str](), list[str]()
    story, scan_s = specification_of(conditions).story_at(None), controller_for(words.target).timing(words).scan_s
    if not story.mains or story.paper_times:
        return supplies, notes, untested
    for power in powers:
        label = f"{mains_label(power)} throughout"
        at_power = [(name, scale_power(model, power)) for name, model in models]
        holding_pct = [(max(setpoints_degC, key=lambda entry: abs(entry - ambient)) - ambient) / model.gain_degC_per_pct
                       for _, model in at_power for ambient in [float(model.ambient_degC or 0.0)]]
        able = tuple(pair for pair, pct in zip(at_power, holding_pct, strict=True) if pct <= 100.0 - RESERVE_PCT)
        if len(able) < len(models):
            whom = "" if len(models) == 1 else f" on {len(models) - len(able)} of {len(models)} heaters"
            untested.append(f"{label}{whom} ({max(holding_pct):.3g} % of that power would hold the setpoint)")
        if not able:
            continue
        try:
            course = course_for(words, [model for _, model in able], conditions, setpoints_degC[0], mains_power=power)
        except (InputError, OutOfRange) as problem:
            untested.append(f"{label} ({problem})")
            continue
        if course.scenario.duration_s > MOST_SCANS * scan_s:
            untested.append(f"{label} (more than {MOST_SCANS // 1_000_000} million scans)")
            continue
        supplies.append(Supply(mains_power=power, scenario=course.scenario, models=able))
        notes += [f"{label}, of that power: {easier}" for easier in course.notes if easier not in rated_notes]
    return supplies, notes, untested


def setpoints_for(fitted: FittedModel, conditions: Conditions) -> tuple[float, float]:
    """Return the upper end of the setpoints of use, and what is the farthest of it and a profile's targets [°C].

    Of a cooler it is the lower end. Where the user tells none it is where the log says that the heater was used, or the
    farthest of the profile.
    """
    profile, cooler = specification_of(conditions).profile, cools(fitted)
    setpoint, farthest = conditions.farthest_degC(cooler=cooler), min if cooler else max
    targets = [] if profile is None else [segment.target_degC for segment in profile.segments]
    if setpoint is None:
        setpoint = farthest(targets) if targets else default_setpoint(fitted)
    return setpoint, farthest([setpoint, *targets])


def every_setpoint(fitted: FittedModel, conditions: Conditions) -> tuple[float, ...]:
    """Return every temperature that a proof asks for: both ends of the setpoints of use, a profile's targets [°C]."""
    profile, nearest = specification_of(conditions).profile, conditions.nearest_degC(cooler=cools(fitted))
    targets = () if profile is None else tuple(segment.target_degC for segment in profile.segments)
    return (*setpoints_for(fitted, conditions), *targets, *(() if nearest is None else (nearest,)))


def course_for(
    words: Words, models: Sequence[HeaterModel], conditions: Conditions, setpoint_degC: float, *,
    mains_power: float | None = None,
) -> SequencePlan:
    """Return what words have to live through on heaters.

    Args:
        words: what the PLC will hold.
        models: the heaters, with their gains at the mains voltage.
        conditions: of the proof.
        setpoint_degC: upper end of the setpoints of use [°C].
        mains_power: full power as a share of the rated one throughout; None: the rated one, but where the story
            changes it. A load is a share of the rated power: draughts and goods know no mains voltage.

    Raises:
        InputError, OutOfRange: as `story_for`.
    """
    controller, actuator = controller_for(words.target), actuator_for(conditions, words)
    timing, design = controller.timing(words), controller.decode(words)
    specification = specification_of(conditions)
    limits, cooling_gain = limits_of(specification, models), actuator.cooling_gain or 0.0
    story = specification.story_at(conditions.nearest_degC(cooler=models[0].gain_degC_per_pct < 0.0))
    if mains_power is not None:
        limits, cooling_gain = limits_off_rated(limits), cooling_gain / mains_power
        story = replace(story, mains=False, load_pct=min(story.load_pct / mains_power, 99.0))
    resolution_degC = words.scaling.span_degC / controller.sensor(words.scaling).counts
    loop = LoopTiming(
        scan_s=timing.scan_s, sample_time_s=words.sample_time_s,
        pwm_period_s=actuator.pwm_period_s if timing.pwm_period_s is None else timing.pwm_period_s,
        integral_time_s=None if design is None else design.integral_time_s,
        ramp_degC_per_min=controller.ramp_degC_per_min(words), settling_s=limits.settling_s or 0.0,
        recovery_s=limits.recovery_s or 0.0, soak_settles_s=limits.soak_settles_s,
        cold_degC=_OF_BAND * (limits.tolerance_degC if limits.soak_band_degC is None else limits.soak_band_degC),
        again_degC=controller.again_degC(words), forgets_degC=controller.forgets_degC(words),
        cooling_gain=cooling_gain, small_change_degC=_IN_BANDS * band_of(limits, resolution_degC))
    return story_for(models, loop, story, noise_degC=conditions.noise_degC, setpoint_degC=setpoint_degC)


def actuator_for(conditions: Conditions, words: Words) -> Actuator:
    """Return the switch behind the controller; without a PWM period, its own, or else TA in parts up to 10 s.

    Without a resolution its pulses are ticks of the target's clock, see `heatertune.plc.pwm.tick_for`.

    Raises:
        OutOfRange, UnknownName: as `switched_by`.
        InputError, OutOfRange: as `heatertune.plc.controller.with_cooler`.
    """
    return with_cooler(_heaters_switch(conditions, words), words, conditions.cooling_gain,
                       minimum_on_s=conditions.cooling_minimum_on_s, minimum_off_s=conditions.cooling_minimum_off_s)


def _heaters_switch(conditions: Conditions, words: Words) -> Actuator:
    controller, interval = controller_for(words.target), words.sample_time_s
    tick, (own, longest) = controller.tick_s, controller.own_pwm
    rule = conditions.pwm_rule or own
    period, resolution = conditions.pwm_period_s, conditions.pwm_resolution_s
    if period is None:
        period = controller.pwm_period_s or default_pwm_period_s(interval, tick_s=tick, most_s=longest)
        return switched_by(rule, pwm_period_s=period, resolution_s=tick_for(
            tick, sample_time_s=interval, pwm_period_s=period))
    if resolution is None:
        resolution = tick_for(tick, sample_time_s=interval, pwm_period_s=period)
    return switched_by(
        rule, pwm_period_s=period, minimum_on_s=conditions.minimum_on_s,
        minimum_off_s=conditions.minimum_off_s, resolution_s=resolution)


def tune_settings_for(tuned: TuneSettings, conditions: Conditions) -> TuneSettings:
    """Return what a design is asked for with the specification's limits on Ms and on the power of one sensor step."""
    limits = specification_of(conditions).limits_for(1.0)
    ms, step_power = (math.inf if limit is None else limit for limit in (limits.ms, limits.step_power_pct))
    own = math.inf if tuned.step_power_pct is None else tuned.step_power_pct
    return replace(tuned, ms=min(tuned.ms, ms), step_power_pct=min(own, step_power))


def aim_sentences(settings: TuneSettings, tuned: TuneSettings) -> tuple[str, ...]:
    """Return the sentence that the design aims at a smaller Ms than it was asked for, where it does."""
    if tuned.ms < settings.ms:
        return (f"Ms <= {tuned.ms:g} instead of {settings.ms:g}, as the specification requires.",)
    return ()


def limits_of(specification: Specification, models: Sequence[HeaterModel]) -> LoopLimits:
    """Return what a loop with any of these heaters must keep."""
    return specification.limits_for(max(sum(model.lags_s) + model.dead_time_s for model in models))


def default_pwm_period_s(sample_time_s: float, *, tick_s: float | None, most_s: float = 10.0) -> float:
    """Return TA, or the largest part of it up to the most: each sample then holds whole PWM periods [s].

    Args:
        sample_time_s: TA [s].
        tick_s: `Controller.tick_s`: the period is whole ticks, where one above half of the most is; None: any.
        most_s: the most.
    """
    parts = max(1, math.ceil(sample_time_s / most_s))
    periods = (sample_time_s / more for more in range(parts, 2 * parts + 1))
    return next((period for period in periods if in_ticks(period, tick_s)), sample_time_s / parts)


def _interlock(conditions: Conditions, words: Words) -> Interlock | None:
    if conditions.interlock is None:
        return None
    limit, scale = conditions.limit_degC, words.scaling
    if limit is None:
        if has_ends(controller_for(words.target).ranges, scale.input):
            raise InputError(f"--interlock with --input {scale.input} needs --limit-temperature: the module's readings "
                             f"go up to {scale.high_degC:g} °C")
        limit = scale.high_degC
    return Interlock(name=conditions.interlock, limit_degC=limit, fan_stops_s=conditions.fan_stops_s)


def _remarks(
    words: Words, fitted: FittedModel, conditions: Conditions, setpoints_degC: Sequence[float],
) -> Iterator[str]:
    """Return what stands on the verdict's line beside the findings of the fit."""
    if fitted.outcome is FitOutcome.BY_HAND:
        yield "the model was entered by its numbers"
    if range_is_unknown(fitted, setpoints_degC):
        yield "the model does not contain the logged range (fit the log again)"
    if (delay := controller_for(words.target).delayed_s(words.scaling)) > 0.0:
        on_board = words.target in (*GROUPS["printer"], *GROUPS["maker"])  # a thermistor and a pin, no module
        yield f"dead time {delay:g} s longer, for the {'sensor reading and the output' if on_board else 'input module'}"
    if (cooling := controller_for(words.target).cooling) is not None:
        is_stated = conditions.cooling_gain is not None
        gain = f"{conditions.cooling_gain if is_stated else cooling.gain(words):g} times that of the heater"
        yield f"the power of the cooler was {'entered as' if is_stated else 'taken from the parameters,'} {gain}"
    if words.sample_time_s < fitted.log_interval_s:
        yield f"TA {words.sample_time_s:g} s is below the log's interval of {fitted.log_interval_s:g} s"


_MOST: Final = 10.0  # strain of a limit that is broken without end
#: share of a limit: broken is not kept, by however little
NOTICEABLE: Final = 1e-9


class WorstRuns(NamedTuple):
    """What words break in runs.

    Attributes:
        badness: by how much, as shares of the limits: the sum over the criteria, of the worst run; 0: they keep all.
            What is broken without end counts as tenfold.
        names: of the criteria.
    """

    badness: float
    names: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScreen:
    """Runs that were failed.

    Attributes:
        fitted: the heater and its candidates.
        runs: the hardest first.
        nights: name of another open circuit → runs with it.
        names: of the criteria that count; None: all.
        night_times: how many times as long as in a proof the longest open circuit lasts.
    """

    fitted_model: FittedModel
    runs: tuple[Run, ...] = ()
    nights: Mapping[str, tuple[Run, ...]] = field(default_factory=dict)
    names: frozenset[str] | None = None
    night_times: float = 1.0

    def with_failed(self, proof: Proof) -> RunScreen:
        """Return it with the worst run of each criterion that a proof breaks, before what is there."""
        broken = sorted(self._broken(proof), key=lambda criterion: -criterion.strain)
        runs = {run.label: run.run for run in proof.runs}
        worst = dict.fromkeys(criterion.where for criterion in broken)
        new = [runs[label] for label in worst if label in runs and runs[label] not in self.runs]
        return replace(self, runs=(*new, *self.runs))

    def with_nights(self, proofs: Iterable[Proof]) -> RunScreen:
        """Return it with the runs that proofs make of the open circuits after which they break a limit, too."""
        hardest = dict(self.nights)
        for name, proof in ((name, each) for each in proofs for name in wound(each.diagnostics)):
            runs = hardest.get(name, ())
            hardest[name] = (*runs, *(run for run in proof.nights[name] if run not in runs))
        return replace(self, nights={name: hardest[name] for name in sorted(hardest)})

    def with_shorter_outages(self) -> RunScreen:
        """Return it with shorter open circuits in its hardest run, for a search whose whole proofs are dear."""
        return replace(self, nights={**self.nights, BRIEF: self.runs[:1]})

    def look(self, words: Words, conditions: Conditions, *, bound: float = math.inf) -> WorstRuns:
        """Return what words break in these runs and nights.

        Args:
            words: to look at.
            conditions: of the proof.
            bound: from here on any badness is as good as another: the hardest run may do.

        Raises:
            InputError, OutOfRange, UnknownName: as `prove`.
        """
        badness, names = 0.0, frozenset[str]()
        for broken in self._looks(words, conditions, at_once=math.isinf(bound)):
            badness = max(badness, *(sum(map(_beyond, criteria)) for criteria in broken))
            names |= {criterion.name for criteria in broken for criterion in criteria}
            if badness >= bound:
                break
        return WorstRuns(badness, names)

    def _looks(self, words: Words, conditions: Conditions, *, at_once: bool) -> Iterator[list[list[Criterion]]]:
        """Yield what runs break, the hardest first where not all are made at once, the nights last."""
        for runs in filter(None, (self.runs,) if at_once else (self.runs[:1], self.runs[1:])):
            yield [self._broken(run) for run in prove(words, self.fitted_model, conditions, only=runs).runs]
        if self.nights:
            yield [self._broken(run, of) for of, run in self._nights(words, conditions)]

    def badness(self, words: Words, conditions: Conditions) -> float:
        """Return by how much words break the limits in these runs, see `WorstRuns`; errors as `look`."""
        return self.look(words, conditions).badness

    def keeps(self, words: Words, conditions: Conditions) -> bool:
        """Return whether words keep the limits in these runs; errors as `look`."""
        return self.look(words, conditions, bound=NOTICEABLE).badness == 0.0

    def settles(self, words: Words, conditions: Conditions) -> float | None:
        """Return when the worst of these runs and nights has settled [s], None where one breaks a limit.

        Errors as `look`.
        """
        last = 0.0
        for some in filter(None, (self.runs[:1], self.runs[1:])):
            runs = prove(words, self.fitted_model, conditions, only=some).runs
            if any(map(self._broken, runs)):
                return None
            last = max(last, *(each.value for run in runs for each in run.criteria if each.name == "settling_time"))
        return None if self.wound(words, conditions) else last

    def wound(self, words: Words, conditions: Conditions) -> list[Criterion]:
        """Return the criteria that words break in the nights; errors as `look`."""
        return [each for of, run in self._nights(words, conditions) for each in self._broken(run, of)]

    def _nights(self, words: Words, conditions: Conditions) -> Iterator[tuple[frozenset[str], RunResult]]:
        """Yield the runs of the nights, each with the names of the criteria that count in it."""
        for night, runs in self.nights.items():
            for run in prove(words, self.fitted_model, conditions, only=runs, night=night,
                             night_times=self.night_times).runs:
                yield frozenset(JUDGED[night]), run

    def _broken(self, proof: Proof | RunResult, of: frozenset[str] | None = None) -> list[Criterion]:
        return [criterion for criterion in proof.criteria
                if not criterion.ok and all(names is None or criterion.name in names for names in (self.names, of))]


def _beyond(criterion: Criterion) -> float:
    return max(NOTICEABLE, min(criterion.strain, _MOST) - 1.0)

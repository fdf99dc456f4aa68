"""The design closed on the verdict: where the plain optimum fails, the least that makes it pass, and its price.

A boost is full power far from the setpoint, so that nothing winds up on the way, nor in an open circuit. The gains
stay, and with them what a disturbance costs; so where a boost keeps every limit, no other change is cheaper. Gains
beside the optimum lie on the bound of Ms or a tighter one, with another TN; they are tried by what they cost.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Final

from heatertune.errors import HeatertuneError, InputError
from heatertune.model.loss_curve import for_setpoints
from heatertune.model.model_values import FittedModel
from heatertune.model.reduction import cools, mirror_heater
from heatertune.pid.design_values import PidDesign
from heatertune.pid.search.feasible import Problem, keeps, largest_gain, search
from heatertune.pid.tune import assessed_sampled
from heatertune.plc import Boost, Scaling, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.design import encode, loop_fit
from heatertune.plc.word_selection import choose_words
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof
from heatertune.proof.design_request import Candidate, DesignRequest, DesignResult, plainly
from heatertune.proof.long_outage import briefly, sums_up, winds_up
from heatertune.proof.nearest_specification import setting_sentences
from heatertune.proof.prove_words import NOTICEABLE, RunScreen, WorstRuns, every_setpoint, tune_settings_for
from heatertune.proof.redesign.design_changes import (
    DEAR,
    OF_WINDUP,
    DesignChange,
    broken,
    change_sentence,
    default_changes,
    design_changes,
    gain_factors_text,
    more_iae,
    output_limits,
    shorter_intervals,
    unwinds,
)
from heatertune.proof.redesign.suggestion import Suggestion, pass_sentence
from heatertune.proof.runs import MOST_SCANS, SearchBudget, judge_once
from heatertune.proof.setpoint_ramp import BY_RAMP, boosts, slow_ramps
from heatertune.proof.text_comparison import as_exported
from heatertune.settings import TuneSettings

__all__ = ["GainFamily", "GainPoint", "GainSearch", "RedesignSearch", "closed_on_runs", "find_passing_design"]


#: shares of the way from Ms = 1 to the limit → times the optimum's TN, of the places that are tried first
_GRID: Final = {1.0: (0.7, 1.4, 2.0, 3.0, 5.0), 0.7: (0.7, 1.0, 1.4, 2.0, 3.0), 0.4: (1.0, 1.5, 2.5)}
_LEAST_SHARE: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class GainPoint:
    """Where gains stand beside the optimum, whose place is (limit, 1).

    Attributes:
        ms: bound on which K stands.
        factor: of TN.
    """

    ms: float
    factor: float

    def towards(self, point: GainPoint, share: float) -> GainPoint:
        """Return the place a share of the way to another one."""
        return GainPoint(ms=self.ms + share * (point.ms - self.ms),
                     factor=self.factor * (point.factor / self.factor) ** share)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainFamily:
    """Designs on the bounds of Ms.

    Attributes:
        problem: whose limits they keep, but for a tighter Ms; of a cooler its mirror image's.
        optimum: of it.
        cooler: whether the designs are a cooler's, the same with K below zero.
    """

    problem: Problem
    optimum: PidDesign
    cooler: bool = False
    _known: dict[GainPoint, PidDesign | None] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    @lru_cache(maxsize=16)  # many changes that a search tries have the same gains
    def of(
        cls, ideal: PidDesign, fitted: FittedModel, tuned: TuneSettings, target: str, scaling: Scaling
    ) -> GainFamily:
        """Return the family of a design that is an optimum; of another one, where TA, Ms or parts are asked otherwise.

        Args:
            ideal: the design.
            fitted: the heater and its candidates.
            tuned: how it was found.
            target: the controller.
            scaling: sensor range.

        Raises:
            InputError: no gains keep the limits.
        """
        its, cooler = controller_for(target), cools(fitted)
        fitted = loop_fit(fitted, target, scaling)
        if cooler:
            fitted, ideal = mirror_heater(fitted), _turned(ideal)
        problem = Problem(
            plants=fitted.plants, structure=tuned.structure, ms=tuned.ms, mt=tuned.mt, mks=tuned.mks,
            sample_time_s=tuned.sample_time_s or ideal.sample_time_s, derivative_filter=ideal.derivative_filter,
            objective=tuned.objective, weight=tuned.weight, step_power=ideal.step_power_limit_pct_per_degC)
        if its.most_gain is not None:
            problem = replace(problem, most_gain=partial(its.most_gain, scaling))
        same = (ideal.structure, ideal.sample_time_s) == (problem.structure, problem.sample_time_s)
        optimum = ideal if same and keeps(problem, ideal) else search(problem)
        return cls(problem=problem, optimum=optimum, cooler=cooler)

    @property
    def place(self) -> GainPoint:
        """Where the optimum stands."""
        return GainPoint(ms=self.problem.ms, factor=1.0)

    def places(self) -> list[GainPoint]:
        """Return places all around, the one whose load disturbances cost the least first, without the optimum's."""
        around = [self._place(share, factor) for share, factors in _GRID.items() for factor in factors]
        return sorted(around, key=self._price)

    def near(self, place: GainPoint, step: float) -> list[GainPoint]:
        """Return the places a step away: a share of the way of Ms, and a factor exp(2·step) of TN."""
        share = (place.ms - 1.0) / (self.problem.ms - 1.0)
        steps = ((0.0, 2.0), (0.0, -2.0), (1.0, 0.0), (-1.0, 0.0))
        around = {self._place(min(1.0, max(_LEAST_SHARE, share + up * step)), place.factor * math.exp(along * step))
                  for up, along in steps}
        return sorted(around - {place}, key=self._price)

    def _place(self, share: float, factor: float) -> GainPoint:
        return GainPoint(ms=1.0 + share * (self.problem.ms - 1.0), factor=factor)

    def _price(self, place: GainPoint) -> float:
        design = self._upright(place)
        return math.inf if design is None else self.problem.least_cost(design)

    def at(self, place: GainPoint) -> PidDesign | None:
        """Return the design at a place, None where no gain keeps the limits."""
        design = self._upright(place)
        return design if design is None or not self.cooler else _turned(design)

    def _upright(self, place: GainPoint) -> PidDesign | None:
        if place not in self._known:
            self._known[place] = self.optimum if place == self.place else self._on_the_bound(place)
        return self._known[place]

    def _on_the_bound(self, place: GainPoint) -> PidDesign | None:
        tn, tv = place.factor * self.optimum.integral_time_s, self.optimum.derivative_time_s
        problem = replace(self.problem, ms=place.ms)
        gains = largest_gain(problem, tn, tv)
        if not gains:
            return None
        return replace(problem.design(gains[0], tn, tv), method=f"Ms <= {place.ms:.4g} at TN = {tn:.4g} s")


def _turned(design: PidDesign) -> PidDesign:
    """Return the design for the mirror image."""
    return replace(design, gain_pct_per_degC=-design.gain_pct_per_degC)


_CHEAPER: Final = 0.8  # of the price of the first that passes: what saves less is not worth its changes
_SOONER: Final = 1 / 16  # of TA: what two levels swing by hangs on the dead time alone then
_HELPS: Final = 0.9  # of the least badness so far: where a change leaves more, no gains are looked for around it
_STEPS: Final = (0.24, 0.12, 0.06, 0.03)  # around the best place of a frame
_MOST_PROOFS: Final = 3  # whole proofs in a frame
_DEAR_PROOF: Final = 0.1  # of the budget of a search; one that passes takes several times what one takes that fails
_SLOWER: Final = (1.0, 1.4, 2.0, 3.0)  # times the optimum's TN, with a slow setpoint ramp
_HALVINGS: Final = 3  # of the way from the optimum to gains that pass


def find_passing_design(fitted: FittedModel, request: DesignRequest, *, progress: ProgressCallback = str,
                        stage: ProgressCallback = str) -> DesignResult:
    """Return the first design that keeps every limit: as asked for, or changed by as little as will do.

    A boost first, then other gains on the bound of Ms or a tighter one, another PWM period, another TA, at last a
    setpoint ramp; what swings gets another PWM first. Where all that passes winds up the more, the longer a circuit is
    open, a boost with other gains. The limits are never moved, Ms is only lowered, and what the user gave stays. Where
    nothing helps, or it is asked for, it is the plain design, or what winds up, its proof saying what would pass.
    Arguments as `plainly`.

    Raises:
        HeatertuneError: as the stages on the plain design.
    """
    result = closed_on_runs(fitted, request, progress=progress, stage=stage)
    return replace(result, proof=as_exported(result.proof))


@judge_once()
def closed_on_runs(
    fitted: FittedModel, request: DesignRequest, *, ways_on: bool = True, freeing: bool = True,
    verdict_only: bool = False, progress: ProgressCallback = str, stage: ProgressCallback = str,
) -> DesignResult:
    """Return what `closed` does before the exported text is run: for who does so a little later, with `as_exported`.

    Args:
        fitted: as `closed`.
        request: likewise.
        ways_on: whether what else would pass is looked for, too.
        freeing: whether that may leave open what is fixed of the design; not where the search itself has fixed it.
        verdict_only: whether only the verdict counts: of what winds up nothing else that would pass is looked for.
        progress: likewise.
        stage: likewise.
    """
    fitted = for_setpoints(fitted, every_setpoint(fitted, request.conditions))
    still = request if request.as_is else replace(request, setpoint_ramp=request.setpoint_ramp or "none")
    with SearchBudget(scans=math.inf) as plain:
        first = plainly(fitted, still, text=False, progress=progress, stage=stage)
    dear = plain.used > _DEAR_PROOF * MOST_SCANS
    keeps_all = first.proof.verdict != "FAIL" and not (first.proof.design and winds_up(first.proof.diagnostics))
    if keeps_all or request.as_is:
        return first
    search = RedesignSearch(
        fitted_model=fitted, request=request, first=first, progress=progress, freeing=freeing, has_dear_proofs=dear,
        verdict_only=verdict_only)
    mended = search.cheapest() if first.proof.design else search.sooner(ways_on=ways_on)
    if not ways_on:
        return mended or first
    if mended is None:
        return search.way_on.with_suggestion(search.budget.message if search.budget.spent else "")
    return replace(mended, notes=(*mended.notes, *search.hints(mended)))


@dataclass(slots=True, kw_only=True)
class GainSearch:
    """The search for gains within a frame.

    Raises:
        InputError: no gains keep the limits.
    """

    search: RedesignSearch
    frame: DesignChange
    request: DesignRequest = field(init=False)
    family: GainFamily = field(init=False)
    proofs: int = 0

    def __post_init__(self) -> None:
        self.request = request = self.search.request_within(self.frame)
        self.family = GainFamily.of(
            self.search.first.ideal, self.search.fitted_model,
            tune_settings_for(request.tune_settings, request.conditions), request.target, request.scaling or Scaling())

    def cheapest(self) -> DesignResult | None:
        """Return the cheapest that passes; None where none does, or where the frame helps too little to look on."""
        search, family = self.search, self.family
        changed = self.frame != DesignChange()
        places = [family.place, *([search.place] if search.place else [])] if changed else family.places()
        looks = [] if changed or search.best else [(WorstRuns(search.least), family.place)]
        for place in places:
            looks.append((self.look(place, search.least), place))
            if looks[-1][0].badness == 0.0 and (mended := self.best_passing(place)):
                return mended
        look, place = min(looks, key=lambda pair: pair[0].badness)
        in_vain = changed and (look.badness > _HELPS * search.least or search.needs_a_later_change(look, self.frame))
        return self.nearby((look.badness, place), () if in_vain else _STEPS)

    def nearby(self, best: tuple[float, GainPoint], steps: Sequence[float]) -> DesignResult | None:
        """Return what passes in ever smaller steps from the best place so far; if nothing does, what is best stays."""
        for step in steps:
            screen = self.search.screen
            for place in self.family.near(best[1], step):
                bad = self.badness(place, bound=best[0])
                if bad == 0.0 and (mended := self.best_passing(place)):
                    return mended
                best = min(best, (bad, place), key=lambda pair: pair[0])
            if self.search.screen is not screen:
                best = self.badness(best[1]), best[1]
        if best[0] < self.search.least:
            if self.search.best is None:
                self.search.calmer = self.frame
            self.search.least, self.search.place, self.search.best = *best, self
        return None

    def badness(self, place: GainPoint, *, bound: float = math.inf) -> float:
        """Return by how much the words at a place break the limits in the runs that others have failed."""
        return self.look(place, bound).badness

    def look(self, place: GainPoint, bound: float = math.inf, screen: RunScreen | None = None) -> WorstRuns:
        """Return what the words at a place break in the runs that others have failed (None), or in others."""
        design, request = self.family.at(place), self.request
        if design is None:
            return WorstRuns(math.inf)
        try:
            words = encode(design, request.target, scaling=request.scaling)
            words = self.frame.on(with_cooling(words, request.conditions.cooling_gain))
            return (screen or self.search.screen).look(words, request.conditions, bound=bound)
        except HeatertuneError as problem:
            self.search.way_on.left_out(self.search.summary(self.frame), problem)
            return WorstRuns(math.inf)

    def keeps(self, place: GainPoint, screen: RunScreen | None = None) -> bool:
        """Return whether they keep all of them."""
        return self.look(place, NOTICEABLE, screen).badness == 0.0

    def beside_a_ramp(self) -> Iterator[GainPoint]:
        """Return what to try with a ramp: the optimum, what helped so far, and what keeps all that no ramp mends."""
        search, optimum = self.search, self.family.place
        yield from dict.fromkeys((optimum, search.place or optimum))
        if unled := {*search.first.proof.broken_criteria} - BY_RAMP:
            screen = RunScreen(fitted_model=search.fitted_model, names=frozenset(unled)).with_failed(search.first.proof)
            point = next((place for place in self.family.places() if self.keeps(place, screen)), optimum)
            yield from dict.fromkeys((self.bisect(point, screen), point) if point != optimum else ())

    def bisect(self, place: GainPoint, screen: RunScreen | None = None) -> GainPoint:
        """Return what still keeps them nearest to the optimum on the way to a place that does."""
        failing, passing = self.family.place, place
        for _ in range(_HALVINGS if place != failing else 0):
            between = failing.towards(passing, 0.5)
            failing, passing = (failing, between) if self.keeps(between, screen) else (between, passing)
        return passing

    def best_passing(self, place: GainPoint) -> DesignResult | None:
        """Return what passes nearest to the optimum on the way to a place, None where the whole proof fails."""
        for simpler in self.frame.without_one():
            inside = GainSearch(search=self.search, frame=simpler)
            if inside.keeps(place) and (mended := inside.best_passing(place)):
                return mended
        if self.proofs >= _MOST_PROOFS:
            return None
        self.proofs += 1
        places = dict.fromkeys((self.bisect(place), place))
        tried = (self.search.prove_design(self.frame, self.candidate(near)) for near in places)
        return next((mended for mended in tried if mended is not None), None)

    def candidate(self, place: GainPoint) -> Candidate:
        """Return the design at a place and its words.

        Raises:
            InputError: no gain keeps the limits there.
            HeatertuneError: as `choose_words`.
        """
        design, request, fit, first = self.family.at(place), self.request, self.search.fitted_model, self.search.first
        if design is None:
            raise InputError("no gain keeps the limits")
        if design is first.ideal and not self.search.request.refined:
            return first.ideal, replace(first.choice, words=self.frame.on(first.choice.words))
        assessed = assessed_sampled(loop_fit(fit, request.target, request.scaling).plants, design)
        choice = choose_words(assessed, request.target, fit, scaling=request.scaling, way=request.words_by)
        return assessed, replace(choice, words=self.frame.on(choice.words))


@dataclass(slots=True, kw_only=True)
class RedesignSearch:
    """What may mend a design that fails; grows with what was tried.

    Attributes:
        screen: the runs that were failed.
        best: the frame of the least badness so far; None: what was asked for.
        place: of that least.
        least: it, in the runs that are known to be failed by now.
        calmer: the first frame that helped.
        way_on: what else would pass.
        dear: what keeps every limit, in the order in which it was found.
        wound: likewise, but for what else an open circuit leads to; with the change of each.
        budget: of the search for changes.
        freeing: as of `closed_on_runs`.
        verdict_only: likewise.
        has_dear_proofs: whether the budget holds a few whole proofs only.
    """

    fitted_model: FittedModel
    request: DesignRequest
    first: DesignResult
    progress: ProgressCallback
    freeing: bool = True
    verdict_only: bool = False
    has_dear_proofs: bool = False
    screen: RunScreen = field(init=False)
    best: GainSearch | None = None
    place: GainPoint | None = None
    least: float = field(init=False)
    calmer: DesignChange = field(default_factory=DesignChange)
    way_on: Suggestion = field(init=False)
    dear: list[DesignResult] = field(default_factory=list)
    wound: list[tuple[DesignChange, DesignResult]] = field(default_factory=list)
    budget: SearchBudget = field(default_factory=SearchBudget)

    def __post_init__(self) -> None:
        self.way_on = Suggestion(
            fitted_model=self.fitted_model, request=self.request, first=self.first, progress=self.progress,
            close=partial(closed_on_runs, ways_on=False, verdict_only=True), freeing=self.freeing)
        self.screen = RunScreen(fitted_model=self.fitted_model)
        self.watch_failed_runs(self.first.proof)
        if self.has_dear_proofs and self.screen.runs and self._windup_alone:
            self.screen = self.screen.with_shorter_outages()
        self.wound += [(DesignChange(), self.first)] if winds_up(self.first.proof.diagnostics) else []

    def watch_failed_runs(self, proof: Proof) -> None:
        """Watch the runs that a proof fails, too; what was best so far is held against them."""
        self.screen = self.screen.with_failed(proof)
        if briefly(proof.diagnostics):
            self.screen = self.screen.with_nights([proof])
        self.least = (self.screen.badness(self.first.choice.words, self.first.conditions)
                      if self.best is None or self.place is None else self.best.badness(self.place))

    def cheapest(self) -> DesignResult | None:
        """Return the first that passes and is not dear, else the least dear; None where nothing passes.

        What helps without passing stays for what follows. A search that is not done within its budget ends with the
        best so far, and says so.
        """
        more = partial(more_iae, self.first)
        with self.budget:
            for mended in () if sums_up(self.first.proof.diagnostics) else self._mended():
                self.dear.append(mended)
                if more(mended) <= DEAR:
                    return mended
            wound = tuple(self.wound)
            if not self.dear and (wound or self._windup_alone):
                result = (self.with_boost(wound) or (self.with_lower_output(wound) if wound else None)
                          or self.with_boost(wound, sooner=True) or (self.with_slow_ramp(wound) if wound else None))
                if result is not None:
                    return result
        if self.dear:
            best = min(self.dear, key=more)
            return self._ended(self.dear[0] if more(best) > _CHEAPER * more(self.dear[0]) else best)
        if not (wound_up := sorted((each for _, each in self.wound), key=more)):
            return None
        return self._ended(wound_up[0] if self.verdict_only else self.way_on.against_windup(wound_up))

    def _ended(self, result: DesignResult) -> DesignResult:
        """Return a design that says that the search ended early, where it did."""
        if not self.budget.spent:
            return result
        reason, notes = f"{self.budget.message}; this is the best so far", result.notes
        return replace(result, notes=(*notes, f"{reason[0].upper()}{reason[1:]}."), proof=result.proof.led_by(reason))

    def _mended(self) -> Iterator[DesignResult]:
        """Yield what keeps every limit of each frame, and does not wind up."""
        request, words = self.request, self.first.proof.words
        for frame in design_changes(
            self.first.proof, self.fitted_model.plants, request.tune_settings, ramp_open=request.setpoint_ramp is None,
            boost_open=self._boost_open,
            period_given=request.switch_kind is not None or request.conditions.pwm_period_s is not None,
            interval_given=self._interval_given,
            least_interval_s=min(self.fitted_model.log_interval_s, words.sample_time_s),
        ):
            mended = next(filter(None, map(self._changed, self._wholes(frame))), None)
            if mended is not None and not winds_up(mended.proof.diagnostics):
                yield mended

    @property
    def _interval_given(self) -> bool:
        """Whether the user chose TA: it stays."""
        return self.request.tune_settings.sample_time_s is not None or self.request.interval_by_words

    @property
    def _windup_alone(self) -> bool:
        """Whether the first design breaks only criteria that a windup breaks."""
        return OF_WINDUP.issuperset(self.first.proof.broken_criteria)

    @property
    def _boost_open(self) -> bool:
        """Whether there may be a boost."""
        return self.request.boost == "auto" and self.request.setpoint_ramp in (None, "none")

    def with_boost(
        self, wound: Sequence[tuple[DesignChange, DesignResult]], *, sooner: bool = False
    ) -> DesignResult | None:
        """Return the first design with a boost and other gains that passes; None: none does.

        The boost heats the heater up again before the I part winds up much; a slower I part winds up less until then.

        Args:
            wound: the designs that keep every limit but wind up; empty: none keeps every limit.
            sooner: whether at shorter intervals than the design's, even below the log's: the boost ends by up to an
                interval of full power too late.
        """
        can_boost = self._boost_open and self.by_optimum and controller_for(self.request.target).has_boost
        if not can_boost or (sooner and self._interval_given):
            return None
        why = "what passes winds up in a long open circuit" if wound else f"{broken(self.first)} fails"
        self.progress(f"{why}: trying a boost with other gains")
        self.screen = self.screen.with_nights(each.proof for _, each in wound)
        helped = DesignChange() if self.best is None else self.best.frame
        bases = (DesignChange(), replace(helped, ramp=None))
        for before in dict.fromkeys(shorter_intervals(self.first.proof.words) if sooner else bases):
            if (result := self._unwinding(before.with_(DesignChange(has_boost=True)))) is not None:
                return result
        return None

    def with_lower_output(self, wound: Sequence[tuple[DesignChange, DesignResult]]) -> DesignResult | None:
        """Return a lower output, else other gains, that pass where all else winds up, as `wound` does; None: none do.

        A design that a setpoint ramp leads is at last tried with what the user left at its default.

        What failed at first need not be a windup: then no limit of the output has been tried.
        """
        if not self.by_optimum:
            return None
        self.screen = self.screen.with_nights(each.proof for _, each in wound)
        limits = output_limits(self.first.proof, self.fitted_model.plants)
        found_in = [frame for frame, _ in wound if frame.power_most_pct is None]
        unled = dict.fromkeys((DesignChange(),
                               *(replace(frame, ramp=None, has_boost=False) for frame in found_in)))
        led = dict.fromkeys(frame for frame in found_in if frame not in unled)
        defaults = list(default_changes(self.first.proof, self.request.tune_settings))
        for whole in (*(before.with_(limit) for limit in limits for before in (*unled, *led)), *unled,
                      *(before.with_(change) for before in led for change in defaults)):
            self.progress(f"what passes winds up: trying {self.summary(whole) or 'other gains'}")
            if (result := self._unwinding(whole)) is not None:
                return result
        return None

    def with_slow_ramp(self, wound: Sequence[tuple[DesignChange, DesignResult]]) -> DesignResult | None:
        """Return a design that passes with a setpoint ramp slower than the test sequence needs; None: none does.

        A short open circuit or a restart leads to an overshoot that a slow ramp with a short holdback prevents: the
        setpoint then waits near the reading. A larger TN adds up less meanwhile.

        Args:
            wound: as for `with_boost`.
        """
        if not self.by_optimum or self.request.setpoint_ramp or not controller_for(self.request.target).has_ramp:
            return None
        self.screen = self.screen.with_nights(each.proof for _, each in wound)
        led = DesignChange(ramp="slow")
        frames = dict.fromkeys(replace(before, ramp=None, has_boost=False).with_(led) for before, _ in wound)
        for frame in frames:
            self.progress(f"what passes winds up: trying {self.summary(frame)}")
            for trial in self._slow_ramps(frame, wound[0][1].proof):
                mended = self.prove_design(frame, trial)
                if mended is not None and not winds_up(mended.proof.diagnostics):
                    return mended
        return None

    def _slow_ramps(self, frame: DesignChange, proof: Proof) -> Iterator[Candidate]:
        """Yield designs that keep every limit in the runs that were failed, with slow ramps and ever larger TN."""
        try:
            inside = GainSearch(search=self, frame=frame)
        except HeatertuneError:
            return
        for factor in _SLOWER:
            try:
                assessed, choice = inside.candidate(replace(inside.family.place, factor=factor))
            except HeatertuneError:
                continue
            for words in slow_ramps(replace(proof, words=choice.words), self.fitted_model):
                if self.screen.keeps(words, inside.request.conditions):
                    yield assessed, replace(choice, words=words)

    def _unwinding(self, frame: DesignChange) -> DesignResult | None:
        """Return the cheapest gains that pass within a frame and do not wind up; None where none do."""
        try:
            inside = GainSearch(search=self, frame=frame)
        except HeatertuneError:
            return None
        ramped = frame.ramp == "fastest"
        for place in inside.beside_a_ramp() if ramped else iter((inside.family.place, *inside.family.places())):
            if not (frame.has_boost or ramped or inside.keeps(place)):
                continue
            try:
                mended = self.try_design(frame, inside.candidate(place))
            except HeatertuneError:
                continue
            if mended is not None and not winds_up(mended.proof.diagnostics):
                return mended
        return None

    def sooner(self, *, ways_on: bool) -> DesignResult | None:
        """Return a control without gains that passes as it scans more often; else None."""
        if self.request.tune_settings.sample_time_s is not None:
            return None
        timer = controller_for(self.request.target).timer
        frame = DesignChange(sample_time_s=timer.round(_SOONER * self.first.ideal.sample_time_s))
        self.way_on.sooner = scanned = closed_on_runs(
            self.fitted_model, self.request_within(frame), ways_on=ways_on, freeing=False, progress=self.progress)
        return None if scanned.proof.verdict == "FAIL" else self.prove_design(frame, (scanned.ideal, scanned.choice))

    def _wholes(self, frame: DesignChange) -> Iterator[DesignChange]:
        """Return a change with what has helped so far.

        Bursts are tried without, and gains where they come last; a led setpoint without, too, as it may need no help.
        """
        helped = DesignChange() if self.best is None else self.best.frame
        if frame.bursts_s or (frame == DesignChange() and self._windup_alone):
            yield frame
        elif frame.ramp == "fastest" or frame.has_boost:
            yield from dict.fromkeys(before.with_(frame) for before in (DesignChange(), self.calmer, helped))
        else:
            yield helped.with_(frame)

    def _changed(self, whole: DesignChange) -> DesignResult | None:
        self.progress(f"{broken(self.first)} fails: trying {self.summary(whole) or 'other gains'}")
        return self.within(whole)

    def summary(self, frame: DesignChange) -> str:
        """Return the changes of a frame for a reader, empty where there are none."""
        return frame.summary(frame.sample_time_s or self.first.ideal.sample_time_s, self.tick_s)

    def hints(self, mended: DesignResult) -> Iterator[str]:
        """Yield what to say beside a design that passes: what was not tried, which open point it is the price of."""
        yield from self.way_on.untried
        if mended.passes_with:
            return
        hanging = setting_sentences(self.first.proof, "the optimum")
        yield from hanging
        if not hanging and more_iae(self.first, mended) > DEAR and (sentence := self._cheaper_setting(mended)):
            yield f"It {sentence}."

    def _cheaper_setting(self, mended: DesignResult) -> str:
        """Return what is told of a setting of an open point with which a cheaper design passes; "" where none does."""
        more = partial(more_iae, self.first)
        wound = min((result for _, result in self.wound), key=more, default=None)
        with SearchBudget():
            for result in filter(None, (self.first, wound)):
                alternative = self.way_on.with_settings(result)
                if alternative is not None and more(alternative[0]) <= _CHEAPER * more(mended):
                    return pass_sentence(*alternative)
        return ""

    def within(self, frame: DesignChange) -> DesignResult | None:
        """Return the cheapest gains that pass within a frame; None where none do."""
        if not self.by_optimum:
            return self.try_design(frame, (self.first.ideal, self.first.choice)) if frame.only_outside else None
        try:
            inside = GainSearch(search=self, frame=frame)
        except HeatertuneError:
            return None
        if not (frame.ramp == "fastest" or frame.has_boost):
            return inside.cheapest()
        tried = (self.try_design(frame, inside.candidate(place)) for place in inside.beside_a_ramp())
        return next((mended for mended in tried if mended is not None), None)

    def needs_a_later_change(self, look: WorstRuns, frame: DesignChange) -> bool:
        """Return whether what a frame leaves broken is a windup that no gains mend so well as a change to come."""
        ramp_open = self.request.setpoint_ramp is None
        return bool(look.names) and look.names <= OF_WINDUP and unwinds(self.request.target, frame, ramp_open=ramp_open)

    @property
    def tick_s(self) -> float | None:
        """Of the target's clock, see `Controller.tick_s` [s]."""
        return controller_for(self.request.target).tick_s

    @property
    def by_optimum(self) -> bool:
        """Whether the design is an optimum with an I part: other gains are not looked for otherwise."""
        return self.first.ideal.method.startswith("optimum") and math.isfinite(self.first.ideal.integral_time_s)

    def request_within(self, frame: DesignChange) -> DesignRequest:
        """Return what is asked for within a frame."""
        return frame.apply_to(self.request, self.first, self.tick_s)

    def try_design(self, frame: DesignChange, trial: Candidate) -> DesignResult | None:
        """Return a design with its price where it passes, with the first boost that does where the frame has one."""
        variants: Iterable[Boost | None] = (
            boosts(trial[1].words, self.screen, self.request_within(frame).conditions) if frame.has_boost else [None])
        tried = (self.prove_design(frame, trial, boost) for boost in variants)
        return next((mended for mended in tried if mended is not None), None)

    def prove_design(self, frame: DesignChange, trial: Candidate, boost: Boost | None = None) -> DesignResult | None:
        """Return a design with its price where it passes; else the runs that it fails are watched."""
        request, by = self.request_within(frame), trial[1]
        trial = trial[0], replace(by, words=by.words.with_boost(boost))
        plain = self.first.proof if request.conditions == self.first.conditions else None
        try:
            case = plainly(self.fitted_model, request, candidate=trial, plain=plain, text=False, progress=self.progress)
        except HeatertuneError as problem:
            self.way_on.left_out(self.summary(frame), problem)
            return None
        if case.proof.verdict == "FAIL":
            self.watch_failed_runs(case.proof)
            return None
        text = "" if (hold := case.proof.hold_degC) is None else f"a holdback of {hold:.3g} °C"
        gains = gain_factors_text(self.first.ideal, trial[0]) if case.proof.design else ""
        what = " and ".join(filter(None, (gains, self.summary(frame), text))) + ("" if boost is None else f" ({boost})")
        diagnostics = case.proof.diagnostics
        proof = replace(case.proof, diagnostics=replace(diagnostics, remarks=(*diagnostics.remarks, f"with {what}")))
        recipe = replace(case.recipe, power_most_pct=frame.power_most_pct, window_degC=frame.window_degC,
                         refined=self.request.refined and by is self.first.choice)
        mended = replace(case, proof=proof, recipe=recipe,
                         notes=(change_sentence(self.first, case, what), *case.notes))
        if winds_up(diagnostics):
            self.wound.append((frame, mended))
        if not briefly(diagnostics):
            return mended
        self.watch_failed_runs(case.proof)
        return None

"""The design closed on the verdict: where the plain optimum fails, the least that makes it pass, and its price."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from heatertune.errors import HeatertuneError
from heatertune.model.values import FittedModel
from heatertune.plc import Boost, controller_for
from heatertune.progress import ProgressCallback
from heatertune.proof import Proof, redesign_cost
from heatertune.proof.design_request import Candidate, DesignRequest, DesignResult, plainly
from heatertune.proof.long_outage import briefly, sums_up, winds_up
from heatertune.proof.nearest_specification import broken_names, settings_told
from heatertune.proof.redesign.boosts import boosts
from heatertune.proof.redesign.design_changes import (
    OF_WINDUP,
    DesignChange,
    default_changes,
    design_changes,
    output_limits,
    unwinds,
)
from heatertune.proof.redesign.gain_points import GainPoint
from heatertune.proof.redesign.gain_search import GainSearch
from heatertune.proof.redesign.suggestion import Suggestion, passing_told
from heatertune.proof.runs import judged_once
from heatertune.proof.search_budget import SearchBudget
from heatertune.proof.text_comparison import as_exported
from heatertune.proof.worst_runs import RunScreen, WorstRuns

__all__ = ["RedesignSearch", "closed_on_runs", "find_passing_design"]

_DEAR: Final = 0.3  # more IAE of load disturbances: then another change may be the cheaper one
_CHEAPER: Final = 0.8  # of the price of the first that passes: what saves less is not worth its changes
_SOONER: Final = 1 / 16  # of TA: what two levels swing by hangs on the dead time alone then


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
    found = closed_on_runs(fitted, request, progress=progress, stage=stage)
    return replace(found, proof=as_exported(found.proof))


@judged_once()
def closed_on_runs(
    fitted: FittedModel, request: DesignRequest, *, ways_on: bool = True, freeing: bool = True,
    verdict_only: bool = False,
    progress: ProgressCallback = str, stage: ProgressCallback = str,
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
    still = request if request.as_is else replace(request, setpoint_ramp=request.setpoint_ramp or "none")
    first = plainly(fitted, still, text=False, progress=progress, stage=stage)
    if request.as_is or (first.proof.verdict != "FAIL"
                         and not (first.proof.design and winds_up(first.proof.diagnostics))):
        return first
    search = RedesignSearch(
        fitted_model=fitted, request=request, first=first, progress=progress, freeing=freeing,
        verdict_only=verdict_only)
    mended = search.cheapest() if first.proof.design else search.sooner(ways_on=ways_on)
    if not ways_on:
        return mended or first
    if mended is None:
        return search.way_on.with_suggestion(search.budget.message if search.budget.spent else "")
    return replace(mended, notes=(*mended.notes, *search.hints(mended)))


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
    """

    fitted_model: FittedModel
    request: DesignRequest
    first: DesignResult
    progress: ProgressCallback
    freeing: bool = True
    verdict_only: bool = False
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
        more = partial(redesign_cost.more_iae, self.first)
        with self.budget:
            for mended in () if sums_up(self.first.proof.diagnostics) else self._mended():
                self.dear.append(mended)
                if more(mended) <= _DEAR:
                    return mended
            wound = tuple(self.wound)
            if wound and not self.dear and (found := self.unwound(wound) or self.calmed(wound)) is not None:
                return found
        if self.dear:
            best = min(self.dear, key=more)
            return self._ended(self.dear[0] if more(best) > _CHEAPER * more(self.dear[0]) else best)
        wound_up = sorted((each for _, each in self.wound), key=more)
        if not wound_up:
            return None
        return self._ended(wound_up[0] if self.verdict_only else self.way_on.unwound(wound_up))

    def _ended(self, found: DesignResult) -> DesignResult:
        """Return a design that says that the search ended early, where it did."""
        if not self.budget.spent:
            return found
        told, heard = f"{self.budget.message}; this is the best so far", found.proof.diagnostics
        return replace(found, notes=(*found.notes, f"{told[0].upper()}{told[1:]}."),
                       proof=replace(found.proof, diagnostics=replace(heard, remarks=(*heard.remarks, told))))

    def _mended(self) -> Iterator[DesignResult]:
        """Yield what keeps every limit of each frame, and does not wind up."""
        asked, words = self.request, self.first.proof.words
        for frame in design_changes(
            self.first.proof, self.fitted_model.plants, asked.tune_settings, ramp_open=asked.setpoint_ramp is None,
            boost_open=self._boost_open,
            period_given=asked.switch_kind is not None or asked.conditions.pwm_period_s is not None,
            interval_given=asked.tune_settings.sample_time_s is not None or asked.interval_by_words,
            least_interval_s=min(self.fitted_model.log_interval_s, words.sample_time_s),
        ):
            mended = next(filter(None, map(self._changed, self._wholes(frame))), None)
            if mended is not None and not winds_up(mended.proof.diagnostics):
                yield mended

    @property
    def _boost_open(self) -> bool:
        """Whether there may be a boost."""
        return self.request.boost == "auto" and self.request.setpoint_ramp in (None, "none")

    def unwound(self, wound: Sequence[tuple[DesignChange, DesignResult]]) -> DesignResult | None:
        """Return a boost, with other gains, that passes where all else winds up, as `wound` does; None: none does.

        It takes the heater back before much is wound up; a slower I part has less to wind up until then.
        """
        if not (self._boost_open and self.by_optimum and controller_for(self.request.target).has_boost):
            return None
        self.progress("what passes winds up in a long open circuit: trying a boost with other gains")
        self.screen = self.screen.with_nights(each.proof for _, each in wound)
        helped = DesignChange() if self.best is None else self.best.frame
        for before in dict.fromkeys((DesignChange(), replace(helped, has_ramp=False))):
            if (found := self._unwinding(before.with_(DesignChange(has_boost=True)))) is not None:
                return found
        return None

    def calmed(self, wound: Sequence[tuple[DesignChange, DesignResult]]) -> DesignResult | None:
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
                               *(replace(frame, has_ramp=False, has_boost=False) for frame in found_in)))
        led = dict.fromkeys(frame for frame in found_in if frame not in unled)
        defaults = list(default_changes(self.first.proof, self.request.tune_settings))
        for whole in (*(before.with_(limit) for limit in limits for before in (*unled, *led)), *unled,
                      *(before.with_(change) for before in led for change in defaults)):
            self.progress(f"what passes winds up: trying {self.summary(whole) or 'other gains'}")
            if (found := self._unwinding(whole)) is not None:
                return found
        return None

    def _unwinding(self, frame: DesignChange) -> DesignResult | None:
        """Return the cheapest gains that pass within a frame and do not wind up; None where none do."""
        try:
            inside = GainSearch(search=self, frame=frame)
        except HeatertuneError:
            return None
        places = inside.beside_a_ramp() if frame.has_ramp else iter((inside.family.place, *inside.family.places()))
        for place in places:
            if not (frame.has_boost or frame.has_ramp or inside.keeps(place)):
                continue
            try:
                mended = self.try_design(frame, inside.candidate(place))
            except HeatertuneError:
                continue
            if mended is not None and not winds_up(mended.proof.diagnostics):
                return mended
        return None

    def sooner(self, *, ways_on: bool) -> DesignResult | None:
        """Return a control without gains that passes as it scans more often; None where it does not, or must not."""
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
        if frame.bursts_s or (frame == DesignChange() and broken_names(self.first.proof) <= OF_WINDUP):
            yield frame
        elif frame.has_ramp or frame.has_boost:
            yield from dict.fromkeys(before.with_(frame) for before in (DesignChange(), self.calmer, helped))
        else:
            yield helped.with_(frame)

    def _changed(self, whole: DesignChange) -> DesignResult | None:
        self.progress(f"{redesign_cost.broken(self.first)} fails: trying {self.summary(whole) or 'other gains'}")
        return self.within(whole)

    def summary(self, frame: DesignChange) -> str:
        """Return the changes of a frame for a reader, empty where there are none."""
        return frame.summary(frame.sample_time_s or self.first.ideal.sample_time_s, self.tick_s)

    def hints(self, mended: DesignResult) -> Iterator[str]:
        """Yield what to say beside a design that passes: what was not tried, which open point it is the price of."""
        yield from self.way_on.untried
        if mended.passes_with:
            return
        hanging = settings_told(self.first.proof, "the optimum")
        yield from hanging
        if not hanging and redesign_cost.more_iae(self.first,
                                                  mended) > _DEAR and (told := self._cheaper_setting(mended)):
            yield f"It {told}."

    def _cheaper_setting(self, mended: DesignResult) -> str:
        """Return what is told of a setting of an open point with which a cheaper design passes; "" where none does."""
        more = partial(redesign_cost.more_iae, self.first)
        wound = min((found for _, found in self.wound), key=more, default=None)
        with SearchBudget():
            for found in filter(None, (self.first, wound)):
                known = self.way_on.with_settings(found)
                if known is not None and more(known[0]) <= _CHEAPER * more(mended):
                    return passing_told(*known)
        return ""

    def within(self, frame: DesignChange) -> DesignResult | None:
        """Return the cheapest gains that pass within a frame; None where none do."""
        if not self.by_optimum:
            return self.try_design(frame, (self.first.ideal, self.first.choice)) if frame.only_outside else None
        try:
            inside = GainSearch(search=self, frame=frame)
        except HeatertuneError:
            return None
        if not (frame.has_ramp or frame.has_boost):
            return inside.cheapest()
        tried = (self.try_design(frame, inside.candidate(place)) for place in inside.beside_a_ramp())
        return next((mended for mended in tried if mended is not None), None)

    def unwound_by_others(self, look: WorstRuns, frame: DesignChange) -> bool:
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

    def try_design(self, frame: DesignChange, made: Candidate) -> DesignResult | None:
        """Return a design with its price where it passes, with the first boost that does where the frame has one."""
        found: Iterable[Boost | None] = (
            boosts(made[1].words, self.screen, self.request_within(frame).conditions) if frame.has_boost else [None])
        tried = (self.prove_design(frame, made, boost) for boost in found)
        return next((mended for mended in tried if mended is not None), None)

    def prove_design(self, frame: DesignChange, made: Candidate, boost: Boost | None = None) -> DesignResult | None:
        """Return a design with its price where it passes; else the runs that it fails are watched."""
        asked, by = self.request_within(frame), made[1]
        made = made[0], replace(by, words=by.words.with_boost(boost))
        plain = self.first.proof if asked.conditions == self.first.conditions else None
        try:
            tried = plainly(self.fitted_model, asked, made=made, plain=plain, text=False, progress=self.progress)
        except HeatertuneError as problem:
            self.way_on.left_out(self.summary(frame), problem)
            return None
        if tried.proof.verdict == "FAIL":
            self.watch_failed_runs(tried.proof)
            return None
        held = "" if (hold := tried.proof.hold_degC) is None else f"a holdback of {hold:.3g} °C"
        gains = redesign_cost.gains_told(self.first.ideal, made[0]) if tried.proof.design else ""
        what = " and ".join(filter(None, (gains, self.summary(frame), held))) + ("" if boost is None else f" ({boost})")
        heard = tried.proof.diagnostics
        proof = replace(tried.proof, diagnostics=replace(heard, remarks=(*heard.remarks, f"with {what}")))
        refined = self.request.refined and by is self.first.choice
        recipe = replace(tried.recipe, power_most_pct=frame.power_most_pct, refined=refined)
        mended = replace(tried, proof=proof, recipe=recipe,
                         notes=(redesign_cost.change_sentence(self.first, tried, what), *tried.notes))
        if winds_up(heard):
            self.wound.append((frame, mended))
        if not briefly(heard):
            return mended
        self.watch_failed_runs(tried.proof)
        return None

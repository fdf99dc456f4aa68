"""Where nothing mends a design as it was asked for: the nearest question that would be answered with PASS.

Of a program with its source's faults that is the one repaired.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from heatertune.errors import HeatertuneError, NotRepresentable
from heatertune.model.findings import KINDS
from heatertune.model.model_values import FittedModel
from heatertune.model.power.disturbance_fit import COLDER
from heatertune.model.reduction import cools
from heatertune.plc import controller_for
from heatertune.plc.targets import REPAIRED
from heatertune.processors import ProgressCallback
from heatertune.proof.design_request import DesignRequest, DesignResult, plainly
from heatertune.proof.heaters import ROOM_DEGC
from heatertune.proof.long_outage import OF_RANGE, briefly, unmended, winds_up, wound
from heatertune.proof.nearest_specification import (
    both_that_pass,
    broken_limits_text,
    limits_above,
    loosen_conditions,
    options_of,
    passing_settings,
    physical_help,
    suspects,
    tolerance_that_passes,
    wider_limits_text,
    within_reach,
)
from heatertune.proof.proof import Proof
from heatertune.proof.prove_words import RunScreen
from heatertune.proof.redesign.design_changes import COARSE, DesignChange, broken, calmest_pwm
from heatertune.proof.runs import MOST_SCANS, SearchBudget
from heatertune.proof.scenario import NewSetpoint
from heatertune.proof.verdict import BREAKS_NONE, NOTHING_PASSES
from heatertune.settings import TuneSettings

__all__ = ["Suggestion", "free_request", "known_as", "pass_sentence", "pass_sentences"]

#: shares of the rise above ambient of lower setpoints that may be suggested
_LOWER: Final = (0.95, 0.9, 0.8)
#: of the range of use, down from its upper end, of smaller ones that may be suggested
_OF_RANGE: Final = (1.0, 0.5, 0.25)
_SSR: Final = "ssr"
_BY_ROOM: Final = ("the heaters whose room is no warmer than the log's lowest reading have a design that passes: state "
                   "the room's temperature (--ambient)")
_HOPELESS: Final = 1.2  # of the band: no open point is what it fails for


def known_as(request: DesignRequest, settings: Mapping[str, str]) -> tuple[DesignRequest, tuple[str, ...]]:
    """Return what is asked for where settings of open points are known, and the options that say so."""
    switches = {**request.conditions.switches, **settings}
    options = tuple(word for name, setting in settings.items() for word in ("--assume", f"{name}={setting}"))
    return replace(request, conditions=replace(request.conditions, switches=switches)), options


def free_request(request: DesignRequest) -> tuple[tuple[str, ...], DesignRequest]:
    """Return a request that leaves open what the user fixed of the design, and the options that say so.

    What the command line cannot take back by an option, a PWM period and a rule's closed-loop time, stays.

    Args:
        request: as it was.

    Returns:
        the options, none where nothing is fixed, and the request.
    """
    usual, tuned, options = TuneSettings(), request.tune_settings, list[str]()
    for name, flag in (("structure", "--structure"), ("method", "--method"), ("ms", "--ms")):
        if getattr(tuned, name) != getattr(usual, name) and tuned.closed_loop_s is None:
            tuned = replace(tuned, **{name: getattr(usual, name)})
            options += [flag, f"{getattr(usual, name)}"]
    if tuned.sample_time_s is not None or request.interval_by_words:
        tuned = replace(tuned, sample_time_s=None)
        options += ["--sample-time", "auto"]
    boost, ramp = request.boost, request.setpoint_ramp
    if boost == "none":
        boost = "auto"
        options += ["--boost", "auto"]
    if ramp not in (None, "auto") and controller_for(request.target).has_ramp:
        ramp = "auto"
        options += ["--setpoint-ramp", "auto"]
    return tuple(options), replace(
        request, tune_settings=tuned, boost=boost, setpoint_ramp=ramp, interval_by_words=False)


def pass_sentences(options: Sequence[str], changes: str = "") -> str:
    """Return what is told of options of known settings, and of `changes`, with which a design would pass."""
    return f"would pass with {' '.join(options)}{changes}: find out what this controller does"


def pass_sentence(result: DesignResult, options: Sequence[str]) -> str:
    """Return what is told of a design that passes with options of known settings."""
    return pass_sentences(options, f", {result.proof.diagnostics.remarks[-1]}" if result.notes else "")


@dataclass(slots=True, kw_only=True)
class Suggestion:
    """What else could be asked for: first another design, then a setting to find out or a condition, a limit last.

    Attributes:
        fitted: the heater and its candidates.
        asked: what for.
        first: the plain design, which fails or winds up.
        progress: called with what is tried.
        close: `heatertune.proof.redesign.redesign_search.closed_on_runs` without ways on.
        freeing: whether what is fixed of the design may be left open.
        sooner: a control without gains that scans more often, where it was tried.
        untried: what could not be tried, and why, each once.
        unproven: options of the first request whose design keeps every limit, yet has a finding that blocks.
    """

    fitted_model: FittedModel
    request: DesignRequest
    first: DesignResult
    progress: ProgressCallback
    close: Callable[..., DesignResult]
    freeing: bool = True
    sooner: DesignResult | None = None
    untried: dict[str, None] = field(default_factory=dict)
    unproven: tuple[str, ...] = ()

    def left_out(self, changes: str, problem: HeatertuneError) -> None:
        """Keep why some changes were not tried; that a PLC cannot hold their words is no news."""
        if not isinstance(problem, NotRepresentable):
            self.untried[f"Not tried: {changes or 'other gains'} ({problem})."] = None

    def with_suggestion(self, ended: str = "") -> DesignResult:
        """Return the design as asked for; its proof says which other question would be answered with PASS.

        Args:
            ended: that the search for changes ended early; empty: it did not.
        """
        first, proof = self.first, self.first.proof
        share, coarse = self._coarse()
        why = coarse if share >= COARSE else None
        advice, options = "", tuple[str, ...]()
        with SearchBudget() as budget:
            options = self._by_repair() or self._by_design() or self._by_switch() or self._by_more_scans()
            if not options:
                advice, options = self.by_settings()
            options = (options or self._by_setpoint() or self._by_tolerance() or self._by_limits()
                       or self._by_both())
        if not advice:
            ended = ended or (budget.message if budget.spent else "")
            would = f"would pass at {' '.join(options)}" if options else self._hopeless(whole=not ended)
            if not options and self.unproven:
                options = self.unproven
                would = f"{BREAKS_NONE} {' '.join(options)}"
            advice = "; ".join(filter(None, (would, wider_limits_text(options), why, ended)))
        note = f"The requested optimum fails: {broken_limits_text(proof.criteria)}; {advice}."
        return replace(first, proof=proof.led_by(advice), notes=(*first.notes, note, *self.untried),
                       passes_with=options, recipe=replace(first.recipe, way_on=advice))

    def against_windup(self, wound_up: Sequence[DesignResult]) -> DesignResult:
        """Return the first of several designs that wind up; its proof says what passes.

        That is another design, a setting of an open point, a smaller range of use, its upper end or a larger limit, in
        this order. What another one of the designs would need counts, too.
        """
        best, *_ = wound_up
        different = {repr(each.proof.words): each for each in wound_up}.values()
        advice, options = "", tuple[str, ...]()
        with SearchBudget(scans=0.5 * MOST_SCANS):  # of its own: what it leaves may be too little for the rest
            options = self._by_design(wound_up=True)
        with SearchBudget() as budget:
            if not options:
                advice, options = self.by_settings(best)
            for way in (self._by_range, self._by_upper_end, self._by_overshoot):
                options = options or next(filter(None, map(way, different)), ())
        advice = advice or ("; ".join(filter(None, (f"would pass at {' '.join(options)}", wider_limits_text(options))))
                            if options else "")
        if budget.spent and not advice:
            return replace(best, proof=best.proof.led_by(budget.message))
        if not advice:
            return best
        shorts = " and ".join(KINDS[name].short for name in sorted(wound(best.proof.diagnostics)))
        note = f"{shorts[0].upper()}{shorts[1:]}; it {advice}."
        return replace(best, proof=best.proof.led_by(advice), notes=(*best.notes, note), passes_with=options)

    def _by_repair(self) -> tuple[str, ...]:
        target = REPAIRED.get(self.request.target)
        if target is None:
            return ()
        self.progress(f"{broken(self.first)} fails: trying the repaired version of the program, {target}")
        try:
            other = self.close(self.fitted_model, replace(self.request, target=target), progress=self.progress)
        except HeatertuneError:  # what was asked for is of the other alone
            return ()
        return self._taken(other.proof, ("--target", target))

    def _taken(self, proof: Proof, options: tuple[str, ...]) -> tuple[str, ...]:
        """Return options whose proof passes; none where it does not; those that break no limit are kept in mind."""
        if self._passes(proof):
            return options
        if proof.verdict != "FAIL":
            self.unproven = self.unproven or options
        return ()

    def _passes(self, proof: Proof) -> bool:
        """Return whether a proof keeps every limit, and nothing blocks it but what the log or the first design has."""
        baseline = {finding.name for finding in (*self.fitted_model.findings, *self.first.proof.diagnostics.findings)}
        blocks = {view.name for view in proof.diagnostics.views if view.effect == "blocks" and not view.accepted}
        return proof.verdict != "FAIL" and blocks <= baseline

    def by_settings(self, result: DesignResult | None = None) -> tuple[str, tuple[str, ...]]:
        """Return what is told where one setting of an open point would do, and its options; nothing where none does.

        Args:
            result: the design that fails or winds up; None: the plain one.
        """
        if (alternative := self.with_settings(result or self.first)) is None:
            return "", ()
        return pass_sentence(*alternative), alternative[1]

    def with_settings(self, result: DesignResult) -> tuple[DesignResult, tuple[str, ...]] | None:
        """Return the design that passes where one setting of an open point is known, and its options; None: none does.

        Args:
            result: the design that fails or winds up.
        """
        proof = result.proof
        settings = {name: passing[0] for name, passing in passing_settings(proof).items()}
        settings = dict(list(settings.items())[:1]) or (
            suspects(proof, _settings_that_wind_up(proof)) if self._coarse()[0] < _HOPELESS else {})
        if not settings:
            return None
        request, options = known_as(self.request, settings)
        self.progress(f"{broken(self.first)} fails: trying {' '.join(options)}")
        trial = self.close(self.fitted_model, request, progress=self.progress)
        return None if trial.proof.verdict == "FAIL" or winds_up(trial.proof.diagnostics) else (trial, options)

    def _by_range(self, result: DesignResult) -> tuple[str, ...]:
        """Return the option of a smaller range of use, where its lower end is all that a design fails at; else none."""
        if cools(self.fitted_model):
            return ()
        scenario = result.proof.scenario
        lowest = min((event.setpoint_degC for event in scenario.disturbances if isinstance(event, NewSetpoint)),
                     default=scenario.setpoint_degC)
        top = float(f"{scenario.setpoint_degC:.4g}")
        shares = _OF_RANGE if scenario.setpoint_low_degC is None else _OF_RANGE[1:]
        lower = [float(f"{top - share * (top - lowest):.4g}") for share in shares]
        return self._by_setpoints(result, [(low, top) for low in lower if low < top])

    def _by_upper_end(self, result: DesignResult) -> tuple[str, ...]:
        """Return likewise the option of one setpoint, that of a stated range which takes most power."""
        scenario = result.proof.scenario
        return () if scenario.setpoint_low_degC is None else self._by_setpoints(
            result, [float(f"{scenario.setpoint_degC:.4g}")])

    def _by_setpoints(
        self, result: DesignResult, setpoints_degC: Sequence[float | tuple[float, float]]
    ) -> tuple[str, ...]:
        proof, request = result.proof, self.request
        if not wound(proof.diagnostics) <= OF_RANGE or request.conditions.profile is not None:
            return ()
        screen = RunScreen(fitted_model=self.fitted_model).with_nights([proof])
        for ends in setpoints_degC:
            if screen.wound(proof.words, replace(result.conditions, setpoint_degC=ends)):
                continue
            option = "--setpoint", f"{ends[0]:g} {ends[1]:g}" if isinstance(ends, tuple) else f"{ends:g}"
            self.progress(f"it winds up: trying {' '.join(option)}")
            smaller = replace(request, conditions=replace(request.conditions, setpoint_degC=ends))
            try:
                trial = self.close(self.fitted_model, smaller, progress=self.progress)
            except HeatertuneError:  # the range is too small for a story
                continue
            if trial.proof.verdict != "FAIL" and not winds_up(trial.proof.diagnostics):
                return option
        return ()

    def _by_overshoot(self, result: DesignResult) -> tuple[str, ...]:
        """Return the options that allow what a design overshoots by in other lengths of the story's parts.

        None where more than that was found, and where no design passes with them.
        """
        proof = result.proof
        if not briefly(proof.diagnostics):
            return ()
        over = RunScreen(fitted_model=self.fitted_model).with_nights([proof]).wound(proof.words, result.conditions)
        looser = limits_above(over)
        if not looser or not within_reach(looser, proof, self.fitted_model, result.conditions):
            return ()
        request = replace(self.request, conditions=loosen_conditions(self.request.conditions, looser))
        options = options_of(looser)
        self.progress(f"it winds up: trying {' '.join(options)}")
        trial = self.close(self.fitted_model, request, progress=self.progress)
        return () if trial.proof.verdict == "FAIL" or winds_up(trial.proof.diagnostics) else options

    def _coarse(self) -> tuple[float, str]:
        """Return how much of the band the calmest PWM of whole half-waves takes, and what is told of it."""
        proof, tolerance = self.first.proof, self.first.proof.limits.tolerance_degC
        calm = None if self.request.conditions.pwm_period_s else calmest_pwm(proof, self.fitted_model.plants)
        if calm is None or "limit_cycle" not in proof.broken_criteria:
            return 0.0, ""
        bursts = ""
        if proof.design is not None:  # a control without gains is not designed anew for them
            free = self.request.switch_kind is None
            way = "were tried, too" if free else "are calmer, and are tried without --switch-kind"
            bursts = f": bursts of a power controller {way}"
        text = (f"at the calmest PWM of a solid-state relay, {calm.period_s:.3g} s, the ripple is "
                f"{calm.ripple_degC:.2g} °C and one half-wave is {calm.half_wave_degC:.2g} °C; the tolerance is "
                f"±{tolerance:.3g} °C{bursts}")
        return calm.share(tolerance), text

    def _hopeless(self, *, whole: bool) -> str:
        """Return what is told where nothing that may be suggested passes; `whole`: the search went to its end."""
        nothing = f"{NOTHING_PASSES} passes" + (", nor does any limit of up to twice its default" if whole else "")
        with SearchBudget():
            if self._passes_in_cold_room():
                return f"{nothing}; {_BY_ROOM}"
        help_ = physical_help(self.first.proof.broken_criteria)
        return nothing + (f"; changes to the heater would help: {help_}" if help_ else "")

    def _passes_in_cold_room(self) -> bool:
        """Return whether a design passes for those heaters alone whose room is no warmer than the lowest reading."""
        fitted = self.fitted_model
        if fitted.residuals is None or cools(fitted):
            return False
        readings = fitted.residuals.measured_degC
        warmest_degC = float(np.min(readings)) + COLDER * float(np.ptp(readings))
        likely = tuple(candidate for candidate in fitted.candidates
                       if candidate.model.ambient_degC is not None and candidate.model.ambient_degC <= warmest_degC)
        if not 0 < len(likely) < len(fitted.candidates):
            return False
        self.progress(f"{broken(self.first)} fails: trying the heaters in a room as cold as the log")
        try:
            return self._passes(self.close(replace(fitted, candidates=likely, model=likely[0].model.half_rule()),
                                           self.request, progress=self.progress).proof)
        except HeatertuneError:  # they cannot be held there
            return False

    def _by_design(self, *, wound_up: bool = False) -> tuple[str, ...]:
        """Return the options that leave open what the user gave of the design; none where that does not pass.

        Args:
            wound_up: whether the design keeps every limit already, so that what winds up is no better.
        """
        options, request = free_request(self.request)
        return self._freed(options, request, wound_up=wound_up) if options else ()

    def _freed(self, options: tuple[str, ...], request: DesignRequest, *, wound_up: bool = False) -> tuple[str, ...]:
        """Return options if the design of their request passes; else none."""
        if not self.freeing:
            return ()
        self.progress(f"{broken(self.first)} fails: trying {' '.join(options)}")
        try:
            other = self.close(self.fitted_model, request, progress=self.progress)
        except HeatertuneError:  # there is no such design
            return ()
        return () if wound_up and winds_up(other.proof.diagnostics) else self._taken(other.proof, options)

    def _by_switch(self) -> tuple[str, ...]:
        """Return the options of a solid-state relay, or of its calmest PWM period, where the user named another one."""
        request, kind, given_s = self.request, self.request.switch_kind, self.request.conditions.pwm_period_s
        if kind is None and given_s is None:  # it was free
            return ()
        ssr_option = () if kind in (None, _SSR) else ("--switch-kind", _SSR)
        ssr_request = request if kind is None else replace(request, switch_kind=_SSR)
        options = self._freed(ssr_option, ssr_request) if ssr_option and given_s is None else ()
        return options or self._by_calm_pwm(ssr_option, ssr_request)

    def _by_calm_pwm(self, options: tuple[str, ...], request: DesignRequest) -> tuple[str, ...]:
        """Return options of another switch with those of its calmest PWM period, if that is shorter and passes."""
        calm = calmest_pwm(self.first.proof, self.fitted_model.plants)
        if calm is None:  # the controller makes the PWM itself
            return ()
        calm_s = DesignChange(pwm_about_s=calm.period_s).pwm_at(
            self.first.ideal.sample_time_s, controller_for(request.target).tick_s)
        if calm_s is None or not calm_s < (request.conditions.pwm_period_s or math.inf):
            return ()
        text = f"{calm_s:.12g}"
        return self._freed((*options, "--pwm-period", text), replace(
            request, conditions=replace(request.conditions, pwm_period_s=float(text))))

    def _by_setpoint(self) -> tuple[str, ...]:
        """Return the option of a lower setpoint at which the plain design passes; none where there is none nearby."""
        conditions, scenario = self.request.conditions, self.first.proof.scenario
        if conditions.profile is not None or conditions.lowest_degC is not None:
            return ()
        ambient = self.fitted_model.plants[0].ambient_degC
        start = ROOM_DEGC if ambient is None else ambient
        screen, words = RunScreen(fitted_model=self.fitted_model).with_failed(self.first.proof), self.first.proof.words
        for share in _LOWER:
            setpoint = float(f"{start + share * (scenario.setpoint_degC - start):.3g}")
            lower = replace(conditions, setpoint_degC=setpoint)
            try:
                if not screen.keeps(words, replace(self.first.conditions, setpoint_degC=setpoint)):
                    continue
                self.progress(f"{broken(self.first)} fails: trying a setpoint of {setpoint:g} °C")
                request = replace(self.request, setpoint_ramp=self.request.setpoint_ramp or "none", conditions=lower)
                result = plainly(self.fitted_model, request, text=False, progress=self.progress)
            except HeatertuneError:  # there the heater cannot be held, or the sensor does not see it
                continue
            if options := self._taken(result.proof, ("--setpoint", f"{setpoint:g}")):
                return options
        return ()

    def _by_limits(self) -> tuple[str, ...]:
        """Return the options that loosen each broken limit by as little as will do, none where they would not."""
        looser = limits_above(self.first.proof.criteria)
        if not looser or not within_reach(looser, self.first.proof, self.fitted_model, self.first.conditions):
            return ()
        self.progress(f"{broken(self.first)} fails: trying wider limits")
        request = replace(self.request, setpoint_ramp=self.request.setpoint_ramp or "none",
                          conditions=loosen_conditions(self.request.conditions, looser))
        return self._taken(
            plainly(self.fitted_model, request, text=False, progress=self.progress).proof, options_of(looser))

    def _by_more_scans(self) -> tuple[str, ...]:
        sooner = self.sooner
        if sooner is None or not sooner.passes_with:
            return ()
        return "--sample-time", f"{sooner.ideal.sample_time_s:g}", *sooner.passes_with

    def _by_both(self) -> tuple[str, ...]:
        proof = self.first.proof
        return () if proof.design else both_that_pass(
            proof.words, self.fitted_model, proof, self.first.conditions, self._passes)

    def _by_tolerance(self) -> tuple[str, ...]:
        proof = self.first.proof
        wider = tolerance_that_passes(proof.words, self.fitted_model, proof, self.first.conditions, self._passes)
        return () if wider is None else ("--tolerance", f"{wider:g}")


def _settings_that_wind_up(proof: Proof) -> list[Mapping[str, str]]:
    """Return the settings of the runs with what no other gains mend, of all that wind up where they mend it all."""
    return [settings for name in sorted(unmended(proof.diagnostics)) for _, settings, _ in proof.nights.get(name, ())]

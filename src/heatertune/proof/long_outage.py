"""Additional runs with outages of other lengths, and with setpoint changes, than in the test sequence.

How a controller integrates decides which length of an open circuit, or which setpoint change, overshoots most. The
methods of `OutageTiming` explain which lengths are tried. An independent search on sampled designs
(tests/bench/outages.py) confirmed them.

Open circuits and restarts are also run while the load of the test sequence is held: less power is left over, and a
controller that integrates up to a limit of its output winds up by more than the load needs.

If the user stated a range of setpoints, all of these, cold goods, loads and heat-ups from cold are also run at lower
setpoints: they need less power, so full power overshoots them more. Without a range they are run at the lower setpoint
of the test sequence, and what they show is told: the verdict speaks of the stated setpoint.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise
from typing import Final, NamedTuple

from heatertune.heater.exact import time_to, unit_step_response
from heatertune.model.findings import Finding
from heatertune.model.loss_curve import slower_cooling
from heatertune.model.model_values import HeaterModel
from heatertune.pid.design_values import PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.words import Words
from heatertune.proof.criteria import Criterion, names_of
from heatertune.proof.phase_statistics import beyond_degC
from heatertune.proof.scenario import (
    REST_SHARE,
    Course,
    Load,
    Mains,
    NewSetpoint,
    OutageLengths,
    PlcPower,
    Scenario,
    TemperatureStep,
    conditions,
    heated_s,
    way_back,
)
from heatertune.proof.verdict import FitDiagnostics
from heatertune.units import written

__all__ = [
    "BELOW", "BRIEF", "HEAT_UP", "JUDGED", "LOADED", "LONGER", "LOW", "OF_RANGE", "ONLY_TOLD", "OVERSHOOTS", "PART",
    "RISING", "UNDER_LOAD", "WARM", "WINDOW", "LongOutage", "OutageTiming", "briefly",
    "nights_of", "sums_up", "unmended", "winds_up", "wound",
]


_SHARES: Final = (0.85, 1.0, 1.7)  # of the time until full power is requested
_LED: Final = 2.5  # the same, if a ramp moves the setpoint back
_NEARLY: Final = (0.95, 0.98)  # of the time until a boost starts
_AT_EDGE: Final = 5  # distances at which a firmware's window may end: setpoint and reading are rounded
_NOT_YET: Final = (0.95, 0.98, 0.985, 0.99, 0.994, 0.998)  # of the distance at which a boost starts; a call may be late
_LED_BY_P: Final = (0.5, 0.6, 0.7, 0.8, 0.95, 1.2, 1.6, 2.2, 3.2)  # of the distance at which P alone gives full power
_COLD: Final = 0.95  # of the way to ambient: a heater is cold then, as at the restart in the test sequence
_NEAR: Final = 0.9  # of the distance at which a boost ends: there is none nearer
_NEAREST: Final = 0.05  # of the largest distance, without a boost
_FEW: Final = 12  # number of lengths for a first search
_FEWEST: Final = 24  # number of closely spaced lengths, at least
_MOST: Final = 96  # the same, at most
_PER_RISE: Final = 600.0  # the same, per fraction of the way that full power heats in a scan: the height of a tooth
_DOWN: Final = 0.8  # of the rise above ambient: each lower setpoint's, of that of the one above it
_SCANS: Final = 1e6  # a longer test sequence gets no longer runs: a proof runs ten times as many at most
_FEWEST_IN_MANY: Final = 9  # number of lengths with a boost then
_NO_GAIN: Final = 1e-9  # [%/°C]: a smaller gain has no effect
_HALVINGS: Final = 50


class OutageTiming(NamedTuple):
    """The timing of outages in a loop whose heaters cool down without power.

    Attributes:
        controller: of the loop.
        words: its parameters.
        design: realised by the parameters; None if the controller is not a PID.
        scenario: the test sequence.
        models: the heaters.
        closely: whether lengths are spaced as closely as the scans require; otherwise there are only a few.
    """

    controller: Controller
    words: Words
    design: PidDesign | None
    scenario: Scenario
    models: Sequence[HeaterModel]
    closely: bool = True

    def openings_s(self) -> list[float]:
        """Return the outage lengths at which the overshoot may peak [s]; empty without an I part.

        After a shorter outage than that of the test sequence the I part has accumulated most, without any of it being
        removed. The sum grows until the output is at its limit; from then on most controllers hold it, and the
        additional P part of the falling reading disappears again on the way up. The overshoot therefore peaks at about
        the length after which full power is requested, between 0 and the 2 TN of the test sequence:

            hold + K·(e + 1/TN·∫e dt) = limit,   e: how far the heater has cooled down since the reading began to fall

        After the circuit has closed, the reading continues to fall for one dead time, by which its fall was delayed
        before. A shorter outage is the worst if P alone determines the output, a longer one if there is no integration
        outside the proportional band, and with a boost the last one before the boost starts.
        """
        if self._summing is None:
            return []
        most_pct = self.controller.most_power_pct(self.words)
        times = [_saturates_s(model, step, self._summing, most_pct) for model, step in self._steps]
        middle = math.sqrt(min(times) * max(times))
        shares = _SHARES if self.words.ramp is None else (*_SHARES, _LED)
        return self._with_more([share * middle for share in shares])

    def lower_s(self) -> dict[float, OutageLengths]:
        """Compute the lengths at the lower setpoints in use, by setpoint [°C].

        The peak is elsewhere there: without integration outside the proportional band, the reading leaves the band
        later the less it can fall. The lowest setpoint is not the worst: so close to the ambient the reading falls too
        little to integrate much. Intermediate setpoints are therefore included, the same ones for every lowest
        setpoint: a wider range then contains all setpoints of a smaller one except its lowest.

        A holdback leaves the I part little to integrate, so it goes on far longer than anywhere else. The way from a
        low setpoint's ambient is too short to remove what it holds, and the overshoot grows until it is full.

        If no range is stated, it is the lower setpoint of the test sequence.
        """
        low_degC = self.scenario.lower_setpoint_degC
        if low_degC is None:
            return {}
        lone = self.scenario.setpoint_low_degC is None
        timings = {low_degC: self._replace(closely=False)} if lone else {**self._down_to(low_degC), low_degC: self}
        there = {low: timing._replace(scenario=replace(self.scenario, setpoint_degC=low))
                 for low, timing in timings.items()}
        return {low: OutageLengths(sorted([*timing.openings_s(), *timing.held_back_s()]), timing.restarts_s())
                for low, timing in there.items()}

    def held_back_s(self) -> list[float]:
        """Return the outage length after which an I part behind a holdback requests full power [s], or none."""
        hold_degC = self.controller.hold_degC(self.words)
        if self._summing is None or hold_degC is None:
            return []
        most_pct = self.controller.most_power_pct(self.words) - min(
            step / model.gain_degC_per_pct for model, step in self._steps)
        return [self._summing.integral_time_s * most_pct / abs(self._summing.gain_pct_per_degC * hold_degC)]

    def _down_to(self, low_degC: float) -> dict[float, OutageTiming]:
        """Return the setpoints on the way down to the lowest one [°C], each with its timing."""
        setpoint_degC, step = self.scenario.setpoint_degC, min((step for _, step in self._steps), key=abs)
        lowest_share = 1.0 - (setpoint_degC - low_degC) / step
        ratio = _DOWN**2 if self._many or not self.closely else _DOWN
        number = math.floor(math.log(lowest_share) / math.log(ratio)) if lowest_share > 0.0 else 0
        return {setpoint_degC - (1.0 - ratio**place) * step: self._replace(closely=False)
                for place in range(1, number + 1)}

    def restarts_s(self) -> list[float]:
        """Return the off-times of a PLC after which its restart may overshoot most [s]; empty without an I part.

        A restarted PLC begins with an empty I part. The farther the heater has cooled down, the more it integrates on
        the way back, until K·e alone requests full power. The search found the peak at 0.5 to 1.2 of that distance, and
        at up to 3.4 without integration outside the proportional band.
        """
        if self._summing is None:
            return []
        full_degC = self.controller.most_power_pct(self.words) / abs(self._summing.gain_pct_per_degC)
        times = [[time_to(min(share * full_degC / abs(step), _COLD), *model.lags_s) for share in _LED_BY_P]
                 for model, step in self._steps]
        return self._with_more([math.sqrt(min(each) * max(each)) for each in zip(*times, strict=True)])

    def lows_degC(self) -> list[float]:
        """Return setpoints whose change may overshoot more than that of the lowest [°C]; empty without an I part.

        From the lowest setpoint in use P requests full power, and little is integrated. Of 128 plain designs that
        passed, 3 reached up to 1.3 of their limit with a smaller change.

        If no range is stated, a boost may begin only at a larger rise than that of the test sequence. The controller
        alone leads all smaller ones, up to that from a nearly cold heater, where the heat-up has the boost: of 8 such
        designs that passed, 3 reached up to 1.35 of their limit there. Plain ones show it in the heat-up.
        """
        setpoint_degC, low_degC = self.scenario.setpoint_degC, self.scenario.lower_setpoint_degC
        alone_degC = self._alone_degC
        if self._summing is None or low_degC is None or low_degC == setpoint_degC:
            return []
        way_degC, again_degC = low_degC - setpoint_degC, alone_degC or self.controller.again_degC(self.words)
        shares = _LED_BY_P[1::2] if self._many else _LED_BY_P
        by_p = [share * self._full_rise_degC(self._summing) for share in shares]
        if again_degC is not None:
            by_p = [each for each in by_p if each < again_degC] + [share * again_degC for share in _NOT_YET]
        end_degC = max(abs(way_degC), alone_degC)
        far = {*by_p, *self._more_degC(end_degC, 0)}
        return [setpoint_degC + math.copysign(each, way_degC) for each in sorted(far) if each < end_degC]

    @property
    def _alone_degC(self) -> float:
        """The largest setpoint rise without a boost if no range is stated [°C]; 0 without a boost, or if one is."""
        if self.words.boost is None or self.scenario.setpoint_low_degC is not None:
            return 0.0
        return min(self.words.boost.again_degC, *(_COLD * abs(step) for _, step in self._steps))

    @property
    def _summing(self) -> PidDesign | None:
        """The design; None without integral action."""
        return None if self.design is None or math.isinf(self.design.integral_time_s) else self.design

    @property
    def _many(self) -> bool:
        """Whether the test sequence has so many scans that no additional run may have more."""
        return self.scenario.duration_s > _SCANS * self.controller.timing(self.words).scan_s

    def _full_rise_degC(self, design: PidDesign) -> float:
        """Return the setpoint rise at which P requests all power in excess of the holding power [°C], or 0."""
        most_pct, gain = self.controller.most_power_pct(self.words), abs(design.gain_pct_per_degC)
        rises = [(most_pct - step / model.gain_degC_per_pct) / max(gain - 1.0 / abs(model.gain_degC_per_pct), _NO_GAIN)
                 for model, step in self._steps]
        return math.sqrt(max(0.0, min(rises)) * max(rises))

    def _with_more(self, lengths_s: list[float]) -> list[float]:
        """Return lengths in order, with more down to the shortest; with a boost, also lengths just before it starts."""
        again_degC, edges_s = self.controller.again_degC(self.words), self._edges_s()
        if again_degC is not None and all(again_degC < abs(step) for _, step in self._steps):
            falls = self._falls_s(again_degC)
            lengths_s = [min(each, _NEARLY[-1] * max(falls)) for each in lengths_s]
            lengths_s += edges_s or [share * end for end in (min(falls), max(falls)) for share in _NEARLY]
        (model, step), *_ = self._steps
        least = 0 if again_degC is None else _FEWEST_IN_MANY - len(edges_s) // 2
        more = self._more_degC(_COLD * abs(step), least)
        return sorted({*lengths_s, *(time_to(far / abs(step), *model.lags_s) for far in more)})

    def _edges_s(self) -> list[float]:
        """Return lengths after which the reading leaves a firmware's window [s]: the overshoot rises up to there."""
        nearest, farthest = self.controller.again_degC(self.words), self.controller.forgets_degC(self.words)
        if nearest is None or farthest is None or any(farthest >= abs(step) for _, step in self._steps):
            return []
        ends = [self._falls_s(nearest + (farthest - nearest) * place / (_AT_EDGE - 1)) for place in range(_AT_EDGE)]
        return [each for falls in ends for each in (min(falls), max(falls))]

    def _falls_s(self, far_degC: float) -> list[float]:
        """Return the times in which the readings of the heaters fall so far [s]."""
        return [time_to(far_degC / abs(step), *model.lags_s) for model, step in self._steps]

    def _more_degC(self, farthest_degC: float, least: int) -> Iterator[float]:
        """Yield distances from the setpoint, from the end of a boost up to the farthest [°C].

        The power changes only at scans. Over the length of the outage, or the size of the change, the overshoot is
        therefore a sawtooth with one tooth for each scan, and a tooth is higher the more full power heats in one scan.
        A boost also ends at a scan, up to one scan late, and its teeth have the full height. The distances are spaced
        so closely that some come near a peak: between two lengths, the search found 6 of 65 designs with a boost up to
        a third beyond their limit, and plain ones up to an eighth. Just inside the distance at which a boost starts,
        the controller alone returns the heater to the setpoint, which is not so from the lowest setpoint in use.

        Args:
            farthest_degC: the largest of them.
            least: their number if the test sequence has too many scans for more.
        """
        boost, again_degC = self.words.boost, self.controller.again_degC(self.words)
        within_degC = again_degC if boost is None else boost.within_degC
        nearest = _NEAREST * farthest_degC if within_degC is None else _NEAR * within_degC
        most_pct, scan_s = self.controller.most_power_pct(self.words), self.controller.timing(self.words).scan_s
        rise = scan_s * max(abs(most_pct * model.gain_degC_per_pct / step) / sum(model.lags_s)
                            for model, step in self._steps)
        number = max(_FEWEST, min(math.ceil(_PER_RISE * rise), _MOST)) if self.closely else _FEW
        number = least if self._many else number
        for place in range(number if nearest < farthest_degC else 0):
            yield nearest + (farthest_degC - nearest) * place / (number - 1)

    @property
    def _steps(self) -> list[tuple[HeaterModel, float]]:
        """The heaters, each with the distance of its setpoint from the ambient [°C]."""
        held_degC = self.scenario.held_setpoints_degC
        return [(model, self.scenario.setpoint_degC - conditions(self.scenario, model, held_degC)[0])
                for model in self.models]


def _saturates_s(model: HeaterModel, step_degC: float, design: PidDesign, most_pct: float) -> float:
    """Return the cooling time after which full power is requested [s]."""
    outer, inner = (*model.lags_s, 0.0)[:2]

    def asked_pct(seconds: float) -> float:
        fallen = unit_step_response(seconds, outer, inner)
        summed_s = seconds + outer * math.expm1(-seconds / outer) - inner * fallen  # integral of the fall
        return step_degC / model.gain_degC_per_pct + design.gain_pct_per_degC * step_degC * (
            fallen + summed_s / design.integral_time_s)

    low, high = 0.0, outer
    while asked_pct(high) < most_pct:
        low, high = high, 2.0 * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if asked_pct(middle) < most_pct else (low, middle)
    return high


#: criteria of the way back from an open circuit, and after a start-up of the controller
_REHEATED: Final = names_of(beyond_degC, phases=("reheat",))
_RESTARTED: Final = names_of(beyond_degC, phases=("restart",))
_HEATED: Final = names_of(beyond_degC, phases=("heat-up", "restart"))
_CHANGED: Final = names_of(beyond_degC, phases=("change",))
_STARTED: Final = (*_REHEATED, *_RESTARTED)
_DISTURBED: Final = (*_STARTED, *names_of(beyond_degC, phases=("recovery",)))
_RETURN, _RESTART, _GROWTH = "reheat_time", "restart_time", "return_growth"
LONGER, RISING, WARM, PART = "winds-up", "stays-at-limit", "warm-restart", "part-change"
#: a shorter open circuit than that of the test sequence
BRIEF: Final = "briefly-open"
LOW: Final = "low-outage"
#: the same without a stated range: it is told, and blocks nothing
BELOW: Final = "outage-below"
HEAT_UP: Final = "low-heat-up"
#: while a load is held
UNDER_LOAD: Final = "outage-under-load"
#: with a boost, while a load is held: the boost starts again and again
LOADED: Final = "loaded-outage"
#: the same with a firmware's own window; told, as windows wide enough for it overshoot on many a heater
WINDOW: Final = "loaded-window"
#: findings that block nothing
ONLY_TOLD: Final = frozenset({BELOW, WINDOW})
#: limits broken there are of the test sequence's kind, and other gains may help
_MENDED: Final = frozenset({LOW, HEAT_UP, BRIEF, WARM, PART, LOADED, UNDER_LOAD})
#: findings that concern the lower end of the range of setpoints
OF_RANGE: Final = frozenset({LOW, HEAT_UP, PART})
#: name of the finding → criteria that select the hardest run
OVERSHOOTS: Final = {
    LONGER: _REHEATED, RISING: _REHEATED, LOW: _DISTURBED, BELOW: _DISTURBED, HEAT_UP: _HEATED, BRIEF: _REHEATED,
    WARM: _RESTARTED, PART: _CHANGED, LOADED: _REHEATED, WINDOW: _REHEATED, UNDER_LOAD: _STARTED}
#: name of the finding → criteria that count
JUDGED: Final = {**OVERSHOOTS, LONGER: (*_REHEATED, _RETURN, _GROWTH), RISING: (*_REHEATED, _RETURN),
                 LOADED: (_RETURN, _RESTART), WINDOW: (_RETURN, _RESTART)}
#: findings of several events
_SEVERAL: Final = frozenset({LOW, BELOW, UNDER_LOAD})
_KEPT_AT_HIGHEST: Final = "the limit is kept at the highest setpoint"
_TIMES: Final = 4.0  # as long as in the test sequence
#: of the time to return after the test sequence's open circuit: tolerance for a heater that was not quite cold then
_COLDER: Final = 0.1
_SLACK: Final = 1.1  # of the test sequence's limit; one that stays at its limit exceeds it by far, or never settles
_ANY: Final = 1e9  # of a limit: only what never ends exceeds it
_OF_RESTARTS: Final = (0.0, 0.5, 1.0)  # of their number, under a load
_HALF: Final = 0.5  # of what a lower setpoint is above the ambient: no goods are colder
_LATER: Final = 1.2  # than full power needs to the lower setpoint: two lags carry the reading beyond it


class LongOutage(NamedTuple):
    """An additional run, derived from an open circuit or a setpoint change of the test sequence.

    Attributes:
        name: of the finding if it breaks a limit.
        scenario: heat-up, the event directly after it, and the way back.
        summary: the condition, in words.
        limits_kept: result of the test sequence itself.
        heater_s: sum of lags and dead time of the slowest heater, the tolerance of the time to return [s].
        most: limit usage that still counts as kept.
    """

    name: str
    scenario: Scenario
    summary: str
    limits_kept: str = ""
    most: float = 1.0
    heater_s: float = 0.0

    @property
    def compares(self) -> bool:
        """Whether the time to return is compared with that after the open circuits of the test sequence."""
        return self.name == LONGER

    def compare(self, criteria: Sequence[Criterion], before: Iterable[Criterion]) -> tuple[Criterion, ...]:
        """Return the criteria of a run, with the increase of the time to return over that in the test sequence.

        Args:
            criteria: of the run.
            before: criteria of the same run in the test sequence.
        """
        now = {each.name: each for each in criteria}.get(_RETURN)
        then = {each.name: each for each in before}.get(_RETURN)
        if not self.compares or now is None or then is None or math.isinf(then.value):
            return tuple(criteria)
        growth = Criterion(
            name=_GROWTH, value=now.value - then.value, limit=_COLDER * then.value + self.heater_s, unit="s",
            what="By how much longer it takes to return after a longer open circuit.", where=now.where)
        return *criteria, growth

    def findings(self, criteria: Iterable[Criterion]) -> list[Finding]:
        """Return the findings of broken limits; empty if all are kept."""
        worst = self._worst(criteria)
        if worst.strain <= self.most:
            return []
        grows = worst.name == _GROWTH and math.isfinite(worst.value)
        beyond = worst.name in OVERSHOOTS[self.name]
        which = f" ({worst.name.replace('_', ' ')})" if self.name in _SEVERAL else ""
        does = (f"overshoots by {worst.value:.3g} {worst.unit}{which}" if beyond else
                f"takes {written(worst.value / 60.0, 2)} min longer to return" if grows else "does not come to rest")
        return [Finding(name=self.name, message=f"{self.summary} it {does}{self.limits_kept}.")]

    def strain(self, criteria: Iterable[Criterion]) -> float:
        """Return the largest usage of the limits that count here."""
        return self._worst(criteria).strain

    def _worst(self, criteria: Iterable[Criterion]) -> Criterion:
        return max((each for each in criteria if each.name in JUDGED[self.name]), key=lambda entry: entry.strain)


def nights_of(
    scenario: Scenario, models: Sequence[HeaterModel], brief_s: Sequence[float] = (), warm_s: Sequence[float] = (),
    lows_degC: Sequence[float] = (), lower_s: Mapping[float, OutageLengths] | None = None, *, again: str = "",
    held_back: bool = False,
) -> Iterator[LongOutage]:
    """Yield variants of the longest open circuit, right after the heat-up: longer, closed at lower setpoints, shorter.

    Yield also open circuits of the same and of shorter lengths, and restarts, under a load and at lower setpoints,
    heat-ups to these from cold, restarts of the PLC after intermediate times, and setpoint changes by less than the
    range.

    Args:
        scenario: the test sequence; its circuits may all stay open.
        models: the heaters.
        brief_s: lengths of the shorter ones [s].
        warm_s: times without supply of the PLC [s].
        lows_degC: setpoints to which it falls, and from which it rises again [°C].
        lower_s: lower setpoint in use [°C] → shorter open circuits and restarts there; None: there is none.
        again: `LOADED` if a boost starts again far from the setpoint, `WINDOW` if a firmware's window ends; else "".
        held_back: whether a holdback keeps the setpoint near the reading.
    """
    lower_s = lower_s or {}
    opened = {number: closed.time_s - event.time_s
              for number, (event, closed) in enumerate(pairwise(scenario.disturbances))
              if isinstance(event, Mains) and isinstance(closed, Mains) and event.share == 0.0 < closed.share}
    if opened:
        number = max(opened, key=lambda entry: opened[entry])
        yield from _opened(scenario, models, number, opened, brief_s, lower_s, held_back)
        if brief_s and scenario.rests_s and _loads_in(scenario):
            yield from _under_load(scenario, number, OutageLengths(brief_s, warm_s), again)
    if not scenario.rests_s:
        return
    if warm_s:
        yield from _restarted(scenario, warm_s)
    if lower_s:
        yield from _cold_at_lower_setpoints(scenario, _downwards(lower_s, scenario), models)
    if lows_degC:
        yield from _changed_in_part(scenario, lows_degC, models)


def _restarted(scenario: Scenario, warm_s: Sequence[float]) -> Iterator[LongOutage]:
    if (back := _restart_in(scenario)) is not None:
        summary = f"Where the controller is restarted after {_minutes(warm_s)} without supply"
        yield LongOutage(WARM, _scenario_of(scenario, back, warm_s), summary,
                         "; the limit is kept where the heater is hot, or cold")


def _restart_in(scenario: Scenario) -> int | None:
    """Return the number of the event with which the PLC loses its supply before a restart; None: there is none."""
    return next((number for number, (lost, event) in enumerate(pairwise(scenario.disturbances))
                 if isinstance(lost, PlcPower) and isinstance(event, PlcPower) and event.on), None)


def _changed_in_part(
    scenario: Scenario, lows_degC: Sequence[float], models: Sequence[HeaterModel]
) -> Iterator[LongOutage]:
    fall = next((number for number, pair in enumerate(pairwise(scenario.disturbances))
                 if all(isinstance(event, NewSetpoint) for event in pair)), None)
    if fall is not None:
        rest_s = way_back(scenario, fall + 1, REST_SHARE)[1]
        course = Course(scenario, rest_s)
        for low_degC in lows_degC:
            more_s = _cools_s(scenario, low_degC, models)
            falls = NewSetpoint(time_s=rest_s, setpoint_degC=low_degC, unheld=more_s > 0.0 or None)
            course.add(falls, way_back(scenario, fall, 0.0)[0] + more_s + rest_s)
            course.single(fall + 1)
        summary = f"Where the setpoint changes between its highest and {min(lows_degC):.4g} to {max(lows_degC):.4g} °C"
        yield LongOutage(PART, course.scenario, summary,
                         "; the limit is kept where it falls to its lowest, and rises from there")


def _opened(
    scenario: Scenario, models: Sequence[HeaterModel], number: int, opened: Mapping[int, float],
    brief_s: Sequence[float], lower_s: Mapping[float, OutageLengths], held_back: bool,
) -> Iterator[LongOutage]:
    heater_s = max(sum(model.lags_s) + model.dead_time_s for model in models)
    yield _longer(scenario, number, opened[number])._replace(heater_s=heater_s)
    low = scenario.lower_setpoint_degC
    if low is not None and scenario.rests_s:
        yield _rising(scenario, number, _downwards({low, *lower_s}, scenario), models)
    if lower_s and brief_s and scenario.rests_s:
        lengths_s = {setpoint: OutageLengths(sorted({*opened.values(), *_no_longer(
            lower.openings_s, opened[number], held_back)}), lower.restarts_s) for setpoint, lower in lower_s.items()}
        yield _at_lower_setpoints(scenario, number, lengths_s, models)
    if brief_s and scenario.rests_s:
        text = f"After {_minutes(brief_s)} with an open circuit"
        yield LongOutage(BRIEF, _scenario_of(scenario, number, brief_s), text, "; the limit is kept after a longer one")


def _no_longer(lengths_s: Iterable[float], longest_s: float, held_back: bool) -> Iterator[float]:
    """Yield the lengths at a lower setpoint; near the ambient the worst ones are longer, without bound."""
    if held_back:
        return (min(length_s, _TIMES * longest_s) for length_s in lengths_s)
    return (length_s for length_s in lengths_s if length_s < longest_s)


def _under_load(scenario: Scenario, number: int, lengths_s: OutageLengths, again: str) -> Iterator[LongOutage]:
    """Yield open circuits and restarts of the PLC while the load of the test sequence is held.

    A boost hands over to a controller with an empty I part. If P alone asks for less than the load needs, the reading
    falls until the boost starts again, and so on without end.
    """
    off, warm_s = _restart_in(scenario), lengths_s.restarts_s
    few_s = sorted({warm_s[round(share * (len(warm_s) - 1))] for share in _OF_RESTARTS}) if warm_s else []
    kinds = [(UNDER_LOAD, lengths_s.fewer, REST_SHARE, 1.0, "; the limit is kept without a load"),
             (again, OutageLengths(lengths_s.openings_s, few_s), 1.0, _ANY, "; it does without a load")]
    for name, lengths, share, most, limits_kept in kinds[:2 if again else 1]:
        course = Course(scenario, way_back(scenario, number + 1, share)[1])
        course.single(_loads_in(scenario)[0], rest_share=1.0)
        course.outages(number, off, lengths, share)
        restart = "" if off is None or not warm_s else ", or a restart of the controller,"
        summary = f"After {_minutes(lengths.openings_s)} with an open circuit{restart} while a load is held"
        yield LongOutage(name, course.scenario, summary, limits_kept, most=most)


def _loads_in(scenario: Scenario) -> list[int]:
    """Return the numbers of the events that take power away and give it back, none where there is no load."""
    return [number for number, event in enumerate(scenario.disturbances) if isinstance(event, Load)]


def _longer(scenario: Scenario, number: int, proven_s: float) -> LongOutage:
    """Return a longer outage, for a controller that keeps integrating.

    Most controllers stop integrating at some limit, and then the length of an open circuit does not matter. One that
    does not requests more power the longer the circuit is open, so no test sequence is long enough to prove it: a
    longer outage gives a finding. With little power in reserve such a controller cannot overshoot much, and the limit
    of the overshoot shows nothing. The time to return then grows with the length, so it is also compared with that
    after the test sequence's own outage.
    """
    ends = [*(event.time_s for event in scenario.disturbances), scenario.duration_s]
    rests = scenario.rests_s
    off_s, open_s = heated_s(scenario, rests[number + 2]) if rests else ends[0], _TIMES * proven_s
    events = [replace(event, time_s=time_s) for event, time_s in zip(
        scenario.disturbances[number:number + 2], (off_s, off_s + open_s), strict=True)]
    longer = replace(scenario, disturbances=tuple(events),
                     rests_s=(*rests[number + 2:number + 3], *rests[number + 1:number + 3]),
                     duration_s=off_s + open_s + ends[number + 2] - ends[number + 1])
    return LongOutage(LONGER, longer, f"After {open_s / 3600.0:.2g} h with an open circuit",
                 f"; the limit is kept after {proven_s / 3600.0:.2g} h")


def _rising(scenario: Scenario, number: int, lows_degC: Sequence[float], models: Sequence[HeaterModel]) -> LongOutage:
    """Return two open circuits for each lower setpoint, closed there; the setpoint rises as the reading arrives.

    The I part is then at its maximum: full power with almost no error. A controller that stops integrating at its
    limit, even in the direction away from it, may stay there: while the reading rises, the D part lowers the power and
    the I part compensates for this, beyond full power. If the setpoint then rises, the output reaches its limit and the
    I part is frozen there: once the reading is slow and D has decayed, nothing lowers the power.
    """
    ends = [*(event.time_s for event in scenario.disturbances), scenario.duration_s]
    opens, closes = scenario.disturbances[number:number + 2]
    open_s, rest_s = ends[number + 1] - ends[number], scenario.rests_s[number + 2]
    course = Course(scenario, rest_s)
    for low_degC in lows_degC:
        times_s = [_arrives_s(model, low_degC, conditions(scenario, model)[0]) for model in models]
        for rises_s in (min(times_s), _LATER * max(times_s)):
            course.add(opens, 0.5 * open_s)
            course.add(NewSetpoint(time_s=opens.time_s, setpoint_degC=low_degC), 0.5 * open_s)
            course.add(closes, rises_s)
            course.single(number + 1, NewSetpoint(time_s=opens.time_s, setpoint_degC=scenario.setpoint_degC),
                          rest_share=1.0)
    return LongOutage(RISING, course.scenario, (
        f"Where the setpoint rises from {_degrees(lows_degC)} to {scenario.setpoint_degC:.4g} °C on the way back from "
        "an open circuit"), most=_SLACK)


def _at_lower_setpoints(
    scenario: Scenario, number: int, lengths_s: Mapping[float, OutageLengths], models: Sequence[HeaterModel]
) -> LongOutage:
    """Construct the open circuits, restarts, cold goods and load of the test sequence again, at every lower setpoint.

    The controller integrates until it requests full power. The less power the setpoint needs, the more of the I part
    has to be removed, and the less P contributes to this: the overshoot is larger than at the highest setpoint. Nor can
    it take away more power than the setpoint needs, where a load is given back.
    """
    off, rest_s = _restart_in(scenario), way_back(scenario, number + 1, REST_SHARE)[1]
    fall = next(place for place, event in enumerate(scenario.disturbances) if isinstance(event, NewSetpoint))
    course = Course(scenario, rest_s)
    for setpoint_degC in _downwards(lengths_s, scenario):
        course.add(NewSetpoint(time_s=rest_s, setpoint_degC=setpoint_degC),
                   way_back(scenario, fall, 0.0)[0] + rest_s, rest_s)
        lengths = lengths_s[setpoint_degC]
        course.outages(number, off, lengths)
        for load, fewer in zip(_loads_in(scenario), (lengths.fewer, OutageLengths()), strict=False):
            course.single(load)
            course.outages(number, off, fewer)
        for goods in _cold_goods(scenario, setpoint_degC, models):
            course.add(goods, *way_back(scenario, number + 1, REST_SHARE))
    every_s = sorted(chain(*(lengths.openings_s for lengths in lengths_s.values())))
    summary = (f"After {_minutes(every_s)} with an open circuit, or another event of the test sequence, "
               f"at {_degrees(lengths_s)} °C")
    name = BELOW if scenario.setpoint_low_degC is None else LOW
    return LongOutage(name, course.scenario, summary, f"; {_KEPT_AT_HIGHEST}")


def _cold_goods(
    scenario: Scenario, setpoint_degC: float, models: Sequence[HeaterModel]
) -> Iterator[TemperatureStep]:
    """Yield the cold goods of the test sequence: they take at most half of what a setpoint is above any ambient."""
    most_degC = _HALF * min(abs(setpoint_degC - conditions(scenario, model)[0]) for model in models)
    for goods in scenario.disturbances:
        if isinstance(goods, TemperatureStep):
            fall_degC = min(abs(goods.temperature_degC), most_degC)
            yield replace(goods, temperature_degC=math.copysign(fall_degC, goods.temperature_degC))


def _cold_at_lower_setpoints(
    scenario: Scenario, setpoints_degC: Sequence[float], models: Sequence[HeaterModel]
) -> Iterator[LongOutage]:
    """Yield heat-ups to the lower setpoints of a stated range: the PLC starts cold, as at the highest one.

    Full power leads to a lower setpoint at more speed, and less of it holds the setpoint there.
    """
    if scenario.setpoint_low_degC is None:
        return
    way_s, rest_s = heated_s(scenario, 0.0), REST_SHARE * min(rest_s for rest_s in scenario.rests_s if rest_s > 0.0)
    off_s = max(model.dead_time_s + time_to(_COLD, *model.lags_s) for model in models)
    course = Course(scenario, rest_s)
    for setpoint_degC in setpoints_degC:
        course.add(PlcPower(time_s=way_s, on=False), 0.5 * off_s)
        course.add(NewSetpoint(time_s=way_s, setpoint_degC=setpoint_degC), 0.5 * off_s)
        course.add(PlcPower(time_s=way_s, on=True), way_s + rest_s, rest_s)
    yield LongOutage(HEAT_UP, course.scenario, f"On a heat-up from cold to {_degrees(setpoints_degC)} °C",
                      f"; {_KEPT_AT_HIGHEST}")


def _scenario_of(scenario: Scenario, number: int, lengths_s: Iterable[float]) -> Scenario:
    """Return the heat-up and then, of each length [s], what begins with an event and ends with the next one.

    Where only the overshoot counts, a share of the rest after it is enough.
    """
    course = Course(scenario, way_back(scenario, number + 1, REST_SHARE)[1])
    course.pairs(number, lengths_s)
    return course.scenario


def _minutes(lengths_s: Sequence[float]) -> str:
    ends = dict.fromkeys(written(each / 60.0, 2) for each in (lengths_s[0], lengths_s[-1]))
    return f"{' to '.join(ends)} min"


def _downwards(setpoints_degC: Iterable[float], scenario: Scenario) -> list[float]:
    """Return setpoints in order, the nearest to that of a scenario first."""
    return sorted(setpoints_degC, key=lambda setpoint_degC: abs(setpoint_degC - scenario.setpoint_degC))


def _degrees(setpoints_degC: Iterable[float]) -> str:
    ends = min(setpoints_degC), max(setpoints_degC)
    return " to ".join(dict.fromkeys(f"{end:.4g}" for end in ends))


def _arrives_s(model: HeaterModel, low_degC: float, ambient_degC: float) -> float:
    """Return in what time full power leads from the ambient to a temperature."""
    share = (low_degC - ambient_degC) / (100.0 * model.gain_degC_per_pct)
    return model.dead_time_s + time_to(share, *model.lags_s)


def _cools_s(scenario: Scenario, low_degC: float, models: Sequence[HeaterModel]) -> float:
    """Return in what time the heaters cool down to a setpoint below those of the test sequence [s]; others: 0."""
    setpoint_degC, proven_degC = scenario.setpoint_degC, scenario.lower_setpoint_degC
    if proven_degC is None or abs(setpoint_degC - low_degC) <= abs(setpoint_degC - proven_degC):
        return 0.0
    fall_degC = setpoint_degC - low_degC
    return max(time_to(fall_degC / (setpoint_degC - conditions(scenario, model)[0]), *model.lags_s)
               * slower_cooling(model, low_degC) for model in models)


def wound(diagnostics: FitDiagnostics) -> set[str]:
    """Return which of these were found, and not accepted by the user."""
    return {finding.name for finding in diagnostics.findings} & set(JUDGED) - {*ONLY_TOLD, *diagnostics.accepted}


def winds_up(diagnostics: FitDiagnostics) -> bool:
    """Return whether any was found, and the user has not accepted it."""
    return bool(wound(diagnostics))


def sums_up(diagnostics: FitDiagnostics) -> bool:
    """Return whether anything was found that no other gains mend."""
    return bool(wound(diagnostics) - _MENDED)


def unmended(diagnostics: FitDiagnostics) -> set[str]:
    """Return which were found that no other gains mend; where there is none such, all that were found."""
    names = wound(diagnostics)
    return names - _MENDED or names


def briefly(diagnostics: FitDiagnostics) -> frozenset[str]:
    """Return what is broken after a shorter open circuit, a restart or a change in between, if nothing else was found.

    These are criteria of a story, and other gains may mend them, as they mend what fails.
    """
    findings = wound(diagnostics)
    return frozenset(name for finding in findings for name in JUDGED[finding]) if findings <= _MENDED else frozenset()

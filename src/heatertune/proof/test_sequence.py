"""The test sequence of a proof: everything that goes wrong with a heater in use, one event after the other in one run.

Each part lasts as long as the slowest plausible heater needs and then continues at rest, so that a late oscillation
shows: ten of the loop's slowest periods where the power at rest is a new one, one period otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from heatertune.errors import InputError
from heatertune.heater.exact import time_to
from heatertune.model.loss_curve import slower_cooling
from heatertune.model.model_values import HeaterModel
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.heaters import MAINS_POWERS, RESERVE_PCT
from heatertune.proof.profile import Leg, Profile
from heatertune.proof.scenario import (
    Disturbance,
    Load,
    Mains,
    NewSetpoint,
    PlcPower,
    Scenario,
    SetpointRampEvent,
    TemperatureStep,
    can_hold,
    conditions,
    scenario_for,
)
from heatertune.units import check

__all__ = ["LoopTiming", "SequencePlan", "TestSequence", "story_for"]


#: scans by which instants differ that are the same
_SAME: Final = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """What the times of a story depend on beside the heaters.

    Attributes:
        scan_s, pwm_period_s, sample_time_s: of controller and switch [s].
        integral_time_s: TN as the words realise it; infinite or None: there is none [s].
        ramp_degC_per_min: of the setpoint; infinite: none.
        settling_s, recovery_s: that heat-up and recovery may take as specified; a part lasts so long or longer [s].
        soak_settles_s: time of a soak [s] → when in it the temperature has to be right [s].
        cold_degC: how near to the ambient a heater has to be before a profile [°C].
        again_degC: so far from the setpoint full power takes the heater back from the controller; None: nowhere [°C].
        forgets_degC: so far from the setpoint it has forgotten what it summed up, for certain; None: nowhere, or a
            boost's controller begins again only nearer [°C].
        cooling_gain: full power of a cooler as a part of the heater's; 0: there is none.
        small_change_degC: the least change of the setpoint whose overshoot is judged as a share of it; 0: none is
            [°C].
    """

    scan_s: float
    pwm_period_s: float
    sample_time_s: float
    integral_time_s: float | None = None
    ramp_degC_per_min: float = math.inf
    settling_s: float = 0.0
    recovery_s: float = 0.0
    soak_settles_s: Callable[[float], float] = LoopLimits().soak_settles_s
    cold_degC: float = 1.0
    again_degC: float | None = None
    forgets_degC: float | None = None
    cooling_gain: float = 0.0
    small_change_degC: float = 0.0

    def instant(self, seconds: float) -> float:
        """Return an instant, a scan's where it is one but for its last digits: a scan would miss what is later."""
        scans = round(seconds / self.scan_s)
        return scans * self.scan_s if abs(seconds / self.scan_s - scans) <= _SAME else seconds

    @property
    def step_s(self) -> float:
        """The longest of what happens in steps [s]."""
        return max(self.scan_s, self.pwm_period_s, self.sample_time_s)

    @property
    def beat_s(self) -> float:
        """The beat of PWM and TA, 0 where one is a multiple of the other [s]."""
        short, long = sorted((self.pwm_period_s, self.sample_time_s))
        apart = abs(long - round(long / short) * short)
        return 0.0 if apart <= 1e-6 * short else long * short / apart


@dataclass(frozen=True, slots=True, kw_only=True)
class SequencePlan:
    """A story made for heaters and words.

    Attributes:
        scenario: of each run.
        not_tested: parts that were left out and why, a few words each.
        told: what was made easier, likewise.
    """

    scenario: Scenario
    not_tested: tuple[str, ...]
    notes: tuple[str, ...]


#: periods of the loop's slowest motion that count as rest at a new power, and after any other part
_LONG_REST: Final = 10
_SHORT_REST: Final = 1
#: sums of lags and dead time that a loop may take beside what the heater itself needs
_LOOP_TIMES: Final = 5.0
#: a TN beyond so many sums of lags and dead time is no motion of the loop that a proof waits for
_SLOWEST_TN: Final = 20.0
_SLOWEST_BEAT: Final = 10.0  # of the slowest other period; a slower beat is a drift, which the loop follows
_HOT_OFF: Final = 0.1  # of the sum of lags and dead time: a PLC that is restarted while the heater is hot
_OPENED_TN: Final = 2.0  # for which the circuit is open
_NIGHT_TN: Final = 10.0
_EDGE_PCT: Final = 1.0  # power that decides at the edge of a window: no heater is known better
_COLD: Final = 0.95  # share of the way to the ambient after which a heater is cold
_LOW_SHARE: Final = 0.2  # of the setpoint step, where nobody tells the lower end of the setpoints of use
_SMALL_SHARE: Final = 0.05  # of the setpoint step: a small change of the setpoint, and times it
_SMALL: Final = (1.0, 2.0)
_ROUNDED: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class TestSequence:
    """Which parts there are after the heat-up, and how hard they are.

    Attributes:
        step_share: by which the temperature falls at once, of the setpoint step; 0: left out. The paper's is 0.3.
        load_pct: power that a load takes, and gives back later; less where that would leave a heater without reserve;
            0: left out [% of full power].
        opens: whether the heater's circuit is open for a while, the PLC running.
        changes: whether the setpoint changes down and up.
        setpoint_low_degC: lower end of the setpoints of use, of a cooler the upper one; None: the user stated no range,
            and the setpoint changes by a fifth of the setpoint step.
        mains: whether the mains voltage falls and rises by 10 %.
        restarts: whether the controller is restarted, with the heater hot and cold.
        paper_times: whether there is nothing but heat-up and temperature step at the paper's times, see `scenario_for`.
        profile: along which the setpoint is led at the end, from cold; None: along none.

    Raises:
        OutOfRange: a share or load that is negative or all of it.
        InputError: a profile beside the paper's times.
    """

    step_share: float = 0.3
    load_pct: float = 10.0
    opens: bool = True
    changes: bool = True
    setpoint_low_degC: float | None = None
    mains: bool = True
    restarts: bool = True
    paper_times: bool = False
    profile: Profile | None = None

    def __post_init__(self) -> None:
        check("step_share", self.step_share, least=0.0, most=0.99)
        check("load_pct", self.load_pct, least=0.0, most=99.0)
        if self.setpoint_low_degC is not None:
            check("setpoint_low_degC", self.setpoint_low_degC, least=-273.15)
        if self.paper_times and self.profile is not None:
            raise InputError("story paper-times is on: the paper's record has no profile; leave one of them out")


def story_for(
    models: Sequence[HeaterModel], loop: LoopTiming, story: TestSequence | None = None, *, setpoint_degC: float,
    ambient_degC: float | None = None, noise_degC: float = 0.0, seed: int = 0,
) -> SequencePlan:
    """Return a story in times that suit the slowest of the heaters.

    Args:
        models: the plausible heaters.
        loop: of the words.
        story: which parts; None: all.
        setpoint_degC: upper end of the setpoints of use [°C].
        ambient_degC: temperature without power; None: the models' own [°C].
        noise_degC: of the sensor, standard deviation [°C].
        seed: of that noise.

    Raises:
        InputError: no model, nobody knows the ambient temperature, or one of the heaters cannot follow the profile.
        OutOfRange: one of the heaters cannot hold the setpoint.
    """
    if not models:
        raise InputError("a test sequence needs at least one model")
    if story is not None and story.paper_times:
        record = scenario_for(models, setpoint_degC=setpoint_degC, ambient_degC=ambient_degC, noise_degC=noise_degC,
                              seed=seed)
        return SequencePlan(scenario=record, notes=("heat-up and temperature step at the paper's times",), not_tested=(
            "a load", "an open circuit of the heater", "a change of the setpoint", "mains voltage",
            "a restart of the controller"))
    plain = Scenario(setpoint_degC=setpoint_degC, ambient_degC=ambient_degC, duration_s=1.0, noise_degC=noise_degC,
                     seed=seed, setpoint_low_degC=None if story is None else story.setpoint_low_degC)
    teller = _SequenceBuilder(models=tuple(models),
                              ambients_degC=tuple(conditions(plain, model)[0] for model in models),
                     loop=loop, story=story or TestSequence(), setpoint_degC=setpoint_degC)
    parts = [teller.heat_up, *teller.parts()]
    # whole scans are counted, not seconds added: an event that is late by a last digit would be seen a scan later
    ends = (np.cumsum([teller.scans(part.limit_s + part.rest_s) for part in parts]) * loop.scan_s).tolist()
    events = tuple(replace(part.event, time_s=begin) for part, begin in zip(parts[1:], ends, strict=False)
                   if part.event is not None)
    scenario = replace(plain, duration_s=ends[-1], disturbances=events, rests_s=tuple(part.rest_s for part in parts))
    scenario = scenario if teller.story.profile is None else teller.along(teller.story.profile, scenario)
    return SequencePlan(scenario=scenario, not_tested=tuple(teller.not_tested()), notes=tuple(teller.notes()))


@dataclass(frozen=True, slots=True, kw_only=True)
class _SequenceStep:
    """An event, in how much time the loop has to be at rest after it, and how long it is watched there [s]."""

    event: Disturbance | None
    limit_s: float
    rest_s: float


@dataclass(frozen=True, kw_only=True)
class _SequenceBuilder:
    """Makes the parts; all events are at 1 s until they are put in order. What the parts share is worked out once."""

    models: tuple[HeaterModel, ...]
    ambients_degC: tuple[float, ...]
    loop: LoopTiming
    story: TestSequence
    setpoint_degC: float

    @cached_property
    def heat_up(self) -> _SequenceStep:
        """The first part."""
        return _SequenceStep(event=None, limit_s=max(self.way_s, self.loop.settling_s), rest_s=self.long_rest_s)

    def parts(self) -> Iterator[_SequenceStep]:
        """Return the parts after the heat-up, in order."""
        if self.story.step_share > 0.0:
            yield self._part(TemperatureStep(time_s=1.0, temperature_degC=-self.story.step_share * self.step_degC))
        yield from self._loads()
        if self.story.opens:
            for seconds in (*self._opened_s, *self._nearly_again_s):
                yield self._off(Mains(time_s=1.0, share=0.0), seconds)
                yield self._part(Mains(time_s=1.0, share=1.0), self.way_s)
            yield from self._at_the_edge()
        yield from self._changes()
        yield from self._small_changes()
        if self._mains_tested:
            for share in MAINS_POWERS:
                yield replace(self._part(Mains(time_s=1.0, share=share)), rest_s=self.long_rest_s)
            yield self._part(Mains(time_s=1.0, share=1.0))
        if self.story.restarts:
            for off_s in (_HOT_OFF * self.heater_s, self._longest_s(_COLD for _ in self.models)):
                yield self._off(PlcPower(time_s=1.0, on=False), off_s)
                yield self._part(PlcPower(time_s=1.0, on=True), self.way_s)

    def _changes(self) -> Iterator[_SequenceStep]:
        """Yield the changes to the lowest setpoint that is held, and to that of use where it is lower, and back.

        Where no power holds it the heater cools down for as long as the longest outage, and the controller sums up what
        it cannot take away.
        """
        if self.low_degC is None:
            return
        for low_degC in dict.fromkeys((self.low_degC, self._stated_low_degC)):
            ramp_s = 60.0 * abs(self.setpoint_degC - low_degC) / self.loop.ramp_degC_per_min
            if self._is_held(low_degC):
                yield _SequenceStep(event=NewSetpoint(time_s=1.0, setpoint_degC=low_degC),
                                    limit_s=self._cooling_s(low_degC) + self.loop_s + self._ramp_s,
                                    rest_s=self.long_rest_s)
            else:
                yield self._off(NewSetpoint(time_s=1.0, setpoint_degC=low_degC, unheld=True),
                                self._opened_s[-1] + ramp_s)
            yield self._part(NewSetpoint(time_s=1.0, setpoint_degC=self.setpoint_degC),
                             self.way_s - self._ramp_s + max(self._ramp_s, ramp_s))

    def _small_changes(self) -> Iterator[_SequenceStep]:
        """Yield small changes of the setpoint, down and up again: most of them without a limit of the output."""
        for change_degC in self._small_degC:
            for setpoint in (self.setpoint_degC - change_degC, self.setpoint_degC):
                change = NewSetpoint(time_s=1.0, setpoint_degC=setpoint, small=True)
                yield self._part(change, self.loop_s + self._ramp_s)

    @cached_property
    def _small_degC(self) -> list[float]:
        """The small changes of the setpoint, negative for a cooler; those beyond the lowest setpoint are left out."""
        least, low = self.loop.small_change_degC, self.low_degC
        if low is None or least == 0.0:
            return []
        small = max(_SMALL_SHARE * abs(self.step_degC), least)
        most = abs(self.setpoint_degC - low)
        return [math.copysign(times * small, self.step_degC) for times in _SMALL if times * small <= most]

    def _at_the_edge(self) -> Iterator[_SequenceStep]:
        """Yield two open circuits until the sum is forgotten, under a small load.

        Whether what is asked for at the edge leads on from there hangs on a hair of the heater, and there on the scan.
        """
        pct, falls = min(_EDGE_PCT, 0.5 * self._reserve_pct()), self._falls_s(self.loop.forgets_degC)
        if not falls:
            return
        yield self._off(Mains(time_s=1.0, share=0.0), falls[0])
        yield self._off(Load(time_s=1.0, power_pct=-pct), max(model.dead_time_s for model in self.models))
        yield self._part(Mains(time_s=1.0, share=1.0), self.way_s)
        yield self._off(Mains(time_s=1.0, share=0.0), falls[-1])
        yield self._part(Mains(time_s=1.0, share=1.0), self.way_s)
        yield self._part(Load(time_s=1.0, power_pct=pct))

    def _loads(self) -> Iterator[_SequenceStep]:
        if self.load_pct > 0.0:
            yield replace(self._part(Load(time_s=1.0, power_pct=-self.load_pct)), rest_s=self.long_rest_s)
            yield self._part(Load(time_s=1.0, power_pct=self.load_pct))
        if self.heating_load_pct > 0.0:
            for load in (self.heating_load_pct, -self.heating_load_pct):
                yield replace(self._part(Load(time_s=1.0, power_pct=load), self.way_s), rest_s=self.long_rest_s)

    def along(self, profile: Profile, scenario: Scenario) -> Scenario:
        """Return the story with a profile at its end, led from the first heater's ambient on, the heaters being cold.

        A profile's times are its own, no whole scans.
        """
        profile.demand_followed(list(zip(self.models, self.ambients_degC, strict=True)))
        cold = 1.0 - min(1.0 - _COLD, self.loop.cold_degC / abs(self.step_degC))
        off_s, legs = scenario.duration_s, self._legs(profile)
        on_s = self.loop.instant(off_s + self.scans(self._longest_s(cold for _ in self.models)) * self.loop.scan_s)
        led = [SetpointRampEvent(time_s=self.loop.instant(on_s + leg.begin_s), from_degC=leg.from_degC,
                                 setpoint_degC=leg.to_degC, duration_s=leg.duration_s) for leg in legs]
        ends = [*(event.time_s for event in led[1:]), self.loop.instant(led[-1].time_s + led[-1].duration_s)]
        rests = [min(self._judged_s(leg), end - event.time_s) for leg, event, end in zip(legs, led, ends, strict=True)]
        return replace(scenario, duration_s=ends[-1], rests_s=(*scenario.rests_s, 0.0, *rests),
                       disturbances=(*scenario.disturbances, PlcPower(time_s=off_s, on=False), *led))

    def scans(self, seconds: float) -> int:
        """Return the scans of whole PWM periods, of the next longer time."""
        scan, step = self.loop.scan_s, max(self.loop.scan_s, self.loop.pwm_period_s)
        return math.ceil(math.ceil(seconds / step - _ROUNDED) * step / scan - _ROUNDED)

    def not_tested(self) -> Iterator[str]:
        """Return what is left out, and why."""
        story = self.story
        if story.step_share == 0.0:
            yield "a step of the temperature"
        yield from self._loads_not_tested()
        if not story.opens:
            yield "an open circuit of the heater"
        yield from self._changes_not_tested()
        if not story.mains:
            yield "mains voltage"
        elif not self._mains_tested:
            yield f"mains voltage (at −10 % a heater has {self._reserve_pct(MAINS_POWERS[0]):.3g} % of power left over)"
        if not story.restarts:
            yield "a restart of the controller"
        if self.period_s < self.loop.beat_s:
            yield f"the beat of PWM and TA as a whole, {self.loop.beat_s:.3g} s"
        legs = self._legs(story.profile)
        arrived = {leg.segment for leg in legs if self._judged_s(leg) > 0.0}
        yield from (f"whether segment {number} of the profile arrives (no soak longer than what it may settle in)"
                    for number in dict.fromkeys(leg.segment for leg in legs) if number not in arrived)

    def _changes_not_tested(self) -> Iterator[str]:
        if self.low_degC is None:
            yield "a change of the setpoint"
            return
        if self.loop.small_change_degC > 0.0 and not self._small_degC:
            least = self.loop.small_change_degC
            yield f"a small change of the setpoint (none from {least:.3g} °C on is within its range)"
        if self.loop.cooling_gain > 0.0 and not self._is_held(self._stated_low_degC):
            yield f"rest at {self._stated_low_degC:.4g} °C, which the cooler has to hold"

    def _loads_not_tested(self) -> Iterator[str]:
        if self.story.load_pct == 0.0:
            yield "a load"
        elif self.load_pct == 0.0:
            yield f"a load (a heater has {self._reserve_pct():.3g} % of power left over)"
        if self.loop.cooling_gain > 0.0 and self.heating_load_pct == 0.0:
            yield "a load that has to be cooled away"

    def notes(self) -> Iterator[str]:
        """Return what is made easier."""
        if 0.0 < self.load_pct < self.story.load_pct:
            yield f"load of {self.load_pct:.3g} % in place of {self.story.load_pct:.3g} %: no more power is left over"
        if self.low_degC not in (None, self._stated_low_degC):
            low, ambient = self._stated_low_degC, max(self.ambients_degC, key=self._height)
            why = (f"{low:.4g} °C is too close to" if self._is_held(low) else f"no power holds {low:.4g} °C at")
            yield f"{self.low_degC:.4g} °C is run as the lowest setpoint too: {why} an ambient of {ambient:.4g} °C"

    @cached_property
    def step_degC(self) -> float:
        """The largest setpoint step, negative for a cooler."""
        return max((self.setpoint_degC - ambient for ambient in self.ambients_degC), key=abs)

    @cached_property
    def heater_s(self) -> float:
        """The largest sum of lags and dead time."""
        return max(sum(model.lags_s) + model.dead_time_s for model in self.models)

    @cached_property
    def loop_s(self) -> float:
        """What a loop may take."""
        return _LOOP_TIMES * self.heater_s

    @cached_property
    def integral_time_s(self) -> float:
        """TN, or what stands for it: the heater's own time where there is none."""
        tn = self.loop.integral_time_s
        return self.heater_s if tn is None or math.isinf(tn) else min(tn, _SLOWEST_TN * self.heater_s)

    @cached_property
    def period_s(self) -> float:
        """The slowest period of what may move at rest."""
        own = max(self.loop.pwm_period_s, 2.0 * math.pi * self.integral_time_s)
        return max(own, min(self.loop.beat_s, _SLOWEST_BEAT * own))

    @cached_property
    def long_rest_s(self) -> float:
        """How long a loop is watched at rest at a power that no part before it had."""
        return _LONG_REST * self.period_s

    @cached_property
    def way_s(self) -> float:
        """In which the setpoint has to be reached from cold: at full power, and what loop and ramp take."""
        shares = ((self.setpoint_degC - ambient) / (100.0 * model.gain_degC_per_pct)
                  for model, ambient in zip(self.models, self.ambients_degC, strict=True))
        return self._longest_s(shares) + self.loop_s + self._ramp_s

    @cached_property
    def load_pct(self) -> float:
        """The load that leaves every heater its reserve."""
        return max(0.0, min(self.story.load_pct, self._reserve_pct() - RESERVE_PCT))

    @cached_property
    def heating_load_pct(self) -> float:
        """The load that heats so that the cooler has to hold the setpoint of every heater; 0: none."""
        powers = self._held_pct()
        cooled = min(self.story.load_pct, 100.0 * self.loop.cooling_gain - RESERVE_PCT - (max(powers) - min(powers)))
        return max(powers) + cooled if cooled > 0.0 else 0.0

    @cached_property
    def low_degC(self) -> float | None:
        """The lowest setpoint of use that every heater holds, None where none is tested."""
        low = self._stated_low_degC
        if not self.story.changes or self._height(low) >= self._height(self.setpoint_degC):
            return None
        return max(low, *map(self._least_degC, self.ambients_degC), key=self._height)

    @cached_property
    def _stated_low_degC(self) -> float:
        """The lower end of the setpoints of use, whether or not a heater can hold it."""
        low = self.story.setpoint_low_degC
        return self.setpoint_degC - _LOW_SHARE * self.step_degC if low is None else low

    def _least_degC(self, ambient_degC: float) -> float:
        """Compute the lowest setpoint at which a heater in its ambient shows whether the loop holds it [°C].

        Within the tolerance of the setpoint a heater without power is right, too: it is two tolerances above the
        ambient, or half of the rise where that is less.
        """
        step, least = self.setpoint_degC - ambient_degC, self.loop.small_change_degC
        return ambient_degC + math.copysign(min(least or _SMALL_SHARE * abs(step), 0.5 * abs(step)), step)

    def _is_held(self, setpoint_degC: float) -> bool:
        return all(can_hold(model, setpoint_degC, ambient)
                   for model, ambient in zip(self.models, self.ambients_degC, strict=True))

    def _height(self, temperature_degC: float) -> float:
        """Return a temperature, of a cooler with the other sign: the power leads upwards."""
        return math.copysign(1.0, self.step_degC) * temperature_degC

    def _legs(self, profile: Profile | None) -> list[Leg]:
        return [] if profile is None else list(profile.legs(self.ambients_degC[0], self.heater_s))

    def _judged_s(self, leg: Leg) -> float:
        """Return how much of a leg, at its end, is held against the band of soaks [s]."""
        return max(0.0, leg.duration_s - self.loop.soak_settles_s(leg.duration_s)) if leg.soaks else 0.0

    def _part(self, event: Disturbance, limit_s: float | None = None) -> _SequenceStep:
        return _SequenceStep(event=event,
                             limit_s=max(self.loop_s, self.loop.recovery_s) if limit_s is None else limit_s,
                     rest_s=_SHORT_REST * self.period_s)

    def _off(self, event: Disturbance, seconds: float) -> _SequenceStep:
        return _SequenceStep(event=event, limit_s=seconds, rest_s=0.0)

    @cached_property
    def _opened_s(self) -> list[float]:
        """How long the circuit is open: the I part asks for much, the heater is warm; and for a night.

        For what it winds up without a limit, that is how it is found out.
        """
        cold_s = self._longest_s(_COLD for _ in self.models)
        return [max(_OPENED_TN * self.integral_time_s, self.heater_s), max(_NIGHT_TN * self.integral_time_s, cold_s)]

    @cached_property
    def _nearly_again_s(self) -> list[float]:
        """How long an open circuit winds the controller up most: a boost nearly takes the heater back, but does not.

        The fastest heater's time and the slowest one's. The dead time is no part of it: a circuit that closes again
        lets the reading fall for as long as it took to begin.
        """
        falls = [seconds - 2.0 * self.loop.step_s for seconds in self._falls_s(self.loop.again_degC)]
        ends = falls if falls and falls[-1] - falls[0] > self.loop.step_s else falls[-1:]
        return [seconds for seconds in ends if seconds > 0.0]

    def _falls_s(self, distance_degC: float | None) -> list[float]:
        """Return in what time the fastest heater and the slowest fall so far by themselves; none: no way is so long."""
        if distance_degC is None or distance_degC >= abs(self.step_degC):
            return []
        shares = (distance_degC / abs(self.setpoint_degC - ambient) for ambient in self.ambients_degC)
        falls = [time_to(share if share < 1.0 else _COLD, *model.lags_s)
                 for model, share in zip(self.models, shares, strict=True)]
        return [min(falls), max(falls)]

    @cached_property
    def _mains_tested(self) -> bool:
        return self.story.mains and self._reserve_pct(MAINS_POWERS[0]) >= RESERVE_PCT

    def _reserve_pct(self, mains: float = 1.0) -> float:
        """Return the least power that is left over at the setpoint [% of full power]."""
        return 100.0 - max(self._held_pct(mains))

    def _held_pct(self, mains: float = 1.0) -> list[float]:
        return [(self.setpoint_degC - ambient) / (mains * model.gain_degC_per_pct)
                for model, ambient in zip(self.models, self.ambients_degC, strict=True)]

    def _cooling_s(self, low_degC: float) -> float:
        most = 100.0 * self.loop.cooling_gain
        shares = ((self.setpoint_degC - low_degC) / (self.setpoint_degC - ambient + most * model.gain_degC_per_pct)
                  for model, ambient in zip(self.models, self.ambients_degC, strict=True))
        return self._longest_s(shares) * max(slower_cooling(model, low_degC) for model in self.models)

    @cached_property
    def _ramp_s(self) -> float:
        return 60.0 * abs(self.step_degC) / self.loop.ramp_degC_per_min

    def _longest_s(self, shares: Iterator[float]) -> float:
        """Return the longest time in which a heater does a share of its way, each its own."""
        return max(model.dead_time_s + time_to(share, *model.lags_s)
                   for model, share in zip(self.models, shares, strict=True))

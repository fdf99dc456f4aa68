"""The temperature band that a proof predicts after a write of words, and the watch that compares readings with it.

The band comes from the worst of all runs of the proof: overshoot, settling time, and the band at rest; it contains no
loads. An oscillating loop is met at any phase: its slope gives the difference between its power and the holding power,
and the new words may overshoot as they would after a load of that size.

Two readings in a row outside the band end the watch. Until the new words can have an effect, readings are compared
with what any words could do since the last reading, the first of which precedes the write. After that the band alone
decides.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import linear_regression
from typing import Any, Final

import numpy as np

from heatertune.errors import LinkError
from heatertune.live.poller import StillSensor, reading_problem
from heatertune.live.write.plc_block import BlockSnapshot, Peer, runs
from heatertune.live.write.proven_words import ProvenWords
from heatertune.live.write.write_record import WriteRecord
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid.sampled_loop import horizon, respond
from heatertune.plc import Words, controller_for
from heatertune.plc.ramp import Number
from heatertune.proof.heaters import MAINS_POWERS, labelled_heaters
from heatertune.proof.scenario import delay_heater
from heatertune.proof.specification import highest_temperature
from heatertune.settings import Conditions
from heatertune.units import count

__all__ = ["Band", "Reach", "RiseWatch", "WatchResult", "band_degC", "carried_s", "highest_message",
           "unseen_s", "watch_response", "watched_s"]


_TIMES: Final = 5.0  # lags and dead time of the slowest heater
_PERIODS: Final = 3.0  # of PWM
_SIGMAS: Final = 3.0
_FASTER: Final = 2.0  # than the fastest plausible heater: what the fit does not know of it
_CLEAR: Final = 5.0  # times what two readings cannot tell, and how late they may be: as long is a rise looked at
_IN_A_ROW: Final = 2  # readings outside that are more than a disturbed one
_SMALL: Final = 0.25  # of the rise from the ambient: up to there a change of the setpoint counts as a small one


def watched_s(proven: ProvenWords) -> float:
    """Return how long a response is watched: 5 (T + L) of the slowest plausible heater, 3 PWM periods at least [s]."""
    return max(_TIMES * proven.slowest_s, _PERIODS * proven.view.actuator.pwm_period_s)


def band_degC(proven: ProvenWords) -> float:
    """Return how far from the setpoint a loop at rest may swing, as the proof judged it [°C]."""
    return proven.view.criteria["limit_cycle"].limit or proven.view.limits.tolerance_degC


def unseen_s(proven: ProvenWords) -> float:
    """Return how long no reading can tell of new words: the shortest dead time, a PWM period at least [s]."""
    dead = min(model.dead_time_s for _, model in labelled_heaters(proven.fitted_model))
    return max(dead, proven.view.actuator.pwm_period_s)


def carried_s(proven: ProvenWords) -> float:
    """Return for how long a slope seems to go on under the words, worst of all heaters [s]; 0 where they are no PID.

    A slope is that of too much power, by slope · lags / gain; a load of as much takes the linear loop of the words on
    that heater so far away.
    """
    words = proven.words
    controller = controller_for(words.target)
    design = controller.decode(words)
    if design is None:
        return 0.0
    late = [delay_heater(model, controller.delayed_s(words.scaling)) for _,
            model in labelled_heaters(proven.fitted_model)]
    return max(
        float(np.abs(respond(model, design, horizon(model, design), load_pct=1.0)).max())
        * sum(model.lags_s) / abs(model.gain_degC_per_pct) for model in late)


class Reach:
    """How far a temperature can get within a time: full power, or none, on the fastest of the plausible heaters.

    A smaller lag comes before the larger one and makes it slower, never faster. A heater twice as fast as the fastest
    possible one is within reach, as its lag and gain are fitted ones.

    Attributes:
        heaters: that are plausible.
    """

    def __init__(self, words: Words, fitted: FittedModel, noise_degC: float, cooling: float = 0.0) -> None:
        """Take the plausible heaters, and what a reading cannot tell.

        Args:
            words: of the controller.
            fitted: the heater.
            noise_degC: of the sensor, standard deviation [°C].
            cooling: gain of a cooler, as a share of the heater's; 0: there is none.
        """
        self.heaters: Sequence[HeaterModel] = [model for _, model in labelled_heaters(fitted)]
        heaters, most_pct = self.heaters, 100.0 * max(MAINS_POWERS)
        self._ends_degC = [sorted(float(model.ambient_degC or 0.0) + model.gain_degC_per_pct * power
                                  for power in (-cooling * most_pct, most_pct)) for model in heaters]
        self._lags_s = [max(model.lags_s) for model in heaters]
        self._unread_degC = 2.0 * _unread_degC(words, fitted, noise_degC)  # of both readings
        #: a reading may be as old as the scan and the module make it
        self._late_s = words.sample_time_s + controller_for(words.target).delayed_s(words.scaling)

    @classmethod
    def from_proof(cls, proven: ProvenWords) -> Reach:
        """Return that of a proof's heaters."""
        return cls(proven.words, proven.fitted_model, proven.view.scenario.noise_degC,
                   proven.view.actuator.cooling_gain or 0.0)

    @property
    def rate_degC_per_s(self) -> float:
        """The largest rise of all, of a cold heater [°C/s]."""
        return max(_FASTER * (hottest - coldest) / lag_s
                   for (coldest, hottest), lag_s in zip(self._ends_degC, self._lags_s, strict=True))

    @property
    def window_s(self) -> float:
        """Within which the largest rise is well beyond what a reading cannot tell [s]."""
        return _CLEAR * (self._unread_degC / self.rate_degC_per_s + self._late_s)

    def at(self, degC: float, passed_s: float) -> tuple[float, float]:
        """Compute the lowest and the highest temperature so long after a reading [°C]; all, where time runs back."""
        if not passed_s >= 0.0:
            return -math.inf, math.inf
        lows, highs = list[float](), list[float]()
        for (coldest, hottest), lag_s in zip(self._ends_degC, self._lags_s, strict=True):
            share = -math.expm1(-_FASTER * (passed_s + self._late_s) / lag_s)
            lows.append(min(0.0, coldest - degC) * share)
            highs.append(max(0.0, hottest - degC) * share)
        return degC + min(lows) - self._unread_degC, degC + max(highs) + self._unread_degC


class RiseWatch:
    """Tells a temperature that rises faster than a heater twice as fast as the fastest plausible one, at full power."""

    def __init__(self, reach: Reach) -> None:
        """Take what is within reach."""
        self._reach, self._latest, self._row = reach, deque[tuple[float, float]](), 0

    def see(self, time_s: float, degC: float) -> str:
        """Take a reading [s], [°C]; return why it rises too fast where two in a row do, a sentence; else nothing."""
        while len(self._latest) > 1 and not 0.0 <= time_s - self._latest[0][0] <= self._reach.window_s:
            self._latest.popleft()  # too old, or later than now: the PLC counts again
        since_s, from_degC = self._latest[0] if self._latest else (time_s, degC)
        highest = self._reach.at(from_degC, time_s - since_s)[1]
        self._row = 0 if degC <= highest else self._row + 1
        if not self._row:
            self._latest.append((time_s, degC))
        return "" if self._row < _IN_A_ROW else (
            f"the temperature has risen from {from_degC:.4g} to {degC:.4g} °C within {time_s - since_s:.3g} s: "
            f"{_FASTER:g} times as fast as the fastest plausible heater, at full power, gets to {highest:.4g} °C")


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The band, from an instant on.

    Attributes:
        setpoint_degC: around which it is [°C].
        off_degC: how far from the setpoint the temperature was at that instant, above it positive [°C].
        carried_degC: how far it was on its way from there, upwards positive [°C].
        overshoot: worst proven, as a share of the way.
        settles_s: after which it is settled [s].
        rest_degC: how far from the setpoint it is then, what a reading cannot tell included [°C].
        beyond_degC: how much farther it may be until then, on both sides, where nobody knows how it came there [°C].
    """

    setpoint_degC: float
    off_degC: float
    carried_degC: float
    overshoot: float
    settles_s: float
    rest_degC: float
    beyond_degC: float = 0.0

    @classmethod
    def of(
        cls, proven: ProvenWords, setpoint_degC: float, temperature_degC: float, carried_degC: float = 0.0, *,
        mid_way: bool = False,
    ) -> Band:
        """Return the band of a proof from where the temperature is, and how far it is on its way.

        Args:
            proven: whose band it is.
            setpoint_degC: around which it is [°C].
            temperature_degC: where the temperature is [°C].
            carried_degC: see `Band`.
            mid_way: whether it may be anywhere in a heat-up from the ambient.
        """
        criteria = proven.view.criteria
        overshoots = {unit: [each.value for name, each in criteria.items() if name.endswith("overshoot")
                             and each.unit == unit] for unit in ("%", "% of rise", "% of change")}
        settles = [each.value for name, each in criteria.items() if name in ("settling_time", "recovery_time")]
        cold = [float(model.ambient_degC or 0.0) for _, model in labelled_heaters(proven.fitted_model)]
        whole, off = max(abs(setpoint_degC - ambient) for ambient in cold), abs(temperature_degC - setpoint_degC)
        judged = overshoots["%"] + overshoots["% of rise"] + overshoots["% of change"] * (off <= _SMALL * whole)
        overshoot = max(judged, default=0.0) / 100.0
        return cls(
            setpoint_degC=setpoint_degC, off_degC=temperature_degC - setpoint_degC, carried_degC=carried_degC,
            overshoot=overshoot, beyond_degC=overshoot * max(0.0, whole - off) if mid_way else 0.0,
            settles_s=max(settles, default=math.inf), rest_degC=band_degC(proven) + _unread_degC(
                proven.words, proven.fitted_model, proven.view.scenario.noise_degC))

    def at(self, since_s: float) -> tuple[float, float]:
        """Return the lowest and the highest temperature so long after its instant [°C]."""
        low = high = self.rest_degC + (self.beyond_degC if since_s <= self.settles_s else 0.0)
        for way in (self.off_degC, self.carried_degC) if since_s <= self.settles_s else ():
            below, above = sorted((way, -self.overshoot * way))
            low, high = low - below, high + above
        return self.setpoint_degC - low, self.setpoint_degC + high

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        return {name: getattr(self, name) for name in self.__slots__}


def highest_message(conditions: Conditions, degC: float) -> str:
    """Return that a reading is at the highest temperature of the specification; empty where it is below."""
    highest = highest_temperature(conditions)
    return "" if highest is None or degC < highest else (
        f"{degC:.4g} °C: the specification or interlock allows less than {highest:g} °C")


def _unread_degC(words: Words, fitted: FittedModel, noise_degC: float) -> float:
    """Return the resolution of a reading plus the residual of the best plausible heater on its own log [°C]."""
    count = words.scaling.span_degC / controller_for(words.target).sensor(words.scaling).counts
    left = [each.rmse_degC for each in fitted.candidates if math.isfinite(each.rmse_degC)]
    return max(_SIGMAS * noise_degC, count) + min(left, default=0.0)


_SAME_DEGC: Final = 1e-6
#: without a new reading so long, the CPU stands [s], [sampling intervals]
_STILL_S: Final = 5.0
_STILL: Final = 4.0
#: so long nobody may look [s]: connections that are tried again take their time
_ASLEEP_S: Final = 20.0
_DISTURBED: Final = 0.01  # of the readings: so many may be none
_NOTHING_NEW: Final = 0.5  # of the watched time without a change of a single byte: nobody knows whether it goes on


@dataclass(frozen=True, slots=True)
class WatchResult:
    """How a watch ended.

    Attributes:
        outside: why the words have to be taken back, a sentence; nothing where they need not.
        ended_early: why it was not watched to its end; nothing where it was.
        seconds: that were watched, of the plant [s].
        count: of readings.
        most: the largest share of the band that was used.
        stands: all words, as they were seen last; None: never.
    """

    outside: str
    ended_early: str
    seconds: float
    count: int
    most: float
    stands: Mapping[str, Number] | None


def watch_response(
    peer: Peer, record: WriteRecord, proven: ProvenWords, expected: Mapping[str, Number],
    before: Iterable[BlockSnapshot] = (),
    progress: Callable[[str], object] = str,
) -> WatchResult:
    """Watch the response to words.

    Args:
        peer: the PLC.
        record: that every new reading goes into.
        proven: whose band it is.
        expected: all words, as they were written.
        before: what was seen from right before the write on.
        progress: called with how far it is.

    Raises:
        RecordBroken: the record cannot be written.
    """
    watch = _Watch(peer, record, proven, before)
    try:
        while watch.seconds < watch.duration_s:
            look = peer.look()
            watch.stands = look.values
            if changed := _changed(peer, look, expected):
                return watch.ended(early=f"somebody has changed the words: {changed}")
            if gap := watch.asleep() or watch.stands_still(look):
                return watch.ended(early=gap)
            if outside := watch.see(look):
                return watch.ended(outside=outside)
            progress(watch.state_text)
            peer.pause()
    except LinkError as problem:
        return watch.ended(early=str(problem))
    except KeyboardInterrupt:
        return watch.ended(early="interrupted")
    return watch.ended(early=watch.unsure())


class _Watch:
    """A watch that is under way."""

    def __init__(self, peer: Peer, record: WriteRecord, proven: ProvenWords, before: Iterable[BlockSnapshot]) -> None:
        self._peer, self._record, self._proven = peer, record, proven
        self.duration_s, self.seconds, self.state_text = watched_s(proven), 0.0, "watching"
        self._first: BlockSnapshot | None = None
        self._last: BlockSnapshot | None = None
        self._moved = self._since_s = self._most = 0.0
        self._band: Band | None = None
        self._unseen_s, self._carried_s = unseen_s(proven), carried_s(proven)
        self._way: deque[tuple[float, float]] = deque()
        self._shows = False
        self._count = self._outside = self._unusable = self._unusable_row = 0
        self._sensor_degC = proven.words.scaling.sensor_degC
        self._still = StillSensor([model for _, model in labelled_heaters(proven.fitted_model)], band_degC(proven))
        self._content, self._changed_s = b"", 0.0
        self._reach, self._believed = Reach.from_proof(proven), (math.nan, math.nan)
        self._rise = RiseWatch(self._reach)
        self._jumped_before, self._looked_s = self._see_before(before), peer.clock.now_s()
        self.stands: Mapping[str, Number] | None = None

    def asleep(self) -> str:
        """Return that nobody has looked for too long, a sentence; empty where somebody has."""
        now_s = self._peer.clock.now_s()
        away_s, self._looked_s = now_s - self._looked_s, now_s
        if away_s <= max(_ASLEEP_S, _STILL * self._proven.words.sample_time_s):
            return ""
        return f"nobody looked for {away_s:.0f} s: this machine was asleep, or the program stopped"

    def stands_still(self, look: BlockSnapshot) -> str:
        """Return that the CPU is in STOP, or nothing new has come for long; takes note of what is new."""
        now = self._peer.clock.now_s()
        if runs(look) is False:
            return "the CPU is in STOP"
        if self._is_new(look):
            self._moved = now
        still = now - self._moved <= max(_STILL_S, _STILL * self._proven.words.sample_time_s)
        return "" if still else "the CPU runs no scan"

    def see(self, look: BlockSnapshot) -> str:
        """Take a reading; return why the words have to be taken back, nothing where they need not."""
        if not self._is_new(look):
            return ""
        degC, setpoint_degC = (self._peer.standing.signal(look.content, role) for role in ("temperature", "setpoint"))
        self._first, self._last = self._first or look, look
        self.seconds = look.time_s - self._first.time_s
        if look.content != self._content:
            self._content, self._changed_s = look.content, self.seconds
        problem = reading_problem(degC, self._sensor_degC)
        problem = problem or ("" if math.isfinite(setpoint_degC) else "the setpoint is not a number")
        problem = problem or ("" if math.isfinite(self._power(look)) else "the power is not a number")
        self._unusable_row = self._unusable_row + 1 if problem else 0
        if problem:
            self._unusable += 1
            self._record.write_line("unusable", s=round(self.seconds, 3), message=problem, **look.to_document())
            return problem if self._unusable_row >= _IN_A_ROW else ""
        rise = self._rise.see(look.time_s, degC)
        if stop := highest_message(self._proven.conditions, degC) or self._frozen(look, degC):
            return stop
        if self._jumped_before:
            return self._jumped_before
        if not self._shows and (jump := self._jump(look, degC)):
            self._outside += 1
            self._record.write_line("jumped", s=round(self.seconds, 3), message=jump, **look.to_document())
            return jump if self._outside >= _IN_A_ROW else ""
        self._way.append((look.time_s, degC))
        while look.time_s - self._way[0][0] > self._unseen_s and len(self._way) > 2:
            self._way.popleft()
        shows = self.seconds >= self._unseen_s and len(self._way) > 1
        if self._band is None or shows != self._shows or abs(setpoint_degC - self._band.setpoint_degC) > _SAME_DEGC:
            self._band, self._since_s, self._shows = self._band_from(setpoint_degC, degC), look.time_s, shows
            self._record.write_line("band", **self._band.to_document())
        low, high = self._band.at(look.time_s - self._since_s)
        low, high = (low, high) if shows else (min(low, degC), max(high, degC))
        used = abs(2.0 * degC - low - high) / (high - low)
        self._outside = 0 if used <= 1.0 else self._outside + 1
        self._count, self._most = self._count + 1, max(self._most, used)
        self._record.write_line("watched", s=round(self.seconds, 3), temperature_degC=degC, low_degC=low,
                                high_degC=high,
                         **look.to_document())
        between = f"the proven band, {low:.4g} to {high:.4g} °C"
        self.state_text = f"{degC:.4g} °C in {between}, {self.seconds:.0f} of {self.duration_s:.0f} s"
        return f"{degC:.4g} °C is outside of {between}" if self._outside >= _IN_A_ROW else rise if shows else ""

    def _see_before(self, looks: Iterable[BlockSnapshot]) -> str:
        """Take the looks from before the watch; return why readings have jumped in them; empty where they have not."""
        content = b""
        for look in looks:
            degC = self._peer.standing.signal(look.content, "temperature")
            if look.content == content or reading_problem(degC, self._sensor_degC):
                continue  # the same reading again, or none
            content = look.content
            jump = self._jump(look, degC)
            self._outside = self._outside + 1 if jump else 0
            if jump:
                self._record.write_line("jumped", s=0.0, message=jump, **look.to_document())
            if self._outside >= _IN_A_ROW:
                return jump
        return ""

    def _jump(self, look: BlockSnapshot, degC: float) -> str:
        """Return why no heater can have led from the last reading to this one; empty where one can.

        From then on, what is believed is the last one that could be.
        """
        since_s, from_degC = self._believed if math.isfinite(self._believed[0]) else (look.time_s, degC)
        passed_s = look.time_s - since_s
        low, high = self._reach.at(from_degC, passed_s)
        if low <= degC <= high:
            self._believed = look.time_s, degC
            return ""
        return (f"the reading has jumped from {from_degC:.4g} to {degC:.4g} °C within {passed_s:.3g} s, in which the "
                f"heater gets to {low:.4g} to {high:.4g} °C at most")

    def _frozen(self, look: BlockSnapshot, degC: float) -> str:
        """Return why the sensor is frozen; empty where it need not be, or where the block does not show the power."""
        if "power" not in self._peer.standing.block.signals:
            return ""
        return self._still.see(self.seconds, degC, self._power(look))

    def _power(self, look: BlockSnapshot) -> float:
        """Return the power that the block shows [%]; 0 where it shows none."""
        there = self._peer.standing
        return there.signal(look.content, "power") if "power" in there.block.signals else 0.0

    def unsure(self) -> str:
        """Return why the whole watch shows nothing; empty where it shows that the words do well."""
        if not self._count:
            return "no reading could be used"
        if not self._unusable <= _DISTURBED * self._count:
            return f"{count(self._unusable, 'reading')} of {self._unusable + self._count} could not be used"
        still_s = self.seconds - self._changed_s
        has_stamp = self._last is not None and (self._last.status is not None or self._last.life.stamp is not None)
        if self._last is not None and not has_stamp and not still_s < _NOTHING_NEW * self.duration_s:
            return (f"no byte of the block has changed for {still_s:.0f} s: a CPU that stands, a frozen sensor and a "
                    "loop at rest look the same")
        return ""

    def _band_from(self, setpoint_degC: float, temperature_degC: float) -> Band:
        slope = linear_regression(*zip(*self._way, strict=True)).slope if len(self._way) > 1 else 0.0
        return Band.of(self._proven, setpoint_degC, temperature_degC, slope * self._carried_s)

    def _is_new(self, look: BlockSnapshot) -> bool:
        return self._last is None or look.is_new(self._last) is not False

    def ended(self, outside: str = "", early: str = "") -> WatchResult:
        """Return the end."""
        return WatchResult(outside, early, self.seconds, self._count, self._most, self.stands)


def _changed(peer: Peer, look: BlockSnapshot, expected: Mapping[str, Number]) -> str:
    return ", ".join(f"{name} is {look.values[name]:g}, not {expected[name]:g}" for name in peer.standing.own
                     if look.values[name] != expected[name])

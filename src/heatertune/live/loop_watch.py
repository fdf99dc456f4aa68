"""A running loop compared with its proven band, and the monitor of `heatertune supervise` on it. Read only.

Reported are readings outside the band, oscillation, and a change of the power that holds the setpoint. A load (an open
door) also leaves the band, which describes the controller alone.

The monitor needs every scan. Up to a tenth of them may be missing, three in a row at most: these are interpolated, and
do not count for a reading that stands still. After a longer gap it restarts, as after a power failure.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from statistics import fmean
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError, LinkError
from heatertune.live.client.connection import Address
from heatertune.live.poller import Snapshot, StillSensor, reading_problem
from heatertune.live.write.band import Band, Reach, RiseWatch, band_degC, highest_message, watched_s
from heatertune.live.write.plc_block import LinkSettings, Peer, block_image
from heatertune.live.write.proven_words import ProvenWords
from heatertune.plc import Words
from heatertune.plc.keyed_entry import value_texts
from heatertune.proof.heaters import labelled_heaters
from heatertune.supervision.faulty_loops import whole_pct
from heatertune.supervision.monitor import ALARMS, Numbers, cold, in_a_row, restart, scan, unseen
from heatertune.supervision.monitor_design import SupervisionView
from heatertune.units import count

__all__ = ["Alarm", "BandWatch", "OnlineMonitor", "RestWatch", "StillTime", "WatchStats", "others_there"]


_ONLINE_MONITOR_IN_A_ROW: Final = 3  # scans that may be missed
_SEEN: Final = 10  # scans for each that is
_FAR_PCT: Final = 1000.0  # beyond all that a controller asks for


@dataclass(slots=True)
class Alarm:
    """An alarm: the scans that gave it, the first and the last one [s of the log]."""

    name: str
    scans: int
    from_s: float
    to_s: float


class OnlineMonitor:
    """Takes looks in their order.

    Attributes:
        view: what supervision.json holds.
        needs: scans in a row, see `heatertune.supervision.monitor.in_a_row`.
        scans: that were seen.
        missed: that were not, and taken from a straight line.
        begun_anew: times, after longer gaps and restarts of the PLC.
        watched: scans that came after so many in a row.
        passed: scans of the PLC, from the first that was seen to the last.
        alarms: by their names, in the order of their first scans.
        highest_degC: setpoint so far.
    """

    def __init__(self, view: SupervisionView, words: Words) -> None:
        """Begin, with what supervision.json holds and the words that run there.

        Raises:
            InputError: it was made for other words.
        """
        if (view.target, view.words) != (words.target, words.values):
            raise InputError(f"the monitor was made for other words, of {view.target}; heatertune supervise makes one "
                             "for these")
        self.view, self.alarms = view, dict[str, Alarm]()
        self.scans = self.missed = self.begun_anew = self.watched = self.passed = 0
        self.highest_degC = -math.inf
        self._numbers, self._state = Numbers(**view.numbers), cold()
        self.needs, self._row = in_a_row(self._numbers), 0
        self._last: tuple[int, int, int] | None = None  # scan, reading, power
        self._may_miss = 0.0

    def see(self, look: Snapshot) -> None:
        """Take a look; temperature and power are in it.

        Raises:
            InputError: no power is.
        """
        if "power" not in look.signals:
            raise InputError("the monitor needs the requested power, and its address in the PLC is not known")
        now, last = round(look.time_s / self.view.scan_s), self._last
        if last is not None and now <= last[0] and not look.restarted:
            return
        if math.isfinite(look.signals["temperature"]) and not math.isfinite(look.signals["power"]):
            return  # without its power a scan cannot be judged: it is missed
        setpoint_degC = look.signals.get("setpoint", -math.inf)
        self.highest_degC = max(self.highest_degC, setpoint_degC if math.isfinite(setpoint_degC) else -math.inf)
        self._last = now, self._reading(look.signals["temperature"]), _whole(look.signals["power"])
        self.passed += 1 if last is None or look.restarted else now - last[0]
        if last is not None and (look.restarted or now - last[0] - 1 > self._may_miss):
            restart(self._state)
            self.begun_anew += 1
            self._may_miss, self._row = 0.0, 0
        elif last is not None:
            self._between(last, self._last)
        self._may_miss = min(self._may_miss + 1.0 / _SEEN, float(_ONLINE_MONITOR_IN_A_ROW))
        self.scans += 1
        self._tell(scan(self._numbers, self._state, *self._last[1:]), now)

    def _between(self, last: tuple[int, int, int], new: tuple[int, int, int]) -> None:
        for at in range(last[0] + 1, new[0]):
            share = (at - last[0]) / (new[0] - last[0])
            reading, power = (round(a + share * (b - a)) for a, b in zip(last[1:], new[1:], strict=True))
            self._tell(unseen(self._numbers, self._state, reading, power), at)
            self._may_miss -= 1.0
            self.missed += 1

    def _tell(self, alarm: int, at: int) -> None:
        self._row += 1
        self.watched += self._row >= self.needs
        if alarm == 0:
            return
        name, time_s = ALARMS[alarm], at * self.view.scan_s
        entry = self.alarms.setdefault(name, Alarm(name, 0, time_s, time_s))
        entry.scans, entry.to_s = entry.scans + 1, time_s

    def _reading(self, degC: float) -> int:
        """Return a temperature as counts of the card; what is no number is no sensor."""
        card = self.view.card
        return round((degC - card.zero_degC) / card.step_degC) if math.isfinite(degC) else self._numbers.high + 1

    def messages(self) -> tuple[str, ...]:
        """Return the messages, one sentence each."""
        lines = [f"monitor: {each.name} at {each.from_s:.6g} s" + (
            f", {each.scans} scans until {each.to_s:.6g} s" if each.scans > 1 else "") for each in self.alarms.values()]
        if self.highest_degC > self.view.setpoint_degC + 0.5 * self.view.card.step_degC:
            lines.append(f"monitor: made for setpoints up to {self.view.setpoint_degC:.4g} °C, but "
                         f"{self.highest_degC:.4g} °C was requested")
        if self.scans > 0 and self.watched == 0:
            lines.append(f"monitor: blind: it needs {self.needs} scans in a row, and they never came")
        return tuple(lines)

    def to_document(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {"scans": self.scans, "missed": self.missed, "begun_anew": self.begun_anew,
                "blind_share": 1.0 - self.watched / max(self.passed, 1), "messages": list(self.messages()),
                "alarms": [asdict(each) for each in self.alarms.values()]}


def _whole(power_pct: float) -> int:
    """Return a power as the monitor takes it; next to a reading that is no number either, none."""
    pct = min(max(power_pct, -_FAR_PCT), _FAR_PCT) if math.isfinite(power_pct) else 0.0
    return int(whole_pct(np.array(pct)))


_IN_A_ROW: Final = 2  # readings outside that are more than a disturbed one
_APART: Final = 0.2  # of the watched time; nearer stretches are told as one
_SWINGS: Final = 3  # that are told: so many crossings of the mean, up and down
_DRIFT: Final = 0.15  # of the power at rest
_SAME_DEGC: Final = 1e-6
_DISTURBED: Final = 0.01  # of the readings: so many may be none


@dataclass(slots=True, kw_only=True)
class WatchStats:
    """What a watch has seen so far.

    Attributes:
        readings: looked at.
        outside: stretches outside of the band: from, until [s of the log].
        swing: how far it swings now, and how often [°C, s]; None: it does not, or it is too early to say.
        rest_pct: power at rest, first and now [%]; None: it has not rested yet.
        least_drift_pct: a smaller change of the power at rest is no drift [%].
        band: lowest and highest proven now [°C].
        used: the largest share of the band's half width that a reading took.
        unusable: readings that are none: not a number, or not within the sensor's range.
        problem: why the last of them was none, a few words.
        unusable_in_a_row: the most of them one after the other.
        frozen: why the sensor is frozen, a sentence; empty where it need not be.
        alarm: that the temperature was too high, or rose too fast, a sentence; empty where neither was.
        still_s: for how long nothing that was read has changed, up to now [s].
        seconds: that were watched [s].
    """

    readings: int = 0
    unusable: int = 0
    problem: str = ""
    unusable_in_a_row: int = 0
    frozen: str = ""
    alarm: str = ""
    still_s: float = 0.0
    seconds: float = 0.0
    outside: list[tuple[float, float]] = field(default_factory=list)
    swing: tuple[float, float] | None = None
    rest_pct: tuple[float, float] | None = None
    least_drift_pct: float = 0.0
    band: tuple[float, float] | None = None
    used: float = 0.0

    @property
    def well(self) -> bool:
        """Whether nothing has to be told, and at least one reading was compared."""
        return self.readings > 0 and not self.outside and self.swing is None and not self.has_drifted and (
            not self.frozen and not self.alarm and self.usable)

    @property
    def usable(self) -> bool:
        """Whether so few readings are none that they are disturbed ones."""
        return self.unusable_in_a_row < _IN_A_ROW and self.unusable <= _DISTURBED * self.readings

    @property
    def has_drifted(self) -> bool:
        """Whether it needs another power at the same setpoint than it did."""
        return self.rest_pct is not None and abs(self.rest_pct[1] - self.rest_pct[0]) > max(
            _DRIFT * self.rest_pct[0], self.least_drift_pct)

    def notes(self) -> tuple[str, ...]:
        """Return the messages, one sentence each."""
        lines = list[str]()
        if self.unusable:
            lines.append(f"{count(self.unusable, 'reading')} could not be used: {self.problem}")
        lines += [each for each in (self.frozen, self.alarm) if each]
        if self.swing is not None:
            lines.append(f"swings by ±{self.swing[0]:.3g} °C every {self.swing[1]:.3g} s")
        if self.has_drifted and self.rest_pct is not None:
            lines.append("needs {1:.3g} % at rest, at first {0:.3g} %: another ambient or load, a weaker heater, or a "
                         "sensor that has slipped".format(*self.rest_pct))
        return (*lines, *(f"from {begin:.6g} to {end:.6g} s outside of the proven band" for begin, end in self.outside))

    def to_document(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {"readings": self.readings, "unusable": self.unusable,
                "outside_s": [list(each) for each in self.outside],
                "swing": None if self.swing is None else dict(zip(("degC", "every_s"), self.swing, strict=True)),
                "rest_pct": self.rest_pct, "largest_share_of_band": self.used, "messages": list(self.notes())}

    def compare(self, degC: float, band: tuple[float, float]) -> bool:
        """Compare a reading with the band of the moment, lowest and highest [°C]; return whether it is within."""
        low, high = self.band = band
        share = abs(2.0 * degC - low - high) / (high - low)
        self.readings, self.used = self.readings + 1, max(self.used, share)
        return share <= 1.0

    def note_outside(self, time_s: float, apart_s: float) -> None:
        """Take note of a reading outside the band; it belongs to the stretch that ended less than `apart_s` before."""
        if self.outside and time_s - self.outside[-1][1] < apart_s:
            self.outside[-1] = self.outside[-1][0], time_s
        else:
            self.outside.append((time_s, time_s))


class RestWatch:
    """Takes note of swing and power of a loop at rest, over as long as a response takes."""

    def __init__(self, stats: WatchStats, *, window_s: float, pwm_s: float, within_degC: float) -> None:
        """Take where to note them.

        Args:
            stats: of the loop.
            window_s: how long a response takes [s].
            pwm_s: PWM period, over which readings are averaged; 0: there is none [s].
            within_degC: how far it may swing [°C].
        """
        self._stats, self._window_s, self._pwm_s, self._within_degC = stats, window_s, pwm_s, within_degC
        self._latest: deque[tuple[float, float, float]] = deque()

    def restart(self) -> None:
        """Forget what was seen at rest: the loop moves."""
        self._latest.clear()
        self._stats.rest_pct = self._stats.swing = None

    def see(self, time_s: float, degC: float, power_pct: float) -> None:
        """Take a reading of a loop that should be at rest [s], [°C], [%]."""
        self._latest.append((time_s, degC, power_pct))
        while time_s - self._latest[0][0] > self._window_s:
            self._latest.popleft()
        if time_s - self._latest[0][0] < 0.9 * self._window_s:
            return
        power, first = fmean(each for _, _, each in self._latest), self._stats.rest_pct
        self._stats.rest_pct = (power if first is None else first[0]), power
        self._stats.swing = self._swing()

    def _swing(self) -> tuple[float, float] | None:
        """Return how far and how often it swings, beyond what was proven; each PWM period is one reading."""
        periods = dict[int, list[tuple[float, float]]]()
        for at, degC, _ in self._latest:
            periods.setdefault(int(at // self._pwm_s) if self._pwm_s > 0.0 else int(at * 1e6), []).append((at, degC))
        levels = [fmean(degC for _, degC in each) for each in periods.values()]
        middle, half = fmean(levels), 0.5 * (max(levels) - min(levels))
        crossed_s = [later[0][0] for (one, other), later in zip(pairwise(levels), [*periods.values()][1:], strict=True)
                     if (one > middle) != (other > middle)]
        if half <= self._within_degC or len(crossed_s) < 2 * _SWINGS:
            return None
        return half, 2.0 * (crossed_s[-1] - crossed_s[0]) / (len(crossed_s) - 1)


class StillTime:
    """Tells for how long nothing that was read has changed; a PLC that has begun to count again is new."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._shown: Mapping[str, float] | None = None
        self._first_s = self._changed_s = 0.0

    def see(self, look: Snapshot) -> tuple[float, float]:
        """Take a look; return for how long nothing has changed, and for how long was looked [s]."""
        if self._shown is None:
            self._first_s = self._changed_s = look.time_s
        if look.signals != self._shown or look.restarted:
            self._shown, self._changed_s = look.signals, look.time_s
        return look.time_s - self._changed_s, look.time_s - self._first_s


class BandWatch:
    """Takes looks in their order; `seen` says what they show."""

    def __init__(self, proven: ProvenWords) -> None:
        """Hold looks against a proof."""
        heaters = [model for _, model in labelled_heaters(proven.fitted_model)]
        self._sensor_degC = proven.words.scaling.sensor_degC
        self._still, self._rise = StillSensor(heaters, band_degC(proven)), RiseWatch(Reach.from_proof(proven))
        self._still_time = StillTime()
        self._unusable_row = 0
        self._proven, self.seen = proven, WatchStats()
        self._window_s = watched_s(proven)
        self._rest = RestWatch(self.seen, window_s=self._window_s, pwm_s=proven.view.actuator.pwm_period_s,
                               within_degC=band_degC(proven))
        self._band: Band | None = None
        self._since_s = 0.0
        self._row = 0

    @property
    def window_s(self) -> float:
        """How long a response takes [s]."""
        return self._window_s

    def see(self, look: Snapshot) -> None:
        """Take a look; temperature, power and setpoint are in it."""
        degC, setpoint_degC = look.signals["temperature"], look.signals["setpoint"]
        self.seen.still_s, self.seen.seconds = self._still_time.see(look)
        if not self._is_usable(look, degC, setpoint_degC):
            return
        power = look.signals.get("power", math.nan)
        self.seen.frozen = self._still.see(look.time_s, degC, power) or self.seen.frozen
        self._note_alarm(look.time_s, degC)
        if self._band is None or abs(setpoint_degC - self._band.setpoint_degC) > _SAME_DEGC:
            # who comes to a loop, or sees its setpoint move before it has settled, does not know where it is in its way
            mid_way = self._band is None or look.time_s - self._since_s < self._band.settles_s
            self._band, self._since_s = Band.of(self._proven, setpoint_degC, degC, mid_way=mid_way), look.time_s
            self._rest.restart()
        since_s = look.time_s - self._since_s
        self._row = 0 if self.seen.compare(degC, self._band.at(since_s)) else self._row + 1
        if self._row >= _IN_A_ROW:
            self.seen.note_outside(look.time_s, _APART * self._window_s)
        if since_s >= min(self._band.settles_s, self._window_s):
            self._rest.see(look.time_s, degC, look.signals.get("power", 0.0))

    def _note_alarm(self, time_s: float, degC: float) -> None:
        """Take note of the first reading that is too high, or rises too fast."""
        rise, hot = self._rise.see(time_s, degC), highest_message(self._proven.conditions, degC)
        self.seen.alarm = self.seen.alarm or hot or rise

    def _is_usable(self, look: Snapshot, degC: float, setpoint_degC: float) -> bool:
        """Return whether a look can be held against the band; take note of one that cannot."""
        problem = reading_problem(degC, self._sensor_degC)
        problem = problem or ("" if math.isfinite(setpoint_degC) else "the setpoint is not a number")
        problem = problem or ("" if math.isfinite(look.signals.get("power", 0.0)) else "the power is not a number")
        self._unusable_row = self._unusable_row + 1 if problem else 0
        if problem:
            self.seen.unusable, self.seen.problem = self.seen.unusable + 1, problem
            self.seen.unusable_in_a_row = max(self.seen.unusable_in_a_row, self._unusable_row)
        return not problem


def others_there(proven: ProvenWords, address: Address) -> tuple[str, str]:
    """Return which words in a PLC are not the proven ones, and why they were not compared; each a text or nothing."""
    words = proven.words
    try:
        there = block_image(words, address, proven.view.stated_settings)
        with Peer(address, there, words.sample_time_s, LinkSettings(tries=1)) as peer:
            content = peer.look().content
    except (InputError, LinkError) as problem:
        return "", str(problem)
    values = {name: value for name, value in there.values(content).items() if name in there.own} | there.bits(content)
    there_texts, texts = value_texts(words, values), value_texts(words, words.values)
    other = [f"{name} is {there_texts[name]}, not {texts[name]}" for name, value in values.items()
             if name not in there.block.operators and value != words.values[name]]
    return f"other words stand there than were proven: {', '.join(other)}" if other else "", ""

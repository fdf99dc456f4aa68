"""The response after a write, watched inside the proven band; two readings in a row outside of it end the watch.

Until the words can show, what is seen is the doing of the old ones: it tells where the temperature is and where it
goes to. It is held against what any words could do to the heater since the last reading; the first of those are from
right before the write. From then on the band judges: cold goods may be put in.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from statistics import linear_regression
from typing import Final

from heatertune.errors import LinkError
from heatertune.live.reading_check import StillSensor, reading_problem
from heatertune.live.write.band import Band, Reach, band_degC, carried_s, unseen_s, watched_s
from heatertune.live.write.plc_block import BlockSnapshot, Peer, runs
from heatertune.live.write.proven_words import ProvenWords
from heatertune.live.write.write_record import WriteRecord
from heatertune.plc.ramp import Number
from heatertune.proof.heaters import labelled_heaters
from heatertune.units import count

__all__ = ["WatchResult", "watch_response"]

_IN_A_ROW: Final = 2  # readings outside that are more than a disturbed one
_SAME_DEGC: Final = 1e-6
#: without a new reading so long, the CPU stands [s], [sampling intervals]
_STILL_S: Final = 5.0
_STILL: Final = 4.0
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
        progress: told how far it is.

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
            if watch.stands_still(look):
                return watch.ended(early="the CPU runs no scan")
            if outside := watch.see(look):
                return watch.ended(outside=outside)
            progress(watch.told)
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
        self.duration_s, self.seconds, self.told = watched_s(proven), 0.0, "watching"
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
        self._reach, self._believed = Reach(proven), (math.nan, math.nan)
        self._jumped_before = self._see_before(before)
        self.stands: Mapping[str, Number] | None = None

    def stands_still(self, look: BlockSnapshot) -> bool:
        """Return whether the CPU is in STOP, or nothing new has come for long; takes note of what is new."""
        now = time.monotonic()
        if runs(look) is False:
            return True
        if self._is_new(look):
            self._moved = now
        return now - self._moved > max(_STILL_S, _STILL * self._proven.words.sample_time_s)

    def see(self, look: BlockSnapshot) -> str:
        """Take a reading; return why the words have to be taken back, nothing where they need not."""
        if not self._is_new(look):
            return ""
        seen, asked = (self._peer.standing.signal(look.content, role) for role in ("temperature", "setpoint"))
        self._first, self._last = self._first or look, look
        self.seconds = look.time_s - self._first.time_s
        if look.content != self._content:
            self._content, self._changed_s = look.content, self.seconds
        problem = reading_problem(seen, self._sensor_degC)
        problem = problem or ("" if math.isfinite(asked) else "the setpoint is not a number")
        self._unusable_row = self._unusable_row + 1 if problem else 0
        if problem:
            self._unusable += 1
            self._record.write_line("unusable", s=round(self.seconds, 3), told=problem, **look.to_document())
            return problem if self._unusable_row >= _IN_A_ROW else ""
        if frozen := self._frozen(look, seen):
            return frozen
        if self._jumped_before:
            return self._jumped_before
        if not self._shows and (jump := self._jump(look, seen)):
            self._outside += 1
            self._record.write_line("jumped", s=round(self.seconds, 3), told=jump, **look.to_document())
            return jump if self._outside >= _IN_A_ROW else ""
        self._way.append((look.time_s, seen))
        while look.time_s - self._way[0][0] > self._unseen_s and len(self._way) > 2:
            self._way.popleft()
        shows = self.seconds >= self._unseen_s and len(self._way) > 1
        if self._band is None or shows != self._shows or abs(asked - self._band.setpoint_degC) > _SAME_DEGC:
            self._band, self._since_s, self._shows = self._band_from(asked, seen), look.time_s, shows
            self._record.write_line("band", **self._band.to_document())
        low, high = self._band.at(look.time_s - self._since_s)
        low, high = (low, high) if shows else (min(low, seen), max(high, seen))
        used = abs(2.0 * seen - low - high) / (high - low)
        self._outside = 0 if used <= 1.0 else self._outside + 1
        self._count, self._most = self._count + 1, max(self._most, used)
        self._record.write_line("watched", s=round(self.seconds, 3), temperature_degC=seen, low_degC=low,
                                high_degC=high,
                         **look.to_document())
        between = f"the proven band, {low:.4g} to {high:.4g} °C"
        self.told = f"{seen:.4g} °C in {between}, {self.seconds:.0f} of {self.duration_s:.0f} s"
        return f"{seen:.4g} °C is outside of {between}" if self._outside >= _IN_A_ROW else ""

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
                self._record.write_line("jumped", s=0.0, told=jump, **look.to_document())
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
        return self._still.see(self.seconds, degC, self._peer.standing.signal(look.content, "power"))

    def unsure(self) -> str:
        """Return why the whole watch shows nothing; empty where it shows that the words do well."""
        if not self._count:
            return "no reading could be used"
        if not self._unusable <= _DISTURBED * self._count:
            return f"{count(self._unusable, 'reading')} of {self._unusable + self._count} could not be used"
        still_s = self.seconds - self._changed_s
        if self._last is not None and self._last.status is None and not still_s < _NOTHING_NEW * self.duration_s:
            return (f"no byte of the block has changed for {still_s:.0f} s: a CPU that stands, a frozen sensor and a "
                    "loop at rest look the same")
        return ""

    def _band_from(self, asked: float, seen: float) -> Band:
        slope = linear_regression(*zip(*self._way, strict=True)).slope if len(self._way) > 1 else 0.0
        return Band.of(self._proven, asked, seen, slope * self._carried_s)

    def _is_new(self, look: BlockSnapshot) -> bool:
        if self._last is None or self._last.status is None or look.status is None:
            return True
        return bool(look.status.scans != self._last.status.scans)

    def ended(self, outside: str = "", early: str = "") -> WatchResult:
        """Return the end."""
        return WatchResult(outside, early, self.seconds, self._count, self._most, self.stands)


def _changed(peer: Peer, look: BlockSnapshot, expected: Mapping[str, Number]) -> str:
    return ", ".join(f"{name} is {look.values[name]:g}, not {expected[name]:g}" for name in peer.standing.own
                     if look.values[name] != expected[name])

"""The response after a write, watched inside the proven band; two readings in a row outside of it end the watch."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from heatertune.errors import LinkError
from heatertune.live.change.band import Band, watched_s
from heatertune.live.change.peer import Look, Peer
from heatertune.live.change.proven import Proven
from heatertune.live.change.record import Record
from heatertune.plc.ramp import Number

__all__ = ["Watched", "watched"]

_IN_A_ROW: Final = 2  # readings outside that are more than a disturbed one
_SAME_DEGC: Final = 1e-6
#: without a new reading so long, the CPU stands [s], [sampling intervals]
_STILL_S: Final = 5.0
_STILL: Final = 4.0


@dataclass(frozen=True, slots=True)
class Watched:
    """How a watch ended.

    Attributes:
        outside: why the words have to be taken back, a sentence; nothing where they need not.
        ended_early: why it was not watched to its end; nothing where it was.
        seconds: that were watched, of the plant [s].
        count: of readings.
        most: the largest share of the band that was used.
    """

    outside: str
    ended_early: str
    seconds: float
    count: int
    most: float


def watched(
    peer: Peer, record: Record, proven: Proven, expected: Mapping[str, Number],
    progress: Callable[[str], object] = str,
) -> Watched:
    """Watch the response to words.

    Args:
        peer: the PLC.
        record: that every new reading goes into.
        proven: whose band it is.
        expected: all words, as they were written.
        progress: told how far it is.
    """
    duration = watched_s(proven)
    begin = last = None
    band, outside, count, most = None, 0, 0, 0.0

    def ended(outside: str = "", early: str = "") -> Watched:
        seconds = 0.0 if begin is None or last is None else last.time_s - begin
        return Watched(outside, early, seconds, count, most)

    while True:
        try:
            look = peer.look()
        except (LinkError, KeyboardInterrupt) as problem:
            return ended(early="interrupted" if isinstance(problem, KeyboardInterrupt) else str(problem))
        if last is None or _is_new(look, last):
            moved = time.monotonic()
        elif time.monotonic() - moved > max(_STILL_S, _STILL * proven.words.sample_time_s):
            return ended(early="the CPU runs no scan")
        if changed := _changed(peer, look, expected):
            return ended(early=f"somebody has changed the words: {changed}")
        if last is None or _is_new(look, last):
            seen, asked = (peer.standing.shown(look.content, role) for role in ("temperature", "setpoint"))
            if band is None or abs(asked - band.setpoint_degC) > _SAME_DEGC:
                band, since = Band.of(proven, asked, seen), look.time_s
                record.put("band", **band.to_document())
            begin = look.time_s if begin is None else begin
            low, high = band.at(look.time_s - since)
            used = abs(2.0 * seen - low - high) / (high - low)
            count, most, outside = count + 1, max(most, used), outside + 1 if used > 1.0 else 0
            record.put("watched", s=round(look.time_s - begin, 3), temperature_degC=seen, low_degC=low, high_degC=high,
                       **look.to_document())
            last = look
            if outside >= _IN_A_ROW:
                return ended(f"{seen:.4g} °C is outside of the proven band, {low:.4g} to {high:.4g} °C")
            if look.time_s - begin >= duration:
                return ended()
            progress(f"watching: {seen:.4g} °C in {low:.4g} to {high:.4g} °C, {look.time_s - begin:.0f} of "
                     f"{duration:.0f} s")
        peer.pause()


def _is_new(look: Look, last: Look) -> bool:
    if look.told is None or last.told is None:
        return True
    return look.told.scans != last.told.scans


def _changed(peer: Peer, look: Look, expected: Mapping[str, Number]) -> str:
    return ", ".join(f"{name} is {look.values[name]:g}, not {expected[name]:g}" for name in peer.standing.own
                     if look.values[name] != expected[name])

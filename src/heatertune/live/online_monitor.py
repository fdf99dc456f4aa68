"""The monitor of `heatertune supervise` on a loop that is looked at from outside: the same scans, whatever the target.

It needs each scan. A tenth of them may be missed, three in a row at most: those are taken from a straight line, and
none of them counts for a reading that stands still. After a longer gap it begins anew, as after a loss of supply.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError
from heatertune.live.poller import Snapshot
from heatertune.plc import Words
from heatertune.supervision.document import SupervisionView
from heatertune.supervision.loops import whole_pct
from heatertune.supervision.monitor import ALARMS, Numbers, cold, in_a_row, restart, scan, unseen

__all__ = ["Alarm", "OnlineMonitor"]

_IN_A_ROW: Final = 3  # scans that may be missed
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
        asked = look.signals.get("setpoint", -math.inf)
        self.highest_degC = max(self.highest_degC, asked if math.isfinite(asked) else -math.inf)
        self._last = now, self._reading(look.signals["temperature"]), _whole(look.signals["power"])
        self.passed += 1 if last is None or look.restarted else now - last[0]
        if last is not None and (look.restarted or now - last[0] - 1 > self._may_miss):
            restart(self._state)
            self.begun_anew += 1
            self._may_miss, self._row = 0.0, 0
        elif last is not None:
            self._between(last, self._last)
        self._may_miss = min(self._may_miss + 1.0 / _SEEN, float(_IN_A_ROW))
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
        told = self.alarms.setdefault(name, Alarm(name, 0, time_s, time_s))
        told.scans, told.to_s = told.scans + 1, time_s

    def _reading(self, degC: float) -> int:
        """Return a temperature as counts of the card; what is no number is no sensor."""
        card = self.view.card
        return round((degC - card.zero_degC) / card.step_degC) if math.isfinite(degC) else self._numbers.high + 1

    def messages(self) -> tuple[str, ...]:
        """Return what has to be told, one sentence each."""
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
    known = min(max(power_pct, -_FAR_PCT), _FAR_PCT) if math.isfinite(power_pct) else 0.0
    return int(whole_pct(np.array(known)))

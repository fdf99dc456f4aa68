"""What a switch made of the duty that was logged: it waits for its next period, and it counts whole ticks.

A PWM of 50 ticks gives power in steps of 2 %, whatever a controller asks for. In a loop that hardly moves the rest that
it leaves out stays for minutes, and a heater that is found without it is bent by that rest: its dead time most of all.
How many ticks there are nobody logs. But a wrong count explains nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from heatertune.log.values import Log

__all__ = ["Switch", "phases", "switched"]

_ROWS: Final = 3.0  # in a period: with fewer the log does not tell where it begins
_PHASES: Final = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """How a duty becomes power.

    Attributes:
        ticks: of a period, of which a whole number is on; None: as many as it takes.
        down: whether a part of a tick is left out; else the nearest number counts.
        phase_s: when its first period begins, from the begin of the log on [s]; None: a duty acts at once.
    """

    ticks: int | None = None
    down: bool = False
    phase_s: float | None = None


def phases(log: Log, period_s: float | None) -> list[float]:
    """Return instants at which the first period may begin, from the begin of the log on [s]; none where no row tells."""
    if period_s is None or period_s < _ROWS * float(np.median(np.diff(log.time_s))):
        return []
    return [period_s * place / _PHASES for place in range(_PHASES)]


def switched(log: Log, switch: Switch, period_s: float | None) -> Log:
    """Return a log with the mean power of each row, as the switch gave it.

    Args:
        log: with the duty as its power.
        switch: what makes power of it.
        period_s: of the switch; None: not known, and its phase is not asked for.
    """
    assert log.power_pct is not None
    power = log.power_pct
    if switch.ticks is not None:
        asked = power * (switch.ticks / 100.0)
        power = (np.floor(asked + 1e-9) if switch.down else np.round(asked)) * (100.0 / switch.ticks)
    if switch.phase_s is not None:
        assert period_s is not None
        first, last = float(log.time_s[0]), float(log.time_s[-1])
        begins = np.arange(first + switch.phase_s - period_s, last + 2.0 * period_s, period_s)
        taken = power[np.maximum(np.searchsorted(log.time_s, begins + 1e-9 * period_s, side="right") - 1, 0)]
        energy = np.concatenate([[0.0], np.cumsum(taken[:-1]) * period_s])
        ends = np.append(log.time_s, 2.0 * last - log.time_s[-2])
        power = np.diff(np.interp(ends, begins, energy)) / np.diff(ends)
    return replace(log, power_pct=np.clip(power, 0.0, 100.0))

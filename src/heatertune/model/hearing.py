"""From the sentences of a fit's checks to the findings that a verdict hears."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from heatertune.log.values import Log
from heatertune.model.findings import Finding
from heatertune.model.values import Outcome

__all__ = ["DROP_PCT", "Remark", "fast_remarks", "findings_of", "level_remarks", "poor_remarks"]

#: fit that may be lost on readings not seen [%]
DROP_PCT = 10.0
_BESIDE = 1.01  # times the least time constant
_TWO = 2  # levels of power
_FULL = 99.0  # %


class Remark(NamedTuple):
    """A sentence about a fit, and the name of the finding that it is; empty where a verdict need not hear it."""

    finding: str
    sentence: str


def findings_of(remarks: Iterable[Remark]) -> tuple[Finding, ...]:
    """Return the findings among some sentences."""
    return tuple(Finding(name=remark.finding, told=remark.sentence) for remark in remarks if remark.finding)


def poor_remarks(outcome: Outcome, fit_pct: float, name: str) -> tuple[Remark, ...]:
    """Return what a poor fit of a log, or logs, of this name means; nothing for another outcome."""
    if outcome is not Outcome.POOR_FIT:
        return ()
    return (Remark("poor-fit", f"{fit_pct:.0f} % of {name} are explained."),)


def level_remarks(log: Log) -> tuple[Remark, ...]:
    """Return what it means that a log knows one level of power beside none; a switch that is full on is linear."""
    assert log.power_pct is not None
    levels = np.unique(np.round(log.power_pct))
    if len(levels) > _TWO or levels[0] > 0.0 or levels[-1] >= _FULL:
        return ()
    return (Remark("one-level", (
        f"{log.name} knows no power but 0 and {levels[-1]:g} %: whether the gain is the same at others it cannot tell."
    )),)


def fast_remarks(least_s: float, time_constant_s: float, name: str) -> tuple[Remark, ...]:
    """Return what it means that the search for the time constant ended at the least that was searched."""
    if time_constant_s > _BESIDE * least_s:
        return ()
    return (Remark("faster-than-log", (
        f"The time constant ended at {time_constant_s:.3g} s, half the interval of {name} and the least searched: "
        "the heater answers faster than the log shows."
    )),)

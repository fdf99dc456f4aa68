"""A log without power whose controller is known: its program, run on the logged readings, gives the power back.

What the controller saw is in the log, so no loop has to be closed inside the fit: the controller is open-loop there,
and what its manual leaves open shows as different records of power, which the fit compares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.log.values import Log
from heatertune.model.open_loop import PowerFit, PowerProblem
from heatertune.model.statistics import ar1_bic, fit_pct
from heatertune.model.values import Candidate

__all__ = ["KnownController", "compare", "distinct", "replay_notes", "replayed"]

Array = npt.NDArray[np.float64]

_SAME_PCT = 1e-9  # power records that differ by less are one
_MOST_SCANS = 500_000  # of one replay: some seconds
_NEAR = 10.0  # BIC points within which a model explains the log nearly as well


class KnownController(Protocol):
    """A controller that is known to its last word, but for the points its manual leaves open."""

    @property
    def name(self) -> str:
        """Name, and what was assumed about the open points."""

    @property
    def interval_s(self) -> float:
        """Interval between two scans [s]."""

    def power_pct(self, temperature_degC: Array, setpoint_degC: Array) -> Array:
        """Return the power after each scan, from the cold state on, held to the next scan [%], same shape."""


def replayed(log: Log, controller: KnownController, setpoint_degC: float | None) -> Log:
    """Return the log with the power that the controller asked for.

    The first scan is taken at the first reading, from the cold state. Between readings the temperature is taken as
    straight, the setpoint as held. Each row's power is the mean up to the next row, as the heater's energy asks.

    Raises:
        InputError: the power was logged, no setpoint is known, or the log is too long for the controller's scans.
    """
    if log.power_pct is not None:
        raise InputError(f"{log.name} holds the power: the controller is not needed, fit the log without it")
    if setpoint_degC is None and log.setpoint_degC is None:
        raise InputError(f"{log.name} holds no setpoint: give --setpoint, or the controller cannot be run")
    time, h = log.time_s - log.time_s[0], controller.interval_s
    scans = int(time[-1] / h + 1e-9) + 1
    if scans > _MOST_SCANS:
        raise InputError(
            f"{log.name}: {scans} scans of {h:g} s are too many to run (at most {_MOST_SCANS}); use --until"
        )
    instants = h * np.arange(scans)
    held = np.maximum(np.searchsorted(time, instants + 1e-9 * h, side="right") - 1, 0)
    asked = np.full(scans, setpoint_degC) if log.setpoint_degC is None or setpoint_degC is not None else (
        log.setpoint_degC[held])
    power = controller.power_pct(np.interp(instants, time, log.temperature_degC), asked)
    return replace(log, power_pct=np.clip(_mean(time, instants, power), 0.0, 100.0))


def _mean(time: Array, instants: Array, power: Array) -> Array:
    """Return the mean of a held power from each row to the next; the last row has the last power."""
    ends = np.append(instants, max(time[-1], instants[-1]) + 1.0)
    energy = np.concatenate([[0.0], np.cumsum(power * np.diff(ends))])
    means = np.diff(np.interp(time, ends, energy)) / np.diff(time)
    return np.append(means, power[-1])


def distinct(logs: Sequence[tuple[str, Log]]) -> list[tuple[str, Log]]:
    """Return the named logs whose power differs from that of all before them."""
    found: list[tuple[str, Log]] = []
    for name, log in logs:
        assert log.power_pct is not None
        if all(np.max(np.abs(log.power_pct - other.power_pct)) > _SAME_PCT for _, other in found):
            found.append((name, log))
    return found


def compare(
    logs: Sequence[tuple[str, Log]], *, ambient_degC: float | None, power_before_pct: float
) -> tuple[list[Candidate], list[Candidate]]:
    """Return the candidates and all hypotheses: one and two lags on each named record of power, the best first.

    Candidates are those within 10 BIC points of the best, and the best single lag.

    Raises:
        InputError: the power never changes, so no record says anything.
    """
    rated = []
    for name, log in logs:
        assert log.power_pct is not None
        if float(np.ptp(log.power_pct)) == 0.0 and ambient_degC is None:
            continue
        for two in (False, True):
            fit = PowerProblem(
                log=log, two_lags=two, ambient_degC=ambient_degC, power_before_pct=power_before_pct
            ).fit()
            rated.append((ar1_bic(log.temperature_degC - fit.simulated_degC, fit.unknowns), name, log, fit))
    if not rated:
        raise InputError(
            f"{logs[0][1].name}: on these readings the controller's power never changes; is the setpoint right?"
        )
    rated.sort(key=lambda each: each[0])
    found = [_candidate(name, log, fit, bic - rated[0][0]) for bic, name, log, fit in rated]
    single = next(each for each in found if len(each.model.lags_s) == 1)
    return [each for each in found if each.delta_bic <= _NEAR or each is single], found


def _candidate(name: str, log: Log, fit: PowerFit, delta_bic: float) -> Candidate:
    error = log.temperature_degC - fit.simulated_degC
    return Candidate(
        model=fit.model, log=log.name, window_s=(float(log.time_s[0]), float(log.time_s[-1])),
        law=f"{name} replayed", fit_pct=fit_pct(log.temperature_degC, fit.simulated_degC),
        rmse_degC=float(np.sqrt(np.mean(error**2))), delta_bic=delta_bic, on_bound=fit.on_bound,
    )


def replay_notes(log: Log, controllers: Sequence[KnownController], rated: Sequence[Candidate]) -> tuple[str, ...]:
    """Return what was assumed to get the power back, and what the log says about the open points."""
    h, sample = controllers[0].interval_s, float(np.median(np.diff(log.time_s)))
    between = "" if h >= sample - 1e-9 else f"; between readings, {sample:g} s apart, the temperature was taken as straight"
    notes = [
        f"The power was not logged; the controller was run on the readings, every {h:g} s from a cold start at the first "
        f"one{between}. The switch behind it is taken as its mean."
    ]
    laws = dict.fromkeys(each.law for each in rated)
    behind = {law: min(each.delta_bic for each in rated if each.law == law) for law in laws}
    out = [f"{law} ({points:.0f})" for law, points in behind.items() if points > _NEAR]
    if len(laws) > 1 and out:
        notes.append(f"The log speaks against {', '.join(out)}: BIC points behind {rated[0].law}.")
    elif len(laws) > 1:
        notes.append(f"The log does not tell {' from '.join(laws)}: models of all are candidates.")
    elif len(controllers) > 1:
        notes.append(f"The {len(controllers)} settings of the open points give the same power on this log.")
    return tuple(notes)

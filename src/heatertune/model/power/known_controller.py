"""A log without power but with a known controller: its program, run on the logged readings, gives the power.

The log contains the inputs of the controller, so the fit needs no closed loop: the controller runs in open loop,
and its open points give several power records, which the fit compares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.model_values import Candidate, HeaterModel
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.statistics import ar1_bic, fit_pct

__all__ = ["KnownController", "ModelOrderFit", "compare", "offset_degC", "rate", "records", "replay_controller",
           "replay_notes"]


_OFFSETS: Final = (-1.0, -0.5, 0.0, 0.5, 1.0)  # steps of the reading
_SAME_PCT = 1e-9  # power records that differ by less are one
_MOST_SCANS = 500_000  # of one replay: some seconds
_NEAR = 10.0  # BIC points within which a model explains the log nearly as well


class KnownController(Protocol):
    """A controller with known parameters; its open points are listed separately."""

    @property
    def name(self) -> str:
        """Name, and the assumed settings of the open points."""

    @property
    def interval_s(self) -> float:
        """Interval between two scans [s]."""

    @property
    def resolution_degC(self) -> float:
        """Step of its reading [°C]."""

    def power_pct(self, temperature_degC: Array, setpoint_degC: Array) -> Array:
        """Return the power after each scan, from the cold state on, held to the next scan [%], same shape."""


def replay_controller(log: Log, controller: KnownController, setpoint_degC: float | None,
                      offset_degC: float = 0.0) -> Log:
    """Return the log with the power requested by the controller, for the log's readings plus an offset.

    The first scan is at the first reading, from a cold start. Between readings the temperature is linear and the
    setpoint constant. Each row's power is the mean up to the next row, which preserves the energy.

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
    instants: Array = h * np.arange(scans, dtype=np.float64)
    rows = np.maximum(np.searchsorted(time, instants + 1e-9 * h, side="right") - 1, 0)
    setpoints_degC = np.full(scans, setpoint_degC) if log.setpoint_degC is None or setpoint_degC is not None else (
        log.setpoint_degC[rows])
    power = controller.power_pct(np.interp(instants, time, log.temperature_degC + offset_degC), setpoints_degC)
    return log.with_rows(power_pct=np.clip(_mean(time, instants, power), 0.0, 100.0))


def _mean(time: Array, instants: Array, power: Array) -> Array:
    """Return the mean of a held power from each row to the next; the last row has the last power."""
    ends = np.append(instants, max(time[-1], instants[-1]) + 1.0)
    energy = np.concatenate([[0.0], np.cumsum(power * np.diff(ends))])
    means: Array = np.diff(np.interp(time, ends, energy)) / np.diff(time)
    return np.append(means, power[-1])


def records(
    log: Log, controllers: Sequence[KnownController], setpoint_degC: float | None, offset_degC: float = 0.0
) -> list[tuple[str, Log]]:
    """Return the log as each controller would have it, by the controller's name; the same power comes once.

    Raises:
        InputError: as `replayed`.
    """
    replays: list[tuple[str, Log]] = []
    for controller in controllers:
        replay = replay_controller(log, controller, setpoint_degC, offset_degC)
        if all(np.max(np.abs(_power(replay) - _power(other))) > _SAME_PCT for _, other in replays):
            replays.append((controller.name, replay))
    return replays


def _power(log: Log) -> Array:
    assert log.power_pct is not None
    return log.power_pct


def offset_degC(
    log: Log, controller: KnownController, setpoint_degC: float | None, *, ambient_degC: float | None,
    power_before_pct: float,
) -> float:
    """Return the offset from the log's readings to those of the controller [°C], usually 0.

    A controller with integral action accumulates the error of a reading, so half a step of its converter is visible in
    the log. Up to one step in each direction is tried; without a gain of 10 BIC points the readings are unchanged.

    Args:
        log: its first reading at the controller's first scan.
        controller: with one setting of its open points.
        setpoint_degC: constant setpoint [°C]; None: as logged.
        ambient_degC: ambient, if known [°C].
        power_before_pct: power before the first reading [%].
    """
    step = max(controller.resolution_degC, float(np.min(np.diff(np.unique(log.temperature_degC)))))
    tried = {}
    for share in _OFFSETS:
        controller_records = records(log, [controller], setpoint_degC, share * step)
        rated = rate(controller_records, ambient_degC=ambient_degC, power_before_pct=power_before_pct)
        tried[share * step] = rated[0].bic if rated else np.inf
    best = min(tried, key=lambda offset: tried[offset])
    return best if tried[best] < tried[0.0] - _NEAR else 0.0


class ModelOrderFit(NamedTuple):
    """One order of heater on one record of power."""

    bic: float
    name: str
    log: Log
    model: HeaterModel
    fit: PowerFit


def rate(logs: Sequence[tuple[str, Log]], *, ambient_degC: float | None,
         power_before_pct: float) -> list[ModelOrderFit]:
    """Return one and two lags on each named power record, the best by BIC first; empty without a plausible heater."""
    rated = []
    for name, log in logs:
        if float(np.ptp(_power(log))) == 0.0 and ambient_degC is None:
            continue
        for two in (False, True):
            fit = PowerProblem(
                readings=Readings.of(log), two_lags=two, ambient_degC=ambient_degC, power_before_pct=power_before_pct
            ).fit()
            if fit.model is None or (fit.model.ambient_degC or 0.0) >= float(np.max(log.temperature_degC)):
                continue  # no heater; or an ambient above all readings: the steady state of the log mistaken for it
            bic = ar1_bic(log.temperature_degC - fit.simulated_degC, fit.unknowns)
            rated.append(ModelOrderFit(bic, name, log, fit.model, fit))
    return sorted(rated, key=lambda rating: rating.bic)


def compare(rated: Sequence[ModelOrderFit]) -> tuple[list[Candidate], list[Candidate]]:
    """Return the candidates (within 10 BIC points of the best, and the best single lag) and all hypotheses."""
    hypotheses = [_candidate(rating, rated[0].bic) for rating in rated]
    single = next((hypothesis for hypothesis in hypotheses if len(hypothesis.model.lags_s) == 1), hypotheses[0])
    near = [hypothesis for hypothesis in hypotheses if hypothesis.delta_bic <= _NEAR or hypothesis is single]
    return near, hypotheses


def _candidate(rated: ModelOrderFit, leader: float) -> Candidate:
    log, fit = rated.log, rated.fit
    error = log.temperature_degC - fit.simulated_degC
    return Candidate(
        model=rated.model, log=log.name, window_s=(float(log.time_s[0]), float(log.time_s[-1])),
        law=f"{rated.name} replayed", fit_pct=fit_pct(log.temperature_degC, fit.simulated_degC),
        rmse_degC=float(np.sqrt(np.mean(error**2))), delta_bic=rated.bic - leader, on_bound=fit.on_bound,
    )


def replay_notes(
    log: Log, controllers: Sequence[KnownController], rated: Sequence[Candidate], offset_degC: float
) -> tuple[str, ...]:
    """Return the assumptions for reconstructing the power, and the log's evidence about the open points."""
    h, sample = controllers[0].interval_s, float(np.median(np.diff(log.time_s)))
    between = "" if h >= sample - 1e-9 else f"; between readings ({sample:g} s) the temperature was taken as straight"
    notes = [
        f"The power was not logged; the controller was run on the readings, every {h:g} s from a cold start at the "
        f"first one{between}. The switch behind it is taken as its mean."
    ]
    if offset_degC != 0.0:
        notes.append(
            f"The controller's readings were taken as the log's {offset_degC:+.3g} °C: as logged, their sum in the "
            "integral part does not fit the temperature."
        )
    laws = dict.fromkeys(hypothesis.law for hypothesis in rated)
    behind = {law: min(hypothesis.delta_bic for hypothesis in rated if hypothesis.law == law) for law in laws}
    out = [f"{law} ({points:.0f})" for law, points in behind.items() if points > _NEAR]
    if len(laws) > 1 and out:
        notes.append(f"The log speaks against {', '.join(out)}: BIC points behind {rated[0].law}.")
    elif len(laws) > 1:
        notes.append(f"The log does not distinguish {' from '.join(laws)}: models of all are candidates.")
    elif len(controllers) > 1:
        notes.append(f"The {len(controllers)} settings of the open points give the same power on this log.")
    return tuple(notes)

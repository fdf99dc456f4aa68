"""Whether the logged power answers the temperature, and what a direct fit to such a log is worth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log

__all__ = ["feedback_notes", "is_feedback"]

Array = npt.NDArray[np.float64]

_EXPLAINED = 0.8  # share of the power's variance that the temperature and its sum explain
_MOVING = 0.2  # share of readings at which a controller's power changes
_SWITCHES = 3  # of a two-level controller, each way
_SCATTER = 0.1  # of the temperature's span, within which a two-level controller switches
_FEW = 10  # readings with the power between its limits; fewer show no law
_APART = 0.2  # of the span between first and last reading: the loop had to heat up


def feedback_notes(log: Log) -> tuple[str, ...]:
    """Return what it means that the logged power is a controller's; nothing where it is not.

    The fit is the direct method: it takes the power as given. Where noise is fed back it is biased as far as the noise
    model is wrong (L. Ljung, "System Identification", 2nd ed., 1999, section 13.4).
    """
    if not is_feedback(log):
        return ()
    change = _excitation(log)
    told = f"{log.name}: the power answers the temperature, so the log is of a closed loop and noise is fed back."
    if change is None:
        return (f"{told} Nothing but noise moves it: the fit may be the controller's inverse; change the setpoint, or "
                "add a dither to the power, and log again.",)
    return (f"{told} {change} moves it, so a direct fit is in order; what the fit calls noise still biases it.",)


def is_feedback(log: Log) -> bool:
    """Return whether the power follows from the temperature: two-level, or nearly linear in it and its sum."""
    power = log.power_pct
    return power is not None and (_is_two_level(power, log.temperature_degC) or _is_linear(log, power))


def _is_two_level(power: Array, temperature: Array) -> bool:
    """Return whether the power is switched on at one temperature and off at a higher one, always the same."""
    if len(np.unique(power)) != 2:
        return False
    change = np.diff(power)
    on, off = temperature[1:][change > 0.0], temperature[1:][change < 0.0]
    if min(len(on), len(off)) < _SWITCHES:
        return False
    same = max(float(np.ptp(on)), float(np.ptp(off))) < _SCATTER * float(np.ptp(temperature))
    return same and float(np.max(on)) <= float(np.min(off))


def _is_linear(log: Log, power: Array) -> bool:
    inside = (power > 0.0) & (power < 100.0)
    moving = np.count_nonzero(np.diff(power[inside]))
    if np.count_nonzero(inside) < _FEW or moving < _MOVING * np.count_nonzero(inside):
        return False
    error = log.temperature_degC if log.setpoint_degC is None else log.temperature_degC - log.setpoint_degC
    total = np.cumsum(error - error.mean()) * np.gradient(log.time_s)
    rows = np.column_stack([np.ones(len(power)), error, total])[inside]
    known, *_ = np.linalg.lstsq(rows, power[inside], rcond=None)
    left = power[inside] - rows @ known
    return bool(known[1] < 0.0 and left.var() < (1.0 - _EXPLAINED) * power[inside].var())


def _excitation(log: Log) -> str | None:
    """Return what moves the loop from outside."""
    if log.setpoint_degC is not None and float(np.ptp(log.setpoint_degC)) > 0.0:
        return "The setpoint changes; that"
    start, end = float(log.temperature_degC[0]), float(np.median(log.temperature_degC[-10:]))
    spread = float(np.ptp(log.temperature_degC))
    power = log.power_pct
    assert power is not None
    limited = np.mean((power == 0.0) | (power == 100.0))
    if abs(end - start) > _APART * spread and limited > 0.0:
        return "The heat-up to the setpoint"
    return None

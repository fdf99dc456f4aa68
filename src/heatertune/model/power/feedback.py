"""Whether the logged power answers the temperature, and what a direct fit to such a log is worth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.diagnostics import Remark
from heatertune.model.power.causality import follows_temperature

__all__ = ["closed_loop", "feedback_notes", "is_feedback", "loop_remarks"]

Array = npt.NDArray[np.float64]

_EXPLAINED = 0.8  # share of the power's variance that the temperature and its sum explain
_MOVING = 0.2  # share of readings at which a controller's power changes
_SWITCHES = 3  # of a two-level controller, each way
_SCATTER = 0.1  # of the temperature's span, within which a two-level controller switches
_PARTS = 8  # of a log; the loop is sought in each and in all neighbours together
_AT_ONCE = 0.5  # correlation
_USUAL = 0.9  # share of the moves
_READINGS = 50  # of a part
_FEW = 10  # readings with the power between its limits; fewer show no law
_APART = 0.2  # of the span between first and last reading: the loop had to heat up


def loop_remarks(log: Log) -> tuple[Remark, ...]:
    """Return what it means that the logged power is a controller's, all the time or from when to when.

    The fit is the direct method: it takes the power as given. Where noise is fed back it is biased as far as the noise
    model is wrong (L. Ljung, "System Identification", 2nd ed., 1999, section 13.4).
    """
    window = closed_loop(log)
    if window is None:
        return ()
    start, end = window
    text = f"{log.name}: the power answers the temperature, so the log is of a closed loop and noise is fed back."
    if not is_feedback(log):
        text = f"{log.name}: from {start:.4g} to {end:.4g} s the power answers the temperature, a closed loop in " \
            "which noise and loads reach the power and pull a direct fit; an open-loop step would settle the model."
    elif (change := _excitation(log)) is None:
        text += (" Nothing but noise moves it: the fit may be the controller's inverse; change the setpoint, or add a "
                 "dither to the power, and log again.")
    else:
        text += f" {change} moves it, so a direct fit is in order; what the fit calls noise still biases it."
    return (Remark("closed-loop", text),)


def feedback_notes(log: Log) -> tuple[str, ...]:
    """Return the sentences of `loop_remarks`."""
    return tuple(remark.sentence for remark in loop_remarks(log))


def is_feedback(log: Log) -> bool:
    """Return whether the power follows from the temperature: two-level, or nearly linear in it and its sum."""
    power = log.power_pct
    return power is not None and (_is_two_level(power, log.temperature_degC) or _is_linear(log, power))


def closed_loop(log: Log) -> tuple[float, float] | None:
    """Return from when to when the power answers the temperature [s], None where it never does.

    The longest of all windows between the ends of equal parts of the log, without the parts at its ends that show
    nothing of it. Pulses by the clock and sines look like a loop too, so its moves have to be the readings'.
    """
    if log.power_pct is None:
        return None
    n = len(log.time_s)
    ends = np.linspace(0, n, max(min(_PARTS, n // _READINGS), 1) + 1).astype(int)

    def answers(i: int, j: int, *, at_once: bool = False) -> bool:
        if np.ptp(log.temperature_degC[ends[i] : ends[j]]) == 0.0:
            return False
        part = log.window(float(log.time_s[ends[i]]), float(log.time_s[ends[j] - 1]))
        return _answers_at_once(part) and (at_once or is_feedback(part) or follows_temperature(part))

    pairs = [(i, i + size) for size in range(len(ends) - 1, 0, -1) for i in range(len(ends) - size)]
    first, last = next((pair for pair in pairs if answers(*pair)), (0, 0))
    while last - first > 1 and not answers(first, first + 1, at_once=True) and answers(first + 1, last):
        first += 1
    while last - first > 1 and not answers(last - 1, last, at_once=True) and answers(first, last - 1):
        last -= 1
    return None if first == last else (float(log.time_s[ends[first]]), float(log.time_s[ends[last] - 1]))


def _answers_at_once(log: Log) -> bool:
    """Return whether the power's moves are those of the readings, or of two levels, whose times no clock gives."""
    assert log.power_pct is not None
    move = np.diff(log.power_pct)
    if len(np.unique(log.power_pct)) == 2:
        runs = np.diff(np.flatnonzero(move))
        return len(np.unique(runs[::2])) > 1 or len(np.unique(runs[1::2])) > 1
    size = np.abs(move)
    free = (size > 0.0) & (size <= np.quantile(size, _USUAL))  # the largest are a hand's, or a setpoint's
    error = log.temperature_degC if log.setpoint_degC is None else log.temperature_degC - log.setpoint_degC
    moves, changes = move[free], np.diff(error)[free]
    if len(moves) < _FEW or min(float(np.ptp(moves)), float(np.ptp(changes))) == 0.0:
        return False
    return bool(np.corrcoef(moves, changes)[0, 1] < -_AT_ONCE)


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
    weights, *_ = np.linalg.lstsq(rows, power[inside], rcond=None)
    left = power[inside] - rows @ weights
    return bool(weights[1] < 0.0 and left.var() < (1.0 - _EXPLAINED) * power[inside].var())


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

"""What is wrong with a logged response to a setpoint step, told by its own numbers.

The symptoms are those of WEG's advice, which gives no figures for them; the figures here are this project's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import OutOfRange
from heatertune.plc.weg.advice import Symptom

__all__ = ["Response", "observe"]

Array = npt.NDArray[np.float64]

_HIGH_PCT: Final = 5.0  # overshoot that is high, as well as beyond the tolerance [% of the step]
_NO_PCT: Final = 2.0  # overshoot that is none [% of the step]
_FAR_PCT: Final = 20.0  # still very far [% of the step]
_BAND_PCT: Final = 5.0  # at the setpoint [% of the step]
_SWINGS: Final = 4  # half periods that are "several periods"
_WIDE_PCT: Final = 10.0  # a swing, peak to peak, that belongs to an oscillation and is no unrest [% of the step]
_HARDLY: Final = math.sqrt(0.5)  # a period that leaves half of the swing or more hardly decays
_REST: Final = 0.2  # last share of the record that counts as rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What was seen.

    Attributes:
        symptom: the first that holds of: oscillating, far, overshoot, slow, restless.
        setpoint_degC, step_degC: setpoint, and its distance from the first reading, signed [°C].
        overshoot_pct: beyond the setpoint [% of the step].
        settled_s: time after the first reading from which on the temperature stays within the band; infinite where it
            never does [s].
        expected_s: time in which it should have [s].
        distance_degC: how far short of the setpoint the last fifth of the record is in the mean [°C]; negative: beyond.
        swing_degC: half of the peak to peak in the last fifth [°C].
        swings: whole half periods after the first turn, each of more than a tenth of the step and the tolerance.
        decay: what a swing leaves of the one before, in the geometric mean; None with fewer than two swings.
    """

    symptom: Symptom
    setpoint_degC: float
    step_degC: float
    overshoot_pct: float
    settled_s: float
    expected_s: float
    distance_degC: float
    swing_degC: float
    swings: int
    decay: float | None


def observe(
    time_s: Array, temperature_degC: Array, setpoint_degC: float, *, expected_s: float | None = None,
    tolerance_degC: float = 1.0,
) -> Response:
    """Return what a response to one setpoint step shows; nothing else may disturb it.

    Args:
        time_s: instants, increasing [s], shape (n,).
        temperature_degC: readings [°C], shape (n,).
        setpoint_degC: constant over the record [°C].
        expected_s: time in which the band should be reached for good [s]; None: half of the record.
        tolerance_degC: how far from the setpoint is still right [°C].

    Raises:
        OutOfRange: the first reading is within the tolerance of the setpoint, so that there is no step to judge.
    """
    step = setpoint_degC - float(temperature_degC[0])
    if abs(step) <= tolerance_degC:
        rule = f"more than {tolerance_degC:g} °C from the first reading, {temperature_degC[0]:g} °C: a step to judge"
        raise OutOfRange("setpoint_degC", setpoint_degC, rule)
    time = time_s - time_s[0]
    error = (temperature_degC - setpoint_degC) * math.copysign(1.0, step)  # negative: short of the setpoint
    size, end = abs(step), float(time[-1])
    rest = error[time >= (1.0 - _REST) * end]
    swings = _swings(error, max(tolerance_degC, _WIDE_PCT / 100.0 * size))
    seen = Response(
        symptom=Symptom.NONE, setpoint_degC=setpoint_degC, step_degC=step,
        overshoot_pct=100.0 * max(0.0, float(error.max())) / size,
        settled_s=_settled(time, error, max(tolerance_degC, _BAND_PCT / 100.0 * size)),
        expected_s=end / 2.0 if expected_s is None else expected_s,
        distance_degC=0.0 - float(rest.mean()), swing_degC=float(np.ptp(rest)) / 2.0, swings=len(swings),
        decay=float((swings[-1] / swings[0]) ** (1.0 / (len(swings) - 1))) if len(swings) > 1 else None,
    )
    return replace(seen, symptom=_symptom(seen, tolerance_degC))


def _symptom(seen: Response, tolerance_degC: float) -> Symptom:
    percent = abs(seen.step_degC) / 100.0
    without = seen.overshoot_pct * percent <= max(_NO_PCT * percent, tolerance_degC)
    if seen.swings >= _SWINGS and seen.decay is not None and seen.decay >= _HARDLY:
        return Symptom.OSCILLATING
    if without and seen.distance_degC > _FAR_PCT * percent:
        return Symptom.FAR
    if seen.overshoot_pct * percent > max(_HIGH_PCT * percent, tolerance_degC):
        return Symptom.OVERSHOOT
    if without and seen.settled_s > seen.expected_s:
        return Symptom.SLOW
    return Symptom.RESTLESS if seen.swing_degC > tolerance_degC else Symptom.NONE


def _settled(time: Array, error: Array, band: float) -> float:
    outside = np.flatnonzero(np.abs(error) > band)
    if len(outside) == 0:
        return 0.0
    last = int(outside[-1])
    return math.inf if last == len(time) - 1 else float(time[last + 1])


def _swings(error: Array, least: float) -> Array:
    """Return the heights of the swings after the first turn; what turns by less than `least` is no turn."""
    turns: list[float] = []
    low = high = float(error[0])
    rising = True  # towards the setpoint
    for value in error.tolist():
        low, high = min(low, value), max(high, value)
        if rising and high - value > least:
            turns.append(high)
            rising, low = False, value
        elif not rising and value - low > least:
            turns.append(low)
            rising, high = True, value
    return np.abs(np.diff(turns))

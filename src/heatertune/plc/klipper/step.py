"""One report of the temperature, in double precision, and what becomes of the duty that it asks for.

With T the reading, e the setpoint minus T, t the 0.3 s of a report and s the smoothing time:

    D = ΔT/t                                where a report is no shorter than s, else
    D = (D·(s − t) + ΔT)/s
    I = I + e·t                             held in 0…max_power/Ki, kept where the output is not at a limit
    duty = Kp·e + Ki·I − Kd·D               held in 0…max_power

The duty is sent where it is at least a band away from the last one sent, or where that one, not being 0, is to be
refreshed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.core import Sensor, count
from heatertune.plc.klipper.words import GAIN_BASE, REPORT_S
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.printer_heater import KLIPPER_HEATER
from heatertune.plc.ramp import Number

__all__ = ["COLD", "FLAGS", "KlipperAssumptions", "KlipperLoop", "KlipperState", "loop_of", "measure", "step"]

#: which source: what a change is held against, and how long a command holds
KLIPPER: Final = 0
KALICO: Final = 1
OLDER: Final = 2

FLAGS: Final = ("max_power", "no power", "not sent")

_BAND: Final = 0.05  # smaller changes of the duty are not sent
#: a command is sent again with the first report that comes 2.399 s (4.05 s) or more after it
_REPORTS: Final = 8
_REPORTS_OLDER: Final = 14


class KlipperAssumptions(NamedTuple):
    """In what the sources differ, see DIFFERENCES.md."""

    source: Annotated[int, OpenPoint(
        name="firmware", means={"klipper": KLIPPER, "kalico": KALICO, "older": OLDER},
        reason="version of the source: a change is not sent if it is below 5 % of max_power (klipper) or of full "
               "power (kalico, older); a command is repeated after 2.4 s (klipper, kalico) or 4.2 s (older)",
    )] = KLIPPER
    heater: Annotated[int, KLIPPER_HEATER] = 0


class KlipperLoop(NamedTuple):
    """What words and source make."""

    kp: float
    ki: float
    kd: float
    most: float  # of the duty
    most_integral: float
    smooth: float
    band: float
    reports: int


class KlipperState(NamedTuple):
    """What the host keeps from report to report."""

    begun: bool = False
    before: float = 0.0  # the reading of the last report
    slope: float = 0.0
    integral: float = 0.0
    duty: float = 0.0  # that was sent last
    since: int = 0  # reports since then


COLD: Final = KlipperState()


def loop_of(values: Mapping[str, Number], assume: KlipperAssumptions) -> KlipperLoop:
    """Return what the host makes of the words when it starts."""
    ki, most = values["pid_Ki"] / GAIN_BASE, float(values["max_power"])
    return KlipperLoop(
        kp=values["pid_Kp"] / GAIN_BASE, ki=ki, kd=values["pid_Kd"] / GAIN_BASE, most=most,
        most_integral=most / ki if ki else 0.0, smooth=float(values["smooth_time"]),
        band=most * _BAND if assume.source == KLIPPER else _BAND,
        reports=_REPORTS_OLDER if assume.source == OLDER else _REPORTS,
    )


def measure(sensor: Sensor, temperature_degC: float) -> float:
    """Return the reading [°C]."""
    return sensor.low + sensor.span * count(sensor, temperature_degC) / sensor.counts


def step(
    loop: KlipperLoop, state: KlipperState, setpoint: float, reading: float, _begins: bool
) -> tuple[KlipperState, float, float, int]:
    """Take one report, see `heatertune.plc.core.StepFunctions`.

    Args:
        loop: what words and source make.
        state: before the report.
        setpoint: [°C]; 0 or less: the heater is off.
        reading: [°C].
        _begins: not looked at: the PWM is behind the duty.
    """
    change = reading - (state.before if state.begun else reading)
    slope = (change / REPORT_S if loop.smooth <= REPORT_S
             else (state.slope * (loop.smooth - REPORT_S) + change) / loop.smooth)
    error = setpoint - reading
    integral = _held(state.integral + error * REPORT_S, loop.most_integral)
    wanted = loop.kp * error + loop.ki * integral - loop.kd * slope
    asked = _held(wanted, loop.most)
    if wanted != asked:
        integral = state.integral
    flags = (1 if wanted > asked else 0) + (2 if asked == 0.0 else 0)
    if setpoint <= 0.0:
        asked = 0.0
    kept = state.since < loop.reports or state.duty == 0.0
    if kept and abs(asked - state.duty) < loop.band:
        after = KlipperState(True, reading, slope, integral, state.duty, min(state.since + 1, loop.reports))
        flags += 4
    else:
        after = KlipperState(True, reading, slope, integral, asked, 1)
    return after, 100.0 * after.duty, after.duty, flags


def _held(value: float, most: float) -> float:
    """Return a value within 0…most; what is no number becomes the most, as in the original."""
    below = value if value < most else most
    return below if below > 0.0 else 0.0

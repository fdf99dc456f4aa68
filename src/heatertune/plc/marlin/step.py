"""One update of Marlin's PID: the law `WINDOW` of `heatertune.plc.parallel.step` (temperature.h, PID_t, 2.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.open_points import OpenPoint
from heatertune.plc.parallel.step import (
    WINDOW,
    ParallelParameters,
    ParallelState,
    compute_call,
    narrowed_to,
    quotient,
    scan_result,
)
from heatertune.plc.printer_heater import MARLIN_HEATER
from heatertune.plc.single_precision import single

__all__ = ["MarlinAssumptions", "parameters_of", "scan"]

_OVERSAMPLED: Final = 16.0
_HZ: Final = 1000.0
_AVR_HZ: Final = 976.5625  # 16 MHz/64/256
_STEPS: Final = 127.0


class MarlinAssumptions(NamedTuple):
    """What depends on the build, see DIFFERENCES.md."""

    avr: Annotated[bool, OpenPoint(
        name="timer", means={"1000hz": False, "977hz": True},
        reason="frequency of the temperature timer, which scales I and D: 1000 Hz, or 976.5625 Hz on a 16 MHz AVR",
    )] = False
    inside: Annotated[bool, OpenPoint(
        name="history", means={"all": False, "inside": True},
        reason="previous reading for the D part: that of every update (2.0, and again since March 2024), or the "
               "last one inside the window, 0 at power-on (2.1.0 to 2.1.2)",
    )] = False
    heater: Annotated[int, MARLIN_HEATER] = 0


def parameters_of(values: Mapping[str, float], assume: MarlinAssumptions) -> ParallelParameters:
    """Return the gains as the firmware keeps them: I times PID_dT, D divided by it."""
    interval = single(_OVERSAMPLED * values["ADC_LOOPS"] / (_AVR_HZ if assume.avr else _HZ))
    ki, high = single(values["Ki"] * interval), float(values["PID_MAX"])
    return ParallelParameters(
        law=WINDOW, narrow=True, kp=float(values["Kp"]), ki=ki, kd=narrowed_to(True, values["Kd"] / interval),
        low=0.0, high=high, least=0.0, most=quotient(True, high, ki), full=_STEPS, interval=interval,
        window=float(values["PID_FUNCTIONAL_RANGE"]), weight=single(1.0 - values["PID_K1"]),
        inside=assume.inside)


def scan(p: ParallelParameters, state: ParallelState, inputs: Mapping[str, float]) -> tuple[ParallelState, float, float,
                                                                                            int]:
    """Compute one update; a target of 0 is off."""
    return scan_result(p, compute_call(p, state, float(inputs["target"]), float(inputs["celsius"]), p.interval))

"""One Compute() of PID_v1: the law `SUM` of `heatertune.plc.parallel.step` (PID_v1.cpp, 1.2.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final, NamedTuple

from heatertune.plc.arduino_pid.words import ON_MEASUREMENT
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.parallel.step import (
    NOBODY,
    SUM,
    ParallelParameters,
    ParallelState,
    again,
    clamp,
    compute_call,
    narrowed_to,
    scan_result,
    step,
)

__all__ = ["FIRST_MS", "ArduinoPidAssumptions", "parameters_of", "scan"]

#: SampleTime before SetSampleTime is called, and how long the last call is taken to be ago when the object is made [ms]
FIRST_MS: Final = 100.0


class ArduinoPidAssumptions(NamedTuple):
    """What the library leaves to board and sketch, see DIFFERENCES.md."""

    narrow: Annotated[bool, OpenPoint(
        name="double", means={"64bit": False, "32bit": True},
        reason="precision of double on the board: double (ARM, ESP32) or single (AVR)",
    )] = False
    late: Annotated[bool, OpenPoint(
        name="calls", means={"on_time": False, "late": True},
        reason="Compute() waits for at least SampleTime: it is called on time, or every tenth call comes after "
               "twice SampleTime",
    )] = False


def parameters_of(values: Mapping[str, float], assume: ArduinoPidAssumptions) -> ParallelParameters:
    """Return the gains as the library keeps them: for 100 ms by the constructor, then by SetSampleTime's ratio."""
    narrow = assume.narrow
    kp, ki, kd = (narrowed_to(narrow, float(values[name])) for name in ("Kp", "Ki", "Kd"))
    first = narrowed_to(narrow, FIRST_MS / 1000.0)
    ratio = narrowed_to(narrow, values["SampleTime"] / FIRST_MS)
    high = narrowed_to(narrow, float(values["OutMax"]))
    return ParallelParameters(
        law=SUM, narrow=narrow, kp=kp, ki=narrowed_to(narrow, narrowed_to(narrow, ki * first) * ratio),
        kd=narrowed_to(narrow, narrowed_to(narrow, kd / first) / ratio), low=0.0, high=high, least=0.0, most=high,
        full=float(values["Full"]), interval=float(values["SampleTime"]), late=assume.late,
        on_measurement=values["POn"] == ON_MEASUREMENT)


def scan(p: ParallelParameters, s: ParallelState, inputs: Mapping[str, float]) -> tuple[ParallelState, float, float,
                                                                                        int]:
    """Compute one pass of loop(): where named, Mode 0 with Output by hand, and Elapsed, ms since the last."""
    if not inputs.get("Mode", 1):
        by_hand = narrowed_to(p.narrow, float(inputs.get("Output", s.output)))
        return scan_result(p, again(s, True, by_hand, s.waited + inputs.get("Elapsed", p.interval), NOBODY))
    if s.begins:  # SetMode(AUTOMATIC), at once
        total = clamp(s.output, p.low, p.high)
        before = narrowed_to(p.narrow, float(inputs["Input"]))
        s = ParallelState(False, s.calls, total, 0.0, 0.0, before, 0.0, 0.0, s.output, s.waited, mode=s.mode)
    setpoint, reading = (narrowed_to(p.narrow, float(inputs[name])) for name in ("Setpoint", "Input"))
    if "Elapsed" not in inputs:
        return step(p, s, setpoint, reading, True)
    waited = s.waited + inputs["Elapsed"]
    if waited < p.interval:
        return scan_result(p, again(s, False, s.output, waited, s.mode))
    return scan_result(p, compute_call(p, s, setpoint, reading, p.interval))

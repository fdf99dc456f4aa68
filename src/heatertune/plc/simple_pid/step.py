"""One call of simple-pid: the law `TERMS` of `heatertune.plc.parallel.step` (simple_pid/pid.py, 2.0.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from heatertune.plc.open_points import OpenPoint
from heatertune.plc.parallel.step import (
    NOBODY,
    TERMS,
    ParallelParameters,
    ParallelState,
    again,
    clamp,
    compute_call,
    scan_result,
    step,
)

__all__ = ["SimplePidAssumptions", "parameters_of", "scan"]


class SimplePidAssumptions(NamedTuple):
    """What depends on the computer, see DIFFERENCES.md."""

    late: Annotated[bool, OpenPoint(
        name="calls", means={"on_time": False, "late": True},
        reason="calls come on time, or every tenth call comes after twice the interval, which the loop measures",
    )] = False


def parameters_of(values: Mapping[str, float], assume: SimplePidAssumptions) -> ParallelParameters:
    """Return the words as the object keeps them."""
    high = float(values["output_max"])
    return ParallelParameters(
        law=TERMS, narrow=False, kp=float(values["Kp"]), ki=float(values["Ki"]), kd=float(values["Kd"]), low=0.0,
        high=high, least=0.0, most=high, full=100.0, interval=values["PERIOD_MS"] / 1000.0, late=assume.late,
        on_measurement=values["proportional_on_measurement"] != 0, on_error=values["differential_on_measurement"] == 0)


def scan(p: ParallelParameters, s: ParallelState, inputs: Mapping[str, float]) -> tuple[ParallelState, float, float,
                                                                                        int]:
    """Compute one call; where named, auto_mode 0 keeps the output, last_output begins I, dt is the interval [s].

    An interval that is none is refused by the package, and leaves all as it was.
    """
    if not inputs.get("auto_mode", 1):
        return scan_result(p, again(s, True, s.output, 1.0, NOBODY))
    if s.begins and s.waited:  # back from manual: the I part begins where it is told
        begun = clamp(float(inputs.get("last_output", 0.0)), p.least, p.most)
        s = ParallelState(True, s.calls, begun, 0.0, 0.0, 0.0, 0.0, 0.0, s.output, 0.0)
    setpoint, reading = float(inputs["setpoint"]), float(inputs["input_"])
    if "dt" not in inputs:
        return step(p, s, setpoint, reading, True)
    interval = float(inputs["dt"])
    return scan_result(p, compute_call(p, s, setpoint, reading, interval) if interval > 0.0 else s)

"""One update of ESPHome's PID: the law `SUM_BY_TIME` of `heatertune.plc.parallel.step` (2026.6.5)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, NamedTuple

from heatertune.plc.open_points import OpenPoint
from heatertune.plc.parallel.step import (
    NOBODY,
    SUM_BY_TIME,
    ParallelParameters,
    ParallelState,
    again,
    compute_call,
    narrowed_to,
    scan_result,
    step,
)
from heatertune.plc.single_precision import single

__all__ = ["EspHomeAssumptions", "parameters_of", "scan"]


class EspHomeAssumptions(NamedTuple):
    """What depends on the sensor, see DIFFERENCES.md."""

    late: Annotated[bool, OpenPoint(
        name="calls", means={"on_time": False, "late": True},
        reason="each sensor reading calls the PID: one per update_interval, or every tenth reading is lost",
    )] = False


def parameters_of(values: Mapping[str, float], assume: EspHomeAssumptions) -> ParallelParameters:
    """Return the words as the component keeps them."""
    return ParallelParameters(
        law=SUM_BY_TIME, narrow=True, kp=float(values["kp"]), ki=float(values["ki"]), kd=float(values["kd"]), low=0.0,
        high=1.0, least=float(values["min_integral"]), most=float(values["max_integral"]), full=1.0,
        interval=single(values["update_interval"] / 1000.0), late=assume.late,
        samples=int(values["derivative_averaging_samples"]))


def scan(p: ParallelParameters, s: ParallelState, inputs: Mapping[str, float]) -> tuple[ParallelState, float, float,
                                                                                        int]:
    """Compute one reading; where named, mode 0 puts the heater off and ms since the reading before are as told."""
    setpoint, reading = (float(inputs[name]) for name in ("target_temperature", "current_temperature"))
    if "elapsed_ms" in inputs:
        waited = s.waited + inputs["elapsed_ms"]
        broken = setpoint != setpoint or reading != reading  # noqa: PLR0124 - only what is no number is not itself
        interval = narrowed_to(True, single(waited) / 1000.0)
        off = again(s, s.begins, 0.0, waited, min(s.mode, NOBODY))
        after = off if broken else compute_call(p, s, setpoint, reading, interval)
    else:
        after = step(p, s, setpoint, reading, True)[0]
    if inputs.get("mode", 1):
        return scan_result(p, after)
    anew = after if math.isinf(p.within) else after._replace(integral=0.0, mode=NOBODY)  # as the lambda of a boost does
    return scan_result(p, anew._replace(output=0.0))

"""The parameters of PID_Temp, heating: those of PID_Compact under other tags."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.pid.values import PidDesign
from heatertune.plc.pid_compact.words import TEMP, consistent, design_of, fields_of, interval_s, oddities
from heatertune.plc.pid_compact.words import values_of as values_in
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, WordField

__all__ = ["FIELDS", "TEMP", "consistent", "design_of", "interval_s", "oddities", "values_of"]

FIELDS: Final[tuple[WordField, ...]] = fields_of(TEMP)


def values_of(design: PidDesign, scaling: Scaling) -> Mapping[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design; raise NotRepresentable for a cooler's, or as PID_Compact's."""
    return values_in(TEMP, design)

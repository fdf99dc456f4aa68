"""What is told of the commissioned loop and of its record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from heatertune.codec import register_schema
from heatertune.options import option, validate_options

__all__ = ["RECORD_SCHEMA", "AsLeftSettings", "RecordSettings"]

RECORD_SCHEMA: Final = "heatertune/record/1"
_COLDEST_DEGC: Final = -273.15


@register_schema(RECORD_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings:
    """What the record calls the plant and itself; what is not said is left to be filled in by hand."""

    plant_tag: str | None = option(None, str, "tag of the plant and heater, for the record", flag="--plant-tag",
                                   metavar="TEXT")
    document: str | None = option(None, str, "number of the record", flag="--document", metavar="TEXT")
    revision: str | None = option(None, str, "version of the record", flag="--revision", metavar="TEXT")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class AsLeftSettings:
    """What is known beside a trace of the commissioned loop."""

    setpoint_degC: float | None = option(
        None, float, "setpoint of the trace", unit="°C", flag="--setpoint", least=_COLDEST_DEGC,
        instead=("as logged, else that of the proof", ""))
    ambient_degC: float | None = option(
        None, float, "ambient during the trace", unit="°C", flag="--ambient", least=_COLDEST_DEGC,
        instead=("that of the plausible heaters", ""))
    begins_s: float | None = option(
        None, float, "instant of the trace at which the heat-up begins", unit="s", flag="--begins-at",
        instead=("where setpoint, power or temperature show it", ""))
    load_at_s: float | None = option(
        None, float, "instant of the trace at which a load came", unit="s", flag="--load-at",
        help="instant of the trace at which a load came [s]: a door or cold goods; the recovery is measured from there")

    def __post_init__(self) -> None:
        validate_options(self)

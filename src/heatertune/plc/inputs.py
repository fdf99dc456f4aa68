"""Ranges of analog input modules: how a sensor's range becomes what the program reads.

A transmitter of 4 to 20 mA gives 3.8 mA at the least; below 3.6 mA it, or its wire, is broken (NAMUR NE 43). A range
for thermocouples or resistance thermometers gives the temperature itself, a fixed part of a degree per digit, and
rounds it to the nearest; other converters cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Final, NamedTuple, final

from heatertune.errors import InputError, UnknownName
from heatertune.plc.core import Sensor
from heatertune.plc.words import Scaling

__all__ = [
    "BROKEN_MA", "FOUR_TO_TWENTY", "INPUTS", "Inputs", "Range", "describe_range", "has_ends", "module",
    "sensor_scaling", "share_of",
]

#: name on the command line of the range that has a lower end of its own
FOUR_TO_TWENTY: Final = "4-20mA"
#: name on the command line → what is told of it
INPUTS: Final = {
    FOUR_TO_TWENTY: "a transmitter of 4 to 20 mA", "thermocouple": "a thermocouple", "rtd": "a resistance thermometer",
    "rtd-climatic": "a resistance thermometer, climatic range",
}
#: a current below it means a broken wire [mA]
BROKEN_MA: Final = 3.6
_LEAST_MA: Final = 3.8
_LOW_MA: Final = 4.0
_HIGH_MA: Final = 20.0
_PLAIN: Final = (0.0, 100.0)
_NO_MODULE: Final = ("this target's program reads no analog module; say with --range what the lowest and the highest "
                     "reading mean")


class Range(NamedTuple):
    """A range of a target's module.

    Attributes:
        high_degC: temperature at the highest reading, that at 0 being 0 °C; None: the user tells both [°C].
        from_zero: whether 0 is 0 mA, so that the readings of a transmitter begin at a fifth.
        counts: steps from 0 to the highest reading; None: as many as a plain range has.
        delay_s: longest time until a temperature is read; None: as in a plain range [s].
    """

    high_degC: float | None = None
    from_zero: bool = False
    counts: int | None = None
    delay_s: float | None = None


def sensor_scaling(
    ranges: Mapping[str, Range], name: str | None, sensor_degC: tuple[float, float] | None = None,
    unread: Mapping[str, str] | None = None,
) -> Scaling:
    """Return the scaling of a sensor behind a module.

    Args:
        ranges: that the target's modules have, by name.
        name: of the range; None: a plain one, whose readings from the lowest to the highest are the sensor's.
        sensor_degC: temperatures at both ends of the sensor's range; None: 0 and 100 [°C].
        unread: name of a range that the target does not have → why.

    Raises:
        UnknownName: no range has that name.
        InputError: the target does not have it; a sensor range beside a module's that has its own.
        OutOfRange: a sensor range that is none.
    """
    low, high = _PLAIN if sensor_degC is None else sensor_degC
    if not name:
        return Scaling(low_degC=low, high_degC=high)
    if name not in INPUTS:
        raise UnknownName("input", name, INPUTS)
    if name not in ranges:
        raise InputError(f"--input {name}: {(unread or {}).get(name, _NO_MODULE)}")
    own = ranges[name].high_degC
    if own is not None:
        if (low, high) not in (_PLAIN, (0.0, own)):
            raise InputError(f"--range {low:g} {high:g} beside --input {name}: its readings are 0…{own:g} °C; leave "
                             "the range out")
        return Scaling(low_degC=0.0, high_degC=own, input=name)
    sensor = Scaling(low_degC=low, high_degC=high, input=name)
    if not ranges[name].from_zero:
        return sensor
    below = _LOW_MA / (_HIGH_MA - _LOW_MA) * sensor.span_degC
    return Scaling(low_degC=low - below, high_degC=high, input=name, from_degC=low)


def module(scaling: Scaling, counts: int, ranges: Mapping[str, Range]) -> Sensor:
    """Return the module behind a scaling.

    Args:
        scaling: of the sensor.
        counts: steps from the lowest reading to the highest.
        ranges: that the target's modules have, by name.
    """
    range_ = ranges.get(scaling.input or "", Range())
    counts = range_.counts or counts
    # 0: as low as readings go
    least = share_of(_LEAST_MA, range_) if range_.from_zero else 0.0
    half = 0.0 if range_.high_degC is None else 0.5
    return Sensor(scaling.low_degC, scaling.span_degC, counts, round(counts * least), half)


class Inputs:
    """What a controller reads; its attributes are explained there, see `heatertune.plc.controller.Controller`."""

    counts: ClassVar[int]
    ranges: ClassVar[Mapping[str, Range]] = {}
    unread: ClassVar[Mapping[str, str]] = {}
    delay_s: ClassVar[float] = 0.0

    @final
    def sensor(self, scaling: Scaling) -> Sensor:
        """Return the input module as the core's `measure` takes it."""
        return module(scaling, self.counts, self.ranges)

    @final
    def scaled(self, name: str | None, sensor_degC: tuple[float, float] | None = None) -> Scaling:
        """Return the scaling of a sensor behind a module, by the name of its range; see `scaled`."""
        return sensor_scaling(self.ranges, name, sensor_degC, self.unread)

    @final
    def delayed_s(self, scaling: Scaling) -> float:
        """Return `delay_s` with the module behind a scaling [s]."""
        own = self.ranges.get(scaling.input or "", Range()).delay_s
        return self.delay_s if own is None else own


def has_ends(ranges: Mapping[str, Range], name: str | None) -> bool:
    """Return whether a range has ends of its own, which are neither the sensor's nor the heater's."""
    return ranges.get(name or "", Range()).high_degC is not None


def describe_range(scaling: Scaling) -> str:
    """Return the sensor's range, and which one of the module is told, in a few words."""
    low, high = scaling.sensor_degC
    text = f"{low:.6g}…{high:.6g} °C"
    return text if scaling.input is None else f"{text} ({INPUTS[scaling.input]})"


def share_of(current_ma: float, range_: Range) -> float:
    """Return the share of the highest reading that a current gives, below 0 where it lies under 4 mA."""
    low = 0.0 if range_.from_zero else _LOW_MA
    return (current_ma - low) / (_HIGH_MA - low)

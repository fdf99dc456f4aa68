"""What the sketch sets: PID_v1's words, its own boost and window of time."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.arduino_pid.readback import from_text
from heatertune.plc.arduino_pid.step import ArduinoPidAssumptions
from heatertune.plc.exported import TextSettings
from heatertune.plc.parallel.window import settings_of

__all__ = ["loaders"]

_FILE: Final = "arduino_pid.ino"
_NUMBER: Final = re.compile(r"^(?:const (?:unsigned long|double)|double) (\w+) = ([^;]+);", re.MULTILINE)


def loaders(files: Mapping[str, str | bytes], assume: ArduinoPidAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads the sketch."""
    return {_FILE: lambda: _settings(str(files[_FILE]))}


def _settings(text: str) -> TextSettings:
    values = from_text(text, None, _FILE).values
    numbers = {name: float(number) for name, number in _NUMBER.findall(text)}
    if numbers.get("SAMPLE_MS", values["SampleTime"]) != values["SampleTime"]:
        raise InputError(f"SAMPLE_MS is {numbers['SAMPLE_MS']:g}; SampleTime is {values['SampleTime']}")
    return settings_of(values, numbers, numbers["Setpoint"], ("BOOST_WITHIN", "BOOST_AGAIN"), text)

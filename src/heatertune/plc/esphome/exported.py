"""What the YAML sets: the climate's words, its setpoint, the boost before its output, slow_pwm's period."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.boost import Boost
from heatertune.plc.esphome.readback import from_text
from heatertune.plc.esphome.step import EspHomeAssumptions
from heatertune.plc.exported import TextSettings
from heatertune.plc.single_precision import single

__all__ = ["loaders"]

_FILE: Final = "esphome_pid.yaml"
_SETPOINT: Final = re.compile(r"^ +default_target_temperature: ([\d.+-]+)°C$", re.MULTILINE)
_PERIOD: Final = re.compile(r"^ +period: (\d+)ms$", re.MULTILINE)
_BOOST: Final = re.compile(r"away > \(boosting \? ([\d.]+)f : ([\d.]+)f\)")
_THROUGH: Final = re.compile(r"^ +heat_output: heater_level$", re.MULTILINE)


def loaders(files: Mapping[str, str | bytes], assume: EspHomeAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads the file."""
    return {_FILE: lambda: _settings(str(files[_FILE]))}


def _settings(text: str) -> TextSettings:
    setpoint, period, boost = _SETPOINT.search(text), _PERIOD.search(text), _BOOST.search(text)
    if setpoint is None or period is None:
        raise InputError("default_target_temperature or period is not there")
    if (boost is None) == (_THROUGH.search(text) is not None):
        raise InputError("the boost is not between climate and slow_pwm")
    distances = None if boost is None else Boost(
        within_degC=single(float(boost[1])), again_degC=single(float(boost[2])))
    return TextSettings(from_text(text, None, _FILE).values, distances, float(setpoint[1]), int(period[1]) / 1000.0)

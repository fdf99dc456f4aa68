"""What the heater's section and the G-code that tries it set in the host."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.exported import TextSettings
from heatertune.plc.klipper.readback import from_text
from heatertune.plc.klipper.step import KlipperAssumptions

__all__ = ["loaders"]

_CONFIG: Final = "klipper_heater.cfg"
_TRIAL: Final = "klipper_try.gcode"
_PERIOD: Final = re.compile(r"^pwm_cycle_time\s*[:=]\s*(\S+)", re.MULTILINE)
_TRIED: Final = re.compile(r"SET_HEATER_PID HEATER=\w+ KP=(\S+) KI=(\S+) KD=(\S+)")
_TARGET: Final = re.compile(r"^SET_HEATER_TEMPERATURE HEATER=\w+ TARGET=(\S+)", re.MULTILINE)


def loaders(files: Mapping[str, str | bytes], assume: KlipperAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads each file."""
    return {_CONFIG: lambda: _section(str(files[_CONFIG])), _TRIAL: lambda: _trial(str(files[_TRIAL]))}


def _section(text: str) -> TextSettings:
    period = _PERIOD.search(text)
    if period is None:
        raise InputError("pwm_cycle_time is not there")
    return TextSettings(from_text(text, None, _CONFIG).values, period_s=float(period[1]))


def _trial(text: str) -> TextSettings:
    """Return the gains that are tried, and at which setpoint, where one was proven."""
    tried, target = _TRIED.search(text), _TARGET.search(text)
    if tried is None:
        raise InputError("SET_HEATER_PID is not there")
    gains = dict(zip(("pid_Kp", "pid_Ki", "pid_Kd"), map(float, tried.groups()), strict=True))
    return TextSettings(gains, setpoint_degC=None if target is None else float(target[1]))

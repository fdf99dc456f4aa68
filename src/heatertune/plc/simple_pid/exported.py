"""What the Python module sets: simple-pid's words, its own boost and window of time."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.plc.exported import TextSettings
from heatertune.plc.parallel.window import settings_of
from heatertune.plc.simple_pid.readback import from_text
from heatertune.plc.simple_pid.step import SimplePidAssumptions

__all__ = ["loaders"]

_FILE: Final = "simple_pid_heater.py"


def loaders(files: Mapping[str, str | bytes], assume: SimplePidAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads the module, which is not run."""
    return {_FILE: lambda: _settings(str(files[_FILE]))}


def _settings(text: str) -> TextSettings:
    values = from_text(text, None, _FILE).values
    numbers = {target.id: float(node.value.value) for node in ast.parse(text).body
               if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
               and isinstance(node.value.value, int | float) for target in node.targets if isinstance(target, ast.Name)}
    return settings_of(values, numbers, numbers["SETPOINT_DEGC"], ("BOOST_WITHIN_DEGC", "BOOST_AGAIN_DEGC"), text)

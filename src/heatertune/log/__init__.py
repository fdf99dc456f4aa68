"""File → Log: time, temperature, power and setpoint in one set of units, with a record of all repairs."""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.log.log_values import Log
    from heatertune.log.read import read_log

__all__ = ["Log", "read_log"]

__getattr__, __dir__ = lazy_attributes(__name__, {"log.log_values": ("Log",), "log.read": ("read_log",)})

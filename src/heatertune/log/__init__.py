"""A file → Log: time, temperature, power and setpoint in one set of units; what was repaired is told."""

from heatertune.log.read import read_log
from heatertune.log.values import Log

__all__ = ["Log", "read_log"]

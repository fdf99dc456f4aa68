"""The PID controller OB251 of the SIMATIC S5-115U; what the manual leaves open stands in DIFFERENCES.md."""

from heatertune.plc.s5_ob251.controller import ROOM

__all__ = ["ROOM"]

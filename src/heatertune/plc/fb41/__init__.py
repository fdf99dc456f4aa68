"""The standard block FB41 CONT_C (SFB41 of the CPU 31xC); what is not documented stands in DIFFERENCES.md."""

from heatertune.plc.fb41.controller import ROOM

__all__ = ["ROOM"]

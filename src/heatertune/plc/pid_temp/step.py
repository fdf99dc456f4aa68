"""One cycle of PID_Temp, heating: that of PID_Compact, so that one compiled loop runs both."""

from __future__ import annotations

from heatertune.plc.pid_compact.step import COLD, Assumptions, block_of, scan, step

__all__ = ["COLD", "Assumptions", "block_of", "scan", "step"]

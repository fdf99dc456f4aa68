"""What breaks in a heater: told by name, and when in a loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["FAULTS", "FaultKind"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultKind:
    """One fault.

    Attributes:
        name: few words.
        mains: share of the power that is left.
        stuck_pct: power that flows whatever is asked for.
        sensor: what becomes of it, see `heatertune.supervision.loops.SENSOR_FAULTS`.
        later: by which the dead time is multiplied, over the whole run.
        cold: whether it is there from the cold start on; else it comes when the loop is at rest.
    """

    name: str
    mains: float = 1.0
    stuck_pct: float = 0.0
    sensor: str = "right"
    later: float = 1.0
    cold: bool = False


FAULTS: Final = (
    FaultKind(name="switch stuck on", mains=0.0, stuck_pct=100.0),
    FaultKind(name="heater open", mains=0.0),
    FaultKind(name="heater open from cold", mains=0.0, cold=True),
    FaultKind(name="half of the power", mains=0.5),
    FaultKind(name="half of the power from cold", mains=0.5, cold=True),
    FaultKind(name="sensor reads its low end", sensor="low"),
    FaultKind(name="sensor reads its high end", sensor="high"),
    FaultKind(name="sensor frozen at rest", sensor="frozen"),
    FaultKind(name="sensor frozen in the heat-up", sensor="frozen", cold=True),
    FaultKind(name="sensor half out", sensor="half"),
    FaultKind(name="sensor half out from cold", sensor="half", cold=True),
    FaultKind(name="sensor loose", sensor="loose"),
    FaultKind(name="dead time 4 times as long", later=4.0, cold=True),
)

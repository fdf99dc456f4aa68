"""Full power far from the setpoint, given by the program around a controller that is not enabled meanwhile.

What the controller would sum up on the way, it then does not: its integral part begins at zero where the way ends,
after an open heater circuit as in the heat-up.
"""

from __future__ import annotations

from dataclasses import dataclass

from heatertune.errors import OutOfRange
from heatertune.plc.single_precision import is_single
from heatertune.units import check

__all__ = ["Boost"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Boost:
    """Where the controller has the heater, and where the program around it has.

    Attributes:
        within_degC: on its way to the setpoint, at this distance or less, the controller is enabled [°C].
        again_degC: farther from it than this the program takes the heater back [°C]; what noise and the sensor's steps
            do to the reading has to be less than what lies between.

    Raises:
        OutOfRange: a distance that is not positive or not in single precision, or the second one not above the first.
    """

    within_degC: float
    again_degC: float

    def __post_init__(self) -> None:
        check("boost within_degC", self.within_degC, above=0.0)
        check("boost again_degC", self.again_degC, above=self.within_degC)
        for name in ("within_degC", "again_degC"):
            if not is_single(getattr(self, name)):
                raise OutOfRange(f"boost {name}", getattr(self, name), "a number in single precision")

    def __str__(self) -> str:
        """Return it as told to people."""
        return (f"full power until {self.within_degC:.7g} °C from the setpoint, and again where it is more than "
                f"{self.again_degC:.7g} °C off")

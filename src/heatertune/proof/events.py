"""What may happen to a loop, each at its instant: disturbances, other setpoints, power that fails."""

from __future__ import annotations

from dataclasses import dataclass, field

from heatertune.codec import LEFT_OUT
from heatertune.units import check

__all__ = ["Disturbance", "Load", "Mains", "NewSetpoint", "PlcPower", "SetpointRampEvent", "TemperatureStep"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TemperatureStep:
    """The temperature of every lag jumps at once: cold goods, an opened door.

    Attributes:
        time_s: [s].
        temperature_degC: the jump, signed [°C].
    """

    time_s: float
    temperature_degC: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("temperature_degC", self.temperature_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A power that is added at the heater's input from then on: a draught, a second source of heat.

    It acts after the dead time, as the heater's own power does.

    Attributes:
        time_s: [s].
        power_pct: added to all that is there already, signed [% of full power].
    """

    time_s: float
    power_pct: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("power_pct", self.power_pct)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSetpoint:
    """Another temperature is asked for from then on.

    Attributes:
        time_s: [s].
        setpoint_degC: [°C]. A ramp on the way to it belongs to the words.
        small: True: the change is so small that its overshoot is judged as a share of it; None: as one of the rise.
        unheld: True: no power holds it, so the heater cools down towards its ambient and no criterion judges the phase;
            None: every heater holds it.
    """

    time_s: float
    setpoint_degC: float
    small: bool | None = field(default=None, metadata=LEFT_OUT)
    unheld: bool | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("setpoint_degC", self.setpoint_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mains:
    """The mains change: the heater's power is multiplied from then on, which acts after the dead time.

    Attributes:
        time_s: [s].
        share: of the rated power that full power then is; 0: the heater's circuit is open, and the PLC runs on.
    """

    time_s: float
    share: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("share", self.share, least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlcPower:
    """The PLC loses its supply, and the heater with it, or gets it back and starts up.

    Attributes:
        time_s: [s].
        on: whether it has its supply from then on.
    """

    time_s: float
    on: bool

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetpointRampEvent:
    """The program around the controller leads the setpoint straight from one temperature to another, and stays there.

    It is set anew at each scan. A PLC without supply gets it and starts up.

    Attributes:
        time_s: [s].
        from_degC: setpoint at the begin [°C].
        setpoint_degC: setpoint at the end; the same: a soak [°C].
        duration_s: of the way [s].
    """

    time_s: float
    from_degC: float
    setpoint_degC: float
    duration_s: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("from_degC", self.from_degC)
        check("setpoint_degC", self.setpoint_degC)
        check("duration_s", self.duration_s, above=0.0)

    @property
    def degC_per_s(self) -> float:
        """How fast the setpoint moves [°C/s]."""
        return (self.setpoint_degC - self.from_degC) / self.duration_s


Disturbance = TemperatureStep | Load | NewSetpoint | Mains | PlcPower | SetpointRampEvent

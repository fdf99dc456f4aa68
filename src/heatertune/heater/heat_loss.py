"""Heat loss as a curve of the temperature: convection and radiation, or a power of the rise above the room.

    lag·T′ = gain·power − loss(T)
    loss(T) = straight·(T − room) + bent·(qⁿ − q(room)ⁿ),   q = (T − origin)/reach

The loss is given in °C, as the power times the gain. n = 4 and the origin at absolute zero is radiation; the origin at
the room and n = 1.0…1.6 is the model of RepRapFirmware. Below a thousandth of the reach the curve is straight.

A step of constant power takes the tangent to the loss at the temperature where it begins and is exact for that tangent
(exponential Rosenbrock–Euler method; M. Hochbruck, A. Ostermann, Acta Numerica 19 (2010) 209–286, section 2.4): its
error is of third order in the step, and 0 if the loss is straight. `STEPS` of them to the shortest lag keep it below a
hundred-thousandth of the rise (`tests/heater/test_heat_loss.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.heater.exact import decay, logarithm
from heatertune.units import check

__all__ = ["ABSOLUTE_ZERO_DEGC", "RADIATION", "STEPS", "Loss", "LossCurve", "Tangent", "loss_at", "tangent_at"]

ABSOLUTE_ZERO_DEGC: Final = -273.15
#: of the temperature above absolute zero, to which radiation grows (Stefan–Boltzmann)
RADIATION: Final = 4.0
#: steps to the shortest lag
STEPS: Final = 64.0

_LEAST: Final = 1e-3  # of the reach


class Loss(NamedTuple):
    """A loss curve: parts that are straight [°C/°C] and bent [°C], exponent, origin and reach [°C]."""

    straight: float
    bent: float
    exponent: float
    origin: float
    reach: float


class Tangent(NamedTuple):
    """The linear heater at a temperature: gain [°C/%], lag [s], and the room that its straight loss points to [°C]."""

    gain: float
    lag: float
    ambient: float


def _power(number: float, exponent: float) -> float:
    """Return a positive number to a power."""
    x = exponent * logarithm(number)
    return decay(x) if x <= 0.0 else 1.0 / decay(-x)


def loss_at(degC: float, room: float, loss: Loss) -> tuple[float, float]:
    """Return the loss [°C] and its slope at a temperature.

    Args:
        degC: temperature.
        room: temperature without power [°C].
        loss: the curve.
    """
    here, steep = _bent((degC - loss.origin) / loss.reach, loss.exponent)
    cold, _ = _bent((room - loss.origin) / loss.reach, loss.exponent)
    return loss.straight * (degC - room) + loss.bent * (here - cold), loss.straight + loss.bent * steep / loss.reach


def _bent(q: float, exponent: float) -> tuple[float, float]:
    """Return qⁿ and its slope, and a straight line through 0 below `_LEAST`."""
    if q < _LEAST:
        slope = _power(_LEAST, exponent) / _LEAST
        return slope * q, slope
    high = _power(q, exponent)
    return high, exponent * high / q


def tangent_at(degC: float, gain: float, lag: float, room: float, loss: Loss) -> Tangent:
    """Return the linear heater at a temperature.

    Args:
        degC: temperature.
        gain: with the loss in °C [°C/%].
        lag: likewise [s].
        room: temperature without power [°C].
        loss: the curve.
    """
    lost, slope = loss_at(degC, room, loss)
    return Tangent(gain / slope, lag / slope, degC - lost / slope)


@dataclass(frozen=True, slots=True, kw_only=True)
class LossCurve:
    """The shape of a heat loss.

    Attributes:
        share: part of the loss at `at_degC` that is bent, 0…1; the rest is proportional to the rise above the ambient.
        exponent: of the bent part: 4 for radiation.
        origin_degC: temperature from which the bent part counts; None: from the ambient.
        at_degC: temperature of the chord: the setpoint of use that needs the most power.
        low_degC: the lowest setpoint of use, None if there is no other.

    Raises:
        OutOfRange: a share outside 0…1, an exponent below 1.
    """

    share: float
    exponent: float
    at_degC: float
    origin_degC: float | None = None
    low_degC: float | None = None

    def __post_init__(self) -> None:
        check("share", self.share, least=0.0, most=1.0)
        check("exponent", self.exponent, least=1.0, most=6.0)
        check("at_degC", self.at_degC, above=ABSOLUTE_ZERO_DEGC)

    @property
    def is_radiation(self) -> bool:
        """Whether the bent part is radiation."""
        return self.origin_degC == ABSOLUTE_ZERO_DEGC and self.exponent == RADIATION

    def loss(self, room_degC: float) -> Loss:
        """Return the curve above a room, with a loss of `at_degC` − room at that temperature."""
        origin = room_degC if self.origin_degC is None else self.origin_degC
        whole, _ = loss_at(self.at_degC, room_degC, Loss(0.0, 1.0, self.exponent, origin, self.at_degC - origin))
        return Loss(1.0 - self.share, self.share * (self.at_degC - room_degC) / whole, self.exponent, origin,
                    self.at_degC - origin)

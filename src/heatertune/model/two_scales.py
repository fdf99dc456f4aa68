"""A heater of two time scales: a fast element next to a slow mass, seen by one sensor.

    G(s) = gain·(1 + fast share·T1·s) / ((1 + T1·s)·(1 + T2·s))·e^(−L·s)

T1 is the lag of the slow mass, T2 that of the fast element. A share of the power's effect reaches the sensor past the
mass: the sensor follows share·(where the power leads) + (1 − share)·mass with the lag T2. With a share of T2/T1 the
heater has one lag, T1; the model is of two scales above that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from heatertune.errors import OutOfRange
from heatertune.heater.exact import since_step
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.units import check

if TYPE_CHECKING:
    from control import TransferFunction

    from heatertune.arrays import Array

__all__ = ["TwoScale", "heater_of_numbers"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoScale(TwoLag):
    """Two lags and a zero; `time_constant_s` is the slow mass, `second_time_constant_s` the fast element.

    Attributes:
        fast_share: share of the power's effect that passes the slow mass, T2/T1…1.

    Raises:
        OutOfRange: a share outside that range, and as of `TwoLag`.
    """

    fast_share: float

    def __post_init__(self) -> None:
        TwoLag.__post_init__(self)
        check("fast_share", self.fast_share, least=self.second_time_constant_s / self.time_constant_s, most=1.0)

    @property
    def zero_s(self) -> float:
        """Time of the zero [s]."""
        return self.fast_share * self.time_constant_s

    def half_rule(self) -> Fopdt:
        """Return one lag with the same gain and the same rise shortly after a step.

        The zero is slow, so the heater is gain·share/(1 + T2·s) for the loop (S. Skogestad, J. Process Control 13
        (2003), rule T3); one lag of T2/share begins to rise as that does.
        """
        return Fopdt(gain_degC_per_pct=self.gain_degC_per_pct,
                     time_constant_s=self.second_time_constant_s / self.fast_share,
                     dead_time_s=self.dead_time_s, ambient_degC=self.ambient_degC)

    def with_neighbours(self, heaters: int) -> TwoScale:
        """Return the model a controller sees where so many equal heaters share the mass and all of them move alike.

        Then no heater loses heat to another one: the temperature begins to rise as before (gain·share/T2), and the gain
        is larger, at most by the number of heaters, and at most that of one lag T1 which begins to rise like this. Of
        equal zones in a row it is exactly that lag.

        Args:
            heaters: number of them, this one included.
        """
        one_lag = self.second_time_constant_s / self.time_constant_s
        share = max(self.fast_share / heaters, one_lag)
        return replace(self, gain_degC_per_pct=self.gain_degC_per_pct * self.fast_share / share, fast_share=share)

    def frequency_response(self, omega: Array) -> npt.NDArray[np.complex128]:
        """Return G(jω) [°C/%] at `omega` [rad/s], shape (n,), with the exact e^(−jωL)."""
        zero = 1.0 + 1j * np.asarray(omega, dtype=np.float64) * self.zero_s
        return np.asarray(zero * TwoLag.frequency_response(self, omega))

    def unit_step(self, since_s: Array) -> Array:
        """Return the response through the mass and past it, see `Dynamics.unit_step`; shape of `since_s`."""
        since = np.maximum(since_s, 0.0)
        through_mass, past_it = (since_step(since, *lags)[0] for lags in (self.lags_s, self.lags_s[1:]))
        return np.asarray((1.0 - self.fast_share) * through_mass + self.fast_share * past_it)

    def to_tf(self, *, pade: int | None = None, sample_time_s: float | None = None) -> TransferFunction:
        """Return python-control's transfer function, see `Dynamics.to_tf`."""
        whole = TwoLag.to_tf(self, pade=pade, sample_time_s=sample_time_s)
        if sample_time_s is not None:  # the step response that it is made of has the zero
            return whole
        return type(whole)(np.polymul(whole.num[0][0], [self.zero_s, 1.0]), whole.den[0][0])

    def scaled(self, gain: float, lag: float, dead_time_s: float) -> TwoScale:
        """Return the heater with another gain and other lags, both as factors, and another dead time."""
        return replace(self, gain_degC_per_pct=gain * self.gain_degC_per_pct, dead_time_s=dead_time_s,
                       time_constant_s=lag * self.time_constant_s,
                       second_time_constant_s=lag * self.second_time_constant_s)


def heater_of_numbers(
    *, gain_degC_per_pct: float, time_constant_s: float, dead_time_s: float,
    second_time_constant_s: float | None = None, zero_s: float | None = None, ambient_degC: float | None = None,
) -> Fopdt | TwoLag:
    """Return the heater of its numbers: one lag, two, or two and a zero.

    Args:
        gain_degC_per_pct: [°C/%].
        time_constant_s: [s].
        dead_time_s: [s].
        second_time_constant_s: None: one lag [s].
        zero_s: of a fast element on a slow mass, T2…T1; None: no zero [s].
        ambient_degC: temperature without power [°C], None if unknown.

    Raises:
        OutOfRange: a number that no heater has, see `Fopdt`, `TwoLag`; a zero outside T2…T1, or without a second lag.
    """
    numbers: dict[str, Any] = {"gain_degC_per_pct": gain_degC_per_pct, "time_constant_s": time_constant_s,
                               "dead_time_s": dead_time_s, "ambient_degC": ambient_degC}
    if second_time_constant_s is None:
        if zero_s is not None:
            raise OutOfRange("zero_s", zero_s, "no zero without a second time constant: state that of the fast element")
        return Fopdt(**numbers)
    two = TwoLag(**numbers, second_time_constant_s=second_time_constant_s)
    if zero_s is None:
        return two
    if not second_time_constant_s <= zero_s <= time_constant_s:
        raise OutOfRange("zero_s", zero_s, f"{second_time_constant_s:g}…{time_constant_s:g} s, between both time "
                         "constants; without it two lags are in series, and a shorter zero is taken off the dead time")
    return TwoScale(**numbers, second_time_constant_s=second_time_constant_s, fast_share=zero_s / time_constant_s)

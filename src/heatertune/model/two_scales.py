"""A heater of two time scales: a fast element next to a slow mass, seen by one sensor.

    G(s) = gain·(1 + fast share·T1·s) / ((1 + T1·s)·(1 + T2·s))·e^(−L·s)

T1 is the lag of the slow mass, T2 that of the fast element. A share of the power's effect reaches the sensor past the
mass: the sensor follows share·(where the power leads) + (1 − share)·mass with the lag T2. With a share of T2/T1 the
heater has one lag, T1; the model is of two scales above that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.heater.exact import since_step
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.units import check

if TYPE_CHECKING:
    from control import TransferFunction

    from heatertune.arrays import Array

__all__ = ["TwoScale"]


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

    def frequency_response(self, omega: Array) -> npt.NDArray[np.complex128]:
        """Return G(jω) [°C/%] at `omega` [rad/s], shape (n,), with the exact e^(−jωL)."""
        zero = 1.0 + 1j * np.asarray(omega, dtype=np.float64) * self.zero_s
        return np.asarray(zero * TwoLag.frequency_response(self, omega))

    def step(self, time_s: npt.ArrayLike, *, power_pct: float = 1.0) -> Array:
        """Return the rise after a step of the power at time 0, see `Dynamics.step`, shape of `time_s` [°C]."""
        since = np.maximum(np.asarray(time_s, dtype=np.float64) - self.dead_time_s, 0.0)
        return self.gain_degC_per_pct * power_pct * self._unit_step(since)

    def _unit_step(self, since_s: Array) -> Array:
        through_mass, past_it = (since_step(since_s, *lags)[0] for lags in (self.lags_s, self.lags_s[1:]))
        return np.asarray((1.0 - self.fast_share) * through_mass + self.fast_share * past_it)

    def _predicted(self, time: Array, power: Array, ambient: float, before: float) -> Array:
        """Return the temperature from rest at a power before: that through the mass, and that past it."""
        past_it = Fopdt(gain_degC_per_pct=self.gain_degC_per_pct, time_constant_s=self.second_time_constant_s,
                        dead_time_s=self.dead_time_s)
        through_mass = TwoLag._predicted(self, time, power, ambient, before)
        return np.asarray((1.0 - self.fast_share) * through_mass
                          + self.fast_share * past_it._predicted(time, power, ambient, before))

    def to_tf(self, *, pade: int | None = None, sample_time_s: float | None = None) -> TransferFunction:
        """Return python-control's transfer function, see `Dynamics.to_tf`.

        Raises:
            InputError: a sampled system, which is not offered for two time scales.
        """
        if sample_time_s is not None:
            raise InputError("a heater of two time scales has no sampled transfer function here; leave sample_time_s "
                             "out and sample the continuous one with python-control")
        whole = TwoLag.to_tf(self, pade=pade)
        return type(whole)(np.polymul(whole.num[0][0], [self.zero_s, 1.0]), whole.den[0][0])

    def scaled(self, gain: float, lag: float, dead_time_s: float) -> TwoScale:
        """Return the heater with another gain and other lags, both as factors, and another dead time."""
        return replace(self, gain_degC_per_pct=gain * self.gain_degC_per_pct, dead_time_s=dead_time_s,
                       time_constant_s=lag * self.time_constant_s,
                       second_time_constant_s=lag * self.second_time_constant_s)

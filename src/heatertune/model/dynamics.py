"""What a heater does: its answer to power, and itself as a system of python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError, OutOfRange
from heatertune.heater.exact import since_step
from heatertune.units import check

if TYPE_CHECKING:
    from control import StateSpace, TransferFunction

__all__ = ["Dynamics"]

Array = npt.NDArray[np.float64]

_WHOLE: Final = 1e-9  # of an interval: a dead time as near to a multiple of it is one
_SCIPYS_ZERO: Final = 1e-14  # SciPy leaves a leading coefficient up to here out, and warns
_AT_ONCE: Final = 1 << 20  # instants times edges of the power


class _Heater(Protocol):
    @property
    def gain_degC_per_pct(self) -> float: ...
    @property
    def dead_time_s(self) -> float: ...
    @property
    def ambient_degC(self) -> float | None: ...
    @property
    def lags_s(self) -> tuple[float, ...]: ...


class Dynamics:
    """A heater that can be asked for its answer; the value that takes this as a base says which heater."""

    __slots__ = ()

    @property
    def _heater(self) -> _Heater:
        raise NotImplementedError

    def step(self, time_s: npt.ArrayLike, *, power_pct: float = 1.0) -> Array:
        """Return the rise of the temperature after the power stepped from 0 at time 0, shape of `time_s` [°C].

        Args:
            time_s: since the step [s].
            power_pct: height of the step [%].
        """
        heater = self._heater
        since = np.asarray(time_s, dtype=np.float64) - heater.dead_time_s
        return heater.gain_degC_per_pct * power_pct * _unit_step(heater.lags_s, since)

    def predict(
        self, time_s: npt.ArrayLike, power_pct: npt.ArrayLike, *, ambient_degC: float | None = None,
        power_before_pct: float | None = None,
    ) -> Array:
        """Return the temperature that a course of power gives, from rest, shape (n,) [°C].

        Args:
            time_s: instants, strictly increasing, shape (n,) [s].
            power_pct: held from its instant to the next, shape (n,) [0…100 %].
            ambient_degC: without power; by default the heater's own [°C].
            power_before_pct: at which the heater rests before the first instant; by default the first power [%].

        Raises:
            InputError: the ambient temperature is unknown.
            OutOfRange: shapes differ, instants that do not increase, a power outside 0…100 %.
        """
        heater = self._heater
        ambient = heater.ambient_degC if ambient_degC is None else ambient_degC
        if ambient is None:
            raise InputError("the ambient temperature is unknown: state ambient_degC")
        time, power = _course(time_s, power_pct)
        before = float(power[0]) if power_before_pct is None else power_before_pct
        check("power_before_pct", before, least=0.0, most=100.0)
        steps = np.diff(power, prepend=before)
        edges = steps != 0.0
        began, height = time[edges] + heater.dead_time_s, steps[edges]
        part = max(_AT_ONCE // max(len(began), 1), 1)
        risen = [_unit_step(heater.lags_s, later[:, None] - began) @ height
                 for later in np.split(time, range(part, len(time), part))]
        return np.asarray(ambient + heater.gain_degC_per_pct * (before + np.concatenate(risen)))

    def to_tf(self, *, pade: int | None = None, sample_time_s: float | None = None) -> TransferFunction:
        """Return the heater as python-control's transfer function, from power [%] to rise above the ambient [°C].

        Args:
            pade: order of the Padé approximant that stands for the dead time of a continuous system.
            sample_time_s: of the sampled system with held power, in which the dead time is exact, whatever it is [s].

        Raises:
            OutOfRange: both are given, or neither and there is a dead time: python-control has none; an order below 1,
                which would leave the dead time out.
        """
        import control  # noqa: PLC0415 - a second that few have to wait

        heater = self._heater
        if (sample_time_s is None) == (pade is None) and (heater.dead_time_s > 0.0 or pade is not None):
            raise OutOfRange("pade", pade, "an order, or sample_time_s for a sampled system with the exact dead time")
        if pade is not None:
            check("pade", pade, least=1)
        if sample_time_s is not None:
            return control.TransferFunction(*_sampled(heater, sample_time_s), sample_time_s)
        above, below = control.pade(heater.dead_time_s, pade or 0)
        for lag in heater.lags_s:
            below = np.polymul(below, [lag, 1.0])
        return control.TransferFunction(heater.gain_degC_per_pct * np.asarray(above), below)

    def to_ss(self, *, pade: int | None = None, sample_time_s: float | None = None) -> StateSpace:
        """Return `to_tf` as python-control's state space."""
        from control import StateSpace  # noqa: PLC0415 - as above
        from scipy.signal import tf2ss  # noqa: PLC0415 - as above

        system = self.to_tf(pade=pade, sample_time_s=sample_time_s)
        matrices = tf2ss(system.num[0][0], system.den[0][0])
        return StateSpace(*matrices) if sample_time_s is None else StateSpace(*matrices, sample_time_s)


def _unit_step(lags_s: tuple[float, ...], since_s: Array) -> Array:
    """Return the unit-step response of one lag or two, 0 before the step."""
    return since_step(np.maximum(since_s, 0.0), *lags_s)[0]


def _course(time_s: npt.ArrayLike, power_pct: npt.ArrayLike) -> tuple[Array, Array]:
    time, power = np.asarray(time_s, dtype=np.float64), np.asarray(power_pct, dtype=np.float64)
    if time.ndim != 1 or not len(time) or power.shape != time.shape:
        raise OutOfRange("power_pct", power.shape, f"one power for each of {time.shape} instants")
    if not np.all(np.diff(time) > 0.0):
        raise OutOfRange("time_s", float(time[0]), "strictly increasing")
    for value in (float(power.min()), float(power.max())):
        check("power_pct", value, least=0.0, most=100.0)
    return time, power


def _sampled(heater: _Heater, sample_time_s: float) -> tuple[Array, Array]:
    """Return numerator and denominator of the sampled heater with held power.

    With q = exp(−TA/T) of each lag, the denominator is Π(z − q), and the increments of the step response, which the
    dead time shifts, give the numerator: it ends after as many coefficients as there are lags, and one more where the
    dead time is no multiple of TA (K. J. Åström, B. Wittenmark, Computer-Controlled Systems, 3rd ed., section 2.6).
    """
    check("sample_time_s", sample_time_s, above=0.0)
    whole = int(heater.dead_time_s / sample_time_s + _WHOLE)
    rest = heater.dead_time_s - whole * sample_time_s
    below = np.poly(np.exp(-sample_time_s / np.array(heater.lags_s)))
    count = len(heater.lags_s) + (rest > _WHOLE * sample_time_s)
    instants = sample_time_s * np.arange(1, count + 1) - max(rest, 0.0)
    rise = _unit_step(heater.lags_s, np.asarray(instants, dtype=np.float64))
    increments = heater.gain_degC_per_pct * np.diff(rise, prepend=0.0)
    above = np.convolve(below, increments)[: len(increments)]
    if len(above) > 1 and abs(above[0]) <= min(_SCIPYS_ZERO, 1e-6 * np.abs(above).max()):
        # the next one takes it over, which keeps the gain
        above = np.append(above[0] + above[1], above[2:])
    return above, np.concatenate([below, np.zeros(whole + len(increments) - len(heater.lags_s))])

"""Heater models (`Fopdt`, `TwoLag`, …) with their response to power, the result of a fit, and its checks.

A heater can also be given by its numbers, without a log. python-control is loaded only on request.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Final, Protocol, cast

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.heater.exact import since_step
from heatertune.model.findings import Finding
from heatertune.model.statistics import Interval
from heatertune.show import NotebookDisplay
from heatertune.units import check

if TYPE_CHECKING:
    from control import StateSpace, TransferFunction

    from heatertune.heater.heat_loss import LossCurve
    from heatertune.model.disturbance import CoolingEffect, DisturbanceEffect

__all__ = [
    "DEFAULT_PADE", "Candidate", "Dynamics", "FitOutcome", "FittedModel", "Fopdt", "Half", "HeaterModel", "HeldOut",
    "InputCorrelation", "OneLog", "Residuals", "TwoLag", "Validation", "disagreeing_parameters", "model_by_hand",
]


#: order of the Padé approximant of a dead time where none is stated
DEFAULT_PADE: Final = 4
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
    def unit_step(self, since_s: Array) -> Array: ...


class Dynamics:
    """Base class for heaters that provides their response; the derived value defines the heater."""

    __slots__ = ()

    @property
    def _heater(self) -> _Heater:
        raise NotImplementedError

    @property
    def loss(self) -> LossCurve | None:
        """The curve of the heat loss; None if the loss is proportional to the rise above the ambient."""
        return None

    @property
    def fast_share(self) -> float | None:
        """Share of the power's effect that passes the slow mass; None if there is no such mass, see `TwoScale`."""
        return None

    @property
    def linear(self) -> tuple[HeaterModel, ...]:
        """The linear heaters that a design has to serve: itself, or the tangents at the setpoints of use."""
        return (cast("HeaterModel", self),)

    def step(self, time_s: npt.ArrayLike, *, power_pct: float = 1.0) -> Array:
        """Return the rise of the temperature after the power stepped from 0 at time 0, shape of `time_s` [°C].

        Args:
            time_s: since the step [s].
            power_pct: height of the step [%].
        """
        heater = self._heater
        since = np.asarray(time_s, dtype=np.float64) - heater.dead_time_s
        return heater.gain_degC_per_pct * power_pct * heater.unit_step(since)

    def unit_step(self, since_s: Array) -> Array:
        """Return the response of the lags alone to a unit step `since_s` ago [s], 0 before it; shape of `since_s`."""
        return since_step(np.maximum(since_s, 0.0), *self._heater.lags_s)[0]

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
        return self._predicted(time, power, ambient, before)

    def _predicted(self, time: Array, power: Array, ambient: float, before: float) -> Array:
        """Return the temperature from rest at a power before, see `predict`."""
        heater = self._heater
        steps = np.diff(power, prepend=before)
        edges = steps != 0.0
        began, height = time[edges] + heater.dead_time_s, steps[edges]
        part = max(_AT_ONCE // max(len(began), 1), 1)
        risen = [heater.unit_step(later[:, None] - began) @ height
                 for later in np.split(time, range(part, len(time), part))]
        return np.asarray(ambient + heater.gain_degC_per_pct * (before + np.concatenate(risen)))

    def to_tf(self, *, pade: int | None = None, sample_time_s: float | None = None) -> TransferFunction:
        """Return the heater as python-control's transfer function, from power [%] to rise above the ambient [°C].

        Args:
            pade: order of the Padé approximant of the dead time L in a continuous system; None: `DEFAULT_PADE`, whose
                phase is right to 0.1° up to ω = 3.4/L.
            sample_time_s: of the sampled system with held power, in which the dead time is exact, whatever it is [s].

        Raises:
            OutOfRange: both are given; an order below 1, which would omit the dead time.
        """
        import control

        heater = self._heater
        if sample_time_s is not None and pade is not None:
            raise OutOfRange("pade", pade, "an order, or sample_time_s for a sampled system with the exact dead time")
        if pade is not None:
            check("pade", pade, least=1)
        if sample_time_s is not None:
            return control.TransferFunction(*_sampled(heater, sample_time_s), sample_time_s)
        above, below = control.pade(heater.dead_time_s, pade or DEFAULT_PADE)
        for lag in heater.lags_s:
            below = np.polymul(below, [lag, 1.0])
        return control.TransferFunction(heater.gain_degC_per_pct * np.asarray(above), below)

    def to_ss(self, *, pade: int | None = None, sample_time_s: float | None = None) -> StateSpace:
        """Return `to_tf` as python-control's state space."""
        from control import StateSpace
        from scipy.signal import tf2ss

        system = self.to_tf(pade=pade, sample_time_s=sample_time_s)
        matrices = tf2ss(system.num[0][0], system.den[0][0])
        return StateSpace(*matrices) if sample_time_s is None else StateSpace(*matrices, sample_time_s)


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
    rise = heater.unit_step(np.asarray(instants, dtype=np.float64))
    increments = heater.gain_degC_per_pct * np.diff(rise, prepend=0.0)
    above = np.convolve(below, increments)[: len(increments)]
    if len(above) > 1 and abs(above[0]) <= min(_SCIPYS_ZERO, 1e-6 * np.abs(above).max()):
        # the next one takes it over, which keeps the gain
        above = np.append(above[0] + above[1], above[2:])
    return above, np.concatenate([below, np.zeros(whole + len(increments) - len(heater.lags_s))])


Bounds = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class InputCorrelation:
    """The largest correlation of the residuals with the power, relative to its significance limit.

    Attributes:
        largest: normalised correlation at that lag, both series whitened.
        at_lag_s: the power's lead over the residual [s].
        limit: 95 % limit of the largest magnitude over all lags for a correct model.
    """

    largest: float
    at_lag_s: float
    limit: float

    @property
    def ok(self) -> bool:
        """Whether the correlation is insignificant."""
        return abs(self.largest) <= self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Cross-validation: windows omitted from the fit one at a time, and predicted by the fit to the others.

    Attributes:
        fit_pct: 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) over all of them [%].
        rmse_degC: error over all of them [°C].
        windows_s: first and last instant of each [s].
        rmses_degC: error in each [°C].
    """

    fit_pct: float
    rmse_degC: float
    windows_s: tuple[Bounds, ...]
    rmses_degC: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Half:
    """One lag fitted to one half of a log.

    Attributes:
        window_s: first and last instant [s].
        values: parameter → its value, unit in the name.
        ci95: parameter → 95 % interval, symmetrical; an impossible end is open.
        ambient_degC: of this half, None if no temperature there is [°C].
        fit_pct, rmse_degC: on this half [%, °C].
    """

    window_s: Bounds
    values: Mapping[str, float]
    ci95: Mapping[str, Interval]
    ambient_degC: float | None
    fit_pct: float
    rmse_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """Checks of the working model of a log with power.

    Attributes:
        ljung_box: whiteness of the residuals; see `validation.ljung_box`.
        input_correlation: None if the power does not change within the horizon.
        held_out: cross-validation.
        halves: None if one of them gives no heater or has too few readings.
    """

    ljung_box: float
    input_correlation: InputCorrelation | None
    held_out: HeldOut
    halves: tuple[Half, Half] | None


def disagreeing_parameters(halves: tuple[Half, Half], *, reaches: float = 1.0) -> tuple[str, ...]:
    """Return the parameters whose two values differ significantly: at 95 %, or by so many times that interval.

    The variances of two independent estimates add up.
    """
    first, second = halves
    return tuple(
        name for name, value in first.values.items()
        if abs(value - second.values[name]) > reaches * math.hypot(*(_reach(half, name) for half in halves))
    )


def _reach(half: Half, name: str) -> float:
    high = half.ci95[name].high
    return math.inf if high is None else high - half.values[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fopdt(Dynamics):
    """First order plus dead time: T' = (ambient + gain·power(t − dead time) − T)/time constant.

    Attributes:
        gain_degC_per_pct: steady rise per percent of power [°C/%]; negative for a cooler.
        time_constant_s: [s].
        dead_time_s: [s].
        ambient_degC: temperature without power [°C], None if unknown.

    Raises:
        OutOfRange: a gain of zero, a time constant that is not positive, a negative dead time.
    """

    gain_degC_per_pct: float
    time_constant_s: float
    dead_time_s: float
    ambient_degC: float | None = None

    def __post_init__(self) -> None:
        _check_plant(self)

    @classmethod
    def from_tf(cls, system: TransferFunction, *, ambient_degC: float | None = None) -> Fopdt:
        """Return the heater of python-control's transfer function, from power [%] to rise above the ambient [°C].

        Args:
            system: continuous, with the dead time as a Padé approximant, or sampled with held power.
            ambient_degC: temperature without power [°C], None if unknown.

        Raises:
            InputError: another system than of first order plus dead time; `TwoLag` has its own.
        """
        heater = _from_tf(system, ambient_degC)
        if not isinstance(heater, cls):
            raise InputError("no FOPDT: two lags; TwoLag.from_tf takes them, and its half_rule() gives one")
        return heater

    @property
    def _heater(self) -> Fopdt:
        return self

    @property
    def lags_s(self) -> tuple[float, ...]:
        """Time constants of the lags in series [s]."""
        return (self.time_constant_s,)

    def half_rule(self) -> Fopdt:
        """Return the model itself: it is of first order already."""
        return self

    def frequency_response(self, omega: Array) -> npt.NDArray[np.complex128]:
        """Return G(jω) [°C/%] at `omega` [rad/s], shape (n,), with the exact e^(−jωL)."""
        return _response(self, omega)


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoLag(Dynamics):
    """Two lags in series and a dead time: the heater and the sensor (or the mass behind it).

    Attributes:
        gain_degC_per_pct: steady rise per percent of power [°C/%]; negative for a cooler.
        time_constant_s: the larger lag [s].
        second_time_constant_s: the smaller lag [s].
        dead_time_s: [s].
        ambient_degC: temperature without power [°C], None if unknown.

    Raises:
        OutOfRange: a gain of zero, a lag that is not positive, lags in the wrong order, a negative dead time.
    """

    gain_degC_per_pct: float
    time_constant_s: float
    second_time_constant_s: float
    dead_time_s: float
    ambient_degC: float | None = None

    def __post_init__(self) -> None:
        _check_plant(self)
        check("second_time_constant_s", self.second_time_constant_s, above=0.0, most=self.time_constant_s)

    @classmethod
    def from_tf(cls, system: TransferFunction, *, ambient_degC: float | None = None) -> TwoLag:
        """Return the heater of python-control's transfer function; as `Fopdt.from_tf`, with two lags.

        With a zero between the lags it is a `TwoScale`.

        Raises:
            InputError: another system than of two lags plus dead time; of `TwoScale`, one without a zero.
        """
        heater = _from_tf(system, ambient_degC)
        if not isinstance(heater, cls):
            raise InputError(f"no {cls.__name__}: {type(heater).__name__}.from_tf takes it")
        return heater

    @property
    def _heater(self) -> TwoLag:
        return self

    @property
    def lags_s(self) -> tuple[float, ...]:
        """Time constants of the lags in series [s]."""
        return (self.time_constant_s, self.second_time_constant_s)

    def half_rule(self) -> Fopdt:
        """Return the FOPDT of Skogestad's half rule.

        Half of the smaller lag goes to the time constant, half to the dead time (S. Skogestad, "Simple
        analytic rules for model reduction and PID controller tuning", J. Process Control 13 (2003), eq. 10).
        """
        half = self.second_time_constant_s / 2.0
        return Fopdt(gain_degC_per_pct=self.gain_degC_per_pct, time_constant_s=self.time_constant_s + half,
                     dead_time_s=self.dead_time_s + half, ambient_degC=self.ambient_degC)

    def frequency_response(self, omega: Array) -> npt.NDArray[np.complex128]:
        """Return G(jω) [°C/%] at `omega` [rad/s], shape (n,), with the exact e^(−jωL)."""
        return _response(self, omega)


HeaterModel = Fopdt | TwoLag


def _delayed(plant: HeaterModel, delay_s: float) -> HeaterModel:
    return replace(plant, dead_time_s=plant.dead_time_s + delay_s)


def _check_plant(plant: HeaterModel) -> None:
    check("gain_degC_per_pct", plant.gain_degC_per_pct)
    if plant.gain_degC_per_pct == 0.0:
        raise OutOfRange("gain_degC_per_pct", 0.0, "not zero: above for a heater, below for a cooler")
    check("time_constant_s", plant.time_constant_s, above=0.0)
    check("dead_time_s", plant.dead_time_s, least=0.0)
    if plant.ambient_degC is not None:
        check("ambient_degC", plant.ambient_degC, least=-273.15)


def _response(plant: HeaterModel, omega: Array) -> npt.NDArray[np.complex128]:
    s = 1j * np.asarray(omega, dtype=np.float64)
    response = plant.gain_degC_per_pct * np.exp(-s * plant.dead_time_s)
    for lag in plant.lags_s:
        response = response / (lag * s + 1.0)
    return np.asarray(response, dtype=np.complex128)


class FitOutcome(Enum):
    """How a fit ended; each member is the sentence a person needs, remedy included."""

    IDENTIFIED = "All parameters are identified."
    COMBINATIONS_ONLY = (
        "Only combinations of parameters are identified: log the heater power, "
        "or an open-loop step that lasts at least three time constants."
    )
    NO_POWER_CHANGE = "The power never changes, so the gain is unknown: log a step of the power."
    POOR_FIT = "No model explains the log well: log the power, and keep doors and fans still."
    LAW_UNKNOWN = "No control law that can be tried made this log: log the heater power."
    BY_HAND = "The model was entered by its numbers; no log supports it."


#: how the law of a candidate of a log with power begins
_POWER_LOGGED: Final = "power logged"
#: outcome → its sentence for a log with power
_OF_POWER_LOGS: Final = {
    FitOutcome.COMBINATIONS_ONLY: (
        "Only combinations of parameters are identified: log on until the temperature rests, at least three time "
        "constants after a step of the power in open loop."),
    FitOutcome.POOR_FIT: (
        "No model explains the log well: keep doors and fans still while you log, and log each change of the power at "
        "its own instant."),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """The best fit of one hypothesis: a heater and its excitation.

    Attributes:
        model: the heater.
        log: name of the log it was fitted to.
        window_s: first and last instant used [s].
        law: the controller hypothesis simulated inside the fit, or "power logged".
        controller: fitted constants of that hypothesis, name → value, unit in the name.
        fit_pct: 100·(1 − ‖y−ŷ‖/‖y−ȳ‖) [%].
        rmse_degC: root mean square simulation error [°C].
        delta_bic: BIC above the best model on the same rows (AR(1) errors).
        fits_pct: log → fit on that log alone [%], if one heater was fitted to several.
        hold_out_rmse_degC: error on the later readings, fitted to the earlier ones alone [°C], None if not tried.
        cross_rmse_degC: error on blocks of readings left out of the fit [°C], None if not tried.
        on_bound: names of the parameters on a bound of the search.
        part: the end of an interval that it represents, if it is not a hypothesis of its own
            ("dead time at its high end"); empty otherwise. Heaters are sampled only around the others.
    """

    model: HeaterModel
    log: str
    window_s: tuple[float, float]
    law: str
    fit_pct: float
    rmse_degC: float
    delta_bic: float
    controller: Mapping[str, float] = field(default_factory=dict)
    fits_pct: Mapping[str, float] = field(default_factory=dict)
    hold_out_rmse_degC: float | None = None
    cross_rmse_degC: float | None = None
    on_bound: tuple[str, ...] = ()
    part: str = ""

    @property
    def label(self) -> str:
        """Short name for tables and pictures."""
        order = "one lag" if isinstance(self.model, Fopdt) else "two lags"
        return ", ".join(filter(None, (self.log, order, self.law, self.part)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residuals:
    """The log, the simulation of the working model, and the autocorrelation of the residuals.

    Attributes:
        time_s, measured_degC, simulated_degC: shape (n,).
        autocorrelation: at lags 1…, shape (m,).
    """

    time_s: Array
    measured_degC: Array
    simulated_degC: Array
    autocorrelation: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class OneLog:
    """One of several logs with power that were fitted together.

    Attributes:
        name: of the log.
        fit_pct: of the one heater for all logs on this one [%].
        alone_fit_pct: of this log's own heater [%].
        ambient_degC: its own, with the one heater [°C].
        drift_degC_per_s: of that ambient; 0 if none was fitted [°C/s].
        noise_degC: standard deviation of the residuals of the common heater [°C].
        values: parameter → its value by this log alone, unit in the name.
        ci95: parameter → 95 % interval of this log alone.
    """

    name: str
    fit_pct: float
    alone_fit_pct: float
    ambient_degC: float
    drift_degC_per_s: float
    noise_degC: float
    values: Mapping[str, float]
    ci95: Mapping[str, Interval]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedModel(NotebookDisplay, Dynamics):
    """Result of a fit: the heater of a log.

    Attributes:
        model: the FOPDT to work with.
        ci95: field name → 95 % interval, None if the log does not identify the field.
        combinations: identifiable combinations, name with unit → (value, interval).
        candidates: every model that explains the data nearly as well; tuning and proof run on all.
        hypotheses: all compared hypotheses, the best by BIC first; the candidates are among them.
        outcome: of the fit, with the remedy.
        fit_pct: of the working model [%], None for a model given by its parameters.
        method: of the fit, one sentence.
        notes: quantities that the log does not identify, and the consequences, one sentence each.
        residuals: of the working model, None for a model given by its parameters.
        validation: checks of the working model, None if no power was logged or several logs were fitted together.
        logs: results of each of several logs with power; empty for one log.
        log_told: read summary of each log, one line each.
        findings: that affect the verdict.
        setpoint_degC: operating temperature of the heater, None if unknown [°C].
        logged_range_degC: lowest and highest logged temperature, None without a log and in a document of an earlier
            version [°C].
        log_interval_s: between two readings, 0 for a model given by its parameters [s].
        least_dead_time_s: shortest plausible dead time: half the log's interval, and the sensor's delay [s].
        reading_step_degC: sensor resolution, or the noise of one reading if that is larger, 0 if unknown [°C].
        assumed: additional knowledge of the user, name with unit → value.
        disturbance: effect of a measured disturbance, or None.
        cooling: effect of a cooler in addition to the heater, or None.
    """

    model: Fopdt
    outcome: FitOutcome
    method: str
    ci95: Mapping[str, Interval | None] = field(default_factory=dict)
    combinations: Mapping[str, tuple[float, Interval]] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    hypotheses: tuple[Candidate, ...] = ()
    fit_pct: float | None = None
    notes: tuple[str, ...] = ()
    residuals: Residuals | None = None
    validation: Validation | None = None
    logs: tuple[OneLog, ...] = ()
    log_summary: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    setpoint_degC: float | None = None
    logged_range_degC: tuple[float, float] | None = None
    log_interval_s: float = 0.0
    least_dead_time_s: float = 0.0
    reading_step_degC: float = 0.0
    assumed: Mapping[str, float] = field(default_factory=dict)
    disturbance: DisturbanceEffect | None = None
    cooling: CoolingEffect | None = None

    def __post_init__(self) -> None:
        for name in ("log_interval_s", "least_dead_time_s", "reading_step_degC"):
            check(name, getattr(self, name), least=0.0)
        if self.logged_range_degC is not None:
            low, high = self.logged_range_degC
            check("logged_range_degC", low, least=-273.15)
            check("logged_range_degC", high, least=low)

    def __repr__(self) -> str:
        """Return the working model and its quality in one line; `summary()` has the rest."""
        fit = "" if self.fit_pct is None else f", fit {self.fit_pct:.1f} %"
        own, count = self.model, len(self.heaters)
        ambient = "" if own.ambient_degC is None else f", ambient {own.ambient_degC:.4g} °C"
        return (f"<FittedModel {own.gain_degC_per_pct:.4g} °C/%, lag {own.time_constant_s:.4g} s, dead time "
                f"{own.dead_time_s:.4g} s{ambient}{fit}, {count} plausible heater{'s' if count > 1 else ''}, "
                f"{self.outcome.name}>")

    @property
    def _heater(self) -> HeaterModel:
        return self._curved or self.model

    @property
    def _curved(self) -> HeaterModel | None:
        """The first heater, if it has a loss curve: the working model is its tangent."""
        return self.candidates[0].model if self.candidates and self.candidates[0].model.loss is not None else None

    def _predicted(self, time: Array, power: Array, ambient: float, before: float) -> Array:
        first = self._curved
        if first is None:
            return Dynamics._predicted(self, time, power, ambient, before)
        return first._predicted(time, power, ambient, before)

    @property
    def outcome_text(self) -> str:
        """The outcome of the fit as text, with a remedy that its log does not already satisfy."""
        if not any(each.law.startswith(_POWER_LOGGED) for each in self.candidates):
            return self.outcome.value
        return _OF_POWER_LOGS.get(self.outcome, self.outcome.value)

    @property
    def heaters(self) -> tuple[tuple[str, HeaterModel], ...]:
        """Every plausible heater, once, with its label and a plausible dead time; without candidates the model."""
        labelled_models = [(c.label, c.model) for c in self.candidates] or [("by hand", self.model)]
        return self._believed(labelled_models)

    @property
    def plants(self) -> tuple[HeaterModel, ...]:
        """Every linear heater a design has to serve."""
        return tuple(dict.fromkeys(linear for _, model in self.heaters for linear in model.linear))

    @property
    def hypothetical(self) -> tuple[HeaterModel, ...]:
        """The plausible heaters that are not ends of an interval; samples are drawn around these."""
        labelled_models = [(c.label, c.model) for c in self.candidates if not c.part] or [("by hand", self.model)]
        return tuple(model for _, model in self._believed(labelled_models))

    def with_delay(self, delay_s: float) -> FittedModel:
        """Return the fit with every dead time longer by a delay of the loop.

        Args:
            delay_s: between the temperature and its reading, and between the output and the heater's switch [s].

        Raises:
            OutOfRange: a negative delay.
        """
        check("delay_s", delay_s, least=0.0)
        if delay_s == 0.0:
            return self
        interval = self.ci95.get("dead_time_s")
        ci95 = self.ci95 if interval is None else {**self.ci95, "dead_time_s": replace(
            interval, **{end: value + delay_s for end in ("low", "high")
                         if (value := getattr(interval, end)) is not None})}
        candidates = tuple(replace(each, model=_delayed(each.model, delay_s)) for each in self.candidates)
        model = replace(self.model, dead_time_s=self.model.dead_time_s + delay_s)
        return replace(self, model=model, candidates=candidates, ci95=ci95,
                       least_dead_time_s=self.least_dead_time_s + delay_s)

    def _believed(self, models: Sequence[tuple[str, HeaterModel]]) -> tuple[tuple[str, HeaterModel], ...]:
        labels: dict[HeaterModel, str] = {}
        for label, model in models:
            least = self.least_dead_time_s
            labels.setdefault(model if model.dead_time_s >= least else replace(model, dead_time_s=least), label)
        return tuple((label, model) for model, label in labels.items())


def _from_tf(system: TransferFunction, ambient_degC: float | None) -> HeaterModel:
    from heatertune.model.transfer_functions import heater_from

    return heater_from(system, ambient_degC=ambient_degC)


def model_by_hand(model: HeaterModel) -> FittedModel:
    """Return a model that was typed in, in the form the other stages take."""
    fopdt = model if isinstance(model, Fopdt) else model.half_rule()
    candidate = Candidate(
        model=model, log="by hand", window_s=(0.0, 0.0), law="no log", fit_pct=float("nan"), rmse_degC=float("nan"),
        delta_bic=0.0,
    )
    return FittedModel(
        model=fopdt, outcome=FitOutcome.BY_HAND, method="given by hand", candidates=(candidate,),
        notes=("No intervals are known: the proof runs on this model only.",),
    )

"""A designed controller in the ideal form, its conversion to the other forms, and the sampling intervals of a timer.

    ideal     K·(1 + 1/(TN·s) + TV·s)             also: standard, ISA, non-interacting; the form of this program
    series    K'·(1 + 1/(TN'·s))·(1 + TV'·s)      also: interacting, classical
    parallel  Kp + Ki/s + Kd·s

Every series form has an ideal form; the inverse needs TN ≥ 4·TV, for real zeros (K. J. Åström and T. Hägglund, "PID
Controllers", 2nd ed., ISA 1995, section 3.2). Derivative filters are not converted: the conversions hold below the
corner frequency of the filter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from heatertune.errors import InputError, OutOfRange
from heatertune.show import NotebookDisplay
from heatertune.units import check

if TYPE_CHECKING:
    from control import TransferFunction

__all__ = [
    "DERIVATIVE_FILTER_N", "Margins", "PidDesign", "Promise", "Settings", "Timer", "ideal_to_parallel",
    "ideal_to_series", "other_forms", "series_to_ideal", "step_parts", "structure_of",
]


#: TV over the lag of the derivative filter of a continuous design; K. J. Åström and T. Hägglund use 8…20
DERIVATIVE_FILTER_N: Final = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Timer:
    """The timer of the target: shortest, longest and step of the sampling interval [s]."""

    shortest_s: float = 0.01
    longest_s: float = 600.0
    step_s: float = 0.01

    def round(self, wanted_s: float) -> float:
        """Return a plain interval near the wanted one: whole seconds above 10 s, tenths above 1 s, else steps."""
        plain = 1.0 if wanted_s > 10.0 else 0.1 if wanted_s > 1.0 else self.step_s
        plain = max(plain, self.step_s)
        rounded = round(wanted_s / plain) * plain
        rounded = min(max(rounded, self.shortest_s), self.longest_s)
        return round(round(rounded / self.step_s) * self.step_s, 6)


#: proportional gain [%/°C], integral-action time [s] (infinite: no I part), derivative-action time [s]
Settings = tuple[float, float, float]


def series_to_ideal(gain: float, integral_time_s: float, derivative_time_s: float) -> Settings:
    """Return the ideal form of a series one: K = K'·f, TN = TN'·f, TV = TV'/f with f = 1 + TV'/TN'."""
    factor = 1.0 + derivative_time_s / integral_time_s
    return gain * factor, integral_time_s * factor, derivative_time_s / factor


def ideal_to_series(gain: float, integral_time_s: float, derivative_time_s: float) -> Settings:
    """Return the series form of an ideal one; of the two that exist, the one with the larger TN'.

    Raises:
        InputError: TV is above TN/4, so no series form exists.
    """
    if derivative_time_s > integral_time_s / 4.0:
        raise InputError(
            f"TV = {derivative_time_s:g} s has no series form with TN = {integral_time_s:g} s; allowed: TV <= TN/4 = "
            f"{integral_time_s / 4.0:g} s"
        )
    factor = 0.5 * (1.0 + math.sqrt(1.0 - 4.0 * derivative_time_s / integral_time_s))
    return gain * factor, integral_time_s * factor, derivative_time_s / factor


def ideal_to_parallel(gain: float, integral_time_s: float, derivative_time_s: float) -> tuple[float, float, float]:
    """Return Kp [%/°C], Ki = K/TN [%/(°C·s)] and Kd = K·TV [%·s/°C]."""
    return gain, gain / integral_time_s, gain * derivative_time_s


def other_forms(gain: float, integral_time_s: float, derivative_time_s: float) -> dict[str, dict[str, float] | None]:
    """Return the same controller in JSON form, as "series" (None if it does not exist) and "parallel".

    "kp" [%/°C], "ki" [%/(°C·s)], "kd" [%·s/°C]; the series names are those of the ideal form.
    """
    forms: dict[str, dict[str, float] | None] = {
        "series": None,
        "parallel": dict(
            zip(("kp", "ki", "kd"), ideal_to_parallel(gain, integral_time_s, derivative_time_s), strict=True)
        ),
    }
    if derivative_time_s <= integral_time_s / 4.0:
        names = ("gain_pct_per_degC", "integral_time_s", "derivative_time_s")
        series = ideal_to_series(gain, integral_time_s, derivative_time_s)
        forms["series"] = dict(zip(names, series, strict=True))
    return forms


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Robustness of one sampled loop, from its exact frequency response.

    Attributes:
        ms: max |1/(1 + L)|; infinite if the closed loop is unstable.
        mt: max |L/(1 + L)|; infinite if the closed loop is unstable.
        gain_margin: factor by which the gain may grow; infinite if no crossing limits it.
        phase_margin_deg: [°].
    """

    ms: float
    mt: float
    gain_margin: float
    phase_margin_deg: float

    @property
    def stable(self) -> bool:
        """Whether the closed loop is stable."""
        return math.isfinite(self.ms)


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """Limits required on heaters sampled from a fit, for the design and for its rounded parameters.

    Attributes:
        way: "p95" or "worst", see `heatertune.pid.search.robust.ROBUST`.
        limits: "ms", "mt", "mks" [%/°C] → largest value, if set.
    """

    way: str
    limits: Mapping[str, float] = field(hash=False)  # a dictionary has no hash, and designs are looked up by theirs


@dataclass(frozen=True, slots=True, kw_only=True)
class PidDesign(NotebookDisplay):
    """u = K·(e + 1/TN·∫e dt + TV·de/dt), sampled every TA.

    Attributes:
        gain_pct_per_degC: K, proportional gain [% of full power per °C]; negative for a cooler.
        integral_time_s: TN [s]; infinite without integral action.
        derivative_time_s: TV [s]; 0 without derivative action.
        sample_time_s: TA [s]; 0: continuous, with the derivative filter N of `heatertune.pid.continuous_loop`.
        structure: "p", "pi" or "pid".
        method: design method.
        margins: worst over the models it was made for, None if not computed.
        iae_load: ∫|e| dt after a load step of 1 % power, worst over the models [°C·s], None if not computed.
        iae_setpoint: ∫|e| dt after a setpoint step of 1 °C [s], None if not computed.
        mks: max |C·S|, the noise gain from reading to power, worst over the models [%/°C], None if not computed.
        notes: remarks for the user, one sentence each.
        derivative_filter: f in D_k = f·D_{k−1} + (1 − f)·TV/TA·(e_k − e_{k−1}); 0: not filtered.
        promise: limits kept on heaters sampled from the fit, None if not requested.
        step_power_limit_pct_per_degC: limit of `step_power_pct_per_degC`, so that one step of the sensor
            moves no more power than requested; infinite without a limit [%/°C].

    Raises:
        OutOfRange: a gain that is zero or not finite, a time that is not positive, a structure that contradicts
            TN or TV.
    """

    gain_pct_per_degC: float
    integral_time_s: float
    derivative_time_s: float
    sample_time_s: float
    structure: str
    method: str
    margins: Margins | None = None
    iae_load: float | None = None
    iae_setpoint: float | None = None
    mks: float | None = None
    notes: tuple[str, ...] = field(default=())
    derivative_filter: float = 0.5
    promise: Promise | None = None
    step_power_limit_pct_per_degC: float = math.inf

    def __repr__(self) -> str:
        """Return structure and constants in one line; `summary()` has the rest."""
        ms = "" if self.margins is None else f", Ms {self.margins.ms:.4g}"
        return (f"<PidDesign {self.structure.upper()}: K {self.gain_pct_per_degC:.4g} %/°C, TN "
                f"{self.integral_time_s:.4g} s, TV {self.derivative_time_s:.4g} s, TA {self.sample_time_s:.4g} s{ms}>")

    def __post_init__(self) -> None:
        check("gain_pct_per_degC", self.gain_pct_per_degC)
        if self.gain_pct_per_degC == 0.0:
            raise OutOfRange("gain_pct_per_degC", 0.0, "not zero")
        check("integral_time_s", self.integral_time_s, above=0.0, infinite=True)
        check("derivative_time_s", self.derivative_time_s, least=0.0)
        check("sample_time_s", self.sample_time_s, least=0.0)
        check("derivative_filter", self.derivative_filter, least=0.0, most=1.0 - 1e-9)
        if self.structure != structure_of(self.integral_time_s, self.derivative_time_s):
            raise OutOfRange("structure", self.structure, "the one that TN and TV make")

    def to_tf(self, *, continuous: bool = False) -> TransferFunction:
        """Return the controller as python-control's transfer function, from error [°C] to power [%].

        Args:
            continuous: whether a sampled design is returned in s, with the derivative filter f as a lag of
                f·TA/(1 − f), which backward differences turn into it; a design with TA = 0 always is, with the filter
                TV/N of `heatertune.pid.continuous_loop`.
        """
        import control

        ta, past = self.sample_time_s, self.derivative_filter
        parts = control.tf([1.0], [1.0], *(() if continuous or ta == 0.0 else (ta,)))
        if continuous or ta == 0.0:
            lag = past * ta / (1.0 - past) if ta > 0.0 else self.derivative_time_s / DERIVATIVE_FILTER_N
            if math.isfinite(self.integral_time_s):
                parts = parts + control.tf([1.0], [self.integral_time_s, 0.0])
            if self.derivative_time_s > 0.0:
                parts = parts + control.tf([self.derivative_time_s, 0.0], [lag, 1.0])
            return self.gain_pct_per_degC * parts
        z = control.tf([1.0, 0.0], [1.0], ta)
        if math.isfinite(self.integral_time_s):
            parts = parts + (ta / self.integral_time_s) * z / (z - 1.0)
        if self.derivative_time_s > 0.0:
            parts = parts + ((1.0 - past) * self.derivative_time_s / ta) * (z - 1.0) / (z - past)
        return self.gain_pct_per_degC * parts

    @property
    def step_power_pct_per_degC(self) -> float:
        """Power that a scan moves at once per °C by which its reading differs from the one before [%/°C]."""
        if self.sample_time_s == 0.0:
            return math.inf if self.derivative_time_s else abs(self.gain_pct_per_degC)
        return abs(self.gain_pct_per_degC) * step_parts(
            self.integral_time_s, self.derivative_time_s, self.sample_time_s, self.derivative_filter)


def step_parts(integral_time_s: float, derivative_time_s: float, sample_time_s: float, past: float) -> float:
    """Return the response of P, I and D part together to a step of the reading in one scan, as a multiple of K."""
    return 1.0 + sample_time_s / integral_time_s + (1.0 - past) * derivative_time_s / sample_time_s


def structure_of(integral_time_s: float, derivative_time_s: float) -> str:
    """Return the letters of the parts that act: "p", "pi", "pd" or "pid"."""
    return "p" + ("i" if math.isfinite(integral_time_s) else "") + ("d" if derivative_time_s > 0.0 else "")

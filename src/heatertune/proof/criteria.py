"""What a loop is judged by: a criterion is one number and its limit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any, Final, Literal

from heatertune.codec import LEFT_OUT, OrInfinite, construct_from, encode
from heatertune.settings import STEP_POWER_PCT
from heatertune.units import check

__all__ = ["Criterion", "LoopLimits", "worst_of"]

_SETTLES_WITHIN: Final = 0.5  # of a soak

@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One number and its limit.

    Attributes:
        name: of the criterion.
        value: what was found; infinite for something that never happened (never settled).
        limit: None: the number informs, nothing depends on it.
        unit: of value and limit.
        what: meaning, in one sentence.
        at_least: whether the value must reach the limit; otherwise it must not exceed it.
        where: label of the run it belongs to.
    """

    name: str
    value: float
    limit: float | None
    unit: str
    what: str
    at_least: bool = False
    where: str = ""

    @property
    def ok(self) -> bool:
        """Whether the limit is kept; what is not a number keeps none, and fails without one too."""
        return _keeps(self.value, self.limit, at_least=self.at_least)

    @property
    def strain(self) -> float:
        """How much of the limit is used: 1 at the limit, above 1 beyond it, 0 without a limit."""
        if math.isnan(self.value):
            return math.inf
        if self.limit is None:
            return 0.0
        used, allowed = (self.limit, self.value) if self.at_least else (self.value, self.limit)
        if allowed > 0.0 and not math.isinf(used):
            return max(0.0, used / allowed)
        return 0.0 if self.ok else math.inf

    @property
    def view(self) -> CriterionView:
        """What is written of it."""
        return construct_from(CriterionView, self, bound=">=" if self.at_least else "<=")

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object; a number that is not finite is null."""
        document: dict[str, Any] = encode(self.view)
        return document


@dataclass(frozen=True, slots=True, kw_only=True)
class CriterionView:
    """A criterion as documents hold it, the worst over all runs; null is infinite."""

    value: OrInfinite
    limit: float | None
    bound: Literal["<=", ">="]
    ok: bool
    unit: str
    where: str
    what: str

    def keeps(self, value: float) -> bool:
        """Return whether a run's value keeps the limit."""
        return _keeps(value, self.limit, at_least=self.bound == ">=")


def _keeps(value: float, limit: float | None, *, at_least: bool) -> bool:
    if limit is None:
        return not math.isnan(value)
    return value >= limit if at_least else value <= limit


def worst_of(same: Iterable[Criterion]) -> Criterion:
    """Return the one that strains its limit most; without limits the one whose value is worst, no number before all."""
    def badness(one: Criterion) -> tuple[bool, float, float]:
        return math.isnan(one.value), one.strain, -one.value if one.at_least else one.value

    return max(same, key=badness)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopLimits:
    """What a loop must keep. None: the number is told, but not judged.

    The margins' limits follow the textbooks: gain margin 1.7…4 and phase margin 30…45° for a well-tuned loop
    (D. E. Seborg, T. F. Edgar, D. A. Mellichamp, "Process Dynamics and Control", frequency response); Ms up to 2
    (K. J. Åström, T. Hägglund, "Advanced PID Control", ISA 2006), which by itself means a phase margin of 29°. They
    hold for every model, the least likely one included. The other limits are this project's choice for heaters.

    Attributes:
        overshoot_pct, overshoot_degC: beyond the setpoint during heat-up [% of the rise from ambient to setpoint, °C];
            both hold.
        reheat_overshoot_pct, reheat_overshoot_degC: beyond the setpoint after the heater's circuit was open [% of the
            rise, °C]; both hold.
        small_change_overshoot_pct, small_change_overshoot_degC: beyond the setpoint after a small change of it [% of
            that change, °C]; both hold.
        settling_s: time after which the temperature stays in the band [s]; None: the time of the first
            disturbance, or the end.
        tolerance_degC: how far from the setpoint the process still is as it should be [°C]: half width of the band,
            and limit of the offset and of the swing at rest.
        tolerance_resolutions: the least the tolerance can be [sensor resolutions]: what the sensor cannot see, the
            controller cannot correct.
        steady_share: last part of the time before the first disturbance that counts as rest, in (0, 1].
        pwm_ripple_degC: peak to peak within one PWM period at rest [°C].
        iae_degC_s: ∫|setpoint − temperature| dt of the whole record, the setpoint as asked for, no ramp [°C·s].
        recovery_s: time after a disturbance until the temperature stays in the band [s]; None: the time until the
            next one, or the end.
        recovery_overshoot_pct, recovery_overshoot_degC: beyond the setpoint after a disturbance, on the other side
            [% of the rise, °C]; both hold.
        deviation_degC: largest distance from the setpoint after a disturbance, on its side [°C].
        saturation_pct: share of the scans that ask for 0 or 100 % power [%].
        power_reserve_pct: power that is left over where the heater holds the highest setpoint [% of full power].
        switchings_per_h: how often the heater is switched on [1/h]; a relay's life is counted in these.
        overflows: how often such a flag was set.
        overflow_flags: names of the flags that mean a wrong result; SM1.1 overflow, SM1.3 division by zero (S7-200).
        ms, gain_margin, phase_margin_deg: margins of the words as realised.
        step_power_pct: power that one step of the reading, or its noise, moves within one scan [%].
        soak_band_degC: how far from the temperature of a profile's soak is still right [°C]; None: the tolerance.
        soak_settling_s, soak_settling_pct: time of a soak after which it has to be [s, % of the soak]; the sooner
            holds; None: half of it.
        ramp_deviation_degC: largest distance from the setpoint on a profile's ramps [°C].
        peak_degC: highest temperature along a profile [°C].

    Raises:
        OutOfRange: a limit that is negative or not finite, a share outside (0, 1].
    """

    overshoot_pct: float | None = 20.0
    overshoot_degC: float | None = None
    reheat_overshoot_pct: float | None = 40.0
    reheat_overshoot_degC: float | None = None
    small_change_overshoot_pct: float | None = field(default=None, metadata=LEFT_OUT)
    small_change_overshoot_degC: float | None = field(default=None, metadata=LEFT_OUT)
    settling_s: float | None = None
    tolerance_degC: float = 1.0
    tolerance_resolutions: float = 2.0
    steady_share: float = 0.2
    pwm_ripple_degC: float | None = None
    iae_degC_s: float | None = None
    recovery_s: float | None = None
    recovery_overshoot_pct: float | None = 20.0
    recovery_overshoot_degC: float | None = None
    deviation_degC: float | None = None
    saturation_pct: float | None = None
    power_reserve_pct: float | None = None
    switchings_per_h: float | None = None
    overflows: float = 0.0
    overflow_flags: tuple[str, ...] = ("SM1.1", "SM1.3", "overflow")
    ms: float | None = 2.0
    gain_margin: float | None = 1.7
    phase_margin_deg: float | None = 30.0
    step_power_pct: float | None = STEP_POWER_PCT
    soak_band_degC: float | None = field(default=None, metadata=LEFT_OUT)
    soak_settling_s: float | None = field(default=None, metadata=LEFT_OUT)
    soak_settling_pct: float | None = field(default=None, metadata=LEFT_OUT)
    ramp_deviation_degC: float | None = field(default=None, metadata=LEFT_OUT)
    peak_degC: float | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        for limit in fields(self):
            value = getattr(self, limit.name)
            if isinstance(value, int | float):
                check(limit.name, value, least=0.0)
        check("steady_share", self.steady_share, above=0.0, most=1.0)

    def soak_settles_s(self, soak_s: float) -> float:
        """Return after what time of a soak the temperature has to be right [s]."""
        given = (self.soak_settling_s, self.soak_settling_pct and self.soak_settling_pct / 100.0 * soak_s)
        return min((limit for limit in given if limit is not None), default=_SETTLES_WITHIN * soak_s)

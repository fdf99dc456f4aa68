"""What a story is made for, and the story made."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from heatertune.proof.criteria import LoopLimits
from heatertune.proof.scenario import Scenario

__all__ = ["LoopTiming", "SequencePlan"]

#: scans by which instants differ that are the same
_SAME: Final = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """What the times of a story depend on beside the heaters.

    Attributes:
        scan_s, pwm_period_s, sample_time_s: of controller and switch [s].
        integral_time_s: TN as the words realise it; infinite or None: there is none [s].
        ramp_degC_per_min: of the setpoint; infinite: none.
        settling_s, recovery_s: that heat-up and recovery may take as specified; a part lasts so long or longer [s].
        soak_settles_s: time of a soak [s] → when in it the temperature has to be right [s].
        cold_degC: how near to the ambient a heater has to be before a profile [°C].
        again_degC: so far from the setpoint full power takes the heater back from the controller; None: nowhere [°C].
        forgets_degC: so far from the setpoint it has forgotten what it summed up, for certain; None: nowhere, or a
            boost's controller begins again only nearer [°C].
        cooling_gain: full power of a cooler as a part of the heater's; 0: there is none.
        small_change_degC: the least change of the setpoint whose overshoot is judged as a share of it; 0: none is
            [°C].
    """

    scan_s: float
    pwm_period_s: float
    sample_time_s: float
    integral_time_s: float | None = None
    ramp_degC_per_min: float = math.inf
    settling_s: float = 0.0
    recovery_s: float = 0.0
    soak_settles_s: Callable[[float], float] = LoopLimits().soak_settles_s
    cold_degC: float = 1.0
    again_degC: float | None = None
    forgets_degC: float | None = None
    cooling_gain: float = 0.0
    small_change_degC: float = 0.0

    def instant(self, seconds: float) -> float:
        """Return an instant, a scan's where it is one but for its last digits: a scan would miss what is later."""
        scans = round(seconds / self.scan_s)
        return scans * self.scan_s if abs(seconds / self.scan_s - scans) <= _SAME else seconds

    @property
    def step_s(self) -> float:
        """The longest of what happens in steps [s]."""
        return max(self.scan_s, self.pwm_period_s, self.sample_time_s)

    @property
    def beat_s(self) -> float:
        """The beat of PWM and TA, 0 where one is a multiple of the other [s]."""
        short, long = sorted((self.pwm_period_s, self.sample_time_s))
        apart = abs(long - round(long / short) * short)
        return 0.0 if apart <= 1e-6 * short else long * short / apart


@dataclass(frozen=True, slots=True, kw_only=True)
class SequencePlan:
    """A story made for heaters and words.

    Attributes:
        scenario: of each run.
        not_tested: parts that were left out and why, a few words each.
        told: what was made easier, likewise.
    """

    scenario: Scenario
    not_tested: tuple[str, ...]
    notes: tuple[str, ...]

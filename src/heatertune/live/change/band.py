"""Where the proof says that the temperature is after words were changed: around the setpoint, from where it was.

It is made of the proof's own figures, the worst of all its runs: how far a response overshoots, how long it takes to
settle, and the band in which it then stays. A load, an open door, is none of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from heatertune.live.change.proven import Proven
from heatertune.plc import controller_for

__all__ = ["Band", "watched_s"]

_TIMES: Final = 5.0  # lags and dead time of the slowest heater
_PERIODS: Final = 3.0  # of PWM
_SIGMAS: Final = 3.0


def watched_s(proven: Proven) -> float:
    """Return how long a response is watched: 5 (T + L) of the slowest possible heater, 3 PWM periods at least [s]."""
    return max(_TIMES * proven.slowest_s, _PERIODS * proven.view.actuator.pwm_period_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The band, from an instant on.

    Attributes:
        setpoint_degC: around which it is [°C].
        off_degC: how far from the setpoint the temperature was at that instant, above it positive [°C].
        overshoot: worst proven, as a share of the way.
        settles_s: after which it is settled [s].
        rest_degC: how far from the setpoint it is then, what a reading cannot tell included [°C].
    """

    setpoint_degC: float
    off_degC: float
    overshoot: float
    settles_s: float
    rest_degC: float

    @classmethod
    def of(cls, proven: Proven, setpoint_degC: float, temperature_degC: float) -> Band:
        """Return the band of a proof from where the temperature is."""
        criteria, limits = proven.view.criteria, proven.view.limits
        overshoots = [each.value for name, each in criteria.items() if name.endswith("overshoot") and each.unit == "%"]
        settles = [each.value for name, each in criteria.items() if name in ("settling_time", "recovery_time")]
        within = criteria["limit_cycle"].limit or limits.tolerance_degC
        return cls(
            setpoint_degC=setpoint_degC, off_degC=temperature_degC - setpoint_degC,
            overshoot=max(overshoots, default=0.0) / 100.0, settles_s=max(settles, default=math.inf),
            rest_degC=within + _unread_degC(proven))

    def at(self, since_s: float) -> tuple[float, float]:
        """Return the lowest and the highest temperature so long after its instant [°C]."""
        off = self.off_degC if since_s <= self.settles_s else 0.0
        there, beyond = max(abs(off), 0.0), self.overshoot * abs(off)
        low, high = (beyond, there) if off > 0.0 else (there, beyond)
        return self.setpoint_degC - low - self.rest_degC, self.setpoint_degC + high + self.rest_degC

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        return {name: getattr(self, name) for name in self.__slots__}


def _unread_degC(proven: Proven) -> float:
    """Return what a reading cannot tell, and what the best of the possible heaters left over of its own log [°C]."""
    scale = proven.words.scaling
    count = scale.span_degC / controller_for(proven.words.target).sensor(scale).counts
    left = [each.rmse_degC for each in proven.fitted.candidates if math.isfinite(each.rmse_degC)]
    return max(_SIGMAS * proven.view.scenario.noise_degC, count) + min(left, default=0.0)

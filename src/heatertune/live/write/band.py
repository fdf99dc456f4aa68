"""Where the proof says that the temperature is after words were changed: around the setpoint, from where it was.

It is made of the proof's own figures, the worst of all its runs: how far a response overshoots, how long it takes to
settle, and the band in which it then stays. A load, an open door, is none of it.

A loop that swings is met anywhere on its way. Its slope there tells how far the power is from what holds the
temperature: the new words find what a load of that power would do, and may let it run as far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from heatertune.live.write.proven_words import ProvenWords
from heatertune.pid.loop.response import horizon, respond
from heatertune.plc import controller_for
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.mains import MAINS_POWERS
from heatertune.proof.scenario import delay_heater

__all__ = ["Band", "Reach", "band_degC", "carried_s", "unseen_s", "watched_s"]

_TIMES: Final = 5.0  # lags and dead time of the slowest heater
_PERIODS: Final = 3.0  # of PWM
_SIGMAS: Final = 3.0
_FASTER: Final = 2.0  # than the fastest plausible heater: what the fit does not know of it
_SMALL: Final = 0.25  # of the rise from the ambient: up to there a change of the setpoint counts as a small one


def watched_s(proven: ProvenWords) -> float:
    """Return how long a response is watched: 5 (T + L) of the slowest plausible heater, 3 PWM periods at least [s]."""
    return max(_TIMES * proven.slowest_s, _PERIODS * proven.view.actuator.pwm_period_s)


def band_degC(proven: ProvenWords) -> float:
    """Return how far from the setpoint a loop at rest may swing, as the proof judged it [°C]."""
    return proven.view.criteria["limit_cycle"].limit or proven.view.limits.tolerance_degC


def unseen_s(proven: ProvenWords) -> float:
    """Return how long no reading can tell of new words: the shortest dead time, a PWM period at least [s]."""
    dead = min(model.dead_time_s for _, model in labelled_heaters(proven.fitted_model))
    return max(dead, proven.view.actuator.pwm_period_s)


def carried_s(proven: ProvenWords) -> float:
    """Return for how long a slope seems to go on under the words, worst of all heaters [s]; 0 where they are no PID.

    A slope is that of too much power, by slope · lags / gain; a load of as much takes the linear loop of the words on
    that heater so far away.
    """
    words = proven.words
    controller = controller_for(words.target)
    design = controller.decode(words)
    if design is None:
        return 0.0
    late = [delay_heater(model, controller.delayed_s(words.scaling)) for _,
            model in labelled_heaters(proven.fitted_model)]
    return max(
        float(np.abs(respond(model, design, horizon(model, design), load_pct=1.0)).max())
        * sum(model.lags_s) / abs(model.gain_degC_per_pct) for model in late)


class Reach:
    """How far a temperature can get within a time: full power, or none, on the fastest of the plausible heaters.

    A smaller lag comes before the larger one and makes it slower, never faster. A heater twice as fast as the fastest
    possible one is within reach, as its lag and gain are fitted ones.
    """

    def __init__(self, proven: ProvenWords) -> None:
        """Take the heaters, and what a reading cannot tell, of a proof."""
        words, heaters = proven.words, [model for _, model in labelled_heaters(proven.fitted_model)]
        most_pct, cooling = 100.0 * max(MAINS_POWERS), proven.view.actuator.cooling_gain or 0.0
        self._ends_degC = [sorted(float(model.ambient_degC or 0.0) + model.gain_degC_per_pct * power
                                  for power in (-cooling * most_pct, most_pct)) for model in heaters]
        self._lags_s = [max(model.lags_s) for model in heaters]
        self._unread_degC = 2.0 * _unread_degC(proven)  # of both readings
        #: a reading may be as old as the scan and the module make it
        self._late_s = words.sample_time_s + controller_for(words.target).delayed_s(words.scaling)

    def at(self, degC: float, passed_s: float) -> tuple[float, float]:
        """Compute the lowest and the highest temperature so long after a reading [°C]; all, where time runs back."""
        if not passed_s >= 0.0:
            return -math.inf, math.inf
        lows, highs = list[float](), list[float]()
        for (coldest, hottest), lag_s in zip(self._ends_degC, self._lags_s, strict=True):
            share = -math.expm1(-_FASTER * (passed_s + self._late_s) / lag_s)
            lows.append(min(0.0, coldest - degC) * share)
            highs.append(max(0.0, hottest - degC) * share)
        return degC + min(lows) - self._unread_degC, degC + max(highs) + self._unread_degC


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The band, from an instant on.

    Attributes:
        setpoint_degC: around which it is [°C].
        off_degC: how far from the setpoint the temperature was at that instant, above it positive [°C].
        carried_degC: how far it was on its way from there, upwards positive [°C].
        overshoot: worst proven, as a share of the way.
        settles_s: after which it is settled [s].
        rest_degC: how far from the setpoint it is then, what a reading cannot tell included [°C].
        beyond_degC: how much farther it may be until then, on both sides, where nobody knows how it came there [°C].
    """

    setpoint_degC: float
    off_degC: float
    carried_degC: float
    overshoot: float
    settles_s: float
    rest_degC: float
    beyond_degC: float = 0.0

    @classmethod
    def of(
        cls, proven: ProvenWords, setpoint_degC: float, temperature_degC: float, carried_degC: float = 0.0, *,
        mid_way: bool = False,
    ) -> Band:
        """Return the band of a proof from where the temperature is, and how far it is on its way.

        Args:
            proven: whose band it is.
            setpoint_degC: around which it is [°C].
            temperature_degC: where the temperature is [°C].
            carried_degC: see `Band`.
            mid_way: whether it may be anywhere in a heat-up from the ambient.
        """
        criteria = proven.view.criteria
        overshoots = {unit: [each.value for name, each in criteria.items() if name.endswith("overshoot")
                             and each.unit == unit] for unit in ("%", "% of rise", "% of change")}
        settles = [each.value for name, each in criteria.items() if name in ("settling_time", "recovery_time")]
        cold = [float(model.ambient_degC or 0.0) for _, model in labelled_heaters(proven.fitted_model)]
        whole, off = max(abs(setpoint_degC - ambient) for ambient in cold), abs(temperature_degC - setpoint_degC)
        judged = overshoots["%"] + overshoots["% of rise"] + overshoots["% of change"] * (off <= _SMALL * whole)
        overshoot = max(judged, default=0.0) / 100.0
        return cls(
            setpoint_degC=setpoint_degC, off_degC=temperature_degC - setpoint_degC,
            carried_degC=carried_degC, overshoot=overshoot,
            beyond_degC=overshoot * max(0.0, whole - off) if mid_way else 0.0,
            settles_s=max(settles, default=math.inf), rest_degC=band_degC(proven) + _unread_degC(proven))

    def at(self, since_s: float) -> tuple[float, float]:
        """Return the lowest and the highest temperature so long after its instant [°C]."""
        low = high = self.rest_degC + (self.beyond_degC if since_s <= self.settles_s else 0.0)
        for way in (self.off_degC, self.carried_degC) if since_s <= self.settles_s else ():
            below, above = sorted((way, -self.overshoot * way))
            low, high = low - below, high + above
        return self.setpoint_degC - low, self.setpoint_degC + high

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        return {name: getattr(self, name) for name in self.__slots__}


def _unread_degC(proven: ProvenWords) -> float:
    """Return what a reading cannot tell, and what the best of the plausible heaters left over of its own log [°C]."""
    scale = proven.words.scaling
    count = scale.span_degC / controller_for(proven.words.target).sensor(scale).counts
    left = [each.rmse_degC for each in proven.fitted_model.candidates if math.isfinite(each.rmse_degC)]
    return max(_SIGMAS * proven.view.scenario.noise_degC, count) + min(left, default=0.0)

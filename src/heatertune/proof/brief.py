"""How long the heater's circuit is open, or the PLC without supply, where most is summed up, and nothing is forgotten.

The sum grows until the output is at its limit. From there on most controllers keep it, and what is gained by P, as the
reading falls farther, is taken back again on the way up: the overshoot has its peak at about this length, between none
and the 2 TN of a story. Full power is asked for where

    hold + K·(e + 1/TN·∫e dt) = limit,   e: how far the heater has cooled down by itself since the reading began to fall

and a circuit that closes lets the reading fall for the dead time that it took to begin. Found by an independent judge
on drawn designs, see tests/bench/outages.py: a shorter one is the worst where the reading falls by P alone, a longer
one where there is no sum outside of the proportional band, and with a boost the last one before it takes over.

A PLC that is restarted begins with an empty sum. The farther the heater has cooled down, the more is summed up on the
way back, until K·e alone asks for full power: the same judge saw the peak at 0.6 to 0.8 of that distance.

A boost ends at a scan, up to one later than it might. Over the length before it, what it overshoots by is a saw with a
tooth for each scan that it lasts, as high as what full power adds in one: lengths stand so close together that some
come near a tip. The same judge saw 6 of 65 designs with a boost up to a third beyond their limit between two lengths.
So it is over how far the setpoint rises; and from just before the distance at which the boost begins, the controller
alone leads the way, which it does not from the lowest setpoint of use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from heatertune.heater.exact import answered, time_to
from heatertune.model.values import HeaterModel
from heatertune.pid.values import PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.words import Words
from heatertune.proof.scenario import NewSetpoint, Scenario, conditions

__all__ = ["Cooling"]

_SHARES: Final = (0.85, 1.0, 1.7)  # of the time until full power is asked for
_LED: Final = 2.5  # likewise, where a ramp leads the setpoint back
_NEARLY: Final = (0.95, 0.98)  # of the time until a boost takes the heater back
_NOT_YET: Final = (0.95, 0.98, 0.985, 0.99, 0.994, 0.998)  # of how far off a boost begins; a call may be late
_WARM: Final = (0.6, 0.65, 0.7, 0.75, 0.8)  # of the distance at which P alone asks for full power
_COLD: Final = 0.95  # share of the way to the ambient after which a heater is cold, as a story's restart has it
_NEAR: Final = 0.9  # of the distance at which a boost ends: nearer to the setpoint there is none
_FEWEST: Final = 9  # lengths with a boost: with those without one, no more scans than a story has
_MOST: Final = 96  # likewise
_PER_RISE: Final = 600.0  # likewise, times the share of the way that full power leads in a scan: the height of a tooth
_HALVINGS: Final = 50


class Cooling(NamedTuple):
    """A loop whose heaters cool down by themselves.

    Attributes:
        controller: that runs the words.
        words: what it holds.
        design: as the words realise it; None where the controller is no PID.
        scenario: the story.
        models: the heaters.
    """

    controller: Controller
    words: Words
    design: PidDesign | None
    scenario: Scenario
    models: Sequence[HeaterModel]

    def openings_s(self) -> list[float]:
        """Return how long a circuit is open where the overshoot may have its peak [s]; none without an I part."""
        if self.design is None or math.isinf(self.design.integral_time_s):
            return []
        most_pct = self.controller.most_power_pct(self.words)
        times = [_saturates_s(model, step, self.design, most_pct) for model, step in self._steps]
        middle = math.sqrt(min(times) * max(times))
        shares = _SHARES if self.words.ramp is None else (*_SHARES, _LED)
        return self._with_boosts([share * middle for share in shares])

    def restarts_s(self) -> list[float]:
        """Return how long a PLC is off where its restart may overshoot most [s]; none without an I part."""
        if self.design is None or math.isinf(self.design.integral_time_s):
            return []
        full_degC = self.controller.most_power_pct(self.words) / abs(self.design.gain_pct_per_degC)
        times = [[time_to(min(share * full_degC / abs(step), _COLD), *model.lags_s) for share in _WARM]
                 for model, step in self._steps]
        return self._with_boosts([math.sqrt(min(each) * max(each)) for each in zip(*times, strict=True)])

    def _with_boosts(self, lengths_s: list[float]) -> list[float]:
        """Return lengths in order, those after which a boost takes over put right before that, and some with one."""
        again_degC = self.controller.again_degC(self.words)
        if again_degC is None:
            return sorted(set(lengths_s))
        if all(again_degC < abs(step) for _, step in self._steps):
            falls = [time_to(again_degC / abs(step), *model.lags_s) for model, step in self._steps]
            lengths_s = [min(each, _NEARLY[-1] * max(falls)) for each in lengths_s]
            lengths_s += [share * end for end in (min(falls), max(falls)) for share in _NEARLY]
        (model, step), *_ = self._steps
        return sorted({*lengths_s, *(
            time_to(far / abs(step), *model.lags_s) for far in self._far_degC(_COLD * abs(step), _FEWEST))})

    def lows_degC(self) -> list[float]:
        """Return setpoints of use from which a rise may overshoot more than from the lowest, with a boost [°C]."""
        asked, again_degC = self.scenario.setpoint_degC, self.controller.again_degC(self.words)
        lows = (event.setpoint_degC for event in self.scenario.disturbances if isinstance(event, NewSetpoint))
        low = next(lows, asked)
        if again_degC is None or again_degC >= abs(asked - low):
            return []
        far = [*(share * again_degC for share in _NOT_YET), *self._far_degC(abs(asked - low))]
        return [asked - math.copysign(each, asked - low) for each in sorted(far)]

    def _far_degC(self, farthest_degC: float, fewest: int = 0) -> Iterator[float]:
        """Yield distances from the setpoint, from where a boost ends to the farthest [°C]; no fewer than so many.

        Where all teeth together would be few, none is high enough to be looked for.
        """
        boost, again_degC = self.words.boost, self.controller.again_degC(self.words) or 0.0
        nearest = _NEAR * (again_degC if boost is None else boost.within_degC)
        most_pct, scan_s = self.controller.most_power_pct(self.words), self.controller.timing(self.words).scan_s
        rise = scan_s * max(abs(most_pct * model.gain_degC_per_pct / step) / sum(model.lags_s)
                            for model, step in self._steps)
        number = min(math.ceil(_PER_RISE * rise), _MOST)
        number = max(number if number >= _FEWEST else 0, fewest)
        for place in range(number if nearest < farthest_degC else 0):
            yield nearest + (farthest_degC - nearest) * place / (number - 1)

    @property
    def _steps(self) -> list[tuple[HeaterModel, float]]:
        """The heaters, each with how far its setpoint is from the ambient [°C]."""
        return [(model, self.scenario.setpoint_degC - conditions(self.scenario, model)[0]) for model in self.models]


def _saturates_s(model: HeaterModel, step_degC: float, design: PidDesign, most_pct: float) -> float:
    """Return how long a heater has cooled down when all power is asked for [s]."""
    outer, inner = (*model.lags_s, 0.0)[:2]

    def asked_pct(seconds: float) -> float:
        fallen = answered(seconds, outer, inner)
        summed_s = seconds + outer * math.expm1(-seconds / outer) - inner * fallen  # of what has fallen
        return step_degC / model.gain_degC_per_pct + design.gain_pct_per_degC * step_degC * (
            fallen + summed_s / design.integral_time_s)

    low, high = 0.0, outer
    while asked_pct(high) < most_pct:
        low, high = high, 2.0 * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if asked_pct(middle) < most_pct else (low, middle)
    return high

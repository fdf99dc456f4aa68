"""How long the heater's circuit is open, or the PLC without supply, where most is summed up, and nothing is forgotten.

The sum grows until the output is at its limit. From there on most controllers keep it, and what is gained by P, as the
reading falls farther, is taken back again on the way up: the overshoot has its peak at about this length, between none
and the 2 TN of a story. Full power is asked for where

    hold + K·(e + 1/TN·∫e dt) = limit,   e: how far the heater has cooled down by itself since the reading began to fall

and a circuit that closes lets the reading fall for the dead time that it took to begin. Found by an independent judge
on drawn designs, see tests/bench/outages.py: a shorter one is the worst where the reading falls by P alone, a longer
one where there is no sum outside of the proportional band, and with a boost the last one before it takes over.

A PLC that is restarted begins with an empty sum. The farther the heater has cooled down, the more is summed up on the
way back, until K·e alone asks for full power: the same judge saw the peak at 0.5 to 1.2 of that distance, and at up to
3.4 where there is no sum outside of the proportional band. So it is where the setpoint changes: from the lowest of use
P asks for full power, and little is summed up; 3 of 128 plain designs that passed went up to 1.3 of their limit where
it changed by less.

Power changes at scans alone, and when is a matter of chance: over the length, or the rise, what is overshot by is a saw
with a tooth for each scan on the way, the higher the farther full power leads in one. A boost ends at a scan, too, up
to one later than it might, and then a tooth has all of that height. Places stand so close together that some come near
a tip: the same judge saw 6 of 65 designs with a boost up to a third beyond their limit between two lengths, and plain
ones up to an eighth. From just before the distance at which a boost begins, the controller alone leads the way, which
it does not from the lowest setpoint of use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

from heatertune.heater.exact import time_to, unit_step_response
from heatertune.model.values import HeaterModel
from heatertune.pid.values import PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.words import Words
from heatertune.proof.scenario import Scenario, conditions

__all__ = ["OutageTiming"]

_SHARES: Final = (0.85, 1.0, 1.7)  # of the time until full power is asked for
_LED: Final = 2.5  # likewise, where a ramp leads the setpoint back
_NEARLY: Final = (0.95, 0.98)  # of the time until a boost takes the heater back
_NOT_YET: Final = (0.95, 0.98, 0.985, 0.99, 0.994, 0.998)  # of how far off a boost begins; a call may be late
_LED_BY_P: Final = (0.5, 0.6, 0.7, 0.8, 0.95, 1.2, 1.6, 2.2, 3.2)  # of how far off P alone asks for full power
_COLD: Final = 0.95  # share of the way to the ambient after which a heater is cold, as a story's restart has it
_NEAR: Final = 0.9  # of the distance at which a boost ends: nearer to the setpoint there is none
_NEAREST: Final = 0.05  # of the way to the farthest, without a boost
_FEW: Final = 12  # places on the way, for a first look
_FEWEST: Final = 24  # likewise, closely
_MOST: Final = 96  # likewise
_PER_RISE: Final = 600.0  # likewise, times the share of the way that full power leads in a scan: the height of a tooth
_DOWN: Final = 0.8  # of the rise above ambient: each lower setpoint's, of that of the one above it
_SCANS: Final = 1e6  # of a story with more no night is longer than it: a proof runs ten times as many at most
_FEWEST_IN_MANY: Final = 9  # places with a boost then
_NO_GAIN: Final = 1e-9  # [%/°C]: less leads nowhere
_HALVINGS: Final = 50


class OutageTiming(NamedTuple):
    """A loop whose heaters cool down by themselves.

    Attributes:
        controller: that runs the words.
        words: what it holds.
        design: as the words realise it; None where the controller is no PID.
        scenario: the story.
        models: the heaters.
        closely: whether places stand as close together as the scans ask for; else there are a few.
    """

    controller: Controller
    words: Words
    design: PidDesign | None
    scenario: Scenario
    models: Sequence[HeaterModel]
    closely: bool = True

    def openings_s(self) -> list[float]:
        """Return how long a circuit is open where the overshoot may have its peak [s]; none without an I part."""
        if self._summing is None:
            return []
        most_pct = self.controller.most_power_pct(self.words)
        times = [_saturates_s(model, step, self._summing, most_pct) for model, step in self._steps]
        middle = math.sqrt(min(times) * max(times))
        shares = _SHARES if self.words.ramp is None else (*_SHARES, _LED)
        return self._with_more([share * middle for share in shares])

    def lower_openings_s(self) -> dict[float, list[float]]:
        """Compute how long a circuit is open at the lower setpoints of a stated range [s], by setpoint [°C].

        The peak lies elsewhere there: where nothing is summed up outside of the proportional band, the reading leaves
        it later the less it can fall. The lowest setpoint is not the worst: so near to the ambient the reading falls by
        too little to sum up much. So there are setpoints on the way down to it, at the same places for every lowest
        one: a wider range then has all the setpoints of a smaller one but its lowest.
        """
        low_degC, setpoint_degC = self.scenario.lower_setpoint_degC, self.scenario.setpoint_degC
        if low_degC is None or self.scenario.setpoint_low_degC is None:
            return {}
        step = min((step for _, step in self._steps), key=abs)
        lowest_share = 1.0 - (setpoint_degC - low_degC) / step
        ratio = _DOWN**2 if self._many or not self.closely else _DOWN
        number = math.floor(math.log(lowest_share) / math.log(ratio)) if lowest_share > 0.0 else 0
        lower = {setpoint_degC - (1.0 - ratio**place) * step: self._replace(closely=False)
                 for place in range(1, number + 1)} | {low_degC: self}
        return {low: timing._replace(scenario=replace(self.scenario, setpoint_degC=low)).openings_s()
                for low, timing in lower.items()}

    def restarts_s(self) -> list[float]:
        """Return how long a PLC is off where its restart may overshoot most [s]; none without an I part."""
        if self._summing is None:
            return []
        full_degC = self.controller.most_power_pct(self.words) / abs(self._summing.gain_pct_per_degC)
        times = [[time_to(min(share * full_degC / abs(step), _COLD), *model.lags_s) for share in _LED_BY_P]
                 for model, step in self._steps]
        return self._with_more([math.sqrt(min(each) * max(each)) for each in zip(*times, strict=True)])

    def lows_degC(self) -> list[float]:
        """Return setpoints a change to or from which may overshoot more than of the lowest [°C]; none without I."""
        asked, low_degC = self.scenario.setpoint_degC, self.scenario.lower_setpoint_degC
        if self._summing is None or low_degC is None or low_degC == asked:
            return []
        way_degC, again_degC = low_degC - asked, self.controller.again_degC(self.words)
        shares = _LED_BY_P[1::2] if self._many else _LED_BY_P
        by_p = [share * self._full_rise_degC(self._summing) for share in shares]
        if again_degC is not None:
            by_p = [each for each in by_p if each < again_degC] + [share * again_degC for share in _NOT_YET]
        far = {*by_p, *self._more_degC(abs(way_degC), 0)}
        return [asked + math.copysign(each, way_degC) for each in sorted(far) if each < abs(way_degC)]

    @property
    def _summing(self) -> PidDesign | None:
        """The design; None where nothing is summed up."""
        return None if self.design is None or math.isinf(self.design.integral_time_s) else self.design

    @property
    def _many(self) -> bool:
        """Whether the story has so many scans that no night may have more."""
        return self.scenario.duration_s > _SCANS * self.controller.timing(self.words).scan_s

    def _full_rise_degC(self, design: PidDesign) -> float:
        """Return by how much the setpoint rises where P asks for all power beside what holds it before [°C]; or 0."""
        most_pct, gain = self.controller.most_power_pct(self.words), abs(design.gain_pct_per_degC)
        rises = [(most_pct - step / model.gain_degC_per_pct) / max(gain - 1.0 / abs(model.gain_degC_per_pct), _NO_GAIN)
                 for model, step in self._steps]
        return math.sqrt(max(0.0, min(rises)) * max(rises))

    def _with_more(self, lengths_s: list[float]) -> list[float]:
        """Return lengths in order, with more all the way down; those after which a boost takes over right before."""
        again_degC = self.controller.again_degC(self.words)
        if again_degC is not None and all(again_degC < abs(step) for _, step in self._steps):
            falls = [time_to(again_degC / abs(step), *model.lags_s) for model, step in self._steps]
            lengths_s = [min(each, _NEARLY[-1] * max(falls)) for each in lengths_s]
            lengths_s += [share * end for end in (min(falls), max(falls)) for share in _NEARLY]
        (model, step), *_ = self._steps
        more = self._more_degC(_COLD * abs(step), 0 if again_degC is None else _FEWEST_IN_MANY)
        return sorted({*lengths_s, *(time_to(far / abs(step), *model.lags_s) for far in more)})

    def _more_degC(self, farthest_degC: float, least: int) -> Iterator[float]:
        """Yield distances from the setpoint, up to the farthest, from where a boost ends on [°C].

        Args:
            farthest_degC: of them.
            least: how many there are where the story has too many scans for more.
        """
        boost, again_degC = self.words.boost, self.controller.again_degC(self.words)
        within_degC = again_degC if boost is None else boost.within_degC
        nearest = _NEAREST * farthest_degC if within_degC is None else _NEAR * within_degC
        most_pct, scan_s = self.controller.most_power_pct(self.words), self.controller.timing(self.words).scan_s
        rise = scan_s * max(abs(most_pct * model.gain_degC_per_pct / step) / sum(model.lags_s)
                            for model, step in self._steps)
        number = max(_FEWEST, min(math.ceil(_PER_RISE * rise), _MOST)) if self.closely else _FEW
        number = least if self._many else number
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
        fallen = unit_step_response(seconds, outer, inner)
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

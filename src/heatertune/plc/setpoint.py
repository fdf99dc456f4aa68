"""How a controller's setpoint is led: its ramp and boost, in the units and at the interval of its scans."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar, cast, final

from heatertune.errors import InputError, OutOfRange
from heatertune.plc.core import StepFunctions, Timing
from heatertune.plc.cycle import Cycle
from heatertune.plc.inputs import Inputs
from heatertune.plc.ramp import Number, Ramp, nearest
from heatertune.plc.single_precision import single
from heatertune.plc.words import Words
from heatertune.units import check

__all__ = ["SetpointHandling"]


class SetpointHandling(Inputs):
    """A controller whose setpoint is led; see `heatertune.plc.controller.Controller`, which explains the attributes."""

    name: ClassVar[str]
    core: ClassVar[StepFunctions]
    scans_per_period: ClassVar[int | None] = None
    cycle: ClassVar[Cycle | None] = None
    has_ramp: ClassVar[bool] = False
    has_boost: ClassVar[bool] = False

    @final
    def timing(self, words: Words) -> Timing:
        """Return when the controller wants to be called."""
        ta, scans = words.sample_time_s, self.scans_per_period
        period = self.cycle.of(words.values) if self.cycle is not None else None if scans is None else ta
        return Timing(scan_s=ta / (scans or 1), pwm_period_s=period)

    @final
    def ramp(self, words: Words, rate_degC_per_min: float, hold_degC: float | None = None) -> Ramp:
        """Return the setpoint ramp near a rate [°C/min] and a holdback [°C]; None: none, below zero: a cooler's.

        Raises:
            InputError: this controller has no ramp.
            OutOfRange: a rate that is not positive, so slow that the word would not move, or so fast that one step
                crosses the sensor's range; a holdback of nothing or one that crosses it.
        """
        if not self.has_ramp:
            raise InputError(f"{self.name} has no setpoint ramp (see: heatertune targets)")
        check("setpoint_ramp_degC_per_min", rate_degC_per_min, above=0.0)
        low, high = self.ends(words)
        per_degree = (high - low) / words.scaling.span_degC
        per_call = rate_degC_per_min / 60.0 * self.timing(words).scan_s * per_degree
        ramp = nearest(per_call, whole=isinstance(high, int), least=(high - low) / self.sensor(words.scaling).counts)
        if not ramp.step < high - low:
            rule = f"< {rate_degC_per_min * (high - low) / per_call:.4g}, the sensor's whole range in one call"
            raise OutOfRange("setpoint_ramp_degC_per_min", rate_degC_per_min, rule)
        if hold_degC is None:
            return ramp
        check("setpoint_hold_degC", abs(hold_degC), above=0.0, most=words.scaling.span_degC)
        size = abs(hold_degC) * per_degree
        hold = max(1, round(size)) if isinstance(high, int) else single(size)
        return replace(ramp, hold=-hold if hold_degC < 0.0 else hold)

    @final
    def ramp_degC_per_min(self, words: Words) -> float:
        """Return how fast the words' ramp moves the setpoint [°C/min], infinite without one."""
        if words.ramp is None:
            return math.inf
        low, high = self.ends(words)
        per_call = words.ramp.step * words.scaling.span_degC / (high - low) / words.ramp.calls
        return 60.0 * per_call / self.timing(words).scan_s

    @final
    def check_ramp(self, words: Words) -> None:
        """Refuse words whose ramp or boost the controller cannot follow.

        Raises:
            InputError: this controller has none.
            OutOfRange: a step or holdback that the setpoint word cannot take.
        """
        if words.boost is not None and not self.has_boost:
            raise InputError(f"{self.name} has no boost (see: heatertune targets)")
        if words.ramp is None:
            return
        if not self.has_ramp:
            raise InputError(f"{self.name} has no setpoint ramp (see: heatertune targets)")
        low, high = self.ends(words)
        least = 1 if isinstance(high, int) else single((high - low) / self.sensor(words.scaling).counts)
        if isinstance(words.ramp.step, int) != isinstance(high, int) or not least <= words.ramp.step < high - low:
            kind = "a whole number" if isinstance(high, int) else "a number in single precision"
            raise OutOfRange("ramp step", words.ramp.step, f"{kind} from {least:.4g} to below {high - low:g}")
        if words.ramp.hold is not None:
            check("ramp hold", abs(words.ramp.hold), least=least, most=high - low)

    @final
    def hold_degC(self, words: Words) -> float | None:
        """Return how far from the reading the words' ramp lets the setpoint be [°C], None without a holdback."""
        if words.ramp is None or words.ramp.hold is None:
            return None
        low, high = self.ends(words)
        return abs(words.ramp.hold) * words.scaling.span_degC / (high - low)

    @final
    def ends(self, words: Words) -> tuple[Number, Number]:
        """Return the readings at the ends of the sensor's range [units]."""
        its, measure = self.sensor(words.scaling)._replace(least=0, half=0.0), self.core.measure
        # beyond the range the module limits: at its end the last digit may fall short
        return measure(its, its.low - its.span), measure(its, its.low + 2.0 * its.span)

    @final
    def measure(self, words: Words, temperature_degC: float) -> Number:
        """Return the reading for a temperature, quantised and limited as the input module does [units]."""
        return cast("Number", self.core.measure(self.sensor(words.scaling), temperature_degC))

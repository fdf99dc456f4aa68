"""PID_Temp that heats and cools, as its manual tells it, in any number type: written before the controller here was changed.

Read: Siemens, S7-1200/S7-1500 PID control, function manual A5E35300227-AC pp. 382 to 445, and the help of TIA Portal ("Using
PID_Temp", output settings, PWM limits, PID parameters):

- Config.ActivateCooling: PidOutputSum is limited to Heat.PidUpperLimit and Cool.PidLowerLimit; what is positive goes to
  OutputHeat, what is negative to OutputCool, each scaled by two pairs of values (PidLowerLimit, UpperScaling of Cool).
- Config.AdvancedCooling FALSE: heating's parameters, "taking into consideration" CoolFactor, the gain of the heater over that of the
  cooler; the table of the equation has CoolFactor at Kp. So cooling's Kp is Heat.Gain·CoolFactor, all others are heating's.
- TRUE: "based on the calculated output value and the control deviation, the PID algorithm decides" which set is used. More is not
  said, so that each way here is one reading:
  RULES: "now": this cycle's sum with heating's set, where negative formed anew with cooling's; "output": by the sign of the last
  cycle's output, where that is 0 by the deviation's; "both": stays until last output and deviation are both of the other side.
  MEMORIES: what of I stays where the set changes: its share of the output ("percent"), or what stands before Kp ("error").
- Each PWM has its own shortest times; a pulse is whole calls, what is left out is made up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

RULES = ("now", "output", "both")
MEMORIES = ("percent", "error")
INTEGRALS = ("backward", "forward", "trapezoid")
DERIVATIVES = ("backward", "tustin", "ramp", "step")
ANTI_WINDUP = ("stopped", "late", "limited", "clamped")


@dataclass(frozen=True)
class Set:
    """Gain [%/°C], Ti, Td [s], TdFiltRatio, PWeighting, DWeighting."""

    Kp: float
    TI: float
    TD: float
    a: float = 0.2
    b: float = 1.0
    c: float = 0.0


def with_factor(heat: Set, factor: float) -> Set:
    """Cooling's set of AdvancedCooling = FALSE."""
    return Set(heat.Kp * factor, heat.TI, heat.TD, heat.a, heat.b, heat.c)


class HeatCool:
    """PidOutputSum from one cycle to the next."""

    def __init__(self, heat: Set, cool: Set, *, TA, low=-100.0, high=100.0, rule="now", memory="percent", integral="backward",
                 derivative="backward", anti_windup="stopped", history="present", number=np.float64):
        assert rule in RULES
        assert memory in MEMORIES
        assert integral in INTEGRALS
        assert derivative in DERIVATIVES
        assert anti_windup in ANTI_WINDUP
        self.number, self.rule, self.memory = number, rule, memory
        self.integral, self.anti_windup, self.history = integral, anti_windup, history
        self.sets = [self._prepared(one, derivative, TA) for one in (heat, cool)]
        self.TA, self.low, self.high = number(TA), number(low), number(high)
        self.I, self.D = number(0), number(0)  # I as `memory` says; D before Kp
        self.past = None  # w, x of the last cycle
        self.sum, self.out, self.cools = number(0), number(0), False

    def _prepared(self, s: Set, kind: str, TA: float):
        number, lag = self.number, s.a * s.TD
        if kind == "tustin" and lag < TA / 2:
            lag = 0.0 if lag == 0.0 else TA / 2  # it would ring otherwise
        if s.TD == 0.0:
            keep, move = 0.0, 0.0
        elif lag == 0.0 or (kind == "tustin" and lag <= TA / 2):
            keep, move = 0.0, s.TD / TA
        elif kind == "backward":
            keep, move = lag / (lag + TA), s.TD / (lag + TA)
        elif kind == "tustin":
            keep, move = (lag - TA / 2) / (lag + TA / 2), s.TD / (lag + TA / 2)
        else:
            keep = math.exp(-TA / lag)
            move = (1.0 - keep) * s.TD / TA if kind == "ramp" else 1.0 / s.a
        grows = TA / s.TI if s.TI > 0.0 else 0.0
        return tuple(map(number, (s.Kp, grows, keep, move, s.b, s.c)))

    def __call__(self, w, x):
        """PidOutputSum of a cycle with this setpoint and reading, limited."""
        w, x = self.number(w), self.number(x)
        e = w - x
        if self.past is None:
            self.past = (w, x) if self.history == "present" else (self.number(0), self.number(0))
        cools = self._side(e)
        made = self._with(cools, w, x)
        if self.rule == "now" and made[0] < 0:
            cools = True
            made = self._with(cools, w, x)
        self.cools = cools
        self.sum, self.I, self.D = made
        self.past = (w, x)
        self.out = min(max(self.sum, self.low), self.high)
        return self.out

    def _side(self, e):
        if self.rule == "now":
            return False
        if self.rule == "output":
            return bool(self.out < 0 or (self.out == 0 and e < 0))
        if self.cools:
            return not (self.out >= 0 and e > 0)
        return bool(self.out <= 0 and e < 0)

    def _with(self, cools, w, x):
        """Sum, I and D of this cycle with a set."""
        Kp, grows, keep, move, b, c = self.sets[cools]
        last_w, last_x = self.past
        D = keep * self.D + move * ((c * w - x) - (c * last_w - last_x))
        e, last = w - x, last_w - last_x
        area = {"backward": e, "forward": last, "trapezoid": (e + last) / self.number(2)}[self.integral]
        unit = Kp if self.memory == "percent" else self.number(1)  # of the memory's growth
        kept = Kp / unit  # of the memory in the sum
        step = unit * grows * area
        if grows == 0:
            start, step = self.number(0), self.number(0)
        else:
            start = self.I
        p = Kp * (b * w - x)
        total = p + kept * (start + step) + Kp * D
        judged = self.sum if self.anti_windup == "late" else total
        if (judged > self.high and kept * step > 0) or (judged < self.low and kept * step < 0):
            step = self.number(0)
        kept_I = start + step
        if grows == 0:  # the integral action is deactivated, and what there was of it deleted (manual)
            kept_I = self.number(0)
        elif self.anti_windup in ("limited", "clamped"):
            part = self.number(0) if self.anti_windup == "limited" else p
            least, most = (self.low - part) / kept if kept else 0, (self.high - part) / kept if kept else 0
            kept_I = min(max(start + unit * grows * area if self.anti_windup == "clamped" else kept_I, least), most)
        return p + kept * kept_I + Kp * D, kept_I, D


def outputs(total, low=-100.0, high=100.0, cool_full=100.0):
    """OutputHeat and OutputCool of a PidOutputSum: each scaled by its two pairs of values, and within them."""
    heat = min(max(total / high * 100.0, 0.0), 100.0)
    cool = min(max(total / low * cool_full, 0.0), cool_full)
    return heat, cool


class Pulses:
    """One PWM of whole calls: pulses of one period after another [calls], what is left out being made up."""

    def __init__(self, per_period: int, least_on: int, least_off: int):
        self.per_period, self.least_on, self.least_off, self.owed = per_period, least_on, least_off, 0.0

    def __call__(self, power: float) -> int:
        wanted = power / 100.0 * self.per_period + self.owed
        on = math.floor(wanted + 0.5 + 1e-9)
        if on < 1 or on < self.least_on or wanted < self.least_on - 1e-9:
            on = 0
        elif on >= self.per_period or self.per_period - on < self.least_off or self.per_period - wanted < self.least_off - 1e-9:
            on = self.per_period
        self.owed = wanted - on
        return on

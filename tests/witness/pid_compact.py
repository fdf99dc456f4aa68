"""The published equation of PID_Compact, PID_3Step and PID_Temp: in continuous time, and sampled in the ways that fit it.

Read: Siemens, S7-1200/S7-1500 PID control, function manual A5E35300227-AC p. 246 and 391; S7-1200 Easy Book 04/2012 p. 350:

    y = Kp·[(b·w − x) + 1/(TI·s)·(w − x) + TD·s/(a·TD·s + 1)·(c·w − x)]

with TI = 0: no I part; a = 0: D acts in one cycle only. "PIDT1 with anti-windup": how it is sampled and what the anti-windup
does is not published, so that each way here is one reading, and none is the CPU's.

`Continuous` integrates the equation exactly for a setpoint and a reading that run in straight lines between its calls.
`Sampled` has three integrals, four derivatives, three anti-windups, in any number type (numpy.float32 for REAL), each
operation rounded once in the order written here.
"""

from __future__ import annotations

import math

import numpy as np

INTEGRALS = ("forward", "backward", "trapezoid")
DERIVATIVES = ("backward", "bilinear", "step", "ramp")
ANTI_WINDUP = ("none", "hold", "clamp", "back")


class Continuous:
    """y(t) without limits, in double precision; times in s, TI = 0: no I part."""

    def __init__(self, Kp, TI, TD, a, b=1.0, c=1.0, w=0.0, x=0.0):
        self.Kp, self.TI, self.lag, self.a, self.TD, self.b, self.c = Kp, TI, a * TD, a, TD, b, c
        self.w, self.x, self.integral = w, x, 0.0
        self.slow = c * w - x  # the filtered copy of c·w − x: the D part is (c·w − x − slow)/a

    def __call__(self, w, x, dt):
        """y after dt [s] in which setpoint and reading ran in straight lines from the last ones to these."""
        self.integral += dt * ((self.w - self.x) + (w - x)) / 2.0
        v, past = self.c * w - x, self.c * self.w - self.x
        slope = (v - past) / dt
        if self.lag > 0.0:  # slow' = (v − slow)/lag with v a straight line: v − slow tends to lag·slope
            self.slow = v - self.lag * slope - (past - self.slow - self.lag * slope) * math.exp(-dt / self.lag)
            d = (v - self.slow) / self.a
        else:
            d = self.TD * slope
        self.w, self.x = w, x
        i = self.integral / self.TI if self.TI > 0.0 else 0.0
        return self.Kp * ((self.b * w - x) + i + d)


class Sampled:
    def __init__(self, Kp, TI, TD, a, b=1.0, c=1.0, *, TA, integral="backward", derivative="backward", anti_windup="hold",
                 low=0.0, high=100.0, number=np.float64):
        assert integral in INTEGRALS
        assert derivative in DERIVATIVES
        assert anti_windup in ANTI_WINDUP
        self.number, self.kinds = number, (integral, derivative, anti_windup)
        self.Kp, self.TI, self.TD, self.a, self.b, self.c, self.TA = map(number, (Kp, TI, TD, a, b, c, TA))
        self.low, self.high = number(low), number(high)
        self.I, self.D, self.past = number(0), number(0), None  # I and D before Kp; past: (e, v) of the last call
        self.keep, self.move = self._derivative(derivative)

    def _derivative(self, kind):
        """(f, g) of D = f·D + g·(v − last v)."""
        TA, TD, lag, number = self.TA, self.TD, self.a * self.TD, self.number
        if lag == 0:
            return number(0), TD / TA
        if kind == "backward":
            return lag / (lag + TA), TD / (lag + TA)
        if kind == "bilinear":
            two = number(2)
            return (two * lag - TA) / (two * lag + TA), two * TD / (two * lag + TA)
        keep = number(math.exp(-float(TA) / float(lag)))
        if kind == "step":
            return keep, number(1) / self.a
        return keep, (number(1) - keep) * TD / TA

    def __call__(self, w, x):
        w, x = self.number(w), self.number(x)
        e, v = w - x, self.c * w - x
        last_e, last_v = (e, v) if self.past is None else self.past
        first = self.past is None
        self.past = (e, v)
        self.D = self.keep * self.D + self.move * (v - last_v)
        p = self.b * w - x
        integral, _, anti_windup = self.kinds
        area = {"forward": last_e, "backward": e, "trapezoid": (last_e + e) / self.number(2)}[integral]
        grown = self.I
        if self.TI > 0 and not (first and integral != "backward"):
            grown = self.I + self.TA / self.TI * area
        y = self.Kp * (p + grown + self.D)
        if anti_windup == "hold" and ((y > self.high and grown > self.I) or (y < self.low and grown < self.I)):
            y = self.Kp * (p + self.I + self.D)  # Kp is positive in PID_Temp
        elif anti_windup == "clamp":
            self.I = min(max(grown, self.low / self.Kp), self.high / self.Kp)
            y = self.Kp * (p + self.I + self.D)
        else:
            self.I = grown
        limited = min(max(y, self.low), self.high)
        if anti_windup == "back" and limited != y and self.TI > 0:
            self.I = limited / self.Kp - p - self.D
        return limited

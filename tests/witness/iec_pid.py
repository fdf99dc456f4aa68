"""The function blocks PID, INTEGRAL and DERIVATIVE that IEC 61131-3 prints as examples, one class for each block.

Read: final draft of IEC 61131-3, second edition (2001-12-10), annex F, as the text compiler matiec ships it, in its
compiled form lib/C/iec_std_FB.h (beremiz/matiec, 4f87a31), which shows the order of the operations:

    PID          ERROR = PV − SP;  ITERM(RUN = AUTO, R1 = NOT AUTO, XIN = ERROR, X0 = TR·(X0 − ERROR), CYCLE)
                 DTERM(RUN = AUTO, XIN = ERROR, CYCLE);  XOUT = KP·((ERROR + ITERM.XOUT/TR) + DTERM.XOUT·TD)
    INTEGRAL     R1: XOUT = X0;  else RUN: XOUT = XOUT + XIN·t(CYCLE);  else as it was
    DERIVATIVE   RUN: XOUT = (((3·(XIN − X3)) + X1) − X2)/(10·t(CYCLE)), then X3 = X2, X2 = X1, X1 = XIN
                 else XOUT = 0, X1 = X2 = X3 = XIN

t is TIME_TO_REAL: in matiec s + ns/10⁹ in LREAL, handed on as REAL, so seconds; other systems give milliseconds, which is
an argument here. Each operation is rounded to REAL once (`numpy.float32`); a compiler that fuses or widens does otherwise.

What is odd stays: heat is taken away where it is wanted (PV − SP with KP > 0), nothing is limited, TR = 0 divides by
zero, manual gives KP·X0, and the first call in AUTO differentiates from zeros.
"""

from __future__ import annotations

import numpy as np

REAL = np.float32


def time_to_real(cycle_ms, milliseconds=False):
    """A TIME of whole milliseconds as REAL, in seconds or milliseconds."""
    if milliseconds:
        return REAL(cycle_ms)
    seconds, rest = divmod(int(cycle_ms), 1000)
    return REAL(float(seconds) + float(rest * 1_000_000) / 1e9)


class Integral:
    def __init__(self):
        self.XOUT, self.Q = REAL(0), False

    def __call__(self, RUN, R1, XIN, X0, t):
        self.Q = not R1
        if R1:
            self.XOUT = X0
        elif RUN:
            self.XOUT = self.XOUT + XIN * t
        return self.XOUT


class Derivative:
    def __init__(self):
        self.X1 = self.X2 = self.X3 = self.XOUT = REAL(0)

    def __call__(self, RUN, XIN, t):
        if RUN:
            self.XOUT = (REAL(3) * (XIN - self.X3) + self.X1 - self.X2) / (REAL(10) * t)
            self.X3, self.X2, self.X1 = self.X2, self.X1, XIN
        else:
            self.XOUT, self.X1, self.X2, self.X3 = REAL(0), XIN, XIN, XIN
        return self.XOUT


class Pid:
    """The block as shipped; KP, TR, TD are REAL, TR and TD in what `t` counts."""

    def __init__(self, KP, TR, TD, cycle_ms, milliseconds=False):
        self.KP, self.TR, self.TD = REAL(KP), REAL(TR), REAL(TD)
        self.t = time_to_real(cycle_ms, milliseconds)
        self.ITERM, self.DTERM = Integral(), Derivative()
        self.ERROR = self.XOUT = REAL(0)

    def __call__(self, AUTO, PV, SP, X0=0.0):
        with np.errstate(all="ignore"):
            self.ERROR = REAL(PV) - REAL(SP)
            self.ITERM(AUTO, not AUTO, self.ERROR, self.TR * (REAL(X0) - self.ERROR), self.t)
            self.DTERM(AUTO, self.ERROR, self.t)
            self.XOUT = self.KP * (self.ERROR + self.ITERM.XOUT / self.TR + self.DTERM.XOUT * self.TD)
        return self.XOUT


class RepairedPid:
    """The same law on ERROR = SP − PV with what a heater needs, as this file reads 'repaired'.

    Output limited to [low, high]. The integral of a call is kept unless the output, worked out with it, lies beyond a
    limit and the integral of this call moved it further there (conditional clamp). Manual gives X0 itself, limited, and
    leaves the integral so that the next call in AUTO with the same ERROR begins from that output. TR = 0: no integral.
    The first call, in whatever mode, has no past: its derivative is that of a constant.
    """

    def __init__(self, KP, TR, TD, cycle_ms, low=0.0, high=100.0, milliseconds=False):
        self.KP, self.TR, self.TD, self.low, self.high = REAL(KP), REAL(TR), REAL(TD), REAL(low), REAL(high)
        self.t = time_to_real(cycle_ms, milliseconds)
        self.integral, self.DTERM, self.called = REAL(0), Derivative(), False

    def _limited(self, value):
        return min(max(value, self.low), self.high)

    def _sum(self, error, integral):
        share = integral / self.TR if self.TR != 0 else REAL(0)
        return self.KP * (error + share + self.DTERM.XOUT * self.TD)

    def __call__(self, AUTO, PV, SP, X0=0.0):
        error = REAL(SP) - REAL(PV)
        if not (AUTO and self.called):
            self.DTERM(False, error, self.t)
        else:
            self.DTERM(True, error, self.t)
        self.called = True
        if not AUTO:
            output = self._limited(REAL(X0))
            if self.KP != 0:
                self.integral = self.TR * (output / self.KP - error)
            return output
        candidate = self.integral + error * self.t
        output = self._sum(error, candidate)
        moved = self.KP * (candidate - self.integral)
        if (output > self.high and moved > 0) or (output < self.low and moved < 0):
            output = self._sum(error, self.integral)
        else:
            self.integral = candidate
        return self._limited(output)

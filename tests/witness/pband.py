"""A panel instrument's law with proportional band, integral and derivative time and a cycle, in double precision.

Read: the words' meaning in the manuals of Omron E5CC (H174/H175), Eurotherm 3200 (HA028651), JUMO dicon, Autonics TM4 and
Delta DVP-TK: P band [°C] is the deviation over which the P part goes from 0 to 100 %; integral time [s] the time in which the
I part of a constant deviation has become as large as its P part, 0 = off; derivative time [s] the time by which a ramp's D part is
ahead of its P part, 0 = off; the cycle [s] is the period in which a switching output is on for the output's share.

    u = 100/PB·[e + 1/Ti·∫e dt + Td·d(−PV)/dt],  e = SP − PV,  limited to low … high

What no manual prints are arguments: D on the reading or the deviation, its filter's lag Td/n (None: none), and the anti-windup:
"hold" keeps the integral where the output is at a limit that e pushes against, "band" takes e into it only while |e| < PB.
"""

from __future__ import annotations


class PBand:
    def __init__(self, band_degC, Ti_s, Td_s, TA_s, *, low=0.0, high=100.0, on_error=False, n=None, anti_windup="hold"):
        assert anti_windup in ("hold", "band")
        self.band, self.Ti, self.Td, self.TA = band_degC, Ti_s, Td_s, TA_s
        self.low, self.high, self.on_error, self.lag, self.kind = low, high, on_error, Td_s / n if n else 0.0, anti_windup
        self.integral_degC_s, self.rate, self.last = 0.0, 0.0, None

    def __call__(self, sp, pv):
        """Output [%] of one sampling interval."""
        e = sp - pv
        led = e if self.on_error else -pv
        change = 0.0 if self.last is None else (led - self.last) / self.TA
        self.last = led
        self.rate += (change - self.rate) * self.TA / (self.lag + self.TA)
        share = self.integral_degC_s + e * self.TA
        asked = self._asked(e, share)
        pushing = (asked > self.high and e > 0.0) or (asked < self.low and e < 0.0)
        if pushing if self.kind == "hold" else abs(e) >= self.band:
            share = self.integral_degC_s
        self.integral_degC_s = share
        return min(max(self._asked(e, share), self.low), self.high)

    def _asked(self, e, integral):
        return 100.0 / self.band * (e + (integral / self.Ti if self.Ti > 0.0 else 0.0) + self.Td * self.rate)


def band_pct(band_degC, span_degC):
    """A P band in °C as % of the sensor's span."""
    return 100.0 * band_degC / span_degC


def switched(output_pct, cycle_s, step_s, least_s=0.0):
    """The switch of one cycle, step by step; a time on or off shorter than `least_s` is left out."""
    steps = round(cycle_s / step_s)
    on_s = min(max(output_pct, 0.0), 100.0) / 100.0 * cycle_s
    if on_s < least_s:
        on_s = 0.0
    elif cycle_s - on_s < least_s:
        on_s = cycle_s
    on = round(on_s / step_s)
    return [k < on for k in range(steps)]

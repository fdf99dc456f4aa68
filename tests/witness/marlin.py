"""Marlin's PID of a heater, its integer output and its PWM of 127 ticks, as classes.

Read: MarlinFirmware/Marlin, Marlin/src/module/temperature.h (000b347, 2.1.x: template PID_t and the macros before it) and
temperature.cpp (soft_pwm_amount = (int)output >> 1; the ISR's modulation); Configuration.h: PID_K1 0.95,
PID_FUNCTIONAL_RANGE 10, PID_MAX 255.

    PID_dT = 16·max(10, ADC states)/TEMP_TIMER_FREQUENCY; Ki is kept as Ki·PID_dT, Kd as Kd/PID_dT
    target = 0 or e < −range: 0 and reset;  e > range: MAX_POW and reset
    reset pending: sum = 0, d = 0
    sum = sum + e, limited to 0 … MAX_POW/Ki − MIN_POW
    d = d + K2·(Kd·(last − reading) − d), K2 = 1 − K1;  output = Kp·e + Ki·sum + d + MIN_POW, limited to 0 … MAX_POW

The releases differ in `last`. 2.0.x and, since pull request 26926 (2024-03), 2.1.x again keep the reading of every scan. 2.1.0 and
the releases after it up to that change keep that of the last scan inside the window, 0 at power on, so that the first scan
inside asks for the drop from there and switches off for seconds: `inside=True`. Pull request 27740 (2025-03, for 2.1.3) touches the
routine again and proposes a window of 20; what of it was merged was not found.

All in float (32 bit), each operation rounded once; a processor whose compiler fuses multiply and add gives other last bits.
The timer runs at 1000 Hz on 32-bit boards, on AVR at F_CPU/64/256 (976.5625 Hz at 16 MHz), which is an argument here.
"""

from __future__ import annotations

import numpy as np

F = np.float32


def interval(timer_hz=1000.0, states=10):
    """PID_dT [s], a float."""
    return F(16) * F(max(10, states)) / F(timer_hz)


class MarlinPid:
    def __init__(self, Kp, Ki, Kd, *, timer_hz=1000.0, states=10, window=10, K1=0.95, inside=False, max_pow=255):
        self.dT = interval(timer_hz, states)
        self.Kp, self.Ki, self.Kd = F(Kp), F(Ki) * self.dT, F(Kd) / self.dT
        self.K2 = F(1) - F(K1)
        self.window, self.least, self.most, self.inside = F(window), 0, max_pow, inside
        self.reset, self.sum, self.last, self.d = True, F(0), F(0), F(0)

    def output(self, target, current):
        """What the PID asks for, 0 … 255, a float."""
        target, current = F(target), F(current)
        last, error = self.last, target - current
        if not self.inside or (abs(error) <= self.window and target != 0):
            self.last = current
        if target == 0 or error < -self.window:
            self.reset = True
            return F(0)
        if error > self.window:
            self.reset = True
            return F(self.most)
        if self.reset:
            self.reset, self.sum, self.d = False, F(0), F(0)
        with np.errstate(all="ignore"):
            largest = F(self.most) / self.Ki - F(self.least)
            self.sum = self._limited(self.sum + error, F(0), largest)
            p, i = self.Kp * error, self.Ki * self.sum
            self.d = self.d + self.K2 * (self.Kd * (last - current) - self.d)
            return self._limited(p + i + self.d + F(self.least), F(0), F(self.most))

    @staticmethod
    def _limited(value, low, high):
        return low if value < low else high if value > high else value

    def amount(self, target, current):
        """soft_pwm_amount, 0 … 127: what M105 prints after @."""
        return int(self.output(target, current)) >> 1


class SoftPwm:
    """The heater's switch, tick by tick of the temperature timer (SOFT_PWM_SCALE 0): a period is 127 ticks.

    A period's first tick switches on if the amount is not zero; every other one off once the count has reached the amount
    of that moment.
    """

    def __init__(self):
        self.count, self.on = 1, False

    def tick(self, amount):
        if self.count >= 127:
            self.count -= 127
            self.on = amount > 0
        elif amount <= self.count:
            self.on = False
        self.count += 1
        return self.on

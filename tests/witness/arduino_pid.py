"""Arduino's PID_v1, its clock an argument of each call.

Read: br3ttb/Arduino-PID-Library, PID_v1.cpp of version 1.2.1 (MIT). `double` has 64 bits on 32-bit boards and 32 on AVR: the
number type is an argument (numpy.float64, numpy.float32).

    SetTunings        ki = Ki·Ts, kd = Kd/Ts, Ts = SampleTime/1000; negative gains are refused; REVERSE: signs turned
    SetSampleTime     ki·(new/old), kd/(new/old)
    Compute           only in AUTOMATIC and when millis() − last ≥ SampleTime (unsigned 32 bit):
                      sum += ki·e; P_ON_M: sum −= kp·dInput; sum limited
                      output = (P_ON_E: kp·e, else 0) + (sum − kd·dInput), limited
    SetMode           manual → automatic: sum = Output, limited; last input = Input
    SetOutputLimits   refused unless min < max; in automatic Output and sum are limited at once
"""

from __future__ import annotations

import numpy as np


class ArduinoPid:
    def __init__(self, Kp, Ki, Kd, *, on_measurement=False, reverse=False, number=np.float64, now_ms=0):
        self.number = number
        zero = number(0)
        self.kp, self.ki, self.kd, self.sum, self.last = zero, zero, zero, zero, zero
        self.input, self.output, self.setpoint = zero, zero, zero
        self.automatic, self.sample_ms, self.reverse = False, 100, reverse
        self.set_output_limits(0, 255)
        self.set_tunings(Kp, Ki, Kd, on_measurement)
        self.last_ms = (now_ms - self.sample_ms) % 2**32

    def set_tunings(self, Kp, Ki, Kd, on_measurement=None):
        if Kp < 0 or Ki < 0 or Kd < 0:
            return
        if on_measurement is not None:
            self.on_measurement = on_measurement
        number = self.number
        seconds = number(self.sample_ms) / number(1000)
        self.kp, self.ki, self.kd = number(Kp), number(Ki) * seconds, number(Kd) / seconds
        if self.reverse:
            self._turn()

    def _turn(self):
        zero = self.number(0)
        self.kp, self.ki, self.kd = zero - self.kp, zero - self.ki, zero - self.kd

    def set_direction(self, reverse):
        if self.automatic and reverse != self.reverse:
            self._turn()
        self.reverse = reverse

    def set_sample_time(self, sample_ms):
        if sample_ms > 0:
            ratio = self.number(sample_ms) / self.number(self.sample_ms)
            self.ki, self.kd, self.sample_ms = self.ki * ratio, self.kd / ratio, sample_ms

    def set_output_limits(self, low, high):
        low, high = self.number(low), self.number(high)
        if low >= high:
            return
        self.low, self.high = low, high
        if self.automatic:
            self.output, self.sum = self._limited(self.output), self._limited(self.sum)

    def _limited(self, value):
        return self.high if value > self.high else self.low if value < self.low else value

    def set_mode(self, automatic):
        if automatic and not self.automatic:
            self.sum, self.last = self._limited(self.output), self.input
        self.automatic = automatic

    def compute(self, now_ms):
        """True where an output was worked out; it stands in `output`."""
        if not self.automatic or (now_ms - self.last_ms) % 2**32 < self.sample_ms:
            return False
        with np.errstate(all="ignore"):
            error, change = self.setpoint - self.input, self.input - self.last
            self.sum = self.sum + self.ki * error
            if self.on_measurement:
                self.sum = self.sum - self.kp * change
            self.sum = self._limited(self.sum)
            output = self.number(0) if self.on_measurement else self.kp * error
            self.output = self._limited(output + (self.sum - self.kd * change))
        self.last, self.last_ms = self.input, now_ms % 2**32
        return True

"""A heater of the tests' own, and a story told to a program tick by tick: nothing of the proof's loop is used.

First order and dead time between two instants at which something changes: y → target + (y − target)·e^(−t/T).
"""

import math
from collections import deque

from heatertune.proof import Load, TemperatureStep
from heatertune.proof.scenario import Mains, NewSetpoint, PlcPower

NEAR = 1e-9


class Heater:
    """Lag T, dead time L, ambient temperature; what is power, from mains, load or switch, is felt after the dead time."""

    def __init__(self, model, ambient):
        (self.lag,), self.dead, self.gain, self.ambient = model.lags_s, model.dead_time_s, model.gain_degC_per_pct, ambient
        self.y, self.now, self.heat, self.mains, self.load = ambient, 0.0, 0.0, 1.0, 0.0
        self.coming, self.edges, self.last = deque(), [], False

    def to(self, time):
        """Go on to an instant."""
        while self.coming and self.coming[0][0] <= time:
            at, what, value = self.coming.popleft()
            self._on(at)
            setattr(self, what, value)
        self._on(time)

    def _on(self, time):
        target = self.ambient + self.gain * (self.heat * self.mains + self.load)
        self.y = target + (self.y - target) * math.exp(-(time - self.now) / self.lag)
        self.now = time

    def feel(self, what, value):
        """Feel another power from now on."""
        self.coming.append((self.now + self.dead, what, value))

    def switch(self, on):
        """The switch now."""
        if bool(on) != self.last:
            self.last = bool(on)
            self.feel("heat", 100.0 if on else 0.0)
            self.edges.append((self.now, self.last))


def told(plc, heater, scenario, tick_s, per_call):
    """Tell a story to a program; return time, temperature and output at each call.

    plc: `begin()` after each time that its supply comes, `setpoint(°C)`, and `tick(°C, whether a call is due)` → heater on?,
    `output` after it.
    """
    events, seen, supplied, calls, load = deque(scenario.disturbances), [], True, 0, 0.0
    plc.setpoint(scenario.setpoint_degC)
    plc.begin()
    for tick in range(round(scenario.duration_s / tick_s) + 1):
        while events and events[0].time_s <= tick * tick_s + NEAR:
            event = events.popleft()
            heater.to(event.time_s)
            if isinstance(event, TemperatureStep):
                heater.y += event.temperature_degC
            elif isinstance(event, Load):
                load += event.power_pct
                heater.feel("load", load)
            elif isinstance(event, Mains):
                heater.feel("mains", event.share)
            elif isinstance(event, NewSetpoint):
                plc.setpoint(event.setpoint_degC)
            else:
                assert isinstance(event, PlcPower)
                supplied = event.on
                if supplied:
                    plc.begin()
        heater.to(tick * tick_s)
        due = tick % per_call == 0
        heater.switch(plc.tick(heater.y, due) if supplied else False)
        if due:
            seen.append((heater.now, heater.y, plc.output if supplied else 0.0))
            calls += supplied
    return seen, calls

"""The same closed loop by other means: what the loop of the proof is measured against.

Heater, PI, PWM and constants are those of `yardstick/loop.c`. Each rival returns the sum of |e| at the calls [°C], so
that all can be held against each other before any time is compared.
"""

import ctypes
import math
import subprocess
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np
from scipy.integrate import solve_ivp as solve
from simple_pid import PID

SOURCE = Path(__file__).parent / "yardstick" / "loop.c"
PERIOD_S, RESOLUTION_S, CALL_S = 10.0, 0.01, 1.0
LANES = 16


@dataclass(frozen=True)
class Case:
    """A heater above its ambient, its controller, and how long it is watched: one call a second."""

    gain: float = 0.9
    lag: float = 180.0
    dead: float = 12.34
    start: float = 0.0
    setpoint: float = 40.0
    kp: float = 3.0
    ti: float = 150.0
    calls: int = 3000


class Pi:
    """The benchmark's PI in plain Python: the integral is clamped, then the output."""

    def __init__(self, case):
        self.kp, self.ki, self.sum = case.kp, case.kp / case.ti, 0.0

    def __call__(self, e):
        """Return the power [%] for a control error [°C]."""
        self.sum = min(max(self.sum + self.ki * e, 0.0), 100.0)
        return min(max(self.kp * e + self.sum, 0.0), 100.0)


class SimplePid:
    """The same by the package simple-pid."""

    def __init__(self, case):
        self.pid = PID(case.kp, case.kp / case.ti, 0.0, setpoint=0.0, sample_time=None, output_limits=(0.0, 100.0))

    def __call__(self, e):
        """Return the power [%] for a control error [°C]."""
        return self.pid(-e, dt=CALL_S)


def event_by_event(case, advance, controller):
    """Return the sum of |e|, the heater advanced from switching instant to switching instant.

    `advance(y, power, seconds)` is the rival's way from one instant to the next.
    """
    y, total = case.start, 0.0
    pulses = []  # (on from, off from) as the heater feels them
    for k in range(case.calls):
        now = k * CALL_S
        e = case.setpoint - y
        total += abs(e)
        power = controller(e)
        if k % 10 == 0:
            on = math.floor(power * PERIOD_S / RESOLUTION_S / 100.0 + 0.5) * RESOLUTION_S
            pulses.append((now + case.dead, now + case.dead + on))
        while pulses and pulses[0][1] <= now:
            pulses.pop(0)
        for on_from, off_from in pulses:
            for edge, power in ((on_from, 0.0), (off_from, 100.0)):
                until = min(edge, k * CALL_S + CALL_S)
                if until > now:
                    y, now = advance(y, power, until - now), until
        if now < k * CALL_S + CALL_S:
            y = advance(y, 0.0, k * CALL_S + CALL_S - now)
    return total


def plain_python(case):
    """The way of the C program in plain Python."""
    own, spilled, decay = _tables(case)
    steps, whole = round(CALL_S / RESOLUTION_S), math.floor(case.dead)
    kp, ki, setpoint, y = case.kp, case.kp / case.ti, case.setpoint, case.start
    done = [0] * (case.calls + whole)  # steps on as the heater feels them, before its `part` of a second
    integral = total = 0.0
    left = before = 0
    for k in range(case.calls):
        e = setpoint - y
        integral = min(max(integral + ki * e, 0.0), 100.0)
        total += abs(e)
        if k % 10 == 0:
            left = int(min(max(kp * e + integral, 0.0), 100.0) * 10.0 + 0.5)
        done[k + whole] = now = left if left < steps else steps
        left -= now
        on = done[k]
        y = decay * y + own[on] + spilled[before]
        before = on
    return total


def _tables(case):
    """Return the heating at a call's end by its own pulse of n steps and by that of the call before; the decay."""
    part, lag, top = case.dead - math.floor(case.dead), case.lag, 100.0 * case.gain
    ends = [part + n * RESOLUTION_S / CALL_S for n in range(round(CALL_S / RESOLUTION_S) + 1)]
    own = [top * (math.exp(min(end - 1.0, 0.0) / lag) - math.exp((part - 1.0) / lag)) for end in ends]
    spilled = [top * (math.exp((max(end, 1.0) - 2.0) / lag) - math.exp(-1.0 / lag)) for end in ends]
    return [0.0, *own[1:]], spilled, math.exp(-CALL_S / lag)


def simple_pid(case):
    """The exact update, the controller by simple-pid."""

    def advance(y, power, seconds):
        target = case.gain * power
        return target + (y - target) * math.exp(-seconds / case.lag)

    return event_by_event(case, advance, SimplePid(case))


def solve_ivp(case):
    """SciPy's solver from instant to instant."""
    def advance(y, power, seconds):
        found = solve(lambda _, x: (case.gain * power - x) / case.lag, (0.0, seconds), [y], rtol=1e-8, atol=1e-8)
        return float(found.y[0, -1])

    return event_by_event(case, advance, Pi(case))


def control_with_pwm(case):
    """python-control's forced_response from instant to instant."""
    heater = control.ss([[-1.0 / case.lag]], [[case.gain / case.lag]], [[1.0]], [[0.0]])

    def advance(y, power, seconds):
        found = control.forced_response(heater, [0.0, seconds], [power, power], X0=[y])
        return float(found.outputs[-1])

    return event_by_event(case, advance, Pi(case))


def control_discrete(case):
    """python-control's input_output_response of the loop without PWM: its power is held from call to call.

    A simpler loop than the others', so the sum differs a little; it is how the package is used for sampled loops.
    """
    delay = max(1, math.ceil(case.dead / CALL_S))
    decay = math.exp(-CALL_S / case.lag)

    def power(e, total):
        total = min(max(total + case.kp / case.ti * e, 0.0), 100.0)
        return min(max(case.kp * e + total, 0.0), 100.0), total

    def update(_, x, u, __):
        wanted, total = power(u[0] - x[0], x[1])
        heated = decay * x[0] + (1.0 - decay) * case.gain * x[-1]
        return np.concatenate([[heated, total, wanted], x[2:-1]])

    loop = control.nlsys(update, lambda _, x, __, ___: x[:1], inputs=1, outputs=1, states=2 + delay, dt=CALL_S)
    time = np.arange(case.calls) * CALL_S
    wish, rest = np.full(case.calls, case.setpoint), [case.start] + [0.0] * (1 + delay)
    found = control.input_output_response(loop, time, wish, rest)
    return float(np.sum(np.abs(case.setpoint - found.outputs)))


class Compiled:
    """The C program, built once into a folder."""

    def __init__(self, folder):
        library = Path(folder) / "loop.so"
        subprocess.run(
            ["gcc", "-O3", "-march=native", "-ffast-math", "-fPIC", "-shared", str(SOURCE), "-o", str(library), "-lm"],
            check=True,
        )
        loaded, number = ctypes.CDLL(str(library)), ctypes.c_double
        array = np.ctypeslib.ndpointer(np.float64, shape=(LANES,), flags="C_CONTIGUOUS")
        self._scalar, self._lanes = loaded.loop_scalar, loaded.loop_lanes
        self._scalar.restype, self._scalar.argtypes = number, [number] * 7 + [ctypes.c_int]
        self._lanes.restype, self._lanes.argtypes = None, [array] * 4 + [number] + [array] * 2 + [ctypes.c_int, array]

    def scalar(self, case):
        """Return the sum of |e| of one heater."""
        return self._scalar(case.gain, case.lag, case.dead, case.start, case.setpoint, case.kp, case.ti, case.calls)

    def lanes(self, cases):
        """Return the sums of |e| of 16 heaters with one setpoint and one horizon."""
        columns = [np.array([getattr(c, name) for c in cases], float) for name in ("gain", "lag", "dead", "start", "kp", "ti")]
        totals = np.empty(LANES)
        self._lanes(*columns[:4], cases[0].setpoint, *columns[4:], cases[0].calls, totals)
        return totals

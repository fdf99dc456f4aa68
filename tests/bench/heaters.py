"""Synthetic heaters whose truth is known, and the logs a user would have of them.

Nothing of heatertune is used: the heater is a chain of lags, integrated by Runge-Kutta steps of a twentieth of its
shortest time between all instants at which anything changes. Temperatures in °C, power in %, times in s.
"""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

KELVIN = 273.15
_STEEPEST = 2.0  # full power heats no faster than that [°C/s]: the default tolerance is 1 °C
_BOILING = 50.0  # above the boiling point each degree takes so many times the heat of a degree below


@dataclass(frozen=True, kw_only=True)
class Heater:
    """lag·T' = gain·f(power(t − dead))·g(T) − loss(T − ambient), then the further lags in series.

    Attributes:
        gain: [°C/%] of a small power at ambient temperature.
        lags: the heater's own first [s].
        dead: dead time [s].
        ambient: temperature without power [°C].
        cooling: the heater's own lag is so many times as long while it cools.
        radiation: share of the loss near ambient that goes with the fourth power of the temperature.
        saturates: power above this gives no more [%].
        bend: share of the gain that is lost at full power.
        sag: share of the gain that is lost where the heater without losing it would be at full power.
        boils: temperature of a plateau [°C].
    """

    gain: float
    lags: tuple[float, ...]
    dead: float
    ambient: float
    cooling: float = 1.0
    radiation: float = 0.0
    saturates: float = 100.0
    bend: float = 0.0
    sag: float = 0.0
    boils: float = math.inf

    def heat(self, power, temperature):
        """Return what a power does, as the rise it would end in [°C]."""
        power = min(power, self.saturates)
        felt = self.gain * power * (1.0 - self.bend * power / 100.0)
        return felt * (1.0 - self.sag * (temperature - self.ambient) / (100.0 * abs(self.gain)))

    def loss(self, temperature, ambient):
        """Return what is lost, as the rise it stands for [°C]."""
        rise = temperature - ambient
        if self.radiation:
            base = ambient + KELVIN
            radiated = ((temperature + KELVIN) ** 4 - base**4) / (4.0 * base**3)
            rise = (1.0 - self.radiation) * rise + self.radiation * radiated
        return rise + _BOILING * max(0.0, temperature - self.boils)

    def slope(self, temperature, power, ambient, open_=1.0, load=0.0):
        """Return T' of the first lag [°C/s]; `open_` multiplies the loss, `load` is a rise by another source [°C]."""
        net = self.heat(power, temperature) + load - open_ * self.loss(temperature, ambient)
        return net / (self.lags[0] if net >= 0.0 else self.cooling * self.lags[0])

    def power_at(self, temperature):
        """Return the power that holds a temperature [%], None where none does."""
        low, high = 0.0, min(100.0, self.saturates)

        def short(power):
            return self.loss(temperature, self.ambient) - self.heat(power, temperature)

        sign = math.copysign(1.0, self.gain)
        if sign * short(low) < 0.0 or sign * short(high) > 0.0:
            return None
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if sign * short(middle) > 0.0 else (low, middle)
        return 0.5 * (low + high)

    def rest_at(self, power):
        """Return the temperature a constant power ends in [°C]."""
        low, high = sorted((self.ambient, self.ambient + 110.0 * self.gain))
        for _ in range(60):
            middle = 0.5 * (low + high)
            rising = self.heat(power, middle) > self.loss(middle, self.ambient)
            low, high = (middle, high) if rising else (low, middle)
        return 0.5 * (low + high)


def _nothing(_):
    return 0.0


def _one(_):
    return 1.0


class Rig:
    """A heater that runs: its state, its clock, and the power on its way through the dead time."""

    def __init__(self, heater, start, power=0.0, drift=_nothing, opened=_one, load=_nothing):
        self.heater, self.now, self.state = heater, 0.0, [start] * len(heater.lags)
        self.drift, self.opened, self.load = drift, opened, load
        self.coming, self.felt = [], power
        quick = heater.lags[0] / (2.0 * _BOILING) if math.isfinite(heater.boils) else math.inf
        self.step = min(*(lag / 20.0 for lag in heater.lags), quick)
        if heater.radiation:  # a hot heater is quicker than its lag says
            self.step /= 4.0

    def set(self, power):
        """Ask for a power from now on."""
        self.coming.append((self.now + self.heater.dead, power))

    def run(self, until):
        """Return the sensor's temperature at an instant."""
        while self.now < until:
            while self.coming and self.coming[0][0] <= self.now:
                self.felt = self.coming.pop(0)[1]
            end = min(until, self.coming[0][0]) if self.coming else until
            steps = max(1, math.ceil((end - self.now) / self.step))
            width = (end - self.now) / steps
            for k in range(steps):
                self._advance(self.now + k * width, width)
            self.now = end
        return self.state[-1]

    def _slopes(self, x, t):
        heater = self.heater
        found = [heater.slope(x[0], self.felt, heater.ambient + self.drift(t), self.opened(t), self.load(t))]
        found += [(x[i - 1] - x[i]) / heater.lags[i] for i in range(1, len(x))]
        return found

    def _advance(self, t, h):
        x = self.state
        a = self._slopes(x, t)
        b = self._slopes([v + 0.5 * h * s for v, s in zip(x, a, strict=True)], t + 0.5 * h)
        c = self._slopes([v + 0.5 * h * s for v, s in zip(x, b, strict=True)], t + 0.5 * h)
        d = self._slopes([v + h * s for v, s in zip(x, c, strict=True)], t + h)
        self.state = [v + h / 6.0 * (p + 2.0 * (q + r) + s) for v, p, q, r, s in zip(x, a, b, c, d, strict=True)]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A heater, the log that a user has of it, and the range of its sensor.

    Attributes:
        kind, seed: what it was made from.
        heater: the truth.
        columns: name → values, as written to the file.
        range: of the sensor [°C].
    """

    kind: str
    seed: int
    heater: Heater
    columns: dict
    range: tuple[float, float]

    def text(self):
        """Return the file's text."""
        rows = zip(*self.columns.values(), strict=True)
        return "\n".join([",".join(self.columns), *(",".join(f"{v:.10g}" for v in row) for row in rows), ""])


@dataclass
class Plan:
    """How a log is made; a kind changes what it is about."""

    rng: np.random.Generator
    heater: Heater
    interval: float
    length: float
    cap: float  # largest power of the test [%]
    program: str = "step"
    power: Callable | None = None  # power at an instant, in place of a program
    start: float | None = None  # temperature at the start; None: at rest with the first power
    rig: dict = field(default_factory=dict)  # drift, opened, load of the rig
    controller: Callable | None = None  # (plan, rig, instants) → temperature, columns beside it
    noise: float = 0.005  # of the span
    noise_is: str = "white"
    step: float = 0.1  # sensor's resolution [°C]
    clip: float | None = None  # last instant that is kept
    edit: Callable | None = None  # what becomes of the columns

    @property
    def total(self):
        """All lags and the dead time [s]."""
        return sum(self.heater.lags) + self.heater.dead


def _drawn(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _plan(rng):
    """Return one lag and a dead time with a test that shows them."""
    lag = _drawn(rng, 10.0, 7200.0)
    gain = _drawn(rng, 0.1, min(10.0, _STEEPEST * lag / 100.0))
    heater = Heater(gain=gain, lags=(lag,), dead=lag * _drawn(rng, 0.02, 1.0), ambient=float(rng.uniform(12.0, 32.0)))
    interval = _nice(lag / _drawn(rng, 5.0, 50.0))
    cap = min(100.0, 800.0 / gain)
    steps = [0.01, 0.1, 0.1, 0.25] if gain * cap > 40.0 else [0.01, 0.0625]
    return Plan(rng=rng, heater=heater, interval=interval, length=0.0, cap=cap,
                program=str(rng.choice(["step", "up and down", "doublet", "levels", "binary"])),
                noise=_drawn(rng, 0.001, 0.01), step=float(rng.choice(steps)))


def _nice(value):
    """Return the nearest interval a logger has [s]."""
    known = [a * 10.0**k for k in range(-1, 4) for a in (1.0, 2.0, 3.0, 5.0, 6.0)]
    return min(known, key=lambda each: abs(math.log(each / value)))


def _program(plan):
    """Return the power at an instant [%], as the plan's program has it."""
    cap, length, rng = plan.cap, plan.length, plan.rng
    rest = plan.interval * max(3, round(0.08 * length / plan.interval))
    low, high = cap * float(rng.uniform(0.0, 0.3)), cap * float(rng.uniform(0.6, 1.0))
    if plan.program == "step":
        times, levels = [rest], [0.0 if rng.random() < 0.6 else low, high]
    elif plan.program == "up and down":
        times, levels = [rest, rest + 0.5 * (length - rest)], [0.0, high, low]
    elif plan.program == "doublet":
        middle = 0.5 * (low + high)
        times, levels = [rest, 0.36 * length, 0.64 * length], [middle, high, low, middle]
    elif plan.program == "levels":
        times, levels = list(np.linspace(rest, 0.8 * length, 5)), list(cap * rng.uniform(0.0, 1.0, 6))
    else:
        clock = max(plan.interval, 0.5 * plan.total)
        times = [rest + k * clock for k in range(int((length - rest) / clock))]
        levels = [low, *(high if bit else low for bit in rng.integers(0, 2, len(times)))]
        levels[1] = high
    edges = np.array([plan.interval * round(t / plan.interval) for t in times])
    return lambda t: float(levels[int(np.searchsorted(edges, t + 1e-9, side="right"))])


def _open_loop(plan, rig, instants):
    """Run the power program; return the temperatures and the power at each instant."""
    found, power = [], []
    for t in instants:
        found.append(rig.run(t))
        power.append(plan.power(t))
        if not power[1:] or power[-1] != power[-2]:
            rig.set(power[-1])
    return np.array(found), {"power_pct": np.array(power)}


def _noisy(plan, clean):
    deviation = plan.noise * float(np.ptp(clean))
    white = plan.rng.normal(0.0, deviation, len(clean))
    if plan.noise_is == "coloured":
        for i in range(1, len(white)):
            white[i] = 0.8 * white[i - 1] + 0.6 * white[i]
    return np.round((clean + white) / plan.step) * plan.step


def sensor_range(hottest):
    """Return the sensor range a user would have: from 0 °C to the first usual end above what was reached."""
    usual = (50.0, 100.0, 150.0, 200.0, 300.0, 400.0, 600.0, 800.0, 1000.0, 1200.0, 1600.0)
    return 0.0, next(end for end in usual if end >= 1.1 * hottest)


def make(kind, seed):
    """Return the case of a kind and a seed; the same at all times."""
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    plan = _plan(rng)
    KINDS[kind].change(plan)
    if not plan.length:
        plan.length = plan.total * float(rng.uniform(5.0, 9.0)) + 10.0 * plan.interval
        plan.length = max(plan.length, 40.0 * plan.interval)
    if plan.power is None:
        plan.power = _program(plan)
    first = plan.power(0.0)
    start = plan.heater.rest_at(first) if plan.start is None else plan.start
    rig = Rig(plan.heater, start, power=first, **plan.rig)
    instants = np.arange(0.0, plan.length, plan.interval)
    clean, others = (plan.controller or _open_loop)(plan, rig, instants)
    columns = {"time_s": instants, "temperature_degC": _noisy(plan, clean), **others}
    if plan.clip is not None:
        columns = {name: values[instants <= plan.clip] for name, values in columns.items()}
    if plan.edit is not None:
        columns = plan.edit(plan, columns)
    return Case(kind=kind, seed=seed, heater=plan.heater, columns=columns, range=sensor_range(float(np.max(clean))))


# What the kinds are about


def _change_heater(plan, **changes):
    plan.heater = replace(plan.heater, **changes)


def _slow_enough(plan, gain):
    """Make the heater as slow as its gain asks for, and its log with it."""
    slower = max(1.0, 100.0 * gain / _STEEPEST / plan.heater.lags[0])
    _change_heater(plan, lags=(plan.heater.lags[0] * slower,), dead=plan.heater.dead * slower)
    plan.interval = _nice(plan.interval * slower)


def _as_it_is(plan):
    """One lag and a dead time, white noise, power logged."""


def _second_lag(plan):
    lag = plan.heater.lags[0]
    _change_heater(plan, lags=(lag, lag * float(plan.rng.uniform(0.1, 0.6))), dead=plan.heater.dead / 2.0)


def _equal_lags(plan):
    lag = plan.heater.lags[0]
    _change_heater(plan, lags=(lag, lag * float(plan.rng.uniform(0.92, 1.0))), dead=plan.heater.dead / 2.0)


def _three_lags(plan):
    lag = plan.heater.lags[0]
    shares = plan.rng.uniform(0.2, 1.0, 2)
    _change_heater(plan, lags=(lag, *(lag * float(s) for s in shares)), dead=plan.heater.dead / 3.0)


def _heat_not_cool(plan):
    plan.program = str(plan.rng.choice(["up and down", "doublet", "levels", "binary"]))
    _change_heater(plan, cooling=_drawn(plan.rng, 1.5, 4.0) ** float(plan.rng.choice([-1.0, 1.0, 1.0])))


def _radiation(plan):
    gain = _drawn(plan.rng, 3.0, 15.0)
    plan.cap = min(100.0, 1000.0 / gain)
    _slow_enough(plan, gain)
    _change_heater(plan, gain=gain, radiation=float(plan.rng.uniform(0.2, 0.9)))


#: programs of more than two levels of power: with two, a bent heater's log is a straight one's, to the last digit
_MORE_LEVELS = ("up and down", "doublet", "levels")


def _saturation(plan):
    plan.program = str(plan.rng.choice(_MORE_LEVELS))
    _saturate(plan)


def _saturation_unseen(plan):
    plan.program = "step"
    _saturate(plan)


def _saturate(plan):
    plan.cap = 100.0
    _change_heater(plan, gain=min(plan.heater.gain, 8.0), saturates=float(plan.rng.uniform(25.0, 60.0)))


def _bent_power(plan):
    plan.program = str(plan.rng.choice(_MORE_LEVELS))
    plan.cap = 100.0
    _change_heater(plan, gain=min(plan.heater.gain, 8.0), bend=float(plan.rng.uniform(0.3, 0.8)))


def _falling_gain(plan):
    plan.cap = 100.0
    _change_heater(plan, gain=min(plan.heater.gain, 10.0), sag=float(plan.rng.uniform(1.0, 6.0)))


def _boiling(plan):
    gain = _drawn(plan.rng, 1.2, 8.0)
    plan.cap = min(100.0, 400.0 / gain)
    _slow_enough(plan, gain)
    _change_heater(plan, gain=gain, boils=100.0)


def _second_heater(plan):
    rng = plan.rng
    plan.length = plan.total * float(rng.uniform(6.0, 9.0)) + 10.0 * plan.interval
    begins, lasts = rng.uniform(0.1, 0.7) * plan.length, rng.uniform(0.1, 0.5) * plan.length
    rise = plan.heater.gain * plan.cap * float(rng.uniform(0.15, 0.6))
    plan.rig["load"] = lambda t: rise if begins <= t < begins + lasts else 0.0


def _door(plan):
    rng = plan.rng
    plan.length = plan.total * float(rng.uniform(6.0, 9.0)) + 10.0 * plan.interval
    begins, lasts = rng.uniform(0.3, 0.9) * plan.length, rng.uniform(0.02, 0.2) * plan.length
    factor = float(rng.uniform(1.5, 4.0))
    plan.rig["opened"] = lambda t: factor if begins <= t < begins + lasts else 1.0


def _drift(plan):
    rng = plan.rng
    plan.length = plan.total * float(rng.uniform(6.0, 9.0)) + 10.0 * plan.interval
    size = float(rng.uniform(-0.15, 0.15)) * plan.heater.gain * plan.cap
    plan.rig["drift"] = lambda t: size * t / plan.length


def _day(plan):
    rng = plan.rng
    plan.length = plan.total * float(rng.uniform(6.0, 9.0)) + 10.0 * plan.interval
    size, turns = float(rng.uniform(0.03, 0.1)) * plan.heater.gain * plan.cap, float(rng.uniform(0.7, 2.5))
    phase = float(rng.uniform(0.0, 6.28))
    plan.rig["drift"] = lambda t: size * (math.sin(6.28 * turns * t / plan.length + phase) - math.sin(phase))


def _gaps(plan):
    def cut(plan, columns):
        t, keep = columns["time_s"], np.ones(len(columns["time_s"]), bool)
        for _ in range(int(plan.rng.integers(1, 4))):
            begins = float(plan.rng.uniform(0.05, 0.9)) * t[-1]
            keep &= (t < begins) | (t > begins + float(plan.rng.uniform(0.03, 0.12)) * t[-1])
        return {name: values[keep] for name, values in columns.items()}

    plan.edit = cut


def _clock_jump(plan):
    def jump(plan, columns):
        t = columns["time_s"].copy()
        place = int(float(plan.rng.uniform(0.15, 0.8)) * len(t))
        by = float(plan.rng.choice([3600.0, 60.0, 2.0 * plan.total, -3600.0, -60.0, -0.5 * plan.total]))
        t[place:] += by
        return columns | {"time_s": t}

    plan.edit = jump


def _relay_cycles(plan, rig, instants, period, duty, logged):
    """Run a relay with a duty that changes; the log has what `logged` makes of the state at each instant."""
    found, power, mean = [], [], []
    switched = -1.0
    for t in instants:
        while True:
            cycle = math.floor(switched / period + 1e-9) + 1 if switched >= 0.0 else 0
            begins = cycle * period
            if begins > t:
                break
            share = duty(begins) / 100.0
            rig.run(begins)
            if share > 0.0:
                rig.set(100.0)
            if share < 1.0:
                rig.coming.append((begins + share * period + rig.heater.dead, 0.0))
            switched = begins
        found.append(rig.run(t))
        inside = t - math.floor(t / period + 1e-9) * period
        power.append(100.0 if inside < duty(t) / 100.0 * period else 0.0)
        mean.append(duty(t))
    return np.array(found), {"power_pct": np.array(power if logged == "state" else mean)}


def _aliased(plan):
    gain = min(plan.heater.gain, 8.0)
    _change_heater(plan, gain=gain)
    plan.cap, rng = 100.0, plan.rng
    plan.program = str(rng.choice(["step", "up and down", "levels"]))
    period = plan.interval * _drawn(rng, 0.07, 1.7)

    def controller(plan, rig, instants):
        return _relay_cycles(plan, rig, instants, period, plan.power, "state")

    plan.controller = controller


def _coarse(plan):
    rng, gain = plan.rng, _drawn(plan.rng, 0.3, 2.0)
    _slow_enough(plan, gain)
    _change_heater(plan, gain=gain)
    plan.cap, plan.step, plan.noise = 100.0, float(rng.choice([0.5, 1.0])), 0.001


def _heavy_noise(plan):
    plan.noise = float(plan.rng.uniform(0.04, 0.12))


def _coloured(plan):
    plan.noise_is, plan.noise = "coloured", float(plan.rng.uniform(0.005, 0.02))


def _truncated(plan):
    shown = plan.heater.dead + plan.heater.lags[0] * float(plan.rng.uniform(0.15, 1.0))
    plan.program, plan.interval = "step", min(plan.interval, _nice(shown / 40.0))
    plan.length = plan.total * 6.0
    plan.clip = plan.interval * max(3, round(0.08 * plan.length / plan.interval)) + shown


def _heat_up(plan, *later, rested=True, **changes):
    """Full power until some temperature, then none for a while: what is logged of a kiln or an oven."""
    rng, heater = plan.rng, plan.heater
    lag = heater.lags[0]
    _change_heater(plan, lags=(lag, *(lag * share for share in later)), dead=lag * float(rng.uniform(0.0, 0.05)), **changes)
    plan.interval = _nice(lag / _drawn(rng, 60.0, 300.0))
    rest = plan.interval * int(rng.integers(5, 40)) * rested
    on = plan.interval * round(plan.total * float(rng.uniform(0.4, 1.2)) / plan.interval)
    fall = plan.total * float(rng.uniform(0.1, 1.2))
    plan.length = rest + on + fall
    plan.power = lambda t: plan.cap if rest <= t + 1e-9 < rest + on else 0.0
    if not rested:
        plan.start = heater.ambient


def _two_lag_heat_up(plan):
    _heat_up(plan, float(plan.rng.uniform(0.1, 1.0)))


def _three_lag_heat_up(plan):
    _heat_up(plan, *plan.rng.uniform(0.1, 1.0, 2))


def _cropped_heat_up(plan):
    _heat_up(plan, float(plan.rng.uniform(0.1, 1.0)), rested=False)


def _glowing_heat_up(plan):
    gain = _drawn(plan.rng, 3.0, 12.0)
    plan.cap = min(100.0, 900.0 / gain)
    _slow_enough(plan, gain)
    _heat_up(plan, float(plan.rng.uniform(0.1, 0.8)), gain=gain, radiation=float(plan.rng.uniform(0.2, 0.9)))


def _below_a_sample(plan):
    lag = plan.heater.lags[0]
    plan.interval = _nice(lag / _drawn(plan.rng, 3.0, 15.0))
    _change_heater(plan, dead=plan.interval * float(plan.rng.uniform(0.05, 0.95)))


def _no_dead_time(plan):
    lag = plan.heater.lags[0]
    plan.interval = _nice(lag / _drawn(plan.rng, 3.0, 15.0))
    hidden = (plan.interval * float(plan.rng.uniform(0.1, 0.5)),) if plan.rng.random() < 0.5 else ()
    _change_heater(plan, dead=0.0, lags=(lag, *hidden))


def _pi_loop(plan, rig, instants, *, manual_until=0.0, power_logged=True):
    """Run a PI controller of unknown tuning, called at every reading or several times between two."""
    rng, heater = plan.rng, plan.heater
    calls = int(rng.choice([1, 1, 2, 5]))
    slow = heater.dead + sum(heater.lags[1:]) + plan.interval
    k = float(rng.uniform(0.15, 0.7)) * sum(heater.lags) / (heater.gain * slow)
    ti = max(float(rng.uniform(0.4, 1.2)) * sum(heater.lags), 2.0 * plan.interval)
    reach = heater.gain * plan.cap
    points = heater.ambient + reach * rng.uniform(0.25, 0.75, int(rng.integers(1, 4)))
    begins = np.linspace(0.0, plan.length, len(points) + 1)[:-1]
    integral, u = 0.0, 0.0
    found, power, wanted = [], [], []
    hand = plan.cap * float(rng.uniform(0.3, 0.7))
    for t in instants:
        found.append(rig.run(t))
        point = float(points[np.searchsorted(begins, t + 1e-9, side="right") - 1])
        wanted.append(point)
        for c in range(calls):
            now = t + c * plan.interval / calls
            y = rig.run(now)
            e = point - y
            if now < manual_until:
                u = 0.0 if now < 0.1 * manual_until else hand
                integral = u - k * e
            else:
                ahead = integral + k * e * plan.interval / calls / ti
                u = k * e + ahead
                if 0.0 < u < plan.cap:
                    integral = ahead
                u = min(max(u, 0.0), plan.cap)
            rig.set(u)
            if c == 0:
                power.append(u)
    beside = {"power_pct": np.round(power, 1), "setpoint_degC": np.round(wanted, 1)}
    return np.array(found), beside if power_logged else {"setpoint_degC": beside["setpoint_degC"]}


def _rest_first(plan):
    plan.power, plan.start = (lambda _: 0.0), plan.heater.ambient
    plan.length = plan.total * float(plan.rng.uniform(8.0, 14.0)) + 10.0 * plan.interval


def _closed_loop(plan):
    _rest_first(plan)
    plan.controller = _pi_loop


def _manual_first(plan):
    _rest_first(plan)
    until = plan.length * float(plan.rng.uniform(0.2, 0.5))
    plan.controller = lambda plan, rig, instants: _pi_loop(plan, rig, instants, manual_until=until)


def _temperature_only(plan):
    _rest_first(plan)
    plan.controller = lambda plan, rig, instants: _pi_loop(plan, rig, instants, power_logged=False)


def _thermostat(plan):
    _rest_first(plan)
    rng, heater = plan.rng, plan.heater
    point = heater.ambient + heater.gain * plan.cap * float(rng.uniform(0.3, 0.7))
    band = heater.gain * plan.cap * float(rng.uniform(0.005, 0.03))

    def controller(plan, rig, instants):
        found, power, on = [], [], True
        for t in instants:
            y = rig.run(t)
            on = y < point + band if on else y < point - band
            rig.set(plan.cap if on else 0.0)
            found.append(y)
            power.append(plan.cap if on else 0.0)
        return np.array(found), {"power_pct": np.array(power)}

    plan.controller = controller


def _wild(plan):
    def spoil(plan, columns):
        rng, y = plan.rng, columns["temperature_degC"].copy()
        place = slice(0, int(rng.integers(1, 3))) if rng.random() < 0.7 else slice(-1, None)
        y[place] = float(rng.choice([0.0, 850.0, -50.0, 3276.7 / 4.0, 85.0]))
        return columns | {"temperature_degC": y}

    plan.edit = spoil


def _sensor_start(plan):
    def spoil(plan, columns):
        rng, y = plan.rng, columns["temperature_degC"].copy()
        n = int(rng.integers(2, 7))
        if rng.random() < 0.5:
            y[:n] = y[:n] * (1.0 - np.exp(-np.arange(n) / (0.3 * n)))
        else:
            y[:n] = float(rng.choice([0.0, 20.0, 25.0]))
        return columns | {"temperature_degC": np.round(y / plan.step) * plan.step}

    plan.edit = spoil


def _warm(plan):
    reach = plan.heater.gain * plan.cap
    plan.program = str(plan.rng.choice(["step", "up and down"]))
    plan.start = plan.heater.ambient + reach * float(plan.rng.uniform(0.2, 0.9))


def _power_late(plan):
    def shift(plan, columns):
        u = columns["power_pct"]
        return columns | {"power_pct": np.concatenate([u[:1], u[:-1]])}

    plan.edit = shift


def _frozen(plan):
    def freeze(plan, columns):
        y = columns["temperature_degC"].copy()
        for _ in range(int(plan.rng.integers(1, 5))):
            place = int(plan.rng.integers(3, len(y) - 3))
            y[place : place + int(plan.rng.integers(2, max(3, len(y) // 12)))] = y[place]
        return columns | {"temperature_degC": y}

    plan.edit = freeze


def _cooler(plan):
    _change_heater(plan, gain=-min(plan.heater.gain, 0.5))
    plan.cap = 100.0


@dataclass(frozen=True)
class Kind:
    """A kind of heater or log.

    Attributes:
        change: makes it of a plan.
        place: "in": inside the model class, with a test that shows the heater; "hard": inside it, seen badly;
            "out": outside; "blind": nothing in the log can tell, so it is shown and counts for nothing.
        most: so many seeds at most, where a fit takes long.
    """

    change: Callable
    place: str
    most: int | None = None


KINDS = {
    "one lag": Kind(_as_it_is, "in"),
    "second lag": Kind(_second_lag, "in"),
    "equal lags": Kind(_equal_lags, "in"),
    "warm start": Kind(_warm, "in"),
    "ambient drift": Kind(_drift, "in"),
    "gaps": Kind(_gaps, "in"),
    "coarse sensor": Kind(_coarse, "in"),
    "coloured noise": Kind(_coloured, "in"),
    "wild end": Kind(_wild, "in"),
    "sensor start-up": Kind(_sensor_start, "in"),
    "heavy noise": Kind(_heavy_noise, "hard"),
    "clock jump": Kind(_clock_jump, "hard"),
    "frozen readings": Kind(_frozen, "hard"),
    "truncated": Kind(_truncated, "hard"),
    "dead time below a sample": Kind(_below_a_sample, "hard"),
    "no dead time": Kind(_no_dead_time, "hard"),
    "closed loop": Kind(_closed_loop, "hard"),
    "manual, then automatic": Kind(_manual_first, "hard"),
    "thermostat": Kind(_thermostat, "hard"),
    "temperature only": Kind(_temperature_only, "hard", 2),
    "three lags": Kind(_three_lags, "out"),
    "heat is not cool": Kind(_heat_not_cool, "out"),
    "radiation": Kind(_radiation, "out"),
    "saturation": Kind(_saturation, "out"),
    "bent power": Kind(_bent_power, "out"),
    "falling gain": Kind(_falling_gain, "out"),
    "boiling": Kind(_boiling, "out"),
    "second heater": Kind(_second_heater, "out"),
    "door": Kind(_door, "out"),
    "ambient of a day": Kind(_day, "out"),
    "aliased power": Kind(_aliased, "out"),
    "heat-up of two lags": Kind(_two_lag_heat_up, "hard"),
    "heat-up of three lags": Kind(_three_lag_heat_up, "out"),
    "heat-up that begins with its log": Kind(_cropped_heat_up, "hard"),
    "heat-up that glows": Kind(_glowing_heat_up, "out"),
    "power a row late": Kind(_power_late, "blind"),
    "saturation, one level": Kind(_saturation_unseen, "blind"),
    "cooler": Kind(_cooler, "out"),
}

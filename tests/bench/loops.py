"""Loops that are well or ill in a known way, as logs: plant, PWM, PID and story of this file's own.

One lag or two and a dead time, integrated in steps of a fiftieth of the PWM period; the PI in the positional form with its
integral held at the limits; gains by S. Skogestad's rule ("Simple analytic rules for model reduction and PID controller
tuning", J. Process Control 13 (2003), table 1: K = T1/(k(τc + L)), TN = min(T1, 4(τc + L))), then spoilt on purpose.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numba
import numpy as np

#: how many of each among 200
SHARES = {"good": 60, "gain too high": 30, "TN too short": 20, "sluggish": 35, "at its limits": 20, "relay wear": 15,
          "drifted": 20}


@dataclass(frozen=True)
class Loop:
    """One loop as it truly is; times in s, temperatures in °C, powers in %."""

    name: str
    cause: str
    gain: float
    lag: float
    second: float
    dead: float
    ambient: float
    low: float
    setpoint: float
    load: float
    k: float
    tn: float
    ta: float
    pwm: float
    noise: float
    step: float
    interval: float
    duration: float
    cold: bool
    duty: bool
    switch: str
    seed: int
    before: tuple[float, float] | None = None  # gain and lag when it was commissioned


@numba.njit(cache=False)
def _run(plant, pid, story, switch, times, noise, dt):
    gain, lag, second, dead, ambient, step = plant
    k, tn, ta, pwm, memory = pid
    start, low, setpoint, at_setpoint, load, load_on, load_off = story
    ticks, down, latched = switch
    n = int(times[-1] / dt) + 2
    per_scan, per_pwm, delay = max(1, round(ta / dt)), max(1, round(pwm / dt)), round(dead / dt)
    ring = np.full(delay + 1, memory)
    temperature, between, integral, duty, row = start, start, memory, memory, 0
    rows = np.zeros((len(times), 4))
    for j in range(n):
        t = j * dt
        asked = setpoint if t >= at_setpoint else low
        if j % per_scan == 0:
            seen = round((temperature + noise[j // per_scan]) / step) * step
            e = asked - seen
            wish = k * e + integral
            if not (wish > 100.0 and e > 0.0) and not (wish < 0.0 and e < 0.0) and tn < 1e9:
                integral += k * ta / tn * e
            power = min(max(k * e + integral, 0.0), 100.0)
        if j % per_pwm == 0 or not latched:
            duty = power
        whole = duty / 100.0 * (ticks or per_pwm)
        whole = math.floor(whole) if down else round(whole)
        on = 100.0 if (j % per_pwm) < round(whole * per_pwm / (ticks or per_pwm)) else 0.0
        if row < len(times) and t >= times[row] - 1e-9:
            rows[row] = temperature, asked, on, power
            row += 1
        ring[j % (delay + 1)] = on
        late = ring[(j + 1) % (delay + 1)]
        drive = late - (load if load_on <= t < load_off else 0.0)
        if second > 0.0:
            between += (1.0 - math.exp(-dt / second)) * (ambient + gain * drive - between)
        else:
            between = ambient + gain * drive
        temperature += (1.0 - math.exp(-dt / lag)) * (between - temperature)
    return rows


def traced(loop, *, k=None, tn=None, ta=None, pwm=None, switch=(0, False, True)):
    """Return time, temperature, setpoint, power of a loop, by its own PI or another one; (n,) each, and the duty.

    switch: its ticks in a period, 0 for one each integration step, of which twenty make a tick where ticks are given;
    whether a part of one is left out; and whether the duty waits for the next period.
    """
    k, tn, ta, pwm = (own if other is None else other for own, other in (
        (loop.k, k), (loop.tn, tn), (loop.ta, ta), (loop.pwm, pwm)))
    rng = np.random.default_rng(loop.seed)
    dt = min(pwm / (20.0 * switch[0] or 50.0), loop.interval / 2.0, ta)
    times = np.arange(0.0, loop.duration, loop.interval)
    memory = 0.0 if loop.cold else min(max((loop.low - loop.ambient) / loop.gain, 0.0), 100.0)
    start = loop.ambient if loop.cold else loop.low
    scan = max(1, round(ta / dt)) * dt  # in whole steps, so there may be more of them than the duration over TA
    noise = loop.noise * rng.standard_normal(int(loop.duration / min(scan, ta)) + 10)
    rows = _run((loop.gain, loop.lag, loop.second, loop.dead, loop.ambient, loop.step), (k, tn, ta, pwm, memory),
                (start, loop.low, loop.setpoint, 0.0 if loop.cold else 0.06 * loop.duration, loop.load,
                 0.4 * loop.duration, 0.7 * loop.duration), switch, times, noise, dt)
    seen = np.round((rows[:, 0] + loop.noise * rng.standard_normal(len(times))) / loop.step) * loop.step
    return times, seen, rows[:, 1], rows[:, 3] if loop.duty else rows[:, 2], rows[:, 0]


def write(loop, folder, **changed):
    """Write a loop's log, changed as `traced` takes it; return its path."""
    times, seen, asked, power, _ = traced(loop, **changed)
    path = Path(folder) / f"{loop.name}.csv"
    lines = ["time_s,temperature_degC,setpoint_degC,power_pct"]
    lines += [f"{t:.2f},{y:.4g},{r:.6g},{u:.4g}" if abs(y) < 10 else f"{t:.2f},{y:.6g},{r:.6g},{u:.4g}"
              for t, y, r, u in zip(times, seen, asked, power, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def drawn(count=200, seed=1):
    """Return loops with causes in the shares of 200, in an order that tells nothing."""
    rng = np.random.default_rng(seed)
    causes = [cause for cause, share in SHARES.items() for _ in range(max(1, round(share * count / 200)))]
    rng.shuffle(causes)
    return [_drawn(f"loop{place:03d}", cause, rng, seed * 1000 + place) for place, cause in enumerate(causes)]


def textbook(loop, closed=1.25):
    """Return K and TN of the rule for a loop's heater, τc so many times what it is late by, hold and scan included."""
    late = loop.dead + loop.second / 2.0
    lag, slow = loop.lag + loop.second / 2.0, closed * late + late + loop.ta
    return lag / loop.gain / slow, min(lag, 4.0 * slow)


def _drawn(name, cause, rng, seed):
    draw = lambda low, high: float(math.exp(rng.uniform(math.log(low), math.log(high))))  # noqa: E731
    gain, lag = draw(0.4, 3.0), draw(80.0, 1200.0)
    dead = lag * draw(0.06, 0.25)
    second = float(rng.choice([0.0, dead * 0.4]))
    ambient = rng.uniform(18.0, 26.0)
    holds = rng.uniform(30.0, 60.0)
    setpoint = round(ambient + gain * holds, 1)
    low = round(setpoint - gain * holds * rng.uniform(0.1, 0.3), 1)
    late = dead + second / 2.0
    closed = late * rng.uniform(1.0, 1.5)
    ta = max(0.5, round(late / 6.0, 1))
    eff = late + ta  # hold and scan
    k, tn = (lag + second / 2.0) / gain / (closed + eff), min(lag + second / 2.0, 4.0 * (closed + eff))
    switch, pwm = "ssr", max(1.0, round(late / float(rng.choice([5.0, 1.5])), 1))
    before = None
    if cause == "gain too high":
        k *= rng.uniform(2.6, 4.0)
    elif cause == "TN too short":
        tn /= rng.uniform(6.0, 10.0)
    elif cause == "sluggish":
        if rng.random() < 0.5:
            k /= rng.uniform(5.0, 10.0)
        else:
            tn *= rng.uniform(6.0, 12.0)
            k /= rng.uniform(1.5, 2.5)
    elif cause == "at its limits":
        setpoint = round(ambient + gain * rng.uniform(103.0, 125.0), 1)
        low = round(ambient + gain * 70.0, 1)
    elif cause == "relay wear":
        switch, pwm = "relay", round(rng.uniform(2.0, 8.0), 1)
        ta = min(ta, pwm)
    elif cause == "drifted":
        before = (gain * float(rng.choice([0.6, 1.55])), lag) if rng.random() < 0.6 else (
            gain, lag * float(rng.choice([0.55, 1.7])))
    duration = 14.0 * (lag + late)
    interval = max(0.2, round(min(duration / 2500.0, late / 16.0), 1))
    span = gain * holds
    duty = bool(rng.random() < 0.6)
    if not duty:
        interval = min(interval, round(pwm / 25.0, 2))
        duty = duration / interval > 12_000.0
    loop = Loop(
        name=name, cause=cause, gain=gain, lag=lag, second=second, dead=dead, ambient=ambient, low=low,
        setpoint=setpoint, load=rng.uniform(8.0, 20.0), k=k, tn=tn, ta=ta, pwm=pwm, noise=span * rng.uniform(2e-4, 1.5e-3),
        step=float(rng.choice([0.01, 0.05, 0.1])) if span > 20 else 0.01, interval=interval, duration=duration,
        cold=bool(rng.random() < 0.5), duty=duty, switch=switch, seed=seed,
        before=before)
    return replace(loop, load=min(loop.load, 95.0 - holds)) if cause != "at its limits" else loop

"""Heaters that share heat, each logged and designed alone while the others rest: do their loops hold together?

    python -m tests.bench.neighbours --count 4
    python -m tests.bench.neighbours --exchange 4 8

Two structures: zones that exchange heat with those next to them, and fast elements on one slow mass. Of every heater a
log is taken while the others have constant power; every heater gets its own design on fb41. A PASS of all of them is
dangerous where the joint loop is unstable on the true heaters, or its largest sensitivity (σ of the inverse of 1 + L)
is above 2.5. Nothing of heatertune makes the logs or judges the loops.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.plc import Scaling
from heatertune.proof.redesign import DesignRequest
from heatertune.settings import Conditions, TuneSettings
from tests.bench import danger

AMBIENT = 22.0


@dataclass(frozen=True)
class Heaters:
    """x′ = A·x + B·u(t − dead), readings AMBIENT + C·x [°C, %, s]; A, B, C: shapes (s, s), (s, n), (n, s)."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    dead: float

    @property
    def slowest(self):
        """Longest time constant [s]."""
        return float(-1.0 / np.linalg.eigvals(self.a).real.max())

    @property
    def steady(self):
        """Static gains [°C/%], shape (n, n)."""
        return -self.c @ np.linalg.solve(self.a, self.b)


def exchange(coupling, gain, lags, dead, sensor=0.0):
    """Return zones that exchange heat.

    Args:
        coupling: what each exchanges with each other by what it loses, shape (n, n).
        gain: alone [°C/%].
        lags: alone, shape (n,) [s].
        dead: dead time [s].
        sensor: lag of every sensor [s]; 0: none.
    """
    n, lags = len(lags), np.asarray(lags, float)
    a = (coupling - np.diag(1.0 + coupling.sum(axis=1))) / lags[:, None]
    b, c = np.diag(gain / lags), np.eye(n)
    if sensor:
        a = np.block([[a, np.zeros((n, n))], [np.eye(n) / sensor, -np.eye(n) / sensor]])
        b, c = np.vstack([b, np.zeros((n, n))]), np.hstack([np.zeros((n, n)), np.eye(n)])
    return Heaters(a, b, c, dead)


def row(count, exchanged, *, ring=False):
    """Return the coupling of zones in a row, or a ring, shape (count, count)."""
    coupling = np.zeros((count, count))
    for zone in range(count if ring and count > 2 else count - 1):
        other = (zone + 1) % count
        coupling[zone, other] = coupling[other, zone] = exchanged
    return coupling


def on_a_mass(count, gain, fast, slow, share, dead):
    """Return elements on one mass; alone each has about this gain, fast and slow lag [s], and share of the gain fast."""
    # element: fast·e′ = gain·share·u − (e − m); mass: slow·m′ = Σ(e − m)·(1 − share)/share − m
    n = count
    a, b = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n))
    given = (1.0 - share) / share
    for i in range(n):
        a[i, i], a[i, n], b[i, i] = -1.0 / fast, 1.0 / fast, gain * share / fast
        a[n, i] = given / slow
    a[n, n] = -(1.0 + n * given) / slow
    return Heaters(a, b, np.hstack([np.eye(n), np.zeros((n, 1))]), dead)


def log_text(heaters, zone, rng, others=20.0, noise=0.03):
    """Return the log of one heater, two steps of its power, while the others have constant power."""
    n = heaters.b.shape[1]
    interval = max(1.0, round(heaters.slowest / 60.0))
    late, rows = round(heaters.dead / interval * 10), []
    step = interval / 10.0
    rest, first = 25, 550
    power = np.full(n, others)
    x = -np.linalg.solve(heaters.a, heaters.b @ power)
    move, drive = _held(heaters.a, heaters.b, step)
    queue = [power.copy()] * (late + 1)
    for k in range(1050 * 10):
        if k % 10 == 0:
            u = others + (0.0 if k < rest * 10 else 40.0 if k < first * 10 else 20.0)
            rows.append(f"{k // 10 * interval:g},{AMBIENT + (heaters.c @ x)[zone] + rng.normal(0.0, noise):.2f},{u:g}\n")
            power = power.copy()
            power[zone] = u
        queue.append(power)
        x = move @ x + drive @ queue[-1 - late]
    return "time_s,temperature_C,power_pct\n" + "".join(rows)


def _held(a, b, seconds):
    s, n = b.shape
    block = np.zeros((s + n, s + n))
    block[:s, :s], block[:s, s:] = a * seconds, b * seconds
    exact = expm(block)
    return exact[:s, :s], exact[:s, s:]


def joint(heaters, laws):
    """Return the spectral radius of the joint loop, and the largest σ of its sensitivity; all laws of one interval."""
    interval = laws[0].interval
    whole = int(np.floor(heaters.dead / interval + 1e-12))
    late = heaters.dead - whole * interval
    phi, _ = _held(heaters.a, heaters.b, interval)
    after, now = _held(heaters.a, heaters.b, interval - late)
    before = after @ _held(heaters.a, heaters.b, late)[1]
    polynomials = [law.polynomials() for law in laws]
    return (_radius(phi, now, before, heaters.c, whole, polynomials),
            _sensitivity(phi, now, before, heaters.c, whole, polynomials, interval, heaters.slowest))


def _radius(phi, now, before, c, whole, polynomials):
    """Return the largest eigenvalue's size of x, the powers on their way, and the controllers' states."""
    s, n = now.shape
    orders = [len(num) - 1 for num, _ in polynomials]
    size = s + n * (whole + 1) + sum(orders)
    u = np.zeros((n, size))  # powers as functions of all states
    u[:, :s] = -np.array([num[0] for num, _ in polynomials])[:, None] * c
    starts = s + n * (whole + 1) + np.concatenate([[0], np.cumsum(orders)[:-1]])
    for i, start in enumerate(starts):
        if orders[i]:
            u[i, start] = 1.0
    whole_matrix = np.zeros((size, size))
    whole_matrix[:s, :s] = phi
    for gamma, place in ((now, whole), (before, whole + 1)):
        if place == 0:
            whole_matrix[:s] += gamma @ u
        else:
            whole_matrix[:s, s + n * (place - 1) : s + n * place] += gamma
    whole_matrix[s : s + n] = u
    for k in range(1, whole + 1):
        whole_matrix[s + n * k : s + n * (k + 1), s + n * (k - 1) : s + n * k] = np.eye(n)
    for i, (num, den) in enumerate(polynomials):
        for k in range(orders[i]):
            place = starts[i] + k
            whole_matrix[place] -= den[k + 1] * u[i]
            whole_matrix[place, :s] -= num[k + 1] * c[i]
            if k + 1 < orders[i]:
                whole_matrix[place, place + 1] += 1.0
    return float(np.abs(np.linalg.eigvals(whole_matrix)).max())


def _sensitivity(phi, now, before, c, whole, polynomials, interval, slowest):
    s, n = now.shape
    omega = np.geomspace(1e-3 / slowest, np.pi / interval, 3000)
    z = np.exp(1j * omega * interval)
    driven = now[None] + before[None] / z[:, None, None]
    plant = c @ np.linalg.solve(z[:, None, None] * np.eye(s) - phi, driven) * z[:, None, None] ** -float(whole)
    back = 1.0 / z
    control = np.array([np.polyval(num[::-1], back) / np.polyval(den[::-1], back) for num, den in polynomials]).T
    loop = plant * control[:, None, :]
    return float(1.0 / np.linalg.svd(np.eye(n) + loop, compute_uv=False)[:, -1].min())


def overshoot_pct(heaters, laws, setpoint):
    """Return the largest overshoot where all heat up together from rest without power, as limited PI [% of the rise].

    The integral is held where the power is at a limit and would go beyond it.
    """
    interval, n = laws[0].interval, heaters.b.shape[1]
    parts = max(4, int(np.ceil(interval / max(heaters.dead, 1e-9) * 4)))
    step = interval / parts
    late = round(heaters.dead / step)
    move, drive = _held(heaters.a, heaters.b, step)
    gain, now, before = (np.array([getattr(law, name) for law in laws]) for name in ("k", "i_now", "i_before"))
    x, integral, last = np.zeros(len(heaters.a)), np.zeros(n), np.full(n, setpoint - AMBIENT)
    queue, highest = [np.zeros(n)] * late, np.zeros(n)
    seconds = 6.0 * heaters.slowest + 10.0 * max(law.interval / max(law.i_now + law.i_before, 1e-9) for law in laws)
    for _ in range(int(seconds / interval)):
        reading = heaters.c @ x
        e = setpoint - AMBIENT - reading
        ahead = integral + gain * (now * e + before * last)
        last, wanted = e, gain * e + ahead
        free = ((wanted >= 0.0) & (wanted <= 100.0)) | ((wanted > 100.0) != (ahead > integral))
        integral = np.where(free, ahead, integral)
        queue += [np.clip(gain * e + integral, 0.0, 100.0)] * parts
        for k in range(parts):
            x = move @ x + drive @ queue[k]
            highest = np.maximum(highest, heaters.c @ x)
        queue = queue[parts:]
    return float(100.0 * (highest.max() / (setpoint - AMBIENT) - 1.0))


@dataclass
class Joint:
    """What separate designs come to: verdicts of the heaters, radius and sensitivity of the joint loop."""

    verdicts: list
    why: list
    radius: float = float("nan")
    sigma: float = float("nan")
    gains: tuple = ()

    @property
    def end(self):
        """PASS where every heater passes; else the first that does not."""
        return next((each for each in self.verdicts if each != "PASS"), "PASS")

    @property
    def danger(self):
        """Whether all pass and do not hold together."""
        return self.end == "PASS" and (self.radius >= 1.0 or self.sigma > 2.5)


def separate(heaters, seed, interval, zones=None, edit=lambda fitted: fitted):
    """Return what separate designs on fb41 come to.

    Args:
        heaters: the truth.
        seed: of the noise.
        interval: of every controller [s].
        zones: heater → heater whose design it gets, as they are alike; None: each its own.
        edit: what changes a fit before it is designed for.
    """
    rng, n = np.random.default_rng([43, seed]), heaters.b.shape[1]
    zones = list(range(n)) if zones is None else zones
    laws, result = {}, Joint([], [])
    for zone in sorted(set(zones)):
        with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
            path = Path(place) / f"zone{zone}.csv"
            path.write_text(log_text(heaters, zone, rng), encoding="utf-8")
            try:
                fitted = edit(fit(read_log(path)))
            except HeatertuneError as refused:
                result.verdicts.append("refused")
                result.why.append(str(refused))
                continue
        top = AMBIENT + float(heaters.steady[zone].sum()) * 100.0
        asked = DesignRequest(
            target="fb41", scaling=Scaling(low_degC=0.0, high_degC=50.0 * (1.0 + top // 50.0)), switch_kind="ssr",
            tune_settings=TuneSettings(structure="pi", sample_time_s=interval), conditions=Conditions(tolerance_degC=2.0))
        ending, words = danger.ended(fitted, asked)
        result.verdicts.append(ending.end)
        result.why.append(f"{type(fitted.candidates[0].model).__name__} {ending.why}")
        if words is not None:
            laws[zone] = danger.law_of(words)
    if len(laws) == len(set(zones)):
        result.radius, result.sigma = joint(heaters, [laws[zone] for zone in zones])
        result.gains = tuple((round(law.k, 3), round(law.interval / max(law.i_now + law.i_before, 1e-12), 1))
                             for law in laws.values())
    return result


def drawn(seed):
    """Return drawn heaters, their controllers' interval [s], and which of them are alike."""
    rng = np.random.default_rng([44, seed])
    count, dead = int(rng.integers(2, 7)), float(rng.uniform(3.0, 15.0))
    if seed % 2:
        lag = float(rng.uniform(100.0, 500.0))
        lags = lag * (np.ones(count) if seed % 4 == 1 else rng.uniform(0.7, 1.4, count))
        heaters = exchange(row(count, float(rng.uniform(1.0, 12.0)), ring=bool(rng.integers(2))), 1.2, lags, dead,
                           float(rng.choice([0.0, rng.uniform(2.0, 8.0)])))
        return heaters, 2.0, None
    fast = float(rng.uniform(10.0, 60.0))
    heaters = on_a_mass(count, float(rng.uniform(0.3, 0.8)), fast, fast * float(rng.uniform(10.0, 60.0)),
                        float(rng.uniform(0.1, 0.7)), dead)
    return heaters, 2.0, [0] * count


def main(arguments=None):
    """Print a line a case; return 1 where separate designs that pass do not hold together."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4, help="drawn cases")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--exchange", type=float, nargs="+", help="three equal zones in a row instead of drawn ones")
    asked = parser.parse_args(arguments)
    cases = [(f"seed {seed}", *drawn(seed)) for seed in range(asked.first, asked.first + asked.count)]
    if asked.exchange:
        cases = [(f"exchange {c:g}", exchange(row(3, c), 1.2, (240.0,) * 3, 12.0), 2.0, [0, 1, 0]) for c in asked.exchange]
    ends, dangers = Counter(), 0
    for seed, (name, heaters, interval, zones) in enumerate(cases):
        begun = time.process_time()
        found = separate(heaters, asked.first + seed, interval, zones)
        ends[found.end] += 1
        dangers += found.danger
        print(f"{name}: {found.end}{' DANGEROUS' if found.danger else ''} radius {found.radius:.4f} σ {found.sigma:.2f} "
              f"K, TN {found.gains} {found.why[:3]} {time.process_time() - begun:.0f} s", flush=True)
    print(f"{dict(ends)}; dangerous {dangers}")
    return int(dangers > 0)


if __name__ == "__main__":
    sys.exit(main())

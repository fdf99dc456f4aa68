"""Which rows of drawn logs are left out as an open sensor's? python -m tests.bench.open_sensors [COUNT].

Real are: a heater whose card ends at a value it reaches, a coarse card, a long plateau, two-level control, cold goods, also into a heater at rest, short
pulses of a fast heater, none of which may lose a row. An open sensor reads an end of the card's range in one or several stands,
at the begin, in the midst or at the end of a record: none of its rows may stay. Refused logs are counted by themselves, and
what stands high at the begin, which is kept: so may a heater at rest.
Status 1 where a real row is lost, or more than a twentieth of the logs keep a row of an open sensor.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from heatertune.errors import LogError
from heatertune.log import read_log

REAL = ("range ends", "coarse", "plateau", "two levels", "cold goods", "goods at rest", "pulses")
OPEN = ("low at the begin", "high at the begin", "in the midst", "at the end", "several")
UNTOLD = "high at the begin"  # as a heater at rest before cold goods come
_KEPT = 0.05


def heater(rng, kind):
    """Return (times, temperatures, powers) of a heater of one lag that is stepped, or switched."""
    n, interval, lag, gain, ambient = int(rng.integers(60, 600)), 10.0 ** rng.uniform(0.0, 1.5), 10.0 ** rng.uniform(1.7, 3.3), rng.uniform(0.4, 3.0), rng.uniform(5.0, 30.0)
    if kind == "pulses":
        lag = interval * rng.uniform(0.1, 1.0)
    time, temperature, power = interval * np.arange(n), np.empty(n), np.empty(n)
    y, u, high, setpoint = ambient, 0.0, rng.uniform(20.0, 100.0), ambient + gain * rng.uniform(10.0, 60.0)
    band, pulse = rng.uniform(0.2, 4.0), int(rng.integers(5, 15))
    if kind == "goods at rest":
        y = ambient + gain * high
    for k in range(n):
        if kind == "two levels":
            u = 100.0 if y < setpoint - band else 0.0 if y > setpoint + band else u
        elif kind == "pulses":
            u = high if n // 2 <= k < n // 2 + pulse else 0.3 * high
        else:
            u = 0.0 if k < n // 10 and kind != "goods at rest" else high
        temperature[k], power[k] = y, u
        target = ambient + gain * u
        y = target + (y - target) * np.exp(-interval / lag)
        if (kind == "cold goods" and k == 2 * n // 3) or (kind == "goods at rest" and k == n // 12):
            y -= rng.uniform(0.1, 0.8) * (y - ambient)
    return time, temperature, power


def logged(rng, temperature, kind):
    """Return readings of a card: steps, noise, and the ends of its range."""
    step = 10.0 ** rng.uniform(-2.0, 0.0) if kind != "coarse" else 10.0 ** rng.uniform(0.0, 1.0)
    noisy = temperature + rng.normal(0.0, rng.choice([0.0, 0.3, 2.0]) * min(step, 1.0), len(temperature))
    low, high = (float(np.quantile(temperature, q)) for q in (0.15, 0.85)) if kind == "range ends" else (-50.0, 500.0)
    if rng.random() < 0.5:
        low = -50.0
    return step * np.round(np.clip(noisy, low, high) / step)


def opened(rng, readings, kind):
    """Return which rows are an open sensor's, and the readings with them."""
    n, is_open = len(readings), np.zeros(len(readings), dtype=bool)
    most = max(5, int(0.08 * n))
    span = np.ptp(readings)
    stands = int(rng.integers(2, 4)) if kind == "several" else 1
    for number in range(stands):
        length = int(rng.integers(5, max(6, most // stands + 1)))
        begin = {"low at the begin": 0, "high at the begin": 0, "at the end": n - length}.get(kind, int((number + rng.uniform(0.2, 0.7)) * n / stands))
        is_open[begin:begin + length] = True
    end = float(np.round(readings.max() + span * rng.uniform(0.5, 4.0))) if kind == UNTOLD or (kind != "low at the begin" and rng.random() < 0.6) else float(
        np.round(readings.min() - span * rng.uniform(0.5, 2.0)))
    return is_open, np.where(is_open, end, readings)


def read(folder, time, readings, power):
    """Return the rows that were kept, None where the log was refused."""
    path = Path(folder) / "log.csv"
    path.write_text("time_s,temp_C,duty_pct\n" + "".join(f"{t:.6g},{y:.6g},{u:.4g}\n" for t, y, u in zip(time, readings, power, strict=True)))
    try:
        return set(np.round(read_log(path).time_s, 6).tolist())
    except LogError:
        return None


def main(count=200):
    told = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(int(count)):
            for kind in (*REAL, *OPEN):
                rng = np.random.default_rng([seed, len(kind), ord(kind[0]), 20261123])
                time, temperature, power = heater(rng, kind)
                time = np.array([float(f"{t:.6g}") for t in time])
                readings = logged(rng, temperature, kind)
                if np.ptp(readings) == 0.0:
                    continue
                is_open = np.zeros(len(time), dtype=bool)
                if kind in OPEN:
                    is_open, readings = opened(rng, readings, kind)
                kept = read(folder, time - time[0], readings, power)
                if kept is None:
                    told[kind, "refused"] += 1
                    continue
                there = np.array([round(float(t), 6) in kept for t in time - time[0]])
                told[kind, "read"] += 1
                told[kind, "open kept"] += bool(np.any(there & is_open))
                told[kind, "real lost"] += bool(np.any(~there & ~is_open))
                if np.sum(~there & ~is_open) and kind in REAL:
                    print(f"{kind} {seed}: {np.sum(~there)} of {len(time)} rows left out", flush=True)
    for kind in (*REAL, *OPEN):
        print(f"{kind:17s}", ", ".join(f"{what} {told[kind, what]}" for what in ("read", "refused", "real lost", "open kept")))
    lost = sum(told[kind, "real lost"] for kind in REAL)
    kept, of = (sum(told[kind, what] for kind in OPEN if kind != UNTOLD) for what in ("open kept", "read"))
    return bool(lost or kept > _KEPT * of)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

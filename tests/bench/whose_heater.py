"""Logs in which the heater is not the one to fit from some instant on: is the instant told, and the way to cut it out?

    python tests/bench/whose_heater.py --count 16
    python tests/bench/whose_heater.py --kinds probe reset --verbose

Kinds: the circuit of the heater opens, for good or for a while (a thermal cut-out); one of its two elements opens; the
probe falls out and shows the room; the controller is reset, forgets its
integral and begins again; it is off until the heater has cooled down (restart); a second heater is switched on. Each in a PI loop, with steps of the power, or under two-level
control. A reset is no fault of the heater: its log has to be fitted as it is, and in a loop a restart is told with the
option that leaves it out. For the others the log has to be refused
with `--until` before the instant, or to be fitted with the truth inside its intervals; never as a cooler. The cut log has
to be fitted. Heater and controllers are this file's own; they use nothing of heatertune.
"""

import argparse
import math
import re
import sys
import tempfile
import zlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log

KINDS = ("opens", "probe", "reset", "second", "cut-out", "element", "restart")
WAYS = ("loop", "steps", "two-level")
_TOLERANCE = 0.03  # of the gain


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A log, the heater's gain [°C/%] and the instant from which the log is not of this heater alone [s]."""

    rows: list
    gain: float
    at: float
    length: float
    way: str

    def text(self, powered=True):
        """Return the file, with the power or without."""
        rows = (f"{t:g},{y:.10g}" + (f",{u:.4g}" if powered else "") for t, y, u in self.rows)
        return "\n".join(["time_s,temperature_degC" + (",power_pct" if powered else ""), *rows, ""])


def draw(kind, way, seed, *, noise_times=1.0, interval_times=1.0):
    """Return the log of a kind, a way to move the power, and a seed; the same at all times.

    Noise and row interval are this many times those of the seed.
    """
    rng = np.random.default_rng([zlib.crc32(f"{kind} {way}".encode()), seed])
    lag, gain = math.exp(rng.uniform(math.log(60.0), math.log(600.0))), math.exp(rng.uniform(math.log(0.4), math.log(3.0)))
    second = lag * rng.uniform(0.05, 0.4) if rng.random() < 0.5 else 0.0
    dead, ambient = lag * rng.uniform(0.03, 0.15), rng.uniform(15.0, 28.0)
    interval = max(1.0, round(lag / 60.0 * interval_times))
    fine = min(interval, lag / 200.0)
    per_row = math.ceil(interval / fine)
    fine = interval / per_row
    length = (lag + second + dead) * rng.uniform(8.0, 12.0)
    at = length * rng.uniform(0.45, 0.75)
    target = ambient + 100.0 * gain * rng.uniform(0.3, 0.6)
    k, ti = lag / (gain * 2.5 * (dead + second + interval)), min(lag, 8.0 * (dead + second + interval))
    levels = [0.0, *rng.uniform(25.0, 80.0, 5)]
    noise, step = noise_times * rng.uniform(0.02, 0.1), float(rng.choice([0.01, 0.1]))
    band = 100.0 * gain * rng.uniform(0.01, 0.03)
    pipe, x, y, part, on, power = [0.0] * round(dead / fine), ambient, ambient, 0.0, True, 0.0
    rise, reset_for = 100.0 * gain * rng.uniform(0.15, 0.4), 5.0 * interval + (1.2 * lag if kind == "restart" else 0.0)
    is_reset = kind in ("reset", "restart")
    closes = at + (2.0 * lag if kind == "cut-out" else math.inf)
    rows, probe, has_reset = [], ambient, False
    for row in range(int(length / interval)):
        now = row * interval
        gone = now >= at
        seen = probe if kind == "probe" and gone else y
        read = round((seen + rng.normal(0.0, noise)) / step) * step
        if is_reset and gone and not has_reset:
            part, has_reset = 0.0, True
        if now < 3.0 * interval or (is_reset and gone and now < at + reset_for):
            power = 0.0
        elif way == "loop":
            wanted = k * (target - read) + part
            power = min(100.0, max(0.0, wanted))
            part += k * interval / ti * (target - read) if power == wanted else 0.0
        elif way == "steps":
            power = float(round(levels[min(5, int(6.0 * now / length))], 1))
        else:
            on = read < target + band if on else read < target - band
            power = 100.0 if on else 0.0
        rows.append((now, read, power))
        for _ in range(per_row):
            left = 0.0 if kind in ("opens", "cut-out") and at <= now < closes else 0.5 if kind == "element" and gone else 1.0
            pipe.append(left * power)
            extra = rise if kind == "second" and gone else 0.0
            x += fine / lag * (ambient + gain * pipe.pop(0) + extra - x)
            y = x if not second else y + fine / second * (x - y)
            probe += fine / max(4.0 * interval, 0.03 * lag) * ((ambient if gone else y) - probe)
    return Drawn(rows=rows, gain=gain, at=at, length=length, way=way)


def fitted_or_refused(drawn, powered=True, **options):
    """Return the outcome, whether the gain's interval holds the truth (None: no interval), and all messages."""
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path = Path(place) / "log.csv"
        path.write_text(drawn.text(powered), encoding="utf-8")
        try:
            fitted = fit(read_log(path), **options)
        except HeatertuneError as problem:
            return "refused", None, str(problem)
        except Exception as problem:
            return "crashed", None, repr(problem)
    message = " ".join([*(finding.message for finding in fitted.findings), *fitted.notes])
    inside = fitted.ci95.get("gain_degC_per_pct")
    if inside is None:
        return fitted.outcome.name, None, message
    low, high = -math.inf if inside.low is None else inside.low, math.inf if inside.high is None else inside.high
    return fitted.outcome.name, (1.0 - _TOLERANCE) * low <= drawn.gain <= (1.0 + _TOLERANCE) * high, message


def cut_of(message):
    """Return the options of a message that leave out a part of the log, and the instant at which they cut [s]."""
    found = re.search(r"--from ([\d.]+)(?: --until ([\d.]+))? leaves", message)
    if found:
        return {"from_s": float(found[1])} | ({"until_s": float(found[2])} if found[2] else {}), float(found[1])
    until = re.search(r"--until (-?[\d.]+)", message)
    return ({"until_s": float(until[1])}, float(until[1])) if until else ({}, None)


def verdict_of(kind, drawn):
    """Return a word on how a log was served, and what was said."""
    outcome, holds, message = fitted_or_refused(drawn)
    options, until = cut_of(message)
    word = "a restart not told" if (kind, drawn.way, until) == ("restart", "loop", None) else "fitted"
    if outcome == "crashed":
        word = "crashed"
    elif "a cooler" in message:
        word = "called a cooler"
    elif outcome == "refused" and until is None:
        word = "refused without the instant"
    elif outcome == "refused" and kind in ("reset", "restart"):
        word = "a reset refused"
    elif holds is False:
        word = "wrong gain"
    elif until is not None and kind != "reset":
        after, its, then = fitted_or_refused(drawn, **options)
        if kind == "cut-out" and cut_of(then)[0]:  # where it closes again, then where it opens
            options, until = cut_of(then)
            after, its, then = fitted_or_refused(drawn, **options)
        if abs(until - drawn.at) > (0.25 if kind == "restart" else 0.15) * drawn.length:
            word = "another instant"
        elif after in ("refused", "crashed") or its is False:
            word, message = "the cut log fails", then
        else:
            word = "told and cut"
    return word, message


#: words that are right for a log
RIGHT = ("told and cut", "fitted")


def main(arguments=None):
    """Print a table of how logs were served; return 1 if one was served wrongly."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=6, help="seeds of each kind and way (default: 6)")
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS, metavar="KIND")
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args(arguments)
    wrong = total = 0
    for kind in asked.kinds:
        for way in WAYS:
            counted = Counter()
            for seed in range(asked.first, asked.first + asked.count):
                drawn = draw(kind, way, seed)
                word, message = verdict_of(kind, drawn)
                counted[word] += 1
                total += 1
                wrong += word not in RIGHT
                if asked.verbose or word not in RIGHT:
                    print(f"  {kind}, {way} {seed}: {word}; at {drawn.at:.0f} of {drawn.length:.0f} s; {message[:230]}")
            print(f"{kind}, {way}: {dict(counted)}", flush=True)
    print(f"{total} logs, {wrong} served wrongly")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

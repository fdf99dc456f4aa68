"""Is the cause right, and do the words cure? python -m tests.bench.health [-n 200] [--words].

--ticks, --down and --at-once attack what `heatertune.loops.unlogged_loads` finds: a switch that works in another way.

Loops of `tests.bench.loops`, whose causes are known, go through `heatertune.batch.loop_health` as `heatertune health` runs it.
The words that are proposed are then typed into PID_v1 as `tests.witness.arduino_pid` has it, in front of this bench's own
plant, and judged beside the textbook PI that the loop would have had, had nobody spoilt it.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import find_peaks

from heatertune.batch import in_processes
from heatertune.batch.loop_health import HealthSettings, health, rank_rows
from heatertune.plc import Scaling
from heatertune.proof.design_request import DesignRequest
from heatertune.settings import ReadSettings
from tests.bench.loops import Loop, drawn, textbook, traced, write
from tests.witness.arduino_pid import ArduinoPid

#: what this bench calls a cause → what heatertune may call it
RIGHT = {"good": {"well"}, "gain too high": {"oscillating"}, "TN too short": {"oscillating"}, "sluggish": {"sluggish"},
         "at its limits": {"full power"}, "relay wear": {"wear"}, "drifted": {"drifted"}}
BY_TUNING = ("gain too high", "TN too short", "sluggish")
BY_WORDS = ("good", *BY_TUNING, "relay wear", "drifted")
NO_WORSE = 2.0  # times the mean error of the textbook's PI, and times its turns
TURNS = 4  # after a load, that nobody minds
PROMINENT = 0.2  # of the largest error after a load: what counts as a turn


def examined(loops, folder, *, target="", switch=(0, False, True)):
    """Return the document of `heatertune health` on these loops' logs and their list."""
    folder = Path(folder)
    (folder / "logs").mkdir()
    entries = []
    for loop in loops:
        write(loop, folder / "logs", switch=switch)
        made_for = None
        if loop.before:
            made_for = folder / "made_for" / loop.name
            made_for.mkdir(parents=True)
        entries.append(f"[[loop]]\nfile = '{loop.name}.csv'\nswitch = '{loop.switch}'\npwm_period_s = {loop.pwm}\n" + (
            "" if made_for is None else _model(loop, made_for)))
    (folder / "loops.toml").write_text("\n".join(entries), encoding="utf-8")
    asked = DesignRequest(target=target, scaling=Scaling(low_degC=0.0, high_degC=500.0))
    return health(folder / "logs", HealthSettings(request=asked, read=ReadSettings()), out=folder / "health.parquet",
                  workers=in_processes(1), loops=folder / "loops.toml", progress=lambda done, of: print(
                      f"{done} of {of}", file=sys.stderr, flush=True))


def _model(loop, folder):
    """Write the heater that a loop's words were made for, as the user gave it by hand; return its entry of the list."""
    from heatertune.model.model_document import to_document  # noqa: PLC0415
    from heatertune.model.model_values import Fopdt, model_by_hand  # noqa: PLC0415

    gain, lag = loop.before
    model = model_by_hand(Fopdt(gain_degC_per_pct=gain, time_constant_s=lag + loop.second / 2.0,
                                dead_time_s=loop.dead + loop.second / 2.0, ambient_degC=loop.ambient))
    (folder / "model.json").write_text(json.dumps(to_document(model)), encoding="utf-8")
    return f"folder = 'made_for/{loop.name}'\n"


def lived(loop: Loop, words, pwm):
    """Return time, true temperature and setpoint of a loop whose PID_v1 holds these words; arrays of shape (n,)."""
    ta = words["SampleTime"] / 1000.0
    pid = ArduinoPid(words["Kp"], words["Ki"], words["Kd"], on_measurement=words["POn"] == 0)
    pid.set_sample_time(int(words["SampleTime"]))
    pid.set_tunings(words["Kp"], words["Ki"], words["Kd"])
    pid.set_output_limits(0, words["OutMax"])
    start = loop.ambient if loop.cold else loop.low
    memory = 0.0 if loop.cold else (loop.low - loop.ambient) / loop.gain
    pid.output, pid.input = np.float64(memory * words["Full"] / 100.0), np.float64(start)
    pid.set_mode(automatic=True)
    rng, dt = np.random.default_rng(loop.seed), min(pwm / 50.0, ta)
    n, delay = int(loop.duration / dt), round(loop.dead / dt)
    ring, temperature, between, duty, due = [memory] * (delay + 1), start, start, memory, 0.0
    keeps = np.exp(-dt / loop.lag), np.exp(-dt / loop.second) if loop.second else 0.0
    each, rows, asked_of = max(1, round(pwm / dt)), np.zeros(n), np.zeros(n)
    for j in range(n):
        t = j * dt
        asked = loop.low if not loop.cold and t < 0.06 * loop.duration else loop.setpoint
        if t >= due - 1e-9:
            pid.setpoint = np.float64(asked)
            pid.input = np.float64(round((temperature + loop.noise * rng.standard_normal()) / loop.step) * loop.step)
            pid.compute(round(1000.0 * due))
            due += ta
        if j % each == 0:
            duty = float(pid.output) / words["Full"] * 100.0
        ring[j % (delay + 1)] = 100.0 if j % each < round(duty / 100.0 * each) else 0.0
        drive = ring[(j + 1) % (delay + 1)] - (
            loop.load if 0.4 * loop.duration <= t < 0.7 * loop.duration else 0.0)
        target = loop.ambient + loop.gain * drive
        between = target + keeps[1] * (between - target)
        temperature = between + keeps[0] * (temperature - between)
        rows[j], asked_of[j] = temperature, asked
    return dt * np.arange(n), rows, asked_of


def mean_error(time, temperature, asked, pwm):
    """Return the mean error of the last 80 % of a story, averaged over the PWM period [°C]."""
    width = max(1, round(pwm / (time[1] - time[0])))
    off = np.convolve(temperature - asked, np.full(width, 1.0 / width), mode="valid")
    return float(np.abs(off[int(0.2 * len(off)):]).mean())


class Behaviour(NamedTuple):
    """How a loop holds its setpoint: mean error [°C], and turns of the error after a load, PWM averaged out."""

    error: float
    turns: int


def behaved(loop, time, temperature, asked, pwm):
    """Return the behaviour of a story, from the true temperature."""
    width = max(1, round(pwm / (time[1] - time[0])))
    off = np.convolve(temperature - asked, np.full(width, 1.0 / width), mode="valid")
    turns = []
    for begin, end in ((0.4, 0.7), (0.7, 1.0)):
        part = off[int(begin * len(time)):int(end * len(time))]
        least = max(PROMINENT * np.abs(part).max(), loop.step)
        turns.append(sum(len(find_peaks(side * part, prominence=least)[0]) for side in (1.0, -1.0)))
    return Behaviour(mean_error(time, temperature, asked, pwm), max(turns))


def ill(loop, one, best):
    """Return whether a behaviour is one that other words would better: worse than the textbook's by error or by swings."""
    return one.error > NO_WORSE * max(best.error, loop.step) or one.turns > max(TURNS, NO_WORSE * best.turns)


def as_found(loop):
    """Return the behaviour of a loop, and that of the textbook's PI in its place."""
    k, tn = textbook(loop)
    stories = [traced(one) for one in (loop, replace(loop, k=k, tn=tn))]
    return [behaved(loop, story[0], story[4], story[2], loop.pwm) for story in stories]


def with_words(loop, row):
    """Return the behaviour of a loop with the words that its row proposes."""
    pwm = row["words_pwm_period_s"]
    return behaved(loop, *lived(loop, json.loads(row["words"]), pwm), pwm)


class Figures:
    """What is told of loops so far."""

    def __init__(self, loops, *, words):
        self.loops, self.words, self.rows, self.counts = loops, words, [], Counter()
        self.right, self.of = Counter(), Counter()

    def add(self, row):
        """Count a loop, and tell where it went wrong."""
        loop = self.loops[row["name"]]
        hit = row["outcome"] in RIGHT[loop.cause]
        self.rows.append(row)
        self.right[loop.cause] += hit
        self.of[loop.cause] += 1
        if not hit:
            print(f"{loop.name}: {loop.cause}, told {row['outcome']}: {row['reason']}")
        if self.words and loop.cause in BY_WORDS:
            was, best = as_found(loop)
            if ill(loop, was, best):
                self._try(loop, row, was, best)
            elif loop.cause in BY_TUNING:
                print(f"{loop.name}: {loop.cause}, but no worse than the textbook's: {was}, {best}")

    def _try(self, loop, row, was, best):
        now = with_words(loop, row) if row.get("words") else None
        passed, cured = row.get("verdict") == "PASS", now is not None and not ill(loop, now, best)
        self.counts.update({
            "ill-tuned": 1, "with words": now is not None, "proven PASS": passed, "cured": cured,
            "cured by PASS": cured and passed,
            "ill by swings alone": was.error <= NO_WORSE * max(best.error, loop.step),
            "of them with a mean error below the textbook's": was.error < best.error,
            "cured with a mean error below what it was": cured and now.error < was.error,
            "swings more in spite of PASS": passed and now.turns > max(TURNS, was.turns),
            "larger mean error than the textbook's and than before in spite of PASS":
                passed and now.error > max(was.error, best.error)})
        if not (cured and passed):
            print(f"{loop.name}: {loop.cause}, {row.get('verdict')} {row.get('why')}: {was}, with words {now}, "
                  f"textbook {best}")

    def tell(self):
        """Print the figures."""
        worst = [self.loops[row["name"]].cause for row in rank_rows(self.rows)[:10]]
        for cause, count in self.of.items():
            print(f"{cause:15} {self.right[cause]:3} of {count}")
        print(f"together        {self.right.total():3} of {self.of.total()}; "
              f"good ones among the worst ten: {worst.count('good')}")
        if self.words:
            print(", ".join(f"{count} {what}" for what, count in self.counts.items()))
        sys.stdout.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--words", action="store_true", help="design and try the words of the ill-tuned ones, too")
    parser.add_argument("--every", type=int, default=20, help="loops between two tellings of the figures")
    parser.add_argument("--ticks", type=int, default=0, help="of a PWM period (default: as the loops are integrated)")
    parser.add_argument("--down", action="store_true", help="parts of a tick are left out, not rounded")
    parser.add_argument("--at-once", action="store_true", help="a duty does not wait for the next period")
    settings = parser.parse_args()
    loops = drawn(settings.n, settings.seed)
    figures = Figures({loop.name: loop for loop in loops}, words=settings.words)
    for begin in range(0, len(loops), settings.every):
        with tempfile.TemporaryDirectory() as folder:
            document = examined(
                loops[begin:begin + settings.every], folder, target="arduino-pid" if settings.words else "",
                switch=(settings.ticks, settings.down, not settings.at_once))
        for row in document["loops"] + document["left_out"]:
            figures.add(row)
        figures.tell()


if __name__ == "__main__":
    main()

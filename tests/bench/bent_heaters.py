"""Drawn heaters whose heat loss is a curve, logged at two powers to half of the working temperature: is it found?

    python tests/bench/bent_heaters.py --count 100
    python tests/bench/bent_heaters.py --count 20 --kinds radiation --targets fb41 weg

Of each log the power that holds the working temperature, the end temperature at full power and, of a heater with a power
of the rise, the exponent are compared with the truth. With targets, a design is made for the working temperature; a PASS
is dangerous (exit status 1) if its loop is unstable on the true heater's tangent there, has Ms > 2.5, or overshoots on
the true, limited heater by more than 1.05 times its own limit.

The heaters are integrated here (Runge–Kutta of fourth order on the physical equations), and the loop is judged by
truth.py: neither shares anything with heatertune.
"""

import argparse
import math
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.model.loss_curve import has_loss_curve, steady_power_pct, top_degC
from heatertune.plc import Scaling
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.settings import Conditions, TuneSettings
from tests.bench import truth
from tests.bench.danger import law_of

KINDS = ("radiation", "exponent")
ABSOLUTE = 273.15


@dataclass(frozen=True)
class Kiln:
    """capacity·T′ = power − convection·(T − room) − glow·(T⁴ − room⁴) − bent·(T − room)^exponent, powers in %.

    Attributes:
        works_at: working temperature [°C].
        sensor: lag of the sensor [s]; 0: none.
        row_s: of the log [s].
        levels: powers of the log [%].
        holds_s: how long each of them is held [s].
    """

    kind: str
    seed: int
    capacity: float
    convection: float
    glow: float
    bent: float
    exponent: float
    room: float
    dead: float
    sensor: float
    noise: float
    works_at: float
    row_s: float
    levels: tuple
    holds_s: tuple

    def lost(self, t):
        """Return the loss at a temperature [%]."""
        rise = t - self.room
        own = self.bent * math.copysign(abs(rise) ** self.exponent, rise) if self.bent else 0.0
        return self.convection * rise + self.glow * ((t + ABSOLUTE) ** 4 - (self.room + ABSOLUTE) ** 4) + own

    def slope(self, t):
        """Return the slope of the loss [%/°C]."""
        rise = max(t - self.room, 1e-9)
        own = self.bent * self.exponent * rise ** (self.exponent - 1.0) if self.bent else 0.0
        return self.convection + 4.0 * self.glow * (t + ABSOLUTE) ** 3 + own

    def rests_at(self, power):
        """Return the temperature to which a power leads [°C]."""
        low, high = self.room, 6000.0
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.lost(middle) < power else (low, middle)
        return low


class Running:
    """A kiln in time: powers act a dead time after they are set."""

    def __init__(self, kiln):
        self.kiln, self.now, self.mass, self.seen, self.edges = kiln, 0.0, kiln.room, kiln.room, [(-1.0, 0.0)]

    def set(self, power):
        self.edges.append((self.now + self.kiln.dead, power))

    def run(self, until):
        """Return the sensor's temperature at an instant [°C]."""
        while self.now < until - 1e-9:
            acting = max((edge for edge in self.edges if edge[0] <= self.now + 1e-9), key=lambda edge: edge[0])
            self.edges = [edge for edge in self.edges if edge[0] >= acting[0]]
            after = [edge[0] for edge in self.edges if edge[0] > self.now + 1e-9]
            end = min([until, *after])
            steps = math.ceil((end - self.now) / self._longest)
            for _ in range(steps):
                self._step((end - self.now) / steps, acting[1])
            self.now = end
        return self.seen

    @property
    def _longest(self):
        kiln = self.kiln
        return min(kiln.capacity / kiln.slope(1.3 * kiln.works_at) / 20.0, kiln.sensor / 2.0 if kiln.sensor else math.inf)

    def _step(self, h, power):
        def slopes(mass, seen):
            kiln = self.kiln
            return (power - kiln.lost(mass)) / kiln.capacity, (mass - seen) / kiln.sensor if kiln.sensor else 0.0

        mass, seen = self.mass, self.seen
        a = slopes(mass, seen)
        b = slopes(mass + 0.5 * h * a[0], seen + 0.5 * h * a[1])
        c = slopes(mass + 0.5 * h * b[0], seen + 0.5 * h * b[1])
        d = slopes(mass + h * c[0], seen + h * c[1])
        self.mass = mass + h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        self.seen = seen + h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]) if self.kiln.sensor else self.mass


def draw(kind, seed):
    """Return a kiln of this kind and seed; the exponents are those of RepRapFirmware, 1.0 to 1.6."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    room = float(rng.uniform(15.0, 28.0))
    works_at = float(rng.uniform(500.0, 1000.0) if kind == "radiation" else rng.uniform(180.0, 320.0))
    holds = float(rng.uniform(45.0, 85.0))  # % of power at the working temperature
    rise = works_at - room
    if kind == "radiation":
        share, exponent, bent = float(rng.uniform(0.25, 0.95)), 1.0, 0.0
        glow = share * holds / ((works_at + ABSOLUTE) ** 4 - (room + ABSOLUTE) ** 4)
        convection = (1.0 - share) * holds / rise
    else:
        glow, convection, exponent = 0.0, 0.0, float(rng.uniform(1.0, 1.6))
        bent = holds / rise**exponent
    lag = float(rng.uniform(600.0, 4000.0) if kind == "radiation" else rng.uniform(100.0, 400.0))
    capacity = lag * holds / rise
    dead, sensor = lag * float(rng.uniform(0.006, 0.03)), lag * float(rng.choice([0.0, rng.uniform(0.01, 0.03)]))
    plain = Kiln(kind, seed, capacity, convection, glow, bent, exponent, room, dead, sensor,
                 float(rng.uniform(0.05, 0.4)), works_at, 1.0, (), ())
    levels, at = [], []
    for part in (float(rng.uniform(0.25, 0.35)), 0.5):
        levels.append(round(plain.lost(room + part * rise), 1))
        at.append(room + part * rise)
    holds_s = tuple(float(rng.uniform(3.0, 5.0)) * capacity / plain.slope(t) for t in at)
    row_s = max(1.0, round(sum(holds_s) / 2500.0))
    return Kiln(**{**plain.__dict__, "row_s": row_s, "levels": tuple(levels), "holds_s": holds_s})


def log_of(kiln):
    """Return the text of a kiln's log: at rest, then its two powers."""
    rng, running, rows = np.random.default_rng([7, kiln.seed]), Running(kiln), []
    begins = [20.0 * kiln.row_s, 20.0 * kiln.row_s + kiln.holds_s[0]]
    begins = [math.ceil(begin / kiln.row_s) * kiln.row_s for begin in begins]
    power, end = 0.0, begins[1] + kiln.holds_s[1]
    for k in range(int(end / kiln.row_s)):
        now = k * kiln.row_s
        running.run(now)
        for begin, level in zip(begins, kiln.levels, strict=True):
            if abs(now - begin) < 1e-6:
                running.set(level)
                power = level
        rows.append(f"{now:g},{running.seen + rng.normal(0.0, kiln.noise):.1f},{power:g}")
    return "time_s,temperature_degC,power_pct\n" + "\n".join(rows) + "\n"


@dataclass
class Finding:
    """What was found of a kiln.

    Attributes:
        found: whether the fit has a loss curve; else why not.
        power: predicted by true power at the working temperature, each plausible heater, the fit first.
        end: predicted less true end temperature at full power [°C], of a kiln that ends at 900 °C.
        exponent: fitted less true exponent, of that kind.
        ends: target → verdict, or how it ended.
        dangers: sentences.
        seconds: processor time of the fit.
    """

    kind: str
    seed: int
    found: str = ""
    power: tuple = ()
    end: float = math.nan
    exponent: float = math.nan
    ends: dict = None
    dangers: tuple = ()
    seconds: float = 0.0


def judge(kiln, words, setpoint, limit_pct):
    """Return why words are dangerous on a kiln, empty if they are not; the limit is of the overshoot [% of the rise]."""
    law = law_of(words)
    lag = kiln.capacity / kiln.slope(setpoint)
    gain = 1.0 / kiln.slope(setpoint)
    a, b = np.array([[-1.0 / lag]]), np.array([gain / lag])
    if kiln.sensor:
        a, b = np.array([[-1.0 / lag, 0.0], [1.0 / kiln.sensor, -1.0 / kiln.sensor]]), np.array([gain / lag, 0.0])
    plant = truth.sampled(a, b, kiln.dead, law.interval)
    if not truth.stable(plant, law):
        return "unstable"
    ms = truth.peak(plant, law, lag + kiln.dead + kiln.sensor)
    if ms > 2.5:
        return f"Ms {ms:.2f}"
    over = overshoot_pct(kiln, law, setpoint)
    return f"overshoot {over:.1f} % of {limit_pct:g} %" if over > 1.05 * limit_pct else ""


def overshoot_pct(kiln, law, setpoint):
    """Return the overshoot of a heat-up by the limited controller, its integral held at the limits [% of the rise]."""
    running, integral, readings = Running(kiln), 0.0, []
    before = setpoint - kiln.room
    for k in range(math.ceil(8.0 * kiln.capacity / kiln.slope(0.3 * setpoint) / law.interval)):
        y = running.run(k * law.interval)
        readings.append(y)
        e = setpoint - y
        ahead = integral + law.k * (law.i_now * e + law.i_before * before)
        before, wanted = e, law.k * e + ahead
        if 0.0 <= wanted <= 100.0 or (wanted > 100.0) != (ahead > integral):
            integral = ahead
        running.set(min(max(law.k * e + integral, 0.0), 100.0))
    return 100.0 * max(max(readings) - setpoint, 0.0) / (setpoint - kiln.room)


def study(kind, seed, targets=()):
    """Return what is found of the kiln of a kind and seed."""
    kiln, finding = draw(kind, seed), Finding(kind, seed, ends={})
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path = Path(place) / f"{kind}_{seed}.csv"
        path.write_text(log_of(kiln), encoding="utf-8")
        begun = time.process_time()
        fitted = fit(read_log(path))
        finding.seconds = time.process_time() - begun
        finding.found = "loss curve" if has_loss_curve(fitted) else ", ".join(each.name for each in fitted.findings)
        if finding.found == "loss curve":
            models = [each.model for each in fitted.candidates]
            true = kiln.lost(kiln.works_at)
            finding.power = tuple(steady_power_pct(model, kiln.works_at) / true for model in models)
            end = kiln.rests_at(100.0)
            finding.end = (top_degC(models[0]) - end) * (900.0 - kiln.room) / (end - kiln.room)
            curve = models[0].loss
            if kind == "exponent":
                finding.exponent = curve.exponent - kiln.exponent if curve.origin_degC is None else math.inf
        for target in targets:
            finding.ends[target], danger = designed(kiln, fitted, target)
            finding.dangers += (f"{target}: {danger}",) if danger else ()
    return finding


def designed(kiln, fitted, target):
    """Return how a design for the working temperature ends, and why its PASS is dangerous, if it is."""
    span = math.ceil(1.3 * kiln.works_at / 50.0) * 50.0
    asked = DesignRequest(
        target=target, scaling=Scaling(low_degC=0.0, high_degC=span), tune_settings=TuneSettings(structure="pi"),
        conditions=Conditions(setpoint_degC=kiln.works_at, tolerance_degC=0.01 * span), switch_kind="ssr")
    try:
        result = find_passing_design(fitted, asked)
    except HeatertuneError as problem:
        return f"none: {problem}"[:70], ""
    proof = result.proof
    why = [each.name for each in proof.criteria if not each.ok]
    why += [each.name for each in proof.diagnostics.findings if each.kind.effect == "blocks"]
    ending = f"{proof.verdict} {','.join(why)}".strip()
    if proof.verdict != "PASS":
        return ending, ""
    limit = next((each.limit for each in proof.criteria if each.name == "overshoot"), 20.0)
    return ending, judge(kiln, proof.words, kiln.works_at, limit)


def lines_of(findings):
    """Return the lines of a table, and each miss."""
    lines = []
    for kind in KINDS:
        own = [each for each in findings if each.kind == kind]
        if not own:
            continue
        curves = [each for each in own if each.power]
        power = [abs(each.power[0] - 1.0) for each in curves]
        ends = [abs(each.end) for each in curves]
        lines.append(f"{kind}: {len(own)} heaters, {len(curves)} with a loss curve; "
                     f"median CPU {np.median([each.seconds for each in own]):.2f} s, "
                     f"worst {max(each.seconds for each in own):.2f} s")
        if curves:
            inside = [min(each.power) <= 1.0 <= max(each.power) for each in curves]
            lines.append(
                f"  power at the working temperature within 5 %: {100.0 * np.mean(np.array(power) < 0.05):.0f} %, worst "
                f"{100.0 * max(power):.1f} %, within the plausible heaters {100.0 * np.mean(inside):.0f} %; end within "
                f"20 °C of 900: {100.0 * np.mean(np.array(ends) < 20.0):.0f} %, worst {max(ends):.1f} °C")
        if kind == "exponent" and curves:
            apart = [abs(each.exponent) for each in curves]
            lines.append(f"  exponent within 0.05: {100.0 * np.mean(np.array(apart) < 0.05):.0f} %, worst {max(apart):.3f}")
        others = Counter(each.found for each in own if not each.power)
        lines += [f"  {count} without: {name or 'linear'}" for name, count in others.most_common()]
        verdicts = Counter(end for each in own for end in each.ends.values())
        lines += [f"  {count} × {name}" for name, count in verdicts.most_common()]
    lines += [f"DANGEROUS {each.kind} {each.seed}: {danger}" for each in findings for danger in each.dangers]
    return lines


def main(arguments=None):
    """Print what is found; return 1 where a dangerous PASS was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=25, help="heaters of each kind (default: 25)")
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--targets", nargs="*", default=[], help="controllers that a design is made for (default: none)")
    settings = parser.parse_args(arguments)
    findings = []
    for seed in range(settings.first, settings.first + settings.count):
        for kind in settings.kinds:
            findings.append(study(kind, seed, settings.targets))
            last = findings[-1]
            if not last.power or abs(last.power[0] - 1.0) > 0.05 or last.dangers:
                print(f"{kind} {seed}: {last}", file=sys.stderr, flush=True)
    print("\n".join(lines_of(findings)))
    return int(any(each.dangers for each in findings))


if __name__ == "__main__":
    sys.exit(main())

"""Does a PASS hold on a day of events in any order, at any instant? python -m tests.bench.any_order [FIRST LAST [TARGET…]].

Heaters are drawn and designed for (outages.py); "tables" in place of FIRST takes the built-in tables 3 and 4. Each PASS
lives through drawn days under every setting of its open points, the condition held all day: mains at 0.81, 1 or 1.21 of
the power, one of the plausible heaters with its own ambient. Events: setpoint changes, small ones and large ones; open
circuits from a scan to 20 TN, also while the setpoint moves and with a loss of the supply in them; load off and on; cold
goods; restarts from hot to cold. Where calls come late, the one of ten that is missed is drawn. Events fall on sixteenths of a scan, half of them before the loop is at rest. The
controllers' arithmetic and the heater are those of second_opinion.c, which shares nothing with the proof; the day, its
instants and its judgement are of this file.

Held against the design's own limits, with two hundredths and a step of the reading as slack:

- above the setpoint: the largest limit of all events since the loop was last at rest;
- below it, where the setpoint fell from rest;
- after a small change from rest: the limit of small changes, if there is one;
- at the end of each quiet stretch: mean and half swing within the band.

Setpoints lie in the stated range; where no range is stated, from a fifth of the rise above the ambient up. What breaks
below the lowest setpoint that the test sequence holds, or on a rise from there, is counted apart, and so is a way back
from an open circuit below a stated setpoint whose overshoot the proof tells (`outage-below`). Prints a table of all
targets, after each number of a heater; "broken by mains" are those that only days at 0.81 or 1.21 of the power break.
Exit status 1 where a limit is broken other than below.
"""

import ctypes
import math
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from unittest import mock

import numpy as np

from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.plc import controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.prove_words import setpoints_for
from heatertune.proof.redesign import DesignRequest, find_passing_design
from tests.bench import second_opinion
from tests.bench.false_passes import _limits, _log
from tests.bench.outages import Night, bench_of, designs
from tests.bench.second_opinion import FOUND, TARGETS, Part

MAINS = (1.0, 0.81, 1.21)
SLACK = 1.02
RESERVE_PCT = 5.0
FINE = 16  # parts of a scan on which events fall
LOWEST_SHARE = 0.2  # of the rise above the ambient, where no range of setpoints is stated
_MOST_SCANS = 1.2e6
_LONGEST_S = 12 * 3600.0
_SMALL = "small change"
_LIMIT_OF = {"heat-up": "overshoot", "setpoint": "change_overshoot", _SMALL: "change_overshoot",
             "circuit": "reheat_overshoot", "restart": "restart_overshoot", "cold goods": "recovery_overshoot",
             "load": "recovery_overshoot"}


@dataclass
class Day:
    """The events of a day.

    Attributes:
        parts: of second_opinion.py.
        ends: of each part [ticks].
        names: what each part begins with.
        quiet: whether a part lasts until the loop is at rest.
    """

    parts: list = field(default_factory=list)
    ends: list = field(default_factory=list)
    names: list = field(default_factory=list)
    quiet: list = field(default_factory=list)


class DayWriter:
    """Draws the events of a day for a bench, one after the other."""

    def __init__(self, b, low, mains, rng, family):
        """Begin a day.

        Args:
            b: a bench, with the gain at the mains voltage.
            low: lowest setpoint [°C].
            mains: full power as a share of the rated one.
            rng: draws.
            family: benches of all plausible heaters, whose slowest decides how long a loop may take.
        """
        self.b, self.low, self.mains, self.rng, self.day = b, low, mains, rng, Day()
        timings = [Night(each) for each in family]
        self.tn, self.step = max(each.tn for each in timings), b.setpoint - b.ambient
        self.way, self.rest = max(each.way for each in timings), 0.3 * max(each.rest for each in timings)
        self.tick = b.interval / b.ratio[1]
        self.state = {"asked": b.setpoint, "power": 1.0, "supplied": True}
        self.loaded, self.now = False, 0
        self.small = max(0.05 * self.step, 2.0 * b.band)

    def part(self, name, event, seconds=None, value=0.0, **changed):
        """Add an event; without a time it is quiet from then on."""
        self.state.update(changed)
        quiet = seconds is None
        seconds = self.way + self.rest if quiet else min(max(seconds, self.tick), _LONGEST_S)
        self.now += max(1, round(seconds / self.tick))
        self.day.parts.append(Part(event, value, 0.0, self.rest if quiet else 0.0, "any", True, **self.state))
        self.day.ends.append(self.now)
        self.day.names.append(name)
        self.day.quiet.append(quiet)

    def pause(self):
        """Return how long nothing happens after an event [s]; None: until the loop is at rest."""
        return None if self.rng.random() < 0.5 else _log(self.rng, self.tick, 2.0 * self.way)

    def setpoint(self):
        """Return a new setpoint [°C] and what its change is called."""
        b, rng, now = self.b, self.rng, self.state["asked"]
        if rng.random() < 0.4:
            far = self.small * float(rng.uniform(0.6, 2.0)) * (1.0 if rng.random() < 0.5 else -1.0)
            new = now + far if self.low <= now + far <= b.setpoint else now - far
            if self.low <= new <= b.setpoint:
                return new, _SMALL
        new = b.setpoint if rng.random() < 0.35 and now != b.setpoint else float(rng.uniform(self.low, b.setpoint))
        return new, "setpoint"

    def circuit(self):
        """Open the circuit and close it, with events meanwhile."""
        rng = self.rng
        seconds = _log(rng, self.b.interval, 20.0 * self.tn)
        if rng.random() < 0.35:
            self.part("open", "mains", 0.5 * seconds, power=0.0)
            for _ in range(int(rng.integers(1, 3))):
                if rng.random() < 0.75:
                    self.part("open", "setpoint", 0.5 * seconds * float(rng.random()), asked=self.setpoint()[0])
                else:
                    self.part("open", "plc", 0.2 * seconds, supplied=False)
                    self.part("open", "plc", 0.2 * seconds, supplied=True)
        else:
            self.part("open", "mains", seconds, power=0.0)
        self.part("circuit", "mains", self.pause(), power=1.0)

    def restart(self):
        """Take the PLC's supply away and give it back."""
        self.part("off", "plc", _log(self.rng, self.b.interval, second_opinion._takes(self.b, 0.97)), power=0.0,
                  supplied=False)
        self.part("restart", "plc", self.pause(), power=1.0, supplied=True)

    def load(self):
        """Take away up to a tenth of the rated power, or give it back."""
        b = self.b
        most = min(10.0 / self.mains, 100.0 - RESERVE_PCT - (b.setpoint - b.ambient) / b.gain)
        if most <= 0.0:
            return
        self.loaded = not self.loaded
        self.part("load off" if self.loaded else "load", "load", self.pause(), -most if self.loaded else most)

    def goods(self):
        """Let the temperature fall at once, by up to 0.3 of the rise and half of what it is above the ambient."""
        fall = min(0.3 * self.step, 0.5 * (self.state["asked"] - self.b.ambient))
        self.part("cold goods", "temperature-step", self.pause(), -fall * float(self.rng.uniform(0.3, 1.0)))

    def write(self, events):
        """Return a day of so many events, fewer where it has too many scans."""
        self.part("heat-up", "heat-up", self.pause())
        kinds = (self.circuit, self.change, self.restart, self.load, self.goods)
        for kind in self.rng.choice(len(kinds), events, p=(0.35, 0.3, 0.15, 0.1, 0.1)):
            if self.now / self.b.ratio[1] > _MOST_SCANS:
                break
            kinds[kind]()
        self.part("setpoint", "setpoint", None, asked=self.b.setpoint)
        return self.day

    def change(self):
        """Change the setpoint."""
        asked, name = self.setpoint()
        self.part(name, "setpoint", self.pause(), asked=asked)


def compiled(folder):
    """Return the C program; raise FileNotFoundError where there is no compiler."""
    source, library = Path(__file__).with_suffix(".c"), Path(folder) / "any_order.so"
    subprocess.run(["cc", "-O3", "-fno-tree-slp-vectorize", "-ffp-contract=off", "-shared", "-fPIC", "-o", str(library),
                    str(source), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def lived(library, b, day):
    """Return what was measured of each part, highest and lowest of each record [°C], and the first record of each part."""
    place = second_opinion._place
    with mock.patch.object(second_opinion, "story", return_value=day.parts), \
            mock.patch.object(second_opinion, "ends_of", return_value=day.ends):
        _, case, held = second_opinion._prepared(b)
    records = day.ends[-1] // b.ratio[1] + len(day.parts) + 2
    table, highest, lowest = np.zeros((len(day.parts), len(FOUND))), np.zeros(records), np.zeros(records)
    firsts = np.zeros(len(day.parts) + 1, dtype=np.int64)
    if library.any_order(ctypes.byref(case), place(table), place(highest), place(lowest), place(firsts)):
        raise RuntimeError("too many pulses were under way")
    del held
    return [dict(zip(FOUND, row, strict=True)) for row in table.tolist()], highest, lowest, firsts.tolist()


class Judge:
    """Holds the parts of a day against limits, one after the other; `found` is what breaks them."""

    def __init__(self, b, limits):
        self.b, self.limits, self.found = b, limits, []
        self.resolution, self.step = (b.high - b.low) / TARGETS[b.target][1], b.setpoint - b.ambient
        self.since, self.waits, self.asked, self.lowest = [], False, b.ambient, math.inf

    def hear(self, number, part, name, quiet, rest, high, low):
        """Judge a part: highest and lowest of its records [°C], and what was measured at rest."""
        change, self.asked = part.asked - self.asked, part.asked
        self.lowest = min(self.lowest, part.asked)  # since the loop rested, and where it did
        self.since.append(name)
        arrived = self._arrived(change, part.asked, low, quiet)
        if name in ("open", "off"):
            return
        above = float(high[arrived:].max(initial=-math.inf)) - part.asked
        below = part.asked - float(low[arrived:].min(initial=math.inf))
        self._above(number, above)
        if len(self.since) == 1 and change < 0.0:
            self._add(number, self._used(below, "change_overshoot", self.step), "below, change_overshoot")
        if len(self.since) == 1 and name == _SMALL and abs(change) >= max(0.05 * self.step, 2.0 * self.b.band):
            beyond = above if change > 0.0 else below
            self._add(number, self._used(beyond, "small_change_overshoot", abs(change)), "small change")
        if quiet:
            self._at_rest(number, part, rest)

    def _arrived(self, change, asked, low, quiet):
        """Return the record from which on what is above the setpoint is the controller's doing.

        Where the setpoint fell, or power was added, the temperature comes from above.
        """
        self.waits = self.waits or change < 0.0 or self.since[-1] == "load"
        if not self.waits:
            return 0
        there = np.flatnonzero(low <= asked)
        arrived = int(there[0]) if len(there) and self.since[-1] != "load" else len(low)
        self.waits = arrived == len(low) and not quiet
        return arrived

    def _above(self, number, beyond):
        names = [_LIMIT_OF[kind] for kind in self.since if kind in _LIMIT_OF] or ["recovery_overshoot"]
        used = {name: self._used(beyond, name, self.step) for name in names}
        name = min(used, key=used.get)
        self._add(number, used[name], f"above, {name}")

    def _at_rest(self, number, part, rest):
        self._add(number, abs(rest["rest_integral"]) / part.rest / self.b.band, "offset at rest")
        self._add(number, 0.5 * (rest["rest_highest"] - rest["rest_lowest"]) / self.b.band, "swing at rest")
        if max(rest["rest_highest"], -rest["rest_lowest"]) <= self.b.band:
            self.since.clear()
            self.lowest = self.asked

    def _used(self, beyond, name, step):
        """Return how much of a limit is used, a step of the reading left out."""
        share, degrees = self.limits.get(name), self.limits.get(f"{name} in degC")
        most = min(math.inf if share is None else share / 100.0 * step, math.inf if degrees is None else degrees)
        over = max(0.0, beyond - self.resolution)
        return over / most if most > 0.0 else math.inf * (over > 0.0)

    def _add(self, number, used, what):
        if used > SLACK:
            self.found.append((round(used, 3), what, round(self.asked, 2), tuple(self.since[-6:]), number, self.lowest))


def broken(library, b, limits, day):
    """Return what a day breaks: part of the limit used, what, setpoint, events since the loop was at rest, the part."""
    seen, highest, lowest, firsts = lived(library, b, day)
    judge = Judge(b, limits)
    for number, part in enumerate(day.parts):
        records = slice(firsts[number], firsts[number + 1])
        judge.hear(number, part, day.names[number], day.quiet[number], seen[number], highest[records], lowest[records])
    return judge.found


def _at(mains, b, design):
    """Return a bench at a mains voltage, whose events fall on parts of a scan."""
    return replace(b, gain=mains * b.gain, ratio=(FINE * b.ratio[0], FINE * b.ratio[1]),
                   setpoint=design.proof.scenario.setpoint_degC)


def judged(library, fitted, design, seed, *, days=2, events=60):
    """Yield (mains, heater, settings, lowest setpoint of the test sequence, what is broken) of each drawn day.

    Each day has a heater, a setting and a mains voltage of its own; all of each occur once at least.
    """
    models = holding_heaters(fitted, setpoints_for(fitted, design.conditions)[1])
    settings = settings_to_prove(controller_for(design.proof.words.target).switches)
    limits, rng = _limits(design.proof.limits) | {"iae": math.inf}, np.random.default_rng([seed, 20261127])
    late = np.random.default_rng([seed, 20261129])  # which of ten calls is missed where they come late
    powers = [mains for mains in MAINS for _ in range(days)]
    number = max(len(powers), len(models), len(settings))
    draws = zip(*(([*each] * number)[:number] for each in (models, settings, powers)), strict=True)
    for (name, model), setting, mains in draws:
        b, *others = (_at(mains, bench_of(each, design, setting), design)
                      for each in (model, *(other for label, other in models if label != name)))
        if any((each.setpoint - each.ambient) / each.gain > 100.0 - RESERVE_PCT for each in (b, *others)):
            continue
        stated = design.conditions.lowest_degC
        stated = None if stated == design.conditions.highest_degC else stated
        proven = b.setpoint - 0.2 * (b.setpoint - b.ambient) if stated is None else stated
        low = b.ambient + LOWEST_SHARE * (b.setpoint - b.ambient) if stated is None else stated
        if not b.ambient < low < b.setpoint:
            continue
        day = DayWriter(b, low, mains, rng, (b, *others)).write(events)
        b = replace(b, missed=int(late.integers(10)))
        yield mains, name, setting, proven, broken(library, b, limits, day)


def claimed(design, proven, one):
    """Return whether a verdict claims that what a day breaks is kept; see `broken`.

    Args:
        design: that passes.
        proven: lowest setpoint of its test sequence [°C].
        one: what a day breaks.
    """
    _, what, asked, *_, lowest = one
    told = any(finding.name == "outage-below" for finding in design.proof.diagnostics.findings)
    below = asked < (design.proof.scenario.setpoint_degC if told and "reheat" in what else proven) - 1e-9
    return not (below or lowest < proven - 1e-9)


def tables(targets):
    """Yield what `designs` does, of the built-in tables."""
    for table, target in product(("table3", "table4"), targets or TARGETS):
        try:
            fitted = fit(read_log(table), None)
            yield int(table[-1]), target, fitted, find_passing_design(fitted, DesignRequest(target=target))
        except HeatertuneError as problem:
            print(table, target, problem)
            yield int(table[-1]), target, None, None


#: columns of the table: what is counted of each target
_COUNTED = ("drawn", "refused", "PASS", "broken", "broken by mains", "broken below")


def table_of(counts):
    """Return the lines of a table of counts by (target, column), see `_COUNTED`, with their sum."""
    targets = [target for target in TARGETS if counts[target, "drawn"]]
    rows = [(target, *(counts[target, column] for column in _COUNTED)) for target in targets]
    rows.append(("all", *(sum(numbers) for numbers in list(zip(*rows, strict=True))[1:])))
    head = "| target | " + " | ".join(_COUNTED) + " | PASS share |"
    return [head, "| --- |" + " --- |" * (len(_COUNTED) + 1),
            *("| " + " | ".join(map(str, row)) + f" | {row[3] / max(1, row[1] - row[2]):.0%} |" for row in rows)]


def _judge_design(library, fitted, design, seed, target, counts, kinds):
    """Enter what the days of a design break into the counts, and print it."""
    within, below = [], []
    for mains, name, setting, low, found in judged(library, fitted, design, seed):
        for each in found:
            (within if claimed(design, low, each) else below).append((mains, name, setting, each))
    counts[target, "PASS"] += 1
    counts[target, "broken"] += bool(within)
    counts[target, "broken by mains"] += bool(within) and all(mains != 1.0 for mains, *_ in within)
    counts[target, "broken below"] += bool(below) and not within
    for bad, where, most in ((within, "in range", 3), (below, "below the range", 2)):
        for each in sorted(bad, key=lambda one: -one[3][0])[:most]:
            print(seed, target, where, each, flush=True)
        kinds.update((target, one[1], one[3][-1], where) for *_, one in bad)
    print(seed, target, f"{len(within)} in range, {len(below)} below" if within or below else "ok", flush=True)


def main(first=0, last=6, *targets):
    counts, kinds, before = Counter(), Counter(), None
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        drawn = tables((last, *targets) if last != 6 else ()) if first == "tables" else designs(first, last, targets, folder)
        for seed, target, fitted, design in drawn:
            if before not in (None, seed):
                print(*table_of(counts), sep="\n", flush=True)
            before = seed
            counts[target, "drawn"] += 1
            counts[target, "refused"] += design is None
            if design is not None and design.proof.verdict == "PASS":
                _judge_design(library, fitted, design, seed, target, counts, kinds)
            else:
                why = "refused" if design is None else f"{design.proof.verdict}: {', '.join(design.proof.shortfalls)}"
                print(seed, target, why, flush=True)
    for each, number in kinds.most_common():
        print(number, *each)
    print(*table_of(counts), sep="\n")
    return any(number for (_, column), number in counts.items() if column == "broken")


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

"""Sessions of look → write → read back → watch on the virtual PLC, with faults of the link, the plant and of people.

    python -m tests.bench.sessions [SESSIONS] [SEED]

Judged by what stood in the PLC's own memory at each instant, with nothing of heatertune's that writes: where the words
are, what they may be, and whether a set of them is stable, is said here anew. Ends with status 1 where a word is wrong,
a report says what is not so, or a write went out blind.
"""

import collections
import dataclasses
import json
import os
import random
import struct
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from heatertune import virtual_plc
from heatertune.cli import main as command
from heatertune.live.change.apply import applied
from heatertune.live.change.guard import Said
from heatertune.live.change.peer import Link
from heatertune.live.change.plan import Wanted
from heatertune.live.change.proven import Proven, read_proven
from heatertune.live.client.address import address_of
from heatertune.live.faults import fault_of
from heatertune.live.serve import read_folder

SESSIONS = 10_000
#: OB251's words that a write may touch → their first byte (manual, table 11-11: DW1, DW3, …; of DW11 the low byte)
PLACES = {"K": 2, "R": 6, "TI": 10, "TD": 14, "YH": 24, "BGOG": 28, "BGUG": 32}
STEU = 23
#: words that a PLC is found with; all of them hold the heater, which is what a session needs of them
FOUND = ({"K": 3000, "TI": 30}, {"K": 4000, "TI": 57, "YH": 200}, {"K": 5680, "TI": 40}, {"K": 2000, "TI": 20, "BGOG": 1500},
         {"K": 5000, "TI": 50, "YH": 100, "BGOG": 1800}, {"YH": 300}, {"K": 1500, "TI": 57, "BGUG": 10},
         {"K": 1200, "TI": 110}, {"K": 800, "TI": 140, "YH": 10})  # of these K first would be unstable
GAIN, LAG_S, DEAD_S, TA_S, MS = 0.9, 167.0, 12.0, 3.1, 2.2
#: with the simulator's time of 1 ms a scan a session takes about 100 scans without its watch
RATE = 3100.0
#: so that the link that fails stands between, whatever will fail
ALWAYS = "t=1e9 cut"
LINK = Link(tries=3, pause_s=0.004, timeout_s=0.05)
OF_LINK = ("cut", "black-hole", "lost-reply", "late-reply=2", "late-reply=40", "torn")
OF_PEOPLE = ("word K=4500", "word K=100", "word TI=30", "word TI=57", "word YH=77", "word BGOG=2000", "word TD=1", "word K=5680",
             "cpu-stop", "db-missing", "db-short", "write-protected")
MAY_HIDE = ("cut", "black-hole", "lost-reply", "late-reply", "db-missing", "db-short")
OF_PLANT = ("sensor-off", "heater-open", "stuck-on", "sensor-frozen", "ambient=30")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Known(Proven):
    """Words and their proof; what was found out of other values is kept."""

    found: dict = dataclasses.field(default_factory=dict)

    def open_in_between(self, values):
        key = tuple(sorted(values.items()))
        if key not in self.found:
            self.found[key] = Proven.open_in_between(self, values)
        return self.found[key]


def folder_in(place, target="s5-ob251"):
    """Return a folder with words and their proof, as the commands make it."""
    out = Path(place) / "out"
    heater = ("--gain", str(GAIN), "--time-constant", str(LAG_S), "--dead-time", str(DEAD_S), "--ambient", "22", "--target", target)
    out.mkdir()
    stdout, sys.stdout = sys.stdout, Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - closed below
    try:
        assert command(["tune", *heater, "-o", str(out / "pid.json"), "--quiet"]) == 0
        assert command(["export-db", str(out / "pid.json"), "--target", target, "--setpoint", "50", "-o", str(out),
                        "--quiet"]) == 0
    finally:
        sys.stdout.close()
        sys.stdout = stdout
    return out


def words_in(image):
    """Return the words in the block's bytes."""
    words = {name: struct.unpack_from(">h", image, place)[0] for name, place in PLACES.items()}
    return words | {"STEU": image[STEU]}


def is_stable(words):
    """Return whether a textbook's loop with these words is, with a delay of half a sample more: Ms <= 2.2."""
    gain, integral, derivative = words["K"] / 1024 * words["R"] / 1024, words["TI"], words["TD"]
    if gain <= 0 or integral <= 0:
        return False
    tn, tv = words["R"] * TA_S / integral, derivative * TA_S * 1024 / words["R"]
    s = 1j * np.logspace(-4, np.log10(np.pi / TA_S), 4000)
    loop = gain * (1 + 1 / (tn * s) + tv * s) * GAIN * np.exp(-s * (DEAD_S + 0.48 + 0.5 * TA_S)) / (LAG_S * s + 1)
    turns = np.unwrap(np.angle(loop))
    crossing = np.flatnonzero(np.abs(loop) < 1)
    return bool(turns[crossing[0]] > -np.pi and np.max(1 / np.abs(1 + loop)) <= MS)


class Witness:
    """What happens in a PLC's memory, in order: ("read", image), ("client", start, bytes, image), ("other", image)."""

    def __init__(self, plc, armed):
        memory = plc.memory
        self.events, self._memory, self._plc = [], memory, plc
        self._armed, self._requests = list(armed), 0
        self._read, self._write, self._put = memory.read, memory.write, memory.put
        memory.read, memory.write, memory.put = self.read, self.write, self.put

    def _asked(self):
        """Let begin, in this very moment, what was to begin with this request."""
        self._requests += 1
        while self._armed and self._armed[0][0] <= self._requests:
            _, fault = self._armed.pop(0)
            now = self._plc.intervals * TA_S
            here = dataclasses.replace(fault, begins_s=now, ends_s=now + fault.ends_s)
            self._plc._plan = dataclasses.replace(self._plc._plan, faults=(*self._plc._plan.faults, here))
            self._plc._there = (*self._plc._there, here)

    def read(self, number, start, count):
        self._asked()
        with self._memory.changed:
            found = self._read(number, start, count)
            if number == self._memory.main:
                self.events.append(("read", self._memory.image()))
            return found

    def write(self, number, start, content):
        self._asked()
        with self._memory.changed:
            self._write(number, start, content)
            if number == self._memory.main:
                self.events.append(("client", start, bytes(content), self._memory.image()))

    def put(self, before, after, part=slice(None), **more):
        with self._memory.changed:
            was = words_in(self._memory.image())
            self._put(before, after, part, **more)
            if words_in(image := self._memory.image()) != was:
                self.events.append(("other", image))


def drawn(chance):
    """Return what goes wrong: on a timetable, and (number of the request, fault), which begins with that request."""
    timed, armed = [], []
    for _ in range(chance.choice((0, 1, 1, 2, 3))):
        name = chance.choice(chance.choice((OF_LINK, OF_LINK, OF_PEOPLE, OF_PEOPLE, OF_PLANT)))
        lasts = 1e9 if chance.random() < 0.3 else 10 ** chance.uniform(0.5, 2.8)
        if chance.random() < 0.25:
            timed.append(f"t={(begin := chance.uniform(6.0, 400.0)):.1f} {name} until={begin + lasts:.1f}")
        else:
            armed.append((chance.randint(3, 34), fault_of(f"t=0 {name} until={lasts:.1f}")))
    return timed, sorted(armed, key=lambda one: one[0])


def session(proven, model, conditions, chance, place):
    """Run one; return how it ended, and what is wrong with it."""
    found = dataclasses.replace(proven.words, values={**proven.words.values, **chance.choice(FOUND)})
    protocol, (timed, armed) = chance.choice(("s7", "modbus")), drawn(chance)
    faults = [*map(fault_of, timed), *(fault for _, fault in armed)]
    with virtual_plc(found, model, conditions, serve=protocol, rate=RATE, faults=[*timed, ALWAYS]) as plc:
        witness = Witness(plc.plc, armed)
        before = words_in(plc.plc.memory.image())
        host, port = plc.addresses[protocol]
        wanted = Wanted(
            proven=proven, address=address_of(f"{protocol}://{host}:{port}" + {"s7": "/0/2/db30", "modbus": "/1"}[protocol]),
            said=Said(range_degC=(0.0, 100.0)), link=LINK, watch=chance.random() < 0.3, record=place / f"{chance.random()}.jsonl",
            most_writes=10 ** 9)
        done = applied(wanted, proven.yes)
        with plc.plc.memory.changed:
            events, last = list(witness.events), words_in(plc.plc.memory.image())
    wrong = judged(done, before, {**before, **{n: v for n, v in proven.words.values.items() if n in before}}, events, last, faults)
    return done.ended.outcome.value, [f"{timed} {armed}: {done.ended.outcome}: {one}; {done.ended.told}" for one in wrong]


def judged(done, before, after, events, last, faults):  # noqa: C901, PLR0912 - a list of what must hold
    """Yield what is wrong with a session."""
    outcome, told = done.ended.outcome.value, done.ended.stands
    others = collections.defaultdict(set)
    was, foreign_last, mine, looked, alone = dict(before), {}, {}, True, True
    for event in events:
        now = words_in(event[-1])
        if event[0] == "read":
            looked = True
        elif event[0] == "client":
            if not looked:
                yield f"a write of {event[2].hex()} at byte {event[1]} without a look before it"
            looked = False
            changed = {name for name in now if now[name] != was[name]}
            mine |= {name: now[name] for name in changed}
            if wrong := [name for name in changed if now[name] not in {before[name], after[name]} | others[name]]:
                yield f"{wrong} were given values of neither side"
            if alone and not is_stable(now):
                yield f"an unstable set of words in between: {now}"
        else:
            alone = False
            for name in now:
                if now[name] != was[name]:
                    others[name].add(now[name])
                    foreign_last[name] = now[name]
                    mine.pop(name, None)
        was = now
    reads = [words_in(event[-1]) for event in events if event[0] == "read"]
    if told is not None and any(told[name] != reads[-1][name] for name in before):
        yield f"said to stand there: {told}; read last: {reads[-1]}"
    if outcome != "unknown" and told is None and mine:
        yield "words were changed, and nothing is said of what stands there"
    if "nothing was sent" in done.ended.told and any(event[0] == "client" for event in events):
        yield "something was sent"
    if outcome == "done" and any(reads[-1][name] != after[name] for name in before):
        yield f"done, but there stands {reads[-1]}"
    for name in before:
        if last[name] not in {before[name], after[name]} | others[name]:
            yield f"{name} = {last[name]} is nobody's"
        if outcome in ("not done", "rolled back") and name in mine and mine[name] == last[name] == after[name] != before[name]:
            yield f"{name} = {last[name]} was left behind"
    if outcome == "unknown" and not any(fault.name in MAY_HIDE for fault in faults):
        yield "unknown without a fault of the link"
    if done.record is not None:
        lines = [json.loads(line) for line in done.record.read_text().splitlines()]
        if lines[-1]["step"] != "end" or lines[-1]["outcome"] != outcome:
            yield "the record has another end"
        if words_in(bytes(lines[0]["begin"]) + done.record.with_suffix(".before.bin").read_bytes()) != words_in(
                next(event[-1] for event in events if event[0] == "read")) and alone:
            yield "the backup is not what stood there"


def run(sessions, seed, place, told=print):
    """Run sessions; return how often each end came, and what is wrong."""
    place = Path(place)
    os.environ["HEATERTUNE_STATE"] = str(place / "state")
    out = folder_in(place)
    whole = read_proven(out)
    proven = Known(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(whole)})
    _, model, conditions = read_folder(out)
    ends, wrong, chance, begun = collections.Counter(), [], random.Random(seed), time.monotonic()
    for number in range(sessions):
        one = random.Random(chance.random())
        end, bad = session(proven, model, conditions, one, place)
        ends[end] += 1
        wrong += [f"session {number}: {each}" for each in bad]
        for each in wrong[-len(bad):] if bad else ():
            told(each)
        for path in place.glob("0.*"):
            path.unlink()
        if number % 200 == 199:
            told(f"{number + 1} sessions in {time.monotonic() - begun:.0f} s: {dict(ends)}, {len(wrong)} wrong")
    return ends, wrong


def main(sessions, seed):
    """Print how they ended; return 1 where one is wrong."""
    with tempfile.TemporaryDirectory() as place:
        ends, wrong = run(sessions, seed, place)
    print(f"{sessions} sessions: {', '.join(f'{count} {end}' for end, count in ends.most_common())}; {len(wrong)} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(*(int(given) for given in (sys.argv[1:] + [str(SESSIONS), "1"][len(sys.argv) - 1:]))))

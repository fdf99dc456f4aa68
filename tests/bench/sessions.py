"""Sessions of record → write → read back → watch on the virtual PLC, with faults of the link, the plant and of people.

    python -m tests.bench.sessions [SESSIONS] [SEED] [FIGURES.json]

Judged by what stood in the PLC's own memory at each instant, with nothing of heatertune's that writes: where the words
are, what they may be, and whether a set of them is stable, is said here anew. Ends with status 1 where a word is wrong,
a report says what is not so, a row of a recording is none of the memory's, or a write went out blind. The file of the
figures is written as it goes, and a run that was stopped goes on from it.
"""

import collections
import dataclasses
import json
import os
import random
import struct
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from heatertune import virtual_plc
from heatertune.cli import main as command
from heatertune.errors import LinkError
from heatertune.live import hold, recorder
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import places_of
from heatertune.live.plc import fault_of
from heatertune.live.serve import read_folder
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus
from heatertune.live.write import writer
from heatertune.live.write.apply import WriteRequest, apply_write
from heatertune.live.write.plc_block import LinkSettings
from heatertune.live.write.proven_words import Declared, ProvenWords, read_proven

SESSIONS = 10_000
GAIN, LAG_S, DEAD_S, TA_S, MS = 0.9, 167.0, 12.0, 3.2, 2.2  # TA of s5-ob251; others may be designed with another one
#: with the simulator's time of 1 ms a scan a session takes about 100 scans without its watch
RATE = 3100.0
#: so that the link that fails stands between, whatever will fail
ALWAYS = "t=1e9 cut"
LINK = LinkSettings(tries=3, pause_s=0.004, timeout_s=0.05)
OF_LINK = ("cut", "black-hole", "lost-reply", "late-reply=2", "late-reply=40", "torn")
#: a gateway between, which keeps, repeats, overtakes, or answers from a copy
OF_GATEWAY = ("late-request=30", "late-request=5", "duplicate=20", "reordered=25", "cached=25", "cached=3")
#: a device that keeps something else than was written
OF_DEVICE = ("half-taken", "clamped=60")
OF_PEOPLE = ("cpu-stop", "db-missing", "db-short", "write-protected")
MAY_HIDE = ("cut", "black-hole", "lost-reply", "late-reply", "db-missing", "db-short", "late-request", "duplicate", "reordered", "cached")
NO_FAULT = "unknown without a fault of the link"
#: names of those that keep what was sent
LATE = ("late-request", "duplicate", "reordered", "cached")
OF_PLANT = ("sensor-off", "heater-open", "stuck-on", "sensor-frozen", "ambient=30")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A controller in a PLC: where its words are, by its manual, and what a session needs to know of it.

    Attributes:
        ways: protocol → end of the address.
        places: word that a write may touch → its first byte, and how it stands there.
        shown: of temperature, power and setpoint the same, and what one of it is.
        found: words that a PLC is found with; all of them hold the heater.
        people: what somebody else writes.
        pid: words → K [%/°C], 1/TN [1/s], TV [s].
        more: options of its design.
        over: protocols over which the recorder asks for other bytes than the writer, so that both can be told apart.
    """

    ways: Mapping[str, str]
    places: Mapping[str, tuple[int, str]]
    shown: tuple[tuple[int, str, float], ...]
    found: tuple[Mapping[str, float], ...]
    people: tuple[str, ...]
    pid: Callable[[Mapping[str, float]], tuple[float, float, float]]
    more: tuple[str, ...] = ()
    over: tuple[str, ...] = ()


def _of_ob251(words):
    r = words["R"]
    return words["K"] / 1024 * r / 1024, words["TI"] / (r * TA_S), words["TD"] * TA_S * 1024 / r


def _reals(first, *names):
    """Return places of REALs that stand one after the other."""
    return {name: (first + 4 * number, ">f") for number, name in enumerate(names)}


KINDS = {
    # manual, table 11-11: DW1, DW3, …; of DW11 the low byte; W DW9, X DW22, YA DW48
    "s5-ob251": Kind(
        ways={"s7": "/0/2/db30", "modbus": "/1", "opcua": "/db30"}, over=("s7", "modbus"),
        places={name: (at, ">h") for name, at in {"K": 2, "R": 6, "TI": 10, "TD": 14, "YH": 24, "BGOG": 28, "BGUG": 32}.items()}
        | {"STEU": (23, ">B")},
        shown=((44, ">h", 100 / 2047), (96, ">h", 100 / 2047), (18, ">h", 100 / 2047)),
        found=({"K": 3000, "TI": 30}, {"K": 4000, "TI": 57, "YH": 200}, {"K": 5680, "TI": 40}, {"K": 2000, "TI": 20, "BGOG": 1500},
               {"K": 5000, "TI": 50, "YH": 100, "BGOG": 1800}, {"YH": 300}, {"K": 1500, "TI": 57, "BGUG": 10},
               {"K": 1200, "TI": 110}, {"K": 800, "TI": 140, "YH": 10}),  # of these K first would be unstable
        people=("word K=4500", "word K=100", "word TI=30", "word TI=57", "word YH=77", "word BGOG=2000", "word TD=1", "word K=5680"),
        pid=_of_ob251),
    # the block's interface in the manual's order from register 0 on, a REAL in two registers
    "weg": Kind(
        ways={"modbus": "/1"}, more=("--assume", "anti_windup=clamp"),
        places=_reals(16, "MinimumOutput", "MaximumOutput", "Kp", "Ki", "Kd", "TauSetPoint")
        | {"Type": (40, ">H"), "Action": (42, ">H"), "Ts": (44, ">H")},
        shown=((12, ">f", 1.0), (48, ">f", 1.0), (2, ">f", 1.0)),
        found=({"Kp": 3.0, "Ki": 0.0125}, {"Kp": 2.5, "Kd": 2.0}, {"MaximumOutput": 80.0, "TauSetPoint": 20.0},
               {"Kp": 1.2, "Ki": 0.04}, {"Ki": 0.011, "MaximumOutput": 90.0}),
        people=("word Kp=4.5", "word Kp=0.1", "word Ki=0.01", "word MaximumOutput=95", "word Ts=3200"),
        pid=lambda words: (words["Kp"], words["Ki"], words["Kd"])),
    # SP, PV, XOUT, X0, AUTO, RUN, then the words, in two registers each
    "iec-pid": Kind(
        ways={"modbus": "/1/2048"}, over=("modbus",), places=_reals(24, "KP", "TR", "TD", "XMIN", "XMAX") | {"CYCLE": (44, ">i")},
        shown=((4, ">f", 1.0), (8, ">f", 1.0), (0, ">f", 1.0)),
        found=({"KP": 3.0, "TR": 80.0}, {"KP": 2.5, "TD": 2.0}, {"XMAX": 80.0}, {"KP": 1.2, "TR": 25.0}, {"TR": 90.0, "XMAX": 90.0}),
        people=("word KP=4.5", "word KP=0.1", "word TR=100", "word XMAX=95", "word TD=1"),
        pid=lambda words: (words["KP"], 1 / words["TR"] if words["TR"] else 0.0, words["TD"])),
    # instance data block of the tip's FB: PV, SP, OUT at 2, 4, 6; GAIN in % of the range per % of it, times in ms
    "s7-300": Kind(
        ways={"s7": "/0/2/db100", "modbus": "/1"}, over=("s7", "modbus"), places=_reals(10, "GAIN", "RATE", "RESET", "SAMPLE"),
        shown=((2, ">h", 100 / 27648), (6, ">h", 100 / 27648), (4, ">h", 100 / 27648)),
        found=({"GAIN": 3.0, "RESET": 80000.0}, {"GAIN": 2.5, "RATE": 2000.0}, {"RESET": 90000.0}, {"GAIN": 1.2, "RESET": 25000.0}),
        people=("word GAIN=4.5", "word GAIN=0.1", "word RESET=100000", "word RATE=500"),
        pid=lambda words: (words["GAIN"], 1000 / words["RESET"] if words["RESET"] else 0.0, words["RATE"] / 1000)),
    # the global block beside the instance
    "pid-compact": Kind(
        ways={"s7": "/0/1/db1", "opcua": "/db1"}, over=("s7",),
        places=_reals(12, "Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle", "OutputUpperLimit", "OutputLowerLimit")
        | {"IntegralResetMode": (48, ">h")},
        shown=((4, ">f", 1.0), (8, ">f", 1.0), (0, ">f", 1.0)),
        found=({"Gain": 3.0, "Ti": 80.0}, {"Gain": 2.5, "Td": 2.0}, {"OutputUpperLimit": 80.0, "PWeighting": 0.8}, {"Gain": 1.2, "Ti": 25.0}),
        people=("word Gain=4.5", "word Gain=0.1", "word Ti=100", "word OutputUpperLimit=95", "word PWeighting=0.5"),
        pid=lambda words: (words["Gain"], 1 / words["Ti"] if words["Ti"] else 0.0, words["Td"])),
}
OB251 = KINDS["s5-ob251"]
#: target and protocol → how often of a hundred; an OPC UA server takes a second to stand
SHARES = {("s5-ob251", "s7"): 48, ("s5-ob251", "modbus"): 14, ("s5-ob251", "opcua"): 2, ("weg", "modbus"): 9, ("iec-pid", "modbus"): 9,
          ("s7-300", "s7"): 8, ("s7-300", "modbus"): 3, ("pid-compact", "s7"): 5, ("pid-compact", "opcua"): 2}
SCHEMES = {"opcua": "opc.tcp"}


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Known(ProvenWords):
    """Words and their proof; what was found out of other values is kept."""

    found: dict = dataclasses.field(default_factory=dict)

    def open_in_between(self, values):
        key = tuple(sorted(values.items()))
        if key not in self.found:
            self.found[key] = ProvenWords.open_in_between(self, values)
        return self.found[key]


def folder_in(place, target="s5-ob251", setpoints=("50",)):
    """Return a folder with words and their proof, as the commands make it, for a setpoint or the ends of a range."""
    out = Path(place) / "out"
    out.parent.mkdir(exist_ok=True)
    heater = ("--gain", str(GAIN), "--time-constant", str(LAG_S), "--dead-time", str(DEAD_S), "--ambient", "22", "--target", target)
    more = KINDS[target].more if target in KINDS else ()
    out.mkdir()
    stdout, sys.stdout = sys.stdout, Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - closed below
    try:
        assert command(["tune", *heater, *more, "-o", str(out / "pid.json"), "--quiet"]) == 0
        assert command(["export-db", str(out / "pid.json"), "--target", target, "--setpoint", *setpoints, *more, "-o", str(out),
                        "--quiet"]) == 0
    finally:
        sys.stdout.close()
        sys.stdout = stdout
    return out


def words_in(image, kind=OB251):
    """Return the words in the block's bytes."""
    return {name: struct.unpack_from(form, image, at)[0] for name, (at, form) in kind.places.items()}


def shown_in(image, kind):
    """Return temperature, power and setpoint in the block's bytes, in the digits of a recording."""
    return tuple(f"{struct.unpack_from(form, image, at)[0] * one:.7g}" for at, form, one in kind.shown)


def is_stable(words, kind=OB251, scan_s=TA_S):
    """Return whether a textbook's loop with these words is, with a delay of half a sample more: Ms <= 2.2."""
    gain, integral, derivative = kind.pid(words)
    if gain <= 0 or integral <= 0:
        return False
    s = 1j * np.logspace(-4, np.log10(np.pi / scan_s), 4000)
    loop = gain * (1 + integral / s + derivative * s) * GAIN * np.exp(-s * (DEAD_S + 0.48 + 0.5 * scan_s)) / (LAG_S * s + 1)
    turns = np.unwrap(np.angle(loop))
    crossing = np.flatnonzero(np.abs(loop) < 1)
    return bool(turns[crossing[0]] > -np.pi and np.max(1 / np.abs(1 + loop)) <= MS)


class Witness:
    """What happens in a PLC's memory, in order: ("read", part, image), ("client", start, bytes, image), ("late", start, bytes, image), ("other", image).

    `shown` has what stood there to be recorded after each scan, and until the next one; `scan_s` is how long one is [s].
    """

    def __init__(self, plc, armed, kind):
        memory = plc.memory
        self.events, self.times, self.shown = [], [], collections.defaultdict(set)
        self._memory, self._plc, self._kind = memory, plc, kind
        self._armed, self._requests, self._scan = list(armed), 0, 0
        self._read, self._write, self._put, self._carry_out = memory.read, memory.write, memory.write_changes, memory.carry_out
        with memory.changed:  # scans may have been run before there was a witness
            memory.read, memory.write, memory.write_changes, memory.carry_out = self.read, self.write, self.put, self.carry_out
            own = SimulatorStatus(self._read(OWN, 0, OWN_LENGTH))
            self._scan, self.scan_s = own.shown, own.interval_s
            self._seen()

    def _asked(self):
        """Let begin, in this very moment, what was to begin with this request."""
        self._requests += 1
        while self._armed and self._armed[0][0] <= self._requests:
            _, fault = self._armed.pop(0)
            now = self._plc.intervals * self.scan_s
            here = dataclasses.replace(fault, begins_s=now, ends_s=now + fault.ends_s)
            self._plc._plan = dataclasses.replace(self._plc._plan, faults=(*self._plc._plan.faults, here))
            self._plc._there = (*self._plc._there, here)

    def _happened(self, *event):
        self.events.append(event)
        self.times.append(time.monotonic())

    def _seen(self):
        image = self._memory.image()
        self.shown[self._scan].add(shown_in(image, self._kind))
        return image

    def read(self, number, start, count):
        self._asked()
        with self._memory.changed:
            found = self._read(number, start, count)
            if number == self._memory.main:
                self._happened("read", (start, count), self._memory.image())
            return found

    def write(self, number, start, content):
        self._asked()
        with self._memory.changed:
            self._write(number, start, content)
            if number == self._memory.main:
                self._happened("client", start, bytes(content), self._seen())

    def carry_out(self, start, content):
        with self._memory.changed:
            self._carry_out(start, content)
            self._happened("late", start, bytes(content), self._seen())

    def put(self, before, after, part=slice(None), *, scan_of=None):
        with self._memory.changed:
            was = words_in(self._memory.image(), self._kind)
            self._put(before, after, part, scan_of=scan_of)
            self._scan = self._scan if scan_of is None else scan_of
            if words_in(image := self._seen(), self._kind) != was:
                self._happened("other", image)


def drawn(chance, kind, most):
    """Return what goes wrong: on a timetable, and (number of the request, fault), which begins with that request."""
    timed, armed = [], []
    for _ in range(chance.choice((0, 1, 1, 2, 3))):
        name = chance.choice(chance.choice((OF_LINK, OF_GATEWAY, OF_GATEWAY, OF_PEOPLE + kind.people, OF_PEOPLE + kind.people, OF_PLANT, OF_DEVICE)))
        lasts = 1e9 if chance.random() < 0.3 else 10 ** chance.uniform(0.5, 2.8)
        if chance.random() < 0.25:
            timed.append(f"t={(begin := chance.uniform(6.0, 400.0)):.1f} {name} until={begin + lasts:.1f}")
        else:
            armed.append((chance.randint(3, most), fault_of(f"t=0 {name} until={lasts:.1f}")))
    return timed, sorted(armed, key=lambda one: one[0])


class Recording:
    """A recording of a session, before the write, and over it where the two can be told apart."""

    def __init__(self, address, words, path, seconds, *, over):
        self.path, self.failed, self.broken = path, False, ""
        self._address, self._words, self._seconds, self._ends = address, words, seconds, threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True) if over else None
        (self._thread.start if self._thread else self._run)()

    def _run(self):
        given = recorder.RecordingSetup(for_s=None if self._thread else self._seconds, timeout_s=LINK.timeout_s)
        begun = time.monotonic()
        try:
            recorder.record(self._address, self.path, places_of(self._words), given,
                            ended=lambda: self._ends.is_set() or (time.monotonic() > begun + 0.1 and not self._thread))
        except LinkError:
            self.failed = True
        except BaseException as problem:
            self.broken = repr(problem)

    def end(self):
        self._ends.set()
        if self._thread:
            self._thread.join()

    def judged(self, shown, scan_s):
        """Yield what is wrong with the file; `shown` is what stood there after each scan, `scan_s` how long one is [s]."""
        if self.broken:
            yield f"the recording broke: {self.broken}"
        if not self.path.exists():
            if not self.failed:
                yield "no file of the recording"
            return
        text, before = self.path.read_text(), -1
        if not text.endswith("\n"):
            yield "the recording ends within a line"
        for line in text.splitlines():
            if line.startswith(("#", "time_s")):
                continue
            at, *row = line.split(",")
            scan = round(float(at) / scan_s) + 1
            if scan <= before:
                yield f"{line!r}: not after scan {before}"
            if tuple(row) not in shown[scan]:
                yield f"{line!r}: not what stood there after scan {scan}, {sorted(shown[scan])}"
            before = scan

    @property
    def rows(self):
        """How many it has."""
        return sum(line[:1].isdigit() for line in self.path.read_text().splitlines()) if self.path.exists() else 0


class Pulse:
    """Measures how long this machine let a thread wait that wanted to run.

    Attributes:
        longest_s: at most [s].
    """

    def __enter__(self):
        self.longest_s, self._ends = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ends.set()
        self._thread.join()

    def _run(self):
        last_s = time.monotonic()
        while not self._ends.wait(0.005):
            now_s = time.monotonic()
            self.longest_s, last_s = max(self.longest_s, now_s - last_s - 0.005), now_s


def session(target, protocol, made, chance, place):
    """Run one; return how it ended, what it took, and what is wrong with it."""
    kind, (proven, model, conditions) = KINDS[target], made
    there = {name: struct.unpack(form := kind.places[name][1], struct.pack(form, value))[0]
             for name, value in chance.choice(kind.found).items()}
    found = dataclasses.replace(proven.words, values={**proven.words.values, **there})
    over, first = protocol in kind.over and chance.random() < 0.3, chance.random() < 0.9
    timed, armed = drawn(chance, kind, 34 + 30 * (over + first))
    faults = [*map(fault_of, timed), *(fault for _, fault in armed)]
    name, logs = str(chance.random()), []
    with Pulse() as pulse, virtual_plc(found, model, conditions, serve=protocol, rate=RATE, faults=[*timed, ALWAYS]) as plc:
        witness = Witness(plc.plc, armed, kind)
        host, port = plc.addresses[protocol]
        address = address_of(f"{SCHEMES.get(protocol, protocol)}://{host}:{port}{kind.ways[protocol]}")
        if first:
            logs.append(Recording(address, found, place / f"{name}.csv", chance.uniform(4, 10) * witness.scan_s, over=False))
        with plc.plc.memory.changed:
            begun, before = len(witness.events), words_in(plc.plc.memory.image(), kind)
        if over:
            logs.append(Recording(address, found, place / f"{name}.over.csv", 0, over=True))
        wanted = WriteRequest(
            proven_words=proven, address=address, declared=Declared(range_degC=(0.0, 100.0), called_every_s=witness.scan_s), link=LINK,
            watch=chance.random() < 0.3, record=place / f"{name}.jsonl", most_writes=10 ** 9)
        done = apply_write(wanted, proven.yes)
        for log in logs:
            log.end()
        if any(fault.name in LATE for fault in faults):  # what a gateway keeps has arrived, or is to arrive never
            plc.plc.wait(hold.LATE_S)
        with plc.plc.memory.changed:
            events, times = witness.events[begun:], witness.times[begun:]
            last = words_in(plc.plc.memory.image(), kind)
    after = {**before, **{n: v for n, v in proven.words.values.items() if n in before}}
    story = Story(kind, witness.scan_s, done, before, after, events, last, faults)
    wrong = [*judged(story), *(one for log in logs for one in log.judged(witness.shown, witness.scan_s)
                                  if not any(fault.name == "cached" for fault in faults))]  # a copy is of another scan
    if pulse.longest_s > 0.5 * LINK.timeout_s:  # nobody ran who could have answered in time
        wrong = [one for one in wrong if one != NO_FAULT]
    took = {"rows": sum(log.rows for log in logs), **took_back(story, done, times)}
    said = f"{target} {protocol} {timed} {armed}: {done.end.outcome}"
    return done.end.outcome.value, took, [f"{said}: {one}; {done.end.message}" for one in wrong]


@dataclasses.dataclass(frozen=True, slots=True)
class Story:
    """A session that is over: words before and as they were to be, what happened meanwhile, and what stood there last."""

    kind: Kind
    scan_s: float
    done: object
    before: Mapping[str, float]
    after: Mapping[str, float]
    events: list
    last: Mapping[str, float]
    faults: list

    def looks(self, event):
        """Return whether it is a read of all words, which a recording's is not."""
        if event[0] != "read":
            return False
        start, count = event[1]
        return all(start <= at and at + struct.calcsize(form) <= start + count
                                          for at, form in self.kind.places.values())


def took_back(story, done, times):
    """Return what it took to take words back that left the proven band; nothing where none did.

    Looks: readings outside of the band, or out of the heater's reach, until it was decided. Round trips to the controller's block from then on, until the
    first word is put back (a third, where somebody else has changed the first to be put back); seconds of this machine until
    the last one is.
    """
    if done.record is None:
        return {}
    lines = [json.loads(line) for line in done.record.read_text().splitlines()]
    back = next((number for number, line in enumerate(lines) if line["step"] == "taking back"), 0)
    if not back or lines[back - 1]["step"] not in {"watched", "jumped"} or "sensor is frozen" in lines[back]["why"]:
        return {}
    outside = [line["step"] == "jumped" or not line["low_degC"] <= line["temperature_degC"] <= line["high_degC"]
               for line in lines[:back] if line["step"] in {"watched", "jumped"}]
    looks = next((number for number, out in enumerate(reversed(outside)) if not out), len(outside))
    asked = [(at, event) for at, event in zip(times, story.events, strict=True) if event[0] == "client" or story.looks(event)]
    wrote = [number for number, (_, event) in enumerate(asked) if event[0] == "client"][:sum(line["step"] == "writing" for line in lines[:back])]
    first = next((number for number, (_, event) in enumerate(asked) if event[0] == "client" and number > wrote[-1]), len(asked))
    seen = max((number for number, (_, event) in enumerate(asked[: first - 1]) if lines[back - 1]["bytes"] in event[-1].hex()), default=first)
    sent = [number for number, (_, event) in enumerate(asked) if event[0] == "client" and number > seen]
    if not sent:
        return {"looks": looks}
    return {"looks": looks, "round_trips": sent[0] - seen, "seconds": asked[sent[-1]][0] - asked[seen][0]}


def judged(story):  # noqa: C901, PLR0912 - a list of what must hold
    """Yield what is wrong with a session."""
    kind, done, before, after, last = story.kind, story.done, story.before, story.after, story.last
    outcome, told = done.end.outcome.value, done.end.stands
    others = collections.defaultdict(set)
    was, mine, looked, alone = dict(before), {}, False, True
    device = any(fault.name in ("half-taken", "clamped") for fault in story.faults)
    gateway = any(fault.name in LATE for fault in story.faults)
    for event in story.events:
        now = words_in(event[-1], kind)
        if story.looks(event):
            looked = True
        elif event[0] in ("client", "late"):
            if not looked and event[0] == "client":
                yield f"a write of {event[2].hex()} at byte {event[1]} without a look before it"
            looked = looked and event[0] == "late"
            changed = {name for name in now if now[name] != was[name]}
            mine |= {name: now[name] for name in changed}
            if wrong := [name for name in changed if not device and now[name] not in {before[name], after[name]} | others[name]]:
                yield f"{wrong} were given values of neither side"
            if alone and not device and now != before and not is_stable(now, kind, story.scan_s):  # as it was found may be somebody's, and none of ours
                yield f"an unstable set of words in between: {now}"
        elif event[0] == "other":
            alone = False
            for name in now:
                if now[name] != was[name]:
                    others[name].add(now[name])
                    mine.pop(name, None)
        was = now
    looks = [event for event in story.events if story.looks(event)]
    if told is not None and not others and any(told[name] != last[name] for name in before) and outcome != "unknown":
        yield f"said to stand there: {told}; in the end: {last}"
    if told is not None and not gateway and any(told[name] != words_in(looks[-1][-1], kind)[name] for name in before):
        yield f"said to stand there: {told}; read last: {words_in(looks[-1][-1], kind)}"
    if outcome != "unknown" and told is None and mine:
        yield "words were changed, and nothing is said of what stands there"
    if "nothing was sent" in done.end.message and any(event[0] == "client" for event in story.events):
        yield "something was sent"
    if outcome == "done" and not gateway and any(words_in(looks[-1][-1], kind)[name] != after[name] for name in before):
        yield f"done, but there stands {words_in(looks[-1][-1], kind)}"
    for name in before:
        if not (device and outcome in ("partly done", "unknown")) and last[name] not in {before[name], after[name]} | others[name]:
            yield f"{name} = {last[name]} is nobody's"
        if outcome in ("not done", "rolled back") and name in mine and mine[name] == last[name] == after[name] != before[name]:
            yield f"{name} = {last[name]} was left behind"
    if outcome == "unknown" and not any(fault.name in MAY_HIDE for fault in story.faults):
        yield NO_FAULT
    if done.record is not None:
        lines = [json.loads(line) for line in done.record.read_text().splitlines()]
        if lines[-1]["step"] != "end" or lines[-1]["outcome"] != outcome:
            yield "the record has another end"
        saved = done.record.with_suffix(".before.bin").read_bytes()
        if alone and words_in(bytes(lines[0]["begin"]) + saved, kind) != words_in(looks[0][-1], kind):
            yield "the backup is not what stood there"


@dataclasses.dataclass(slots=True)
class Figures:
    """What sessions have come to, in a file that is written as they go."""

    path: Path | None
    done: int = 0
    rows: int = 0
    seconds: float = 0.0
    ends: dict = dataclasses.field(default_factory=collections.Counter)
    kinds: dict = dataclasses.field(default_factory=collections.Counter)
    looks: dict = dataclasses.field(default_factory=collections.Counter)
    round_trips: dict = dataclasses.field(default_factory=collections.Counter)
    longest_s: float = 0.0
    wrong: list = dataclasses.field(default_factory=list)

    @classmethod
    def begun(cls, path):
        """Return those of a file, or none yet."""
        if path is None or not path.exists():
            return cls(path)
        said = json.loads(path.read_text())
        counts = {name: collections.Counter(said[name]) for name in ("ends", "kinds", "looks", "round_trips")}
        return cls(path, **said | counts)

    def take(self, which, end, took, wrong):
        """Take one session."""
        self.done += 1
        self.ends[end] += 1
        self.kinds[which] += 1
        self.rows += took["rows"]
        for name in ("looks", "round_trips"):
            if name in took:
                getattr(self, name)[str(took[name])] += 1
        self.longest_s = max(self.longest_s, took.get("seconds", 0.0))
        self.wrong += wrong

    def keep(self):
        """Write the file."""
        if self.path is not None:
            said = {each.name: getattr(self, each.name) for each in dataclasses.fields(self) if each.name != "path"}
            beside = self.path.with_suffix(".new")
            beside.write_text(json.dumps(said, indent=1))
            beside.replace(self.path)

    def __str__(self):
        def listed(counts):
            return ", ".join(f"{count} {name}" for name, count in sorted(counts.items(), key=lambda one: -one[1]))

        return (f"{self.done} sessions in {self.seconds:.0f} s: {listed(self.ends)}; {self.rows} rows recorded; {len(self.wrong)} wrong\n"
                f"of {listed(self.kinds)}\nleft the band: readings outside until it was decided {dict(self.looks)}; round trips until the first "
                f"word was back {dict(self.round_trips)}; the last one after {1000 * self.longest_s:.0f} ms at the most")


def run(sessions, seed, place, told=print, path=None):
    """Run sessions; return their figures."""
    place, made = Path(place), {}
    os.environ["HEATERTUNE_STATE"] = str(place / "state")
    recorder._PAUSES_S = (0.0, 0.002, 0.01)  # time goes fast here
    hold.LATE_S, writer._PAUSE_S = 0.4, 0.02
    figures = Figures.begun(path)
    for number in range(figures.done, sessions):
        begun, chance = time.monotonic(), random.Random(f"{seed} {number}")
        (target, protocol), = chance.choices(list(SHARES), list(SHARES.values()))
        if target not in made:
            out = folder_in(place / target, target) if not (place / target).exists() else place / target / "out"
            whole = read_proven(out)
            known = Known(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(whole)})
            made[target] = known, *read_folder(out)[1:]
        end, took, bad = session(target, protocol, made[target], chance, place)
        figures.take(f"{target} {protocol}", end, took, [f"session {number}: {each}" for each in bad])
        figures.seconds += time.monotonic() - begun
        for each in bad:
            told(f"session {number}: {each}")
        for left in place.glob("0.*"):
            left.unlink()
        if number % 50 == 49:
            figures.keep()
        if number % 500 == 499:
            told(figures)
    figures.keep()
    return figures


def main(sessions=SESSIONS, seed=1, path=None):
    """Print how they ended; return 1 where one is wrong."""
    memory = Path("/dev/shm")  # the files are judged, not the disk
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as place:
        figures = run(int(sessions), int(seed), place, path=path and Path(path))
    print(figures)
    return int(bool(figures.wrong))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

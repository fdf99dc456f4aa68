"""`watch --monitor` over links that drop: nothing is told of a loop in order, nothing is lost that a whole link would tell.

    python -m tests.bench.dropping [RUNS] [SEED] [PROTOCOL …]

Between the watch and the virtual PLC stands a proxy that knows of no protocol: for drawn stretches it refuses
connections, drops them in the middle of a frame, sends half of one and then nothing, answers late, or lets bytes drip. Three of four heaters break
after that, on a timetable of their own, while the link goes on dropping until some time later. Every third PLC tells no
count of its scans: this machine's clock tells their time, as fast as the PLC runs. Witnesses: the PLC's own
record of every scan, which no link touches, and the second monitor on it (`second_monitor.py`). Of each run is told how
many scans were seen, and what was found; ends with status 1 where
- an alarm is told before the heater breaks, or one that the second monitor has at no time;
- the second monitor has one that lasts, on scans that came over a link that was whole, and the watch has none;
- rows, scans missed and gaps are not all scans from the first row to the last, or a row is not of its scan.
"""

import contextlib
import io
import itertools
import json
import os
import random
import select
import socket
import sys
import tempfile
import threading
import time
import tty
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from heatertune import virtual_plc
from heatertune.cli import main as command
from heatertune.live import poller
from heatertune.live.plc import VirtualPlc
from heatertune.supervision.monitor_design import read_supervision
from tests.bench.second_monitor import NAMES, Monitors

RUNS = 12
#: how many times as fast as a real heater, with a scan of 3.1 s: as fast as looks of the protocol can follow
RATES = {"s7": 180.0, "modbus": 180.0, "opcua": 80.0, "as511": 20.0}
LINK = ("refuse", "cut", "half", "late", "drip")
HEATER = ("", "heater-open", "sensor-off", "stuck-on")
#: scans: the heater breaks amid those in which the link drops; then it is whole; what lasts, does so for some
BREAKS, DROPS, WHOLE, SCANS, LASTS = 170, 260, 280, 420, 40


class Proxy:
    """Stands between on loopback, or on a serial line; `mood` says what it does to bytes now."""

    def __init__(self, address, mood, chance):
        self.mood, self.chance, self._server, self._pairs = mood, chance, address, []
        self._over = threading.Event()
        if isinstance(address[0], str) and address[0].startswith("/"):
            self._near, self._slave = os.openpty()
            tty.setraw(self._slave)
            self._far = os.open(address[0], os.O_RDWR | os.O_NOCTTY)
            self.address = os.ttyname(self._slave), 0
            self._begin(self._serial)
        else:
            self._door = socket.create_server(("127.0.0.1", 0))
            self.address = self._door.getsockname()
            self._begin(self._tcp)

    def _begin(self, work):
        self._thread = threading.Thread(target=work, daemon=True)
        self._thread.start()

    def close(self):
        """End, and close everything."""
        self._over.set()
        self._thread.join()

    def _tcp(self):
        while not self._over.is_set():
            if self.mood() == "refuse":
                self._drop_all()
                self._door.close()  # nobody listens there: refused by the kernel
                while self.mood() == "refuse" and not self._over.wait(0.002):
                    pass
                self._door = socket.create_server(self.address)
            ready = select.select([self._door, *(one for pair in self._pairs for one in pair)], [], [], 0.01)[0]
            for one in ready:
                if one is self._door:
                    client = one.accept()[0]
                    self._pairs.append((client, socket.create_connection(self._server)))
                else:
                    self._pass_on(one)
        self._drop_all()
        self._door.close()

    def _pass_on(self, source):
        pair = next((each for each in self._pairs if source in each), None)
        if pair is None:  # the other end was dropped meanwhile
            return
        to = pair[source is pair[0]]
        try:
            content = source.recv(65536)
            if not content or not self._given(content, to.sendall):
                self._drop(pair)
        except OSError:
            self._drop(pair)

    def _given(self, content, send):
        """Give bytes, in the way of the moment; return whether the connection goes on."""
        mood = self.mood()
        if mood in ("cut", "refuse"):
            send(content[:self.chance.randrange(len(content))])
            return False
        if mood == "half":
            send(content[:len(content) // 2])  # the rest never comes; the connection stays
        elif mood == "late":
            self._over.wait(self.chance.uniform(0.0, self.chance.choice((0.02, 0.05, 0.2))))
            send(content)
        elif mood == "drip":
            for at in range(len(content)):
                send(content[at:at + 1])
                if at % 16 == 0:
                    self._over.wait(0.001)
        else:
            send(content)
        return True

    def _drop(self, pair):
        self._pairs.remove(pair)
        for one in pair:
            one.close()

    def _drop_all(self):
        for pair in list(self._pairs):
            self._drop(pair)

    def _serial(self):
        ends = {self._near: self._far, self._far: self._near}
        while not self._over.is_set():
            for one in select.select(list(ends), [], [], 0.01)[0]:
                content = os.read(one, 65536)
                self._given(content, lambda part, to=ends[one]: os.write(to, part))
        for one in (self._near, self._slave, self._far):
            os.close(one)


class Truth:
    """What each scan has shown, from the PLC itself."""

    def __init__(self):
        self.scans, self._plain = {}, VirtualPlc._over

    def __enter__(self):
        def over(plc, scans=self.scans, plain=self._plain):
            if plc.intervals:
                scans[plc.intervals - 1] = min(max(plc._seen[0], 0.0), 100.0), plc._seen[1]  # the card ends there
            return plain(plc)

        VirtualPlc._over = over
        return self.scans

    def __exit__(self, *_):
        VirtualPlc._over = self._plain


def design_in(folder):
    """Write words with their proof and a monitor of them; return the monitor's path."""
    heater = ("--gain", "0.9", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
    pid = str(folder / "pid.json")
    asked = ("--target", "s5-ob251", "--setpoint", "50", "--quiet")
    assert command(["tune", *heater, "-o", pid, "--quiet"]) == 0
    assert command(["export-db", pid, *asked, "-o", str(folder)]) == 0
    with contextlib.redirect_stdout(io.StringIO()):
        assert command(["supervise", pid, *asked, "--samples", "20", "--faults-per-kind", "1", "-o", str(folder / "monitor")]) == 0
    return folder / "monitor" / "supervision.json"


def timetable(chance):
    """Return (first scan, last scan, mood) of some stretches."""
    found, at = [], chance.randrange(5, 40)
    while at < DROPS:
        long = chance.choice((1, 2, 4, 10, 40))
        found.append((at, min(at + long, DROPS), chance.choice(LINK)))
        at += long + chance.choice((2, 15, 60))
    return found


@contextlib.contextmanager
def uncounted(rate):
    """Let a PLC be one that counts no scans; the clock that tells them goes so many times as fast."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(poller, "status_of_simulator", lambda _: None)
        patch.setattr(poller, "time", SimpleNamespace(monotonic=lambda: rate * time.monotonic()))
        yield


def run(folder, monitor, protocol, heater, drops, chance, log, *, counted=True):
    """Watch one loop over one link; return the PLC's scans before it, the watch's document, and every scan of the PLC."""
    faults = [f"t={BREAKS * read_supervision(monitor).scan_s:.6g} {heater}"] if heater else []
    with Truth() as truth, virtual_plc(folder, serve=protocol, faults=faults, step=False,
                                       rate=RATES[protocol]) as plc:
        def mood():
            return next((name for first, last, name in drops if first <= plc.plc.intervals < last), "")

        proxy = Proxy(plc.addresses[protocol], mood, chance)
        url = plc.urls[protocol].replace(*(f"{one[0]}:{one[1]}" if one[1] else one[0]
                                           for one in (plc.addresses[protocol], proxy.address)))
        said, before = io.StringIO(), 0 if counted else plc.plc.intervals
        try:
            with contextlib.redirect_stdout(said), contextlib.nullcontext() if counted else uncounted(RATES[protocol]):
                command(["watch", url, "--design", str(folder), "--monitor", str(monitor), "-o", str(log), "--duration",
                                  f"{SCANS * plc.scan_s}", "--quiet", "--json"])
        finally:
            proxy.close()
    return before, json.loads(said.getvalue()), truth


def rows_wrong(view, found, truth, log):
    """Return what is wrong with rows that tell their scans, and with what was counted of them."""
    step, watched = view.card.step_degC, found["monitor"]
    rows = [line.split(",") for line in log.read_text().splitlines() if line[0].isdigit()]
    seen = [round(float(row[0]) / view.scan_s) for row in rows]
    wrong = [f"row {row[0]}: {row[1]} °C; the scan had {truth[at][0]:.7g}" for at, row in zip(seen, rows, strict=True)
             if at not in truth or abs(float(row[1]) - truth[at][0]) > step]
    missed = [other - one - 1 for one, other in itertools.pairwise(seen)]
    if watched["scans"] != len(seen):
        wrong.append(f"{len(seen)} rows, {watched['scans']} scans")
    if watched["missed"] > sum(missed):
        wrong.append(f"{watched['missed']} scans missed, more than there are")
    if watched["begun_anew"] < sum(each > 3 for each in missed):
        wrong.append(f"gaps of more than three scans, and begun anew {watched['begun_anew']} times")
    return wrong


def alarms_wrong(view, found, truth, before, heater):
    """Return what is wrong with the alarms; `before`: scans that the log's time does not count."""
    told = {each["name"]: each["from_s"] for each in found["monitor"]["alarms"]}
    card = view.card
    counts = [(round((degC - card.zero_degC) / card.step_degC), round(power)) for _, (degC, power) in sorted(truth.items())]
    ever, late = alarms_of(view, counts), alarms_of(view, counts[WHOLE:SCANS - LASTS])
    wrong = [f"{name} at {at:.6g} s of a loop in order" for name, at in told.items()
             if not heater or at < (BREAKS - before - 2) * view.scan_s]
    wrong += [f"{name}, which the second monitor never has" for name in told if kind(name) not in ever]
    if late and not told:
        wrong.append(f"no alarm; the second monitor, over a whole link: {late}")
    return wrong


def kind(name):
    """Return the rule of an alarm: one window tells both, by the way the level moves."""
    return "heats too slowly" if name == "falls although heated" else name


def alarms_of(view, scans):
    """Return kind → its first scan, of the second monitor that sees each of them."""
    second, found = Monitors(view.numbers, 1), {}
    for at, (count, power) in enumerate(scans):
        alarm = second.feed(np.array([count]), np.array([power]))[0]
        if alarm:
            found.setdefault(kind(NAMES[alarm]), at)
    return found


def main(runs, seed, protocols):
    """Run, tell a line each, and return the status."""
    wrong = 0
    with tempfile.TemporaryDirectory() as place:
        monitor = design_in(Path(place))
        view = read_supervision(monitor)
        for number in range(runs):
            chance = random.Random(f"{seed} {number}")
            protocol, heater, drops = protocols[number % len(protocols)], chance.choice(HEATER), timetable(chance)
            log, begun, counted = Path(place) / f"{number}.csv", time.monotonic(), number % 3 != 2 or protocol == "as511"
            before, found, truth = run(Path(place), monitor, protocol, heater, drops, chance, log, counted=counted)
            told = alarms_wrong(view, found, truth, before, heater) + (rows_wrong(view, found, truth, log) if counted else [])
            watched = found["monitor"]
            names = ", ".join(f"{each['name']} at {each['from_s']:.0f} s" for each in watched["alarms"]) or "no alarm"
            print(f"{number:3d} {protocol:7} {'counted' if counted else 'by clock'} {heater or 'in order':12} {len(drops)} drops: {watched['scans']} scans, {watched['missed']} missed, "
                  f"{watched['begun_anew']} anew; {names}; {time.monotonic() - begun:.0f} s", flush=True)
            for line in told:
                print(f"      WRONG: {line}", flush=True)
            wrong += len(told)
    print(f"{wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else RUNS, int(sys.argv[2]) if len(sys.argv) > 2 else 1,
                  sys.argv[3:] or list(RATES)))

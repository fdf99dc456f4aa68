"""Networks that are cut at each request of each command, in network namespaces: 0 wrong end states, 0 reports that differ from the memory.

    python -m tests.bench.cut_networks [CUTS [SEED [AT_ONCE]]]

Run as root. `tests.bench.cuts` has a proxy that behaves like a network; here the kernel's own TCP runs between client and virtual PLC,
each in a namespace, through a third one that stops forwarding: just before a request is sent, just before its answer is, or at a tenth
of a second after the command began. The PLC's memory is judged once more half a minute after the end of each command.
"""

import collections
import random
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from heatertune import virtual_plc
from heatertune.live import hold, serve
from heatertune.live.client import modbus, opcua, s7
from heatertune.live.client.connection import RequestConnection, address_of
from heatertune.live.write.plc_block import LinkSettings
from tests.bench import cuts
from tests.bench.cuts import COMMANDS, OLD, SCHEMES, TAILS
from tests.bench.outage import Network, why_not

BEGINS = ("before", "behind", "clock")
#: of each command: its last request, and the tenths of a second in which it begins its last ones
MOST = {"experiment": 60, "write": 40, "rollback": 24}
TENTHS = {"experiment": 60, "write": 12, "rollback": 12}
#: lengths of a cut: below and above the time after which an answer counts as lost, and after which nothing more is waited for
LENGTHS_S = [n / 10 for n in range(1, 41)]
LATER_S = 30.0
RATES = {"experiment": 100.0, "write": 160.0, "rollback": 160.0}  # so many times as fast as a heater; a scan is 3.2 s of the heater's


@dataclass(frozen=True, slots=True)
class Cut(cuts.Cut):
    """`before` of `cuts.Cut` is one of `BEGINS`, `at` a request's number or, of "clock", tenths of a second."""


class Site(cuts.Plant):
    """A virtual PLC behind a router of the kernel's; it stands for its own `router`."""

    def __init__(self, made, cut, place, network):
        self._known, model, conditions = made
        words = self._known.words
        old = replace(words, values={**words.values, **OLD})
        self.plc = network.in_server(lambda: virtual_plc(
            old if cut.command != "experiment" else words, model, conditions, serve=cut.protocol, rate=RATES[cut.command]))
        self.place, self.cut, self.router, self._network = place, cut, self, network
        port = self.plc.addresses[cut.protocol][1]
        self.address = address_of(f"{SCHEMES.get(cut.protocol, cut.protocol)}://{network.host}:{port}{TAILS[cut.protocol]}")
        self.timeout_s = cuts.TIMEOUTS_S[cut.protocol]
        self.link, self.ends = LinkSettings(tries=3, pause_s=0.05, timeout_s=self.timeout_s), []
        self.asked = self._at = 0
        self.hit, self._timers, self._is_armed = False, [], False
        memory = self.plc.plc.memory
        self._read, self._write = memory.read, memory.write
        memory.read, memory.write = self._answering(memory.read), self._answering(memory.write)
        SITES[network.host] = self
        if cut.command != "rollback":
            self.begin()

    def begin(self):
        """Count requests, or tenths of a second, from now on."""
        if self.cut.before == "clock":
            self._timers.append(threading.Timer(self.cut.at / 10, self._off))
            self._timers[-1].start()
        else:
            self._at = self.asked + self.cut.at

    def request(self):
        """Note that the client sends a request next."""
        self.asked += 1
        if self.asked == self._at:
            if self.cut.before == "before":
                self._off()
            else:
                self._is_armed = True

    def _answering(self, act):
        def carried_out(*given):
            try:
                return act(*given)
            finally:
                if self._is_armed:
                    self._is_armed = False
                    self._off()
        return carried_out

    def _off(self):
        self.hit = True
        self._network.pass_on(False)
        self._timers.append(threading.Timer(self.cut.seconds, self._network.pass_on))
        self._timers[-1].start()

    def pass_on(self):
        """Forward all from now on."""
        self._at = 0
        self._ended()

    def _ended(self):
        for each in list(self._timers):
            each.cancel()
            each.join()
        self._network.pass_on()

    def rollback(self):
        """As `cuts.Plant.rollback`."""
        done, wrong = self._written()
        yield from wrong
        if done.end.outcome.value != "done":
            return
        self.begin()
        ended = self._rolled_back()
        self._arrived()
        yield from self._judged(ended, back=True)

    def _arrived(self):
        time.sleep(0.3)
        for each in list(self._timers):
            each.join()

    def close(self):
        self._ended()
        SITES.pop(self._network.host)
        self.plc.close()


#: host → what is there
SITES = {}


def count_requests():
    """Have each request of a client, and each new connection, noted at its site."""
    asked = RequestConnection._answer_to

    def _answer_to(self, ask, what):
        if self._address.host in SITES:
            SITES[self._address.host].request()
        return asked(self, ask, what)

    RequestConnection._answer_to = _answer_to
    for module in (s7, modbus, opcua):
        def open_client(address, timeout_s, opened=module.open_client):
            if address.host in SITES:
                SITES[address.host].request()
            return opened(address, timeout_s)

        module.open_client = open_client


class Judge:
    """Closes sites half a minute after their command ended, where the memory is what it was then."""

    def __init__(self, report):
        self._report, self._left, self._lock = report, [], threading.Lock()

    def take(self, site, network, wrong):
        """Take a site whose command has just ended."""
        stood = site.image()[cuts.CELLS] if site.cut.command == "experiment" else site.words()
        with self._lock:
            self._left.append((time.monotonic() + LATER_S, site, network, wrong, stood))

    def close(self, *, all_of_them=False):
        """Judge those whose time has come."""
        while True:
            with self._lock:
                ready = [each for each in self._left if each[0] <= time.monotonic()]
                self._left = [each for each in self._left if each not in ready]
            for _, site, network, found, stood in ready:
                wrong, now = list(found), site.image()[cuts.CELLS] if site.cut.command == "experiment" else site.words()
                if now != stood:
                    wrong.append(f"half a minute later {now} stands there, not {stood}")
                site.close()
                network.__exit__()
                self._report(site.cut, wrong, site.hit, site.ends[-1:])
            if not self._left or not all_of_them:
                return
            time.sleep(0.5)


def run(made, cut, place, number, judge):
    """Run one; its judgement comes half a minute later."""
    network = Network(number).__enter__()
    place.mkdir()
    try:
        site = Site(made, cut, place, network)
    except BaseException:
        network.__exit__()
        raise

    def act():
        try:
            return list(getattr(site, cut.command)())
        except Exception as problem:
            return [f"broke: {problem!r}"]

    judge.take(site, network, network.in_client(act))
    judge.close()


def sweep(count, chance):
    """Draw cuts: commands and protocols in turn, each begin and length."""
    drawn = []
    for number in range(count):
        command, protocol = COMMANDS[number % 3], ("modbus", "s7", "opcua")[number // 3 % 3]
        begin = chance.choice(BEGINS)
        at = chance.randint(0, TENTHS[command]) if begin == "clock" else chance.randint(1, MOST[command])
        drawn.append(Cut(command, protocol, at, chance.choice(LENGTHS_S), begin))
    return drawn


def main(count=500, seed=1, at_once=3, first=0):
    """Run a sweep; return 1 where one is wrong."""
    if problem := why_not():
        print(problem)
        return 2
    ran, ends, lock = {"cuts": 0, "hit": 0, "wrong": 0}, collections.Counter(), threading.Lock()

    def report(cut, wrong, was_hit, end):
        with lock:
            ran["cuts"], ran["hit"], ran["wrong"] = ran["cuts"] + 1, ran["hit"] + was_hit, ran["wrong"] + bool(wrong)
            ends.update((cut.command, cut.protocol, each) for each in end)
            for each in wrong:
                print(f"{cut}: {each}", flush=True)
            if ran["cuts"] % 20 == 0:
                print(ran, flush=True)

    with tempfile.TemporaryDirectory() as folder:
        made = cuts.prepared(folder)
        hold.LATE_S, hold.RETRY_S, serve._LOOPBACK = 1.0, 5.0, "0.0.0.0"
        count_requests()
        judge = Judge(report)
        with ThreadPoolExecutor(int(at_once)) as pool:
            for done in [pool.submit(run, made, cut, Path(folder) / str(number), number % 100, judge) for number, cut in
                         enumerate(sweep(int(count), random.Random(int(seed)))) if number >= int(first)]:
                done.result()
        judge.close(all_of_them=True)
    for (command, protocol, end), often in sorted(ends.items()):
        print(f"{command:12}{protocol:8}{end:20}{often:4}")
    print(f"{ran['cuts']} cuts in namespaces, {ran['hit']} of them within the command; {ran['wrong']} wrong")
    return int(bool(ran["wrong"]))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

"""Networks that are cut at each request of each command: 0 wrong end states, 0 reports that differ from the PLC's memory afterwards.

    python -m tests.bench.cuts [CUTS [SEED]]

A proxy stands between client and virtual PLC. At one request it stops passing anything on, before or behind it, for tenths of a
second. As in a network whose router forwards nothing, what a client sent meanwhile arrives when the outage is over where its
connection was closed in order, and never where it was reset. `tests.bench.outage` does the same in network namespaces, slowly.
Judged by the memory of the virtual PLC, which the proxy's judge reads itself; nothing of heatertune's that writes is asked.
"""

import contextlib
import dataclasses
import os
import random
import selectors
import socket
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from heatertune import virtual_plc
from heatertune.errors import HeatertuneError, LinkError
from heatertune.live import hold, recorder
from heatertune.live.client.connection import address_of
from heatertune.live.experiment import AbortLimits, Experiment, Steps, restore
from heatertune.live.hold import Hold
from heatertune.live.serve import read_folder
from heatertune.live.write import writer
from heatertune.live.write.apply import WriteRequest, apply_write
from heatertune.live.write.plc_block import LinkSettings
from heatertune.live.write.proven_words import Declared, read_proven
from heatertune.live.write.rollback import before_of, rolled_back
from tests.bench.sessions import SCHEMES, Known, folder_in, words_in

CUTS = 500
#: STEU and YH of OB251's block (manual, table 11-9: DW11, DW12)
CELLS = slice(22, 26)
OLD = {"K": 3000, "TI": 30, "YH": 200}
TAILS = {"s7": "/0/2/db30", "modbus": "/1/0", "opcua": "/db30"}
COMMANDS = ("experiment", "write", "rollback")
PLAN = Steps(steps=tuple((float(at), power) for at, power in zip(range(0, 400, 20), (0.0, 90.0, 30.0) * 7, strict=False)))
TIMEOUTS_S, LATE_S, RETRY_S = {"s7": 0.3, "modbus": 0.3, "opcua": 0.6}, 0.5, 1.5


class Router:
    """Passes requests on but for an outage: from one request on, before it is passed on or before its answer is.

    Attributes:
        port: that clients come to.
        asked: requests so far.
    """

    def __init__(self, server, at, seconds, *, before):
        """Listen; `at` is the number of the request (0: none), `before` whether it is swallowed itself."""
        self._server, self._at, self._seconds, self._before = server, at, seconds, before
        self.asked, self._off, self._back_s, self._held = 0, False, 0.0, []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._selector, self._pairs, self._ended = selectors.DefaultSelector(), {}, False
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        self._ended = True
        self._thread.join()
        for each in [self._listener, *self._pairs]:
            each.close()
        self._selector.close()

    def pass_on(self):
        """Pass on all from now on."""
        self._at = 0
        self._back_s = 0.0

    def _run(self):
        while not self._ended:
            if self._off and time.monotonic() >= self._back_s:
                self._off = False
            if self._held and time.monotonic() >= self._back_s + self._seconds:  # the system tries again more and more rarely
                for to, content in self._held:  # of connections that nobody has reset
                    with contextlib.suppress(OSError):
                        to.sendall(content)
                self._held.clear()
            for key, _ in self._selector.select(0.01):
                if key.fileobj is self._listener:
                    self._accept()
                elif key.fileobj in self._pairs:
                    self._relay(key.fileobj)

    def _accept(self):
        client, _ = self._listener.accept()
        server = socket.create_connection(self._server)
        for one, other, kind in ((client, server, "client"), (server, client, "server")):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._pairs[one] = other, kind
            self._selector.register(one, selectors.EVENT_READ)

    def _relay(self, source):
        other, kind = self._pairs[source]
        try:
            content, reset = source.recv(65536), False
        except OSError:
            content, reset = b"", True
        if not content:
            self._selector.unregister(source)
            del self._pairs[source]
            source.close()
            if reset:  # what the system has not delivered is gone; the server, whom nobody tells, keeps its end
                self._held = [each for each in self._held if each[0] is not other]
            elif not self._off:
                with contextlib.suppress(OSError):
                    other.shutdown(socket.SHUT_WR)
            return
        if kind == "client":
            self.asked += 1
            if self.asked == self._at and not self._off:
                self._off, self._back_s = True, time.monotonic() + self._seconds
                if not self._before:
                    with contextlib.suppress(OSError):
                        other.sendall(content)
                    return
        if self._off:
            self._held.append((other, content))
            return
        with contextlib.suppress(OSError):
            other.sendall(content)


@dataclasses.dataclass(frozen=True, slots=True)
class Cut:
    """One of the sweep: which command over which protocol, and what is cut when, for how long [s]."""

    command: str
    protocol: str
    at: int
    seconds: float
    before: bool


class Plant:
    """A virtual PLC behind a router."""

    def __init__(self, made, cut, place, *, rate):
        self._known, model, conditions = made
        words = self._known.words
        old = dataclasses.replace(words, values={**words.values, **OLD})
        self.plc = virtual_plc(old if cut.command != "experiment" else words, model, conditions, serve=cut.protocol, rate=rate)
        self.router = Router(self.plc.addresses[cut.protocol], 0 if cut.command == "rollback" else cut.at, cut.seconds, before=cut.before)
        scheme = SCHEMES.get(cut.protocol, cut.protocol)
        self.address = address_of(f"{scheme}://127.0.0.1:{self.router.port}{TAILS[cut.protocol]}")
        self.place, self.cut = place, cut
        self.timeout_s = TIMEOUTS_S[cut.protocol]
        self.link, self.ends = LinkSettings(tries=3, pause_s=0.05, timeout_s=self.timeout_s), []

    def image(self):
        return self.plc.plc.memory.image()

    def words(self):
        return {name: words_in(self.image())[name] for name in OLD}

    def is_open(self):
        return Hold(self.address).path.exists()

    def close(self):
        self.router.close()
        self.plc.close()

    def experiment(self):
        """Run it; yield what is wrong."""
        before = self.image()[CELLS]
        whole = Experiment(PLAN, self.address, self._known.words, AbortLimits(temperature_degC=95.0), timeout_s=self.timeout_s)
        try:
            whole.check()
            ended = whole.run(self.place / "log.csv")
        except LinkError:
            self.ends.append("refused")
            self._arrived()
            if self.image()[CELLS] != before:
                yield "refused, and other cells stand there"
            return
        self.ends.append({True: "as before", False: "another's", None: "unknown"}[ended.restored])
        self._arrived()
        if ended.restored is False:
            yield f"said to be somebody else's: {ended.message}"
        if ended.restored and (self.image()[CELLS] != before or self.is_open()):
            yield f"said to be as before: {self.image()[CELLS].hex()}, hold open: {self.is_open()}"
        if ended.restored is None:
            if not self.is_open():
                yield "unknown, and nothing is open"
            self.router.pass_on()
            found = next((each for each in (restore(self.address, self.timeout_s) for _ in range(10)) if each is not None), None)
            if found is not True:  # tried again, as a person does on a busy machine
                yield f"not restored by the named command: {found}"
        if self.image()[CELLS] != before:
            yield f"{self.image()[CELLS].hex()} stands there in the end"

    def _arrived(self):
        """Wait until the outage is over, and nothing can arrive any more."""
        time.sleep(2.0 * self.cut.seconds + 0.3)

    def write(self):
        """Run it; yield what is wrong."""
        _, wrong = self._written()
        yield from wrong

    def _written(self):
        known = self._known
        wanted = WriteRequest(proven_words=known, address=self.address, declared=Declared(range_degC=(0.0, 100.0)), link=self.link,
                              watch=False, record=self.place / "record.jsonl", most_writes=10 ** 9)
        done = apply_write(wanted, known.yes)
        self._arrived()
        return done, list(self._judged(done.end))

    def _judged(self, end, back=False):
        outcome, stands = end.outcome.value, self.words()
        self.ends.append(outcome)
        new = {name: self._known.words.values[name] for name in OLD}
        told = None if end.stands is None else {name: end.stands[name] for name in OLD}
        if outcome == "unknown":
            if not self.is_open():
                yield "unknown, and nothing is open"
            self.router.pass_on()
            again = self._rolled_back(patient=True)
            if again.outcome.value != "done" or self.words() != OLD:
                yield f"after unknown, rollback: {again.outcome}, {again.message}: {self.words()}"
            return
        if told is not None and told != stands:
            yield f"{outcome}: said to stand there {told}; there stands {stands}"
        due = {"done": OLD if back else new, "not done": new if back else OLD, "rolled back": OLD}
        if outcome in due and stands != due[outcome] and not (back and outcome == "not done"):
            yield f"{outcome}: {stands}; {end.message}"

    def _rolled_back(self, patient=False):
        before = before_of(self.place / "record.jsonl")
        for _ in range(40):
            try:
                ended = rolled_back(before, before.yes, self.link, 10 ** 9, unproven=True)
                if patient and ("nothing was sent" in ended.message or ended.outcome.value == "unknown"):
                    continue  # a busy machine: nobody answered in time, and its message says to ask again
                return ended
            except HeatertuneError as problem:
                if "again in" not in str(problem):
                    raise
                time.sleep(0.05)
        raise AssertionError("it is held up for ever")

    def rollback(self):
        """Write, and put back while the network is cut; yield what is wrong."""
        done, wrong = self._written()
        yield from wrong
        if done.end.outcome.value != "done":  # likewise; what it reports is judged all the same
            return
        self.router._at = self.router.asked + self.cut.at
        ended = self._rolled_back()
        self._arrived()
        yield from self._judged(ended, back=True)


def run(made, cut, place):
    """Run one; return what is wrong, and at which request the cut came, or 0."""
    plant = Plant(made, cut, place, rate=800.0 if cut.command == "experiment" else 3100.0)
    try:
        wrong = list(getattr(plant, cut.command)())
        return wrong, cut.at if plant.router.asked >= cut.at else 0
    finally:
        plant.close()


def sweep(count, chance, protocols=("modbus", "s7", "opcua"), most=None):
    """Return cuts: each request of each command in turn, behind and before it, for tenths of a second."""
    most = most or {"experiment": 40, "write": 40, "rollback": 24}
    every = [Cut(command, protocol, at, seconds, before) for command in COMMANDS for protocol in protocols
             for at in range(1, most[command] + 1) for before in (True, False) for seconds in [n / 10 for n in range(1, 9)]]
    return chance.sample(every, min(count, len(every)))


def prepared(place):
    """Return words, proof, heater and conditions, and set the times of this bench."""
    os.environ["HEATERTUNE_STATE"] = str(Path(place) / "state")
    recorder._PAUSES_S, hold._PAUSES_S = (0.0, 0.02, 0.1), (0.0, 0.05, 0.1)
    hold.LATE_S, hold.RETRY_S, writer._PAUSE_S = LATE_S, RETRY_S, 0.05
    out = folder_in(Path(place) / "made")
    whole = read_proven(out)
    known = Known(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(whole)})
    return known, *read_folder(out)[1:]


def main(cuts=CUTS, seed=1, at_once=6):
    """Run a sweep; return 1 where one is wrong."""
    chance, bad, hit = random.Random(int(seed)), 0, 0
    with tempfile.TemporaryDirectory() as place:
        made = prepared(place)

        def one(numbered):
            number, cut = numbered
            (here := Path(place) / str(number)).mkdir()
            try:
                return cut, *run(made, cut, here)
            except Exception as problem:
                return cut, [f"broke: {problem!r}"], 0

        with ThreadPoolExecutor(int(at_once)) as pool:
            for cut, wrong, was_hit in pool.map(one, enumerate(sweep(int(cuts), chance))):
                bad, hit = bad + bool(wrong), hit + bool(was_hit)
                for each in wrong:
                    print(f"{cut}: {each}", flush=True)
    print(f"{cuts} cuts, {hit} of them within the command; {bad} wrong")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

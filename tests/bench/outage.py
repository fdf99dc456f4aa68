"""Networks that lose what is sent, on this machine alone: three network namespaces, and a door to a virtual PLC in the third.

    python -m tests.bench.outage [RUNS [SEED]]

Run as root. A client runs in the first namespace; the second one forwards, or is a black hole; the door in the third relays to
a server on loopback outside, over connections of its own. Nothing leaves the machine. What the PLC holds is read from its memory.
"""

import contextlib
import ctypes
import itertools
import os
import random
import re
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from heatertune import Fopdt, model_by_hand, virtual_plc
from tests.live.conftest import CONDITIONS, words_of, write_design

_NEW_NETWORK = 0x40000000  # CLONE_NEWNET
_NUMBERS = itertools.count()


def why_not():
    """Return why there can be no namespaces here; nothing where there can be."""
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("ip") is None:
        return "network namespaces need Linux, root and iproute2"
    name = f"httry{os.getpid()}"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False).returncode == 0
    if not made:
        return "no network namespace can be made here"
    pair = ["ip", "-n", name, "link", "add", "a0", "type", "veth", "peer", "name", "a1"]
    linked = subprocess.run(pair, capture_output=True, check=False).returncode == 0
    subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
    return "" if linked else "no pair of virtual links can be made here"


def _ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Network:
    """Client, router and server, each in a namespace of its own; `with` takes all away."""

    def __init__(self, number=0):
        """Belong to two of the nets 10.93.0.0/16; two networks at once that name a PLC by its host need two numbers."""
        self._nets = 2 * number + 1, 2 * number + 2
        self.host = f"10.93.{self._nets[1]}.2"

    def __enter__(self):
        tail = f"{os.getpid() % 100000}n{next(_NUMBERS)}"
        self.client, self._router, self.server = names = [f"{kind}{tail}" for kind in ("htc", "htr", "hts")]
        for name in names:
            _ip("netns", "add", name)
        for end, name, other, net in (("c", self.client, "rc", self._nets[0]), ("s", self.server, "rs", self._nets[1])):
            _ip("link", "add", f"{end}0", "netns", name, "type", "veth", "peer", "name", other, "netns", self._router)
            _ip("-n", name, "addr", "add", f"10.93.{net}.2/24", "dev", f"{end}0")
            _ip("-n", self._router, "addr", "add", f"10.93.{net}.1/24", "dev", other)
            for place, link in ((name, f"{end}0"), (name, "lo"), (self._router, other)):
                _ip("-n", place, "link", "set", link, "up")
            _ip("-n", name, "route", "add", "default", "via", f"10.93.{net}.1")
        self._forward = self._within(self._router, lambda: os.open("/proc/sys/net/ipv4/ip_forward", os.O_RDWR))
        self.pass_on()
        return self

    def __exit__(self, *_):
        os.close(self._forward)
        for name in (self.client, self._router, self.server):
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)

    def pass_on(self, whether=True):
        """Forward, or be a black hole."""
        os.pwrite(self._forward, b"1" if whether else b"0", 0)

    @staticmethod
    def _within(name, act):
        """Do something in a namespace, in a thread of its own; return what it returns."""
        found = []

        def run():
            libc, number = ctypes.CDLL(None, use_errno=True), os.open(f"/run/netns/{name}", os.O_RDONLY)
            assert libc.setns(number, _NEW_NETWORK) == 0
            os.close(number)
            found.append(act())

        thread = threading.Thread(target=run)
        thread.start()
        thread.join()
        return found[0]

    def in_client(self, act):
        """Do something in the client's namespace, its threads too; return what it returns."""
        return self._within(self.client, act)

    def in_server(self, act):
        """Do the same in the server's."""
        return self._within(self.server, act)

    def listener(self):
        """Return a socket that listens in the server's namespace."""
        return self._within(self.server, lambda: socket.create_server((self.host, 0)))


class Door:
    """Relays connections to a server on loopback, and notes how each ends.

    Attributes:
        port: that clients come to.
        ends: of each connection whose client ended it: "reset" or "orderly".
        deaf: whether requests are neither passed on nor answered.
    """

    def __init__(self, listener, server, *, replied=lambda _door: None, asked=lambda _door, _content: None):
        """Open; `replied` is called behind each reply that was passed on, `asked` before each request that is."""
        self.port, self._server, self._replied, self._asked = listener.getsockname()[1], server, replied, asked
        self.ends, self.deaf, self.replies = [], False, 0
        self._reset = set()  # connections whose reset was seen while something was sent to them: the system tells it once
        self._selector, self._listener = selectors.DefaultSelector(), listener
        self._wake, self._woken = socket.socketpair()
        self._selector.register(self._woken, selectors.EVENT_READ, None)
        self._selector.register(listener, selectors.EVENT_READ, "new")
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        """Close all."""
        self._wake.send(b"x")
        self._thread.join()

    def _run(self):
        while True:
            for key, _ in self._selector.select():
                if key.data is None:
                    for each in list(self._selector.get_map().values()):
                        each.fileobj.close()
                    self._selector.close()
                    self._wake.close()
                    return
                if key.data == "new":
                    client, _ = self._listener.accept()
                    server = socket.create_connection(self._server)
                    for one, other, kind in ((client, server, "client"), (server, client, "server")):
                        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                        self._selector.register(one, selectors.EVENT_READ, (kind, other))
                elif key.fileobj.fileno() >= 0:
                    self._relay(key.fileobj, *key.data)

    def _relay(self, source, kind, other):
        try:
            content = source.recv(65536)
            how = "orderly"
        except OSError:
            content, how = b"", "reset"
        if content and kind == "client":
            self._asked(self, content)
            if self.deaf:
                return
        try:
            other.sendall(content)
        except ConnectionResetError:
            self._reset.add(other)
        except OSError:
            pass
        if content and kind == "server":
            self.replies += 1
            self._replied(self)
        if not content:
            if kind == "client":
                self.ends.append("reset" if source in self._reset else how)
            for each in (source, other) if kind == "client" else (source,):  # how the client ends it is still to be seen
                with contextlib.suppress(KeyError, ValueError):
                    self._selector.unregister(each)
                each.close()


#: how a read of mode and manual value of OB251's block (DW11, DW12) goes over the network: Modbus function 3, registers 11 and 12;
#: S7 any-pointer, 4 bytes of DB30 from bit 176 on
LOOKS = {"modbus": bytes.fromhex("03000b0002"), "s7": bytes.fromhex("0004001e840000b0")}

#: what the report of an experiment may claim, and the words that claim it
CLAIMS = {"as before": "stand there as before", "unknown": "UNKNOWN"}


class Experiment:
    """One experiment over a network: a plan of 0, 90 and 30 %, with a virtual PLC that has no dead man behind a door."""

    def __init__(self, network, plc, part, protocol, tail, folder, place, *, hole_at, outage_s, seconds=2.0):
        """Run it to its end, and some seconds more.

        Args:
            network: that it goes over.
            plc: virtual PLC.
            part: bytes of its block that hold mode and manual value.
            protocol: that it speaks.
            tail: of the address.
            folder: of the design.
            place: for plan and log.
            hole_at: number of the look at mode and manual value whose reply is the last one that passes.
            outage_s: for how long [s].
            seconds: after the end [s].
        """
        self.before, self._network, self._hole_at, self._outage_s = plc.plc.memory.image()[part], network, hole_at, outage_s
        self._timer, self._looks, self._look = None, 0, LOOKS[protocol]
        door = Door(network.listener(), plc.addresses[protocol], asked=self._asked, replied=self._replied)
        rows = (f"{at},{power}\n" for at, power in zip(range(0, 168, 4), itertools.cycle((0, 90, 30)), strict=False))
        (place / "plan.csv").write_text("time_s,power_pct\n" + "".join(rows))  # most looks are followed by another power
        scheme = {"opcua": "opc.tcp"}.get(protocol, protocol)
        self.address = f"{scheme}://{network.host}:{door.port}{tail}"
        line = [sys.executable, "-m", "heatertune", "experiment", place / "plan.csv", self.address, "--design", folder,
                "--limit-temperature", "95", "-o", place / "log.csv", "--yes", "--without-dead-man", "--quiet"]
        self._client = subprocess.Popen(["ip", "netns", "exec", network.client, *map(str, line)], stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)
        self.said = " ".join(self._client.communicate()[0].split())
        self.status, self.ended = self._client.returncode, plc.plc.memory.image()[part]
        if self._timer is not None:
            self._timer.join()
        time.sleep(seconds)
        self.later = plc.plc.memory.image()[part]
        door.close()
        network.pass_on()
        self.ends = door.ends

    def _asked(self, _, content):
        self._looks += self._look in content
        if self._looks == self._hole_at and self._timer is None:
            self._client.send_signal(signal.SIGSTOP)  # it sends nothing before the hole is there

    def _replied(self, _):
        if self._looks >= self._hole_at and self._timer is None:
            time.sleep(0.05)  # in which the reply arrives
            self._network.pass_on(False)
            self._client.send_signal(signal.SIGCONT)
            self._timer = threading.Timer(self._outage_s, self._network.pass_on)
            self._timer.start()

    @property
    def wrong(self):
        """Yield what is not as it was said."""
        if CLAIMS["as before"] in self.said and self.later != self.before:
            yield f"said to be as before: {self.before.hex()}; {self.later.hex()} stands there"
        if not re.search("|".join(CLAIMS.values()), self.said) and self.later != self.before:
            yield f"nothing is claimed, and {self.later.hex()} stands there, not {self.before.hex()}: {self.said}"
        if "orderly" in self.ends:
            yield f"connections ended {self.ends}"


def main(runs=20, seed=1):
    """Cut experiments off at random moments; return 1 where one says what is not so."""
    if problem := why_not():
        print(problem)
        return 2
    chance, words, wrong = random.Random(int(seed)), words_of("s5-ob251"), 0
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))
    with tempfile.TemporaryDirectory() as folder, Network() as network:
        place = Path(folder)
        os.environ["HEATERTUNE_STATE"] = str(place / "state")
        (place / "design").mkdir()
        write_design(place / "design")
        for number in range(int(runs)):
            (here := place / str(number)).mkdir()
            protocol, tail = chance.choice([("modbus", "/1/0"), ("s7", "/0/2/db30")])
            hole_at, outage_s = chance.randrange(1, 30), chance.choice([2.0, 4.0, 6.0])
            with virtual_plc(words, heater, CONDITIONS, serve=protocol, rate=20.0) as plc:
                ran = Experiment(network, plc, slice(22, 26), protocol, tail, place / "design", here, hole_at=hole_at,
                                 outage_s=outage_s, seconds=8.0)
            found = list(ran.wrong)
            wrong += bool(found)
            print(f"{number}: {protocol}, black hole behind look {hole_at} for {outage_s:g} s: status {ran.status}; "
                  f"{ran.said[:400]}", *found, sep="\n   ", flush=True)
    print(f"{runs} experiments, {wrong} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

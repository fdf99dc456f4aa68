import json
import os
import struct
import subprocess
import sys
from contextlib import contextmanager
from importlib.util import find_spec
from select import select

import pytest

from heatertune import Fopdt, Scaling, model_by_hand, virtual_plc
from heatertune.cli import main
from heatertune.live.hold import HOST, Clock
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus
from heatertune.pid.design_values import PidDesign
from heatertune.plc import controller_for
from heatertune.proof.words_file import WORDS_SCHEMA
from heatertune.settings import Conditions

snap7 = pytest.importorskip("snap7.client", reason="python-snap7 is not installed")
S7Error = pytest.importorskip("snap7.error").S7Error
pymodbus = pytest.importorskip("pymodbus.client", reason="pymodbus is not installed")
try:
    from asyncua import ua
    from asyncua.sync import Client as UaClient
except ImportError:
    UA_ERRORS = ()
else:
    UA_ERRORS = (ua.UaError,)

_NEEDED = {"s7": True, "modbus": True, "opcua": UA_ERRORS, "as511": find_spec("serial") and hasattr(os, "openpty")}
#: each protocol as a parameter; an OPC UA server takes most of a second to stand
PROTOCOLS = [pytest.param(name, marks=[pytest.mark.skipif(not there, reason=f"what {name} needs is not installed"),
                                       *([pytest.mark.long] if name == "opcua" else [])])
             for name, there in _NEEDED.items()]

def hasty_clock():
    """Return a clock on which waiting takes no time, and counts all the same."""
    slept = [0.0]
    return Clock(lambda: HOST.now_s() + slept[0], lambda seconds: slept.append(slept.pop() + seconds))


#: of OB251's block
DB, LENGTH = 30, 98
CONDITIONS = Conditions(setpoint_degC=50.0)


@pytest.fixture(scope="session")
def heater():
    return model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))


def words_of(target, scaling=None):
    """Return words with an interval of 4 s, or the nearest that an instrument has."""
    controller = controller_for(target)
    design = PidDesign(gain_pct_per_degC=6.0, integral_time_s=110.0, derivative_time_s=0.0,
                       sample_time_s=min(4.0, controller.timer.longest_s), structure="pi", method="")
    return controller.encode(design, scaling or Scaling())


@pytest.fixture(scope="session")
def words():
    return words_of("s5-ob251")


@pytest.fixture
def served(words, heater):
    """Serve the words and the heater, as `virtual_plc` is asked; all ends with the test."""
    begun = []

    def serve(which=words, conditions=CONDITIONS, **changed):
        begun.append(virtual_plc(which, heater, conditions, **{"step": True} | changed))
        return begun[-1]

    yield serve
    for each in begun:
        each.close()


@pytest.fixture(autouse=True)
def a_busy_machine_is_no_silence(monkeypatch):
    monkeypatch.setattr("heatertune.live.as511_server.SILENCE_S", 60.0)


class S7:
    """What a test asks of a PLC over S7; a block is read and written as bytes."""

    def __init__(self, host, port):
        self.client = snap7.Client()
        self.client.connect(host, 0, 2, port)
        self.timeout(5.0)

    def timeout(self, seconds):
        self.client.connection.timeout = seconds
        self.client.connection.socket.settimeout(seconds)

    def read(self, number, start, count):
        return bytes(self.client.db_read(number, start, count))

    def write(self, number, start, content):
        self.client.db_write(number, start, bytearray(content))

    def close(self):
        self.client.disconnect()


class Modbus:
    """The same over Modbus; whole registers only."""

    def __init__(self, host, port):
        self.client = pymodbus.ModbusTcpClient(host, port=port, timeout=5, retries=0)
        assert self.client.connect()

    def _first(self, number, start):
        return (1000 if number == OWN else 0) + start // 2

    def read(self, number, start, count):
        found = self.client.read_holding_registers(self._first(number, start), count=count // 2, device_id=1)
        assert not found.isError(), found
        return struct.pack(f">{count // 2}H", *found.registers)

    def write(self, number, start, content):
        values = list(struct.unpack(f">{len(content) // 2}H", content))
        found = self.client.write_registers(self._first(number, start), values, device_id=1)
        assert not found.isError(), found

    def close(self):
        self.client.close()


class OpcUa:
    """The same over OPC UA: a block is a ByteString, of which an index range names the bytes that are written."""

    def __init__(self, host, port):
        self.client = UaClient(f"opc.tcp://{host}:{port}/", timeout=5)
        self.client.connect()

    def read(self, number, start, count):
        return self.client.get_node(f"ns=2;s=DB{number}").read_value()[start:start + count]

    def write(self, number, start, content):
        span = f"{start}:{start + len(content) - 1}" if len(content) > 1 else f"{start}"
        value = ua.DataValue(ua.Variant(content, ua.VariantType.ByteString))
        self.client.get_node(f"ns=2;s=DB{number}").write_attribute(ua.AttributeIds.Value, value, span)

    def close(self):
        self.client.disconnect()


class As511:
    """The same over AS511, as its public descriptions write the bytes down, one step below the other."""

    def __init__(self, device, _):
        self.line = os.open(device, os.O_RDWR | os.O_NOCTTY)

    def step(self, say, due=b""):
        """Say bytes, and take those that are due."""
        os.write(self.line, say)
        return self.take(len(due), due)

    def take(self, count, due=None):
        found = b""
        while len(found) < count:
            assert select([self.line], [], [], 5)[0], f"silence after {found}"
            found += os.read(self.line, count - len(found))
        assert due is None or found == due, (found, due)
        return found

    def function(self, code, body, replies):
        """Run a function, and return what it replies."""
        self.step(b"\x02", b"\x10\x06")
        self.step(bytes([code]), b"\x02")
        self.step(b"\x10\x06", b"\x16\x10\x03")
        self.step(b"\x10\x06" + body.replace(b"\x10", b"\x10\x10") + b"\x10\x04", b"\x10\x06")
        self.take(1, b"\x02")
        data = b""
        if replies:
            os.write(self.line, b"\x10\x06")
            while not data.replace(b"\x10\x10", b"").endswith(b"\x10\x03"):
                data += self.take(1)
            self.step(b"\x10\x06", b"\x02")
        self.step(b"\x10\x06", b"\x12\x10\x03")
        os.write(self.line, b"\x10\x06")
        return data[:-2].replace(b"\x10\x10", b"\x10")

    def _address(self, number):
        return int.from_bytes(self.function(0x1A, bytes([1, 255 if number == OWN else number]), True)[1:3], "big")

    def read(self, number, start, count):
        first = self._address(number) + start
        return self.function(0x04, struct.pack(">HH", first, first + count - 1), True)[5:]

    def write(self, number, start, content):
        self.function(0x03, struct.pack(">H", self._address(number) + start) + content, False)

    def close(self):
        os.close(self.line)


#: what a client meets where the PLC or the link refuses
FAILED = (AssertionError, OSError, S7Error, *UA_ERRORS)

CLIENTS = {"s7": S7, "modbus": Modbus, "opcua": OpcUa, "as511": As511}


@contextmanager
def client(served, protocol="s7"):
    one = CLIENTS[protocol](*served.addresses[protocol])
    try:
        yield one
    finally:
        one.close()


def stepped(asking, scans, upto=0, block=(DB, LENGTH)):
    """Release scans one by one from outside, and return both blocks after each; block: number and bytes, None: the simulator's alone."""
    rows = []
    for number in range(upto + 1, upto + scans + 1):
        asking.write(OWN, 8, struct.pack(">I", number))
        while SimulatorStatus(own := asking.read(OWN, 0, OWN_LENGTH)).intervals < number:
            pass
        rows.append((own, asking.read(block[0], 0, block[1]) if block else b""))
    return rows


def write_design(folder):
    """Write a design as `tune` writes it, and words, into a folder."""
    heater = ("--gain", "0.9", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
    assert main(["tune", *heater, "-o", str(folder / "pid.json"), "--quiet"]) == 0
    words = words_of("s5-ob251")
    (folder / "words.json").write_text(json.dumps({
        "schema": WORDS_SCHEMA, "target": words.target, "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": None}))


@pytest.fixture(scope="session")
def design_folder(tmp_path_factory):
    """A folder with a design as `tune` writes it, and words."""
    folder = tmp_path_factory.mktemp("design")
    write_design(folder)
    return folder


#: a shell that starts the tests behind it has them, and so what they start, ignore Ctrl-C
_HEEDS_CTRL_C = ("import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
                 "from heatertune.cli import main; sys.exit(main())")


@pytest.fixture
def run_simulate(design_folder, tmp_path):
    """Start the command in an empty folder; return process and ports. What is left of it ends with the test."""
    begun = []

    def run(*arguments):
        command = [sys.executable, "-c", _HEEDS_CTRL_C, "simulate", design_folder, "--json", *arguments]
        process = subprocess.Popen(list(map(str, command)), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        begun.append(process)
        lines = []
        while not lines or lines[-1] != "}\n":
            lines.append(process.stdout.readline())
            assert lines[-1], process.stderr.read()
        return process, [where["port"] for where in json.loads("".join(lines))["addresses"].values()]

    run.folder = design_folder
    yield run
    for process in begun:
        process.kill()
        process.communicate()

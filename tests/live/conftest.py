import json
import struct
import subprocess
import sys
from contextlib import contextmanager

import pytest

from heatertune import Fopdt, Scaling, model_by_hand, virtual_plc
from heatertune.cli import main
from heatertune.live.memory import OWN, OWN_LENGTH, Told
from heatertune.pid.values import PidDesign
from heatertune.plc import controller_for
from heatertune.proof.words_file import WORDS_SCHEMA
from heatertune.settings import Conditions

snap7 = pytest.importorskip("snap7.client", reason="python-snap7 is not installed")
S7Error = pytest.importorskip("snap7.error").S7Error
pymodbus = pytest.importorskip("pymodbus.client", reason="pymodbus is not installed")

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


#: what a client meets where the PLC or the link refuses
FAILED = (AssertionError, OSError, S7Error)

CLIENTS = {"s7": S7, "modbus": Modbus}


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
        while Told(own := asking.read(OWN, 0, OWN_LENGTH)).intervals < number:
            pass
        rows.append((own, asking.read(block[0], 0, block[1]) if block else b""))
    return rows


@pytest.fixture(scope="session")
def design_folder(tmp_path_factory):
    """A folder with a design as `tune` writes it, and words."""
    folder = tmp_path_factory.mktemp("design")
    heater = ("--gain", "0.9", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
    assert main(["tune", *heater, "-o", str(folder / "pid.json"), "--quiet"]) == 0
    words = words_of("s5-ob251")
    (folder / "words.json").write_text(json.dumps({
        "schema": WORDS_SCHEMA, "target": words.target, "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": None}))
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

"""awlsim, a second implementation of the S7-300 in the `test` extra."""

import json
import struct
import subprocess
import sys
from pathlib import Path

import pytest

DRIVER = Path(__file__).with_name("awlsim_driver.py")
CODES = {"INT": ">h", "DINT": ">i", "REAL": ">f", "TIME": ">i", "WORD": ">H"}


class Awlsim:
    """An S7-300 that is told what to do, see the driver; without a clock, so the test is it."""

    def __init__(self):
        self._process, self._names = None, {}

    def tell(self, *order):
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, f"awlsim died at {order[0]}, see its stderr"
        return json.loads(answer)

    def load(self, source):
        """Load a source; its data blocks hold what their BEGIN says."""
        assert source.isascii()
        self._names.clear()
        if self._process is None or self._process.poll() is not None:
            self.end()
            self._process = subprocess.Popen([sys.executable, DRIVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.tell("load", source)

    def names(self, number):
        """Byte, bit and type of each member of a data block, as awlsim reckons them."""
        if number not in self._names:
            self._names[number] = self.tell("names", number)
        return self._names[number]

    def block(self, number):
        return bytes.fromhex(self.tell("read", number))

    def read(self, number, name):
        byte, bit, kind = self.names(number)[name]
        memory = self.block(number)
        return memory[byte] >> bit & 1 if kind == "BOOL" else struct.unpack_from(CODES[kind], memory, byte)[0]

    def write(self, number, **members):
        for name, value in members.items():
            self.tell("write", number, name, value)

    def restart(self, reading=0):
        """OB100, with what the data blocks retain; return what OB35 does."""
        return self.tell("ob", 100, 0, reading)

    def tick(self, interval_ms, reading):
        """OB35: return QB 4 as it reached the module, PQW 256 and QB 4 of the process image."""
        return self.tell("ob", 35, interval_ms, reading)

    def end(self):
        if self._process is None:
            return
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait()


@pytest.fixture(scope="module")
def machine():
    """An S7-300; load a source first."""
    made = Awlsim()
    yield made
    made.end()


@pytest.fixture(scope="module")
def awlsim(machine):
    """Run an exported source call by call, one call of the controller each: data blocks and outputs after each.

    rows: [automatic?, SP, PV, manual power or None]. The answer's blocks are those after OB100 and after each OB35.
    restart: reading at OB100; None: it is not run.
    """

    def run(text, rows, block=100, restart=0, tick=None):
        machine.load(text)
        tick = machine.read(101, "TICK_MS") if tick is None else tick
        if restart is not None:
            machine.restart(restart)
        told = {"restart": machine.tell("read", block), "automatic": machine.read(101, "AUTO"), "rows": [], "written": [],
                "offsets": {name: place[:2] for name, place in machine.names(block).items()}}
        for mode, setpoint, reading, output in rows:
            machine.write(101, AUTO=mode, SP=setpoint)
            if output is not None:
                machine.write(101, POWER=output)
            told["written"].append(machine.tick(tick, reading)[1])
            told["rows"].append(machine.tell("read", block))
        return told

    return run

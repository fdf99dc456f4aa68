"""Each way to end a program, at each step of each live command: a table of how many cases were right, and what was wrong.

    python -m tests.bench.signal_table [CASES [SEED [PART OF]]]

A step is a request that reaches the PLC. The ways are SIGINT, SIGTERM, SIGHUP, a terminal that is closed ("terminal": the system's own SIGHUP,
and no terminal any more), and a reader that goes away ("pipe": SIGPIPE). Judged by registers of `tests.bench.gateway`, or, of `write` and
`rollback`, by the memory of a virtual PLC: what stood there stands there again, or the hold is open and the command that ends it does so;
what only reads has written nothing, and its log is whole.
"""

import collections
import contextlib
import fcntl
import json
import os
import pty
import random
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
from pathlib import Path

from heatertune.live.client.connection import address_of
from heatertune.live.hold import Hold, WayBackPart, new_way_back
from heatertune.live.write.write_record import read_lines
from tests.bench.kills import OLD, Written, told
from tests.bench.sessions import folder_in
from tests.bench.signals import AUTOMATIC, BY_HAND, served

WAYS = ("SIGINT", "SIGTERM", "SIGHUP", "terminal", "pipe")
#: command → the last step at which something comes
STEPS = {"record": 8, "watch": 8, "experiment": 20, "experiment --restore": 8, "write": 30, "rollback": 16, "simulate": 4}
_HEEDS = ("import signal, sys; [signal.signal(each, signal.SIG_DFL) for each in (1, 2, 3, 15)]; "
          "from heatertune.cli import main; signal.signal(signal.SIGINT, signal.default_int_handler); sys.exit(main())")
_IN_MANUAL = bytes.fromhex("42b400000001")  # 90 %, by hand


class Program:
    """A command that runs at the end of a terminal or a pipe."""

    def __init__(self, line, way, place):
        self.way, self.log = way, (place / "said.txt").open("w+", encoding="utf-8")
        self.held = None
        command, environment = [sys.executable, "-c", _HEEDS, *map(str, line)], {**os.environ, "PYTHONUNBUFFERED": "1"}
        if way == "terminal":
            self.held, other = pty.openpty()
            self.process = subprocess.Popen(
                command, stdin=other, stdout=other, stderr=self.log, env=environment, start_new_session=True,
                preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0))  # noqa: PLW1509
            os.close(other)
        elif way == "pipe":
            self.held, other = os.pipe()
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=other, stderr=self.log, env=environment)
            os.close(other)
        else:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log, env=environment)
        self.struck = False

    def strike(self):
        """End it, the way that was chosen."""
        if self.struck or self.process.poll() is not None:
            return
        self.struck = True
        if self.held is None:
            self.process.send_signal(getattr(signal, self.way))
        else:
            os.close(self.held)
            self.held = None
        time.sleep(0.05)

    def ended(self, seconds=150):
        """Wait for its end; return status and what it said."""
        try:
            status = self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            status = self.process.wait()
            status = None
        if self.held is not None:
            os.close(self.held)
        self.log.seek(0)
        said = " ".join(self.log.read().split())
        self.log.close()
        return status, said


def at_request(number, act, strikes):
    """Return a hook that counts requests, and strikes at one of them."""
    strikes.setdefault("count", 0)
    lock = threading.Lock()

    def hook(*_):
        with lock:
            strikes["count"] += 1
            now = strikes["count"] == number
        if now:
            act()
    return hook


def open_hold(address):
    """Leave what a killed experiment leaves."""
    part = WayBackPart(BY_HAND.start, AUTOMATIC, {_IN_MANUAL})
    Hold(address_of(address)).open(new_way_back("experiment", address_of(address), 1, [part], "log.csv", 90.0))


def of_gateway(command, number, way, made, place):
    """Run record, watch, experiment or its end; return what is wrong, and whether it was struck."""
    words, gateway = served()
    address, log = f"modbus://127.0.0.1:{gateway.port}/1/0", place / "log.csv"
    (place / "plan.csv").write_text("time_s,power_pct\n" + "".join(f"{at},{90 * (at % 2)}\n" for at in range(6)))
    design = made if command == "watch" else place
    if command != "watch":
        (place / "words.json").write_text(json.dumps({
            "schema": "heatertune/words/2", "target": "weg", "words": dict(words.values), "sample_time_s": words.sample_time_s,
            "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": None}))
    line = {
        "record": ["record", address, "--design", design, "-o", log, "--interval", 0.1, "--duration", 4],
        "watch": ["watch", address, "--design", design, "-o", log, "--duration", 4],
        "experiment": ["experiment", place / "plan.csv", address, "--design", design, "--limit-temperature", 80, "-o", log, "--yes",
                       "--without-dead-man"],
        "experiment --restore": ["experiment", "--restore", address]}[command]
    if command == "experiment --restore":
        gateway.memory[BY_HAND] = _IN_MANUAL
        open_hold(address)
    program = Program(line, way, place)
    strikes = {}
    gateway.looked = gateway.seen = at_request(number, program.strike, strikes)
    status, said = program.ended()
    gateway.looked = gateway.seen = lambda _number: None
    wrong = list(judged(command, status, said, gateway, address, log))
    gateway.close()
    return wrong, program.struck


def judged(command, status, said, gateway, address, log):
    """Yield what is wrong."""
    if status is None:
        yield f"it goes on: {said}"
    if "Traceback" in said or "Exception ignored" in said:
        yield said[-300:]
    if command in ("record", "watch"):
        if gateway.writes:
            yield f"it has written: {gateway.writes}"
        if log.exists() and log.read_bytes()[-1:] not in (b"\n", b""):
            yield "the log ends within a line"
        return
    hold = Hold(address_of(address))
    if hold.way_back() is None and hold.path.exists():
        hold.path.unlink()  # nothing is open; something may still arrive
    if (found := hold.way_back()) is not None:
        again, answer = told(*found.remedy.split()[1:])
        if again or "as before" not in answer:
            yield f"open, and not brought back: {answer}"
    if gateway.memory[BY_HAND] != AUTOMATIC:
        yield f"{gateway.memory[BY_HAND].hex()} stands there: {said}"


def of_words(command, number, way, made, place):
    """Run a write or a rollback; return what is wrong, and whether it was struck."""
    here = Written(made)
    try:
        line = [*here.line, "--no-watch", "--record", place / "r.jsonl"]
        if command == "rollback":
            assert told(*line)[0] == 0
            line = ["rollback", place / "r.jsonl", "--apply", "--yes", read_lines(place / "r.jsonl").begin["sha256"][:8], "--unproven", "--quiet"]
        program, memory = Program(line, way, place), here.plc.plc.memory
        read, write, strikes = memory.read, memory.write, {}
        hook = at_request(number, program.strike, strikes)
        memory.read = lambda *given: (hook(), read(*given))[1]
        memory.write = lambda *given: (hook(), write(*given))[1]
        status, said = program.ended()
        memory.read, memory.write = read, write
        return list(judged_words(command, status, said, here, place)), program.struck
    finally:
        here.plc.close()


def judged_words(command, status, said, here, place):
    """Yield what is wrong: without an open hold all words are of one side, with one the command that it names brings them back."""
    new = {each: here.new[each] for each in OLD}
    stands = {each: here.words[each] for each in OLD}
    if status is None:
        yield f"it goes on: {said}"
    if "Traceback" in said or "Exception ignored" in said:
        yield said[-300:]
    hold = Hold(address_of(here.address))
    if (found := hold.way_back()) is None:
        if stands not in (OLD, new):
            yield f"nothing is open, and {stands} stand there: {said}"
        for head, due in {"DONE:": OLD if command == "rollback" else new, "ROLLED BACK": OLD}.items():
            if said.startswith(head) and stands != due:
                yield f"{head} {stands}: {said}"
        hold.path.unlink(missing_ok=True)
        return
    again, answer = told(*found.remedy.split()[1:], "--apply", "--yes", read_lines(place / "r.jsonl").begin["sha256"][:8], "--unproven")
    stands = {each: here.words[each] for each in OLD}
    if again or stands != OLD:
        yield f"open, and not brought back by {found.remedy}: {stands}: {answer}"


def of_simulate(number, way, made, place):
    """Run a simulator, and strike some time after it began; return what is wrong, and whether it was struck."""
    program = Program(["simulate", made, "--serve", "modbus", "--rate", "100"], way, place)
    time.sleep(0.5 * number)
    program.strike()
    if way == "pipe":  # it has said all that it says, and serves on: nothing tells it that its reader has gone
        time.sleep(5.0)
        program.process.terminate()
    status, said = program.ended(60)
    return [f"{status}: {said[-300:]}"] if status is None or "Traceback" in said else [], program.struck


def case(command, number, way, folders, place):
    """Run one; return what is wrong, and whether it was struck."""
    if command == "simulate":
        return of_simulate(number, way, folders["s5-ob251"], place)
    if command in ("write", "rollback"):
        return of_words(command, number, way, folders["s5-ob251"], place)
    return of_gateway(command, number, way, folders["weg"], place)


def cases():
    """Return all of them: command, step, way."""
    return [(command, number, way) for command, most in STEPS.items() for number in range(1, most + 1) for way in WAYS]


def table(ran, hit, bad):
    """Return the table, a text."""
    rows = [command.ljust(22) + "".join(f"{hit[command, way]}/{ran[command, way]}".rjust(11) for way in WAYS) for command in STEPS]
    last = f"{sum(ran.values())} cases, {sum(hit.values())} struck while the command ran, {bad} wrong"
    return "\n".join(["struck of run".ljust(22) + "".join(way.rjust(11) for way in WAYS), *rows, last])


def main(count=240, seed=1, part=0, parts=1):
    """Print the table, of one part of several that run side by side; return 1 where something was wrong."""
    every, ran, hit, bad = cases(), collections.Counter(), collections.Counter(), 0
    drawn = random.Random(int(seed)).sample(every, min(int(count), len(every)))[int(part)::int(parts)]
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        os.environ["HEATERTUNE_STATE"] = str(root / "state")
        folders = {target: folder_in(root / target, target) for target in ("weg", "s5-ob251")}
        for index, (command, number, way) in enumerate(drawn):
            (place := root / str(index)).mkdir()
            with contextlib.suppress(BrokenPipeError):
                wrong, struck = case(command, number, way, folders, place)
            ran[command, way] += 1
            hit[command, way] += struck
            bad += bool(wrong)
            for each in wrong:
                print(f"{command}, step {number}, {way}: {each}", flush=True)
            if index % 10 == 9:
                print(table(ran, hit, bad), flush=True)
    print(table(ran, hit, bad))
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

"""Experiments that signals end at random moments, one or several, SIGKILL among them, on a PLC without a dead man.

    python -m tests.bench.signals [RUNS [SEED]]
    python -m tests.bench.signals steps [RUNS [SEED]]

`steps` has a signal come at a request of `write` and of `rollback`, on the virtual PLC: each request, each signal. Judged by the registers of a server that shares nothing with heatertune. After a SIGKILL the next command has to name the one that
brings back what stood there, and that one has to do it.
"""

import json
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from heatertune import virtual_plc
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import block_for
from heatertune.live.hold import Hold
from heatertune.live.write.write_record import read_lines
from heatertune.plc import controller_for
from heatertune.proof.words_file import WORDS_SCHEMA
from tests.bench.gateway import Gateway
from tests.bench.kills import OLD, Written, told
from tests.bench.sessions import folder_in
from tests.live.conftest import words_of

#: of a WEG block in the manual's order: ManualSetPoint and SelectSetPoint, Feedback
BY_HAND, FEEDBACK = slice(6, 12), 12
AUTOMATIC = struct.pack(">fH", 0.0, 0)
NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGUSR1", "SIGKILL")
_HEEDS = ("import signal, sys; [signal.signal(each, signal.SIG_DFL) for each in (1, 2, 3, 15)]; "
          "from heatertune.cli import main; sys.exit(main())")


def served():
    """Return a gateway with a WEG block behind it."""
    words = words_of("weg")
    image = bytearray(block_for(controller_for("weg"), words, {}).image())
    image[2:6], image[BY_HAND] = struct.pack(">f", 40.0), AUTOMATIC
    return words, Gateway(bytes(image) + bytes(64), moves=FEEDBACK)


def run(chance, place):
    """Run one experiment; return what was done to it, and what is wrong."""
    words, gateway = served()
    (place / "words.json").write_text(json.dumps({
        "schema": WORDS_SCHEMA, "target": "weg", "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": None}))
    (place / "plan.csv").write_text("time_s,power_pct\n" + "".join(f"{at},{90 * (at % 2)}\n" for at in range(60)))
    address = f"modbus://127.0.0.1:{gateway.port}/1/0"

    def line(log):
        return [sys.executable, "-c", _HEEDS, "experiment", str(place / "plan.csv"), address, "--design", str(place), "--limit-temperature",
                "80", "-o", str(place / log), "--yes", "--without-dead-man", "--quiet"]

    sent = sorted((round(chance.uniform(0.5, 6.0), 2), chance.choice(NAMES)) for _ in range(chance.randint(1, 3)))
    begun = time.monotonic()
    with subprocess.Popen(line("log.csv"), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        for at_s, name in sent:
            time.sleep(max(0.0, begun + at_s - time.monotonic()))
            begins = not gateway.writes and name == "SIGTSTP"  # it stops, and has changed nothing yet
            if process.poll() is None and not begins:
                process.send_signal(getattr(signal, name))
        try:
            said = " ".join(process.communicate(timeout=90)[0].split())
        except subprocess.TimeoutExpired:
            process.kill()
            return sent, "it goes on"
    wrong = ""
    if process.returncode == -signal.SIGKILL:
        again = subprocess.run(line("other.csv"), capture_output=True, text=True, check=False, timeout=90) if gateway.writes else None
        if again is not None and "heatertune experiment --restore" in again.stderr:
            name = again.stderr.strip().rpartition("heatertune ")[2].split()
            subprocess.run([sys.executable, "-m", "heatertune", *name], capture_output=True, check=False, timeout=200)
    elif process.returncode < 0 and gateway.writes:
        wrong = f"ended by a signal: {said}"
    elif "as before" not in said and gateway.writes:
        wrong = f"nothing is said: {said}"
    if gateway.memory[BY_HAND] != AUTOMATIC:
        wrong = f"{gateway.memory[BY_HAND].hex()} stands there: {said}"
    gateway.close()
    return sent, wrong


def at_a_step(made, command, number, name, begun=virtual_plc):
    """Send a signal at a request of a write or a rollback; return what was said, what is wrong, and whether it came in time."""
    here = Written(made, begun)
    sent = []
    try:
        line = list(here.line)
        if command == "rollback":
            assert told(*here.line, "--no-watch")[0] == 0
            digest = read_lines(here.record).begin["sha256"]
            line = ["rollback", here.record, "--apply", "--yes", digest[:8], "--unproven", "--quiet"]
        process = subprocess.Popen([sys.executable, "-c", _HEEDS, *map(str, line)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        memory, seen = here.plc.plc.memory, []
        read, write = memory.read, memory.write

        def at(act):
            def request(*given):
                seen.append(given)
                if len(seen) == number and process.poll() is None:
                    sent.append(name)
                    process.send_signal(getattr(signal, name))
                    time.sleep(0.1)
                return act(*given)
            return request

        memory.read, memory.write = at(read), at(write)
        said = " ".join(process.communicate(timeout=200)[0].split())
        stands = {each: here.words[each] for each in OLD}
        new = {each: here.new[each] for each in OLD}
        due = {"DONE:": OLD if command == "rollback" else new, "ROLLED BACK": OLD, "NOT DONE": new if command == "rollback" else OLD}
        wrong = [f"{head}: {stands}; {said}" for head, words in due.items() if said.startswith(head) and stands != words]
        if process.returncode < 0 and stands not in (OLD, new):
            wrong.append(f"ended by a signal: {stands}; {said}")
        if not said.startswith(("DONE", "ROLLED BACK", "NOT DONE", "UNKNOWN", "PARTLY")) and stands != (new if command == "rollback" else OLD):
            wrong.append(f"nothing is said: {stands}; {said}")
        if Hold(address_of(here.address)).way_back() is not None and not said.startswith(("UNKNOWN", "PARTLY")):
            wrong.append(f"the hold is open: {said}")
        return said, wrong, bool(sent)
    finally:
        here.plc.close()


def steps(runs=60, seed=1):
    """Draw steps of both commands, and signals; return 1 where something was wrong."""
    chance, bad, hit = random.Random(int(seed)), 0, 0
    every = [(command, number, name) for command, most in (("write", 34), ("rollback", 16)) for number in range(1, most + 1)
             for name in ("SIGINT", "SIGTERM", "SIGHUP")]
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HEATERTUNE_STATE"] = str(Path(folder) / "state")
        made = folder_in(Path(folder) / "made")
        for command, number, name in chance.sample(every, min(int(runs), len(every))):
            said, wrong, in_time = at_a_step(made, command, number, name)
            bad, hit = bad + bool(wrong), hit + in_time
            for left in made.glob("write_*"):
                left.unlink()
            print(f"{command}, request {number}, {name}: {wrong or said[:60]}", flush=True)
    print(f"{runs} signals, {hit} of them within the command; {bad} wrong")
    return int(bool(bad))


def main(runs=20, seed=1):
    """Print what was wrong; return 1 where something was."""
    chance, bad = random.Random(int(seed)), 0
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HEATERTUNE_STATE"] = str(Path(folder) / "state")
        for number in range(int(runs)):
            place = Path(folder) / str(number)
            place.mkdir()
            sent, wrong = run(chance, place)
            bad += bool(wrong)
            print(f"{number}: {', '.join(f'{name} at {at_s:g} s' for at_s, name in sent)}: {wrong or 'right'}", flush=True)
    print(f"{runs} experiments, {bad} wrong")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(steps(*sys.argv[2:]) if sys.argv[1:2] == ["steps"] else main(*sys.argv[1:]))

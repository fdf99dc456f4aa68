"""Experiments that signals end at random moments, one or several, SIGKILL among them, on a PLC without a dead man.

    python -m tests.bench.signals [RUNS [SEED]]

Judged by the registers of a server that shares nothing with heatertune. After a SIGKILL the next command has to name the one that
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

from heatertune.live.controller_block import block_for
from heatertune.plc import controller_for
from heatertune.proof.words_file import WORDS_SCHEMA
from tests.bench.gateway import Gateway
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
    sys.exit(main(*sys.argv[1:]))

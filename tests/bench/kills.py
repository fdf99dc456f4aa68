"""Kills a fleet and a study at random moments, many times each, and holds what they write against undisturbed runs.

    python tests/bench/kills.py LOGS [--kills 20] [--seed 1]

LOGS is what `heatertune fleet` takes. The tests do the same with the machinery under both commands, and kill each command
once. Ends with status 1 where a byte differs.
"""

import argparse
import itertools
import random
import subprocess
import sys
import tempfile
from pathlib import Path

LONGEST_S = 8.0  # until a kill; the first seconds are start-up
FLEET = ("--target", "s7-300", "--method", "simc", "--setpoint", "45")
STUDY = """\
[fixed]
gain_degC_per_pct = 0.37
time_constant_s = 167
dead_time_s = 12
ambient_degC = 22
method = "simc"
setpoint_degC = 40
[grid]
target = ["s5-ob251", "s7-300", "weg"]
pwm_period_s = [2, 5, 10, 10.5]
closed_loop_s = [12, 20, 30, 40, 60]
"""


def run_through(command, table, kills, chance):
    """Start a command, killed so many times at the most, until it ends; return how often it was killed, and its bytes."""
    for killed in itertools.count():
        process = subprocess.Popen([*command, "-o", str(table), "--quiet", "--resume"], stdout=subprocess.DEVNULL)
        try:
            process.wait(timeout=chance.uniform(0.0, LONGEST_S) if killed < kills else None)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            continue
        if process.returncode:
            sys.exit(f"{' '.join(command)}: exit status {process.returncode}")
        found = table.read_bytes()
        table.unlink()
        return killed, found
    raise AssertionError


def main():
    """Run both; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", metavar="LOGS")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    settings = parser.parse_args()
    chance, same = random.Random(settings.seed), True
    with tempfile.TemporaryDirectory() as folder:
        study, table = Path(folder, "study.toml"), Path(folder, "table.parquet")
        study.write_text(STUDY)
        for name, given in (("fleet", (settings.logs, *FLEET)), ("study", (str(study),))):
            command = [sys.executable, "-m", "heatertune", name, *given]
            _, whole = run_through(command, table, 0, chance)
            killed, runs, equal = 0, 0, True
            while killed < settings.kills:
                times, found = run_through(command, table, settings.kills - killed, chance)
                killed, runs, equal = killed + times, runs + 1, equal and found == whole
            print(f"{name}: killed {killed} times in {runs} runs, {'the same bytes' if equal else 'OTHER bytes'}", flush=True)
            same &= equal
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())

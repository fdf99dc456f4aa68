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


def run_through(command, kills, chance):
    """Start a command until it ends by itself; return how often it was killed before."""
    longest = 8.0  # s; the first seconds are start-up
    for done in itertools.count():
        process = subprocess.Popen([*command, "--quiet", "--resume"], stdout=subprocess.DEVNULL)
        try:
            process.wait(timeout=chance.uniform(0.0, longest) if done < kills else None)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            continue
        if process.returncode:
            sys.exit(f"{' '.join(command)}: exit status {process.returncode}")
        return done
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
        study = Path(folder, "study.toml")
        study.write_text(STUDY)
        for name, given in (("fleet", (settings.logs, *FLEET)), ("study", (str(study),))):
            tables = {kills: Path(folder, f"{name}{kills}.parquet") for kills in (0, settings.kills)}
            killed = [run_through([sys.executable, "-m", "heatertune", name, *given, "-o", str(table)], kills, chance)
                      for kills, table in tables.items()]
            equal = len({table.read_bytes() for table in tables.values()}) == 1
            print(f"{name}: killed {killed[1]} times, {'the same bytes' if equal else 'OTHER bytes'}")
            same &= equal
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())

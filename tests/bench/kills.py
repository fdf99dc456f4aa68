"""Kill -9 of `record` and `experiment` at random moments: whole rows, one torn line at most, and the PLC as it was found.

    python -m tests.bench.kills [KILLS [SEED]]

What the PLC holds is read from the simulator's memory. `tests/bench/sessions.py` does the same with `write`.
"""

import random
import subprocess
import sys
import tempfile
from pathlib import Path

from heatertune import Fopdt, model_by_hand, virtual_plc
from heatertune.live.experiment import before_of, restore
from heatertune.log.cells import read_sheet
from tests.live.conftest import CONDITIONS, words_of, write_design

#: STEU and YH in OB251's block (S5-115U manual, table 11-9: DW11, DW12), and the bit that says automatic
CELLS = slice(22, 26)
AUTOMATIC = 1


def command(name, plc, folder, path, *more):
    """Return the command line; `more` comes before the address."""
    host, port = plc.addresses["s7"]
    return [sys.executable, "-m", "heatertune", name, *more, f"s7://{host}:{port}/0/2/db30", "--design", str(folder),
            "-o", str(path), "--quiet"]


def killed(line, path, grown):
    """Run a command, and kill it when its log has grown by so many bytes."""
    size = path.stat().st_size if path.exists() else 0
    with subprocess.Popen(line) as running:
        while not path.exists() or path.stat().st_size < size + grown:
            assert running.poll() is None, "it ended by itself"
        running.kill()


def of_record(plc, folder, path, kills, chance):
    """Kill a recorder that continues its file each time."""
    for _ in range(kills):
        killed([*command("record", plc, folder, path), "--append"], path, chance.randrange(1, 3000))
        whole = [line.split(",") for line in path.read_text().split("\n")[:-1] if line[:1].isdigit() and not line.endswith("#torn")]
        assert read_sheet(path).rows == whole
        assert {len(row) for row in whole} <= {4}
        times = [float(row[0]) for row in whole]
        assert times == sorted(set(times))


def of_experiment(begun, folder, words, place, kills, chance):
    """Kill experiments; `begun` begins a PLC that `close` ends."""
    plan = place / "plan.csv"
    plan.write_text("time_s,power_pct\n0,10\n100,60\n100000,20\n")
    for number in range(kills):
        plc, path = begun(), place / f"{number}.csv"
        before = plc.plc.memory.image()[CELLS]
        line = [*command("experiment", plc, folder, path, str(plan)), "--limit-temperature", "90", "--yes"]
        killed(line, path, chance.randrange(0, 4000))
        while not plc.plc.memory.image()[CELLS][1] & AUTOMATIC:  # the dead man
            pass
        assert before_of(path).exists()
        again = subprocess.run(line, capture_output=True, text=True, check=False)
        assert again.returncode == 2
        assert "was cut off; bring back" in again.stderr
        assert restore(path, words)[0] is True
        assert plc.plc.memory.image()[CELLS] == before
        assert not before_of(path).exists()
        plc.close()


def main(kills, seed):
    """Kill each command so many times."""
    chance, words = random.Random(seed), words_of("s5-ob251")
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))

    def begun(**changed):
        return virtual_plc(words, heater, CONDITIONS, **{"rate": 2000.0} | changed)

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        write_design(place)
        with begun() as plc:
            of_record(plc, place, place / "log.csv", kills, chance)
        of_experiment(lambda: begun(dead_man=200), place, words, place, kills, chance)
    print(f"{kills} kills of record, {kills} of experiment: rows whole, the PLC as it was found")
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 30, int(sys.argv[2]) if len(sys.argv) > 2 else 1))

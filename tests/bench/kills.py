"""Kill -9 of each command that meets a PLC, at random moments: the PLC safe, files whole, and the next start says what happened.

    python -m tests.bench.kills [KILLS [SEED [COMMAND …]]]

What the PLC holds is read from the simulator's memory, with the manual's places of the words as `tests/bench/sessions.py` has them.
"""

import contextlib
import io
import json
import os
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

from heatertune import Fopdt, model_by_hand, virtual_plc
from heatertune.cli import main as run_here
from heatertune.live import hold, recorder
from heatertune.live.client.connection import address_of
from heatertune.live.controller_block import places_of
from heatertune.live.experiment import restore
from heatertune.live.hold import Hold
from heatertune.live.serve import read_folder
from heatertune.live.write.write_record import Budget, read_lines
from heatertune.log.cells import read_sheet
from tests.bench.sessions import folder_in, is_stable, words_in
from tests.live.conftest import CONDITIONS, words_of, write_design

#: STEU and YH in OB251's block (S5-115U manual, table 11-9: DW11, DW12), and the bit that says automatic
CELLS = slice(22, 26)
AUTOMATIC = 1
#: words that a write finds; of these K first would be unstable
OLD = {"K": 1200, "TI": 110, "YH": 200}
_LOOK_S = 0.0005


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
            time.sleep(_LOOK_S)  # the processor is for the command
        running.kill()


def whole(path):
    """Hold a log to have whole rows alone but for the torn ones that are marked, each later than the one before."""
    rows = [line.split(",") for line in path.read_text().split("\n")[:-1] if line[:1].isdigit() and not line.endswith("#torn")]
    sheet = read_sheet(path)
    assert [sheet.row(k) for k in range(len(sheet))] == rows
    assert {len(row) for row in rows} <= {4}
    times = [float(row[0]) for row in rows]
    assert times == sorted(set(times))


def told(*line):
    """Run a command here; return its exit status and all that it printed, in one line."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = run_here([str(each) for each in line])
    return status, " ".join(said.getvalue().split())


def of_record(plc, folder, path, kills, chance, name="record"):
    """Kill a recorder, or a watch, that continues its file each time."""
    before, written = plc.plc.memory.image()[:CELLS.stop], []
    plc.plc.memory.write = lambda *given: written.append(given)  # it only reads
    for _ in range(kills):
        killed([*command(name, plc, folder, path), "--append"], path, chance.randrange(1, 3000))
        whole(path)
        status, said = told(*command(name, plc, folder, path)[3:])
        assert status == 2
        assert "is there already, with" in said, said
    assert not written
    assert plc.plc.memory.image()[:CELLS.stop] == before


def of_experiment(begun, folder, place, kills, chance):
    """Kill experiments; `begun` begins a PLC that `close` ends."""
    plan = place / "plan.csv"
    plan.write_text("time_s,power_pct\n0,10\n100,60\n100000,20\n")
    for number in range(kills):
        plc, path = begun(), place / f"{number}.csv"
        before = plc.plc.memory.image()[CELLS]
        line = [*command("experiment", plc, folder, path, str(plan)), "--limit-temperature", "90", "--yes"]
        killed(line, path, chance.randrange(0, 4000))
        while not plc.plc.memory.image()[CELLS][1] & AUTOMATIC:  # the dead man
            time.sleep(_LOOK_S)
        where = address_of(plc.urls["s7"])
        assert Hold(where).way_back() is not None
        again = subprocess.run(line, capture_output=True, text=True, check=False)
        assert again.returncode == 2
        assert "has not ended" in again.stderr
        assert restore(where) is True
        assert plc.plc.memory.image()[CELLS] == before
        assert Hold(where).way_back() is None
        plc.close()


def asked(process, memory, number):
    """Kill a process at its request of that number."""
    seen, read, write = [], memory.read, memory.write

    def at(act):
        def request(*given):
            seen.append(given)
            if len(seen) == number:
                process.kill()
                process.wait()
            return act(*given)
        return request

    memory.read, memory.write = at(read), at(write)


class Written:
    """A virtual PLC with old words, and the commands on it, in a folder with words and their proof."""

    def __init__(self, made, begun=virtual_plc):
        words, model, conditions = read_folder(made)
        self.made, self.new = made, words.values
        self.plc = begun(replace(words, values={**words.values, **OLD}), model, conditions, serve="s7", rate=1500)
        self.address = self.plc.urls["s7"]
        digest = json.loads((made / "data" / "proof.json").read_text())["digest"].partition(":")[2]
        self.line = ["write", made, self.address, "--range", "0", "100", "--apply", "--yes", digest[:8], "--quiet"]

    @property
    def words(self):
        return words_in(self.plc.plc.memory.image())

    @property
    def record(self):
        """The record of the write, if there is one that has begun."""
        own = [path for path in self.made.glob("write_*.jsonl") if self.address in path.read_text()]
        return own[0] if own else None

    def killed(self, line, at):
        """Run a command, and kill it at its request of that number; return whether that ended it."""
        process = subprocess.Popen([sys.executable, "-m", "heatertune", *map(str, line)], stdout=subprocess.DEVNULL)
        asked(process, self.plc.plc.memory, at)
        return process.wait() < 0

    def judged(self):
        """Hold what stands there to be of one side or the other, and stable; and the count of writes to be whole."""
        stands = self.words
        assert all(stands[name] in (before, self.new[name]) for name, before in OLD.items()), stands
        assert is_stable(stands), stands
        Budget(address_of(self.address), 30).counts()
        return stands

    def put_back(self, died):
        """Hold the next start to say what happened, and put back what was."""
        _, said = told("rollback", self.record, "--quiet")
        assert ("it broke off at" in said) == (not read_lines(self.record).complete), said
        assert died or "it ended at" in said, said
        digest = read_lines(self.record).begin["sha256"]
        assert told("rollback", self.record, "--apply", "--yes", digest[:8], "--unproven", "--quiet")[0] == 0
        assert self.words == {**self.words, **OLD}


def of_write(made, kills, chance, begun=virtual_plc):
    """Kill writes; return how many a kill ended."""
    died = 0
    for _ in range(kills):
        here = Written(made, begun)
        ended = here.killed(here.line, chance.randint(1, 40))
        died += ended
        stands = here.judged()
        if here.record is None:
            assert stands == {**stands, **OLD}
        else:
            said = told(*here.line[:3])[1]
            assert (f"bring back what stood there before: heatertune rollback {here.record}" in said) == (not read_lines(here.record).complete), said
            here.put_back(ended)
        here.plc.close()
    return died


def of_rollback(made, kills, chance, begun=virtual_plc):
    """Kill rollbacks; return how many a kill ended."""
    died = 0
    for _ in range(kills):
        here = Written(made, begun)
        assert told(*here.line, "--no-watch")[0] == 0
        digest = read_lines(here.record).begin["sha256"]
        ended = here.killed(["rollback", here.record, "--apply", "--yes", digest[:8], "--unproven", "--quiet"], chance.randint(1, 15))
        died += ended
        here.judged()
        here.put_back(ended)
        here.plc.close()
    return died


def of_simulate(folder, words, place, kills, chance):
    """Kill virtual PLCs, most while a recorder looks: neither port nor file is left, the recording is whole, and another one begins."""
    empty = place / "empty"
    empty.mkdir()
    for number in range(kills):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        line = [sys.executable, "-m", "heatertune", "simulate", str(folder), "--port", str(port), "--rate", "2000", "--json"]
        path, ends, trouble = place / f"simulate{number}.csv", threading.Event(), []

        def shown(so_far, ends=ends, trouble=trouble):
            trouble.extend([so_far.trouble] * bool(so_far.trouble))
            if so_far.trouble:
                ends.set()

        with subprocess.Popen(line, cwd=empty, stdout=subprocess.PIPE) as running:
            if number % 5:
                assert running.stdout.readline()  # it serves
                given = recorder.RecordingSetup(timeout_s=0.5)
                looking = threading.Thread(target=recorder.record, args=(address_of(f"s7://127.0.0.1:{port}/0/2/db30"), path,
                                           places_of(words), given), kwargs={"shown": shown, "ended": ends.is_set})
                looking.start()
                grown = chance.randrange(1, 3000)
                while not path.exists() or path.stat().st_size < grown:
                    assert looking.is_alive()
                    time.sleep(_LOOK_S)
            else:
                ends.wait(chance.uniform(0.0, 1.5))  # while it begins
            running.kill()
        if number % 5:
            looking.join()
            assert trouble
            whole(path)
        assert not list(empty.iterdir())
        with socket.socket() as nobody:
            assert nobody.connect_ex(("127.0.0.1", port)) != 0
        again = subprocess.run([*line, "--scans", "3"], cwd=empty, capture_output=True, check=False)
        assert again.returncode == 0, again.stderr


COMMANDS = ("record", "watch", "experiment", "write", "rollback", "simulate")


def main(kills=30, seed=1, *names):
    """Kill each command so many times."""
    kills, chance, words = int(kills), random.Random(int(seed)), words_of("s5-ob251")
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))

    def begun(**changed):
        return virtual_plc(words, heater, CONDITIONS, **{"rate": 2000.0} | changed)

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        os.environ["HEATERTUNE_STATE"] = str(place / "state")
        hold.LATE_S = 0.3
        design = place / "design"
        design.mkdir()
        write_design(design)
        made = folder_in(place / "proven")
        for name in names or COMMANDS:
            ended = None
            if name in ("record", "watch"):
                with begun() as plc:
                    of_record(plc, made if name == "watch" else design, place / f"{name}.csv", kills, chance, name)
            elif name == "experiment":
                of_experiment(lambda: begun(dead_man=200), design, place, kills, chance)
            elif name == "simulate":
                of_simulate(design, words, place, kills, chance)
            else:
                ended = {"write": of_write, "rollback": of_rollback}[name](made, kills, chance)
            print(f"{kills if ended is None else ended} of {kills} runs of {name} ended by a kill: the PLC safe, files whole, and the next "
                  "start said what had happened", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

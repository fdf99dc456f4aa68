"""The manual's table of speeds, measured and printed by one command: python -m tests.bench.speeds.

    python -m tests.bench.speeds              all rows: some six minutes on an idle machine of two cores
    python -m tests.bench.speeds fit verify   the rows with such a word in their first or last cell

What a row needs beside `pip install '.[bench]'`: gcc for C, Chromium for the studio, a network for the installation.
A cell is a text with a place for each figure, so `test_speeds.py` can compare the manual's table with it: the same rows,
the same words, figures where figures belong. Of whole commands it is the median of some runs, in turn with the others,
after one that keeps what they compile; all rows share one folder of what is kept, empty at first. What is being measured,
every run of a command, and the least and the most of them are told on stderr.
"""

import atexit
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from pathlib import Path

BEGUN = time.perf_counter()
ROOT = Path(__file__).parents[2]
HEAD = "| what | heatertune | for comparison | measured by |\n| --- | --- | --- | --- |"
FIGURE = r"\d[\d,]*(?:\.\d+)?"
TURNS = 3
STAGES = ("fit table4 -o model.json", "tune model.json -o pid.json", "verify hand.json --target s5-ob251 --setpoint 40",
          "export-db hand.json --target s5-ob251 --setpoint 40 --force -o db/")
DESIGNS = ("design table4 --target s5-ob251 --out x/", "design table4 --target s7-300 --out y/", "compare y/data/pid.json -o z/")
HAND = "--gain 0.37 --time-constant 167 --dead-time 12 --ambient 22"


@dataclass(frozen=True)
class Row:
    """A row of the table: `{}` in `ours` and `beside` is a figure; `measure` gives the figures of both, in order."""

    what: str
    ours: str
    beside: str
    by: str
    measure: object

    def told(self):
        """Return the row as the manual shows it."""
        figures = iter(self.measure())
        return re.sub(r"\{\}", lambda _: figure(next(figures)), self._line())

    def form(self):
        """Return the pattern of such a row."""
        return FIGURE.join(map(re.escape, self._line().split("{}")))

    def _line(self):
        return "|" + "".join(f" {cell} |" if cell else " |" for cell in (self.what, self.ours, self.beside, self.by))


def told(line):
    """Tell who waits what is being done."""
    print(line, file=sys.stderr, flush=True)


def figure(value):
    """Return a number with two digits that say something, thousands apart."""
    digits = float(f"{value:.2g}")
    return f"{digits:,.0f}" if digits >= 10.0 else f"{digits:g}"


def spent(*command, cache=None, where=None):
    """Return processor seconds and seconds of a whole process; `cache`: the folder of what is kept."""
    environment = os.environ | ({} if cache is None else {"HEATERTUNE_CACHE": str(cache)})
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    ended = subprocess.run(command, env=environment, cwd=where, capture_output=True, text=True, check=False)
    after, seconds = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begun
    if ended.returncode not in (0, 1):  # 1: a verdict that is not PASS
        raise SystemExit(f"{' '.join(command)}: {ended.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, seconds


@cache
def place():
    """Return the folder of this run, in which all commands run, and `kept` in it; it goes with the process."""
    folder = tempfile.TemporaryDirectory(prefix="speeds")
    atexit.register(folder.cleanup)
    os.environ["HEATERTUNE_CACHE"] = f"{folder.name}/kept"  # for what rows compute in this process, too
    return Path(folder.name)


def heatertune(line):
    """Return processor seconds and seconds of a command."""
    found = spent(sys.executable, "-m", "heatertune", *line.split(), cache=place() / "kept", where=place())
    told(f"  {found[0]:6.2f} s of processor time, {found[1]:6.2f} s: heatertune {line}")
    return found


@contextmanager
def results_aside():
    """Keep nothing but machine code."""
    kept, aside = place() / "kept", place() / "aside"
    aside.mkdir(exist_ok=True)
    for result in kept.glob("*.json"):
        result.rename(aside / result.name)
    yield
    for result in aside.iterdir():
        result.rename(kept / result.name)


def first_design():
    """Return the processor seconds of a design for which nothing is kept."""
    return heatertune("design table4 --target s5-ob251 --out x/")[0]


def whole_commands():
    """Return command → processor seconds of its runs, "anew: " before those which had only code kept.

    A turn runs each once, so that what slows the machine down for a while slows them all; the first keeps what is compiled.
    """
    once(first_design)
    heatertune(f"tune {HAND} -o hand.json")
    found = defaultdict(list)
    for turn in range(1 + TURNS):
        for line in (*STAGES, *DESIGNS):
            runs = [(line, nullcontext())] + ([(f"anew: {line}", results_aside())] if line in STAGES else [])
            for name, around in runs:
                with around:
                    seconds = heatertune(line)[0]
                if turn > 0:
                    found[name].append(seconds)
    return found


def of_commands(*names):
    """Return the median of the runs of each, and tell the least and the most as well."""
    found = once(whole_commands)
    for name in names:
        told(f"  least, median, most: {' '.join(f'{end(found[name]):.2f}' for end in (min, statistics.median, max))} s of {name}")
    return [statistics.median(found[name]) for name in names]


def loops():
    """Return figures of the closed loop: heatertune's PI, WEG and OB251, each alone and judged; then the rivals'."""
    sys.path.insert(0, str(Path(__file__).parent))
    import loop  # noqa: PLC0415 - needs simple-pid and a C compiler
    import yardsticks  # noqa: PLC0415

    loop.dispatch._PLAIN_SCANS = -1
    with tempfile.TemporaryDirectory() as folder:
        rivals = {name: ns for name, (_, ns) in loop.rivals(yardsticks.Compiled(folder), slow=True).items()}
    own = {name: (each.ns(), each.ns(measures=True), each.plain_ns())
           for name, each in {"pi": loop.Ours.pi(), "weg": loop.Ours.of("weg"), "ob251": loop.Ours.of("s5-ob251")}.items()}
    drawn = loop.samples("weg", 10_000, len(os.sched_getaffinity(0)))
    return own, rivals, drawn


def pi_loop():
    own, rivals, _ = once(loops)
    return *own["pi"][:2], rivals["C, scalar"], rivals["C, 16 lanes"], rivals["plain_python"], rivals["simple_pid"]


def rooms():
    own = once(loops)[0]
    return own["weg"][0], own["ob251"][0], own["weg"][1], own["ob251"][1], own["weg"][2], own["ob251"][2]


def solvers():
    rivals = once(loops)[1]
    return rivals["control_discrete"], 1e-6 * rivals["control_with_pwm"], 1e-6 * rivals["solve_ivp"]


def descents():
    sys.path.insert(0, str(Path(__file__).parent))
    import fit  # noqa: PLC0415 - beside its only use

    own, rival = ([fit.seconds(work, fit.made(rows), 5)[0] for rows in (300, 100_000)] for work in (fit.one_descent, fit.by_lfilter))
    return *(1e3 * each for each in own), *(theirs / ours for theirs, ours in zip(rival, own, strict=True))


def whole_fit():
    from heatertune.bench import speed  # noqa: PLC0415 - beside its only use

    return (1e-3 * speed("weg", 100).fit_ms["100000"].median,)


def optima():
    from tests.bench import optimum  # noqa: PLC0415 - beside its only use

    ours, rival = {"pi": [], "pid": []}, []
    for structure, found in ours.items():
        for dead in (0.1, 0.3, 1.0, 3.0):
            problem, _ = optimum.case(dead, structure)
            fresh = iter([optimum.unsolved(dead * (1.0 + 1e-9 * k), structure) for k in range(10)])
            found.append(optimum.timed(lambda fresh=fresh: optimum.optimum(next(fresh)), 10)[0])
            theirs, _ = optimum.timed(lambda p=problem, d=dead, s=structure: optimum.by_slsqp(p, d, s), 3)
            rival.append(theirs / found[-1])
    return *(1e3 * end(found) for found in ours.values() for end in (min, max)), min(rival), max(rival)


def zone():
    from tests.bench import zones  # noqa: PLC0415 - needs pyarrow

    spent = []
    for samples in (200, 0):
        settings = zones.settings_of(["--samples", str(samples)])
        with tempfile.TemporaryDirectory() as folder:
            for count in (1, 100):
                told(f"  {count} zones, {samples} samples")
                seconds, _, _ = zones.run(Path(folder), count, settings)
        spent.append(seconds / 100)
    return spent


def studio():
    told = subprocess.run([sys.executable, str(Path(__file__).with_name("studio.py")), "s5-ob251"], capture_output=True,
                          text=True, check=True).stdout
    row = next(line.split() for line in told.splitlines() if line.startswith("s5-ob251"))
    return float(row[-2]), float(row[4])  # controller, verdict, n, least, median, …, look, proof


def from_nothing():
    with tempfile.TemporaryDirectory() as folder:
        python = Path(folder) / "env" / "bin" / "python"
        steps = []
        for step in (f"python3 -m venv {python.parents[1]}", f"{python} -m pip install {ROOT}",
                     f"{python} -m heatertune design table4 --target s5-ob251 --out {folder}"):
            steps.append(spent(*step.split(), cache=Path(folder) / "cache"))
            told(f"  {steps[-1][0]:6.2f} s of processor time, {steps[-1][1]:6.2f} s: {step}")
    cpu = [each[0] for each in steps]
    return sum(cpu), *cpu


def samples():
    once(whole_commands)
    return [heatertune("verify hand.json --target s5-ob251 --setpoint 40 --samples 10000")[1] for _ in range(2)][1:]


def helps():
    bare = "import argparse; argparse.ArgumentParser().parse_args()"
    found = [(1e3 * spent(sys.executable, "-m", "heatertune", "--help")[1], 1e3 * spent(sys.executable, "-c", bare)[1])
             for _ in range(9)]
    return tuple(statistics.median(each) for each in zip(*found, strict=True))


_kept = {}


def once(work):
    """Return what a measurement gave, which serves several rows."""
    if work not in _kept:
        _kept[work] = work()
    return _kept[work]


ROWS = (
    Row("closed loop with a PI, per scan; with its measurements", "{} ns; {} ns",
        "C `-O3` {} ns, in 16 lanes {} ns; plain Python {} ns; simple-pid {} ns", "`tests/bench/loop.py`", pi_loop),
    Row("the same with WEG's block, with OB251", "{} ns, {} ns; {} ns, {} ns", "in plain Python {} ns, {} ns",
        "`tests/bench/loop.py`", rooms),
    Row("the same by solvers, per scan", "",
        "python-control without PWM {} ns, from edge to edge {} ms; SciPy's `solve_ivp` {} ms",
        "`tests/bench/loop.py --slow`", solvers),
    Row("10,000 drawn heaters, a loop of 3,000 s each", "{} s", "", "`tests/bench/loop.py`", lambda: once(loops)[2:]),
    Row("the same through the whole test sequence of a proof, under six settings each", "{} s", "",
        "`time heatertune verify pid.json --target s5-ob251 --setpoint 40 --samples 10000`", samples),
    Row("one descent of a fit, 300 and 100,000 rows", "{} ms, {} ms", "SciPy's `curve_fit` around `lfilter` {} and {} times",
        "`tests/bench/fit.py`", descents),
    Row("whole fit of 100,000 rows", "{} s", "", "`heatertune bench`", whole_fit),
    Row("the first design after the installation; the same again, its fit cached", "{} s; {} s of processor time", "",
        "`time heatertune design table4 --target s5-ob251 --out x/`", lambda: (once(first_design), *of_commands(DESIGNS[0]))),
    Row("whole commands, everything cached: `fit`, `tune`, `verify`, `export-db`",
        "{} s, {} s, {} s, {} s of processor time", "", "`time` before each", lambda: of_commands(*STAGES)),
    Row("the same, only their machine code cached", "{} s, {} s, {} s, {} s of processor time", "", "`time` before each",
        lambda: of_commands(*(f"anew: {line}" for line in STAGES))),
    Row("a design proven in 72 runs, with the exported text executed, the comparison and the report; its fit cached",
        "{} s of processor time", "", "`time heatertune design table4 --target s7-300 --out x/`", lambda: of_commands(DESIGNS[1])),
    Row("the same design on every controller, each with its proof", "{} s of processor time", "",
        "`time heatertune compare x/pid.json -o y/`", lambda: of_commands(DESIGNS[2])),
    Row("constrained optimum of a PI, of a PID", "{} to {} ms, {} to {} ms", "SLSQP {} to {} times",
        "`tests/bench/optimum.py`", optima),
    Row("fleet, a zone: 240 rows to proven parameters, on 200 drawn heaters under nine settings; without these", "{} s; {} s", "",
        "`tests/bench/zones.py 100`", zone),
    Row("studio: first look at a moved design; from the slider to its picture", "{} ms; {} ms", "",
        "`tests/bench/studio.py`", studio),
    Row("from nothing to the first verdict: `python3 -m venv`, `pip install .`, the first design",
        "{} s of processor time", "{} s, {} s, {} s", "`time` before each", from_nothing),
    Row("`heatertune --help`", "{} ms", "Python with argparse {} ms", "`time heatertune --help`", helps),
)


def main():
    asked = sys.argv[1:]
    print(HEAD)
    for row in ROWS:
        if not asked or any(word in f"{row.what} {row.by}" for word in asked):
            told(f"{time.perf_counter() - BEGUN:4.0f} s: {row.what}")
            print(row.told(), flush=True)
    told(f"{time.perf_counter() - BEGUN:4.0f} s: done")


if __name__ == "__main__":
    main()

"""One log written in other ways gives the same heater: thinned to its changes, late by a row, as means, in two files.

Real logs are read where they lie beside the project, drawn ones come from `on_change.py`. Each is written again and fitted;
the intervals have to meet those of the log as it was, and of a drawn heater hold the truth. By hand:

    python -m tests.bench.thinning real [WORD]              the real logs, or those with this word in their names
    python -m tests.bench.thinning [COUNT] [FIRST]          so many drawn logs from a seed on
    python -m tests.bench.thinning accused [COUNT] [FIRST]  is a heater said to have stopped in drawn logs of means and late rows?

Each outcome is printed when it is there. A fit of a real log ends after 90 s of processor time, as "no end".
"""

from __future__ import annotations

import os
import pickle
import random
import resource
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import FittedModel
from heatertune.model.power.changed_heater import opening
from heatertune.model.power.explanation import clean_log
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from tests.bench import on_change

REAL = Path(__file__).parents[3] / "shared" / "data" / "logs"
BOUND_S = 90  # processor time of a fit of a real log
#: what the reader asks for of real logs, as their README and titles say
READ: dict[str, dict[str, Any]] = {
    "reaction_curve_semicolon_no_time": {"sample_time_s": 1.0},
    "tclab_step_fahrenheit_millivolt": {"power_full_scale": 255.0, "temperature_unit": "degF"},
    "tclab_step_kelvin_pwm255": {"temperature_unit": "K", "power_full_scale": 255.0},
}
#: what the fit asks for: of constant power, the temperature without it, that of the first row
FIT: dict[str, dict[str, Any]] = {
    "kantor_tclab_step2": {"ambient_degC": 21.54}, "kantor_tclab_step3": {"ambient_degC": 22.51}}


@dataclass(frozen=True, kw_only=True)
class Rows:
    """A log as a logger that forgets nothing would have it: shape (n,) each.

    Attributes:
        time_s, temperature_degC: of the readings [s, °C].
        power_s, power_pct: instants at which the power changes, and to what [s, %]; shape (m,).
    """

    time_s: np.ndarray
    temperature_degC: np.ndarray
    power_s: np.ndarray
    power_pct: np.ndarray

    def power(self, at_s: np.ndarray) -> np.ndarray:
        """Return the power at instants [%]."""
        return self.power_pct[np.maximum(np.searchsorted(self.power_s, at_s + 1e-9, side="right") - 1, 0)]

    def mean_power(self, at_s: np.ndarray) -> np.ndarray:
        """Return the mean of the power over the interval before each instant [%]."""
        edges = np.concatenate([[at_s[0] - (at_s[1] - at_s[0])], at_s])
        energy = np.concatenate([[0.0], np.cumsum(np.diff(self.power_s) * self.power_pct[:-1])])

        def until(instant: np.ndarray) -> np.ndarray:
            place = np.maximum(np.searchsorted(self.power_s, instant, side="right") - 1, 0)
            return energy[place] + (instant - self.power_s[place]) * self.power_pct[place]

        return np.diff(until(edges)) / np.diff(edges)


def rows_of(log: Log) -> Rows:
    """Return the rows of a log whose power is written with each reading."""
    assert log.power_pct is not None
    changed = np.concatenate([[True], np.diff(log.power_pct) != 0.0])
    return Rows(time_s=log.time_s, temperature_degC=log.temperature_degC, power_s=log.time_s[changed], power_pct=log.power_pct[changed])


def drawn_rows(case: on_change.Case, seed: int) -> Rows:
    """Return the rows of a drawn heater; readings at each interval."""
    times, values = on_change.readings(case, seed)
    at, power = (np.array(column) for column in zip(*case.plan, strict=True))
    return Rows(time_s=times, temperature_degC=values, power_s=at, power_pct=power)


def _table(*columns: tuple[str, np.ndarray]) -> str:
    lines = (",".join(f"{value:.10g}" for value in row) for row in zip(*(values for _, values in columns), strict=True))
    return "\n".join([",".join(name for name, _ in columns), *lines]) + "\n"


def plain(rows: Rows) -> list[str]:
    """A row for each reading, with the power of that instant."""
    return [_table(("time_s", rows.time_s), ("temp_C", rows.temperature_degC), ("power_pct", rows.power(rows.time_s)))]


def late(rows: Rows) -> list[str]:
    """The same with the power of the row before."""
    power = rows.power(rows.time_s)
    return [_table(("time_s", rows.time_s), ("temp_C", rows.temperature_degC), ("power_pct", np.concatenate([power[:1], power[:-1]])))]


def mean(rows: Rows) -> list[str]:
    """The same with the mean of the power since the row before."""
    return [_table(("time_s", rows.time_s), ("temp_C", rows.temperature_degC), ("power_pct", rows.mean_power(rows.time_s)))]


def mean_both(rows: Rows) -> list[str]:
    """Every fourth row, with the means of temperature and power since the row before."""
    count = len(rows.time_s) // 4
    at = rows.time_s[3:4 * count:4]
    temperature = rows.temperature_degC[:4 * count].reshape(count, 4).mean(axis=1)
    return [_table(("time_s", at), ("temp_C", temperature), ("power_pct", rows.mean_power(at)))]


def _changes(rows: Rows) -> np.ndarray:
    kept = np.concatenate([[True], np.diff(rows.temperature_degC) != 0.0])
    return np.flatnonzero(kept)


def thinned(rows: Rows) -> list[str]:
    """A long table with a row for each change of reading or power, at its instant."""
    kept = _changes(rows)
    events = [(at, "heater_power_pct", value) for at, value in zip(rows.power_s, rows.power_pct, strict=True)]
    events += [(rows.time_s[k], "oven_temperature_C", rows.temperature_degC[k]) for k in kept]
    lines = (f"{name},{value:.10g},{at:.10g}" for at, name, value in sorted(events))
    return ["\n".join(["tag,value,time_s", *lines]) + "\n"]


def blanks(rows: Rows) -> list[str]:
    """A wide table with a cell where its value changes."""
    kept = _changes(rows)
    events: dict[float, list[str]] = {}
    for at, value in zip(rows.power_s, rows.power_pct, strict=True):
        events.setdefault(float(at), ["", ""])[1] = f"{value:.10g}"
    for k in kept:
        events.setdefault(float(rows.time_s[k]), ["", ""])[0] = f"{rows.temperature_degC[k]:.10g}"
    return ["\n".join(["time_s,temp_C,power_pct", *(f"{at:.10g},{y},{u}" for at, (y, u) in sorted(events.items()))]) + "\n"]


def two_files(rows: Rows) -> list[str]:
    """The readings in one file, the changes of the power in another."""
    return [_table(("time_s", rows.time_s), ("temp_C", rows.temperature_degC)), _table(("time_s", rows.power_s), ("power_pct", rows.power_pct))]


WRITERS: tuple[Callable[[Rows], list[str]], ...] = (plain, thinned, blanks, late, mean, mean_both, two_files)


def fitted(texts: list[str], folder: Path, **stated: Any) -> FittedModel:
    """Return the heater of a log in one file, or in two; `stated` is known beside it."""
    files = [folder / name for name in ("log.csv", "power.csv")[:len(texts)]]
    for file, text in zip(files, texts, strict=True):
        file.write_text(text, encoding="utf-8")
    return fit(read_log(files[0], power_full_scale=100.0, power_log=str(files[1]) if len(files) > 1 else None), **stated)


def bounded(call: Callable[[], Any], seconds: int) -> Any:
    """Return what a call returns within so much processor time, in a process of its own; else why there is nothing."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        try:
            result = call()
        except HeatertuneError as problem:
            result = f"refused: {problem}"
        except Exception as problem:
            result = f"FAULT: {problem!r}"
        with os.fdopen(writer, "wb") as pipe:
            pickle.dump(result, pipe)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        content = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(content) if content else f"no end: in {seconds} s of processor time"


def apart(one: FittedModel, other: FittedModel, slack: dict[str, float]) -> list[str]:
    """Return the parameters whose intervals do not meet."""
    out = []
    for name, allowed in slack.items():
        a, b = one.ci95[name], other.ci95[name]
        if a is None or b is None:
            continue
        low, high = max(x for x in (a.low, b.low, -np.inf) if x is not None), min(x for x in (a.high, b.high, np.inf) if x is not None)
        if low > high + allowed:
            out.append(f"{name} {a.low}…{a.high} and {b.low}…{b.high}")
    return out


def blocks(model: FittedModel) -> list[str]:
    """Return the findings of a fit that keep its designs from a PASS."""
    return [finding.name for finding in model.findings if finding.kind.effect == "blocks"]


def real_rows(word: str = "") -> Iterator[tuple[str, Rows, on_change.Case | None]]:
    """Yield name and rows of the real logs that have a power, those with this word in their names."""
    for path in sorted(REAL.rglob("*.csv")):
        if word in path.stem:
            log = read_log(path, **READ.get(path.stem, {}))
            if log.power_pct is not None:
                yield path.stem, rows_of(log), None


def drawn_cases(count: int, first: int) -> Iterator[tuple[str, Rows, on_change.Case | None]]:
    """Yield name, rows and heater of drawn logs."""
    rng = random.Random(7)
    for seed in range(first + count):
        case = on_change.drawn(rng)
        if seed >= first:
            yield f"drawn {seed}", drawn_rows(case, seed), case


def main(cases: Iterable[tuple[str, Rows, on_change.Case | None]], folder: Path) -> int:
    """Print the outcome of each log in each of its ways; return how many heaters are wrong."""
    tally = Counter[str]()
    for name, rows, case in cases:
        base = None
        for writer in WRITERS:
            model = bounded(lambda: fitted(writer(rows), folder, **FIT.get(name, {})), BOUND_S)  # noqa: B023 - called at once
            if isinstance(model, str):
                tally[f"{writer.__name__}: {model.partition(':')[0]}"] += 1
                print(f"{name} {writer.__name__} {model}", flush=True)
                continue
            base = base or model
            wrong = missed(case, rows, base, model)
            outcome = "blocked" if blocks(model) else "WRONG" if wrong else "right"
            tally[f"{writer.__name__}: {outcome}"] += 1
            print(f"{name} {writer.__name__} {outcome}: {wrong} {blocks(model)} (as it was {blocks(base)}), dead time "
                  f"{model.model.dead_time_s:.4g} s (as it was {base.model.dead_time_s:.4g} s)", flush=True)
    for key, number in sorted(tally.items()):
        print(f"{key} {number}")
    return sum(number for key, number in tally.items() if key.endswith(("WRONG", "FAULT")))


def missed(case: on_change.Case | None, rows: Rows, base: FittedModel, model: FittedModel) -> list[str]:
    """Return what is wrong of a fit: against that of the log as it was, and against the heater where it is known."""
    interval = float(np.median(np.diff(rows.time_s)))
    slack = {"gain_degC_per_pct": 0.02 * abs(base.model.gain_degC_per_pct), "time_constant_s": 0.02 * base.model.time_constant_s,
             "dead_time_s": 0.1 * interval}
    return apart(base, model, slack) + ([] if case is None else on_change.missed(case, model))


def accused(count: int, first: int, folder: Path) -> int:
    """Return in how many drawn logs a heater is said to have stopped that has not; asked of each log, whatever its fit is like."""
    rng, wrong = random.Random(7), 0
    for seed in range(first + count):
        case = on_change.drawn(rng)
        if seed < first:
            continue
        writer = (late, mean, mean_both)[seed % 3]
        path = folder / "log.csv"
        path.write_text(writer(drawn_rows(case, seed))[0], encoding="utf-8")
        log = read_log(path, power_full_scale=100.0)
        period = opening(clean_log(log, PowerProblem(readings=Readings.of(log)))[1].problem)
        if period is not None:
            wrong += 1
            print(f"drawn {seed} {writer.__name__}: stopped at {period.message}?", flush=True)
    print(f"{count} logs, {wrong} accused")
    return wrong


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        if sys.argv[1:2] == ["accused"]:
            sys.exit(min(accused(int([*sys.argv, 100][2]), int([*sys.argv, 0, 0][3]), Path(made)), 1))
        if sys.argv[1:2] == ["real"]:
            sys.exit(min(main(real_rows([*sys.argv, ""][2]), Path(made)), 1))
        sys.exit(min(main(drawn_cases(int([*sys.argv, 40][1]), int([*sys.argv, 0, 0][2])), Path(made)), 1))

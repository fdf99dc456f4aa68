"""Does a PASS hold on the rig? Real logs and their halves, each taken the whole way to proven words.

    python tests/bench/danger_real.py --logs ../shared/data/logs
    python tests/bench/danger_real.py --only kantor --targets weg

Each PASS is judged on models that witness.py fits to the other half, to both halves where the whole log was used, and
to the other logs of the same rig. A loop that is unstable or has Ms > 2.5 on one of them is a dangerous one: exit
status 1. Nothing of heatertune fits a witness or judges a loop.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.log import read_log
from tests.bench import danger, truth, witness

LOGS = Path(__file__).parents[3] / "shared" / "data" / "logs"
_TOPS = (100.0, 200.0, 400.0, 600.0, 1200.0)  # ends of the usual sensor ranges [°C]
_LEAST = 30  # readings of a half
WHOLE, HALVES = "whole", ("half 1", "half 2")


@dataclass(frozen=True)
class Source:
    """A published log.

    Attributes:
        path: below the folder of logs.
        rig: what it was logged on, by the README beside it; logs of one rig bear witness to each other.
        columns: of time (None: none), temperature, power, setpoint (None: none), counted from 1.
        reading: options of `read_log`.
        delimiter, head: of the file, and its lines before the first reading.
    """

    path: str
    rig: str
    columns: tuple = (1, 2, 3, 4)
    reading: dict = field(default_factory=dict)
    delimiter: str = ","
    head: int = 1


def _usual(rig, *names):
    return [Source(f"normalised/{name}.csv", rig) for name in names]


SOURCES = (
    *_usual("TCLab, early", "apm_siso_doublet"),
    Source("tclab_step_kelvin_pwm255.csv", "TCLab, early", (1, 3, 2, None), head=0,
           reading={"temperature_unit": "K", "power_full_scale": 255.0}),
    Source("tclab_step_fahrenheit_millivolt.csv", "TCLab, millivolt", (1, 3, 2, None),
           reading={"temperature_unit": "degF", "power_full_scale": 255.0}),
    *_usual("TCLab, BYU", "apm_mimo_random_T1", "apm_mimo_steps_T1", "apm_mhe_lin_T1"),
    *_usual("TCLab, pds", "pds_tclab"),  # another source, and 1.6 times the gain per time constant
    Source("tclab_two_heaters_closed_loop.csv", "TCLab, BYU", (1, 4, 2, 6)),
    *_usual("TCLab, Notre Dame", "kantor_tclab_step2", "kantor_tclab_step3"),
    *_usual("UNThermal", "unal_prbs_open", "unal_profile_closed"),
    *_usual("box", "box_kp8", "box_kp4_ki01", "box_kp2_ki001_kd10"),
    *_usual("TEC oven", "tec_run11", "tec_run16"),
    *_usual("TEC oven, first", "tec0114_p7_i05_d1"),
    *_usual("chamber", "chamber_run13"),
    *_usual("chamber in counts", "chamber_relay_autotune2"),
    *_usual("UCR", "pidtune_dataIDFOM1"),
    *_usual("reaction curve", "pypidtune_prc"),
    Source("reaction_curve_semicolon_no_time.csv", "reaction curve", (None, 1, 2, None), delimiter=";",
           reading={"sample_time_s": 0.1}),
)


@dataclass(frozen=True)
class Readings:
    """What a log holds: time [s], temperature [°C], power [%], setpoint [°C] or None."""

    time: np.ndarray
    temperature: np.ndarray
    power: np.ndarray
    setpoint: np.ndarray | None

    def record(self, part):
        """Return a part as the witness takes it."""
        first, last = cut(part, len(self.time))
        interval = (self.time[-1] - self.time[0]) / (len(self.time) - 1)
        return witness.Record(float(interval), self.power, self.temperature, first, last)

    def text(self, part):
        """Return a part as a file."""
        first, last = cut(part, len(self.time))
        columns = {"time_s": self.time - self.time[first], "temp_C": self.temperature, "duty_pct": self.power}
        if self.setpoint is not None:
            columns["setpoint_C"] = self.setpoint
        rows = zip(*(values[first:last] for values in columns.values()), strict=True)
        return "\n".join([",".join(columns), *(",".join(f"{value:.10g}" for value in row) for row in rows)]) + "\n"


def cut(part, count):
    """Return the first reading of a part and the one behind its last."""
    return {WHOLE: (0, count), HALVES[0]: (0, count // 2), HALVES[1]: (count // 2, count)}[part]


def readings(source, folder):
    """Read a log without heatertune."""
    rows = np.genfromtxt(folder / source.path, delimiter=source.delimiter, skip_header=source.head)
    time_, temperature, power, setpoint = (None if c is None else rows[:, c - 1] if c <= rows.shape[1] else None
                                           for c in source.columns)
    if time_ is None:
        time_ = np.arange(len(rows)) * source.reading["sample_time_s"]
    kept = np.concatenate([[True], np.diff(time_) > 0.0])
    unit = source.reading.get("temperature_unit", "degC")
    celsius = {"degC": temperature, "K": temperature - 273.15, "degF": (temperature - 32.0) / 1.8}[unit]
    share = power * 100.0 / source.reading.get("power_full_scale", 100.0)
    return Readings(time_[kept], celsius[kept], share[kept], None if setpoint is None else setpoint[kept])


@dataclass
class Judged:
    """One PASS on one witness: which part of which log, its model, and what the loop is there."""

    where: str
    model: str
    stable: bool
    ms: float

    @property
    def bad(self):
        """Whether such a loop must not PASS."""
        return not self.stable or self.ms > 2.5


@dataclass
class Part:
    """How a part of a log ended.

    Attributes:
        log, part, rig: what was taken.
        fitted: what the fit said.
        seconds: processor time of the fit.
        ends: target → ending.
        judged: target → the witnesses' judgements of a PASS.
    """

    log: str
    part: str
    rig: str
    fitted: dict = field(default_factory=dict)
    seconds: float = 0.0
    ends: dict = field(default_factory=dict)
    judged: dict = field(default_factory=dict)

    def worst(self, target):
        """Return the worst judgement, None without a witness."""
        return max(self.judged.get(target, ()), key=lambda each: each.ms, default=None)

    def danger(self, target):
        """Whether it is a PASS that a witness breaks."""
        worst = self.worst(target)
        return self.ends[target].end == "PASS" and worst is not None and worst.bad


def designed(asked):
    """Return how a part ends on all targets, not yet judged, and the laws of its PASSes; `asked`: see `parts`."""
    source, part, folder, targets, structure, plain = asked
    held, found = readings(source, folder), Part(name_of(source), part, source.rig)
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path, options = folder / source.path, reading(source)
        if part != WHOLE:
            path, options = Path(place) / "half.csv", {}
            path.write_text(held.text(part), encoding="utf-8")
        log, lost = danger.take("refused", lambda: read_log(path, **options))
        begun, fitted = time.process_time(), None
        if lost is None:
            fitted, lost = danger.take("refused", lambda: fit(log))
        found.seconds = time.process_time() - begun
        if lost is not None:
            found.ends = dict.fromkeys(targets, lost)
            return found, {}
        found.fitted, laws = danger.fitted_document(fitted), {}
        top = next(top for top in _TOPS if top > 1.1 * held.temperature.max())
        for target in targets:
            found.ends[target], words = danger.ended(fitted, danger.asked_for(target, 0.0, top, structure, plain))
            if found.ends[target].end == "PASS":
                laws[target] = danger.law_of(words)
    return found, laws


def reading(source):
    """Return the options a user gives for a log that does not explain itself."""
    roles = ("time_column", "temperature_column", "power_column", "setpoint_column")
    if source.path.startswith("normalised"):
        return {}
    return source.reading | {role: c for role, c in zip(roles, source.columns, strict=True) if c is not None}


def name_of(source):
    """Return a log's name."""
    return Path(source.path).stem


def fitted_witnesses(asked):
    """Return the witnesses of a part: (log, part), [model]; `asked`: see `parts`."""
    source, part, folder = asked[:3]
    return (name_of(source), part), witness.witnesses(readings(source, folder).record(part))


def judge(found, laws, known):
    """Add to a part what each witness says of its PASSes; `known`: (rig, log, part) → models."""
    for target, law in laws.items():
        found.judged[target] = [
            _judged(f"{log}, {part}", model, law) for (rig, log, part), models in known.items()
            if rig == found.rig and not (log == found.log and part in (found.part, WHOLE)) for model in models]


def _judged(where, model, law):
    heater = model.heater
    setpoint = heater.ambient + 50.0 * heater.gain  # a linear model's loop is the same everywhere
    told = truth.judge(heater, law, setpoint)
    lags = ", ".join(f"{lag:.4g}" for lag in heater.lags)
    text = f"{model.form}, fit {model.fit_pct:.1f} %: {heater.gain:.4g} °C/%, {lags} s, dead {heater.dead:.3g} s"
    return Judged(where, text, told.stable, told.ms)


def parts(folder, settings):
    """Return what is asked: log, part, folder, targets, structure, plain; halves too short to tell are left out."""
    asked = []
    for source in SOURCES:
        if not (folder / source.path).is_file():
            continue
        long = len(readings(source, folder).time) >= 2 * _LEAST
        asked += [(source, part, folder, settings.targets, settings.structure, settings.plain)
                  for part in (WHOLE, *HALVES) if long or part == WHOLE]
    return asked


def table(found, targets):
    """Return a line for each part: the verdict on each target with the worst witness's Ms, and what the fit said."""
    lines = [f"| log | part | {' | '.join(targets)} | witnesses | findings, notes |", "| --- " * (len(targets) + 4) + "|"]
    for each in found:
        cells = [_cell(each, target) for target in targets]
        count = max((len(judged) for judged in each.judged.values()), default=0)
        told = each.fitted.get("findings", [])
        notes = len(each.fitted.get("notes", []))
        lines.append(f"| {each.log} | {each.part} | {' | '.join(cells)} | {count or ''} | {', '.join(told)}; {notes} notes |")
    return lines


def _cell(each, target):
    end, worst = each.ends[target], each.worst(target)
    if end.end != "PASS":
        return danger.lack(end)
    return "PASS" if worst is None else f"PASS {worst.ms:.2f}{' DANGER' if each.danger(target) else ''}"


def dangers(found):
    """Return a paragraph for each part with a dangerous PASS: where it breaks, and what the fit said."""
    lines = []
    for each in found:
        bad = [target for target in each.ends if each.danger(target)]
        if not bad:
            continue
        setpoint, fitted = each.ends[bad[0]].setpoint, each.fitted
        told = ", ".join(f"{target} Ms {each.worst(target).ms:.3g}" for target in bad)
        lines.append(f"{each.log}, {each.part}: {told} (of {len(each.judged)} PASS) at {setpoint:g} °C")
        lines += _broken(each, bad)
        lines += [f"  fitted {fitted['model']}, {fitted['outcome']}, fit {fitted['fit_pct']:.1f} %, "
                  f"{len(fitted['models'])} models, findings: {', '.join(fitted['findings']) or 'none'}",
                  f"  intervals {fitted['ci95']}", *(f"  - {note}" for note in fitted["notes"])]
    return lines


def _broken(each, targets):
    """Return a line for each witness that breaks some PASS."""
    worst = {}
    for judged in (judged for target in targets for judged in each.judged[target] if judged.bad):
        worst[judged.where, judged.model] = max(judged.ms, worst.get((judged.where, judged.model), 0.0))
    return [f"  on {where}: {model}: Ms up to {ms:.3g}" for (where, model), ms in worst.items()]


def shares(found, targets):
    """Return the lines on how the parts end, and how long that takes."""
    lines = []
    for target in targets:
        ends = [each.ends[target] for each in found]
        counted = Counter(end.end for end in ends)
        told = ", ".join(f"{100.0 * n / len(ends):.0f} % {end}" for end, n in counted.most_common())
        seen = sum(bool(each.judged.get(target)) for each in found)
        bad = sum(each.danger(target) for each in found)
        lines.append(f"{target}: {told}, of {len(ends)}; {seen} PASS seen by a witness, {bad} dangerous")
        if proofs := [end.seconds["proof"] for end in ends if "proof" in end.seconds]:
            lines[-1] += f"; first proof: median {statistics.median(proofs):.3f} CPU s"
    lacks = Counter(danger.lack(each.ends[target]) for each in found for target in targets if each.ends[target].end != "PASS")
    fits = [each.seconds for each in found if each.fitted]
    return [*lines, *(f"{n} × {lack}" for lack, n in lacks.most_common()),
            f"fit: median {statistics.median(fits):.3f} CPU s, worst {max(fits):.2f}" if fits else "no fit"]


def _arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=Path, default=LOGS, metavar="DIR", help=f"folder of the logs (default: {LOGS})")
    parser.add_argument("--only", nargs="+", default=[""], metavar="PART", help="logs whose names have this in them")
    parser.add_argument("--targets", "--target", nargs="+", default=list(danger.TARGETS), choices=danger.TARGETS,
                        metavar="TARGET")
    parser.add_argument("--structure", default="pi", choices=("p", "pi", "pid"))
    parser.add_argument("--plain", action="store_true", help="see danger.py")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--json", type=Path, help="file for all that was found")
    return parser.parse_args(arguments)


def run(folder, settings):
    """Return how every part that was chosen ends, judged by the witnesses of all logs of its rig."""
    every = parts(folder, settings)
    chosen = [each for each in every if any(word in name_of(each[0]) for word in settings.only)]
    rigs = {each[0].rig: each[0] for each in chosen}
    rig_of = {name_of(each[0]): each[0].rig for each in every}
    with ProcessPoolExecutor(settings.workers) as pool:
        work = map if settings.workers == 1 else pool.map
        known = {(rig_of[log], log, part): models for (log, part), models
                 in work(fitted_witnesses, [each for each in every if each[0].rig in rigs])}
        found = []
        for each, laws in work(designed, chosen):
            judge(each, laws, known)
            found.append(each)
            for line in dangers([each])[:1]:  # a long run tells at once what it finds
                print(f"{len(found)} of {len(chosen)}: {line}", file=sys.stderr, flush=True)
    return found


def main(arguments=None):
    """Print the tables; return 1 where a dangerous PASS was found."""
    settings = _arguments(arguments)
    if not settings.logs.is_dir():
        print(f"no real logs in {settings.logs}: nothing to judge (--logs DIR)")
        return 0
    begun = time.perf_counter()
    found = run(settings.logs, settings)
    if settings.json:
        settings.json.write_text(json.dumps([asdict(each) for each in found], indent=1), encoding="utf-8")
    bad = sum(each.danger(target) for each in found for target in settings.targets)
    print("\n".join([*table(found, settings.targets), "", *dangers(found), "", *shares(found, settings.targets),
                     f"{len(found)} parts in {time.perf_counter() - begun:.0f} s; load of the machine "
                     f"{os.getloadavg()[0]:.1f}; {bad} dangerous PASS"]))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

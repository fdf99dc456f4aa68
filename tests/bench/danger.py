"""Does a PASS hold on the heater? Logs of heaters whose truth is known, taken the whole way to proven words.

    python tests/bench/danger.py --count 25 --workers 2
    python tests/bench/danger.py --kinds boiling --seed 7 --targets weg --keep logs/
    python tests/bench/danger.py --count 5 --each 2 --longest 60 --lines found.jsonl

The last takes two of the controllers for each log, all in turn, gives a design 60 s of processor time, and writes each
outcome as soon as it is there.

A PASS whose loop is unstable on the true heater, or has Ms > 2.5 there, is a dangerous one: exit status 1. The truth is
judged by truth.py, which shares nothing with heatertune; heaters and logs are those of heaters.py. Of the logs inside the
model class at least 80 % should PASS.
"""

import argparse
import json
import os
import re
import signal
import statistics
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.plc import Scaling
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.settings import Conditions, TuneSettings
from tests.bench import heaters, truth

TARGETS = ("s5-ob251", "s7-300", "fb41", "weg", "s7-200", "iec-pid", "arduino-pid", "simple-pid", "esphome", "pband")
_SWINGS_OVER = 25.0  # times all lags and the dead time
_MOST_CALLS = 20_000  # of a simulated loop


@dataclass
class Ending:
    """How one heater ended on one target.

    Attributes:
        end: "refused", "no design", "no words", "no proof", "crashed", "late", or the verdict.
        why: of what is no PASS.
        setpoint: of the proof [°C].
        words: what the controller holds, with its interval [s] and the sensor's range [°C].
        held, stable, ms: what the words are on the true heater, see `truth.Judgement`.
        swings: whether the true, limited loop went on swinging; None where it was not run.
        seconds: processor time of design, words, proof, and closing where the first proof fails.
        changes: what else stands on the verdict's line.
    """

    end: str
    why: str = ""
    setpoint: float | None = None
    words: dict = field(default_factory=dict)
    held: bool = True
    stable: bool = True
    ms: float | None = None
    swings: bool | None = None
    seconds: dict = field(default_factory=dict)
    changes: list = field(default_factory=list)

    @property
    def danger(self):
        """Whether it is a PASS that the true heater breaks."""
        return self.end == "PASS" and self.held and (not self.stable or (self.ms or 0.0) > 2.5)


@dataclass
class Outcome:
    """How one log ended on all targets.

    Attributes:
        kind, seed: of the case.
        truth: the heater in words.
        fitted: what the fit said: outcome, findings, notes, model.
        seconds: processor time of the fit.
        ends: target → ending.
    """

    kind: str
    seed: int
    truth: str
    fitted: dict = field(default_factory=dict)
    seconds: float = 0.0
    ends: dict = field(default_factory=dict)


def fitted_document(fitted):
    """Return what a fit said of itself, in whatever version."""
    outcome = getattr(fitted.outcome, "name", str(fitted.outcome))
    return {
        "outcome": outcome, "model": repr(fitted.model), "fit_pct": fitted.fit_pct,
        "models": [repr(getattr(each, "model", each)) for each in getattr(fitted, "candidates", ())],
        "ci95": {name: None if each is None else [each.low, each.high] for name, each in fitted.ci95.items()},
        "findings": [finding.name for finding in getattr(fitted, "findings", ())],
        "notes": list(getattr(fitted, "notes", ())),
    }


def take(stage, work):
    """Return what a stage makes and None, or None and how it ended without."""
    try:
        found = work()
    except HeatertuneError as problem:
        return None, Ending(stage, str(problem))
    except Exception as problem:  # a fault of the program is what this looks for, too
        return None, Ending("crashed", f"{stage}: {type(problem).__name__}: {problem}")
    return found, None


def asked_for(target, low, high, structure, plain):
    """Return what a user asks a design for.

    Who reads its messages asks for a switch that is fast enough, and for no tighter band than a hundredth of the
    sensor's range; `plain`: for nothing.
    """
    assumed = Conditions() if plain else Conditions(tolerance_degC=max(1.0, 0.01 * (high - low)))
    return DesignRequest(target=target, scaling=Scaling(low_degC=low, high_degC=high), tune_settings=TuneSettings(structure=structure),
                 conditions=assumed, switch_kind=None if plain else "ssr")


class Watch:
    """The processor time of each stage of a design; "closing" is all that comes after a first proof that fails."""

    def __init__(self):
        self.seconds, self.stage, self._begun = {}, "design", time.process_time()

    def at(self, stage):
        now = time.process_time()
        self.seconds[self.stage] = self.seconds.get(self.stage, 0.0) + now - self._begun
        self.stage, self._begun = stage, now

    def told(self, message):
        if "fails: trying" in message and self.stage == "proof":
            self.at("closing")


def ended(fitted, asked):
    """Return how a design ends: an ending, and the words, None where it came to no verdict."""
    watch = Watch()
    try:
        found = find_passing_design(fitted, asked, progress=watch.told, stage=watch.at)
    except HeatertuneError as problem:
        return Ending(f"no {watch.stage}", str(problem)), None
    except Exception as problem:  # a fault of the program is what this looks for, too
        return Ending("crashed", f"{watch.stage}: {type(problem).__name__}: {problem}"), None
    watch.at("")
    proof, words = found.proof, found.proof.words
    why = [f"{each.name} {each.value:.4g} of {each.limit:.4g}" for each in proof.criteria if not each.ok]
    why += [each.name for each in proof.diagnostics.findings if each.kind.effect == "blocks"]
    told = dict(words.values) | {
        "interval_s": words.sample_time_s, "range": [words.scaling.low_degC, words.scaling.high_degC]}
    ending = Ending(proof.verdict, "; ".join(why), proof.nominal.setpoint_degC, told, seconds=watch.seconds,
                    changes=list(found.proof.diagnostics.remarks))
    return ending, words


def law_of(words):
    """Return what words do."""
    scaling = words.scaling
    return truth.law_of(words.target, words.values, scaling.low_degC, scaling.high_degC, words.sample_time_s)


def on_target(case, fitted, target, structure, plain):
    """Return how a fitted heater ends on a target."""
    ending, words = ended(fitted, asked_for(target, *case.range, structure, plain))
    if words is None:
        return ending
    law = law_of(words)
    judged = truth.judge(case.heater, law, ending.setpoint)
    ending = replace(ending, held=judged.held, stable=judged.stable, ms=judged.ms)
    if ending.end == "PASS" and judged.held and (ending.danger or case.seed % 5 == 0):
        ending.swings = _swings(case, law, ending.setpoint)
    return ending


def _swings(case, law, setpoint):
    heater = case.heater
    seconds = min(_SWINGS_OVER * (sum(heater.lags) + heater.dead), _MOST_CALLS * law.interval)
    return truth.swings(heaters.Rig(heater, heater.ambient), law, setpoint, max(seconds, 200.0 * law.interval))


class _Late(BaseException):
    """A design took too long; no Exception, which a stage might take for a fault of the program."""


@contextmanager
def at_most(seconds):
    """Raise `_Late` where what is done takes more processor time [s]; None: however long it takes."""
    def late(*_):
        raise _Late

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds or 0.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def in_time(case, fitted, target, structure, plain, longest):
    """Return how a fitted heater ends on a target, "late" where that takes more processor time than `longest` [s]."""
    try:
        with at_most(longest):
            return on_target(case, fitted, target, structure, plain)
    except _Late:
        return Ending("late", f"more than {longest:g} s of processor time")


def run(asked):
    """Return the outcome of one case; `asked`: kind, seed, targets, structure, plain, folder to keep the log in or None,
    and the most processor time of a design [s] or None."""
    kind, seed, targets, structure, plain, keep, longest = asked
    case = heaters.make(kind, seed)
    outcome = Outcome(kind, seed, repr(case.heater))
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path = Path(keep or place) / f"{kind.replace(' ', '_').replace(',', '')}_{seed}.csv"
        path.write_text(case.text(), encoding="utf-8")
        log, lost = take("refused", lambda: read_log(path))
        begun = time.process_time()
        if lost is None:
            fitted, lost = take("refused", lambda: fit(log))
        outcome.seconds = time.process_time() - begun
        if lost is not None:
            outcome.ends = dict.fromkeys(targets, lost)
            return outcome
        outcome.fitted = fitted_document(fitted)
        outcome.ends = {target: in_time(case, fitted, target, structure, plain, longest) for target in targets}
    return outcome


def table(outcomes, targets):
    """Return the lines of the table: how often each kind ended how, and each dangerous PASS."""
    ends = ("refused", "no design", "no words", "no proof", "crashed", "late", "NOT PROVEN", "FAIL", "PASS")
    lines = [f"| kind | class | n | {' | '.join(ends)} | swinging | not held | dangerous PASS: {', '.join(targets)} |",
             "| --- " * (len(ends) + 6) + "|"]
    for kind in [kind for kind in heaters.KINDS if any(o.kind == kind for o in outcomes)]:
        lines.append(_row(kind, heaters.KINDS[kind].place, [o for o in outcomes if o.kind == kind], ends, targets))
    lines.append(_row("all", "", outcomes, ends, targets))
    return lines


def _row(name, place, outcomes, ends, targets):
    found = [end for o in outcomes for end in o.ends.values()]
    counted = Counter(end.end for end in found)
    strange = {end: n for end, n in counted.items() if end not in ends}
    cells = [str(counted[end] or "") for end in ends]
    cells += [str(sum(bool(end.swings) for end in found) or ""), str(sum(_unheld(end) for end in found) or "")]
    cells.append(", ".join(str(sum(o.ends[t].danger for o in outcomes if t in o.ends) or "-") for t in targets))
    return f"| {name} | {place} | {len(outcomes)} | {' | '.join(cells)} |{f' {strange}' if strange else ''}"


def _unheld(end):
    return end.end == "PASS" and not end.held


def dangers(outcomes):
    """Return a paragraph for each log with a dangerous PASS: how to repeat it, and what the fit said."""
    lines = []
    for o in outcomes:
        bad = {target: end for target, end in o.ends.items() if end.danger}
        if bad:
            told = ", ".join(f"{t} Ms {end.ms:.3g}{' swings' if end.swings else ''}" for t, end in bad.items())
            lines += [f"{o.kind} {o.seed}: {told} (of {sum(e.end == 'PASS' for e in o.ends.values())} PASS) at "
                      f"{next(iter(bad.values())).setpoint:g} °C",
                      f"  truth  {o.truth}", f"  fitted {o.fitted['model']}",
                      f"  {o.fitted['outcome']}, fit {o.fitted['fit_pct']:.1f} %, {len(o.fitted['models'])} models, "
                      f"findings: {', '.join(o.fitted['findings']) or 'none'}",
                      *(f"  - {note}" for note in o.fitted["notes"])]
    return lines


def shares(outcomes, targets):
    """Return the lines on how many of the logs inside the model class PASS, and what the others lack."""
    inside = [o for o in outcomes if heaters.KINDS[o.kind].place == "in"]
    if not inside:
        return []
    lines = []
    for target in targets:
        found = [o.ends[target] for o in inside if target in o.ends]
        if not found:
            continue
        lacks = Counter(lack(end) for end in found if end.end != "PASS")
        told = ", ".join(f"{n} {lack}" for lack, n in lacks.most_common(5))
        lines.append(f"inside the class, {target}: {100.0 * _share(found):.0f} % of {len(found)} PASS; else {told}")
    every = [end for o in inside for end in o.ends.values()]
    any_ = [any(end.end == "PASS" for end in o.ends.values()) for o in inside]
    lines.append(f"inside the class, all targets: {100.0 * _share(every):.0f} % of {len(every)} PASS; "
                 f"{100.0 * np.mean(any_):.0f} % of {len(inside)} logs PASS on one target at least")
    return lines


def _share(found):
    return sum(end.end == "PASS" for end in found) / len(found)


def lack(end):
    """Return how and why an ending is no PASS, in short."""
    if end.end in ("FAIL", "NOT PROVEN"):
        names = ",".join(part.split(" ")[0] for part in end.why.split("; ") if part)
        return f"{end.end}({names})"
    return f"{end.end}({re.sub(r'[-−]?[0-9][0-9.]*', '#', end.why)[:60]})"  # alike but for numbers is the same


def times(outcomes, targets):
    """Return the lines of the median processor times."""
    fits = [o.seconds for o in outcomes if o.fitted and heaters.KINDS[o.kind].most is None]
    if not fits:
        return []
    lines = [f"fit: median {statistics.median(fits):.3f} CPU s, 95 % {np.quantile(fits, 0.95):.3f}, worst {max(fits):.2f}"]
    for target in targets:
        spent = [o.ends[target].seconds for o in outcomes if target in o.ends and o.ends[target].seconds]
        told = (f"{stage} {statistics.median(some):.3f} ({len(some)})" for stage in ("design", "words", "proof", "closing")
                if (some := [s[stage] for s in spent if stage in s]))
        lines.append(f"{target}: median CPU s: {', '.join(told)}")
    return lines


def cases(settings):
    """Return what is asked of `run`, one for each log."""
    seeds = range(settings.first, settings.first + settings.count) if settings.seed is None else [settings.seed]
    drawn = [(kind, seed) for seed in seeds for kind in settings.kinds
             if settings.seed is not None or heaters.KINDS[kind].most is None or seed < heaters.KINDS[kind].most]
    each, all_ = settings.each or len(settings.targets), settings.targets
    return [
        (kind, seed, [all_[(number * each + k) % len(all_)] for k in range(each)], settings.structure, settings.plain,
         settings.keep, settings.longest)
        for number, (kind, seed) in enumerate(drawn)
    ]


def _arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=25, help="seeds of each kind (default: 25)")
    parser.add_argument("--kinds", "--kind", nargs="+", default=list(heaters.KINDS), choices=heaters.KINDS, metavar="KIND",
                        help=f"some of: {', '.join(heaters.KINDS)}")
    parser.add_argument("--targets", "--target", nargs="+", default=list(TARGETS), choices=TARGETS, metavar="TARGET")
    parser.add_argument("--structure", default="pi", choices=("p", "pi", "pid"))
    parser.add_argument("--first", type=int, default=0, help="first seed of each kind (default: 0)")
    parser.add_argument("--plain", action="store_true",
                        help="ask for no fast switch and no tolerance that goes with the sensor's range")
    parser.add_argument("--seed", type=int, help="this seed alone")
    parser.add_argument("--keep", help="folder for the logs")
    parser.add_argument("--each", type=int, metavar="N", help="so many of the targets for each log, all in turn (default: all)")
    parser.add_argument("--longest", type=float, metavar="S", help="processor time for a design (default: any)")
    parser.add_argument("--lines", help="file to which each outcome is added as a line of JSON as soon as it is there")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--json", help="file for all that was found")
    return parser.parse_args(arguments)


def main(arguments=None):
    """Print the tables; return 1 where a dangerous PASS was found."""
    settings = _arguments(arguments)
    if settings.keep:
        Path(settings.keep).mkdir(parents=True, exist_ok=True)
    asked, begun = cases(settings), time.perf_counter()
    outcomes = []
    with ProcessPoolExecutor(settings.workers) as pool:
        for outcome in map(run, asked) if settings.workers == 1 else pool.map(run, asked):
            outcomes.append(outcome)
            if settings.lines:
                with Path(settings.lines).open("a", encoding="utf-8") as lines:
                    lines.write(json.dumps(asdict(outcome)) + "\n")
            if paragraph := dangers([outcome]):  # a long run tells at once what it finds
                print(f"{len(outcomes)} of {len(asked)}: {paragraph[0]}", file=sys.stderr, flush=True)
    if settings.json:
        Path(settings.json).write_text(json.dumps([asdict(o) for o in outcomes], indent=1), encoding="utf-8")
    counted = [o for o in outcomes if heaters.KINDS[o.kind].place != "blind"]
    found = sum(end.danger for o in counted for end in o.ends.values())
    crashed = sorted({f"crashed: {o.kind} {o.seed}: {e.why}" for o in outcomes for e in o.ends.values() if e.end == "crashed"})
    print("\n".join([*table(outcomes, settings.targets), "", *dangers(outcomes), "", *crashed,
                     *shares(outcomes, settings.targets), *times(outcomes, settings.targets),
                     f"{len(outcomes)} logs in {time.perf_counter() - begun:.0f} s; load of the machine "
                     f"{os.getloadavg()[0]:.1f}; {found} dangerous PASS"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

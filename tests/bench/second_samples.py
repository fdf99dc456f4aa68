"""Are drawn heaters drawn and judged as the documentation says? Drawn and judged a second time; run as a program.

    python -m tests.bench.second_samples                                  12 zones, each on two of six controllers
    python -m tests.bench.second_samples --first 1000 --zones 4 --targets weg s7-300 --samples 500

Zones are those of zones.py, their logs shortened and made noisy at random, so that intervals are wide and candidates several; from
1,000 on more is asked for: limits in T+L, a range of setpoints, a kind of switch, noise; from 2,000 on scans are late.
heatertune fits a log, designs for it with samples, and says how many keep every limit. It is held against

- the same heaters, rows and sizes as `SampleRequest.heaters_of` gives them, each living through a story of its own in
  second_opinion.c, which keeps or breaks limits of its own: sample by sample, under each setting;
- other heaters, drawn here by NumPy's generator from the fit's document as the head of proof/monte_carlo/draw.py says it: the shares that
  keep every limit (Fisher's exact test), what is drawn and each criterion (Kolmogorov and Smirnov), all at a level of 1 %
  divided by how many comparisons there are.

Sample by sample, both kinds of close calls (close_calls.py) are counted; what else differs is printed. Exit status 1 where
something does, or where a test objects.

Found in this way: a load that went with the square of the drawn mains, and was least where the heater is weakest; times in T+L of
another heater than the proof's; and of the second judge, how the S7-200's PID begins and how readings are rounded.
"""

import argparse
import json
import math
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.stats import fisher_exact, ks_2samp

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.model.model_document import to_document
from heatertune.model.model_values import Fopdt
from heatertune.plc import Scaling, controller_for
from heatertune.proof.criteria import columns_of
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.loop import scans_of
from heatertune.proof.monte_carlo.draw import measure
from heatertune.proof.monte_carlo.run import _limits, drawing_for
from heatertune.proof.redesign.on_samples import closed_on_samples
from heatertune.settings import Conditions, SampleSettings, TuneSettings
from tests.bench.close_calls import COUNTED, SLACK, apart, by_a_hair, differ, keeps, named, told
from tests.bench.outages import bench_of
from tests.bench.second_draw import drawn, given, inputs_of, inputs_of_rows, possible, verdict_notes
from tests.bench.second_opinion import SWITCHES, TARGETS, compiled, story
from tests.bench.zones import heater, log_text

LEVEL = 0.01  # of all tests together: so often one of them objects to what is right
LIMITS = {"overshoot": 20.0, "change_overshoot": 20.0, "restart_overshoot": 20.0, "recovery_overshoot": 20.0,
          "reheat_overshoot": 40.0, "small_change_overshoot": 65.0}  # `heatertune spec general`, the tolerance apart
_WIDE = 1000  # from this zone on more is asked for
_LATE = 2000  # and from this one on scans are late
MORE = 2000  # heaters of the program that cost little
INPUTS = 40_000  # that are drawn only


@dataclass(kw_only=True)
class Subject:
    """A zone and the words that were designed for it.

    Attributes:
        number, target: of the zone and the controller.
        fitted: its model.
        design: with the verdict on samples.
        settings: of open points, each of which a controller may have.
        seed: of the first sample that the verdict is about.
        times: limits that are asked for, "settling" and "recovery" [T+L].
        jitter: latest delay of a scan [s].
    """

    number: int
    target: str
    fitted: object
    design: object
    settings: list
    seed: int
    times: dict
    jitter: float

    @property
    def limits(self):
        """What a heater must keep, by the judge's names; the band is the bench's."""
        slowest = max(sum(lags) + dead for _, lags, dead, _, _ in possible(self.document, self.design.conditions.highest_degC))
        return LIMITS | {f"{name}_time": share * slowest for name, share in self.times.items()}

    @cached_property
    def document(self):
        """The model as it is written."""
        return json.loads(json.dumps(to_document(self.fitted)))


def subject(number, target, samples, folder):
    """Return the design for a zone; raise HeatertuneError where there is none."""
    rng = np.random.default_rng([number, TARGETS[target][0], 9])
    path = Path(folder, f"zone{number}.csv")
    path.write_text(_coarse(number), encoding="utf-8")
    fitted, (gain, lag, _, ambient) = fit(read_log(path), None), heater(number)
    setpoint = round(float(ambient + gain * rng.uniform(25.0, 82.0)), 1)
    tolerance = None if rng.random() < 0.5 else round(float((setpoint - ambient) * rng.uniform(0.015, 0.05)), 2)
    room = controller_for(target)
    tuned = TuneSettings() if room.timer is None else TuneSettings(sample_time_s=float(round(lag / rng.uniform(10.0, 40.0))))
    open_point = rng.choice([*SWITCHES[target]])
    known = {switch.name: switch.default for switch in room.switches if switch.name != open_point}
    conditions, times, kind = Conditions(setpoint_degC=setpoint, tolerance_degC=tolerance, switches=known), {}, None
    as_is = bool(rng.random() < 0.5)
    jitter = 0.0 if number < _LATE or room.timer is None else round(tuned.sample_time_s * float(rng.uniform(0.05, 0.6)), 2)
    if number >= _WIDE:
        conditions, times, kind = _widened(conditions, rng, ambient)
    asked = DesignRequest(
        target=target, scaling=Scaling(low_degC=0.0, high_degC=float(math.ceil(1.6 * setpoint))), tune_settings=tuned,
        as_is=as_is, sample_settings=SampleSettings(samples=samples, jitter_s=jitter), conditions=conditions, switch_kind=kind)
    design = closed_on_samples(fitted, asked)
    proven = design.proof.samples
    return Subject(number=number, target=target, fitted=fitted, design=design, seed=proven.seed, times=times, jitter=jitter,
                   settings=[dict(setting.switches) for setting in proven.settings])


def _widened(conditions, rng, ambient):
    """Return conditions with more asked for, which times are limited (in T+L), and the kind of switch."""
    times, setpoint = {}, conditions.highest_degC
    for name, low, high in (("settling", 4.0, 14.0), ("recovery", 2.0, 8.0)):
        if rng.random() < 0.5:
            times[name] = round(float(rng.uniform(low, high)), 1)
    if rng.random() < 0.5:
        low = round(float(ambient + rng.uniform(0.3, 0.95) * (setpoint - ambient)), 1)
        conditions = replace(conditions, setpoint_degC=(low, setpoint))
    if rng.random() < 0.3:
        conditions = replace(conditions, noise_degC=round(float(rng.uniform(0.01, 0.08)), 2))
    limits = tuple(f"{name}={value} T+L" for name, value in times.items())
    return replace(conditions, limit=limits), times, [None, "ssr", "relay"][rng.integers(3)]


def _coarse(number):
    """Return a zone's log with fewer rows and more noise."""
    rng = np.random.default_rng([number, 8])
    head, *rows = log_text(number).splitlines()
    noise = math.exp(rng.uniform(math.log(0.05), math.log(0.6)))
    cells = (row.split(",") for row in rows[:int(rng.integers(60, len(rows)))])
    return "\n".join([head, *(f"{t},{float(y) + rng.normal(0.0, noise):.2f},{u}" for t, y, u in cells), ""])


# ---- both ---------------------------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class Found:
    """What became of a subject.

    Attributes:
        ends: how often what was seen of the same heaters, "same", "measures", "hair", "close" or "apart".
        unexplained: one line each.
        shares: of each setting: (kept of the program's document, of the same heaters by the judge, of its own).
        tests: (p, what) of each comparison of what is drawn apart.
    """

    ends: Counter = field(default_factory=Counter)
    unexplained: list = field(default_factory=list)
    shares: list = field(default_factory=list)
    tests: list = field(default_factory=list)


def drawing_of(case):
    """Return whose samples the program draws."""
    return drawing_for(case.design.proof.words, case.fitted, {"jitter_s": case.jitter}, case.design.conditions)


def plain_of(case):
    """Return the bench that all heaters of a subject differ from, under the first setting."""
    gain, lags, dead, ambient, _ = possible(case.document, case.design.conditions.highest_degC)[0]
    model, conditions = Fopdt(gain_degC_per_pct=gain, time_constant_s=lags[0], dead_time_s=dead, ambient_degC=ambient), case.design.conditions
    limits = case.limits
    return verdict_notes(replace(
        bench_of(model, case.design, case.settings[0]), tolerance=conditions.tolerance_degC or 1.0, noise=conditions.noise_degC, jitter=case.jitter,
        asked_low=conditions.lowest_degC, heats_in=limits.get("settling_time", 0.0), recovers_in=limits.get("recovery_time", 0.0)),
        case.document, case.settings[0])


def programs(case, drawing, count, seed):
    """Return the program's values by the judge's names, shape (settings, count), and which keep every limit."""
    limits = _limits(case.design.conditions, case.fitted)
    columns = columns_of(measure(drawing, limits, count, seed=seed, workers=1), limits)
    values = named({column.name: column.values.reshape(-1, count) for column in columns})
    kept = np.all([column.strains <= 1.0 for column in columns], axis=0).reshape(-1, count)
    return values, kept


def judged(library, case, samples, rng):
    """Return what became of a subject: the program's heaters one by one, others by their shares."""
    found, document, drawing, plain = Found(), case.document, drawing_of(case), plain_of(case)
    values, kept = programs(case, drawing, samples, case.seed)
    theirs = theirs_of(drawing, range(case.seed, case.seed + samples))
    more, more_kept = programs(case, drawing, MORE, case.seed + 1_000_000)
    own = drawn(plain, document, samples, rng)
    for setting, settings in enumerate(case.settings):
        bench = verdict_notes(plain, document, settings)
        seen = []
        for number in range(samples):
            its = {name: float(value[setting, number]) for name, value in values.items()}
            mine, end = compared(library, given(bench, *theirs[number]), case.limits, its, bool(kept[setting, number]))
            found.ends[end] += 1
            seen.append(keeps(mine))
            if end == "apart":
                found.unexplained.append(f"{settings} seed {case.seed + number}: kept {kept[setting, number]} and {seen[-1]}; "
                                         f"{apart(its, mine)}")
        others = [told(library, replace(each, settings=settings), case.limits) for each in own]
        kept_by = sum(map(keeps, others))
        found.shares.append((case.design.proof.samples.settings[setting].passing_count, sum(seen), kept_by))
        of_more = int(more_kept[setting].sum())
        p = fisher_exact([[kept_by, samples - kept_by], [of_more, MORE - of_more]])[1]
        found.tests.append((float(p), f"share under {settings}: {kept_by / samples:.3f} and {of_more / MORE:.3f}"))
        found.tests += [(_alike([each[name][0] for each in others], more[name][setting], 2.0 * COUNTED.get(name, SLACK)),
                         f"{name} under {settings}") for name in others[0] if name in more]
    found.tests += inputs_alike(drawing, plain, document, rng)
    return found


def theirs_of(drawing, seeds):
    """Return (row, sizes, noise and delays of the scans) of each of the program's samples."""
    own = drawing.scans_of(seeds, scans_of(drawing.controllers[0], drawing.scenario))
    return list(zip(*drawing.heaters_of(seeds), *(each if each.shape[1] > 1 else [None] * len(seeds) for each in own), strict=True))


def compared(library, bench, limits, values, kept):
    """Return what the judge sees of a sample, and how that differs: "same", "close", "hair" or "apart"."""
    mine = told(library, bench, limits)
    if differ(values, kept, mine) or apart(values, mine):
        return mine, "hair" if by_a_hair(library, bench, limits, values, kept) else "apart"
    return mine, "same" if kept == keeps(mine) else "close"


def inputs_alike(drawing, bench, document, rng):
    """Return (p, what) of what is drawn, many times and not run."""
    parts = list(story(replace(bench, sizes=())))
    theirs = inputs_of_rows(*drawing.heaters_of(range(INPUTS)), parts)
    mine = inputs_of(drawn(bench, document, INPUTS, rng), parts)
    return [(_alike(mine[name], theirs[name]), f"drawn {name}") for name in mine]


def _alike(one, other, share=0.0):
    """Return the chance of two samples being as far apart as they are, where they are of one distribution.

    With a share, they may differ by so much of each value: where many are alike, a hair would part them.
    """
    one, other = (np.nan_to_num(np.round(each, 9), posinf=1e300) for each in (one, other))
    if not share:
        return float(ks_2samp(one, other, method="asymp").pvalue)
    sides = [ks_2samp((1.0 + way * share) * one, other, alternative=side, method="asymp") for way, side in ((1, "greater"), (-1, "less"))]
    return min(1.0, 2.0 * min(float(side.pvalue) for side in sides))


def objections(tests):
    """Return what the tests of all subjects object to, the level shared among them."""
    return sorted((p, what) for p, what in tests if p < LEVEL / len(tests))


def main(words=None):
    """Print a line for each subject and what differs; return the exit status."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--zones", type=int, default=12)
    asked.add_argument("--samples", type=int, default=200)
    asked.add_argument("--targets", nargs="+", default=["weg", "s7-300", "fb41", "s5-ob251", "pid-compact", "iec-pid"])
    asked.add_argument("--each", type=int, default=2, help="so many of the targets on each zone, in turn")
    asked = asked.parse_args(words)
    tests, ends, asked.each = [], Counter(), min(asked.each, len(asked.targets))
    print(f"{'target':12s} zone samples  kept of the program's heaters, by it and by the judge; of the judge's own   differences")
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        for turn in range(asked.zones * asked.each):
            number, target = asked.first + turn // asked.each, asked.targets[turn % len(asked.targets)]
            try:
                case = subject(number, target, asked.samples, folder)
            except HeatertuneError as refused:
                print(f"{target:12s} {number:4d} refused: {' '.join(str(refused).split()[:12])}", flush=True)
                continue
            found = judged(library, case, asked.samples, np.random.default_rng([number, TARGETS[target][0], 10]))
            ends += found.ends
            tests += [(p, f"{target} zone {number}: {what}") for p, what in found.tests]
            shares = "; ".join(" ".join(f"{100.0 * kept / asked.samples:5.1f} %" for kept in each) for each in found.shares)
            print(f"{target:12s} {number:4d} {asked.samples:7d}  {shares}   {dict(found.ends)}", flush=True)
            for line in found.unexplained:
                print(f"    {line}", flush=True)
    print(f"{len(tests)} tests; the least p: {sorted(tests)[:3]}")
    for p, what in objections(tests):
        print(f"OBJECTION {what}: p = {p:.2g}")
    print(f"{sum(ends.values())} runs of the same heaters: {dict(ends)}")
    return int(bool(ends["apart"] or objections(tests)))


if __name__ == "__main__":
    sys.exit(main())

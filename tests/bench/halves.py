"""Do the intervals hold on real logs? python tests/bench/halves.py LOGS: a half's estimate against the whole's interval.

Each log and each half of its time are fitted as a user's log is. A half in which the power never changes, or that no
heater explains, is named and not counted. One that holds less than the whole says little by itself, so the last lines
count all halves, and then those that identify gain and time constant by themselves.
"""

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from heatertune.errors import InputError, OutOfRange
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import FitOutcome

PARAMETERS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
#: file → what its reader has to be told
READING = {
    "reaction_curve_semicolon_no_time": {"sample_time_s": 0.1},
    "tclab_step_fahrenheit_millivolt": {"temperature_unit": "degF", "power_full_scale": 255.0},
    "tclab_step_kelvin_pwm255": {"temperature_unit": "K", "power_full_scale": 255.0},
}


@dataclass(frozen=True)
class Compared:
    """A log, its fit and its halves' (None and why not), and CPU seconds of the whole's fit."""

    name: str
    whole: object
    halves: tuple
    refused: str
    seconds: float


def logs_of(folder):
    """Return the paths of the logs in a folder and in its folder `normalised`."""
    return sorted([*Path(folder).glob("*.csv"), *(Path(folder) / "normalised").glob("*.csv")])


def compared(path):
    """Return what the whole log and its halves give."""
    log = read_log(path, **READING.get(Path(path).stem, {}))
    refusals, fits, seconds = [], [], 0.0
    for part in (log, *split(log)):
        begun = time.process_time()
        try:
            fits.append(fit(part))
        except (InputError, OutOfRange) as refusal:
            fits.append(None)
            refusals.append(f"{part.name}: {refusal}")
        seconds = seconds or time.process_time() - begun
    return Compared(Path(path).stem, fits[0], tuple(fits[1:]), "; ".join(refusals), seconds)


def split(log):
    """Return the two halves of a log's time, the power of the second known from its first reading on."""
    middle = 0.5 * (log.time_s[0] + log.time_s[-1])
    return [
        Log(name=f"{log.name}, {which} half", source=log.source, time_s=log.time_s[rows],
            temperature_degC=log.temperature_degC[rows],
            power_pct=None if log.power_pct is None else log.power_pct[rows],
            setpoint_degC=None if log.setpoint_degC is None else log.setpoint_degC[rows])
        for which, rows in (("first", log.time_s <= middle), ("second", log.time_s > middle))
    ]


def holds(interval, value):
    """Return whether an interval holds a value; one that is unknown holds all."""
    low, high = ends(interval)
    return low <= value <= high


def ends(interval):
    """Return an interval's ends, infinite where open."""
    if interval is None:
        return -np.inf, np.inf
    return -np.inf if interval.low is None else interval.low, np.inf if interval.high is None else interval.high


def table(found):
    """Return the lines of the table, then the shares of halves that lie inside."""
    yield "| log | outcome, candidates | k | T | L | s |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for each in found:
        if each.whole is None:
            yield f"| {each.name} | refused: {each.refused} |"
            continue
        cells = " | ".join(_cell(each, name) for name in PARAMETERS)
        yield (f"| {each.name} | {each.whole.outcome.name}, {len(each.whole.candidates)} | {cells} | "
               f"{each.seconds:.2f} |")
    for told, wanted in (("all halves", lambda _: True),
                         ("halves that identify gain and time constant", lambda h: h.outcome is FitOutcome.IDENTIFIED)):
        inside = [inside_of(each, half) for each in found if each.whole for half in each.halves if half and wanted(half)]
        shares = ", ".join(f"{100.0 * share:.0f}" for share in np.mean(inside, axis=0)) if inside else ""
        yield f"{told}: {len(inside)}, inside the whole log's intervals for k, T, L: {shares} %"
    seconds = [each.seconds for each in found if each.whole]
    yield f"CPU of the whole log's fit: median {np.median(seconds):.2f} s, longest {np.max(seconds):.2f} s"


def inside_of(each, half):
    """Return for each parameter whether a half's estimate lies inside the whole's interval."""
    return [holds(each.whole.ci95[name], getattr(half.model, name)) for name in PARAMETERS]


def _cell(each, name):
    low, high = ends(each.whole.ci95[name])
    told = [f"{getattr(each.whole.model, name):.3g} [{low:.3g}, {high:.3g}]"]
    for half in each.halves:
        if half is not None:
            value = getattr(half.model, name)
            sure = "" if half.outcome is FitOutcome.IDENTIFIED else "?"
            told.append(f"{value:.3g}{sure} {'in' if holds(each.whole.ci95[name], value) else 'OUT'}")
    return "; ".join(told)


def main(arguments=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path, help="folder of logs")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    settings = parser.parse_args(arguments)
    paths = [str(path) for path in logs_of(settings.logs)]
    with ProcessPoolExecutor(settings.jobs) as pool:
        found = list(pool.map(compared, paths))
    print("\n".join(table(found)))


if __name__ == "__main__":
    main()

"""The best that a printer's own supervision can express for a heater: never a false trip first, then the soonest one.

Klipper's `[verify_heater]` (klippy/extras/verify_heater.py): below the target by more than `hysteresis` the distance is
added up each second; at `max_error` it stops, unless the heater is on its way and gains `heating_gain` in each
`check_gain_time`. Marlin's defines (src/module/temperature.cpp): once warm, at most `THERMAL_PROTECTION_PERIOD` seconds
below the target by more than the hysteresis; on the way `WATCH_TEMP_INCREASE` in each `WATCH_TEMP_PERIOD`. Both stop at
the ends of the sensor that their configuration allows.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.plc.klipper.export import heater_of
from heatertune.processors import threaded_list
from heatertune.progress import ProgressCallback
from heatertune.supervision.design import FRESH, Bench
from heatertune.supervision.faults import FAULTS
from heatertune.supervision.loops import Card, Ran
from heatertune.supervision.monitor import Numbers

__all__ = ["TARGETS", "Protection", "VerifyHeater", "first_stop", "lines_of", "printer_rule"]

Array = npt.NDArray[np.float64]

TARGETS: Final = ("klipper", "marlin")
_MARGIN: Final = 1.3
_WIDER: Final = 1.3  # by which margins grow where a fresh heater was stopped
_BATCHES: Final = 4
_DRAWN: Final = 40  # heaters beside the corners
_TRIED: Final = 12
_BEFORE_WATCH_DEGC: Final = 4.0  # Marlin: TEMP_HYSTERESIS and 1, above which it watches the way
_HYSTERESES: Final = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
_INCREASES: Final = (1.0, 2.0, 4.0, 8.0, 15.0)
_TIMES_S: Final = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0)
_NEVER: Final = 1e9


class VerifyHeater(NamedTuple):
    """Klipper's numbers: temperatures in °C, `max_error` in °C times seconds, the time in seconds."""

    hysteresis: float
    max_error: float
    heating_gain: float
    check_gain_time: float
    min_temp: float
    max_temp: float


class Protection(NamedTuple):
    """Marlin's numbers: temperatures in °C, times in seconds; no watch where its increase is 0."""

    hysteresis: float
    period: float
    watch_increase: float
    watch_period: float
    min_temp: float
    max_temp: float


Rule = VerifyHeater | Protection


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Record:
    """A loop as a printer sees it: temperatures [°C], targets (0: off), where a fault begins, a scan [s]."""

    reading_degC: Array
    target: Array
    first: int
    scan_s: float


def klipper(  # noqa: C901 - one branch for each of the rule, told from its begin to its end
    rule: Any, seen: Any, target: Any, scan_s: float, first: int
) -> tuple[int, float]:
    """Return the scan at which Klipper stops, -1 for never, and the largest error that could have."""
    last, error, most, goal, due = 0.0, 0.0, 0.0, 0.0, 0.0
    way, begun, until = False, False, 0.0
    for k in range(len(seen)):
        now, aim, temperature = k * scan_s, target[k], seen[k]
        if k >= first and aim > 0.0 and not rule.min_temp <= temperature <= rule.max_temp:
            return k, most
        if now < due:
            continue
        due += 1.0
        short = aim - rule.hysteresis - temperature
        if short <= 0.0 or aim <= 0.0:
            way = begun = False
            if temperature <= aim + rule.hysteresis:
                error = 0.0
            last = aim
            continue
        error += short
        if not way:
            if aim != last:
                way = begun = True
                goal, until = temperature + rule.heating_gain, now + rule.check_gain_time
            else:
                most = max(most, error)
                if error >= rule.max_error and k >= first:
                    return k, most
        elif temperature >= goal:
            begun, error = False, 0.0
            goal, until = temperature + rule.heating_gain, now + rule.check_gain_time
        elif now >= until:
            way = False
        elif begun:
            goal = min(goal, temperature + rule.heating_gain)
        last = aim
    return -1, most


def marlin(rule: Any, seen: Any, target: Any, scan_s: float, first: int) -> tuple[int, float]:
    """Return the scan at which Marlin stops, -1 for never, and for how long it was too cold once warm [s]."""
    last, warm, right, most = 0.0, False, 0.0, 0.0
    goal, until = 0.0, -1.0
    for k in range(len(seen)):
        now, aim, temperature = k * scan_s, target[k], seen[k]
        if k >= first and aim > 0.0 and not rule.min_temp <= temperature <= rule.max_temp:
            return k, most
        asked, last = aim != last, aim
        if asked:
            warm, until = False, -1.0
        if aim <= 0.0:
            continue
        if rule.watch_increase > 0.0 and (asked or 0.0 <= until < now):
            if not asked and temperature < goal and k >= first:
                return k, most
            far = temperature < aim - rule.watch_increase - _BEFORE_WATCH_DEGC
            goal, until = temperature + rule.watch_increase, now + rule.watch_period if far else -1.0
        warm = warm or temperature >= aim
        if not warm or temperature >= aim - rule.hysteresis:
            right = now
            continue
        most = max(most, now - right)
        if now - right > rule.period and k >= first:
            return k, most
    return -1, most


def first_stop(rule: Rule, bench: Bench, one: Ran, first: int) -> int:
    """Return the scan at which a printer stops a loop with a fault, -1 for never."""
    return _ran(rule, _fault_record(bench, one, first))[0]


def printer_rule(bench: Bench, numbers: Numbers, target: str, checked: int, progress: ProgressCallback) -> Rule:
    """Return the numbers of a printer's rule for a bench.

    Args:
        bench: what runs.
        numbers: of the monitor; the ends of its sensor are the rule's.
        target: of `TARGETS`.
        checked: fresh heaters that it must not stop.
        progress: told what begins.

    Raises:
        InputError: none leaves loops in order alone.
    """
    family, (low, step, _) = bench.family, bench.card
    ends = (float(math.floor(low + step * numbers.low)), float(math.ceil(low + step * numbers.high)))
    members = [family.member(2 * seed + 1, corner=seed) for seed in family.corners()]
    members += [family.member(seed) for seed in range(_DRAWN)]
    stories = threaded_list(partial(_story, bench), members)
    broken = {kind: [_broken(bench, kind, seed) for seed in range(_TRIED)] for kind in (FAULTS[1], FAULTS[2])}
    best = _klipper if target == "klipper" else _marlin
    margin = _MARGIN
    for batch in range(_BATCHES):
        progress(f"the best of {target}'s own rule ({batch + 1} of {_BATCHES})")
        rule = best(stories, list(broken.values()), ends, margin)
        seeds = range(3 * FRESH + batch * checked, 3 * FRESH + (batch + 1) * checked)
        caught = [one for one in threaded_list(partial(_stopped, bench, rule), list(seeds)) if one is not None]
        if not caught:
            return rule
        stories += caught
        margin *= _WIDER
    raise InputError(f"after {_BATCHES} tries {target}'s own rule still stops a heater in order")


def lines_of(rule: Rule, head: Sequence[str], known: Mapping[str, str]) -> tuple[str, str]:
    """Return the file and the lines of a rule.

    Args:
        rule: of a printer.
        head: remarks at its beginning.
        known: open point of the controller → its setting, the heater of the printer among them.
    """
    if isinstance(rule, VerifyHeater):
        named = rule._asdict()
        limits = [f"min_temp: {named.pop('min_temp'):g}", f"max_temp: {named.pop('max_temp'):g}"]
        text = [f"[verify_heater {heater_of(known)[1]}]", *(f"{name}: {value:g}" for name, value in named.items()), "",
                "# in the section of the heater, as its parts bear them:", *(f"# {line}" for line in limits)]
        return "klipper_verify_heater.cfg", "\n".join([*(f"# {line}" for line in head), *text]) + "\n"
    bed, limit = ("BED_", "BED") if known.get("heater") == "bed" else ("", "HEATER_0")
    defines = {f"THERMAL_PROTECTION_{bed}PERIOD": rule.period, f"THERMAL_PROTECTION_{bed}HYSTERESIS": rule.hysteresis,
               f"WATCH_{bed}TEMP_PERIOD": rule.watch_period, f"WATCH_{bed}TEMP_INCREASE": rule.watch_increase}
    whose = [] if "heater" in known else ["// of a hot end; for a bed design with --switch heater=bed"]
    text = [*whose, *(f"#define {name} {value:g}" for name, value in defines.items() if value),
            "// in Configuration.h, as its parts bear them:", f"// #define {limit}_MINTEMP {rule.min_temp:g}",
            f"// #define {limit}_MAXTEMP {rule.max_temp:g}"]
    return "marlin_protection.h", "\n".join([*(f"// {line}" for line in head), *text]) + "\n"


def _ran(rule: Rule, record: _Record) -> tuple[int, float]:
    function = klipper if isinstance(rule, VerifyHeater) else marlin
    at, most = compile_function(function)(rule, record.reading_degC, record.target, record.scan_s, record.first)
    return int(at), float(most)


def _record(card: Card, one: Ran, target: Array, first: int, scan_s: float) -> _Record:
    seen = np.asarray(card.low_degC + card.step_degC * one.counts, dtype=np.float64)
    return _Record(reading_degC=seen, target=np.where(one.power < 0, 0.0, target),
                   first=first, scan_s=scan_s)


def _story(bench: Bench, member: Any) -> _Record:
    one, scenario, scan = bench.story(member), member.scenario, bench.family.scan_s
    begins = [0.0, *(event.time_s for event in scenario.disturbances)]
    phase = np.searchsorted(begins, np.arange(len(one.counts)) * scan + 1e-9, "right") - 1
    return _record(bench.card, one, np.array(scenario.setpoints_degC)[phase], 0, scan)


def _stopped(bench: Bench, rule: Rule, seed: int) -> _Record | None:
    record = _story(bench, bench.family.member(seed))
    return None if _ran(rule, record)[0] < 0 else record


def _fault_record(bench: Bench, one: Ran, first: int) -> _Record:
    family = bench.family
    return _record(bench.card, one, np.full(len(one.counts), family.setpoint_degC), first, family.scan_s)


def _broken(bench: Bench, kind: Any, seed: int) -> _Record:
    first = math.ceil(bench.begins_s(kind) / bench.family.scan_s)
    return _fault_record(bench, bench.fault(bench.family.member(seed), kind), first)


def _late(rule: Rule, records: Sequence[_Record]) -> float:
    """Return how late a rule is, in the mean and at worst together [s]; never is as late as the record's end."""
    late = [((at if at >= 0 else len(record.reading_degC)) - record.first) * record.scan_s
            for record in records for at, _ in [_ran(rule, record)]]
    return float(np.mean(late) + max(late))


def _soonest(rules: Iterator[Any], records: Sequence[_Record], none: str) -> Any:
    found = [(_late(rule, records), number, rule) for number, rule in enumerate(rules)]
    if not found:
        raise InputError(none)
    return min(found)[2]


def _needed(rule: Rule, stories: Sequence[_Record]) -> float:
    """Return the largest error, or the longest time, of loops in order."""
    return max(most for _, most in threaded_list(partial(_ran, rule), stories))


def _klipper(
    stories: Sequence[_Record], broken: Sequence[Sequence[_Record]], ends: tuple[float, float], margin: float
) -> VerifyHeater:
    def rules() -> Iterator[VerifyHeater]:
        for hysteresis, gain, time in itertools.product(_HYSTERESES, _INCREASES, _TIMES_S):
            rule = VerifyHeater(hysteresis, _NEVER, gain, time, *ends)
            yield rule._replace(max_error=float(math.ceil(margin * _needed(rule, stories)) + 5))

    both: VerifyHeater = _soonest(rules(), [record for records in broken for record in records], "none")
    return both


def _marlin(
    stories: Sequence[_Record], broken: Sequence[Sequence[_Record]], ends: tuple[float, float], margin: float
) -> Protection:
    def warm() -> Iterator[Protection]:
        for hysteresis in _HYSTERESES:
            rule = Protection(hysteresis, _NEVER, 0.0, 0.0, *ends)
            yield rule._replace(period=float(math.ceil(margin * _needed(rule, stories)) + 2))

    at_rest: Protection = _soonest(warm(), broken[0], "none")

    def watched() -> Iterator[Protection]:
        yield at_rest
        for increase, period in itertools.product(_INCREASES, _TIMES_S):
            stricter = at_rest._replace(watch_increase=math.ceil(margin * increase), watch_period=period)
            if all(at < 0 for at, _ in threaded_list(partial(_ran, stricter), stories)):
                yield at_rest._replace(watch_increase=increase, watch_period=period)

    whole: Protection = _soonest(watched(), broken[1], "none")
    return whole

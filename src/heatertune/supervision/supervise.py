"""Supervision of proven words: the monitor and its detection time for each fault, or settings of printer firmware.

Klipper's `[verify_heater]` (klippy/extras/verify_heater.py): below the target by more than `hysteresis` the distance
is summed each second; at `max_error` it stops, unless the heater gains `heating_gain` in each `check_gain_time`.
Marlin's defines (src/module/temperature.cpp): once warm, at most `THERMAL_PROTECTION_PERIOD` seconds below the target
by more than the hysteresis; on the way `WATCH_TEMP_INCREASE` in each `WATCH_TEMP_PERIOD`. Both stop outside their
sensor range.
"""

from __future__ import annotations

import itertools
import math
import textwrap
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.codec import encode
from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.model.model_values import FittedModel
from heatertune.model.reduction import cools
from heatertune.plc import Words, controller_for
from heatertune.plc.klipper.controller import heater_of
from heatertune.plc.open_points import settings_to_prove
from heatertune.processors import ProgressCallback, threaded_list
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.loop import LoopController, actuator_of, check_words, in_loop
from heatertune.proof.prove_words import actuator_for, setpoints_for
from heatertune.proof.scenario import Scenario
from heatertune.proof.specification import specification_of
from heatertune.settings import Conditions
from heatertune.supervision.faulty_loops import (
    FAULTS,
    Card,
    FamilyMember,
    FaultKind,
    HeaterFamily,
    Ran,
    breakable_sensor,
)
from heatertune.supervision.monitor import ALARMS, Numbers
from heatertune.supervision.monitor_design import (
    FRESH,
    Bench,
    CardView,
    FaultView,
    MonitorDesign,
    OffView,
    SpreadView,
    SupervisionView,
    TraceView,
    design,
    first_alarm,
)
from heatertune.supervision.text.one_bit import TARGET, reduce_monitor
from heatertune.supervision.text.program_check import MonitorProgram, export_monitor
from heatertune.units import check, written

__all__ = [
    "TARGETS", "WARNING", "Protection", "SampleCounts", "VerifyHeater", "bench_of", "first_stop", "lines_of",
    "printer_rule", "supervise",
]


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
    rule: Any, snapshot: Any, target: Any, scan_s: float, first: int
) -> tuple[int, float]:
    """Return the scan at which Klipper stops, -1 for never, and the largest error that could have."""
    last, error, most, goal, due = 0.0, 0.0, 0.0, 0.0, 0.0
    approaching_target, starting_approach, until = False, False, 0.0
    for k in range(len(snapshot)):
        now, aim, temperature = k * scan_s, target[k], snapshot[k]
        if k >= first and aim > 0.0 and not rule.min_temp <= temperature <= rule.max_temp:
            return k, most
        if now < due:
            continue
        due += 1.0
        short = aim - rule.hysteresis - temperature
        if short <= 0.0 or aim <= 0.0:
            approaching_target = starting_approach = False
            if temperature <= aim + rule.hysteresis:
                error = 0.0
            last = aim
            continue
        error += short
        if not approaching_target:
            if aim != last:
                approaching_target = starting_approach = True
                goal, until = temperature + rule.heating_gain, now + rule.check_gain_time
            else:
                most = max(most, error)
                if error >= rule.max_error and k >= first:
                    return k, most
        elif temperature >= goal:
            starting_approach, error = False, 0.0
            goal, until = temperature + rule.heating_gain, now + rule.check_gain_time
        elif now >= until:
            approaching_target = False
        elif starting_approach:
            goal = min(goal, temperature + rule.heating_gain)
        last = aim
    return -1, most


def marlin(rule: Any, snapshot: Any, target: Any, scan_s: float, first: int) -> tuple[int, float]:
    """Return the scan at which Marlin stops, -1 for never, and for how long it was too cold once warm [s]."""
    last, warm, right, most = 0.0, False, 0.0, 0.0
    goal, until = 0.0, -1.0
    for k in range(len(snapshot)):
        now, aim, temperature = k * scan_s, target[k], snapshot[k]
        if k >= first and aim > 0.0 and not rule.min_temp <= temperature <= rule.max_temp:
            return k, most
        is_new_target, last = aim != last, aim
        if is_new_target:
            warm, until = False, -1.0
        if aim <= 0.0:
            continue
        if rule.watch_increase > 0.0 and (is_new_target or 0.0 <= until < now):
            if not is_new_target and temperature < goal and k >= first:
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


def first_stop(rule: Rule, bench: Bench, run: Ran, first: int) -> int:
    """Return the scan at which a printer stops a loop with a fault, -1 for never."""
    return _ran(rule, _fault_record(bench, run, first))[0]


def printer_rule(bench: Bench, numbers: Numbers, target: str, checked: int, progress: ProgressCallback) -> Rule:
    """Return the numbers of a printer's rule for a bench.

    Args:
        bench: what runs.
        numbers: of the monitor; the ends of its sensor are the rule's.
        target: of `TARGETS`.
        checked: fresh heaters that it must not stop.
        progress: called with a few words as each step begins.

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


def lines_of(rule: Rule, head: Sequence[str], stated: Mapping[str, str]) -> tuple[str, str]:
    """Return the file and the lines of a rule.

    Args:
        rule: of a printer.
        head: remarks at its beginning.
        stated: open point of the controller → its setting, the heater of the printer among them.
    """
    if isinstance(rule, VerifyHeater):
        table = rule._asdict()
        limits = [f"min_temp: {table.pop('min_temp'):g}", f"max_temp: {table.pop('max_temp'):g}"]
        text = [f"[verify_heater {heater_of(stated)[1]}]", *(f"{name}: {value:g}" for name, value in table.items()), "",
                "# in the section of the heater, as its parts bear them:", *(f"# {line}" for line in limits)]
        return "klipper_verify_heater.cfg", "\n".join([*(f"# {line}" for line in head), *text]) + "\n"
    bed, limit = ("BED_", "BED") if stated.get("heater") == "bed" else ("", "HEATER_0")
    defines = {f"THERMAL_PROTECTION_{bed}PERIOD": rule.period, f"THERMAL_PROTECTION_{bed}HYSTERESIS": rule.hysteresis,
               f"WATCH_{bed}TEMP_PERIOD": rule.watch_period, f"WATCH_{bed}TEMP_INCREASE": rule.watch_increase}
    whose = [] if "heater" in stated else ["// of a hot end; for a bed design with --assume heater=bed"]
    text = [*whose, *(f"#define {name} {value:g}" for name, value in defines.items() if value),
            "// in Configuration.h, as its parts bear them:", f"// #define {limit}_MINTEMP {rule.min_temp:g}",
            f"// #define {limit}_MAXTEMP {rule.max_temp:g}"]
    return "marlin_protection.h", "\n".join([*(f"// {line}" for line in head), *text]) + "\n"


def _ran(rule: Rule, record: _Record) -> tuple[int, float]:
    function = klipper if isinstance(rule, VerifyHeater) else marlin
    at, most = compile_function(function)(rule, record.reading_degC, record.target, record.scan_s, record.first)
    return int(at), float(most)


def _record(card: Card, run: Ran, target: Array, first: int, scan_s: float) -> _Record:
    readings_degC = np.asarray(card.low_degC + card.step_degC * run.counts, dtype=np.float64)
    return _Record(reading_degC=readings_degC, target=np.where(run.power < 0, 0.0, target), first=first, scan_s=scan_s)


def _story(bench: Bench, member: Any) -> _Record:
    one, scenario, scan = bench.story(member), member.scenario, bench.family.scan_s
    begins = [0.0, *(event.time_s for event in scenario.disturbances)]
    phase = np.searchsorted(begins, np.arange(len(one.counts)) * scan + 1e-9, "right") - 1
    return _record(bench.card, one, np.array(scenario.setpoints_degC)[phase], 0, scan)


def _stopped(bench: Bench, rule: Rule, seed: int) -> _Record | None:
    record = _story(bench, bench.family.member(seed))
    return None if _ran(rule, record)[0] < 0 else record


def _fault_record(bench: Bench, run: Ran, first: int) -> _Record:
    family = bench.family
    return _record(bench.card, run, np.full(len(run.counts), family.setpoint_degC), first, family.scan_s)


def _broken(bench: Bench, kind: Any, seed: int) -> _Record:
    first = math.ceil(bench.begins_s(kind) / bench.family.scan_s)
    return _fault_record(bench, bench.fault(bench.family.member(seed), kind), first)


def _late(rule: Rule, records: Sequence[_Record]) -> float:
    """Return how late a rule is, in the mean and at worst together [s]; never is as late as the record's end."""
    late = [((at if at >= 0 else len(record.reading_degC)) - record.first) * record.scan_s
            for record in records for at, _ in [_ran(rule, record)]]
    return float(np.mean(late) + max(late))


def _soonest(rules: Iterator[Any], records: Sequence[_Record], none: str) -> Any:
    trips = [(_late(rule, records), number, rule) for number, rule in enumerate(rules)]
    if not trips:
        raise InputError(none)
    return min(trips)[2]


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


WARNING: Final = (
    "This does not replace a thermal cut-out: it sees what the controller sees, through the same sensor, and switches "
    "off through whatever the program can reach.")
#: sensor noise where neither the user nor the log tells it [°C]
_NOISE_DEGC: Final = 0.1
_LATER: Final = 2 * FRESH  # seeds of the heaters that break
_POINTS: Final = 400  # of a trace
_DRAWN_SHARE: Final = 0.6  # of the slowest heater's time, for which a trace is drawn at least
_STORIES: Final = 2  # on which the program is run beside the monitor
#: a run and the scan at which its fault begins → the scan at which something stops it, -1 for never, and what it says
_First = Callable[[Ran, int], tuple[int, str]]
_NOT_TESTED: Final = (
    "a temperature that jumps at once (cold goods, a door): it may trip as a sensor does that slips",
    "a load of more than 15 % of full power, a mains voltage beyond ±10 %",
    "a sensor that drifts or slips slowly: its readings are those of another heater",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleCounts:
    """How widely, and how often, heaters are drawn.

    Attributes:
        spread_pct: half width of gain and lags; the dead time's is half as much again [%].
        ambient_degC: half width of the ambient temperature [°C].
        least_noise_degC: noise that the sensor has at least [°C].
        checked: fresh heaters on which the monitor must not trip.
        broken: heaters that break, for each fault.
        seed: of the first one.

    Raises:
        OutOfRange: one without meaning.
    """

    spread_pct: float = 20.0
    ambient_degC: float = 5.0
    least_noise_degC: float = 0.0
    checked: int = 1000
    broken: int = 60
    seed: int = 0

    def __post_init__(self) -> None:
        check("--spread", self.spread_pct, least=0.0, most=60.0)
        check("--ambient-spread", self.ambient_degC, least=0.0, most=50.0)
        check("--least-noise", self.least_noise_degC, least=0.0)
        check("--samples", self.checked, least=1, most=1_000_000)
        check("--faults-per-kind", self.broken, least=1, most=100_000)
        check("--seed", self.seed, least=0, most=FRESH - 1000)


def supervise(
    words: Words, fitted: FittedModel, conditions: Conditions | None = None, drawn: SampleCounts | None = None, *,
    progress: ProgressCallback = str,
) -> dict[str, Any]:
    """Return the monitor of a loop and what it sees, as a JSON object.

    Args:
        words: what the controller holds.
        fitted: the heater; the possible ones are drawn around.
        conditions: as of the proof; without a noise it is the log's, or 0.1 °C.
        drawn: how heaters are drawn; None: as by default.
        progress: called with a few words as each step begins.

    Raises:
        InputError: a cooler; no limits tell loops in order from broken ones.
        OutOfRange: a setpoint out of the sensor's range or of a heater's reach.
        UnknownName: no such switch or setting.
    """
    assumed, drawn = conditions or Conditions(), drawn or SampleCounts()
    bench = bench_of(words, fitted, assumed, drawn)
    monitor = design(bench, drawn.checked, seed=drawn.seed, progress=progress)
    faults = []
    for number, kind in enumerate(FAULTS):
        progress(f"{kind.name} ({number + 1} of {len(FAULTS)})")
        faults.append(_fault(bench, _monitored(monitor.numbers), kind, drawn))
    family, card = bench.family, bench.card
    head, built_in = list(_head(words, family, monitor, card)), list[FaultView]()
    if words.target in TARGETS:
        write = partial(lines_of, head=head, stated=dict(assumed.switches))
        program, built_in = _by_printer(bench, monitor, words, drawn, write, progress)
    else:
        progress("comparing the program of the monitor with it")
        program = export_monitor(monitor.numbers, words, card, head, _runs(bench, drawn))
    if words.target == TARGET:
        built_in = [_fault(bench, _monitored(reduce_monitor(monitor.numbers)), kind, drawn) for kind in FAULTS]
    document: dict[str, Any] = encode(SupervisionView(
        warning=WARNING, target=words.target, words=dict(words.values), scan_s=family.scan_s,
        setpoint_degC=family.setpoint_degC, card=CardView(zero_degC=card.low_degC, step_degC=card.step_degC),
        numbers=monitor.numbers._asdict(), rules=tuple(_meanings(monitor, card, family.scan_s)),
        spread_pct=drawn.spread_pct, ambient_spread_degC=drawn.ambient_degC, noise_degC=family.noise_degC,
        seed=drawn.seed, checked=monitor.checked, false_trips=0, widened_for=monitor.tripped,
        off=tuple(OffView(rule=rule, why=why) for rule, why in monitor.off), faults=tuple(faults),
        not_tested=(*_NOT_TESTED, *_untested(assumed)), program=program, heaters=len(family.heaters),
        built_in=tuple(replace(row, missed_because=None) for row in built_in), trace=_trace(bench, monitor, FAULTS[0])))
    return document


def bench_of(words: Words, fitted: FittedModel, conditions: Conditions, drawn: SampleCounts) -> Bench:
    """Return what runs.

    Raises:
        InputError: a cooler; less noise at most than at least.
        OutOfRange: as `supervise`.
    """
    if cools(fitted):
        raise InputError("a monitor is made for heaters; this one cools")
    controller = controller_for(words.target)
    setpoint, _ = setpoints_for(fitted, conditions)
    check_words(controller, words, Scenario(setpoint_degC=setpoint, duration_s=1.0))
    noise = conditions.noise_degC or fitted.reading_step_degC or _NOISE_DEGC
    if drawn.least_noise_degC > noise:
        raise InputError(f"--least-noise is {drawn.least_noise_degC:g} °C; at most the noise of {noise:g} °C")
    settings = list(settings_to_prove(controller.switches, dict(conditions.switches)))

    def loop_of(setpoints: Sequence[float], seed: int) -> LoopController:
        return breakable_sensor(in_loop(controller, words, setpoints, settings[seed % len(settings)], direct=True))

    family = HeaterFamily(
        heaters=[heater for _, heater in holding_heaters(fitted, setpoint)], setpoint_degC=setpoint,
        low_degC=conditions.lowest_degC, scan_s=controller.timing(words).scan_s,
        delay_s=controller.delayed_s(words.scaling), spread=drawn.spread_pct / 100.0, ambient_degC=drawn.ambient_degC,
        noise_degC=(drawn.least_noise_degC, noise), ramp_degC_per_min=controller.ramp_degC_per_min(words))
    actuator = actuator_of(loop_of([setpoint], 0), actuator_for(conditions, words))
    return Bench(loop=loop_of, actuator=actuator, family=family)


def _untested(conditions: Conditions) -> Iterator[str]:
    if specification_of(conditions).profile is not None:
        yield "the profile: steps of the setpoint stand for it"
    if conditions.interlock is not None:
        yield "the interlock"


def _fault(bench: Bench, first_of: _First, kind: FaultKind, drawn: SampleCounts) -> FaultView:
    scan_s, begins = bench.family.scan_s, bench.begins_s(kind)
    first = math.ceil(begins / scan_s)

    def seen(member: FamilyMember) -> tuple[float, float, str]:
        one = bench.fault(member, kind)
        at, alarm = first_of(one, first)
        if at >= 0:
            one = bench.fault(member, kind, at * scan_s)
        return (at - first) * scan_s if at >= 0 else math.nan, float(one.temperature_degC[first:].max()), alarm

    members = [bench.family.member(_LATER + drawn.seed + number) for number in range(drawn.broken)]
    times, peaks, alarms = zip(*threaded_list(seen, members), strict=True)
    late = [time for time in times if not math.isnan(time)]
    return FaultView(
        name=kind.name, heaters=len(members), detected=len(late), detection_s=_of(late) if late else None,
        peak_degC=_of(peaks), alarms=dict(Counter(alarm for alarm in alarms if alarm)),
        missed_because=None if len(late) == len(members) else _missed(kind))


def _trace(bench: Bench, design: MonitorDesign, kind: FaultKind) -> TraceView:
    """Return a fault on one heater around its alarm: what it does if nobody sees it, and switched off by the alarm."""
    family, member = bench.family, bench.family.member(_LATER)
    first = math.ceil(bench.begins_s(kind) / family.scan_s)
    left = bench.fault(member, kind)
    at, _ = first_alarm(design.numbers, left, first)
    stopped = left if at < 0 else bench.fault(member, kind, at * family.scan_s)
    lasts = max(4 * (at - first), int(_DRAWN_SHARE * family.slowest_s / family.scan_s))
    begin, end = max(0, first - lasts // 4), min(first + lasts, len(left.counts))
    part = slice(begin, end, max(1, (end - begin) // _POINTS))
    time_s = (np.arange(begin, end) - first)[::part.step] * family.scan_s
    return TraceView(
        name=kind.name, time_s=tuple(time_s.tolist()), left_degC=tuple(left.temperature_degC[part].tolist()),
        stopped_degC=tuple(stopped.temperature_degC[part].tolist()),
        alarm_s=None if at < 0 else (at - first) * family.scan_s)


def _monitored(numbers: Numbers) -> _First:
    def first_of(run: Ran, first: int) -> tuple[int, str]:
        at, alarm = first_alarm(numbers, run, first)
        return at, ALARMS[alarm] if alarm else ""
    return first_of


def _by_printer(
    bench: Bench, design: MonitorDesign, words: Words, drawn: SampleCounts, write: Callable[[Rule], tuple[str, str]],
    progress: ProgressCallback
) -> tuple[MonitorProgram, list[FaultView]]:
    """Return the lines of a printer's own rule, and how soon it sees each fault."""
    try:
        rule = printer_rule(bench, design.numbers, words.target, drawn.checked, progress)
    except InputError as problem:
        return MonitorProgram(why=str(problem)), []
    file, text = write(rule)

    def first_of(run: Ran, first: int) -> tuple[int, str]:
        at = first_stop(rule, bench, run, first)
        return at, "stops" if at >= 0 else ""

    rows = [_fault(bench, first_of, kind, drawn) for kind in FAULTS]
    return MonitorProgram(file=file, text=text), rows


def _of(values: Sequence[float]) -> SpreadView:
    median, p95 = np.percentile(values, [50.0, 95.0]).tolist()
    return SpreadView(median=median, p95=p95, worst=max(values))


def _missed(kind: FaultKind) -> str:
    if kind.later != 1.0:
        return "the loop bears it: it is slower to settle and hardly swings"
    if kind.sensor == "frozen":
        return ("a reading that stays where the setpoint is asks for the power that holds it: nothing moves, until a "
                "load or the setpoint does; where the process bears it, move the setpoint a little now and then")
    if kind.sensor != "right":
        return "its readings are those of another plausible heater"
    return "with what is left it does what a weaker heater, a lower voltage or a load make of one in order"


def _runs(bench: Bench, drawn: SampleCounts) -> list[Ran]:
    """Return the runs on which the program is held against the monitor: stories, and each fault once."""
    members = [bench.family.member(_LATER + drawn.seed + number) for number in range(_STORIES)]
    return [*threaded_list(bench.story, members), *threaded_list(lambda kind: bench.fault(members[0], kind), FAULTS)]


def _head(words: Words, family: HeaterFamily, design: MonitorDesign, card: Card) -> Iterator[str]:
    """Return the head of the program."""
    yield (f"Supervision of the heater by {words.target}'s own rule, numbers by heatertune" if words.target in TARGETS
           else f"Monitor of the heater beside the controller of {words.target}, written by heatertune")
    yield from textwrap.wrap(WARNING, 100)
    yield (f"proven: no false trip on {design.checked} drawn heaters; setpoint {family.setpoint_degC:g} degC, called "
           f"every {family.scan_s:g} s")
    yield f"count 0 = {card.low_degC:g} degC, a count = {card.step_degC:.6g} degC"
    yield "not tried in the maker's own tool or machine"


def _seconds(time: float) -> str:
    return f"{written(time, 3)} s"


def _meanings(design: MonitorDesign, card: Card, scan: float) -> Iterator[str]:
    """Return the meaning of the numbers, one sentence for each rule."""
    numbers, step = design.numbers, card.step_degC
    block = numbers.block * scan
    yield f"A block is {numbers.block} scans, {_seconds(block)}."
    yield (f"Sensor gone: below {card.low_degC + step * numbers.low:.4g} °C or above "
           f"{card.low_degC + step * numbers.high:.4g} °C.")
    yield f"Implausible rate: more than {step * numbers.jump:.3g} °C from scan to scan."
    if numbers.still:
        yield f"Frozen: the same reading for more than {_seconds(numbers.still * scan)}."
    if numbers.still_moved:
        yield (f"Frozen: the same reading for more than {_seconds(numbers.still_moved * scan)} after the power has "
               f"moved by {numbers.moved} % or more.")
    if numbers.slow_blocks:
        yield (f"Heats too slowly, falls although heated: over {_seconds(numbers.slow_blocks * block)} less than the "
               f"power of {written(numbers.delay_low * block, 3)}…{_seconds(numbers.delay_high * block)} ago explains.")
    if numbers.fast_blocks:
        yield f"Too hot for its power: over {_seconds(numbers.fast_blocks * block)} more than it explains."
    yield f"Setpoint out of reach: full power for more than {_seconds(numbers.full * scan)}."
    yield (f"Swing grows: {numbers.growths + 1} swings of {step * numbers.swing / numbers.block:.3g} °C or more in a "
           "row, each larger than the one before.")

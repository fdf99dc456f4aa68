"""Design a monitor for plausible heaters and their whole test sequence: no false trip, then the earliest alarm.

Each limit is what healthy loops need plus a margin: planes over level and power, in whole numbers, around the least
and largest movement. The windows are those that detect a stuck switch and an open heater soonest. The result is tested
on other healthy heaters; if one trips, limits are widened and others drawn, until a whole batch passes.

Also what supervision.json holds: the monitor, how soon it sees each fault, its program; checked when it is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.codec import decode, read_document, register_schema
from heatertune.compiled import compile_function
from heatertune.errors import DocumentError, InputError
from heatertune.plc.pwm import Actuator
from heatertune.processors import ProgressCallback, threaded_list
from heatertune.proof.loop import LoopController, scans_of
from heatertune.proof.scenario import Scenario
from heatertune.supervision.faulty_loops import (
    FAULTS,
    Card,
    FamilyMember,
    Fault,
    FaultKind,
    HeaterFamily,
    Ran,
    card_of,
    ran,
)
from heatertune.supervision.monitor import RING, STATE, Numbers, is_full, restart, scan, scan_counts, watch, window_sums
from heatertune.supervision.text.program_check import MonitorProgram
from heatertune.units import written

__all__ = [
    "FRESH", "SCHEMA", "Bench", "CardView", "FaultView", "MonitorDesign", "OffView", "Plane", "SpreadView",
    "SupervisionView", "Tally", "TraceView", "design", "first_alarm", "plane_of", "read_supervision", "tally",
    "windows",
]


Table = npt.NDArray[np.int64]

_BINS: Final = 48
_ALL_WEIGHT: Final = 0.05  # of a plane's mean distance, beside that at the point it is made for
#: what products of a monitor's numbers may reach: half of a 32-bit whole number
_MOST: Final = 1 << 30
_SCALES: Final = (4096, 1024, 256, 64, 16, 4, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """movement · scale ≤ gain · power − loss · level + rest, as whole numbers; for the least movement ≥."""

    scale: int
    gain: int
    loss: int
    rest: int


def plane_of(
    rows: Table, points: npt.NDArray[np.float64], *, largest: bool, share: float, more: float,
) -> Plane | None:
    """Return the closest plane that no row crosses, None where no whole numbers hold it.

    Args:
        rows: movement, level and power of windows, shape (n, 3).
        points: (level, power) at which it shall be close, shape (m, 2).
        largest: whether it bounds the largest movement.
        share: of the plane's distance from standstill at the first point that is left as a margin.
        more: further margin, in the unit of the movement.
    """
    sign = 1.0 if largest else -1.0
    move, level, power = (rows[:, column].astype(float) for column in range(3))
    gain, loss, rest = _fitted(sign * move, level, power, points, sign)
    # in the sense of the sign: move·s ≤ s·(gain·power − loss·level) + rest
    left = float(np.max(sign * move - sign * (gain * power - loss * level) - rest))
    at = points[0]
    standing = abs(sign * (gain * at[1] - loss * at[0]) + rest + left)
    rest += max(left, 0.0) + share * standing + more
    for scale in _SCALES:
        whole_gain, whole_loss = round(gain * scale), round(loss * scale)
        # the rest takes up what rounding the others moved
        moved = np.max(sign * ((gain * scale - whole_gain) * power - (loss * scale - whole_loss) * level))
        whole_rest = int(np.ceil(rest * scale + max(float(moved), 0.0)))
        reach = max(scale * np.abs(move).max() * 4, whole_gain * power.max() * 1.5, whole_loss * level.max() * 1.5)
        if max(reach, abs(whole_rest)) < _MOST:
            return Plane(scale=scale, gain=whole_gain, loss=whole_loss, rest=int(sign) * whole_rest)
    return None


def _fitted(
    move: npt.NDArray[np.float64], level: npt.NDArray[np.float64], power: npt.NDArray[np.float64],
    points: npt.NDArray[np.float64], sign: float,
) -> tuple[float, float, float]:
    """Return gain, loss and rest of the closest plane above the largest movement of each part of the field."""
    from scipy.optimize import linprog

    units = max(np.abs(move).max(), 1.0), max(level.max(), 1.0), max(power.max(), 1.0)
    m, r, u = move / units[0], level / units[1], power / units[2]
    field = (np.clip(r * _BINS, 0, _BINS - 1).astype(int) * _BINS + np.clip(u * _BINS, 0, _BINS - 1).astype(int))
    order = np.lexsort((m, field))
    last = order[np.append(field[order][1:] != field[order][:-1], True)]
    m, r, u = m[last], r[last], u[last]
    above = np.column_stack([sign * u, -sign * r, np.ones(len(m))])
    near = np.column_stack([sign * points[:, 1] / units[2], -sign * points[:, 0] / units[1], np.ones(len(points))])
    cost = near.mean(axis=0) + _ALL_WEIGHT * above.mean(axis=0)
    solution = linprog(cost, A_ub=-above, b_ub=-m, bounds=[(0.0, None), (0.0, None), (None, None)], method="highs")
    gain, loss, rest = solution.x if solution.success else (0.0, 0.0, float(m.max()))
    return gain * units[0] / units[2], loss * units[0] / units[1], rest * units[0]


#: places of `_tallied`
_TALLIES: Final = 8


class Tally(NamedTuple):
    """Extremes of one loop: readings [counts], moves from scan to scan, and how long what lasted [scans].

    `still_moved` is how long a reading stayed the same although the power moved; `grew` how many swings in a row grew.
    """

    low: int
    high: int
    jump: int
    still: int
    still_moved: int
    full: int
    grew: int
    steady: int


def _tallied(numbers: Numbers, state: Any, readings: Any, powers: Any, settled: int, begins: int, out: Any) -> None:
    restart(state)
    off, has_level, last, least, most = True, False, 0, 0, 0
    for k in range(len(readings)):
        reading, power = int(readings[k]), int(powers[k])
        if power < 0:
            off = True
            continue
        if off:
            restart(state)
            off, last = False, reading
        scan(numbers, state, reading, power)
        still, moved, full, grew, ended, level = scan_counts(state)
        out[0], out[1] = min(out[0], reading), max(out[1], reading)
        out[2] = max(out[2], reading - last, last - reading)
        out[3], out[4], out[5], out[6] = max(out[3], still), max(out[4], moved), max(out[5], full), max(out[6], grew)
        if begins <= k < settled and ended:
            least, most = (min(least, level), max(most, level)) if has_level else (level, level)
            out[7], has_level = most - least, True
        last = reading


def _windows(numbers: Numbers, state: Any, readings: Any, powers: Any, blocks: int, largest: bool, out: Any) -> int:
    restart(state)
    off, rows = False, 0
    for k in range(len(readings)):
        if powers[k] < 0:
            off = True
            continue
        if off:
            restart(state)
            off = False
        scan(numbers, state, int(readings[k]), int(powers[k]))
        if is_full(numbers, state, blocks):
            out[rows, 0], out[rows, 1], out[rows, 2] = window_sums(numbers, state, blocks, largest)
            rows += 1
    return rows


def tally(numbers: Numbers, run: Ran, rest: tuple[int, int]) -> Tally:
    """Return the extremes of a loop in order; within the scans `rest` it is at rest."""
    out = np.zeros(_TALLIES, dtype=np.int64)
    out[0] = 1 << 40
    compile_function(_tallied)(numbers, _state(), run.counts, run.power, rest[1], rest[0], out)
    return Tally(*out.tolist())


def windows(numbers: Numbers, run: Ran, blocks: int, *, largest: bool) -> npt.NDArray[np.int64]:
    """Return movement, level and power of each window of a loop, shape (n, 3)."""
    out = np.empty((len(run.counts) // numbers.block + 1, 3), dtype=np.int64)
    return out[:compile_function(_windows)(numbers, _state(), run.counts, run.power, blocks, largest, out)]


def first_alarm(numbers: Numbers, run: Ran, first: int = 0) -> tuple[int, int]:
    """Return the scan of the first alarm from a scan on, -1 for none, and the alarm."""
    at, alarm = compile_function(watch)(numbers, _state(), run.counts, run.power, first)
    return int(at), int(alarm)


def _state() -> npt.NDArray[np.int64]:
    return np.zeros(STATE, dtype=np.int64)


_DRAWN: Final = 200  # heaters beside the corners
_TURNS: Final = 2  # how often each corner is run, with other noise and loads
_CORNER_SEEDS: Final = 3_000_000
_FEW: Final = 80  # runs by which a window is chosen
_TRIED: Final = 12  # faults by which a window is chosen
_BATCHES: Final = 4
#: seeds from here on are those of heaters that no limit is made from
FRESH: Final = 1_000_000
_WINDOWS: Final = (2, 3, 4, 6, 8, 11, 15, 20)
_MOST_DELAY: Final = 36  # blocks
_MARGIN: Final = 0.15  # of each limit
_WIDER: Final = 1.6  # by which margins grow where a fresh heater tripped
_MOVED_PCT: Final = 20
_LONG: Final = 4.0  # a sensor may be silent for so many times the slowest heater's time: no longer a rule
_AFTER: Final = 1.5  # of the slowest heater's time, for which a fault is watched
_OFF: Final = 1 << 30


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """What runs: the words asked for whatever setpoints, the switch, and whom.

    Attributes:
        loop: setpoints of the phases [°C] and a seed → the controller under one of the settings that its manual leaves
            open, see `heatertune.supervision.faulty_loops.breakable_sensor`.
        actuator: the switch.
        family: of heaters.
    """

    loop: Callable[[Sequence[float], int], LoopController]
    actuator: Actuator
    family: HeaterFamily

    @property
    def card(self) -> Card:
        """The input module."""
        return card_of(self.loop([self.family.setpoint_degC], 0))

    def story(self, member: FamilyMember) -> Ran:
        """Run a heater through its story."""
        return self._ran(member, member.scenario)

    def fault(self, member: FamilyMember, kind: FaultKind, tripped_s: float = math.inf) -> Ran:
        """Run a heater that breaks, and may then be switched off."""
        begins = self.begins_s(kind)
        lasts = self.family.settled_s() if kind.cold else begins
        if kind.later != 1.0:
            row = member.row
            member = replace(member, row=[*row[:3], kind.later * row[3], *row[4:]])
        scenario = Scenario(setpoint_degC=self.family.setpoint_degC, ambient_degC=member.row[4],
                            duration_s=lasts + _AFTER * self.family.slowest_s)
        wrong = Fault(time_s=begins, mains=kind.mains, stuck_pct=kind.stuck_pct, sensor=kind.sensor)
        return self._ran(member, scenario, wrong, tripped_s)

    def begins_s(self, kind: FaultKind) -> float:
        """Return when a fault begins [s]."""
        scan = self.family.scan_s
        return (1 + round(0.3 * self.family.way_s() / scan if kind.sensor != "right" else 0)) * scan if kind.cold else (
            self.family.settled_s())

    def _ran(self, member: FamilyMember, scenario: Scenario, fault: Fault | None = None,
             tripped_s: float = math.inf) -> Ran:
        loop = self.loop(scenario.setpoints_degC, member.seed)
        return ran(loop, member.row, scenario, self.actuator, member.noise(scans_of(loop, scenario)), fault=fault,
                   tripped_s=tripped_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorDesign:
    """A monitor.

    Attributes:
        numbers: it holds.
        checked: fresh heaters that it did not trip on, of how many.
        tripped: of the batches before, whose limits were made wider.
        off: rules that are switched off, and why.
    """

    numbers: Numbers
    checked: int
    tripped: int
    off: tuple[tuple[str, str], ...]


def design(bench: Bench, checked: int = 300, *, seed: int = 0, progress: ProgressCallback = str) -> MonitorDesign:
    """Return the monitor of a bench.

    Args:
        bench: what runs.
        checked: fresh heaters that it must not trip on.
        seed: of the first heater that is drawn.
        progress: called with a few words as each step begins.

    Raises:
        InputError: loops in order differ so much that no limit tells them from broken ones in 32 bits.
    """
    bare = _bare(bench)
    progress("running the plausible heaters through the test sequence")
    family, corners = bench.family, bench.family.corners()
    members = [family.member(_CORNER_SEEDS + turn, corner=turn % len(corners)) for turn in range(_TURNS * len(corners))]
    members += [family.member(drawn) for drawn in range(seed, seed + _DRAWN)]
    runs = threaded_list(bench.story, members)
    progress("choosing limits and windows")
    numbers, off = _limits(bench, bare, runs)
    broken = {kind: _broken(bench, kind, seed) for kind in (FAULTS[0], FAULTS[1])}
    margin, tripped = _MARGIN, 0
    windows_of = _chosen(bench, numbers, runs[:_FEW], broken, margin)
    for batch in range(_BATCHES):
        monitor = _with_windows(bench, numbers, runs, windows_of, margin)
        progress(f"trying it on {checked} other heaters ({batch + 1} of {_BATCHES})")
        seeds = range(seed + FRESH + batch * checked, seed + FRESH + (batch + 1) * checked)
        trips = threaded_list(partial(_trips, bench, monitor), list(map(family.member, seeds)))
        caught = [one for one in trips if one is not None]
        if not caught:
            return MonitorDesign(numbers=monitor, checked=checked, tripped=tripped, off=off)
        tripped += len(caught)
        runs += caught
        margin *= _WIDER
        numbers, off = _limits(bench, bare, runs, margin / _MARGIN)
    raise InputError(
        f"no monitor: after {_BATCHES} tries a heater in order still trips it; a smaller --spread may help")


def _trips(bench: Bench, numbers: Numbers, member: FamilyMember) -> Ran | None:
    one = bench.story(member)
    return None if first_alarm(numbers, one)[0] < 0 else one


def _bare(bench: Bench) -> Numbers:
    """Return numbers whose rules are all off, with the block and the delays of a family."""
    scan, family = bench.family.scan_s, bench.family
    low, high = family.dead_times_s
    lag = min(sum(heater.lags_s) for heater in family.heaters)
    pwm = max(1, round(bench.actuator.pwm_period_s / scan))
    wish = max(0.25 * high, 0.01 * lag, high / _MOST_DELAY) / scan
    block = max(pwm * math.ceil(wish / pwm), 1)
    seconds = block * scan
    return Numbers(
        block=block, low=-_OFF, high=_OFF, jump=_OFF, still=0, still_moved=0, moved=_MOVED_PCT,
        delay_low=int(low / seconds), delay_high=math.ceil((high + bench.actuator.pwm_period_s) / seconds),
        slow_blocks=0, slow_scale=1, slow_gain=0, slow_loss=0, slow_rest=0, fast_blocks=0, fast_scale=1, fast_gain=0,
        fast_loss=0, fast_rest=0, full=0, swing=_OFF, growths=0)


def _limits(
    bench: Bench, bare: Numbers, runs: Sequence[Ran], wider: float = 1.0
) -> tuple[Numbers, tuple[tuple[str, str], ...]]:
    """Return the numbers of the rules without a window, and which of them are off and why."""
    family, scan = bench.family, bench.family.scan_s
    rest = (int((family.settled_s() - 2.0 * family.slowest_s) / scan), int(family.settled_s() / scan))
    first = threaded_list(lambda entry: tally(bare, entry, rest), runs)
    swing = max(4 * bare.block, math.ceil(1.5 * max(one.steady for one in first)))
    watching = bare._replace(swing=swing, growths=RING)
    of = threaded_list(lambda entry: tally(watching, entry, rest), runs)
    share = _MARGIN * wider
    span = max(one.high for one in of) - min(one.low for one in of)

    def more(scans: int) -> int:
        return math.ceil((1.0 + 3.0 * share) * scans) + bare.block

    longest = int(_LONG * family.slowest_s / scan)
    still, moved = more(max(one.still for one in of)), more(max(one.still_moved for one in of))
    off = tuple(_silent(still, moved, longest, scan))
    low, high = min(one.low for one in of), max(one.high for one in of)
    card = bench.card
    # what the card shows of a sensor that is gone is no reading, unless loops in order come that far
    below, above = math.floor(low - share * span) - 2, math.ceil(high + share * span) + 2
    numbers = watching._replace(
        low=min(max(below, 1), low), high=max(min(above, card.highest - 1), high),
        jump=math.ceil((1.0 + 3.0 * share) * max(one.jump for one in of)) + 2,
        still=still if still <= longest else 0, still_moved=moved if moved <= longest else 0,
        full=more(max(one.full for one in of)), growths=max(one.grew for one in of) + 3)
    return numbers, off


def _silent(still: int, moved: int, longest: int, scan: float) -> Iterator[tuple[str, str]]:
    if still > longest:
        yield ("frozen", f"a sensor in order may read the same for {written(still * scan, 3)} s while the loop is at "
                         "rest: too little noise, or too coarse a card")
    if moved > longest:
        yield ("frozen while the power moves", f"a sensor in order may read the same for {written(moved * scan, 3)} s "
                                               f"after the power has moved by {_MOVED_PCT} %")


def _broken(bench: Bench, kind: FaultKind, seed: int) -> list[tuple[Ran, int]]:
    members = [bench.family.member(drawn) for drawn in range(seed, seed + _TRIED)]
    begins = math.ceil(bench.begins_s(kind) / bench.family.scan_s)
    return [(one, begins) for one in threaded_list(lambda member: bench.fault(member, kind), members)]


def _chosen(
    bench: Bench, numbers: Numbers, runs: Sequence[Ran], broken: dict[FaultKind, list[tuple[Ran, int]]], margin: float,
) -> dict[bool, int]:
    """Return the blocks of the windows: of the largest movement (True) and of the least."""
    chosen = {True: 0, False: 0}
    for largest, (_, ones) in zip((True, False), broken.items(), strict=True):
        best = math.inf
        for blocks in _WINDOWS:
            if blocks + numbers.delay_high > RING - 3:
                continue
            tried = _with_windows(bench, numbers._replace(low=-_OFF, high=_OFF, jump=_OFF, still=0, still_moved=0),
                                  runs, {largest: blocks, not largest: 0}, margin)
            late = []
            for one, begins in ones:
                at, _ = first_alarm(tried, one, begins)
                late.append(len(one.counts) if at < 0 else at - begins)
            cost = float(np.mean(late) + max(late))
            if cost < best:
                best, chosen[largest] = cost, blocks
    return chosen


def _with_windows(
    bench: Bench, numbers: Numbers, runs: Sequence[Ran], blocks: dict[bool, int], margin: float
) -> Numbers:
    """Return the numbers with those of the windows: both planes have one scale."""
    has_window = False
    for largest, length in blocks.items():
        if not length:
            continue
        rows = np.vstack(threaded_list(partial(windows, numbers, blocks=length, largest=largest), runs))
        plane = plane_of(rows, _points(bench, numbers, length, largest=largest), largest=largest, share=margin,
                         more=float(numbers.block))
        if plane is not None:
            has_window = True
            of = "fast" if largest else "slow"
            numbers = numbers._replace(**{
                f"{of}_blocks": length, f"{of}_scale": plane.scale, f"{of}_gain": plane.gain,
                f"{of}_loss": plane.loss, f"{of}_rest": plane.rest})
    if not has_window:
        raise InputError("no monitor: the movements of heaters in order do not fit into 32 bits; a shorter TA may help")
    return numbers


def _points(bench: Bench, numbers: Numbers, blocks: int, *, largest: bool) -> npt.NDArray[np.float64]:
    """Return level and power at which a plane shall be close: at the setpoint, stuck on or open."""
    family = bench.family
    level = (family.setpoint_degC - bench.card.low_degC) / bench.card.step_degC * numbers.block
    scans = blocks * numbers.block
    holds = float(np.mean([family.member(seed).needs_pct for seed in range(16)]))
    powers = (0.0, 0.3 * holds) if largest else (100.0, 0.5 * (100.0 + holds))
    return np.array([(level, power * scans) for power in powers])


SCHEMA: Final = "heatertune/supervision/2"


@dataclass(frozen=True, slots=True, kw_only=True)
class SpreadView:
    """A figure over all heaters that show it."""

    median: float
    p95: float
    worst: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultView:
    """How soon a fault is seen.

    Attributes:
        name: of the fault.
        heaters: that had it.
        detected: of these, on so many it was seen.
        detection_s: from the fault to the alarm, where it was seen; None: nowhere [s].
        peak_degC: the hottest of each heater, switched off by the alarm [°C].
        alarms: which alarm → on how many heaters.
        missed_because: why it is not always seen; None: it is, or nobody knows.
    """

    name: str
    heaters: int
    detected: int
    detection_s: SpreadView | None
    peak_degC: SpreadView
    alarms: Mapping[str, int]
    missed_because: str | None

    def __post_init__(self) -> None:
        if not 0 <= self.detected <= self.heaters or sum(self.alarms.values()) != self.detected:
            raise DocumentError(f"detected: {self.detected} of {self.heaters}, {sum(self.alarms.values())} alarms")
        if (self.detection_s is None) != (self.detected == 0):
            raise DocumentError(f"detection_s: expected where a fault is seen; {self.detected} are")


@dataclass(frozen=True, slots=True, kw_only=True)
class CardView:
    """The input module: the temperature at count 0 and of a count [°C]."""

    zero_degC: float
    step_degC: float

    def __post_init__(self) -> None:
        if not self.step_degC > 0.0:
            raise DocumentError(f"step_degC: {self.step_degC:g}; expected more than 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class OffView:
    """A rule that is off, and why."""

    rule: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceView:
    """A fault on one heater: temperatures if nobody sees it, and switched off by the alarm [s from the fault, °C]."""

    name: str
    time_s: tuple[float, ...]
    left_degC: tuple[float, ...]
    stopped_degC: tuple[float, ...]
    alarm_s: float | None


@register_schema(SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class SupervisionView:
    """The document.

    Attributes:
        warning: what it does not replace.
        target: of the controller.
        words: it holds.
        scan_s: from one call of the monitor to the next [s].
        setpoint_degC: the highest setpoint of use [°C].
        card: the input module.
        numbers: of the monitor, see `heatertune.supervision.monitor.Numbers`.
        told: what they mean.
        heaters: possible ones, around which others were drawn.
        spread_pct: half width of gain and lags [%].
        ambient_spread_degC: half width of the ambient temperature [°C].
        noise_degC: least and most noise of the sensor [°C].
        seed: of the first heater that was drawn.
        checked: fresh heaters that it was tried on.
        false_trips: on these.
        widened_for: heaters before, for which the limits were made wider.
        off: rules that are off.
        faults: how soon each is seen.
        not_tested: what no heater lived through.
        program: of the monitor in the target's own language.
        beside: how soon the target sees each fault itself, where it can do less than the monitor.
        trace: a picture's.
    """

    warning: str
    target: str
    words: Mapping[str, float]
    scan_s: float
    setpoint_degC: float
    card: CardView
    numbers: Mapping[str, int]
    rules: tuple[str, ...]
    heaters: int
    spread_pct: float
    ambient_spread_degC: float
    noise_degC: tuple[float, float]
    seed: int
    checked: int
    false_trips: int
    widened_for: int
    off: tuple[OffView, ...]
    faults: tuple[FaultView, ...]
    not_tested: tuple[str, ...]
    program: MonitorProgram
    built_in: tuple[FaultView, ...]
    trace: TraceView

    def __post_init__(self) -> None:
        if tuple(self.numbers) != Numbers._fields:
            raise DocumentError(f"numbers: {', '.join(self.numbers)}; expected {', '.join(Numbers._fields)}")
        if not self.scan_s > 0.0:
            raise DocumentError(f"scan_s: {self.scan_s:g}; expected more than 0")
        numbers = Numbers(**self.numbers)
        if numbers.block < 1 or not 0 <= numbers.delay_low <= numbers.delay_high:
            raise DocumentError(f"numbers: block {numbers.block}, delay_low {numbers.delay_low}, delay_high "
                                f"{numbers.delay_high}; expected 1 or more, and 0 or more, and no less than delay_low")
        reach = numbers.delay_high + max(numbers.slow_blocks, numbers.fast_blocks)
        if reach >= RING:
            raise DocumentError(f"numbers: windows and delay_high reach {reach} blocks back; expected less than {RING}")


def read_supervision(path: str | Path) -> SupervisionView:
    """Return the content of a supervision.json.

    Raises:
        DocumentError: it is none, or does not hold together; the error names the field.
    """
    return decode(SupervisionView, read_document(path, SCHEMA), path)

"""Plausible heaters × their whole story → the numbers of a monitor: never a false trip first, then the soonest alarm.

Each limit is what loops in order need and a margin beyond. The windows are those that tell a switch that is stuck on,
and a heater that is open, soonest. What was found is tried on heaters that no limit was made from; where one of them
trips, the limits are made wider and others are drawn, until a whole batch passes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.plc.pwm import Actuator
from heatertune.processors import threaded_list
from heatertune.progress import ProgressCallback
from heatertune.proof.loop import LoopController, scans_of
from heatertune.proof.scenario import Scenario
from heatertune.supervision.envelope import plane_of
from heatertune.supervision.faults import FAULTS, FaultKind
from heatertune.supervision.loops import Card, Fault, Ran, card_of, ran
from heatertune.supervision.monitor import RING, Numbers
from heatertune.supervision.sample_heaters import FamilyMember, HeaterFamily
from heatertune.supervision.tallies import first_alarm, tally, windows
from heatertune.units import written

__all__ = ["FRESH", "Bench", "MonitorDesign", "design"]

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
            open, see `heatertune.supervision.loops.breakable_sensor`.
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
        progress: told what begins.

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
        made = _with_windows(bench, numbers, runs, windows_of, margin)
        progress(f"trying it on {checked} other heaters ({batch + 1} of {_BATCHES})")
        seeds = range(seed + FRESH + batch * checked, seed + FRESH + (batch + 1) * checked)
        trips = threaded_list(partial(_trips, bench, made), list(map(family.member, seeds)))
        caught = [one for one in trips if one is not None]
        if not caught:
            return MonitorDesign(numbers=made, checked=checked, tripped=tripped, off=off)
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
    first = threaded_list(lambda one: tally(bare, one, rest), runs)
    swing = max(4 * bare.block, math.ceil(1.5 * max(one.steady for one in first)))
    watching = bare._replace(swing=swing, growths=RING)
    of = threaded_list(lambda one: tally(watching, one, rest), runs)
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
    found = False
    for largest, length in blocks.items():
        if not length:
            continue
        rows = np.vstack(threaded_list(partial(windows, numbers, blocks=length, largest=largest), runs))
        plane = plane_of(rows, _points(bench, numbers, length, largest=largest), largest=largest, share=margin,
                         more=float(numbers.block))
        if plane is not None:
            found = True
            of = "fast" if largest else "slow"
            numbers = numbers._replace(**{
                f"{of}_blocks": length, f"{of}_scale": plane.scale, f"{of}_gain": plane.gain,
                f"{of}_loss": plane.loss, f"{of}_rest": plane.rest})
    if not found:
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

"""The runs of a proof: words on every model under every setting, and their criteria.

Runs are traced, or measured by the kernel without a trace, which is fast for many loops.

How much a search may simulate, counted in scans: the same request then has the same result on every machine.

Each run that a search asks for counts with all of its scans, also where its result is known already: what was simulated
earlier must not decide how far the search gets.

The runs nearest to a limit are repeated from other initial states: a verdict must not depend on when an event comes.
The events of a test sequence come at whole scans and PWM periods, and always at the same remainder of the controller's
sum. In a plant they come at any phase. Usually the phase changes less than a limit has left over, so only the nearest
runs are repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar, Token
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from types import TracebackType
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import HeaterModel
from heatertune.plc.controller import Controller
from heatertune.plc.pwm import Actuator
from heatertune.plc.words import Words
from heatertune.processors import ProgressCallback, interruption_point, processors, threaded_map
from heatertune.proof.criteria import Criterion, LoopLimits, columns_of, meter_for, names_of, worst_of
from heatertune.proof.heaters import RATED_ONLY, limits_off_rated, mains_label
from heatertune.proof.kernel import AS_TOLD, LoopBatch, TraceArrays
from heatertune.proof.long_outage import LongOutage
from heatertune.proof.loop import (
    LoopController,
    actuator_of,
    check_words,
    in_loop,
    noise_of,
    plant_rows,
    program_of,
    pulses_of,
    ring_size,
    run_with,
    scans_of,
    simulate,
)
from heatertune.proof.phase_statistics import (
    CriterionTable,
    behind_degC,
    beyond_degC,
    join_tables,
    reorder,
    rests_of,
    table_from,
)
from heatertune.proof.scenario import Scenario, SetpointRampEvent, conditions, delay_heater, events_of
from heatertune.proof.trace import Trace
from heatertune.proof.verdict import Coverage, Interlock, Run

__all__ = [
    "CLOSE", "MOST_SCANS", "SAME", "STATES", "AllRuns", "Runs", "SearchBudget", "count_scans", "judge_once",
    "measure_runs", "near_limit", "nearest_to_limits", "other_states", "outside_budget", "worst_state",
]


#: that a search simulates where nothing else is said: about a minute of a processor, several times what most take
MOST_SCANS: Final = 300e6
_MILLION: Final = 1e6


class BudgetSpent(Exception):
    """A search has simulated as much as it may; it ends within the budget that raises this."""


@dataclass(slots=True, kw_only=True, eq=False)
class SearchBudget:
    """A limit on what is simulated within a `with` block: beyond it the block ends, and the program goes on after it.

    A budget within another one is charged to both.

    Attributes:
        scans: that may be simulated.
        used: scans that were.
        spent: whether the block ended early.
    """

    scans: float = field(default_factory=lambda: MOST_SCANS)
    used: float = 0.0
    spent: bool = False
    _token: Token[tuple[SearchBudget, ...]] | None = field(default=None, init=False, repr=False)

    def __enter__(self) -> SearchBudget:
        self._token = _budgets.set((*_budgets.get(), self))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if self._token is not None:
            _budgets.reset(self._token)
            self._token = None
        self.spent = isinstance(problem, BudgetSpent) and problem.args == (self,)
        return self.spent

    @property
    def message(self) -> str:
        """That it is spent, for a reader."""
        return f"the search ended after {self.scans / _MILLION:,g} million simulated scans, its budget"


_budgets: ContextVar[tuple[SearchBudget, ...]] = ContextVar("budgets", default=())


def count_scans(scans: float) -> None:
    """Charge scans to every budget that is open.

    Raises:
        BudgetSpent: one of them, the outermost first, is spent.
    """
    interruption_point()
    budgets = _budgets.get()
    for budget in budgets:
        budget.used += scans
    for budget in budgets:
        if budget.used > budget.scans:
            raise BudgetSpent(budget)


@contextmanager
def outside_budget(*, only_told: bool = True) -> Iterator[None]:
    """Charge no budget within the block if the result of its runs is only told: they must not end a search."""
    mark = _budgets.set(() if only_told else _budgets.get())
    try:
        yield
    finally:
        _budgets.reset(mark)


def measure_runs(  # noqa: PLR0913 - what differs from loop to loop stands in arrays of its own
    controller: LoopController, rows: Array, scenario: Scenario, actuator: Actuator, limits: LoopLimits,
    noise_degC: Array,
    late_s: Array, sizes: Array | None = None, *, cooling: Array = AS_TOLD, side_by_side: bool = False, ahead: int = 0,
) -> CriterionTable:
    """Run a controller on heaters and return what the kernel's meter found.

    Args:
        controller: the words, running.
        rows: of `Batch.plants`, shape (n, 6).
        scenario: what happens.
        actuator: the switch.
        limits: what is right, and when the time at rest begins.
        noise_degC: of the readings, see `Clock`; a row for each heater, or one for all.
        late_s: of the scans, likewise.
        sizes: by what each disturbance is multiplied, a row for each heater; None: by nothing.
        cooling: by what the power of the cooler is multiplied, see `Batch`.
        side_by_side: whether they run so, all of them fitting (`heatertune.proof.lanes`); it changes no bit.
        ahead: how many such loops are sure to follow.

    Raises:
        ValueError: noise or delay of fewer scans than there are: compiled code would read what lies behind them.
    """
    scans, period, count = scans_of(controller, scenario), actuator.pwm_period_s, len(rows)
    if shorter := [array.shape[1] for array in (noise_degC, late_s) if 1 < array.shape[1] < scans]:
        raise ValueError(f"noise_degC, late_s: of {scans} scans, got {shorter[0]}")
    dead = rows[:, 3].tolist()
    meter, phases = meter_for(scenario, limits, end_s=(scans - 1) * controller.scan_s, period_s=period, loops=count,
                              flags=controller.core.flags, resolution_degC=controller.resolution_degC)
    program = program_of(controller, scenario)
    events = events_of(scenario, dead, sizes, rests_of(phases))
    batch = LoopBatch(scans, noise_degC, late_s, rows, *events, meter.leads, cooling)
    if side_by_side:
        from heatertune.proof.lanes.choice import run_side_by_side

        run_side_by_side(controller, program, batch, actuator, meter)
    else:
        edges = np.empty(ring_size(pulses_of(max(dead) + 3.0 * controller.scan_s + period, actuator)))  # under way
        none = np.empty(0)
        record = TraceArrays(False, none, none, none, none, np.empty(0, dtype=np.int64), none, none, none, none)
        arguments = (program, batch, actuator.switches, np.inf, edges, record, meter)
        run_with(controller, arguments, 2 * count * scans, ahead=2 * ahead * scans)  # plain, a measured scan takes two
    return table_from(meter, phases, scenario, rows)


_Judged = tuple[Criterion, ...]

#: scans from which on it pays to share them among processors
_SHARED: Final = 100_000

#: of the search that goes on: all that decides a run → what was judged of it; None: nothing is kept
_judged: ContextVar[dict[Hashable, _Judged] | None] = ContextVar("judged", default=None)


@contextmanager
def judge_once() -> Iterator[None]:
    """Judge no run twice within the block: a search comes back to words that it had in its hands before."""
    mark = _judged.set({} if (around := _judged.get()) is None else around)
    try:
        yield
    finally:
        _judged.reset(mark)


class _RunChunk(NamedTuple):
    """Runs under one setting: the words under it, their places among all, and how many follow them."""

    loop: LoopController
    places: list[int]
    ahead: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Runs:
    """The loops of a proof.

    Attributes:
        controller: that runs the words.
        words: what it holds.
        cases: label of the model, heater with the controller's delay, and setting, of each run.
        loops: the words under each setting that is run.
        scenario: what happens in each run.
        actuator: the switch.
        limits: that are to be kept.
        interlock: what watches the heater in every run; None: nothing.
        progress: called with how many runs are judged.
        mains_power: full power as a share of the rated one; None: the rated power.
        models: (label, heater) of all, without the controller's delay.
        done: how many runs of the proof come before these, and how many there are in all; None: these are all.
        reference: what these are runs of, and the same runs in the test sequence, whose time to return theirs is held
            against; None: these are held against their limits alone.
        start: state from which the controller begins, see `heatertune.proof.loop.in_loop`.
    """

    controller: Controller
    words: Words
    cases: Sequence[tuple[str, HeaterModel, Mapping[str, str]]]
    loops: Sequence[LoopController]
    scenario: Scenario
    actuator: Actuator
    limits: LoopLimits
    interlock: Interlock | None
    progress: ProgressCallback
    mains_power: float | None = None
    done: tuple[int, int] | None = None
    models: Sequence[tuple[str, HeaterModel]] = ()
    reference: tuple[LongOutage, Runs] | None = None
    start: int = 0

    @classmethod
    def of(  # noqa: PLR0913 - what a run is made of
        cls, controller: Controller, words: Words, models: Sequence[tuple[str, HeaterModel]], scenario: Scenario,
        actuator: Actuator | None, limits: LoopLimits, coverage: Coverage, *, interlock: Interlock | None,
        mains_power: float | None = None, start: int = 0,
    ) -> Runs:
        """Return the runs of every model under every setting that a proof covers.

        Args:
            controller: that runs the words; its delay is added to the dead times.
            words: what it holds.
            models: (label, heater).
            scenario: as the attribute.
            actuator: not used where the controller makes the PWM itself.
            limits: as the attribute.
            coverage: which of the runs are made.
            interlock: as the attribute.
            mains_power: as the attribute; the heaters' gains are those at this power.
            start: as the attribute.

        Raises:
            InputError: no model or no run, or as in `simulate`, with the model's label.
            OutOfRange, UnknownName: as in `simulate`.
        """
        settings = coverage.settings(controller.switches)
        if not models:
            raise InputError("a proof needs at least one model")
        late = [(name, delay_heater(model, controller.delayed_s(words.scaling))) for name, model in models]
        _check(controller, words, late, scenario)
        cases = [(name, model, setting) for (name, model), setting in product(late, settings)
                 if coverage.runs(name, setting, mains_power)]
        if not cases:
            raise InputError("a proof needs at least one run")
        loops = [in_loop(controller, words, scenario.setpoints_degC, setting, direct=True, start=start)
                 for setting in settings if any(setting is ran for *_, ran in cases)]
        return cls(controller=controller, words=words, cases=cases, loops=loops, scenario=scenario,
                   actuator=_at_mains(actuator_of(loops[0], actuator), mains_power),
                   limits=limits if mains_power is None else limits_off_rated(limits), interlock=interlock,
                   progress=coverage.progress, mains_power=mains_power, models=models, start=start)

    def again(self, scenario: Scenario, only: Sequence[Run], coverage: Coverage, *, start: int = 0) -> Runs:
        """Return some of these runs in another scenario, or from another start."""
        again = Runs.of(self.controller, self.words, self.models, scenario, self.actuator, self.limits,
                        replace(coverage, only=only), interlock=self.interlock, mains_power=self.mains_power,
                        start=start)
        return replace(again, actuator=self.actuator)

    def label(self, run: int) -> str:
        """Return the model of a run, and the settings that are not the default."""
        name, _, setting = self.cases[run]
        changed = [f"{switch.name} = {setting[switch.name]}" for switch in self.controller.switches
                   if setting[switch.name] != switch.default]
        supply = [] if self.mains_power is None else [mains_label(self.mains_power)]
        return ", ".join([name, *changed, *supply])

    @property
    def resolution_degC(self) -> float:
        """Step of the controller's reading [°C]."""
        return self.loops[0].resolution_degC

    @property
    def step_s(self) -> float:
        """The longest of scan, PWM period and sampling interval [s]."""
        return max(self.loops[0].scan_s, self.actuator.pwm_period_s, self.words.sample_time_s)

    @property
    def ticks_degC(self) -> list[float]:
        """What one tick of the PWM changes in the temperature at rest, of each run [°C]."""
        share = self.actuator.resolution_s / self.actuator.pwm_period_s
        return [100.0 * share * abs(model.gain_degC_per_pct) for _, model, _ in self.cases]

    @property
    def starts(self) -> int:
        """How many other starts there are under some setting, see `start`."""
        return max(len(loop.core.other_starts(loop.parameters, loop.state)) for loop in self.loops)

    def late_calls(self, judged: Sequence[_Judged]) -> list[int]:
        """Return the runs in which a call that is missed at another scan may reach a limit.

        The power then lasts an interval longer: an overshoot grows by what full power heats in that time at most.

        Args:
            judged: criteria of each run.
        """
        missed = [loop.switches for loop in self.loops if loop.core.other_starts(loop.parameters, loop.state)]
        return [run for run, criteria in enumerate(judged)
                if self.cases[run][2] in missed and self._may_reach(self.cases[run][1], criteria)]

    def with_late_calls(self, judged: Sequence[_Judged], coverage: Coverage) -> dict[int, list[_Judged]]:
        """Return the criteria of the runs of `late_calls` from each other start, by number; arguments likewise."""
        if not (late := self.late_calls(judged)):
            return {}
        only = [(self.cases[run][0], self.cases[run][2], self.mains_power) for run in late]
        again = [self.again(self.scenario, only, coverage, start=start + 1).judge_all() for start in range(self.starts)]
        return {run: [each[place] for each in again] for place, run in enumerate(late)}

    def _may_reach(self, model: HeaterModel, criteria: _Judged) -> bool:
        step_degC = abs(self.scenario.setpoint_degC - conditions(self.scenario, model)[0])
        most_degC = 100.0 * abs(model.gain_degC_per_pct) * self.words.sample_time_s / max(model.lags_s)
        grows = {"°C": most_degC, "% of rise": 100.0 * most_degC / step_degC}
        share = near_limit(self.step_s, model.dead_time_s)
        return any(one.strain > (share if one.name not in _LASTS else min(share, CLOSE - grows[one.unit] / one.limit))
                   for one in criteria if one.limit and one.name != _OF_HEATER)

    @property
    def scans(self) -> int:
        """Scans of a run."""
        return scans_of(self.loops[0], self.scenario)

    def trace(self, run: int, seed: int | None = None, *, direct: bool = False) -> Trace:
        """Return the trace of a run, `direct` without the controller's listing; `seed` of its noise, None: its own."""
        _, model, setting = self.cases[run]
        scenario = self.scenario if seed is None else replace(self.scenario, seed=seed)
        return simulate(
            self.controller, self.words, model, scenario, self.actuator, setting, self.interlock, limits=self.limits,
            direct=direct, start=self.start)

    def judge_all(self) -> list[_Judged]:
        """Return the criteria of each run."""
        judged = self._judged()
        if self.reference is None:
            return judged
        night, before = self.reference
        return [night.compare(*pair) for pair in zip(judged, before.judge_all(), strict=True)]

    def _judged(self) -> list[_Judged]:
        if self.interlock is None:
            return self._metered(range(len(self.cases)), tell=self._tell)
        judged = list[_Judged]()
        for run in range(len(self.cases)):
            judged += self.criteria_with([self.scenario.seed], run)
            self._tell(len(judged))
        return judged

    def judge(self, trace: Trace, run: int) -> _Judged:
        """Return the criteria of a run from its trace."""
        label = self.label(run)
        return self._at_power(tuple(replace(criterion, where=label) for criterion in trace.criteria))

    def _at_power(self, criteria: _Judged) -> _Judged:
        """Return the criteria that hold at the power of these runs."""
        if self.mains_power is None:
            return criteria
        return tuple(criterion for criterion in criteria if criterion.name not in RATED_ONLY)

    def criteria_with(self, seeds: Sequence[int], run: int) -> list[_Judged]:
        """Return the criteria of one run with noise of other seeds."""
        if self.interlock is None:
            return self._metered([run] * len(seeds), seeds)
        count_scans(len(seeds) * self.scans)
        # what it sees is the temperature at any instant, which only a trace tells
        return [self.judge(self.trace(run, seed, direct=True), run) for seed in seeds]

    def _tell(self, done: int) -> None:
        before, total = self.done or (0, len(self.cases))
        self.progress(f"{before + done} of {total} runs")

    def _metered(
        self, runs: Sequence[int], seeds: Sequence[int] = (), tell: Callable[[int], object] = int,
    ) -> list[_Judged]:
        """Return the criteria of some runs, those of a search from where they are kept; arguments as `_measured`."""
        count_scans(len(runs) * self.scans)
        cache = _judged.get()
        if cache is None:
            return self._measured(runs, seeds, tell)
        same = repr(self.words), self.scenario, self.actuator, self.limits, self.start
        keys = [(*same, self.label(run), tuple(self.cases[run][2].items()), self.cases[run][1], seed)
                for run, seed in zip(runs, seeds or [self.scenario.seed] * len(runs), strict=True)]
        new = [place for place, key in enumerate(keys) if key not in cache]
        if new:
            results = self._measured([runs[place] for place in new], [seeds[place] for place in new] if seeds else (),
                                     lambda done: tell(len(runs) - len(new) + done))
            cache |= zip([keys[place] for place in new], results, strict=True)
        return [cache[key] for key in keys]

    def _measured(
        self, runs: Sequence[int], seeds: Sequence[int] = (), tell: Callable[[int], object] = int,
    ) -> list[_Judged]:
        """Return the criteria of some runs, and no trace: many times as fast.

        Args:
            runs: their numbers.
            seeds: of each one's noise, all being under one setting; none: the scenario's for all.
            tell: called with how many are done.
        """
        drawn = seeds or [self.scenario.seed] * len(runs)
        keys = [(self.cases[run][0], self._shown(run), seed) for run, seed in zip(runs, drawn, strict=True)]
        once = dict(zip(reversed(keys), reversed(runs), strict=True))  # the first of those alike
        rows = plant_rows([self.cases[run][1] for run in once.values()], self.scenario)
        noise = np.array([noise_of(replace(self.scenario, seed=seed), self.scans)
                          for *_, seed in (once if seeds else keys[:1])])

        def run(part: _RunChunk) -> CriterionTable:
            return measure_runs(
                part.loop, rows[part.places], self.scenario, self.actuator, self.limits,
                noise[part.places] if seeds else noise, np.zeros((1, 1)), ahead=part.ahead)

        shared = self.loops[0].core.compiles and len(once) * self.scans > _SHARED
        workers = processors() if shared else 1
        parts, measured = self._parts(list(once.values()), workers), list[CriterionTable]()
        for part, table in zip(parts, threaded_map(run, parts, workers), strict=True):
            measured.append(table)
            tell(len(runs) - part.ahead)
        back = dict(zip(once, np.argsort(np.concatenate([part.places for part in parts])), strict=True))
        columns = columns_of(reorder(join_tables(measured), np.array([back[key] for key in keys])), self.limits)
        labels = [self.label(run) for run in runs]
        return [self._at_power(each) for each in zip(*(column.criteria(labels) for column in columns), strict=True)]

    def _shown(self, run: int) -> frozenset[tuple[str, str]]:
        """Return what a run shows of its setting: runs of one heater that show the same are the same, bit for bit."""
        return next(loop.shown for loop in self.loops if loop.switches == self.cases[run][2])

    def _parts(self, runs: Sequence[int], workers: int) -> list[_RunChunk]:
        """Return the runs in parts, those under each setting shared among so many."""
        parts, ahead = list[_RunChunk](), len(runs)
        for loop in self.loops:
            own = [place for place, run in enumerate(runs) if self.cases[run][2] == loop.switches]
            for places in (own[worker::workers] for worker in range(min(workers, len(own)))):
                ahead -= len(places)
                parts.append(_RunChunk(loop, places, ahead))
        return parts


@dataclass(frozen=True, slots=True, kw_only=True)
class AllRuns:
    """The loops of a proof at each power, numbered one after the other, those at the rated power first.

    Attributes:
        parts: the loops at one power each.
    """

    parts: tuple[Runs, ...]

    @classmethod
    def of(cls, parts: Sequence[Runs]) -> AllRuns:
        """Return them, each part counting its runs from the end of the part before."""
        lengths = [len(part.cases) for part in parts]
        return cls(parts=tuple(replace(part, done=(sum(lengths[:number]), sum(lengths)))
                               for number, part in enumerate(parts)))

    @property
    def has_others(self) -> bool:
        """Whether there are more runs than the nominal one, or one that it is compared with."""
        return sum(len(part.cases) for part in self.parts) > 1 or self.parts[0].reference is not None

    def place(self, run: int) -> tuple[Runs, int]:
        """Return the part of a run, and its number there."""
        for part in self.parts:
            if run < len(part.cases):
                return part, run
            run -= len(part.cases)
        raise IndexError(run)

    def trace(self, run: int, seed: int | None = None, *, direct: bool = False) -> Trace:
        """Return the trace of a run, see `Runs.trace`."""
        part, own = self.place(run)
        return part.trace(own, seed, direct=direct)

    def judge(self, trace: Trace, run: int) -> _Judged:
        """Return the criteria of a run from its trace."""
        part, own = self.place(run)
        return part.judge(trace, own)

    def judge_all(self) -> list[_Judged]:
        """Return the criteria of each run."""
        return [criteria for part in self.parts for criteria in part.judge_all()]


def _at_mains(actuator: Actuator, mains_power: float | None) -> Actuator:
    """Return the switch at a power: a cooler next to the heater, a fan or a valve, is as strong as ever."""
    if mains_power is None or actuator.cooling_gain is None:
        return actuator
    return replace(actuator, cooling_gain=actuator.cooling_gain / mains_power)


def _check(controller: Controller, words: Words, models: Sequence[tuple[str, HeaterModel]], scenario: Scenario) -> None:
    """Raise what `simulate` would, with the model's label; the words are the same on each."""
    held_degC = scenario.held_setpoints_degC
    for number, (name, model) in enumerate(models):
        try:
            if number == 0:
                check_words(controller, words, scenario)
            conditions(scenario, model, held_degC)
        except OutOfRange as problem:
            raise InputError(f"model {name}: {problem}") from problem


CLOSE: Final = 0.95
#: of a limit, which another state may use without breaking it; it is told. The search leads parameters up to a limit,
#: and an independent judge takes so much for the same
SAME: Final = 1.02
#: of a limit, per step of scan and PWM as a share of the dead time: an event is noticed so much later at most. On drawn
#: designs another phase raised the use of a limit above 0.6 by up to 14 % of it where that share was 0.25, and by 0.2 %
#: where it was 0.06; a share of a limit of two hundredths is within what an independent judge takes for the same
_PER_STEP: Final = 0.2
_MOST_FOR_STEP: Final = 0.05
#: initial states from which it is repeated
STATES: Final = 4
#: of a scan: an event just after a scan waits longest for the next one
_JUST_AFTER: Final = 0.01
#: of a rest, by which it lasts longer at most: a slow oscillation is in another phase then
_LONGER: Final = 0.25
#: of the heater alone: no state changes it
_OF_HEATER: Final = "power_reserve"
#: overshoots of large steps: the power is at its limit before, and one more interval of it adds to them
_LASTS: Final = frozenset(names_of(
    beyond_degC, behind_degC, phases=("heat-up", "reheat", "restart", "change", "recovery")))
#: criteria of one band: what hunts between two ticks uses the sum of both, and of one tick's effect
_SWING: Final = "limit_cycle"
_AT_REST: Final = frozenset({"steady_offset", _SWING})


def near_limit(step_s: float, dead_time_s: float) -> float:
    """Compute the share of a limit from which on a run is repeated.

    Args:
        step_s: the longest of scan, PWM period and sampling interval [s].
        dead_time_s: of the heater [s].
    """
    return CLOSE - min(_MOST_FOR_STEP, _PER_STEP * step_s / max(dead_time_s, step_s))


def nearest_to_limits(
    runs: Sequence[Sequence[Criterion]], shares: Sequence[float], ticks_degC: Sequence[float]
) -> list[int]:
    """Return, for each limit, the number of the run that uses most of it, if it is near the limit.

    Args:
        runs: criteria of each run.
        shares: of a limit from which on a run is near it, of each run.
        ticks_degC: what one tick of the PWM changes in the temperature at rest, of each run [°C].
    """
    nearest = dict[str, tuple[float, int]]()
    for run, (criteria, share, tick_degC) in enumerate(zip(runs, shares, ticks_degC, strict=True)):
        band = next((one.limit for one in criteria if one.name in _AT_REST and one.limit), None)
        rest = [one for one in criteria if one.name in _AT_REST]
        swing_degC = next((one.value for one in rest if one.name == _SWING), 0.0)  # a loop that is still has no tick
        at_rest = 0.0 if band is None else min(tick_degC, swing_degC) / band + sum(one.strain for one in rest)
        for one in (one for one in criteria if one.name != _OF_HEATER):
            used = at_rest if one.name in _AT_REST else one.strain
            if used > max(share, nearest.get(one.name, (0.0, 0))[0]):
                nearest[one.name] = used, run
    return sorted({run for _, run in nearest.values()})


def other_states(scenario: Scenario, scan_s: float, step_s: float) -> Iterator[Scenario]:
    """Yield a scenario whose events come at other phases of scan, PWM period and sampling interval.

    In the first one they come just after a scan, in the others at drawn phases, after a rest that lasts longer by up to
    a quarter. What a part may take stays the same. The segments of a profile keep their lengths.

    Args:
        scenario: the test sequence; its parts that come to rest do so at their end.
        scan_s: interval of the scans [s].
        step_s: the longest of scan, PWM period and sampling interval [s].
    """
    number = len(scenario.disturbances) + 1
    if number == 1 or not scenario.rests_s:
        return
    rests = np.array(scenario.rests_s)
    within = np.array([False, *(isinstance(one, SetpointRampEvent) and isinstance(other, SetpointRampEvent)
                                for one, other in pairwise(scenario.disturbances)), False])[:number]
    led = bool(scenario.disturbances) and isinstance(scenario.disturbances[-1], SetpointRampEvent)
    for state in range(STATES):
        drawn = np.random.default_rng(state).random(number)
        longer = np.where(np.arange(number) == 0, _JUST_AFTER * scan_s, 0.0) if state == 0 else (
            drawn * (step_s + _LONGER * rests))
        longer = np.where(within, 0.0, longer)
        longer[-1] = 0.0 if led else longer[-1]
        later = np.cumsum(longer)
        yield replace(
            scenario, duration_s=float(scenario.duration_s + later[-1]),
            disturbances=tuple(replace(event, time_s=event.time_s + by_s) for event, by_s in zip(
                scenario.disturbances, later.tolist(), strict=False)),
            rests_s=tuple(np.where(rests > 0.0, rests + longer, 0.0).tolist()))


def worst_state(criteria: Sequence[Criterion], others: Sequence[Sequence[Criterion]]) -> tuple[Criterion, ...]:
    """Return the criteria of a run, each limited one from the state that uses most of its limit.

    Args:
        criteria: of the run in the test sequence.
        others: the same from each other state.
    """
    return tuple(one if one.limit is None else worst_of((one, *same))
                 for one, *same in zip(criteria, *others, strict=True))

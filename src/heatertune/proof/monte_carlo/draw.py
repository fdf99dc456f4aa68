"""A proof on many heaters: each sample is one loop with randomly drawn heater, mains, ambient, loads and sensor noise.

Sample i of a run with seed S has the seed S + i, and all its random numbers come from streams of Philox4x32-10 with
that key (J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11, 2011). A sample therefore depends
neither on the number of samples nor of workers, and its seed alone reproduces it. Each sample runs once for every
setting of the open points of a manual, with the same heater. The distributions are described at `SampleSpread`.
The result is quantiles of each criterion, how many samples keep all limits, and the worst sample.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.codec import encode
from heatertune.compiled import compile_function, worth_compiling
from heatertune.errors import InputError, OutOfRange
from heatertune.heater.exact import logarithm
from heatertune.model.model_values import Fopdt, HeaterModel, TwoLag
from heatertune.plc.controller import Controller
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.pwm import Actuator
from heatertune.plc.words import Words
from heatertune.processors import processors, threaded_list
from heatertune.proof.criteria import LoopLimits, columns_of
from heatertune.proof.kernel import AS_TOLD
from heatertune.proof.lanes.choice import fits, order_by_edges, pays
from heatertune.proof.lanes.passes import LANES, STEP
from heatertune.proof.loop import LoopController, actuator_of, have_loss, in_loop, plant_rows, scans_of, trace_run
from heatertune.proof.meter import Places
from heatertune.proof.phase_statistics import CriterionTable, join_tables, reorder
from heatertune.proof.runs import measure_runs
from heatertune.proof.scenario import Disturbance, Load, Mains, Scenario, TemperatureStep
from heatertune.proof.trace import Trace
from heatertune.proof.verdict import verdict_of_samples
from heatertune.units import check

__all__ = [
    "BLOCK", "STREAM", "SampleProof", "SampleRequest", "SampleSpread", "SampledSetting", "Spot", "block_of",
    "hardest_setting", "measure", "normal", "normals", "parts", "prove_samples", "replay", "uniform", "words",
]


Whole = npt.NDArray[np.int64]

_ROUNDS: Final = 10
_FIRST: Final = 0xD2511F53
_SECOND: Final = 0xCD9E8D57
_LOW: Final = 0x9E3779B9
_HIGH: Final = 0xBB67AE85
_WORD: Final = 0xFFFFFFFF
_PER_CALL: Final = 2  # numbers of four words: 27 and 26 bits of two make the 53 of one


def words(counter: tuple[Any, Any, Any, Any], key: tuple[Any, Any]) -> tuple[Any, Any, Any, Any]:
    """Return four words of 32 bits for a counter of four and a key of two.

    All are whole numbers, or arrays of them that have or take one shape. A product of two words may have a bit more
    than a number with a sign holds; what stands in its two halves is right all the same.
    """
    a, b, c, d = counter
    low, high = key
    for _ in range(_ROUNDS):
        first, second = _FIRST * a, _SECOND * c
        a, b, c, d = ((second >> 32 & _WORD) ^ b ^ low, second & _WORD, (first >> 32 & _WORD) ^ d ^ high, first & _WORD)
        low, high = low + _LOW & _WORD, high + _HIGH & _WORD
    return a, b, c, d


def parts(seeds: Sequence[int]) -> Whole:
    """Return the four lowest words of each seed, the lowest first, shape (seeds, 4)."""
    return np.array([[seed >> shift & _WORD for shift in (0, 32, 64, 96)] for seed in seeds], dtype=np.int64)


def uniform(seeds: Sequence[int], count: int, stream: int = 0) -> Array:
    """Return numbers between 0 and 1, both excluded, for each seed: shape (seeds, count).

    The lowest 64 bits of a seed are the key, the next 64 one half of the counter; each stream has numbers of its own.
    """
    low, high, third, fourth = parts(seeds).T[:, :, None]
    calls = np.arange(-(-count // _PER_CALL))
    numbers = np.empty((len(seeds), len(calls), _PER_CALL))
    drawn = words((calls, np.full(1, stream), third, fourth), (low, high))
    for place in range(_PER_CALL):
        whole = (drawn[2 * place] >> 5 << 26) + (drawn[2 * place + 1] >> 6)
        numbers[:, :, place] = (whole + 0.5) * 2.0**-53
    return numbers.reshape(len(seeds), -1)[:, :count]


def normal(even: Array) -> Array:
    """Return standard normal numbers made of as many uniform ones by Box and Muller's way, shape (n, 2·m)."""
    radius, angle = np.sqrt(-2.0 * np.log(even[:, ::2])), 2.0 * np.pi * even[:, 1::2]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=2).reshape(even.shape)


#: of Philox, see `heatertune.proof.monte_carlo.draw.uniform`
STREAM: Final = 1

_SCAN_NOISE_CALLS: Final = 32  # of a block: their first numbers, their second ones and so on stand together
#: scans whose numbers are drawn together
BLOCK: Final = 4 * _SCAN_NOISE_CALLS

_MOST_PLAIN: Final = 200_000  # numbers that take as long in plain Python as the compiler
_QUARTER: Final = 2**30  # a word's two highest bits tell the quarter of the circle
_ALL: Final = 0.5 * math.pi / _QUARTER


def normals(seeds: Sequence[int], count: int, deviation: float = 1.0) -> npt.NDArray[np.float64]:
    """Return so many numbers of a standard deviation for each seed, shape (seeds, count)."""
    places, spare = np.empty((len(seeds), count)), np.empty(BLOCK)
    if worth_compiling(places.size, "noise", _MOST_PLAIN, _all_drawn):
        compile_function(_all_drawn)(places, spare, parts(seeds), deviation)
    else:
        plain = places.tolist()
        _all_drawn(plain, spare.tolist(), parts(seeds).tolist(), deviation)
        places[:] = plain
    return places


def block_of(seed: int, number: int) -> list[float]:
    """Return a seed's numbers of one block of scans, in plain Python: who asks scan by scan waits for no compiler."""
    places = [0.0] * BLOCK
    _drawn(places, 0, 1.0, number * _SCAN_NOISE_CALLS, *parts([seed])[0].tolist())
    return places


def _all_drawn(places: Places, spare: Places, keys: Places, deviation: float) -> None:
    """Fill rows, each for the four words of a seed; `spare` is for blocks of which not all is asked for."""
    for row in range(len(places)):
        key, own, blocks = keys[row], places[row], len(places[row]) // BLOCK
        for block in range(blocks):
            _drawn(own, block * BLOCK, deviation, block * _SCAN_NOISE_CALLS, key[0], key[1], key[2], key[3])
        if blocks * BLOCK < len(own):
            _drawn(spare, 0, deviation, blocks * _SCAN_NOISE_CALLS, key[0], key[1], key[2], key[3])
        for place in range(blocks * BLOCK, len(own)):
            own[place] = spare[place - blocks * BLOCK]


def _drawn(
    places: Places, begin: int, deviation: float, first: int, low: int, high: int, third: int, fourth: int
) -> None:
    """Fill a block from a place on with its numbers from a call on; a compiler makes vector instructions of it."""
    for call in range(_SCAN_NOISE_CALLS):
        a, b, c, d = words((first + call, STREAM, third, fourth), (low, high))
        one, two = _pair(a, b)
        three, four = _pair(c, d)
        place = begin + call
        places[place], places[place + _SCAN_NOISE_CALLS] = deviation * one, deviation * two
        places[place + 2 * _SCAN_NOISE_CALLS], places[place
                                                      + 3 * _SCAN_NOISE_CALLS] = deviation * three, deviation * four


def _pair(size: int, turn: int) -> tuple[float, float]:
    """Return two numbers of two words."""
    radius = math.sqrt(-2.0 * logarithm((size + 0.5) * 2.0**-32))
    angle = ((turn & _QUARTER - 1) + 0.5 - 0.5 * _QUARTER) * _ALL  # within ±π/4, the middle of the first quarter
    z = angle * angle
    sine = angle + angle * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (
        1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (1.0 / 6227020800.0))))))
    cosine = 1.0 + z * (-1.0 / 2.0 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0 + z * (
        -1.0 / 3628800.0 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0)))))))
    odd, behind = turn & _QUARTER != 0, turn & 2 * _QUARTER != 0
    along, across = (sine, cosine) if odd else (cosine, sine)
    return (-radius if odd != behind else radius) * along, (-radius if behind else radius) * across


_LATE: Final = 2  # stream of the delays, beside that of the heaters, 0, and that of the noise
_ORIGIN: Final = 3  # place among the numbers of a loss curve
_NORMAL: Final = 4  # uniform numbers of which those of the heater are made
_CALLS: Final = 8  # at least, where samples are so many that more of them go into one call
_GROUPS: Final = 4  # of samples side by side in one call at most: some megabytes of noise
_LEAST: Final = 5  # samples that take as long one after the other as a step side by side


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleSpread:
    """How far samples differ. Everything is drawn independently.

    - Gain and lags are lognormal and the dead time normal, as wide as the fit's 95 % intervals
      (`heatertune.pid.search.robust`), around each candidate in turn.
    - The mains voltage is uniform, by default within ±10 %, the tolerance of the public supply (EN 50160); power goes
      with its square. It is one value for the whole run, because a sag that lasts is the severe one. Where the mains
      of the test sequence change to an end of that tolerance, they do so from this value. A cooler is unaffected.
    - The ambient temperature is uniform, by default within ±5 °C: a cold morning and a hot afternoon in a hall (this
      project's choice). The heater starts from it.
    - Each temperature step and load is multiplied by a uniform factor, by default 0.5…1.5 (this project's choice). A
      load is a share of the rated power, whatever the mains.
    - Sensor noise is Gaussian, as in the scenario.
    - Each scan is late by a uniform time between 0 and the jitter, by default none; the first one, with which the PWM
      begins, and the last one are on time.

    Attributes:
        heater: standard deviations of the logarithms of gain and lags, and of the dead time [s].
        least_dead_time_s: no dead time is drawn below it [s].
        mains_pct: half width of the mains voltage [%].
        ambient_degC: half width of the ambient temperature [°C].
        disturbance_pct: half width of each disturbance's size [%].
        jitter_s: latest delay of a scan [s]; less than the scan interval. A controller's own PWM waits for its scan, so
            with it there is none.

    Raises:
        OutOfRange: one that is negative or leaves no mains or no disturbance.
    """

    heater: tuple[float, float, float] = (0.0, 0.0, 0.0)
    least_dead_time_s: float = 0.0
    mains_pct: float = 10.0
    ambient_degC: float = 5.0
    disturbance_pct: float = 50.0
    jitter_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mains_pct", "disturbance_pct"):
            check(name, getattr(self, name), least=0.0, most=99.0)
        for name in ("ambient_degC", "jitter_s", "least_dead_time_s"):
            check(name, getattr(self, name), least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampleRequest:
    """Whose samples are drawn.

    Attributes:
        controllers: the words, running under each setting of what is open.
        heaters: candidates, in turn.
        scenario: what is drawn around.
        actuator: the switch.
        spread: how far they differ.
        delay_s: of the controller, added to each dead time that is drawn [s].

    Raises:
        InputError: no heater, no controller, or no switch where one is needed.
        OutOfRange: an ambient that may reach the setpoint, a jitter as long as a scan.
    """

    controllers: Sequence[LoopController]
    heaters: Sequence[HeaterModel]
    scenario: Scenario
    actuator: Actuator
    spread: SampleSpread
    delay_s: float = 0.0
    rows: tuple[tuple[float, ...], ...] = field(init=False)

    def __post_init__(self) -> None:
        if not self.heaters or not self.controllers:
            raise InputError("a proof needs at least one model and one controller")
        rows = tuple(map(tuple, plant_rows(self.heaters, self.scenario).tolist()))
        object.__setattr__(self, "rows", rows)
        low = min(abs(setpoint - row[4]) for row in rows for setpoint in self.scenario.held_setpoints_degC)
        if not self.spread.ambient_degC < low:
            rule = f"< {low:g}, or it reaches the setpoint"
            raise OutOfRange("spread of the ambient", self.spread.ambient_degC, rule)
        scan_s = self.controllers[0].scan_s
        if not self.spread.jitter_s < scan_s:
            raise OutOfRange("jitter_s", self.spread.jitter_s, f"< {scan_s:g}, the scan interval")

    @classmethod
    def of(
        cls, controller: Controller, words: Words, heaters: Sequence[HeaterModel], scenario: Scenario,
        spread: SampleSpread,
        actuator: Actuator | None = None, switches: dict[str, str] | None = None,
    ) -> SampleRequest:
        """Return the drawing of a controller that runs words; errors as in `simulate`.

        Args:
            controller: that is to run the words.
            words: what it holds.
            heaters: candidates.
            scenario: what is drawn around.
            spread: how far samples differ.
            actuator: the switch; None: the controller makes the PWM itself.
            switches: settings of open points that are known; of the others each is run.
        """
        controller.check(words)
        controller.check_ramp(words)
        controllers = [in_loop(controller, words, scenario.setpoints_degC, setting, direct=True)
                       for setting in settings_to_prove(controller.switches, switches)]
        return cls(controllers=controllers, heaters=heaters, scenario=scenario, spread=spread,
                   delay_s=controller.delayed_s(words.scaling), actuator=actuator_of(controllers[0], actuator))

    def heaters_of(self, seeds: Sequence[int]) -> tuple[Array, Array]:
        """Return rows of `Batch.plants` and factors of the disturbances, shapes (n, 6) and (n, disturbances).

        Args:
            seeds: of the n samples.
        """
        even = uniform(seeds, _NORMAL + 2 + len(self.scenario.disturbances))
        drawn, even = normal(even[:, :_NORMAL])[:, :3] * self.spread.heater, 2.0 * even[:, _NORMAL:] - 1.0
        turns = [seed % len(self.rows) for seed in seeds]
        (gain, first, second, dead, ambient, start), curve = np.split(np.array(self.rows)[turns].T, [6])
        power = self._power_of(even[:, 0])
        shift = self.spread.ambient_degC * even[:, 1]
        lags = np.exp(drawn[:, 1])
        rows = np.column_stack([
            gain * np.exp(drawn[:, 0]) * power, first * lags, second * lags,
            np.maximum(dead + drawn[:, 2], self.spread.least_dead_time_s) + self.delay_s, ambient + shift,
            start + shift if self.scenario.start_degC is None else start, *self._curves(curve, shift, turns)])
        sizes = 1.0 + self.spread.disturbance_pct / 100.0 * even[:, 2:]
        for number, (event, share) in enumerate(zip(self.scenario.disturbances, self.scenario.mains[1:], strict=True)):
            if isinstance(event, Load):  # a share of the rated power, and the gain is that of the drawn mains
                sizes[:, number] /= power
            elif not isinstance(event, TemperatureStep):
                sizes[:, number] = 1.0 if share in (0.0, 1.0) else 1.0 / power  # likewise
        return rows, sizes

    def _curves(self, curve: Array, shift: Array, turns: Sequence[int]) -> Array:
        """Return the loss curves of samples, whose origin moves with the ambient where they count from there."""
        if not len(curve):
            return curve
        moves = [model.loss is not None and model.loss.origin_degC is None for model in self.heaters]
        curve[_ORIGIN] += np.where(np.array(moves)[turns], shift, 0.0)
        return curve

    def cooling_of(self, seeds: Sequence[int]) -> Array:
        """Return `Batch.cooling` of samples, shape (n,) or (1,): a cooler beside a heater knows nothing of the mains.

        Args:
            seeds: of the n samples.
        """
        if self.actuator.cooling_gain is None:
            return AS_TOLD
        return 1.0 / self._power_of(2.0 * uniform(seeds, _NORMAL + 1)[:, _NORMAL] - 1.0)

    def _power_of(self, even: Array) -> Array:
        """Return what full power is of the rated one, for mains from −1, the lowest, to 1, the highest."""
        return (1.0 + self.spread.mains_pct / 100.0 * even) ** 2

    def heater(self, seed: int) -> HeaterModel:
        """Return the heater of a sample, its mains in the gain, without the controller's delay; `replay` adds more."""
        (row,), _ = self.heaters_of([seed])
        row[3] -= self.delay_s
        return _heater(row, self.heaters[seed % len(self.heaters)])

    def scans_of(self, seeds: Sequence[int], scans: int) -> tuple[Array, Array]:
        """Return noise [°C] and delay [s] of the scans of samples, shape (n, scans), or (1, 1) where none is.

        Args:
            seeds: of the n samples.
            scans: how many.
        """
        noise = late = np.zeros((1, 1))
        if self.scenario.noise_degC > 0.0:
            noise = normals(seeds, scans, self.scenario.noise_degC)
        if self.spread.jitter_s > 0.0 and not self.controllers[0].pwm_period_s:
            late = self.spread.jitter_s * uniform(seeds, scans, _LATE)
            late[:, [0, -1]] = 0.0  # with the first one the PWM begins, with the last one the story ends
        return noise, late


def measure(drawing: SampleRequest, limits: LoopLimits, count: int, *, seed: int = 0,
            workers: int | None = None) -> CriterionTable:
    """Run samples and return what was measured: all samples under the first setting, then under the next one.

    Args:
        drawing: what is drawn.
        limits: what is right.
        count: how many samples.
        seed: of the first one.
        workers: how many share them; None: every processor.

    Raises:
        OutOfRange: no samples, a negative seed.
    """
    check("samples", count, least=1)
    check("seed", seed, least=0)
    seeds, scans = range(seed, seed + count), scans_of(drawing.controllers[0], drawing.scenario)
    rows, sizes = drawing.heaters_of(seeds)

    def run(part: _SampleChunk) -> CriterionTable:
        places, (noise, late) = part.places, drawing.scans_of([seeds[place] for place in part.places], scans)
        cooling = drawing.cooling_of([seeds[place] for place in part.places])
        return join_tables([measure_runs(controller, rows[places], drawing.scenario, drawing.actuator, limits, noise,
                                         late, sizes[places], cooling=cooling, side_by_side=part.side_by_side)
                       for controller in differing.values()])

    # of settings that no run tells apart, one is run for all
    differing = {controller.shown: controller for controller in drawing.controllers}
    parts = _parts(drawing, rows, count * len(differing) * scans // (workers or processors()))
    runs = [part.places + count * setting for part in parts for setting in range(len(differing))]
    back = np.argsort(np.concatenate(runs)).reshape(len(differing), count)
    settings = [list(differing).index(controller.shown) for controller in drawing.controllers]
    return reorder(join_tables(threaded_list(run, parts, workers)), back[settings].ravel())


class _SampleChunk(NamedTuple):
    """Samples of one call: their places among all, and whether they run side by side."""

    places: npt.NDArray[np.intp]
    side_by_side: bool


def _parts(drawing: SampleRequest, rows: Array, scans: int) -> list[_SampleChunk]:
    """Return all samples in parts; those side by side are alike, so that edges come in the same scans.

    `scans` tells how much work they are to one processor.
    """
    lags, parts, shaken = (rows[:, 2] > 0.0).astype(int), list[_SampleChunk](), np.full((1, 1), drawing.spread.jitter_s)
    fit = not have_loss(rows) and all(
        fits(controller, drawing.scenario, drawing.actuator, shaken) for controller in drawing.controllers)
    for more in np.unique(lags).tolist():
        own = np.flatnonzero(lags == more)
        own = own[order_by_edges(rows[own], drawing.scenario.setpoint_degC, drawing.actuator.pwm_period_s)]
        work = int(scans * np.mean(lags == more))
        worth = pays(drawing.controllers[0], drawing.actuator, work, two_lags=bool(more))
        parts += _chunks(own, side_by_side=worth and fit)
    return parts


def _chunks(places: npt.NDArray[np.intp], *, side_by_side: bool) -> list[_SampleChunk]:
    remainder = len(places) % STEP
    in_lanes = len(places) - (remainder if remainder < _LEAST else 0) if side_by_side else 0
    chunk = LANES * min(max(len(places) // (_CALLS * LANES), 1), _GROUPS)
    return [_SampleChunk(part[begin:begin + chunk], way)
            for part, way in ((places[:in_lanes], True), (places[in_lanes:], False))
            for begin in range(0, len(part), chunk)]


def replay(drawing: SampleRequest, seed: int, setting: int = 0, limits: LoopLimits | None = None) -> Trace:
    """Return the trace of the sample that has this seed: the same run, instant by instant.

    Args:
        drawing: what is drawn.
        seed: of the sample.
        setting: number of the controller.
        limits: for which the run is measured; None: for none.

    Raises:
        OutOfRange: a negative seed.
    """
    check("seed", seed, least=0)
    controller = drawing.controllers[setting]
    (row,), (factors,) = drawing.heaters_of([seed])
    (noise,), (late,) = drawing.scans_of([seed], scans_of(controller, drawing.scenario))
    model, start, actuator = _heater(row, drawing.heaters[seed % len(drawing.heaters)]), float(row[5]), drawing.actuator
    if actuator.cooling_gain is not None:
        actuator = replace(actuator, cooling_gain=actuator.cooling_gain * float(drawing.cooling_of([seed])[0]))
    disturbances = tuple(map(_sized, drawing.scenario.disturbances, factors.tolist()))
    scenario = replace(drawing.scenario, ambient_degC=float(row[4]), start_degC=start, disturbances=disturbances,
                       seed=seed)
    return trace_run(controller, model, scenario, actuator, noise, late, limits)


def _heater(row: Array, centre: HeaterModel) -> HeaterModel:
    """Return the heater of a row of `SampleRequest.heaters_of`, shape (6,) or more, drawn around another one."""
    gain, first, second, dead, ambient = row[:5].tolist()
    if centre.loss is not None:  # its curve keeps its own ambient; the scenario states the drawn one
        lags = {"second_time_constant_s": second} if second else {}
        return replace(centre, gain_degC_per_pct=gain, time_constant_s=first, dead_time_s=dead, **lags)
    parameters = {"gain_degC_per_pct": gain, "time_constant_s": first, "dead_time_s": dead, "ambient_degC": ambient}
    if centre.fast_share is not None:
        return replace(centre, **parameters, second_time_constant_s=second)
    return TwoLag(**parameters, second_time_constant_s=second) if second else Fopdt(**parameters)


def _sized(event: Disturbance, factor: float) -> Disturbance:
    """Return a disturbance times a factor, where it has a size."""
    if isinstance(event, TemperatureStep):
        return replace(event, temperature_degC=factor * event.temperature_degC)
    if isinstance(event, Mains):
        return replace(event, share=factor * event.share)
    return replace(event, power_pct=factor * event.power_pct) if isinstance(event, Load) else event


_AT_ONCE: Final = 10_000  # samples of which all is kept that was measured: some kilobytes each
_NAMED: Final = 500  # runs that break a limit whose samples are named


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One criterion over all samples, each under the setting that is worst for it; infinite for what never happened.

    Attributes:
        name: of the criterion, as in `CRITERIA`.
        unit: of all its numbers.
        limit: with several disturbances that of the worst sample; None: the number informs.
        bound: ">=" where it has to be reached, else "<=".
        median, p95, p99, worst: of its value over the samples; the largest is the worst, or, where it has to reach its
            limit, the smallest.
        passing: share of the samples that keep the limit under every setting, 0…1.
    """

    name: str
    unit: str
    limit: float | None
    bound: str
    median: float
    p95: float
    p99: float
    worst: float
    passing: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSetting:
    """A setting of what the manual leaves open, and how many of the samples keep every limit under it."""

    switches: Mapping[str, str]
    passing_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleProof:
    """The verdict on many samples.

    Attributes:
        count: how many samples, each run under every setting of what the manual leaves open.
        seed: of the first one; the others follow.
        quantile: share of all such heaters that must keep every limit.
        passing: share of the samples that does, under the setting under which the fewest do: a controller has one
            setting, whichever it is.
        settings: each setting and how many samples keep every limit under it.
        worst_seed: seed of the worst sample: most limits broken, then the most of a limit used.
        broken: seeds of samples that break a limit, the worst first, of very many some; no document has them.
        spread: what they were drawn from.
        criteria: by name.
    """

    count: int
    seed: int
    quantile: float
    passing: float
    settings: tuple[SampledSetting, ...]
    worst_seed: int
    spread: SampleSpread
    criteria: tuple[Spot, ...]
    broken: tuple[int, ...]

    @property
    def verdict(self) -> str:
        """Whether `quantile` of all such heaters keep every limit under each setting, see `verdict_of_samples`."""
        return verdict_of_samples(self.count, self.quantile, [setting.passing_count for setting in self.settings])

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object; numbers that are not finite are null."""
        document: dict[str, Any] = {"verdict": self.verdict, **encode(self)}
        del document["broken"]
        return document | {"criteria": {spot.pop("name"): spot for spot in document["criteria"]}}


def prove_samples(
    drawing: SampleRequest, limits: LoopLimits, count: int, *, seed: int = 0, quantile: float = 0.95,
    workers: int | None = None
) -> SampleProof:
    """Run samples and judge them.

    Args:
        drawing: what is drawn.
        limits: that each has to keep.
        count: how many samples.
        seed: of the first one.
        quantile: share of all such heaters that has to keep every limit, under each setting.
        workers: how many processors share them; None: all.

    Raises:
        OutOfRange: no samples, a negative seed, a quantile outside (0, 1].
    """
    check("quantile", quantile, above=0.0, most=1.0)
    check("samples", count, least=1)
    blocks = [_run(drawing, limits, min(_AT_ONCE, count - offset), seed + offset, workers)
              for offset in range(0, count, _AT_ONCE)]
    broken, strain = (np.concatenate([getattr(part, name) for part in blocks], axis=1) for name in ("broken", "strain"))
    passing_counts, hardest = np.count_nonzero(broken == 0, axis=1).tolist(), _hardest(broken, strain)
    settings = tuple(SampledSetting(switches=controller.switches, passing_count=number)
                     for controller, number in zip(drawing.controllers, passing_counts, strict=True))
    return SampleProof(
        count=count, seed=seed, quantile=quantile, settings=settings, spread=drawing.spread,
        passing=min(passing_counts) / count, worst_seed=seed + int(hardest[0]) % count,
        broken=tuple(dict.fromkeys((seed + hardest[:np.count_nonzero(broken)][:_NAMED] % count).tolist())),
        criteria=tuple(_spot(each) for each in zip(*(part.criteria for part in blocks), strict=True)))


class _SampledCriterion(NamedTuple):
    """One criterion of some samples: of each its worst value, signed so that the largest is the worst, and strain."""

    name: str
    unit: str
    at_least: bool
    values: Array
    strain: Array
    limit: float | None  # of the one that strains most


class _SampleTally(NamedTuple):
    """What some samples amount to: of each, under each setting, how many limits it breaks and the most it uses of one.

    Arrays of shape (settings, samples).
    """

    criteria: list[_SampledCriterion]
    broken: npt.NDArray[np.intp]
    strain: Array


def _run(drawing: SampleRequest, limits: LoopLimits, count: int, seed: int, workers: int | None) -> _SampleTally:
    columns = list(columns_of(measure(drawing, limits, count, seed=seed, workers=workers), limits))
    strains = np.array([column.strains.reshape(-1, count) for column in columns])
    criteria = [
        _SampledCriterion(
            name=column.name, unit=column.unit, at_least=column.at_least, strain=strain.max(axis=0),
            values=(_sign(column.at_least) * column.values).reshape(-1, count).max(axis=0),
            limit=None if column.limits is None else column.limits[np.argmax(strain)].item())
        for column, strain in zip(columns, strains, strict=True)]
    return _SampleTally(criteria, np.count_nonzero(~(strains <= 1.0), axis=0), strains.max(axis=0))


def _spot(parts: Sequence[_SampledCriterion]) -> Spot:
    first, values, strain = parts[0], *(np.concatenate([getattr(part, name) for part in parts])
                                        for name in ("values", "strain"))
    median, p95, p99, most = (_sign(first.at_least) * np.quantile(
        values, [0.5, 0.95, 0.99, 1.0], method="higher")).tolist()
    return Spot(
        name=first.name, unit=first.unit, limit=max(parts, key=lambda part: float(part.strain.max())).limit,
        bound=">=" if first.at_least else "<=", median=median, p95=p95, p99=p99, worst=most,
        passing=float(np.mean(strain <= 1.0)))


def _sign(at_least: bool) -> float:
    """Return by what values are multiplied so that the largest is the worst."""
    return -1.0 if at_least else 1.0


def _hardest(broken: npt.NDArray[np.intp], strain: Array) -> npt.NDArray[np.intp]:
    """Return the numbers of the runs: first what breaks the most limits, of equals what uses most of one."""
    return np.lexsort((-strain.ravel(), -broken.ravel()))


def hardest_setting(drawing: SampleRequest, limits: LoopLimits, seed: int) -> int:
    """Return the number of the setting under which the sample of a seed is the worst, as in `SampleProof.worst_seed`.

    Raises:
        OutOfRange: a negative seed.
    """
    if len(drawing.controllers) == 1:
        return 0
    result = _run(drawing, limits, 1, seed, 1)
    return int(_hardest(result.broken, result.strain)[0])

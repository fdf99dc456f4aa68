"""What a loop is judged by: a criterion is one number and its limit.

What was measured on loops → criteria: one table for both, the trace of a run and the kernel's meter.

`judge` measures on a trace, `metered` while the loops run; neither knows the other's arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from heatertune.codec import LEFT_OUT, OrInfinite, construct_from, encode
from heatertune.plc.pwm import INSTANT_S
from heatertune.proof.meter import (
    ABSOLUTE,
    FAULTS,
    HIGHEST,
    LAG,
    LIMITED,
    LOWEST,
    MEAN,
    REST_HIGHEST,
    REST_LOWEST,
    SCANS,
    SETTLED,
    SWITCHINGS,
)
from heatertune.proof.scenario import LED, WAYS, Phase, Scenario, SetpointRampEvent, phases_of
from heatertune.settings import STEP_POWER_PCT
from heatertune.units import check

__all__ = [
    "IN_DEGC",
    "Criterion",
    "CriterionColumn",
    "CriterionTable",
    "LoopLimits",
    "band_of",
    "columns_of",
    "join_tables",
    "periods_at_rest",
    "phases_measured",
    "reorder",
    "worst_of",
]


_SETTLES_WITHIN: Final = 0.5  # of a soak

@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One number and its limit.

    Attributes:
        name: of the criterion.
        value: what was found; infinite for something that never happened (never settled).
        limit: None: the number informs, nothing depends on it.
        unit: of value and limit.
        what: meaning, in one sentence.
        at_least: whether the value must reach the limit; otherwise it must not exceed it.
        where: label of the run it belongs to.
    """

    name: str
    value: float
    limit: float | None
    unit: str
    what: str
    at_least: bool = False
    where: str = ""

    @property
    def ok(self) -> bool:
        """Whether the limit is kept; what is not a number keeps none, and fails without one too."""
        return _keeps(self.value, self.limit, at_least=self.at_least)

    @property
    def strain(self) -> float:
        """How much of the limit is used: 1 at the limit, above 1 beyond it, 0 without a limit."""
        if math.isnan(self.value):
            return math.inf
        if self.limit is None:
            return 0.0
        used, allowed = (self.limit, self.value) if self.at_least else (self.value, self.limit)
        if allowed > 0.0 and not math.isinf(used):
            return max(0.0, used / allowed)
        return 0.0 if self.ok else math.inf

    @property
    def view(self) -> CriterionView:
        """What is written of it."""
        return construct_from(CriterionView, self, bound=">=" if self.at_least else "<=")

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object; a number that is not finite is null."""
        document: dict[str, Any] = encode(self.view)
        return document


@dataclass(frozen=True, slots=True, kw_only=True)
class CriterionView:
    """A criterion as documents hold it, the worst over all runs; null is infinite."""

    value: OrInfinite
    limit: float | None
    bound: Literal["<=", ">="]
    ok: bool
    unit: str
    where: str
    what: str

    def keeps(self, value: float) -> bool:
        """Return whether a run's value keeps the limit."""
        return _keeps(value, self.limit, at_least=self.bound == ">=")


def _keeps(value: float, limit: float | None, *, at_least: bool) -> bool:
    if limit is None:
        return not math.isnan(value)
    return value >= limit if at_least else value <= limit


def worst_of(same: Iterable[Criterion]) -> Criterion:
    """Return the one that strains its limit most; without limits the one whose value is worst, no number before all."""
    def badness(one: Criterion) -> tuple[bool, float, float]:
        return math.isnan(one.value), one.strain, -one.value if one.at_least else one.value

    return max(same, key=badness)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopLimits:
    """What a loop must keep. None: the number is told, but not judged.

    The margins' limits follow the textbooks: gain margin 1.7…4 and phase margin 30…45° for a well-tuned loop
    (D. E. Seborg, T. F. Edgar, D. A. Mellichamp, "Process Dynamics and Control", frequency response); Ms up to 2
    (K. J. Åström, T. Hägglund, "Advanced PID Control", ISA 2006), which by itself means a phase margin of 29°. They
    hold for every model, the least likely one included. The other limits are this project's choice for heaters.

    Attributes:
        overshoot_pct, overshoot_degC: beyond the setpoint during heat-up [% of the rise from ambient to setpoint, °C];
            both hold.
        reheat_overshoot_pct, reheat_overshoot_degC: beyond the setpoint after the heater's circuit was open [% of the
            rise, °C]; both hold.
        small_change_overshoot_pct, small_change_overshoot_degC: beyond the setpoint after a small change of it [% of
            that change, °C]; both hold.
        settling_s: time after which the temperature stays in the band [s]; None: the time of the first
            disturbance, or the end.
        tolerance_degC: how far from the setpoint the process still is as it should be [°C]: half width of the band,
            and limit of the offset and of the swing at rest.
        tolerance_resolutions: the least the tolerance can be [sensor resolutions]: what the sensor cannot see, the
            controller cannot correct.
        steady_share: last part of the time before the first disturbance that counts as rest, in (0, 1].
        pwm_ripple_degC: peak to peak within one PWM period at rest [°C].
        iae_degC_s: ∫|setpoint − temperature| dt of the whole record, the setpoint as asked for, no ramp [°C·s].
        recovery_s: time after a disturbance until the temperature stays in the band [s]; None: the time until the
            next one, or the end.
        recovery_overshoot_pct, recovery_overshoot_degC: beyond the setpoint after a disturbance, on the other side
            [% of the rise, °C]; both hold.
        deviation_degC: largest distance from the setpoint after a disturbance, on its side [°C].
        saturation_pct: share of the scans that ask for 0 or 100 % power [%].
        power_reserve_pct: power that is left over where the heater holds the highest setpoint [% of full power].
        switchings_per_h: how often the heater is switched on [1/h]; a relay's life is counted in these.
        overflows: how often such a flag was set.
        overflow_flags: names of the flags that mean a wrong result; SM1.1 overflow, SM1.3 division by zero (S7-200).
        ms, gain_margin, phase_margin_deg: margins of the words as realised.
        step_power_pct: power that one step of the reading, or its noise, moves within one scan [%].
        soak_band_degC: how far from the temperature of a profile's soak is still right [°C]; None: the tolerance.
        soak_settling_s, soak_settling_pct: time of a soak after which it has to be [s, % of the soak]; the sooner
            holds; None: half of it.
        ramp_deviation_degC: largest distance from the setpoint on a profile's ramps [°C].
        peak_degC: highest temperature along a profile [°C].

    Raises:
        OutOfRange: a limit that is negative or not finite, a share outside (0, 1].
    """

    overshoot_pct: float | None = 20.0
    overshoot_degC: float | None = None
    reheat_overshoot_pct: float | None = 40.0
    reheat_overshoot_degC: float | None = None
    small_change_overshoot_pct: float | None = field(default=None, metadata=LEFT_OUT)
    small_change_overshoot_degC: float | None = field(default=None, metadata=LEFT_OUT)
    settling_s: float | None = None
    tolerance_degC: float = 1.0
    tolerance_resolutions: float = 2.0
    steady_share: float = 0.2
    pwm_ripple_degC: float | None = None
    iae_degC_s: float | None = None
    recovery_s: float | None = None
    recovery_overshoot_pct: float | None = 20.0
    recovery_overshoot_degC: float | None = None
    deviation_degC: float | None = None
    saturation_pct: float | None = None
    power_reserve_pct: float | None = None
    switchings_per_h: float | None = None
    overflows: float = 0.0
    overflow_flags: tuple[str, ...] = ("SM1.1", "SM1.3", "overflow")
    ms: float | None = 2.0
    gain_margin: float | None = 1.7
    phase_margin_deg: float | None = 30.0
    step_power_pct: float | None = STEP_POWER_PCT
    soak_band_degC: float | None = field(default=None, metadata=LEFT_OUT)
    soak_settling_s: float | None = field(default=None, metadata=LEFT_OUT)
    soak_settling_pct: float | None = field(default=None, metadata=LEFT_OUT)
    ramp_deviation_degC: float | None = field(default=None, metadata=LEFT_OUT)
    peak_degC: float | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        for limit in fields(self):
            value = getattr(self, limit.name)
            if isinstance(value, int | float):
                check(limit.name, value, least=0.0)
        check("steady_share", self.steady_share, above=0.0, most=1.0)

    def soak_settles_s(self, soak_s: float) -> float:
        """Return after what time of a soak the temperature has to be right [s]."""
        given = (self.soak_settling_s, self.soak_settling_pct and self.soak_settling_pct / 100.0 * soak_s)
        return min((limit for limit in given if limit is not None), default=_SETTLES_WITHIN * soak_s)


Array = npt.NDArray[np.float64]

#: end of the name of a criterion that is told in percent, where it is limited in °C, too
IN_DEGC: Final = "_degC"
#: what an overshoot is a percentage of: unit and meaning
RISE: Final = ("% of rise", "the rise from ambient to the highest setpoint")
CHANGE: Final = ("% of change", "that change")
#: kinds of phases that are held against no criterion, or against those of a profile
_OWN: Final = ("off", *LED)
_PERIODS_AT_REST = 3  # PWM periods that the time at rest spans at least


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CriterionTable:
    """What was measured on loops that live through one scenario, a row each, see `proof.meter`.

    Attributes:
        scenario: what they live through.
        period_s: of the PWM [s].
        band_degC: how far from the setpoint is still right [°C].
        phases: of the scenario; all temperatures are distances from their setpoints.
        rows: of `Batch.plants`, shape (n, 6).
        table: what was measured in each phase, shape (n, phases, `COLUMNS`).
        totals: shape (n, `TOTALS`).
        ripple: peak to peak in each PWM period at rest [°C], median, shape (n,).
    """

    scenario: Scenario
    period_s: float
    band_degC: float
    phases: tuple[Phase, ...]
    rows: Array
    table: Array
    totals: Array
    ripple: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CriterionColumn:
    """One criterion of many loops.

    Attributes:
        name, unit, what, at_least: see `Criterion`.
        values: of the loops, shape (n,); in several phases, shape (n, phases).
        limits: of each of them, likewise; None: the numbers inform.
    """

    name: str
    unit: str
    what: str
    values: Array
    limits: Array | None
    at_least: bool = False

    @property
    def strains(self) -> Array:
        """How much of its limit each loop uses, as `Criterion.strain`, shape (n,) or, as the values, (n, phases)."""
        return _strains(self.values, self.limits, at_least=self.at_least)

    def criteria(self, labels: Iterable[str]) -> Iterator[Criterion]:
        """Return the criterion of each loop, the loops being called so."""
        limits = [None] * len(self.values) if self.limits is None else self.limits.tolist()
        for value, limit, label in zip(self.values.tolist(), limits, labels, strict=True):
            yield Criterion(name=self.name, value=value, limit=limit, unit=self.unit, what=self.what,
                            at_least=self.at_least, where=label)


def _strains(values: Array, limits: Array | None, *, at_least: bool) -> Array:
    """Return how much of its limit each value uses, as `Criterion.strain`, arrays of one shape."""
    unknown = np.isnan(values)
    if limits is None:
        return np.where(unknown, math.inf, 0.0)
    used, allowed = (limits, values) if at_least else (values, limits)
    over = np.where(used <= allowed, 0.0, math.inf)
    used = np.maximum(0.0, np.divide(used, allowed, out=over, where=allowed > 0.0))
    return np.where(unknown, math.inf, used)


def join_tables(parts: Sequence[CriterionTable]) -> CriterionTable:
    """Return the loops of all parts, which differ in nothing else, part by part."""
    def all_of(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    return replace(
        parts[0], rows=all_of("rows"), table=all_of("table"), totals=all_of("totals"), ripple=all_of("ripple"))


def reorder(measured: CriterionTable, places: npt.NDArray[np.intp]) -> CriterionTable:
    """Return the n loops in another order: first the one of the first place, shape (n,)."""
    return replace(measured, rows=measured.rows[places], table=measured.table[places], totals=measured.totals[places],
                   ripple=measured.ripple[places])


def band_of(limits: LoopLimits, resolution_degC: float) -> float:
    """Return how far from the setpoint is still right [°C]; the sensor's resolution limits it."""
    return max(limits.tolerance_degC, limits.tolerance_resolutions * resolution_degC)


def phases_measured(scenario: Scenario, limits: LoopLimits, end_s: float, period_s: float) -> tuple[Phase, ...]:
    """Return the phases of a run; a rest that the scenario does not tell is whole PWM periods at the heat-up's end."""
    heated_s = scenario.disturbances[0].time_s if scenario.disturbances else end_s
    periods = max(_PERIODS_AT_REST, math.floor(limits.steady_share * heated_s / period_s))
    return phases_of(scenario, end_s, max(0.0, heated_s - periods * period_s))


def periods_at_rest(phase: Phase, period_s: float) -> int:
    """Return how many PWM periods the rest of a phase spans."""
    return max(1, math.floor((phase.end_s - phase.rest_s) / period_s + INSTANT_S))


def columns_of(measured: CriterionTable, limits: LoopLimits) -> list[CriterionColumn]:
    """Return what the loops amount to, in a fixed order."""
    return [*_ways(measured, limits, "heat-up"), *_at_rest(measured, limits), *_recovery(measured, limits),
            *(column for kind in WAYS if kind != "heat-up" for column in _ways(measured, limits, kind)),
            *_profile(measured, limits), *_switching(measured, limits)]


def _column(name: str, unit: str, values: Array, limit: float | Array | None, what: str) -> CriterionColumn:
    limits = None if limit is None else np.full(values.shape, limit)
    return CriterionColumn(name=name, unit=unit, what=what, values=values, limits=limits)


def _steps(measured: CriterionTable) -> Array:
    """Return how far each loop has to go, up or down [°C], shape (n, 1)."""
    return np.asarray(np.abs(measured.scenario.setpoint_degC - measured.rows[:, 5:6]))


def _changes(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return by how much the setpoint changes at the begin of each phase [°C], shape (phases,)."""
    asked = measured.scenario.setpoints_degC
    return np.array([abs(asked[number] - asked[number - 1]) for number in phases])


def _rises(measured: CriterionTable, phases: Sequence[int]) -> npt.NDArray[np.bool_]:
    """Return for each loop whether the event of a phase moves the temperature up: a cooler's power moves it down."""
    up, by_power = np.array([(measured.phases[number].up, measured.phases[number].by_power) for number in phases]).T
    return np.asarray(np.where(by_power, (measured.rows[:, :1] > 0.0) == up, up))


def _of_kind(measured: CriterionTable, kind: str) -> list[int]:
    """Return the numbers of the phases of a kind."""
    return [number for number, phase in enumerate(measured.phases) if phase.kind == kind]


def _numbers(measured: CriterionTable, phases: Sequence[int], name: str) -> Array:
    """Return a number that each phase has."""
    return np.array([getattr(measured.phases[number], name) for number in phases])


def _ways(measured: CriterionTable, limits: LoopLimits, kind: str) -> Iterator[CriterionColumn]:
    """Return the criteria of the phases on which the temperature has to go to a setpoint."""
    phases = _of_kind(measured, kind)
    return map(_worst, _way(measured, limits, kind, phases) if phases else ())


def _way(measured: CriterionTable, limits: LoopLimits, kind: str, phases: Sequence[int]) -> Iterator[CriterionColumn]:
    overshoot, time, when, since = WAYS[kind]
    seen, asked = measured.table[:, phases], limits.settling_s if kind == "heat-up" else None
    beyond = np.where(_rises(measured, phases), seen[:, :, HIGHEST], -seen[:, :, LOWEST])
    steps = _changes(measured, phases) if kind == "small-change" else _steps(measured)
    yield from _beyond(overshoot, np.maximum(0.0, beyond), steps, _limits_of(limits, overshoot), when,
                       CHANGE if kind == "small-change" else RISE)
    yield _column(
        time, "s", seen[:, :, SETTLED] - _numbers(measured, phases, "begin_s"),
        _numbers(measured, phases, "limit_s") if asked is None else asked,
        f"{since} after which the temperature stays within ±{measured.band_degC:.3g} °C of the setpoint.")


def _beyond(
    name: str, beyond: Array, steps: Array, limits: tuple[float | None, float | None], when: str,
    of: tuple[str, str] = RISE,
) -> Iterator[CriterionColumn]:
    """Return how far beyond the setpoint, in percent of a step, and in °C where that is limited."""
    (pct, degC), (unit, step) = limits, of
    yield _column(name, unit, beyond / steps * 100.0, pct, f"Beyond the setpoint {when}, of {step}.")
    if degC is not None:
        yield _column(f"{name}{IN_DEGC}", "°C", beyond, degC, f"Beyond the setpoint {when}.")


def _limits_of(limits: LoopLimits, overshoot: str) -> tuple[float | None, float | None]:
    """Return the limits of an overshoot, in percent and °C: that after an open circuit has its own."""
    own = overshoot if hasattr(limits, f"{overshoot}_pct") else "overshoot"
    return getattr(limits, f"{own}_pct"), getattr(limits, f"{own}{IN_DEGC}")


def _worst(column: CriterionColumn) -> CriterionColumn:
    """Return of a criterion in several phases, shape (n, phases), for each loop that which uses most of its limit.

    Without limits it is the largest value; of equals the first.
    """
    values, used = column.values, column.strains
    most = np.where(used == used.max(axis=1, keepdims=True), values, -math.inf).argmax(axis=1)
    loops = np.arange(len(values))
    return replace(column, values=values[loops, most],
                   limits=None if column.limits is None else column.limits[loops, most])


def _at_rest(measured: CriterionTable, limits: LoopLimits) -> Iterator[CriterionColumn]:
    judged = [number for number, phase in enumerate(measured.phases) if phase.kind not in _OWN]
    rests = [number for number in judged if measured.phases[number].rest_s < measured.phases[number].end_s]
    yield from map(_worst, _rest(measured, rests) if rests else ())
    yield _column(
        "pwm_ripple", "°C", measured.ripple, limits.pwm_ripple_degC,
        "Peak to peak within one PWM period at rest after the heat-up, median.")
    errors = np.ascontiguousarray(measured.table[:, judged, ABSOLUTE])  # one order of sums for any number of loops
    yield _column(
        "iae", "°C·s", errors.sum(axis=1), limits.iae_degC_s,
        "Integral of the absolute error over the whole run, except while heater or PLC are off.")


def _rest(measured: CriterionTable, phases: Sequence[int]) -> Iterator[CriterionColumn]:
    seen, band = measured.table[:, phases], measured.band_degC
    lasts_s = _numbers(measured, phases, "end_s") - _numbers(measured, phases, "rest_s")
    yield _column(
        "steady_offset", "°C", np.abs(seen[:, :, MEAN]) / lasts_s, band, "Mean distance from the setpoint at rest.")
    yield _column(
        "limit_cycle", "°C", (seen[:, :, REST_HIGHEST] - seen[:, :, REST_LOWEST]) / 2.0, band,
        "Half of the temperature's peak to peak at rest, PWM ripple included.")


def _recovery(measured: CriterionTable, limits: LoopLimits) -> Iterator[CriterionColumn]:
    """Return the criteria of the disturbances."""
    phases = _of_kind(measured, "recovery")
    return map(_worst, _after(measured, limits, phases) if phases else ())


def _after(measured: CriterionTable, limits: LoopLimits, phases: Sequence[int]) -> Iterator[CriterionColumn]:
    seen, rises = measured.table[:, phases], _rises(measured, phases)
    along, beyond = (np.where(rises == up, seen[:, :, HIGHEST], -seen[:, :, LOWEST]) for up in (True, False))
    yield _column(
        "recovery_time", "s", seen[:, :, SETTLED] - _numbers(measured, phases, "begin_s"),
        _numbers(measured, phases, "limit_s") if limits.recovery_s is None else limits.recovery_s,
        f"Time after a disturbance until the temperature stays within ±{measured.band_degC:.3g} °C of the setpoint.")
    yield from _beyond(
        "recovery_overshoot", np.maximum(0.0, beyond), _steps(measured), _limits_of(limits, "recovery_overshoot"),
        "after a disturbance, on the other side")
    yield _column(
        "deviation", "°C", np.maximum(0.0, along), limits.deviation_degC,
        "Largest distance from the setpoint after a disturbance, on its side.")


def _profile(measured: CriterionTable, limits: LoopLimits) -> Iterator[CriterionColumn]:
    """Return the criteria of a profile, none where the setpoint is led along none."""
    led = [number for number, phase in enumerate(measured.phases) if phase.kind in LED]
    ramps = _of_kind(measured, "ramp")
    soaks = [number for number in _of_kind(measured, "soak")
             if measured.phases[number].rest_s < measured.phases[number].end_s]
    if soaks:
        yield _worst(_soak(measured, limits, soaks))
    if ramps:
        yield from map(_worst, _ramp_ends(measured, limits, ramps))
        yield _column("ramp_deviation", "°C", measured.table[:, ramps, LAG].max(axis=1), limits.ramp_deviation_degC,
                      "Largest distance from the setpoint on the ramps of the profile.")
    if led:
        yield _column("peak", "°C", _highest(measured, led), limits.peak_degC, "Highest temperature along the profile.")


def _soak(measured: CriterionTable, limits: LoopLimits, phases: Sequence[int]) -> CriterionColumn:
    seen, band = measured.table[:, phases], limits.soak_band_degC
    return _column(
        "soak_deviation", "°C", np.maximum(seen[:, :, REST_HIGHEST], -seen[:, :, REST_LOWEST]),
        measured.band_degC if band is None else band,
        "Largest distance from the temperature of a soak of the profile, after what it may settle in.")


def _ramp_ends(measured: CriterionTable, limits: LoopLimits, ramps: Sequence[int]) -> Iterator[CriterionColumn]:
    """Return what goes beyond the ends of ramps: on each, in the soak after it, and on a way back that follows."""
    beyond, steps = zip(*(_beyond_ramp(measured, number) for number in ramps), strict=True)
    return _beyond("ramp_overshoot", np.maximum(0.0, np.column_stack(beyond)), np.array(steps),
                   _limits_of(limits, "ramp_overshoot"), "at the end of a ramp of the profile",
                   ("% of ramp", "the step of that ramp"))


def _beyond_ramp(measured: CriterionTable, number: int) -> tuple[Array, float]:
    """Return how far each loop goes beyond the end of a ramp, and how high that is [°C]."""
    phases, ramp, led = measured.phases, measured.phases[number], measured.scenario.disturbances[number - 1]
    assert isinstance(led, SetpointRampEvent)
    after = [number]
    for later in range(number + 1, len(phases)):
        if phases[later].kind == "ramp" and phases[later].up == ramp.up:
            break
        after.append(later)
        if phases[later].kind == "ramp":
            break
    beyond = (_highest(measured, after) - ramp.setpoint_degC if ramp.up
              else ramp.setpoint_degC - _lowest(measured, after))
    return beyond, abs(led.setpoint_degC - led.from_degC)


def _highest(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the highest temperature in some phases [°C]."""
    setpoints = [measured.phases[number].setpoint_degC for number in phases]
    return np.asarray((measured.table[:, phases, HIGHEST] + setpoints).max(axis=1))


def _lowest(measured: CriterionTable, phases: Sequence[int]) -> Array:
    setpoints = [measured.phases[number].setpoint_degC for number in phases]
    return np.asarray((measured.table[:, phases, LOWEST] + setpoints).min(axis=1))


def _switching(measured: CriterionTable, limits: LoopLimits) -> Iterator[CriterionColumn]:
    gain, ambient = measured.rows[:, :1], measured.rows[:, 4:5]
    held = ((np.asarray(measured.scenario.setpoints_degC) - ambient) / gain).max(axis=1)
    reserve = _column(
        "power_reserve", "% of power", 100.0 - held, limits.power_reserve_pct,
        "Power reserve while the heater holds the highest setpoint, as a share of full power.")
    yield replace(reserve, at_least=True)
    total = measured.totals
    yield _column(
        "saturation", "% of scans", total[:, LIMITED] / np.maximum(total[:, SCANS], 1.0) * 100.0, limits.saturation_pct,
        "Share of the scans that ask for 0 or 100 % power.")
    yield _column(
        "switchings", "1/h", _switchings_per_h(measured), limits.switchings_per_h,
        "How often the heater is switched on while the requested power is between its limits; for two-level control, "
        "while the circuit is closed.")
    yield _column(
        "overflow", "1", total[:, FAULTS], limits.overflows,
        "How often an error flag was set, or the requested power was not a number.")


def _switchings_per_h(measured: CriterionTable) -> Array:
    """Return how often each loop's heater is switched on where it has to be, not thinned by times at full power or off.

    A PWM period has one pulse at most; a loop that is hardly ever between its limits would be told to have more.
    """
    scenario, total = measured.scenario, measured.totals
    lasts = np.array([phase.end_s - phase.begin_s for phase in measured.phases])
    between_s = lasts[np.array(scenario.supplied)].sum() * (1.0 - total[:, LIMITED] / np.maximum(total[:, SCANS], 1.0))
    closed_s = lasts[[phase.kind != "off" for phase in measured.phases]].sum()
    times = total[:, SWITCHINGS]
    often = np.divide(times, between_s, out=np.zeros(len(times)), where=between_s > 0.0)
    return np.asarray(3600.0 * np.minimum(np.maximum(times / closed_s, often), 1.0 / measured.period_s))

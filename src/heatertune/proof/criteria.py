"""All criteria and limits of a loop, declared once, and their evaluation.

A criterion is a row of `CRITERIA`. A limit of its own is a field of `LoopLimits` and, for users, a row of `LIMITS`.
Specifications, documents, verdicts, the columns of a fleet, texts and the comparison with a trace read these tables.
`meter_for` prepares the kernel's meter, and `columns_of` compares its results with the limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.codec import LEFT_OUT, OrInfinite, construct_from, encode
from heatertune.errors import UnknownName
from heatertune.pid.design_values import Margins
from heatertune.plc.pwm import INSTANT_S
from heatertune.proof.meter import COLUMNS, TOTALS, Meter
from heatertune.proof.phase_statistics import (
    STEPS_DEGC,
    CriterionTable,
    PhaseMeasure,
    behind_degC,
    beyond_degC,
    beyond_ramp_degC,
    fault_count,
    highest_degC,
    iae_degC_s,
    lag_degC,
    numbers_of,
    off_at_rest_degC,
    offset_degC,
    reserve_pct,
    ripple_degC,
    saturated_pct,
    settling_s,
    swing_degC,
    switchings_per_h,
)
from heatertune.proof.scenario import LED, TO_SETPOINT, Phase, Scenario, phases_of
from heatertune.settings import STEP_POWER_PCT
from heatertune.units import check

__all__ = [
    "CRITERIA", "CRITERION", "HEATER_REMEDIES", "LIMITS", "TIME_OF", "Criterion", "CriterionColumn", "CriterionKind",
    "CriterionView", "Limit", "LoopLimits", "Measure", "band_of", "columns_of", "criteria_of_words", "limit_of",
    "meter_for", "names_of", "phases_measured", "worst_of",
]


_SETTLES_WITHIN: Final = 0.5  # of a soak
_PERIODS_AT_REST: Final = 3  # PWM periods that the time at rest spans at least
_TIMES: Final = {"s": 1.0, "min": 60.0, "h": 3600.0}


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
    def badness(item: Criterion) -> tuple[bool, float, float]:
        return math.isnan(item.value), item.strain, -item.value if item.at_least else item.value

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
        limits = (self.soak_settling_s, self.soak_settling_pct and self.soak_settling_pct / 100.0 * soak_s)
        return min((limit for limit in limits if limit is not None), default=_SETTLES_WITHIN * soak_s)


class Measure(NamedTuple):
    """A unit of a limit: the field of `Limits` it sets, and by what a number in it is multiplied."""

    field: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """What can be limited.

    Attributes:
        description: its meaning.
        units: unit → what it sets; "T+L" counts in the slowest plausible heater's lags and dead time.
        example: a value, as a user would write it.
        at_least: whether the value must be reached; otherwise it must not be exceeded.
        is_required: whether a limit there must be: nothing cannot be asked for.
        least: no value is below it, so that to ask for less would be to ask for nothing that there is.
    """

    description: str
    units: Mapping[str, Measure]
    example: str
    at_least: bool = False
    is_required: bool = False
    least: float = 0.0


def _of_time(field_: str) -> dict[str, Measure]:
    return {unit: Measure(field_, factor) for unit, factor in _TIMES.items()} | {"T+L": Measure(field_)}


def _of_overshoot(field_: str) -> dict[str, Measure]:
    return {"%": Measure(f"{field_}_pct"), "degC": Measure(f"{field_}_degC")}


#: everything that a user can limit, by the name that a user writes
LIMITS: Final[dict[str, Limit]] = {
    "tolerance": Limit(
        description="tolerance around the setpoint: half width of the band, limit of offset and oscillation at rest",
        units={"degC": Measure("tolerance_degC")}, example="1 degC", is_required=True),
    "overshoot": Limit(
        description="beyond the setpoint on heat-up, after a change of the setpoint and a restart, of the rise above "
                    "ambient",
        units=_of_overshoot("overshoot"), example="5 %"),
    "reheat-overshoot": Limit(
        description="beyond the setpoint after the heater's circuit was open for a while, of the rise above ambient",
        units=_of_overshoot("reheat_overshoot"), example="40 %"),
    "small-change-overshoot": Limit(
        description="beyond the setpoint after a small change of the setpoint, of that change",
        units=_of_overshoot("small_change_overshoot"), example="30 %"),
    "settling": Limit(description="time from cold until the temperature stays in the band",
        units=_of_time("settling_s"), example="20 min"),
    "recovery": Limit(description="time after a disturbance until the temperature stays in the band",
        units=_of_time("recovery_s"), example="5 min"),
    "recovery-overshoot": Limit(
        description="beyond the setpoint after a disturbance, on the other side, of the rise above ambient",
        units=_of_overshoot("recovery_overshoot"), example="5 %"),
    "load-deviation": Limit(description="largest distance from the setpoint after a disturbance, on its side",
        units={"degC": Measure("deviation_degC")}, example="2 degC"),
    "ripple": Limit(description="peak to peak within one PWM period at rest",
        units={"degC": Measure("pwm_ripple_degC")}, example="0.2 degC"),
    "iae": Limit(description="integral of the absolute error over the whole test sequence",
        units={"degC·s": Measure("iae_degC_s")}, example="5000 degC·s"),
    "power-reserve": Limit(
        description="power reserve while the heater holds the highest setpoint, as a share of full power",
        units={"%": Measure("power_reserve_pct")}, example="10 %", at_least=True),
    "saturation": Limit(description="share of the scans that ask for 0 or 100 % power",
        units={"%": Measure("saturation_pct")}, example="50 %"),
    "switchings": Limit(description="how often the heater is switched on", units={"/h": Measure("switchings_per_h")},
        example="30 /h"),
    "ms": Limit(description="maximum sensitivity Ms", units={"": Measure("ms")}, example="1.7", least=1.0),
    "gain-margin": Limit(description="factor by which the heater's gain may grow", units={"": Measure("gain_margin")},
        example="2.5", at_least=True),
    "phase-margin": Limit(description="phase that the loop may lose", units={"deg": Measure("phase_margin_deg")},
        example="45 deg", at_least=True),
    "step-power": Limit(description="power that one step of the reading, or its noise, may move",
        units={"%": Measure("step_power_pct")}, example="10 %"),
    "soak-band": Limit(description="tolerance around the temperature of a soak; by default the general tolerance",
        units={"degC": Measure("soak_band_degC")}, example="3 degC"),
    "soak-settling": Limit(description="share of a soak after which its tolerance applies; by default one half",
        units={"%": Measure("soak_settling_pct"), **_of_time("soak_settling_s")}, example="10 min"),
    "ramp-deviation": Limit(description="largest distance from the setpoint on a profile's ramps",
        units={"degC": Measure("ramp_deviation_degC")}, example="20 degC"),
    "peak": Limit(description="highest temperature along a profile", units={"degC": Measure("peak_degC")},
        example="1070 degC"),
}


def limit_of(name: str) -> Limit:
    """Return what a name limits.

    Raises:
        UnknownName: it limits nothing.
    """
    if name not in LIMITS:
        raise UnknownName("limit", name, LIMITS)
    return LIMITS[name]


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


def band_of(limits: LoopLimits, resolution_degC: float) -> float:
    """Return how far from the setpoint is still right [°C]; the sensor's resolution limits it."""
    return max(limits.tolerance_degC, limits.tolerance_resolutions * resolution_degC)


def phases_measured(scenario: Scenario, limits: LoopLimits, end_s: float, period_s: float) -> tuple[Phase, ...]:
    """Return the phases of a run; a rest that the scenario does not tell is whole PWM periods at the heat-up's end."""
    heated_s = scenario.disturbances[0].time_s if scenario.disturbances else end_s
    periods = max(_PERIODS_AT_REST, math.floor(limits.steady_share * heated_s / period_s))
    return phases_of(scenario, end_s, max(0.0, heated_s - periods * period_s))


def meter_for(
    scenario: Scenario, limits: LoopLimits, *, end_s: float, period_s: float, resolution_degC: float,
    flags: Sequence[str], loops: int = 1,
) -> tuple[Meter, tuple[Phase, ...]]:
    """Return the kernel's meter for some loops, and the phases that it measures.

    Args:
        scenario: what they live through.
        limits: what is right.
        end_s: instant of the last scan [s].
        period_s: of the PWM [s].
        resolution_degC: step of the reading [°C].
        flags: of the controller, by their bits.
        loops: how many.
    """
    phases = phases_measured(scenario, limits, end_s, period_s)
    periods = max(1, math.floor((phases[0].end_s - phases[0].rest_s) / period_s + INSTANT_S))
    wrong = sum(1 << place for place, name in enumerate(flags) if name in limits.overflow_flags)
    return Meter(True, np.array(scenario.setpoints_degC), band_of(limits, resolution_degC), period_s, wrong,
                 np.zeros((loops, len(phases) * COLUMNS)), np.zeros((loops, TOTALS)), np.empty((loops, periods)),
                 np.empty((loops, periods)), np.array(scenario.leads)), phases


#: what helps at the heater itself, the most fundamental first
_POWER: Final = "more heater power, better insulation or a lower setpoint"
_SWITCH: Final = "a faster switch (solid-state relay) or a slower, heavier load"
_INPUT: Final = "a finer input module or a narrower sensor range"
_SENSOR: Final = "a sensor closer to the heater (less dead time)"
HEATER_REMEDIES: Final = (_POWER, _SWITCH, _INPUT, _SENSOR)

#: kinds of phases in which the loop is held against the general limits: not those of a profile, nor while it is off
_HELD: Final = (*TO_SETPOINT, "recovery")


@dataclass(frozen=True, slots=True, kw_only=True)
class CriterionKind:
    """One criterion: all that is known of it.

    Attributes:
        name: in documents and in Python.
        unit: of value and limit.
        description: meaning, in one sentence; {band}: how far from the setpoint is right, likewise what else is filled
            in.
        measure: takes it from what was measured, in some phases (by their numbers), shape (n, phases) or (n,); None:
            no run shows it.
        phases: kinds of the phases in which it is measured, the worst counts; empty: over the whole run.
        at_rest: whether only while these are at rest.
        of: what it is a percentage of: the "rise" from ambient to the highest setpoint, the "change" of the setpoint,
            the "ramp" of a profile; empty: it is none.
        limit: the field of `LoopLimits` that limits it; empty: it has none of its own.
        fixed_limit: its limit where no field holds it.
        otherwise: what limits it where no number does: the "band" around the setpoint, or the time that each "part" of
            the test sequence lasts; empty: nothing.
        at_least: whether the value must reach the limit; otherwise it must not exceed it.
        limited_only: whether it is left out where it has no limit.
        rated_power_only: whether its limit holds at the rated power alone.
        source: what shows it: the "run", the "flags" of the PLC, its "interlock", or the "words" without a run.
        margin: of the words: the attribute of `Margins`; empty: it is no margin.
        label: what people call it; empty: its name.
        column: of a fleet's table; empty: it has none there.
        remedies: of `HEATER_REMEDIES`.
        not_in_trace: why a trace of readings does not show it.
    """

    name: str
    unit: str
    description: str
    measure: PhaseMeasure | None = None
    phases: tuple[str, ...] = ()
    at_rest: bool = False
    of: Literal["", "rise", "change", "ramp"] = ""
    limit: str = ""
    fixed_limit: float | None = None
    otherwise: Literal["", "band", "part"] = ""
    at_least: bool = False
    limited_only: bool = False
    rated_power_only: bool = False
    source: Literal["run", "flags", "interlock", "words"] = "run"
    margin: str = ""
    label: str = ""
    column: str = ""
    remedies: tuple[str, ...] = ()
    not_in_trace: str = "no such part in the trace"

    def limit_in(self, limits: LoopLimits) -> float | None:
        """Return the number that limits it; None: there is none, see `otherwise`."""
        limit: float | None = getattr(limits, self.limit) if self.limit else self.fixed_limit
        return limit

    def occurs(self, kinds: Iterable[str], resting: Iterable[str], limits: LoopLimits) -> bool:
        """Return whether a run has it.

        Args:
            kinds: of the run's phases.
            resting: kinds of those that come to rest.
            limits: that it is held against.
        """
        there = not self.phases or bool({*self.phases} & {*(resting if self.at_rest else kinds)})
        return there and not (self.limited_only and self.limit_in(limits) is None)

    def column_of(self, measured: CriterionTable, limits: LoopLimits, measure: PhaseMeasure) -> CriterionColumn:
        """Return the criterion of loops that have it, taken by its measure."""
        phases = [number for number, phase in enumerate(measured.phases)
                  if phase.kind in self.phases and (not self.at_rest or phase.rest_s < phase.end_s)]
        values, limit = measure(measured, phases), self._limit_of(measured, phases, limits)
        if self.of:
            values = values / STEPS_DEGC[self.of](measured, phases) * 100.0
        column = CriterionColumn(
            name=self.name, unit=self.unit, what=self.description.format(band=f"{measured.band_degC:.3g}"),
            values=values, limits=None if limit is None else np.full(values.shape, limit), at_least=self.at_least)
        return _worst(column) if values.ndim > 1 else column

    def _limit_of(self, measured: CriterionTable, phases: Sequence[int], limits: LoopLimits) -> float | Array | None:
        limit = self.limit_in(limits)
        if limit is not None or not self.otherwise:
            return limit
        return measured.band_degC if self.otherwise == "band" else numbers_of(measured, phases, "limit_s")

    def criterion(self, value: float, limits: LoopLimits | None = None, where: str = "", **facts: str) -> Criterion:
        """Return it with a value that no phase shows; `facts` fill in its description."""
        return Criterion(name=self.name, value=value, limit=self.limit_in(limits or LoopLimits()), unit=self.unit,
                         what=self.description.format(**facts), at_least=self.at_least, where=where)


def columns_of(measured: CriterionTable, limits: LoopLimits) -> list[CriterionColumn]:
    """Return what the loops amount to, in the order of `CRITERIA`."""
    kinds = {phase.kind for phase in measured.phases}
    resting = {phase.kind for phase in measured.phases if phase.rest_s < phase.end_s}
    return [kind.column_of(measured, limits, kind.measure) for kind in CRITERIA
            if kind.measure is not None and kind.occurs(kinds, resting, limits)]


def criteria_of_words(
    limits: LoopLimits, margins: Margins | None, step_power_pct: float | None, where: str = ""
) -> Iterator[Criterion]:
    """Return what needs no run.

    Args:
        limits: what is to be kept.
        margins: of the words on a heater; None: they are not judged.
        step_power_pct: power that one step of the reading moves at once [%]; None: it is not judged.
        where: label of the run.
    """
    for kind in (kind for kind in CRITERIA if kind.source == "words"):
        value = step_power_pct if not kind.margin else None if margins is None else float(getattr(margins, kind.margin))
        if value is not None:
            yield kind.criterion(value, limits, where)


def names_of(*measures: PhaseMeasure, phases: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the criteria that are measured so in phases of some kinds, in any unit."""
    kinds = frozenset(phases)
    return tuple(kind.name for kind in CRITERIA if kind.measure in measures and kinds & {*kind.phases})


def _worst(column: CriterionColumn) -> CriterionColumn:
    """Return of a criterion in several phases, shape (n, phases), for each loop that which uses most of its limit.

    Without limits it is the largest value; of equals the first.
    """
    values, used = column.values, column.strains
    most = np.where(used == used.max(axis=1, keepdims=True), values, -math.inf).argmax(axis=1)
    loops = np.arange(len(values))
    return replace(column, values=values[loops, most],
                   limits=None if column.limits is None else column.limits[loops, most])


def _overshoot(
    name: str, phases: tuple[str, ...], when: str, limit: str, *, measure: PhaseMeasure = beyond_degC,
    of: Literal["rise", "change", "ramp"] = "rise", column: str = "",
) -> Iterator[CriterionKind]:
    """Yield how far beyond the setpoint: in percent of a step, and in °C where that is limited."""
    step = {"rise": "the rise from ambient to the highest setpoint", "change": "that change",
            "ramp": "the step of that ramp"}[of]
    for unit, ending, what in ((f"% of {of}", "", f", of {step}"), ("°C", "_degC", "")):
        yield CriterionKind(
            name=f"{name}{ending}", unit=unit, description=f"Beyond the setpoint {when}{what}.", measure=measure,
            phases=phases, of="" if ending else of, limit=f"{limit}{ending or '_pct'}", limited_only=bool(ending),
            column="" if ending else column, remedies=(_SENSOR,))


def _time(name: str, kind: str, since: str, *, limit: str = "", column: str = "") -> CriterionKind:
    return CriterionKind(
        name=name, unit="s", description=f"{since} the temperature stays within ±{{band}} °C of the setpoint.",
        measure=settling_s, phases=(kind,), limit=limit, otherwise="part", rated_power_only=bool(limit), column=column,
        remedies=(_POWER,))


_NO_RUN: Final = "of the words, no run shows it"
_WHOLE_SEQUENCE: Final = "of the whole story that was proven"

#: all criteria, in the order of documents
CRITERIA: Final[tuple[CriterionKind, ...]] = (
    *_overshoot("overshoot", ("heat-up",), "during heat-up", "overshoot", column="overshoot_pct"),
    _time("settling_time", "heat-up", "Time after which", limit="settling_s", column="settling_time_s"),
    CriterionKind(name="steady_offset", unit="°C", description="Mean distance from the setpoint at rest.",
        measure=offset_degC, phases=_HELD, at_rest=True, otherwise="band", label="offset at rest",
        column="steady_offset_degC", remedies=(_INPUT,)),
    CriterionKind(name="limit_cycle", unit="°C",
        description="Half of the temperature's peak to peak at rest, PWM ripple included.", measure=swing_degC,
        phases=_HELD, at_rest=True, otherwise="band", label="swing at rest", column="limit_cycle_degC",
        remedies=(_SWITCH, _INPUT, _SENSOR)),
    CriterionKind(name="pwm_ripple", unit="°C",
        description="Peak to peak within one PWM period at rest after the heat-up, median.", measure=ripple_degC,
        limit="pwm_ripple_degC", label="ripple", column="pwm_ripple_degC", remedies=(_SWITCH,)),
    CriterionKind(name="iae", unit="°C·s",
        description="Integral of the absolute error over the whole run, except while heater or controller are off.",
        measure=iae_degC_s, phases=_HELD, limit="iae_degC_s", rated_power_only=True, label="integral of the error",
        column="iae_degC_s", remedies=(_SENSOR,), not_in_trace=_WHOLE_SEQUENCE),
    _time("recovery_time", "recovery", "Time after a disturbance until", limit="recovery_s", column="recovery_time_s"),
    *_overshoot("recovery_overshoot", ("recovery",), "after a disturbance, on the other side", "recovery_overshoot",
        measure=behind_degC, column="recovery_overshoot_pct"),
    CriterionKind(name="deviation", unit="°C",
        description="Largest distance from the setpoint after a disturbance, on its side.", measure=beyond_degC,
        phases=("recovery",), limit="deviation_degC", label="deviation under load", column="deviation_degC",
        remedies=(_SENSOR,)),
    *_overshoot("reheat_overshoot", ("reheat",), "after the heater's circuit was open", "reheat_overshoot"),
    _time("reheat_time", "reheat", "Time after the heater's circuit is closed again after which"),
    *_overshoot("change_overshoot", ("change",), "after a change of the setpoint", "overshoot"),
    _time("change_time", "change", "Time after it after which"),
    *_overshoot("small_change_overshoot", ("small-change",), "after a small change of the setpoint",
        "small_change_overshoot", of="change"),
    _time("small_change_time", "small-change", "Time after it after which"),
    *_overshoot("restart_overshoot", ("restart",), "after a start-up of the controller", "overshoot"),
    _time("restart_time", "restart", "Time after it after which"),
    CriterionKind(name="soak_deviation", unit="°C",
        description="Largest distance from the temperature of a soak of the profile, after what it may settle in.",
        measure=off_at_rest_degC, phases=("soak",), at_rest=True, limit="soak_band_degC", otherwise="band",
        remedies=(_SENSOR,)),
    *_overshoot("ramp_overshoot", ("ramp",), "at the end of a ramp of the profile", "overshoot",
        measure=beyond_ramp_degC, of="ramp"),
    CriterionKind(name="ramp_deviation", unit="°C",
        description="Largest distance from the setpoint on the ramps of the profile.", measure=lag_degC,
        phases=("ramp",), limit="ramp_deviation_degC", remedies=(_SENSOR,)),
    CriterionKind(name="peak", unit="°C", description="Highest temperature along the profile.", measure=highest_degC,
        phases=LED, limit="peak_degC"),
    CriterionKind(name="power_reserve", unit="% of power",
        description="Power reserve while the heater holds the highest setpoint, as a share of full power.",
        measure=reserve_pct, limit="power_reserve_pct", at_least=True, rated_power_only=True, remedies=(_POWER,)),
    CriterionKind(name="saturation", unit="% of scans", description="Share of the scans that ask for 0 or 100 % power.",
        measure=saturated_pct, limit="saturation_pct", column="saturation_pct", remedies=(_POWER,),
        not_in_trace=_WHOLE_SEQUENCE),
    CriterionKind(name="switchings", unit="1/h",
        description="How often the heater is switched on while the requested power is between its limits; for "
                    "two-level control, while the circuit is closed.",
        measure=switchings_per_h, limit="switchings_per_h", column="switchings_per_h", remedies=(_SWITCH,)),
    CriterionKind(name="overflow", unit="1",
        description="How often an error flag was set, or the requested power was not a number.", measure=fault_count,
        limit="overflows", source="flags", label="overflows", column="overflows",
        not_in_trace="a flag in the PLC: look there"),
    CriterionKind(name="interlock_trips", unit="1",
        description="1 where the interlock {interlock}, limit {limit_degC} °C, switched the heater off for good, else "
                    "0.",
        fixed_limit=0.0, source="interlock", column="interlock_trips",
        not_in_trace="the trace does not show the interlock"),
    CriterionKind(name="stability", unit="1",
        description="1 where the linear loop of the words as realised is stable, else 0.", fixed_limit=1.0,
        at_least=True, source="words", margin="stable", not_in_trace=_NO_RUN),
    CriterionKind(name="ms", unit="1", description="Maximum sensitivity of the words as realised.", limit="ms",
        source="words", margin="ms", label="Ms (robustness)", column="ms", remedies=(_SENSOR,), not_in_trace=_NO_RUN),
    CriterionKind(name="gain_margin", unit="1", description="Factor by which the heater's gain may grow.",
        limit="gain_margin", at_least=True, source="words", margin="gain_margin", column="gain_margin",
        remedies=(_SENSOR,), not_in_trace=_NO_RUN),
    CriterionKind(name="phase_margin", unit="°", description="Phase that the loop may lose.", limit="phase_margin_deg",
        at_least=True, source="words", margin="phase_margin_deg", column="phase_margin_deg", remedies=(_SENSOR,),
        not_in_trace=_NO_RUN),
    CriterionKind(name="step_power", unit="% of power",
        description="Power that one step of the reading, or its noise where that is more, moves within one scan.",
        limit="step_power_pct", source="words", label="power per sensor step", remedies=(_INPUT,),
        not_in_trace=_NO_RUN),
)

#: name → criterion
CRITERION: Final = {kind.name: kind for kind in CRITERIA}
#: kind of a phase → the criterion that tells when it is over
TIME_OF: Final = {phase: kind.name for kind in CRITERIA if kind.measure is settling_s for phase in kind.phases}

"""The proof of all zones together: their words in one closed loop, on every plausible network, under every open point.

The runs: all zones heated up together; of each zone a setpoint change, a load, an open heater circuit, the zone off and
its heater stuck at full power; a restart of the PLC; zones started one after the other, see `start_orders`. Of
decoupled zones also a sensor that breaks, whose reading the other zones then do without.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.model.findings import KINDS, Finding, remedy_of
from heatertune.plc import controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.pwm import Actuator
from heatertune.plc.words import Certificate, Words
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.heaters import MAINS_POWERS, RESERVE_PCT
from heatertune.proof.specification import GENERAL, preset, specification_of
from heatertune.proof.verdict import FitDiagnostics
from heatertune.settings import Conditions
from heatertune.units import check
from heatertune.zones.identify import FittedNetwork
from heatertune.zones.joint_loop import (
    JointCriterion,
    JointTrace,
    PeakPower,
    RunPhase,
    StartOrder,
    ZoneEvent,
    ZoneLoop,
    calm_actuator,
    name_order,
    offsets_for,
    overshoot_criteria,
    pwm_option,
    residual_error_degC,
    rest_criteria,
    run_zones,
    start_orders,
    summarize_orders,
    tightest_degC,
    zone_spread,
)
from heatertune.zones.joint_tuning import JOINT_MS, JointDesign
from heatertune.zones.network import ThermalNetwork

__all__ = [
    "HOLDING_POWERS", "SPREAD_NAME", "JointProof", "ZoneSpecification", "prove_zones",
    "specification_for",
]

_DRAWN: Final = 6
_STEP_DEGC: Final = 5.0
_DEVIATION: Final = 0.4  # of a neighbour's setpoint change
_DEVIATION_NAME: Final = "neighbour deviation [°C]"
SPREAD_NAME: Final = "spread while heating up [°C]"  # of all zones together
_LOAD_PCT: Final = 20.0
_DECAY: Final = 200.0  # the loop has settled where its slowest motion is so many times smaller
_BEYOND: Final = 1.1  # times the logged rise that a setpoint may be above the ambient
_IDLE_PCT: Final = 1.0  # power that a zone needs at least to hold its setpoint
_BREAKS: Final = "a sensor that breaks"  # run where zones are decoupled; every program puts such a zone off
_READS_WRONG: Final = "a sensor that reads wrong (its neighbours follow it)"
_NOT_TESTED: Final = ("mains that change while the zones run", "a setpoint profile")
#: criteria of the setpoints alone
HOLDING_POWERS: Final = ("power to hold the setpoints [%]", "cooling that a zone would need [%]")
_NEAR: Final = 0.85  # of the time that a zone heats up with full power
_COOLS: Final = 3.0  # time constants in which an overheated zone cools down
_STEPS: Final = ("log a step of each zone's power, one after the other, each until all temperatures are steady, with "
                 "doors and fans unchanged")
#: finding → its remedy for zones, where that of one heater is another
_REMEDIES: Final = {
    "beyond-the-log": "log up to the setpoint, or choose setpoints that the log covers (--zone-setpoints)",
    **dict.fromkeys(("poor-fit", "unexplained-by-power", "contradicted"), _STEPS)}
#: limits of a specification that runs of zones judge
_JUDGED: Final = ("tolerance", "overshoot", "reheat-overshoot", "small-change-overshoot", "recovery-overshoot",
                  "load-deviation", "ms")


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneSpecification:
    """What the zones must keep.

    Attributes:
        setpoints_degC: of the zones [°C].
        step_degC: change of one zone's setpoint [°C].
        deviation_degC: by which a neighbour may leave its setpoint meanwhile; None: 40 % of the change, at least the
            tolerance [°C].
        limits: of each loop, see `heatertune.proof.criteria.LoopLimits`.
        rated_kw: full power of each zone's heater [kW]; empty: not stated.
        peak_kw: most power of all heaters at once, None: no limit [kW].
        staggered: whether the PWM periods begin one after the other, so that few heaters are on at once.
        spread_degC: by how much the difference between two zones may exceed that between their setpoints while all heat
            up together; None: no limit [°C].
        decouple: whether the zones' programs are to add power for their neighbours' temperatures, where that helps.
    """

    setpoints_degC: tuple[float, ...]
    step_degC: float = _STEP_DEGC
    deviation_degC: float | None = None
    limits: LoopLimits
    rated_kw: tuple[float, ...] = ()
    peak_kw: float | None = None
    staggered: bool = False
    spread_degC: float | None = None
    decouple: bool = False

    def __post_init__(self) -> None:
        check("step_degC", self.step_degC, above=0.0)
        for name in ("deviation_degC", "peak_kw", "spread_degC"):
            if (limit := getattr(self, name)) is not None:
                check(name, limit, above=0.0)
        for number, rated in enumerate(self.rated_kw):
            check(f"rated_kw[{number}]", rated, above=0.0)
        if self.rated_kw and len(self.rated_kw) != len(self.setpoints_degC):
            raise InputError(f"{len(self.rated_kw)} rated powers for {len(self.setpoints_degC)} zones")
        if self.peak_kw is not None and not self.rated_kw:
            raise InputError("a limit of the peak power needs the rated power of each zone")

    def deviation_limit_degC(self, change_degC: float) -> float:
        """Return how far a neighbour may be from its setpoint during a change [°C]."""
        if self.deviation_degC is not None:
            return self.deviation_degC
        return max(_DEVIATION * change_degC, self.limits.tolerance_degC)

    def most_kw(self, heaters: int) -> float | None:
        """Return the power of so many heaters, the largest of all; None where the rated power is not stated [kW]."""
        return sum(sorted(self.rated_kw, reverse=True)[:heaters]) if self.rated_kw else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointProof:
    """The proof of the words of all zones.

    Attributes:
        design: that was proven.
        fitted: the network and its intervals.
        specification: what the zones must keep.
        actuator: of each zone.
        offsets_s: begin of each zone's PWM period after the first [s].
        criteria: the worst of each kind over all runs.
        runs: label of each run.
        findings: that leave the words unproven unless they are accepted.
        accepted: names of accepted findings.
        not_tested: what no run shows, a few words each.
        peak_heaters, peak_kw: most heaters on at once while the setpoints are held, and their power [kW].
        heating_up_heaters: likewise in the whole run, heat-up, faults and restart included.
        heaters_bound: ⌈Σ duty⌉ on the best fit: as many must be on at once at times.
        spread: largest one while all zones heat up together, see `ZoneSpecification`; None: no run came so far.
        bound_share: share of the PWM periods, while the setpoints are held, in which no more than ⌈Σ duty⌉ of the run's
            network are on at once.
        trace: the first run, on the best fit.
        settle_s: time after which all zones are at rest, after a setpoint change or load [s].
        heat_s: likewise, after a heat-up or restart [s].
        switches: open point → setting that the user knows.
        conditions: of the proof.
        remarks: what the design says of its own choices, lines of the summary.
    """

    design: JointDesign
    fitted: FittedNetwork
    specification: ZoneSpecification
    actuator: Actuator
    offsets_s: tuple[float, ...]
    criteria: tuple[JointCriterion, ...]
    runs: tuple[str, ...]
    findings: tuple[Finding, ...]
    accepted: tuple[str, ...]
    not_tested: tuple[str, ...]
    peak_heaters: int
    peak_kw: float | None
    heating_up_heaters: int
    heaters_bound: int
    bound_share: float
    spread: JointCriterion | None
    trace: JointTrace
    settle_s: float = math.inf
    heat_s: float = math.inf
    switches: Mapping[str, str] = field(default_factory=dict)
    conditions: Conditions = field(default_factory=Conditions)
    remarks: tuple[str, ...] = ()

    @property
    def words(self) -> tuple[Words, ...]:
        """The controller parameters of each zone."""
        return self.design.words

    @property
    def blocking(self) -> tuple[Finding, ...]:
        """Findings that leave the words unproven."""
        return tuple(each for each in self.findings
                     if each.kind.effect == "blocks" and each.name not in self.accepted)

    @property
    def verdict(self) -> str:
        """PASS, FAIL or NOT PROVEN."""
        if not all(criterion.ok for criterion in self.criteria):
            return "FAIL"
        return "NOT PROVEN" if self.blocking else "PASS"

    @property
    def neighbour_deviation_degC(self) -> float:
        """Largest distance of a zone from its setpoint while another one's setpoint changes [°C]."""
        return max((each.value for each in self.criteria if each.name == _DEVIATION_NAME), default=0.0)

    def summary(self) -> str:
        """Return the verdict and what it rests on, a line each."""
        zones = self.fitted.network.zones
        lines = [f"{self.verdict}: {len(zones)} zones together at "
                 f"{', '.join(f'{each:g}' for each in self.specification.setpoints_degC)} °C in {len(self.runs)} runs"]
        broken = sorted((each for each in self.criteria if not each.ok), key=lambda criterion: criterion.cause >= 0)
        lines += [f"not kept: {each.name} {each.value:.4g}, limit {each.limit:.4g} ({each.where})" for each in broken]
        options = _allowing(broken, pwm_option(self.conditions, self.words[0], self.actuator))
        blocking = ", ".join(each.name for each in self.blocking)
        lines += [f"to allow {'it' if len(broken) == 1 else 'them'}: {options}"
                  f"{blocking and f'; NOT PROVEN until {blocking} is remedied, too'}"] if options else []
        for finding in self.blocking:
            remedy = _REMEDIES.get(finding.name) or remedy_of(finding.name, [])
            lines.append(f"not proven ({finding.name}): {finding.message}; {remedy}, or --accept {finding.name}")
        lines += summarize_orders(zones, self.runs)
        lines += [*(f"accepted: {KINDS[name].short}" for name in self.accepted), *dict.fromkeys(
            f"assumed: {each.kind.short}" for each in self.findings if each.kind.is_assumption)]
        lines += [f"not tested: {', '.join(self.not_tested)}"] if self.not_tested else []
        lines += [f"{each.name}: {each.value:.4g} of {each.limit:.4g} ({each.where})"
                  for each in self.criteria if each.ok]
        kw_of = self.specification.most_kw
        at_rest, heating = (f"{count}" if kw_of(count) is None else f"{count}, {kw_of(count):.4g} kW" for count in (
            self.peak_heaters, self.heating_up_heaters))
        lines.append(f"heaters on at once while the setpoints are held: at most {at_rest}; the best fit needs "
                     f"{self.heaters_bound}; in {100.0 * self.bound_share:.4g} % of the PWM periods no more than the "
                     f"duties of the run need; heating up, and after faults: up to {heating}")
        most_kw, limit_kw = kw_of(self.heating_up_heaters), self.specification.peak_kw
        if most_kw is not None and limit_kw is not None and most_kw > limit_kw:
            lines.append(f"not limited to {limit_kw:.4g} kW: heating up, faults and restarts; fuses and supply have to "
                         f"bear {most_kw:.4g} kW")
        return "\n".join([*lines, *self._group_start(), *self.remarks])

    def _group_start(self) -> Iterator[str]:
        """Yield how far the zones are apart while they heat up together, and what they need to be so."""
        if self.spread is None:
            return
        limit = "" if self.spread.limit == math.inf else f", limit {self.spread.limit:.4g} °C"
        yield (f"spread of the zones while all heat up together: {self.spread.value:.4g} °C beyond the difference of "
               f"their setpoints{limit} ({self.spread.where})")
        if self.words[0].ramp is not None:
            rate = controller_for(self.words[0].target).ramp_degC_per_min(self.words[0])
            together = "" if self.specification.spread_degC is None else ": start all zones at the same time"
            yield f"setpoint ramp of all zones: {rate:.3g} °C/min, contained in the program of each{together}"

    def brief(self) -> str:
        """Return the summary without the criteria that are kept."""
        prefixes = tuple(f"{each.name}: " for each in self.criteria if each.ok)
        return "\n".join(line for line in self.summary().splitlines() if not line.startswith(prefixes))

    def certificate(self) -> Certificate:
        """Return what each export says about this proof."""
        lines = (f"proven together with the other zones: {', '.join(self.fitted.network.zones)}",
                 *self.brief().splitlines()[1:])
        return Certificate(verdict=self.verdict, lines=lines, forced=self.verdict != "PASS", actuator=self.actuator,
                           switches=self.switches)


#: criterion → the option that allows what it measured, and its unit
_OPTIONS: Final = {
    _DEVIATION_NAME: ("--neighbour-deviation ", ""),
    SPREAD_NAME: ("--spread ", ""),
    **dict.fromkeys(("offset at rest [°C]", "swing at rest [°C]", "error at rest [°C]",
                     "error that no increment corrects [°C]"), ("--tolerance ", "")),
    "overshoot [%]": ("--limit overshoot=", "%"),
    "overshoot after a fault [%]": ("--limit reheat-overshoot=", "%"),
    "overshoot after a load [%]": ("--limit recovery-overshoot=", "%")}


def _allowing(broken: Sequence[JointCriterion], pwm: str) -> str:
    """Return the options that allow what all broken criteria measured; "" where one of them has no option.

    A PWM period that is not stated follows the tolerance: `pwm` is the option that keeps it.
    """
    others = [each for each in broken if each.name != SPREAD_NAME]
    if not broken or any(each.name not in _OPTIONS for each in broken):
        return ""
    if others and others != [*broken]:
        return f"{_allowing(others, pwm)}; the spread is then proven again, with setpoint ramps if needed"
    most, units = dict[str, float](), dict(_OPTIONS.values())
    for each in broken:
        option, _ = _OPTIONS[each.name]
        most[option] = max(most.get(option, 0.0), math.ceil(10.0 * each.value + 1e-6) / 10.0)
    named = " ".join(f"{option}{value:g}{units[option]}" for option, value in most.items())
    return f"{named}{pwm if '--tolerance ' in most else ''}"


def _limits_not_judged(conditions: Conditions) -> list[str]:
    """Return what a specification limits beyond the general one and no run of zones judges, a few words each."""
    limits, general = specification_of(conditions).limits, preset(GENERAL).limits
    return [f"the limit {name}" for name in sorted(limits) if name not in _JUDGED and limits[name] != general.get(name)]


def specification_for(
    fitted: FittedNetwork, setpoints_degC: float | Sequence[float] | None, conditions: Conditions
) -> ZoneSpecification:
    """Return the specification of conditions at setpoints.

    Args:
        fitted: the network.
        setpoints_degC: one for all zones, or one for each; None: those of the log [°C].
        conditions: of the proof.

    Raises:
        InputError: no setpoint is known, or their number is not that of the zones.
        OutOfRange, UnknownName: as in `specification_of`.
    """
    count = len(fitted.network.zones)
    if setpoints_degC is None:
        if fitted.setpoints_degC is None:
            raise InputError("no setpoint is known: the log has none for every zone; state it (--setpoint)")
        setpoints_degC = fitted.setpoints_degC
    values = [setpoints_degC] * count if isinstance(setpoints_degC, int | float) else list(setpoints_degC)
    if len(values) != count:
        raise InputError(f"{len(values)} setpoints for {count} zones: state one for all, or one for each")
    slowest = max(map(sum, zip(fitted.network.time_constants_s, fitted.network.dead_times_s, strict=True)))
    return ZoneSpecification(setpoints_degC=tuple(map(float, values)),
                             limits=specification_of(conditions).limits_for(slowest))


def prove_zones(
    design: JointDesign, fitted: FittedNetwork, specification: ZoneSpecification, conditions: Conditions | None = None,
    *, up_to_failure: bool = False, first: str = "",
) -> JointProof:
    """Run the words of all zones together, see this module.

    Args:
        design: with the words.
        fitted: the network and its intervals.
        specification: what the zones must keep.
        conditions: PWM, accepted findings and known open points; None: the defaults.
        up_to_failure: end with the first run that breaks a limit.
        first: label of a run that is tried before all others, as it breaks a limit of a similar design; "": none.

    Raises:
        InputError, OutOfRange, UnknownName: as `heatertune.zones.joint_loop.run_zones` and `actuator_for`.
    """
    assumptions = conditions or Conditions()
    FitDiagnostics(accepted=assumptions.accept)  # refuses a name that blocks nothing
    for name, setpoint in zip(fitted.network.zones, specification.setpoints_degC, strict=True):
        low, high = design.words[0].scaling.sensor_degC
        if not low < setpoint < high:
            rule = f"> {low:g} and < {high:g}, the sensor's range (--range)"
            raise OutOfRange(f"setpoint of zone {name}", setpoint, rule)
    networks = fitted.draw(_DRAWN)
    power = [network.holding_pct(specification.setpoints_degC) for _, network in networks]
    actuator = calm_actuator(
        assumptions, design.words[0], networks[0][1], specification.setpoints_degC, specification.limits.tolerance_degC)
    staggered = specification.staggered or specification.peak_kw is not None
    likely = [power[0], *(power[0] * share for share in (0.9, 1.05, 1.1, 1.0 / MAINS_POWERS[0], 1.0 / MAINS_POWERS[1]))]
    offsets = (0.0,) * len(power[0])
    if staggered:
        offsets = offsets_for(np.array([*likely, *power[1:]]), actuator.pwm_period_s, actuator.resolution_s)
    prover = _Prover(design, fitted, specification, ZoneLoop(
        words=design.words, actuator=actuator, offsets_s=offsets, decoupling=design.decoupling))
    criteria, traces, runs = prover.static([network for _, network in networks], power), list[JointTrace](), list[str]()
    criteria += prover.residual_errors(prover.settings(assumptions.switches))
    unrun = len(criteria)
    planned = list(prover.runs(networks, assumptions.switches))
    for label, run in [*(pair for pair in planned[1:] if up_to_failure and pair[0] == first), *planned]:
        if runs == [first]:  # it breaks nothing: as if it had not run
            prover.peak, criteria, traces, runs = PeakPower(), criteria[:unrun], [], []
        result, judged = run()
        criteria += [replace(each, where=f"{each.where}, {label}") for each in judged]
        runs.append(label)
        traces = traces or [result]
        if up_to_failure and not all(each.ok for each in criteria):
            break
    peak = prover.peak
    spread = max((each for each in criteria if each.name == SPREAD_NAME), key=lambda criterion: criterion.value,
                 default=None)
    limited = (each for each in criteria if each.limit < math.inf)
    worst = list({each.name: each for each in sorted(limited, key=lambda criterion: criterion.share)}.values())
    peak_kw = specification.most_kw(peak.most)
    if specification.peak_kw is not None and peak_kw is not None:
        worst.append(JointCriterion(
            name="peak power [kW]", value=peak_kw, limit=specification.peak_kw,
            where=f"{peak.most} heaters at once while the setpoints are held; --peak-power "
                  f"{math.ceil(1000.0 * peak_kw - 1e-6) / 1000.0:g} allows them"))
    return JointProof(
        design=design, fitted=fitted, specification=specification, actuator=actuator, offsets_s=offsets,
        criteria=tuple(worst), runs=tuple(runs), findings=(*fitted.findings, *_beyond_log(fitted, specification)),
        accepted=tuple(assumptions.accept),
        not_tested=(*dict.fromkeys(prover.not_tested), *_limits_not_judged(assumptions),
                    _READS_WRONG if design.decoupling else _BREAKS, *_NOT_TESTED),
        peak_heaters=peak.most, peak_kw=peak_kw, heating_up_heaters=peak.ever, heaters_bound=peak.bound,
        bound_share=peak.share, spread=spread, trace=traces[0],
        settle_s=prover.settle_s, heat_s=max(prover.heat_s, 2.0 * prover.settle_s),
        switches=dict(assumptions.switches), conditions=assumptions)


def _beyond_log(fitted: FittedNetwork, specification: ZoneSpecification) -> Iterator[Finding]:
    if fitted.highest_degC is None:
        return
    for zone, name in enumerate(fitted.network.zones):
        ambient, high = fitted.network.ambients_degC[zone], fitted.highest_degC[zone]
        if specification.setpoints_degC[zone] > ambient + _BEYOND * (high - ambient):
            yield Finding(name="beyond-the-log", message=(
                f"the setpoint of zone {name}, {specification.setpoints_degC[zone]:g} °C, lies beyond its log, which "
                f"goes up to {high:.4g} °C"))
            return


class _Prover:
    """The runs of one design and their criteria."""

    def __init__(self, design: JointDesign, fitted: FittedNetwork, specification: ZoneSpecification,
                 loop: ZoneLoop) -> None:
        self.design, self.fitted, self.specification, self.loop = design, fitted, specification, loop
        self.zones, self.count = fitted.network.zones, len(fitted.network.zones)
        self.setpoints = np.array(specification.setpoints_degC)
        self.not_tested: list[str] = []
        self._residual_errors: dict[tuple[tuple[str, str], ...], Array] = {}
        self.peak = PeakPower()
        tight = max(max(network.dead_times_s) for _, network in fitted.draw(0))
        words = design.words[0]
        self.ramp_s_per_degC = 60.0 / controller_for(words.target).ramp_degC_per_min(words)  # 0 without a ramp
        radius = min(max(design.radius, 1e-3), 1.0 - 1e-6)
        settle = -math.log(_DECAY) / math.log(radius) * loop.sample_time_s + 2.0 * tight
        on_ramp_s = self.ramp_s_per_degC * specification.step_degC
        self.settle_s = max(settle, 6.0 * tight, 20.0 * loop.sample_time_s) + on_ramp_s
        integral = max(each.integral_time_s for each in design.designs)
        self.open_s = 2.0 * integral
        self.heat_s = 0.0  # the longest heat-up of a run

    def settings(self, stated: Mapping[str, str]) -> list[dict[str, str]]:
        """Return the settings of the open points that are proven, where some are known."""
        return settings_to_prove(controller_for(self.design.words[0].target).switches, stated)

    def residual_errors(self, settings: Sequence[Mapping[str, str]]) -> list[JointCriterion]:
        """Return which error of a zone no increment of its controller corrects, the largest of each setting."""
        criteria = []
        for setting in settings:
            errors = self._residual_error_degC(setting)
            zone = int(np.argmax(errors))
            if errors[zone] > 0.0:
                name = ", ".join(f"{name} = {value}" for name, value in setting.items()
                                 if value != settings[0][name]) or "every setting"
                criteria.append(JointCriterion(
                    name="error that no increment corrects [°C]", value=float(errors[zone]),
                    limit=self.specification.limits.tolerance_degC, where=f"zone {self.zones[zone]}, {name}"))
        return criteria

    def _residual_error_degC(self, setting: Mapping[str, str]) -> Array:
        """Return the largest error of each zone that its controller never corrects, shape (n,) [°C]."""
        key = tuple(setting.items())
        if key not in self._residual_errors:
            self._residual_errors[key] = np.array([residual_error_degC(words, setting) for words in self.design.words])
        return self._residual_errors[key]

    def static(self, networks: Sequence[ThermalNetwork], powers_pct: Sequence[Array]) -> list[JointCriterion]:
        """Return the criteria that need no run: margins, and the power that holds the setpoints of each network."""
        design, where = self.design, "all plausible networks"
        most, least = max(map(np.max, powers_pct)), min(map(np.min, powers_pct))
        place = where
        if most > 100.0 - RESERVE_PCT:
            zone = self.zones[int(np.argmax(max(powers_pct, key=np.max)))]
            wide = float(np.max(powers_pct[0])) <= 100.0 - RESERVE_PCT  # the best fit can hold them
            place += f", zone {zone}: lower its setpoint{', or log longer steps of its power' if wide else ''}"
        criteria = [
            JointCriterion(name="largest singular value of S", value=design.joint_ms, limit=JOINT_MS, where=where),
            JointCriterion(name="Ms of a zone alone", value=design.alone_ms, where=where,
                           limit=min(JOINT_MS, self.specification.limits.ms or JOINT_MS)),
            JointCriterion(name=HOLDING_POWERS[0], value=float(most), limit=100.0 - RESERVE_PCT, where=place)]
        if least < 0.0:
            cold = int(np.argmin(min(powers_pct, key=np.min)))
            rise = max(map(lambda network, power: (_IDLE_PCT - power[cold]) * network.neighbours_held(
                cold).gain_degC_per_pct, networks, powers_pct))
            criteria.append(JointCriterion(name=HOLDING_POWERS[1], value=-float(least), limit=0.0, where=(
                f"zone {self.zones[cold]}: its neighbours heat it beyond its setpoint; raise it to "
                f"{math.ceil(self.setpoints[cold] + rise)} °C, or lower theirs")))
        return criteria

    def runs(self, networks: Sequence[tuple[str, ThermalNetwork]], stated: Mapping[str, str]) -> Iterator[
            tuple[str, partial[tuple[JointTrace, list[JointCriterion]]]]]:
        """Yield label and run, the whole sequence on the best fit first."""
        settings, orders, every = self.settings(stated), start_orders(self.count), list(range(self.count))
        nominal = networks[0][1]
        yield networks[0][0], partial(self._in_use, nominal, settings[0], every, whole=True)
        for number, (label, network) in enumerate(networks[1:]):
            yield label, partial(self._in_use, network, settings[0], [number % self.count])
            order = orders[number % len(orders)]
            yield name_order(order, self.zones, label), partial(self._in_turn, network, settings[0], order)
        yield from self._mains_runs(nominal, settings[0], orders)
        for number, setting in enumerate(settings[1:]):
            label = ", ".join(f"{name} = {value}" for name, value in setting.items() if value != settings[0][name])
            yield label, partial(self._in_use, nominal, setting, every)
            order = orders[number % len(orders)]
            yield name_order(order, self.zones, label), partial(self._in_turn, nominal, setting, order)
        yield from self._starts(nominal, settings[0], orders)

    def _starts(
        self, network: ThermalNetwork, setting: Mapping[str, str], orders: Sequence[StartOrder], label: str = ""
    ) -> Iterator[tuple[str, partial[tuple[JointTrace, list[JointCriterion]]]]]:
        """Yield label and run of zones started in each order, and in the first ones in quick succession."""
        for order in orders:
            yield name_order(order, self.zones, label), partial(self._in_turn, network, setting, order)
        for order in orders[:self.count]:
            name = ", ".join(["in quick succession", *filter(None, [label])])
            yield name_order(order, self.zones, name), partial(self._in_turn, network, setting, order, quick=True)

    def _mains_runs(
        self, nominal: ThermalNetwork, setting: Mapping[str, str], orders: Sequence[StartOrder]
    ) -> Iterator[tuple[str, partial[tuple[JointTrace, list[JointCriterion]]]]]:
        """Yield label and run of zones on weak and strong mains, all together and started in each order."""
        for power in MAINS_POWERS:
            label = f"mains power {100.0 * power:.0f} %"
            scaled = replace(nominal, gains_degC_per_pct=tuple(power * gain for gain in nominal.gains_degC_per_pct))
            if float(np.max(scaled.holding_pct(self.setpoints))) <= 100.0 - RESERVE_PCT:
                yield label, partial(self._in_use, scaled, setting, [0])
                yield from self._starts(scaled, setting, orders, label)
            else:
                self.not_tested.append(f"{label} (it cannot hold the setpoints)")

    def _heat_up_s(self, network: ThermalNetwork) -> float:
        share = min(float(np.max(network.holding_pct(self.setpoints))) / 100.0, 0.95)
        alone = max(network.time_constants_s) + sum(network.second_time_constants_s)
        rise_degC = max(float(np.max(self.setpoints - np.array(network.ambients_degC))), 0.0)
        return (-alone * math.log(1.0 - max(share, 0.1)) + max(network.dead_times_s) + self.settle_s
                + self.ramp_s_per_degC * rise_degC)

    def _change_degC(self, network: ThermalNetwork, zone: int) -> float:
        """Return the largest setpoint change of a zone that all zones can hold, up to the one asked for [°C]."""
        moved = np.zeros(self.count)
        moved[zone] = 1.0
        base = network.holding_pct(self.setpoints)
        slope = network.holding_pct(self.setpoints + moved) - base
        _, high = self.loop.words[0].scaling.sensor_degC
        room = [self.specification.step_degC, 0.95 * (high - self.setpoints[zone])]
        room += [(base[i] - _IDLE_PCT) / -slope[i] for i in range(self.count) if slope[i] < 0.0]
        room += [(100.0 - RESERVE_PCT - base[i]) / slope[i] for i in range(self.count) if slope[i] > 0.0]
        return float(min(room))

    def _in_use(self, network: ThermalNetwork, switches: Mapping[str, str], zones: Sequence[int], *,
                whole: bool = False) -> tuple[JointTrace, list[JointCriterion]]:
        """Run the sequence of use: heat-up, then for some zones what may happen to each."""
        heat_s, wait = self._heat_up_s(network), self.settle_s
        self.heat_s = max(self.heat_s, heat_s)
        events = [event for zone in range(self.count) for event in (
            ZoneEvent(0.0, "setpoint", zone, float(self.setpoints[zone])), ZoneEvent(0.0, "on", zone))]
        phases, now = [RunPhase("heat-up", -1, 0.0, heat_s)], heat_s
        for zone in zones:
            change, setpoint = self._change_degC(network, zone), float(self.setpoints[zone])
            if change >= 0.2 * self.specification.step_degC:
                events += [ZoneEvent(now, "setpoint", zone, setpoint + change),
                           ZoneEvent(now + wait, "setpoint", zone, setpoint)]
                phases += [RunPhase("setpoint change", zone, now, now + wait, change),
                           RunPhase("setpoint back", zone, now + wait, now + 2.0 * wait, change)]
                now += 2.0 * wait
            else:
                name = self.zones[zone]
                self.not_tested.append(f"a higher setpoint of zone {name} alone (its neighbours could not hold theirs)")
            load = min(_LOAD_PCT, 100.0 - RESERVE_PCT - float(network.holding_pct(self.setpoints)[zone]))
            if load > _IDLE_PCT:
                events += [ZoneEvent(now, "load", zone, load), ZoneEvent(now + wait, "load", zone, 0.0)]
                phases += [RunPhase("load", zone, now, now + wait),
                           RunPhase("load gone", zone, now + wait, now + 2.0 * wait)]
                now += 2.0 * wait
            now = self._faults(network, zone, now, events, phases, whole=whole)
        events.append(ZoneEvent(now, "restart", 0))
        phases.append(RunPhase("restart", -1, now, now + 2.0 * wait))
        trace = run_zones(self.loop, network, events, now + 2.0 * wait, switches=switches)
        steady_phases = [phase for phase in phases if phase.kind in ("load gone", "setpoint back", "restart")]
        duties = np.clip(network.holding_pct(self.setpoints), 0.0, 100.0)
        self.peak.count(trace, steady_phases, self.loop.period_s, math.ceil(float(duties.sum()) / 100.0 - 1e-9))
        return trace, self._judged(trace, network, phases, self._residual_error_degC(switches))

    def _faults(self, network: ThermalNetwork, zone: int, now: float, events: list[ZoneEvent],
                phases: list[RunPhase], *, whole: bool) -> float:
        """Add the open circuit of a zone, and in the whole sequence the zone off and stuck; return the end [s]."""
        wait = self.settle_s
        cools = _COOLS * max(network.time_constants_s)  # a zone that is off, and then disturbs its neighbours no more
        faults = [("open", "closed", self.open_s), ("off", "on", wait + cools), ("stuck", "closed", self.open_s)]
        faults += [("broken", "on", wait + cools)] if self.loop.decoupling else []
        for kind, ends, lasts in faults:
            if kind != "open" and not whole:
                continue
            others = tuple(other for other in range(self.count) if other != zone)
            holdable = kind in ("off", "broken") and self._can_hold(network, others)
            events += [ZoneEvent(now, kind, zone), ZoneEvent(now + lasts, ends, zone)]
            if holdable:
                phases.append(RunPhase(f"others with the zone {kind}", zone, now, now + lasts, idle=(zone,)))
            again = 1.5 * wait + {"open": 0.0, "stuck": cools}.get(kind, self._heat_up_s(network) - wait)
            phases.append(RunPhase(f"after the zone was {kind}", zone, now + lasts, now + lasts + again))
            now += lasts + again
        return now

    def _in_turn(self, network: ThermalNetwork, switches: Mapping[str, str], order: StartOrder, *,
                 quick: bool = False) -> tuple[JointTrace, list[JointCriterion]]:
        """Start groups of zones one after the other, when those before have settled, or soon (`quick`)."""
        events, phases, zones_on, now = list[ZoneEvent](), list[RunPhase](), tuple[int, ...](), 0.0
        for group in order:
            zones_on = *zones_on, *group
            lasts, rests = self._stage(network, zones_on, quick=quick and group != order[-1])
            events += [event for zone in group for event in (
                ZoneEvent(now, "setpoint", zone, float(self.setpoints[zone])), ZoneEvent(now, "on", zone))]
            phases.append(RunPhase(
                "start", group[0] if len(group) == 1 else -1, now, now + lasts, started=group, rests=rests,
                idle=tuple(zone for zone in range(self.count) if zone not in zones_on)))
            now += lasts
        phases.append(RunPhase("all started", -1, now, now + self.settle_s))
        trace = run_zones(self.loop, network, events, now + self.settle_s, switches=switches)
        return trace, self._judged(trace, network, phases, self._residual_error_degC(switches))

    def _stage(self, network: ThermalNetwork, begun: Sequence[int], *, quick: bool) -> tuple[float, bool]:
        """Return how long zones run before others start [s], and whether they rest then or only near their setpoints.

        Others push a zone the most that nears its setpoint, or that full power does not bring there.
        """
        if quick:
            near = [max(_NEAR * network.rise_time_s(zone, self.setpoints[zone], 100.0 - RESERVE_PCT),
                        self.ramp_s_per_degC * (self.setpoints[zone] - network.ambients_degC[zone])) for zone in begun]
            return max(near), False
        slow_s = _COOLS * max(network.time_constants_s) if len(begun) < self.count else 0.0  # zones that are off
        return self._heat_up_s(network) + slow_s, self._can_hold(network, begun)

    def _can_hold(self, network: ThermalNetwork, zones: Sequence[int]) -> bool:
        """Return whether some zones hold their setpoints while the others get no power."""
        chosen = list(zones)
        rise = np.column_stack([network.steady_degC(row) - network.steady_degC([0.0] * self.count)
                                for row in np.eye(self.count)])
        demand_degC = self.setpoints - network.steady_degC([0.0] * self.count)
        heat = np.zeros(self.count)
        heat[chosen] = np.linalg.solve(rise[np.ix_(chosen, chosen)], demand_degC[chosen])
        power = network.demanded_pct(heat)[chosen]
        return bool(np.all(power <= 100.0 - RESERVE_PCT) and np.all(power >= _IDLE_PCT))

    def _judged(self, trace: JointTrace, network: ThermalNetwork, phases: Sequence[RunPhase],
                residual_error_degC: Array) -> list[JointCriterion]:
        criteria = [JointCriterion(name="overflows", value=float(trace.overflows), limit=0.0, where="all zones")]
        for phase in phases:
            inside = (trace.time_s >= phase.start_s) & (trace.time_s < phase.end_s)
            error, high, low = ((curve - trace.setpoints_degC)[inside] for curve in (
                trace.temperatures_degC, trace.highest_degC, trace.lowest_degC))
            if phase.kind == "heat-up":
                criteria.append(self._spread(trace.highest_degC[inside], trace.lowest_degC[inside]))
            for zone in range(self.count):
                if zone not in phase.idle:
                    criteria += self._of_zone(phase, zone, (error[:, zone], high[:, zone], low[:, zone]), network,
                                              float(residual_error_degC[zone]))
        return criteria

    def _spread(self, highest_degC: Array, lowest_degC: Array) -> JointCriterion:
        """Return the largest spread of the zones in a heat-up; without a stated limit it is measured all the same."""
        limit, (spread, warm, cold) = self.specification.spread_degC, zone_spread(
            highest_degC, lowest_degC, self.setpoints)
        return JointCriterion(name=SPREAD_NAME, value=spread, limit=math.inf if limit is None else limit,
                              where=f"zone {self.zones[warm]} beyond zone {self.zones[cold]}")

    def _of_zone(
        self, phase: RunPhase, zone: int, errors: tuple[Array, Array, Array], network: ThermalNetwork,
        residual_error_degC: float,
    ) -> Iterator[JointCriterion]:
        """Yield the criteria of a zone, of its distances at the scans and of the highest and lowest between them.

        A zone may begin a phase with any error that its controller does not correct, on either side.
        """
        limits, name = self.specification.limits, self.zones[zone]
        error, high, low = errors
        where = f"zone {name}, {phase.kind}" + ("" if phase.zone < 0 else f" ({self.zones[phase.zone]})")
        make = partial(JointCriterion, where=where, cause=zone if zone in (phase.started or (zone,)) else -1)
        yield from rest_criteria(make, errors, limits.tolerance_degC) if phase.rests else ()
        rise = max(float(self.setpoints[zone]) - network.ambients_degC[zone], 1.0)
        over = partial(overshoot_criteria, make, rise)
        if phase.kind in ("heat-up", "restart", "start"):
            if phase.started or phase.zone in (-1, zone):
                yield from over("overshoot [%]", high, (limits.overshoot_pct, limits.overshoot_degC))
        elif phase.kind.startswith("after") and "stuck" not in phase.kind and (
                zone == phase.zone or "broken" in phase.kind):
            most = limits.reheat_overshoot_pct, limits.reheat_overshoot_degC
            yield from over("overshoot after a fault [%]", high, most)
        elif phase.kind.startswith("setpoint") and zone != phase.zone:
            offset = float(np.clip(error[0], -residual_error_degC, residual_error_degC))
            yield make(name=_DEVIATION_NAME, cause=phase.zone,
                       value=float(max(high.max() - offset, offset - low.min())) + residual_error_degC,
                       limit=self.specification.deviation_limit_degC(phase.change_degC))
        elif phase.kind == "setpoint change":
            most_degC = tightest_degC(
                phase.change_degC, limits.small_change_overshoot_pct, limits.small_change_overshoot_degC)
            if most_degC is not None:
                yield make(name="overshoot of a setpoint change [°C]", value=float(high.max()),
                           limit=max(most_degC, limits.tolerance_degC))
        elif phase.kind in ("load", "load gone"):
            sides = (high, -low) if phase.kind == "load" else (-low, high)
            yield from over("overshoot after a load [%]", sides[0], (
                limits.recovery_overshoot_pct, limits.recovery_overshoot_degC))
            if limits.deviation_degC is not None and zone == phase.zone:
                yield make(name="distance after a load [°C]", value=float(sides[1].max()), limit=limits.deviation_degC)

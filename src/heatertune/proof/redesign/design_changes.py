"""Changes that a redesign tries besides the gains, chosen by the failing criterion, and sentences that describe them.

The changes are PWM period, sampling interval, setpoint ramp and output limits; the sentences state effect and cost.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Final, Literal, NamedTuple

from heatertune.model.model_values import HeaterModel
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.pwm import HALF_WAVE_S, in_ticks
from heatertune.proof.design_request import DesignRequest, DesignResult
from heatertune.proof.heaters import RESERVE_PCT, ROOM_DEGC
from heatertune.proof.long_outage import LOADED, WINDOW, briefly, wound
from heatertune.proof.long_outage import OVERSHOOTS as OF_NIGHTS
from heatertune.proof.proof import Proof
from heatertune.proof.prove_words import default_pwm_period_s
from heatertune.proof.ripple_and_wear import holding_power_pct, ripple_at
from heatertune.proof.setpoint_ramp import OVERSHOOTS, REHEATS
from heatertune.settings import TuneSettings
from heatertune.units import written

__all__ = [
    "COARSE", "DEAR", "OF_WINDUP", "DesignChange", "Pwm", "broken", "calmest_pwm", "change_sentence", "costs",
    "default_changes", "design_changes", "gain_factors_text", "more_iae", "output_limits", "shorter_intervals",
    "unwinds", "wider_windows",
]


#: more IAE of load disturbances: then another change may be the cheaper one
DEAR: Final = 0.3
_NOTICED: Final = 0.1  # a smaller change of heat-up or switchings is not told
_NEAR: Final = 0.05  # a factor nearer to 1 is told with a digit more
_SAME: Final = 0.005  # a factor of gains nearer to 1 is not told
_NOTHING_PCT: Final = 0.05  # more IAE than this is told
#: of what is broken → how it is told, where the story itself is kept
_BRIEFLY: Final = {"reheat": "reheat overshoot after a short open circuit",
                   "restart": "restart overshoot while the heater is warm"}
_UNDER_LOAD: Final = frozenset({LOADED, WINDOW})


def gain_factors_text(first: PidDesign, design: PidDesign) -> str:
    """Return by what factors gains were changed, empty where they were not."""
    factors = [design.gain_pct_per_degC / first.gain_pct_per_degC, design.integral_time_s / first.integral_time_s]
    return " and ".join(f"{name} times {factor:.{3 if abs(factor - 1.0) < _NEAR else 2}g}"
                        for name, factor in zip(("K", "TN"), factors, strict=True) if abs(factor - 1.0) >= _SAME)


def change_sentence(first: DesignResult, result: DesignResult, what: str) -> str:
    """Return the sentence of a change that passes: what failed, what was changed, and its price."""
    price = costs(first, result)
    why = f"fails ({broken(first)})" if broken(first) else "winds up"
    return f"The requested optimum {why}; with {what} every limit is kept; {price}."


def more_iae(first: DesignResult, result: DesignResult) -> float:
    """Return how much more a load disturbance costs, as a share of what it did; 0 where that is not known."""
    before, after = first.choice.search.realised.iae_load, result.choice.search.realised.iae_load
    return 0.0 if before is None or after is None else after / before - 1.0


def costs(first: DesignResult, result: DesignResult) -> str:
    """Return what another design costs beside the first, for a reader."""
    return ", ".join(_costs(first, result))


def _costs(first: DesignResult, result: DesignResult) -> Iterator[str]:
    """Return what a change costs: load disturbances, heat-up, wear of the switch."""
    more = 100.0 * more_iae(first, result)
    yield f"the IAE of a load disturbance rises by {more:.2g} %" if more > _NOTHING_PCT else "the IAE does not change"
    for name, unit in (("settling_time", "s"), ("switchings", "1/h")):
        old, new = (next(each.value for each in closed_.proof.criteria if each.name == name)
                    for closed_ in (first, result))
        if abs(new - old) > _NOTICED * old:
            yield f"the worst {name.replace('_', ' ')} changes from {written(old, 3)} to {written(new, 3)} {unit}"


def broken(result: DesignResult) -> str:
    """Return the criteria that a design breaks, in the story or in other lengths of its parts, for a reader."""
    if _UNDER_LOAD & wound(result.proof.diagnostics):
        return "the return from an open circuit under a load"
    if names := briefly(result.proof.diagnostics):
        return ", ".join(text for part, text in _BRIEFLY.items() if any(name.startswith(part) for name in names))
    return ", ".join(result.proof.broken_criteria).replace("_", " ")


#: PWM periods that a solid-state relay takes well and a contactor does not [s]
_FAST_S: Final = 2.5
_FASTEST_S: Final = 1.0
_ROUNDED: Final = 1e-9
#: of the band, which is the limit of half a swing: ripple that leaves the rest to the loop
_RIPPLE: Final = 0.5
#: of a design that nobody asked a limit of
_LOOSER_MS: Final = 1.8
#: criteria that a windup breaks: with less power to wind up to, less has to be unwound
OF_WINDUP: Final = OVERSHOOTS.union(*OF_NIGHTS.values())
#: of the power left over at the setpoint, what a limit of the output leaves for loads and low mains voltage
_RESERVES: Final = (0.6, 0.4, 0.25)
#: what a loop breaks that falls out of a firmware's window again and again
_RETURN: Final = "reheat_time"
#: of the distance at which P alone asks for full power: a firmware's window
_WINDOWS: Final = (0.6, 0.8, 1.0, 1.4)
#: times TA
_INTERVALS: Final = (0.5, 2.0, 0.25)


#: of the band: PWM of a solid-state relay leaves the loop next to nothing
COARSE: Final = 0.8
_HOPELESS: Final = 1.07  # more than all of it
#: of burst firing, as power controllers do it: between these, with so much ripple, as a share of half the band [s]
_BURSTS_S: Final = (0.1, 1.0)
_BURST_RIPPLE: Final = 0.4
_WAVE_S: Final = 2.0 * HALF_WAVE_S


class Pwm(NamedTuple):
    """A PWM period [s], its ripple, peak to peak, and by how much one half-wave in it moves the temperature [°C]."""

    period_s: float
    ripple_degC: float
    half_wave_degC: float

    def share(self, tolerance_degC: float) -> float:
        """Return how much of a band that reaches so far from the setpoint is taken by both together."""
        return 0.5 * (self.ripple_degC + self.half_wave_degC) / tolerance_degC


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignChange:
    """Changes beside the gains; None and False: as it was.

    Attributes:
        pwm_about_s: the PWM period is a whole part of TA, the nearest to that which suits a solid-state relay [s].
        pwm_period_s: it is this [s].
        bursts_s: a power controller fires in bursts about so often, and makes up in the next one what whole waves leave
            [s].
        sample_time_s: TA [s].
        structure: of the design.
        ms: a looser limit of the optimum than asked for, within the specification.
        power_most_pct: the controller never asks for more [%].
        window_degC: a firmware hands over from full power to the PID so far from the setpoint [°C].
        has_boost: whether the program gives full power far from the setpoint.
        ramp: that leads the setpoint: "fastest", which the test sequence allows, or "slow", slower than it needs.
    """

    pwm_about_s: float | None = None
    pwm_period_s: float | None = None
    bursts_s: float | None = None
    sample_time_s: float | None = None
    structure: str | None = None
    ms: float | None = None
    power_most_pct: float | None = None
    window_degC: float | None = None
    has_boost: bool = False
    ramp: Literal["fastest", "slow"] | None = None

    def with_(self, change: DesignChange) -> DesignChange:
        """Return the changes of both; of the other where both change the same."""
        changes = {one.name: value for one in fields(change) if (value := getattr(change, one.name))}
        own = replace(self, pwm_about_s=None, pwm_period_s=None) if change.bursts_s else self
        return replace(own, **changes)

    def without_one(self) -> list[DesignChange]:
        """Return what is left where one of several changes is taken back; none where there is one change or none."""
        changes = {one.name: value for one in fields(self) if (value := getattr(self, one.name))}
        rests = ({name: value for name, value in changes.items() if name != left} for left in changes)
        return [DesignChange(**rest) for rest in rests if rest]

    def pwm_at(self, sample_time_s: float, tick_s: float | None) -> float | None:
        """Return the PWM period at an interval [s], None where it is not changed; `tick_s` as for `in_ticks`."""
        about = self.pwm_about_s
        if self.bursts_s is not None:
            return _in_whole_waves(sample_time_s, self.bursts_s)
        if about is None:
            return self.pwm_period_s
        few = max(1, math.floor(sample_time_s / about))
        parts = few + 1 if sample_time_s / few / about > about * (few + 1) / sample_time_s else few
        most = max(1, math.floor(sample_time_s / _FASTEST_S + _ROUNDED))
        whole = [n for n in range(1, most + 1) if n == 1 or in_ticks(sample_time_s / n, tick_s)]
        return sample_time_s / min(whole, key=lambda n: abs(math.log(n / parts)))

    def on(self, words: Words) -> Words:
        """Return words with what these changes do to them, gains aside; raise OutOfRange where they cannot be so."""
        controller = controller_for(words.target)
        words = words if self.window_degC is None else controller.with_window(words, self.window_degC)
        return words if self.power_most_pct is None else controller.with_output_limit(words, self.power_most_pct)

    def apply_to(self, request: DesignRequest, first: DesignResult, tick_s: float | None) -> DesignRequest:
        """Return what is asked for with these changes.

        Args:
            request: without them.
            first: the design without them.
            tick_s: as for `in_ticks`.
        """
        ta = self.sample_time_s
        tuned = replace(request.tune_settings, structure=self.structure or request.tune_settings.structure,
                        ms=self.ms or request.tune_settings.ms, sample_time_s=ta or request.tune_settings.sample_time_s)
        conditions = first.conditions if ta is None else request.conditions
        period = self.pwm_at(ta or first.ideal.sample_time_s, tick_s)
        if period is not None:
            conditions = replace(conditions, pwm_period_s=period)
        if self.bursts_s:
            conditions = replace(conditions, pwm_resolution_s=_WAVE_S, pwm_rule="burst")
        ramps = {"slow": None, "fastest": "auto", None: request.setpoint_ramp or "none"}  # a slow one is in the words
        return replace(request, tune_settings=tuned, conditions=conditions, refined=False,
                       setpoint_ramp=ramps[self.ramp])

    @property
    def only_outside(self) -> bool:
        """Whether a design that shall stay as it is can be proven with these changes."""
        inside = (self.sample_time_s, self.structure, self.ms, self.power_most_pct, self.window_degC)
        return self != DesignChange() and not any(inside)

    def summary(self, sample_time_s: float, tick_s: float | None) -> str:
        """Return the changes for a reader, TA being that [s]; empty where there are none."""
        about, period = self.pwm_about_s, self.pwm_at(sample_time_s, tick_s)
        parts = (
            self.sample_time_s and f"TA = {self.sample_time_s:g} s",
            self.structure and "a D part",
            self.ms and f"Ms <= {self.ms:g}",
            period and (f"bursts of whole mains waves every {period:.3g} s (a power controller, as a solid-state relay "
                        "usually takes 1 s or more)" if self.bursts_s else
                        f"a PWM period of {period:.3g} s{' (a solid-state relay)' if about else ''}"),
            self.power_most_pct and f"an output of at most {self.power_most_pct:.3g} %",
            self.window_degC and f"a firmware built with a window of {self.window_degC:.3g} °C",
            self.has_boost and "a boost",
            self.ramp and ("a slow setpoint ramp" if self.ramp == "slow" else "a setpoint ramp"))
        return " and ".join(part for part in parts if part)


def design_changes(
    proof: Proof, models: Sequence[HeaterModel], tuned: TuneSettings, *, period_given: bool, interval_given: bool,
    ramp_open: bool, boost_open: bool, least_interval_s: float,
) -> Iterator[DesignChange]:
    """Return what may help where a proof fails, the least change first.

    Args:
        proof: that fails.
        models: the plausible heaters.
        tuned: how the design was found.
        period_given: whether the user chose the PWM period: it stays.
        interval_given: likewise TA.
        ramp_open: whether nobody said anything about a setpoint ramp.
        boost_open: whether there may be a boost.
        least_interval_s: TA is not taken below [s].
    """
    words, broken = proof.words, {*proof.broken_criteria, *briefly(proof.diagnostics)}
    controller = controller_for(words.target)
    own = controller.timing(words).pwm_period_s is not None
    switch = _SwitchChoice(proof=proof, models=tuple(models), own=own)
    of_windup, beyond = broken <= OF_WINDUP, bool(broken & (OVERSHOOTS | REHEATS))
    limited = list(switch.limited()) if broken & OF_WINDUP else []
    boosted = [DesignChange(has_boost=True)] if boost_open and controller.has_boost and beyond else []
    ramped = [DesignChange(ramp="fastest")] if ramp_open and controller.has_ramp and beyond else []
    bursts, quick, slow = ([], [], []) if own or period_given else switch.for_criteria(
        broken, (DesignChange(), *boosted, *limited, *ramped))
    swings = bool(broken & {"limit_cycle", "pwm_ripple"}) and switch.share(proof.actuator.pwm_period_s) > 1.0
    hopeless = swings and switch.calmest.share(proof.limits.tolerance_degC) >= _HOPELESS
    quick = [] if hopeless and bursts else quick
    windup = of_windup and bool(limited)
    gains = [] if windup else [DesignChange()]
    costly = not (ramped and of_windup)
    for applies, changes in (
        (hopeless, bursts),
        (not swings, boosted),  # costs nothing but the program
        (True, (*quick, *gains, *slow) if swings else (*gains, *quick, *slow)),
        (True, wider_windows(proof)),
        (not of_windup, boosted),
        (True, limited),
        (costly and not interval_given, _intervals(switch, words, least_interval_s)),
        (costly, default_changes(proof, tuned)),
        (True, ramped),
        (windup, [DesignChange()]),  # gains mend a windup dearly: limit and ramp leave what a load costs as it is
        (of_windup, boosted),  # with what has helped by now
        (not hopeless, bursts),
    ):
        if applies:
            yield from changes


def wider_windows(proof: Proof) -> Iterator[DesignChange]:
    """Yield wider windows of a firmware whose loop falls out of its own again and again.

    At the edge the P part has to ask for what setpoint and load need: the sum begins there from zero.
    """
    controller, design = controller_for(proof.words.target), proof.design
    falls_out = WINDOW in wound(proof.diagnostics) or _RETURN in proof.broken_criteria
    if controller.window is None or design is None or not falls_out:
        return
    full_degC = controller.most_power_pct(proof.words) / abs(design.gain_pct_per_degC)
    built_degC, most_degC = proof.words.values[controller.window], proof.words.scaling.span_degC
    for window_degC in dict.fromkeys(float(round(share * full_degC)) for share in _WINDOWS):
        if built_degC < window_degC < most_degC:
            yield DesignChange(window_degC=window_degC)


def unwinds(target: str, frame: DesignChange, *, ramp_open: bool) -> bool:
    """Return whether there is a change to come after a frame that mends a windup: a limit of the output, or a ramp."""
    controller = controller_for(target)
    limited = controller.most_power is not None and frame.power_most_pct is None
    return limited or (ramp_open and controller.has_ramp and frame.ramp != "fastest")


def _in_whole_waves(sample_time_s: float, most_s: float) -> float:
    """Return the longest whole part of TA up to a time, of whole waves or half-waves where there is one [s]."""
    parts = range(max(1, math.ceil(sample_time_s / most_s - _ROUNDED)), math.floor(2.0 * sample_time_s / most_s) + 1)
    periods = [sample_time_s / part for part in parts] or [sample_time_s]
    whole = [[period for period in periods if math.isclose(period / wave, round(period / wave), rel_tol=_ROUNDED)]
             for wave in (_WAVE_S, HALF_WAVE_S)]
    return next((fitting[0] for fitting in whole if fitting), periods[0])


def calmest_pwm(proof: Proof, models: Sequence[HeaterModel]) -> Pwm | None:
    """Return the calmest PWM of a solid-state relay, None where the controller makes the PWM itself."""
    own = controller_for(proof.words.target).timing(proof.words).pwm_period_s is not None
    switch = _SwitchChoice(proof=proof, models=tuple(models), own=own)
    return None if own else switch.calmest


def output_limits(proof: Proof, models: Sequence[HeaterModel]) -> list[DesignChange]:
    """Return limits of the output, the highest first, none where the controller has none.

    Args:
        proof: of words without one.
        models: the plausible heaters.
    """
    return list(_SwitchChoice(proof=proof, models=tuple(models), own=False).limited())


def default_changes(proof: Proof, tuned: TuneSettings) -> Iterator[DesignChange]:
    """Return what was not asked for but left at its default: a less robust design, within the limits; a D part."""
    usual, most = TuneSettings(), proof.limits.ms
    if tuned.ms == usual.ms and (most is None or most > _LOOSER_MS):
        yield DesignChange(ms=_LOOSER_MS)
    if tuned.structure == usual.structure and proof.design is not None:
        yield DesignChange(structure="pid")


@dataclass(frozen=True, slots=True, kw_only=True)
class _SwitchChoice:
    proof: Proof
    models: tuple[HeaterModel, ...]
    own: bool

    def for_criteria(
        self, broken: Collection[str], with_bursts: Iterable[DesignChange]
    ) -> tuple[list[DesignChange], list[DesignChange], list[DesignChange]]:
        """Return bursts, shorter PWM periods and longer ones that may help where criteria are broken.

        Args:
            broken: names of the criteria, and of what else the proof found.
            with_bursts: what the bursts are tried together with.
        """
        of_windup = OF_WINDUP.issuperset(broken)
        coarse = self.pwm(self.proof.actuator.pwm_period_s).share(self.proof.limits.tolerance_degC) > _RIPPLE
        bursts = [] if of_windup or not coarse else [
            DesignChange(bursts_s=self.bursts_s).with_(change) for change in with_bursts]
        quick = [] if of_windup else self.quicker(self.proof.words.sample_time_s)
        return bursts, quick, self.slower() if "switchings" in broken else []

    def share(self, period_s: float) -> float:
        """Return the ripple of a PWM period as a multiple of what leaves the loop its part of the band."""
        ripple = self.pwm(period_s).ripple_degC
        limits = self.proof.limits
        least = min(2.0 * _RIPPLE * limits.tolerance_degC, limits.pwm_ripple_degC or ripple + 1.0)
        return ripple / least if least > 0.0 else float("inf")

    def quicker(self, sample_time_s: float) -> list[DesignChange]:
        """Return shorter PWM periods for a solid-state relay, none where there is none.

        Where ripple leaves the loop its part of the band, the pulses need not be short; else ripple and the step of
        power that a half-wave is are the least together.
        """
        tick = controller_for(self.proof.words.target).tick_s
        fast = default_pwm_period_s(sample_time_s, tick_s=tick, most_s=_FAST_S)
        own = self.proof.actuator.pwm_period_s
        quick = [DesignChange(pwm_about_s=about)
                 for about in (*([fast] if self.share(fast) <= 1.0 else []), self.calmest_s, _FASTEST_S)]
        periods = {frame.pwm_at(sample_time_s, tick): frame for frame in reversed(quick)}
        return [frame for period, frame in reversed(periods.items()) if period is not None and period < own]

    @property
    def calmest_s(self) -> float:
        """The PWM period at which ripple and one half-wave more or less move the temperature equally much [s].

        The ripple of a period P is about 100·k·d·(1 − d)·P/T at a share d of power, a half-wave 100·k·10 ms/P.
        """
        setpoint = self.proof.scenario.setpoint_degC
        powers = [(model, holding_power_pct(model, setpoint, ROOM_DEGC) / 100.0) for model in self.models]
        return min(_FAST_S, max(_FASTEST_S, min(
            math.sqrt(HALF_WAVE_S * model.time_constant_s / max(_ROUNDED, share * (1.0 - share)))
            for model, share in powers)))

    @property
    def calmest(self) -> Pwm:
        """The PWM of that period."""
        return self.pwm(self.calmest_s)

    @property
    def bursts_s(self) -> float:
        """How often a power controller has to fire so that the ripple leaves the loop its part of the band [s]."""
        shortest, longest = _BURSTS_S
        ripple = self.pwm(longest).ripple_degC
        return min(longest, max(shortest, _BURST_RIPPLE * self.proof.limits.tolerance_degC / ripple * longest))

    def pwm(self, period_s: float) -> Pwm:
        """Return the PWM of a period."""
        ripple = ripple_at(self.models, period_s, setpoint_degC=self.proof.scenario.setpoint_degC,
                           ambient_degC=ROOM_DEGC)
        gain = max(abs(model.gain_degC_per_pct) for model in self.models)
        return Pwm(period_s, abs(ripple), 100.0 * gain * HALF_WAVE_S / period_s)

    def limited(self) -> Iterator[DesignChange]:
        """Return limits of the output, the highest first, none where the controller has none."""
        if controller_for(self.proof.words.target).most_power is None:
            return
        setpoint = self.proof.scenario.setpoint_degC
        holding_pct = max(holding_power_pct(model, setpoint, ROOM_DEGC) for model in self.models)
        at_low_mains = holding_pct / min((1.0, *(supply.mains_power for supply in self.proof.mains)))
        holding_pct = at_low_mains if at_low_mains <= 100.0 - RESERVE_PCT else holding_pct
        for share in _RESERVES:
            yield DesignChange(power_most_pct=float(round(holding_pct + share * (100.0 - holding_pct))))

    def slower(self) -> list[DesignChange]:
        """Return a longer PWM period, which switches as often as the limit allows."""
        most, ta = self.proof.limits.switchings_per_h, self.proof.words.sample_time_s
        if not most:
            return []
        least = 3600.0 / most
        if least > ta:
            return [DesignChange(pwm_period_s=ta * -(-least // ta))]
        tick = controller_for(self.proof.words.target).tick_s
        parts = next(n for n in range(int(ta // least), 0, -1) if n == 1 or in_ticks(ta / n, tick))
        return [DesignChange(pwm_period_s=ta / parts)]


def _intervals(switch: _SwitchChoice, words: Words, least_s: float) -> Iterator[DesignChange]:
    """Yield other sampling intervals; the one that the ripple asks for first where the PWM is the controller's own.

    Such a controller scans once in a PWM period: the ripple may need an interval that is shorter than the log's.
    """
    timer, ta = controller_for(words.target).timer, words.sample_time_s
    share = switch.share(ta) if switch.own else 0.0
    factors = [*([1.0 / share] if share > 1.0 else []), *_INTERVALS]
    bounds_s = (least_s, 0.0) if switch.own else (least_s,)
    intervals = dict.fromkeys(timer.round(max(bound_s, factor * ta)) for bound_s in bounds_s for factor in factors)
    for interval in intervals:
        if interval != ta:
            yield DesignChange(sample_time_s=interval)


def shorter_intervals(words: Words) -> list[DesignChange]:
    """Return shorter sampling intervals than that of words, the longest first, without regard to the log's."""
    timer, ta = controller_for(words.target).timer, words.sample_time_s
    intervals = (timer.round(factor * ta) for factor in _INTERVALS if factor < 1.0)
    return [DesignChange(sample_time_s=interval) for interval in intervals if interval < ta]

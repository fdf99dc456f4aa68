"""Feed-forward of a measured disturbance beside plain feedback: the same words, heaters and step of the disturbance.

The disturbance steps from its calm level to the strong one just after a scan, which sees it at the next one, and back
when the loop is at rest again. It acts as power through the heater's lags; for the power itself the controller's delay
(input module, way of the output) is added to the dead time, as in every proof, for the disturbance it is not. Best
value and both ends of its effect's interval, and the earliest instant at which it may act, are run on every possible
heater; every setting that the manual leaves open is run with the best values. So is the heat-up while the disturbance
is strong, from the controller's cold state: feed-forward must not make it overshoot more than plain feedback does or
the limits allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.compiled import bound
from heatertune.compiled.plain_functions import step, warm_state
from heatertune.errors import InputError
from heatertune.model.disturbance import DisturbanceEffect
from heatertune.model.model_values import HeaterModel
from heatertune.plc.controller import Controller, controller_for
from heatertune.plc.feed_forward import FeedForward
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.pwm import Actuator
from heatertune.plc.words import Words
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.loop import LoopController, check_words, in_loop, run_loop
from heatertune.proof.scenario import Load, Scenario, conditions, delay_heater
from heatertune.proof.trace import Trace

__all__ = ["FeedForwardComparison", "FeedForwardProof", "PlainLoop", "prove_feed_forward", "restarted_fed", "step_fed"]


_HEATER_TIMES: Final = 8.0  # sums of lags and dead time until a loop is at rest, beside as many TN
_TN_TIMES: Final = 6.0
_RESERVE_PCT: Final = 5.0  # of power, at both ends, where the disturbance is strong
_LEAST_SHARE: Final = 0.1  # of the logged step: what a heater cannot make up for is no test
#: of plain feedback's error, the integral or the largest: less help is not worth a program. The integral counts the
#: ripple of a switch that the heater has anyway.
_MOST_OF_PLAIN: Final = 0.8
_WORSE: Final = 1.05  # of plain feedback: beyond, a run is worse


class FeedForwardParameters(NamedTuple):
    """A core's parameters while the disturbance is calm and strong, and the scans that see it strong: begin, end."""

    calm: Any
    strong: Any
    begin: int
    end: int


def step_fed(
    parameters: FeedForwardParameters, state: tuple[int, Any], setpoint: Any, reading: Any, cycle_start: bool
) -> tuple[tuple[int, Any], float, Any, int]:
    """Compute one scan, the program around the controller having written the disturbance; see `StepFunctions.step`.

    Args:
        parameters: what the controller takes while the disturbance is calm and strong, and the scans between.
        state: scans so far, and the controller's own state.
        setpoint: as for the controller.
        reading: likewise.
        cycle_start: likewise.
    """
    scan, inner = state
    strong = parameters.begin <= scan < parameters.end
    current = parameters.strong if strong else parameters.calm
    inner, power, output, flags = step(current, inner, setpoint, reading, cycle_start)
    return (scan + 1, inner), power, output, flags


def restarted_fed(parameters: FeedForwardParameters, cold: tuple[int, Any], state: tuple[int, Any]) -> tuple[int, Any]:
    """Return the state after a start-up, see `StepFunctions.warm_start`."""
    return state[0], warm_state(parameters.calm, cold[1], state[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForwardComparison:
    """One heater with plain feedback and with feed-forward.

    Attributes:
        label: heater, what of the effect, settings that are not the default.
        iae_degC_s: ∫|error| after both steps, or over the heat-up, plain and fed forward [°C·s].
        deviation_degC: largest |error| after them, or how far the heat-up goes beyond the setpoint, likewise, but no
            less than a step of the sensor [°C].
        allowed_degC: how far the heat-up may go beyond the setpoint [°C]; None: it is no heat-up.
    """

    label: str
    iae_degC_s: tuple[float, float]
    deviation_degC: tuple[float, float]
    allowed_degC: float | None = None

    @property
    def iae_ratio(self) -> float:
        """The integral with feed-forward, of that with plain feedback."""
        return self.iae_degC_s[1] / self.iae_degC_s[0]

    @property
    def deviation_ratio(self) -> float:
        """Likewise the deviation."""
        return self.deviation_degC[1] / self.deviation_degC[0]

    @property
    def harm(self) -> float:
        """How many times plain feedback's error it makes; of a heat-up's overshoot, what is beyond what is allowed.

        Infinite where anything is no number.
        """
        plain, fed = self.deviation_degC
        if not all(map(math.isfinite, (*self.iae_degC_s, plain, fed))):
            return math.inf
        return max(self.iae_ratio, fed / max(plain, self.allowed_degC or 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForwardProof:
    """What feed-forward does beside plain feedback.

    Attributes:
        line: what the program writes.
        word: the input.
        effect: of the disturbance.
        setpoint_degC: [°C].
        step: levels of the disturbance between which it stepped [units].
        load_pct: power that the step stands for [%].
        runs: the working heater's first.
    """

    line: FeedForward
    word: str
    effect: DisturbanceEffect
    setpoint_degC: float
    step: tuple[float, float]
    load_pct: float
    runs: tuple[FeedForwardComparison, ...]

    @property
    def worst(self) -> FeedForwardComparison:
        """The run in which feed-forward helps least, or harms most, by integral or deviation."""
        return max((run for run in self.runs if run.allowed_degC is None), key=lambda run: run.harm)

    @property
    def refusal(self) -> str:
        """Why the program is not to be used; empty: it is."""
        first, worst = self.runs[0], max(self.runs, key=lambda run: run.harm)
        left = min(first.iae_ratio, first.deviation_ratio)
        if not left <= _MOST_OF_PLAIN:
            worth = f"the step is worth {abs(self.load_pct):.2g} % of power"
            return (f"feed-forward hardly helps: {left:.0%} of plain feedback's error is left; {worth} and "
                    f"acts {self.effect.lead_s:.3g} s before what makes up for it")
        if not worst.harm <= _WORSE:
            return f"feed-forward may be worse than plain feedback: {worst.harm:.2f} times its error on {worst.label}"
        return ""

    @property
    def summary(self) -> tuple[str, ...]:
        """What it comes to, for the head of an exported file, a line each."""
        first, worst, (calm, strong) = self.runs[0], self.worst, self.step
        return (
            *([f"feed-forward not to be used: {self.refusal}"] if self.refusal else []),
            f"the disturbance from {calm:.4g} to {strong:.4g} and back at {self.setpoint_degC:g} °C (logged: up to "
            f"{self.effect.strong:.4g}, nothing is tested beyond): largest error "
            f"{first.deviation_degC[0]:.3g} °C with plain feedback, {first.deviation_degC[1]:.3g} °C fed forward",
            f"worst of {len(self.runs)} runs: {worst.iae_ratio:.2f} of plain feedback's error integral, "
            f"{worst.deviation_ratio:.2f} of its largest error ({worst.label})",
        )

    def to_document(self) -> dict[str, Any]:
        """Return the JSON document."""
        line = self.line
        return {
            "schema": "heatertune/feed-forward/1", "verdict": "FAIL" if self.refusal else "PASS",
            "refusal": self.refusal, "input": self.word, "disturbance": line.column, "range": [line.low, line.high],
            "calm": line.calm, "at_low": line.at_low, "at_high": line.at_high, "pct_per_unit": line.pct_per_unit,
            "effect_pct_per_unit": self.effect.pct_per_unit,
            "effect_pct_per_unit_ci95": list(self.effect.pct_per_unit_ci95), "setpoint_degC": self.setpoint_degC,
            "step": list(self.step), "logged": [self.effect.calm, self.effect.strong],
            "load_pct": self.load_pct, "worst": self.runs.index(self.worst),
            "runs": [{"label": run.label, "iae_degC_s": list(run.iae_degC_s),
                      "deviation_degC": list(run.deviation_degC), "allowed_degC": run.allowed_degC}
                     for run in self.runs],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainLoop:
    """The loop with plain feedback, as its words were proven.

    Attributes:
        setpoint_degC: [°C].
        actuator: the switch; None where the controller makes the PWM itself.
        limits: on the overshoot.
        noise_degC: of the sensor [°C].
        known: settings of open points that are known.
    """

    setpoint_degC: float
    actuator: Actuator | None = None
    limits: LoopLimits = field(default_factory=LoopLimits)
    noise_degC: float = 0.0
    stated_settings: Mapping[str, str] = field(default_factory=dict)


def prove_feed_forward(
    words: Words, line: FeedForward, effect: DisturbanceEffect, models: Sequence[tuple[str, HeaterModel]],
    plain: PlainLoop,
) -> FeedForwardProof:
    """Run words with plain feedback and with feed-forward on every plausible heater.

    Args:
        words: as they were proven.
        line: what the program writes.
        effect: of the disturbance.
        models: (label, heater), the first the working one; all with their ambient.
        plain: what the words were proven under.

    Raises:
        InputError: the controller has no input for it, or a heater has no power left over for the step.
        OutOfRange: as `heatertune.proof.simulate`.
    """
    controller = controller_for(words.target)
    if controller.feed is None:
        raise InputError(f"{words.target} has no input for a measured disturbance (see: heatertune targets)")
    if not models:
        raise InputError("a proof needs at least one model")
    share = _share(models, effect, plain.setpoint_degC)
    strong = effect.calm + share * (effect.strong - effect.calm)
    trial = _Trial(controller, words, line, effect, strong, plain)
    runs = tuple(trial.runs(models, settings_to_prove(controller.switches, plain.stated_settings)))
    return FeedForwardProof(
        line=line, word=controller.feed.word, effect=effect, setpoint_degC=plain.setpoint_degC,
        step=(effect.calm, strong), load_pct=effect.pct_per_unit * (strong - effect.calm), runs=runs)


def _share(models: Sequence[tuple[str, HeaterModel]], effect: DisturbanceEffect, setpoint_degC: float) -> float:
    """Return which share of the logged step leaves every heater a reserve of power."""
    share = 1.0
    loads = [end * (effect.strong - effect.calm) for end in effect.pct_per_unit_ci95]
    for label, model in models:
        ambient, _ = conditions(Scenario(setpoint_degC=setpoint_degC, duration_s=1.0), model)
        holding_pct = (setpoint_degC - ambient) / model.gain_degC_per_pct
        for load in loads:
            reserve_pct = holding_pct - _RESERVE_PCT if load > 0.0 else 100.0 - _RESERVE_PCT - holding_pct
            share = min(share, reserve_pct / abs(load))
        if share < _LEAST_SHARE:
            raise InputError(f"{label}: holding {setpoint_degC:g} °C takes {holding_pct:.3g} % of power, which leaves "
                             f"nothing to make up for the disturbance, {effect.pct_per_unit:.3g} % per unit")
    return share


class _Effect(NamedTuple):
    """One hypothesis about the disturbance: its name in labels, its effect, and how soon it acts."""

    name: str
    pct_per_unit: float
    lead_s: float


class _Trial(NamedTuple):
    """What is the same in all runs; see `prove_feed_forward`."""

    controller: Controller
    words: Words
    line: FeedForward
    effect: DisturbanceEffect
    strong: float
    plain: PlainLoop

    def runs(
        self, models: Sequence[tuple[str, HeaterModel]], settings: Sequence[Mapping[str, str]]
    ) -> Iterator[FeedForwardComparison]:
        """Return every heater under every setting, and under the default also with the other effects."""
        effect, (low, high) = self.effect, self.effect.pct_per_unit_ci95
        best = _Effect("", effect.pct_per_unit, effect.lead_s)
        others = (_Effect("effect at its low end", low, effect.lead_s),
                  _Effect("effect at its high end", high, effect.lead_s),
                  _Effect("acting at its earliest", effect.pct_per_unit, effect.lead_s_ci95[1]))
        for name, model in models:
            for chosen in settings:
                changed = [f"{key}={value}" for key, value in chosen.items() if value != settings[0][key]]
                yield self.compare(", ".join([name, *changed]), model, chosen, best)
                yield self.compare(", ".join([name, *changed, "heat-up while it is strong"]), model, chosen, best,
                                  heats_up=True)
            for other in others:
                yield self.compare(f"{name}, {other.name}", model, settings[0], other)

    def compare(
        self, label: str, model: HeaterModel, chosen: Mapping[str, str], acts: _Effect, *, heats_up: bool = False
    ) -> FeedForwardComparison:
        """Return one heater with plain feedback and with feed-forward."""
        begin, end, stops_s = self._instants(model, heats_up=heats_up)
        late = delay_heater(model, self._delay_s)
        # the disturbance does not wait for the program
        sooner = acts._replace(lead_s=acts.lead_s + self._delay_s)
        scenario = self._scenario(late, sooner, begin, end, stops_s)
        check_words(self.controller, self.words, scenario)
        setpoints = scenario.setpoints_degC
        loops = in_loop(self.controller, self.words, setpoints, chosen), self._fed(setpoints, chosen, begin, end)
        since_s = max(begin, 0) * self._scan_s
        (plain, beyond_plain), (fed, beyond_fed) = (
            _measured(run_loop(loop, late, scenario, self.plain.actuator), since_s, beyond=heats_up) for loop in loops)
        return FeedForwardComparison(label=label, iae_degC_s=(plain, fed), deviation_degC=(beyond_plain, beyond_fed),
                      allowed_degC=self._allowed_degC(model) if heats_up else None)

    @property
    def _delay_s(self) -> float:
        return self.controller.delayed_s(self.words.scaling)

    @property
    def _scan_s(self) -> float:
        return self.controller.timing(self.words).scan_s

    def _scenario(self, model: HeaterModel, acts: _Effect, begin: int, end: int, stops_s: float) -> Scenario:
        """Return the step of the disturbance just after a scan, so that the next one sees it, and back."""
        # a load of a scenario acts after the heater's dead time, and the first instant is after 0
        load, late = acts.pct_per_unit * (self.strong - self.effect.calm), 1e-3 * self._scan_s
        lead = min(acts.lead_s, model.dead_time_s)
        steps = [(max(begin * self._scan_s - lead, 0.0) + late, load), (end * self._scan_s - lead + late, -load)]
        return Scenario(
            setpoint_degC=self.plain.setpoint_degC, duration_s=stops_s, noise_degC=self.plain.noise_degC,
            disturbances=tuple(Load(time_s=time, power_pct=power) for time, power in steps if time < stops_s))

    def _fed(self, asked_degC: Sequence[float], chosen: Mapping[str, str], begin: int, end: int) -> LoopController:
        """Return the words with their input listened to, and written after each of two scans."""
        feed = self.controller.feed
        assert feed is not None
        words = replace(self.words, values=feed.listened(self.words.values))
        loop = in_loop(self.controller, words, asked_degC, chosen)
        calm, strong = (feed.set_disturbance(loop.parameters, self.line.at(level, self.controller.counts))
                        for level in (self.effect.calm, self.strong))
        fed = replace(loop.core, step=bound(step_fed, step=loop.core.step),
                      warm_start=bound(restarted_fed, warm_state=loop.core.warm_start))
        return replace(loop, core=fed, parameters=FeedForwardParameters(calm, strong, begin + 1, end + 1),
                       state=(0, loop.state))

    def _allowed_degC(self, model: HeaterModel) -> float:
        """Return how far a heat-up may go beyond the setpoint [°C]."""
        step = self.plain.setpoint_degC - (model.ambient_degC or 0.0)
        share, most = self.plain.limits.overshoot_pct, self.plain.limits.overshoot_degC
        allowed = math.inf if share is None else step * share / 100.0
        return min(allowed, math.inf if most is None else most)

    def _instants(self, model: HeaterModel, *, heats_up: bool) -> tuple[int, int, float]:
        """Return the scans after which the disturbance is strong and calm again, and the end [s]."""
        design, ambient, scan_s = self.controller.decode(self.words), model.ambient_degC or 0.0, self._scan_s
        tn = 0.0 if design is None or math.isinf(design.integral_time_s) else design.integral_time_s
        rest = _HEATER_TIMES * (sum(model.lags_s) + model.dead_time_s) + _TN_TIMES * tn + 10.0 * scan_s
        rest += 2.0 * max(0.0, -self.effect.lead_s)
        ramp = (self.plain.setpoint_degC - ambient) / self.controller.ramp_degC_per_min(self.words) * 60.0
        begin = math.ceil((rest + ramp) / scan_s)
        end = begin + math.ceil(rest / scan_s)
        return (-1, end, begin * scan_s) if heats_up else (begin, end, end * scan_s + rest)


def _measured(trace: Trace, begin_s: float, *, beyond: bool) -> tuple[float, float]:
    """Return ∫|error| from an instant to the end [°C·s], and the largest |error|, or the largest beyond [°C]."""
    times, temperature = trace.course(begin_s, float(trace.time_s[-1]))
    error = temperature - trace.scenario.setpoint_degC
    crossed = np.flatnonzero(error[1:] * error[:-1] < 0.0)
    share = error[crossed] / (error[crossed] - error[crossed + 1])
    instants = np.union1d(times, times[crossed] + share * (times[crossed + 1] - times[crossed]))
    areas = trace.areas(instants) - trace.scenario.setpoint_degC * np.diff(instants)
    largest = float((error if beyond else np.abs(error)).max())
    return float(np.abs(areas).sum()), max(largest, trace.resolution_degC)

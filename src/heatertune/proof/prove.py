"""Words × every model × every open point of the manual → one verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache as remember
from itertools import product
from typing import Any, Final

import numpy as np

from heatertune.codec import built, encode
from heatertune.errors import InputError, OutOfRange
from heatertune.model.findings import Finding
from heatertune.model.values import HeaterModel
from heatertune.pid.values import Margins, PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.open_points import Switch, settings_of
from heatertune.plc.words import Words
from heatertune.proof.criteria import Criterion, Limits, worst_of
from heatertune.proof.document import OutcomeView, ProofView, RampView, RunView, digested
from heatertune.proof.interlock import Interlock
from heatertune.proof.judge import judge, of_words
from heatertune.proof.loop import (
    InLoop,
    actuator_of,
    check_words,
    in_loop,
    noise_of,
    plant_row,
    scans_of,
    simulate,
)
from heatertune.proof.measured import band_of, columns_of, joined
from heatertune.proof.metered import metered
from heatertune.proof.pwm import Actuator
from heatertune.proof.scenario import Scenario, conditions
from heatertune.proof.specification import Specification
from heatertune.proof.trace import Trace
from heatertune.proof.verdict import NOT_PROVEN, Heard, blocking, combined
from heatertune.show import Shown

__all__ = ["Proof", "RunResult", "prove_models", "settings_to_prove"]

_ALL_TOGETHER: Final = 8  # up to so many combinations of settings all are run


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """One model under one setting of the room's switches.

    Attributes:
        model: the model's label.
        switches: setting of each switch.
        label: model and the settings that are not the default.
        criteria: of this run.
    """

    model: str
    switches: Mapping[str, str]
    label: str
    criteria: tuple[Criterion, ...]

    @property
    def verdict(self) -> str:
        """"PASS" where every criterion is ok, else "FAIL"."""
        return "PASS" if all(each.ok for each in self.criteria) else "FAIL"

    @property
    def strains(self) -> list[float]:
        """How much of each limit is used, the most first: the greater of two lists is the worse run."""
        return sorted((each.strain for each in self.criteria), reverse=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proof(Shown):
    """What the words do in every run.

    Attributes:
        words: that were proven.
        design: as the words realise it; None where the controller is no PID.
        limits: they were held against.
        specification: behind the limits, in its user's words; None: the limits were given as they are.
        criteria: each the worst over all runs, with the label of the run it comes from.
        runs: first model and default settings first.
        scenario: of each run.
        actuator: the switch; the controller's own where it makes the PWM itself.
        interlock: what watches the heater in every run; None: nothing.
        traced: number of a run → its trace, made when it is asked for first.
        known: settings that were taken as known.
        faults: what is known to be wrong in the controller with these words, one sentence each.
        ramp_degC_per_min: how fast the words' ramp moves the setpoint [°C/min]; infinite without one.
        open_points: whether every setting the manual leaves open was run, not only the defaults.
        heard: what the fit found and the user knows, which no run shows.

    Raises:
        InputError: no run.
    """

    words: Words
    design: PidDesign | None
    limits: Limits
    criteria: tuple[Criterion, ...]
    runs: tuple[RunResult, ...]
    scenario: Scenario
    actuator: Actuator
    interlock: Interlock | None
    traced: Callable[[int], Trace] = field(repr=False)
    known: Mapping[str, str] = field(default_factory=dict)
    faults: tuple[str, ...] = ()
    ramp_degC_per_min: float = math.inf
    open_points: bool = True
    heard: Heard = field(default_factory=Heard)
    specification: Specification | None = None

    def __post_init__(self) -> None:
        if not (self.runs and self.criteria):
            raise InputError("runs: none; a proof without a run proves nothing")

    @property
    def nominal(self) -> Trace:
        """Trace of the first run."""
        return self.traced(0)

    @property
    def worst(self) -> Trace:
        """Trace of the run whose criteria strain their limits most."""
        return self.traced(self.worst_run)

    @property
    def worst_run(self) -> int:
        """Number of the run whose criteria strain their limits most."""
        return _worst(self.runs)

    @property
    def verdict(self) -> str:
        """"FAIL" where a run failed, else "NOT PROVEN" where the fit leaves open what no run shows, else "PASS"."""
        heard = [NOT_PROVEN] if blocking(self.heard.to_document()) else []
        return combined([*(each.verdict for each in self.runs), *heard])

    @property
    def setpoint_ramp(self) -> RampView | None:
        """The words' setpoint ramp as documents hold it, None without one."""
        ramp = self.words.ramp
        return None if ramp is None else built(RampView, ramp, degC_per_min=self.ramp_degC_per_min)

    def to_document(self) -> dict[str, Any]:
        """Return the JSON document; traces are not part of it, numbers that are not finite are null."""
        runs = (built(RunView, run, criteria={each.name: built(OutcomeView, each) for each in run.criteria})
                for run in self.runs)
        return digested(encode(built(
            ProofView, self, self.words, self.heard, words=self.words.values, runs=tuple(runs),
            criteria={each.name: each.view for each in self.criteria}, findings=self.heard.views, digest="")))


def prove_models(
    room: Controller,
    words: Words,
    models: Sequence[tuple[str, HeaterModel]],
    scenario: Scenario,
    actuator: Actuator | None = None,
    limits: Limits | None = None,
    margins_of: Callable[[HeaterModel, PidDesign], Margins] | None = None,
    *,
    open_points: bool = True,
    known: Mapping[str, str] | None = None,
    interlock: Interlock | None = None,
    heard: Heard | None = None,
    reading_step_degC: float = 0.0,
    specification: Specification | None = None,
) -> Proof:
    """Run the words on every model under every setting the manual leaves open, and judge the worst.

    Where a room exports a listing, the first and the worst run are the listing's own; the others, which its direct form
    runs, step by step the same, take a hundredth of the time.

    Args:
        room: the controller.
        words: what it holds.
        models: (label, heater); the first is the nominal one.
        scenario: what happens in each run.
        actuator: the switch; not used where the controller makes the PWM itself.
        limits: None: the defaults.
        margins_of: margins of a design on a heater; None: margins are not judged.
        known: switch → setting of what is known of this very controller, the manual leaving it open.
        open_points: False: only the default settings of the room's switches, for a quick comparison.
        interlock: what watches the heater in every run; None: nothing.
        heard: what the fit found and the user knows; None: nothing.
        reading_step_degC: step or noise of a reading on the heater, where that is more than the controller's own [°C].
        specification: behind the limits.

    Raises:
        InputError: no model, or as in `simulate`, with the model's label.
        OutOfRange, UnknownName: as in `simulate`.
    """
    if not models:
        raise InputError("a proof needs at least one model")
    limits, design = limits or Limits(), room.decode(words)
    settings = settings_to_prove(room.switches, known or {})[: None if open_points else 1]
    _check(room, words, models, scenario)
    controllers = [in_loop(room, words, scenario.setpoint_degC, each, direct=True) for each in settings]
    switch = actuator_of(controllers[0], actuator)
    runs = list(product(models, settings))
    labels = [_label(name, room.switches, switches) for (name, _), switches in runs]

    @remember
    def traced(run: int) -> Trace:
        (_, model), switches = runs[run]
        return simulate(room, words, model, scenario, switch, switches, interlock)

    if interlock is None:
        judged = _metered(controllers, models, scenario, switch, limits, labels)
    else:  # what it sees is the temperature at any instant, which only a trace tells
        judged = [judge(traced.__wrapped__(run), limits, where=label) for run, label in enumerate(labels)]
    step = None if design is None else design.step_power_pct_per_degC * max(
        reading_step_degC, controllers[0].resolution_degC, scenario.noise_degC)
    margins = [None if margins_of is None or design is None else margins_of(model, design) for _, model in models]
    spread = (each for each in margins for _ in settings)
    results = [
        RunResult(model=name, switches=switches, label=label, criteria=(*ran, *of_words(limits, robust, step, label)))
        for ((name, _), switches), label, ran, robust in zip(runs, labels, judged, spread, strict=True)
    ]
    if room.direct is not None:
        for run in {0, _worst(results)}:
            results[run] = _by_listing(results[run], judge(traced(run), limits, where=labels[run]))
    return Proof(
        words=words,
        design=design,
        limits=limits,
        criteria=tuple(worst_of(same) for same in zip(*(each.criteria for each in results), strict=True)),
        runs=tuple(results),
        scenario=scenario,
        actuator=switch,
        interlock=interlock,
        traced=traced,
        known=dict(known or {}),
        faults=() if room.faults is None else room.faults(words),
        ramp_degC_per_min=math.inf if words.ramp is None else room.ramp_degC_per_min(words),
        open_points=open_points,
        heard=_with_band(heard or Heard(), limits, controllers[0].resolution_degC),
        specification=specification,
    )


def _with_band(heard: Heard, limits: Limits, resolution_degC: float) -> Heard:
    """Return what is heard, and that the band is wider than what was asked for, where the sensor makes it so."""
    band = band_of(limits, resolution_degC)
    if band <= limits.tolerance_degC:
        return heard
    told = f"asked ±{limits.tolerance_degC:.3g} °C, proven ±{band:.3g} °C"
    coarse = Finding(name="coarse-sensor", told=f"{told}: the sensor's step is {resolution_degC:.3g} °C.")
    return replace(heard, findings=(*heard.findings, coarse), remarks=(*heard.remarks, told))


def settings_to_prove(switches: Sequence[Switch], known: Mapping[str, str] | None = None) -> list[dict[str, str]]:
    """Return the settings under which words are proven, the defaults (and what is known) first.

    Every combination where there are few of them; otherwise each switch on its own.

    Raises:
        UnknownName: what is known is no switch or setting.
    """
    default = settings_of(switches, known or {})
    open_ = [switch for switch in switches if switch.name not in (known or {})]
    varied: Iterable[dict[str, str]]
    if math.prod(len(switch.settings) for switch in open_) <= _ALL_TOGETHER:
        names = [switch.name for switch in open_]
        varied = (default | dict(zip(names, each, strict=True)) for each in product(*(s.settings for s in open_)))
    else:
        varied = (default | {switch.name: setting} for switch in open_ for setting in switch.settings)
    return [default, *(each for each in varied if each != default)]


def _check(room: Controller, words: Words, models: Sequence[tuple[str, HeaterModel]], scenario: Scenario) -> None:
    """Raise what `simulate` would, with the model's label."""
    for name, model in models:
        try:
            check_words(room, words, scenario)
            conditions(scenario, model)
        except OutOfRange as problem:
            raise InputError(f"model {name}: {problem}") from problem


def _metered(
    controllers: Sequence[InLoop], models: Sequence[tuple[str, HeaterModel]], scenario: Scenario,
    actuator: Actuator, limits: Limits, labels: Sequence[str],
) -> list[tuple[Criterion, ...]]:
    """Return the criteria of each model with each controller, and no trace: many times as fast."""
    rows = np.array([plant_row(model, scenario) for _, model in models])
    noise, late = noise_of(scenario, scans_of(controllers[0], scenario))[None], np.zeros((1, 1))
    parts = [metered(each, rows, scenario, actuator, limits, noise, late) for each in controllers]
    columns = columns_of(joined(parts, in_turn=True), limits)
    return list(zip(*(column.criteria(labels) for column in columns), strict=True))


def _worst(results: Sequence[RunResult]) -> int:
    """Return the number of the run whose criteria strain their limits most."""
    return max(range(len(results)), key=lambda run: results[run].strains)


def _by_listing(result: RunResult, ran: tuple[Criterion, ...]) -> RunResult:
    """Return a run as its listing ran: the meter runs a room's direct form, and what is exported shall have its say."""
    return replace(result, criteria=(*ran, *result.criteria[len(ran):]))


def _label(name: str, known: Sequence[Switch], switches: Mapping[str, str]) -> str:
    changed = [f"{s.name} = {switches[s.name]}" for s in known if switches[s.name] != s.default]
    return ", ".join([name, *changed])

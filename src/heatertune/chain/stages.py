"""One function per stage; each hands the stage what it needs from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from heatertune import cache
from heatertune.chain.known import closed_again, controllers
from heatertune.chain.words_file import certificate
from heatertune.errors import ExportRefused, InputError
from heatertune.log import read_log
from heatertune.log.values import Log
from heatertune.model import document as model_document
from heatertune.model.findings import Finding
from heatertune.model.temperature.pool import pool_candidates
from heatertune.model.values import FittedModel, HeaterModel, Outcome
from heatertune.pid import document as pid_document
from heatertune.pid.loop.robustness import margins
from heatertune.pid.timer import Timer
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, Words, room
from heatertune.proof import Actuator, Interlock, Limits, Proof, scenario_for
from heatertune.proof import prove as prove_words
from heatertune.proof.scenario import can_hold
from heatertune.proof.verdict import Heard

if TYPE_CHECKING:
    from heatertune.model.temperature.closed_loop import Bounds

__all__ = [
    "Told", "default_pwm_period_s", "default_setpoint", "encode", "export", "fit", "fit_known", "fit_together",
    "holding", "labelled", "prove", "tune",
]

Told = Callable[[str], object]

#: of a model's document, what is told and no design depends on
_TOLD = ("residuals", "notes", "hypotheses", "whiteness", "input_crosscorrelation", "held_out", "halves", "logs")

#: ambient assumed where neither the log nor the user tells it [°C]
ROOM_DEGC = 20.0


def fit(
    log: Log, *, ambient_degC: float | Bounds | None = None, power_before_pct: float | None = None,
    until_s: float | None = None, dead_time_at_most_s: float | None = None, sensor_delay_s: float = 0.0,
    thorough: bool = False, companions: bool = False, progress: Told = str,
) -> FittedModel:
    """Identify the heater behind a log; the paper's controller laws run inside the fit where no power was logged.

    Args:
        log: what `read_log` returned.
        ambient_degC: ambient temperature where it is known, or its lowest and highest value [°C].
        power_before_pct: power before the first reading [%].
        until_s: last instant to use [s].
        dead_time_at_most_s: no dead time is longer, as the user knows [s].
        sensor_delay_s: by which the sensor is known to lag behind [s].
        thorough: carry every controller hypothesis to the end, however far behind it is.
        companions: whether the candidates of other built-in logs of the same heater are added.
        progress: told what begins.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit`.
    """
    settings = {
        "ambient_degC": ambient_degC, "power_before_pct": power_before_pct, "until_s": until_s, "thorough": thorough,
        "dead_time_at_most_s": dead_time_at_most_s, "sensor_delay_s": sensor_delay_s,
    }
    fitted = _fit_one(log, settings, progress)
    if not companions:
        return fitted
    others = [_fit_one(read_log(name, errata=True), {}, progress) for name in log.same_heater]
    return pool_candidates(fitted, others)


def fit_together(
    logs: Sequence[Log], *, ambient_degC: float | Bounds | None = None, power_before_pct: float | None = None,
    until_s: float | None = None, dead_time_at_most_s: float | None = None, sensor_delay_s: float = 0.0,
    progress: Told = str,
) -> FittedModel:
    """Identify the one heater behind several logs, all with power or all without; arguments as in `fit`.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit_together`.
    """
    from heatertune.model.fit import fit_together as fit_logs  # noqa: PLC0415 - compiles; a proof needs no fit

    settings: dict[str, Any] = {
        "ambient_degC": ambient_degC, "power_before_pct": power_before_pct, "until_s": until_s,
        "dead_time_at_most_s": dead_time_at_most_s, "sensor_delay_s": sensor_delay_s,
    }
    laws = () if any(log.power_pct is not None for log in logs) else _laws()
    return _kept(
        "fit-together", {"logs": [_columns(log) for log in logs], **settings},
        lambda: fit_logs(logs, laws=laws, progress=progress, **settings), progress,
    )


def fit_known(
    log: Log, words: Words, *, setpoint_degC: float | None = None, known: Mapping[str, str] | None = None,
    ambient_degC: float | Bounds | None = None, power_before_pct: float | None = None, until_s: float | None = None,
    dead_time_at_most_s: float | None = None, sensor_delay_s: float = 0.0, progress: Told = str,
) -> FittedModel:
    """Identify the heater behind a log without power whose controller is known.

    Args:
        log: without power; its first reading is the controller's first.
        words: what the controller held.
        setpoint_degC: its setpoint [°C]; None: as logged.
        known: switch → setting of what is known of this very controller, its manual leaving it open.
        ambient_degC: as in `fit`.
        power_before_pct: power before the first reading [%]; None: none.
        until_s: as in `fit`.
        dead_time_at_most_s: as in `fit`.
        sensor_delay_s: as in `fit`.
        progress: told what begins.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit_known`; words with a setpoint ramp.
        UnknownName: no such switch or setting.
    """
    if words.ramp is not None:
        raise InputError("words with a setpoint ramp: a log tells the setpoint asked for, not the one followed")
    from heatertune.model.fit import fit_known as fit_log_known  # noqa: PLC0415 - compiles; a proof needs no fit

    tried = controllers(words, known)
    settings: dict[str, Any] = {
        "setpoint_degC": setpoint_degC, "ambient_degC": ambient_degC, "power_before_pct": power_before_pct or 0.0,
        "until_s": until_s, "dead_time_at_most_s": dead_time_at_most_s, "sensor_delay_s": sensor_delay_s,
    }
    inputs = _columns(log) | settings | {
        "target": words.target, "words": dict(words.values), "sample_time_s": words.sample_time_s,
        "range": [words.scaling.low_degC, words.scaling.high_degC], "switches": [dict(each.switches) for each in tried],
    }

    def run() -> FittedModel:
        found = fit_log_known(log, tried, progress=progress, **settings)
        return replace(found, notes=(*found.notes, closed_again(log, found, tried, setpoint_degC)))

    return _kept("fit-known", inputs, run, progress)


def _fit_one(log: Log, settings: Mapping[str, Any], progress: Told) -> FittedModel:
    def run() -> FittedModel:
        from heatertune.model.fit import fit as fit_log  # noqa: PLC0415 - compiles; what is kept needs no fit

        laws = _laws() if log.power_pct is None else ()
        return fit_log(log, laws=laws, progress=progress, **settings)

    return _kept("fit", _columns(log) | dict(settings), run, progress)


def _columns(log: Log) -> dict[str, Any]:
    names = ("name", "time_s", "temperature_degC", "power_pct", "setpoint_degC", "rests_at_degC")
    taken = None if log.taken is None else (log.taken.line, log.taken.repaired_share)
    return {name: getattr(log, name) for name in names} | {"taken": taken}


def _kept(stage: str, inputs: Mapping[str, Any], run: Callable[[], FittedModel], progress: Told) -> FittedModel:
    """Return what was found before for the same inputs, else what `run` finds."""
    return cache.cached(stage, inputs, lambda: model_document.to_document(run()), model_document.from_document,
                        progress=progress)


def _laws() -> Sequence[Any]:
    from heatertune.plc.s7_200.paper.laws import LAWS  # noqa: PLC0415 - compiles; only logs without power need it

    return LAWS


def tune(
    fitted: FittedModel, *, target: str | None = None, scaling: Scaling | None = None, progress: Told = str,
    **settings: Any,
) -> PidDesign:
    """Find K, TN, TV and TA; with a target, TA is what its timer can do, and a reading as fine as its input's.

    Settings: see `heatertune.pid.tune.tune`.

    Raises:
        UnknownName, OutOfRange, InputError: as there.
    """
    from heatertune.pid.tune import tune as tune_model  # noqa: PLC0415 - compiles; a proof needs no search

    timer = Timer()
    if target is not None:
        found = room(target)
        shortest, longest, step = found.sample_times_s
        timer = Timer(shortest_s=shortest, longest_s=longest, step_s=step)
        settings = {"derivative_filter": found.derivative_filter,
                    "resolution_degC": (scaling or Scaling()).span_degC / found.counts} | settings
    inputs = {
        "model": _essence(fitted),
        "timer": [timer.shortest_s, timer.longest_s, timer.step_s],
        "settings": dict(settings),
    }

    def run() -> dict[str, Any]:
        return pid_document.to_document(tune_model(fitted, timer=timer, progress=progress, **settings))

    return cache.cached("tune", inputs, run, pid_document.from_document, progress=progress)


def _essence(fitted: FittedModel) -> dict[str, Any]:
    """Return what a design depends on: the working model and the candidates."""
    document = model_document.to_document(fitted)
    return {key: document[key] for key in document if key not in _TOLD}


def encode(design: PidDesign, target: str, *, scaling: Scaling | None = None) -> Words:
    """Round a design to the words of a target.

    Raises:
        UnknownName: no such target.
        NotRepresentable: a word does not fit; the error tells the nearest change that would.
    """
    return room(target).encode(design, scaling or Scaling())


def prove(
    words: Words, fitted: FittedModel, *, setpoint_degC: float | None = None, noise_degC: float = 0.0,
    actuator: Actuator | None = None, tolerance_degC: float = 1.0, interlock: str | None = None,
    limit_degC: float | None = None, fan_stops_s: float | None = None, known: Mapping[str, str] | None = None,
    step_power_pct: float = 10.0, accept: Sequence[str] = (), first_look: bool = False,
) -> Proof:
    """Run the words in the closed loop on every candidate model, under every open point of the manual.

    Without a setpoint, the loop is proven where the log says that the heater was used, or, without a log, half way
    between ambient and full power on the weakest model.

    Args:
        words: what the PLC will hold.
        fitted: the heater and its candidates.
        setpoint_degC: setpoint [°C].
        noise_degC: standard deviation of the sensor noise [°C].
        actuator: the switch behind the controller; None: PWM in parts of TA up to 10 s.
        tolerance_degC: how far from the setpoint the process still is as it should be [°C].
        interlock: name of what watches the heater in every run; None: nothing.
        limit_degC: temperature at which it switches the heater off [°C]; None: the end of the sensor's range.
        fan_stops_s: instant at which the fan fails [s]; None: it never does.
        known: switch → setting of what is known of this very controller, its manual leaving it open.
        step_power_pct: most power that one step of the reading may move at once [%].
        accept: names of findings that the user accepts, see `heatertune.model.findings`.
        first_look: only the nominal model under the default settings, in the same scenario; `export` refuses it.

    Raises:
        InputError, OutOfRange: as `heatertune.proof.prove`.
        UnknownName: no such interlock, switch or setting, or no finding to accept.
    """
    setpoint = default_setpoint(fitted) if setpoint_degC is None else setpoint_degC
    models = holding(fitted, setpoint)
    scenario = scenario_for([model for _, model in models], noise_degC=noise_degC, setpoint_degC=setpoint)
    return prove_words(
        room(words.target), words, models[:1] if first_look else models, scenario, open_points=not first_look,
        actuator=actuator or Actuator(pwm_period_s=default_pwm_period_s(words.sample_time_s)),
        limits=Limits(tolerance_degC=tolerance_degC, step_power_pct=step_power_pct), margins_of=margins, known=known,
        heard=Heard(findings=(*fitted.findings, *_unreached(fitted, len(models), setpoint)), accepted=tuple(accept),
                    assumed=fitted.assumed, remarks=tuple(_remarks(words, fitted))),
        reading_step_degC=fitted.reading_step_degC,
        interlock=None if interlock is None else Interlock(
            name=interlock, limit_degC=words.scaling.high_degC if limit_degC is None else limit_degC,
            fan_stops_s=fan_stops_s,
        ),
    )


def labelled(fitted: FittedModel) -> list[tuple[str, HeaterModel]]:
    """Return every candidate with its label, the one that fits best first; an unknown ambient is taken as 20 °C."""
    known = sorted(fitted.candidates, key=lambda c: (c.part != "", c.log != fitted.candidates[0].log, -c.fit_pct))
    found = replace(fitted, candidates=tuple(known)).heaters
    return [(label, _with_ambient(model)) for label, model in found]


def holding(fitted: FittedModel, setpoint_degC: float) -> list[tuple[str, HeaterModel]]:
    """Return the possible heaters that can hold a setpoint with their labels; all of them where none can."""
    found = labelled(fitted)
    return [(label, model) for label, model in found
            if can_hold(model, setpoint_degC, float(model.ambient_degC or 0.0))] or found


def _unreached(fitted: FittedModel, able: int, setpoint_degC: float) -> Iterator[Finding]:
    known = len(fitted.heaters)
    if able < known:
        yield Finding(name="setpoint-unreached",
                      told=f"{known - able} of {known} possible heaters cannot hold {setpoint_degC:g} °C.")


def _remarks(words: Words, fitted: FittedModel) -> Iterator[str]:
    """Return what stands on the verdict's line beside the findings of the fit."""
    if fitted.outcome is Outcome.BY_HAND:
        yield "the model was given by hand"
    if words.sample_time_s < fitted.log_interval_s:
        yield f"TA {words.sample_time_s:g} s is below the log's interval of {fitted.log_interval_s:g} s"


def _with_ambient(model: HeaterModel) -> HeaterModel:
    return model if model.ambient_degC is not None else replace(model, ambient_degC=ROOM_DEGC)


def default_setpoint(fitted: FittedModel) -> float:
    """Return where the log says that the heater was used, else half way up on the weakest model [°C]."""
    if fitted.setpoint_degC is not None:
        return fitted.setpoint_degC
    return min(float(m.ambient_degC or 0.0) + 50.0 * m.gain_degC_per_pct for _, m in labelled(fitted))


def default_pwm_period_s(sample_time_s: float, *, most_s: float = 10.0) -> float:
    """Return TA, or the largest whole part of it up to the most: each sample then holds whole PWM periods [s]."""
    return sample_time_s / max(1, math.ceil(sample_time_s / most_s))


def export(words: Words, proof: Proof, *, force: bool = False) -> dict[str, str | bytes]:
    """Return the export files of proven words, name → content.

    Raises:
        ExportRefused: the verdict is not PASS and `force` was not given, or the proof is of other words or a first
            look.
    """
    if proof.words != words:
        raise ExportRefused("the proof was made for other words; prove these first")
    if not proof.open_points:
        raise ExportRefused("the proof is a first look under default settings; prove what the manual leaves open, too")
    return dict(room(words.target).export(words, certificate(proof.to_document(), force=force)))

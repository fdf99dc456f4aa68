"""The whole chain as functions; it hands later stages to earlier ones where a loop goes back.

    log = read_log("table4")
    model = fit(log)
    design = tune(model, target="s5-ob251")
    words = encode(design, target="s5-ob251")
    proof = prove(words, model)
    report(proof, model, "out/")

There is no algorithm here: each function asks the stage that knows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from heatertune import cache
from heatertune.documents import number, peek_schema, read_document, to_json, write_files
from heatertune.errors import DocumentError, ExportRefused, NotRepresentable
from heatertune.log import read_log
from heatertune.log.values import Log
from heatertune.model import document as model_document
from heatertune.model.fit import fit as fit_log
from heatertune.model.fit import model_by_hand, pool_candidates
from heatertune.model.values import FittedModel, Fopdt, HeaterModel
from heatertune.pid import document as pid_document
from heatertune.pid.robustness import margins
from heatertune.pid.rules import RULES
from heatertune.pid.tune import Timer
from heatertune.pid.tune import tune as tune_model
from heatertune.pid.values import PidDesign
from heatertune.plc import Certificate, Scaling, Words, room
from heatertune.proof import Actuator, Limits, Proof, scenario_for, simulate, simulate_wish
from heatertune.proof import prove as prove_words
from heatertune.proof.series import curve_series, trace_series
from heatertune.proof.trace import Trace

__all__ = ["design", "encode", "export", "fit", "pictures", "prove", "read_log", "report", "tune"]

Told = Callable[[str], object]

WORDS_SCHEMA = "heatertune/words/1"

#: ambient assumed where neither the log nor the user tells it [°C]
ROOM_DEGC = 20.0


def fit(
    log: Log, *, ambient_degC: float | None = None, power_before_pct: float | None = None, until_s: float | None = None,
    companions: bool = False, progress: Told = str,
) -> FittedModel:
    """Identify the heater behind a log; the paper's controller laws run inside the fit where no power was logged.

    Args:
        log: what `read_log` returned.
        ambient_degC: ambient temperature where it is known [°C].
        power_before_pct: power before the first reading [%].
        until_s: last instant to use [s].
        companions: whether the candidates of other built-in logs of the same heater are added.
        progress: told what begins.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit`.
    """
    settings = {"ambient_degC": ambient_degC, "power_before_pct": power_before_pct, "until_s": until_s}
    fitted = _fit_one(log, settings, progress)
    if not companions:
        return fitted
    others = [_fit_one(read_log(name, errata=True), {}, progress) for name in log.same_heater]
    return pool_candidates(fitted, others)


def _fit_one(log: Log, settings: Mapping[str, Any], progress: Told) -> FittedModel:
    inputs = {
        "name": log.name, "time_s": log.time_s, "temperature_degC": log.temperature_degC, "power_pct": log.power_pct,
        **settings,
    }

    def run() -> dict[str, Any]:
        return model_document.to_document(fit_log(log, laws=_laws(log), progress=progress, **settings))

    return model_document.from_document(cache.cached("fit", inputs, run, progress=progress))


def _laws(log: Log) -> Sequence[Any]:
    if log.power_pct is not None:
        return ()
    from heatertune.plc.s7_200.laws import LAWS  # noqa: PLC0415 - compiles; only logs without power need it

    return LAWS


def tune(fitted: FittedModel, *, target: str | None = None, progress: Told = str, **settings: Any) -> PidDesign:
    """Find K, TN, TV and TA; with a target, TA is what its timer can do. Settings: see `heatertune.pid.tune.tune`.

    Raises:
        UnknownName, OutOfRange, InputError: as there.
    """
    timer = Timer()
    if target is not None:
        shortest, longest, step = room(target).sample_times_s
        timer = Timer(shortest_s=shortest, longest_s=longest, step_s=step)
    inputs = {
        "model": _essence(fitted), "timer": [timer.shortest_s, timer.longest_s, timer.step_s], "settings": dict(settings),
    }

    def run() -> dict[str, Any]:
        return pid_document.to_document(tune_model(fitted, timer=timer, progress=progress, **settings))

    return pid_document.from_document(cache.cached("tune", inputs, run, progress=progress))


def _essence(fitted: FittedModel) -> dict[str, Any]:
    """Return what a design depends on: the working model and the candidates."""
    document = model_document.to_document(fitted)
    return {key: document[key] for key in document if key not in ("residuals", "notes")}


def encode(design: PidDesign, target: str, *, scaling: Scaling | None = None) -> Words:
    """Round a design to the words of a target.

    Raises:
        UnknownName: no such target.
        NotRepresentable: a word does not fit; the error tells the nearest change that would.
    """
    return room(target).encode(design, scaling or Scaling())


def prove(
    words: Words, fitted: FittedModel, *, setpoint_degC: float | None = None, noise_degC: float = 0.0,
    actuator: Actuator | None = None, limits: Limits | None = None,
) -> Proof:
    """Run the words in the closed loop on every candidate model, under every open point of the manual.

    Without a setpoint, the loop is proven half way between ambient and full power on the weakest model, or, where the
    model was fitted to a log, where that log rested.

    Raises:
        InputError, OutOfRange: as `heatertune.proof.prove`.
    """
    models = [(label, _with_ambient(model)) for label, model in labelled(fitted)]
    scenario = scenario_for(
        [model for _, model in models], noise_degC=noise_degC,
        setpoint_degC=default_setpoint(fitted) if setpoint_degC is None else setpoint_degC,
    )
    return prove_words(
        room(words.target), words, models, scenario,
        actuator=actuator or Actuator(pwm_period_s=default_pwm_period_s(words.sample_time_s)),
        limits=limits, margins_of=margins,
    )


def labelled(fitted: FittedModel) -> list[tuple[str, HeaterModel]]:
    """Return every candidate with its label, the one that fits best first."""
    known = sorted(fitted.candidates, key=lambda c: (c.log != fitted.candidates[0].log, -c.fit_pct))
    return [(candidate.label, candidate.model) for candidate in known] or [("by hand", fitted.model)]


def default_setpoint(fitted: FittedModel) -> float:
    """Return where the log rested before it was disturbed, else half way up on the weakest model [°C]."""
    if fitted.residuals is not None:
        rest = fitted.residuals.measured_degC
        return round(float(sum(rest[-10:]) / 10), 1)
    reach = [_with_ambient(model) for _, model in labelled(fitted)]
    return min(float(model.ambient_degC or 0.0) + 50.0 * model.gain_degC_per_pct for model in reach)


def default_pwm_period_s(sample_time_s: float) -> float:
    """Return TA, or the largest whole part of it up to 10 s: each sample then holds whole PWM periods [s]."""
    return sample_time_s / max(1, math.ceil(sample_time_s / 10.0))


def _with_ambient(model: HeaterModel) -> HeaterModel:
    return model if model.ambient_degC is not None else replace(model, ambient_degC=ROOM_DEGC)


def export(words: Words, proof: Proof, *, force: bool = False) -> dict[str, str]:
    """Return the export files of proven words, name → text.

    Raises:
        ExportRefused: the verdict is FAIL and `force` was not given, or the proof is of other words.
    """
    if proof.words != words:
        raise ExportRefused("the proof was made for other words; prove these first")
    failed = [criterion.name for criterion in proof.criteria if not criterion.ok]
    if failed and not force:
        raise ExportRefused(f"the proof of these words is FAIL ({', '.join(failed)}); --force exports them all the same")
    models = len({run.model for run in proof.runs})
    lines = [f"proven in {len(proof.runs)} closed-loop runs on {models} heater models"]
    lines += [f"not kept: {name}" for name in failed]
    certificate = Certificate(verdict=proof.verdict, lines=tuple(lines), forced=bool(failed))
    return room(words.target).export(words, certificate)


def words_document(words: Words, proof: Proof, files: Mapping[str, str]) -> dict[str, Any]:
    """Return the JSON document of words, in the order in which they are typed in."""
    fields = room(words.target).fields
    return {
        "schema": WORDS_SCHEMA,
        "target": words.target,
        "words": dict(words.values),
        "fields": [{name: getattr(f, name) for name in ("name", "address", "format", "low", "high", "comment")}
                   for f in fields],
        "sample_time_s": words.sample_time_s,
        "scaling": {"low_degC": words.scaling.low_degC, "high_degC": words.scaling.high_degC},
        "realised": pid_document.to_document(proof.design),
        "files": sorted(files),
        "verdict": proof.verdict,
        "forced": bool(files) and proof.verdict == "FAIL",
    }


def demand_target(target: str) -> None:
    """Raise UnknownName unless there is such a target."""
    room(target)


def read_words(path: str | Path, target: str) -> Words | None:
    """Return the words of a `words.json`, None where the file holds another document.

    Raises:
        DocumentError: the file cannot be read, or holds words of another target.
        OutOfRange: a word the target does not allow.
    """
    found = peek_schema(path)
    if found != WORDS_SCHEMA:
        return None
    document = read_document(path, WORDS_SCHEMA)
    if document.get("target") != target or not isinstance(document.get("words"), dict):
        raise DocumentError(f"{path}: words of target {document.get('target')!r}; expected {target!r}")
    scale = document.get("scaling")
    if not isinstance(scale, dict):
        raise DocumentError(f"{path}: scaling is {scale!r}; expected low_degC and high_degC")
    words = Words(
        target=target, values=document["words"], sample_time_s=number(document, "sample_time_s", path),
        scaling=Scaling(low_degC=number(scale, "low_degC", path), high_degC=number(scale, "high_degC", path)),
    )
    room(target).check(words)
    return words


def read_documents(directory: Path) -> dict[str, dict[str, Any]]:
    """Return the documents that `design` wrote into a directory.

    Raises:
        DocumentError: one is missing or is none.
    """
    names = ("log", "model", "pid", "words", "proof", "pictures", "comparison")
    return {name: read_document(directory / f"{name}.json", f"heatertune/{name}/1") for name in names}


def log_document(log: Log) -> dict[str, Any]:
    """Return the JSON document of a log as it was understood."""
    names = ("name", "source", "time_s", "temperature_degC", "power_pct", "setpoint_degC", "repairs", "doubts")
    return {"schema": "heatertune/log/1"} | {name: getattr(log, name) for name in names}


def pictures(wished: PidDesign, fitted: FittedModel, proof: Proof) -> dict[str, Any]:
    """Return the series that the report draws: the runs, the wish, and the robustness of the words as realised."""
    models = [(label, _with_ambient(model)) for label, model in labelled(fitted)]
    nominal, found = proof.nominal, room(proof.words.target)
    others = [
        trace_series(simulate(found, proof.words, model, nominal.scenario, nominal.actuator), label)
        for label, model in models[1:]
    ]
    return {
        "schema": "heatertune/pictures/1",
        "kick_s": nominal.scenario.disturbances[0].time_s,
        "ms_limit": proof.limits.ms,
        "nominal": trace_series(nominal, proof.runs[0].label),
        "worst": trace_series(proof.worst, _label_of(proof.worst, models)),
        "others": [{name: run[name] for name in ("label", "time_s", "temperature_degC")} for run in others],
        "wish": trace_series(simulate_wish(wished, models[0][1], nominal.scenario, nominal.actuator), "wished"),
        "curves": curve_series(proof.design, models),
    }


def _label_of(trace: Trace, models: Sequence[tuple[str, HeaterModel]]) -> str:
    label = next(label for label, model in models if model == trace.model)
    defaults = {switch.name: switch.default for switch in room(trace.words.target).switches} if trace.words else {}
    changed = [f"{name} = {setting}" for name, setting in trace.switches.items() if setting != defaults.get(name)]
    return ", ".join([label, *changed])


def rivals(fitted: FittedModel, words: Words, proof: Proof) -> list[dict[str, Any]]:
    """Return how the rules fare in the same proof when they are applied to the best single-lag model alone."""
    singles = [c for c in fitted.candidates if isinstance(c.model, Fopdt) and c.log == fitted.candidates[0].log]
    alone = max(singles, key=lambda c: c.fit_pct).model if singles else fitted.model
    return [_rival(rule, alone, fitted, words, proof) for rule in RULES]


def _rival(rule: str, alone: HeaterModel, fitted: FittedModel, words: Words, proof: Proof) -> dict[str, Any]:
    wished = tune(model_by_hand(alone), target=words.target, method=rule)
    told = {
        "label": f"{rule} on {alone.gain_degC_per_pct:.3g} °C/%, {alone.lags_s[0]:.3g} s, {alone.dead_time_s:.3g} s",
        "gain_pct_per_degC": wished.gain_pct_per_degC,
        "integral_time_s": wished.integral_time_s,
    }
    try:
        rounded = encode(wished, words.target, scaling=words.scaling)
    except NotRepresentable as problem:
        return told | {"verdict": "not representable", "ms": None, "fails": [str(problem)]}
    models = [(label, _with_ambient(model)) for label, model in labelled(fitted)]
    actuator = Actuator(pwm_period_s=default_pwm_period_s(rounded.sample_time_s))
    found = prove_words(
        room(words.target), rounded, models, proof.nominal.scenario, actuator, proof.limits, margins
    )
    worst = next(criterion for criterion in found.criteria if criterion.name == "ms")
    fails = [criterion.name for criterion in found.criteria if not criterion.ok]
    return told | {"verdict": found.verdict, "ms": worst.value, "fails": fails}


def report(documents: Mapping[str, Mapping[str, Any]], directory: str | Path) -> list[Path]:
    """Write `report.html` made from the stages' documents; return its path.

    Raises:
        InputError: the directory cannot be written.
    """
    from heatertune.report import render  # noqa: PLC0415 - matplotlib

    return write_files(directory, {"report.html": render(documents)})


def design(
    source: str | Path, *, target: str, out: str | Path, reading: Mapping[str, Any] | None = None,
    fitting: Mapping[str, Any] | None = None, tuning: Mapping[str, Any] | None = None,
    proving: Mapping[str, Any] | None = None, scaling: Scaling | None = None, force: bool = False, progress: Told = str,
) -> dict[str, dict[str, Any]]:
    """Run the whole chain, write every stage's document, the export files and the report; return the documents.

    A verdict of FAIL writes documents and report but no export files, unless `force` is given.

    Args:
        source: a log, or "table3" / "table4".
        target: the controller.
        out: directory for the results.
        reading: options of `read_log`.
        fitting: options of `fit`.
        tuning: options of `tune`.
        proving: options of `prove`.
        scaling: sensor range.
        force: export in spite of FAIL.
        progress: told what begins.

    Raises:
        HeatertuneError: as the stages; nothing is written then.
    """
    room(target)  # an unknown target is refused before the long part
    log = read_log(source, **(reading or {}))
    fitted = fit(log, companions=True, progress=progress, **(fitting or {}))
    wished = tune(fitted, target=target, progress=progress, **(tuning or {}))
    words = encode(wished, target, scaling=scaling)
    progress(f"proving the words on {len(fitted.plants)} models")
    proof = prove(words, fitted, **(proving or {}))
    files = export(words, proof, force=force) if force or proof.verdict == "PASS" else {}
    progress("comparing with other designs")
    documents: dict[str, dict[str, Any]] = {
        "log": log_document(log),
        "model": model_document.to_document(fitted),
        "pid": pid_document.to_document(wished, fitted),
        "words": words_document(words, proof, files),
        "proof": proof.to_document(),
        "pictures": pictures(wished, fitted, proof),
        "comparison": {"schema": "heatertune/comparison/1", "rivals": rivals(fitted, words, proof)},
    }
    progress("drawing the report")
    written = {f"{name}.json": to_json(document) for name, document in documents.items()}
    from heatertune.report import render  # noqa: PLC0415 - matplotlib

    write_files(out, {**written, **files, "report.html": render(documents)})
    return documents

"""Repeat the proof of a folder before its words are exported or written: a document alone is not trusted.

The digest of a proof shows that its file is whole, not who wrote it: anyone can change words, limits and results and
compute the digest again. So the words are derived again from design and provenance, and proven with the recorded
heater and conditions.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from heatertune.cache import load_or_compute, release
from heatertune.codec import Document, construct_from, decode, encode, existing_path, plain, read_document
from heatertune.errors import DocumentError, HeatertuneError, InputError
from heatertune.model import model_document
from heatertune.model.model_values import FittedModel
from heatertune.pid.design_document import DesignProvenance, RampView, parts_of, read_design
from heatertune.pid.design_document import to_document as pid_document
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Boost, Ramp, Scaling, Words, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.word_selection import WordChoice, choose_words
from heatertune.plc.words import with_pwm_period
from heatertune.processors import ProgressCallback
from heatertune.proof.folder_digest import demand_log_of_model, demand_one_design
from heatertune.proof.profile import read_profile
from heatertune.proof.proof import Proof
from heatertune.proof.proof_document import ProofView, check_document, with_digest
from heatertune.proof.prove_words import prove
from heatertune.proof.specification import NOTHING, in_force, specification_of
from heatertune.proof.text_comparison import as_exported
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import WORDS_SCHEMA, WholeWordsView, demand_same_words, words_of
from heatertune.settings import Conditions, SampleSettings

__all__ = [
    "RepeatedProof", "apply_provenance", "demand_consistent", "demand_same_files", "design_document", "files_of",
    "recorded_conditions", "repeat_proof", "repeat_words", "scaling_of",
]


def recorded_conditions(conditions: Conditions) -> Conditions:
    """Return conditions as a document can hold them: what is not asked for at all is said by a limit."""
    if conditions.step_power_pct is None or math.isfinite(conditions.step_power_pct):
        return conditions
    return replace(conditions, step_power_pct=None, limit=(*conditions.limit, f"step-power={NOTHING}"))


def files_of(conditions: Conditions) -> dict[str, str]:
    """Return digests of what the files of a specification ask for, by the names of the options; none: there are none.

    Raises:
        DocumentError: one cannot be read.
    """
    spec, profile = conditions.spec, conditions.profile
    contents: dict[str, object] = {}
    if spec is not None and spec.endswith(".toml"):
        contents["spec"] = in_force(spec)
    if profile is not None:
        contents["profile"] = read_profile(profile)
    return {name: f"sha256:{hashlib.sha256(repr(content).encode()).hexdigest()}" for name, content in contents.items()}


def demand_same_files(recipe: DesignProvenance, names: Collection[str], where: str) -> None:
    """Refuse a file that has changed since a recipe was written, but for those that options give anew.

    Raises:
        InputError: it asks for something else; as `files_of`.
    """
    conditions = recipe.conditions
    now = files_of(Conditions(spec=None if "spec" in names else conditions.spec,
                              profile=None if "profile" in names else conditions.profile))
    for name, digest in now.items():
        if recipe.files.get(name) != digest:
            raise InputError(f"{where}: {getattr(conditions, name)}, under which it was made, has changed since: say "
                             f"--{name}, or design again")


def scaling_of(recipe: DesignProvenance) -> Scaling:
    """Return the sensor's range as its module gives it; errors as `heatertune.plc.inputs.sensor_scaling`."""
    if recipe.input is None:
        low, high = recipe.range_degC
        return Scaling(low_degC=low, high_degC=high)
    return controller_for(recipe.target).scaled(recipe.input, recipe.range_degC)


def repeat_words(design: PidDesign, fitted: FittedModel, recipe: DesignProvenance) -> WordChoice:
    """Return the words that a recipe makes of a design.

    Raises:
        NotRepresentable, OutOfRange, UnknownName, InputError: as `choose_words`, `refine` and `finished`.
    """
    choice = choose_words(design, recipe.target, fitted, scaling=scaling_of(recipe), way=recipe.words_by)
    if recipe.refined:
        from heatertune.proof.refine import refine

        choice = refine(choice, fitted, recipe.conditions)
    return replace(choice, words=apply_provenance(choice.words, recipe))


def apply_provenance(words: Words, recipe: DesignProvenance | None) -> Words:
    """Return words with what a recipe changes beside the gains; as they are where it is of another controller.

    Raises:
        OutOfRange, InputError: the controller cannot have it.
    """
    if recipe is None or recipe.target != words.target:
        return words
    words = with_cooling(words, recipe.conditions.cooling_gain)
    words = with_pwm_period(controller_for(words.target).cycle, words, recipe.conditions.pwm_period_s)
    if recipe.power_most_pct is not None:
        words = controller_for(words.target).with_output_limit(words, recipe.power_most_pct)
    if recipe.window_degC is not None:
        words = controller_for(words.target).with_window(words, recipe.window_degC)
    if recipe.boost is not None:
        words = replace(words, boost=construct_from(Boost, recipe.boost))
    return words if recipe.setpoint_ramp is None else replace(words, ramp=_ramp(words, recipe.setpoint_ramp))


def _ramp(words: Words, view: RampView) -> Ramp:
    """Return the very ramp, or, where the words' units are others now, the one that comes near it."""
    controller, ramp = controller_for(words.target), Ramp(step=view.step, calls=view.calls, hold=view.hold)
    same = replace(words, ramp=ramp)
    hold = controller.hold_degC(same)
    as_told = math.isclose(controller.ramp_degC_per_min(same), view.degC_per_min) and (
        hold == view.hold_degC if hold is None or view.hold_degC is None else math.isclose(hold, view.hold_degC))
    if as_told:
        return ramp
    far = view.hold_degC if view.hold_degC is None or not ramp.cools else -view.hold_degC
    return controller.ramp(words, view.degC_per_min, far)


#: two numbers of a proof that differ by less are the same: processors and libraries round differently
_RELATIVE: Final = 1e-6
_ABSOLUTE: Final = 1e-9
#: parts of a proof that have to be the same when it is repeated; the verdict follows from them
_REPEATED: Final = ("scenario", "actuator", "limits", "specification", "stated_settings", "interlock", "findings",
                    "assumed", "faults", "criteria", "runs", "samples")
#: lists of sentences: a design adds what it changed to those of its proof
_SENTENCES: Final = ("remarks", "not_tested")


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedProof:
    """Words of a folder, with the proof that was made of them just now.

    Attributes:
        words: the controller's parameters.
        words_document: `words.json`.
        proof: document of the repeated proof, with the remarks of the stored one.
        design: document of the design, heater and conditions, as `pid.json` holds them.
        fitted: the heater that the words were proven on.
        conditions: of the proof.
    """

    words: Words
    words_document: Document
    proof: Document
    design: Document
    fitted_model: FittedModel
    conditions: Conditions


def repeat_proof(path: str | Path, *, accept: Sequence[str] = (), progress: ProgressCallback = str) -> RepeatedProof:
    """Prove the words of a file again, on the heater and under the conditions of the design next to it.

    Args:
        path: of `words.json`; `proof.json` and `pid.json` lie in the same folder.
        accept: names of findings that the user accepts, next to those of the folder.
        progress: called with the name of the step that begins.

    Raises:
        DocumentError: a document is missing or damaged, the words are not those of the design, or the stored proof is
            not what proving the words again gives.
        ExportRefused: the stored proof is of other words.
        InputError: the design holds no heater; a file of its specification has changed.
        OutOfRange: a word that the controller does not allow.
        UnknownName: no finding of this name blocks a verdict.
    """
    words_path = existing_path(path)
    place, proof_path = words_path.parent, words_path.with_name("proof.json")
    document = read_document(words_path, WORDS_SCHEMA)
    stored = check_document(read_document(proof_path, PROOF_SCHEMA), proof_path)
    decode(WholeWordsView, document, words_path)
    words = words_of(document, str(document.get("target")), words_path)
    demand_same_words(document, stored, proof_path)
    design_path = _design_path(place)
    design, fitted, recipe = read_design(design_path)
    if fitted is None:
        raise InputError(f"{design_path}: no heater in it, so the words cannot be proven again: {_way_on(words)}")
    recipe = recipe if recipe is not None and recipe.target == words.target else (
        _assumed_recipe(words, stored, design, fitted))
    demand_same_files(recipe, (), str(design_path))
    _demand_words(words, document, design, fitted, recipe, words_path)
    _demand_model(place, fitted, design_path)
    demand_one_design(place, _way_on(words))
    demand_log_of_model(place, _way_on(words))
    wider = replace(recipe.conditions, accept=tuple(dict.fromkeys((*recipe.conditions.accept, *accept))))
    progress("proving the parameters again")
    samples = _sample_settings(stored)
    again = _proof_document(words, fitted, recipe.conditions, samples)
    for name in _REPEATED:
        _demand_same(proof_path, name, stored.get(name), again.get(name), words)
    again = _with_sentences(again, stored, proof_path)
    if wider != recipe.conditions:
        again = _with_sentences(_proof_document(words, fitted, wider, samples), stored, proof_path)
    return RepeatedProof(
        words=words, words_document=document, proof=again, fitted_model=fitted, conditions=wider,
        design=pid_document(design, fitted, replace(recipe, conditions=wider)))


def design_document(
    proof: Proof, design: PidDesign | None, fitted: FittedModel, recipe: DesignProvenance | None, conditions: Conditions
) -> dict[str, Any] | None:
    """Return the document from which proven words can be made and proven again; None: no design makes these words.

    Args:
        proof: of the words.
        design: that they were made from; None: the one that they realise.
        fitted: the heater that they were proven on.
        recipe: how the words were made from the design; None: by the defaults.
        conditions: of the proof.
    """
    source = design or proof.design
    if source is None:
        return None
    scaling, record = proof.words.scaling, recorded_conditions(conditions)
    base = recipe or DesignProvenance(target=proof.words.target, conditions=record)
    base = replace(
        base, target=proof.words.target, range_degC=scaling.sensor_degC, input=scaling.input, conditions=record,
        setpoint_ramp=proof.setpoint_ramp, boost=proof.boost, files=files_of(record), way_on=None)
    document = pid_document(source, fitted, base)
    # as it will be read: a number that its text does not hold exactly makes other words
    again, kept_recipe = parts_of(document)
    new_words = repeat_words(again, fitted, kept_recipe or base).words
    return document if _same_words(new_words, proof.words) else None


def demand_consistent(folder: str | Path, documents: Mapping[str, Document]) -> None:
    """Refuse documents of a folder that do not belong together.

    The words have to be those that the design makes, and the heater of the design that of `model.json`.

    Args:
        folder: names the documents in an error.
        documents: "model", "pid", "words" and "proof".

    Raises:
        DocumentError: they do not.
        InputError, OutOfRange: as `heatertune.proof.repetition.repeat_words`.
    """
    place, document = Path(folder), documents["words"]
    words = words_of(document, str(document.get("target")), place / "words.json")
    design, recipe = parts_of(documents["pid"], where=place / "pid.json")
    model = documents["pid"].get("model")
    if model is None:
        return
    fitted = model_document.from_document(model)
    if recipe is not None and recipe.target == words.target:
        _demand_words(words, document, design, fitted, recipe, place / "words.json")
    _demand_same_model(documents["model"], fitted, place)
    setpoint = documents["proof"]["scenario"]["setpoint_degC"]
    if document["setpoint_degC"] != setpoint:
        raise DocumentError(f"{place / 'words.json'}: setpoint_degC: {document['setpoint_degC']:g}; the proof is of "
                            f"{setpoint:g}")


def _design_path(place: Path) -> Path:
    """Return the design's file next to words, else, where `tune` was told to write it, in the folder around."""
    own, outer = place / "pid.json", place.parent / "pid.json"
    return outer if not own.is_file() and place.name == "data" and outer.is_file() else own


def _way_on(words: Words) -> str:
    return (f"heatertune export-db PID --target {words.target} -o DIR proves the design PID and writes a whole folder; "
            "for words alone name their heater, too (--gain, --time-constant, --dead-time)")


def _assumed_recipe(words: Words, proof: Document, design: PidDesign, fitted: FittedModel) -> DesignProvenance:
    """Return the recipe of a design that has none: the defaults, with what the proof states in its first lines.

    Its words are those of the first way of rounding that makes the given ones, else of the last way.
    """
    view = decode(ProofView, dict(proof), "proof.json")
    conditions = Conditions(
        setpoint_degC=view.scenario.setpoint_degC, switches=dict(view.stated_settings),
        pwm_period_s=view.actuator.pwm_period_s)
    recipe = DesignProvenance(target=words.target, range_degC=words.scaling.sensor_degC, input=words.scaling.input,
                    conditions=conditions, setpoint_ramp=view.setpoint_ramp, boost=view.boost)
    for way in ("rounded", "optimum"):
        recipe = replace(recipe, words_by=way)
        with suppress(HeatertuneError):
            if _same_words(repeat_words(design, fitted, recipe).words, words):
                break
    return recipe


def _demand_words(
    words: Words, document: Document, design: PidDesign, fitted: FittedModel, recipe: DesignProvenance,
    where: Path
) -> None:
    """Refuse words that the design does not make, or that their document describes as others."""
    design_words = repeat_words(design, fitted, recipe).words
    if not _same_words(design_words, words):
        difference = next((f"words.{name}: {value:.9g}; the design makes it {design_words.values[name]:.9g}"
                           for name, value in words.values.items() if design_words.values[name] != value),
                          "TA, sensor range, ramp or boost: the design makes others")
        raise DocumentError(f"{where}: {difference}: they were changed; {_way_on(words)}")
    expected = [(field.name, field.address, field.comment) for field in controller_for(words.target).fields]
    described = [(entry["name"], entry["address"], entry["comment"]) for entry in document.get("fields", ())]
    if described and described != expected:
        raise DocumentError(f"{where}: fields: others than those of {words.target}; {_way_on(words)}")


def _same_words(left: Words, right: Words) -> bool:
    return (left.target, dict(left.values), left.sample_time_s, left.scaling, left.ramp, left.boost) == (
        right.target, dict(right.values), right.sample_time_s, right.scaling, right.ramp, right.boost)


def _demand_model(place: Path, fitted: FittedModel, design_path: Path) -> None:
    """Refuse a `model.json` of another heater than the design's."""
    path = place / "model.json"
    if path.is_file() and design_path.parent == place:
        _demand_same_model(read_document(path, model_document.SCHEMA), fitted, place)


def _demand_same_model(document: Document, fitted: FittedModel, place: Path) -> None:
    own = model_document.to_document(model_document.from_document(document))
    if (apart := _difference("", plain(own), plain(model_document.to_document(fitted)))) is not None:
        raise DocumentError(f"{place / 'model.json'}: {apart[0]}: {apart[1]}; the design in pid.json was made for "
                            f"{apart[2]}: tune again")


def _sample_settings(stored: Document) -> SampleSettings | None:
    """Return which samples a proof was made on; None: on none."""
    drawn = stored.get("samples")
    if drawn is None:
        return None
    names = ("mains_pct", "ambient_degC", "disturbance_pct", "jitter_s")
    spread = {name: drawn["spread"][name] for name in names if name in drawn["spread"]}
    return SampleSettings(samples=drawn["count"], seed=drawn["seed"], quantile=drawn["quantile"], **spread)


def _proof_document(
    words: Words, fitted: FittedModel, conditions: Conditions, samples: SampleSettings | None
) -> dict[str, Any]:
    """Return the document of a proof that is made now, or was made by this very program on this machine."""

    def run() -> dict[str, Any]:
        proof = as_exported(prove(words, fitted, conditions))
        if samples is None:
            return proof.to_document()
        from heatertune.proof.monte_carlo.run import with_samples

        return with_samples(proof, fitted, samples, conditions).to_document()

    inputs = {
        "words": repr(words), "model": model_document.to_document(fitted), "conditions": asdict(conditions),
        "specification": repr(specification_of(conditions)), "samples": repr(samples),
        "libraries": [release(name) for name in ("numpy", "scipy", "numba")]}
    return load_or_compute("proof", inputs, run, lambda document: check_document(document, "the cache"))


def _demand_same(path: Path, name: str, stored: object, again: object, words: Words) -> None:
    if (apart := _difference(name, encode(plain(stored)), encode(plain(again)))) is not None:
        at, one, other = apart
        raise DocumentError(f"{path}: {at}: {one}; proven again it is {other}: the folder was changed or is of another "
                            f"release; {_way_on(words)}")


def _difference(at: str, left: Any, right: Any) -> tuple[str, str, str] | None:
    """Return where two documents differ and what stands there, None where they are the same."""
    if isinstance(left, Mapping) and isinstance(right, Mapping):
        keys = dict.fromkeys((*left, *right))
        parts: Iterator[tuple[str, Any, Any]] = (
            (f"{at}.{key}".lstrip("."), left.get(key), right.get(key)) for key in keys)
        return next((apart for part in parts if (apart := _difference(*part)) is not None), None)
    if isinstance(left, list | tuple) and isinstance(right, list | tuple) and len(left) == len(right):
        pairs = ((f"{at}[{number}]", *pair) for number, pair in enumerate(zip(left, right, strict=True)))
        return next((apart for pair in pairs if (apart := _difference(*pair)) is not None), None)
    return None if _same_value(left, right) else (at, _short(left), _short(right))


def _same_value(left: Any, right: Any) -> bool:
    numbers = [isinstance(value, int | float) and not isinstance(value, bool) for value in (left, right)]
    if all(numbers):
        return math.isclose(left, right, rel_tol=_RELATIVE, abs_tol=_ABSOLUTE)
    return type(left) is type(right) and bool(left == right)


def _short(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _with_sentences(again: Document, stored: Document, path: Path) -> dict[str, Any]:
    """Return a repeated proof with the sentences of the stored one, which must not lack any of its own."""
    result: dict[str, Any] = dict(again)
    for name in _SENTENCES:
        sentences, others = list(again[name]), list(stored[name])
        if missing := [sentence for sentence in sentences if sentence not in others]:
            raise DocumentError(f"{path}: {name}: without {missing[0]!r}: prove the words again")
        if odd := [sentence for sentence in others if not sentence.isprintable()]:
            raise DocumentError(f"{path}: {name}: {odd[0][:40]!r}: expected one line")
        result[name] = others
    return with_digest(result)

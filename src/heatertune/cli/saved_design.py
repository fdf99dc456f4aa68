"""Words and conditions of a saved design (`pid.json`) as defaults of options; options of a known controller."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import options, plc
from heatertune.cli import common
from heatertune.cli.common import again
from heatertune.codec import data_folder, peek_schema, read_document
from heatertune.errors import InputError
from heatertune.options import Option, options_of
from heatertune.plc import NAMES
from heatertune.plc.targets import REPAIRED
from heatertune.settings import Conditions, SensorSettings, WordSettings

if TYPE_CHECKING:
    from heatertune.log.log_values import Log
    from heatertune.model.model_values import FittedModel
    from heatertune.pid.design_document import DesignProvenance
    from heatertune.pid.design_values import PidDesign
    from heatertune.plc import Words
    from heatertune.plc.word_selection import WordChoice

__all__ = ["ProofSource", "add_known_options", "controller_words", "in_force", "parameters_file",
           "proof_source", "redesign_command", "target_in"]


def add_known_options(command: argparse.ArgumentParser) -> None:
    """Add --controller, --words, --setpoint and --assume."""
    group = command.add_argument_group("a log without power, from a known controller")
    group.add_argument("--controller", metavar="NAME", help=f"the controller of this log: one of {', '.join(NAMES)}")
    group.add_argument("--words", metavar="FILE", help="its parameters: words.json as written by export-db")
    group.add_argument("--setpoint", type=float, nargs=1, metavar="°C",
                       help="its setpoint, if the log does not contain it [°C]")
    options.add(group, Conditions, "switches",
                help="known setting of an open point (see: heatertune targets); may be repeated")


def controller_words(settings: argparse.Namespace, logs: Sequence[Log]) -> Words | None:
    """Return the words of the controller that is named, None where none is.

    Raises:
        InputError: words without a controller, a controller without words or with several logs.
        UnknownName: no such controller.
    """
    if settings.controller is None:
        for name in ("words", "setpoint", "assume"):
            if getattr(settings, name):
                raise InputError(f"--{name} needs --controller: it tells what that controller holds")
        return None
    from heatertune.proof.words_file import read_words

    plc.controller_for(settings.controller)  # an unknown name is refused before the file is opened
    if settings.words is None:
        raise InputError("--controller needs --words: without its words a controller is not known")
    if len(logs) > 1:
        raise InputError("--controller takes one log: the words are of one run")
    words = read_words(settings.words, settings.controller)
    if words is None:
        raise InputError(f"{settings.words}: no words; expected words.json as written by export-db")
    return words


#: an option in what was found to pass when a design was made
_OPTION: Final = re.compile(r"(--[a-z][a-z-]*) ([^\s,;:]+)")
_BY_HAND: Final = ("gain", "time_constant", "second_time_constant", "zero", "dead_time", "ambient")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProofSource:
    """What is to be proven.

    Attributes:
        words: of a words file, or of a design.
        choice: how they were found; None: they were given.
        fitted: the heater to prove them on.
        conditions: of the proof.
        ramp: another way of the setpoint than the words have, see `heatertune.proof.setpoint_ramp.prove_ramped`.
        notes: what was taken from the file, and what options took its place, one sentence each.
        way_on: where they fail, what was found when they were made for the very same; None: nobody looked.
        design: from which the words were made; None: the words were given.
        recipe: how they were made from it; None: the words were given.
        structure: of the design behind the words; None: not known.
    """

    words: Words
    choice: WordChoice | None
    fitted_model: FittedModel
    conditions: Conditions
    ramp: float | str | None
    notes: tuple[str, ...]
    way_on: str | None = None
    design: PidDesign | None = None
    recipe: DesignProvenance | None = None
    structure: str | None = None


def proof_source(settings: argparse.Namespace) -> ProofSource:
    """Return what is to be proven of a design or words file.

    Raises:
        InputError: the file holds no model and none is given by hand; words of another target; as `in_force`.
        NotRepresentable, OutOfRange: the words do not fit.
    """
    from heatertune.proof.folder_digest import digest_problem
    from heatertune.proof.repetition import repeat_words
    from heatertune.proof.words_file import read_words

    words, by = read_words(settings.pid, common.target(settings)), options.of(WordSettings, settings)
    ramp = by.setpoint_ramp
    if words is not None:
        words = replace(words, boost=None) if by.boost == "none" else words
        model, sources = _model_of_words(settings)
        if sources and (problem := digest_problem(Path(settings.pid).parent)):
            sources = (*sources, f"{problem}.")
        return ProofSource(words=words, choice=None, fitted_model=model, conditions=common.conditions(settings),
                           ramp=ramp, notes=sources)
    design, fitted, origin = common.design_and_model(settings)
    recipe, notes = in_force(settings, origin, settings.pid)
    choice = repeat_words(design, fitted, recipe)
    same = recipe == origin and ramp is None and not common.by_hand(settings)
    return ProofSource(words=choice.words, choice=choice, fitted_model=fitted, conditions=recipe.conditions, ramp=ramp,
                   notes=tuple(notes), way_on=recipe.way_on if same else None, design=design, recipe=recipe,
                   structure=design.structure)


def _model_of_words(settings: argparse.Namespace) -> tuple[FittedModel, tuple[str, ...]]:
    """Return the model by its numbers, else that of the design next to the parameters, and a note on what was taken."""
    sources = [path for name in ("model.json", "pid.json") if (path := Path(settings.pid).with_name(name)).exists()]
    if common.by_hand(settings) or not sources:
        return common.model_from(settings, None), ()
    design = sources[-1]
    also = f"; {design} has the conditions of the design, too" if design.name == "pid.json" else ""
    return common.model_from(settings, str(sources[0])), (f"Proven on the heaters of {sources[0]}{also}.",)


def parameters_file(path: str) -> str:
    """Return the file of parameters of a design's folder; a file, or what is none, as it is."""
    with suppress(OSError, ValueError):
        if Path(path).is_dir():
            return str(data_folder(path) / "words.json")
    return path


def target_in(path: str) -> str:
    """Return the controller that a saved design or parameters are for.

    Raises:
        InputError: the file names none, or cannot be read.
    """
    from heatertune.pid.design_document import SCHEMA, read_design
    from heatertune.proof.words_file import WORDS_SCHEMA

    schema = peek_schema(path)
    if schema == WORDS_SCHEMA:
        if (target := read_document(path, WORDS_SCHEMA).get("target")) is None:
            raise InputError(f"{path}: target: is missing")
        return str(target)
    recipe = read_design(path)[2] if schema in (SCHEMA, None) else None
    if recipe is None or not recipe.target:
        raise InputError(f"{path} names no controller: add --target NAME (see: heatertune targets)")
    return recipe.target


def redesign_command(settings: argparse.Namespace, source: ProofSource, setpoint_degC: float) -> tuple[str, ...]:
    """Return the whole command that designs again what fails, for the same heater, controller and conditions.

    Args:
        settings: of the command that proved it.
        source: what was proven.
        setpoint_degC: of the proof [°C].
    """
    target, path = source.words.target, Path(settings.pid)
    hand = [part for name in _BY_HAND if (value := getattr(settings, name)) is not None
            for part in (f"--{name.replace('_', '-')}", f"{value:g}")]
    words = ["tune", *(hand or [str(path)]), "--target", REPAIRED.get(target, target)]
    scaling, conditions = source.words.scaling, source.conditions
    words += [] if scaling.input is None else ["--input", scaling.input]
    words += ["--range", *(f"{end:.12g}" for end in scaling.sensor_degC)]
    if conditions.setpoint_degC is None and conditions.profile is None:
        conditions = replace(conditions, setpoint_degC=setpoint_degC)
    if target in REPAIRED:
        conditions = replace(conditions, switches={})
    for name, one in options_of(Conditions).items():
        if (value := getattr(conditions, name)) != one.default:
            words += _typed(one, value)
    if source.choice is not None and source.structure not in (None, "pi"):
        words += ["--structure", str(source.structure)]
    words += ["--out", str(path.with_name(f"{path.stem}_redesigned.json"))]
    changes = [part for flag, value in _OPTION.findall(source.way_on or "") for part in (flag, value)]
    return again(words, changes) if changes else ("heatertune", *words)


def _typed(option: Option, value: Any) -> list[str]:
    """Return an option as the words of a command line."""
    if isinstance(value, Mapping):
        return [part for name, setting in value.items() for part in (option.flag, f"{name}={setting}")]
    if option.kind is tuple:
        return [part for item in value for part in (option.flag, str(item))]
    if option.kind is bool:
        return [option.flag]
    values = value if isinstance(value, tuple) else (value,)
    return [option.flag, *(f"{item:.12g}" if isinstance(item, float) else str(item) for item in values)]


def in_force(settings: argparse.Namespace, origin: DesignProvenance | None, where: str) -> tuple[DesignProvenance,
                                                                                               list[str]]:
    """Return the recipe in force: that of the file with options in the place of what it says, and what is told of it.

    Of a recipe for another controller the conditions hold, but for what is known of that controller.

    Raises:
        InputError: a file of the specification has changed since; another controller whose module gives no degrees;
            as `heatertune.options.of`.
    """
    from heatertune.pid.design_document import DesignProvenance
    from heatertune.proof.repetition import demand_same_files

    target = common.target(settings) if hasattr(settings, "target") else None
    sensor, own = options.provided_options(SensorSettings, settings), options.provided_options(Conditions, settings)
    by = {name: value for name, value in options.provided_options(WordSettings, settings).items()
          if name in ("words_by", "refined")}
    if origin is None:
        return DesignProvenance(target=target or "", conditions=common.conditions(settings), **sensor, **by), []
    demand_same_files(origin, own, where)
    origin, foreign = _of(origin, origin.target if target is None else target, where, sensor)
    if common.by_hand(settings):  # what was accepted was found in another model
        origin = replace(origin, conditions=replace(origin.conditions, accept=()))
    recipe = replace(origin, conditions=_merged(origin.conditions, own), **sensor, **by)
    if "setpoint_ramp" in options.provided_options(WordSettings, settings):
        recipe = replace(recipe, setpoint_ramp=None)
    if options.of(WordSettings, settings).boost == "none":
        recipe = replace(recipe, boost=None)
    return recipe, [*foreign, *_origin_lines(origin, recipe, where)]


def _of(origin: DesignProvenance, target: str, where: str, sensor: Mapping[str, Any]) -> tuple[DesignProvenance,
                                                                                             list[str]]:
    """Return what a recipe says of any controller, where it is of another one, and what of it is not taken then."""
    from heatertune.plc.inputs import has_ends

    degrees = has_ends(plc.controller_for(origin.target).ranges, origin.input)
    if degrees:
        origin = replace(origin, range_degC=options_of(SensorSettings)["range_degC"].default)
    if target == origin.target:
        return origin, []
    has = origin.input in plc.controller_for(target).ranges
    if degrees and not has and not sensor:
        raise InputError(
            f"{where} is for --input {origin.input} of {origin.target}, which {target} has not: say a --range")
    theirs = replace(
        origin, target=target, input=origin.input if has else None, words_by="auto", refined=False, power_most_pct=None,
        window_degC=None, setpoint_ramp=None, boost=None, conditions=replace(origin.conditions, switches={}))
    left = [part for part in _parts(origin) if part not in _parts(theirs)]
    return theirs, [f"Of {where} not taken, as it is of {origin.target}: {', '.join(left)}."] if left else []


def _merged(stored_conditions: Conditions, own: Mapping[str, Any]) -> Conditions:
    """Return conditions with the user's own: a specification in the place of the whole, limits and settings by name."""
    if "spec" in own:
        stored_conditions = replace(stored_conditions, limit=(), tolerance_degC=None, step_power_pct=None)
    limits = own.get("limit", ())
    names = {_name(limit) for limit in limits}
    others = tuple(limit for limit in stored_conditions.limit if _name(limit) not in names)
    return replace(stored_conditions, **{
        **own, "limit": (*others, *limits), "switches": {**stored_conditions.switches, **own.get("switches", {})},
        "accept": tuple(dict.fromkeys((*stored_conditions.accept, *own.get("accept", ()))))})


def _name(limit: str) -> str:
    return limit.partition("=")[0].strip()


def _origin_lines(origin: DesignProvenance, recipe: DesignProvenance, where: str) -> Iterator[str]:
    """Return the settings that are taken from the file, and those that are not."""
    origin_parts, recipe_parts = list(_parts(origin)), list(_parts(recipe))
    if common := [part for part in recipe_parts if part in origin_parts]:
        yield f"As {where} has it: {', '.join(common)}."
    if left := [part for part in origin_parts if part not in recipe_parts]:
        yield f"Not as {where} has it, for an option says otherwise: {', '.join(left)}."


def _parts(recipe: DesignProvenance) -> Iterator[str]:
    """Return the settings of a recipe beyond the defaults, as on the command line."""
    for kind, holder in ((SensorSettings, recipe), (WordSettings, recipe), (Conditions, recipe.conditions)):
        for name, one in options_of(kind).items():
            value = getattr(holder, name, one.default)
            if name not in ("setpoint_ramp", "boost") and value != one.default:
                yield from _flags(one, value)
    if recipe.power_most_pct is not None:
        yield f"an output of at most {recipe.power_most_pct:.3g} %"
    if recipe.window_degC is not None:
        yield f"a window of {recipe.window_degC:.3g} °C"
    if recipe.setpoint_ramp is not None:
        ramp = recipe.setpoint_ramp
        holdback = "" if ramp.hold_degC is None else f" held within {ramp.hold_degC:.3g} °C of the reading"
        yield f"a setpoint ramp of {ramp.degC_per_min:.3g} °C/min{holdback}"
    if recipe.boost is not None:
        yield f"a boost to {recipe.boost.within_degC:.3g} °C from the setpoint"


def _flags(option: Option, value: Any) -> Iterator[str]:
    """Return an option as the command line would have it, as often as it would."""
    if isinstance(value, Mapping):
        yield from (f"{option.flag} {name}={setting}" for name, setting in value.items())
    elif option.kind is tuple:
        yield from (f"{option.flag} {item}" for item in value)
    elif option.kind is bool:
        yield option.flag
    else:
        values = value if isinstance(value, tuple) else (value,)
        yield " ".join([option.flag, *(f"{item:.6g}" if isinstance(item, float) else str(item) for item in values)])

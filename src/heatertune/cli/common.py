"""What the commands share: groups of options, their conversion to values, and one-line errors for bad arguments."""

from __future__ import annotations

import argparse
import copy
import os
import re
import sys
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

from heatertune import options, plc
from heatertune.cli.command_table import FIRST_OPTIONS, current_options
from heatertune.codec import peek_schema
from heatertune.errors import InputError, UnknownName, did_you_mean
from heatertune.options import point_of
from heatertune.plc.open_points import settings_of
from heatertune.plc.targets import COOLING, FAITHFUL, NAMES, target_by_name
from heatertune.settings import (
    Conditions,
    FitSettings,
    ReadSettings,
    SampleSettings,
    SensorSettings,
    TuneSettings,
    WordSettings,
    refuse_unused_limits,
)
from heatertune.units import check

if TYPE_CHECKING:
    from heatertune.model.model_values import FittedModel
    from heatertune.pid.design_document import DesignProvenance
    from heatertune.pid.design_values import PidDesign
    from heatertune.plc.dump_reader import Machine
    from heatertune.proof.redesign import DesignRequest

__all__ = [
    "FULL", "CommandParser", "CommandStub", "add_condition_options", "add_log_options", "add_model_options",
    "add_proof_options", "add_reading_options", "add_tuning_options", "add_word_options", "again", "by_hand",
    "conditions", "demand_folder", "design_and_model", "design_request", "interval_by_words", "model_from",
    "reading", "sample_time", "scaling", "target", "wants_proof", "words_of_machine",
]


#: what --json=full is to argparse, whose options with a value that may be missing would take the next word for it
FULL: Final = "--json-full"
_OF_SEVERAL: Final = ("--setpoint",)  # options with one number or two


#: columns of an option and of what it is, in the first layer of the help on a terminal of 80
_OPTION_COLUMNS: Final = 25
_TEXT_COLUMNS: Final = 51


#: a value that begins with a minus, no option; with a decimal comma, too
_NEGATIVE: Final = re.compile(r"^-\d+$|^-\d*[.,]\d+$")


def _number_hint(text: str) -> str:
    """Return what a text that is no number may have been meant as; nothing where that is not clear."""
    number = re.match(r"[-+]?[0-9]+(?:[.,][0-9]+)?", text)
    if re.fullmatch(r"[-+]?\d{1,3}(,\d{3})+", text):
        return f": write {text.replace(',', '')}, or {text.replace(',', '.', 1)}"
    if (ends := re.fullmatch(r"(\d+)\s*(?:-|\.\.|…|:)\s*(\d+)", text)) is not None:
        return f": write {ends[1]} {ends[2]}"
    return f": write {point_of(number[0])}, without a unit" if number is not None else ""


class _HelpAll(argparse.Action):
    """Print the help with all options, and end."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None) -> None:
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(parser.format_help(), end="")
        parser.exit()


class CommandParser(argparse.ArgumentParser):
    """A parser whose complaints are one line, with exit status 2, and whose help has two layers.

    `--help` shows the options of `FIRST_OPTIONS`, `--help-all` and `format_help` all of them.
    """

    def __init__(self, **keywords: Any) -> None:
        """Make the parser; keywords as of `argparse.ArgumentParser`."""
        super().__init__(**keywords | {"add_help": False})
        command = self.prog.rpartition(" ")[2]
        self._first: Final = FIRST_OPTIONS.get(command, ())
        self.add_argument("-h", "--help", action="help", help=(
            "show the options that matter most and exit" if self._first else "show this help message and exit"))
        self._negative_number_matcher = _NEGATIVE
        self.add_argument("--help-all", action=_HelpAll, help=(
            "show all options and exit" if self._first else argparse.SUPPRESS))

    def print_help(self, file: Any = None) -> None:
        """Print the first layer of the help, or all of it where there is one layer."""
        self._print_message(self.format_first_help() if self._first else self.format_help(), file or sys.stdout)

    def format_first_help(self) -> str:
        """Return the first layer of the help: the options that matter most, a line each, and an example."""
        by_flag = {flag: action for action in self._actions for flag in action.option_strings}
        shown = [action for action in self._actions if not action.option_strings]
        shown += [by_flag[flag] for flag in self._first]
        others = argparse.Action((), "option", nargs="*", metavar="OPTION")
        formatter = argparse.HelpFormatter(self.prog, max_help_position=_OPTION_COLUMNS + 2)
        needed = [action for action in shown if action.required or not action.option_strings]
        formatter.add_usage(None, [*needed, others], ())
        sentence = re.split(r"(?<=[.])\s", self.description or "")[0]
        formatter.add_text(f"{_first_clause(sentence.removesuffix('.'))}.")
        formatter.start_section("the options that matter most")
        formatter.add_arguments(map(_in_brief, shown))
        formatter.end_section()
        formatter.add_text(self.epilog)
        return f"{formatter.format_help()}all options: {self.prog} --help-all\n"

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        """Return a value of the command line; a number may have a decimal comma."""
        if action.type not in (float, int):
            return super()._get_value(action, arg_string)  # argparse has no public way to a value
        try:
            return action.type(point_of(arg_string) if action.type is float else arg_string)
        except ValueError:
            kind = "a whole number" if action.type is int else "a number"
            hint = _number_hint(arg_string)
            raise argparse.ArgumentError(action, f"{arg_string!r} is not {kind}{hint}") from None

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse what is not one of the choices, and name the closest one."""
        if action.choices is not None and value not in action.choices:
            choices = [str(each) for each in action.choices]
            expected = choices[0] if len(choices) == 1 else f"{', '.join(choices[:-1])} or {choices[-1]}"
            meant = did_you_mean(str(value), choices)
            raise argparse.ArgumentError(action, f"unknown value {value!r}{meant} (expected {expected})")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options; "--option=--" has no value, argparse makes a list of it."""
        arguments = current_options(sys.argv[1:] if args is None else args)
        for argument in arguments:
            if argument.startswith("-") and argument.endswith("=--"):
                self.error(f"argument {argument.removesuffix('=--')}: expected a value, got '--'")
        return super().parse_args([FULL if each == "--json=full" else each for each in arguments], namespace)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options of a command; one that it does not have is named before any that is missing."""
        flags = tuple(flag for action in self._actions for flag in action.option_strings)
        words = list(takewhile(lambda word: word.startswith("-"), args)) if self._subparsers else args
        if (unknown := _unknown(words, flags)) is not None:
            meant = did_you_mean(unknown, flags)
            if meant or not self._subparsers:  # what stands before the command may be an option of it
                self.error(f"unknown option {unknown}{meant}")
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Raise the complaint as an input error, with the layer of the help that shows the options it names.

        Raises:
            InputError: always.
        """
        flags = re.findall(r"--[a-z][a-z-]*", message)
        layer = "--help-all" if self._first and not {*flags} <= {*self._first} else "--help"
        if message.startswith("unrecognized arguments") and " -" not in message:
            message += "; write a list as one word, --zones a,b, and quote what has spaces"
        if message.endswith("expected 2 arguments"):
            message += f": two numbers, such as {flags[0]} 0 100"
        raise InputError(f"{message} (see: {self.prog} {layer})")


def _unknown(words: Sequence[str], flags: tuple[str, ...]) -> str | None:
    """Return the first long option of a command line that no flag begins with."""
    options = takewhile(lambda word: word != "--", words)
    names = (word.partition("=")[0] for word in options if word.startswith("--"))
    return next((name for name in names if not any(flag.startswith(name) for flag in flags)), None)


def _in_brief(action: argparse.Action) -> argparse.Action:
    """Return an argument with the first clause of its help; choices too long for the option stand there."""
    brief = copy.copy(action)
    brief.help = _first_clause(action.help or "")
    flag = max(action.option_strings, key=len, default="")
    if action.choices and _too_long(flag, f"{{{','.join(action.choices)}}}"):
        brief.help = _listed(brief.help.partition(" (default")[0], list(action.choices))
        brief.metavar, brief.choices = _short_metavar(flag), None
    elif isinstance(action.metavar, str) and _too_long(flag, action.metavar):
        brief.metavar = _short_metavar(flag)
    brief.help = _with_default(brief.help, action.help or "")
    return brief


def _with_default(clause: str, text: str) -> str:
    """Return the first clause of a help with the default that the help names, where that fits into the line."""
    default = re.search(r" \(default: [^()]*\)", text)
    if default is None:
        return clause
    alone = clause.removesuffix(default[0])
    return alone + default[0] if len(alone + default[0]) <= _TEXT_COLUMNS else alone


def _too_long(flag: str, values: str) -> bool:
    """Return whether an option with its values is wider than its column; a positional argument never is."""
    return bool(flag) and len(f"{flag} {values}") > _OPTION_COLUMNS - 2


def _short_metavar(flag: str) -> str:
    """Return what stands for the value of an option: the flag's last word, or its initial where that is too long."""
    word = flag.rpartition("-")[2].upper()
    return word[0] if _too_long(flag, word) else word


def _listed(text: str, choices: list[str]) -> str:
    """Return a text with as many choices as its line holds."""
    whole = f"{text}: {', '.join(choices)}"
    while len(whole) > _TEXT_COLUMNS and len(choices) > 1:
        choices = choices[:-1]
        whole = f"{text}: {', '.join(choices)}, …"
    return whole


def _first_clause(text: str) -> str:
    """Return a help up to the first semicolon or colon outside brackets."""
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter in "([{") - (letter in ")]}")
        if depth == 0 and text.startswith(("; ", ": "), place):
            return text[:place]
    return text


def again(arguments: Sequence[str], options: Sequence[str]) -> tuple[str, ...]:
    """Return a command with options in the place of what it says there; nothing without options.

    Args:
        arguments: as it was typed, without the program's name.
        options: flags, each followed by its value, or values in one; of values NAME=VALUE only those of the name are
            replaced.
    """
    if not options:
        return ()
    command = tuple(arguments)
    for flag, value in zip(options[::2], options[1::2], strict=True):
        if flag == "--target":
            command = tuple(word for word in command if word != "--as-printed")  # the target says which
        command = (*_without(command, flag, value.partition("=")[0] if "=" in value else ""), flag, *value.split())
    return ("heatertune", *command)


def _without(arguments: Sequence[str], flag: str, name: str) -> tuple[str, ...]:
    """Return a command without a flag and its value; where there is a name, only where the value is of that name."""
    words, queue = list[str](), list(arguments)
    while queue:
        word = queue.pop(0)
        value = word.removeprefix(f"{flag}=") if word.startswith(f"{flag}=") else queue[0] if word == flag else None
        if value is None or (name and value.partition("=")[0].strip() != name):
            words.append(word)
        elif word == flag:
            queue.pop(0)
            while flag in _OF_SEVERAL and queue and _is_number(queue[0]):
                queue.pop(0)
    return tuple(words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


class CommandStub:
    """In place of a command's parser where the command is only named: what is added to it is forgotten."""

    def __init__(self, **_: Any) -> None: ...

    def __getattr__(self, _: str) -> Any:
        return lambda *_, **__: self


def add_reading_options(command: argparse.ArgumentParser) -> None:
    """Add the options that tell how a log file is to be read."""
    group = command.add_argument_group("reading the log")
    options.add(group, ReadSettings)
    options.add(group, FitSettings, "until_s")


def add_log_options(command: argparse.ArgumentParser) -> None:
    """Add the options that tell how a log file is to be read and fitted."""
    add_reading_options(command)
    options.add(command.add_argument_group("fitting the log"), FitSettings, but=("until_s",))


def add_model_options(command: argparse.ArgumentParser) -> None:
    """Add the options of a model given by hand."""
    group = command.add_argument_group("a model by its numbers, instead of a model file")
    group.add_argument("--gain", type=float, metavar="°C/%",
                       help="temperature rise per percent of power [°C/%%]; negative for a cooler")
    group.add_argument("--time-constant", type=float, metavar="S", help="time constant [s]")
    group.add_argument("--second-time-constant", type=float, metavar="S", help="second time constant, if any [s]")
    group.add_argument("--zero", type=float, metavar="S", help="time of the zero, where a fast element heats a slow "
                       "mass: between the second time constant and the first [s]")
    group.add_argument("--dead-time", type=float, metavar="S", help="dead time [s]")
    group.add_argument("--ambient", type=float, metavar="°C", help="ambient temperature, reached without power [°C]")


def add_tuning_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `tune`."""
    options.add(command.add_argument_group("tuning"), TuneSettings, but=("step_power_pct",))


def add_proof_options(command: argparse.ArgumentParser, *, target: str | None = None, needed: bool = True) -> None:
    """Add the target, which must be given where it is needed and has no default, and the conditions of the proof."""
    group = command.add_argument_group("target")
    default = "" if target is None else f" (default: {target})"
    group.add_argument("--target", required=needed and target is None, default=target, metavar="NAME",
                       type=target_by_name,
                       help=f"the controller (see: heatertune targets): {', '.join(NAMES)}{default}")
    group.add_argument("--as-printed", action="store_true",
                       help="the program exactly as its source prints it, with its faults (s7-200)")
    options.add(group, Conditions, "switches", default=argparse.SUPPRESS)
    add_condition_options(command)


def add_condition_options(command: argparse.ArgumentParser, *sensor: str) -> None:
    """Add the conditions of the proof; what is not said is not there, so that another source of it can be asked.

    Args:
        command: to add them to.
        sensor: names of the sensor's options; none: all of them.
    """
    group = command.add_argument_group("conditions of the proof")
    options.add(group, SensorSettings, *sensor, default=argparse.SUPPRESS)
    options.add(group, Conditions, but=("switches",), default=argparse.SUPPRESS)


def add_word_options(command: argparse.ArgumentParser, *names: str, but: Sequence[str] = ()) -> None:
    """Add the options of the words, or those of the names; what is not said is not there."""
    options.add(command, WordSettings, *names, but=but, default=argparse.SUPPRESS)


def conditions(settings: argparse.Namespace) -> Conditions:
    """Return the conditions of the proof, refused before anything is computed.

    Raises:
        InputError: as `heatertune.options.of`.
        UnknownName: no such limit, specification, finding to accept, open point or setting.
        DocumentError: a file of a specification or profile that cannot be read.
    """
    from heatertune.proof.specification import specification_of
    from heatertune.proof.verdict import FitDiagnostics

    proof_conditions = options.of(Conditions, settings)
    specification_of(proof_conditions)
    FitDiagnostics(accepted=proof_conditions.accept)
    if getattr(settings, "target", None) is not None and proof_conditions.switches:
        settings_of(plc.controller_for(target(settings)).switches, proof_conditions.switches)
    return proof_conditions


def reading(settings: argparse.Namespace) -> ReadSettings:
    """Return how a log file is to be read; errors as `heatertune.options.of`."""
    return options.of(ReadSettings, settings)


def demand_folder(path: str | Path) -> None:
    """Refuse a folder for results that cannot be written, before anything is computed.

    Raises:
        InputError: a file of that name, or a folder that the user may not write.
    """
    folder = Path(path)
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not there.is_dir():
        raise InputError(f"--out {path}: {'' if there == folder else f'{there} is '}a file; expected a folder")
    if not os.access(there, os.W_OK):
        raise InputError(f"--out {path}: {there} cannot be written")


def sample_time(settings: argparse.Namespace) -> float | None:
    """Return the sampling interval [s], None for auto; errors as `heatertune.options.of`."""
    interval: float | None = options.options_of(TuneSettings)["sample_time_s"].read(settings.sample_time)
    return interval


def interval_by_words(settings: argparse.Namespace) -> bool:
    """Return whether TA is to be found by the words."""
    return bool(settings.sample_time == "words")


def target(settings: argparse.Namespace) -> str:
    """Return the target; with --as-printed the same as its source prints it, with --cooling-gain the one with a cooler.

    Raises:
        UnknownName: --as-printed for a target that has no such version.
    """
    if not settings.as_printed:
        cools = options.provided_options(Conditions, settings).get("cooling_gain") is not None
        return COOLING.get(settings.target, settings.target) if cools else str(settings.target)
    if settings.target not in FAITHFUL:
        raise UnknownName("target with --as-printed", settings.target, FAITHFUL)
    return FAITHFUL[settings.target]


def design_request(settings: argparse.Namespace) -> DesignRequest:
    """Return what a design is asked for; errors as `conditions` and `heatertune.pid.tune.refuse_contradictions`."""
    from heatertune.pid.tune import refuse_contradictions
    from heatertune.proof.design_request import DesignRequest

    by, tuning = options.of(WordSettings, settings), options.of(TuneSettings, settings)
    refuse_contradictions(tuning)
    refuse_unused_limits(tuning)
    return DesignRequest(
        target=target(settings), tune_settings=tuning,
        scaling=scaling(settings) if options.provided_options(SensorSettings, settings) else None,
        conditions=conditions(settings), interval_by_words=interval_by_words(settings), words_by=by.words_by,
        refined=by.refined, setpoint_ramp=by.setpoint_ramp, boost=by.boost, switch_kind=by.switch_kind,
        as_is=by.as_is, sample_settings=options.of(SampleSettings, settings))


def scaling(settings: argparse.Namespace) -> plc.Scaling:
    """Return the sensor range as its module gives it.

    Raises:
        InputError: a module's range without a target; else as `heatertune.plc.inputs.sensor_scaling`.
    """
    sensor = options.of(SensorSettings, settings)
    if sensor.input is None:
        low, high = sensor.range_degC
        return plc.Scaling(low_degC=low, high_degC=high)
    if settings.target is None:
        raise InputError("--input needs --target: the ranges are its module's")
    return plc.controller_for(target(settings)).scaled(sensor.input, sensor.range_degC)


def design_and_model(settings: argparse.Namespace) -> tuple[PidDesign, FittedModel, DesignProvenance | None]:
    """Return the design of a file, the model to prove it on, given by hand or else the file's, and its words' recipe.

    Raises:
        InputError: the file holds no model and none is given by hand.
    """
    from heatertune.pid.design_document import read_design

    design, model, recipe = read_design(settings.pid)
    return design, model if model is not None and not by_hand(settings) else model_from(settings, None), recipe


def words_of_machine(settings: argparse.Namespace, path: str) -> Machine:
    """Return what a dump or text of a controller holds; errors as `heatertune.plc.dump_reader.read_machine`.

    Raises:
        InputError: the file cannot be read.
    """
    from heatertune.plc.dump_reader import content_of, gain_depends_on_range, read_machine

    if settings.called_every is not None:
        check("--called-every", settings.called_every, above=0.0)
    controller, sensor = plc.controller_for(target(settings)), scaling(settings)
    read = read_machine(controller, content_of(path), sample_time_s=settings.called_every, scaling=sensor, source=path,
                        stated=conditions(settings).switches)
    if options.provided_options(SensorSettings, settings).keys() & {"range_degC"} or not gain_depends_on_range(
            controller, read.words):
        return read
    return read._replace(assumed=(*read.assumed, f"a sensor of {sensor.low_degC:g} to {sensor.high_degC:g} °C, else "
                                  "--range LOW HIGH"))


def wants_proof(settings: argparse.Namespace) -> bool:
    """Return whether an option asks for a proof of its own: a heater by hand, another condition, a ramp, no boost."""
    export_options = {"accept"}  # an export takes these without another proof
    proof_options = options.provided_options(Conditions, settings).keys() - export_options
    by = options.of(WordSettings, settings)
    return bool(proof_options) or by.setpoint_ramp is not None or by.boost == "none" or by.refined or by_hand(settings)


def by_hand(settings: argparse.Namespace) -> bool:
    """Return whether a model is given by hand."""
    return any(getattr(settings, name, None) is not None for name in ("gain", "time_constant", "dead_time"))


def _options_set(settings: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: getattr(settings, name) for name in names if getattr(settings, name) is not None}


def _model_of_design(path: str) -> FittedModel | None:
    """Return the model that a pid.json holds; None where the file is none."""
    from heatertune.pid.design_document import SCHEMA, read_design

    if peek_schema(path) != SCHEMA:
        return None
    model = read_design(path)[1]
    if model is None:
        raise InputError(f"{path} is a design without its model: give the model.json, or --gain, --time-constant and "
                         "--dead-time")
    return model


def model_from(settings: argparse.Namespace, path: str | None) -> FittedModel:
    """Return the model of a file (model.json, or the one in a pid.json), or the one given by hand.

    Raises:
        InputError: both or neither are given, or a number of the hand-given model is missing.
    """
    from heatertune.model.model_document import read_model
    from heatertune.model.model_values import model_by_hand
    from heatertune.model.two_scales import heater_of_numbers

    names = ("gain", "time_constant", "dead_time")
    numbers = _options_set(settings, *names)
    if path is not None and numbers:
        raise InputError("name a model file or --gain, --time-constant, --dead-time, not both")
    if path is not None:
        return _model_of_design(path) or read_model(path)
    missing = [f"--{name.replace('_', '-')}" for name in names if name not in numbers]
    if missing:
        raise InputError(f"no model: name a model file, or add {', '.join(missing)}")
    return model_by_hand(heater_of_numbers(
        gain_degC_per_pct=settings.gain, time_constant_s=settings.time_constant, dead_time_s=settings.dead_time,
        second_time_constant_s=settings.second_time_constant, zero_s=settings.zero, ambient_degC=settings.ambient))

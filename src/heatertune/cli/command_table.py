"""The commands: where each is, which options its `--help` shows, and what completes a command line.

`--help-all` shows the other options, too. The user's `heatertune.toml` states options that a command line leaves out.

This is the one place in the core that names modules of the extras: batch, live, studio, supervision, zones.
"""

from __future__ import annotations

import argparse
import os
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from heatertune.codec import existing_path, read_toml
from heatertune.errors import DocumentError, InputError, closest, did_you_mean

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Callable, Iterator, Sequence

    from heatertune.proof.difference import WriteHistory

__all__ = [
    "BUILT_IN", "COMMAND_MODULES", "FIRST_OPTIONS", "Command", "command", "current_options", "demand_files",
    "design_zones", "read_settings", "settings_file", "with_user_settings", "write_records",
]

#: command, in the order of the help → its module in heatertune
COMMAND_MODULES: Final = {
    "design": "cli.tuning",
    "read": "cli.identification",
    "fit": "cli.identification",
    "validate": "cli.identification",
    "plan": "cli.identification",
    "spec": "cli.reference",
    "tune": "cli.tuning",
    "pareto": "cli.tuning",
    "export-db": "cli.export_verify",
    "verify": "cli.export_verify",
    "supervise": "supervision.command",
    "feed-forward": "cli.export_verify",
    "compare": "cli.tuning",
    "advise": "cli.running_controller",
    "study": "batch.command",
    "fleet": "batch.command",
    "health": "live.commands.record_watch",
    "report": "cli.export_verify",
    "decode": "cli.running_controller",
    "diff": "cli.running_controller",
    "replay": "cli.running_controller",
    "targets": "cli.reference",
    "terms": "cli.reference",
    "studio": "studio.command",
    "simulate": "live.commands.simulate",
    "record": "live.commands.record_watch",
    "experiment": "live.commands.run_experiment",
    "write": "live.commands.write_rollback",
    "rollback": "live.commands.write_rollback",
    "watch": "live.commands.record_watch",
    "doctor": "cli.reference",
    "bench": "cli.reference",
    "completion": "cli.reference",
}

_UNITS: Final = ("--temperature-unit", "--power-full-scale")
_COLUMNS: Final = ("--temperature-column", "--power-column", *_UNITS)
_TARGET: Final = ("--target", "--setpoint", "--range")
_MODEL: Final = ("--gain", "--time-constant", "--dead-time", "--ambient")
_OUTPUT: Final = ("--json", "--quiet")

#: command → its flags in the first layer, at most one screen in this order; a command that is not here shows all
FIRST_OPTIONS: Final[dict[str, tuple[str, ...]]] = {
    "design": ("--out", *_TARGET, *_UNITS, "--setpoint-ramp", "--structure", "--ms", "--limit", "--accept", "--force",
               *_OUTPUT),
    "read": ("--time-column", *_COLUMNS, "--setpoint-column", "--time-unit", "--log-interval", "--tag", "--run",
             "--skip-rows", *_OUTPUT),
    "fit": ("--out", *_COLUMNS, "--ambient", "--dead-time-at-most", "--until", "--cooler", "--thermostat",
            "--controller", "--words", "--hypotheses", *_OUTPUT),
    "validate": ("--out", "--least-fit", *_COLUMNS, "--ambient", "--power-before", "--until", *_OUTPUT),
    "plan": ("--out", "--limit-temperature", *_MODEL, "--max-duration", "--power", "--aim", "--kind", "--json"),
    "tune": ("--out", *_TARGET, *_MODEL, "--structure", "--method", "--ms", "--setpoint-ramp", "--limit", "--json"),
    "pareto": ("--out", *_MODEL, "--structure", "--ms-range", "--points", "--objective", "--sample-time", *_OUTPUT),
    "export-db": ("--out", *_TARGET, "--pwm-period", "--words", "--setpoint-ramp", "--assume", "--spec", "--limit",
                  "--accept", "--force", *_OUTPUT),
    "verify": (*_TARGET, "--pwm-period", "--assume", "--spec", "--limit", "--accept", "--noise", "--samples",
               "--json", "--verbose"),
    "supervise": ("--out", *_TARGET, *_MODEL, "--spread", "--ambient-spread", "--least-noise", "--samples", "--json"),
    "compare": ("--out", "--setpoint", "--range", "--pwm-period", "--spec", "--limit", "--accept", *_MODEL, *_OUTPUT),
    "advise": ("--pid", *_TARGET, "--spec", "--limit", *_COLUMNS, *_OUTPUT),
    "fleet": ("--out", *_TARGET, *_UNITS, "--structure", "--ms", "--limit", "--accept", "--samples", "--resume",
              "--jobs", "--json"),
    "health": ("--out", "--loops", "--since", "--duration", "--interval", *_TARGET, *_UNITS, "--limit", "--json"),
    "report": ("--plant-tag", "--as-left", "--setpoint", "--ambient", "--begins-at", "--load-at", *_UNITS, "--record",
               *_OUTPUT),
    "decode": (*_TARGET, "--input", "--called-every", "--model", *_MODEL, "--assume", "--spec", "--limit", *_OUTPUT),
    "simulate": ("--serve", "--port", "--rate", "--sample", "--fault", "--faults", "--setpoint", "--noise", *_OUTPUT),
    "record": ("--out", "--duration", "--interval", "--design", "--map", *_OUTPUT),
    "experiment": ("--design", "--out", "--limit-temperature", "--limit-rate", "--until", "--in-manual", "--restore",
                   "--yes", *_OUTPUT),
    "write": ("--apply", "--confirm", "--called-every", "--range", "--as-exported", "--in-manual", "--no-watch",
              "--record", *_OUTPUT),
}


class Command(NamedTuple):
    """A command.

    Attributes:
        add_to: adds its parser to the parsers of the commands.
        example: of its use, the last line of its help.
    """

    add_to: Callable[[Any], None]
    example: str


def command(name: str) -> Command:
    """Import a command: of its module the function `add_` and the constant `_EXAMPLE` of its name."""
    module, stem = import_module(f"heatertune.{COMMAND_MODULES[name]}"), name.replace("-", "_")
    return Command(getattr(module, f"add_{stem}"), getattr(module, f"{stem.upper()}_EXAMPLE"))


#: options of the releases before 0.9.0 → what they are called now; they are understood, but not listed
_RENAMED: Final = {
    "--switch": "--assume", "--as-is": "--no-redesign", "--faithful": "--as-printed", "--broken": "--faults-per-kind",
    "--most-writes": "--max-writes"}
#: likewise, of some commands alone: "--yes" of `experiment` takes no value, and stays
_RENAMED_IN: Final = {
    "write": {"--yes": "--confirm"}, "rollback": {"--yes": "--confirm"},
    **{name: {"--for": "--duration", "--every": "--interval"} for name in ("health", "record", "watch")}}


def current_options(arguments: Sequence[str]) -> list[str]:
    """Return a command line in which the options of earlier releases have the names of today."""
    names = _RENAMED | _RENAMED_IN.get(arguments[0] if arguments else "", {})
    options = (each.partition("=") for each in arguments)
    return [f"{names.get(option, option)}{equals}{value}" for option, equals, value in options]


def design_zones(settings: Namespace) -> int:
    """Run `design --zones`; return its exit status."""
    return int(import_module("heatertune.zones.command").run(settings))


def write_records(paths: Sequence[str], directory: str) -> WriteHistory:
    """Read the records of writes that a report is to show; errors as `heatertune.live.write.rollback.write_records`."""
    history: WriteHistory = import_module("heatertune.live.write.rollback").write_records(paths, directory)
    return history


_NAME: Final = "heatertune.toml"
#: keys of the file: options by their names; the controller, its sensor, the specification and the PWM
KEYS: Final = (
    "target", "range", "input", "spec", "pwm-period", "pwm-rule", "pwm-resolution", "minimum-on", "minimum-off",
    "switch-kind", "temperature-unit", "power-full-scale")
#: commands that begin something; those that repeat what a file records take it from there
_COMPLETED: Final = ("design", "tune", "fleet", "advise", "supervise", "decode")
#: what stands for an existing file in the help of a command
_FILES: Final = ("LOG", "MODEL", "PID", "PID|WORDS", "WORDS", "INPUTS", "IMAGE", "DUMP")
#: logs that come with heatertune
BUILT_IN: Final = ("table3", "table4")


def settings_file() -> Path | None:
    """Return the file of the user's settings: of this folder, else of the user's config folder; None: there is none."""
    home = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return next((path for path in (Path(_NAME), home / "heatertune" / _NAME) if path.is_file()), None)


def with_user_settings(words: tuple[str, ...], parser: argparse.ArgumentParser) -> tuple[tuple[str, ...], str]:
    """Return a command line with what the user's file says of options that it leaves out, and a line that says so.

    Raises:
        DocumentError: the file is no TOML, or has a key or value that no option has.
    """
    if words[0] not in _COMPLETED or any(word in ("-h", "--help", "--help-all") for word in words):
        return words, ""
    path = settings_file()
    if path is None:
        return words, ""
    flags = {flag for action in _actions(parser, words[0]) for flag in action.option_strings}
    options = [word.partition("=")[0] for word in words if word.startswith("--")]
    added: list[str] = []
    for key, values in read_settings(path).items():
        flag = f"--{key}"
        if flag in flags and not any(len(word) > 2 and flag.startswith(word) for word in options):
            added += [flag, *values]
    return (*words, *added), f"[{path}] {' '.join(added)}" if added else ""


def read_settings(path: Path) -> dict[str, list[str]]:
    """Return the options of the file, each with its values as a command line has them.

    Raises:
        DocumentError: no TOML, or a key or value that no option has.
    """
    options = {}
    for name, value in read_toml(path).items():
        key = name.replace("_", "-")
        if key not in KEYS:
            raise DocumentError(f"{path}: {name}: no such key{did_you_mean(key, KEYS)} (known: {', '.join(KEYS)})")
        values = value if isinstance(value, list) else [value]
        if not values or any(isinstance(each, bool) or not isinstance(each, str | int | float) for each in values):
            raise DocumentError(f"{path}: {name}: expected a text, a number, or a list of them")
        options[key] = [f"{each}" for each in values]
    return options


def demand_files(parser: argparse.ArgumentParser, settings: argparse.Namespace) -> None:
    """Refuse a file that is not there, where the name of another one, or of a built-in log, is near.

    Raises:
        InputError: such a file.
    """
    names = vars(settings)
    for action in _actions(parser, ""):
        if action.option_strings or action.metavar not in _FILES or not isinstance(names.get(action.dest), str | list):
            continue
        paths = names[action.dest]
        for name in [paths] if isinstance(paths, str) else paths:
            is_there = name.lower() in BUILT_IN or os.path.lexists(existing_path(name))
            near = "" if is_there else _near(name, log=action.metavar == "LOG")
            if near:
                raise InputError(f"{name}: cannot be read: No such file or directory; did you mean {near}?")


def _near(name: str, *, log: bool) -> str | None:
    folder = Path(name).parent
    try:
        there = {str(folder / each.name): each.name for each in folder.iterdir() if each.is_file()}
    except (OSError, ValueError):  # no name of a folder can be that long, or hold a zero byte
        there = {}
    names = {each: path for path, each in there.items()} | ({each: each for each in BUILT_IN} if log else {})
    near = closest(Path(name).name, names)
    return None if near is None else names[near]


def _actions(parser: argparse.ArgumentParser, command: str) -> Iterator[Any]:
    """Yield the actions of a parser and of its commands, or of the one that is named."""
    for action in parser._actions:  # argparse has no public way to them
        if isinstance(action, argparse._SubParsersAction):
            for name, its in action.choices.items():
                if command in ("", name):
                    yield from its._actions
        else:
            yield action

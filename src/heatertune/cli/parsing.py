"""Arguments → options, complaints in one line."""

from __future__ import annotations

import argparse
import copy
import re
import sys
from collections.abc import Sequence
from itertools import takewhile
from typing import Any, Final, NoReturn

from heatertune.cli.command_table import FIRST_OPTIONS
from heatertune.errors import InputError, did_you_mean

__all__ = ["FULL", "CommandParser", "CommandStub", "again"]

#: what --json=full is to argparse, whose options with a value that may be missing would take the next word for it
FULL: Final = "--json-full"
_OF_SEVERAL: Final = ("--setpoint",)  # options with one number or two


#: columns of an option and of what it is, in the first layer of the help on a terminal of 80
_OPTION_COLUMNS: Final = 25
_TEXT_COLUMNS: Final = 51


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

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options; "--option=--" has no value, argparse makes a list of it."""
        given = sys.argv[1:] if args is None else args
        for argument in given:
            if argument.startswith("-") and argument.endswith("=--"):
                self.error(f"argument {argument.removesuffix('=--')}: expected a value, got '--'")
        return super().parse_args([FULL if each == "--json=full" else each for each in given], namespace)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options of a command; one that it does not have is named before any that is missing."""
        if not self._subparsers:
            flags = tuple(flag for action in self._actions for flag in action.option_strings)
            if (unknown := _unknown(args, flags)) is not None:
                self.error(f"unknown option {unknown}{did_you_mean(unknown, flags)}")
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Raise the complaint as an input error, with the layer of the help that shows the options it names.

        Raises:
            InputError: always.
        """
        named = re.findall(r"--[a-z][a-z-]*", message)
        layer = "--help-all" if self._first and not {*named} <= {*self._first} else "--help"
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


def again(given: Sequence[str], options: Sequence[str]) -> tuple[str, ...]:
    """Return a command with options in the place of what it says there; nothing without options.

    Args:
        given: as it was typed, without the program's name.
        options: flags, each followed by its value, or values in one; of values NAME=VALUE only those of the name are
            replaced.
    """
    if not options:
        return ()
    command = tuple(given)
    for flag, value in zip(options[::2], options[1::2], strict=True):
        if flag == "--target":
            command = tuple(word for word in command if word != "--faithful")  # the target says which
        command = (*_without(command, flag, value.partition("=")[0] if "=" in value else ""), flag, *value.split())
    return ("heatertune", *command)


def _without(given: Sequence[str], flag: str, name: str) -> tuple[str, ...]:
    """Return a command without a flag and its value; where there is a name, only where the value is of that name."""
    kept, rest = list[str](), list(given)
    while rest:
        word = rest.pop(0)
        value = word.removeprefix(f"{flag}=") if word.startswith(f"{flag}=") else rest[0] if word == flag else None
        if value is None or (name and value.partition("=")[0].strip() != name):
            kept.append(word)
        elif word == flag:
            rest.pop(0)
            while flag in _OF_SEVERAL and rest and _is_number(rest[0]):
                rest.pop(0)
    return tuple(kept)


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

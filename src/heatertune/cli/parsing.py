"""Arguments → options, complaints in one line."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, Final, NoReturn

from heatertune.errors import InputError

__all__ = ["FULL", "CommandParser", "CommandStub", "again"]

#: what --json=full is to argparse, whose options with a value that may be missing would take the next word for it
FULL: Final = "--json-full"
_OF_SEVERAL: Final = ("--setpoint",)  # options with one number or two


class CommandParser(argparse.ArgumentParser):
    """A parser whose complaints are one line, with exit status 2, like every other bad input."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options; "--option=--" has no value, argparse makes a list of it."""
        given = sys.argv[1:] if args is None else args
        for argument in given:
            if argument.startswith("-") and argument.endswith("=--"):
                self.error(f"argument {argument.removesuffix('=--')}: expected a value, got '--'")
        return super().parse_args([FULL if each == "--json=full" else each for each in given], namespace)

    def error(self, message: str) -> NoReturn:
        """Raise the complaint as an input error.

        Raises:
            InputError: always.
        """
        raise InputError(f"{message} (see: {self.prog} --help)")


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

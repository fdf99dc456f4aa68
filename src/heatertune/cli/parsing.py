"""Arguments → options, complaints in one line."""

from __future__ import annotations

import argparse
import sys
from typing import Any, NoReturn

from heatertune.errors import InputError

__all__ = ["CommandParser", "Named"]


class CommandParser(argparse.ArgumentParser):
    """A parser whose complaints are one line, with exit status 2, like every other bad input."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options; "--option=--" has no value, argparse makes a list of it."""
        for argument in sys.argv[1:] if args is None else args:
            if argument.startswith("-") and argument.endswith("=--"):
                self.error(f"argument {argument.removesuffix('=--')}: expected a value, got '--'")
        return super().parse_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Raise the complaint as an input error.

        Raises:
            InputError: always.
        """
        raise InputError(f"{message} (see: {self.prog} --help)")


class Named:
    """In place of a command's parser where the command is only named: what is added to it is forgotten."""

    def __init__(self, **_: Any) -> None: ...

    def __getattr__(self, _: str) -> Any:
        return lambda *_, **__: self

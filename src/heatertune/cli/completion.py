"""`heatertune completion`: the script that makes a shell complete commands, options, targets and files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any, Final

from heatertune.plc import NAMES

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune completion bash"

_EPILOG = f"""\
bash: heatertune completion bash > ~/.local/share/bash-completion/completions/heatertune
zsh:  heatertune completion zsh > DIR/_heatertune, DIR being one of $fpath
fish: heatertune completion fish > ~/.config/fish/completions/heatertune.fish

{_EXAMPLE}
"""

#: what stands for a file and for a directory in the help
_FILES: Final = ("FILE", "LOG", "LOG|proof", "MODEL", "PID", "PID|WORDS", "WORDS", "INPUTS", "IMAGE", "DUMP", "A", "B")
_DIRECTORIES: Final = ("DIR",)


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "completion", help="print a completion script for bash, zsh or fish", epilog=_EPILOG,
        description="Print a completion script. Put it where the shell looks for completions, and start a new shell.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("shell", choices=("bash", "zsh", "fish"), help="the shell")
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    import shtab  # noqa: PLC0415 - only this command needs it

    from heatertune.cli import parser  # noqa: PLC0415 - it holds this command

    whole = parser()
    for action in _actions(whole):
        if action.dest == "target":
            action.choices = tuple(NAMES)
        elif action.metavar in _FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]  # where shtab looks for it
        elif action.metavar in _DIRECTORIES:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]  # same
    print(shtab.complete(whole, shell=settings.shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield every action of a parser and of its commands."""
    for action in parser._actions:  # argparse has no public way to them
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)

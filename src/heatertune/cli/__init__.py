"""The command line: one file per command, each a few lines around `heatertune.chain`.

The commands of the extras are in the extras: `command_table` says where.
"""

from __future__ import annotations

import argparse
import atexit
import gc
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from heatertune import __version__
from heatertune.cli.command_table import BUILT_IN, COMMAND_MODULES, command, demand_files, with_user_settings
from heatertune.cli.common import CommandParser, CommandStub
from heatertune.cli.printing import LINE, colourise, to_nobody
from heatertune.errors import ExportRefused, HeatertuneError, InputError, closest, did_you_mean, one_line

__all__ = ["main"]


_PURPOSE: Final = "From a heater's temperature log to proven PID parameters for your PLC."

#: those that most people need, in the order in which they do, and what they are for
_FIRST: Final = {
    "design": "from a log to proven parameters and the commissioning record: begin here",
    "studio": "the same in a browser: drop a log, adjust, download the parameters",
    "read": "how a log file is read, before it is used",
    "verify": "prove a design or parameters again, under your own conditions",
    "decode": "the parameters of a running controller, and their proof",
}

#: function of Python → the command that does it
_FUNCTIONS: Final = {"encode": "export-db", "prove": "verify", "export": "export-db", "front": "pareto",
                     "read_log": "read", "write_report": "report", "virtual_plc": "simulate", "read_zones": "design"}

#: exit status of a crash, as EX_SOFTWARE of sysexits.h
FAULT: Final = 70

#: after these no command is looked at
_BEFORE: Final = ("-h", "--help", "--help-all", "-V", "--version")

_EPILOG = """\
the chain: log → model → pid → plc → proof → report
example:   heatertune design table4 --target s5-ob251 --out out/
terms:     heatertune terms TA TN Ms

exit status: 0 success, 1 a verdict of FAIL or NOT PROVEN, 2 bad input (one line `error: …`), 70 a fault of heatertune
             itself (one line; HEATERTUNE_DEBUG=1 shows where)
"""

# a command needs most of what it makes to its end: looking for what to free took a twentieth of its time, a tenth there
gc.set_threshold(300_000)
atexit.register(gc.freeze)
# NumPy's sums: one order whatever the machine; what is summed is small, and a second thread waits more than it works
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def __getattr__(name: str) -> Any:
    """Give all commands by their names as COMMANDS: a command that is run imports its own module alone."""
    if name == "COMMANDS":
        return {each: command(each) for each in COMMAND_MODULES}
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _welcome() -> str:
    """Return what `heatertune` alone shows: the commands that most people need, each by its example."""
    examples = {name: command(name).example.removeprefix("example: ") for name in _FIRST}
    lines = [f"  {examples[name]}\n      {what}" for name, what in _FIRST.items()]
    return "\n".join([
        _PURPOSE, "", *lines, "", "heatertune --help lists all commands, heatertune COMMAND --help its options."])


def parser(only: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of all commands; where `only` is one of them, of that one: the others' options take time.

    Where it is what ends before any command, all are named and none has its options.
    """
    top = CommandParser(
        prog="heatertune",
        description=_PURPOSE,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("-V", "--version", action="version", version=f"heatertune {__version__}")
    parser_class: Any = CommandStub if only in _BEFORE else CommandParser
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=parser_class)
    for name in [only] if only in COMMAND_MODULES else COMMAND_MODULES:
        command(name).add_to(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 success, 1 verdict FAIL, 2 bad input, 70 a fault of heatertune."""
    _open_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a name that is no text is shown escaped
            stream.reconfigure(errors="backslashreplace")
    try:
        return _run(tuple(sys.argv[1:] if arguments is None else arguments))
    except ExportRefused as problem:
        _complain(str(problem))
        return 1
    except HeatertuneError as problem:
        _complain(str(problem))
        return 2
    except BrokenPipeError:  # the reader of a pipe went away; nothing is wrong with the result
        to_nobody()
        return 0
    except KeyboardInterrupt:
        _complain("interrupted")
        return 130
    except Exception as problem:  # a verdict has 0 and 1, bad input 2: none of them may say that this program failed
        if os.environ.get("HEATERTUNE_DEBUG"):
            raise
        _complain(_fault(problem))
        return FAULT


def _open_closed_streams() -> None:
    """Write to nowhere where the shell closed stdout or stderr (`>&-`), so that no other file gets their numbers."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open("r" if name == "stdin" else "w", encoding="utf-8")  # noqa: SIM115 - as long as the process
            setattr(sys, name, stream)


def _run(arguments: tuple[str, ...]) -> int:
    """Run a command line; alone it shows where to begin.

    Raises:
        InputError: no such command.
    """
    if not arguments:
        print(_welcome())
        return 0
    arguments = _as_help(arguments)
    if not arguments[0].startswith("-") and arguments[0] not in COMMAND_MODULES:
        command_name = _FUNCTIONS.get(arguments[0])
        near = f": did you mean {command_name}?" if command_name else did_you_mean(
            arguments[0], (*COMMAND_MODULES, "help"))
        log = arguments[0] if Path(arguments[0]).is_file() else closest(arguments[0], BUILT_IN)
        near = near or (f": did you mean heatertune design {log} --target NAME?" if log else "")
        raise InputError(f"unknown command {arguments[0]!r}{near} (see: heatertune --help)")
    its = parser(arguments[0])
    arguments, source = with_user_settings(arguments, its)
    try:
        settings = its.parse_args(arguments)
    except InputError as problem:
        raise InputError(f"{problem} {source}".rstrip()) from None  # what the user's file adds may be what is wrong
    demand_files(its, settings)
    if source and not getattr(settings, "quiet", False):
        print(source, file=sys.stderr)
    settings.given = arguments
    return int(settings.run(settings))


def _as_help(words: tuple[str, ...]) -> tuple[str, ...]:
    """Return `help` and `help COMMAND` as the options that they mean."""
    if words[0] not in ("help", "-help", "-?", "/?"):
        return words
    return ("--help",) if len(words) == 1 else (words[1], "--help-all" if "all" in words[2:] else "--help")


def _complain(text: str) -> None:
    LINE.end()
    with suppress(OSError):  # nobody is there to read it
        print(colourise(f"error: {text}", sys.stderr), file=sys.stderr)


def _fault(problem: Exception) -> str:
    """Return what a user can report."""
    import traceback

    place = traceback.extract_tb(problem.__traceback__)[-1]
    return one_line(
        f"a fault of heatertune itself, please report it with the command: {type(problem).__name__} in "
        f"{Path(place.filename).name}, line {place.lineno}: {problem} (HEATERTUNE_DEBUG=1 shows the traceback)")

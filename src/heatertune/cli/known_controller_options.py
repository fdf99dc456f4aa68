"""The options of a known controller behind a log without power."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from heatertune import options, plc
from heatertune.errors import InputError
from heatertune.plc import NAMES
from heatertune.settings import Conditions

if TYPE_CHECKING:
    from heatertune.log.values import Log
    from heatertune.plc import Words

__all__ = ["add_known_options", "known_words"]


def add_known_options(command: argparse.ArgumentParser) -> None:
    """Add --controller, --words, --setpoint and --switch."""
    group = command.add_argument_group("a log without power, from a known controller")
    group.add_argument("--controller", metavar="NAME", help=f"the controller of this log: one of {', '.join(NAMES)}")
    group.add_argument("--words", metavar="FILE", help="its parameters: words.json as written by export-db")
    group.add_argument("--setpoint", type=float, nargs=1, metavar="°C",
                       help="its setpoint, if the log does not contain it [°C]")
    options.add(group, Conditions, "switches",
                help="known setting of an open point (see: heatertune targets); may be repeated")


def known_words(settings: argparse.Namespace, logs: Sequence[Log]) -> Words | None:
    """Return the words of the controller that is named, None where none is.

    Raises:
        InputError: words without a controller, a controller without words or with several logs.
        UnknownName: no such controller.
    """
    if settings.controller is None:
        for name in ("words", "setpoint", "switch"):
            if getattr(settings, name):
                raise InputError(f"--{name} needs --controller: it tells what that controller holds")
        return None
    from heatertune.proof.words_file import read_words  # noqa: PLC0415 - the help must not wait for it

    plc.controller_for(settings.controller)  # an unknown name is refused before the file is opened
    if settings.words is None:
        raise InputError("--controller needs --words: without its words a controller is not known")
    if len(logs) > 1:
        raise InputError("--controller takes one log: the words are of one run")
    words = read_words(settings.words, settings.controller)
    if words is None:
        raise InputError(f"{settings.words}: no words; expected words.json as written by export-db")
    return words

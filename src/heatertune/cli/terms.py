"""`heatertune terms`: what the symbols and words mean that the other commands print."""

from __future__ import annotations

import argparse
import dataclasses
import textwrap
from typing import TYPE_CHECKING, Any, Final

from heatertune.cli import printing

if TYPE_CHECKING:
    from heatertune.terms import GlossaryTerm

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune terms TA TN Ms"

_LEFT: Final = 20  # columns of the names


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "terms", help="what TA, TN, Ms, plausible heater … mean", epilog=_EXAMPLE,
        description="Explain the symbols and terms that heatertune prints.",
    )
    command.add_argument("term", nargs="*", metavar="TERM", help="a symbol or term (default: all)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.terms import TERMS, the_term  # noqa: PLC0415 - the help must not wait for it

    chosen = tuple(map(the_term, settings.term)) or TERMS
    document = {"schema": "heatertune/terms/1", "terms": [dataclasses.asdict(term) for term in chosen]}
    printing.output(settings, document, lambda: "\n".join(map(_told, chosen)))
    return 0


def _told(term: GlossaryTerm) -> str:
    name, *others = term.names
    unit = f" [{term.unit}]" if term.unit not in ("", "1") else ""
    meaning = f"{', '.join(others)}{unit}: {term.meaning}" if others else term.meaning
    return textwrap.fill(meaning, printing.WIDTH, initial_indent=f"{name:{_LEFT - 1}} ", subsequent_indent=" " * _LEFT)

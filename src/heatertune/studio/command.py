"""`heatertune studio`: the whole chain on a local page."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from typing import Any

from heatertune.errors import InputError

__all__ = ["STUDIO_EXAMPLE", "add_studio"]

STUDIO_EXAMPLE = "example: heatertune studio table4"


def add_studio(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "studio", help="the whole chain on a local page", epilog=STUDIO_EXAMPLE,
        description="Serve a page on 127.0.0.1: drop a log, adjust the design with sliders, download proven "
                    "parameters. Prints its address; stop with Ctrl-C.",
    )
    command.add_argument("source", metavar="LOG|DIR", nargs="?",
                         help="a CSV file, the built-in table3 / table4, or a folder that `heatertune design` wrote")
    command.add_argument("--port", type=int, metavar="N", help="port on 127.0.0.1 (default: any free port)")
    command.add_argument("--no-browser", action="store_true", help="do not open the page in a browser")
    command.set_defaults(run=_run_studio)


def _run_studio(settings: argparse.Namespace) -> int:
    if find_spec("nicegui") is None:
        raise InputError('the studio needs NiceGUI: pip install "heatertune[studio]"')
    from heatertune.studio.server import serve

    serve(settings.source, port=settings.port, browser=not settings.no_browser)
    return 0

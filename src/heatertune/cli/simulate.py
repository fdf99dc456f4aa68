"""`heatertune simulate`: a virtual PLC that answers on the network, with the heater behind it."""

from __future__ import annotations

import argparse
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import options
from heatertune.cli import common, printing
from heatertune.errors import InputError
from heatertune.settings import Conditions

if TYPE_CHECKING:
    from heatertune.live.serve import VirtualPlcServed

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune simulate out/ --serve s7 --rate 100"
_SERVED: Final = ("s7", "modbus")
#: protocol → how a client addresses the PLC
_BY: Final = {"s7": "rack 0, slot 2", "modbus": "unit 1"}


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "simulate", help="a virtual PLC that answers on the network, with the heater behind it", epilog=_EXAMPLE,
        description="Serve the controller of a design on 127.0.0.1, its own arithmetic in its own memory, and behind it "
                    "the heater in PWM. Prints its addresses; Ctrl-C ends it, and nothing is left.",
    )
    command.add_argument("directory", metavar="DIR", help="folder that heatertune design wrote")
    command.add_argument("--serve", action="append", default=[], metavar="NAME",
                         help=f"protocol: {', '.join(_SERVED)} (default: s7); may be repeated")
    command.add_argument("--port", action="append", type=int, default=[], metavar="N",
                         help="port of each protocol, in turn (default: one that is free)")
    pace = command.add_argument_group("time")
    pace.add_argument("--rate", default="1", metavar="N|max", help="so many times as fast as a real heater (default: 1)")
    pace.add_argument("--step", action="store_true", help="a client releases each scan: the same run every time")
    pace.add_argument("--scans", type=int, metavar="N", help="end after so many (default: never)")
    heater = command.add_argument_group("the heater")
    heater.add_argument("--sample", type=int, metavar="SEED",
                        help="draw it as verify --samples does (default: the working model)")
    heater.add_argument("--story", action="store_true", help="with what the proof lets it live through")
    heater.add_argument("--fault", action="append", default=[], metavar="TEXT",
                        help='what goes wrong, as "t=900 sensor-off until=1200"; may be repeated')
    heater.add_argument("--faults", action="store_true", help="list what can go wrong, and end")
    heater.add_argument("--dead-man", type=int, default=0, metavar="N",
                        help="scans in manual without a heartbeat of the host before it goes to automatic (default: never)")
    group = command.add_argument_group("conditions, where they are other than the design's")
    options.add(group, Conditions, "setpoint_degC", "noise_degC", "switches", default=argparse.SUPPRESS)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.live.faults import FAULTS  # noqa: PLC0415 - the help must not wait for it

    if settings.faults:
        width = max(map(len, FAULTS))
        printing.output(settings, {"schema": "heatertune/faults/1", "faults": dict(FAULTS)},
                        lambda: "\n".join(f"{name:{width}}  {what}" for name, what in FAULTS.items()))
        return 0
    from heatertune.live.serve import Simulation, virtual_plc  # noqa: PLC0415

    simulation = Simulation(
        serve=tuple(settings.serve) or ("s7",), ports=tuple(settings.port), rate=_rate(settings.rate),
        step=settings.step, intervals=settings.scans, sample=settings.sample, story=settings.story,
        faults=tuple(settings.fault), dead_man=settings.dead_man)
    own = options.given(Conditions, settings)
    with virtual_plc(settings.directory, changed=own, settings=simulation) as served:
        document = _document(settings, served, simulation)
        printing.output(settings, document, lambda: _lines(document, settings.directory))
        served.wait()
        _ended(settings, served)
    return 0

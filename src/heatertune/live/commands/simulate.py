"""`heatertune simulate`: a virtual PLC that answers on the network, with the heater behind it."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from heatertune import options
from heatertune.cli import printing
from heatertune.codec import holds_zones
from heatertune.errors import InputError
from heatertune.settings import Conditions

if TYPE_CHECKING:
    from heatertune.live.serve import Simulation, VirtualPlcServed

__all__ = ["SIMULATE_EXAMPLE", "add_simulate"]

SIMULATE_EXAMPLE = "example: heatertune simulate out/ --serve s7 --rate 100"
_SERVED: Final = ("s7", "modbus", "opcua", "as511")


def add_simulate(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "simulate", help="a virtual PLC with a simulated heater, reachable over the network", epilog=SIMULATE_EXAMPLE,
        description="Serve the controller of a design on 127.0.0.1, with its own arithmetic and memory layout and a "
                    "simulated heater under PWM. Prints its addresses; stop with Ctrl-C. It leaves no files behind.",
    )
    command.add_argument("directory", metavar="DIR", nargs="?", help="folder that heatertune design wrote")
    command.add_argument("--serve", action="append", default=[], metavar="NAME",
                         help=f"protocol: {', '.join(_SERVED)} (default: what reaches the controller); may be repeated")
    command.add_argument("--port", action="append", type=int, default=[], metavar="N",
                         help="port of each protocol, in order (default: any free port)")
    pace = command.add_argument_group("time")
    pace.add_argument("--rate", default="1", metavar="N|max", help="speed relative to a real heater (default: 1)")
    pace.add_argument("--step", action="store_true", help="a client triggers each scan, so that every run is identical")
    pace.add_argument("--scans", type=int, metavar="N", help="stop after N scans (default: never)")
    heater = command.add_argument_group("the heater")
    heater.add_argument("--sample", type=int, metavar="SEED",
                        help="sample it as verify --samples does (default: the working model)")
    heater.add_argument("--story", action="store_true", help="run the test sequence of the proof")
    heater.add_argument("--fault", action="append", default=[], metavar="TEXT",
                        help='a scheduled fault, such as "t=900 sensor-off until=1200"; may be repeated')
    heater.add_argument("--faults", action="store_true", help="list the faults and exit")
    heater.add_argument("--dead-man", type=int, default=0, metavar="N",
                        help="scans in manual without a heartbeat before it returns to automatic (default: never)")
    group = command.add_argument_group("conditions, if other than those of the design")
    options.add(group, Conditions, "setpoint_degC", "noise_degC", "switches", default=argparse.SUPPRESS)
    printing.add_output_options(command, _run_simulate)


def _run_simulate(settings: argparse.Namespace) -> int:
    if settings.faults:
        from heatertune.live.plc import FAULTS

        width = max(map(len, FAULTS))
        printing.output(settings, {"schema": "heatertune/faults/1", "faults": dict(FAULTS)},
                        lambda: "\n".join(f"{name:{width}}  {what}" for name, what in FAULTS.items()))
        return 0
    if settings.directory is None:
        raise InputError("simulate needs the folder that heatertune design wrote (or --faults)")
    from heatertune.live.serve import Simulation, read_folder, virtual_plc

    simulation = Simulation(
        serve=tuple(settings.serve), ports=tuple(settings.port), rate=_rate(settings.rate),
        step=settings.step, intervals=settings.scans, sample=settings.sample, story=settings.story,
        faults=tuple(settings.fault), dead_man=settings.dead_man)
    changed = options.provided_options(Conditions, settings)
    if holds_zones(settings.directory):
        plc = _zones(settings, simulation, changed)
    else:
        words, model, conditions = read_folder(settings.directory)
        plc = virtual_plc(words, model, replace(conditions, **changed), simulation)
    with plc as served:
        with suppress(KeyboardInterrupt):  # as it is meant to be ended, as soon as its addresses are told
            document = _document(settings, served, simulation)
            printing.output(settings, document, lambda: _lines(document))
            sys.stdout.flush()
            served.wait()
        status = served.status
    if not settings.quiet:
        print(f"ended after {status.intervals} scans: {status.temperature_degC:.2f} °C, {status.power_pct:.1f} % power",
              file=sys.stderr)
    return 0


def _zones(settings: argparse.Namespace, simulation: Simulation, changed: Mapping[str, object]) -> VirtualPlcServed:
    """Return the virtual PLC of several zones; raise InputError for a condition that theirs does not follow."""
    if other := next((name for name in changed if name != "noise_degC"), None):
        flag = options.options_of(Conditions)[other].flag
        raise InputError(f"{flag}: not for zones, which are simulated as they were proven; leave it out")
    served: VirtualPlcServed = import_module("heatertune.live.joint.virtual_zones").virtual_zones(
        settings.directory, simulation, **changed)
    return served


def _rate(text: str) -> float:
    if text == "max":
        return math.inf
    try:
        return float(text)
    except ValueError:
        raise InputError(f"--rate {text!r}: expected a number, or max") from None


def _document(settings: argparse.Namespace, served: VirtualPlcServed, simulation: Any) -> dict[str, Any]:
    addresses = {protocol: {"host": host, "port": port, "url": served.urls[protocol]}
                 for protocol, (host, port) in served.addresses.items()}
    return {
        "schema": "heatertune/simulate/2", "target": served.target, "directory": settings.directory,
        "addresses": addresses, "block": served.number, "bytes": served.length, "description": served.block,
        "registers": [[run.first, run.first + run.size - 1] for run in served.registers],
        "scan_s": served.scan_s, "pace": "a client releases each" if simulation.step else _pace(simulation.rate),
        "sample": simulation.sample, "faults": list(simulation.faults), "zones": served.zone_places() or None,
    }


def _pace(rate: float) -> str:
    return "as fast as it can" if math.isinf(rate) else "in real time" if rate == 1.0 else f"{rate:g} times as fast"


def _lines(document: Mapping[str, Any]) -> str:
    sample = document["sample"]
    heater = "the model's heater" if sample is None else f"heater {sample} of the model set"
    heater = heater if document["zones"] is None else f"the network of {len(document['zones'])} zones"
    lines = [f"virtual PLC: {document['target']} with the words of {document['directory']}, {heater} behind it"]
    for protocol, where in document["addresses"].items():
        lines.append(f"{protocol:8}{where['url']}  {_block_address(protocol, document)}")
    lines += [f"zone    {zone['name']}: {', '.join(zone['urls'].values())}" for zone in document["zones"] or ()]
    lines += [f"fault   {fault}" for fault in document["faults"]]
    return "\n".join([*lines, f"scans   every {document['scan_s']:g} s, {document['pace']}; Ctrl-C ends it"])


def _block_address(protocol: str, document: Mapping[str, Any]) -> str:
    """Return where a client finds the block, and the simulator's own."""
    if protocol == "modbus":
        runs = ", ".join(f"{first}" if first == last else f"{first}…{last}" for first, last in document["registers"])
        return f"unit 1, registers {runs} ({document['description']}); its own from 1000 on"
    if protocol == "opcua":
        return f"ns=2;s=DB{document['block']} ({document['description']}); its own: ns=2;s=DB1000"
    if protocol == "as511":
        return f"8N1, DB{document['block']} ({document['description']}); its own: DB255"
    return f"rack 0, slot 2, DB{document['block']} ({document['description']}); its own: DB1000"

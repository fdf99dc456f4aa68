"""The commands: where each is, and which options its `--help` shows; `--help-all` shows the others, too.

This is the one place in the core that names modules of the extras: batch, live, studio, supervision, zones.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, NamedTuple

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Callable, Sequence

    from heatertune.proof.difference import WriteHistory

__all__ = ["COMMAND_MODULES", "FIRST_OPTIONS", "Command", "command", "current_options", "design_zones",
           "written_in"]

#: command, in the order of the help → its module in heatertune
COMMAND_MODULES: Final = {
    "design": "cli.design_compare",
    "read": "cli.identification",
    "fit": "cli.identification",
    "validate": "cli.identification",
    "plan": "cli.identification",
    "spec": "cli.reference",
    "tune": "cli.tuning",
    "pareto": "cli.tuning",
    "export-db": "cli.export_verify",
    "verify": "cli.export_verify",
    "supervise": "supervision.command",
    "feed-forward": "cli.export_verify",
    "compare": "cli.design_compare",
    "advise": "cli.running_controller",
    "study": "batch.command",
    "fleet": "batch.command",
    "health": "live.commands.health",
    "report": "cli.export_verify",
    "decode": "cli.running_controller",
    "diff": "cli.running_controller",
    "replay": "cli.running_controller",
    "targets": "cli.reference",
    "terms": "cli.reference",
    "studio": "studio.command",
    "simulate": "live.commands.simulate",
    "record": "live.commands.record_watch",
    "experiment": "live.commands.run_experiment",
    "write": "live.commands.write_rollback",
    "rollback": "live.commands.write_rollback",
    "watch": "live.commands.record_watch",
    "doctor": "cli.installation",
    "bench": "cli.installation",
    "completion": "cli.installation",
}

_UNITS: Final = ("--temperature-unit", "--power-full-scale")
_COLUMNS: Final = ("--temperature-column", "--power-column", *_UNITS)
_TARGET: Final = ("--target", "--setpoint", "--range")
_MODEL: Final = ("--gain", "--time-constant", "--dead-time", "--ambient")
_OUTPUT: Final = ("--json", "--quiet")

#: command → its flags in the first layer, at most one screen in this order; a command that is not here shows all
FIRST_OPTIONS: Final[dict[str, tuple[str, ...]]] = {
    "design": ("--out", *_TARGET, *_UNITS, "--setpoint-ramp", "--structure", "--ms", "--limit", "--accept", "--force",
               *_OUTPUT),
    "read": ("--time-column", *_COLUMNS, "--setpoint-column", "--time-unit", "--log-interval", "--tag", "--run",
             "--skip-rows", *_OUTPUT),
    "fit": ("--out", *_COLUMNS, "--ambient", "--dead-time-at-most", "--until", "--cooler", "--thermostat",
            "--controller", "--words", "--hypotheses", *_OUTPUT),
    "validate": ("--out", "--least-fit", *_COLUMNS, "--ambient", "--power-before", "--until", *_OUTPUT),
    "plan": ("--out", "--limit-temperature", *_MODEL, "--max-duration", "--power", "--aim", "--kind", "--json"),
    "tune": ("--out", *_TARGET, *_MODEL, "--structure", "--method", "--ms", "--setpoint-ramp", "--limit", "--json"),
    "pareto": ("--out", *_MODEL, "--structure", "--ms-range", "--points", "--objective", "--sample-time", *_OUTPUT),
    "export-db": ("--out", *_TARGET, "--pwm-period", "--words", "--setpoint-ramp", "--assume", "--spec", "--limit",
                  "--accept", "--force", *_OUTPUT),
    "verify": (*_TARGET, "--pwm-period", "--assume", "--spec", "--limit", "--accept", "--noise", "--samples",
               "--json", "--verbose"),
    "supervise": ("--out", *_TARGET, *_MODEL, "--spread", "--ambient-spread", "--least-noise", "--samples", "--json"),
    "compare": ("--out", "--setpoint", "--range", "--pwm-period", "--spec", "--limit", "--accept", *_MODEL, *_OUTPUT),
    "advise": ("--pid", *_TARGET, "--spec", "--limit", *_COLUMNS, *_OUTPUT),
    "fleet": ("--out", *_TARGET, *_UNITS, "--structure", "--ms", "--limit", "--accept", "--samples", "--resume",
              "--jobs", "--json"),
    "health": ("--out", "--loops", "--since", "--duration", "--interval", *_TARGET, *_UNITS, "--limit", "--json"),
    "report": ("--plant-tag", "--as-left", "--setpoint", "--ambient", "--begins-at", "--load-at", *_UNITS, "--record",
               *_OUTPUT),
    "decode": (*_TARGET, "--input", "--called-every", "--model", *_MODEL, "--assume", "--spec", "--limit", *_OUTPUT),
    "simulate": ("--serve", "--port", "--rate", "--sample", "--fault", "--faults", "--setpoint", "--noise", *_OUTPUT),
    "record": ("--out", "--duration", "--interval", "--design", "--map", *_OUTPUT),
    "experiment": ("--design", "--out", "--limit-temperature", "--limit-rate", "--until", "--in-manual", "--restore",
                   "--yes", *_OUTPUT),
    "write": ("--apply", "--confirm", "--called-every", "--range", "--as-exported", "--in-manual", "--no-watch",
              "--record", *_OUTPUT),
}


class Command(NamedTuple):
    """A command.

    Attributes:
        add_to: adds its parser to the parsers of the commands.
        example: of its use, the last line of its help.
    """

    add_to: Callable[[Any], None]
    example: str


def command(name: str) -> Command:
    """Import a command: of its module the function `add_` and the constant `_EXAMPLE` of its name."""
    module, stem = import_module(f"heatertune.{COMMAND_MODULES[name]}"), name.replace("-", "_")
    return Command(getattr(module, f"add_{stem}"), getattr(module, f"{stem.upper()}_EXAMPLE"))


#: options of the releases before 0.9.0 → what they are called now; they are understood, but not listed
_RENAMED: Final = {
    "--switch": "--assume", "--as-is": "--no-redesign", "--faithful": "--as-printed", "--broken": "--faults-per-kind",
    "--most-writes": "--max-writes"}
#: likewise, of some commands alone: "--yes" of `experiment` takes no value, and stays
_RENAMED_IN: Final = {
    "write": {"--yes": "--confirm"}, "rollback": {"--yes": "--confirm"},
    **{name: {"--for": "--duration", "--every": "--interval"} for name in ("health", "record", "watch")}}


def current_options(arguments: Sequence[str]) -> list[str]:
    """Return a command line in which the options of earlier releases have the names of today."""
    names = _RENAMED | _RENAMED_IN.get(arguments[0] if arguments else "", {})
    options = (each.partition("=") for each in arguments)
    return [f"{names.get(option, option)}{equals}{value}" for option, equals, value in options]


def design_zones(settings: Namespace) -> int:
    """Run `design --zones`; return its exit status."""
    return int(import_module("heatertune.zones.command").run(settings))


def written_in(paths: Sequence[str], directory: str) -> WriteHistory:
    """Read the records of writes that a report is to show; errors as `heatertune.live.write.rollback.written_in`."""
    history: WriteHistory = import_module("heatertune.live.write.rollback").written_in(paths, directory)
    return history

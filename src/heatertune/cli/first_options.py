"""Which options `heatertune COMMAND --help` shows; `--help-all` shows the others, too."""

from __future__ import annotations

from typing import Final

__all__ = ["FIRST_OPTIONS"]

_UNITS: Final = ("--temperature-unit", "--power-full-scale")
_COLUMNS: Final = ("--temperature-column", "--power-column", *_UNITS)
_TARGET: Final = ("--target", "--setpoint", "--range")
_MODEL: Final = ("--gain", "--time-constant", "--dead-time", "--ambient")
_OUTPUT: Final = ("--json", "--quiet")

#: command → flags, in the order in which they are shown, at most one screen; a command that is not here shows all
FIRST_OPTIONS: Final[dict[str, tuple[str, ...]]] = {
    "design": ("--out", *_TARGET, *_UNITS, "--setpoint-ramp", "--structure", "--ms", "--limit", "--accept", "--force",
               *_OUTPUT),
    "read": ("--time-column", *_COLUMNS, "--setpoint-column", "--time-unit", "--log-interval", "--tag", "--run",
             "--skip-rows", *_OUTPUT),
    "fit": ("--out", *_COLUMNS, "--ambient", "--dead-time-at-most", "--until", "--cooler", "--controller", "--words",
            "--hypotheses", *_OUTPUT),
    "validate": ("--out", "--least-fit", *_COLUMNS, "--ambient", "--power-before", "--until", *_OUTPUT),
    "plan": ("--out", "--limit-temperature", *_MODEL, "--max-duration", "--power", "--aim", "--kind",
             "--json"),
    "tune": ("--out", *_TARGET, *_MODEL, "--structure", "--method", "--ms", "--setpoint-ramp", "--limit", "--json"),
    "pareto": ("--out", *_MODEL, "--structure", "--ms-range", "--points", "--objective", "--sample-time", *_OUTPUT),
    "export-db": ("--out", *_TARGET, "--pwm-period", "--words", "--setpoint-ramp", "--switch", "--spec", "--limit",
                  "--accept", "--force", *_OUTPUT),
    "verify": (*_TARGET, "--pwm-period", "--switch", "--spec", "--limit", "--accept", "--noise", "--samples", "--json",
               "--verbose"),
    "supervise": ("--out", *_TARGET, *_MODEL, "--spread", "--ambient-spread", "--least-noise", "--samples", "--json"),
    "compare": ("--out", "--setpoint", "--range", "--pwm-period", "--spec", "--limit", "--accept", *_MODEL, *_OUTPUT),
    "advise": ("--pid", *_TARGET, "--spec", "--limit", *_COLUMNS, *_OUTPUT),
    "fleet": ("--out", *_TARGET, *_UNITS, "--structure", "--ms", "--limit", "--accept", "--samples", "--resume",
              "--jobs", "--json"),
    "health": ("--out", "--loops", "--since", "--for", "--every", *_TARGET, *_UNITS, "--limit", "--json"),
    "report": ("--plant-tag", "--as-left", "--setpoint", "--ambient", "--begins-at", "--load-at", *_UNITS, "--record", *_OUTPUT),
    "decode": (*_TARGET, "--input", "--called-every", "--model", *_MODEL, "--switch", "--spec", "--limit", *_OUTPUT),
    "simulate": ("--serve", "--port", "--rate", "--sample", "--fault", "--faults", "--setpoint", "--noise", *_OUTPUT),
    "record": ("--out", "--for", "--every", "--design", "--map", *_OUTPUT),
    "experiment": ("--design", "--out", "--limit-temperature", "--limit-rate", "--until", "--in-manual", "--restore",
                   "--yes", *_OUTPUT),
    "write": ("--apply", "--yes", "--called-every", "--range", "--as-exported", "--in-manual", "--no-watch", "--record",
              *_OUTPUT),
}

"""`heatertune tune`: model → pid."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from heatertune import options
from heatertune.cli import common, printing
from heatertune.errors import InputError
from heatertune.settings import Conditions, TuneSettings, WordSettings

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune tune --gain 0.37 --time-constant 167 --dead-time 12 --ambient 22 -o pid.json"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "tune", help="model → pid: K, TN, TV and TA by a rule or the optimum", epilog=_EXAMPLE,
        description="Find the controller for a heater and all its candidate models.",
    )
    command.add_argument("model", metavar="MODEL", nargs="?", help="model.json as written by fit")
    command.add_argument("-o", "--out", metavar="FILE", help="write the design to this JSON file")
    command.add_argument("--target", metavar="NAME", help="round TA to what this controller's timer can do")
    options.add(command, WordSettings, "switch_kind")
    common.add_model_options(command)
    common.add_tuning_options(command)
    options.add(command, TuneSettings, "step_power_pct")
    options.add(command, Conditions, "spec", "limit")
    command.add_argument("--second-opinion", action="store_true",
                         help="have python-control compute Ms, too (takes seconds to load)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune import chain  # noqa: PLC0415 - the help must not wait for it
    from heatertune.pid.alternatives import alternatives  # noqa: PLC0415
    from heatertune.pid.document import to_document  # noqa: PLC0415
    from heatertune.pid.forms import other_forms  # noqa: PLC0415
    from heatertune.plc.choose import tune_for_words  # noqa: PLC0415
    from heatertune.proof.fitted import aimed, told_of_aim  # noqa: PLC0415
    from heatertune.proof.pwm_period import with_pwm  # noqa: PLC0415
    from heatertune.report.text import alternatives_table, design_lines, forms_lines  # noqa: PLC0415

    fitted = common.model_from(settings, settings.model)
    by_words = common.interval_by_words(settings)
    if by_words and settings.target is None:
        raise InputError("--sample-time words needs --target: the words are its own")
    find = tune_for_words if by_words else chain.tune
    asked = options.of(TuneSettings, settings)
    tuned = aimed(asked, Conditions(spec=settings.spec, limit=tuple(settings.limit)))
    design = find(fitted, tuned, target=settings.target, progress=printing.Progress(settings))
    design = replace(design, notes=(*design.notes, *told_of_aim(asked, tuned)))
    if settings.switch_kind is not None:
        design, _ = with_pwm(design, fitted, settings.switch_kind)
    if settings.second_opinion:
        from heatertune.pid.loop.linear import second_opinion  # noqa: PLC0415 - loads python-control

        design = replace(design, notes=(*design.notes, second_opinion(fitted.plants, design)))
    others = alternatives(fitted, design)
    settled = (design.gain_pct_per_degC, design.integral_time_s, design.derivative_time_s)
    document = to_document(design, fitted) | {"forms": other_forms(*settled), "alternatives": others}
    printing.save(settings.out, document)
    printing.output(settings, document, lambda: "\n".join(
        (design_lines(document), forms_lines(document["forms"]), "", alternatives_table(others))))
    return 0

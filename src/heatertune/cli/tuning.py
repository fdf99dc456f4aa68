"""The commands from a model to a design: `tune` and `pareto`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatertune import chain, options, report
from heatertune.cli import common, printing
from heatertune.cli.common import again
from heatertune.codec import plain
from heatertune.errors import InputError
from heatertune.settings import Conditions, TuneSettings, WordSettings
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.model.model_values import FittedModel
    from heatertune.pid.design_values import PidDesign
    from heatertune.proof.redesign import DesignResult

__all__ = ["PARETO_EXAMPLE", "TUNE_EXAMPLE", "add_pareto", "add_tune"]


PARETO_EXAMPLE = (
    "example: heatertune pareto --gain 0.37 --time-constant 167 --dead-time 12 --structure pid -o front.svg")
_PICTURES = (".svg", ".png")


def add_pareto(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "pareto", help="model → performance against robustness: the best cost at each Ms", epilog=PARETO_EXAMPLE,
        description="Tune for a range of limits on Ms and show what robustness costs.",
    )
    command.add_argument("model", metavar="MODEL", nargs="?", help="model.json as written by fit")
    command.add_argument("-o", "--out", metavar="FILE", help="picture (.svg, .png) or document (.json) of the front")
    common.add_model_options(command)
    group = command.add_argument_group("tuning")
    group.add_argument("--structure", choices=("pi", "pid"), default="pi", help="parts that act (default: pi)")
    group.add_argument("--ms-range", nargs=2, type=float, metavar=("LOW", "HIGH"), default=(1.2, 2.0),
                       help="limits of Ms (default: 1.2 2.0)")
    group.add_argument("--points", type=int, default=9, help="how many limits (default: 9)")
    group.add_argument("--sample-time", default="0", metavar="S",
                       help="sampling interval TA [s]; 0: continuous (default); auto: TRdom/10 half way")
    options.add(group, TuneSettings, "objective", "weight", "mt", "mks")
    printing.add_output_options(command, _run_pareto)


def _run_pareto(settings: argparse.Namespace) -> int:
    from heatertune.pid.alternatives import front

    suffix = None if settings.out is None else Path(settings.out).suffix.lower()
    if suffix not in (None, ".json", *_PICTURES):
        raise InputError(f"--out is {settings.out!r}; expected a name that ends in .svg, .png or .json")
    document = plain(front(
        common.model_from(settings, settings.model), structure=settings.structure, ms_low=settings.ms_range[0],
        ms_high=settings.ms_range[1], points=settings.points, sample_time_s=common.sample_time(settings),
        progress=printing.Progress(settings), objective=settings.objective, weight=settings.weight, mt=settings.mt,
        mks=settings.mks,
    ))
    if suffix in _PICTURES:
        _draw(document, settings.out, suffix)
    else:
        printing.save(settings.out, document)
    printing.output(settings, document, lambda: report.pareto_table(document))
    return 0


def _draw(document: dict[str, Any], path: str, suffix: str) -> None:
    from heatertune.report.plots import (
        plot_pareto,
        to_png,
        to_svg,
    )

    figure = plot_pareto(document)
    picture: str | bytes = to_svg(figure) if suffix == ".svg" else to_png(figure)
    write_files(Path(path).parent, {Path(path).name: picture})


TUNE_EXAMPLE = "example: heatertune tune --gain 0.37 --time-constant 167 --dead-time 12 --ambient 22 -o pid.json"
_UNPROVEN = ("Nothing was proven, as no --target names the controller: the design aims only at the limits on Ms and on "
             "the power per sensor step.")


def add_tune(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "tune", help="model → pid: K, TN, TV and TA by a rule or the optimum", epilog=TUNE_EXAMPLE,
        description="Tune the controller for all heaters that explain a log. With --target and a specification "
                    "(--spec, --limit), prove its parameters and, if they fail, take the cheapest change that passes; "
                    "exit status 1 if there is none.",
    )
    command.add_argument("model", metavar="MODEL", nargs="?",
                         help="model.json as written by fit; or a pid.json, which contains a model")
    command.add_argument("-o", "--out", metavar="FILE", help="write the design to this JSON file")
    common.add_word_options(command)
    common.add_proof_options(command, needed=False)
    common.add_model_options(command)
    common.add_tuning_options(command)
    command.add_argument("--second-opinion", action="store_true",
                         help="also compute Ms with python-control (takes seconds to load)")
    printing.add_output_options(command, _run_tune, brief=True)


def _run_tune(settings: argparse.Namespace) -> int:
    from heatertune.pid.alternatives import alternatives
    from heatertune.pid.design_document import to_document
    from heatertune.pid.design_values import other_forms
    from heatertune.plc.design import loop_fit
    from heatertune.proof.verdict import verdict_line

    fitted, progress = common.model_from(settings, settings.model), printing.Progress(settings)
    proven = _closed(settings, fitted, progress)
    design = _plain(settings, fitted, progress) if proven is None else replace(
        proven.ideal, notes=(*proven.ideal.notes, *proven.notes))
    loop = fitted if settings.target is None else loop_fit(fitted, common.target(settings), common.scaling(settings))
    if settings.second_opinion:
        from heatertune.pid.sampled_loop import second_opinion

        design = replace(design, notes=(*design.notes, second_opinion(loop.plants, design)))
    others = alternatives(loop, design)
    settled = (design.gain_pct_per_degC, design.integral_time_s, design.derivative_time_s)
    document = to_document(design, fitted, None if proven is None else proven.recipe) | {
        "forms": other_forms(*settled), "alternatives": others}
    printing.save(settings.out, document)
    proof = None if proven is None else proven.proof.to_document()
    verdict = [] if proof is None else ["", f"VERDICT {verdict_line(proof)}"]
    nearest = () if proven is None else again(settings.given, proven.passes_with)
    printing.output(
        settings, document,
        lambda: "\n".join((report.design_lines(document), report.forms_lines(document["forms"]), "",
                           report.alternatives_table(others), *verdict)),
        brief=lambda: report.tune_brief(document, proof, nearest, settings.out))
    return 0 if proven is None or proven.proof.verdict == "PASS" else 1


def _closed(settings: argparse.Namespace, fitted: FittedModel, progress: printing.Progress) -> DesignResult | None:
    """Return the design closed on the verdict of its words, None where no proof is asked for or can be made."""
    from heatertune.proof.redesign import find_passing_design

    if settings.target is None or not _proof_asked(settings):
        return None
    return find_passing_design(fitted, common.design_request(settings), progress=progress)


def _proof_asked(settings: argparse.Namespace) -> bool:
    """Return whether there is an option that only a proof hears."""
    beside = {"step_power_pct", "switch_kind", "as_is"}  # a design hears these, too
    return bool({*options.provided_options(Conditions, settings),
                 *options.provided_options(WordSettings, settings)} - beside)


def _plain(settings: argparse.Namespace, fitted: FittedModel, progress: printing.Progress) -> PidDesign:
    """Return the design as asked for; of the conditions of a proof it hears those that it can aim at."""
    from heatertune.plc.word_selection import tune_for_words
    from heatertune.proof.design_request import with_pwm
    from heatertune.proof.prove_words import aim_sentences, tune_settings_for

    by_words = common.interval_by_words(settings)
    if by_words and settings.target is None:
        raise InputError("--sample-time words needs --target: the words are its own")
    asked = options.of(TuneSettings, settings)
    proven_later = settings.target is not None or _proof_asked(settings)
    tuned = tune_settings_for(asked, common.conditions(settings)) if proven_later else asked
    find = partial(tune_for_words if by_words else chain.tune, target=settings.target, progress=progress)
    design = find(fitted, tuned, scaling=common.scaling(settings))
    notes = [*aim_sentences(asked, tuned), *([_UNPROVEN] if _proof_asked(settings) else [])]
    design = replace(design, notes=(*design.notes, *notes))
    kind = options.of(WordSettings, settings).switch_kind
    return design if kind is None else with_pwm(design, fitted, kind)[0]

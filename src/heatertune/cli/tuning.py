"""The commands from a model to a design, `tune` and `pareto`, and those for the whole chain, `design` and `compare`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import chain, options, plc, report
from heatertune.cli import common, printing
from heatertune.cli.command_table import design_zones
from heatertune.cli.common import again
from heatertune.cli.saved_design import in_force
from heatertune.codec import DATA, plain, to_json
from heatertune.errors import InputError
from heatertune.settings import (
    Conditions,
    FitSettings,
    SampleSettings,
    SensorSettings,
    TuneSettings,
    WordSettings,
    refuse_unused_limits,
)
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.chain.precompile import Worker
    from heatertune.model.model_values import FittedModel
    from heatertune.pid.design_values import PidDesign
    from heatertune.proof.redesign import DesignResult

__all__ = [
    "COMPARE_EXAMPLE", "DESIGN_EXAMPLE", "PARETO_EXAMPLE", "TUNE_EXAMPLE", "add_compare", "add_design",
    "add_pareto", "add_tune",
]


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
    proven = _result_of(settings, fitted, progress)
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


def _result_of(settings: argparse.Namespace, fitted: FittedModel, progress: printing.Progress) -> DesignResult | None:
    """Return the design closed on the verdict of its words, None where no proof is asked for or can be made."""
    from heatertune.proof.redesign import find_passing_design

    if settings.target is None or not _proof_asked(settings):
        return None
    return find_passing_design(fitted, common.design_request(settings), progress=progress)


def _proof_asked(settings: argparse.Namespace) -> bool:
    """Return whether there is an option that only a proof hears."""
    shared = {"step_power_pct", "switch_kind", "as_is"}  # a design hears these, too
    return bool({*options.provided_options(Conditions, settings),
                 *options.provided_options(WordSettings, settings)} - shared)


def _plain(settings: argparse.Namespace, fitted: FittedModel, progress: printing.Progress) -> PidDesign:
    """Return the design as asked for; of the conditions of a proof it hears those that it can aim at."""
    from heatertune.plc.word_selection import tune_for_words
    from heatertune.proof.design_request import with_pwm
    from heatertune.proof.prove_words import aim_sentences, tune_settings_for

    by_words = common.interval_by_words(settings)
    if by_words and settings.target is None:
        raise InputError("--sample-time words needs --target: the words are its own")
    aim = options.of(TuneSettings, settings)
    refuse_unused_limits(aim)
    proven_later = settings.target is not None or _proof_asked(settings)
    tuned = tune_settings_for(aim, common.conditions(settings)) if proven_later else aim
    find = partial(tune_for_words if by_words else chain.tune, target=settings.target, progress=progress)
    design = find(fitted, tuned, scaling=common.scaling(settings))
    notes = [*aim_sentences(aim, tuned), *([_UNPROVEN] if _proof_asked(settings) else [])]
    design = replace(design, notes=(*design.notes, *notes))
    kind = options.of(WordSettings, settings).switch_kind
    return design if kind is None else with_pwm(design, fitted, kind)[0]


COMPARE_EXAMPLE = "example: heatertune compare pid.json --setpoint 40 -o out/"


def add_compare(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "compare", help="one design on every controller: IAE, overshoot, offset, and the cost of rounding",
        epilog=COMPARE_EXAMPLE,
        description="Round a design to the parameters of every controller, prove each, and compare them.",
    )
    command.add_argument("pid", metavar="PID", help="pid.json as written by tune")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for compare.html and data/compare.json")
    common.add_condition_options(command, "range_degC")
    common.add_model_options(command)
    printing.add_output_options(command, _run_compare, brief=True)


def _run_compare(settings: argparse.Namespace) -> int:
    from heatertune.proof.repetition import scaling_of

    design, fitted, origin = common.design_and_model(settings)
    progress, (recipe, notes) = printing.Progress(settings), in_force(settings, origin, settings.pid)
    for note in notes:
        progress.note(note)
    if recipe.input is not None:
        if "range_degC" not in options.provided_options(SensorSettings, settings):
            raise InputError(f"{settings.pid} is for --input {recipe.input} of {recipe.target}, which others have not: "
                             "say a --range")
        recipe = replace(recipe, input=None)
    document = plain(chain.compare(
        design, fitted, recipe.conditions, scaling=scaling_of(recipe), recipe=recipe, progress=progress))
    if settings.out is not None:
        write_files(settings.out, {
            f"{DATA}/compare.json": to_json(document), "compare.html": report.render_targets(document)})
    printing.output(settings, document, lambda: report.targets_table(document),
                    brief=lambda: report.targets_brief(document),
                    short=lambda: {**document, "rows": [_without_curves(row) for row in document["rows"]]})
    return 0


def _without_curves(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: part for name, part in row.items() if name not in ("series", "ideal")}


DESIGN_EXAMPLE = "example: heatertune design table4 --target s5-ob251 --out out/"


def add_design(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "design", help="the whole chain: log → model → pid → plc → proof → report", epilog=DESIGN_EXAMPLE,
        description="Fit the heater, tune the controller, round to its parameters, prove them, and write the "
                    "documents, the export files and report.html.",
    )
    command.add_argument("log", metavar="LOG", help="a CSV file, or the built-in table3 / table4")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for the results (default: named after the log)")
    options.add(command, WordSettings)
    command.add_argument("--force", action="store_true", help="export even if the verdict is not PASS")
    common.add_proof_options(command)
    common.add_log_options(command)
    common.add_tuning_options(command)
    options.add(command.add_argument_group("many heaters"), SampleSettings, but=("replay",))
    _add_zones(command.add_argument_group("heaters that exchange heat"))
    printing.add_output_options(command, _run_design, brief=True)


def _add_zones(group: Any) -> None:
    """Add the options of `heatertune.zones`."""
    group.add_argument("--zones", metavar="NAMES", help="names of the zones in the log, with commas between them, "
                       "neighbours next to each other: tune and prove them together")
    group.add_argument("--zone-log", metavar="FILE", action="append", default=[],
                       help="log of a further zone, if each has a file of its own; may be repeated")
    group.add_argument("--zone-setpoints", metavar="X,X", help="setpoint of each zone [°C]; default: --setpoint, or "
                       "the last ones of the log")
    group.add_argument("--neighbours", metavar="NAME", choices=("chain", "ring", "free"),
                       help="which zones exchange heat: chain, ring or free (default: what the log shows)")
    group.add_argument("--neighbour-deviation", type=float, metavar="K", help="by how much a zone may leave its "
                       "setpoint while a neighbour's changes [°C] (default: 40 %% of the change)")
    group.add_argument("--spread", type=float, metavar="K", help="by how much two zones may differ beyond their "
                       "setpoints while all heat up together [°C]; if needed, on the same setpoint ramp")
    group.add_argument("--decouple", action="store_true", help="let each zone's program add power for its neighbours' "
                       "temperatures, if that moves neighbours less (fb41, iec-pid)")
    group.add_argument("--rated-power", metavar="X,X", help="full power of each zone's heater [kW]")
    group.add_argument("--peak-power", type=float, metavar="X", help="most power of all heaters at once while the "
                       "setpoints are held [kW]; the PWM periods are staggered")
    group.add_argument("--stagger", action="store_true", help="begin the PWM periods of the zones one after the other")


_OF_ZONES: Final = ("zone_log", "zone_setpoints", "neighbours", "neighbour_deviation", "spread", "decouple",
                    "rated_power", "peak_power", "stagger")


def _run_design(settings: argparse.Namespace) -> int:
    if settings.zones is not None:
        return design_zones(settings)
    for name in _OF_ZONES:
        if (value := getattr(settings, name)) is not None and value is not False and value != []:
            raise InputError(f"--{name.replace('_', '-')}: for zones designed together; name them with --zones")
    from heatertune.chain.precompile import work_alongside

    settings.out = settings.out or _folder_of(settings.log)
    common.demand_folder(settings.out)
    with work_alongside(settings.target) as second:  # which begins before the rest is imported
        return _designed(settings, second)


def _folder_of(log: str) -> str:
    """Return the folder for the results of a log: its name without its ending.

    Raises:
        InputError: a folder of that name that holds no design.
    """
    name = Path(log).name.partition(".")[0]
    if not name or (Path(name).exists() and not (Path(name) / DATA / "proof.json").exists()):
        raise InputError(f"{name or log}: there already, and no design: name a folder with --out")
    return name


def _designed(settings: argparse.Namespace, second: Worker) -> int:
    from heatertune.chain.documents import without_curves
    from heatertune.chain.pipeline import TYPICAL_S

    progress = printing.Progress(settings, TYPICAL_S)
    progress("reading")
    request, fit = common.design_request(settings), options.of(FitSettings, settings)  # refused before the log is read
    plc.controller_for(request.target)
    log = chain.read_log(settings.log, common.reading(settings), errata=True)
    printing.tell_taken(settings, [log], progress)
    result = chain.design(
        log, request, out=settings.out, fitted_with=fit, force=settings.force, progress=progress, begun=second)
    effect, feed = result.fitted_model.disturbance, plc.controller_for(request.target).feed
    fed = "" if effect is None or not effect.acts or feed is None else (
        f"feed it forward: heatertune feed-forward {settings.out}")
    nearest = again(settings.given, result.outcome.passes_with)
    printing.output(
        settings, result.documents,
        lambda: "\n".join(filter(None, (report.summary(result.documents), f"written to {settings.out}", fed))),
        brief=lambda: report.design_brief(result.documents, settings.out, nearest, fed),
        short=lambda: without_curves(result.documents, nearest))
    return 0 if result.outcome.proof.verdict == "PASS" else 1

"""`heatertune pareto`: what robustness costs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from heatertune import options, report
from heatertune.cli import common, printing
from heatertune.codec import plain
from heatertune.errors import InputError
from heatertune.settings import TuneSettings
from heatertune.writing import write_files

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune pareto --gain 0.37 --time-constant 167 --dead-time 12 --structure pid -o front.svg"
_PICTURES = (".svg", ".png")


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "pareto", help="model → performance against robustness: the best cost at each Ms", epilog=_EXAMPLE,
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
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.pid.pareto import front  # noqa: PLC0415 - the help must not wait for it

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
    from heatertune.report.plots import (  # noqa: PLC0415
        plot_pareto,
        to_png,
        to_svg,
    )

    figure = plot_pareto(document)
    picture: str | bytes = to_svg(figure) if suffix == ".svg" else to_png(figure)
    write_files(Path(path).parent, {Path(path).name: picture})

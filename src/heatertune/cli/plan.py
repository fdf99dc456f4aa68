"""`heatertune plan`: what is believed → the experiment that makes it known."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatertune import chain, report
from heatertune.cli import printing
from heatertune.codec import plain
from heatertune.errors import InputError
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.model.values import FittedModel

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune plan model.json --limit-temperature 70 --max-duration 3000 -o plan.csv"
_RANGES = {"gain": "gain_degC_per_pct", "time_constant": "time_constant_s", "dead_time": "dead_time_s"}


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "plan", help="model → the experiment to run, and the intervals to expect from it", epilog=_EXAMPLE,
        description="Propose the doublet or relay test that identifies a heater best within a temperature limit, and "
                    "predict the intervals before anything is heated.",
    )
    command.add_argument("model", metavar="MODEL", nargs="?", help="model.json as written by fit")
    command.add_argument("-o", "--out", metavar="FILE", help="write the schedule to this CSV; or the relay's settings")
    _add_prior_options(command)
    group = command.add_argument_group("the experiment")
    group.add_argument("--limit-temperature", type=float, required=True, metavar="°C",
                       help="no plausible heater exceeds it [°C]")
    group.add_argument("--max-duration", type=float, metavar="S",
                       help="longest duration [s] (default: six time constants of the slowest plausible heater)")
    group.add_argument("--power", nargs=2, type=float, default=(0.0, 100.0), metavar=("LOW", "HIGH"),
                       help="bounds of the power [%%] (default: 0 100)")
    group.add_argument("--power-now", type=float, default=0.0, metavar="%",
                       help="power at which the heater is at rest before and after [%%] (default: 0)")
    group.add_argument("--aim", type=float, default=10.0, metavar="%",
                       help="half width of the 95 %% intervals that is sufficient [%%] (default: 10)")
    group.add_argument("--kind", choices=("best", "doublet", "relay"), default="best",
                       help="kind of experiment (default: the better one)")
    group.add_argument("--relay", dest="kind", action="store_const", const="relay", help="the same as --kind relay")
    group = command.add_argument_group("the readings (default: from the residuals of the model)")
    group.add_argument("--noise", type=float, metavar="°C", help="standard deviation of the noise [°C]")
    group.add_argument("--correlation", type=float, metavar="R",
                       help="correlation of the noise between two readings, 0 to 1")
    group.add_argument("--resolution", type=float, metavar="°C", help="resolution of the sensor [°C]")
    group.add_argument("--log-interval", type=float, metavar="S", help="interval between readings [s] (default: 1)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _add_prior_options(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("what is known, instead of a model file")
    ends = ("LOW", "HIGH")
    group.add_argument("--gain", nargs=2, type=float, metavar=ends, help="rise per percent of power [°C/%%]")
    group.add_argument("--time-constant", nargs=2, type=float, metavar=ends, help="time constant [s]")
    group.add_argument("--dead-time", nargs=2, type=float, metavar=ends, help="dead time [s]")
    group.add_argument("--ambient", nargs="+", type=float, metavar="°C",
                       help="ambient temperature [°C]: one number if the fit will know it, or LOW HIGH")


def _run(settings: argparse.Namespace) -> int:
    from heatertune.model.experiment.fisher import noise_of  # noqa: PLC0415 - the help must not wait for it

    fitted = None if settings.model is None else _model(settings)
    low, high = settings.power
    document = plain(chain.plan(
        _ranges(settings) if fitted is None else fitted,
        limit_degC=settings.limit_temperature, longest_s=settings.max_duration, kind=settings.kind,
        ambient_degC=_known_ambient(settings),
        noise=noise_of(
            fitted, std_degC=settings.noise, correlation=settings.correlation, resolution_degC=settings.resolution,
            sample_time_s=settings.log_interval,
        ),
        base_pct=settings.power_now, least_pct=low, most_pct=high, aim=settings.aim / 100.0,
        progress=printing.Progress(settings),
    ))
    if settings.out is not None:
        target = Path(settings.out)
        write_files(target.parent, {target.name: report.plan_csv(document)})
    known = [] if fitted is None else _known_already(fitted, settings.aim / 100.0)
    printing.output(settings, document, lambda: "\n".join([*known, report.plan_lines(document)]))
    return 0


def _known_already(fitted: FittedModel, aim: float) -> list[str]:
    """Return a sentence where a log knows its heater as well as the experiment aims at, else nothing."""
    widths = []
    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s"):
        interval, value = fitted.ci95.get(name), getattr(fitted.model, name)
        if interval is None or interval.low is None or interval.high is None or value == 0.0:
            return []
        widths.append(abs(0.5 * (interval.high - interval.low) / value))
    if not max(widths) <= aim:
        return []
    return [f"This model's log knows gain, time constant and dead time within ±{100.0 * max(widths):.2g} % already: "
            "no experiment is needed for this aim."]


def _model(settings: argparse.Namespace) -> FittedModel:
    """Return the model of the file.

    Raises:
        InputError: ranges are given as well.
    """
    from heatertune.model.document import read_model  # noqa: PLC0415 - the help must not wait for numpy

    if any(getattr(settings, name) is not None for name in _RANGES):
        raise InputError("name a model file or --gain, --time-constant, --dead-time, not both")
    return read_model(settings.model)


def _ranges(settings: argparse.Namespace) -> dict[str, tuple[float, float]]:
    """Return the ranges given.

    Raises:
        InputError: one is missing.
    """
    missing = [f"--{name.replace('_', '-')}" for name in (*_RANGES, "ambient") if getattr(settings, name) is None]
    if missing:
        raise InputError(f"no model: name a model file, or add {', '.join(missing)}")
    ranges = {field: tuple(getattr(settings, name)) for name, field in _RANGES.items()}
    return ranges if len(settings.ambient) == 1 else ranges | {"ambient_degC": tuple(settings.ambient)}


def _known_ambient(settings: argparse.Namespace) -> float | None:
    """Return the ambient that the fit will be told, None where it will not.

    Raises:
        InputError: more than two numbers; a range beside a model file.
    """
    given = settings.ambient or []
    if len(given) > 2 or (len(given) == 2 and settings.model is not None):
        raise InputError(f"--ambient has {len(given)} numbers; expected one, or LOW HIGH without a model file")
    return float(given[0]) if len(given) == 1 else None

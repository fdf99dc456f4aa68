"""The commands from a log to a model: `read`, `fit`, `validate` and `plan`."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import chain, options, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import add_known_options, controller_words
from heatertune.codec import peek_schema, plain
from heatertune.errors import DocumentError, InputError
from heatertune.settings import FitSettings, ValidateSettings
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.log.log_values import Log
    from heatertune.model.model_values import FittedModel

__all__ = [
    "FIT_EXAMPLE", "PLAN_EXAMPLE", "READ_EXAMPLE", "VALIDATE_EXAMPLE", "add_fit", "add_plan", "add_read",
    "add_validate", "command_of",
]


READ_EXAMPLE = "example: heatertune read table4"
_ROWS: Final = 5  # shown
_NO_FLAG: Final = {"sample_time_s": "log-interval"}
_COLUMNS: Final = (("time_s", "time [s]"), ("temperature_degC", "temperature [°C]"), ("power_pct", "power [%]"),
                   ("setpoint_degC", "setpoint [°C]"), ("cooling_pct", "cooling [%]"), ("disturbance", "disturbance"),
                   ("ambient_degC", "ambient [°C]"))


def add_read(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "read", help="file → how its columns are read, and the command that repeats it", epilog=READ_EXAMPLE,
        description="Show how a log is read: its first rows, the meaning and unit of each column, what was assumed, "
                    "repaired or looks odd, and the command that repeats this reading without guesses.",
    )
    command.add_argument("log", metavar="LOG", help="a CSV file, or the built-in table3 / table4")
    common.add_reading_options(command)
    printing.add_output_options(command, _run_read)


def _run_read(settings: argparse.Namespace) -> int:

    log = chain.read_log(settings.log, common.reading(settings))
    if settings.until is not None:
        log = log.window(float(log.time_s[0]), settings.until)
    document = _document(settings.log, log)
    printing.output(settings, document, lambda: _lines(document))
    return 0


def command_of(source: str, reading: Mapping[str, Any]) -> str:
    """Return the command line that reads a file with these options of `read_log`."""
    parts = ["heatertune", "read", source]
    for name, value in reading.items():
        parts.append(f"--{_NO_FLAG.get(name, name.replace('_', '-'))}")
        if isinstance(value, tuple):
            parts += [f"{number:g}" for number in value]
        elif value is not True:
            parts.append(str(value).removesuffix(".0") if isinstance(value, float) else str(value))
    return shlex.join(parts)


def _document(source: str, log: Log) -> dict[str, Any]:
    assert log.taken is not None
    rows = [{name: float(getattr(log, name)[k]) for name, _ in _COLUMNS if getattr(log, name) is not None}
            for k in range(_ROWS)]
    return {
        "schema": "heatertune/reading/2", "name": log.name, "source": log.source, "taken": log.taken.document(),
        "first_rows": rows, "repairs": list(log.repairs), "warnings": list(log.warnings),
        "command": command_of(source, log.taken.reading),
    }


def _lines(document: Mapping[str, Any]) -> str:
    rows = document["first_rows"]
    heads = [(name, head) for name, head in _COLUMNS if name in rows[0]]
    table = [[head for _, head in heads], *([f"{row[name]:.7g}" for name, _ in heads] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    shown = ["  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in table]
    parts = [document["taken"]["line"], "\n".join(shown)]
    for title, notes in (("Changed or assumed", document["repairs"]), ("Odd, but left as it is", document["warnings"])):
        if notes:
            parts.append("\n".join([f"{title}:", *(f"- {sentence}" for sentence in notes)]))
    return "\n\n".join([*parts, f"The same with nothing left to guess:\n{document['command']}"])


VALIDATE_EXAMPLE = "example: heatertune validate model.json other_day.csv --ambient 19.5"


def add_validate(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "validate", help="check a model against another log; exit status 1 if it does not fit", epilog=VALIDATE_EXAMPLE,
        description="Simulate a model and its candidates with the power of another log of the same heater and compare "
                    "them with its readings. Only the initial state is fitted.",
    )
    command.add_argument("model", metavar="MODEL", help="model.json as written by fit")
    command.add_argument("log", metavar="LOG",
                         help="a CSV file with power, or without power if the controller is known")
    command.add_argument("-o", "--out", metavar="FILE", help="write the result to this JSON file")
    options.add(command, ValidateSettings, "least_fit_pct")
    common.add_reading_options(command)
    options.add(command.add_argument_group("this log"), ValidateSettings, "ambient_degC", "power_before_pct")
    add_known_options(command)
    printing.add_output_options(command, _run_validate)


def _run_validate(settings: argparse.Namespace) -> int:
    from heatertune.model.model_document import read_model
    from heatertune.model.validate import to_document

    progress = printing.Progress(settings)
    model = read_model(settings.model)
    log = chain.read_log(settings.log, common.reading(settings))
    printing.tell_taken(settings, [log], progress)
    verdict = chain.validate(
        model, log, options.of(ValidateSettings, settings), words=controller_words(settings, [log]),
        setpoint_degC=common.conditions(settings).highest_degC, stated=common.conditions(settings).switches,
    )
    document = to_document(verdict)
    printing.save(settings.out, document)
    printing.output(settings, document, lambda: report.validation_lines(document))
    return 1 if verdict.fails else 0


PLAN_EXAMPLE = "example: heatertune plan model.json --limit-temperature 70 --max-duration 3000 -o plan.csv"
_RANGES = {"gain": "gain_degC_per_pct", "time_constant": "time_constant_s", "dead_time": "dead_time_s"}


def add_plan(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "plan", help="model → the experiment to run, and the intervals to expect from it", epilog=PLAN_EXAMPLE,
        description="Propose the doublet or relay test that identifies a heater best within a temperature limit, and "
                    "predict the intervals before anything is heated.",
    )
    command.add_argument("model", metavar="MODEL", nargs="?", help="model.json, folder of a design, or a log")
    command.add_argument("-o", "--out", metavar="FILE", help="write the schedule to this CSV; or the relay's settings")
    _add_prior_options(command)
    group = command.add_argument_group("the experiment")
    group.add_argument("--limit-temperature", type=float, metavar="°C",
                       help="no plausible heater exceeds it [°C] (default: the highest logged temperature)")
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
    printing.add_output_options(command, _run_plan)


def _add_prior_options(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("what is known, instead of a model file")
    ends = ("LOW", "HIGH")
    group.add_argument("--gain", nargs=2, type=float, metavar=ends, help="rise per percent of power [°C/%%]")
    group.add_argument("--time-constant", nargs=2, type=float, metavar=ends, help="time constant [s]")
    group.add_argument("--dead-time", nargs=2, type=float, metavar=ends, help="dead time [s]")
    group.add_argument("--ambient", nargs="+", type=float, metavar="°C",
                       help="ambient temperature [°C]: one number if the fit will know it, or LOW HIGH")


def _run_plan(settings: argparse.Namespace) -> int:
    from heatertune.model.experiment.fisher import noise_of

    fitted = None if settings.model is None else _model(settings)
    low, high = settings.power
    document = plain(chain.plan(
        _ranges(settings) if fitted is None else fitted,
        limit_degC=_limit_degC(settings, fitted), longest_s=settings.max_duration, kind=settings.kind,
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
    opening = [] if fitted is None else _known_already(fitted, settings.aim / 100.0)
    printing.output(settings, document, lambda: "\n".join([*opening, report.plan_lines(document)]))
    return 0


def _limit_degC(settings: argparse.Namespace, fitted: FittedModel | None) -> float:
    """Return the temperature that the experiment may reach.

    Raises:
        InputError: it is not stated, and no log has reached one.
    """
    if settings.limit_temperature is not None:
        return float(settings.limit_temperature)
    if fitted is None or fitted.logged_range_degC is None:
        raise InputError("plan needs --limit-temperature °C, which no plausible heater exceeds")
    return fitted.logged_range_degC[1]


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
    """Return the model of the file or of a design's folder, or the one that fits a log.

    Raises:
        InputError: ranges are given as well; a log that needs options of fit.
    """
    if any(getattr(settings, name) is not None for name in _RANGES):
        raise InputError("name a model file or --gain, --time-constant, --dead-time, not both")
    given = Path(settings.model)
    path = given / "model.json" if given.is_dir() else given
    if given.is_dir() or _is_document(path):
        return common.model_from(settings, str(path))
    try:
        return chain.fit(chain.read_log(settings.model), progress=printing.Progress(settings))
    except InputError as problem:
        raise InputError(f"{problem} (options of a log belong to heatertune fit LOG -o model.json; then heatertune "
                         "plan model.json)") from None


def _is_document(path: Path) -> bool:
    """Return whether a file is a document of heatertune, or is named like one that is not there."""
    try:
        return peek_schema(path) is not None
    except DocumentError:
        return path.suffix == ".json" and not path.exists()


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
    ambient = settings.ambient or []
    if len(ambient) > 2 or (len(ambient) == 2 and settings.model is not None):
        raise InputError(f"--ambient has {len(ambient)} numbers; expected one, or LOW HIGH without a model file")
    return float(ambient[0]) if len(ambient) == 1 else None


FIT_EXAMPLE = "example: heatertune fit table4 -o model.json"


def add_fit(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "fit", help="log → model: FOPDT with intervals, and every model that explains the log", epilog=FIT_EXAMPLE,
        description="Identify a heater from its temperature log, or from several logs of it.",
    )
    command.add_argument("log", metavar="LOG", nargs="+",
                         help="a CSV file, or the built-in table3 / table4; several logs of one heater (all with "
                              "power, or all without) are fitted together")
    command.add_argument("-o", "--out", metavar="FILE", help="write the model to this JSON file")
    command.add_argument("--hypotheses", action="store_true",
                         help="print the table of controller hypotheses; for one log, all of them")
    common.add_log_options(command)
    add_known_options(command)
    printing.add_output_options(command, _run_fit, brief=True)


def _run_fit(settings: argparse.Namespace) -> int:
    from heatertune.model.model_document import to_document

    progress = printing.Progress(settings)
    progress("reading")
    logs = [chain.read_log(name, common.reading(settings)) for name in settings.log]
    printing.tell_taken(settings, logs, progress)
    progress("finding the heater")
    document = to_document(_fitted(settings, logs, progress))
    printing.save(settings.out, document)
    shown = settings.hypotheses or settings.controller is not None
    parts = [report.model_lines, report.hypothesis_table] if shown else [report.model_lines]
    printing.output(settings, document, lambda: "\n\n".join(part(document) for part in parts),
                    brief=None if shown else lambda: report.model_brief(document, settings.out),
                    short=lambda: {name: part for name, part in document.items() if name != "residuals"})
    return 0


def _fitted(settings: argparse.Namespace, logs: Sequence[Log], progress: printing.Progress) -> FittedModel:

    fit_settings = options.of(FitSettings, settings)
    words = controller_words(settings, logs)
    if words is not None:
        its = common.conditions(settings)
        return chain.fit_known(
            logs[0], words, fit_settings, setpoint_degC=its.highest_degC, stated=its.switches, progress=progress)
    if len(logs) == 1:
        return chain.fit(logs[0], fit_settings, thorough=settings.hypotheses, progress=progress)
    return chain.fit_together(logs, fit_settings, progress=progress)

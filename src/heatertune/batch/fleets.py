"""`fleet`: each heater of many logs or models is fitted, tuned, rounded to words and proven; one row of a table each.

A heater that fails at any stage has the reason in its row.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields
from functools import partial
from glob import glob, has_magic
from pathlib import Path, PurePath
from typing import Any, Final, NamedTuple

from heatertune import cache
from heatertune.batch import CaseBatch, Progress, Row, TableColumn, Workers, run, silent
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError, InputError, LogError
from heatertune.log import read_log
from heatertune.model.model_values import FittedModel, Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.pid.specs import without_explanation
from heatertune.plc import Words, controller_for
from heatertune.plc.words import FLOATS
from heatertune.processors import on_one
from heatertune.proof import Proof
from heatertune.proof.criteria import CRITERIA
from heatertune.proof.redesign import DesignRequest
from heatertune.proof.redesign.on_samples import closed_on_samples
from heatertune.proof.specification import specification_of
from heatertune.proof.text_comparison import as_exported
from heatertune.proof.verdict import samples_text
from heatertune.settings import FitSettings, ReadSettings
from heatertune.writing import read_bytes, read_text

__all__ = ["HEAD", "RESULT", "SCHEMA", "ZoneSettings", "find_logs", "fleet", "lost_row", "word_columns", "zone_row"]


_WHAT: Final = {
    "gain_degC_per_pct": "process gain [°C/%]", "time_constant_s": "time constant [s]", "dead_time_s": "dead time [s]",
    "ambient_degC": "ambient temperature, reached without power [°C]",
}

_DESIGN: Final = {
    "gain_pct_per_degC": "proportional gain K [%/°C]", "integral_time_s": "TN [s], infinite without an I part",
    "derivative_time_s": "TV [s]", "sample_time_s": "sampling interval TA [s]",
}

#: the columns every row begins with
HEAD: Final = (
    TableColumn("outcome", "text",
                "PASS, FAIL or NOT PROVEN; or the stage that failed: no log, no fit, no design, no words, "
                            "no proof; crashed: program error"),
    TableColumn("reason", "text", "limits that the proof did not keep, or why a stage failed"),
)

#: the columns of what was found
RESULT: Final = (
    TableColumn("log_taken", "text", "columns of the log and their meaning"),
    TableColumn("fit_outcome", "text", "outcome of the fit"),
    *(TableColumn(f"{name}{end}", "float", f"{what}{of}") for name, what in _WHAT.items() for end,
      of in (
        ("", " of the working model"), ("_ci95_low", ", low end of its 95 % interval"),
        ("_ci95_high", ", high end of its 95 % interval"))),
    TableColumn("fit_pct", "float", "fit of the working model to the log [%]"),
    TableColumn("models", "int", "candidate models used for tuning and proof"),
    *(TableColumn(name, "float", f"{what} of the design") for name, what in _DESIGN.items()),
    TableColumn("structure", "text", "controller structure"),
    TableColumn("method", "text", "design method"),
    TableColumn("words", "text", "the parameters for the PLC, as JSON"),
    TableColumn("remarks", "text",
                "other remarks of the verdict line: changes made to pass, or changes that would pass"),
    TableColumn("ramp_degC_per_min", "float", "setpoint ramp [°C/min]; empty: none"),
    TableColumn("hold_degC", "float",
                "its holdback: largest distance of the setpoint from the reading [°C]; empty: unlimited"),
    TableColumn("boost_within_degC", "float",
                "boost: full power until this distance from the setpoint [°C]; empty: none"),
    TableColumn("boost_again_degC", "float", "boost: full power again beyond this distance [°C]"),
    TableColumn("setpoint_degC", "float", "setpoint of the proof [°C]"),
    TableColumn("pwm_period_s", "float", "PWM period of the proof [s]; set this one if you gave none"),
    TableColumn("runs", "int", "closed-loop runs of the proof"),
    *(TableColumn(kind.column, "float", f"{kind.name.replace('_', ' ')}, the worst over all runs")
      for kind in CRITERIA if kind.column),
    TableColumn("samples", "int", "sampled heaters of the proof"),
    TableColumn("samples_passing_pct", "float", "percentage of them that keep every limit [%]"),
    TableColumn("samples_worst_seed", "int", "seed of the worst sample, for verify --replay"),
)


def word_columns(targets: Iterable[str]) -> tuple[TableColumn, ...]:
    """Return a column for every word of the targets; words of one name share it.

    Raises:
        UnknownName: no such target.
    """
    columns: dict[str, TableColumn] = {}
    for target in targets:
        for word in controller_for(target).fields:
            before = columns.get(word.name)
            whole = word.format not in FLOATS and (before is None or before.kind == "int")
            what = f"word {word.name} of {target}" if before is None else f"{before.description}, {target}"
            columns[word.name] = TableColumn(f"word_{word.name}", "int" if whole else "float", what)
    return tuple(columns.values())


def zone_row(name: str, find: Callable[[], FittedModel], request: DesignRequest) -> Row:
    """Take a heater through the chain as `design` does; what cannot be done is told in the row, never raised.

    Nothing but what `find` finds is kept in the cache: a million designs would fill the disk.

    Args:
        name: of the row.
        find: reads and fits the log, or reads the model.
        request: what the design is asked for.
    """
    row: Row = {"name": name}
    stage = "no fit"
    try:
        fitted = find()
        row |= _model(fitted)
        with cache.cache_disabled(), without_explanation(), on_one():
            stages = list[str]()
            try:
                design = closed_on_samples(fitted, request, stage=stages.append)
                proof = as_exported(design.proof)
            finally:
                stage = f"no {stages[-1]}"
            return row | _design(design.ideal) | _words(proof.words) | _proof(proof) | _sampled(proof)
    except HeatertuneError as problem:
        return row | {"outcome": "no log" if isinstance(problem, LogError) else stage, "reason": str(problem)}
    except Exception as problem:  # one zone must not stop the others, whatever is wrong in the program
        return row | {"outcome": "crashed", "reason": f"{stage}: {type(problem).__name__}: {problem}"}


def lost_row(name: str, why: str) -> Row:
    """Return the row of a case whose process died."""
    return {"name": name, "outcome": "crashed", "reason": why}


def _model(fitted: FittedModel) -> Row:
    row: Row = {"log_taken": "; ".join(fitted.log_summary) or None, "fit_outcome": fitted.outcome.name,
                "fit_pct": fitted.fit_pct, "models": len(fitted.plants)}
    for name in (parameter.name for parameter in fields(Fopdt)):
        interval = fitted.ci95.get(name)
        row[name] = getattr(fitted.model, name)
        row[f"{name}_ci95_low"] = None if interval is None else interval.low
        row[f"{name}_ci95_high"] = None if interval is None else interval.high
    return row


def _design(design: PidDesign) -> Row:
    return {name: getattr(design, name) for name in (*_DESIGN, "structure", "method")}


def _words(words: Words) -> Row:
    values = dict(words.values)
    return {"words": json.dumps(values), **{f"word_{name}": value for name, value in values.items()}}


def _proof(proof: Proof) -> Row:
    worst, boost = {criterion.name: criterion.value for criterion in proof.criteria}, proof.words.boost
    columns = {kind.column: worst.get(kind.name, math.nan) for kind in CRITERIA if kind.column}
    return {
        "outcome": proof.verdict, "reason": "; ".join(_reasons(proof)) or None,
        "remarks": "; ".join(proof.diagnostics.remarks) or None,
        "ramp_degC_per_min": None if proof.words.ramp is None else proof.ramp_degC_per_min,
        "hold_degC": proof.hold_degC,
        "boost_within_degC": None if boost is None else boost.within_degC,
        "boost_again_degC": None if boost is None else boost.again_degC,
        "setpoint_degC": proof.scenario.setpoint_degC, "pwm_period_s": proof.actuator.pwm_period_s,
        "runs": len(proof.runs),
        **{column: None if math.isnan(value) else float(value) for column, value in columns.items()},
    }


def _reasons(proof: Proof) -> Iterator[str]:
    if proof.broken_criteria:
        yield f"not kept: {', '.join(proof.broken_criteria)}"
    yield from (f"not proven: {name}" for name in proof.diagnostics.blocking)
    if proof.samples is not None and proof.samples.verdict != "PASS":
        yield samples_text(proof.samples.to_document())


def _sampled(proof: Proof) -> Row:
    drawn = proof.samples
    return {} if drawn is None else {
        "samples": drawn.count, "samples_passing_pct": 100.0 * drawn.passing, "samples_worst_seed": drawn.worst_seed}


SCHEMA: Final = "heatertune/fleet/1"

#: files of a folder that are taken for logs
_ENDINGS: Final = (".csv", ".tsv", ".txt", ".log", ".dat")
_COLUMNS: Final = (TableColumn("name", "text", "file of the log, without the common part of the paths"), *HEAD, *RESULT)


class Zone(NamedTuple):
    """A log on its way to a worker: its name, and its content or why it could not be read."""

    name: str
    content: bytes | None
    problem: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneSettings:
    """What is done with every log of a fleet.

    Attributes:
        asked: what each design is asked for.
        read: how the logs are read.
        fitted_with: what is known beside them.
    """

    request: DesignRequest
    read: ReadSettings = field(default_factory=ReadSettings)
    fitted_with: FitSettings = field(default_factory=FitSettings)


def fleet(
    logs: str | Path, settings: ZoneSettings, *, out: str | Path, workers: Workers, resume: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Take every log through the chain and write one row per log, sorted by name; return the summary.

    A log that cannot be read, fitted or proven is a row with its reason and stops no other. Nothing is kept in the
    cache of `heatertune.cache`: the parts beside the table are.

    Args:
        logs: a folder (searched through), a pattern with ``*``, or a text file with one path per line.
        settings: what is done with each.
        out: Parquet file; the meaning of every column is kept in it.
        workers: where the zones are done.
        resume: go on where a run with the same options was stopped; logs that have changed since are done again.
        progress: called with how many zones are done, and how many there are.

    Raises:
        UnknownName: no such target.
        InputError: no log found, or as `in_force`; as `heatertune.batch.engine`.
    """
    controller_for(settings.request.target)  # an unknown one is refused before the long part
    # likewise, and a file may change before the fleet is resumed
    specification = specification_of(settings.request.conditions)
    folder, names = find_logs(logs)
    listed = hashlib.sha256(json.dumps(names).encode()).hexdigest()
    batch = CaseBatch(
        do=_zone, common=settings, cases=names, sent=partial(_sent, folder), lost=lost_row,
        columns=(*_COLUMNS, *word_columns([settings.request.target])),
        identity={one.name: repr(getattr(settings, one.name)) for one in fields(settings)} | {
            "logs": listed, "specification": repr(specification)},
    )
    return {"schema": SCHEMA} | run(batch, out, workers=workers, resume=resume, progress=progress)


def find_logs(logs: str | Path) -> tuple[str, list[str]]:
    """Return the folder that all logs share, and their paths below it: each once, sorted, with "/" on any machine.

    Raises:
        InputError: there are none, or the list cannot be read.
    """
    files, expected = _log_files(logs)
    paths = {os.path.abspath(path) for path in files}  # noqa: PTH100 - `resolve` would follow links: their names count
    if not paths:
        raise InputError(f"{logs}: no log found; expected {expected}")
    # the table does not tell where the logs lay, nor do the errors in it
    folder = os.path.commonpath([str(Path(path).parent) for path in paths])
    return folder, sorted(PurePath(os.path.relpath(path, folder)).as_posix() for path in paths)


def _log_files(logs: str | Path) -> tuple[Iterable[Path], str]:
    """Return the files, and what was looked for."""
    place = Path(logs)
    if place.is_dir():
        return (
            (path for path in place.rglob("*") if path.suffix.lower() in _ENDINGS and _is_log(path)),
            f"files that end in {', '.join(_ENDINGS)}",
        )
    if has_magic(str(logs)) and not place.exists():
        matching = glob(str(logs), recursive=True)  # noqa: PTH207 - `Path.glob` takes no absolute pattern
        return (path for path in map(Path, matching) if _is_log(path)), "files that match"
    return _listed(place), "one path per line"


def _is_log(path: Path) -> bool:
    """Whether a path is a file, or a link that leads nowhere now: a zone of its own, which cannot be read."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def _listed(path: Path) -> Iterator[Path]:
    try:
        lines = read_text(path).split("\n")
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"{path}: cannot be read; expected a folder, a pattern, or a list of paths") from problem
    return (path.parent / line.strip() for line in lines if line.strip() and not line.startswith("#"))


def _sent(folder: str, name: str) -> Zone:
    try:
        return Zone(name, read_bytes(Path(folder, name)), None)
    except OSError as problem:
        return Zone(name, None, f"cannot be read: {problem.strerror}")


def _zone(settings: ZoneSettings, zone: Zone) -> Row:
    """Return the row of one log; this runs on the worker."""
    return zone_row(zone.name, partial(_fitted, settings, zone), settings.request)


def _fitted(settings: ZoneSettings, zone: Zone) -> FittedModel:
    if zone.content is None:
        raise LogError(str(zone.problem), file=zone.name)
    log = read_log(zone.name, settings.read, content=zone.content)
    with cache.cache_disabled():
        return fit(log, settings.fitted_with)

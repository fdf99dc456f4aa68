"""The logs of many heaters → one table: each is fitted, tuned, rounded to words and proven, or says why not."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from functools import partial
from glob import glob, has_magic
from pathlib import Path, PurePath
from typing import Any, Final, NamedTuple

from heatertune import cache
from heatertune.batch import CaseBatch, Progress, Row, TableColumn, Workers, run, silent
from heatertune.batch.zone import HEAD, RESULT, lost_row, word_columns, zone_row
from heatertune.chain.stages import fit
from heatertune.errors import InputError, LogError
from heatertune.log import read_log
from heatertune.model.values import FittedModel
from heatertune.plc import controller_for
from heatertune.proof.redesign import DesignRequest
from heatertune.proof.spec_file import specification_of
from heatertune.settings import FitSettings, ReadSettings
from heatertune.writing import read_bytes, read_text

__all__ = ["SCHEMA", "ZoneSettings", "find_logs", "fleet"]

SCHEMA: Final = "heatertune/fleet/1"

#: files of a folder that are taken for logs
_ENDINGS: Final = (".csv", ".tsv", ".txt", ".log", ".dat")
_COLUMNS: Final = (
    TableColumn(name="name", kind="text",
                description="the log's file, without the part of its path that all logs share"),
    *HEAD, *RESULT,
)


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
        progress: told how many zones are done, and how many there are.

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
    files, expected = _found(logs)
    paths = {os.path.abspath(path) for path in files}  # noqa: PTH100 - `resolve` would follow links: their names count
    if not paths:
        raise InputError(f"{logs}: no log found; expected {expected}")
    # the table does not tell where the logs lay, nor do the errors in it
    folder = os.path.commonpath([str(Path(path).parent) for path in paths])
    return folder, sorted(PurePath(os.path.relpath(path, folder)).as_posix() for path in paths)


def _found(logs: str | Path) -> tuple[Iterable[Path], str]:
    """Return the files, and what was looked for."""
    given = Path(logs)
    if given.is_dir():
        return (
            (path for path in given.rglob("*") if path.suffix.lower() in _ENDINGS and _is_log(path)),
            f"files that end in {', '.join(_ENDINGS)}",
        )
    if has_magic(str(logs)) and not given.exists():
        matching = glob(str(logs), recursive=True)  # noqa: PTH207 - `Path.glob` takes no absolute pattern
        return (path for path in map(Path, matching) if _is_log(path)), "files that match"
    return _listed(given), "one path per line"


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

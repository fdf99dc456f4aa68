"""A study: every case of a STUDY.toml taken through the chain, one row of a table each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from heatertune.batch import CaseBatch, Progress, Row, TableColumn, Workers, run, silent
from heatertune.batch.study_file import KEYS, Study, read_study, scaling_of
from heatertune.batch.zone import HEAD, RESULT, lost_row, word_columns, zone_row
from heatertune.chain.stages import fit
from heatertune.documents import read_document
from heatertune.errors import DocumentError
from heatertune.files import read_bytes
from heatertune.log import read_log
from heatertune.log.tables import BUILT_IN
from heatertune.model.document import SCHEMA as MODEL_SCHEMA
from heatertune.model.document import from_document
from heatertune.model.manual_model import model_by_hand
from heatertune.model.values import FittedModel, Fopdt, TwoLag
from heatertune.options import options_of
from heatertune.proof.profile_file import read_profile
from heatertune.proof.redesign import DesignRequest
from heatertune.proof.spec_file import in_force
from heatertune.settings import Conditions, FitSettings, SampleSettings, TuneSettings

__all__ = ["SCHEMA", "study"]

SCHEMA: Final = "heatertune/study/1"

_T = TypeVar("_T")


class Case(NamedTuple):
    """A case on its way to a worker: its number and name, its settings, and what its log or model file holds."""

    number: int
    name: str
    settings: Mapping[str, Any]
    content: Any


def study(
    path: str | Path, *, out: str | Path, workers: Workers, resume: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Do every case of a study and write one row per case, in the order of the file; return the summary.

    Args:
        path: STUDY.toml, see `read_study`; files it names lie beside it.
        out: Parquet file; a setting is the column ``case_<key>``, the meaning of every column is kept in the table.
        workers: where the cases are done.
        resume: go on where a run of the same study was stopped; cases whose files have changed since are done again.
        progress: told how many cases are done, and how many there are.

    Raises:
        DocumentError: as `read_study`; a log, model or specification that cannot be read.
        UnknownName: no such specification.
        InputError: as `heatertune.batch.engine`.
    """
    cases = read_study(path)
    files = _files(Path(path), cases)
    # refused before the long part, and a file may change before the study is resumed
    folder = Path(path).parent
    specifications = {name: repr(in_force(_beside(folder, name))) for name in cases.settings_of("spec")}
    profiles = {name: repr(read_profile(folder / name)) for name in cases.settings_of("profile")}
    varied = [key for key in cases.keys if key in cases.grid or any(key in case for case in cases.listed)]

    def sent(number: int) -> Case:
        settings = cases.case(number)
        source = settings.get("log", settings.get("model"))
        return Case(number, _name(settings, varied), settings, files.get(source))

    def lost(number: int, why: str) -> Row:
        case = sent(number)
        return _labelled(case, lost_row(case.name, why))

    batch = CaseBatch(
        do=_row, common=folder, cases=range(len(cases)), sent=sent, lost=lost, columns=_columns(cases),
        identity={"fixed": cases.fixed, "grid": cases.grid, "case": cases.listed, "specifications": specifications,
                  **({"profiles": profiles} if profiles else {})},
    )
    return {"schema": SCHEMA} | run(batch, out, workers=workers, resume=resume, progress=progress)


def _files(path: Path, cases: Study) -> dict[str, Any]:
    """Return what the logs (bytes) and models (documents) of all cases hold, name → content."""
    content: dict[str, Any] = {}
    for name in cases.settings_of("model"):
        content[name] = read_document(path.parent / name, MODEL_SCHEMA)
    for name in cases.settings_of("log"):
        if name.lower() in BUILT_IN:
            continue
        try:
            content[name] = read_bytes(path.parent / name)
        except OSError as problem:
            raise DocumentError(f"{path}: log {name!r} cannot be read: {problem.strerror}") from problem
    return content


def _columns(cases: Study) -> tuple[TableColumn, ...]:
    kinds = {str: "text", float: "float", int: "int", bool: "bool", dict: "text"}
    return (
        TableColumn(name="case", kind="int", description="number of the case, from 1"),
        TableColumn(name="name", kind="text", description="what tells the case from the others"),
        *(TableColumn(name=f"case_{key}", kind=kinds[KEYS[key].kind],
                      description=f"as requested: {KEYS[key].quantity_with_unit}")
          for key in cases.keys),
        *HEAD, *RESULT, *word_columns(cases.settings_of("target")),
    )


def _name(settings: Mapping[str, Any], varied: list[str]) -> str:
    return ", ".join(f"{key} = {_told(settings[key])}" for key in varied if key in settings)


def _told(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, dict) else str(value)


def _labelled(case: Case, row: Row) -> Row:
    settings = {f"case_{key}": _told(value) if isinstance(value, dict) else value
                for key, value in case.settings.items()}
    return {"case": case.number + 1, **settings, **row}


def _row(folder: Path, case: Case) -> Row:
    """Return the row of one case; this runs on the worker."""
    settings = case.settings
    conditions = _of(Conditions, settings)
    if conditions.spec is not None:
        conditions = replace(conditions, spec=_beside(folder, conditions.spec))
    if conditions.profile is not None:
        conditions = replace(conditions, profile=str(folder / conditions.profile))
    asked = DesignRequest(
        target=settings["target"], scaling=scaling_of(settings), tune_settings=_of(TuneSettings, settings),
        conditions=conditions, words_by=settings.get("words", "auto"), as_is=settings.get("as_is", False),
        sample_settings=SampleSettings(samples=settings.get("samples") or None))
    return _labelled(case, zone_row(case.name, partial(_heater, case), asked))


def _beside(folder: Path, spec: str) -> str:
    """Return what to read a specification by: a file stands beside the study."""
    return str(folder / spec) if spec.endswith(".toml") else spec


def _of(kind: type[_T], settings: Mapping[str, Any]) -> _T:
    """Return a dataclass of options as a case sets them."""
    return kind(**{name: settings[name] for name in options_of(kind) if name in settings})


def _heater(case: Case) -> FittedModel:
    """Return the heater of a case: by hand, from a model file, or fitted to a log."""
    settings = case.settings
    if "model" in settings:
        return from_document(case.content)
    if "log" in settings:
        return _fitted(settings["log"], case.content, _of(FitSettings, settings))
    plant = {field.name: settings[field.name] for field in fields(Fopdt) if field.name in settings}
    second = settings.get("second_time_constant_s")
    return model_by_hand(Fopdt(**plant) if second is None else TwoLag(**plant, second_time_constant_s=second))


@lru_cache(maxsize=16)
def _fitted(name: str, content: bytes | None, given: FitSettings) -> FittedModel:
    """Return the fit of a log; the cases that share it come one after the other."""
    return fit(read_log(name, content=content, errata=True), given)

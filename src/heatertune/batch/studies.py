"""`study`: the cases of a STUDY.toml, a grid and single cases, each run through the chain to one row of a table."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from heatertune.batch import CaseBatch, Progress, Row, TableColumn, Workers, run, silent
from heatertune.batch.fleets import HEAD, RESULT, lost_row, word_columns, zone_row
from heatertune.chain.stages import fit
from heatertune.codec import decode, read_document, read_toml
from heatertune.errors import DocumentError, InputError, UnknownName
from heatertune.log import read_log
from heatertune.log.log_values import BUILT_IN
from heatertune.model.model_document import SCHEMA as MODEL_SCHEMA
from heatertune.model.model_document import from_document
from heatertune.model.model_values import FittedModel, TwoLag, model_by_hand
from heatertune.model.two_scales import heater_of_numbers
from heatertune.options import Option, options_of
from heatertune.pid.tune import METHODS
from heatertune.plc import NAMES, Scaling, controller_for
from heatertune.plc.open_points import settings_of
from heatertune.proof.profile import read_profile
from heatertune.proof.redesign import DesignRequest
from heatertune.proof.specification import in_force
from heatertune.settings import Conditions, FitSettings, SampleSettings, SensorSettings, TuneSettings, WordSettings
from heatertune.writing import read_bytes

__all__ = ["KEYS", "SCHEMA", "Study", "read_study", "scaling_of", "study"]


def _key(kind: type, what: str, **more: Any) -> Option:
    return Option(kind=kind, default=None, quantity=what, **more)


def _keys(kind: type) -> dict[str, Option]:
    """Return the keys of a dataclass of options; texts that may be repeated are no setting of a case."""
    return {name: one for name, one in options_of(kind).items() if one.kind in _TYPES}


#: kind of a key → what the file holds
_TYPES: Final[Mapping[type, Any]] = {float: float, int: int, str: str, bool: bool, dict: dict[str, str]}

#: every key of a study, in the order of the chain
KEYS: Final[Mapping[str, Option]] = {
    "log": _key(str, "a log to fit: a CSV file, table3 or table4"),
    "model": _key(str, "model.json as written by fit"),
    "gain_degC_per_pct": _key(float, "process gain of a model given by its parameters", unit="°C/%"),
    "time_constant_s": _key(float, "its time constant", unit="s"),
    "second_time_constant_s": _key(float, "its second time constant", unit="s"),
    "zero_s": _key(float, "time of its zero, between both time constants", unit="s"),
    "dead_time_s": _key(float, "its dead time", unit="s"),
    **_keys(FitSettings),
    "target": _key(str, "the controller", choices=tuple(NAMES)),
    **_keys(TuneSettings) | {"method": replace(_keys(TuneSettings)["method"], choices=METHODS)},
    "words": options_of(WordSettings)["words_by"],
    "as_is": options_of(WordSettings)["as_is"],
    "range_low_degC": _key(float, "temperature at the sensor's lowest reading", unit="°C"),
    "range_high_degC": _key(float, "temperature at the sensor's highest reading", unit="°C"),
    "input": options_of(SensorSettings)["input"],
    **_keys(Conditions),
    "samples": _key(int, "number of sampled heaters for the proof", least=0.0),
}

_RANGE: Final = ("range_low_degC", "range_high_degC")
_PARTS: Final = ("fixed", "grid", "case")
_SOURCES: Final = ("log", "model", "gain_degC_per_pct")
_BY_HAND: Final = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
#: key → the one without which it means nothing
_NEEDS: Final = {
    "second_time_constant_s": "gain_degC_per_pct", "zero_s": "second_time_constant_s",
    "time_constant_s": "gain_degC_per_pct",
    "dead_time_s": "gain_degC_per_pct", **{name: "log" for name in _keys(FitSettings) if name != "ambient_degC"},
    **{name: its.needs for name, its in options_of(Conditions).items() if its.needs},
}


#: key of a study → setting of a case
CaseSettings = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """The cases of a study: the grid's, its first key varying slowest, then the listed ones; made when asked for.

    Attributes:
        fixed: what all cases share, unless a listed one sets it itself.
        grid: key → settings.
        listed: what each listed case sets.
    """

    fixed: CaseSettings
    grid: Mapping[str, Sequence[Any]]
    listed: Sequence[CaseSettings]

    @property
    def keys(self) -> list[str]:
        """The keys that any case sets, in the order of `KEYS`."""
        used = {*self.fixed, *self.grid, *(key for case in self.listed for key in case)}
        return [key for key in KEYS if key in used]

    def settings_of(self, key: str) -> list[Any]:
        """Return every setting of a key, each once, in the order of the file."""
        single = [part[key] for part in (self.fixed, *self.listed) if key in part]
        return list(dict.fromkeys([*single, *self.grid.get(key, ())]))

    def __len__(self) -> int:
        return self._combinations + len(self.listed)

    def case(self, number: int) -> CaseSettings:
        """Return the settings of a case; the first is number 0."""
        if number >= self._combinations:
            return {**self.fixed, **self.listed[number - self._combinations]}
        chosen: dict[str, Any] = {}
        for key in reversed(list(self.grid)):
            number, which = divmod(number, len(self.grid[key]))
            chosen[key] = self.grid[key][which]
        return {**self.fixed, **chosen}

    @property
    def _combinations(self) -> int:
        return math.prod(map(len, self.grid.values())) if self.grid else 0


def read_study(path: str | Path) -> Study:
    """Return the cases of a study.

    The file has up to three parts: ``[fixed]`` what all cases share, ``[grid]`` lists of which every combination is a
    case, ``[[case]]`` one further case each. Their keys are those of `KEYS`.

    Raises:
        DocumentError: no such file, no TOML, an unknown key, a setting of the wrong type, an unknown name, an empty
            list, a case without heater or target.
    """
    content = read_toml(path)
    for part in content:
        _demand_known(path, "part", part, _PARTS)
    study = Study(
        fixed=_settings(f"{path}, [fixed]", content.get("fixed", {})),
        grid=_grid(f"{path}, [grid]", content.get("grid", {})),
        listed=_listed(path, content.get("case", [])),
    )
    if not len(study):
        raise DocumentError(f"{path}: no cases; expected [grid] with lists, or [[case]]")
    for where, case in _shapes(path, study):
        _check(where, case)
    return study


def _grid(where: str, value: object) -> dict[str, list[Any]]:
    lists: dict[str, list[Any]] = {}
    for key, settings in _table(where, value).items():
        _demand_known(where, "key", key, KEYS)
        if not isinstance(settings, list) or not settings:
            raise DocumentError(f"{where}: {key} is {settings!r}; expected a list of at least one setting")
        lists[key] = [_setting(where, key, setting) for setting in settings]
        if any(setting in lists[key][:k] for k, setting in enumerate(lists[key])):
            raise DocumentError(f"{where}: {key} is {settings!r}; expected each setting once")
    return lists


def _listed(path: str | Path, value: object) -> list[dict[str, Any]]:
    if not isinstance(value, list):
        raise DocumentError(f"{path}: case is {value!r}; expected [[case]], once per case")
    return [_settings(f"{path}, [[case]] {k}", case) for k, case in enumerate(value, start=1)]


def _settings(where: str, content: object) -> dict[str, Any]:
    settings = _table(where, content)
    for key in settings:
        _demand_known(where, "key", key, KEYS)
    return {key: _setting(where, key, value) for key, value in settings.items()}


def _table(where: str, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise DocumentError(f"{where}: {value!r}; expected a table of key = setting")
    return value


def _setting(where: str, key: str, value: Any) -> Any:
    """Return a setting of its kind and in its range, numbers as floats."""
    if isinstance(value, list):
        raise DocumentError(f"{where}: {key} is {value!r}; lists belong in [grid]")
    setting = decode(_TYPES[KEYS[key].kind], value, where, key)
    try:
        KEYS[key].check(setting, key)
    except InputError as problem:
        raise DocumentError(f"{where}: {problem}") from problem
    return setting


def _demand_known(where: str | Path, kind: str, name: str, allowed: Any) -> None:
    if name not in allowed:
        raise DocumentError(f"{where}: {UnknownName(kind, name, allowed)}")


def _shapes(path: str | Path, study: Study) -> Iterator[tuple[str, CaseSettings]]:
    """Return one case of each shape with its place: those that differ only in numbers need no second look."""
    if study.grid:
        chosen = {key: settings if key in ("target", "switches", "input", "samples") else settings[:1]
                  for key, settings in study.grid.items()}
        for settings in product(*chosen.values()):
            yield f"{path}, [grid]", {**study.fixed, **dict(zip(chosen, settings, strict=True))}
    for k, case in enumerate(study.listed, start=1):
        yield f"{path}, [[case]] {k}", {**study.fixed, **case}


def _check(where: str, case: CaseSettings) -> None:
    """Refuse a case without a heater or a target, or with a key that needs another one."""
    sources = [key for key in _SOURCES if key in case]
    if len(sources) != 1:
        source_names = " and ".join(sources) or "no heater"
        raise DocumentError(f"{where}: {source_names}; expected one of {', '.join(_SOURCES)}")
    if "target" not in case:
        raise DocumentError(f"{where}: no target; expected one of {', '.join(NAMES)}")
    for key, needed in _NEEDS.items():
        if key in case and needed not in case:
            raise DocumentError(f"{where}: {key} needs {needed}")
    _check_values(where, case)


def _check_values(where: str, case: CaseSettings) -> None:
    if case.get("samples") and "interlock" in case:
        raise DocumentError(f"{where}: samples cannot be combined with an interlock; omit one of them")
    missing = [key for key in _BY_HAND if key not in case]
    if "gain_degC_per_pct" in case and missing:
        raise DocumentError(f"{where}: no {missing[0]}; a model given by its parameters needs {', '.join(_BY_HAND)}")
    try:
        settings_of(controller_for(case["target"]).switches, case.get("switches", {}))
        scaling_of(case)
    except InputError as problem:
        raise DocumentError(f"{where}: {case['target']}: {problem}") from problem


def scaling_of(case: CaseSettings) -> Scaling:
    """Return the sensor's range of a case; errors as `heatertune.plc.inputs.sensor_scaling`."""
    low, high = _RANGE
    plain = options_of(SensorSettings)["range_degC"].default
    return controller_for(case["target"]).scaled(case.get("input"), (case.get(low, plain[0]), case.get(high, plain[1])))


SCHEMA: Final = "heatertune/study/1"

_T = TypeVar("_T")


class Case(NamedTuple):
    """A case on its way to a worker: its number and name, its settings, and what its log or model file holds."""

    number: int
    name: str
    settings: CaseSettings
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
        progress: called with how many cases are done, and how many there are.

    Raises:
        DocumentError: as `read_study`; a log, model or specification that cannot be read.
        UnknownName: no such specification.
        InputError: as `heatertune.batch.engine`.
    """
    cases = read_study(path)
    files = _files(Path(path), cases)
    # refused before the long part, and a file may change before the study is resumed
    folder = Path(path).parent
    specifications = {name: repr(in_force(_spec_path(folder, name))) for name in cases.settings_of("spec")}
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
    """Return the contents of the logs (bytes) and models (documents) of all cases, name → content."""
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
        TableColumn("case", "int", "number of the case, from 1"),
        TableColumn("name", "text", "settings that distinguish the case"),
        *(TableColumn(f"case_{key}", kinds[KEYS[key].kind],
                      f"as requested: {KEYS[key].quantity_with_unit}")
          for key in cases.keys),
        *HEAD, *RESULT, *word_columns(cases.settings_of("target")),
    )


def _name(settings: CaseSettings, varied: list[str]) -> str:
    return ", ".join(f"{key} = {_value_text(settings[key])}" for key in varied if key in settings)


def _value_text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, dict) else str(value)


def _labelled(case: Case, row: Row) -> Row:
    settings = {f"case_{key}": _value_text(value) if isinstance(value, dict) else value
                for key, value in case.settings.items()}
    return {"case": case.number + 1, **settings, **row}


def _row(folder: Path, case: Case) -> Row:
    """Return the row of one case; this runs on the worker."""
    settings = case.settings
    conditions = _of(Conditions, settings)
    if conditions.spec is not None:
        conditions = replace(conditions, spec=_spec_path(folder, conditions.spec))
    if conditions.profile is not None:
        conditions = replace(conditions, profile=str(folder / conditions.profile))
    request = DesignRequest(
        target=settings["target"], scaling=scaling_of(settings), tune_settings=_of(TuneSettings, settings),
        conditions=conditions, words_by=settings.get("words", "auto"), as_is=settings.get("as_is", False),
        sample_settings=SampleSettings(samples=settings.get("samples") or None))
    return _labelled(case, zone_row(case.name, partial(_heater, case), request))


def _spec_path(folder: Path, spec: str) -> str:
    """Return what to read a specification by: a file stands beside the study."""
    return str(folder / spec) if spec.endswith(".toml") else spec


def _of(kind: type[_T], settings: CaseSettings) -> _T:
    """Return a dataclass of options as a case sets them."""
    return kind(**{name: settings[name] for name in options_of(kind) if name in settings})


def _heater(case: Case) -> FittedModel:
    """Return the heater of a case: by hand, from a model file, or fitted to a log."""
    settings = case.settings
    if "model" in settings:
        return from_document(case.content)
    if "log" in settings:
        return _fitted(settings["log"], case.content, _of(FitSettings, settings))
    numbers = (*(field.name for field in fields(TwoLag)), "zero_s")
    return model_by_hand(heater_of_numbers(**{name: settings[name] for name in numbers if name in settings}))


@lru_cache(maxsize=16)
def _fitted(name: str, content: bytes | None, settings: FitSettings) -> FittedModel:
    """Return the fit of a log; the cases that share it come one after the other."""
    return fit(read_log(name, content=content, errata=True), settings)

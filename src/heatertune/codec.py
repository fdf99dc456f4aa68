"""JSON documents: frozen dataclasses are written and read by one codec, with the path of the field in each error.

A document has the shape of a dataclass: fields in the order in which they are written, a default where a field is
optional. `encode` writes values as JSON; `decode` reads and checks them, or names the field and its fault:

    model.json: candidates[1].fit_pct: expected a number, got "x"

The type of a field says what JSON cannot: `OrInfinite` and `OrUnknown` are floats that null stands for.
"""

from __future__ import annotations

import json
import math
import os
import sys
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Final,
    Literal,
    NamedTuple,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from heatertune.errors import DocumentError, InputError
from heatertune.writing import read_text

__all__ = [
    "DATA", "FLAT", "LEFT_OUT", "Document", "EarlierDocument", "Null", "OrInfinite", "OrUnknown", "construct_from",
    "data_folder", "decode", "encode", "existing_path", "is_earlier", "peek_schema", "plain", "read_document",
    "read_toml", "register_schema", "schema_of", "to_json", "with_current_keys",
]


#: a JSON document of a stage, or an object in one, as it was read or is to be written
Document = Mapping[str, Any]

#: folder in which the documents of a design lie, beside what one reads and types
DATA: Final = "data"


def data_folder(directory: str | Path) -> Path:
    """Return where the documents of a design lie: in `DATA`, or, of an earlier release, in its very folder."""
    inner = Path(directory) / DATA
    return inner if os.path.lexists(inner / "words.json") else Path(directory)


#: document of a design of zones in its folder
ZONES_FILE: Final = f"{DATA}/zones.json"


def holds_zones(directory: str | Path | None) -> bool:
    """Return whether a folder holds a design of zones.

    Raises:
        DocumentError: it holds one of a single heater, too, so that nobody knows which is meant.
    """
    if directory is None or not os.path.lexists(Path(directory) / ZONES_FILE):
        return False
    if os.path.lexists(data_folder(directory) / "words.json"):
        raise DocumentError(f"{directory}: holds a design of zones and one of a single heater; give each a folder of "
                            "its own")
    return True


def existing_path(path: str | Path) -> Path:
    """Return a document's file; one that is not there where earlier releases wrote it is looked for in `DATA`."""
    file = Path(path)
    inner = file.parent / DATA / file.name
    return inner if not os.path.lexists(file) and os.path.lexists(inner) else file


def to_json(document: Mapping[str, Any]) -> str:
    """Return the document as JSON text; numbers that are not finite become null."""
    return json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def plain(value: Any) -> Any:
    """Return the value as JSON holds it: arrays as lists, numbers that are not finite as None."""
    if isinstance(value, float):  # as most are
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return value


class EarlierDocument(dict[str, Any]):
    """A document of an earlier schema with the keys of the current one.

    Attributes:
        original: the content of the file, which its digest covers.
    """

    def __init__(self, content: Document, original: dict[str, Any]) -> None:
        """Hold the content with its current keys, and the original."""
        super().__init__(content)
        self.original = original


class _KeyChange(NamedTuple):
    """What changed from a schema to the next one: keys anywhere in the document, and keys at its top level alone."""

    earlier: str
    keys: Mapping[str, str] = {}
    top: Mapping[str, str] = {}


_FINDINGS: Final = {"told": "message", "log_told": "log_summary"}
_CURVES: Final = {"wish": "ideal", "asked_time_s": "request_time_s", "asked_pct": "request_pct"}
#: schema → the schema before it, whose documents are still read
_KEY_CHANGES: Final = {
    "heatertune/model/3": _KeyChange("heatertune/model/2", _FINDINGS),
    "heatertune/pid/2": _KeyChange("heatertune/pid/1", _FINDINGS),
    "heatertune/words/2": _KeyChange("heatertune/words/1", {"ms_drawn": "ms_sampled", "told": "message"}),
    "heatertune/proof/4": _KeyChange("heatertune/proof/3", {
        "told": "message", "known": "stated_settings", "kept": "passing_count"}),
    "heatertune/log/2": _KeyChange("heatertune/log/1", {"doubts": "warnings"}),
    "heatertune/pictures/3": _KeyChange("heatertune/pictures/2", _CURVES),
    "heatertune/comparison/2": _KeyChange("heatertune/comparison/1", {**_CURVES, "price": "cost", "told": "message"}),
    "heatertune/as-left/2": _KeyChange("heatertune/as-left/1", {"told": "message"}, {"told": "messages"}),
    "heatertune/written/2": _KeyChange("heatertune/written/1", {
        "told": "message", "seen": "observations", "found": "as_found"}),
    "heatertune/write-record/2": _KeyChange("heatertune/write-record/1", {"told": "message"}),
    "heatertune/supervision/2": _KeyChange("heatertune/supervision/1", top={"told": "rules", "beside": "built_in"}),
}

_CURRENT: Final = {change.earlier: schema for schema, change in _KEY_CHANGES.items()}


def read_document(path: str | Path, schema: str) -> dict[str, Any]:
    """Read the JSON object of a file; one of the schema before has its keys renamed.

    Raises:
        DocumentError: the file is missing, is no JSON object, or carries another schema.
    """
    content = _load(path)
    schema_name = content.get("schema")
    if schema_name != schema and not is_earlier(schema_name, schema):
        raise DocumentError(f"{path}: schema is {schema_name!r}; expected {schema!r}")
    return content if schema_name == schema else EarlierDocument(with_current_keys(content, schema), content)


def is_earlier(named: object, schema: str) -> bool:
    """Return whether a document names the schema before a given one, with other keys."""
    return schema in _KEY_CHANGES and named == _KEY_CHANGES[schema].earlier


def with_current_keys(content: Document, schema: str) -> Document:
    """Return the content of a document of the previous schema, by the keys of a given schema."""
    change = _KEY_CHANGES[schema]
    renamed: Document = _with_keys({change.top.get(key, key): value for key, value in content.items()}, change.keys)
    return renamed


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        DocumentError: it cannot be read, or is no TOML.
    """
    import tomllib

    try:
        return tomllib.loads(read_text(path))
    except OSError as problem:
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from problem
    except (ValueError, RecursionError) as problem:  # no UTF-8, no TOML, thousands of digits or brackets
        raise DocumentError(f"{path}: no TOML: {problem}") from problem


def peek_schema(path: str | Path) -> str | None:
    """Return the schema as which `read_document` reads a JSON file, None where it names none; errors as there."""
    schema = _load(path).get("schema")
    return _CURRENT.get(schema, schema) if isinstance(schema, str) else None


def _with_keys(value: Any, keys: Mapping[str, str]) -> Any:
    """Rename keys in JSON, those of documents within a document as well."""
    if isinstance(value, dict):
        renamed = {keys.get(key, key): _with_keys(item, keys) for key, item in value.items()}
        schema = value.get("schema")
        return renamed | ({"schema": _CURRENT[schema]} if isinstance(schema, str) and schema in _CURRENT else {})
    return [_with_keys(item, keys) for item in value] if isinstance(value, list) else value


def _load(path: str | Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(existing_path(path)), object_pairs_hook=_object_documents,
                             parse_constant=_constant)
    except OSError as problem:
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from problem
    except (UnicodeDecodeError, json.JSONDecodeError) as problem:
        line = getattr(problem, "lineno", 1)
        raise DocumentError(f"{path}, line {line}: no JSON document") from problem
    except (ValueError, RecursionError) as problem:  # a key twice, NaN, 5000 digits, a thousand brackets
        why = "nested too deep" if isinstance(problem, RecursionError) else problem
        raise DocumentError(f"{path}: no JSON document: {why}") from problem
    if not isinstance(content, dict):
        raise DocumentError(f"{path}: no JSON object; expected a document of heatertune")
    return content


def _object_documents(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    document = dict(pairs)
    if len(document) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(name for name in names if names.count(name) > 1)!r} is there twice")
    return document


def _constant(name: str) -> float:
    raise ValueError(f"{name} is no number; heatertune writes null")


T = TypeVar("T")

_SHOWN: Final = 40  # characters of a wrong value


@dataclass(frozen=True, slots=True)
class Null:
    """What null stands for in a field of floats."""

    value: float


#: metadata of a field in whose place the document holds the fields of its dataclass, or nothing where it is None
FLAT: Final = types.MappingProxyType({"flat": True})
#: metadata of a field that the document holds only where it is something: not None, not empty
LEFT_OUT: Final = types.MappingProxyType({"left_out": True})

OrInfinite = Annotated[float, Null(math.inf)]
OrUnknown = Annotated[float, Null(math.nan)]

_SCHEMAS: Final[dict[type, str]] = {}


def register_schema(schema: str) -> Callable[[type[T]], type[T]]:
    """Return a decorator that says which schema a dataclass is written under.

    Raises:
        ValueError: another dataclass has this schema.
    """
    def register(kind: type[T]) -> type[T]:
        if schema in _SCHEMAS.values():
            raise ValueError(f"{schema} is registered twice")
        _SCHEMAS[kind] = schema
        return kind

    return register


def schema_of(kind: type) -> str | None:
    """Return the schema of a dataclass, None for one that is a part of others."""
    return _SCHEMAS.get(kind)


def construct_from(kind: type[T], *sources: object, **value: Any) -> T:
    """Return a dataclass whose fields are given or, else, attributes of that name of the first source that has one.

    So a value is made of its view and a view of its value: what they share needs no line.
    """
    for name in (field.name for field in fields(cast("Any", kind)) if field.init and field.name not in value):
        values = [item for source in sources if hasattr(source, name) and not callable(item := getattr(source, name))]
        if values:
            value[name] = values[0]
    return kind(**value)


def encode(value: Any) -> Any:
    """Return a value as JSON holds it: fields in their order, enums by name, numbers that are not finite as None."""
    if isinstance(value, float):  # as most are
        return float(value) if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        schema = _SCHEMAS.get(type(value))
        document: dict[str, Any] = {} if schema is None else {"schema": schema}
        for field in fields(value):
            item = getattr(value, field.name)
            if "flat" in field.metadata:
                document |= {} if item is None else encode(item)
            elif "left_out" not in field.metadata or not (item is None or (isinstance(item, tuple) and not item)):
                document[field.name] = encode(item)
        return document
    if isinstance(value, Mapping):
        return {str(key): encode(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [encode(item) for item in value]
    if hasattr(value, "tolist"):
        return encode(value.tolist())
    return value.name if isinstance(value, Enum) else value


def decode(kind: type[T], value: Any, where: str | Path, at: str = "") -> T:
    """Return a value of a type from what JSON holds.

    Args:
        kind: a dataclass, or anything that a field of one may be.
        value: as `json.loads` gives it.
        where: name of the document, for errors.
        at: path of the value in it.

    Raises:
        DocumentError: another schema, an unknown or missing field, a value of the wrong kind or against its rule.
    """
    return cast("T", _decoded(kind, value, _DocumentPlace(str(where), at)))


@dataclass(frozen=True, slots=True)
class _DocumentPlace:
    """Where in which document a value stands."""

    where: str
    at: str

    def field(self, name: str) -> _DocumentPlace:
        shown = name if name.isidentifier() else f"[{_shown(name)}]"
        return _DocumentPlace(self.where,
                              f"{self.at}.{shown}" if self.at and name.isidentifier() else f"{self.at}{shown}")

    def item(self, number: int) -> _DocumentPlace:
        return _DocumentPlace(self.where, f"{self.at}[{number}]")

    def wrong(self, expected: str, value: Any) -> DocumentError:
        return self.error(f"expected {expected}, got {_shown(value)}")

    def error(self, problem: object) -> DocumentError:
        return DocumentError(f"{self.where}: {self.at}: {problem}" if self.at else f"{self.where}: {problem}")


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else f"a list of {len(value)}"
    text = json.dumps(value, default=repr)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def _decoded(kind: Any, value: Any, place: _DocumentPlace) -> Any:
    if is_dataclass(kind):
        return _object(kind, value, place)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind[_literal(tuple(kind.__members__), value, place)]
    reader = _READERS.get(get_origin(kind))
    return _plain(kind, value, place) if reader is None else reader(get_args(kind), value, place)


def _plain(kind: Any, value: Any, place: _DocumentPlace) -> Any:
    if kind is Any:
        return value
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        if not abs(value) <= sys.float_info.max:
            raise place.wrong("a finite number", value)
        return float(value)
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind in (bool, str) and isinstance(value, kind):
        return value
    if kind is type(None) and value is None:
        return None
    raise place.wrong(_NAMES.get(kind, "null"), value)


_NAMES: Final = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}


def _nullable(kinds: tuple[Any, ...], value: Any, place: _DocumentPlace) -> Any:
    kind, null = kinds
    return null.value if value is None else _decoded(kind, value, place)


def _literal(allowed: tuple[Any, ...], value: Any, place: _DocumentPlace) -> Any:
    if isinstance(value, str | int) and value in allowed:
        return value
    raise place.wrong(f"one of {', '.join(map(str, allowed))}", value)


def _one_of(kinds: tuple[Any, ...], value: Any, place: _DocumentPlace) -> Any:
    """Return a value of a union: null where that is allowed, an object as the first dataclass whose fields it has."""
    if value is None and type(None) in kinds:
        return None
    others = [kind for kind in kinds if kind is not type(None)]
    for kind in others[:-1]:
        try:
            return _decoded(kind, value, place)
        except DocumentError:
            continue
    return _decoded(others[-1], value, place)


def _tuple(kinds: tuple[Any, ...], value: Any, place: _DocumentPlace) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise place.wrong("a list", value)
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(value)
    if len(value) != len(kinds):
        raise place.wrong(f"a list of {len(kinds)}", value)
    return tuple(_decoded(kind, item, place.item(k)) for k, (kind, item) in enumerate(zip(kinds, value, strict=True)))


def _mapping(kinds: tuple[Any, ...], value: Any, place: _DocumentPlace) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise place.wrong("an object", value)
    names, items = kinds
    return {_decoded(names, name, place): _decoded(items, item, place.field(name)) for name, item in value.items()}


_READERS: Final[dict[Any, Callable[[tuple[Any, ...], Any, _DocumentPlace], Any]]] = {
    Annotated: _nullable, Union: _one_of, types.UnionType: _one_of, Literal: _literal, tuple: _tuple, dict: _mapping,
    Mapping: _mapping,
}


@cache
def _shape(kind: type) -> tuple[dict[str, Any], frozenset[str], dict[str, Any]]:
    """Return the fields of a dataclass with their types, those that a document must hold, and those that lie flat."""
    hints = get_type_hints(kind, include_extras=True)
    own = [field for field in fields(kind) if field.init]
    needed = frozenset(field.name for field in own if field.default is MISSING and field.default_factory is MISSING)
    groups = {field.name: get_args(hints[field.name])[0] for field in own if "flat" in field.metadata}
    return {field.name: hints[field.name] for field in own if field.name not in groups}, needed, groups


def _object(kind: Any, value: Any, place: _DocumentPlace) -> Any:
    if not isinstance(value, dict):
        raise place.wrong("an object", value)
    rest = dict(value)
    if (schema := schema_of(kind)) is not None and rest.pop("schema", None) != schema:
        raise place.error(f"schema is {value.get('schema')!r}; expected {schema!r}")
    kinds, needed, groups = _shape(kind)
    fields = {}
    for name, group in groups.items():
        if part := {inner: rest.pop(inner) for inner in _shape(group)[0] if inner in rest}:
            fields[name] = _object(group, part, place)
    for name in rest:
        if name not in kinds:
            raise place.field(name).error("no such field")
    for name in kinds:
        if name in needed and name not in rest:
            raise place.field(name).error("is missing")
    fields |= {name: _decoded(kinds[name], item, place.field(name)) for name, item in rest.items()}
    try:
        return kind(**fields)
    except InputError as problem:
        raise place.error(problem) from problem

"""JSON documents between stages."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from heatertune.errors import DocumentError
from heatertune.files import read_text

__all__ = [
    "DATA", "EarlierDocument", "data_folder", "existing_path", "peek_schema", "plain", "read_document", "read_toml",
    "to_json",
]


#: folder in which the documents of a design lie, beside what one reads and types
DATA: Final = "data"


def data_folder(directory: str | Path) -> Path:
    """Return where the documents of a design lie: in `DATA`, or, of an earlier release, in its very folder."""
    inner = Path(directory) / DATA
    return inner if (inner / "words.json").is_file() else Path(directory)


def existing_path(path: str | Path) -> Path:
    """Return a document's file; one that is not there where earlier releases wrote it is looked for in `DATA`."""
    file = Path(path)
    inner = file.parent / DATA / file.name
    return inner if not os.path.lexists(file) and inner.is_file() else file


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

    def __init__(self, content: Mapping[str, Any], original: dict[str, Any]) -> None:
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
    "heatertune/supervision/2": _KeyChange("heatertune/supervision/1", top={"told": "rules", "beside": "built_in"}),
}

_CURRENT: Final = {change.earlier: schema for schema, change in _KEY_CHANGES.items()}


def read_document(path: str | Path, schema: str) -> dict[str, Any]:
    """Read the JSON object of a file; one of the schema before has its keys renamed.

    Raises:
        DocumentError: the file is missing, is no JSON object, or carries another schema.
    """
    content = _load(path)
    named = content.get("schema")
    change = _KEY_CHANGES.get(schema)
    if change is not None and named == change.earlier:
        top = {change.top.get(key, key): value for key, value in content.items()}
        return EarlierDocument(_with_keys(top, change.keys), content)
    if named != schema:
        raise DocumentError(f"{path}: schema is {named!r}; expected {schema!r}")
    return content


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return what a TOML file holds.

    Raises:
        DocumentError: it cannot be read, or is no TOML.
    """
    import tomllib  # noqa: PLC0415 - documents are read at every start, TOML files seldom

    try:
        return tomllib.loads(read_text(path))
    except OSError as problem:
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from problem
    except (ValueError, RecursionError) as problem:  # no UTF-8, no TOML, thousands of digits or brackets
        raise DocumentError(f"{path}: no TOML: {problem}") from problem


def peek_schema(path: str | Path) -> str | None:
    """Return the schema as which `read_document` reads a JSON file, None where it names none; errors as there."""
    named = _load(path).get("schema")
    return _CURRENT.get(named, named) if isinstance(named, str) else None


def _with_keys(value: Any, keys: Mapping[str, str]) -> Any:
    """Rename keys in JSON, those of documents within a document as well."""
    if isinstance(value, dict):
        renamed = {keys.get(key, key): _with_keys(item, keys) for key, item in value.items()}
        named = value.get("schema")
        return renamed | ({"schema": _CURRENT[named]} if isinstance(named, str) and named in _CURRENT else {})
    return [_with_keys(item, keys) for item in value] if isinstance(value, list) else value


def _load(path: str | Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(existing_path(path)), object_pairs_hook=_object, parse_constant=_constant)
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


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(name for name in names if names.count(name) > 1)!r} is there twice")
    return made


def _constant(name: str) -> float:
    raise ValueError(f"{name} is no number; heatertune writes null")

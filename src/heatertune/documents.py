"""JSON documents between stages."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from heatertune.errors import DocumentError
from heatertune.files import read_text

__all__ = ["DATA", "data_folder", "existing_path", "peek_schema", "plain", "read_document", "read_toml", "to_json"]


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


def read_document(path: str | Path, schema: str) -> dict[str, Any]:
    """Return the JSON object of a file.

    Raises:
        DocumentError: the file is missing, is no JSON object, or carries another schema.
    """
    content = _load(path)
    named = content.get("schema")
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
    """Return the schema a JSON file names, None where it names none; errors as in `read_document`."""
    named = _load(path).get("schema")
    return named if isinstance(named, str) else None


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

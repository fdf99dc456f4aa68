"""Results of slow stages, kept on disk: a fit of the same numbers by the same program is read, not run.

The key is the SHA-256 of everything that went in and of heatertune's own source. `HEATERTUNE_CACHE` moves the folder;
set to the empty text it switches the cache off. A folder that cannot be written is no error: the stage runs. So it does
where a file is in any doubt: each begins with the cache's schema and the digest of its document.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache as remember
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, TypeVar

from heatertune.documents import to_json
from heatertune.errors import HeatertuneError, InputError
from heatertune.files import read_bytes
from heatertune.writing import write_files

__all__ = ["cached", "folder", "release", "source_digest", "unused"]

T = TypeVar("T")

_SCHEMA: Final = "heatertune/cache/1"

_unused: ContextVar[bool] = ContextVar("unused", default=False)


def cached(
    stage: str, inputs: Mapping[str, Any], run: Callable[[], dict[str, Any]], read: Callable[[dict[str, Any]], T], *,
    progress: Callable[[str], object] = str,
) -> T:
    """Return the value of a stage's document: from disk where it was made before, else made by `run`.

    Args:
        stage: name of the stage, the beginning of the file's name.
        inputs: all that decides the result, as JSON can hold it (arrays included).
        run: makes the document.
        read: gives the value of a document; raises HeatertuneError where it is none.
        progress: told when a result is read instead of computed.
    """
    place = None if _unused.get() else folder()
    if place is None:
        # through the same text as a result that is kept: a switched-off cache changes no number
        return read(json.loads(to_json(run())))
    text = json.dumps(inputs, sort_keys=True, default=lambda array: array.tolist())  # keeps nan apart from null
    key = hashlib.sha256((source_digest() + stage + text).encode(errors="backslashreplace")).hexdigest()[:32]
    name = f"{stage}-{key}.json"
    with suppress(OSError, ValueError, RecursionError, HeatertuneError):
        value = read(_document(read_bytes(place / name)))
        progress(f"{stage}: read from the cache")
        return value
    # the text, not the value, is what a later run will see: both runs get the same
    text = to_json(run())
    try:
        content = text.encode(errors="backslashreplace")  # half a surrogate, from a file name that is not UTF-8
        write_files(place, {name: _head(content) + content})
    except InputError:
        progress(f"{stage}: the cache {place} cannot be written")
    return read(json.loads(text))


def _head(text: bytes) -> bytes:
    return f"{_SCHEMA} sha256:{hashlib.sha256(text).hexdigest()}\n".encode()


def _document(kept: bytes) -> dict[str, Any]:
    """Return the document of a kept file; raise ValueError where it is not as it was written."""
    text = kept[len(_head(b"")):]
    if kept != _head(text) + text:
        raise ValueError("the file was changed")
    document = json.loads(text)
    if not isinstance(document, dict):
        raise ValueError("no JSON object")
    return document


@contextmanager
def unused() -> Iterator[None]:
    """Keep and read no result within the block: a million would fill the disk. Machine code is kept."""
    mark = _unused.set(True)
    try:
        yield
    finally:
        _unused.reset(mark)


def folder() -> Path | None:
    """Return where results and machine code are kept, None where nothing is to be kept."""
    given = os.environ.get("HEATERTUNE_CACHE")
    if given is not None:
        return Path(given) if given else None
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "heatertune"
    except RuntimeError:
        return None


def release(library: str) -> str:
    """Return what tells the release of an installed library apart from all others, without loading it.

    It is what its own file of the version says; where it has none, the number that it was installed with, for which
    Python has to read much more.
    """
    found = find_spec(library)
    origin = None if found is None else found.origin
    for name in ("version.py", "_version.py") if origin else ():
        with suppress(OSError):
            return (Path(str(origin)).parent / name).read_text(encoding="utf-8")
    from importlib.metadata import version  # noqa: PLC0415

    return version(library)


@remember
def source_digest() -> str:
    """Return a digest of heatertune's own source, so that a changed program forgets what the old one found."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()

"""Results of slow stages, kept on disk: a fit of the same numbers by the same program is read, not run.

The key is the SHA-256 of everything that went in and of heatertune's own source. `HEATERTUNE_CACHE` moves the folder;
set to the empty text it switches the cache off. A folder that cannot be written is no error: the stage runs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache as remember
from pathlib import Path
from typing import Any

from heatertune.documents import to_json
from heatertune.errors import InputError
from heatertune.writing import write_files

__all__ = ["cached", "folder", "source_digest", "unused"]

_unused: ContextVar[bool] = ContextVar("unused", default=False)


def cached(
    stage: str, inputs: Mapping[str, Any], run: Callable[[], dict[str, Any]], *, progress: Callable[[str], object] = str
) -> dict[str, Any]:
    """Return the stage's document: from disk where it was made before, else by `run`.

    Args:
        stage: name of the stage, the beginning of the file's name.
        inputs: all that decides the result, as JSON can hold it (arrays included).
        run: makes the document.
        progress: told when a result is read instead of computed.
    """
    place = None if _unused.get() else folder()
    if place is None:
        # through the same text as a result that is kept: a switched-off cache changes no number
        return dict(json.loads(to_json(run())))
    told = json.dumps(inputs, sort_keys=True, default=lambda array: array.tolist())  # keeps nan apart from null
    key = hashlib.sha256((source_digest() + stage + told).encode()).hexdigest()[:32]
    name = f"{stage}-{key}.json"
    kept = _read(place / name)
    if kept is not None:
        progress(f"{stage}: read from the cache")
        return kept
    # the text, not the value, is what a later run will see: both runs get the same
    text = to_json(run())
    try:
        write_files(place, {name: text})
    except InputError:
        progress(f"{stage}: the cache {place} cannot be written")
    return dict(json.loads(text))


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


def _read(path: Path) -> dict[str, Any] | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None


@remember
def source_digest() -> str:
    """Return a digest of heatertune's own source, so that a changed program forgets what the old one found."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()

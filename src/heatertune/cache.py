"""Results of slow stages, kept on disk: a fit of the same numbers by the same program is read, not run.

The key is the SHA-256 of everything that went in and of heatertune's own source. `HEATERTUNE_CACHE` moves the folder;
set to the empty text it switches the cache off. A folder that cannot be written is no error: the stage runs. So it does
where a file is in any doubt: each begins with the cache's schema and a keyed digest (HMAC) of schema, key and document.
The secret of that digest is made once per user and machine and lies in the state folder, so a file that another program
or machine put there is not believed. A folder that other users may write is not used at all.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import stat
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache as remember
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, TypeVar

from heatertune.codec import to_json
from heatertune.errors import HeatertuneError, InputError
from heatertune.writing import read_bytes, state_folder, write_files

__all__ = ["cache_disabled", "folder", "is_as_imported", "load_or_compute", "mark", "not_private", "release",
           "source_digest"]

T = TypeVar("T")

_SCHEMA: Final = "heatertune/cache/2"
_SECRET: Final = "cache.key"
_SECRET_BYTES: Final = 32
_IMPORTED_S: Final = time.time()

_unused: ContextVar[bool] = ContextVar("unused", default=False)


def load_or_compute(
    stage: str, inputs: Mapping[str, Any], run: Callable[[], dict[str, Any]], read: Callable[[dict[str, Any]], T], *,
    progress: Callable[[str], object] = str,
) -> T:
    """Return the value of a stage's document: from disk where it was made before, else made by `run`.

    Args:
        stage: name of the stage, the beginning of the file's name.
        inputs: all that decides the result, as JSON can hold it (arrays included).
        run: makes the document.
        read: gives the value of a document; raises HeatertuneError where it is none.
        progress: called when a result is read instead of computed.
    """
    place = None if _unused.get() else folder()
    secret = None if place is None else _machine_secret()
    source = None if place is None else source_digest()
    if place is None or secret is None or source is None:
        if not _unused.get() and (why := not_private() or _not_kept(place, secret)):
            progress(f"{stage}: {why}: nothing is kept")
        # through the same text as a result that is kept: a switched-off cache changes no number
        return read(json.loads(to_json(run())))
    text = json.dumps(inputs, sort_keys=True, default=lambda array: array.tolist())  # keeps nan apart from null
    key = hashlib.sha256((source + stage + text).encode(errors="backslashreplace")).hexdigest()[:32]
    name = f"{stage}-{key}.json"
    with suppress(OSError, ValueError, RecursionError, HeatertuneError):
        value = read(_document(read_bytes(place / name), name, secret))
        progress(f"{stage}: read from the cache")
        return value
    # the text, not the value, is what a later run will see: both runs get the same
    text = to_json(run())
    try:
        content = text.encode(errors="backslashreplace")  # half a surrogate, from a file name that is not UTF-8
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_files(place, {name: _head(content, name, secret) + content})
    except (InputError, OSError):
        progress(f"{stage}: the cache {place} cannot be written")
    return read(json.loads(text))


def _not_kept(place: Path | None, secret: bytes | None) -> str:
    """Return why nothing is kept in a folder that is private; empty where the user wants none."""
    if place is None:
        return ""
    return "the state folder cannot hold its secret" if secret is None else (
        "heatertune's own source was replaced while it runs")


def _head(text: bytes, name: str, secret: bytes) -> bytes:
    """Return the first line of a kept file: schema and keyed digest of schema, name and text."""
    signed = hmac.new(secret, f"{_SCHEMA}\n{name}\n".encode() + text, hashlib.sha256).hexdigest()
    return f"{_SCHEMA} hmac-sha256:{signed}\n".encode()


def mark(text: str) -> str | None:
    """Return a text's keyed digest, which this user on this machine alone can make; None: no secret can be kept."""
    secret = _machine_secret()
    return None if secret is None else f"hmac-sha256:{hmac.new(secret, text.encode(), hashlib.sha256).hexdigest()}"


def _document(content: bytes, name: str, secret: bytes) -> dict[str, Any]:
    """Return the document of a kept file; raise ValueError where it is not as this machine wrote it."""
    first, _, text = content.partition(b"\n")
    if not hmac.compare_digest(first + b"\n", _head(text, name, secret)):
        raise ValueError("the file was changed")
    document = json.loads(text)
    if not isinstance(document, dict):
        raise ValueError("no JSON object")
    return document


def _machine_secret() -> bytes | None:
    """Return this user's secret on this machine, made when it is first needed; None: it cannot be kept."""
    place = state_folder()
    if place is None:
        return None
    path = place / _SECRET
    with suppress(OSError):
        if not path.exists():
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            own = path.with_name(f".{_SECRET}.{os.getpid()}.{os.urandom(4).hex()}")
            number = os.open(own, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            try:
                os.write(number, os.urandom(_SECRET_BYTES))
            finally:
                os.close(number)
            try:
                with suppress(FileExistsError):  # another process was faster: its secret is the one
                    os.link(own, path)
            finally:
                own.unlink()
        if _mode_problem(path, 0o077) is None and len(secret := read_bytes(path)) == _SECRET_BYTES:
            return secret
    return None


@contextmanager
def cache_disabled() -> Iterator[None]:
    """Keep and read no result within the block: a million would fill the disk. Machine code is kept."""
    mark = _unused.set(True)
    try:
        yield
    finally:
        _unused.reset(mark)


def folder() -> Path | None:
    """Return where results and machine code are kept, None where nothing is to be kept.

    A folder of another user, or one that others may write, is not used: whoever can write there could plant results.
    """
    place = _chosen_folder()
    return None if place is None or _mode_problem(place, 0o022) is not None else place


def not_private() -> str | None:
    """Return why the chosen cache folder is not used, a sentence; None where it is used, or none is wanted."""
    place = _chosen_folder()
    problem = None if place is None else _mode_problem(place, 0o022)
    return None if problem is None else f"the cache {place} is not used: {problem}"


def _chosen_folder() -> Path | None:
    path = os.environ.get("HEATERTUNE_CACHE")
    if path is not None:
        return Path(path) if path else None
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "heatertune"
    except RuntimeError:
        return None


def _mode_problem(path: Path, forbidden: int) -> str | None:
    """Return why a path cannot be trusted, None where it can or is not there yet.

    Args:
        path: of a file or folder.
        forbidden: permission bits that must not be set.
    """
    if not hasattr(os, "geteuid"):  # Windows: the user's own folders are private by their access lists
        return None
    try:
        kind = path.stat()
    except OSError:
        return None
    if kind.st_uid != os.geteuid():
        return "it belongs to another user"
    if stat.S_IMODE(kind.st_mode) & forbidden:
        return f"other users may write there; chmod go-w {path} makes it private"
    return None


def release(library: str) -> str:
    """Return what tells the release of an installed library apart from all others, without loading it.

    It is what its own file of the version says; where it has none, the number that it was installed with, for which
    Python has to read much more.
    """
    spec = find_spec(library)
    origin = None if spec is None else spec.origin
    for name in ("version.py", "_version.py") if origin else ():
        with suppress(OSError):
            return (Path(str(origin)).parent / name).read_text(encoding="utf-8")
    from importlib.metadata import version

    return version(library)


@remember
def source_digest() -> str | None:
    """Compute a digest of heatertune's own source, so that a changed program forgets what the old one found.

    None where the source was replaced since this process imported it: the digest would be another program's.
    """
    digest, paths = hashlib.sha256(), sorted(Path(__file__).parent.rglob("*.py"))
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest() if is_as_imported(paths) else None


def is_as_imported(paths: Iterable[Path]) -> bool:
    """Return whether files of heatertune's source are older than this process.

    An update replaces them under a studio or a fleet that runs: its results are the old program's, and what it keeps
    under the digest of the new files would be read as theirs. A file from the future shows a clock that was set back,
    as that of a computer without a battery at its start; it is no sign of an update.
    """
    now_s = time.time()
    return not any(_IMPORTED_S <= _replaced_s(path, now_s) <= now_s for path in paths)


def _replaced_s(path: Path, now_s: float) -> float:
    """Return when a file was replaced or written to last [s]; now where it is gone."""
    try:
        kind = path.stat()
    except OSError:
        return now_s
    # unlike the time of the last write, that of the last change is not an archive's; Windows tells no such time
    return max(kind.st_mtime, kind.st_ctime) if sys.platform == "win32" else kind.st_ctime

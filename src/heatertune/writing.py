"""Files that are written whole or not at all, and sets of files that change together.

One file is written under another name, then renamed. For several, a new copy of their folder is made, with links to
its other contents, and exchanged with the old one by one system call: a kill at any moment leaves the old set or the
new. Where this is impossible (no such call, subfolders, the current directory, a disk without links), files are
renamed one by one, and back again on failure: only a kill at that moment mixes them. Also the bounded reading of a
user's files.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import re
import shutil
import stat
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cache
from io import BufferedIOBase
from pathlib import Path
from typing import Any, BinaryIO, Final

from heatertune.errors import InputError

__all__ = [
    "MOST_BYTES", "display_name", "read_beyond", "read_bytes", "read_text", "settle", "state_folder", "write_files",
]


_BLOCK: Final = 1 << 20
#: of any file: a reading a second for some years
MOST_BYTES: Final = 1 << 28
_SURROGATE: Final = re.compile("[\ud800-\udfff]")


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file or a pipe.

    Raises:
        OSError: there is none, it is a folder, a device or a pipe that nobody writes to, its name cannot be one, or it
            holds more than `MOST_BYTES`; `strerror` says so.
    """
    try:
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a pipe without a writer would never open
    except ValueError as problem:  # a null character, half of a surrogate pair
        raise OSError(errno.EINVAL, "no name that a file can have") from problem
    with os.fdopen(number, "rb") as file:
        kind = os.fstat(number).st_mode
        if not (stat.S_ISREG(kind) or stat.S_ISFIFO(kind)):
            raise OSError(errno.EISDIR, "Is a directory" if stat.S_ISDIR(kind) else "a device, not a file")
        return _whole(file, is_pipe=stat.S_ISFIFO(kind))


def _whole(file: BinaryIO, *, is_pipe: bool) -> bytes:
    if is_pipe:
        try:
            first = os.read(file.fileno(), 1)
        except BlockingIOError:  # there is a writer who has written nothing yet
            first = b""
        else:
            if not first:
                raise OSError(errno.EPIPE, "a pipe without a writer")
        os.set_blocking(file.fileno(), True)
    data = (first if is_pipe else b"") + read_beyond(file, MOST_BYTES)
    if len(data) > MOST_BYTES:
        raise OSError(errno.EFBIG, f"more than {MOST_BYTES >> 20} MB")
    return data


def read_beyond(file: BinaryIO | BufferedIOBase, most: int) -> bytes:
    """Return the content of a stream; of one with more than so many bytes, more than these, for the caller to refuse.

    It is read in blocks: one call for the most bytes would set memory aside for all of them.
    """
    data = bytearray()
    while len(data) <= most and (block := file.read(_BLOCK)):
        data += block
    return bytes(data)


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file.

    Raises:
        OSError: as `read_bytes`.
        UnicodeDecodeError: it is no UTF-8.
    """
    return read_bytes(path).decode("utf-8")


def display_name(name: str) -> str:
    r"""Return a file's name as text for documents; bytes of it that are not UTF-8 are escaped: h\xe4.csv.

    Args:
        name: as the operating system gives it, such bytes as lone surrogates (PEP 383).
    """
    return _SURROGATE.sub(lambda match: f"\\x{ord(match[0]) & 0xff:02x}", name)


def state_folder() -> Path | None:
    """Return the user's state folder, which `HEATERTUNE_STATE` moves; None: the user has no home."""
    path = os.environ.get("HEATERTUNE_STATE")
    if path:
        return Path(path)
    base = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return (Path(base) if base else Path.home() / ".local" / "state") / "heatertune"
    except RuntimeError:
        return None


_HERE: Final = -100  # AT_FDCWD
_EXCHANGE: Final = 2  # RENAME_EXCHANGE


def write_files(directory: str | Path, files: Mapping[str, str | bytes], gone: Collection[str] = ()) -> list[Path]:
    """Write all files or none; return their paths.

    Args:
        directory: where to; it is made where there is none.
        files: name → content; a name may lead into a folder of the directory: "data/words.json".
        gone: names of files in the directory that are no more once these are there.

    Raises:
        InputError: the directory cannot be made or written.
    """
    folder = Path(directory)
    data = {name: content if isinstance(content, bytes) else content.encode(errors="backslashreplace")
            for name, content in files.items()}
    try:
        old = {name for name in gone if (folder / name).is_file()}
        if (len(data) == 1 and not old) or not _exchanged(folder.resolve(), data, old):
            _one_by_one(folder, data, old)
    except (OSError, ValueError, RuntimeError) as problem:  # a name that no file can have, links in a circle
        place = getattr(problem, "filename2", None) or getattr(problem, "filename", None) or folder
        raise InputError(f"{place}: cannot be written: {getattr(problem, 'strerror', problem)}") from problem
    return [folder / name for name in data]


def _exchanged(  # noqa: C901 - one transaction, told from its begin to its end
    folder: Path, data: Mapping[str, bytes], gone: Collection[str]
) -> bool:
    """Put a folder made anew, with these files, in the place of the old one; return whether that is possible here."""
    within = {Path(name).parent for name in data}
    if _renameat2() is None or not all(_may_go(folder / inner, folder, within) for inner in {Path(), *within}):
        return False
    folder.parent.mkdir(parents=True, exist_ok=True)
    _sweep(folder)
    new = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        new.mkdir()
        if folder.exists():
            shutil.copystat(folder, new)
        for inner in within:
            (new / inner).mkdir(parents=True, exist_ok=True)
        for name in _others(folder, data, gone):
            os.link(folder / name, new / name, follow_symlinks=False)
        for name, content in data.items():
            _write(new / name, content)
        for inner in {Path(), *within}:
            settle(new / inner)
        if not _swap(new, folder):
            return False
        settle(folder.parent)
        for name in _others(new, data, gone):  # saved by others since the links were made
            if not (folder / name).exists():
                (new / name).rename(folder / name)
    except OSError:
        return False
    finally:
        shutil.rmtree(new, ignore_errors=True)
    return True


def _others(folder: Path, data: Mapping[str, bytes], gone: Collection[str]) -> Iterator[str]:
    """Return the names in a folder, and in those of it that files are written into, of what is to stay as it is."""
    for inner in {Path(), *(Path(name).parent for name in data)}:
        for path in list((folder / inner).iterdir()) if (folder / inner).is_dir() else ():
            name = str(inner / path.name)
            if name not in data and name not in gone and (path.is_symlink() or not path.is_dir()):
                yield name


def _may_go(folder: Path, whole: Path, within: Collection[Path]) -> bool:
    """Return whether a folder can be replaced by another one without anybody's noticing; one that is not there can."""
    if not folder.exists() and not folder.is_symlink():
        return True
    is_mine = folder.is_dir() and folder.stat().st_uid == os.geteuid() and not folder.samefile(Path.cwd())
    linked = folder != whole and folder.is_symlink()
    return is_mine and not linked and not any(
        path.is_dir() and not path.is_symlink() and path.relative_to(whole) not in within for path in folder.iterdir())


def _swap(new: Path, folder: Path) -> bool:
    if not folder.exists():
        new.rename(folder)
        return True
    rename = _renameat2()
    return rename is not None and rename(_HERE, os.fsencode(new), _HERE, os.fsencode(folder), _EXCHANGE) == 0


@cache
def _renameat2() -> Callable[..., Any] | None:
    """Return the call that exchanges two names, None on a system without it."""
    import ctypes

    try:
        return ctypes.CDLL(None).renameat2
    except (AttributeError, OSError, TypeError):
        return None


def _sweep(folder: Path) -> None:
    """Remove what killed runs left beside a folder."""
    for left in folder.parent.glob(f".{glob.escape(folder.name)}.*.part"):
        with contextlib.suppress(ValueError, PermissionError):
            try:
                os.kill(int(left.name.split(".")[-2]), 0)
            except ProcessLookupError:
                shutil.rmtree(left, ignore_errors=True)


def _one_by_one(folder: Path, data: Mapping[str, bytes], gone: Collection[str]) -> None:
    """Write all files beside, then put each in its place; where one cannot be, all are as they were."""
    new = {name: _temporary_path(folder / name, "part") for name in data}
    old = {name: _temporary_path(folder / name, "old") for name in (*data, *gone) if len(data) + len(gone) > 1}
    placed: list[str] = []
    folders = [path for path in {(folder / name).parent for name in data} if not path.exists() and path != folder]
    try:
        for name, content in data.items():
            new[name].parent.mkdir(parents=True, exist_ok=True)
            _write(new[name], content)
        for name in (*data, *(name for name in gone if (folder / name).is_file())):
            if name in old and (folder / name).is_file():
                shutil.copy2(folder / name, old[name])
            if name in new:
                new[name].replace(folder / name)
            else:
                (folder / name).unlink()
            placed.append(name)
        for path in {path.parent for path in new.values()}:
            settle(path)
    except (OSError, ValueError):
        for name in placed:
            if old[name].exists():
                old[name].replace(folder / name)
            else:
                (folder / name).unlink()
        raise
    finally:
        _forget(*new.values(), *old.values())
        for path in folders:
            with contextlib.suppress(OSError):  # it holds what was written
                path.rmdir()


def _forget(*files: Path) -> None:
    for path in files:
        with contextlib.suppress(OSError, ValueError):
            path.unlink(missing_ok=True)


def _temporary_path(path: Path, end: str) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{end}")


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def settle(folder: Path) -> None:
    """Wait until the disk knows the names in a folder, where it can be asked."""
    with contextlib.suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)

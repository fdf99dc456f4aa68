"""Files that are written whole or not at all, and sets of files that change together or not at all.

One file is written beside, then renamed. Of several, their whole folder is made anew beside the old one, with links to
what else lies in it, and the two are exchanged by one call of the system: a kill at any moment leaves the old set or
the new. Where that cannot be (a system without the call, folders within the folder, the folder one works in, a disk
without links) the files are renamed one after the other, and back again where one cannot be: only a kill just then
mixes them.
"""

from __future__ import annotations

import contextlib
import ctypes
import glob
import os
import shutil
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from heatertune.errors import InputError

__all__ = ["write_files"]

_HERE: Final = -100  # AT_FDCWD
_EXCHANGE: Final = 2  # RENAME_EXCHANGE


def write_files(directory: str | Path, files: Mapping[str, str | bytes]) -> list[Path]:
    """Write all files or none; return their paths.

    Raises:
        InputError: the directory cannot be made or written.
    """
    folder = Path(directory)
    data = {name: content if isinstance(content, bytes) else content.encode(errors="backslashreplace")
            for name, content in files.items()}
    try:
        if len(data) == 1 or not _exchanged(folder.resolve(), data):
            folder.mkdir(parents=True, exist_ok=True)
            _one_by_one(folder, data)
    except (OSError, ValueError, RuntimeError) as problem:  # a name that no file can have, links in a circle
        place = getattr(problem, "filename2", None) or getattr(problem, "filename", None) or folder
        raise InputError(f"{place}: cannot be written: {getattr(problem, 'strerror', problem)}") from problem
    return [folder / name for name in data]


def _exchanged(folder: Path, data: Mapping[str, bytes]) -> bool:
    """Put a folder made anew, with these files, in the place of the old one; return whether that is possible here."""
    if _renameat2() is None or (folder.exists() and not _may_go(folder)):
        return False
    folder.parent.mkdir(parents=True, exist_ok=True)
    _sweep(folder)
    new = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        new.mkdir()
        if folder.exists():
            shutil.copystat(folder, new)
            for path in folder.iterdir():
                if path.name not in data:
                    os.link(path, new / path.name, follow_symlinks=False)
        for name, content in data.items():
            _write(new / name, content)
        _settle(new)
        if not _swap(new, folder):
            return False
        _settle(folder.parent)
        for path in new.iterdir() if new.exists() else ():  # saved by others since the links were made
            if path.name not in data and not (folder / path.name).exists():
                path.rename(folder / path.name)
    except OSError:
        return False
    finally:
        shutil.rmtree(new, ignore_errors=True)
    return True


def _may_go(folder: Path) -> bool:
    """Return whether a folder can be replaced by another one without anybody's noticing."""
    is_mine = folder.is_dir() and folder.stat().st_uid == os.geteuid() and not folder.samefile(Path.cwd())
    return is_mine and not any(path.is_dir() and not path.is_symlink() for path in folder.iterdir())


def _swap(new: Path, folder: Path) -> bool:
    if not folder.exists():
        new.rename(folder)
        return True
    rename = _renameat2()
    return rename is not None and rename(_HERE, os.fsencode(new), _HERE, os.fsencode(folder), _EXCHANGE) == 0


@cache
def _renameat2() -> Callable[..., Any] | None:
    """Return the call that exchanges two names, None on a system without it."""
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


def _one_by_one(folder: Path, data: Mapping[str, bytes]) -> None:
    """Write all files beside, then put each in its place; where one cannot be, all are as they were."""
    new = {name: folder / f".{name}.{os.getpid()}.part" for name in data}
    old = {name: folder / f".{name}.{os.getpid()}.old" for name in data if len(data) > 1}
    placed: list[str] = []
    try:
        for name, content in data.items():
            _write(new[name], content)
        for name in data:
            if name in old and (folder / name).is_file():
                shutil.copy2(folder / name, old[name])
            new[name].replace(folder / name)
            placed.append(name)
        _settle(folder)
    except (OSError, ValueError):
        for name in placed:
            if old[name].exists():
                old[name].replace(folder / name)
            else:
                (folder / name).unlink()
        raise
    finally:
        for path in (*new.values(), *old.values()):
            with contextlib.suppress(OSError, ValueError):
                path.unlink(missing_ok=True)


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _settle(folder: Path) -> None:
    """Wait until the disk knows the names in a folder, where it can be asked."""
    with contextlib.suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)

"""One run at a time writes a table: whoever comes second is refused, and a dead run's lock is nobody's."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from heatertune.errors import InputError

__all__ = ["hold_lock"]

if sys.platform == "win32":
    import msvcrt

    def _take(file: IO[str]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _take(file: IO[str]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def hold_lock(
    table: Path, instead: str = ", or give another table", *, what: str | None = None, holder: str = ""
) -> Iterator[None]:
    """Hold the lock of a table, or of another file, within the block.

    The system holds it for the process, not the file: with the process ends the lock, however that ended.

    Args:
        table: the file.
        instead: what can be done beside waiting, the end of the error.
        what: beginning of the error of whoever comes second; None: that another run writes the table.
        holder: said of this process in that error, behind its number.

    Raises:
        InputError: another run holds it, or the file beside the table cannot be written.
    """
    path = table.with_name(f".{table.name}.lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("a+", encoding="utf-8")
    except OSError as problem:
        raise InputError(f"{path}: cannot be written: {problem.strerror}") from problem
    with file:
        _demand(file, path, what or f"{table}: another run writes it", instead)
        with suppress(OSError):  # on a full disk the lock holds all the same
            os.write(file.fileno(), f"process {os.getpid()}{holder}".encode())
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _demand(file: IO[str], path: Path, what: str, instead: str) -> None:
    """Lock an open file that is still the one of this name: its last owner takes it away when it ends."""
    try:
        _take(file)
        mine = path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        mine = False
    if not mine:
        file.seek(0)
        raise InputError(f"{what} ({file.read() or 'just begun'}); wait for its end{instead}")
    file.truncate(0)

"""Files that a user names: read whole, or refused without waiting."""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path
from typing import BinaryIO, Final

__all__ = ["MOST_BYTES", "display_name", "read_bytes", "read_text", "state_folder"]

#: of any file: a reading a second for some years
MOST_BYTES: Final = 1 << 28
_SURROGATE: Final = re.compile("[\ud800-\udfff]")


def read_bytes(path: str | Path) -> bytes:
    """Return what a file or a pipe holds.

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
    data = (first if is_pipe else b"") + file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise OSError(errno.EFBIG, f"more than {MOST_BYTES >> 20} MB")
    return data


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
    given = os.environ.get("HEATERTUNE_STATE")
    if given:
        return Path(given)
    base = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    try:
        return (Path(base) if base else Path.home() / ".local" / "state") / "heatertune"
    except RuntimeError:
        return None

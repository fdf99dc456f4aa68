"""The record of a write, and the number of writes per word.

The record is one line of JSON per step, on disk before the step is made and never changed afterwards; an incomplete
last line of a killed process is ignored. Writes are counted because non-volatile memory wears out: one file per PLC,
one line per write, in the user's state folder, which `HEATERTUNE_STATE` moves.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from heatertune.codec import Document, is_earlier, plain, with_current_keys
from heatertune.errors import DocumentError, InputError
from heatertune.live.client.connection import Address, ClosesOnExit
from heatertune.live.hold import state_folder, where_of
from heatertune.writing import read_bytes, settle

__all__ = [
    "MOST_WRITES", "RECORD_SCHEMA", "Budget", "Lines", "RecordBroken", "WriteRecord", "read_lines", "utc_now",
    "write_new",
]


RECORD_SCHEMA: Final = "heatertune/write-record/2"
#: steps after which nothing is left to be found out
_ENDS: Final = ("end",)
#: says that the line before it was left by a kill
_TORN: Final = "torn"


def utc_now() -> str:
    """Return the time of this machine, UTC."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True, slots=True)
class Lines:
    """A record that was read.

    Attributes:
        path: its file.
        begin: its first line.
        steps: the others.
        torn: whether a line without its end was left out.
    """

    path: Path
    begin: Mapping[str, Any]
    steps: tuple[Mapping[str, Any], ...]
    torn: bool

    @property
    def complete(self) -> bool:
        """Whether the last that was begun also ended."""
        return bool(self.steps) and self.steps[-1]["step"] in _ENDS

    def last(self, step: str) -> Mapping[str, Any] | None:
        """Return the last line of a kind."""
        return next((line for line in reversed(self.steps) if line["step"] == step), None)


class RecordBroken(InputError):
    """Raised when a record that was begun cannot be gone on with."""


class WriteRecord(ClosesOnExit):
    """A record that is being written."""

    def __init__(self, path: Path, *, torn: bool = False) -> None:
        """Open it; what stands there stays.

        Raises:
            InputError: it cannot be written.
        """
        self.path, self._broken = path, False
        try:
            self._number = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        except OSError as problem:
            raise InputError(f"{path}: cannot be written: {problem.strerror}") from None
        if torn:
            os.write(self._number, b"\n")
            self.write_line(_TORN)
        settle(path.parent)

    def write_line(self, step: str, **what: Any) -> None:
        """Write a line, and wait until the disk has it; once it could not be, nothing more is written.

        Raises:
            RecordBroken: it cannot be written, for the first time.
        """
        if self._broken:
            return
        line = json.dumps(plain({"step": step, "at": utc_now(), **what}), ensure_ascii=False, allow_nan=False)
        content = f"{line}\n".encode()
        try:
            while content:
                content = content[os.write(self._number, content):]
            os.fsync(self._number)
        except OSError as problem:
            self._broken = True
            raise RecordBroken(f"{self.path}: cannot be written: {problem.strerror}") from None

    def close(self) -> None:
        """Close the file."""
        os.close(self._number)


def read_lines(path: str | Path) -> Lines:
    """Return a record.

    Raises:
        DocumentError: it cannot be read, or is none; the message names the line.
    """
    try:
        *whole, rest = read_bytes(path).split(b"\n")
    except OSError as problem:
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from None
    documents = [_line(content) for content in whole]
    for number, line in enumerate(documents, start=1):
        after = documents[number] if number < len(documents) else None
        if line is None and (number == 1 or after is None or after["step"] != _TORN):
            raise DocumentError(f"{path}, line {number}: no step of a record")
    lines: list[Document] = [line for line in documents if line is not None and line["step"] != _TORN]
    if lines and is_earlier(lines[0].get("schema"), RECORD_SCHEMA):
        lines = [with_current_keys(line, RECORD_SCHEMA) for line in lines]
    if not lines or lines[0].get("schema") != RECORD_SCHEMA:
        raise DocumentError(f"{path}: no record of a write; expected the schema {RECORD_SCHEMA!r} in its first line")
    missing = [name for name in ("address", "directory", "target", "digest", "begin", "before", "parts", "words")
               if name not in lines[0]]
    if missing:
        raise DocumentError(f"{path}, line 1: {missing[0]}: is missing")
    return Lines(Path(path), lines[0], tuple(lines[1:]), torn=bool(rest))


def _line(content: bytes) -> dict[str, Any] | None:
    """Return a line of a record, None where it is none."""
    try:
        line = json.loads(content)
    except (ValueError, RecursionError):
        return None
    return line if isinstance(line, dict) and isinstance(line.get("step"), str) else None


def write_new(path: Path, content: bytes) -> None:
    """Write a file that is not there yet, and wait until the disk has it and its name.

    Raises:
        InputError: it is there already, or cannot be written.
    """
    try:
        with path.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except OSError as problem:
        raise InputError(f"{path}: cannot be written: {problem.strerror}") from None
    settle(path.parent)


#: of one word, where the user says no other number; makers promise from 10,000 (EEPROM) to 100,000 writes on
MOST_WRITES: Final = 1000


def _count_of(where: str) -> Path:
    return state_folder() / f"writes-{hashlib.sha256(where.encode()).hexdigest()[:16]}.log"


def _lines_of(path: Path) -> list[str]:
    """Return the lines of a count, none where there is no such file; raise InputError where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError:
        return []
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem.strerror}") from None


class Budget:
    """The count of one block of one PLC, however its address is written; earlier releases counted by the text of it.

    Attributes:
        path: of its file.
    """

    def __init__(self, address: Address, number: int, most: int = MOST_WRITES) -> None:
        """Take a block.

        Args:
            address: of the PLC.
            number: of the block.
            most: writes of one word.
        """
        written = f"{address.protocol} {address.host} {address.port} {address.way} {number} {address.block}"
        place = address.block if address.protocol == "modbus" else number
        self._where, self._most = f"{where_of(address)} {address.protocol} {place} {address.node}".strip(), most
        self.path, self._earlier = _count_of(self._where), _count_of(written)

    def counts(self) -> Counter[str]:
        """Return how often each word was written.

        Raises:
            InputError: the count cannot be read.
        """
        lines = [line for path in (self.path, self._earlier) for line in _lines_of(path)]
        return Counter(name for line in lines if not line.startswith("#") for name in line.split()[1:])

    def spent(self, names: tuple[str, ...]) -> str:
        """Return which word has been written often enough, a sentence; nothing where none has."""
        counts = self.counts()
        return next((f"{name} was written {counts[name]} times from here, and {self._most} is the most (--max-writes; "
                     f"the count is in {self.path})" for name in names if counts[name] >= self._most), "")

    def count(self, names: tuple[str, ...]) -> None:
        """Count a write of words, before it is made.

        Raises:
            InputError: the count cannot be kept.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            is_new = not self.path.exists()
            number = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
            try:
                head = f"# {self._where}\n" if is_new else ""
                os.write(number, f"{head}{utc_now()} {' '.join(names)}\n".encode())
                os.fsync(number)
            finally:
                os.close(number)
        except OSError as problem:
            raise InputError(f"{self.path}: cannot be written: {problem.strerror}") from None
        if is_new:
            settle(self.path.parent)

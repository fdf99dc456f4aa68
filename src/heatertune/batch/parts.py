"""The finished chunks of a batch, one file each, in a folder beside the table until that is written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, Final

from heatertune.batch.values import Row
from heatertune.documents import read_document, to_json, write_files
from heatertune.errors import DocumentError, InputError

__all__ = ["Parts"]

_SCHEMA: Final = "heatertune/parts/1"
_MANIFEST: Final = "manifest.json"
_MOST_CASES: Final = 16  # of a chunk: a kill costs no more than these again
_MANY: Final = 2000  # chunks, from which on they grow


class Parts:
    """The folder `<table>.parts`: a manifest, and one file of JSON lines per finished chunk.

    A part comes into being by a rename, so one that is there is whole. Which cases make a chunk depends on their
    number alone.

    Attributes:
        folder: of the parts.
        total: number of cases.
        size: cases of a chunk, the last one excepted.
    """

    def __init__(self, table: Path, total: int) -> None:
        self.folder = table.with_name(f"{table.name}.parts")
        self.total = total
        self.size = min(max(total // _MANY, 1), _MOST_CASES)

    def open(self, identity: Mapping[str, Any], *, resume: bool) -> None:
        """Make the folder, or find it as a stopped run left it.

        Args:
            identity: of the batch; a folder of another one is refused.
            resume: whether there may be parts already.

        Raises:
            InputError: parts are there and not to be used, or they are of another batch.
        """
        if self.folder.exists() and not resume:
            raise InputError(
                f"{self.folder}: the parts of a run that was stopped; --resume goes on with it, else remove the folder")
        if (self.folder / _MANIFEST).exists():
            found = read_document(self.folder / _MANIFEST, _SCHEMA).get("identity")
            other = _differences(found, json.loads(json.dumps(identity)))
            if other:
                raise InputError(
                    f"{self.folder}: the parts of another run, with other {', '.join(other)}; "
                    "give what that run was given, or remove the folder")
        else:
            write_files(self.folder, {_MANIFEST: to_json({"schema": _SCHEMA, "identity": identity})})

    def missing(self) -> Iterator[int]:
        """Return the number of the first case of each chunk that is not finished."""
        return (start for start in range(0, self.total, self.size) if not self._whole(start))

    def write(self, start: int, rows: Sequence[Row]) -> None:
        """Keep the rows of the chunk that begins with this case."""
        # a number that is not finite is kept as such: "never settled" is no missing value
        lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)
        write_files(self.folder, {self._name(start): lines})

    def rows(self) -> Iterator[Row]:
        """Return all rows in order.

        Raises:
            DocumentError: a part is no longer as it was written.
        """
        for start in range(0, self.total, self.size):
            path = self.folder / self._name(start)
            try:
                found = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
            except (OSError, ValueError) as problem:
                raise DocumentError(f"{path}: no part of a table; remove it, --resume makes it again") from problem
            yield from found

    def remove(self) -> None:
        """Remove the folder; a kill meanwhile leaves none that looks like parts of a stopped run."""
        done = self.folder.with_name(f".{self.folder.name}.done")
        shutil.rmtree(done, ignore_errors=True)
        self.folder.rename(done)
        shutil.rmtree(done, ignore_errors=True)

    def length(self, start: int) -> int:
        """Return the number of cases of the chunk that begins with this one."""
        return min(self.size, self.total - start)

    def _whole(self, start: int) -> bool:
        """Return whether a part is there with all its rows: a power cut may leave a name without its content."""
        path = self.folder / self._name(start)
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return sum(line.endswith(b"}\n") for line in islice(file, self.size + 1)) == self.length(start)

    def _name(self, start: int) -> str:
        return f"{start:09d}.jsonl"


def _differences(found: object, identity: Mapping[str, Any]) -> list[str]:
    """Return the names of what two identities do not share."""
    if not isinstance(found, dict):
        return sorted(identity)
    return sorted(name for name in {*found, *identity} if found.get(name) != identity.get(name))

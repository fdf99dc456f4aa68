"""The finished chunks of a batch, one file each, in a folder beside the table until that is written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from heatertune.batch.values import Chunk, Row
from heatertune.documents import read_document, to_json
from heatertune.errors import DocumentError, InputError
from heatertune.writing import write_files

__all__ = ["Parts"]

_SCHEMA: Final = "heatertune/parts/1"
_MANIFEST: Final = "manifest.json"
_MOST_CASES: Final = 16  # of a chunk: a kill costs no more than these again
_MANY: Final = 2000  # chunks, from which on they grow
_DIGITS: Final = 9  # of the number that a part's name begins with


class Parts:
    """The folder `<table>.parts`: a manifest, and one file of JSON lines per finished chunk.

    Which cases make a chunk depends on their number alone; a part's name tells what they held, so one whose cases have
    changed since is no part of the table any more.

    Attributes:
        folder: of the parts.
        total: number of cases.
        size: cases of a chunk, the last one excepted.
        outdated: number of cases that were done before they changed; they are missing again.
    """

    def __init__(self, table: Path, total: int) -> None:
        self.folder = table.with_name(f"{table.name}.parts")
        self.total = total
        self.size = min(max(total // _MANY, 1), _MOST_CASES)
        self.outdated = 0
        self._names: dict[int, str] = {}

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
            earlier = read_document(self.folder / _MANIFEST, _SCHEMA).get("identity")
            other = _differences(earlier, json.loads(json.dumps(identity)))
            if other:
                raise InputError(
                    f"{self.folder}: the parts of another run, with other {', '.join(other)}; "
                    "give what that run was given, or remove the folder")
        else:
            write_files(self.folder, {_MANIFEST: to_json({"schema": _SCHEMA, "identity": identity})})

    def starts(self) -> range:
        """Return the number of the first case of each chunk."""
        return range(0, self.total, self.size)

    def missing(self, chunks: Iterable[Chunk]) -> Iterator[int]:
        """Return the numbers of the first cases of those chunks that are not finished as they are now."""
        before = {path.name for path in self.folder.glob("[0-9]*.jsonl")}
        began = {name[:_DIGITS] for name in before}
        for chunk in chunks:
            name = self._named(chunk)
            if name in before and self._whole(name, len(chunk.cases)):
                continue
            self.outdated += len(chunk.cases) if name not in before and name[:_DIGITS] in began else 0
            yield chunk.start

    def write(self, chunk: Chunk, rows: Sequence[Row]) -> None:
        """Keep the rows of a chunk."""
        # a number that is not finite is kept as such: "never settled" is no missing value
        lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)
        write_files(self.folder, {self._named(chunk): lines})

    def rows(self) -> Iterator[Row]:
        """Return all rows in order.

        Raises:
            DocumentError: a part is no longer as it was written.
        """
        for start in self.starts():
            path = self.folder / self._names[start]
            try:
                rows = [json.loads(line) for line in path.read_bytes().split(b"\n")[:-1]]
            except (OSError, ValueError) as problem:
                raise DocumentError(f"{path}: no part of a table; remove it, --resume makes it again") from problem
            yield from rows

    def contents(self) -> list[str]:
        """Return what tells the contents of all chunks, as they were done, from others."""
        return [self._names[start] for start in self.starts()]

    def remove(self) -> None:
        """Remove the folder; a kill meanwhile leaves none that looks like parts of a stopped run."""
        done = self.folder.with_name(f".{self.folder.name}.done")
        shutil.rmtree(done, ignore_errors=True)
        self.folder.rename(done)
        shutil.rmtree(done, ignore_errors=True)

    def length(self, start: int) -> int:
        """Return the number of cases of the chunk that begins with this one."""
        return min(self.size, self.total - start)

    def _whole(self, name: str, rows: int) -> bool:
        """Return whether a part is there with all its rows: a power cut may leave a name without its content."""
        try:
            lines = (self.folder / name).read_bytes().split(b"\n")
        except OSError:
            return False
        return len(lines) == rows + 1 and all(line.endswith(b"}") for line in lines[:-1])

    def _named(self, chunk: Chunk) -> str:
        """Return the name of a chunk's part, and keep it in mind."""
        content = sha256(repr(chunk.cases).encode(errors="backslashreplace")).hexdigest()[:32]
        name = self._names[chunk.start] = f"{chunk.start:0{_DIGITS}d}-{content}.jsonl"
        return name


def _differences(earlier: object, identity: Mapping[str, Any]) -> list[str]:
    """Return the names of what two identities do not share."""
    if not isinstance(earlier, dict):
        return sorted(identity)
    return sorted(name for name in {*earlier, *identity} if earlier.get(name) != identity.get(name))

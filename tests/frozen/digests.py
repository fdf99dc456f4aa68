"""The table of digests: one line per output, `digest  controller/design/file`, sorted by the output's name."""

import hashlib
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import chdir
from pathlib import Path

from tests.frozen.outputs import DESIGNS, of_design, outputs

from heatertune.processors import on_one

TABLE = Path(__file__).with_name("digests.txt")
_DIGITS = 16


def collect(targets: Sequence[str] = (), keep: str | None = None, designs: Iterable[str] = DESIGNS) -> dict[str, str]:
    """Return name → digest of all outputs, or of the designs for some controllers; write the outputs where asked to."""
    kept = None if keep is None else Path(keep).resolve()
    digests = {}
    with tempfile.TemporaryDirectory() as folder, chdir(folder), on_one():
        found = (item for target in targets for design in designs for item in of_design(target, design))
        for name, content in found if targets else outputs():
            digests[name] = hashlib.sha256(content).hexdigest()[:_DIGITS]
            if kept is not None:
                (kept / name).parent.mkdir(parents=True, exist_ok=True)
                (kept / name).write_bytes(content)
    return digests


def read_digests(targets: Sequence[str] = (), designs: Iterable[str] = DESIGNS) -> dict[str, str]:
    """Return name → digest of the table, or of the designs for some controllers; nothing where there is no table yet."""
    lines = TABLE.read_text(encoding="utf-8").splitlines() if TABLE.exists() else []
    rows = {name: digest for digest, name in (line.split("  ", 1) for line in lines)}
    wanted = tuple(f"{target}/{design}/" for target in targets for design in designs)
    return {name: digest for name, digest in rows.items() if not targets or name.startswith(wanted)}


def write_digests(digests: Mapping[str, str], targets: Sequence[str] = ()) -> None:
    """Write the table; where only some controllers were run, the lines of the others stay."""
    old = read_digests()
    stay = {name: digest for name, digest in old.items() if targets and name not in read_digests(targets)}
    TABLE.write_text("".join(f"{digest}  {name}\n" for name, digest in sorted({**stay, **digests}.items())), encoding="utf-8")


def changes(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """Return a line for every output that changed, is new or is gone."""
    words = {(True, True): "changed", (True, False): "gone   ", (False, True): "new    "}
    names = sorted(before.keys() | after.keys())
    return [f"{words[name in before, name in after]}  {name}" for name in names if before.get(name) != after.get(name)]

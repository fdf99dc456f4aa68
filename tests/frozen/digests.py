"""The table of digests: one line per output, `digest  controller/design/file`, sorted by the output's name."""

import hashlib
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import chdir
from importlib.metadata import version
from pathlib import Path
from platform import python_version

from tests.frozen.outputs import DESIGNS, of_design, outputs

from heatertune.processors import on_one

TABLE = Path(__file__).with_name("digests.txt")
_DIGITS = 16
_MACHINE = "# "
#: whose last digits a fit and an optimum depend on
_LIBRARIES = ("numpy", "scipy", "numba", "casadi")


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


def machine() -> str:
    """Return what the digests depend on beside the source: processor, Python, and the libraries that compute."""
    cpu = Path("/proc/cpuinfo").read_text(encoding="utf-8") if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name\s*: (.*)$", cpu, re.MULTILINE)
    able = hashlib.sha256("".join(re.findall(r"^flags\s*: (.*)$", cpu, re.MULTILINE)[:1]).encode()).hexdigest()[:8]
    releases = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    return f"{model[1] if model else 'unknown processor'} ({able}), Python {python_version()}, {releases}"


def machine_of_table() -> str:
    """Return the `machine` on which the table was written."""
    return TABLE.read_text(encoding="utf-8").splitlines()[0].removeprefix(_MACHINE)


def read_digests(targets: Sequence[str] = (), designs: Iterable[str] = DESIGNS) -> dict[str, str]:
    """Return name → digest of the table, or of the designs for some controllers; nothing where there is no table yet."""
    lines = TABLE.read_text(encoding="utf-8").splitlines() if TABLE.exists() else []
    rows = {name: digest for digest, name in (line.split("  ", 1) for line in lines if not line.startswith(_MACHINE))}
    wanted = tuple(f"{target}/{design}/" for target in targets for design in designs)
    return {name: digest for name, digest in rows.items() if not targets or name.startswith(wanted)}


def write_digests(digests: Mapping[str, str], targets: Sequence[str] = ()) -> None:
    """Write the table; where only some controllers were run, the lines of the others stay."""
    old = read_digests()
    stay = {name: digest for name, digest in old.items() if targets and name not in read_digests(targets)}
    rows = [f"{digest}  {name}" for name, digest in sorted({**stay, **digests}.items())]
    TABLE.write_text("\n".join([f"{_MACHINE}{machine()}", *rows, ""]), encoding="utf-8")


def changes(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """Return a line for every output that changed, is new or is gone."""
    words = {(True, True): "changed", (True, False): "gone   ", (False, True): "new    "}
    names = sorted(before.keys() | after.keys())
    return [f"{words[name in before, name in after]}  {name}" for name in names if before.get(name) != after.get(name)]

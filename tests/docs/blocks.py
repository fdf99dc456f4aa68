"""The manual's code blocks: found, run, held against the output the page shows, and, on request, written anew.

A block of `sh` or `python` is run; a block of `text` that follows it is its output. The blocks of a page run in the order
in which they stand, in one empty folder, the Python blocks in one namespace. A line `…` in an output stands for any lines.

    python -m tests.docs.blocks [PAGE …]        write the outputs in docs/ anew
"""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from heatertune.cli import main
from heatertune.plc import TARGETS

DOCS = Path(__file__).parents[2] / "docs"
#: in the order of the navigation: a reader's order
PAGES = (
    "index.md", "tutorial.md", "tutorial_plant.md", "tutorial_extruder.md", "howto/overview.md", "howto/tasks.md", "howto/your_log.md", "howto/your_export.md", "howto/your_specification.md", "howto/your_plc.md",
    "howto/your_disturbance.md", "howto/zones.md", "howto/supervision.md", "howto/studio.md", "howto/live.md", "howto/write.md", "howto/many.md",
    "howto/health.md",
    "howto/your_controller.md",
    "howto/terminal.md",
    "explain/sampling.md", "explain/rounding.md", "explain/proof.md", "explain/events.md", "explain/verdict.md", "explain/paper_program.md",
    "explain/iec_pid.md", "explain/machine_code.md", "explain/no_power.md", "reference/commands.md", "reference/python.md", "reference/python_chain.md",
    "reference/python_log.md", "reference/python_heater.md", "reference/python_model.md", "reference/python_pid.md",
    "reference/python_plc.md", "reference/python_controllers.md", "reference/python_proof.md", "reference/python_redesign.md", "reference/python_lanes.md", "reference/python_monte_carlo.md",
    "reference/python_supervision.md", "reference/python_report.md", "reference/python_batch.md",
    "reference/python_loops.md", "reference/python_zones.md", "reference/python_live.md", "reference/python_common.md", "reference/controllers.md", *(f"controllers/{name}.md" for name in TARGETS), "reference/nomenclature.md", "reference/speed.md", "reference/install_size.md", "notebooks.md", "sources.md",
)
#: its commands read files of the user: tests/house/test_readme.py runs them after those of the README
OVERVIEW = "howto/overview.md"
#: installs are run by .ci/run, in a virtual environment of their own
INSTALL = re.compile(r"pip install |python -m pip install ")

_FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_STATUS = re.compile(r"\s+# exit status (\d)$")
#: of a proof: hangs on the last digit of the processor's arithmetic
_DIGEST = re.compile(r"sha256:[0-9a-f]{64}")
_NUMBER = re.compile(r"[-+−]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")


class Block(NamedTuple):
    """A block of code; `output` is what the page shows under it, None where it shows nothing."""

    kind: str
    code: str
    output: str | None
    span: tuple[int, int]


def blocks(text: str) -> list[Block]:
    """Return the blocks of a page that run."""
    fences = list(_FENCE.finditer(text))
    found = []
    for fence, after in zip_longest(fences, fences[1:]):
        if fence[1] in ("sh", "python"):
            shown = after is not None and after[1] == "text" and not text[fence.end() : after.start()].strip()
            output, span = (after[2], after.span(2)) if shown and after is not None else (None, (0, 0))
            found.append(Block(fence[1], fence[2], output, span))
    return found


def run(block: Block, names: dict[str, Any]) -> str:
    """Run a block in the present folder and return what it prints; raise AssertionError for another exit status."""
    printed = io.StringIO()
    if block.kind == "python":
        with redirect_stdout(printed):
            exec(compile(block.code, "<manual>", "exec", dont_inherit=True), names)  # as in a reader's own file
        return printed.getvalue()
    for line in block.code.replace("\\\n", " ").splitlines():
        command, status = _STATUS.sub("", line), _STATUS.search(line)
        if line.strip() and not INSTALL.match(command):
            found, said = _command(command)
            assert found == (int(status[1]) if status else 0), (command, found, said)
            printed.write(said)
    return printed.getvalue()


def _command(command: str) -> tuple[int, str]:
    """Run heatertune's commands here, which saves their start, and whatever needs a shell in one."""
    words = shlex.split(command)
    if words[0] == "heatertune" and not re.search(r"[|<>&;$]", command):
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            status = main(words[1:])
        errors = [line + "\n" for line in err.getvalue().splitlines() if line.startswith("error:")]
        return status, out.getvalue() + "".join(errors)
    # a fixed locale: `ls` sorts by it
    path = {"LC_ALL": "C.UTF-8", "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    ended = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, env=os.environ | path)
    return ended.returncode, ended.stdout


def differences(shown: str, printed: str) -> list[str]:
    """Return the shown lines that were not printed: words as they are, numbers within 1 %, spaces as you like."""
    missing, rest, free = [], [line for line in printed.splitlines() if line.strip()], False
    for line in [line for line in shown.splitlines() if line.strip()]:
        if line.strip() == "…":
            free = True
            continue
        places = range(len(rest) if free else min(1, len(rest)))
        place = next((i for i in places if same(line, rest[i])), None)
        if place is None:
            missing.append(line)
        else:
            rest, free = rest[place + 1 :], False
    return missing if missing or free or not rest else [f"printed but not shown: {rest[0]}"]


def same(one: str, other: str) -> bool:
    """Return whether two lines have the same words, and numbers within 1 % of each other."""
    if pattern(one) != pattern(other):
        return False
    pairs = zip(_numbers(one), _numbers(other), strict=True)
    return all(abs(a - b) <= 0.01 * max(abs(a), abs(b)) for a, b in pairs)


def pattern(line: str) -> str:
    """Return the line without what may differ: its numbers and digests, and how wide its gaps are."""
    return " ".join(_NUMBER.sub("#", _DIGEST.sub("", line)).split())


def _numbers(line: str) -> list[float]:
    return [float(found.replace("−", "-")) for found in _NUMBER.findall(_DIGEST.sub("", line))]


def refreshed(shown: str, printed: str) -> str:
    """Return the output as it is now, with what the page leaves out left out again; a line that is gone stays."""
    if not any(line.strip() == "…" for line in shown.splitlines()):
        return "\n".join(line.rstrip() for line in printed.strip("\n").splitlines()) + "\n"
    lines, rest = [], printed.splitlines()
    for line in shown.splitlines():
        place = next((i for i, each in enumerate(rest) if pattern(each) == pattern(line)), None)
        lines.append(line if place is None else rest[place].rstrip())
        rest = rest if place is None else rest[place + 1 :]
    return "\n".join(lines) + "\n"


def refresh(page: str) -> None:
    """Run a page and write its outputs anew."""
    path = DOCS / page
    text, names = path.read_text(encoding="utf-8"), {"__name__": "__manual__"}
    shift = 0
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for block in blocks(text):
            printed = run(block, names)
            if block.output is not None:
                new = refreshed(block.output, printed)
                missing = differences(new, printed)
                print(*(f"{page}: not printed any more: {line}" for line in missing), sep="\n", end="")
                start, end = (at + shift for at in block.span)
                text, shift = text[:start] + new + text[end:], shift + len(new) - (end - start)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    for each in sys.argv[1:] or PAGES:
        refresh(each)

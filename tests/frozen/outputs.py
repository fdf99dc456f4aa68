"""The outputs that are frozen: three designs for every controller, the README's commands, the help, the manual's pages.

Each function yields pairs of a name, `controller/design/file`, and a content in its stable form. All run in one process,
in the present folder, on one processor.
"""

import io
import re
import shlex
from collections.abc import Iterable, Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

from tests.conftest import heater_log
from tests.docs.blocks import DOCS, OVERVIEW, PAGES, Block, blocks, run
from tests.frozen.stable import LEFT_OUT, stable
from tests.house.test_readme import COMMAND_LINES, EXAMPLES, SERVES, write_example_files

from heatertune.cli import COMMANDS, main
from heatertune.plc import NAMES
from heatertune.proof.folder_digest import DIGEST_FILE

Item = tuple[str, bytes]

#: what they print is the machine's
_OF_THE_MACHINE = ("doctor", "bench")
#: slow, and their text is in the manual: of the README's, only the document
_TEXT_IN_MANUAL = ("design", "pareto", "supervise", "fleet")
#: these pages talk to servers that run by the clock
_LIVE_PAGES = ("howto/live.md", "howto/write.md")

_HEATER = ("--gain", "0.37", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
_SLOW_SENSOR = ("--gain", "1.2", "--time-constant", "60", "--dead-time", "30", "--ambient", "20")
_TIGHT = ("--setpoint", "60", "--limit", "overshoot=0.5%")


def outputs(targets: Iterable[str] = NAMES) -> Iterator[Item]:
    """Yield all items; the present folder must be empty."""
    for target in targets:
        for design in DESIGNS:
            yield from of_design(target, design)
    yield from of_help()
    yield from of_readme()
    yield from of_manual()


def of_design(target: str, design: str) -> Iterator[Item]:
    """Yield what one of the three designs prints and writes for a controller."""
    folder = Path(target, design)
    folder.mkdir(parents=True)
    with chdir(folder):
        DESIGNS[design](target)
    yield from _files(folder)


def _logged(target: str) -> None:
    """A log with its power: the whole chain."""
    Path("heater.csv").write_text(heater_log(0.9, 7), encoding="utf-8")
    _keep_document("design", "design", "heater.csv", "--target", target, "--force", "-o", "out")


def _ramped(target: str) -> None:
    """A heater by its numbers, PI, with a setpoint ramp where the controller has one."""
    _keep_text("tune", "tune", *_HEATER, "--target", target, "-o", "pid.json")
    export = ("export-db", "pid.json", "--target", target, "--setpoint", "50", "--force", "-o", "out")
    if _keep_text("ramp", *export, "--setpoint-ramp", "10") == 2:  # the error says that there is no ramp
        _keep_document("export", *export)


def _tight(target: str) -> None:
    """PID for a heater with much dead time and a limit that it cannot keep: FAIL, and what would pass where there is something."""
    options = ("--target", target, *_TIGHT)
    _keep_text("tune", "tune", *_SLOW_SENSOR, "--structure", "pid", *options, "-o", "pid.json")
    _keep_document("export", "export-db", "pid.json", *options, "--force", "-o", "out")


DESIGNS = {"logged": _logged, "ramped": _ramped, "tight": _tight}


def of_help() -> Iterator[Item]:
    """Yield the help of every command, its first layer and all of it."""
    for name in COMMANDS:
        yield f"help/{name}.out", stable(".out", _called(name, "--help")[1])
        yield f"help/{name}-all.out", stable(".out", _called(name, "--help-all")[1])


def of_readme() -> Iterator[Item]:
    """Yield what the README's commands and the other examples of the help print and write, in their order."""
    folder = Path("readme")
    folder.mkdir()
    with chdir(folder):
        write_example_files(Path())
        for line in COMMAND_LINES + [example for example in EXAMPLES if example not in COMMAND_LINES]:
            _, *arguments = shlex.split(line, comments=True)
            if arguments[0] in (*SERVES, *_OF_THE_MACHINE):
                continue
            name = re.sub(r"[^\w.=-]+", "_", " ".join(arguments))
            if arguments[0] not in _TEXT_IN_MANUAL:
                _keep_text(name, *arguments)
            if "--json" in _called(arguments[0], "--help-all")[1]:
                _keep_document(name, *arguments)
    yield from _files(folder)


def of_manual() -> Iterator[Item]:
    """Yield for each page of the manual what its blocks print."""
    for page in PAGES:
        found = blocks((DOCS / page).read_text(encoding="utf-8"))
        if not found or page in (*_LIVE_PAGES, OVERVIEW):
            continue
        folder = Path("manual", page.replace("/", "-"))
        folder.mkdir(parents=True)
        names = {"__name__": "__manual__"}
        with chdir(folder):
            printed = [f"{block.code}\n{_printed(block, names)}\n" for block in found if "heatertune doctor" not in block.code]
            yield f"manual/{page}.out", stable(".out", "".join(printed))


def _printed(block: Block, names: dict[str, object]) -> str:
    """Return what a block prints; where it fails, that is a change like any other, and the rest still runs."""
    try:
        return run(block, names)
    except Exception as problem:
        return f"{type(problem).__name__}: {problem}"


def _keep_text(name: str, *arguments: str) -> int:
    """Write what a command prints; return its exit status."""
    status, printed = _called(*arguments)
    Path(f"{name}.out").write_text(f"exit status {status}\n{printed}", encoding="utf-8")
    return status


def _keep_document(name: str, *arguments: str) -> None:
    Path(f"{name}.json").write_text(_called(*arguments, "--json")[1], encoding="utf-8")


def _called(*arguments: str) -> tuple[int, str]:
    """Return the exit status of a command, and what it prints, errors included."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            status = main(arguments)
        except SystemExit as ended:  # of the help
            status = int(ended.code or 0)
    errors = [f"{line}\n" for line in err.getvalue().splitlines() if line.startswith("error:")]
    return status, out.getvalue() + "".join(errors)


def _files(folder: Path) -> Iterator[Item]:
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix not in LEFT_OUT and path.name != DIGEST_FILE:  # of the others, which are here
            yield path.as_posix(), stable(path.name, path.read_bytes())

"""What the README and the overview of the commands show works: every command and every block is executed."""

import re
import shlex
import subprocess
import sys

import pytest
from tests.conftest import ROOT, fan_log, heater_log
from tests.docs.blocks import DOCS, OVERVIEW
from tests.docs.pictures import LARGEST_BYTES

from heatertune.cli import COMMANDS, main, parser

README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", README, re.DOTALL)
EXAMPLE_BLOCKS = BLOCKS + re.findall(r"```(sh)\n(.*?)```", (DOCS / OVERVIEW).read_text(encoding="utf-8"), re.DOTALL)
SHELL = [line for kind, block in EXAMPLE_BLOCKS if kind == "sh" for line in block.splitlines()]
MOST_LINES = 120
#: do not end by themselves, or ask a PLC: tests/studio/test_browser.py and tests/live start them
SERVES = ("studio", "simulate", "record", "experiment", "write", "rollback", "watch")
EXAMPLES = [command.example.removeprefix("example: ").splitlines()[0] for command in COMMANDS.values()]
COMMAND_LINES = [line[line.index("heatertune") :] for line in SHELL if "heatertune " in line]
OWN_LINES = [line for line in COMMAND_LINES if line in README]


def write_example_files(folder):
    """Write what the examples read: the user's own files."""
    (folder / "inputs.csv").write_text("W,X\n1091,500\n1091,510\n")
    (folder / "logs").mkdir()
    (folder / "logs" / "zone.csv").write_text(heater_log(0.5, 1))
    (folder / "other_day.csv").write_text(heater_log(0.5, 2))
    (folder / "trace.csv").write_text(heater_log(0.5, 2))
    (folder / "oven.csv").write_text(fan_log())
    (folder / "firing.csv").write_text("target [degC],ramp [degC/h],soak [min]\n35,60,20\n45,30,20\n")
    (folder / "study.toml").write_text(
        "[fixed]\ngain_degC_per_pct = 0.37\ntime_constant_s = 167\ndead_time_s = 12\nambient_degC = 22\n"
        "[grid]\ntarget = ['weg']\n")


@pytest.mark.doc
@pytest.mark.long(seconds=200)
@pytest.mark.parametrize("lines", [
    pytest.param(OWN_LINES, id="readme", marks=[pytest.mark.essential, pytest.mark.contained]),
    pytest.param(list(dict.fromkeys(COMMAND_LINES + EXAMPLES)), id="overview and help"),
])
@pytest.mark.usefixtures("whatever_pays")
def test_the_commands_of_readme_overview_and_help_run_in_the_order_they_stand(lines, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_example_files(tmp_path)
    assert lines
    for line in lines:
        if line.split()[1] in SERVES:
            parser().parse_args(shlex.split(line)[1:])
            continue
        status = main(shlex.split(line)[1:])
        # the log of another heater and the trace of another loop fail, as they should
        assert status == ("--ambient 19.5" in line or "--as-left" in line), (line, capsys.readouterr())


def test_the_readmes_pictures_and_pages_are_there_and_light():
    places = re.findall(r"\]\(([^)#]+)[^)]*\)", README)
    assert all((ROOT / place).is_file() for place in places), places
    shown = [ROOT / place for place in re.findall(r"!\[[^]]+\]\(([^)]+)\)", README)]
    assert shown
    assert all(place.stat().st_size <= LARGEST_BYTES for place in shown)


def test_the_readme_is_short_enough_to_be_read_at_once():
    assert len(README.splitlines()) <= MOST_LINES, "details belong in the manual"
    assert max(map(len, README.splitlines())) <= 150


def test_every_command_has_an_example():
    for name in COMMANDS:
        assert any(line.split()[1] == name for line in COMMAND_LINES), name


@pytest.mark.doc
@pytest.mark.essential
@pytest.mark.contained  # in tests/chain/test_same_request.py
@pytest.mark.long
def test_the_readmes_python_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (code,) = [block for kind, block in BLOCKS if kind == "python"]
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.split()[0] in ("PASS", "FAIL")


def test_the_help_needs_none_of_the_slow_libraries():
    code = (
        "import sys; from heatertune.cli import parser; parser().format_help();"
        "print([m for m in ('numpy', 'scipy', 'casadi', 'matplotlib', 'numba', 'control') if m in sys.modules])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "[]"

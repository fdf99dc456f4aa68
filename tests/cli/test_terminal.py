"""What a person at the terminal sees: colour, time left, completion."""

import argparse
import io
import os
import re
import subprocess
import sys

import pytest

from heatertune.cli import COMMANDS, printing, terminal
from heatertune.plc import TARGETS


class _Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def colourful(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    return _Terminal()


def test_a_verdict_is_painted_on_a_terminal_and_nowhere_else(colourful):
    # ECMA-48, 8.3.117 SGR: 1 bold, 31 red, 32 green, 0 back to normal
    assert terminal.painted("VERDICT PASS", colourful) == "VERDICT \033[1;32mPASS\033[0m"
    assert terminal.painted("ms  2.3  FAIL  x", colourful) == "ms  2.3  \033[1;31mFAIL\033[0m  x"
    assert terminal.painted("PASSED FAILED", colourful) == "PASSED FAILED"
    assert terminal.painted("VERDICT PASS", io.StringIO()) == "VERDICT PASS"


def test_no_color_and_a_dumb_terminal_switch_the_paint_off(colourful, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    assert not terminal.has_colour(colourful)
    monkeypatch.setenv("NO_COLOR", "")  # no-color.org: present and not empty
    assert terminal.has_colour(colourful)
    monkeypatch.setenv("TERM", "dumb")
    assert not terminal.has_colour(colourful)


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
def test_on_a_real_terminal_the_word_error_is_red_and_no_color_is_heard():
    import pty  # noqa: PLC0415 - not on every platform

    def said(**more):
        ours, theirs = pty.openpty()
        kept = {name: value for name, value in os.environ.items() if name != "NO_COLOR"}
        subprocess.run([sys.executable, "-m", "heatertune", "fit"], stderr=theirs, check=False,
                       env=kept | {"TERM": "xterm"} | more)
        os.close(theirs)
        text = os.read(ours, 4096).decode()
        os.close(ours)
        return text

    assert said().startswith("\033[1;31merror:\033[0m the following arguments")
    assert said(NO_COLOR="1").startswith("error: the following")


def test_json_and_a_pipe_have_no_escapes(run, by_hand):
    for more in ((), ("--json",)):
        status, out, err = run("verify", by_hand, "--target", "s5-ob251", "--setpoint", 40, *more)
        assert status == 0
        assert "\033" not in out + err


def _told(monkeypatch, capsys, messages, quiet=False):
    """Messages told at given instants → the lines on stderr."""
    clock = iter([0.0, *(instant for instant, _ in messages)])
    monkeypatch.setattr(printing.time, "monotonic", lambda: next(clock))
    progress = printing.Progress(argparse.Namespace(quiet=quiet))
    for _, message in messages:
        progress(message)
    return capsys.readouterr().err.splitlines()


def test_the_time_left_is_told_where_a_count_is_known(monkeypatch, capsys):
    # three of five done in 30 s: the two that are left take 20 s; what came before the first does not count
    told = _told(monkeypatch, capsys, [(7.0, "reading"), (10.0, "a (1 of 5)"), (20.0, "b (2 of 5)"), (40.0, "d (4 of 5)")])
    assert told[0].endswith("reading")
    assert told[1].endswith("a (1 of 5)")
    assert told[2].endswith("b (2 of 5), about 40 s left")
    assert told[3].endswith("d (4 of 5), about 20 s left")


def test_a_second_count_begins_anew_and_quiet_is_silent(monkeypatch, capsys):
    steps = [(0.0, "a (1 of 2)"), (50.0, "a (2 of 2)"), (100.0, "b (1 of 2)"), (103.0, "b (2 of 2)")]
    assert _told(monkeypatch, capsys, steps)[3].endswith("about 3 s left")
    assert _told(monkeypatch, capsys, steps, quiet=True) == []


@pytest.mark.long
def test_pareto_tells_its_count(run):
    _, _, err = run("pareto", "--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--structure", "pi",
                    "--points", 2)
    assert "(1 of 2)" in err
    assert re.search(r"\(2 of 2\), about \d+ s left", err)


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """The completion script for bash."""
    path = tmp_path_factory.mktemp("completion") / "heatertune.bash"
    command = [sys.executable, "-m", "heatertune", "completion", "bash"]
    path.write_text(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return path


def _completed(script, folder, *words):
    """What bash offers for the last word, by its own completion machinery."""
    line = " ".join(f"'{word}'" for word in words)
    code = (f"source '{script}'; COMP_WORDS=(heatertune {line}); COMP_CWORD={len(words)}; COMPREPLY=();"
            "f=$(complete -p heatertune | sed 's/.*-F \\([^ ]*\\).*/\\1/'); $f heatertune '' '';"
            'printf "%s\\n" "${COMPREPLY[@]}"')
    ended = subprocess.run(["bash", "-c", code], capture_output=True, text=True, check=True, cwd=folder)
    return set(ended.stdout.split())


def test_bash_completes_commands_options_targets_files_and_folders(script, tmp_path):
    (tmp_path / "own.csv").write_text("")
    (tmp_path / "out").mkdir()
    names = {each.__name__.rsplit(".", 1)[1].replace("_", "-") for each in COMMANDS}
    assert names <= _completed(script, tmp_path, "")
    assert _completed(script, tmp_path, "ver") == {"verify"}
    assert {"--target", "--setpoint"} <= _completed(script, tmp_path, "verify", "--")
    assert _completed(script, tmp_path, "verify", "x", "--target", "s7") == {name for name in TARGETS if name.startswith("s7")}
    assert _completed(script, tmp_path, "fit", "ow") == {"own.csv"}
    assert {each.rstrip("/") for each in _completed(script, tmp_path, "report", "o")} == {"out"}, "no file is a folder"
    assert _completed(script, tmp_path, "tune", "--structure", "p") == {"p", "pi", "pid"}


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_zsh_and_fish_get_every_command_too(run, shell):
    # neither shell is where the tests run; that the scripts name all is what can be seen here
    status, out, err = run("completion", shell)
    assert (status, err) == (0, "")
    for command in COMMANDS:
        assert command.__name__.rsplit(".", 1)[1].replace("_", "-") in out


def test_another_shell_is_refused_in_one_line(run):
    status, out, err = run("completion", "cmd")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert len(err.splitlines()) == 1

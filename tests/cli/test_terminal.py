"""What a person at the terminal sees: colour, time left, completion."""

import argparse
import io
import os
import shlex
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from heatertune.cli import COMMANDS, main, parser, printing
from heatertune.cli import printing as terminal
from heatertune.cli.common import again
from heatertune.cli.printing import Line
from heatertune.errors import InputError
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
    assert terminal.colourise("VERDICT PASS", colourful) == "VERDICT \033[1;32mPASS\033[0m"
    assert terminal.colourise("ms  2.3  FAIL  x", colourful) == "ms  2.3  \033[1;31mFAIL\033[0m  x"
    assert terminal.colourise("PASSED FAILED", colourful) == "PASSED FAILED"
    assert terminal.colourise("VERDICT PASS", io.StringIO()) == "VERDICT PASS"


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


@pytest.fixture
def line(monkeypatch):
    """A terminal's line that moves, drawn by hand."""
    err = _Terminal()
    monkeypatch.setattr("heatertune.cli.printing.sys", SimpleNamespace(stderr=err))
    monkeypatch.setattr(printing.LINE, "_beat", lambda _: None)
    yield err
    printing.LINE.end()


def _told(monkeypatch, line, messages, typical_s=()):
    """Messages told at given instants → what the line was each time."""
    clock = [0.0]
    monkeypatch.setattr(printing, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    progress = printing.Progress(argparse.Namespace(quiet=False), typical_s)
    for clock[0], message in messages:
        progress(message)
    return line.getvalue().split("\r\033[K")[1:]


def test_the_time_left_is_told_where_a_count_is_known(monkeypatch, line):
    # three of five done in 30 s: the two that are left take 20 s; what came before the first does not count
    told = _told(monkeypatch, line, [(7.0, "reading"), (10.0, "a (1 of 5)"), (20.0, "b (2 of 5)"), (40.0, "d (4 of 5)")])
    assert told == ["[  7.0 s] reading", "[ 10.0 s] 1 of 5: a", "[ 20.0 s] 2 of 5: b, about 40 s left",
                    "[ 40.0 s] 4 of 5: d, about 20 s left"]


def test_a_second_count_begins_anew(monkeypatch, line):
    steps = [(0.0, "a (1 of 2)"), (50.0, "a (2 of 2)"), (100.0, "b (1 of 2)"), (103.0, "b (2 of 2)")]
    assert _told(monkeypatch, line, steps)[-1].endswith("about 3 s left")


def test_steps_that_take_unlike_times_are_weighed_by_these():
    # the first, 8 s as a rule, took 16: twice as slow, so that 2 + 4 + 1 s become 14; from a cache: half at least
    assert printing.time_left(2, 4, 16.0, (8.0, 2.0, 4.0, 1.0)) == 14.0
    assert printing.time_left(2, 4, 0.1, (8.0, 2.0, 4.0, 1.0)) == 3.5
    assert printing.time_left(1, 4, 0.0, (8.0, 2.0, 4.0, 1.0)) == 15.0
    assert printing.time_left(1, 4, 0.0) is None


def test_a_line_is_never_wider_than_a_terminal_and_goes_before_a_result(monkeypatch, line):
    told = _told(monkeypatch, line, [(0.0, f"{'x' * 90} (1 of 2)"), (1000.0, f"{'y' * 90} (2 of 2)")])
    assert [len(each) for each in told] == [79, 79]
    assert told[1].endswith("…, about 1000 s left")
    printing.LINE.end()
    assert line.getvalue().endswith("\r\033[K")


def test_progress_is_for_terminals(capsys):
    progress = printing.Progress(argparse.Namespace(quiet=False))
    progress("a (1 of 2)")
    assert capsys.readouterr().err == ""
    progress.note("a row was left out")
    assert capsys.readouterr().err == "a row was left out\n"
    quiet = printing.Progress(argparse.Namespace(quiet=True))
    quiet("a (1 of 2)")
    quiet.note("a row was left out")
    assert capsys.readouterr().err == ""


def test_quiet_is_heard_on_a_terminal(line):
    printing.Progress(argparse.Namespace(quiet=True))("a (1 of 2)")
    assert line.getvalue() == ""


def test_the_line_lives_by_itself_while_something_takes_long(monkeypatch):
    drawn = threading.Event()
    line, texts = Line(), iter(range(1000))

    class _Waits(_Terminal):
        def write(self, text):
            if "3" in text:
                drawn.set()
            return super().write(text)

    monkeypatch.setattr("heatertune.cli.printing.sys", SimpleNamespace(stderr=_Waits()))
    monkeypatch.setattr("heatertune.cli.printing._BEAT_S", 0.001)
    line.show(lambda: str(next(texts)))
    assert drawn.wait(10.0)
    line.end()


def test_heatertune_alone_shows_where_to_begin(run):
    status, out, err = run()
    assert (status, err) == (0, "")
    examples = [each.split()[1] for each in out.splitlines() if each.startswith("  heatertune")]
    assert examples == ["design", "studio", "read", "verify", "decode"]
    assert max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize(("typed", "meant"), [("desing", "design"), ("Verify", "verify"), ("exportdb", "export-db")])
def test_a_command_that_is_nearly_one_is_named(run, typed, meant):
    status, out, err = run(typed, "table4")
    assert (status, out) == (2, "")
    assert err == f"error: unknown command {typed!r}: did you mean {meant}? (see: heatertune --help)\n"


def test_names_are_taken_in_any_case():
    for wanted in ("s5-ob251", "S5-OB251"):
        settings = parser("design").parse_args(
            ["design", "x.csv", "--out", "o", "--target", wanted, "--structure", "PI", "--pwm-rule", "Burst"])
        assert (settings.target, settings.structure, settings.pwm_rule) == ("s5-ob251", "pi", "burst")


def test_a_command_is_given_again_with_what_makes_it_pass():
    given = ("design", "x.csv", "--limit", "overshoot=1%", "--tolerance=2", "--limit", "ms=1.6", "--assume", "a=b")
    assert again(given, ("--tolerance", "3")) == (
        "heatertune", "design", "x.csv", "--limit", "overshoot=1%", "--limit", "ms=1.6", "--assume", "a=b",
        "--tolerance", "3")
    assert again(given, ("--limit", "overshoot=5%")) == (
        "heatertune", "design", "x.csv", "--tolerance=2", "--limit", "ms=1.6", "--assume", "a=b",
        "--limit", "overshoot=5%")
    assert again(given, ()) == ()
    for asked in (("--setpoint", "58", "104"), ("--setpoint=104",), ("--setpoint", "104")):
        assert again(("design", *asked, "--target", "weg"), ("--setpoint", "80 104")) == (
            "heatertune", "design", "--target", "weg", "--setpoint", "80", "104")


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
    names = set(COMMANDS)
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
    assert all(name in out for name in COMMANDS)


def test_another_shell_is_refused_in_one_line(run):
    status, out, err = run("completion", "cmd")
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert len(err.splitlines()) == 1


def _shown_on(stream, monkeypatch):
    monkeypatch.setattr(sys, "stdout", stream)
    printing.output(SimpleNamespace(json=False, json_full=False, verbose=True), {}, lambda: "VERDICT FAIL")


def test_a_reader_that_went_away_takes_no_verdict_with_it(monkeypatch):
    # `heatertune verify … | head -1` under pipefail: a status of 0 was taken for PASS
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "w") as stream:
        _shown_on(stream, monkeypatch)  # returns, and the command goes on to its status


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no file that is always full")
def test_a_result_that_cannot_be_written_is_no_fault_of_the_program(monkeypatch):
    with Path("/dev/full").open("w") as stream, pytest.raises(InputError, match=r"^the result: cannot be written: No space left"):
        _shown_on(stream, monkeypatch)


@pytest.mark.long
def test_the_status_of_words_that_fail_is_1_whoever_reads_on(tmp_path):
    heater = ("--gain", "0.5", "--time-constant", "120", "--dead-time", "10", "--ambient", "20")
    limits = ("--target", "weg", "--limit", "settling=1 s", "--no-redesign", "-o", str(tmp_path / "pid.json"))
    reads, writes = os.pipe()
    os.close(reads)
    ended = subprocess.run([sys.executable, "-m", "heatertune", "tune", *heater, *limits], stdout=writes, stderr=subprocess.PIPE, check=False)
    os.close(writes)
    assert (ended.returncode, ended.stderr) == (1, b"")


@pytest.mark.long
def test_the_setpoint_that_is_printed_for_what_winds_up_passes_as_it_is_typed(tmp_path, capsys):
    # dead time of two thirds of the lag: see tests/chain/test_closing.py
    given = ["tune", "--gain", "0.53", "--time-constant", "3200", "--dead-time", "2090", "--ambient", "20", "--target", "weg",
             "--range", "0", "50", "--tolerance", "0.45", "--assume", "anti_windup=clamp", "--assume", "sampling=caller",
             "--setpoint-ramp", "none"]
    assert main([*given, "--setpoint", "30", "40", "--out", str(tmp_path / "pid.json")]) == 1
    screen = capsys.readouterr().out
    assert screen.startswith("NOT PROVEN")
    typed = shlex.split(screen.partition("nearest that passes:\n")[2].replace("\\\n", " ").partition("\n")[0])
    assert typed[-2:] == ["--setpoint", "40"]
    assert main(typed[1:]) == 0
    assert capsys.readouterr().out.startswith("PASS")

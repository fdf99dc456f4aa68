"""What a second process does beside a design: found, or done where it is needed; never left running."""

import json
import os
import select
import signal
import subprocess
import sys
from functools import cache
from types import SimpleNamespace

import pytest

from heatertune.chain import design, precompile, worker
from heatertune.chain.pipeline import redraw
from heatertune.compiled import dispatch as machine
from heatertune.proof import text_comparison
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.text_comparison import ComparisonResult
from heatertune.report import sections

TARGET = "on-off"  # the loop that is compiled soonest; it is compared with no other


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """No machine code, in memory or on disk, and a second processor."""
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path))  # for the second process
    monkeypatch.setattr(machine, "folder", lambda: tmp_path)
    monkeypatch.setattr(machine, "_door", cache(machine._door.__wrapped__))
    monkeypatch.setattr(machine, "_found", set())
    monkeypatch.setattr(machine, "_beside", {})
    monkeypatch.setattr(precompile, "processors", lambda: 2)
    monkeypatch.setattr(precompile, "_has_drawn", lambda: True)  # no pictures, unless a test wants them
    return tmp_path


def begun(monkeypatch):
    """The processes that are begun from now on."""
    processes, begin = [], precompile._begun

    def noted():
        processes.append(begin())
        return processes[-1]

    monkeypatch.setattr(precompile, "_begun", noted)
    return processes


def door():
    """The loop as this process calls it, after a short run."""
    (_, loop), = worker.loops(TARGET)
    before = machine.decide(True)
    try:
        worker._compile(TARGET)
    finally:
        machine.decide(before)
    return machine.compile_function(loop)


@pytest.mark.long
def test_what_the_second_process_compiled_is_found_and_it_ends_with_the_block(fresh, monkeypatch):
    processes = begun(monkeypatch)
    with precompile.work_alongside(TARGET):
        found = door()
        assert (found.found, found.made) == (1, 0)
    assert processes[0].returncode is not None
    assert not machine._beside
    assert not list(fresh.rglob("*.tmp.*"))
    with precompile.work_alongside(TARGET):
        assert len(processes) == 1, "what is kept needs no process"


@pytest.mark.long
@pytest.mark.parametrize("told", ["import nothing_of_this_name", f"print({json.dumps(TARGET)!r})"], ids=["broken", "lies"])
def test_whatever_ends_the_second_process_the_first_one_compiles(told, fresh, monkeypatch):
    monkeypatch.setattr(precompile, "_begun", lambda: subprocess.Popen(
        [sys.executable, "-c", told], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL))
    with precompile.work_alongside(TARGET):
        own = door()
        assert (own.found, own.made) == (0, 1)


def test_where_no_process_can_be_begun_none_is_waited_for(fresh, monkeypatch):
    for name, value in (("executable", str(fresh / "no-such-python")), ("frozen", True)):
        monkeypatch.setattr(sys, name, value, raising=False)
        with precompile.work_alongside("s5-ob251"):
            assert not machine._beside


@pytest.mark.parametrize("reason", ["one processor", "no folder"])
def test_no_process_is_begun_where_it_is_of_no_use(reason, fresh, monkeypatch):
    processes = begun(monkeypatch)
    if reason == "one processor":
        monkeypatch.setattr(precompile, "processors", lambda: 1)
    else:
        monkeypatch.setattr(precompile, "folder", lambda: None)
    with precompile.work_alongside("s5-ob251"):
        pass
    assert not processes


#: of a log's section alone: nothing else is looked at
DOCUMENTS = {"log": {"name": "a log", "source": "made up", "repairs": [], "warnings": [], "time_s": [0.0, 1.0],
                     "temperature_degC": [20.0, 21.0], "power_pct": [0.0, 50.0], "setpoint_degC": None},
             "model": {"residuals": {"time_s": [0.0, 1.0], "measured_degC": [20.0, 21.0],
                                   "simulated_degC": [20.0, 20.5]}}}


@pytest.mark.long
def test_what_the_second_process_drew_is_what_the_first_one_draws(fresh, monkeypatch):
    monkeypatch.setattr(precompile, "_missing", lambda _: {})
    monkeypatch.setattr(precompile, "_has_drawn", lambda: False)
    other = DOCUMENTS | {"log": DOCUMENTS["log"] | {"source": "made up anew"}}
    with precompile.work_alongside(TARGET) as drawer:
        drawer.draw(DOCUMENTS, "log")
        assert drawer.sections() == sections(DOCUMENTS, ["log"])
        drawer.draw(DOCUMENTS, "log")
        drawer.draw(other, "log")
        assert drawer.sections() == sections(other, ["log"]), "of what was asked for last"
    assert drawer.sections() == sections(other, ["log"]), "kept when it has ended"


@pytest.mark.long
def test_what_the_exported_text_shows_is_in_the_report_though_it_runs_while_this_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr(text_comparison, "load_or_compute", lambda _, __, run, read: read(run()))
    for told in (ComparisonResult("at 3 s it asks for 7 %"), ComparisonResult(not_run=("the end of the listing",))):
        monkeypatch.setattr(text_comparison, "compare_text", lambda *_, told=told, **__: told)
        done = design("table4", DesignRequest(target="s5-ob251"), out=tmp_path)
        shown, page = done.outcome.proof, (tmp_path / "report.html").read_text()
        assert {"at 3 s it asks for 7 %", "the end of the listing"} & {text for text in (told.departs, *told.not_run) if text and text in page}
        assert shown.verdict == json.loads((tmp_path / "data" / "proof.json").read_text())["verdict"]
        assert (shown.verdict == "PASS") == (told.departs is None) == (tmp_path / "program_listing.txt").exists()
        redraw(tmp_path)
        assert (tmp_path / "report.html").read_text() == page


@pytest.mark.long
def test_who_waits_for_the_compiler_draws_meanwhile_what_nobody_draws_again(fresh, monkeypatch, capsys):
    # this one has compiled as soon as it is told that the picture is drawn
    told = ("import pickle, sys\nwhile not isinstance(pickle.load(sys.stdin.buffer), int): pass\n"
            f"print({json.dumps(TARGET)!r}, flush=True)\ninput()")
    monkeypatch.setattr(precompile, "_begun", lambda: subprocess.Popen(
        [sys.executable, "-c", told], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL))
    with precompile.work_alongside(TARGET) as drawer:
        drawer.draw(DOCUMENTS, "log")
        drawer.waits(TARGET)
        assert drawer.sections() == sections(DOCUMENTS, ["log"])
    before, asked = machine.decide(None), iter([[], (0, DOCUMENTS, "log"), (1, DOCUMENTS, "log")])
    try:
        with pytest.raises(StopIteration):
            worker._work(SimpleNamespace(get=lambda: next(asked)), {0}, compiles=False)
    finally:
        machine.decide(before)
    line, = capsys.readouterr().out.splitlines()
    assert json.loads(line) == [1, "log", sections(DOCUMENTS, ["log"])["log"]]


GARBAGE = ["[1, {}]", '[0, "log", 1]', '["0", "log", "drawn"]', '[7, "log", "drawn"]', '[0, "proof", "drawn"]', "null", '{"proof": 1}', '"log"', "\0", "{"]


@pytest.mark.long
@pytest.mark.parametrize("told", ["import nothing_of_this_name", "input()", f"print(*{GARBAGE!r}, sep='\\n')"],
                         ids=["broken", "ends", "garbage"])
def test_whatever_ends_the_second_process_the_first_one_draws(told, fresh, monkeypatch):
    monkeypatch.setattr(precompile, "_has_drawn", lambda: False)
    monkeypatch.setattr(precompile, "_begun", lambda: subprocess.Popen(
        [sys.executable, "-c", told], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL))
    with precompile.work_alongside(TARGET) as drawer:
        drawer.draw(DOCUMENTS | {"long": {"text": "x" * 1_000_000}}, "log")
        assert drawer.sections() == {}


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="tells when somebody else's process ends: Linux")
def test_the_second_process_ends_when_the_first_one_is_killed(fresh):
    code = ("from heatertune.chain import precompile\n"
            "precompile.processors, begin = lambda: 2, precompile._begun\n"
            "def told():\n"
            "    process = begin()\n"
            "    print(process.pid, flush=True)\n"
            "    return process\n"
            "precompile._begun = told\n"
            "with precompile.work_alongside('s5-ob251'):\n"
            "    input()\n")
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        second = os.pidfd_open(int(first.stdout.readline()))
        first.send_signal(signal.SIGKILL)
    assert select.select([second], [], [], 60.0)[0], "still running"
    os.close(second)
    assert not list(fresh.rglob("*.tmp.*"))

"""The compiler beside the fit: what it leaves on disk is what the design then asks for, and nothing depends on it."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from heatertune.chain import ahead
from heatertune.chain.ahead import compiling
from heatertune.compiled import machine_code

TARGET = "on-off"


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path))
    monkeypatch.setattr(ahead, "is_compiled", lambda _: False)
    return tmp_path


@pytest.mark.long(20)
def test_the_process_beside_leaves_the_loop_s_machine_code_on_disk(place):
    with compiling(TARGET) as beside:
        beside.begin()
        beside.wait()
        assert beside._process.returncode == 0
    assert any("run_all" in path.name for path in machine_code(place))


def test_none_is_begun_where_nothing_can_be_kept_or_all_is(place, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", pytest.fail)
    with compiling(TARGET) as beside, monkeypatch.context() as without:
        without.setenv("HEATERTUNE_CACHE", "")
        beside.begin()
    monkeypatch.setattr(ahead, "is_compiled", lambda _: True)
    with compiling(TARGET) as beside:
        beside.begin()
        beside.wait()


@pytest.mark.parametrize("program", ["raise SystemExit(3)", "import time; time.sleep(60)"], ids=["fails", "hangs"])
def test_a_process_that_fails_or_hangs_holds_nothing_up(program, place, monkeypatch):
    run = subprocess.Popen
    monkeypatch.setattr(ahead, "_PATIENCE_S", 0.1)
    begun = SimpleNamespace(Popen=lambda _, **pipes: run([sys.executable, "-c", program], **pipes))
    for name in ("PIPE", "DEVNULL", "TimeoutExpired"):
        setattr(begun, name, getattr(subprocess, name))
    monkeypatch.setattr(ahead, "subprocess", begun)
    with compiling(TARGET) as beside:
        beside.begin()
        beside.wait()
    assert beside._process.returncode is not None


def test_where_no_process_can_be_begun_the_design_goes_on(place, monkeypatch):
    def refused(*_, **__):
        raise OSError("no more processes")

    monkeypatch.setattr(ahead.subprocess, "Popen", refused)
    with compiling(TARGET) as beside:
        beside.begin()
        beside.wait()

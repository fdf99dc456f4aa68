import json
import subprocess

import pytest
from tests.conftest import ROOT

from heatertune.cli import main


@pytest.fixture
def run(capsys):
    """Run a command as a user types it; return exit status, stdout and stderr."""

    def run(*arguments):
        status = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


@pytest.fixture
def by_hand(tmp_path, run):
    """A design for a heater given by hand, as `tune` writes it."""
    path = tmp_path / "pid.json"
    status, _, _ = run("tune", "--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22, "-o", path)
    assert status == 0
    assert json.loads(path.read_text())["schema"] == "heatertune/pid/2"
    return path


@pytest.fixture
def kill():
    """Start a command and kill it as soon as so many parts of its table are there; return these."""

    def kill(command, folder, parts):
        process = subprocess.Popen(list(map(str, command)), cwd=ROOT)
        while len(list(folder.glob("[0-9]*.jsonl"))) < parts:
            assert process.poll() is None, "it was too quick to be killed"
            try:
                process.wait(timeout=0.02)
            except subprocess.TimeoutExpired:
                continue
        process.kill()
        process.wait()
        return sorted(folder.glob("[0-9]*.jsonl"))

    return kill

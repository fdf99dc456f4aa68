"""TCLab's own model is the unknown heater: words that passed keep their limits on it, measured on its own state."""

import json
import subprocess
import sys

import pytest

from tests.conftest import ROOT


@pytest.mark.long(seconds=12)
def test_words_that_passed_keep_their_limits_on_the_lab_and_are_left_as_proven(witness):
    folders = [str(witness(package)) for package in ("tclab", "pyserial")]
    # in a process of its own: the package has warnings that are not ours
    command = [sys.executable, "-m", "tests.bench.tclab_bench", *folders, "--labs", "1", "--first", "5"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:] + ended.stdout
    told = json.loads(ended.stdout)
    assert (told["verdict"], told["broken"], told["as_left"]) == ("PASS", [], "AS PROVEN"), told
    assert told["overshoot"][0] <= told["overshoot"][1] + 0.5

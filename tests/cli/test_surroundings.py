"""What the shell and the file system hand over: closed streams, names that are not UTF-8, files of nothing but lines."""

import os
import subprocess
import sys

import numpy as np
import pytest

from heatertune.cli import main
from heatertune.writing import display_name

COMMAND = f"{sys.executable} -m heatertune"


def shell(line, folder):
    return subprocess.run(["sh", "-c", line], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.long
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("command", "status"), [
    ("read table4", 0), ("--help", 0), ("terms TA", 0), ("read", 2), ("read missing.csv", 2)])
def test_a_closed_stream_changes_no_status(tmp_path, command, status, closed):
    ended = shell(f"{COMMAND} {command} {closed}", tmp_path)
    assert ended.returncode == status, ended.stderr
    assert "fault" not in ended.stderr
    assert "Traceback" not in ended.stderr


def test_output_goes_into_no_file_that_took_the_number_of_a_closed_stream(tmp_path):
    """A file opened after `>&-` gets descriptor 1: what is printed must not end up in it."""
    ended = shell(f"{COMMAND} spec oven -o spec.toml >&-; {COMMAND} spec oven -o other.toml", tmp_path)
    assert ended.returncode == 0
    assert (tmp_path / "spec.toml").read_bytes() == (tmp_path / "other.toml").read_bytes()


@pytest.fixture
def latin_log(tmp_path, monkeypatch):
    """A good log whose name was written by a machine with Latin-1 names."""
    monkeypatch.chdir(tmp_path)
    rng, heater, rows = np.random.default_rng(0), 22.0, []
    for second in range(900):
        power = 0.0 if second < 60 else 60.0 if second < 500 else 20.0
        rows.append(f"{second},{heater + rng.normal(0, 0.05):.2f},{power:g}")
        heater += (22.0 + 0.6 * power - heater) / 200.0
    name = os.fsdecode(b"h\xe4izung.csv")
    try:
        with open(name, "w", encoding="ascii") as file:  # noqa: PTH123 - as a shell would
            file.write("time_s,temperature_degC,power_pct\n" + "\n".join(rows))
    except OSError:
        pytest.skip("this file system takes no name that is not UTF-8")
    return name


def test_a_name_that_is_not_utf_8_is_shown_escaped():
    assert display_name(os.fsdecode(b"h\xe4izung.csv")) == "h\\xe4izung.csv"
    assert display_name("häizung °C.csv") == "häizung °C.csv"
    for number in range(0xd800, 0xe000, 37):
        display_name(chr(number)).encode("utf-8")


@pytest.mark.long(15)
def test_a_log_whose_name_is_not_utf_8_is_designed_for_exported_and_reported(latin_log, capsys):
    folder = os.fsdecode(b"o\xe4")
    for command in (
        ["read", latin_log, "--json"], ["fit", latin_log, "-o", os.fsdecode(b"m\xe4.json")],
        ["design", latin_log, "--target", "s7-300", "--setpoint", "35", "--out", folder],
        ["report", folder], ["verify", f"{folder}/data/pid.json", "--target", "s7-300"],
        ["fleet", ".", "--target", "s7-300", "--jobs", "1", "-o", os.fsdecode(b"f\xe4.parquet")],
    ):
        status = main([*command, "--quiet"])
        assert status in (0, 1), (command[0], capsys.readouterr().err)


@pytest.mark.long
@pytest.mark.parametrize("line", [b"\n", b"#\n", b",\n"], ids=["blank", "comment", "separator"])
def test_megabytes_of_lines_without_readings_take_little_memory(tmp_path, line):
    path = tmp_path / "lines.csv"
    path.write_bytes(line * (8_000_000 // len(line)))
    # of this program alone: getrusage counts what the parent had at the fork
    measured = ("from pathlib import Path; from heatertune.cli import main; status = main(['read', 'lines.csv']); "
                "lines = Path('/proc/self/status').read_text().splitlines(); "
                "print(status, *(int(line.split()[1]) // 1024 for line in lines if line.startswith('VmHWM')))")
    ended = subprocess.run([sys.executable, "-c", measured], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "the file is empty" in ended.stderr
    status, megabytes = map(int, ended.stdout.split())
    assert status == 2
    assert megabytes < 250  # today 90, most of it Python and NumPy; a list of the lines would be 900

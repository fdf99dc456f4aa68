"""Files that a user names, and what a crash looks like."""

import os
import threading

import pytest

from heatertune import writing as files
from heatertune.cli import main
from heatertune.cli import reference as targets
from heatertune.errors import InputError


@pytest.mark.parametrize(("path", "why"), [
    ("/dev/zero", "a device, not a file"), (".", "Is a directory"), ("x\0y", "no name that a file can have"),
    ("\ud800", "no name that a file can have"),
])
def test_what_is_no_file_is_refused(path, why):
    with pytest.raises(OSError, match=why):
        files.read_bytes(path)


def test_a_pipe_is_read_where_somebody_writes_to_it(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="a pipe without a writer"):
        files.read_bytes(tmp_path / "pipe")
    reading, writing = os.pipe()
    writer = threading.Thread(target=lambda: (os.write(writing, b"x" * 200_000), os.close(writing)))
    writer.start()
    assert files.read_bytes(f"/dev/fd/{reading}") == b"x" * 200_000
    writer.join()
    os.close(reading)


def test_a_file_that_is_too_long_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MOST_BYTES", 10)
    (tmp_path / "long").write_bytes(b"x" * 11)
    with pytest.raises(OSError, match="more than"):
        files.read_bytes(tmp_path / "long")


def test_an_error_is_one_line_of_limited_length():
    told = str(InputError("a\nb\u2028\ud800" + "x" * 1000))
    assert told.startswith("a\\nb\\u2028\\ud800xxx")
    assert len(told) <= 480


def test_a_crash_is_no_verdict_and_no_bad_input(monkeypatch, capsys):
    def crash(settings):
        raise KeyError("x")

    monkeypatch.setattr(targets, "_run_targets", crash)
    monkeypatch.delenv("HEATERTUNE_DEBUG", raising=False)
    assert main(["targets"]) == 70  # EX_SOFTWARE of sysexits.h
    told = capsys.readouterr().err
    assert told.startswith("error: a fault of heatertune itself, please report it with the command: KeyError in test_files.py")
    assert told.count("\n") == 1
    monkeypatch.setenv("HEATERTUNE_DEBUG", "1")
    with pytest.raises(KeyError):
        main(["targets"])

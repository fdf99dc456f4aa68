"""Folders whose log was exchanged with all digests computed again: some ways of the bench, each refused."""

import pytest

from heatertune.live.write import plc_block
from tests.bench.consistent_forgeries import of_logs
from tests.live.conftest import hasty_clock


@pytest.mark.long(25)
def test_a_log_that_was_exchanged_consistently_is_neither_exported_nor_written(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "state"))
    monkeypatch.setattr(plc_block, "HOST", hasty_clock())
    names = ("the log of the other", "its line kept", "a mark by a key of their own", "no digest", "a model of several logs", "a cooler that never ran")
    assert of_logs(tmp_path, names) == (2 * len(names), [])

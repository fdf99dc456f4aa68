"""Of the faults that `text_faults.py` plants, some: a proof notices each, or its reason stands beside that program."""

import pytest

from tests.bench.text_faults import unexplained
from tests.conftest import tried


@pytest.mark.long
@pytest.mark.parametrize(("target", "file", "every"), [("weg", "weg_pid_block.st", 7), ("iec-pid", "iec_pid.st", 9), ("s7-300", "s7_300_pid.awl", 13)])
def test_a_fault_in_an_exported_program_is_noticed_or_explained(target, file, every):
    times = tried(3, 1)
    left, _, count = unexplained(target, file, every * times)
    assert left == []
    assert count >= 30 // times

"""The outputs are those whose digests the table holds; `python -m tests.frozen --keep FOLDER` shows what changed.

Here run the designs for a few controllers; the command runs all, in minutes: before and after a change that keeps behaviour.
"""

import pytest
from tests.frozen.digests import changes, collect, machine, machine_of_table, read_digests
from tests.frozen.stable import stable

same_machine = pytest.mark.skipif(
    machine() != machine_of_table(), reason=f"the digests hold for {machine_of_table()}: the last digits of a fit depend on it")


@same_machine
@pytest.mark.long(seconds=12)
@pytest.mark.parametrize("target", ["s7-300", "s7-200-pid", "weg", "klipper"])
def test_a_design_has_the_frozen_outputs(target):
    assert changes(read_digests([target], ["ramped"]), collect([target], designs=["ramped"])) == []


def test_one_letter_of_a_program_and_one_key_of_a_document_are_changes():
    assert stable("pid.awl", "L 1;") != stable("pid.awl", "L 2;")
    assert stable("a.json", '{"gain": 1.0}') != stable("a.json", '{"gains": 1.0}')
    assert stable("a.json", '{"gain": 1.23457}') == stable("a.json", '{"gain": 1.2345700001}')
    assert stable("a.awl", "// 1.2345700001") != stable("a.awl", "// 1.23457")
    assert changes({"a": "1", "b": "2"}, {"b": "3", "c": "4"}) == ["gone     a", "changed  b", "new      c"]


def test_an_error_in_place_of_a_document_is_a_change_too():
    assert stable("tune.json", "error: no model\n") == b"error: no model\n"

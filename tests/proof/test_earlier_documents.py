"""Documents of the schemas before are read: files that the release before the change of keys wrote, kept as they were."""

import json

import pytest
from tests.conftest import ROOT

from heatertune.cli import main
from heatertune.codec import EarlierDocument, peek_schema, read_document
from heatertune.errors import DocumentError
from heatertune.model.model_document import SCHEMA as MODEL_SCHEMA
from heatertune.model.model_document import read_model
from heatertune.pid.design_document import SCHEMA as PID_SCHEMA
from heatertune.proof.proof_document import check_document
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import WORDS_SCHEMA

EARLIER = ROOT / "tests" / "golden" / "earlier_documents"


def keys(value):
    """Return all keys in JSON."""
    if isinstance(value, dict):
        return {*value, *(key for item in value.values() for key in keys(item))}
    return {key for item in value for key in keys(item)} if isinstance(value, list) else set()


@pytest.mark.parametrize(("name", "schema"), [
    ("model", MODEL_SCHEMA), ("pid", PID_SCHEMA), ("words", WORDS_SCHEMA), ("proof", PROOF_SCHEMA)])
def test_a_document_of_the_schema_before_has_the_current_keys(name, schema):
    path = EARLIER / f"{name}.json"
    original = json.loads(path.read_text(encoding="utf-8"))
    document = read_document(path, schema)
    assert (peek_schema(path), document["schema"]) == (schema, schema) != (original["schema"],) * 2
    assert isinstance(document, EarlierDocument)
    assert document.original == original
    assert not keys(document) & {"told", "log_told", "known", "kept", "ms_drawn"}
    assert len(keys(document)) == len(keys(original))


def test_the_digest_of_an_earlier_proof_covers_what_its_file_holds(tmp_path):
    read = check_document(read_document(EARLIER / "proof.json", PROOF_SCHEMA), "proof.json")
    assert read["stated_settings"] == json.loads((EARLIER / "proof.json").read_text(encoding="utf-8"))["known"]
    changed = tmp_path / "proof.json"
    changed.write_text((EARLIER / "proof.json").read_text(encoding="utf-8").replace('"remarks": [', '"remarks": [\n    "all is well",', 1),
                       encoding="utf-8")
    with pytest.raises(DocumentError, match="digest: of another proof"):
        check_document(read_document(changed, PROOF_SCHEMA), changed)


def test_earlier_words_are_verified_and_exported_with_their_proof(tmp_path, capsys):
    asked = ("--target", "weg", "--setpoint", "83", "--tolerance", "1.5")
    heater = ("--gain", "1.88", "--time-constant", "59", "--dead-time", "1.41", "--ambient", "20")
    assert main(["export-db", str(EARLIER / "words.json"), *asked, *heater, "-o", str(tmp_path), "--quiet"]) == 0
    assert "PASS" in (tmp_path / "weg_pid_block.st").read_text(encoding="utf-8")
    assert main(["verify", str(EARLIER / "pid.json"), *asked, "--quiet"]) == 0
    assert capsys.readouterr().out.count("PASS") >= 1
    assert read_model(EARLIER / "model.json").findings[0].message


@pytest.mark.parametrize("schema", [5, None, [], "heatertune/proof/2"])
def test_a_schema_that_is_none_is_refused_in_one_line(tmp_path, schema):
    path = tmp_path / "proof.json"
    path.write_text(json.dumps({"schema": schema, "runs": {"schema": schema}}))
    with pytest.raises(DocumentError, match="schema is"):
        read_document(path, PROOF_SCHEMA)

"""--boost from the command line, and a boost in the documents."""

import json

import pytest

HAND = ("--gain", 1.88, "--time-constant", 59, "--dead-time", 1.41, "--ambient", 20)
ASKED = ("--target", "weg", "--setpoint", 83, "--range", 0, 150, "--tolerance", 1.5)


@pytest.fixture
def design(tmp_path, run):
    path = tmp_path / "pid.json"
    assert run("tune", *HAND, *ASKED[:2], "-o", path)[0] == 0
    return path


@pytest.mark.long
def test_words_with_a_boost_are_exported_read_again_and_proven_again(run, design, tmp_path):
    assert run("export-db", design, *ASKED, "-o", tmp_path, "--force")[0] == 0
    path = tmp_path / "data" / "words.json"
    given = (path, *ASKED[:4], "--tolerance", 1.5, *HAND)
    plain = json.loads(path.read_text())
    assert "boost" not in plain
    assert run("verify", *given)[0] == 1
    boost = {"within_degC": 9.0, "again_degC": 13.5}
    path.write_text(json.dumps(plain | {"boost": boost}))
    status, out, _ = run("verify", *given, "--verbose")
    assert (status, "full power until 9 °C from the setpoint" in " ".join(out.split())) == (0, True)
    status, out, _ = run("verify", *given, "--json")
    assert (status, json.loads(out)["boost"]) == (0, boost)
    status, out, _ = run("verify", *given, "--boost", "none", "--json")
    assert (status, "boost" in json.loads(out)) == (1, False)
    status, out, _ = run("export-db", *given, "-o", tmp_path / "again", "--json")
    assert (status, json.loads(out)["boost"]) == (0, boost)
    text = (tmp_path / "again" / "weg_pid_call.st").read_text()
    assert "proven with a boost: full power until 9 degC from the setpoint, and again where it is more than 13.5" in text
    assert "HeaterPid.EN := HeaterOn AND NOT HeaterBoost;" in text
    assert run("export-db", tmp_path / "again" / "data" / "words.json", *ASKED[:2], "-o", tmp_path / "third")[0] == 0
    assert (tmp_path / "third" / "weg_pid_call.st").read_text() == text
    status, _, err = run("export-db", path, *ASKED[:2], "-o", tmp_path / "other")  # beside the proof of words without one
    assert (status, "the proof of other parameters (boost)" in err) == (1, True)


@pytest.mark.parametrize(("boost", "told"), [
    ({"within_degC": 12.5, "again_degC": 12.5}, "boost again_degC = 12.5 is out of range"),
    ({"within_degC": 12.5}, "boost.again_degC: is missing"), (5, "boost: expected an object, got 5"),
])
def test_a_boost_in_a_words_file_is_checked(run, design, tmp_path, boost, told):
    run("export-db", design, *ASKED, "-o", tmp_path, "--force")
    path = tmp_path / "data" / "words.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"boost": boost}))
    status, _, err = run("verify", path, *ASKED[:4], *HAND)
    assert (status, told in err, err.strip().count("\n")) == (2, True, 0), err

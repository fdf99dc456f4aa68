"""What a command does not need it does not import."""

import json
import os
import subprocess
import sys

import pytest

from heatertune.cli import main
from heatertune.compiled import dispatch
from heatertune.proof.proof_document import with_digest

SLOW = ("casadi", "control", "llvmlite", "matplotlib", "numba", "pyarrow", "distributed", "scipy", "scipy.stats")

HAND = ("--gain", "0.37", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
TARGET = ("--target", "s5-ob251", "--setpoint", "40")


#: modules of ours and of Python's that a command which only reads and writes words has no use for
UNUSED = ("heatertune.cli.tuning", "heatertune.log.read", "heatertune.report.page", "importlib.metadata")


def slow_modules(arguments, cache="", looked_for=SLOW):
    """Return which of the slow libraries a command loads, in a process of its own."""
    code = (
        "import sys; from heatertune.cli import main\n"
        "try: status = main(sys.argv[1:])\n"
        "except SystemExit as end: status = end.code\n"
        f"print(status, [name for name in {looked_for!r} if name in sys.modules], file=sys.stderr)"
    )
    fresh = os.environ | {"HEATERTUNE_CACHE": str(cache)}
    ended = subprocess.run([sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True, check=True,
                           env=fresh)
    return ended.stderr.strip()


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    """A folder with words and their proof, as export-db writes it; and the design they come from."""
    folder = tmp_path_factory.mktemp("proven")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEATERTUNE_CACHE", str(folder / "cache"))
        assert main(["tune", *HAND, "--target", "s5-ob251", "-o", str(folder / "pid.json"), "--quiet"]) == 0
        assert main(["export-db", str(folder / "pid.json"), *TARGET, "-o", str(folder / "out")]) == 0
    return folder


@pytest.mark.parametrize("arguments", [("--help",), ("export-db", "--help"), ("fleet", "--help"), ("study", "--help"),
                                       ("--version",), ("-V",)])
def test_help_loads_none_of_the_slow_libraries(arguments):
    assert slow_modules(arguments) == "0 []"


@pytest.mark.long
def test_words_that_this_machine_proved_are_exported_again_by_none_of_the_slow_libraries(proven, tmp_path):
    again = ("export-db", proven / "out" / "words.json", "--target", "s5-ob251", "-o", tmp_path)
    assert slow_modules(again, proven / "cache").startswith("0 ["), "words are proven again before they leave"
    assert slow_modules(again, proven / "cache") == "0 []", "and what this machine proved is read"
    first = {path.name: path for path in (proven / "out").rglob("*") if path.is_file()}
    again = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {path.name for path in again} == set(first)
    for path in again:
        if path.suffix == ".json":
            assert json.loads(path.read_text()) == json.loads(first[path.name].read_text())
        else:
            assert path.read_bytes() == first[path.name].read_bytes()


@pytest.mark.long
def test_a_design_whose_proof_is_kept_is_exported_again_by_none_of_the_slow_libraries(proven, tmp_path):
    again = ("export-db", proven / "pid.json", *TARGET, "-o", tmp_path)
    assert slow_modules(again, proven / "cache", (*SLOW, *UNUSED)) == "0 []"
    first = {path.name: path.read_bytes() for path in (proven / "out").rglob("*") if path.is_file()}
    assert {path.name: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == first


@pytest.mark.long
def test_a_design_is_proven_and_exported_without_casadi_and_matplotlib(proven, tmp_path):
    loaded = slow_modules(("export-db", proven / "pid.json", *TARGET, "-o", tmp_path))
    assert loaded.startswith("0 ")
    assert not any(name in loaded for name in ("casadi", "matplotlib", "control", "pyarrow", "distributed", "scipy.stats"))


@pytest.mark.long
@pytest.mark.parametrize("target", [("--target", "weg"), ("--target", "s5-ob251", "--words", "rounded")], ids=" ".join)
def test_a_design_whose_words_are_rounded_is_proven_and_exported_by_none_of_the_slow_libraries(target, proven, tmp_path):
    # forced: in single precision the design overshoots; the search over whole numbers alone needs machine code, and so
    # does a story of many parts
    asked = ("export-db", proven / "pid.json", *target, "--setpoint", "40", "--spec", "paper", "--force", "-o", tmp_path)
    assert slow_modules(asked).splitlines()[-1] == "0 []"
    assert "iae_load" in (tmp_path / "data" / "words.json").read_text()


@pytest.mark.long
def test_machine_code_that_is_kept_runs_without_the_compiler(proven):
    asked = ("verify", str(proven / "pid.json"), *TARGET)
    before = dispatch.decide(True)
    try:
        main([*asked, "--quiet"])
    finally:
        dispatch.decide(before)
    ended = slow_modules(asked, dispatch.folder()).splitlines()[-1]
    assert ended in ("0 ['llvmlite']", "1 ['llvmlite']"), "numba takes 0.2 s"


def failing(proof):
    """Turn a proof into one whose words break the limit of Ms: in every value, and in all that follows from them."""
    proof["verdict"] = "FAIL"
    proof["criteria"]["ms"].update(value=9.0, ok=False)
    for run in proof["runs"]:
        if "ms" in run["criteria"]:  # a run at another mains voltage has fewer criteria
            run["verdict"] = "FAIL"
            run["criteria"]["ms"] = {"value": 9.0, "ok": False}
    proof["digest"] = with_digest(proof)["digest"]


@pytest.mark.parametrize(("change", "status", "told"), [
    (lambda proof: proof["words"].update(K=proof["words"]["K"] + 1), 1, "the proof of other parameters (words); prove these"),
    (lambda proof: proof.update(sample_time_s=9.0), 1, "the proof of other parameters (sample_time_s)"),
    (lambda proof: proof["scaling"].update(high_degC=200.0), 1, "the proof of other parameters (scaling)"),
    (lambda proof: proof["criteria"]["ms"].update(ok=False) or proof.update(verdict="FAIL"), 2,
     "criteria.ms.ok: False; its value says otherwise: no whole proof; prove the words again"),
    (failing, 2, "criteria.ms.value: 9; proven again it is "),  # a whole proof, but not what the words do
    (lambda proof: proof.pop("runs"), 2, "proof.json: runs: is missing: no whole proof; prove the words again"),
    (lambda proof: proof.update(schema="x"), 2, "schema is 'x'; expected 'heatertune/proof/4'"),
])
@pytest.mark.long
def test_no_words_leave_on_another_proof(change, status, told, proven, tmp_path, capsys):
    proof = json.loads((proven / "out" / "data" / "proof.json").read_text())
    change(proof)
    if "other parameters" in told:  # a whole proof, but not of these
        proof["digest"] = with_digest(proof)["digest"]
    (tmp_path / "words.json").write_text((proven / "out" / "data" / "words.json").read_text())
    (tmp_path / "proof.json").write_text(json.dumps(proof))
    (tmp_path / "pid.json").write_text((proven / "out" / "data" / "pid.json").read_text())
    arguments = ["export-db", str(tmp_path / "words.json"), "--target", "s5-ob251", "-o", str(tmp_path / "new")]
    capsys.readouterr()
    assert main(arguments) == status
    refusal = capsys.readouterr().err
    assert told in refusal
    assert not (tmp_path / "new").exists()
    assert main([*arguments, "--force"]) == status, "no force makes another proof of it"
    assert not (tmp_path / "new").exists()


@pytest.mark.long
def test_words_that_fail_leave_by_force_alone_and_say_so_again(proven, tmp_path, capsys):
    asked = ("export-db", str(proven / "pid.json"), *TARGET, "--limit", "ms=1.2")
    assert main([*asked, "-o", str(tmp_path / "forced"), "--force", "--quiet"]) == 0
    again = ["export-db", str(tmp_path / "forced" / "data" / "words.json"), "--target", "s5-ob251", "-o", str(tmp_path / "new")]
    capsys.readouterr()
    assert main(again) == 1
    refusal = capsys.readouterr().err
    assert "not kept: Ms" in refusal or "not kept: ms" in refusal
    assert "; --force exports these parameters anyway" in refusal
    assert not (tmp_path / "new").exists()
    assert main([*again, "--force"]) == 0
    assert "not kept: ms" in (tmp_path / "new" / "DB30_listing.txt").read_text()
    assert json.loads((tmp_path / "new" / "data" / "words.json").read_text())["forced"] is True

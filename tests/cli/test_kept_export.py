"""An export is read where the same words were proven before: the same to the byte, and never for anything else."""

import pytest

from heatertune.proof import setpoint_ramp

SPEC = '[limits]\novershoot = "{}"\nreheat-overshoot = "90 %"\n'
HAND = ("--gain", 0.8, "--time-constant", 480, "--dead-time", 60, "--ambient", 22)


@pytest.fixture
def proofs(tmp_path, monkeypatch):
    """Proofs that were run, in a cache of its own."""
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path / "kept"))
    ran, prove = [], setpoint_ramp.prove_ramped

    def counted(*given, **named):
        ran.append(given)
        return prove(*given, **named)

    monkeypatch.setattr(setpoint_ramp, "prove_ramped", counted)
    return ran


def _files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.long
def test_an_export_is_kept_for_the_same_words_heater_and_conditions_alone(run, proofs, tmp_path):
    pid, spec = tmp_path / "pid.json", tmp_path / "own.toml"
    assert run("tune", *HAND, "--target", "s5-ob251", "-o", pid)[0] == 0
    spec.write_text(SPEC.format("30 %"))
    asked = ("export-db", pid, "--target", "s5-ob251", "--setpoint", 40, "--spec", spec)
    first = run(*asked, "-o", tmp_path / "a")
    assert (first[0], len(proofs)) == (0, 1)
    again = run(*asked, "-o", tmp_path / "b")
    assert (again[0], len(proofs)) == (0, 1)
    assert _files(tmp_path / "a") == _files(tmp_path / "b")
    assert first[1].replace(str(tmp_path / "a"), "") == again[1].replace(str(tmp_path / "b"), "")
    for more in (("--setpoint", 41), ("--gain", 0.81, *HAND[2:]), ("--limit", "overshoot=29%"), ("--force",),
                 ("--assume", "limit=exceeded")):
        before = len(proofs)
        run(*asked, *more, "-o", tmp_path / "c")
        assert len(proofs) == before + 1, more
    spec.write_text(SPEC.format("1 %"))  # another file of the same name
    assert (run(*asked, "-o", tmp_path / "d")[0], len(proofs)) == (1, 7)
    assert not (tmp_path / "d").exists()
    assert run(*asked, "-o", tmp_path / "d")[0] == 1  # a refusal is not kept
    assert len(proofs) == 8
    spec.write_text(SPEC.format("30 %"))
    for path in (tmp_path / "kept").glob("export-*.json"):  # damaged: in any doubt the proof runs
        path.write_bytes(path.read_bytes().replace(b"PASS", b"FAIL", 1))
    assert run(*asked, "-o", tmp_path / "e")[0] == 0
    assert len(proofs) == 9
    assert _files(tmp_path / "a") == _files(tmp_path / "e")
    run("verify", pid, "--target", "s5-ob251", "--setpoint", 40)
    run("verify", pid, "--target", "s5-ob251", "--setpoint", 40)
    assert len(proofs) == 11  # who verifies has it proven

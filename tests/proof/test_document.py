"""A proof is checked, not believed: whatever a hand changed in one is refused, by the export and by the report."""

import json
import shutil

import pytest
from tests.bench.documents import write_all

from heatertune.cli import main
from heatertune.proof import repetition
from heatertune.proof.proof_document import with_digest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("proven")
    write_all(folder)
    assert json.loads((folder / "proof.json").read_text())["verdict"] == "PASS"
    return folder


def _raise_limit(proof):
    proof["criteria"]["ms"]["limit"] = 9.0


def _worse_run(proof):
    proof["runs"][1]["criteria"]["overshoot"]["value"] = 19.0


def _broken_run(proof):
    proof["runs"][1]["criteria"]["overshoot"]["value"] = 50.0


def _drop_everywhere(proof):
    for holder in (proof, *proof["runs"]):
        del holder["criteria"]["overshoot"]


def _drop_margins(proof):
    for holder in (proof, *proof["runs"]):
        for name in ("stability", "ms", "gain_margin", "phase_margin", "step_power"):
            holder["criteria"].pop(name, None)  # a run at another mains voltage has none of them


def _wider_band(proof):
    for name in ("steady_offset", "limit_cycle"):
        proof["criteria"][name]["limit"] = 4.7


#: what is changed → what is told of it
CHANGES = [
    (lambda proof: proof.update(runs=[]), "runs: none"),
    (lambda proof: proof.update(criteria={}), "criteria."),
    (_drop_everywhere, "criteria.overshoot: is missing"),
    (_drop_margins, "criteria.ms: is missing"),
    (_raise_limit, "criteria.ms.limit: 9.0; limits.ms says otherwise"),
    (_wider_band, "criteria.steady_offset.limit: 4.7; the tolerance is 1 °C"),
    (_worse_run, "criteria.overshoot.value"),
    (_broken_run, "runs[1].criteria.overshoot.ok: True; its value says otherwise"),
    (lambda proof: proof.update(verdict="FAIL"), "verdict: 'FAIL'; its values make it 'PASS'"),
    (lambda proof: proof.update(verdict="pass"), 'verdict: expected one of PASS, FAIL, NOT PROVEN, got "pass"'),
    (lambda proof: proof["runs"][0].update(verdict="FAIL"), "runs[0].verdict: 'FAIL'"),
    (lambda proof: proof["criteria"]["overshoot"].update(value=99.0), "criteria.overshoot.value: 99.0; the worst run"),
    (lambda proof: proof["criteria"]["overshoot"].update(value=None), "criteria.overshoot.value: None; the worst run"),
    (lambda proof: proof["criteria"]["overshoot"].update(ok=False), "criteria.overshoot.ok: False"),
    (lambda proof: proof["criteria"]["overshoot"].update(bound=">="), "runs[0].criteria.overshoot.ok: True"),
    (lambda proof: proof["criteria"].update(joy=proof["criteria"]["iae"]), "criteria.joy: no such criterion"),
    (lambda proof: proof["runs"][0]["criteria"].pop("iae"), "runs[0].criteria: others than those of the proof"),
    (lambda proof: proof["findings"].append({"name": "poor-fit", "effect": "told", "message": "x", "accepted": False}),
     "findings[0]: effect: 'told'; a finding poor-fit blocks"),
    (lambda proof: proof["findings"].append({"name": "poor-fit", "effect": "blocks", "message": "x", "accepted": False}),
     "verdict: 'PASS'; its values make it 'NOT PROVEN'"),
    (lambda proof: proof["findings"].append({"name": "joy", "effect": "told", "message": "x", "accepted": False}),
     "findings[0].name: expected one of poor-fit"),
    (lambda proof: proof.pop("digest"), "digest: is missing"),
    (lambda proof: proof["runs"][0]["criteria"]["change_time"].update(ok=False), "runs[0].verdict: 'PASS'"),
    (lambda proof: proof["runs"][0]["criteria"]["change_time"].update(value=None), "runs[0].criteria.change_time.ok: True"),
    (lambda proof: proof["runs"][0]["criteria"]["change_time"].update(value=1e6), "runs[0].criteria.change_time.ok: True"),
    (lambda proof: proof["criteria"]["change_time"].update(value=1.0), "criteria.change_time.value: 1.0; the worst run"),
]


def test_a_run_that_takes_longer_on_a_way_that_has_longer_is_not_worse(folder, tmp_path, capsys):
    # the two changes of the setpoint have limits of their own: the worst has used most of its own, another took more seconds
    proof = json.loads((folder / "proof.json").read_text())
    worst = proof["criteria"]["change_time"]
    other = next(run for run in proof["runs"] if run["criteria"]["change_time"]["value"] < worst["value"])
    other["criteria"]["change_time"]["value"] = worst["value"] + 0.5
    shutil.copytree(folder, tmp_path / "in")
    (tmp_path / "in" / "proof.json").write_text(json.dumps(with_digest(proof)))
    assert main(["report", str(tmp_path / "in")]) == 0
    assert capsys.readouterr().err.count("error") == 0


@pytest.mark.parametrize("command", ["export-db", "report"])
@pytest.mark.parametrize(("change", "told"), CHANGES)
def test_what_does_not_follow_from_the_values_is_refused_even_under_a_digest_of_its_own(change, told, command, folder, tmp_path, capsys):
    proof = json.loads((folder / "proof.json").read_text())
    change(proof)
    if "digest" in proof:
        proof = with_digest(proof)
    assert _refusal(command, folder, tmp_path, json.dumps(proof), capsys).startswith(f"error: {tmp_path / 'in' / 'proof.json'}: {told}")


@pytest.mark.parametrize("command", ["export-db", "report"])
@pytest.mark.parametrize(("old", "new", "told"), [
    ('"noise_degC": 0.0', '"noise_degC": 0.1', "digest: of another proof"), ('"seed": 0', '"seed": 1', "digest: of another proof"),
    ('"faults": []', '"faults": ["x"]', "digest: of another proof"), ('"value": 1.0', '"value": NaN', "no JSON document: NaN is no number"),
])
def test_a_changed_text_is_refused(old, new, told, command, folder, tmp_path, capsys):
    text = (folder / "proof.json").read_text()
    assert old in text
    assert told in _refusal(command, folder, tmp_path, text.replace(old, new, 1), capsys)


@pytest.mark.parametrize("command", ["export-db", "report"])
@pytest.mark.parametrize(("field", "value"), [
    ("target", "s7-300"), ("sample_time_s", 9.0), ("scaling", {"low_degC": 0.0, "high_degC": 200.0}), ("words", {"K": 1}),
])
def test_a_proof_of_other_words_is_refused(field, value, command, folder, tmp_path, capsys):
    proof = with_digest(json.loads((folder / "proof.json").read_text()) | {field: value})
    assert f"the proof of other parameters ({field})" in _refusal(command, folder, tmp_path, json.dumps(proof), capsys, status=1)


@pytest.mark.parametrize("command", ["export-db", "report"])
def test_a_proof_of_some_settings_of_what_the_manual_leaves_open_is_refused(command, folder, tmp_path, capsys):
    proof = json.loads((folder / "proof.json").read_text())
    whole, proof["runs"] = proof["runs"], proof["runs"][:-1]
    for name, criterion in proof["criteria"].items():  # the worst of what is left
        values = [run["criteria"][name]["value"] for run in proof["runs"] if name in run["criteria"]]
        criterion["value"] = min(values) if criterion["bound"] == ">=" else max(values)
    told = _refusal(command, folder, tmp_path, json.dumps(with_digest(proof)), capsys)
    gone = ", ".join(f"{name} = {setting}" for name, setting in whole[-1]["switches"].items())
    assert f"proof.json: runs: none on {whole[-1]['model']} under {gone}, mains +10 %: no whole proof" in told


def _with_samples(folder, here, kept, monkeypatch):
    """Copy a design, its proof with samples of which so many of 200 pass, as `verify --samples -o proof.json` writes it."""
    shutil.copytree(folder, here)
    proof = json.loads((here / "proof.json").read_text())
    verdict = "PASS" if kept >= 196 else "FAIL" if kept <= 184 else "NOT PROVEN"
    settings = [{"switches": {"sum": setting}, "passing_count": number} for setting, number in (("limited", 200), ("unlimited", kept))]
    proof["samples"] = {"verdict": verdict, "count": 200, "seed": 0, "quantile": 0.95, "passing": kept / 200, "settings": settings,
                        "worst_seed": 3, "spread": {}, "criteria": {}}
    (here / "proof.json").write_text(json.dumps(with_digest(proof | {"verdict": verdict})))
    # the export proves the words again: here it finds the planted samples once more
    monkeypatch.setattr(repetition, "_proof_document", lambda *_: json.loads((here / "proof.json").read_text()))


@pytest.mark.long
def test_samples_that_are_not_drawn_again_are_not_believed(folder, tmp_path, monkeypatch, capsys):
    here, out = tmp_path / "in", tmp_path / "out"
    with monkeypatch.context() as planted:
        _with_samples(folder, here, 197, planted)
    assert main(["export-db", str(here / "words.json"), "--target", "s5-ob251", "-o", str(out), "--quiet"]) == 2
    refusal = capsys.readouterr().err
    assert f"{here / 'proof.json'}: " in refusal
    assert "; proven again it is " in refusal
    assert not out.exists()


@pytest.mark.long
def test_samples_that_fail_are_no_pass_of_the_words(folder, tmp_path, monkeypatch, capsys):
    here, out = tmp_path / "in", tmp_path / "out"
    _with_samples(folder, here, 90, monkeypatch)
    export = ["export-db", str(here / "words.json"), "--target", "s5-ob251", "-o", str(out), "--quiet"]
    assert main(export) == 1
    told = capsys.readouterr().err
    assert told.startswith("error: FAIL at ")
    assert "90 of 200 samples keep every limit under sum = unlimited, so at most 51.07 % of all do" in told
    assert not out.exists()
    assert main([*export, "--force"]) == 0
    words = json.loads((out / "data" / "words.json").read_text())
    assert (words["verdict"], words["forced"]) == ("FAIL", True)
    listing = (out / "DB30_listing.txt").read_text()
    assert "90 of 200 samples keep every limit under sum = unlimited" in listing
    assert main(["report", str(here), "--quiet"]) == 2, "its words.json still says PASS"
    assert "words.json: verdict: 'PASS'; proof.json next to it says 'FAIL': export the parameters again" in capsys.readouterr().err


def test_samples_that_pass_let_the_words_pass_and_stand_in_the_certificate(folder, tmp_path, monkeypatch):
    here, out = tmp_path / "in", tmp_path / "out"
    _with_samples(folder, here, 197, monkeypatch)
    assert main(["export-db", str(here / "words.json"), "--target", "s5-ob251", "-o", str(out), "--quiet"]) == 0
    assert json.loads((out / "data" / "words.json").read_text())["verdict"] == "PASS"
    assert "197 of 200 samples keep every limit under sum = unlimited, so at least 96.16 % of all do" in (
        out / "DB30_listing.txt").read_text()


def test_samples_too_few_to_tell_are_no_pass_either_and_tell_how_many_would_be_enough(folder, tmp_path, monkeypatch, capsys):
    here, out = tmp_path / "in", tmp_path / "out"
    _with_samples(folder, here, 195, monkeypatch)
    assert main(["export-db", str(here / "words.json"), "--target", "s5-ob251", "-o", str(out), "--quiet"]) == 1
    told = capsys.readouterr().err
    assert told.startswith("error: NOT PROVEN at ")
    assert "too few to decide whether 95 % of all do: --samples 500" in told
    assert not out.exists()


def _refusal(command, folder, tmp_path, proof, capsys, status=2):
    here = tmp_path / "in"
    shutil.copytree(folder, here)
    (here / "proof.json").write_text(proof)
    asked = {"report": [str(here)], "export-db": [str(here / "words.json"), "--target", "s5-ob251", "-o", str(tmp_path / "out")]}
    assert main([command, *asked[command], "--quiet"]) == status
    assert not (tmp_path / "out").exists()
    assert not (here / "report.html").exists()
    return capsys.readouterr().err

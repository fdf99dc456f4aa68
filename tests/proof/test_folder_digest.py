"""One digest over the documents of a folder: a mixture of two designs is found out, however its files are laid out.

The digests are computed again here, by what the manual says: SHA-256 of the JSON without spaces, its keys in order.
"""

import hashlib
import hmac
import json

import pytest

from heatertune.errors import DocumentError
from heatertune.proof.folder_digest import demand_log_of_model, demand_one_design, digest_problem, folder_digest

PARTS = {"log": "heatertune/log/2", "model": "heatertune/model/3", "pid": "heatertune/pid/2", "words": "heatertune/words/2",
         "proof": "heatertune/proof/4"}


def documents(which):
    """Return documents of a design that differ from those of another one."""
    made = {name: {"schema": schema, "of": which, "numbers": [1.5, 1e-7, 3]} for name, schema in PARTS.items()}
    made["log"]["taken"] = {"line": f"{which}: 240 rows"}
    made["model"] |= {"log_summary": [f"{which}: 240 rows"], "residuals": None}
    return made


def sha256(document):
    return f"sha256:{hashlib.sha256(json.dumps(document, sort_keys=True, separators=(',', ':')).encode()).hexdigest()}"


def write(folder, found, digest=None, indent=2):
    for name, document in found.items():
        (folder / f"{name}.json").write_text(json.dumps(document, indent=indent))
    if digest is not None:
        (folder / "digest.json").write_text(json.dumps(digest))


def test_the_digest_is_that_of_each_document_and_of_all_of_them(tmp_path):
    found, made = documents("one"), folder_digest(documents("one"))
    assert made["documents"] == {name: sha256(document) for name, document in found.items()}
    assert made["digest"] == sha256({"schema": "heatertune/digest/1", "documents": made["documents"]})
    for indent in (2, None):
        write(tmp_path, found, made, indent)
        assert digest_problem(tmp_path) == ""


@pytest.mark.parametrize("name", PARTS)
def test_a_document_of_another_design_or_none_is_told_and_refused(tmp_path, name):
    write(tmp_path, documents("one"), folder_digest(documents("one")))
    write(tmp_path, {name: documents("other")[name]})
    assert f"{name}.json is not the one of this design" in digest_problem(tmp_path)
    with pytest.raises(DocumentError, match=f"{name}.json is not the one .*; design again"):
        demand_one_design(tmp_path, "design again")
    (tmp_path / f"{name}.json").unlink()
    assert f"{name}.json is not the one of this design" in digest_problem(tmp_path)


@pytest.mark.parametrize("swapped", ["log", "model"])
@pytest.mark.parametrize("digest", [True, False])
def test_a_log_that_the_model_was_not_fitted_to_is_told_though_the_digest_is_computed_again(tmp_path, swapped, digest):
    mixed = documents("one") | {swapped: documents("other")[swapped]}
    write(tmp_path, mixed, folder_digest(mixed) if digest else None)
    assert "log.json: '" in digest_problem(tmp_path)
    assert "the model was fitted to" in digest_problem(tmp_path)


@pytest.mark.parametrize(("more", "left", "told"), [
    ({}, 0.05, True), ({"disturbance": {}}, 0.05, False), ({"residuals": None}, 0.05, False), ({}, 3.0, False)])
def test_readings_that_the_model_was_not_fitted_to_are_told_though_their_file_was_read_alike(tmp_path, more, left, told):
    """2 °C apart at each row, where the fit leaves 0.05 °C over; where it leaves 3 °C, nobody can say."""
    found, time_s = documents("one"), [5.0 * k for k in range(200)]
    measured = [20.0 + 0.1 * k for k in range(200)]
    found["log"] |= {"time_s": time_s, "temperature_degC": measured}
    found["model"] |= {"residuals": {"time_s": time_s[:120], "measured_degC": measured[:120],
                                     "simulated_degC": [each + left for each in measured[:120]]}} | more
    write(tmp_path, found, folder_digest(found))
    assert digest_problem(tmp_path) == ""
    found["log"]["temperature_degC"] = [each + 2.0 for each in measured]
    write(tmp_path, found, folder_digest(found))
    assert ("its readings differ by 2 °C" in digest_problem(tmp_path)) == told


def with_readings(which, **model):
    """Return documents whose log is that of the model's residuals, but for what is changed in the model."""
    found, time_s = documents(which), [5.0 * k for k in range(200)]
    degC = [20.0 + 0.1 * k for k in range(200)]
    found["log"] |= {"time_s": time_s, "temperature_degC": degC}
    found["model"] |= {"residuals": {"time_s": time_s, "measured_degC": degC, "simulated_degC": [each + 0.05 for each in degC]}} | model
    return found


def test_the_mark_is_an_hmac_of_the_digest_by_the_users_key(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "state"))
    made = folder_digest(documents("one"))
    key = (tmp_path / "state" / "cache.key").read_bytes()
    assert made["mark"] == f"hmac-sha256:{hmac.new(key, made['digest'].encode(), 'sha256').hexdigest()}"


HIDES = {"a disturbance": {"disturbance": {}}, "no residuals": {"residuals": None}, "two logs": {"log_summary": ["one: 240 rows", "two: 9 rows"]}}


@pytest.mark.parametrize("hides", HIDES.values(), ids=HIDES)
@pytest.mark.parametrize("mark", [None, "", "hmac-sha256:" + "0" * 64, "another user"])
def test_a_log_that_nothing_compares_is_believed_of_a_folder_with_the_users_mark_alone(tmp_path, monkeypatch, hides, mark):
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "state"))
    found = with_readings("one", **hides)
    made = folder_digest(found)
    write(tmp_path, found, made)
    demand_log_of_model(tmp_path, "take the parameters")
    if mark == "another user":
        monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "other"))
    else:
        write(tmp_path, {}, {name: value for name, value in made.items() if name != "mark"} | ({} if mark is None else {"mark": mark}))
    assert digest_problem(tmp_path) == ""  # the page is drawn, and nothing leaves
    with pytest.raises(DocumentError, match=r"nothing shows whether the model was fitted to it: .*; take the parameters"):
        demand_log_of_model(tmp_path, "take the parameters")
    write(tmp_path, {"model": found["model"] | {"outcome": "BY_HAND"}})
    (tmp_path / "digest.json").unlink()
    demand_log_of_model(tmp_path, "take the parameters")  # such a model says that no log supports it
    (tmp_path / "log.json").unlink()
    demand_log_of_model(tmp_path, "take the parameters")  # without a log there is none to be wrong


@pytest.mark.parametrize(("change", "refused"), [
    ({}, False), ({"temperature_degC": [float("nan")] * 200}, True), ({"temperature_degC": [20.0] * 7}, True),
    ({"time_s": [], "temperature_degC": []}, True), ({"cooling_pct": [0.0] * 200}, True),
    ({"temperature_degC": [20.0 + 0.15 * k for k in range(200)]}, True)])
def test_a_log_of_another_user_is_compared_with_the_models_residuals(tmp_path, change, refused):
    found = with_readings("one")
    found["log"] |= change
    made = folder_digest(found)
    made.pop("mark", None)
    write(tmp_path, found, made)
    if not refused:
        demand_log_of_model(tmp_path, "take the parameters")
        return
    with pytest.raises(DocumentError):
        demand_log_of_model(tmp_path, "take the parameters")


def test_residuals_that_are_larger_than_the_models_fit_says_hide_no_other_log(tmp_path):
    found = with_readings("one", fit_pct=99.0)  # of readings that scatter by 5.8 °C: 0.06 °C is left
    found["model"]["residuals"]["simulated_degC"] = [500.0] * 200
    found["log"]["temperature_degC"] = [20.0 + 0.15 * k for k in range(200)]
    write(tmp_path, found, folder_digest(found))
    assert "its readings differ by" in digest_problem(tmp_path)


def test_an_export_into_the_folder_of_another_user_does_not_vouch_for_its_log(tmp_path, monkeypatch):
    found = with_readings("one", disturbance={})
    made = folder_digest(found)
    write(tmp_path, found, made)
    exported = {name: found[name] for name in ("pid", "words", "proof")}
    assert "mark" in folder_digest(exported, tmp_path)
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "other"))
    assert "mark" not in folder_digest(exported, tmp_path)


def test_a_folder_without_a_digest_is_read_and_an_export_into_one_keeps_the_digests_of_log_and_model(tmp_path):
    whole, other = documents("one"), documents("other")
    write(tmp_path, whole)
    assert digest_problem(tmp_path) == ""
    exported = {name: other[name] for name in ("pid", "words", "proof")}
    assert folder_digest(exported, tmp_path)["documents"].keys() == exported.keys()
    write(tmp_path, {}, folder_digest(whole))
    write(tmp_path, exported, folder_digest(exported, tmp_path))
    assert digest_problem(tmp_path) == ""
    write(tmp_path, {"log": other["log"]})
    assert "log.json is not the one" in digest_problem(tmp_path)


@pytest.mark.parametrize(("change", "told"), [
    (lambda document: document["documents"].update(log=sha256({})), "not that of its documents"),
    (lambda document: document.update(schema="heatertune/digest/2"), "schema is"),
    (lambda document: document.pop("digest"), "digest: is missing"),
    (lambda document: document.update(documents=[]), "expected an object"),
])
def test_a_damaged_digest_is_told(tmp_path, change, told):
    document = folder_digest(documents("one"))
    change(document)
    write(tmp_path, documents("one"), document)
    with pytest.raises(DocumentError, match=told):
        digest_problem(tmp_path)

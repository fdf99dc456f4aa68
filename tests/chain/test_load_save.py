"""Values are saved and loaded again, and are the same: log, model, design, parameters, proof."""

import importlib.util
import json
import logging
from dataclasses import replace

import numpy as np
import pytest
from tests.conftest import heater_log

import heatertune as ht
from heatertune.errors import DocumentError, InputError
from heatertune.plc import controller_for
from heatertune.plc.ramp import Boost, Ramp


@pytest.fixture(scope="module")
def values(tmp_path_factory):
    file = tmp_path_factory.mktemp("saved") / "zone.csv"
    file.write_text(heater_log(0.5, 1), encoding="utf-8")
    log = ht.read_log(file)
    model = ht.fit(log)
    design = ht.tune(model, target="s5-ob251")
    words = ht.encode(design, "s5-ob251", model)
    return {"log": log, "model": model, "design": design, "words": words, "proof": ht.prove(words, model)}


@pytest.mark.parametrize("name", ["log", "model", "design", "words", "proof"])
def test_what_is_loaded_gives_the_document_that_was_saved(values, name, tmp_path):
    path = values[name].save(tmp_path / f"{name}.json")
    back = ht.load(path)
    assert type(back) is type(values[name]) or name == "proof", "whose traces are not saved"
    assert back.to_dict() == values[name].to_dict()
    if name in ("design", "words"):
        assert back == values[name]


def test_a_loaded_proof_says_what_the_proof_says_and_names_the_way_to_its_picture(values, tmp_path):
    proof, back = values["proof"], ht.load(values["proof"].save(tmp_path / "proof.json"))
    assert back.summary() == proof.summary()
    assert back.summary(verbose=True) == proof.summary(verbose=True)
    shown, whole = back._repr_html_(), proof._repr_html_()
    assert shown == whole[:whole.index("<svg")] + whole[whole.index("</svg>") + len("</svg>"):].lstrip()
    with pytest.raises(InputError, match=r"no traces to draw; heatertune\.prove\(words, model\)\.plot\(\) draws them"):
        back.plot()
    if importlib.util.find_spec("pandas") is not None:
        assert back.to_frame().equals(proof.to_frame())


def test_a_fit_of_a_loaded_log_is_the_fit_of_the_log(values, tmp_path):
    back = ht.load(values["log"].save(tmp_path / "log.json"))
    assert back.taken == values["log"].taken
    assert np.array_equal(back.time_s, values["log"].time_s)
    assert ht.fit(back).to_dict() == values["model"].to_dict()


@pytest.mark.parametrize("changed", [{"ramp": (5, 2)}, {"boost": (3.0, 4.0)}], ids=["ramp", "boost"])
def test_parameters_with_a_ramp_or_a_boost_come_back_with_it(values, changed, tmp_path):
    words = replace(values["words"], ramp=Ramp(step=5, calls=2)) if "ramp" in changed else values["words"].with_boost(
        Boost(within_degC=3.0, again_degC=4.0))
    assert ht.load(words.save(tmp_path / "words.json")) == words


def test_the_files_of_design_are_loaded_but_for_its_log_which_has_not_all(values, tmp_path):
    request = ht.DesignRequest(target="s5-ob251")
    result = ht.design(values["log"], request, out=tmp_path)
    data = tmp_path / "data"
    assert ht.load(data / "model.json").to_dict() == result.fitted_model.to_dict()
    assert ht.load(data / "words.json") == result.outcome.proof.words
    assert ht.load(data / "proof.json").verdict == result.outcome.proof.verdict
    with pytest.raises(DocumentError, match=r"read_log reads a log's file"):
        ht.load(data / "log.json")


def test_what_is_no_document_and_a_name_that_is_no_json_are_refused(values, tmp_path):
    (tmp_path / "other.json").write_text(json.dumps({"schema": "other/1"}), encoding="utf-8")
    with pytest.raises(DocumentError, match=r"other/1; expected a model\.json"):
        ht.load(tmp_path / "other.json")
    with pytest.raises(InputError, match=r"ends in \.json"):
        values["model"].save(tmp_path / "model.csv")
    with pytest.raises(InputError, match="no document of a Trace"):
        values["proof"].trace(0).to_dict()


def test_values_are_tables_of_pandas(values):
    pytest.importorskip("pandas")
    model, words, proof = (values[name].to_frame() for name in ("model", "words", "proof"))
    assert model["parameter"].tolist() == ["gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC"]
    assert model["value"].iloc[0] == values["model"].model.gain_degC_per_pct
    assert dict(zip(words["parameter"], words["value"], strict=True)) == dict(values["words"].values)
    assert len(proof) == len(values["proof"].criteria)
    assert values["design"].to_frame()["gain_pct_per_degC"].iloc[0] == values["design"].gain_pct_per_degC
    assert len(values["log"].to_frame()) == len(values["log"].time_s)


def test_a_value_is_shown_in_one_line_and_its_summary_begins_with_the_point(values):
    for value in (*values.values(), values["proof"].trace(0)):
        assert "\n" not in repr(value)
    for name, most in (("log", 200), ("model", 200), ("design", 120), ("proof", 120)):
        assert len(repr(values[name])) < most
    assert repr(values["proof"]).startswith(f"<Proof {values['proof'].verdict} of s5-ob251 at")
    assert values["model"].summary().splitlines()[0] == repr(values["model"])
    assert values["proof"].summary().startswith(values["proof"].verdict)
    assert len(values["model"].summary().splitlines()) <= 30
    assert set(values["model"].notes) <= {line.removeprefix("- ") for line in values["model"].summary(verbose=True).splitlines()}


def test_the_text_of_words_tells_them_apart(values):
    """Runs are reused, and stored proofs recognised, by this text: a shorter one let words with a ramp have the runs without."""
    words = values["words"]
    ramp = controller_for(words.target).ramp(words, 6.0)
    some = [words, replace(words, ramp=ramp), replace(words, ramp=controller_for(words.target).ramp(words, 12.0)),
            replace(words, scaling=replace(words.scaling, high_degC=words.scaling.high_degC + 1.0)),
            replace(words, sample_time_s=2.0 * words.sample_time_s),
            *(replace(words, values={**words.values, name: value + 1}) for name, value in words.values.items())]
    assert len(set(map(repr, some))) == len(some)


def test_the_result_of_a_design_and_the_program_behind_it_are_shown_in_one_line(values):
    """A cell that ends in one of them printed 1,100,000 and 475,000 characters."""
    found = ht.design(values["log"], target="s5-ob251", as_is=True)
    assert found.proof is found.outcome.proof
    assert repr(found) == f"<ChainResult zone: {found.proof!r}, {len(found.files)} files>"
    assert repr(found.proof) in repr(found.outcome)
    assert found.summary() == found.proof.summary()
    assert "<svg" in found._repr_html_()
    assert repr(ht.problem(values["model"])).startswith("<NonlinearProgram of a PI, TA ")
    assert len(repr(ht.problem(values["model"]))) < 120


def test_the_functions_log_what_they_begin_for_those_who_listen(values, caplog, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    with caplog.at_level(logging.INFO, logger="heatertune"):
        ht.tune(values["model"], ms=1.45)
    assert any(record.name == "heatertune" and record.message.startswith("tuning with TA = ") for record in caplog.records)

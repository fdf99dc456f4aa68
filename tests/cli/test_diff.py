"""Two word sets apart: what differs is told in engineering terms and word by word, and no proof is said to cover other words."""

import json
import shutil
import struct
from dataclasses import replace

import numpy as np
import pytest
from tests.bench.documents import write_all

from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Certificate, Ramp, Scaling, controller_for
from heatertune.proof.difference import DeclaredWords, Side, difference, read_sides
from heatertune.proof.proof_document import with_digest
from heatertune.report.report_text import difference_lines

DESIGN = PidDesign(gain_pct_per_degC=2.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=5.0, structure="pi", method="")
PROVEN = {"verdict": "PASS", "digest": "sha256:0"}


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    """A folder of proven words of OB251, as `export-db` writes it."""
    folder = tmp_path_factory.mktemp("proven")
    write_all(folder)
    return folder


@pytest.fixture
def dump(proven, tmp_path):
    """Write the memory of the proven controller with other words: DW number → value."""

    def dump(**changed):
        image = bytearray((proven / "DB30.bin").read_bytes())
        for place, value in changed.items():
            struct.pack_into(">h", image, 2 * int(place.removeprefix("DW")), value)
        (tmp_path / "dump.bin").write_bytes(image)
        return tmp_path / "dump.bin"

    return dump


def _document(run, *arguments):
    status, out, _ = run("diff", *arguments, "--json")
    document = json.loads(out)
    assert (document["schema"], status) == ("heatertune/diff/3", 0 if document["same"] else 1)
    return document


def _term(document, name):
    return next(term for term in document["terms"] if term["name"] == name)


def test_a_proven_folder_and_the_memory_it_was_typed_into_are_the_same(run, proven, dump):
    document = _document(run, proven, dump())
    assert (document["same"], document["words"], document["odd_in_b_alone"]) == (True, [], [])
    (covers,) = document["proofs"]
    assert (covers["verdict"], covers["covers"]) == ("PASS", True)
    # a memory holds neither range nor interval nor the program: they are said, not taken for known
    assert len(covers["provided"]) == 3
    status, out, _ = run("diff", proven, proven / "DB30_listing.txt")
    assert (status, out.splitlines()[-1]) == (0, "SAME WORDS")
    assert "covers" in out
    assert "where these are as proven" in out


def test_what_was_changed_is_told_in_engineering_terms_and_is_not_covered(run, proven, dump):
    before = json.loads((proven / "words.json").read_text())["words"]["K"]
    after = round(1.12 * before)
    document = _document(run, proven, dump(DW1=after, DW14=1638))
    # K is proportional to its word; 1638 of 2047 units are 80 %
    assert _term(document, "K")["change_pct"] == pytest.approx(100.0 * (after / before - 1.0))
    assert _term(document, "TN")["a"] == _term(document, "TN")["b"]
    assert _term(document, "largest power")["b"] == pytest.approx(80.0, abs=0.05)
    assert [(word["address"], word["name"], word["b"]) for word in document["words"]] == [("DW1", "K", after), ("DW14", "BGOG", 1638)]
    assert document["proofs"][0]["covers"] is False
    assert document["proofs"][0]["why_not"] == ["word K", "word BGOG"]
    status, out, _ = run("diff", proven, dump(DW1=after))
    assert (status, "+12 %" in out, "as before" in out, out.splitlines()[-1]) == (1, True, True, "DIFFERENT: word K")
    assert "does not cover" in out


def test_another_mode_is_told_and_a_setpoint_that_the_program_writes_is_none(run, proven, dump):
    document = _document(run, proven, dump(DW11=32))  # table 11-10: bit 0 is AUTO
    assert document["odd_in_b_alone"] == ["STEU bit 0 is 0: the controller is in manual mode."]
    assert _document(run, dump(DW11=32), proven)["odd_in_a_alone"] == document["odd_in_b_alone"]
    assert "now: STEU bit 0" in run("diff", proven, dump(DW11=32))[1]
    document = _document(run, proven, dump(DW9=819))
    assert (document["same"], document["proofs"][0]["covers"]) == (True, True)
    assert [(word["name"], word["written"]) for word in document["words"]] == [("W", True)]


def test_another_range_or_interval_is_no_longer_what_was_proven(run, proven, dump):
    document = _document(run, proven, dump(), "--range", 0, 150)
    assert document["around"] == ["sensor range"]
    assert _term(document, "K")["change_pct"] == pytest.approx(-100.0 / 3.0)  # as many units are 1.5 times as many degrees
    assert document["proofs"][0]["why_not"] == ["sensor range"]
    document = _document(run, proven, dump(), "--called-every", 20)
    assert (document["around"], document["proofs"][0]["covers"]) == (["call interval"], False)


def test_a_design_is_rounded_to_the_words_beside_it(run, proven, tmp_path):
    document = _document(run, proven / "pid.json", proven)
    assert (document["a"]["kind"], document["a"]["target"]) == ("design", "s5-ob251")
    assert document["proofs"][0]["proof_of"] == str(proven)
    same = _document(run, proven / "pid.json", proven / "pid.json", "--target", "weg")
    assert (same["same"], same["proofs"], same["conditions"]) == (True, [], None)


def test_a_design_with_its_recipe_becomes_the_words_that_were_proven(run, proven, tmp_path):
    document = json.loads((proven / "pid.json").read_text())
    recipe = {"target": "s5-ob251", "range_degC": [0.0, 150.0], "words_by": "rounded", "power_most_pct": 80.0, "conditions": {}}
    (tmp_path / "pid.json").write_text(json.dumps(document | {"made_for": recipe}))
    a, _ = read_sides(tmp_path / "pid.json", proven, DeclaredWords())
    assert (a.kind, a.taken_over, a.words.scaling.high_degC) == ("design", (), 150.0)
    assert a.words.values["BGOG"] == 1638  # 80 % of 2047 units
    rounded, _ = read_sides(tmp_path / "pid.json", proven, DeclaredWords(sensor_degC=(0.0, 100.0)))  # the user's range
    assert (rounded.words.scaling, rounded.words.values["BGOG"]) == (Scaling(), 1638)
    other, _ = read_sides(tmp_path / "pid.json", tmp_path / "pid.json", DeclaredWords(target="weg"))
    assert other.words.values["MaximumOutput"] == 100.0  # a recipe of another controller says nothing of this one


def test_two_proofs_are_compared_in_their_conditions(run, proven, tmp_path):
    copy = shutil.copytree(proven, tmp_path / "copy")
    assert _document(run, proven, copy)["conditions"] == []
    proof = json.loads((copy / "proof.json").read_text())
    proof["remarks"] = ["another"]
    (copy / "proof.json").write_text(json.dumps(with_digest(proof)))
    document = _document(run, proven, copy)
    assert (document["same"], document["conditions"]) == (True, ["the remarks"])
    assert [covers["covers"] for covers in document["proofs"]] == [True, True]
    # a proof that somebody changed is none
    (copy / "proof.json").write_text(json.dumps(proof | {"remarks": ["a third"]}))
    document = _document(run, proven, copy)
    assert (document["b"]["verdict"], len(document["proofs"])) == (None, 1)
    assert "digest" in document["b"]["notes"][0]
    # nor is one of other words
    words = json.loads((copy / "words.json").read_text())
    words["words"]["K"] += 1
    (copy / "words.json").write_text(json.dumps(words))
    shutil.copy(proven / "proof.json", copy)
    document = _document(run, copy, proven)
    assert "the proof of other parameters" in document["a"]["notes"][0]
    assert [(covers["proof_of"], covers["covers"]) for covers in document["proofs"]] == [(str(proven), False)]


#: words that tell the interval
_TIMES = ("TICK", "TICKS", "CYCLE", "Ts", "ADC_LOOPS", "SampleTime", "update_interval", "PERIOD_MS")


@pytest.mark.parametrize("target", TARGETS)
def test_every_word_counts(target):
    controller = controller_for(target)
    words = controller.encode(replace(DESIGN, sample_time_s=controller.timer.round(DESIGN.sample_time_s)), Scaling())
    a = Side(source="a", kind="words", words=words, proof=PROVEN)
    assert difference(a, replace(a, source="b", proof=None))["same"]
    for field in controller.fields:
        if field.low == field.high or (field.name in _TIMES and controller.interval_s is not None):
            continue  # the latter tell the interval: alone they are no words
        value = words.values[field.name]
        step = 1 if field.places is None else 10.0**-field.places
        near = (round(value + step, 6), round(value - step, 6)) if field.format != "REAL" else np.nextafter(np.float32(value), np.float32([1e9, -1e9])).tolist()
        other = next(number for number in near if field.low <= number <= field.high and (field.name, number) != ("OutMax", 256.0))
        b = Side(source="b", kind="words", words=replace(words, values=dict(words.values) | {field.name: other}))
        document = difference(a, b)
        written = field.name in controller.written
        assert [word["name"] for word in document["words"]] == [field.name]
        assert (document["same"], document["proofs"][0]["covers"]) == (written, written)


def test_a_ramp_is_known_of_words_and_taken_over_for_a_memory(tmp_path):
    controller = controller_for("s7-200")
    words = replace(controller.encode(DESIGN, Scaling()), ramp=Ramp(step=1, calls=3))
    text = controller.export(words, Certificate(verdict="PASS"))["s7_200_program.awl"]
    (tmp_path / "program.awl").write_text(text)
    document = {"schema": "heatertune/words/2", "target": "s7-200", "words": dict(words.values), "sample_time_s": words.sample_time_s,
                "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": {"step": 1, "calls": 3}}
    (tmp_path / "words.json").write_text(json.dumps(document))
    a, b = read_sides(tmp_path, tmp_path / "program.awl", DeclaredWords())
    assert difference(a, b)["same"]  # the ramp's statements are in the program, and the same
    assert b.words.ramp == words.ramp
    (tmp_path / "words.json").write_text(json.dumps(document | {"setpoint_ramp": {"step": 2, "calls": 3}}))
    a, b = read_sides(tmp_path, tmp_path / "program.awl", DeclaredWords())
    document = difference(replace(a, proof=PROVEN), b)
    assert (document["same"], document["around"]) == (False, ["program around the words"])
    assert document["proofs"][0]["why_not"] == ["program around the words"]
    plain = Side(source="plain", kind="words", words=replace(words, ramp=None))
    assert difference(replace(a, proof=PROVEN), plain)["around"] == ["setpoint ramp"]


def test_a_program_that_was_changed_is_not_covered(tmp_path):
    controller = controller_for("s7-200")
    words = controller.encode(DESIGN, Scaling())
    text = controller.export(words, Certificate(verdict="PASS"))["s7_200_program.awl"]
    (tmp_path / "program.awl").write_text(text.replace("\tENI\r\n", ""))
    a = Side(source="a", kind="words", words=words, proof=PROVEN)
    _, b = read_sides(tmp_path / "program.awl", tmp_path / "program.awl", DeclaredWords(target="s7-200"))
    document = difference(a, b)
    assert (document["same"], document["words"], document["proofs"][0]["covers"]) == (False, [], False)
    assert "differs from the exported one" in document["b"]["notes"][0]


def test_two_controllers_are_compared_in_engineering_terms():
    a = Side(source="a", kind="words", words=controller_for("fb41").encode(DESIGN, Scaling()), proof=PROVEN)
    b = Side(source="b", kind="words", words=controller_for("on-off").encode(DESIGN, Scaling()))
    document = difference(a, b)
    assert (document["around"], document["words"], _term(document, "K")["b"], _term(document, "TA")["b"]) == (["target"], [], None, 5.0)
    assert document["proofs"][0]["why_not"] == ["target"]


def test_another_range_of_the_module_is_told_and_not_covered(run, proven):
    which = controller_for("fb41")
    a, b = (Side(source=name, kind="words", words=which.encode(DESIGN, which.scaled(name))) for name in ("thermocouple", "rtd"))
    document = difference(replace(a, proof=PROVEN), b)
    assert (document["same"], document["around"], document["words"]) == (False, ["analog input"], [])
    assert document["proofs"][0]["why_not"] == ["analog input"]
    text = difference_lines(document)
    assert "rtd: its sensor is a resistance thermometer" in text
    assert "does not cover rtd: another analog input" in text
    document = _document(run, proven, proven / "DB30.bin", "--input", "4-20mA")
    assert (document["same"], document["around"], document["proofs"][0]["covers"]) == (False, ["analog input"], False)


@pytest.mark.parametrize(("arguments", "said"), [
    (("{proven}", "{proven}/DB30.bin", "--input", "rtd"), "--input rtd: an analog input 460 gives ohms"),
    (("{here}", "{proven}"), "no words.json"), (("{here}/none.json", "{proven}"), "cannot be read"),
    (("{proven}/pid.json", "{proven}/pid.json"), "--target is needed"), (("{proven}/proof.json", "{proven}"), "schema is"),
    (("{proven}", "{here}/bad.txt"), "line 2, data word: 'K = 3'"), (("{proven}", "{here}/short.bin"), "2 bytes; expected 98"),
    (("{proven}", "{proven}/DB30.bin", "--target", "plc"), "expected 'plc'"), (("{proven}", "{proven}", "--target", "weg"), "'s5-ob251'"),
    (("{proven}", "{proven}/DB30.bin", "--called-every", "0"), "--called-every"), (("{proven}", "{proven}/DB30.bin", "--range", "9", "1"), "high_degC"),
    (("{proven}/DB30.bin", "{proven}/DB30.bin", "--target", "s5-ob251"), "--called-every is needed"),
])
def test_bad_input_is_told_in_one_line(run, proven, tmp_path, arguments, said):
    (tmp_path / "bad.txt").write_text("DB30\nK = 3\n")
    (tmp_path / "short.bin").write_bytes(b"12")
    status, out, err = run("diff", *(text.format(here=tmp_path, proven=proven) for text in arguments))
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert said in err


@pytest.mark.parametrize(("name", "value", "said"), [("verdict", 3, "verdict"), ("files", "DB30.bin", "files"), ("fields", [], "fields: others")])
def test_words_whose_document_is_not_whole_are_not_exported_again(run, proven, tmp_path, name, value, said):
    folder = shutil.copytree(proven, tmp_path / "changed")
    document = json.loads((folder / "words.json").read_text())
    (folder / "words.json").write_text(json.dumps(document | {name: value}))
    status, out, err = run("export-db", folder / "words.json", "--target", "s5-ob251", "-o", tmp_path / "out")
    assert (status, out) == (2, "")
    assert said in err

"""What fits on one screen: the verdict first, nothing that it rests on left out without being counted."""

import re
import shlex
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.report.conftest import DESIGN
from tests.report.screens import GOLDEN, NEAREST, VERDICTS, criterion, documents_of, proof_of, screen_of, screens

from heatertune.codec import encode as as_json
from heatertune.model.findings import KINDS
from heatertune.plc import TARGETS, Certificate, controller_for
from heatertune.plc.design import encode
from heatertune.plc.keyed_entry import as_typed
from heatertune.proof.criteria import Criterion
from heatertune.proof.nearest_specification import limits_above
from heatertune.proof.specification import preset
from heatertune.report.controller_comparison import targets_brief
from heatertune.report.layout import LINES, WIDTH, command, labelled_lines, notes_within, wrap_text
from heatertune.report.report_text import keyed_entries
from heatertune.report.verdict_summary import design_brief, verify_brief

BLOCKING = [name for name, kind in KINDS.items() if kind.effect == "blocks"]
TOLD = [name for name, kind in KINDS.items() if kind.effect != "blocks"]


def _fits(screen):
    lines = screen.splitlines()
    assert len(lines) <= LINES == 30, len(lines)
    assert max(map(len, lines)) <= WIDTH == 80, max(lines, key=len)
    return lines


def test_the_screens_are_as_they_were_looked_at():
    assert screens() == GOLDEN.read_text(encoding="utf-8"), "python -m tests.report.screens, and look at them"


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_of_every_controller_is_one_screen(target, verdict):
    screen = screen_of(target, verdict)
    lines, whole = _fits(screen), " ".join(screen.replace("\\\n", " ").split())
    assert lines[0].startswith(f"{verdict}  {target} at 53.3 °C: ")
    assert "54 runs on 9 plausible heaters" in whole
    assert "the power was not logged" in whole
    assert "mains voltage (at −10 % a heater has 2.98 %" in whole
    assert "3 points that the manual leaves open" in whole
    assert "out/report.html" in whole
    if verdict == "PASS":
        for word in keyed_entries(documents_of(target, verdict)["words"]):
            assert re.search(rf"^  .*\b{re.escape(word.name)} +{re.escape(word.first_text)}(  |$)", screen, re.MULTILINE)
            assert not word.changes or f"then {word.then_text}:" in screen
    else:
        assert "do not enter: " in whole
        assert "no files to enter" in whole
    if verdict == "FAIL":
        assert "overshoot 24.1 % (limit 20 %), settling time never (limit 1500 s)" in whole
        assert f"nearest that passes: {' '.join(NEAREST).format(target)}" in whole
    if verdict == "NOT PROVEN":
        assert "--accept dead-time-open" in whole


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("verdict", VERDICTS)
def test_however_much_there_is_to_tell_it_is_one_screen_and_names_or_counts_all(target, verdict):
    documents = documents_of(target, verdict)
    proof = documents["proof"] = proof_of(target, verdict)
    names = [*TOLD, *(BLOCKING if verdict != "PASS" else [])]
    proof["findings"] = [{"name": name, "effect": "", "message": "", "accepted": False} for name in names]
    proof["not_tested"] = [f"part {number} of the story, for a long and winding reason" for number in range(9)]
    proof["remarks"] = [f"remark {number}, which takes some room on its line" for number in range(9)]
    proof["assumed"], proof["stated_settings"] = {"sensor_delay_s": 0.5}, {"rounding": "cut", "sum": "wide"}
    proof["faults"] = ["the error word wraps above 127 counts", "its P accumulates"]
    proof["specification"] = {"name": "oven", "changed": ["ms"], "limits": {**as_json(preset("oven").limits), "ms": ["1.6"]}, "profile": None}
    if verdict == "FAIL":
        proof["criteria"] |= {f"another_{number}": criterion(3.0, 2.0) for number in range(9)}
    documents["pid"]["notes"] = [f"note {number}" for number in range(40)]
    nearest = [word.format(target) for word in NEAREST] if verdict == "FAIL" else ()
    screen = design_brief(documents, "out/", nearest)
    lines, whole = _fits(screen), " ".join(screen.split())
    assert lines[0].startswith(verdict)
    for label in ("not known", "not tested", "assumed", "asked", "also", "faults"):
        assert re.search(rf"^{label} |\b{label} \(\d+\)", screen, re.MULTILINE), label
    if verdict != "PASS":
        assert f"--accept {BLOCKING[0]}" in whole
        assert "nor proven: " in whole
    if verdict == "FAIL":
        assert "and 8 more; 54 runs" in whole


def test_a_proof_alone_shows_its_notes_as_far_as_there_is_room():
    notes = [f"Note {number}: {'it is long. ' * 9}".strip() for number in range(9)]
    screen = verify_brief(proof_of("weg", "FAIL"), notes)
    _fits(screen)
    shown = len(re.findall(r"^- Note", screen, re.MULTILINE))
    assert f"- {9 - shown} more: --verbose" in screen
    assert 0 < shown < 9
    assert "remedy: heatertune design or tune" in screen
    assert "remedy: found during the design: would pass at" in verify_brief(proof_of("weg", "FAIL"), notes, "would pass at 3 °C")
    hidden = verify_brief(proof_of("weg", "PASS"), ["Ljung-Box is 3.", "The ramp is 2 °C/min."])
    assert "Ljung" not in hidden
    assert "- The ramp is 2 °C/min.\n- 1 more: --verbose" in hidden


def test_samples_stand_in_the_first_lines_with_what_they_break_where_the_runs_break_nothing():
    held = {"passing": 1.0, "worst": 12.0}
    spots = {"recovery_overshoot": {"passing": 0.98, "worst": 22.0}, "overshoot": {"passing": 0.995, "worst": 21.0}, "iae": held}
    drawn = {"quantile": 0.95, "count": 200, "seed": 1, "criteria": {**spots, "power_reserve": held},
             "settings": [{"switches": {"x": "y"}, "passing_count": 196}, {"switches": {"x": "z"}, "passing_count": 180}]}
    proof = proof_of("weg", "FAIL") | {"samples": drawn}
    proof["criteria"] = {name: criterion | {"ok": True} for name, criterion in proof["criteria"].items()}
    said = " ".join(verify_brief(proof).split())
    assert "180 of 200 samples keep every limit under x = z, so at most 93.28 % of all do (95 % confidence), 95 % must" in said
    assert "remedy: of all samples, 2 % break recovery overshoot and 0.5 % break overshoot: if your controller is known to behave " in said
    assert "state it with --assume; heatertune design or fleet with --samples searches for the smallest change that passes" in said
    drawn["settings"][0]["passing_count"] = 195
    drawn["criteria"] = {**spots, "power_reserve": {"passing": 1.0, "worst": -3.0}}
    said = " ".join(verify_brief(proof).split())
    assert "break overshoot: some heaters lack the power for this setpoint" in said


WORDS = st.text(st.characters(codec="utf-8", categories=["L", "N"]), min_size=1, max_size=12)


@settings(max_examples=20)
@given(parts=st.dictionaries(WORDS, st.lists(WORDS, max_size=8), max_size=8), most=st.integers(1, 9))
def test_parts_behind_labels_are_shown_or_counted(parts, most):
    lines = labelled_lines(parts, most)
    assert len(lines) <= most
    assert all(len(line) <= WIDTH for line in lines)
    filled = {label: of for label, of in parts.items() if of}
    if len(filled) <= most:
        for label, of in filled.items():
            told = " ".join(lines)
            assert label in told
            assert all(part in told for part in of) or "more" in told or "…" in told


@settings(max_examples=20)
@given(words=st.lists(st.sampled_from(["design", "--out", "a b", "out/", "--limit", "overshoot=25%", "-o", "it's"]), min_size=1, max_size=25))
def test_a_command_over_several_lines_is_one_for_the_shell(words):
    # POSIX.1-2017, Shell Command Language, 2.2.1: a backslash before a newline joins the lines
    assert shlex.split("\n".join(command(["heatertune", *words])).replace("\\\n", " ")) == ["heatertune", *words]


def test_notes_take_no_more_than_their_room():
    assert notes_within(3, ["one", "two", "three", "four"]) == ["- one", "- two", "- 2 more: --verbose"]
    assert notes_within(9, ["one"]) == ["- one"]
    assert notes_within(9, ["one"], hidden=2) == ["- one", "- 2 more: --verbose"]
    assert notes_within(1, []) == []


def test_a_paragraph_hangs_under_its_first_words():
    assert wrap_text("x " * 60, "label  ") == [f"label  {'x ' * 36}x", f"       {'x ' * 22}x"]


def test_a_real_has_its_decimal_point():
    # IEC 61131-3, 6.1.2.1: a real literal has one
    assert [as_typed(value, "REAL") for value in (66000.0, -2.0, 9.5, 1e20)] == ["66000.0", "-2.0", "9.5", "1e+20"]
    assert as_typed(4000, "INT") == "4000"


@pytest.mark.parametrize(("target", "file"), [("s5-ob251", "DB30_listing.txt"), ("fb41", "fb41_cont_c.awl")])
def test_values_are_typed_as_the_export_writes_them(target, file):
    # the exported text is run, or read back, by the tests of the controller; STEP's own spelling stands there
    words, controller = encode(DESIGN, target), controller_for(target)
    text = " ".join(controller.export(words, Certificate(verdict="PASS", setpoint_degC=53.3))[file].split())
    for field in controller.fields:
        if field.format in ("KF", "TIME", "BOOL"):
            assert as_typed(words.values[field.name], field.format).replace("KF ", "KF = ") in text, field.name


def _broken(*criteria):
    return SimpleNamespace(criteria=[Criterion(name=name, value=value, limit=limit, unit="", what="", at_least=least)
                                     for name, value, limit, least in criteria])


def test_the_limits_that_a_design_would_keep_are_a_little_above_what_it_does():
    assert limits_above(_broken(("overshoot", 24.1, 20.0, False), ("change_overshoot", 26.0, 20.0, False),
                                    ("iae", 3.0, None, False)).criteria) == {"overshoot": "27%"}
    assert limits_above(_broken(("limit_cycle", 1.234, 1.0, False)).criteria) == {"tolerance": "1.3degC"}


@pytest.mark.parametrize("broken", [
    ("ms", 2.3, 2.0, False), ("gain_margin", 1.2, 1.7, True), ("settling_time", float("inf"), 900.0, False),
    ("stability", 0.0, 1.0, True), ("overflow", 3.0, 0.0, False), ("power_reserve", 3.0, 5.0, True),
])
def test_robustness_and_what_never_happens_are_never_loosened(broken):
    assert limits_above(_broken(("overshoot", 24.1, 20.0, False), broken).criteria) == {}


def test_a_comparison_is_one_screen():
    figures = {"settling_time": 1.23e4, "overshoot": 10.2, "steady_offset": 0.28, "iae": 100.0}
    rows = [{"target": target, "verdict": "FAIL", "fails": ["reheat_overshoot", "limit_cycle"], "realised": figures,
             "wished": figures | {"iae": 40.0}} for target in TARGETS]
    rows[0] |= {"realised": figures | {"settling_time": None}, "wished": figures | {"iae": 0.1}, "fails": [], "verdict": "PASS"}
    rows[1] = {"target": "s7-200", "verdict": "not representable", "why": "K"}
    screen = targets_brief({"setpoint_degC": 40.0, "rows": rows, "model": "one lag"})
    lines = _fits(screen)
    assert lines[2].split() == ["s5-ob251", "PASS", "never", "10.2", "%", "0.28", "°C", "1000", "times"]
    assert lines[3].endswith("not representable")
    assert lines[4].endswith("+150.0 %  reheat overshoot +1")

import json
import math
from dataclasses import replace

import pytest
from tests.bench.documents import DESIGN, HEATER, own_log, write_all

from heatertune import chain
from heatertune.chain.pipeline import dossier
from heatertune.codec import to_json
from heatertune.errors import ExportRefused, InputError, NotRepresentable, OutOfRange
from heatertune.log import read_log
from heatertune.model.model_values import Candidate, model_by_hand
from heatertune.pid.design_document import DesignProvenance
from heatertune.plc import controller_for
from heatertune.proof.monte_carlo.run import with_samples
from heatertune.proof.repetition import repeat_words
from heatertune.settings import Conditions, ReadSettings, SampleSettings
from heatertune.studio.loop_settings import StudioSettings, find_design, first_look, full_proof
from heatertune.studio.session import MOST_PINNED, Session, read_source
from heatertune.studio.sheet_card import DroppedFile
from heatertune.writing import write_files


@pytest.fixture
def session(heater, step_log):
    found = Session()
    assert found.fit_done(found.begin(DroppedFile.of("step.csv", step_log).log), heater)
    return found


def look(session):
    found = first_look(session.fitted, session.settings, session.gains())
    assert session.look_done(session.ticket, found)
    return found


def prove(session):
    proof = full_proof(session.fitted, session.look)
    session.proof_done(session.ticket, proof)
    return proof


def test_a_first_look_shows_what_the_chain_itself_would_prove_on_the_first_heater(session):
    found = look(session)
    words = chain.encode(found.gains.design, "s5-ob251")
    whole = chain.prove(words, session.fitted)
    assert found.gains.words == words
    assert found.proof.nominal.temperature_degC.tolist() == whole.nominal.temperature_degC.tolist()
    assert [run.criteria for run in found.proof.runs] == [whole.runs[0].criteria]


def test_a_first_look_runs_the_first_heater_alone_and_tells_the_margins_on_all(heater):
    models = (heater.model, replace(heater.model, dead_time_s=30.0))
    both = replace(heater, candidates=tuple(
        Candidate(model=model, log="x", window_s=(0.0, 1.0), law=f"law {i}", fit_pct=90.0 - i, rmse_degC=0.1, delta_bic=0.0)
        for i, model in enumerate(models)))
    found = first_look(both, StudioSettings(), first_look(heater, StudioSettings()).gains)
    assert len(found.proof.runs) == 1
    late = heater.model.dead_time_s + controller_for(found.settings.target).delay_s  # of its input module
    assert found.proof.nominal.model == replace(heater.model, dead_time_s=late)
    # more dead time, less margin (any textbook): the worst is the second heater's
    assert found.margins.ms > first_look(heater, StudioSettings()).margins.ms
    assert {run.model for run in full_proof(both, found).runs} == {candidate.label for candidate in both.candidates}


def test_no_words_leave_on_a_first_look(session):
    found = look(session)
    with pytest.raises(ExportRefused, match="first look"):
        chain.export(found.gains.words, found.proof, force=True)
    with pytest.raises(ExportRefused, match="not proven yet"):
        session.export(force=True)


def test_proven_words_leave_as_the_chain_exports_them(session):
    look(session)
    proof = prove(session)
    assert session.verdict == proof.verdict == "PASS"
    assert session.export(force=False) == chain.export(proof.words, proof)


def test_failed_words_leave_only_by_force_and_say_so(session):
    session.change(ms=2.0, structure="p", setpoint_degC=60.0)  # a P controller keeps an offset: not within 1 °C
    look(session)
    prove(session)
    assert session.verdict == "FAIL"
    with pytest.raises(ExportRefused, match="steady offset"):
        session.export(force=False)
    text = "".join(v if isinstance(v, str) else v.decode("latin-1") for v in session.export(force=True).values())
    assert "FAIL - FORCED in spite of it" in text


def test_what_comes_late_is_kept_but_not_shown(session):
    first = look(session)
    ticket = session.ticket
    session.change(ms=1.4)
    late = first_look(session.fitted, session.settings)
    session.change(ms=1.8)
    assert not session.look_done((ticket[0], replace(session.settings, ms=1.4), "quick"), late)
    assert session.look is first
    assert session.verdict == "proving…"
    assert not session.proof_done(ticket, full_proof(session.fitted, first))
    assert session.proof is None
    session.change(ms=1.6)
    assert session.show_remembered()
    assert session.verdict == "PASS"


def test_settings_that_were_seen_before_are_never_beside_the_words_of_others(session):
    first = look(session)
    prove(session)
    session.change(ms=1.4)
    look(session)
    prove(session)
    assert session.verdict == "PASS"
    session.change(ms=1.6)  # proven already: its verdict is known at once, so its words are
    assert session.verdict == "PASS"
    assert session.look is session.front is first
    assert session.front_design(session.number).look is first


def test_nothing_is_done_with_a_loop_that_no_longer_belongs_to_the_settings(session):
    look(session)
    prove(session)
    session.change(ms=1.4)  # its loop is still being computed; the one before is still seen
    assert session.look is not None
    assert session.unproven() == []
    with pytest.raises(ExportRefused, match="not proven yet"):
        session.export(force=True)
    with pytest.raises(InputError, match="no design"):
        session.pin()


def test_a_late_fit_does_not_replace_a_newer_log(session, heater, step_log):
    before = session.log
    old, new = (session.begin(DroppedFile.of(name, step_log).log) for name in ("old.csv", "new.csv"))
    assert not session.fit_done(old, heater)
    assert session.log is before
    assert session.fit_done(new, heater)
    assert session.log.name == "new"


def test_designs_of_the_last_heater_are_not_shown_for_the_next(session, heater, step_log):
    look(session)
    prove(session)
    session.pin()
    ticket = session.begin(DroppedFile.of("next.csv", step_log).log)
    assert session.verdict == "PASS"  # until the next heater is known, the last one stays
    session.fit_done(ticket, heater)
    assert (session.look, session.pinned_designs, session.verdict) == (None, (), "no design")
    assert not session.show_remembered()


def test_a_refused_setting_changes_nothing_and_tells_why(session):
    look(session)
    before = session.settings
    session.change(low_degC=150.0)
    assert session.settings == before
    assert "high_degC" in session.error
    assert session.verdict == "no design"
    assert session.show_remembered()
    assert session.error == ""


def test_a_file_that_is_refused_takes_nothing_away(session, malformed):
    found = look(session)
    prove(session)
    session.refuse_file(InputError(DroppedFile.of("bad.csv", malformed).problem))
    assert session.file_error.startswith("bad.csv, line 3, column temperature_degC: no number: 'warm'; expected a number")
    assert (session.look, session.verdict) == (found, "PASS")


@pytest.mark.parametrize("name", ["../../etc/bad.csv", "C:\\logs\\bad.csv", "bad.csv"])
def test_a_dropped_file_is_known_by_its_plain_name(name, malformed, step_log):
    assert DroppedFile.of(name, malformed).problem.startswith("bad.csv, line 3")
    assert DroppedFile.of(name, step_log).log.source == "bad.csv"


@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 400, b"time_s,temperature_degC\n", b"hello"])
def test_whatever_is_dropped_is_a_log_or_an_error_of_one_line(content):
    problem = DroppedFile.of("x.csv", content).problem
    assert "\n" not in problem
    assert problem.startswith("x.csv")


def test_a_design_that_no_word_can_hold_names_the_change_that_would_fit(session):
    session.change(target="s7-200-pid", sample_time_s=1e-3)
    with pytest.raises((NotRepresentable, OutOfRange)):
        first_look(session.fitted, session.settings)


def test_a_proof_that_is_refused_is_not_tried_again(session):
    look(session)
    assert len(session.unproven()) == 1
    session.proof_refused(session.ticket, InputError("model b: cannot hold it"))
    assert session.unproven() == []
    assert session.error == "model b: cannot hold it"
    session.show_remembered()
    assert session.error == "model b: cannot hold it"


def test_four_designs_stand_side_by_side_and_a_fifth_does_not(session):
    with pytest.raises(InputError, match="no design"):
        session.pin()
    for ms in (1.3, 1.4, 1.5, 1.6):
        session.change(ms=ms)
        look(session)
        session.pin()
    with pytest.raises(InputError, match="kept already"):
        session.pin()
    assert [(each.name, each.look.settings.ms) for each in session.pinned_designs] == [("A", 1.3), ("B", 1.4), ("C", 1.5), ("D", 1.6)]
    assert {each.verdict for each in session.pinned_designs} == {"proving…"}
    assert len(session.unproven()) == MOST_PINNED
    session.change(ms=1.7)
    look(session)
    with pytest.raises(InputError, match="let one go"):
        session.pin()
    session.unpin("B")
    session.pin()
    assert [(each.name, each.look.settings.ms) for each in session.pinned_designs] == [("A", 1.3), ("C", 1.5), ("D", 1.6), ("B", 1.7)]


def test_the_newest_design_is_proven_before_those_set_aside(session):
    look(session)
    session.pin()
    session.change(ms=1.3)
    newest = look(session)
    assert session.unproven()[0][1] is newest


@pytest.mark.long
def test_a_searched_optimum_is_what_the_command_line_takes_and_serves_all_settings_of_the_proof(session):
    look(session)
    session.take()
    session.take_design(session.key, find_design(session.fitted, session.settings))
    found = look(session)
    assert session.proof is found.gains.proof, "as it was found"
    wished = chain.tune(session.fitted, target="s5-ob251", structure="pi", ms=1.6, sample_time_s=None)
    assert (found.gains.design.gain_pct_per_degC, found.gains.design.integral_time_s) == (
        wished.gain_pct_per_degC, wished.integral_time_s)
    session.change(noise_degC=0.1)
    assert session.gains().words == found.gains.words
    session.change(ms=1.5)
    assert session.gains() is None


def test_more_noise_and_a_longer_pwm_period_are_seen_in_the_loop(session):
    quiet = look(session)
    session.change(noise_degC=0.5)
    noisy = look(session)
    assert max(abs(noisy.proof.nominal.reading_degC - quiet.proof.nominal.reading_degC)) > 0.5
    session.change(noise_degC=0.0, pwm_period_s=40.0)
    ripple = {c.name: c.value for c in look(session).proof.criteria}["pwm_ripple"]
    assert ripple > {c.name: c.value for c in quiet.proof.criteria}["pwm_ripple"]


def test_a_folder_of_a_design_is_opened_with_its_heater_and_settings(tmp_path):
    write_all(tmp_path)
    found = Session()
    found.load(read_source(str(tmp_path)))
    log = own_log()
    assert (found.log.name, found.log.time_s.tolist()) == ("own log", log.time_s.tolist())
    assert (found.settings.target, found.settings.structure) == ("s5-ob251", "pi")
    assert found.fitted.model == HEATER
    words = json.loads((tmp_path / "words.json").read_text())
    del words["target"]
    (tmp_path / "words.json").write_text(json.dumps(words))
    with pytest.raises(InputError, match=r"words.json: target: is missing"):
        read_source(str(tmp_path))


def _written(folder, design, recipe, drawn=None):
    """Write the documents of a design into a folder, as `heatertune design` does; return their proof."""
    fitted = model_by_hand(HEATER)
    words = repeat_words(design, fitted, recipe).words
    proof = with_samples(chain.prove(words, fitted, recipe.conditions), fitted, drawn or SampleSettings(), recipe.conditions)
    documents = dossier(own_log(), fitted, design, proof, chain.export(words, proof, force=True), None, recipe)
    write_files(folder, {f"{name}.json": to_json(document) for name, document in documents.items()})
    return proof


@pytest.mark.long
def test_a_folder_whose_verdict_its_runs_alone_do_not_make_is_not_shown_with_another_verdict(tmp_path):
    recipe = DesignProvenance(target="s5-ob251", conditions=Conditions(setpoint_degC=45.0))
    proof = _written(tmp_path, DESIGN, recipe, SampleSettings(samples=2))
    assert replace(proof, samples=None).verdict != proof.verdict, "two samples show nothing"
    source = read_source(str(tmp_path))
    assert source.outcome is None
    assert f"its {proof.verdict} is of other words or runs than its pid.json makes" in source.as_left


@pytest.mark.long
def test_a_folder_is_opened_with_its_very_design_and_what_moving_a_setting_would_leave_out_is_told(tmp_path):
    # once another design for the page's own setpoint, TA, range and limits was in front, and nothing said so
    asked = Conditions(setpoint_degC=45.0, limit=("overshoot=24%",), tolerance_degC=2.0, noise_degC=0.1, spec="paper",
                       switches={"sum": "limited"}, accept=("winds-up",), pwm_period_s=4.0, minimum_on_s=0.5)
    design = replace(DESIGN, method="optimum (Ms <= 1.5 on 2 models)")
    recipe = DesignProvenance(target="s5-ob251", range_degC=(0.0, 150.0), conditions=asked, way_on="would pass at --tolerance 3")
    proof = _written(tmp_path, design, recipe)
    found = Session()
    found.load(read_source(str(tmp_path)))
    assert found.settings == StudioSettings(
        target="s5-ob251", structure="pi", ms=1.5, sample_time_s=design.sample_time_s, pwm_period_s=4.0, setpoint_degC=45.0,
        low_degC=0.0, high_degC=150.0, noise_degC=0.1, tolerance_degC=2.0, limits=("overshoot=24%",),
        assumptions=(("sum", "limited"),), spec="paper")
    assert found.file_error.endswith("has no place for --minimum-on, --accept; moving a setting leaves that out")
    seen = look(found)
    assert (seen.gains.design, seen.gains.words, seen.conditions) == (design, proof.words, asked)
    assert found.proof.to_document() == proof.to_document()
    assert found.suggestion.message == f"This is the design of {tmp_path}: would pass at a tolerance of 3 °C."
    found.change(noise_degC=0.2)
    assert found.gains() is None, "quick ones for other settings"


@pytest.mark.parametrize("typed", [None, 7.0])
def test_the_interval_of_a_folder_belongs_to_its_controller_and_a_typed_one_to_all(tmp_path, typed):
    _written(tmp_path, DESIGN, DesignProvenance(target="s5-ob251", conditions=Conditions(setpoint_degC=45.0)))
    found = Session()
    found.load(read_source(str(tmp_path)))
    if typed is not None:
        found.change(sample_time_s=typed)
    shown = []
    for target in ("klipper", "weg", "s5-ob251"):
        found.change(target=target)
        shown.append(found.settings.sample_time_s)
    assert shown == [typed, typed, typed or DESIGN.sample_time_s]


def test_a_range_of_setpoints_has_no_place_on_the_page_and_that_is_told(tmp_path):
    _written(tmp_path, DESIGN, DesignProvenance(target="s5-ob251", conditions=Conditions(setpoint_degC=(40.0, 50.0))))
    source = read_source(str(tmp_path))
    assert source.settings.setpoint_degC is None
    assert source.as_left.endswith("has no place for --setpoint; moving a setting leaves that out")


def test_a_built_in_table_is_read_with_its_misprints_corrected():
    assert read_source("table4").log.temperature_degC.tolist() == chain.read_log("table4", errata=True).temperature_degC.tolist()
    assert math.isfinite(read_source("table4").settings.ms)


@pytest.mark.parametrize(("tag", "expected"), [("heater_bed", {"klipper": "heater_bed", "marlin": "bed"}), (
    "extruder", {"klipper": "extruder", "marlin": "hotend"})])
def test_the_heater_of_a_printers_log_is_that_of_its_files_for_each_controller_that_is_chosen(heater, tmp_path, tag, expected):
    path = tmp_path / "klippy.log"
    path.write_text("".join(f"Stats {1000 + k}.0: heater_bed: target=60 temp={30 + k / 10:.1f} pwm=0.500 "
                            f"extruder: target=200 temp={40 + k / 2:.1f} pwm=0.700\n" for k in range(120)))
    session = Session()
    session.fit_done(session.begin(read_log(path, ReadSettings(tag=tag))), heater)
    for target in ("klipper", "marlin"):
        session.change(target=target)
        assert dict(session.settings.conditions.switches) == {"heater": expected[target]}
    session.change(target="weg")
    assert dict(session.settings.conditions.switches) == {}

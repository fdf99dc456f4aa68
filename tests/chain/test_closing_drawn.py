"""The design closed on drawn heaters, too: what it says is what samples that it never saw say."""

import json
import re
from dataclasses import replace

import pytest
from tests.conftest import heater_log

from heatertune.chain import export, prove
from heatertune.cli import main
from heatertune.codec import decode
from heatertune.errors import ExportRefused, InputError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_document import PidView, to_document
from heatertune.proof.design_request import DesignRequest
from heatertune.proof.monte_carlo.run import run_samples, with_samples
from heatertune.proof.proof_document import check_document
from heatertune.proof.redesign import closed_on_runs, on_samples
from heatertune.proof.redesign.on_samples import closed_on_samples
from heatertune.proof.repetition import repeat_words
from heatertune.proof.verdict import verdict_line
from heatertune.settings import Conditions, SampleSettings

#: on too many days the optimum at Ms 1.6 breaks a limit, where the block stops its sum at no limit
HEATER = model_by_hand(Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=15.0, ambient_degC=22.0))
DRAWN = SampleSettings(samples=100)
ASKED = DesignRequest(target="weg", sample_settings=DRAWN)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def plain():
    """The design that no samples have seen."""
    return closed_on_runs(HEATER, ASKED)


@pytest.fixture(scope="module")
def found():
    """The design that was made for those of them that the plain one fails on, too."""
    return closed_on_samples(HEATER, ASKED)


@pytest.fixture
def heard(monkeypatch):
    """Let samples say what a test makes them say; return the seeds of the first of all that were asked for."""
    def let(says):
        asked = []

        def instead(proof, fitted, drawn, conditions):
            asked.append(drawn.seed)
            true = with_samples(proof, fitted, replace(drawn, samples=10), conditions).samples
            kept = says(true.settings, len(asked))
            settings = tuple(replace(setting, passing_count=number) for setting, number in zip(true.settings, kept, strict=True))
            broken = () if min(kept) == 100 else tuple(range(3 * len(asked)))
            return replace(proof, samples=replace(
                true, count=100, settings=settings, passing=min(kept) / 100, broken=broken))

        monkeypatch.setattr(on_samples, "with_samples", instead)
        return asked

    return let


def test_a_design_that_too_few_drawn_heaters_bear_is_made_for_them_too_and_judged_by_others(plain, found):
    before = with_samples(plain.proof, HEATER, DRAWN, plain.conditions)
    assert plain.proof.verdict == "PASS"
    assert before.verdict == before.samples.verdict == "NOT PROVEN"
    with pytest.raises(ExportRefused, match=r"of 100 samples keep every limit.*too few"):
        export(before.words, before)

    assert found.proof.verdict == "PASS"
    # the two that the plain one fails on, and what a design for these fails on, the worst three of each round
    (more,) = re.findall(r"designed for (\d) of the drawn heaters as well$", found.proof.diagnostics.remarks[0])
    assert len(before.samples.broken) == 2
    assert more in {"2", "5", "8"}
    assert all(part in found.notes[0] for part in ("of 100 samples keep", "of as many new ones", "IAE"))
    others = SampleSettings(samples=100, seed=100)
    assert found.proof.samples == run_samples(found.proof.words, HEATER, others, found.conditions)
    assert {run.model for run in found.proof.runs} == {run.model for run in plain.proof.runs}, "proven on the possible ones"
    document = check_document(found.proof.to_document(), "proof.json")
    assert "of 100 samples keep every limit" in verdict_line(document)
    files = export(found.proof.words, found.proof)
    assert any("samples keep every limit" in content for content in files.values() if isinstance(content, str))
    # two thousand heaters that neither search nor verdict has seen
    assert run_samples(found.proof.words, HEATER, SampleSettings(samples=2000, seed=10_000), found.conditions).passing >= 0.95


def test_the_design_that_is_written_makes_the_same_words_again(found):
    view = decode(PidView, json.loads(json.dumps(to_document(found.ideal, HEATER, found.recipe))), "pid.json")
    again = repeat_words(view.value, view.model.value, view.made_for)
    assert again.words == found.proof.words == found.choice.words
    assert view.made_for.conditions.setpoint_degC is None, "as it was asked for"
    assert prove(again.words, HEATER, view.made_for.conditions).verdict == "PASS"


def test_what_suits_the_samples_it_was_looked_for_on_and_no_others_does_not_pass(heard):
    asked = heard(lambda settings, times: [100 if times == 2 else 80] * len(settings))
    assert closed_on_samples(HEATER, ASKED).proof.verdict == "FAIL"
    assert asked == [0, 0, 100], "nothing is chosen by the samples that judge"


def test_where_nothing_helps_the_design_is_as_asked_for_and_says_so(heard, plain):
    asked = heard(lambda settings, _: [80] * len(settings))
    found = closed_on_samples(HEATER, ASKED)
    assert found.proof.words == plain.proof.words
    assert found.proof.diagnostics.remarks[0] == "nothing that was tried makes the samples pass"
    assert asked == [0] * len(asked)
    assert (found.proof.verdict, found.passes_with) == ("FAIL", ())


def test_a_setting_that_is_what_the_samples_fail_for_is_named_with_what_would_pass(heard):
    heard(lambda settings, _: [80 if setting.switches["anti_windup"] == "none" else 100 for setting in settings])
    found = closed_on_samples(HEATER, ASKED)
    assert found.proof.verdict == "FAIL"
    assert found.passes_with == ("--assume", "anti_windup=clamp")
    assert found.proof.diagnostics.remarks[0] == "would pass with --assume anti_windup=clamp: find out what this controller does"


@pytest.mark.parametrize("changed", [
    {"as_is": True},
    # the mains' 10 % take what power 44 °C leaves over on too many days
    {"conditions": Conditions(setpoint_degC=44.0)},
    {"sample_settings": SampleSettings(samples=20)},  # which show nothing, whatever passes
])
def test_a_plain_design_that_was_asked_for_and_what_no_design_passes_are_left_as_they_are(changed):
    heater = replace(HEATER.model, gain_degC_per_pct=0.26)
    fitted = model_by_hand(heater) if "conditions" in changed else HEATER
    found = closed_on_samples(fitted, replace(ASKED, **changed))
    assert found.proof.samples.verdict != "PASS"
    assert not any("samples" in remark for remark in found.proof.diagnostics.remarks)
    assert found.proof.words == closed_on_runs(fitted, replace(ASKED, **changed)).proof.words


def test_samples_behind_an_interlock_are_refused_before_anything_is_read(plain, tmp_path, capsys):
    with pytest.raises(InputError, match="samples are run without an interlock"):
        DesignRequest(target="weg", sample_settings=DRAWN, conditions=Conditions(interlock="heater-fan"))
    with pytest.raises(InputError, match="samples: none are asked for"):
        run_samples(plain.proof.words, HEATER, SampleSettings())
    words = ("design", str(tmp_path / "none.csv"), "--target", "weg", "--samples", "9", "--interlock", "heater-fan")
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "samples are run without an interlock" in capsys.readouterr().err


def test_the_command_exports_what_samples_passed_and_every_page_says_so(tmp_path, capsys):
    (tmp_path / "zone.csv").write_text(heater_log(0.5, 1))
    asked = ["design", str(tmp_path / "zone.csv"), "--target", "weg", "--samples", "100", "--out", str(tmp_path / "out"), "--verbose"]
    assert main(asked) == 0
    told = "100 of 100 samples keep every limit under every setting"  # a dead time that may be two rows longer makes it calm
    assert told in capsys.readouterr().out
    assert told in (tmp_path / "out" / "weg_pid_call.st").read_text(encoding="utf-8")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<h3>Samples</h3>" in page
    assert told in page.split("<h3>Samples</h3>")[0], "the record, too"
    proof = json.loads((tmp_path / "out" / "data" / "proof.json").read_text(encoding="utf-8"))
    assert check_document(proof, "proof.json")["samples"]["verdict"] == proof["verdict"] == "PASS"

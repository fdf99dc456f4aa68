"""The design closed on drawn heaters, too: what it says is what samples that it never saw say."""

from dataclasses import replace

import pytest

from heatertune.chain import export
from heatertune.cli import main
from heatertune.errors import ExportRefused, InputError
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import Fopdt
from heatertune.proof import closing_drawn
from heatertune.proof.asked import Asked
from heatertune.proof.closing import closed_on_runs
from heatertune.proof.closing_drawn import closed_on_samples
from heatertune.proof.document import checked
from heatertune.proof.drawn import sampled, with_samples
from heatertune.proof.verdict import verdict_line
from heatertune.settings import Conditions, SampleSettings

#: on too many days the optimum at Ms 1.6 breaks a limit, where the block stops its sum at no limit
HEATER = model_by_hand(Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=15.0, ambient_degC=22.0))
DRAWN = SampleSettings(samples=100)
ASKED = Asked(target="weg", drawn=DRAWN)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def plain():
    """The design that no samples have seen."""
    return closed_on_runs(HEATER, ASKED)


@pytest.fixture
def heard(monkeypatch):
    """Let samples say what a test makes them say; return what was asked of them."""
    def let(says):
        asked = []

        def instead(proof, fitted, drawn, conditions):
            (ms,) = (criterion.value for criterion in proof.criteria if criterion.name == "ms")
            asked.append((round(ms, 1), drawn.seed))
            true = with_samples(proof, fitted, replace(drawn, samples=10), conditions).samples
            kept = says(true.settings, drawn.seed, ms)
            settings = tuple(replace(setting, kept=number) for setting, number in zip(true.settings, kept, strict=True))
            return replace(proof, samples=replace(true, count=100, settings=settings, passing=min(kept) / 100))

        monkeypatch.setattr(closing_drawn, "with_samples", instead)
        return asked

    return let


def test_a_design_that_too_few_drawn_heaters_bear_is_made_calmer_and_judged_by_others(plain):
    before = with_samples(plain.proof, HEATER, DRAWN, plain.conditions)
    assert plain.proof.verdict == "PASS"
    assert before.verdict == before.samples.verdict == "NOT PROVEN"
    with pytest.raises(ExportRefused, match=r"of 100 samples keep every limit.*too few"):
        export(before.words, before)

    found = closed_on_samples(HEATER, ASKED)
    assert found.proof.verdict == "PASS"
    assert found.wished.margins.ms <= 1.4 < plain.wished.margins.ms
    assert found.proof.heard.remarks[-1] == "with Ms <= 1.4 for the samples"
    assert all(part in found.notes[0] for part in ("of 100 samples keep", "of as many others", "more IAE"))
    others = SampleSettings(samples=100, seed=100)
    assert found.proof.samples == sampled(found.proof.words, HEATER, others, found.conditions)
    document = checked(found.proof.to_document(), "proof.json")
    assert "100 of 100 samples keep every limit" in verdict_line(document)
    assert any("samples" in content for content in export(found.proof.words, found.proof).values() if isinstance(content, str))
    # a witness of its own: two thousand heaters that neither search nor verdict has seen
    assert sampled(found.proof.words, HEATER, SampleSettings(samples=2000, seed=10_000), found.conditions).passing >= 0.95


def test_what_suits_the_samples_it_was_looked_for_on_and_no_others_does_not_pass(heard):
    asked = heard(lambda settings, seed, ms: [100 if ms < 1.5 and seed == 0 else 80] * len(settings))
    found = closed_on_samples(HEATER, ASKED)
    assert found.proof.verdict == "FAIL"
    assert asked == [(1.6, 0), (1.4, 0), (1.4, 100)], "nothing is chosen by the samples that judge"


def test_where_no_lower_ms_helps_the_design_is_as_asked_for_and_says_so(heard, plain):
    asked = heard(lambda settings, _, __: [80] * len(settings))
    found = closed_on_samples(HEATER, ASKED)
    assert found.proof.words == plain.proof.words
    assert found.proof.heard.remarks[-1] == "no lower Ms down to 1.25 helps the samples"
    assert [seed for _, seed in asked] == [0, 0, 0]
    assert (found.proof.verdict, found.passes_with) == ("FAIL", ())


def test_a_setting_that_is_what_the_samples_fail_for_is_named_with_what_would_pass(heard):
    heard(lambda settings, _, __: [80 if setting.switches["anti_windup"] == "none" else 100 for setting in settings])
    found = closed_on_samples(HEATER, ASKED)
    assert found.proof.verdict == "FAIL"
    assert found.passes_with == ("--switch", "anti_windup=clamp")
    assert found.proof.heard.remarks[-1] == "would pass with --switch anti_windup=clamp: find out what this controller does"


@pytest.mark.parametrize("changed", [
    {"as_is": True},
    # the mains' 10 % take what power 44 °C leaves over on too many days
    {"conditions": Conditions(setpoint_degC=44.0)},
])
def test_a_plain_design_that_was_asked_for_and_one_without_power_are_left_as_they_are(heard, changed):
    heater = replace(HEATER.model, gain_degC_per_pct=0.26)
    fitted = HEATER if "as_is" in changed else model_by_hand(heater)
    found = closed_on_samples(fitted, replace(ASKED, **changed))
    assert found.proof.samples.verdict == "FAIL"
    assert not any("samples" in remark for remark in found.proof.heard.remarks)
    assert found.proof.words == closed_on_runs(fitted, replace(ASKED, **changed)).proof.words


def test_samples_behind_an_interlock_are_refused_before_anything_is_read(tmp_path, capsys):
    with pytest.raises(InputError, match="samples are run without an interlock"):
        Asked(target="weg", drawn=DRAWN, conditions=Conditions(interlock="heater-fan"))
    words = ("design", str(tmp_path / "none.csv"), "--target", "weg", "--samples", "9", "--interlock", "heater-fan")
    assert main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "samples are run without an interlock" in capsys.readouterr().err

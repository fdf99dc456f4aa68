"""`pid.json` holds what the words were proven with and under: other commands take it, and options take its place."""

import json
from argparse import Namespace

import pytest

from heatertune.cli.saved_design import in_force
from heatertune.errors import InputError
from heatertune.pid.design_document import DesignProvenance
from heatertune.proof import comparison
from heatertune.proof.repetition import scaling_of
from heatertune.settings import Conditions

#: a long dead time and an optimum with little robustness: in the paper's story it overshoots, and a ramp mends that
HASTY = ("--gain", 0.9, "--time-constant", 120, "--dead-time", 18, "--ambient", 28, "--sample-time", 4, "--ms", 2)
STORY = ("--setpoint", 40, "--spec", "paper", "--limit", "ms=2.2", "--limit", "overshoot=10%")


@pytest.fixture
def led(run, tmp_path):
    """A design whose words pass with a setpoint ramp alone."""
    path = tmp_path / "pid.json"
    assert run("tune", *HASTY, "--target", "s7-300", *STORY, "--quiet", "-o", path)[0] == 0
    document = json.loads(path.read_text())
    assert document["made_for"]["setpoint_ramp"]["step"] > 0
    return path


def _old(path):
    """Return the file as it was written before it held more than the design."""
    document = json.loads(path.read_text())
    del document["made_for"]
    old = path.with_name("old.json")
    old.write_text(json.dumps(document))
    return old


@pytest.mark.long
def test_a_design_is_proven_and_exported_as_it_passed_and_an_old_file_is_still_read(run, led, tmp_path):
    ramp = json.loads(led.read_text())["made_for"]["setpoint_ramp"]
    status, out, _ = run("verify", led, "--target", "s7-300", "--quiet", "--verbose")
    assert status == 0
    assert f"As {led} has it: --setpoint 40, --spec paper, --limit ms=2.2, --limit overshoot=10%, a setpoint ramp" in out
    assert run("export-db", led, "--target", "s7-300", "-o", tmp_path / "out", "--quiet")[0] == 0
    words, proof = (json.loads((tmp_path / "out" / "data" / f"{name}.json").read_text()) for name in ("words", "proof"))
    assert words["setpoint_ramp"] == ramp
    assert (proof["verdict"], proof["specification"]["name"]) == ("PASS", "paper")
    status, out, _ = run("verify", _old(led), "--target", "s7-300", *STORY, "--quiet")
    assert status == 1
    assert "has it" not in out


@pytest.mark.long
def test_what_a_design_that_fails_found_is_its_way_on_as_long_as_nothing_else_is_asked(run, tmp_path):
    # once `verify` sent its user back to the very `tune` that had found nothing
    heater, path = ("--gain", 0.5, "--time-constant", 120, "--dead-time", 10, "--ambient", 20), tmp_path / "pid.json"
    assert run("tune", *heater, "--target", "on-off", "--tolerance", 0.01, "--quiet", "-o", path)[0] == 1
    found = json.loads(path.read_text())["made_for"]["way_on"]
    assert "bursts" not in found, "none are tried for a control without gains"
    said = " ".join(run("verify", path, "--target", "on-off", "--quiet")[1].split())
    assert f"remedy: found during the design: {found}" in said
    for asked in (("--tolerance", 0.02), ("--gain", 0.6, "--time-constant", 120, "--dead-time", 10, "--ambient", 20)):
        other = " ".join(run("verify", path, "--target", "on-off", "--quiet", *asked)[1].split())
        assert "remedy: heatertune design or tune with this --target searches for the smallest change" in other


@pytest.mark.long
def test_an_option_takes_the_place_of_what_the_file_says_and_that_is_told(run, led):
    status, out, _ = run("verify", led, "--target", "s7-300", "--quiet", "--setpoint-ramp", "none", "--setpoint", 38,
                         "--limit", "overshoot=50%", "--verbose")
    assert status == 0
    assert f"As {led} has it: --spec paper, --limit ms=2.2." in out
    assert f"Not as {led} has it, for an option says otherwise: --setpoint 40, --limit overshoot=10%, a setpoint" in out
    _, out, _ = run("verify", led, "--target", "s7-300", "--quiet", "--spec", "general", "--noise", 0.01, "--verbose")
    assert f"As {led} has it: --setpoint 40, a setpoint ramp" in out  # the limits were part of the specification


def test_another_controller_gets_the_conditions_and_not_what_belongs_to_the_words(run, led):
    _, out, _ = run("verify", led, "--target", "fb41", "--quiet", "--setpoint-ramp", "none")
    assert "not taken, as it is of s7-300: a setpoint ramp" in " ".join(out.split())
    assert "specification paper" in out
    assert "at 40 °C" in out


def test_the_range_of_a_module_in_degrees_is_that_modules_alone():
    said = DesignProvenance(target="s7-300", input="thermocouple", range_degC=(0.0, 2764.8), conditions=Conditions(setpoint_degC=60.0))

    def taken(target, **sensor):
        return in_force(Namespace(target=target, as_printed=False, **sensor), said, "pid.json")

    recipe, notes = taken("s7-300")
    assert (scaling_of(recipe).high_degC, recipe.input) == (2764.8, "thermocouple")
    assert notes == ["As pid.json has it: --input thermocouple, --setpoint 60."]
    assert scaling_of(taken("s7-200-pid")[0]).high_degC == 3200.0
    assert scaling_of(taken("s7-300", input="4-20mA")[0]).sensor_degC == (0.0, 100.0)
    with pytest.raises(InputError, match=r"pid\.json is for --input thermocouple of s7-300, which s5-ob251 has not: say a --range"):
        taken("s5-ob251")
    assert taken("s5-ob251", range=[0.0, 300.0])[0].range_degC == (0.0, 300.0)


@pytest.mark.long
def test_a_comparison_and_an_advice_prove_what_passed(run, led, monkeypatch):
    monkeypatch.setattr(comparison, "TARGETS", ["s7-300", "fb41"])  # all of them: tests/report/test_targets.py
    _, out, told = run("compare", led, "--json")
    rows = {row["target"]: row for row in json.loads(out)["rows"]}
    assert rows["s7-300"]["verdict"] == "PASS"
    assert "overshoot" in rows["fb41"]["fails"]  # the same gains, without the ramp
    assert "a setpoint ramp of" in told
    _, out, told = run("advise", "proof", "--pid", led, "--target", "s7-300", "--json")
    assert json.loads(out)["cases"][0]["verdict"] == "PASS"
    assert "a setpoint ramp of" in told


def test_a_specification_that_has_changed_since_is_refused_until_it_is_given_again(run, tmp_path):
    spec = tmp_path / "spec.toml"
    spec.write_text('preset = "paper"\n[limits]\novershoot = "20 %"\n')
    path = tmp_path / "own.json"
    asked = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22, "--setpoint", 40)
    assert run("tune", *asked, "--target", "s7-300", "--spec", spec, "--ms", 1.4, "--quiet", "-o", path)[0] == 0
    assert run("verify", path, "--target", "s7-300", "--quiet")[0] == 0
    spec.write_text('preset = "paper"\n[limits]\novershoot = "30 %"\n')
    status, _, said = run("verify", path, "--target", "s7-300", "--quiet")
    assert status == 2
    assert f"{spec}, under which it was made, has changed since: say --spec" in said
    assert run("verify", path, "--target", "s7-300", "--quiet", "--spec", spec)[0] == 0


@pytest.mark.parametrize(("field", "value", "said"), [
    ("words_by", "luck", "optimum"), ("power_most_pct", 0.0, "power_most_pct"), ("range_degC", [0.0], "range_degC"),
    ("setpoint_ramp", {"step": "x"}, "setpoint_ramp"), ("more", 1, "no such field"),
])
def test_what_a_recipe_cannot_be_is_refused_with_its_field(run, by_hand, field, value, said):
    document = json.loads(by_hand.read_text())
    document["made_for"] = {"target": "s7-300", "conditions": {}, field: value}
    by_hand.write_text(json.dumps(document))
    status, _, error = run("verify", by_hand, "--target", "s7-300", "--quiet")
    assert status == 2
    assert "made_for" in error
    assert said in error


def test_a_design_differs_from_what_is_exported_of_it_by_no_ramp(run, led, tmp_path):
    run("export-db", led, "--target", "s7-300", "-o", tmp_path / "out", "--quiet")
    _, out, _ = run("diff", tmp_path / "out", led)
    assert "as before" in next(line for line in out.splitlines() if line.startswith("setpoint ramp"))

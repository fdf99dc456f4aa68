"""A heater with a cooler on the command line: `--cooling-gain` takes the controller that has an output for it."""

import json

import pytest

HAND = ("--gain", 0.37, "--time-constant", 167, "--dead-time", 12, "--ambient", 22)


@pytest.mark.long
def test_a_design_goes_to_words_that_cool_and_back_again(run, by_hand, tmp_path):
    out = tmp_path / "out"
    cooling = ("--target", "pid-temp", "--cooling-gain", 0.5, "--setpoint", 40)
    assert run("export-db", by_hand, *cooling, "--cooling-minimum-on", 0.3, "-o", out)[0] == 0
    words = json.loads((out / "data" / "words.json").read_text())
    assert (words["target"], words["words"]["CoolFactor"]) == ("pid-temp-cooling", 2.0)
    proof = json.loads((out / "data" / "proof.json").read_text())
    assert (proof["actuator"]["cooling_gain"], proof["actuator"]["cooling_minimum_on_s"]) == (0.5, 0.3)
    # the design alone makes the same words again, and so does what goes into the PLC
    status, told, _ = run("verify", out / "data" / "words.json", "--target", "pid-temp", "--cooling-gain", 0.4, "--setpoint", 40, *HAND)
    assert status == 0
    assert "the power of the cooler was entered as 0.4" in " ".join(told.split())
    status, told, _ = run("decode", out / "pid_temp_words.scl", "--target", "pid-temp-cooling", "--json=full")
    assert status == 0
    assert json.loads(told)["words"] == words["words"]


@pytest.mark.parametrize(("given", "said"), [
    (("--target", "s7-300", "--cooling-gain", 0.5), "s7-300 has no second output for a cooler; pid-temp-cooling has one"),
    (("--target", "pid-temp", "--cooling-gain", 0), "--cooling-gain = 0"),
    (("--target", "pid-temp", "--cooling-minimum-on", 0.3), "--cooling-minimum-on and --cooling-minimum-off need --cooling-gain")])
def test_a_cooler_that_cannot_be_is_told_in_one_line(run, by_hand, given, said):
    status, _, err = run("verify", by_hand, *given, "--setpoint", 40)
    assert status == 2
    assert said in err
    assert "Traceback" not in err

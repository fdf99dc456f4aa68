"""A heater with a cooler on the command line: `--cooling-gain` takes the controller that has an output for it."""

import json
import re

import pytest
from tests.bench.tool_exports import COOLING_GAIN, exports

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


@pytest.fixture
def two_way_log(tmp_path):
    """A log of a heater of 0.6 °C/%, 150 s, whose cooler is 0.6 times as strong."""
    export = next(exports("PID_Temp", "clean"))
    path = tmp_path / export.name
    path.write_bytes(export.content)
    return path


@pytest.mark.long(20)
def test_a_cooler_is_proven_as_its_log_shows_it(run, two_way_log, tmp_path):
    common = ("design", two_way_log, "--target", "pid-temp", "--setpoint", 40, "--quiet")
    status, told, err = run(*common, "--cooling-gain", 0.3, "-o", tmp_path / "weak")
    assert status == 1
    assert "NOT PROVEN" in told
    assert "--accept cooling-gain" in " ".join(told.split())
    asked = next(finding["message"] for finding in json.loads((tmp_path / "weak" / "data" / "proof.json").read_text())["findings"]
                 if finding["name"] == "cooling-gain")
    remedy = re.search(r"--cooling-gain ([\d.]+)", asked)  # the value that the message names
    assert abs(float(remedy[1]) - COOLING_GAIN) < 0.02
    assert run(*common, *remedy[0].split(), "-o", tmp_path / "right")[0] == 0, err
    model = json.loads((tmp_path / "right" / "data" / "model.json").read_text())
    low, high = model["cooling"]["cooling_gain_ci95"]
    assert low <= COOLING_GAIN <= high
    assert json.loads((tmp_path / "right" / "data" / "log.json").read_text())["cooling_pct"][-1] == 0.0
    # without its cooler the heater is proven as well, and the verdict names what was left off
    status, told, _ = run(*common, "-o", tmp_path / "alone")
    assert status == 0
    assert "the log has a cooler" in " ".join(told.split())


def test_what_knows_no_cooler_refuses_its_log_with_another_way(run, two_way_log, tmp_path):
    model = tmp_path / "model.json"
    assert run("fit", two_way_log, "-o", model)[0] == 0
    assert run("validate", model, two_way_log)[0] == 0
    alone = json.loads(model.read_text())
    del alone["cooling"]
    model.write_text(json.dumps(alone), encoding="utf-8")
    status, _, err = run("validate", model, two_way_log)
    assert (status, "the power of a cooler, which this model does not know" in err) == (2, True)
    assert run("validate", model, two_way_log, "--until", 698)[0] in (0, 1)  # as the message says
    assert run("fit", two_way_log, "--until", 698)[0] == 0  # no cooler is left to be fitted
    copy = two_way_log.with_name("other.csv")
    copy.write_bytes(two_way_log.read_bytes())
    assert run("fit", two_way_log, copy)[0] == 0  # of one heater and cooler
